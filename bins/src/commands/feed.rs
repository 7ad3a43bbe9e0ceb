//! `plumage feed`: observations into a mission that runs in processes in real time.

use crate::feeding::{FeedFiles, FeedOptions, LineFeed, Start};
use crate::pace::Speed;
use crate::{Failure, agent, presence};
use mission::Setup;
use mission::fed_vehicle::FedVehicle;
use net::Net;
use net::realtime::{self, MissionClock};
use protocol::{AgentId, SimTime};
use std::path::PathBuf;
use std::sync::Arc;
use tokio::sync::Notify;

/// Arguments of `plumage feed`.
#[derive(Debug, clap::Args)]
#[command(after_help = "Example: plumage feed obs.csv --scenario scenarios/as-pontes.toml")]
pub struct FeedArguments {
    /// Observations (CSV or MCAP recordings), or - for CSV lines or JSON objects on standard input
    #[arg(required = true, value_name = "OBS")]
    pub observations: Vec<PathBuf>,
    /// Mapping file (TOML) to read logs of other formats, as from `plumage import`
    #[arg(long, value_name = "FILE")]
    pub map: Option<PathBuf>,
    /// Id of the vehicle in the mission [default: the platform's name; "feed" for standard input]
    #[arg(long, value_name = "ID")]
    pub id: Option<String>,
    /// Speed of the rows: real, max, or a factor of real time above 0
    #[arg(long, default_value = "real")]
    pub speed: Speed,
    /// Mission time of the first row, 0 to 1000000 s, or `file` for the times in the file [default: at once]
    #[arg(long, value_name = "S|file")]
    pub start: Option<Start>,
    #[command(flatten)]
    bus: agent::BusArguments,
}

/// Joins the mission, says all rows, and leaves.
///
/// # Errors
/// Wrong input, a vehicle that is there already, or a bus that fails.
pub fn feed(arguments: &FeedArguments) -> Result<(), Failure> {
    let setup = arguments.bus.setup()?;
    if arguments.bus.lockstep {
        return Err(Failure::usage(
            "feed needs a mission in real time; start without --lockstep (for virtual time, use plumage run --feed)",
        ));
    }
    let options = FeedOptions {
        files: &arguments.observations,
        map: arguments.map.as_deref(),
        id: arguments.id.as_deref(),
        start: arguments.start,
        speed: arguments.speed,
    };
    if options.is_stream() && options.map.is_some() {
        return Err(Failure::usage(
            "--map applies to files only; expected lines with Plumage's columns on standard input",
        ));
    }
    // Wrong input is told before anybody is waited for.
    let source = Source::open(&setup, &options)?;
    agent::block_on(async {
        let mut net = arguments.bus.open(&setup, false).await?;
        let ids: Vec<String> = source.ids().iter().map(|id| format!("va/{id}")).collect();
        let connects_to = arguments.bus.connected_to(false);
        let watch = presence::watch(&net, &setup, &ids, connects_to, false)?;
        // What is said before those are there to whom it matters is lost.
        net.wait_for(&[AgentId::sc(), AgentId::ws()]).await;
        let clock = MissionClock::ask(&net).await?;
        if let Some(id) = ids.iter().find(|id| net.peers().contains(*id)) {
            return Err(Failure::usage(format!(
                "{id} is on the bus already; expected another --id"
            )));
        }
        let fed = source.feed(&setup, &options, &mut net, clock).await?;
        watch.abort();
        net.leave().await;
        println!("{fed}");
        Ok(())
    })
}

/// Where rows come from.
enum Source {
    Files(FeedFiles),
    Lines(Box<LineFeed>),
}

impl Source {
    fn open(setup: &Setup, options: &FeedOptions<'_>) -> Result<Self, Failure> {
        if !options.is_stream() {
            return Ok(Self::Files(FeedFiles::open(setup, options)?));
        }
        Ok(Self::Lines(Box::new(LineFeed::new(setup, options)?)))
    }

    fn ids(&self) -> &[String] {
        match self {
            Self::Files(files) => files.ids(),
            Self::Lines(lines) => std::slice::from_ref(lines.id()),
        }
    }

    /// Says all rows, until they or the mission end. What was done, in words.
    async fn feed(
        self,
        setup: &Setup,
        options: &FeedOptions<'_>,
        net: &mut Net,
        clock: MissionClock,
    ) -> Result<String, Failure> {
        let ids = self.ids().join(", ");
        let (mut vehicles, mut lines) = match self {
            Self::Files(files) => (files.vehicles(setup, options, clock.now())?.0, None),
            Self::Lines(lines) => (vec![lines.vehicle(setup)?], Some(lines)),
        };
        let until = SimTime::from_s(setup.scenario.mission.duration_s);
        let finished = Arc::new(Notify::new());
        let mut wrong = None;
        let (last, mut all_said) = (vehicles.len() - 1, true);
        let ends = |due: SimTime, _: &mut [FedVehicle]| due >= until;
        let mut around = (ends, {
            let (finished, lines, wrong) = (Arc::clone(&finished), &mut lines, &mut wrong);
            move |k, vehicle: &mut FedVehicle| {
                if let Some(lines) = lines
                    && let Err(failure) = lines.serve(vehicle, clock.now())
                {
                    *wrong = Some(failure);
                    finished.notify_one();
                }
                // Asked before a tick: what was said in the last one has gone out.
                let more = lines.as_ref().is_some_and(|l| !l.has_ended());
                all_said = (all_said || k == 0) && vehicle.has_said_all() && !more;
                if k == last && all_said {
                    finished.notify_one();
                }
            }
        });
        let run = realtime::run(net, &mut vehicles, clock, setup.tick_ns(), &mut around);
        tokio::select! {
            done = run => done?,
            () = finished.notified() => {}
        }
        match wrong {
            Some(failure) => Err(failure),
            None => Ok(match lines {
                Some(lines) => format!("{ids}: {}", lines.tally()),
                None => format!(
                    "{ids}: fed all rows up to {:.0} s of mission time",
                    clock.now().s()
                ),
            }),
        }
    }
}
