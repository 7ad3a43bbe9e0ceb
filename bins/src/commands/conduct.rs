//! `plumage conduct`: the conductor of a lockstep run whose agents are processes of their own.

use crate::outputs::Outputs;
use crate::progress::Bar;
use crate::{Failure, agent, presence, site};
use mission::team;
use net::lockstep::Conductor;
use protocol::digest::Digest;
use protocol::message::Severity;
use protocol::{AgentId, SimTime};
use std::path::PathBuf;
use std::sync::Arc;
use std::time::Instant;

/// Arguments of `plumage conduct`.
#[derive(Debug, clap::Args)]
#[command(
    after_help = "Example: plumage conduct --scenario scenarios/as-pontes.toml --duration 60 --out out/lockstep"
)]
pub struct ConductArguments {
    #[command(flatten)]
    bus: agent::BusArguments,
    /// Folder for the outputs [default: write none]
    #[arg(long, value_name = "DIR", help_heading = "Outputs")]
    out: Option<PathBuf>,
    /// Write into a folder that is not empty, and replace earlier outputs
    #[arg(long, help_heading = "Outputs")]
    force: bool,
    /// Wait for a recorder process before the first tick
    #[arg(long, help_heading = "Outputs")]
    with_recorder: bool,
}

/// Conducts the run and prints its digest.
///
/// # Errors
/// Wrong input, or an agent that goes before the end.
pub fn conduct(arguments: &ConductArguments) -> Result<(), Failure> {
    let setup = arguments.bus.setup()?;
    let mut team = team::agent_ids(&setup).map_err(Failure::input)?;
    if arguments.with_recorder {
        team.push(AgentId::recorder());
    }
    let mut outputs = match &arguments.out {
        None => None,
        Some(folder) => {
            let site = Arc::new(site::of(&setup)?);
            Some(Outputs::open(folder, arguments.force, &setup, site)?)
        }
    };
    let bar = Bar::new(
        "conducting ticks",
        setup.ticks(),
        "{wide_bar} {pos}/{len} {msg}",
    );
    let mut digest = Digest::new();
    let mut started = Instant::now();
    let mut now = SimTime::ZERO;
    let conducted = agent::block_on(async {
        let own = [AgentId::clock().to_string()];
        let mut net = arguments.bus.open_as(&setup, false, &own).await?;
        bar.set_message("waiting for the team");
        let watch = presence::watch(&net, &setup, &own, arguments.bus.connected_to(false), true)?;
        let mut conductor = Conductor::gather(&mut net, &team, setup.tick_ns()).await?;
        started = Instant::now();
        for tick in 0..=setup.ticks() {
            let said = conductor.step(&mut net, tick == setup.ticks()).await?;
            for (topic, envelope) in &said {
                digest.add(topic, envelope);
            }
            if let Some(outputs) = &mut outputs {
                outputs.take(&said);
            }
            now = conductor.now();
            for refused in conductor.refused() {
                bar.println(&format!("warning: {refused}"));
            }
            bar.set_position(tick);
        }
        watch.abort();
        conductor.close(&mut net).await?;
        net.close().await;
        Ok(())
    });
    bar.finish_and_clear();
    let wall_s = started.elapsed().as_secs_f64();
    let mut written = Ok(());
    if let Some(mut outputs) = outputs {
        if let Err(why) = &conducted {
            outputs.note(now, Severity::Error, "ended", &why.words());
        }
        let (summary, all) = outputs.finish(&digest.hex(), wall_s);
        print!("{}", record::text::summary(&summary));
        written = all;
    }
    println!("digest {}", digest.hex());
    conducted?;
    written
}
