//! Named extensions of an aircraft: what may differ between the aircraft of the file and the one
//! that flies, with the sizes that physics allows.
//!
//! The same list serves the simulation (a `[[mechanism]]` of an aircraft file or scenario changes
//! the aircraft that flies) and the search for the cause of a gap (each mechanism is a
//! hypothesis with a prior). The autopilot keeps the numbers of the base.

mod catalogue;

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use crate::aircraft::Aircraft;
use crate::flight::{AirAround, FlightState};
use crate::{FdmError, refuse};

pub use catalogue::{ActsOn, CATALOGUE, MechanismSpec, ParameterSpec, spec};

/// One mechanism with its parameters, as in a `[[mechanism]]` table; parameters left out are
/// neutral.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Mechanism {
    /// Name in [`CATALOGUE`].
    pub id: String,
    /// Parameters by name.
    #[serde(flatten)]
    pub parameters: BTreeMap<String, f64>,
}

impl Mechanism {
    /// A mechanism with all parameters in the catalogue's order.
    ///
    /// # Errors
    /// [`FdmError::UnknownMechanism`], or [`FdmError::Refused`] for a value out of range.
    pub fn with_values(id: &str, values: &[f64]) -> Result<Self, FdmError> {
        let spec = spec(id).ok_or_else(|| unknown(id))?;
        let parameters = spec
            .parameters
            .iter()
            .zip(values)
            .map(|(parameter, value)| (parameter.name.to_owned(), *value))
            .collect();
        let mechanism = Self {
            id: id.to_owned(),
            parameters,
        };
        mechanism.values()?;
        Ok(mechanism)
    }

    /// The parameters in the catalogue's order (at most three), checked.
    ///
    /// # Errors
    /// [`FdmError::UnknownMechanism`] for an id or parameter that is not in the catalogue,
    /// [`FdmError::Refused`] for a value out of range.
    pub fn values(&self) -> Result<[f64; 3], FdmError> {
        let spec = spec(&self.id).ok_or_else(|| unknown(&self.id))?;
        if let Some(stranger) = self
            .parameters
            .keys()
            .find(|name| spec.parameters.iter().all(|p| p.name != name.as_str()))
        {
            return Err(unknown(&format!("{}.{stranger}", self.id)));
        }
        let mut values = [0.0; 3];
        for (value, parameter) in values.iter_mut().zip(spec.parameters) {
            let given = self.parameters.get(parameter.name).copied();
            *value = given.unwrap_or(parameter.neutral);
            if !(*value >= parameter.low && *value <= parameter.high) {
                return Err(refuse(
                    &format!("{}.{}", self.id, parameter.name),
                    *value,
                    format!("{} to {} {}", parameter.low, parameter.high, parameter.unit),
                ));
            }
        }
        Ok(values)
    }
}

fn unknown(id: &str) -> FdmError {
    FdmError::UnknownMechanism {
        id: id.to_owned(),
        known: CATALOGUE
            .iter()
            .map(|spec| spec.id)
            .collect::<Vec<_>>()
            .join(", "),
    }
}

/// What the sensors of a vehicle add to the truth.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SensorErrors {
    /// Factor of the airspeed.
    pub airspeed_factor: f64,
    /// Added to the angular rates, rad/s.
    pub gyro_bias_rad_s: [f64; 3],
    /// Added to the specific force, m/s².
    pub accelerometer_bias_m_s2: [f64; 3],
    /// Factor of the angle of attack.
    pub alpha_factor: f64,
    /// Added to the angle of attack, rad.
    pub alpha_offset_rad: f64,
}

impl Default for SensorErrors {
    fn default() -> Self {
        Self {
            airspeed_factor: 1.0,
            gyro_bias_rad_s: [0.0; 3],
            accelerometer_bias_m_s2: [0.0; 3],
            alpha_factor: 1.0,
            alpha_offset_rad: 0.0,
        }
    }
}

impl SensorErrors {
    /// The state as these sensors tell it.
    pub fn of(&self, state: &FlightState) -> FlightState {
        let mut told = *state;
        told.airspeed_m_s *= self.airspeed_factor;
        told.alpha_rad = self.alpha_factor * state.alpha_rad + self.alpha_offset_rad;
        for k in 0..3 {
            told.rate_rad_s[k] += self.gyro_bias_rad_s[k];
            told.specific_force_m_s2[k] += self.accelerometer_bias_m_s2[k];
        }
        told
    }
}

/// An aircraft with mechanisms at work: the airframe that flies, what its sensors add, and what
/// the air adds.
#[derive(Debug, Clone, PartialEq)]
pub struct Extended {
    /// The airframe that flies; its list of mechanisms is empty.
    pub aircraft: Aircraft,
    /// What the sensors add.
    pub sensors: SensorErrors,
    /// Added to the wind, NED, m/s.
    pub wind_bias_ned_m_s: [f64; 3],
}

impl Extended {
    /// The aircraft with the mechanisms of its own list.
    ///
    /// # Errors
    /// As [`Mechanism::values`], or what [`Aircraft::check`] says of the result.
    pub fn of(aircraft: &Aircraft) -> Result<Self, FdmError> {
        let mut base = aircraft.clone();
        let mechanisms = std::mem::take(&mut base.mechanism);
        let mut extended = Self {
            aircraft: base,
            sensors: SensorErrors::default(),
            wind_bias_ned_m_s: [0.0; 3],
        };
        for mechanism in &mechanisms {
            extended.apply(&mechanism.id, mechanism.values()?);
        }
        extended.aircraft.check()?;
        Ok(extended)
    }

    /// The air as it is, from the air as others tell it.
    pub fn air(&self, told: &AirAround) -> AirAround {
        let mut air = *told;
        for (wind, bias) in air.wind_ned_m_s.iter_mut().zip(self.wind_bias_ned_m_s) {
            *wind += bias;
        }
        air
    }

