//! One agent in a process of its own, on the bus over Zenoh.

use crate::flightgear::{self, Viewer};
use crate::interrupts::Interrupts;
use crate::links::{self, Links};
use crate::mission_files::MissionOptions;
use crate::released::{self, Released};
use crate::resume::resume;
use crate::weather_file::WeatherFile;
use crate::{Failure, host_keys, listening, metrics, preflight, presence, runtime, tls};
use mav_bridge::link::LinkAddress;
use mav_bridge::signing::SigningConfig;
use mission::real_vehicle::{LinkOptions, RealVehicle};
use mission::setup::SigningKey;
use mission::{Member, MissionError, Setup, team};
use net::realtime::{MissionClock, Surroundings};
use net::{DEFAULT_ENDPOINT, Net, NetError, NetOptions, OneRun, TlsFiles, lockstep, realtime};
use protocol::joining::{Introduction, MissionIdentity};
use protocol::key::Name;
use protocol::message::Swap;
use protocol::{Agent as _, SimTime};
use scenario::tables::VehicleKind;
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc;
use std::time::{Duration, SystemTime, UNIX_EPOCH};
use tasks::mission_key;

/// How a process joins the bus of a mission.
#[derive(Debug, Clone, clap::Args)]
#[command(next_help_heading = "Bus")]
pub struct BusArguments {
    /// Scenario of the mission (TOML); all processes of a mission need the same one
    #[arg(long, value_name = "FILE", help_heading = "Mission")]
    pub scenario: PathBuf,
    /// Seed, length and gas; all processes of a mission need the same ones
    #[command(flatten)]
    pub mission: MissionOptions,
    /// Run in lockstep under `plumage conduct`, not in real time
    #[arg(long)]
    pub lockstep: bool,
    /// Listen on this endpoint, such as tcp/192.0.2.1:7447; repeatable [default for sc: tcp/127.0.0.1:7447]
    #[arg(long, value_name = "ENDPOINT")]
    pub listen: Vec<String>,
    /// Connect to this endpoint, such as tcp/192.0.2.1:7447; repeatable [default for all but sc: tcp/127.0.0.1:7447]
    #[arg(long, value_name = "ENDPOINT")]
    pub connect: Vec<String>,
    /// Publish messages as JSON, not bincode
    #[arg(long)]
    pub json: bool,
    /// Folder of this host from `plumage keys new`: TLS certificates, access rules and the mission key
    #[arg(long, value_name = "DIR", conflicts_with_all = ["tls_ca", "mission_key"])]
    pub keys: Option<PathBuf>,
    /// File with the mission key: 64 hexadecimal digits, readable only by its owner. Every holder of the key can
    /// command the team [default: PLUMAGE_MISSION_KEY, else on a single host a file that the first process creates]
    #[arg(long, value_name = "FILE")]
    pub mission_key: Option<PathBuf>,
    /// Certificate of the authority that signs the certificates of all TLS endpoints (PEM)
    #[arg(long, value_name = "FILE")]
    pub tls_ca: Option<String>,
    /// Certificate of this process, for the TLS endpoints that it listens on (PEM)
    #[arg(long, value_name = "FILE", requires = "tls_ca")]
    pub tls_certificate: Option<String>,
    /// Private key of this process, for the TLS endpoints that it listens on (PEM)
    #[arg(long, value_name = "FILE", requires = "tls_ca")]
    pub tls_key: Option<String>,
    /// User name to connect with; its password is read from the environment variable PLUMAGE_PASSWORD
    #[arg(long, value_name = "NAME")]
    pub user: Option<String>,
    /// Accept connections only from the users in this file, with one user:password per line
    #[arg(long, value_name = "FILE")]
    pub password_file: Option<String>,
    /// Serve metrics for Prometheus at this address, such as 127.0.0.1:9100
    #[arg(long, value_name = "ADDR", help_heading = "Integrations")]
    pub metrics: Option<String>,
}

impl BusArguments {
    /// The mission, with what the arguments change of it; the first thing that a process does, as
    /// with TLS it is started again ([`tls::in_one_thread`]).
    ///
    /// # Errors
    /// Wrong input, with what was expected.
    pub fn setup(&self) -> Result<Setup, Failure> {
        if self.tls_ca.is_some() || self.keys.is_some() {
            tls::in_one_thread()?;
        }
        self.mission.setup(&self.scenario)
    }

