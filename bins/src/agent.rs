//! One agent in a process of its own, on the bus over Zenoh.

use crate::{Failure, mission_files};
use anyhow::Context as _;
use mav_bridge::link::{Link, LinkAddress};
use mission::{Member, Setup, team};
use protocol::key::Name;
use protocol::net::realtime::MissionClock;
use protocol::net::{DEFAULT_ENDPOINT, Net, NetOptions, TlsFiles, lockstep, realtime};
use protocol::{Agent as _, AgentId, SimTime};
use std::path::PathBuf;

/// How a process joins the bus of a mission.
#[derive(Debug, Clone, clap::Args)]
pub struct BusArguments {
    /// Scenario of the mission (TOML), the same for all its processes
    #[arg(long, value_name = "FILE")]
    pub scenario: PathBuf,
    /// Seed of every random number, instead of the scenario's
    #[arg(long)]
    pub seed: Option<u64>,
    /// Length of the mission in simulated seconds, instead of the scenario's
    #[arg(long, value_name = "S")]
    pub duration: Option<f64>,
    /// Tick by tick under a conductor (plumage conduct) instead of by the wall clock
    #[arg(long)]
    pub lockstep: bool,
    /// Endpoint to listen on, such as tcp/127.0.0.1:7447; may be repeated
    #[arg(long, value_name = "ENDPOINT")]
    pub listen: Vec<String>,
    /// Endpoint to connect to; may be repeated
    #[arg(long, value_name = "ENDPOINT")]
    pub connect: Vec<String>,
    /// Publish JSON instead of bincode
    #[arg(long)]
    pub json: bool,
    /// Certificate of the authority behind TLS endpoints (PEM)
    #[arg(long, value_name = "FILE")]
    pub tls_ca: Option<String>,
    /// Own certificate for TLS endpoints that listen (PEM)
    #[arg(long, value_name = "FILE", requires = "tls_ca")]
    pub tls_certificate: Option<String>,
    /// Own private key for TLS endpoints that listen (PEM)
    #[arg(long, value_name = "FILE", requires = "tls_ca")]
    pub tls_key: Option<String>,
    /// User name that this process shows; its password is read from PLUMAGE_PASSWORD
    #[arg(long)]
    pub user: Option<String>,
    /// File of user:password lines that a listening process accepts
    #[arg(long, value_name = "FILE")]
    pub password_file: Option<String>,
}

impl BusArguments {
    /// The mission, with what the arguments change of it.
    ///
    /// # Errors
    /// Wrong input, with what was expected.
    pub fn setup(&self) -> Result<Setup, Failure> {
        mission_files::load_changed(&self.scenario, self.seed, self.duration)
    }

    /// How to join; `listens` where a process that is told nothing else listens.
    ///
    /// # Errors
    /// A user without a password.
    pub fn net_options(&self, listens: bool) -> Result<NetOptions, Failure> {
        let nothing_said = self.listen.is_empty() && self.connect.is_empty();
        let default = || vec![DEFAULT_ENDPOINT.to_owned()];
        let user_password = match &self.user {
            None => None,
            Some(user) => {
                let password = std::env::var("PLUMAGE_PASSWORD").map_err(|_| {
                    Failure::usage("--user: expected its password in PLUMAGE_PASSWORD")
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
            tls: self.tls_ca.clone().map(|root_ca| TlsFiles {
                root_ca,
                certificate: self.tls_certificate.clone(),
                private_key: self.tls_key.clone(),
            }),
            user_password,
            password_file: self.password_file.clone(),
        })
    }

    /// Joins the bus.
    ///
    /// # Errors
    /// Options that Zenoh does not take, or a port that is taken.
    pub async fn open(&self, setup: &Setup, listens: bool) -> Result<Net, Failure> {
        let mission = Name::new(&setup.scenario.mission.name).map_err(Failure::input)?;
        Net::open(mission, &self.net_options(listens)?)
            .await
            .map_err(Failure::input)
    }
}

/// Runs `work` on a runtime that Zenoh can use.
///
/// # Errors
/// No runtime, or those of `work`.
pub fn block_on(work: impl Future<Output = Result<(), Failure>>) -> Result<(), Failure> {
    tokio::runtime::Builder::new_multi_thread()
        .worker_threads(2)
        .enable_all()
        .build()
        .context("cannot start the runtime")?
        .block_on(async {
            tokio::select! {
                done = work => done,
                _ = tokio::signal::ctrl_c() => {
                    eprintln!("interrupted");
                    Ok(())
                }
            }
        })
}

/// Runs the agent that `make` makes until the mission's end. `keeps_time`: it listens, and keeps
/// the mission's time for the others.
///
/// # Errors
/// Wrong input, or a bus that fails.
pub fn run(
    arguments: &BusArguments,
    keeps_time: bool,
    make: impl FnOnce(&Setup) -> Result<Member, Failure>,
) -> Result<(), Failure> {
    let setup = arguments.setup()?;
    let mut member = make(&setup)?;
    block_on(async {
        let mut net = arguments.open(&setup, keeps_time).await?;
        eprintln!(
            "{} joins mission {}",
            member.id(),
            setup.scenario.mission.name
        );
        if arguments.lockstep {
            let team = team::agent_ids(&setup).map_err(Failure::input)?;
            lockstep::run(&mut net, &mut member, &team, setup.tick_ns()).await?;
        } else {
            fly_in_real_time(&mut net, &mut member, &setup, keeps_time).await?;
        }
        eprintln!("{} has finished", member.id());
        net.close().await?;
        Ok(())
    })
}

async fn fly_in_real_time(
    net: &mut Net,
    member: &mut Member,
    setup: &Setup,
    keeps_time: bool,
) -> Result<(), Failure> {
    let mut link = open_link(setup, member.id()).await?;
    let clock = if keeps_time {
        MissionClock::keep(net).await?
    } else {
        MissionClock::ask(net).await?
    };
    let until = SimTime::from_s(setup.scenario.mission.duration_s);
    realtime::run(
        net,
        member,
        clock,
        setup.tick_ns(),
        until,
        |member, _, _| {
            if let (Some(link), Member::Real(vehicle)) = (&mut link, member)
                && let Some(buffers) = vehicle.link()
            {
                serve_link(link, buffers);
            }
        },
    )
    .await?;
    Ok(())
}

/// The MAVLink link of the vehicle that `id` is, if the scenario gives it one.
async fn open_link(setup: &Setup, id: &AgentId) -> Result<Option<Link>, Failure> {
    let vehicle = setup
        .scenario
        .vehicles
        .iter()
        .find(|v| AgentId::va(&v.id).as_ref() == Ok(id));
    let Some(address) = vehicle.and_then(|v| v.link.as_ref()) else {
        return Ok(None);
    };
    let address: LinkAddress = address.parse().map_err(Failure::input)?;
    Ok(Some(Link::open(&address).await.map_err(Failure::input)?))
}

/// Moves bytes between a link and a bridge.
pub fn serve_link(link: &mut Link, buffers: &mut mission::real_vehicle::LinkBuffers) {
    while let Some(bytes) = link.try_receive() {
        buffers.from_vehicle.push(bytes);
    }
    for frame in buffers.to_vehicle.drain(..) {
        // A link that does not keep up loses frames, as any radio does; commands are repeated.
        let _ = link.send(frame);
    }
}
