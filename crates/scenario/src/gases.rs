//! The gas of a scenario: an analysis, or a mission, is of one.

use crate::check::Refusal;
use crate::tables::{Scenario, SensorTable};
use plume::{Gas, Unit};
use std::ops::RangeInclusive;
use toml::{Table, Value};

/// Molar masses of gases, g/mol: from hydrogen to beyond the heaviest refrigerants and tracers (C10F18 has 462).
const MOLAR_MASSES_G_MOL: RangeInclusive<f64> = 1.0..=1000.0;

fn undefined(key: String, gas: Gas) -> Refusal {
    let known = Gas::ALL.map(Gas::as_str).join(", ");
    let name = gas.as_str();
    Refusal::new(
        key,
        name,
        format!("one of {known}, or a [[gas]] with name = \"{name}\" and molar_mass_g_mol"),
    )
}

impl Scenario {
    /// The gas that is read: that of the first source. Sources of other gases are not read, but have
    /// their keep-out.
    pub fn gas(&self) -> Gas {
        self.sources.first().map_or(Gas::Co2, |s| s.gas)
    }

    /// Gives every gas of sources, sensors and vehicles that the table does not have the molar mass that `[[gas]]` states.
    ///
    /// # Errors
    /// An invalid or repeated definition, and a gas without a definition.
    pub(crate) fn define_gases(&mut self) -> Result<(), Refusal> {
        let mut defined = Vec::new();
        for (k, stated) in self.gases.iter().enumerate() {
            let key = |name: &str| format!("gas.{k}.{name}");
            let Some(gas) = stated.gas().filter(|gas| !defined.contains(gas)) else {
                let expected = "1 to 16 letters and digits, a letter first, of a gas that is neither known nor \
                                defined before";
                return Err(Refusal::new(key("name"), &stated.name, expected));
            };
            if !MOLAR_MASSES_G_MOL.contains(&stated.molar_mass_g_mol) {
                let (low, high) = MOLAR_MASSES_G_MOL.into_inner();
                return Err(Refusal::new(
                    key("molar_mass_g_mol"),
                    stated.molar_mass_g_mol,
                    format!("g/mol, {low} to {high}"),
                ));
            }
            defined.push(gas);
        }
        let define = |key: String, gas: &mut Gas| match gas {
            Gas::Other(_) => {
                let known = defined.iter().find(|d| *d == gas);
                *gas = *known.ok_or_else(|| undefined(key, *gas))?;
                Ok(())
            }
            _ => Ok(()),
        };
        for (k, source) in self.sources.iter_mut().enumerate() {
            define(format!("source.{k}.gas"), &mut source.gas)?;
        }
        let one = self.sensor.0.len() == 1;
        for (k, sensor) in self.sensor.0.iter_mut().enumerate() {
            let key = if one {
                "sensor.gas".to_owned()
            } else {
                format!("sensor.{k}.gas")
            };
            sensor
                .gas
                .iter_mut()
                .try_for_each(|gas| define(key.clone(), gas))?;
        }
        for (k, vehicle) in self.vehicles.iter_mut().enumerate() {
            let mut gases = vehicle.gas.iter_mut().filter_map(|g| g.gas.as_mut());
            gases.try_for_each(|gas| define(format!("vehicle.{k}.gas"), gas))?;
        }
        Ok(())
    }

    /// The gas and unit of a column, among the gases of the table and those that the scenario defines.
    pub(crate) fn gas_of_column(&self, name: &str) -> Option<(Gas, Unit)> {
        let own: Vec<Gas> = self.gases.iter().filter_map(|g| g.gas()).collect();
        Gas::of_column_among(name, &own)
    }

    /// The sensor of that gas.
    pub fn sensor(&self) -> &SensorTable {
        &self.sensor.0[self.sensor_index()]
    }

    /// The same, to be changed.
    pub fn sensor_mut(&mut self) -> &mut SensorTable {
        let k = self.sensor_index();
        &mut self.sensor.0[k]
    }

    fn sensor_index(&self) -> usize {
        // Parsing has seen to it that there is one.
        self.sensor.index(self.gas()).unwrap_or_default()
    }

    fn put_sensor_first(&mut self) {
        let k = self.sensor_index();
        self.sensor.0[..=k].rotate_right(1);
    }

    /// The same scenario read for another gas: the sources of that gas come first.
    ///
    /// # Errors
    /// The gases that the scenario has sources of, where this is none of them.
    pub fn of_gas(&self, gas: Gas) -> Result<Self, String> {
        let mut order: Vec<usize> = (0..self.sources.len()).collect();
        order.sort_by_key(|&k| self.sources[k].gas != gas);
        if self.sources[order[0]].gas != gas {
            return Err(format!(
                "no [[source]] emits {}: expected gas = \"{}\" in the scenario's [[source]], or {}",
                gas.formula(),
                gas.as_str(),
                self.gas().as_str()
            ));
        }
        let mut out = self.clone();
        out.sources = order.iter().map(|&k| self.sources[k].clone()).collect();
        out.put_sensor_first();
        // The n-th [[reality.source]] changes the n-th [[source]].
        if let Some(Value::Array(changes)) = out.reality.as_mut().and_then(|r| r.get_mut("source"))
        {
            let change = |k: usize| {
                changes
                    .get(k)
                    .cloned()
                    .unwrap_or(Value::Table(Table::new()))
            };
            let own = order.iter().map(|&k| change(k));
            *changes = own
                .chain(changes.iter().skip(order.len()).cloned())
                .collect();
        }
        Ok(out)
    }

