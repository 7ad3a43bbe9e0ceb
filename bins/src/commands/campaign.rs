//! `plumage campaign`: many missions of one scenario, and what they show beside each other.

use crate::flights::fly_all;
use crate::mission_files::LengthAndGas;
use crate::{Failure, mission_files, ranges, reports};
use record::campaign::folder::{self, CampaignFolder};
use record::campaign::{MissionKey, MissionRow, Question, Shard, table};
use record::files;
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::str::FromStr;
use std::sync::Mutex;
use tasks::campaign::{Campaign, Varied, tables, twice};
use views::campaign_report;

/// Arguments of `plumage campaign`.
#[derive(Debug, clap::Args)]
#[command(
    args_conflicts_with_subcommands = true,
    subcommand_negates_reqs = true,
    after_help = "Example: plumage campaign scenarios/as-pontes.toml --seeds 20 --strategies posterior,cs-ea --out out/campaign"
)]
pub struct CampaignArguments {
    /// Further subcommands.
    #[command(subcommand)]
    pub then: Option<CampaignCommand>,
    /// Scenario to fly (TOML)
    #[arg(required = true)]
    pub scenario: Option<PathBuf>,
    /// Seeds to fly: a number (1 to 100000), a range such as 5..12, or a list such as 1,4,9
    #[arg(
        long,
        default_value = "20",
        value_name = "SEEDS",
        allow_hyphen_values = true,
        help_heading = "Mission"
    )]
    pub seeds: Seeds,
    /// Search strategies to compare, separated by commas; particle-swarm, ascent and random are baselines [default: the scenario's]
    #[arg(
        long,
        value_name = "NAMES",
        value_delimiter = ',',
        help_heading = "Mission"
    )]
    pub strategies: Vec<String>,
    /// Realities to compare, separated by commas: names from docs/campaign.md (joined by +), or TOML files with the
    /// tables of a `[reality]` [default: the scenario's]
    #[arg(
        long,
        value_name = "NAMES",
        value_delimiter = ',',
        help_heading = "Mission"
    )]
    pub realities: Vec<String>,
    /// Team sizes to compare, separated by commas, 1 or more each [default: the scenario's]
    #[arg(
        long,
        value_name = "COUNTS",
        value_delimiter = ',',
        value_parser = ranges::whole(1..=ranges::TEAM),
        help_heading = "Mission"
    )]
    pub vehicles: Vec<usize>,
    /// Fly the last N vehicles of the team as stand-ins, simulated ArduPlanes in place of real aircraft, and simulate
    /// the others, 0 to the team's size
    #[arg(
        long,
        value_name = "N",
        value_parser = ranges::whole(0..=ranges::TEAM),
        help_heading = "Mission"
    )]
    pub real_stand_ins: Option<usize>,
    /// Length and gas
    #[command(flatten)]
    pub length_and_gas: LengthAndGas,
    /// Fly only shard K of N shards, such as 1/4; `plumage campaign merge` combines them
    #[arg(long, value_name = "K/N", help_heading = "Mission")]
    pub shard: Option<Shard>,
    /// Folder for missions, tables and report; an unfinished campaign in it is resumed. A file (.md) gets only the
    /// table [default: print the table]
    #[arg(long, value_name = "DIR", help_heading = "Outputs")]
    pub out: Option<PathBuf>,
    /// Write into a folder that holds other files
    #[arg(long, help_heading = "Outputs")]
    pub force: bool,
}

/// What else `plumage campaign` does.
#[derive(Debug, clap::Subcommand)]
pub enum CampaignCommand {
    /// Merge the shards of a campaign
    Merge(MergeArguments),
}

/// Arguments of `plumage campaign merge`.
#[derive(Debug, clap::Args)]
#[command(after_help = "Example: plumage campaign merge out/part-* --out out/campaign")]
pub struct MergeArguments {
    /// Folders of all shards
    #[arg(required = true)]
    pub folders: Vec<PathBuf>,
    /// Folder for missions, tables and report
    #[arg(long, value_name = "DIR")]
    pub out: PathBuf,
    /// Write into a folder that holds other files
    #[arg(long)]
    pub force: bool,
}

