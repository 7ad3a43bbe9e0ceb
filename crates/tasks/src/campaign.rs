//! Campaigns, many missions of one scenario: the question, each mission, and the tables of all.

use crate::{TaskError, preflight, scenario_files};
use mission::{Run, Setup, campaign};
use protocol::digest::sha256_hex;
use record::campaign::{MissionKey, MissionRow, Question, Reality, SCHEMA, columns, table};
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

/// What is to be varied; of an empty list the scenario's own.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Varied {
    /// Search strategies.
    pub strategies: Vec<String>,
    /// Realities: names, or files with the tables of a `[reality]`.
    pub realities: Vec<String>,
    /// Sizes of the team.
    pub vehicles: Vec<usize>,
    /// The last so many of the scenario's team are stand-ins for real vehicles.
    pub real_stand_ins: Option<usize>,
    /// Seeds.
    pub seeds: Vec<u64>,
}

/// What a list holds twice.
pub fn twice<T: Ord>(list: &[T]) -> Option<&T> {
    let mut earlier = BTreeSet::new();
    list.iter().find(|one| !earlier.insert(*one))
}

/// The reality that a scenario has.
const OWN: &str = "own";

/// A reality by its name, or from a file.
fn reality(name: String) -> Result<Reality, TaskError> {
    let is_file = Path::new(&name).extension().is_some_and(|e| e == "toml");
    let text = is_file.then(|| crate::measured::read(Path::new(&name), "reality"));
    let text = text.transpose()?;
    // The same file may lie elsewhere on another machine.
    let file = Path::new(&name).file_name().filter(|_| is_file);
    let name = file.map_or(name.clone(), |file| file.to_string_lossy().into_owned());
    Ok(Reality { name, text })
}

/// The missions of a campaign, ready to fly.
#[derive(Debug, Clone)]
pub struct Campaign {
    setup: Setup,
    /// What is asked.
    pub question: Question,
    /// The scenario's folder, beside which files are looked for that realities name.
    folder: PathBuf,
}

impl Campaign {
    /// The missions of the scenario of `setup`, which lies in `folder`, with all that is to be varied.
    ///
    /// # Errors
    /// Something that stands twice, or a reality's file that cannot be read.
    pub fn new(mut setup: Setup, folder: &Path, varied: &Varied) -> Result<Self, TaskError> {
        if let Some(count) = varied.real_stand_ins {
            setup = setup.with_stand_ins(count)?;
        }
        Ok(Self {
            question: question(&setup, varied)?,
            setup,
            folder: folder.to_owned(),
        })
    }

    /// The missions of `question`, whose scenario is read again, with the files that it names from `read`.
    ///
    /// # Errors
    /// A question of another version, or a scenario that cannot be read.
    pub fn of_question(
        question: Question,
        read: &dyn Fn(&str) -> Result<Vec<u8>, String>,
    ) -> Result<Self, TaskError> {
        if question.version != env!("CARGO_PKG_VERSION") {
            return Err(TaskError::Argument(format!(
                "the campaign is of Plumage {}; expected version {}, which flies its missions here",
                question.version,
                env!("CARGO_PKG_VERSION")
            )));
        }
        Ok(Self {
            setup: Setup::load(&question.mission, &question.scenario, read)?,
            question,
            folder: PathBuf::new(),
        })
    }

    fn in_case(
        &self,
        reality: &Reality,
        strategy: &str,
        vehicles: usize,
    ) -> Result<Setup, TaskError> {
        let read = |file: &str| scenario_files::read(file, &self.folder);
        let setup = campaign::in_case(&self.setup, reality, strategy, vehicles, &read)?;
        Ok(setup)
    }

