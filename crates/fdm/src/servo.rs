//! Servos and motor: linear lags advanced exactly under a held command, so that a fast pole does
//! not limit the step of the rigid body.

use nalgebra::Matrix2;

use crate::aircraft::Surfaces;
use crate::scalar::bounded;

/// How a surface stands and moves.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Servo {
    /// Angle, rad.
    pub angle: f64,
    /// Its rate, rad/s.
    pub rate: f64,
}

/// The exact transition over a fixed time of x'' = ω² (u − x) − 2 ζ ω x' with held u, and of the
/// motor's first-order lag; travel and rate limits are applied at its end.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LagStep {
    /// Transition of (x − u, x').
    phi: [[f64; 2]; 2],
    dt: f64,
    low: f64,
    high: f64,
    rate: f64,
    motor_keep: f64,
}

impl LagStep {
    /// The transition over `dt` seconds.
    pub fn new(surfaces: &Surfaces, motor_lag_s: f64, dt: f64) -> Self {
        let w = surfaces.natural_frequency_rad_s;
        let a = Matrix2::new(0.0, 1.0, -w * w, -2.0 * surfaces.damping_ratio * w);
        let phi = (a * dt).exp();
        Self {
            phi: [[phi[(0, 0)], phi[(0, 1)]], [phi[(1, 0)], phi[(1, 1)]]],
            dt,
            low: surfaces.min_deg.to_radians(),
            high: surfaces.max_deg.to_radians(),
            rate: surfaces.rate_deg_s.to_radians(),
            motor_keep: if motor_lag_s > 0.0 {
                (-dt / motor_lag_s).exp()
            } else {
                0.0
            },
        }
    }

    /// The servo after the time of this transition. While the rate limit holds, the angle moves
    /// at that rate; inside the limits the result is exact.
    #[inline(always)]
    pub fn servo(&self, servo: Servo, command: f64) -> Servo {
        let command = bounded(command, self.low, self.high);
        // The exact solution of the linear lag over the step: stable at any step, where RK4 would
        // diverge on the servo's fast pole.
        let off = servo.angle - command;
        let moved = off * self.phi[0][0] + servo.rate * self.phi[0][1] + command - servo.angle;
        let rate = off * self.phi[1][0] + servo.rate * self.phi[1][1];
        let most = self.rate * self.dt;
        let free = servo.angle + bounded(moved, -most, most);
        let angle = bounded(free, self.low, self.high);
        let rate = bounded(rate, -self.rate, self.rate);
        Servo {
            angle,
            // At a stop the surface rests.
            rate: if free == angle { rate } else { 0.0 },
        }
    }

    /// Servos and motor after the time of this transition.
    #[inline(always)]
    pub fn drive(
        &self,
        servos: &mut [Servo; 3],
        motor: &mut f64,
        angles: &[f64; 3],
        throttle: f64,
    ) {
        for k in 0..3 {
            servos[k] = self.servo(servos[k], angles[k]);
        }
        let throttle = bounded(throttle, 0.0, 1.0);
        *motor = throttle + (*motor - throttle) * self.motor_keep;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::aircraft::Layout;

    fn surfaces() -> Surfaces {
        Surfaces {
            layout: Layout::Elevons,
            min_deg: -30.0,
            max_deg: 35.0,
            rate_deg_s: 200.0,
            natural_frequency_rad_s: 100.0,
            damping_ratio: 1.71,
            delay_s: 0.0,
            elevator_offset_deg: 0.0,
            aileron_offset_deg: 0.0,
            rudder_offset_deg: 0.0,
        }
    }

    /// scipy 1.15: `scipy.signal.step(([1e4],[1,342,1e4]), T=[0,.01,.02,.05,.1])[1]`
    #[test]
    fn small_step_is_the_analytic_response() {
        let lag = LagStep::new(&surfaces(), 0.2, 0.01);
        let mut servo = Servo {
            angle: 0.0,
            rate: 0.0,
        };
        let fast = 171.0 + (171.0_f64.powi(2) - 1e4).sqrt();
        let slow = 1e4 / fast;
        for k in 1..=10 {
            servo = lag.servo(servo, 0.01);
            let t = f64::from(k) * 0.01;
            let exact = 1.0 - (fast * (-slow * t).exp() - slow * (-fast * t).exp()) / (fast - slow);
            assert!((servo.angle / 0.01 - exact).abs() < 1e-12, "{t}");
        }
    }

    #[test]
    fn rate_and_travel_are_limited() {
        let lag = LagStep::new(&surfaces(), 0.2, 0.005);
        let mut servo = Servo {
            angle: 0.0,
            rate: 0.0,
        };
        for _ in 0..200 {
            let next = lag.servo(servo, 2.0);
            assert!((next.angle - servo.angle).abs() <= 200f64.to_radians() * 0.005 + 1e-12);
            servo = next;
        }
        assert!(servo.angle <= 35f64.to_radians());
        assert!((servo.angle - 35f64.to_radians()).abs() < 1e-6);
    }
}
