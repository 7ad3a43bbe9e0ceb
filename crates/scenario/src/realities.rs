//! Other realities of the same scenario, by name: what a team that believes the scenario may meet instead.
//!
//! Each changes the scenario's `[reality]`, whose tables and keys it is written in; mechanisms come in addition to
//! those that the reality has. Sizes are such that a mission can see them and a team must expect them: those of
//! power plants' plumes in the literature of dispersion (Hanna et al. 1982), or what a wind forecast misses.

use crate::ScenarioError;
use crate::check::{place, syntax};
use crate::reality::{MECHANISM, merge_table};
use crate::tables::Scenario;
use toml::{Table, Value};

/// A reality that goes by a name.
#[derive(Debug, Clone, Copy)]
pub struct NamedReality {
    /// Its name.
    pub name: &'static str,
    /// What it is, in words.
    pub what: &'static str,
    changes: &'static str,
}

/// The names that [`Scenario::in_other_reality`] knows, joined by [`AND`] as well.
pub const REALITIES: [NamedReality; 13] = [
    reality("own", "as the scenario has it", ""),
    reality(
        "steady",
        "air that does not meander",
        "[weather]\nair = \"steady\"",
    ),
    reality(
        "unsteady",
        "air that meanders and carries the plume as puffs",
        "[weather]\nair = \"unsteady\"",
    ),
    reality(
        "two-sources",
        "a second source of half the first's strength, 390 m from it",
        "id = \"second-source\"\neast_m = 300.0\nnorth_m = -250.0\nratio = 0.5",
    ),
    reality(
        "drift",
        "a wind that turns clockwise by 30° an hour",
        "id = \"wind-direction-drift\"\nrate_deg_per_h = 30.0",
    ),
    reality(
        "veer",
        "a wind that turns clockwise with height, 5° in 100 m",
        "id = \"wind-veer-with-height\"\nrate_deg_per_100m = 5.0",
    ),
    reality(
        "growth",
        "a plume whose height grows with distance by an extra power of 0.3",
        "id = \"sigma-z-growth\"\nexponent = 0.3",
    ),
    reality(
        "unstable",
        "air of one stability class less stable",
        "id = \"stability-class\"\nshift = -1.0",
    ),
    reality(
        "downwash",
        "a building of 20000 m² with downwash in its wake",
        "id = \"building-downwash\"\narea_m2 = 20000.0",
    ),
    reality(
        "trend",
        "an emission that grows by a factor of e in 40 minutes",
        "id = \"emission-trend\"\nrate_per_h = 1.5",
    ),
    reality(
        "decay",
        "a gas that decays by 0.3 % a second",
        "id = \"first-order-decay\"\nrate_per_s = 0.003",
    ),
    reality(
        "gain",
        "a sensor that reads 20 % too high",
        "id = \"sensor-gain\"\nfactor = 1.2",
    ),
    reality(NOTHING, "no plume at all", ""),
];

/// The reality without a plume.
const NOTHING: &str = "none";
/// Between names of realities that hold together.
pub const AND: char = '+';

/// `changes` are tables of a reality, or the keys of one mechanism.
const fn reality(name: &'static str, what: &'static str, changes: &'static str) -> NamedReality {
    NamedReality {
        name,
        what,
        changes,
    }
}

impl NamedReality {
    /// Whether it cannot be joined with another: with itself, and one kind of air with the other.
    fn excludes(&self, other: &Self) -> bool {
        let sets_air = |r: &Self| r.changes.starts_with("[weather]");
        self.name == other.name || (sets_air(self) && sets_air(other))
    }

    /// Its changes as TOML.
    fn text(&self, of: &Scenario) -> String {
        if self.name == NOTHING {
            of.sources.iter().fold(String::new(), |text, source| {
                let strength = if source.c_max_ppm.is_some() {
                    "c_max_ppm"
                } else {
                    "emission_kg_s"
                };
                text + "[[source]]\n" + strength + " = 0.0\n"
            })
        } else if self.changes.starts_with("id") {
            format!("[[{MECHANISM}]]\n{}", self.changes)
        } else {
            self.changes.to_owned()
        }
    }
}

