//! A real vehicle of the team: the bridge between its MAVLink and the bus. Also a stand-in for
//! one on a link of its own, for those who have no aircraft at hand.

use anyhow::Context as _;
use clap::Parser;
use mav_bridge::arduplane::TAKEOFF;
use mav_bridge::link::{Link, LinkAddress};
use mission::Setup;
use mission::real_vehicle::LinkOptions;
use mission::setup::SigningKey;
use programs::agent::{self, VehicleOptions, signing_from};
use programs::{Failure, failure, mission_files};
use protocol::SimTime;
use scenario::random::stream;
use stand_in::StandIn;
use std::io::IsTerminal;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::{Duration, Instant};

/// Joins the bus as a real vehicle whose autopilot (ArduPlane) is on a MAVLink link.
///
/// `mav-bridge stand-in` flies a stand-in for one on a link of its own; see its --help.
#[derive(Debug, Parser)]
#[command(name = "mav-bridge", version, about)]
struct BridgeArguments {
    #[command(flatten)]
    bus: agent::BusArguments,
    /// Ids of the vehicles in the scenario, apart by commas; several share the links, and are told apart by
    /// their system_id
    #[arg(long, value_name = "ID", value_delimiter = ',', required = true)]
    vehicle: Vec<String>,
    /// Where the vehicle is: udpin:HOST:PORT, udpout:HOST:PORT, tcp:HOST:PORT, tcpin:HOST:PORT or
    /// serial:PATH:BAUD; repeated for one that is heard over several links [default: the vehicle's link in the scenario]
    #[arg(long)]
    link: Vec<LinkAddress>,
    /// MAVLink system of the vehicle [default: its system_id in the scenario, else the one that is heard]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u8).range(1..))]
    system_id: Option<u8>,
    /// MAVLink component of its autopilot [default: its component_id in the scenario, else 1]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u8).range(1..))]
    component_id: Option<u8>,
    /// MAVLink system of this bridge as a ground station; the vehicle's MAV_GCS_SYSID (SYSID_MYGCS before 4.7)
    /// must be the same [default: the vehicle's gcs_system_id in the scenario, else 255]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u8).range(1..))]
    gcs_id: Option<u8>,
    /// Send nothing at all, no heartbeat and no request either: what the vehicle sends by itself is taken in
    #[arg(long)]
    listen_only: bool,
    /// Send nothing but questions for parameters and the fence, and say every other frame that would be sent: no
    /// heartbeat, no rate, no mode, no setpoint
    #[arg(long, conflicts_with = "listen_only")]
    dry_run: bool,
    /// Set the parameters that the checklist finds wrong, on the ground: FS_GCS_ENABL and FS_LONG_ACTN to 1,
    /// MAV_GCS_SYSID (SYSID_MYGCS before 4.7) to --gcs-id; without it none is ever written
    #[arg(long, conflicts_with = "listen_only")]
    set_parameters: bool,
    /// Put the corners of the mission's fence on board where others or none are there, on the ground; without it the
    /// fence on board is read alone
    #[arg(long, conflicts_with = "listen_only")]
    set_fence: bool,
    /// Let the bridge arm the motor at take-off; else a person does
    #[arg(long)]
    may_arm: bool,
    /// File with the 64 hexadecimal digits of the key shared with the vehicle: frames are signed,
    /// unsigned ones refused [default: the vehicle's signing_key in the scenario]
    #[arg(long, value_name = "FILE")]
    signing_key: Option<PathBuf>,
    /// FlightGear that shows the vehicle, 50 packets a second
    #[arg(long, value_name = "HOST:PORT")]
    flightgear: Option<String>,
}

/// Flies a stand-in in the scenario's reality on a link, in real time.
#[derive(Debug, Parser)]
#[command(name = "mav-bridge stand-in", version, about)]
struct StandInArguments {
    /// Scenario file
    #[arg(long)]
    scenario: PathBuf,
    /// Id of the vehicle in the scenario
    #[arg(long)]
    vehicle: String,
    /// Where its ground station is
    #[arg(long, default_value = "udpout:127.0.0.1:14550")]
    link: LinkAddress,
    /// Seed of its gusts and sensor noise [default: the scenario's]
    #[arg(long)]
    seed: Option<u64>,
    /// End after this many seconds; else it flies until interrupted
    #[arg(long, value_name = "S")]
    duration: Option<f64>,
    /// File with the 64 hexadecimal digits of the key shared with its ground station
    #[arg(long, value_name = "FILE")]
    signing_key: Option<PathBuf>,
    /// Leave arming to the ground station; else its pilot arms it when it is in TAKEOFF
    #[arg(long)]
    hands_off: bool,
}