    /// Options to join the bus; `listens`: without endpoints the process listens at the default one.
    ///
    /// # Errors
    /// A user without a password.
    pub fn net_options(&self, listens: bool) -> Result<NetOptions, Failure> {
        let nothing_said = self.listen.is_empty() && self.connect.is_empty();
        let default = || vec![self.default_endpoint()];
        let (tls, access_control, host) = match &self.keys {
            Some(folder) => {
                let ([root_ca, certificate, private_key], access, host) = host_keys::read(folder)?;
                let tls = TlsFiles {
                    root_ca,
                    certificate: Some(certificate),
                    private_key: Some(private_key),
                    mutual: true,
                };
                (Some(tls), Some(access), Some(host))
            }
            None => {
                let tls = self.tls_ca.clone().map(|root_ca| TlsFiles {
                    root_ca,
                    certificate: self.tls_certificate.clone(),
                    private_key: self.tls_key.clone(),
                    mutual: false,
                });
                (tls, None, None)
            }
        };
        let endpoints = || self.listen.iter().chain(&self.connect);
        if let Some(open) = endpoints().find(|e| self.keys.is_some() && !e.starts_with("tls/")) {
            return Err(Failure::usage(format!(
                "{open}: --keys encrypts all connections; expected a TLS endpoint, such as tls/192.0.2.1:7447"
            )));
        }
        let user_password = match &self.user {
            None => None,
            Some(user) => {
                let password = std::env::var("PLUMAGE_PASSWORD").map_err(|_| {
                    Failure::usage(format!(
                        "--user {user}: expected its password in the environment variable PLUMAGE_PASSWORD"
                    ))
                })?;
                Some((user.clone(), password))
            }
        };
        Ok(NetOptions {
            listen: if nothing_said && listens {
                default()
            } else {
                self.listen.clone()
            },
            connect: if nothing_said && !listens {
                default()
            } else {
                self.connect.clone()
            },
            json: self.json,
            tls,
            access_control,
            host,
            user_password,
            password_file: self.password_file.clone(),
            real_time: !self.lockstep,
        })
    }

    /// Default endpoint of the squadron controller.
    fn default_endpoint(&self) -> String {
        match &self.keys {
            Some(_) => DEFAULT_ENDPOINT.replace("tcp/", "tls/"),
            None => DEFAULT_ENDPOINT.to_owned(),
        }
    }

    /// The endpoints to which it connects, for messages.
    pub fn connected_to(&self, listens: bool) -> String {
        match (self.connect.as_slice(), listens) {
            ([], true) => String::new(),
            ([], false) if self.listen.is_empty() => self.default_endpoint(),
            (endpoints, _) => endpoints.join(", "),
        }
    }

    /// Joins the bus as an observer or operator.
    ///
    /// # Errors
    /// As [`BusArguments::open_as`].
    pub async fn open(&self, setup: &Setup, listens: bool) -> Result<Net, Failure> {
        self.open_as(setup, listens, &[]).await
    }

    /// Joins the bus as `agents`.
    ///
    /// # Errors
    /// Options that Zenoh rejects, a port in use, or no key for a mission on several hosts.
    pub async fn open_as(
        &self,
        setup: &Setup,
        listens: bool,
        agents: &[String],
    ) -> Result<Net, Failure> {
        let mission = Name::new(&setup.scenario.mission.name).map_err(Failure::input)?;
        if let Some(warning) = presence::unreachable(&self.listen, &self.connect) {
            eprintln!("warning: {warning}");
        }
        let endpoints: Vec<String> = self.listen.iter().chain(&self.connect).cloned().collect();
        let options = self.net_options(listens)?;
        let in_folder = self
            .keys
            .as_ref()
            .map(|folder| folder.join(mission_key::FILE));
        let file = self.mission_key.as_deref().or(in_folder.as_deref());
        let key = mission_key::find(&mission, file, &endpoints).map_err(Failure::input)?;
        let mut net = Net::open(mission, key, &options)
            .await
            .map_err(Failure::input)?;
        net.introduce(Introduction {
            agents: agents.to_vec(),
            mission: identity(setup),
        });
        if let Some(address) = &self.metrics {
            metrics::serve_of_bus(address, &net, setup).await?;
        }
        Ok(net)
    }
}

