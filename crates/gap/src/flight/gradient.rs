//! Gusts that the aircraft meets piece by piece: while a gust has reached the wing and not yet the
//! tail, the air turns about the aircraft, which its damping feels (MIL-F-8785C, 3.7.5: rotary
//! gusts as gradients of the linear ones along the way, smoothed over the span).

use std::f64::consts::PI;

/// Least airspeed that the way through a gust is reckoned with, m/s.
pub const SLOWEST_M_S: f64 = 5.0;
/// Share of a gust's gradient that turns the aircraft, pitch and yaw: by the standard all of it;
/// a wing far ahead of a small tail meets less.
pub const USUAL_SHARE: f64 = 0.5;
/// Prior standard deviation of that share.
pub const SHARE_SD: f64 = 0.4;

/// What of a gust's gradient turns an aircraft.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Gradient {
    /// Shares of pitch and yaw, about 0 to 1.
    pub share: [f64; 2],
    /// Wing span, m.
    pub span_m: f64,
}

impl Gradient {
    /// Ways over which the lateral gust (yaw) and the vertical gust (pitch) are smoothed, m.
    pub fn ways_m(&self) -> [f64; 2] {
        [3.0 * self.span_m / PI, 4.0 * self.span_m / PI]
    }

    /// What of the difference to the smoothed lateral and vertical gust is left after `dt_s`.
    pub fn kept(&self, airspeed_m_s: f64, dt_s: f64) -> [f64; 2] {
        let way_m = airspeed_m_s.max(SLOWEST_M_S) * dt_s;
        self.ways_m().map(|w| (-way_m / w).exp())
    }

    /// How the aircraft turns relative to the air beyond its own rates where so much of the
    /// lateral and the vertical gust (body axes, m/s) is `fresh`: roll, pitch, yaw, rad/s.
    pub fn turn(&self, fresh: [f64; 2]) -> [f64; 3] {
        let [lateral_m, vertical_m] = self.ways_m();
        [
            0.0,
            self.share[0] * fresh[1] / vertical_m,
            -self.share[1] * fresh[0] / lateral_m,
        ]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const ULTRA_STICK: Gradient = Gradient {
        share: [1.0, 1.0],
        span_m: 1.27,
    };

    /// MIL-F-8785C: q = (dw/dt)/V and r = -(dv/dt)/V for gusts that grow slowly.
    #[test]
    fn a_steady_growth_turns_by_its_gradient() {
        let (speed, growth, dt) = (18.0, 2.0, 1e-3);
        let mut smoothed = [0.0; 2];
        let mut now = [0.0; 2];
        let kept = ULTRA_STICK.kept(speed, dt);
        for k in 0..2000 {
            smoothed = std::array::from_fn(|n| now[n] + (smoothed[n] - now[n]) * kept[n]);
            now = [growth * dt * f64::from(k), -growth * dt * f64::from(k)];
        }
        let turn = ULTRA_STICK.turn(std::array::from_fn(|n| now[n] - smoothed[n]));
        assert!((turn[1] + growth / speed).abs() < 2e-3, "{turn:?}");
        assert!((turn[2] + growth / speed).abs() < 2e-3, "{turn:?}");
    }

    #[test]
    fn a_gust_that_stands_does_not_turn() {
        let now = [1.5, -0.7];
        let kept = ULTRA_STICK.kept(18.0, 5.0);
        let turn = ULTRA_STICK.turn(std::array::from_fn(|n| now[n] * kept[n]));
        assert!(turn.iter().all(|t| t.abs() < 1e-9), "{turn:?}");
    }
}
