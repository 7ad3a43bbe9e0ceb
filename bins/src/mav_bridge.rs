//! A real vehicle of the team: the bridge between its MAVLink and the bus. Also a stand-in for
//! one on a link of its own, for those who have no aircraft at hand.

use anyhow::Context as _;
use clap::{Args, Parser, Subcommand};
use mav_bridge::arduplane::TAKEOFF;
use mav_bridge::link::{Link, LinkAddress};
use mission::Setup;
use mission::real_vehicle::RealVehicle;
use protocol::SimTime;
use protocol::key::Name;
use protocol::net::realtime::{self, MissionClock};
use protocol::net::{DEFAULT_ENDPOINT, Net, NetOptions};
use scenario::random::stream;
use shell::{Failure, failure, mission_files};
use stand_in::{StandIn, StandInConfig};
use std::path::PathBuf;
use std::process::ExitCode;
use std::sync::mpsc;
use std::time::{Duration, Instant};

/// Joins the bus as a real vehicle whose autopilot (ArduPlane) is on a MAVLink link.
#[derive(Debug, Parser)]
#[command(
    name = "mav-bridge",
    version,
    about,
    args_conflicts_with_subcommands = true,
    subcommand_negates_reqs = true
)]
struct Arguments {
    #[command(subcommand)]
    command: Option<Command>,
    #[command(flatten)]
    bridge: Option<BridgeArguments>,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Fly a stand-in in the scenario's reality on a link, in real time
    StandIn(StandInArguments),
}

#[derive(Debug, Args)]
struct BridgeArguments {
    /// Scenario file
    #[arg(long)]
    scenario: PathBuf,
    /// Id of the vehicle in the scenario
    #[arg(long)]
    vehicle: String,
    /// Where the vehicle is: udpin:HOST:PORT, udpout:HOST:PORT, tcp:HOST:PORT or tcpin:HOST:PORT
    /// [default: the vehicle's link in the scenario]
    #[arg(long)]
    link: Option<LinkAddress>,
    /// Bus endpoint to connect to; may be given several times
    #[arg(long, default_value = DEFAULT_ENDPOINT)]
    connect: Vec<String>,
    /// Publish JSON instead of the binary encoding
    #[arg(long)]
    json: bool,
}

#[derive(Debug, Args)]
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
    /// Leave arming to the ground station; else its pilot arms it when it is in TAKEOFF
    #[arg(long)]
    hands_off: bool,
}

fn main() -> ExitCode {
    let filter = tracing_subscriber::EnvFilter::try_from_default_env()
        .unwrap_or_else(|_| tracing_subscriber::EnvFilter::new("warn,mav_bridge=info"));
    tracing_subscriber::fmt()
        .with_env_filter(filter)
        .with_writer(std::io::stderr)
        .init();
    let arguments = Arguments::parse();
    failure::exit(match (arguments.command, arguments.bridge) {
        (Some(Command::StandIn(stand_in)), _) => block_on(fly_stand_in(&stand_in)),
        (None, Some(bridge)) => block_on(serve(&bridge)),
        (None, None) => Err(Failure::usage("expected --scenario, --vehicle and --link")),
    })
}

fn block_on(work: impl Future<Output = Result<(), Failure>>) -> Result<(), Failure> {
    tokio::runtime::Builder::new_multi_thread()
        .enable_all()
        .build()
        .context("cannot start the runtime")?
        .block_on(work)
}

/// The scenario's vehicle that is asked for: setup and index.
fn vehicle_of(scenario: &std::path::Path, id: &str) -> Result<(Setup, usize), Failure> {
    let setup = mission_files::load(scenario)?;
    let index = setup.index_of(id).map_err(Failure::input)?;
    Ok((setup, index))
}

async fn serve(arguments: &BridgeArguments) -> Result<(), Failure> {
    let (setup, index) = vehicle_of(&arguments.scenario, &arguments.vehicle)?;
    let address = match (&arguments.link, &setup.scenario.vehicles[index].link) {
        (Some(address), _) => address.clone(),
        (None, Some(text)) => text.parse().map_err(Failure::input)?,
        (None, None) => {
            return Err(Failure::usage(format!(
                "vehicle {} has no link in the scenario: expected --link",
                arguments.vehicle
            )));
        }
    };
    let mut vehicle = RealVehicle::with_link(&setup, index).map_err(Failure::input)?;
    let mut link = Link::open(&address).await.map_err(Failure::input)?;
    let options = NetOptions {
        connect: arguments.connect.clone(),
        json: arguments.json,
        ..NetOptions::default()
    };
    let name = Name::new(&setup.scenario.mission.name).map_err(Failure::input)?;
    let mut net = Net::open(name, &options).await?;
    eprintln!(
        "vehicle {} on {address}; 'hand-back' and Enter gives it back to automatic flight",
        arguments.vehicle
    );
    let clock = MissionClock::ask(&net).await?;
    let words = typed_words();
    let until = SimTime::from_s(setup.scenario.mission.duration_s);
    realtime::run(
        &mut net,
        &mut vehicle,
        clock,
        setup.tick_ns(),
        until,
        |vehicle, _, _| {
            while let Ok(word) = words.try_recv() {
                match word.trim() {
                    "hand-back" => vehicle.hand_back(),
                    "" => {}
                    other => eprintln!("'{other}': expected 'hand-back'"),
                }
            }
            if let Some(buffers) = vehicle.link() {
                while let Some(bytes) = link.try_receive() {
                    buffers.from_vehicle.push(bytes);
                }
                for frame in buffers.to_vehicle.drain(..) {
                    link.send(frame);
                }
            }
        },
    )
    .await?;
    net.close().await?;
    Ok(())
}

/// Lines typed on standard input, read on a thread of their own that ends with the process.
fn typed_words() -> mpsc::Receiver<String> {
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

async fn fly_stand_in(arguments: &StandInArguments) -> Result<(), Failure> {
    let (setup, index) = vehicle_of(&arguments.scenario, &arguments.vehicle)?;
    let aircraft = setup.aircraft_of(index).map_err(Failure::input)?.clone();
    let mut config =
        StandInConfig::from_scenario(&setup.scenario, index, aircraft).map_err(Failure::input)?;
    config.wind_series = setup.wind_series.clone();
    let seed = arguments.seed.unwrap_or(setup.scenario.mission.seed);
    let name = format!("stand-in/{}", arguments.vehicle);
    let mut vehicle = StandIn::new(config, stream(seed, &name)).map_err(Failure::input)?;
    let mut link = Link::open(&arguments.link).await.map_err(Failure::input)?;
    eprintln!("stand-in {} on {}", arguments.vehicle, arguments.link);
    let start = Instant::now();
    let mut ticks = tokio::time::interval(Duration::from_nanos(setup.tick_ns().unsigned_abs()));
    ticks.set_missed_tick_behavior(tokio::time::MissedTickBehavior::Skip);
    let mut interrupted = std::pin::pin!(tokio::signal::ctrl_c());
    loop {
        tokio::select! {
            _ = &mut interrupted => return Ok(()),
            _ = ticks.tick() => {}
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