/// Identity of a mission, equal in all its processes.
fn identity(setup: &Setup) -> MissionIdentity {
    let scenario = &setup.scenario;
    let mut same = scenario.clone();
    // Compared separately, or irrelevant to observers.
    (same.mission.seed, same.mission.duration_s) = (0, 0.0);
    let mut bytes = same.to_toml().into_bytes();
    // Reported weather may be written anew while the team flies.
    let aircraft = scenario.vehicles.iter().map(|v| &v.aircraft);
    for name in aircraft.chain(&scenario.site.terrain) {
        bytes.extend(setup.files.get(name).into_iter().flatten());
    }
    MissionIdentity {
        scenario_sha256: protocol::digest::sha256_hex(&bytes),
        seed: scenario.mission.seed,
        tick_ns: setup.tick_ns(),
        site_deg: [scenario.site.lat_deg, scenario.site.lon_deg],
    }
}

/// Runs `work` on a runtime that Zenoh can use, until it is done or interrupted.
///
/// # Errors
/// No runtime, or those of `work`.
pub fn block_on(work: impl Future<Output = Result<(), Failure>>) -> Result<(), Failure> {
    block_on_until(work, None)
}

/// The same; with a flag an interrupt raises it, and only a second one ends the work at once.
fn block_on_until(
    work: impl Future<Output = Result<(), Failure>>,
    interrupted: Option<&AtomicBool>,
) -> Result<(), Failure> {
    runtime::start("bus", 2)?.block_on(async {
        let mut interrupts = Interrupts::watch();
        tokio::pin!(work);
        tokio::select! {
            done = &mut work => return done,
            how = interrupts.next() => eprintln!("{how}"),
        }
        let Some(flag) = interrupted else {
            return Ok(());
        };
        flag.store(true, Ordering::Relaxed);
        tokio::select! {
            done = &mut work => done,
            how = interrupts.next() => {
                eprintln!("{how} again: stopped at once; real vehicles rely on their own failsafe");
                Ok(())
            }
        }
    })
}

/// A member of the team in this process, with its links and displays.
pub struct HostedMember {
    member: Member,
    /// The links of a real vehicle.
    links: Vec<LinkAddress>,
    /// The key shared with it.
    signing_key: Option<SigningKey>,
    /// Address of its FlightGear.
    flightgear: Option<String>,
    /// The file of reported weather that the world goes by.
    weather: Option<WeatherFile>,
    /// The same vehicle, listened to while no mission is there yet.
    alone: Option<Member>,
}

impl HostedMember {
    /// The same, the world of which goes by a file of reported weather.
    #[must_use]
    pub fn with_weather(self, weather: Option<WeatherFile>) -> Self {
        Self { weather, ..self }
    }
}

impl From<Member> for HostedMember {
    fn from(member: Member) -> Self {
        Self {
            member,
            links: Vec::new(),
            signing_key: None,
            flightgear: None,
            weather: None,
            alone: None,
        }
    }
}

/// Options of a process that replace the scenario's for its vehicles.
#[derive(Debug, Clone, Default)]
pub struct VehicleOptions {
    /// `--flightgear` arguments.
    pub flightgear: Vec<String>,
    /// Links of the vehicles, whatever their kind; where empty those of the scenario.
    pub links: Vec<LinkAddress>,
    /// Further options of a link.
    pub link_options: LinkOptions,
    /// The key shared with it.
    pub signing_key: Option<SigningKey>,
}

