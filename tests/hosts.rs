//! Missions on several hosts, which are network namespaces: one is cut off, or a process dies, stops or is started
//! again, by chance, at take-off, in the search and on the way home; and what has to hold then holds. Ignored, with the
//! reason, where namespaces may not be made.

use crate::runner::{Spends, Test};
use crate::team::{self, Team, outputs_are_whole};
use libtest_mimic::{Completion, Failed};
use protocol::message::{ControlLevel, Message};
use protocol::{AgentId, Envelope, SimTime, Topic};
use rand::RngExt as _;
use std::collections::BTreeMap;
use std::ops::RangeInclusive;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::atomic::{AtomicU32, Ordering};
use std::time::Duration;

const SCENARIO: &str = "../scenarios/as-pontes-steady.toml";
/// How long something is out of order: longer than Zenoh's lease of 10 s.
const OUT_OF_ORDER: Duration = Duration::from_secs(12);
/// By then all meet again.
const HEALS_WITHIN: Duration = Duration::from_secs(10);
/// By then a vehicle that has to come home by itself does, s: 5 s after the last word (docs/operations.md), and a second in
/// which it acts and is heard.
const GUARDIAN_WITHIN_S: f64 = 6.0;
/// A silence that calls for nothing, s: vehicles come home after 5 s, which they count from what they heard. A choice: the recorder
/// looks ten times a second, and may hear the last word a look later than they and the next one a look sooner.
const SILENCE_S: f64 = 4.8;
/// Time after which a process that died is started again.
const STARTED_AGAIN_AFTER: Duration = Duration::from_secs(1);

/// Runs a line of shell.
fn shell(line: &str) -> Result<(), String> {
    let ran = Command::new("sh").args(["-ec", line]).output().unwrap();
    match ran.status.success() {
        true => Ok(()),
        false => Err(String::from_utf8_lossy(&ran.stderr).trim().to_owned()),
    }
}

/// Three hosts on one network.
struct Hosts {
    tag: String,
}

impl Drop for Hosts {
    fn drop(&mut self) {
        for name in ["net", "1", "2", "3"] {
            let _ = shell(&format!("ip netns del {}-{name}", self.tag));
        }
    }
}

impl Hosts {
    fn make() -> Result<Self, String> {
        static NEXT: AtomicU32 = AtomicU32::new(0);
        let number = NEXT.fetch_add(1, Ordering::Relaxed);
        let tag = format!("pl{}-{number}", std::process::id());
        let hosts = Self { tag };
        let net = format!("{}-net", hosts.tag);
        shell(&format!(
            "ip netns add {net}; ip -n {net} link add bridge type bridge; ip -n {net} link set bridge up"
        ))?;
        for k in 1..=3 {
            let host = hosts.name(k);
            shell(&format!(
                "ip netns add {host}; ip -n {host} link set lo up
                 ip -n {net} link add to{k} type veth peer name eth0 netns {host}
                 ip -n {net} link set to{k} master bridge; ip -n {net} link set to{k} up
                 ip -n {host} addr add 10.77.0.{k}/24 dev eth0; ip -n {host} link set eth0 up"
            ))?;
        }
        Ok(hosts)
    }

    fn name(&self, k: u32) -> String {
        format!("{}-{k}", self.tag)
    }

    /// Takes the cable of a host out, or puts it back.
    fn cable(&self, k: u32, state: &str) {
        shell(&format!("ip -n {}-net link set to{k} {state}", self.tag)).unwrap();
    }

    /// Processes that are started next are on this host.
    fn on(&self, k: u32, team: &mut Team) {
        team.host = Some((self.name(k), format!("10.77.0.{k}")));
    }
}

/// The processes, with the host of each.
const PROCESSES: [(&str, u32); 6] = [
    ("sc/main", 1),
    ("clock/recorder", 1),
    ("ws/main", 2),
    ("va/1", 2),
    ("va/3", 3),
    ("va/5", 3),
];

