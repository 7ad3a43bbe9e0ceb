//! The recorder in a process of its own.

use clap::Parser;
use net::lockstep;
use net::realtime::{self, MissionClock};
use programs::outputs::Outputs;
use programs::presence::RollCall;
use programs::ros2::{Ros2, Ros2Arguments};
use programs::{Failure, agent, failure, presence, site};
use protocol::SimTime;
use protocol::bus::Publication;
use protocol::message::Severity;
use record::gaps::Gaps;
use std::path::PathBuf;
use std::process::ExitCode;
use std::sync::Arc;
use std::time::Instant;

/// Record a running mission: MCAP, tracks, summary and report
#[derive(Debug, Parser)]
#[command(
    name = "recorder",
    version,
    about,
    after_help = "Example: recorder --scenario scenarios/as-pontes.toml --out out/recorded"
)]
struct Arguments {
    #[command(flatten)]
    bus: agent::BusArguments,
    /// Folder for the outputs
    #[arg(long, value_name = "DIR", help_heading = "Outputs")]
    out: PathBuf,
    /// Write into a folder that is not empty, and replace earlier outputs
    #[arg(long, help_heading = "Outputs")]
    force: bool,
    #[command(flatten)]
    ros2: Ros2Arguments,
}

fn main() -> ExitCode {
    failure::exit(record(&failure::arguments::<Arguments>()))
}

fn record(arguments: &Arguments) -> Result<(), Failure> {
    let setup = arguments.bus.setup()?;
    let site = Arc::new(site::of(&setup)?);
    let mut outputs = Outputs::open(&arguments.out, arguments.force, &setup, site)?;
    if !arguments.bus.lockstep {
        outputs.is_in_real_time();
    }
    let mut digest = protocol::digest::Digest::new();
    let started = Instant::now();
    let mut now = SimTime::ZERO;
    let mut gaps = Gaps::default();
    let mut roll = RollCall::of(&setup)?;
    let mut ros2 = Ros2::open(&arguments.ros2, &setup)?;
    let mut take = |outputs: &mut Outputs, said: &[Publication]| {
        for (topic, envelope) in said {
            digest.add(topic, envelope);
            now = now.max(envelope.time);
        }
        if let Some(ros2) = &mut ros2 {
            ros2.take(said);
        }
        outputs.take(said);
    };
    let observed = agent::block_on(async {
        let mut net = arguments.bus.open(&setup, false).await?;
        let (connects_to, lockstep) = (arguments.bus.connected_to(false), arguments.bus.lockstep);
        let watch = presence::watch(&net, &setup, &[], connects_to, lockstep)?;
        if arguments.bus.lockstep {
            let team = mission::team::agent_ids(&setup).map_err(Failure::input)?;
            lockstep::observe(
                &mut net,
                &team,
                setup.tick_ns(),
                |said: &[Publication]| {
                    take(&mut outputs, said);
                    Ok::<(), Failure>(())
                },
            )
            .await?;
        } else {
            let clock = MissionClock::ask(&net).await?;
            let until = SimTime::from_s(setup.scenario.mission.duration_s);
            let present = net.presence();
            realtime::observe(&mut net, clock, until, |said: &[Publication]| {
                take(&mut outputs, said);
                for (_, envelope) in said {
                    if let Some(found) = gaps.take(envelope) {
                        let words = found.words(&envelope.sender);
                        eprintln!("warning: {words}");
                        outputs.note(envelope.time, Severity::Warning, "lost", &words);
                    }
                }
                let last_heard = |id: &str| present.last_heard(id).map(|at| clock.at(at));
                for change in roll.call(&present.now(), last_heard, clock.now()) {
                    outputs.note(clock.now(), change.severity, change.code, &change.text);
                }
                Ok::<(), Failure>(())
            })
            .await?;
        }
        watch.abort();
        net.close().await;
        Ok(())
    });
    if let Some(ros2) = ros2 {
        ros2.close();
    }
    if let Err(why) = &observed {
        outputs.note(now, Severity::Error, "ended", &why.words());
    }
    let (summary, written) = outputs.finish(&digest.hex(), started.elapsed().as_secs_f64());
    print!("{}", record::text::summary(&summary));
    if gaps.missing() > 0 {
        println!(
            "{} messages were lost on the way; events in the recording give the times.",
            gaps.missing()
        );
    }
    observed?;
    written?;
    if summary.vehicles.is_empty() {
        return Err(Failure::Run(anyhow::anyhow!(
            "no vehicle published anything; check that the va processes run and can reach this one"
        )));
    }
    Ok(())
}