/// The vehicles `ids` of the team.
///
/// # Errors
/// Vehicles that the scenario does not have or that cannot be.
pub fn vehicles(
    setup: &Setup,
    ids: &[&str],
    options: &VehicleOptions,
) -> Result<Vec<HostedMember>, Failure> {
    let addresses = flightgear::addresses(&options.flightgear, ids, &setup.scenario)?;
    let layers_amsl_m = setup.scenario.layers_amsl_m();
    let mut hosted = Vec::new();
    for (id, flightgear) in ids.iter().zip(addresses) {
        let index = setup.index_of(id).map_err(Failure::input)?;
        let vehicle = &setup.scenario.vehicles[index];
        let links = match vehicle.kind {
            _ if !options.links.is_empty() => options.links.clone(),
            VehicleKind::Mavlink => links::addresses(&vehicle.link)?,
            _ => Vec::new(),
        };
        let linked = || Member::linked(setup, index, &options.link_options);
        let member = if links.is_empty() {
            Member::vehicle_among(setup, index, &layers_amsl_m)
        } else {
            linked()
        };
        let onlooker = options.link_options.listen_only || options.link_options.dry_run;
        let alone = (onlooker && !links.is_empty()).then(linked).transpose();
        let of_scenario = || setup.signing_keys.get(*id).cloned();
        hosted.push(HostedMember {
            member: member.map_err(Failure::input)?,
            links,
            signing_key: options.signing_key.clone().or_else(of_scenario),
            flightgear,
            weather: None,
            alone: alone.map_err(Failure::input)?,
        });
    }
    Ok(hosted)
}

/// Runs the members that `make` makes until the mission's end. `keeps_time`: the process listens,
/// and keeps the mission's time for the others.
///
/// # Errors
/// Wrong input, or a bus that fails.
pub fn run(
    arguments: &BusArguments,
    keeps_time: bool,
    make: impl FnOnce(&Setup) -> Result<Vec<HostedMember>, Failure>,
) -> Result<(), Failure> {
    let setup = arguments.setup()?;
    preflight::check(&setup)?;
    let hosted = make(&setup)?;
    run_hosted(arguments, keeps_time, &setup, hosted)
}

/// Apart from [`run`], so that the compiler makes it once and not anew in each program.
fn run_hosted(
    arguments: &BusArguments,
    keeps_time: bool,
    setup: &Setup,
    hosted: Vec<HostedMember>,
) -> Result<(), Failure> {
    let linked = hosted.iter().find(|a| !a.links.is_empty());
    if let Some(linked) = linked.filter(|_| arguments.lockstep) {
        return Err(Failure::usage(format!(
            "{}: a real vehicle cannot fly in lockstep; start without --lockstep",
            linked.member.id()
        )));
    }
    let ids: Vec<String> = hosted.iter().map(|a| a.member.id().to_string()).collect();
    let who = ids.join(", ");
    let interrupted = AtomicBool::new(false);
    let has_links = linked.is_some();
    let stays = (!arguments.lockstep).then_some(&interrupted);
    block_on_until(
        async {
            let mut net = arguments.open_as(setup, keeps_time, &ids).await?;
            eprintln!("{who} joins mission {}", setup.scenario.mission.name);
            // A listen-only process does not wait for others.
            let watch = match hosted.iter().any(|a| a.alone.is_some()) {
                true => None,
                false => Some(presence::watch(
                    &net,
                    setup,
                    &ids,
                    arguments.connected_to(keeps_time),
                    arguments.lockstep,
                )?),
            };
            if arguments.lockstep {
                let team = team::agent_ids(setup).map_err(Failure::input)?;
                let mut members: Vec<Member> = hosted.into_iter().map(|a| a.member).collect();
                lockstep::run(&mut net, &mut members, &team, setup.tick_ns()).await?;
            } else {
                let flown = fly_in_real_time(&mut net, hosted, setup, keeps_time, &interrupted);
                tokio::select! {
                    flown = flown => flown?,
                    () = raised(&interrupted), if !has_links => {}
                }
            }
            if let Some(watch) = watch {
                watch.abort();
            }
            eprintln!("{who} has finished");
            net.leave().await;
            Ok(())
        },
        stays,
    )
}

/// Waits for an interrupt.
async fn raised(interrupted: &AtomicBool) {
    while !interrupted.load(Ordering::Relaxed) {
        tokio::time::sleep(INTERRUPTED_AFTER).await;
    }
}

