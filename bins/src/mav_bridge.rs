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
use programs::{Failure, failure, mission_files, ranges};
use protocol::SimTime;
use scenario::random::stream;
use stand_in::StandIn;
use std::io::IsTerminal;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::{Duration, Instant};

/// Connect real vehicles (ArduPlane or PX4) to the bus over MAVLink
///
/// `mav-bridge stand-in` simulates an ArduPlane on a link of its own; see `mav-bridge stand-in --help`.
#[derive(Debug, Parser)]
#[command(
    name = "mav-bridge",
    version,
    about,
    after_help = "Example: mav-bridge --scenario scenarios/as-pontes.toml --vehicle 6 --link udpin:0.0.0.0:14550"
)]
struct BridgeArguments {
    #[command(flatten)]
    bus: agent::BusArguments,
    /// Ids of the vehicles in the scenario, separated by commas; several vehicles share the links and need different
    /// values of system_id in the scenario
    #[arg(
        long,
        value_name = "ID",
        value_delimiter = ',',
        required = true,
        help_heading = "Vehicle"
    )]
    vehicle: Vec<String>,
    /// MAVLink link to the vehicle: udpin:HOST:PORT, udpout:HOST:PORT, tcp:HOST:PORT, tcpin:HOST:PORT or
    /// serial:PATH:BAUD; repeatable for redundant links [default: the vehicle's link in the scenario]
    #[arg(long, value_name = "LINK", help_heading = "Vehicle")]
    link: Vec<LinkAddress>,
    /// MAVLink system id of the vehicle, 1 to 255 [default: its system_id in the scenario, else the first one received]
    #[arg(
        long,
        value_name = "N",
        value_parser = clap::value_parser!(u8).range(1..),
        help_heading = "Vehicle"
    )]
    system_id: Option<u8>,
    /// MAVLink component id of its autopilot, 1 to 255 [default: its component_id in the scenario, else 1]
    #[arg(
        long,
        value_name = "N",
        value_parser = clap::value_parser!(u8).range(1..),
        help_heading = "Vehicle"
    )]
    component_id: Option<u8>,
    /// MAVLink system id of this bridge, 1 to 255; the vehicle's MAV_GCS_SYSID (SYSID_MYGCS before 4.7) must equal it
    /// [default: the vehicle's gcs_system_id in the scenario, else 255]
    #[arg(
        long,
        value_name = "N",
        value_parser = clap::value_parser!(u8).range(1..),
        help_heading = "Vehicle"
    )]
    gcs_id: Option<u8>,
    /// Send nothing, not even heartbeats or requests; only receive what the vehicle sends by itself
    #[arg(long, help_heading = "Safety")]
    listen_only: bool,
    /// Send only requests for parameters and the fence; log every other frame (heartbeat, rate, mode, setpoint) instead
    /// of sending it
    #[arg(long, conflicts_with = "listen_only", help_heading = "Safety")]
    dry_run: bool,
    /// Correct wrong parameters on the ground: FS_GCS_ENABL and FS_LONG_ACTN to 1, MAV_GCS_SYSID (SYSID_MYGCS before
    /// 4.7) to --gcs-id [default: never write a parameter]
    #[arg(long, conflicts_with = "listen_only", help_heading = "Safety")]
    set_parameters: bool,
    /// Upload the mission's fence on the ground if the fence on board differs or is missing [default: only compare it]
    #[arg(long, conflicts_with = "listen_only", help_heading = "Safety")]
    set_fence: bool,
    /// Arm the motor at take-off [default: wait until a person arms it]
    #[arg(long, help_heading = "Safety")]
    may_arm: bool,
    /// File with the MAVLink signing key shared with the vehicle, 64 hexadecimal digits: sign all frames and reject
    /// unsigned ones [default: the vehicle's signing_key in the scenario]
    #[arg(long, value_name = "FILE", help_heading = "Safety")]
    signing_key: Option<PathBuf>,
    /// Show the vehicle in the FlightGear at HOST:PORT, with 50 packets a second
    #[arg(long, value_name = "HOST:PORT", help_heading = "Integrations")]
    flightgear: Option<String>,
}

/// Simulate a real ArduPlane on a MAVLink link, in the scenario's reality and in real time
#[derive(Debug, Parser)]
#[command(
    name = "mav-bridge stand-in",
    version,
    about,
    after_help = "Example: mav-bridge stand-in --scenario scenarios/as-pontes.toml --vehicle 6"
)]
struct StandInArguments {
    /// Scenario (TOML)
    #[arg(long, value_name = "FILE")]
    scenario: PathBuf,
    /// Id of the vehicle in the scenario
    #[arg(long, value_name = "ID")]
    vehicle: String,
    /// MAVLink link to its ground station, in the forms of `mav-bridge --link`
    #[arg(long, value_name = "LINK", default_value = "udpout:127.0.0.1:14550")]
    link: LinkAddress,
    /// Seed of its gusts and sensor noise, 0 to 2^63 - 1 [default: the scenario's]
    #[arg(long, value_name = "N", value_parser = ranges::seed)]
    seed: Option<u64>,
    /// Stop after this time, 1 to 1000000 s [default: fly until interrupted]
    #[arg(long, value_name = "S", value_parser = ranges::duration_s)]
    duration: Option<f64>,
    /// File with the MAVLink signing key shared with its ground station, 64 hexadecimal digits
    #[arg(long, value_name = "FILE")]
    signing_key: Option<PathBuf>,
    /// Leave arming to the ground station [default: a simulated pilot arms it in mode TAKEOFF]
    #[arg(long)]
    hands_off: bool,
}

fn main() -> ExitCode {
    let filter = tracing_subscriber::EnvFilter::try_from_default_env()
        // Zenoh warns of each failed dial, one a second while a process is missing; `presence` reports that.
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
            "--system-id: applies to one vehicle only; for several, set system_id of each vehicle in the scenario",
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
            "type 'hand-back' and Enter to return vehicle {} to automatic flight",
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
                "vehicle {id}: the scenario names no link; expected --link, such as udpin:0.0.0.0:14550"
            )));
        }
        let known = vehicle.system_id.filter(|system| !systems.contains(system));
        if share && ids.len() > 1 && known.is_none() {
            return Err(Failure::usage(format!(
                "vehicles {} share --link: expected a system_id for vehicle {id} in the scenario that no other vehicle has",
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
