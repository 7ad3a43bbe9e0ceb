//! An aircraft with its mechanisms at work. The autopilot keeps the numbers of the base: it does
//! not know how the aircraft that flies differs from its description.

use crate::aircraft::Aircraft;
use crate::error::FdmError;
use crate::state::FlightState;
use std::sync::Arc;

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
    /// The state as these sensors measure it.
    pub fn of(&self, state: &FlightState) -> FlightState {
        let mut sensed = *state;
        sensed.airspeed_m_s *= self.airspeed_factor;
        sensed.alpha_rad = self.alpha_factor * state.alpha_rad + self.alpha_offset_rad;
        for k in 0..3 {
            sensed.rate_rad_s[k] += self.gyro_bias_rad_s[k];
            sensed.specific_force_m_s2[k] += self.accelerometer_bias_m_s2[k];
        }
        sensed
    }
}

/// An aircraft with mechanisms at work: the airframe that flies, what its sensors add, and what
/// the air adds.
#[derive(Debug, Clone, PartialEq)]
pub struct ExtendedAircraft {
    /// The airframe that flies; its list of mechanisms is empty.
    pub aircraft: Arc<Aircraft>,
    /// What the sensors add.
    pub sensors: SensorErrors,
    /// Added to the wind, NED, m/s.
    pub wind_bias_ned_m_s: [f64; 3],
}

impl ExtendedAircraft {
    /// The aircraft with the mechanisms of its own list.
    ///
    /// # Errors
    /// As [`crate::mechanism::Mechanism::values`], or what [`Aircraft::check`] refuses of the result.
    pub fn of(aircraft: &Arc<Aircraft>) -> Result<Self, FdmError> {
        let mut extended = Self::without_mechanisms(aircraft);
        for mechanism in &aircraft.mechanism {
            extended.apply(&mechanism.id, mechanism.values()?);
        }
        extended.aircraft.check()?;
        Ok(extended)
    }

    /// The aircraft without the mechanisms of its list.
    pub fn without_mechanisms(aircraft: &Arc<Aircraft>) -> Self {
        let mut base = aircraft.clone();
        if !base.mechanism.is_empty() {
            Arc::make_mut(&mut base).mechanism.clear();
        }
        Self {
            aircraft: base,
            sensors: SensorErrors::default(),
            wind_bias_ned_m_s: [0.0; 3],
        }
    }

    /// Adds one mechanism with its values in the catalogue's order; they are taken as they come.
    pub fn apply(&mut self, id: &str, [a, b, c]: [f64; 3]) {
        let (craft, sensors) = (Arc::make_mut(&mut self.aircraft), &mut self.sensors);
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
    use crate::mechanism::CATALOGUE;

    fn x8() -> Arc<Aircraft> {
        let text = include_str!("../../../aircraft/x8.toml");
        Arc::new(Aircraft::from_toml("x8.toml", text).unwrap())
    }

    #[test]
    fn neutral_values_change_nothing() {
        let mut extended = ExtendedAircraft::of(&x8()).unwrap();
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
        Arc::make_mut(&mut extended.aircraft)
            .surfaces
            .natural_frequency_rad_s = frequency;
        assert_eq!(extended, before);
    }

    #[test]
    fn every_mechanism_of_the_catalogue_changes_something() {
        for spec in CATALOGUE {
            for k in 0..spec.parameters.len() {
                let mut extended = ExtendedAircraft::of(&x8()).unwrap();
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
        let good = Arc::new(with("[[mechanism]]\nid = \"roll-damping\"\nfactor = 2").unwrap());
        let extended = ExtendedAircraft::of(&good).unwrap();
        assert_eq!(extended.aircraft.roll.p, 2.0 * -0.40420);
        let again = Aircraft::from_toml("again", &good.to_toml().unwrap()).unwrap();
        assert_eq!(again, *good);
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
