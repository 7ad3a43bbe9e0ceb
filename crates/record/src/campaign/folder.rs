//! The folder of a campaign: what was asked, and each mission as soon as it is flown.
//!
//! `campaign.json` holds the question and the part of it that is flown here, `missions.jsonl` one [`MissionRow`] a line
//! in the order in which they came to an end. A program that is killed loses the missions under way and no other.

use super::{MissionKey, MissionRow, Question, Shard};
use crate::files::failed;
use crate::{RecordError, files};
use serde::{Deserialize, Serialize};
use std::collections::{BTreeMap, BTreeSet};
use std::fs::{File, OpenOptions};
use std::io::Write as _;
use std::path::{Path, PathBuf};

const QUESTION: &str = "campaign.json";
const MISSIONS: &str = "missions.jsonl";

/// What `campaign.json` holds.
#[derive(Debug, Serialize, Deserialize)]
struct Asked {
    #[serde(flatten)]
    question: Question,
    shard: Shard,
}

/// A campaign's folder, open for more missions.
#[derive(Debug)]
pub struct CampaignFolder {
    path: PathBuf,
    missions: File,
}

/// What a folder holds.
#[derive(Debug, Clone)]
pub struct Flown {
    /// What was asked.
    pub question: Question,
    /// Which part of it.
    pub shard: Shard,
    /// What was flown of it.
    pub rows: Vec<MissionRow>,
}

impl CampaignFolder {
    /// Opens the folder at `path` for the missions of `question` in `shard`, with the rows that it holds of them
    /// already. A new or empty folder begins with none; with `force` what is there of another campaign is given up.
    ///
    /// # Errors
    /// A folder that holds another campaign or something else, or that cannot be read or written.
    pub fn open(
        path: &Path,
        question: &Question,
        shard: Shard,
        force: bool,
    ) -> Result<(Self, Vec<MissionRow>), RecordError> {
        std::fs::create_dir_all(path).map_err(failed(path, "make"))?;
        let begun = path.join(QUESTION).is_file();
        let rows = match begun.then(|| read(path)) {
            Some(Ok(there)) if there.question == *question && there.shard == shard => there.rows,
            Some(_) if force => Vec::new(),
            Some(Err(error)) => return Err(error),
            Some(Ok(there)) => {
                let what = there.question.differs_from(question).unwrap_or("the shard");
                return Err(no_campaign(
                    path,
                    format!("holds a campaign that differs in {what}"),
                ));
            }
            None if force || is_empty(path)? => Vec::new(),
            None => return Err(no_campaign(path, "is not empty and holds no campaign")),
        };
        let asked = Asked {
            question: question.clone(),
            shard,
        };
        let text = serde_json::to_string_pretty(&asked).unwrap_or_default() + "\n";
        // A line that a killed program did not end is given up.
        let lines: String = rows.iter().map(line).collect();
        files::write_set(&[
            (path.join(QUESTION), text.as_bytes()),
            (path.join(MISSIONS), lines.as_bytes()),
        ])?;
        let missions = path.join(MISSIONS);
        let missions = OpenOptions::new()
            .append(true)
            .open(&missions)
            .map_err(failed(&missions, "open"))?;
        let folder = Self {
            path: path.to_owned(),
            missions,
        };
        Ok((folder, rows))
    }

    /// Keeps a mission.
    ///
    /// # Errors
    /// A file that cannot be written.
    pub fn add(&mut self, row: &MissionRow) -> Result<(), RecordError> {
        self.missions
            .write_all(line(row).as_bytes())
            .and_then(|()| self.missions.flush())
            .map_err(failed(&self.path.join(MISSIONS), "write"))
    }
}

/// Reads the folder of a campaign.
///
/// # Errors
/// A folder that holds none, or that cannot be read.
pub fn read(path: &Path) -> Result<Flown, RecordError> {
    let file = path.join(QUESTION);
    let text = std::fs::read_to_string(&file).map_err(failed(&file, "read"))?;
    let asked: Asked = serde_json::from_str(&text)
        .map_err(|e| no_campaign(&file, format!("is no campaign of this version: {e}")))?;
    let file = path.join(MISSIONS);
    let text = std::fs::read_to_string(&file).map_err(failed(&file, "read"))?;
    let expected: BTreeSet<MissionKey> = asked
        .question
        .missions_of(asked.shard)
        .into_iter()
        .collect();
    let rows = text.lines().filter_map(|l| serde_json::from_str(l).ok());
    let rows = rows.filter(|row: &MissionRow| expected.contains(&row.key));
    Ok(Flown {
        rows: rows.collect(),
        question: asked.question,
        shard: asked.shard,
    })
}

/// Puts the parts of a campaign together: its question, and every mission once, in the question's order.
///
/// # Errors
/// Parts of different campaigns, or missions that no part holds.
pub fn merged(parts: &[(PathBuf, Flown)]) -> Result<(Question, Vec<MissionRow>), String> {
    let Some((first, flown)) = parts.first() else {
        return Err("no campaign folder; expected the folders of its shards".to_owned());
    };
    for (path, other) in parts {
        if let Some(what) = flown.question.differs_from(&other.question) {
            let (first, path) = (first.display(), path.display());
            return Err(format!(
                "{first} and {path} hold campaigns that differ in {what}: expected shards of one"
            ));
        }
    }
    let rows = parts.iter().flat_map(|(_, flown)| &flown.rows);
    let (rows, missing) = in_order(&flown.question, rows);
    if let Some(first) = missing.first() {
        let MissionKey {
            reality,
            strategy,
            vehicles,
            seed,
        } = first;
        return Err(format!(
            "{} of {} missions are missing, the first of them {strategy} in {reality} with {vehicles} vehicles \
             and seed {seed}; give all shards, and resume those that were stopped with the same command",
            missing.len(),
            flown.question.missions().len()
        ));
    }
    Ok((flown.question.clone(), rows))
}

