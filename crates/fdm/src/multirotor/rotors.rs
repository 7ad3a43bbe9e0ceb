//! Motors and propellers of a multirotor.

use serde::{Deserialize, Serialize};
use std::f64::consts::TAU;

use crate::error::FdmError;
use crate::range::{positive, within};

/// Number of rotors.
pub const ROTORS: usize = 4;

/// Sides of the rotors, forward and right, in the order of ArduPilot's QUAD/X frame.
const PLACES: [[f64; 2]; ROTORS] = [[1.0, 1.0], [-1.0, -1.0], [1.0, -1.0], [-1.0, 1.0]];
/// Sign of the torque that each puts on the body: the first two turn counter-clockwise seen from above, which turns the
/// nose right.
const TORQUE_SIGNS: [f64; ROTORS] = [1.0, 1.0, -1.0, -1.0];

/// Four equal rotors in an X. With n revolutions a second, diameter D and flow V along the shaft (positive in a climb)
/// the advance ratio is J = V/(nD), the thrust ρ n² D⁴ CT(J) and the torque ρ n² D⁵ CP(J)/2π.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Rotors {
    /// Distance of the shafts ahead of and behind the centre of gravity, m.
    pub forward_m: f64,
    /// Distance of the shafts right and left of it, m.
    pub right_m: f64,
    /// Height of the propellers above it, m.
    pub above_m: f64,
    /// Diameter of the propellers, m.
    pub diameter_m: f64,
    /// Coefficient of thrust by advance ratio: constant, linear and quadratic term.
    pub thrust: [f64; 3],
    /// Coefficient of power by advance ratio, likewise.
    pub power: [f64; 3],
    /// Drag across the shaft over rotor speed and cross flow, N/((rad/s)(m/s)).
    pub drag_n_s2_rad_m: f64,
    /// Speed at idle, rad/s.
    pub idle_rad_s: f64,
    /// Highest speed, rad/s.
    pub max_rad_s: f64,
    /// Time constant of a motor that speeds up, s.
    pub lag_up_s: f64,
    /// Time constant of a motor that slows down, s.
    pub lag_down_s: f64,
}

/// A polynomial of second order in the advance ratio times n² (D⁰): what a rotor makes of its speed and the flow along
/// its shaft. The quadratic term keeps its sign in a descent, where the flow comes from below and holds the fall.
#[inline(always)]
fn by_advance_ratio(coefficients: &[f64; 3], n: f64, flow_over_d: f64) -> f64 {
    let [zero, one, two] = *coefficients;
    zero * n * n + one * n * flow_over_d + two * flow_over_d * flow_over_d.abs()
}

impl Rotors {
    pub(super) fn check(&self) -> Result<(), FdmError> {
        within("rotors.forward_m", self.forward_m, 0.02, 3.0)?;
        within("rotors.right_m", self.right_m, 0.02, 3.0)?;
        within("rotors.above_m", self.above_m, -1.0, 1.0)?;
        let apart_m = 2.0 * self.forward_m.min(self.right_m);
        within("rotors.diameter_m", self.diameter_m, 0.02, apart_m)?;
        within("rotors.thrust", self.thrust[0], 0.01, 0.5)?;
        within("rotors.power", self.power[0], 0.002, 0.5)?;
        for coefficient in [self.thrust[1], self.thrust[2]] {
            within("rotors.thrust", coefficient, -2.0, 0.0)?;
        }
        for coefficient in [self.power[1], self.power[2]] {
            within("rotors.power", coefficient, -2.0, 2.0)?;
        }
        within("rotors.drag_n_s2_rad_m", self.drag_n_s2_rad_m, 0.0, 0.1)?;
        positive("rotors.max_rad_s", self.max_rad_s)?;
        within(
            "rotors.idle_rad_s",
            self.idle_rad_s,
            0.0,
            0.5 * self.max_rad_s,
        )?;
        within("rotors.lag_up_s", self.lag_up_s, 0.001, 0.3)?;
        within("rotors.lag_down_s", self.lag_down_s, 0.001, 0.3)
    }

    /// Where rotor `k` is: forward, right and down of the centre of gravity, m.
    pub fn place_m(&self, k: usize) -> [f64; 3] {
        let [forward, right] = PLACES[k];
        [
            forward * self.forward_m,
            right * self.right_m,
            -self.above_m,
        ]
    }

    /// Sign of the torque of rotor `k` about the down axis.
    pub fn torque_sign(&self, k: usize) -> f64 {
        TORQUE_SIGNS[k]
    }

    /// Thrust at a speed, flow along the shaft and density, N.
    #[inline(always)]
    pub fn thrust_n(&self, speed_rad_s: f64, flow_m_s: f64, density_kg_m3: f64) -> f64 {
        let d = self.diameter_m;
        let n = speed_rad_s / TAU;
        density_kg_m3 * d.powi(4) * by_advance_ratio(&self.thrust, n, flow_m_s / d)
    }

    /// Torque against the rotation, N m; a rotor that the flow drives takes none.
    #[inline(always)]
    pub fn torque_n_m(&self, speed_rad_s: f64, flow_m_s: f64, density_kg_m3: f64) -> f64 {
        let d = self.diameter_m;
        let n = speed_rad_s / TAU;
        let power = by_advance_ratio(&self.power, n, flow_m_s / d).max(0.0);
        density_kg_m3 * d.powi(5) * power / TAU
    }

    /// The speed that gives a thrust, rad/s; 0 for none.
    pub fn speed_for(&self, thrust_n: f64, flow_m_s: f64, density_kg_m3: f64) -> f64 {
        let d = self.diameter_m;
        let flow = flow_m_s / d;
        let [a, b, c] = self.thrust;
        let wanted = thrust_n.max(0.0) / (density_kg_m3 * d.powi(4)) - c * flow * flow.abs();
        let half = 0.5 * b * flow / a;
        let n = (half * half + wanted / a).max(0.0).sqrt() - half;
        TAU * n.max(0.0)
    }

    /// Torque over thrust of a rotor in no flow along its shaft, m.
    pub fn torque_over_thrust_m(&self) -> f64 {
        self.power[0] / self.thrust[0] * self.diameter_m / TAU
    }

    /// Speeds after `dt_s` with commands held: a first-order lag, exact for any step.
    #[inline(always)]
    pub fn lagged(
        &self,
        speeds: &[f64; ROTORS],
        commands: &[f64; ROTORS],
        dt_s: f64,
    ) -> [f64; ROTORS] {
        std::array::from_fn(|k| {
            let lag_s = if commands[k] > speeds[k] {
                self.lag_up_s
            } else {
                self.lag_down_s
            };
            commands[k] + (speeds[k] - commands[k]) * (-dt_s / lag_s).exp()
        })
    }
}