/// The vehicles of a process.
fn vehicles_of(process: &str) -> &'static [&'static str] {
    match process {
        "va/1" => &["1", "2"],
        "va/3" => &["3", "4"],
        "va/5" => &["5"],
        _ => &[],
    }
}

/// Homes that are so far apart that all take off at once, and search half a minute later: degrees north and east.
const HOMES_DEG: [(f64, f64); 5] = [
    (43.430, -7.856),
    (43.430, -7.844),
    (43.430, -7.832),
    (43.420, -7.850),
    (43.420, -7.838),
];

/// The reference mission with simulated vehicles alone, in a folder.
fn scenario(folder: &Path) -> PathBuf {
    let mut scenario = programs::mission_files::load(Path::new(SCENARIO))
        .unwrap()
        .scenario;
    scenario.vehicles.truncate(HOMES_DEG.len());
    let aircraft = std::fs::canonicalize("../aircraft/x8.toml").unwrap();
    for (vehicle, (lat_deg, lon_deg)) in scenario.vehicles.iter_mut().zip(HOMES_DEG) {
        vehicle.aircraft = aircraft.to_str().unwrap().to_owned();
        vehicle.home = Some(scenario::tables::HomeTable { lat_deg, lon_deg });
    }
    let path = folder.join("mission.toml");
    std::fs::write(&path, scenario.to_toml()).unwrap();
    path
}

/// A mission on three hosts.
struct Mission {
    hosts: Hosts,
    team: Team,
    scenario: PathBuf,
    out: PathBuf,
    /// The keys of each host, where the mission is over TLS with access control.
    keys: Option<PathBuf>,
    mission_key: PathBuf,
}

/// What each host may say.
const HOSTS: [&str; 3] = [
    "one=10.77.0.1=sc,op,watch",
    "two=10.77.0.2=ws,va/1,va/2",
    "three=10.77.0.3=va/3,va/4,va/5",
];

impl Mission {
    /// Begins one of `duration_s`; with `tls` as `plumage keys new` makes it, else with a key alone.
    fn begin(name: &str, duration_s: u32, tls: bool) -> Result<Self, String> {
        let hosts = Hosts::make()?;
        let folder = team::folder(&format!("{name}-scenario"));
        let scenario = scenario(&folder);
        let mission_key = folder.join("mission.key");
        let digits = format!("{:064x}\n", std::process::id());
        tasks::mission_key::write_private(&mission_key, &digits).map_err(|e| e.to_string())?;
        let keys = tls.then(|| folder.join("keys"));
        if let Some(keys) = &keys {
            let made = Command::new(env!("CARGO_BIN_EXE_plumage"))
                .args(["keys", "new", "--mission", "as-pontes-steady", "--out"])
                .arg(keys)
                .args(HOSTS.iter().flat_map(|host| ["--host", host]))
                .output()
                .unwrap();
            assert!(made.status.success(), "{made:?}");
        }
        let duration = duration_s.to_string();
        let scenario_text = scenario.to_str().unwrap();
        let common = ["--scenario", scenario_text, "--duration", &duration];
        let endpoint = format!("{}/10.77.0.1:7447", if tls { "tls" } else { "tcp" });
        let team = Team::meeting_at(name, endpoint, &common);
        let out = team.folder.join("out");
        let mut mission = Self {
            hosts,
            team,
            scenario,
            out,
            keys,
            mission_key,
        };
        for (name, _) in PROCESSES {
            mission.start(name);
        }
        Ok(mission)
    }

    /// The option by which a program on a host has the mission's key.
    fn key_option(&self, host: u32) -> [String; 2] {
        let text = |path: &Path| path.to_str().unwrap().to_owned();
        let Some(keys) = &self.keys else {
            return ["--mission-key".to_owned(), text(&self.mission_key)];
        };
        let (name, _) = HOSTS[host as usize - 1].split_once('=').unwrap();
        ["--keys".to_owned(), text(&keys.join(name))]
    }