async fn fly_in_real_time(
    net: &mut Net,
    hosted: Vec<HostedMember>,
    setup: &Setup,
    keeps_time: bool,
    interrupted: &AtomicBool,
) -> Result<(), Failure> {
    let mut members = Vec::new();
    let mut links = Links::default();
    let mut served = Vec::new();
    let mut viewers = Vec::new();
    let mut keys = Vec::new();
    let mut weather = Vec::new();
    let mut alone = Vec::new();
    for a in hosted {
        served.push(match a.member.aircraft().map(|va| va.id().to_string()) {
            Some(id) if !a.links.is_empty() => {
                let id = id.trim_start_matches("va/");
                Some(links.add(id, system_of(&a.member), &a.links).await?)
            }
            _ => None,
        });
        alone.extend(a.alone.zip(served.last().copied().flatten()));
        members.push(a.member);
        keys.push(a.signing_key);
        weather.push(a.weather);
        viewers.push(a.flightgear.as_deref().map(Viewer::open).transpose()?);
    }
    let clock = if keeps_time {
        tokio::select! {
            clock = MissionClock::keep(net) => clock?,
            () = raised(interrupted) => return Ok(()),
        }
    } else {
        match listening::until_joined(net, &mut links, alone, interrupted).await? {
            Some(clock) => clock,
            None => return Ok(()),
        }
    };
    for member in &mut members {
        resume(net, setup, member, clock.now()).await?;
    }
    for (member, key) in members.iter_mut().zip(keys) {
        if let (Member::Real(vehicle), Some(key)) = (member, key) {
            vehicle.sign(signing_from(&key, clock.now()));
        }
    }
    let mut around = Around {
        setup,
        clock,
        interrupted,
        until: SimTime::from_s(setup.scenario.mission.duration_s),
        team: OneRun::new(net.presence()),
        rival: None,
        links,
        typed: served.iter().any(Option::is_some).then(typed_commands),
        first_served: served.iter().position(Option::is_some),
        words: Vec::new(),
        replaced: members.iter().map(|_| None).collect(),
        released: members.iter().map(|_| None).collect(),
        served,
        weather,
        viewers,
    };
    realtime::run(net, &mut members, clock, setup.tick_ns(), &mut around).await?;
    around.rival.map_or(Ok(()), |rival| Err(rival.into()))
}

/// Polling interval for interrupts.
const INTERRUPTED_AFTER: Duration = Duration::from_millis(50);

/// Time limit for the first frame of a real aircraft that replaces a simulated one, ns: a radio's search and an
/// autopilot's start take some 10 s.
const HEARD_WITHIN_NS: i64 = 30_000_000_000;

/// A simulated member that waits for the first frame of its real replacement.
struct Replaced {
    member: Member,
    link: String,
    until: SimTime,
}

/// Links and displays of the members in this process.
struct Around<'a> {
    setup: &'a Setup,
    clock: MissionClock,
    interrupted: &'a AtomicBool,
    until: SimTime,
    /// The run that it is in, beside others of the mission.
    team: OneRun,
    /// The run that makes its end.
    rival: Option<NetError>,
    links: Links,
    /// The number of each member among the links.
    served: Vec<Option<usize>>,
    /// Commands typed at the terminal since the last tick, for all vehicles.
    typed: Option<mpsc::Receiver<String>>,
    words: Vec<String>,
    first_served: Option<usize>,
    /// Simulated members whose real replacements are not received yet.
    replaced: Vec<Option<Replaced>>,
    /// Real aircraft that simulated members have replaced and that still get the heartbeat.
    released: Vec<Option<Released>>,
    weather: Vec<Option<WeatherFile>>,
    viewers: Vec<Option<Viewer>>,
}

