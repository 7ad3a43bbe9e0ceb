//! `plumage campaign`: one scenario with many seeds, and a table.

use crate::flights::fly_all;
use crate::{Failure, mission_files, preflight};
use mission::Run;
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
    /// Search strategies to hold against each other, with commas between them, instead of the scenario's one
    #[arg(long, value_name = "NAMES", value_delimiter = ',')]
    pub strategies: Vec<String>,
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
    let fly = |strategy: &str| -> Result<Campaign, Failure> {
        let missions = fly_all(arguments.seeds, |seed| {
            let mut setup = setup.clone();
            setup.scenario.mission.seed = seed;
            setup.scenario.search.strategy = strategy.to_owned();
            campaign::fly(&setup)
        })?;
        Ok(Campaign { missions })
    };
    let table = if arguments.strategies.is_empty() {
        fly(&setup.scenario.search.strategy)?.to_markdown()
    } else {
        // A name that is none is found out before the first mission.
        for strategy in &arguments.strategies {
            let mut setup = setup.clone();
            setup.scenario.search.strategy = strategy.clone();
            Run::new(&setup).map_err(Failure::input)?;
        }
        let mut campaigns = Vec::new();
        for strategy in &arguments.strategies {
            campaigns.push((strategy.clone(), fly(strategy)?));
        }
        campaign::compared(&campaigns)
    };
    match &arguments.out {
        Some(file) => files::write_whole(file, table.as_bytes()).map_err(Failure::input)?,
        None => print!("{table}"),
    }
    Ok(())
}
