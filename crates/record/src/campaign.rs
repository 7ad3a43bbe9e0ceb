//! A campaign: many missions of one scenario, in several realities, by several strategies, with teams of several
//! sizes and many seeds, and what they show beside each other.
//!
//! A mission is one [`MissionRow`]. Rows are kept as they are flown ([`folder`]), so that a campaign goes on where it
//! was left, and may be flown in parts on several machines and put together; [`columns`] writes them as CSV and
//! Parquet, [`table`] tells in Markdown what they show.

pub mod columns;
pub mod folder;
pub mod table;

use crate::summary::{CORRECTED, FluxSummary, MissionSummary, ModelNumber, Outcome, ppm_of};
use crate::text;
use plume::Gas;
use protocol::message::{Flux, FluxMethod, PeakStatus};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// The schema that `campaign.json` names.
pub const SCHEMA: &str = "plumage.campaign/1";
/// A found peak within this distance of the truth counts as found, m.
pub const FOUND_WITHIN_M: f64 = 150.0;
/// A vehicle this near to the true peak is there, m.
pub const NEAR_M: f64 = 100.0;

/// A reality in which missions are flown.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Reality {
    /// Its name, or that of the file that describes it, without its folder.
    pub name: String,
    /// What that file holds; nothing of a name.
    pub text: Option<String>,
}

/// What a campaign is to tell: everything that its missions follow from.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Question {
    /// [`SCHEMA`].
    pub schema: String,
    /// Version of the program that flies it.
    pub version: String,
    /// Name of the mission.
    pub mission: String,
    /// Gas that is read.
    pub gas: Gas,
    /// The scenario, as TOML with all defaults.
    pub scenario: String,
    /// SHA-256 of each file that the scenario names.
    pub files: BTreeMap<String, String>,
    /// Realities.
    pub realities: Vec<Reality>,
    /// Strategies.
    pub strategies: Vec<String>,
    /// Sizes of the team.
    pub vehicles: Vec<usize>,
    /// How many of the team are stand-ins for real vehicles; none for those that the scenario has.
    pub real_stand_ins: Option<usize>,
    /// Seeds.
    pub seeds: Vec<u64>,
}

/// Which mission of a campaign.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub struct MissionKey {
    /// Name of the reality.
    pub reality: String,
    /// Name of the strategy.
    pub strategy: String,
    /// Vehicles of the team.
    pub vehicles: usize,
    /// Seed.
    pub seed: u64,
}

/// A part of a campaign, of `of` that are flown each for itself: missions `number`, `number` + `of` and so on.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct Shard {
    /// Which, from 1.
    pub number: usize,
    /// Of how many.
    pub of: usize,
}

impl Shard {
    /// All missions.
    pub const WHOLE: Self = Self { number: 1, of: 1 };
}

impl std::str::FromStr for Shard {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let parts = text.split_once('/');
        let parts = parts.and_then(|(k, n)| Some((k.parse().ok()?, n.parse().ok()?)));
        match parts {
            Some((number, of)) if (1..=of).contains(&number) => Ok(Self { number, of }),
            _ => Err("expected k/n with k from 1 to n, such as 2/8".to_owned()),
        }
    }
}

impl Question {
    /// All missions, in the order of realities, strategies, teams and seeds as they were asked for.
    pub fn missions(&self) -> Vec<MissionKey> {
        let mut all = Vec::new();
        for reality in &self.realities {
            for strategy in &self.strategies {
                for vehicles in &self.vehicles {
                    all.extend(self.seeds.iter().map(|seed| MissionKey {
                        reality: reality.name.clone(),
                        strategy: strategy.clone(),
                        vehicles: *vehicles,
                        seed: *seed,
                    }));
                }
            }
        }
        all
    }

    /// The missions of a part.
    pub fn missions_of(&self, shard: Shard) -> Vec<MissionKey> {
        let all = self.missions().into_iter();
        all.skip(shard.number - 1).step_by(shard.of).collect()
    }
}

/// A moment of a mission.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Moment {
    /// Mission time, s.
    pub time_s: f64,
    /// What the team had flown by then, km.
    pub flown_km: f64,
}