    fn start(&mut self, name: &'static str) {
        let (_, host) = *PROCESSES.iter().find(|p| p.0 == name).unwrap();
        self.hosts.on(host, &mut self.team);
        let vehicles = vehicles_of(name).join(",");
        let out = self.out.to_str().unwrap().to_owned();
        let (program, own): (&str, &[&str]) = match name {
            "sc/main" => (env!("CARGO_BIN_EXE_sc"), &[]),
            "ws/main" => (env!("CARGO_BIN_EXE_ws"), &[]),
            "clock/recorder" => (env!("CARGO_BIN_EXE_recorder"), &["--out", &out]),
            _ => (env!("CARGO_BIN_EXE_va"), &["--vehicles", &vehicles]),
        };
        let key = self.key_option(host);
        let more: Vec<&str> = own
            .iter()
            .copied()
            .chain(key.iter().map(String::as_str))
            .collect();
        self.team.start(name, program, &more);
    }

    /// What the operator says, on the first host.
    fn control(&self, wish: &[&str]) {
        let status = Command::new("ip")
            .args([
                "netns",
                "exec",
                &self.hosts.name(1),
                env!("CARGO_BIN_EXE_plumage"),
                "control",
            ])
            .args(wish)
            .arg("--scenario")
            .arg(&self.scenario)
            .args(["--connect", &self.team.endpoint])
            .args(["--listen", &self.team.endpoint.replace(":7447", ":0")])
            .args(self.key_option(1))
            .stdout(Stdio::null())
            .status()
            .unwrap();
        assert!(status.success(), "control {wish:?}");
    }

    /// Ends the recording and reads it.
    fn recorded(&mut self) -> Result<Vec<(Topic, Envelope)>, Failed> {
        let recorder = self.team.of("clock/recorder");
        recorder.signal("-TERM");
        recorder.ends_before(std::time::Instant::now() + Duration::from_secs(10))?;
        outputs_are_whole(&self.out)?;
        let recording = record::read_mcap(&self.out.join("mission.mcap")).unwrap();
        Ok(recording.in_order().unwrap().map(Result::unwrap).collect())
    }
}

/// When each vehicle turned Guardian first, s, or was heard again after it had and has flown on.
fn guardians(said: &[(Topic, Envelope)]) -> BTreeMap<String, f64> {
    let mut turned = BTreeMap::new();
    for (topic, envelope) in said {
        if let (Topic::Mode(vehicle), Message::Mode(mode)) = (topic, &envelope.message)
            && (mode.level == ControlLevel::Guardian || mode.reason.contains(va::control::RESUMED))
        {
            turned
                .entry(vehicle.to_string())
                .or_insert(envelope.time.s());
        }
    }
    turned
}

/// Who flies each vehicle in the end.
fn levels(said: &[(Topic, Envelope)]) -> BTreeMap<String, ControlLevel> {
    let modes = said
        .iter()
        .filter_map(|(topic, envelope)| match (topic, &envelope.message) {
            (Topic::Mode(vehicle), Message::Mode(mode)) => Some((vehicle.to_string(), mode.level)),
            _ => None,
        });
    modes.collect()
}

/// The longest silence of an agent: when it was heard last before, and how long it lasted, s.
fn silence_of(said: &[(Topic, Envelope)], of: &AgentId) -> (SimTime, f64) {
    let of_it = said.iter().filter(|(_, e)| e.sender == *of);
    let times: Vec<SimTime> = of_it.map(|(_, e)| e.time).collect();
    let silences = times.windows(2).map(|w| (w[0], w[1].since_s(w[0])));
    silences.fold((SimTime::ZERO, 0.0), |longest, this| {
        if this.1 > longest.1 { this } else { longest }
    })
}

/// Vehicles that were in the air before `s`.
fn airborne_before(said: &[(Topic, Envelope)], s: f64) -> BTreeMap<String, bool> {
    let mut airborne = BTreeMap::new();
    for (topic, envelope) in said {
        if let (Topic::State(vehicle), Message::State(state)) = (topic, &envelope.message)
            && envelope.time.s() < s
        {
            airborne.insert(vehicle.to_string(), state.airborne);
        }
    }
    airborne
}

