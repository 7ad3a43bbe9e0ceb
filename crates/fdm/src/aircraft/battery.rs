//! The battery: how much the motor takes out of it and how much is left.
//!
//! The propeller's work on the air by momentum theory: thrust T speeds up the stream from the
//! airspeed V to the slipstream's Vd and costs T (V + Vd)/2; what the battery gives is that over
//! one efficiency of propeller, motor and speed controller, and what the avionics take. Voltage,
//! temperature and age of the cells are not modelled.

use serde::{Deserialize, Serialize};

use super::propulsion::Propulsion;
use crate::error::FdmError;
use crate::range::{positive, within};

/// Seconds in an hour.
const HOUR_S: f64 = 3600.0;

/// A battery and what it drives.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Battery {
    /// Usable energy of the full battery, Wh.
    pub capacity_wh: f64,
    /// Work of the propeller on the air, of a multirotor work at the shafts, over electrical energy, 0.05 to 1.
    pub efficiency: f64,
    /// Power of everything but the motor, W.
    pub avionics_w: f64,
}

impl Battery {
    /// Checks the numbers.
    ///
    /// # Errors
    /// [`FdmError::Refused`] for the first that no battery has.
    pub(crate) fn check(&self) -> Result<(), FdmError> {
        positive("battery.capacity_wh", self.capacity_wh)?;
        within("battery.efficiency", self.efficiency, 0.05, 1.0)?;
        within("battery.avionics_w", self.avionics_w, 0.0, 1000.0)
    }

    /// Electrical power in flight at a true airspeed, throttle (0 to 1) and density, W.
    pub fn power_w(
        &self,
        propulsion: &Propulsion,
        airspeed_m_s: f64,
        throttle: f64,
        density_kg_m3: f64,
    ) -> f64 {
        let slipstream_m_s = propulsion.slipstream_m_s(airspeed_m_s, throttle);
        let thrust_n = propulsion.thrust_n(airspeed_m_s, throttle, density_kg_m3);
        let on_air_w = (thrust_n * 0.5 * (airspeed_m_s + slipstream_m_s)).max(0.0);
        self.power_of_w(on_air_w)
    }

    /// Electrical power for a work per time at its propellers, W.
    pub(crate) fn power_of_w(&self, work_w: f64) -> f64 {
        work_w / self.efficiency + self.avionics_w
    }
}

/// What is left in a battery.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StateOfCharge {
    capacity_wh: f64,
    left_wh: f64,
}

impl StateOfCharge {
    /// A full battery.
    pub fn full(battery: &Battery) -> Self {
        Self {
            capacity_wh: battery.capacity_wh,
            left_wh: battery.capacity_wh,
        }
    }

    /// Takes out `power_w` for `dt_s`; nothing that is not finite.
    pub fn draw(&mut self, power_w: f64, dt_s: f64) {
        let used_wh = power_w * dt_s / HOUR_S;
        if used_wh.is_finite() {
            self.left_wh = (self.left_wh - used_wh).clamp(0.0, self.capacity_wh);
        }
    }

    /// Share of the capacity that is left, 0 to 1.
    pub fn fraction(&self) -> f64 {
        self.left_wh / self.capacity_wh
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Aircraft;

    /// By hand: at 18 m/s, throttle 0.1219 and 1.225 kg/m³ the slipstream is 18 + 0.1219 · 22 =
    /// 20.6818 m/s, thrust 0.5 · 1.225 · 0.10179 · 20.6818 · 2.6818 = 3.4581 N, the work on the air
    /// 3.4581 · 19.3409 = 66.882 W, the battery gives 66.882 / 0.5 + 10 = 143.76 W.
    #[test]
    fn level_flight_of_the_x8() {
        let aircraft =
            Aircraft::from_toml("x8", include_str!("../../../../aircraft/x8.toml")).unwrap();
        let battery = Battery {
            capacity_wh: 100.0,
            efficiency: 0.5,
            avionics_w: 10.0,
        };
        let power_w = battery.power_w(&aircraft.propulsion, 18.0, 0.1219, 1.225);
        assert!((power_w - 143.76).abs() < 0.01, "{power_w}");
        let mut charge = StateOfCharge::full(&battery);
        charge.draw(power_w, 1800.0);
        assert!((charge.fraction() - (1.0 - 0.7188)).abs() < 1e-4);
        charge.draw(power_w, 3600.0);
        charge.draw(f64::NAN, 1.0);
        assert_eq!(charge.fraction(), 0.0);
    }

    #[test]
    fn a_battery_that_cannot_be_is_refused_with_its_line() {
        let text = include_str!("../../../../aircraft/x8.toml");
        let text = text.replace("capacity_wh = 237.0", "capacity_wh = -1.0");
        let message = Aircraft::from_toml("x8.toml", &text)
            .unwrap_err()
            .to_string();
        assert!(message.contains("battery.capacity_wh"), "{message}");
    }
}
