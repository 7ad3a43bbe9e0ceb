//! `plumage campaign`: one scenario with many seeds, and a table.

use crate::commands::run::interrupt_flag;
use crate::{Failure, mission_files, preflight};
use indicatif::ProgressBar;
use mission::campaign::{self, Campaign};
use plume::Gas;
use record::files;
use std::path::PathBuf;
use std::sync::Mutex;
use std::sync::atomic::Ordering;

/// Arguments of `plumage campaign`.
#[derive(Debug, clap::Args)]
pub struct CampaignArguments {
    /// Scenario to fly (TOML)
    pub scenario: PathBuf,
    /// Gas that is read: that of the first source if not given
    #[arg(long, value_name = "GAS")]
    pub gas: Option<Gas>,
    /// Number of seeds, from 1
    #[arg(long, default_value_t = 20)]
    pub seeds: u64,
    /// Make the last N vehicles of the team stand-ins for real ones, the others simulated
    #[arg(long, value_name = "N")]
    pub real_stand_ins: Option<usize>,
    /// File for the table (Markdown); standard output if not given
    #[arg(long, value_name = "FILE")]
    pub out: Option<PathBuf>,
}

/// Flies the scenario with every seed and tells what they show together.
///
/// # Errors
/// Wrong input, or a mission that cannot be flown.
pub fn campaign(arguments: &CampaignArguments) -> Result<(), Failure> {
    let setup = mission_files::load(&arguments.scenario)?;
    let mut setup = mission_files::for_gas(setup, arguments.gas)?;
    if let Some(count) = arguments.real_stand_ins {
        setup = setup.with_stand_ins(count).map_err(Failure::input)?;
    }
    preflight::check(&setup)?;
    let bar = ProgressBar::new(arguments.seeds);
    bar.tick();
    let stop = interrupt_flag()?;
    let next = Mutex::new(1..=arguments.seeds);
    let threads = std::thread::available_parallelism().map_or(1, usize::from);
    let fly_some = || -> Result<Vec<record::summary::MissionSummary>, mission::MissionError> {
        let mut flown = Vec::new();
        while !stop.load(Ordering::Relaxed) {
            let seed = next
                .lock()
                .unwrap_or_else(std::sync::PoisonError::into_inner)
                .next();
            let Some(seed) = seed else { break };
            let mut setup = setup.clone();
            setup.scenario.mission.seed = seed;
            flown.push(campaign::fly(&setup)?);
            bar.inc(1);
        }
        Ok(flown)
    };
    let mut missions = std::thread::scope(|scope| -> Result<_, Failure> {
        let workers: Vec<_> = (0..threads).map(|_| scope.spawn(fly_some)).collect();
        let mut missions = Vec::new();
        for worker in workers {
            let flown = worker
                .join()
                .map_err(|_| Failure::usage("a mission ended unexpectedly"))?;
            missions.extend(flown.map_err(Failure::input)?);
        }
        Ok(missions)
    })?;
    bar.finish_and_clear();
    missions.sort_by_key(|m| m.seed);
    let table = Campaign { missions }.to_markdown();
    match &arguments.out {
        Some(file) => files::write_whole(file, table.as_bytes()).map_err(Failure::input)?,
        None => print!("{table}"),
    }
    Ok(())
}
