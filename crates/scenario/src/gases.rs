//! The gas of a scenario: an analysis, or a mission, is of one.

use crate::check::Refusal;
use crate::tables::{Scenario, SensorTable};
use plume::Gas;
use toml::{Table, Value};

impl Scenario {
    /// The gas that is read: that of the first source. Sources of other gases are not read, but have
    /// their keep-out.
    pub fn gas(&self) -> Gas {
        self.sources.first().map_or(Gas::Co2, |s| s.gas)
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
            let Some((gas, unit)) = Gas::of_column(name) else {
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
