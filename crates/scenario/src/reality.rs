//! The stand-ins' own world: `[reality]` holds the scenario's own tables with only the keys that
//! differ. The n-th `[[reality.source]]` changes the n-th `[[source]]`.

use crate::check::Refusal;
use crate::tables::{Scenario, USUAL_SLOW_TIME_S};
use crate::uncertain::Uncertain;
use plume::Unit;
use rand::Rng;
use rand_distr::{Distribution, StandardNormal};
use toml::{Table, Value};

/// Tables that a reality may change.
const REALITY_TABLES: [&str; 6] = [
    "weather",
    "source",
    "plume",
    "background",
    "sensor",
    MECHANISM,
];

/// The table of a reality that is a list of extensions.
pub(crate) const MECHANISM: &str = "mechanism";

/// Draws from a prior end here, in standard deviations: beyond, factors and amounts would soon be none.
const FARTHEST_DRAW_SD: f64 = 2.0;

impl Scenario {
    /// The same scenario with a reality as it may be for all that the team knows: each number of `[uncertain]` drawn
    /// from its prior, a normal distribution cut off at two standard deviations. What `[reality]` says is left out.
    pub fn with_drawn_reality(&self, rng: &mut impl Rng) -> Self {
        let mut drawn = Self {
            reality: None,
            ..self.clone()
        };
        for key in Uncertain::ALL {
            if let (Some(value), Some(sd)) = (self.value(key), self.prior_sd(key)) {
                let z: f64 = loop {
                    let z: f64 = StandardNormal.sample(rng);
                    if z.abs() <= FARTHEST_DRAW_SD {
                        break z;
                    }
                };
                drawn.set(key, value + z * sd);
            }
        }
        // A scenario writes itself: there is nothing to refuse.
        let mut reality = Table::try_from(&drawn).unwrap_or_default();
        reality.retain(|name, _| REALITY_TABLES.contains(&name));
        Self {
            reality: Some(reality),
            ..self.clone()
        }
    }

    /// The scenario as the stand-ins' reality has it; the scenario itself where it names none.
    pub(crate) fn reality_scenario(&self) -> Result<Scenario, Refusal> {
        let Some(differences) = &self.reality else {
            return Ok(self.clone());
        };
        for name in differences.keys() {
            if !REALITY_TABLES.contains(&name.as_str()) {
                return Err(Refusal::new(
                    format!("reality.{name}"),
                    "a table that a reality does not have",
                    REALITY_TABLES.join(", "),
                ));
            }
        }
        let base = Scenario {
            reality: None,
            ..self.clone()
        };
        let refuse = |e: String| Refusal::new("reality", e, "the scenario's own tables and keys");
        let mut merged = Table::try_from(&base).map_err(|e| refuse(e.to_string()))?;
        merge_table(&mut merged, differences);
        let mut reality: Scenario = merged
            .try_into()
            .map_err(|e: toml::de::Error| refuse(e.message().to_owned()))?;
        reality.define_gases()?;
        Ok(reality)
    }

    /// This scenario, changed by findings, with the reality that it had `before`. Without this, a `[reality]` that states
    /// only some keys would take the changed values of all others, the list of mechanisms included. A scenario that
    /// states no reality is left alone: its stand-ins fly in the scenario's own world.
    #[must_use]
    pub fn with_reality_of(self, before: &Scenario) -> Self {
        if before.reality.is_none() {
            return self;
        }
        let mut world = before.in_reality();
        world.state_defaults(&self);
        // A scenario writes itself: there is nothing to refuse.
        let table = |scenario: &Scenario| Table::try_from(scenario).unwrap_or_default();
        let (mut reality, own) = (table(&world), table(&self));
        reality
            .retain(|name, value| REALITY_TABLES.contains(&name) && own.get(name) != Some(&*value));
        if world.mechanisms.is_empty() && !self.mechanisms.is_empty() {
            reality.insert(MECHANISM.to_owned(), Value::Array(Vec::new()));
        }
        if let Some(Value::Array(sensors)) = reality.get_mut("sensor") {
            // A sensor without a gas changes all: those with one have to follow it.
            sensors.sort_by_key(|sensor| sensor.get("gas").is_some());
        }
        Self {
            reality: Some(reality),
            ..self
        }
    }