fn main() -> ExitCode {
    let filter = tracing_subscriber::EnvFilter::try_from_default_env()
        // Zenoh warns of each dial that fails, one a second while somebody is missing, which is said in other words.
        .unwrap_or_else(|_| tracing_subscriber::EnvFilter::new("warn,mav_bridge=info,zenoh=error"));
    tracing_subscriber::fmt()
        .with_env_filter(filter)
        .with_writer(std::io::stderr)
        .with_ansi(std::io::stderr().is_terminal())
        .init();
    // The first word tells which of the two it is; clap's subcommands do not go with options that
    // only the other one requires.
    let mut arguments_os = std::env::args_os();
    let is_stand_in = arguments_os.nth(1).is_some_and(|first| first == "stand-in");
    failure::exit(if is_stand_in {
        let name = std::iter::once("mav-bridge stand-in".into());
        let arguments = StandInArguments::parse_from(name.chain(arguments_os));
        agent::block_on(fly_stand_in(&arguments))
    } else {
        serve(&BridgeArguments::parse())
    })
}

/// The scenario's vehicle that is asked for: setup and index.
fn vehicle_of(scenario: &Path, id: &str) -> Result<(Setup, usize), Failure> {
    let setup = mission_files::load(scenario)?;
    let index = setup.index_of(id).map_err(Failure::input)?;
    Ok((setup, index))
}

fn serve(arguments: &BridgeArguments) -> Result<(), Failure> {
    let signing_key = arguments
        .signing_key
        .as_deref()
        .map(signing_key)
        .transpose()?;
    let ids: Vec<&str> = arguments.vehicle.iter().map(String::as_str).collect();
    if ids.len() > 1 && arguments.system_id.is_some() {
        return Err(Failure::usage(
            "--system-id: expected one vehicle, or the system_id of each in the scenario",
        ));
    }
    let options = VehicleOptions {
        flightgear: arguments.flightgear.iter().cloned().collect(),
        links: arguments.link.clone(),
        link_options: LinkOptions {
            may_arm: arguments.may_arm,
            listen_only: arguments.listen_only,
            dry_run: arguments.dry_run,
            set_parameters: arguments.set_parameters,
            set_fence: arguments.set_fence,
            system_id: arguments.system_id,
            component_id: arguments.component_id,
            gcs_system_id: arguments.gcs_id,
        },
        signing_key,
    };
    agent::run(&arguments.bus, false, |setup| {
        check_vehicles(setup, &ids, !options.links.is_empty())?;
        eprintln!(
            "'hand-back' and Enter gives vehicle {} back to automatic flight",
            ids.join(" and ")
        );
        agent::vehicles(setup, &ids, &options)
    })
}

/// Whether each of the vehicles has a link, and those that are to `share` one are told apart.
fn check_vehicles(setup: &Setup, ids: &[&str], share: bool) -> Result<(), Failure> {
    let mut systems = Vec::new();
    for id in ids {
        let index = setup.index_of(id).map_err(Failure::input)?;
        let vehicle = &setup.scenario.vehicles[index];
        if !share && vehicle.link.is_empty() {
            return Err(Failure::usage(format!(
                "vehicle {id} has no link in the scenario: expected --link"
            )));
        }
        let known = vehicle.system_id.filter(|system| !systems.contains(system));
        if share && ids.len() > 1 && known.is_none() {
            return Err(Failure::usage(format!(
                "vehicles {} share --link: expected a system_id of vehicle {id} in the scenario that no other has",
                ids.join(" and ")
            )));
        }
        systems.extend(known);
    }
    Ok(())
}

fn signing_key(file: &Path) -> Result<SigningKey, Failure> {
    let text = std::fs::read_to_string(file)
        .with_context(|| format!("{}: cannot read the signing key", file.display()))
        .map_err(Failure::Input)?;
    SigningKey::from_text(&text).map_err(|why| Failure::usage(format!("{}: {why}", file.display())))
}

async fn fly_stand_in(arguments: &StandInArguments) -> Result<(), Failure> {
    let (setup, index) = vehicle_of(&arguments.scenario, &arguments.vehicle)?;
    let mut config = setup.stand_in_config(index).map_err(Failure::input)?;
    let key = arguments
        .signing_key
        .as_deref()
        .map(signing_key)
        .transpose()?;
    config.signing = key.map(|key| signing_from(&key, SimTime::ZERO));
    let seed = arguments.seed.unwrap_or(setup.scenario.mission.seed);
    let name = format!("stand-in/{}", arguments.vehicle);
    let mut vehicle = StandIn::new(config, stream(seed, &name)).map_err(Failure::input)?;
    let mut link = Link::open(&arguments.link).await.map_err(Failure::input)?;
    eprintln!("stand-in {} on {}", arguments.vehicle, arguments.link);
    let start = Instant::now();
    let mut ticks = tokio::time::interval(Duration::from_nanos(setup.tick_ns().unsigned_abs()));
    ticks.set_missed_tick_behavior(tokio::time::MissedTickBehavior::Skip);
    loop {
        ticks.tick().await;
        if arguments
            .duration
            .is_some_and(|s| start.elapsed().as_secs_f64() >= s)
        {
            return Ok(());
        }
        let frames_in: Vec<Vec<u8>> = std::iter::from_fn(|| link.try_receive()).collect();
        let now = SimTime::from_ns(i64::try_from(start.elapsed().as_nanos()).unwrap_or(i64::MAX));
        for frame in vehicle.step(now, &frames_in) {
            link.send(frame);
        }
        if !arguments.hands_off && vehicle.custom_mode() == TAKEOFF && !vehicle.is_armed() {
            vehicle.arm_by_hand(true);
        }
    }
}