/// A host with two processes of vehicles is cut off, in a mission over TLS with access control: theirs come home by themselves, and nobody else's; all meet again.
fn only_who_is_cut_off_comes_home_by_itself() -> Result<Completion, Failed> {
    let mut mission = match Mission::begin("cut", 1500, true) {
        Ok(mission) => mission,
        Err(why) => return Ok(Completion::ignored_with(format!("no namespaces: {why}"))),
    };
    mission
        .team
        .wait("all meet", Duration::from_secs(40), Team::all_meet)?;
    // All are in the air by then, and search.
    std::thread::sleep(Duration::from_secs(35));
    mission.hosts.cable(3, "down");
    std::thread::sleep(OUT_OF_ORDER);
    mission.hosts.cable(3, "up");
    mission
        .team
        .wait("all meet again", HEALS_WITHIN, Team::all_meet)?;
    // What holds is said again to those who have missed it.
    std::thread::sleep(Duration::from_secs(3));
    let said = mission.recorded()?;
    let turned = guardians(&said);
    let names: Vec<&str> = turned.keys().map(String::as_str).collect();
    assert_eq!(names, ["3", "4", "5"]);
    Ok(Completion::Completed)
}

/// What is broken.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Fault {
    /// The process dies, and is started again as systemd does.
    Dies(&'static str),
    /// The process is stopped for a while.
    Stops(&'static str),
    /// The host is cut off for a while.
    CutOff(u32),
    /// The squadron controller dies, and when it is started again its network comes up so much later.
    LateNetwork(Duration),
}

/// When it is broken.
#[derive(Debug, Clone, Copy, PartialEq)]
enum When {
    TakeOff,
    Search,
    WayHome,
}

const FAULTS: [Fault; 13] = [
    Fault::Dies("sc/main"),
    Fault::Dies("ws/main"),
    Fault::Dies("va/1"),
    Fault::Dies("va/3"),
    Fault::Stops("sc/main"),
    Fault::Stops("ws/main"),
    Fault::Stops("va/1"),
    Fault::Stops("va/3"),
    Fault::Stops("clock/recorder"),
    Fault::CutOff(1),
    Fault::CutOff(2),
    Fault::CutOff(3),
    Fault::LateNetwork(Duration::from_secs(4)),
];
/// How late a network of the squadron controller's host is: longer than it looks for a run, than a silence lasts, and than
/// Zenoh's lease.
const LATE: [Duration; 3] = [
    Duration::from_secs(3),
    Duration::from_secs(7),
    Duration::from_secs(13),
];
const WHENS: [When; 3] = [When::TakeOff, When::Search, When::WayHome];
/// The vehicle that a person flies.
const PILOTED: &str = "3";

/// Which of the vehicles have to come home by themselves, and which may.
fn who_comes_home(fault: Fault) -> (&'static [&'static str], &'static [&'static str]) {
    const ALL: &[&str] = &["1", "2", "3", "4", "5"];
    match fault {
        // Started again in time it is not missed.
        Fault::Dies("sc/main" | "ws/main") => (&[], ALL),
        Fault::Stops("sc/main" | "ws/main") => (ALL, ALL),
        Fault::CutOff(3) => (&["3", "4", "5"], &["3", "4", "5"]),
        // The squadron controller or the world is on it, or whoever hears them.
        Fault::CutOff(_) => (ALL, ALL),
        // Started again and heard in time it is not missed.
        Fault::LateNetwork(_) => (&[], ALL),
        Fault::Dies(process) | Fault::Stops(process) => (&[], vehicles_of(process)),
    }
}