impl Scenario {
    /// The scenario whose stand-ins fly in another reality: `names` of [`REALITIES`], several with [`AND`] between them.
    ///
    /// # Errors
    /// A name that is none, two that cannot hold together, or a reality that the scenario cannot have.
    pub fn in_other_reality(&self, names: &str) -> Result<Self, ScenarioError> {
        let mut other = self.clone();
        let mut joined: Vec<NamedReality> = Vec::new();
        for name in names.split(AND) {
            let known = REALITIES.iter().find(|r| r.name == name.trim());
            let Some(known) = known else {
                let all: Vec<&str> = REALITIES.iter().map(|r| r.name).collect();
                return Err(ScenarioError::Reality {
                    name: name.trim().to_owned(),
                    known: all.join(", "),
                });
            };
            if let Some(before) = joined.iter().find(|before| before.excludes(known)) {
                return Err(ScenarioError::Realities {
                    names: names.to_owned(),
                    one: before.name,
                    other: known.name,
                });
            }
            joined.push(*known);
            let changes = known.text(&other);
            other = other.in_reality_of(&format!("reality {}", known.name), &changes)?;
        }
        Ok(other)
    }

    /// The scenario whose stand-ins fly in the reality that `text`, the tables of a `[reality]`, makes of its own.
    ///
    /// # Errors
    /// A text that is not TOML, or a reality that the scenario cannot have.
    pub fn in_reality_of(&self, file: &str, text: &str) -> Result<Self, ScenarioError> {
        let changes: Table = toml::from_str(text).map_err(|e| syntax(file, text, &e))?;
        let changed = self.with_changed_reality(&changes);
        let world = changed.reality_scenario().and_then(|world| world.check());
        world.map_err(|refusal| place(file, text, refusal))?;
        Ok(changed)
    }

    fn with_changed_reality(&self, changes: &Table) -> Self {
        let mut changes = changes.clone();
        let added = changes.remove(MECHANISM);
        let mut reality = self.reality.clone().unwrap_or_default();
        if let Some(Value::Array(added)) = added {
            // A reality's list stands in the place of the scenario's.
            let own = reality.remove(MECHANISM).or_else(|| {
                let base = Table::try_from(self).ok()?;
                base.get(MECHANISM).cloned()
            });
            let mut all = match own {
                Some(Value::Array(own)) => own,
                _ => Vec::new(),
            };
            all.extend(added);
            reality.insert(MECHANISM.to_owned(), Value::Array(all));
        }
        merge_table(&mut reality, &changes);
        Self {
            reality: Some(reality),
            ..self.clone()
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn as_pontes() -> Scenario {
        let text = include_str!("../../../scenarios/as-pontes.toml");
        Scenario::parse("as-pontes.toml", text).unwrap()
    }

    #[test]
    fn every_name_makes_another_world() {
        let scenario = as_pontes();
        let own = scenario.in_reality().to_toml();
        for named in REALITIES {
            let other = scenario.in_other_reality(named.name).unwrap();
            let same = ["own", "unsteady"].contains(&named.name);
            assert_eq!(other.in_reality().to_toml() == own, same, "{}", named.name);
            // What the team believes stays.
            let believed = Scenario {
                reality: scenario.reality.clone(),
                ..other
            };
            assert_eq!(believed.to_toml(), scenario.to_toml(), "{}", named.name);
        }
    }

    #[test]
    fn names_join_and_the_unknown_is_refused() {
        let scenario = as_pontes();
        for wrong in ["steady+unsteady", "growth+growth"] {
            let told = scenario.in_other_reality(wrong).unwrap_err().to_string();
            assert!(told.contains("exclude each other"), "{told}");
        }
        let both = scenario.in_other_reality("steady+growth+decay").unwrap();
        let world = both.in_reality();
        assert_eq!(world.mechanisms.len(), 2);
        assert_eq!(world.dispersion_spec().unwrap().mechanisms.len(), 2);
        let none = scenario.in_other_reality("none").unwrap();
        let fluxes = none.in_reality().dispersion_model().unwrap();
        assert_eq!(fluxes.emissions_kg_s()[0].1, 0.0);
        let refused = scenario.in_other_reality("steady+sunny").unwrap_err();
        assert!(refused.to_string().contains("'sunny'"), "{refused}");
        assert!(refused.to_string().contains("two-sources"), "{refused}");
    }

    #[test]
    fn a_text_of_ones_own_changes_the_reality() {
        let text = "[weather]\nwind_speed_m_s = 5.0\n[[mechanism]]\nid = \"sensor-offset\"\noffset_ppm = 7.0\n";
        let other = as_pontes().in_reality_of("mine.toml", text).unwrap();
        let world = other.in_reality();
        assert_eq!(
            (world.weather.wind_speed_m_s, world.weather.wind_from_deg),
            (5.0, 252.0)
        );
        assert_eq!(world.mechanisms.len(), 1);
        let wrong = as_pontes().in_reality_of("mine.toml", "[fence]\nfloor_agl_m = 1.0");
        assert!(wrong.unwrap_err().to_string().contains("fence"));
    }
}