/// Rows in the order of a question, each mission once, and the missions that are in none.
pub fn in_order<'a>(
    question: &Question,
    rows: impl Iterator<Item = &'a MissionRow>,
) -> (Vec<MissionRow>, Vec<MissionKey>) {
    let by_key: BTreeMap<&MissionKey, &MissionRow> = rows.map(|row| (&row.key, row)).collect();
    let (mut found, mut missing) = (Vec::new(), Vec::new());
    for key in question.missions() {
        match by_key.get(&key) {
            Some(row) => found.push((*row).clone()),
            None => missing.push(key),
        }
    }
    (found, missing)
}

impl Question {
    /// What another campaign differs in, in words.
    pub fn differs_from(&self, other: &Self) -> Option<&'static str> {
        [
            (self.schema != other.schema, "its format"),
            (self.version != other.version, "the program's version"),
            (self.scenario != other.scenario, "the scenario"),
            (self.files != other.files, "files that the scenario names"),
            (self.gas != other.gas, "the gas"),
            (self.realities != other.realities, "the realities"),
            (self.strategies != other.strategies, "the strategies"),
            (self.vehicles != other.vehicles, "the sizes of the team"),
            (
                self.real_stand_ins != other.real_stand_ins,
                "the number of stand-ins",
            ),
            (self.seeds != other.seeds, "the seeds"),
            (self != other, "its name"),
        ]
        .into_iter()
        .find_map(|(differs, what)| differs.then_some(what))
    }
}

fn line(row: &MissionRow) -> String {
    // Plain structs, finite numbers and text: serde_json has nothing to refuse here.
    serde_json::to_string(row).unwrap_or_default() + "\n"
}

fn is_empty(path: &Path) -> Result<bool, RecordError> {
    let mut entries = std::fs::read_dir(path).map_err(failed(path, "read"))?;
    Ok(entries.next().is_none())
}

fn no_campaign(path: &Path, why: impl Into<String>) -> RecordError {
    RecordError::Campaign {
        path: path.to_owned(),
        why: why.into(),
    }
}

#[cfg(test)]
mod tests {
    use super::super::made_up;
    use super::*;

    fn folder(name: &str) -> PathBuf {
        let path = std::env::temp_dir().join(format!("plumage-{name}-{}", std::process::id()));
        let _ = std::fs::remove_dir_all(&path);
        path
    }

    #[test]
    fn a_campaign_goes_on_where_it_was_killed() {
        let (path, question) = (folder("resumed"), made_up::question());
        let missions = question.missions();
        let row = |k: usize| made_up::row(missions[k].clone(), Some(300.0));
        let (mut open, rows) = CampaignFolder::open(&path, &question, Shard::WHOLE, false).unwrap();
        assert!(rows.is_empty());
        open.add(&row(1)).unwrap();
        open.add(&row(0)).unwrap();
        // Killed within a line.
        let torn = &line(&row(2))[..40];
        open.missions.write_all(torn.as_bytes()).unwrap();
        let (mut open, rows) = CampaignFolder::open(&path, &question, Shard::WHOLE, false).unwrap();
        assert_eq!(rows, [row(1), row(0)]);
        open.add(&row(2)).unwrap();
        assert_eq!(read(&path).unwrap().rows, [row(1), row(0), row(2)]);
        // Another campaign does not write over it.
        let other = Question {
            seeds: vec![9],
            ..question.clone()
        };
        let refused = CampaignFolder::open(&path, &other, Shard::WHOLE, false).unwrap_err();
        assert!(refused.to_string().contains("the seeds"), "{refused}");
        assert_eq!(read(&path).unwrap().rows.len(), 3);
        assert!(
            CampaignFolder::open(&path, &other, Shard::WHOLE, true)
                .unwrap()
                .1
                .is_empty()
        );
        std::fs::remove_dir_all(path).unwrap();
    }

    #[test]
    fn parts_make_the_whole_and_what_is_missing_is_said() {
        let question = made_up::question();
        let part = |number: usize| {
            let shard = Shard { number, of: 3 };
            let keys = question.missions_of(shard).into_iter().rev();
            let flown = Flown {
                question: question.clone(),
                shard,
                rows: keys.map(|key| made_up::row(key, None)).collect(),
            };
            (PathBuf::from(format!("part-{number}")), flown)
        };
        let whole: Vec<MissionRow> = question
            .missions()
            .into_iter()
            .map(|key| made_up::row(key, None))
            .collect();
        let (_, rows) = merged(&[part(3), part(1), part(2)]).unwrap();
        assert_eq!(rows, whole);
        let refused = merged(&[part(1), part(3)]).unwrap_err();
        assert!(refused.starts_with("3 of 8 missions"), "{refused}");
        let mut other = part(2);
        other.1.question.strategies.pop();
        let refused = merged(&[part(1), other]).unwrap_err();
        assert!(refused.contains("the strategies"), "{refused}");
    }
}