/// How well a corrected model knows the reality's mean plume inside the fence.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct MapError {
    /// Root of the mean square of the difference, ppm.
    pub rmse_ppm: f64,
    /// The same of the plume itself above its background, ppm: the error of a map without a plume.
    pub plume_rms_ppm: f64,
}

/// A number that a mission states, against the truth.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Stated {
    /// Its name for people.
    pub name: String,
    /// Its unit; empty for a ratio.
    pub unit: String,
    /// Digits after the point that are worth showing.
    pub digits: usize,
    /// Estimate minus truth.
    pub error: f64,
    /// The standard deviation that is stated; none where it has no bound.
    pub sd: Option<f64>,
    /// Error before the mission, where there was an estimate.
    pub before: Option<f64>,
}

impl Stated {
    /// Whether the truth lies within two standard deviations.
    pub fn holds(&self) -> bool {
        self.sd.is_none_or(|sd| self.error.abs() <= 2.0 * sd)
    }

    /// Error over that before the mission, where there was one.
    pub fn left(&self) -> Option<f64> {
        let before = self.before.filter(|b| *b != 0.0)?;
        Some((self.error / before).abs())
    }
}

/// A mission of a campaign, and what came of it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct MissionRow {
    /// Which.
    #[serde(flatten)]
    pub key: MissionKey,
    /// Vehicles that were real or stood in for real ones.
    pub real: usize,
    /// How far readings stand behind the peak.
    pub status: PeakStatus,
    /// Distance of the peak from the true one, m; none where none was found or there is none.
    pub peak_off_m: Option<f64>,
    /// Whether the reality has a peak to find.
    pub has_peak: bool,
    /// When a vehicle was first within [`NEAR_M`] of the true peak.
    pub near: Option<Moment>,
    /// When the peak was first confirmed or supported.
    pub known: Option<Moment>,
    /// When it was first confirmed: as well known as the mission asks.
    pub confirmed: Option<Moment>,
    /// Error of the map at the end.
    pub map: Option<MapError>,
    /// What was stated of which the truth is known.
    pub stated: Vec<Stated>,
    /// What the team flew, km.
    pub flown_km: f64,
    /// Vehicles that landed.
    pub landed: usize,
    /// Digest of the run.
    pub digest: String,
}

impl MissionRow {
    /// The row of a mission that was flown, by so many real vehicles, in a reality that has a peak or none.
    pub fn new(
        key: MissionKey,
        (real, has_peak): (usize, bool),
        summary: &MissionSummary,
        [near, known, confirmed]: [Option<Moment>; 3],
        map: Option<MapError>,
    ) -> Self {
        let vehicles = &summary.vehicles;
        Self {
            key,
            real,
            status: summary.peak.status,
            peak_off_m: summary.peak.error_m,
            has_peak,
            near,
            known,
            confirmed,
            map,
            // Of a plume that is not there nothing is true.
            stated: if has_peak {
                stated(summary)
            } else {
                Vec::new()
            },
            flown_km: vehicles.iter().map(|v| v.distance_m).sum::<f64>() / 1000.0,
            landed: vehicles
                .iter()
                .filter(|v| v.outcome == Outcome::Landed)
                .count(),
            digest: summary.digest.clone(),
        }
    }

    /// Whether the peak was found.
    pub fn is_found(&self) -> bool {
        self.peak_off_m.is_some_and(|m| m <= FOUND_WITHIN_M)
    }

    /// What was stated under a name.
    pub fn stated_of(&self, name: &str) -> Option<&Stated> {
        self.stated.iter().find(|s| s.name == name)
    }

    /// What was stated of the flux by a method; of the first of several sources.
    pub fn flux_by(&self, method: FluxMethod) -> Option<&Stated> {
        self.stated
            .iter()
            .find(|s| s.name.ends_with(text::flux_method(method)))
    }
}

/// The name under which the peak is stated.
pub const PEAK: &str = "peak";

/// What a mission states of which the truth is known.
pub fn stated(mission: &MissionSummary) -> Vec<Stated> {
    let mut out = Vec::new();
    if let (Some(estimate), Some(truth)) = (&mission.peak.estimate, &mission.peak.truth) {
        out.push(Stated {
            name: PEAK.to_owned(),
            unit: ppm_of(mission.gas),
            digits: mission.gas.digits(),
            error: estimate.co2_ppm - truth.co2_ppm,
            sd: bounded(estimate.sd_ppm),
            before: None,
        });
    }
    out.extend(CORRECTED.iter().filter_map(|n| stated_number(mission, n)));
    out.extend(mission.flux.iter().filter_map(stated_flux));
    out
}