    /// A sensor for every gas that a source emits, and backgrounds of no others.
    ///
    /// # Errors
    /// The gas that none reads, or that none emits.
    pub(crate) fn check_gases(&self) -> Result<(), Refusal> {
        self.check_backgrounds()?;
        match self
            .sources
            .iter()
            .find(|s| self.sensor.index(s.gas).is_none())
        {
            None => Ok(()),
            Some(source) => Err(Refusal::new(
                "sensor",
                format!("none for {}", source.gas.as_str()),
                format!(
                    "a [[sensor]] with gas = \"{}\", or one without gas",
                    source.gas.as_str()
                ),
            )),
        }
    }

    /// A background of a gas that nothing emits is that of another by mistake.
    fn check_backgrounds(&self) -> Result<(), Refusal> {
        const TABLE: &str = "background.";
        let emits = |gas: Gas| self.sources.iter().any(|s| s.gas == gas);
        let stated = self
            .background
            .0
            .iter()
            .map(|(name, v)| (name.as_str(), "", *v));
        let priors = self.uncertain.iter();
        let priors = priors.filter_map(|(k, v)| Some((k.strip_prefix(TABLE)?, "uncertain.", *v)));
        for (name, table, value) in stated.chain(priors) {
            let Some((gas, unit)) = self.gas_of_column(name) else {
                continue;
            };
            if !emits(gas) {
                let own = self.gas();
                return Err(Refusal::new(
                    format!("{table}{TABLE}{name}"),
                    value,
                    format!(
                        "{TABLE}{}, or gas = \"{}\" in a [[source]]: none emits {}",
                        own.column(unit),
                        gas.as_str(),
                        gas.formula()
                    ),
                ));
            }
        }
        Ok(())
    }

    /// Writes out backgrounds and noise that are as usual for their gases.
    pub(crate) fn write_out_gases(&mut self) {
        self.put_sensor_first();
        let first = self.gas();
        for source in &self.sources {
            self.background.write_out(source.gas);
        }
        let one = self.sources.iter().all(|s| s.gas == first);
        for sensor in &mut self.sensor.0 {
            if let Some(gas) = sensor.gas.or(one.then_some(first)) {
                sensor.noise_sd_ppm = Some(sensor.noise_sd_ppm(gas));
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parse(more: &str) -> Result<Scenario, String> {
        let text = format!(
            "[site]\nlat_deg = 43.4\nlon_deg = -7.8\nground_amsl_m = 340\n{more}\n\
             [[source]]\nlat_deg = 43.4\nlon_deg = -7.8\nemission_kg_s = 1\n"
        );
        Scenario::parse("s.toml", &text).map_err(|e| e.to_string())
    }

    const TRACER: &str = "[background]\npfc_ppb = 0.5\n[[sensor]]\ngas = \"pfc\"\n\
        [[source]]\nlat_deg = 43.4\nlon_deg = -7.8\nemission_kg_s = 1e-3\ngas = \"pfc\"\n[[sensor]]\n";
    const DEFINED: &str = "[[gas]]\nname = \"pfc\"\nmolar_mass_g_mol = 400.1\n";

    #[test]
    fn a_gas_that_the_table_does_not_have_is_defined_once() {
        let scenario = parse(&format!("{DEFINED}{TRACER}")).unwrap();
        let gas = scenario.gas();
        assert_eq!(gas.as_str(), "pfc");
        assert!((gas.molar_mass_kg_mol() - 0.4001).abs() < 1e-12);
        assert_eq!(scenario.background.ppm(gas), 0.5e-3);
        // It survives the scenario's own text, and --gas selects it by its name alone.
        let again = Scenario::parse("again.toml", &scenario.to_toml()).unwrap();
        assert_eq!(again.gas().molar_mass_kg_mol(), gas.molar_mass_kg_mol());
        let named: Gas = "pfc".parse().unwrap();
        let chosen = scenario.of_gas(Gas::Co2).unwrap().of_gas(named).unwrap();
        assert_eq!(chosen.gas().molar_mass_kg_mol(), gas.molar_mass_kg_mol());
    }

    #[test]
    fn a_gas_that_nothing_defines_is_refused_with_what_would() {
        let why = parse(TRACER).unwrap_err();
        assert!(
            why.contains("a [[gas]] with name = \"pfc\" and molar_mass_g_mol"),
            "{why}"
        );
        for (gas, words) in [
            ("name = \"co2\"\nmolar_mass_g_mol = 44", "neither known nor"),
            (
                "name = \"p f c\"\nmolar_mass_g_mol = 44",
                "letters and digits",
            ),
            ("name = \"pfc\"\nmolar_mass_g_mol = 0.4", "g/mol, 1 to 1000"),
            ("name = \"pfc\"", "molar_mass_g_mol"),
        ] {
            let why = parse(&format!("[[gas]]\n{gas}\n")).unwrap_err();
            assert!(why.contains(words), "{why}");
        }
        let twice = parse(&format!("{DEFINED}{DEFINED}")).unwrap_err();
        assert!(twice.contains("defined before"), "{twice}");
    }
}