    /// Finds out before the first mission what cannot be flown; what is doubtful is given in words.
    ///
    /// # Errors
    /// What cannot be flown.
    pub fn check(&self) -> Result<Vec<String>, TaskError> {
        let Question {
            realities,
            strategies,
            vehicles,
            ..
        } = &self.question;
        let (reality, strategy) = (&realities[0], &strategies[0]);
        let mut warnings = Vec::new();
        for count in vehicles {
            let setup = self.in_case(reality, strategy, *count)?;
            warnings.extend(preflight::check(&setup)?);
        }
        for strategy in strategies {
            Run::new(&self.in_case(reality, strategy, vehicles[0])?)?;
        }
        for reality in realities {
            self.in_case(reality, strategy, vehicles[0])?;
        }
        Ok(warnings)
    }

    /// Flies one of the missions.
    ///
    /// # Errors
    /// A mission that was not asked for or cannot be flown.
    pub fn fly(&self, key: &MissionKey) -> Result<MissionRow, TaskError> {
        let mut realities = self.question.realities.iter();
        let reality = realities.find(|r| r.name == key.reality).ok_or_else(|| {
            TaskError::Argument(format!(
                "reality {}: not part of this campaign",
                key.reality
            ))
        })?;
        let setup = self.in_case(reality, &key.strategy, key.vehicles)?;
        Ok(campaign::fly_row(&setup, key.clone())?)
    }

    /// The files that the scenario names, by the names that it gives them.
    pub fn files(&self) -> &std::collections::BTreeMap<String, Vec<u8>> {
        &self.setup.files
    }
}

fn question(setup: &Setup, varied: &Varied) -> Result<Question, TaskError> {
    let scenario = &setup.scenario;
    let or_own = |given: &[String], own: &str| match given {
        [] => vec![own.to_owned()],
        given => given.to_vec(),
    };
    let strategies = or_own(&varied.strategies, &scenario.search.strategy);
    let realities = or_own(&varied.realities, OWN);
    let vehicles = match varied.vehicles.as_slice() {
        [] => vec![scenario.vehicles.len()],
        given => given.to_vec(),
    };
    let stands_twice = |what: String| TaskError::Argument(format!("{what} is listed twice"));
    if let Some(name) = twice(&strategies) {
        return Err(stands_twice(format!("strategies: {name}")));
    }
    if let Some(count) = twice(&vehicles) {
        return Err(stands_twice(format!("vehicles: {count}")));
    }
    if let Some(seed) = twice(&varied.seeds) {
        return Err(stands_twice(format!("seeds: {seed}")));
    }
    let realities: Result<Vec<Reality>, TaskError> = realities.into_iter().map(reality).collect();
    let realities = realities?;
    let names: Vec<&String> = realities.iter().map(|r| &r.name).collect();
    if let Some(name) = twice(&names) {
        return Err(stands_twice(format!("realities: {name}")));
    }
    Ok(Question {
        schema: SCHEMA.to_owned(),
        version: env!("CARGO_PKG_VERSION").to_owned(),
        mission: scenario.mission.name.clone(),
        gas: scenario.gas(),
        scenario: scenario.to_toml(),
        files: setup
            .files
            .iter()
            .map(|(name, bytes)| (name.clone(), sha256_hex(bytes)))
            .collect(),
        realities,
        strategies,
        vehicles,
        real_stand_ins: varied.real_stand_ins,
        seeds: varied.seeds.clone(),
    })
}

/// The tables of missions, by the names of their files; the last one is Markdown, for people.
///
/// # Errors
/// None that is not a defect: what is written is in memory.
pub fn tables(
    question: &Question,
    rows: &[MissionRow],
) -> Result<[(&'static str, Vec<u8>); 3], TaskError> {
    let defect = |e: &dyn std::error::Error| TaskError::Table(e.to_string());
    Ok([
        ("missions.csv", columns::csv(rows).map_err(|e| defect(&e))?),
        (
            "missions.parquet",
            columns::parquet(rows).map_err(|e| defect(&e))?,
        ),
        (
            "campaign.md",
            table::to_markdown(question, rows).into_bytes(),
        ),
    ])
}