    /// States what holds where this scenario leaves out a key that `changed` states: a reality cannot remove a key.
    fn state_defaults(&mut self, changed: &Scenario) {
        let gas = self.gas();
        for (own, changed) in self.sources.iter_mut().zip(&changed.sources) {
            let height_m = own.axis_height_agl_m();
            if changed.effective_height_m.is_some() {
                own.effective_height_m.get_or_insert(height_m);
            }
        }
        for (own, changed) in self.sensor.0.iter_mut().zip(&changed.sensor.0) {
            let noise_sd_ppm = own.noise_sd_ppm(own.gas.unwrap_or(gas));
            let slow_sd_ppm = own.slow_sd_ppm.unwrap_or_default();
            let slow_time_s = own.slow_time_s.unwrap_or(USUAL_SLOW_TIME_S);
            for (own, is_changed, default) in [
                (&mut own.noise_sd_ppm, changed.noise_sd_ppm, noise_sd_ppm),
                (&mut own.slow_sd_ppm, changed.slow_sd_ppm, slow_sd_ppm),
                (&mut own.slow_time_s, changed.slow_time_s, slow_time_s),
            ] {
                if is_changed.is_some() {
                    own.get_or_insert(default);
                }
            }
        }
    }

    /// The world that stand-ins fly in, as a scenario of its own: this one where `[reality]` says
    /// nothing else.
    pub fn in_reality(&self) -> Scenario {
        // Parsing has tried this merge already.
        self.reality_scenario().unwrap_or_else(|_| self.clone())
    }
}

pub(crate) fn merge_table(base: &mut Table, differences: &Table) {
    for (key, new) in differences {
        match (base.get_mut(key), new) {
            (Some(Value::Table(old)), Value::Table(new)) => {
                remove_alternative(old, new);
                merge_table(old, new);
            }
            // Sources are changed one by one, so that a reality may say one key of one of them; a
            // list of mechanisms is replaced whole, or a reality could never do without one.
            (Some(Value::Array(old)), Value::Array(new)) if key == "source" => {
                for (k, item) in new.iter().enumerate() {
                    match (old.get_mut(k), item) {
                        (Some(Value::Table(old)), Value::Table(new)) => {
                            remove_alternative(old, new);
                            merge_table(old, new);
                        }
                        _ => old.push(item.clone()),
                    }
                }
            }
            (Some(Value::Array(old)), new) if key == "sensor" => merge_sensors(old, new),
            (Some(old @ Value::Table(_)), Value::Array(_)) if key == "sensor" => {
                // The one for all gases stays that of the gases that the reality does not name.
                let mut all = vec![old.clone()];
                merge_sensors(&mut all, new);
                *old = Value::Array(all);
            }
            _ => {
                base.insert(key.clone(), new.clone());
            }
        }
    }
}

/// Changes the sensors of a list: one by its gas, all by a table that names none.
fn merge_sensors(sensors: &mut Vec<Value>, differences: &Value) {
    let Value::Array(differences) = differences else {
        return merge_sensors(sensors, &Value::Array(vec![differences.clone()]));
    };
    let gas_of = |sensor: &Value| sensor.get("gas").cloned();
    for difference in differences {
        let Value::Table(new) = difference else {
            sensors.push(difference.clone());
            continue;
        };
        let gas = gas_of(difference);
        if gas.is_some() && !sensors.iter().any(|s| gas_of(s) == gas) {
            // It is what the gas had so far, but for what is said.
            let before = sensors.iter().find(|s| gas_of(s).is_none()).cloned();
            sensors.push(before.unwrap_or_else(|| Value::Table(Table::new())));
            if let Some(Value::Table(own)) = sensors.last_mut() {
                merge_table(own, new);
            }
            continue;
        }
        for sensor in sensors
            .iter_mut()
            .filter(|s| gas.is_none() || gas_of(s) == gas)
        {
            if let Value::Table(old) = sensor {
                merge_table(old, new);
            }
        }
    }
}

/// A source given by its emission in one world may be given by its maximum in the other, and a
/// wind given by a series in one by numbers in the other.
fn remove_alternative(old: &mut Table, new: &Table) {
    const TABLES: [&str; 2] = ["emission_series", "emission_table"];
    let changes = TABLES.iter().any(|key| new.contains_key(*key));
    if new.contains_key("emission_kg_s") || changes {
        old.remove("c_max_ppm");
        old.remove("c_max_distance_m");
    } else if new.contains_key("c_max_ppm") {
        old.remove("emission_kg_s");
        TABLES.iter().for_each(|key| drop(old.remove(*key)));
        old.remove("emission_between");
    }
    if changes {
        // Another course of the emission is in kg/s of its own, unless its mean is stated beside it.
        old.remove("emission_kg_s");
        TABLES.iter().for_each(|key| drop(old.remove(*key)));
    }
    // A background given in one unit may be given in the other.
    let [ppm, ppb] = Unit::ALL.map(|unit| format!("_{}", unit.as_str()));
    for key in new.keys() {
        for (unit, other) in [(&ppm, &ppb), (&ppb, &ppm)] {
            if let Some(gas) = key.strip_suffix(unit.as_str()) {
                old.remove(&format!("{gas}{other}"));
            }
        }
    }
    let by_numbers = ["wind_speed_m_s", "wind_from_deg"].map(|key| new.contains_key(key));
    if by_numbers.contains(&true) {
        old.remove("series");
    }
}