/// Most seeds of a campaign.
const MOST_SEEDS: u64 = 100_000;

/// Seeds of a campaign.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Seeds(pub Vec<u64>);

impl FromStr for Seeds {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let number = |text: &str| text.trim().parse::<u64>().ok();
        let seeds = if let Some((from, to)) = text.split_once("..") {
            let ends = number(from).zip(number(to.trim_start_matches('=')));
            ends.filter(|(from, to)| from <= to && to - from < MOST_SEEDS)
                .map(|(from, to)| (from..=to).collect())
        } else if text.contains(',') {
            text.split(',').map(number).collect()
        } else {
            let count = number(text).filter(|n| (1..=MOST_SEEDS).contains(n));
            count.map(|count| (1..=count).collect())
        };
        let seeds: Vec<u64> = seeds.ok_or_else(|| {
            format!(
                "expected a number of seeds, 1 to {MOST_SEEDS}, or seeds such as 5..12 or 1,4,9"
            )
        })?;
        twice(&seeds).map_or(Ok(Self(seeds.clone())), |seed| {
            Err(format!("seed {seed} is listed twice"))
        })
    }
}

/// Flies the missions that are asked for, and tells what they show together.
///
/// # Errors
/// Wrong input, or a mission that cannot be flown.
pub fn campaign(arguments: &CampaignArguments) -> Result<(), Failure> {
    if let Some(CampaignCommand::Merge(arguments)) = &arguments.then {
        return merge(arguments);
    }
    let Some(file) = &arguments.scenario else {
        return Err(Failure::usage("expected a scenario (TOML)"));
    };
    let setup = arguments.length_and_gas.setup(file, None)?;
    let varied = Varied {
        strategies: arguments.strategies.clone(),
        realities: arguments.realities.clone(),
        vehicles: arguments.vehicles.clone(),
        real_stand_ins: arguments.real_stand_ins,
        seeds: arguments.seeds.0.clone(),
    };
    let beside = file.parent().unwrap_or(Path::new(""));
    let campaign = Campaign::new(setup, beside, &varied).map_err(mission_files::option)?;
    for warning in campaign.check().map_err(Failure::input)? {
        eprintln!("warning: before take-off: {warning}");
    }
    let fleet = Fleet(campaign);
    let folder = arguments.out.as_ref().filter(|out| !is_table(out));
    let Some(folder) = folder else {
        if arguments.shard.is_some() {
            return Err(Failure::usage(
                "--shard: expected --out DIR as well; `plumage campaign merge` reads the missions from there",
            ));
        }
        let rows = fleet.fly(&fleet.0.question.missions(), &|_| Ok(()))?;
        let table = table::to_markdown(&fleet.0.question, &rows);
        match &arguments.out {
            Some(file) => files::write_whole(file, table.as_bytes()).map_err(Failure::input)?,
            None => print!("{table}"),
        }
        return Ok(());
    };
    let shard = arguments.shard.unwrap_or(Shard::WHOLE);
    fleet.fly_into(folder, shard, arguments.force)
}

/// Whether `--out` names a table alone rather than a folder.
fn is_table(out: &Path) -> bool {
    out.extension().is_some_and(|e| e == "md")
}

/// The missions of a campaign, flown on all processors.
struct Fleet(Campaign);

impl Fleet {
    /// Flies missions, and keeps each as it is done.
    fn fly(
        &self,
        missions: &[MissionKey],
        keep: &(impl Fn(&MissionRow) -> Result<(), Failure> + Sync),
    ) -> Result<Vec<MissionRow>, Failure> {
        let of = |key: &MissionKey| -> Result<MissionRow, Failure> {
            let row = self.0.fly(key).map_err(Failure::input)?;
            keep(&row)?;
            Ok(row)
        };
        fly_all(missions.len() as u64, |number| {
            of(&missions[number as usize - 1])
        })
    }