    /// Adds one mechanism with its values in the catalogue's order; they are taken as they come.
    pub fn apply(&mut self, id: &str, [a, b, c]: [f64; 3]) {
        let (craft, sensors) = (&mut self.aircraft, &mut self.sensors);
        match id {
            "airspeed-scale" => sensors.airspeed_factor *= a,
            "actuator-delay" => craft.surfaces.delay_s += a,
            "actuator-lag" => {
                let s = &mut craft.surfaces;
                // At low frequency a second-order servo lags by 2ζ/ω.
                let lag = 2.0 * s.damping_ratio / s.natural_frequency_rad_s + a;
                s.natural_frequency_rad_s = 2.0 * s.damping_ratio / lag;
            }
            "surface-trim-offset" => {
                craft.surfaces.elevator_offset_deg += a;
                craft.surfaces.aileron_offset_deg += b;
                craft.surfaces.rudder_offset_deg += c;
            }
            "control-effectiveness" => {
                craft.pitch.elevator *= a;
                craft.roll.aileron *= b;
                craft.yaw.aileron *= b;
                craft.yaw.rudder *= c;
                craft.roll.rudder *= c;
            }
            "mass-change" => craft.body.mass_kg += a,
            "cg-shift" => craft.body.cg_ahead_m += a,
            "drag-increase" => craft.drag.zero += a,
            "lift-slope" => craft.lift.alpha *= a,
            "thrust-loss" => craft.propulsion.swept_area_m2 *= 1.0 - a,
            "roll-damping" => craft.roll.p *= a,
            "pitch-damping" => craft.pitch.q *= a,
            "wind-bias" => {
                self.wind_bias_ned_m_s[0] += a;
                self.wind_bias_ned_m_s[1] += b;
            }
            "gyro-bias" => add(&mut sensors.gyro_bias_rad_s, [a, b, c].map(f64::to_radians)),
            "accelerometer-bias" => add(&mut sensors.accelerometer_bias_m_s2, [a, b, c]),
            "alpha-vane-scale" => {
                sensors.alpha_factor *= a;
                sensors.alpha_offset_rad += b.to_radians();
            }
            _ => {}
        }
    }
}

fn add(to: &mut [f64; 3], what: [f64; 3]) {
    for (to, what) in to.iter_mut().zip(what) {
        *to += what;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn x8() -> Aircraft {
        Aircraft::from_toml("x8.toml", include_str!("../../../aircraft/x8.toml")).unwrap()
    }

    #[test]
    fn neutral_values_change_nothing() {
        let mut extended = Extended::of(&x8()).unwrap();
        let before = extended.clone();
        for spec in CATALOGUE {
            let mut values = [0.0; 3];
            for (value, parameter) in values.iter_mut().zip(spec.parameters) {
                *value = parameter.neutral;
            }
            extended.apply(spec.id, values);
        }
        // The servo's frequency passes through a quotient and back.
        let frequency = before.aircraft.surfaces.natural_frequency_rad_s;
        let after = extended.aircraft.surfaces.natural_frequency_rad_s;
        assert!((after / frequency - 1.0).abs() < 1e-12);
        extended.aircraft.surfaces.natural_frequency_rad_s = frequency;
        assert_eq!(extended, before);
    }

    #[test]
    fn every_mechanism_of_the_catalogue_changes_something() {
        for spec in CATALOGUE {
            for k in 0..spec.parameters.len() {
                let mut extended = Extended::of(&x8()).unwrap();
                let before = extended.clone();
                let mut values = [0.0; 3];
                for (value, parameter) in values.iter_mut().zip(spec.parameters) {
                    *value = parameter.neutral;
                }
                values[k] += spec.parameters[k].prior_sd;
                extended.apply(spec.id, values);
                let rudder = spec.parameters[k].name == "rudder_factor";
                // The X8 has no rudder.
                assert_eq!(extended != before, !rudder, "{} {k}", spec.id);
            }
        }
    }

    #[test]
    fn the_document_tells_every_mechanism_with_its_parameters() {
        let document = include_str!("../../../docs/mechanisms.md");
        for spec in CATALOGUE {
            let row = document
                .lines()
                .find(|line| line.starts_with(&format!("| `{}` ", spec.id)))
                .unwrap_or_else(|| panic!("docs/mechanisms.md lacks {}", spec.id));
            for parameter in spec.parameters {
                assert!(row.contains(&format!("`{}`", parameter.name)), "{row}");
            }
        }
    }

    #[test]
    fn files_carry_mechanisms_and_bad_ones_are_refused() {
        let text = include_str!("../../../aircraft/x8.toml");
        let with = |table: &str| Aircraft::from_toml("x8.toml", &format!("{text}\n{table}"));
        let good = with("[[mechanism]]\nid = \"roll-damping\"\nfactor = 2").unwrap();
        let extended = Extended::of(&good).unwrap();
        assert_eq!(extended.aircraft.roll.p, 2.0 * -0.40420);
        let again = Aircraft::from_toml("again", &good.to_toml().unwrap()).unwrap();
        assert_eq!(again, good);
        for (table, says) in [
            ("[[mechanism]]\nid = \"roll-dampng\"", "roll-dampng"),
            (
                "[[mechanism]]\nid = \"roll-damping\"\nfacter = 2.0",
                "facter",
            ),
            (
                "[[mechanism]]\nid = \"roll-damping\"\nfactor = -2.0",
                "0.05 to 5",
            ),
            (
                "[[mechanism]]\nid = \"mass-change\"\nadded_kg = -4.0",
                "mass",
            ),
        ] {
            let error = with(table).unwrap_err().to_string();
            assert!(error.contains(says), "{error}");
        }
    }
}