/// One mission in which something is broken, by chance or the network of the squadron controller; the invariants that do
/// not hold.
fn break_something(seed: u64, late_network: bool) -> Result<(), String> {
    let mut rng = scenario::random::stream(seed, "faults");
    let fault = match late_network {
        true => Fault::LateNetwork(LATE[rng.random_range(0..LATE.len())]),
        false => FAULTS[rng.random_range(0..FAULTS.len())],
    };
    let when = WHENS[rng.random_range(0..WHENS.len())];
    let later = Duration::from_secs_f64(rng.random_range(0.0..4.0));
    eprintln!("seed {seed}: {fault:?} at {when:?}");
    let told = |why: Failed| {
        format!(
            "seed {seed}, {fault:?} at {when:?}: {}",
            why.message().unwrap_or("")
        )
    };
    let folder = if late_network { "late" } else { "seed" };
    let mut mission = Mission::begin(&format!("{folder}-{seed}"), 1500, false)?;
    let meet = Duration::from_secs(60);
    mission
        .team
        .wait("all meet", meet, Team::all_meet)
        .map_err(told)?;
    std::thread::sleep(Duration::from_secs(4) + later);
    if when != When::TakeOff {
        mission.control(&["take-over", "--vehicles", PILOTED]);
    }
    match when {
        When::TakeOff => {}
        When::Search => std::thread::sleep(Duration::from_secs(28)),
        When::WayHome => {
            std::thread::sleep(Duration::from_secs(8));
            mission.control(&["home", "--vehicles", "1,2,4,5"]);
            std::thread::sleep(Duration::from_secs(3));
        }
    }
    match fault {
        Fault::Dies(process) => {
            mission.team.of(process).signal("-KILL");
            std::thread::sleep(STARTED_AGAIN_AFTER);
            mission.start(process);
            std::thread::sleep(OUT_OF_ORDER);
        }
        Fault::Stops(process) => {
            mission.team.of(process).signal("-STOP");
            std::thread::sleep(OUT_OF_ORDER);
            mission.team.of(process).signal("-CONT");
        }
        Fault::CutOff(host) => {
            mission.hosts.cable(host, "down");
            std::thread::sleep(OUT_OF_ORDER);
            mission.hosts.cable(host, "up");
        }
        Fault::LateNetwork(late) => {
            mission.team.of("sc/main").signal("-KILL");
            mission.hosts.cable(1, "down");
            std::thread::sleep(STARTED_AGAIN_AFTER);
            mission.start("sc/main");
            std::thread::sleep(late);
            mission.hosts.cable(1, "up");
        }
    }
    let heal = mission
        .team
        .wait("all meet again", HEALS_WITHIN, Team::all_meet);
    heal.map_err(told)?;
    // What holds is said again to those who have missed it, and who went home for a silence flies on.
    std::thread::sleep(Duration::from_secs(5));
    let said = mission.recorded().map_err(told)?;
    let broken = broken_invariants(&mission.scenario, &said, fault);
    match broken.is_empty() {
        true => Ok(()),
        false => Err(format!(
            "seed {seed}, {fault:?} at {when:?}: {}",
            broken.join("; ")
        )),
    }
}

