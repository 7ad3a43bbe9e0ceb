//! Campaigns: what is asked, single missions wherever they are flown, the folder that keeps them, the tables.

use crate::error::{self, InputError};
use crate::scenario::Scenario;
use pyo3::prelude::*;
use record::campaign::folder::{self, CampaignFolder};
use record::campaign::{MissionKey, MissionRow, Question, Shard};
use serde::de::DeserializeOwned;
use std::collections::BTreeMap;
use std::path::PathBuf;
use tasks::campaign::{self, Varied};

/// The missions of a campaign, ready to fly.
#[pyclass(frozen, module = "plumage._plumage")]
pub(crate) struct Campaign(campaign::Campaign);

fn parsed<T: DeserializeOwned>(json: &str) -> PyResult<T> {
    serde_json::from_str(json).map_err(|e| error::input(&e))
}

fn written(value: &impl serde::Serialize) -> PyResult<String> {
    serde_json::to_string(value).map_err(|e| error::run(&e))
}

fn rows(json: &[String]) -> PyResult<Vec<MissionRow>> {
    json.iter().map(|row| parsed(row)).collect()
}

fn shard(text: &str) -> PyResult<Shard> {
    let shard = text.parse();
    shard.map_err(|why| InputError::new_err(format!("shard {text}: {why}")))
}

#[pymethods]
impl Campaign {
    #[new]
    fn new(
        scenario: &Scenario,
        seeds: Vec<u64>,
        strategies: Vec<String>,
        realities: Vec<String>,
        vehicles: Vec<usize>,
        stand_ins: Option<usize>,
    ) -> PyResult<Self> {
        let varied = Varied {
            strategies,
            realities,
            vehicles,
            real_stand_ins: stand_ins,
            seeds,
        };
        let setup = scenario.setup.clone();
        let campaign = campaign::Campaign::new(setup, &scenario.folder, &varied);
        Ok(Self(campaign.map_err(error::of_task)?))
    }

    /// The same on another machine.
    #[staticmethod]
    fn of_question(question: &str, files: BTreeMap<String, Vec<u8>>) -> PyResult<Self> {
        let read = |name: &str| {
            let bytes = files.get(name).cloned();
            bytes.ok_or_else(|| "the campaign has no such file".to_owned())
        };
        let campaign = campaign::Campaign::of_question(parsed(question)?, &read);
        Ok(Self(campaign.map_err(error::of_task)?))
    }

    /// What is asked, as JSON.
    fn question(&self) -> PyResult<String> {
        written(&self.0.question)
    }

    /// The files that the scenario names.
    fn files(&self) -> BTreeMap<String, Vec<u8>> {
        self.0.files().clone()
    }

    /// What is doubtful, in words, before the first mission.
    fn check(&self, py: Python<'_>) -> PyResult<Vec<String>> {
        py.detach(|| self.0.check()).map_err(error::of_task)
    }

    /// The missions of a part, as JSON.
    fn missions(&self, part: &str) -> PyResult<Vec<String>> {
        let missions = self.0.question.missions_of(shard(part)?);
        missions.iter().map(written).collect()
    }

    /// Flies one of the missions; what came of it, as JSON.
    fn fly(&self, py: Python<'_>, mission: &str) -> PyResult<String> {
        let key: MissionKey = parsed(mission)?;
        let row = py.detach(|| self.0.fly(&key)).map_err(error::of_task)?;
        written(&row)
    }

    /// The tables of missions by the names of their files, missions in the order of what was asked.
    fn tables(&self, flown: Vec<String>) -> PyResult<Vec<(&'static str, Vec<u8>)>> {
        let flown = rows(&flown)?;
        let (flown, _) = folder::in_order(&self.0.question, flown.iter());
        tables(&self.0.question, &flown)
    }
}

fn tables(question: &Question, rows: &[MissionRow]) -> PyResult<Vec<(&'static str, Vec<u8>)>> {
    let tables = campaign::tables(question, rows).map_err(error::of_task)?;
    Ok(tables.into_iter().collect())
}

/// The folder of a campaign, open for missions.
#[pyclass(module = "plumage._plumage")]
pub(crate) struct Kept {
    folder: CampaignFolder,
    path: PathBuf,
    there: Vec<MissionRow>,
}

#[pymethods]
impl Kept {
    #[new]
    fn new(path: PathBuf, campaign: &Campaign, part: &str, force: bool) -> PyResult<Self> {
        let opened = CampaignFolder::open(&path, &campaign.0.question, shard(part)?, force);
        let (folder, there) = opened.map_err(|e| error::input(&e))?;
        Ok(Self {
            folder,
            path,
            there,
        })
    }

    /// Missions that are there already, and what came of each, as JSON.
    fn there(&self) -> PyResult<Vec<(String, String)>> {
        let one = |row: &MissionRow| Ok((written(&row.key)?, written(row)?));
        self.there.iter().map(one).collect()
    }

    /// Keeps a mission.
    fn add(&mut self, row: &str) -> PyResult<()> {
        let row: MissionRow = parsed(row)?;
        self.folder.add(&row).map_err(|e| error::run(&e))
    }

    /// Writes the tables.
    fn finish(&self, tables: Vec<(String, Vec<u8>)>) -> PyResult<()> {
        let files: Vec<_> = tables
            .iter()
            .map(|(name, bytes)| (self.path.join(name), bytes.as_slice()))
            .collect();
        record::files::write_set(&files).map_err(|e| error::run(&e))
    }
}

/// The tables of a campaign whose parts lie in these folders.
#[pyfunction]
pub(crate) fn merged_tables(folders: Vec<PathBuf>) -> PyResult<Vec<(&'static str, Vec<u8>)>> {
    let read = |path: PathBuf| {
        let flown = folder::read(&path).map_err(|e| error::input(&e))?;
        Ok((path, flown))
    };
    let parts: PyResult<Vec<_>> = folders.into_iter().map(read).collect();
    let (question, rows) = folder::merged(&parts?).map_err(InputError::new_err)?;
    tables(&question, &rows)
}