/// One of the model's numbers against that of a stand-in's reality; none where no reality is known.
pub fn stated_number(mission: &MissionSummary, number: &ModelNumber) -> Option<Stated> {
    let model = &mission.model;
    let truth = (number.of)(model.reality.as_ref()?).value;
    let [before, after] = [&model.before, &model.after].map(number.of);
    Some(Stated {
        name: number.name.to_owned(),
        unit: number.unit_of(mission.gas),
        digits: number.digits(mission.gas),
        error: number.error(after.value, truth),
        sd: bounded(after.sd),
        before: Some(number.error(before.value, truth)),
    })
}

/// A flux in % of the true one.
fn stated_flux(flux: &FluxSummary) -> Option<Stated> {
    let truth = flux.truth_kg_s.filter(|q| *q > 0.0)?;
    let Flux {
        source,
        method,
        kg_s,
    } = &flux.found;
    Some(Stated {
        name: format!("flux of {source} by {}", text::flux_method(*method)),
        unit: "%".to_owned(),
        digits: 0,
        error: 100.0 * (kg_s.value / truth - 1.0),
        sd: bounded(100.0 * kg_s.sd / truth),
        before: None,
    })
}

fn bounded(sd: f64) -> Option<f64> {
    sd.is_finite().then_some(sd)
}

#[cfg(test)]
pub(crate) mod made_up {
    use super::*;

    /// A campaign of two strategies with four seeds.
    pub fn question() -> Question {
        Question {
            schema: SCHEMA.to_owned(),
            version: "0.1.0".to_owned(),
            mission: "try".to_owned(),
            gas: Gas::Co2,
            scenario: "[site]\n".to_owned(),
            files: BTreeMap::new(),
            realities: vec![Reality {
                name: "own".to_owned(),
                text: None,
            }],
            strategies: vec!["cs-ea".to_owned(), "posterior".to_owned()],
            vehicles: vec![6],
            real_stand_ins: Some(1),
            seeds: vec![1, 2, 3, 4],
        }
    }

    /// A mission whose peak was known after `known_s`, if it was.
    pub fn row(key: MissionKey, known_s: Option<f64>) -> MissionRow {
        let moment = |time_s: f64| Moment {
            time_s,
            flown_km: time_s / 50.0,
        };
        MissionRow {
            real: 1,
            status: if known_s.is_some() {
                PeakStatus::Confirmed
            } else {
                PeakStatus::Doubtful
            },
            peak_off_m: known_s.map(|s| s / 10.0),
            has_peak: true,
            near: known_s.map(|s| moment(s / 2.0)),
            known: known_s.map(moment),
            confirmed: known_s.map(moment),
            map: Some(MapError {
                rmse_ppm: 20.0,
                plume_rms_ppm: 80.0,
            }),
            stated: vec![Stated {
                name: "axis (towards)".to_owned(),
                unit: "°".to_owned(),
                digits: 1,
                error: 1.5,
                sd: Some(1.0),
                before: Some(-12.0),
            }],
            flown_km: 120.5,
            landed: 6,
            digest: format!("{:x}", key.seed),
            key,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parts_hold_every_mission_once() {
        let question = made_up::question();
        let mut all: Vec<MissionKey> = (1..=3)
            .flat_map(|number| question.missions_of(Shard { number, of: 3 }))
            .collect();
        let mut whole = question.missions();
        assert_eq!(question.missions_of(Shard::WHOLE), whole);
        all.sort();
        whole.sort();
        assert_eq!(all, whole);
        assert_eq!(whole.len(), 8);
    }

    #[test]
    fn a_part_is_read_or_refused() {
        assert_eq!("2/8".parse(), Ok(Shard { number: 2, of: 8 }));
        for wrong in ["0/3", "4/3", "1", "1/0", "a/b", "-1/2"] {
            assert!(
                wrong.parse::<Shard>().unwrap_err().contains("2/8"),
                "{wrong}"
            );
        }
    }
}
