//! `plumage campaign`: one scenario with many seeds, and a table.

use crate::flights::fly_all;
use crate::{Failure, mission_files, preflight};
use mission::campaign::{self, Campaign};
use record::files;
use std::path::PathBuf;

/// Arguments of `plumage campaign`.
#[derive(Debug, clap::Args)]
pub struct CampaignArguments {
    /// Scenario to fly (TOML)
    pub scenario: PathBuf,
    /// Number of seeds, from 1
    #[arg(long, default_value_t = 20, value_parser = clap::value_parser!(u64).range(1..=100_000))]
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
    let mut setup = mission_files::load(&arguments.scenario)?;
    if let Some(count) = arguments.real_stand_ins {
        setup = setup.with_stand_ins(count).map_err(Failure::input)?;
    }
    preflight::check(&setup)?;
    let missions = fly_all(arguments.seeds, |seed| {
        let mut setup = setup.clone();
        setup.scenario.mission.seed = seed;
        campaign::fly(&setup)
    })?;
    let table = Campaign { missions }.to_markdown();
    match &arguments.out {
        Some(file) => files::write_whole(file, table.as_bytes()).map_err(Failure::input)?,
        None => print!("{table}"),
    }
    Ok(())
}