impl Around<'_> {
    /// Transfers bytes on the links of the `k`-th member; true if some arrived.
    fn serve(&mut self, k: usize, member: &mut Member) -> bool {
        match (self.served[k], member) {
            (Some(user), Member::Real(vehicle)) => vehicle
                .link()
                .is_some_and(|link| self.links.serve(user, link, self.clock.now())),
            _ => false,
        }
    }

    /// Whether another run makes its end, or all others have ended whose time it keeps.
    fn is_left(&mut self, members: &[Member]) -> bool {
        if self.rival.is_none()
            && let Err(rival) = self.team.check()
        {
            eprintln!("warning: {rival}");
            self.rival = Some(rival);
        }
        let keeps_time = members.iter().any(|m| matches!(m, Member::Controller(_)));
        let is_left = keeps_time && self.team.others_ended();
        if is_left {
            eprintln!("all other members of the team have ended");
        }
        self.rival.is_some() || is_left
    }

    /// Puts another aircraft in the place of the `k`-th member, as the operator wants.
    fn swap(&mut self, k: usize, member: &mut Member, swap: &Swap) {
        if swap.link.is_none() && self.replaced[k].is_some() {
            return self.give_back(k, member, "the operator asked for it");
        }
        if swap.link.is_none() && self.released[k].is_some() {
            return member.answer_swap(Ok(&released::kept(
                "a simulated aircraft flies as this vehicle already",
            )));
        }
        let now = self.clock.now();
        let made = swapped(member, swap, self.setup, now, &mut self.links);
        let (mut next, user) = match made {
            Ok(made) => made,
            Err(why) => return member.answer_swap(Err(&why)),
        };
        let served = std::mem::replace(&mut self.served[k], user);
        std::mem::swap(member, &mut next);
        let before = next;
        self.end_heartbeat(k);
        let words = match &swap.link {
            Some(link) => {
                self.replaced[k] = Some(Replaced {
                    member: before,
                    link: link.clone(),
                    until: now.later(HEARD_WITHIN_NS),
                });
                format!("a real aircraft on {link} now flies as this vehicle")
            }
            None => {
                self.released[k] = Released::of(before, served, &mut self.links);
                let words = "a simulated aircraft now flies as this vehicle".to_owned();
                match &self.released[k] {
                    Some(_) => released::kept(&words),
                    None => words,
                }
            }
        };
        member.answer_swap(Ok(&words));
        eprintln!("vehicle {}: {words}", member.id().name());
    }

    /// Ends the heartbeat to the real aircraft that the `k`-th member has replaced; false if there is none.
    fn end_heartbeat(&mut self, k: usize) -> bool {
        let released = self.released[k].take();
        let ended = released.is_some();
        if let Some(released) = released {
            released.end(&mut self.links);
        }
        ended
    }

    /// Continues the heartbeat to a released real aircraft until its pilot's station is received or the operator
    /// ends it.
    fn check_released(&mut self, k: usize, member: &mut Member) {
        let asked = member.take_release();
        let now = self.clock.now();
        let station = self.released[k]
            .as_mut()
            .and_then(|released| released.serve(&mut self.links, now));
        let Some(words) = station
            .map(released::taken_by)
            .or_else(|| asked.then(|| released::ENDED.to_owned()))
        else {
            return;
        };
        if self.end_heartbeat(k) {
            eprintln!("vehicle {}: {words}", member.id().name());
            member.answer_release(true, &words);
        } else {
            member.answer_release(false, released::NONE);
        }
    }

    /// Checks that a real replacement of a simulated aircraft is received in time.
    fn check_replaced(&mut self, k: usize, member: &mut Member) {
        let heard = matches!(member, Member::Real(vehicle) if vehicle.is_heard());
        if heard {
            self.replaced[k] = None;
        }
        let late = |replaced: &Replaced| self.clock.now() >= replaced.until;
        if self.replaced[k].as_ref().is_some_and(late) {
            let words = format!(
                "no MAVLink frame came within {} s",
                HEARD_WITHIN_NS / 1_000_000_000
            );
            self.give_back(k, member, &words);
        }
    }

    /// Lets the simulated member go on from where it was.
    fn give_back(&mut self, k: usize, member: &mut Member, why: &str) {
        let Some(replaced) = self.replaced[k].take() else {
            return;
        };
        let words = format!(
            "{}: {why}; the simulated aircraft flies on from where it was",
            replaced.link
        );
        eprintln!("vehicle {}: {words}", member.id().name());
        if let Some(user) = self.served[k].take() {
            self.links.forget(user);
        }
        *member = replaced.member;
        member.answer_swap(Ok(&words));
    }
}