/// What does not hold of what was recorded.
fn broken_invariants(scenario: &Path, said: &[(Topic, Envelope)], fault: Fault) -> Vec<String> {
    let mut broken = Vec::new();
    let setup = programs::mission_files::load(scenario).unwrap();
    let airspace = scenario::airspace::Airspace::of(&setup.scenario).unwrap();
    let mut piloted = false;
    for (topic, envelope) in said {
        let at_s = envelope.time.s();
        match (topic, &envelope.message) {
            (Topic::Setpoint(vehicle), Message::Setpoint(to)) => {
                let at = airspace.frame().to_enu(air::geo::Geodetic {
                    lat_deg: to.lat_deg,
                    lon_deg: to.lon_deg,
                });
                if air::area::clearance_m(airspace.polygon(), at) < 0.0 {
                    broken.push(format!("{vehicle} is sent out of the fence at {at_s} s"));
                }
            }
            (Topic::State(vehicle), Message::State(state)) if state.airborne => {
                let at = airspace.frame().to_enu(air::geo::Geodetic {
                    lat_deg: state.lat_deg,
                    lon_deg: state.lon_deg,
                });
                if air::area::clearance_m(airspace.polygon(), at) < -50.0 {
                    broken.push(format!("{vehicle} is out of the fence at {at_s} s"));
                }
            }
            (Topic::Mode(vehicle), Message::Mode(mode)) if vehicle.as_str() == PILOTED => {
                if piloted && mode.level != ControlLevel::Pilot {
                    broken.push(format!(
                        "the pilot of {vehicle} loses it at {at_s} s: {}",
                        mode.reason
                    ));
                }
                piloted |= mode.level == ControlLevel::Pilot;
            }
            _ => {}
        }
    }
    let (must, mut may) = who_comes_home(fault);
    let silent = match fault {
        Fault::Stops("sc/main") | Fault::Dies("sc/main") => Some(AgentId::sc()),
        Fault::Stops("ws/main") | Fault::Dies("ws/main") => Some(AgentId::ws()),
        _ => None,
    };
    // The recorder has heard the silence as the vehicles have.
    let silence = silent.map(|agent| silence_of(said, &agent));
    if silence.is_some_and(|(_, lasted_s)| lasted_s < SILENCE_S) {
        may = &[];
    }
    let turned = guardians(said);
    for (vehicle, at_s) in &turned {
        if !may.contains(&vehicle.as_str()) {
            broken.push(format!(
                "{vehicle} comes home by itself at {at_s} s, for nothing"
            ));
        }
    }
    // A silence that is over leaves nobody to the Guardian.
    for (vehicle, level) in levels(said) {
        if level == ControlLevel::Guardian {
            broken.push(format!("{vehicle} has not resumed"));
        }
    }
    let flew = airborne_before(said, silence.map_or(f64::INFINITY, |(since, _)| since.s()));
    for vehicle in must {
        if flew.get(*vehicle) != Some(&true) || (piloted && *vehicle == PILOTED) {
            continue;
        }
        match (turned.get(*vehicle), silence) {
            (None, _) => broken.push(format!("{vehicle} does not come home")),
            (Some(at_s), Some((since, _))) if at_s - since.s() > GUARDIAN_WITHIN_S => {
                let late_s = at_s - since.s();
                broken.push(format!(
                    "{vehicle} comes home only {late_s:.1} s after the last word"
                ));
            }
            _ => {}
        }
    }
    broken
}

/// What has to hold holds whatever breaks in the missions of these seeds, flown one after the other: by chance, or the
/// network of the squadron controller.
fn what_has_to_hold_holds(
    seeds: RangeInclusive<u64>,
    late_network: bool,
) -> Result<Completion, Failed> {
    if let Err(why) = Hosts::make() {
        return Ok(Completion::ignored_with(format!("no namespaces: {why}")));
    }
    let broken: Vec<String> = seeds
        .filter_map(|seed| break_something(seed, late_network).err())
        .collect();
    if broken.is_empty() {
        return Ok(Completion::Completed);
    }
    Err(broken.join("\n").into())
}

/// The first tier breaks three missions, the second sixty-three others, in seven parts.
pub fn tests() -> Vec<Test> {
    let breaks = |seeds: RangeInclusive<u64>, late_network: bool| {
        let (first, last) = (seeds.start(), seeds.end());
        let what = match late_network {
            true => "what_has_to_hold_holds_with_a_late_network",
            false => "what_has_to_hold_holds_whatever_breaks",
        };
        let name = format!("{what}_{first}_to_{last}");
        Test::new(module_path!(), &name, Spends::RealTime, move || {
            what_has_to_hold_holds(seeds, late_network)
        })
    };
    let cut_off = Test::new(
        module_path!(),
        "only_who_is_cut_off_comes_home_by_itself",
        Spends::RealTime,
        only_who_is_cut_off_comes_home_by_itself,
    );
    let few = (1..=3).map(|seed| breaks(seed..=seed, false));
    let three = breaks(4..=6, false).of_second_tier("second tier: three missions");
    let many = (0..6).map(|part| {
        let first = 7 + 10 * part;
        breaks(first..=first + 9, false).of_second_tier("second tier: ten missions")
    });
    let late = [
        breaks(1..=1, true),
        breaks(2..=12, true).of_second_tier("second tier: eleven missions"),
    ];
    std::iter::once(cut_off)
        .chain(few)
        .chain([three])
        .chain(many)
        .chain(late)
        .collect()
}