    fn fly_into(&self, path: &Path, shard: Shard, force: bool) -> Result<(), Failure> {
        let opened = CampaignFolder::open(path, &self.0.question, shard, force);
        let (folder, mut rows) = opened.map_err(Failure::input)?;
        let flown: BTreeSet<&MissionKey> = rows.iter().map(|row| &row.key).collect();
        let mut missing = self.0.question.missions_of(shard);
        let of = missing.len();
        missing.retain(|key| !flown.contains(key));
        if missing.len() < of {
            eprintln!(
                "resuming: {} of {of} missions are done already",
                of - missing.len()
            );
        }
        let folder = Mutex::new(folder);
        let keep = |row: &MissionRow| -> Result<(), Failure> {
            let mut folder = folder
                .lock()
                .map_err(|_| Failure::usage("a mission ended unexpectedly (internal error)"))?;
            Ok(folder.add(row)?)
        };
        rows.extend(self.fly(&missing, &keep)?);
        let (rows, _) = folder::in_order(&self.0.question, rows.iter());
        results(path, &self.0.question, &rows)?;
        if rows.len() < of {
            return Err(Failure::Run(anyhow::anyhow!(
                "stopped after {} of {of} missions; run the same command again to fly the others",
                rows.len()
            )));
        }
        Ok(())
    }
}

/// Writes tables and report of the missions that there are.
fn results(folder: &Path, question: &Question, rows: &[MissionRow]) -> Result<(), Failure> {
    let tables = tables(question, rows).map_err(Failure::input)?;
    let page = reports::html(&campaign_report::page(question, rows));
    let named = tables
        .iter()
        .map(|(name, bytes)| (folder.join(name), &bytes[..]));
    let mut all: Vec<(PathBuf, &[u8])> = named.collect();
    all.push((folder.join("campaign.html"), page.as_bytes()));
    files::write_set(&all)?;
    let table = table::to_markdown(question, rows);
    let first = table.split("\n\n").next().unwrap_or_default();
    println!("{first}\n\nOutputs in {}", folder.display());
    Ok(())
}

fn merge(arguments: &MergeArguments) -> Result<(), Failure> {
    if is_table(&arguments.out) {
        return Err(Failure::usage(format!(
            "--out {}: expected a folder; the table is written to its campaign.md",
            arguments.out.display()
        )));
    }
    let read = |path: &PathBuf| Ok((path.clone(), folder::read(path).map_err(Failure::input)?));
    let parts: Result<Vec<_>, Failure> = arguments.folders.iter().map(read).collect();
    let (question, rows) = folder::merged(&parts?).map_err(Failure::usage)?;
    let opened = CampaignFolder::open(&arguments.out, &question, Shard::WHOLE, arguments.force);
    let (mut folder, there) = opened.map_err(Failure::input)?;
    let there: BTreeSet<&MissionKey> = there.iter().map(|row| &row.key).collect();
    for row in rows.iter().filter(|row| !there.contains(&row.key)) {
        folder.add(row)?;
    }
    results(&arguments.out, &question, &rows)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn seeds_are_a_number_a_range_or_a_list() {
        let seeds = |text: &str| text.parse::<Seeds>().map(|s| s.0);
        assert_eq!(seeds("3"), Ok(vec![1, 2, 3]));
        assert_eq!(seeds("5..7"), Ok(vec![5, 6, 7]));
        assert_eq!(seeds("1..=2"), Ok(vec![1, 2]));
        assert_eq!(seeds("9, 1,4"), Ok(vec![9, 1, 4]));
        for wrong in ["0", "", "a", "7..5", "1,,2", "1,2,1", "-3", "200000"] {
            assert!(seeds(wrong).is_err(), "{wrong}");
        }
    }
}