impl Surroundings<Member> for Around<'_> {
    fn ends(&mut self, due: SimTime, members: &mut [Member]) -> bool {
        let over = due >= self.until || self.interrupted.load(Ordering::Relaxed);
        let missed = self.released.iter().flatten().any(Released::is_missed);
        (over || self.is_left(members)) && all_down(members) && !missed
    }

    fn before_tick(&mut self, k: usize, member: &mut Member) {
        if let Some(swap) = member.take_swap() {
            self.swap(k, member, &swap);
        }
        self.check_replaced(k, member);
        self.check_released(k, member);
        if self.served[k].is_some()
            && let Member::Real(vehicle) = &mut *member
        {
            if Some(k) == self.first_served {
                let typed = self.typed.as_ref();
                self.words = typed.map_or_else(Vec::new, |t| t.try_iter().collect());
            }
            for word in &self.words {
                obey(word, vehicle);
            }
        }
        self.serve(k, member);
        if let (Some(file), Member::World(world)) = (&mut self.weather[k], &mut *member)
            && let Some(news) = file.poll(self.clock.now())
        {
            world.set_weather(news);
        }
        if let Some(viewer) = &mut self.viewers[k] {
            viewer.show(member);
        }
    }

    fn has_news(&mut self, k: usize, member: &mut Member) -> bool {
        self.serve(k, member)
    }
}

/// The member that takes the place of `member`, and its number among the links, none for a simulated one.
fn swapped(
    member: &Member,
    swap: &Swap,
    setup: &Setup,
    now: SimTime,
    links: &mut Links,
) -> Result<(Member, Option<usize>), MissionError> {
    let name = member.id().name().to_string();
    let index = setup.index_of(&name)?;
    let mut next = member.swapped(setup, index, swap)?;
    let Some(link) = &swap.link else {
        return Ok((next, None));
    };
    let refuse = |why: String| MissionError::Request(format!("link {link}: {why}"));
    let address = link
        .parse()
        .map_err(|e: mav_bridge::BridgeError| refuse(e.to_string()))?;
    // A socket is opened in no time; the tick waits for it.
    let addresses = [address];
    let added = links.add(&name, system_of(&next), &addresses);
    let opened = tokio::task::block_in_place(|| tokio::runtime::Handle::current().block_on(added));
    let user = opened.map_err(|e| refuse(e.words()))?;
    if let (Member::Real(vehicle), Some(key)) = (&mut next, setup.signing_keys.get(&name)) {
        vehicle.sign(signing_from(key, now));
    }
    Ok((next, Some(user)))
}

/// The MAVLink system of a real vehicle, if one was asked for.
fn system_of(member: &Member) -> Option<u8> {
    match member {
        Member::Real(vehicle) => vehicle.system_id(),
        _ => None,
    }
}

/// Whether no vehicle behind a link is in the air or armed; those that are are told that the mission is over.
fn all_down(members: &mut [Member]) -> bool {
    let mut down = true;
    for member in members {
        if let Member::Real(vehicle) = member {
            vehicle.mission_over();
            down &= !vehicle.is_up();
        }
    }
    down
}

fn obey(word: &str, vehicle: &mut RealVehicle) {
    match word.trim() {
        "hand-back" => vehicle.hand_back(),
        "" => {}
        other => eprintln!("'{other}': unknown command; expected 'hand-back'"),
    }
}

/// Lines typed on standard input, read on a thread of their own that ends with the process.
fn typed_commands() -> mpsc::Receiver<String> {
    let (sender, receiver) = mpsc::channel();
    std::thread::spawn(move || {
        for line in std::io::stdin().lines().map_while(Result::ok) {
            if sender.send(line).is_err() {
                return;
            }
        }
    });
    receiver
}

/// Signing with `key` of a mission whose time is `now`.
pub fn signing_from(key: &SigningKey, now: SimTime) -> SigningConfig {
    // Signatures count 10 µs since 2015-01-01 00:00 UTC.
    const SINCE_1970_S: u64 = 1_420_070_400;
    let since_1970 = SystemTime::now().duration_since(UNIX_EPOCH);
    let wall = since_1970.map_or(0, |d| d.as_micros() / 10);
    let wall_10us = u64::try_from(wall)
        .unwrap_or(u64::MAX)
        .saturating_sub(SINCE_1970_S * 100_000);
    SigningConfig {
        key: key.0,
        link_id: 0,
        epoch_10us: wall_10us.saturating_add_signed(-now.ns() / 10_000),
    }
}
