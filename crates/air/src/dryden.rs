//! Continuous gusts by the Dryden model of MIL-F-8785C (1980), low-altitude form extended with
//! the medium-altitude lengths, as first- and second-order filters of white noise.
//!
//! Filters are discretised exactly for the first-order component (u) and by cascaded exact
//! first-order sections for v and w, so that variance does not depend on the step.

use rand::Rng;
use rand_distr::{Distribution, StandardNormal};

/// Metres in a foot.
const FOOT_M: f64 = 0.3048;

/// Standard deviations and length scales of turbulence at one height.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Turbulence {
    /// Standard deviation of the gust along, across and vertical to the mean wind, m/s.
    pub sigma_m_s: [f64; 3],
    /// Length scales of the same, m.
    pub length_m: [f64; 3],
}

impl Turbulence {
    /// Turbulence at `height_agl_m` for a wind of `wind_20ft_m_s` at 20 ft, scaled by
    /// `intensity` (1 is the standard's own). MIL-F-8785C: σw = 0.1 W20,
    /// σu = σv = σw / (0.177 + 0.000823 h)^0.4, Lw = h, Lu = Lv = h / (0.177 + 0.000823 h)^1.2
    /// for 10 ft < h < 1000 ft; above 1000 ft those of 1000 ft are kept, which is the standard's
    /// own value there (σ equal, L = 1000 ft) up to the 1750 ft of medium altitude.
    pub fn mil_f_8785c(height_agl_m: f64, wind_20ft_m_s: f64, intensity: f64) -> Self {
        let h_ft = (height_agl_m / FOOT_M).clamp(10.0, 1000.0);
        let base = 0.177 + 0.000_823 * h_ft;
        let sigma_w = 0.1 * wind_20ft_m_s * intensity;
        let sigma_u = sigma_w / base.powf(0.4);
        let length_u = h_ft / base.powf(1.2) * FOOT_M;
        Self {
            sigma_m_s: [sigma_u, sigma_u, sigma_w],
            length_m: [length_u, length_u, h_ft * FOOT_M],
        }
    }
}

/// The gust felt by one vehicle: filter states of the three components.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Dryden {
    u: f64,
    v: [f64; 2],
    w: [f64; 2],
}

impl Dryden {
    /// A gust that starts from stillness.
    pub fn new() -> Self {
        Self::default()
    }

    /// Advances by `dt_s` while flying through the air at `airspeed_m_s` and returns the gust
    /// along, across (right) and down relative to the mean wind, m/s.
    pub fn step<R: Rng>(
        &mut self,
        dt_s: f64,
        airspeed_m_s: f64,
        turbulence: &Turbulence,
        rng: &mut R,
    ) -> [f64; 3] {
        // Taylor's (1938) frozen turbulence: a vehicle flies through L at its airspeed, so that the
        // filter's time constant is L/V. One that stands still would meet no change at all.
        let speed = airspeed_m_s.max(1.0);
        let mut white = || -> f64 { StandardNormal.sample(rng) };
        let [su, sv, sw] = turbulence.sigma_m_s;
        let [lu, lv, lw] = turbulence.length_m;
        // σu √(2L/πV) / (1 + (L/V) s): an Ornstein–Uhlenbeck process, whose transition is exact with
        // this variance of the noise at any step (Gillespie 1996, equation 3.1).
        let decay = (-dt_s * speed / lu).exp();
        self.u = decay * self.u + su * (1.0 - decay * decay).sqrt() * white();
        [
            self.u,
            second_order(&mut self.v, dt_s * speed / lv, sv, white()),
            second_order(&mut self.w, dt_s * speed / lw, sw, white()),
        ]
    }
}

/// Dryden's lateral and vertical form, σ √(L/πV) (1 + √3 (L/V) s) / (1 + (L/V) s)²: a unit
/// Ornstein-Uhlenbeck process `x0` seen directly and through one more lag `x1` of the same
/// length: (1 + √3 T s)/(1 + T s)² = √3/(1 + T s) + (1 − √3)/(1 + T s)². With x0 of unit
/// variance, x1 (its lag) has variance 1/2 and covariance 1/2 with x0, so that the output
/// variance is 3 + √3(1 − √3) + (1 − √3)²/2 = 2, hence the division by √2.
fn second_order(state: &mut [f64; 2], steps: f64, sigma: f64, white: f64) -> f64 {
    let decay = (-steps).exp();
    // Exact transition of the chain; the noise enters x0, and x1 follows it.
    let [x0, x1] = *state;
    let noise = (1.0 - decay * decay).sqrt() * white;
    state[0] = decay * x0 + noise;
    state[1] = decay * (x1 + steps * x0) + noise * lag_share(steps, decay);
    let root3 = 3.0_f64.sqrt();
    sigma * (root3 * state[0] + (1.0 - root3) * state[1]) / std::f64::consts::SQRT_2
}

/// Share of a step's noise that has reached the second lag at the end of the step: the value
/// that keeps the stationary covariance of x0 and x1 at 1/2 for every step length. With d the decay
/// over the step, E[x0' x1'] = d²(E[x0 x1] + steps E[x0²]) + share E[noise²], hence
/// share = (1/2 − d²(1/2 + steps)) / (1 − d²).
fn lag_share(steps: f64, decay: f64) -> f64 {
    let injected = 1.0 - decay * decay;
    // Over a step of next to no length both sides vanish.
    if injected < 1e-12 {
        return 0.0;
    }
    (0.5 - decay * decay * (0.5 + steps)) / injected
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;
    use rand::rngs::ChaCha8Rng;

    #[test]
    fn low_altitude_numbers_of_the_standard() {
        // MIL-F-8785C figure 10/11 formulas at h = 1000 ft: σu = σw, L = 1000 ft.
        let t = Turbulence::mil_f_8785c(304.8, 10.0, 1.0);
        assert!((t.sigma_m_s[2] - 1.0).abs() < 1e-12);
        assert!((t.sigma_m_s[0] - 1.0).abs() < 1e-9);
        assert!((t.length_m[0] - 304.8).abs() < 1e-6);
        assert!((t.length_m[2] - 304.8).abs() < 1e-9);
    }

    #[test]
    fn variance_is_that_asked_for_at_any_step() {
        let turbulence = Turbulence {
            sigma_m_s: [1.5, 1.5, 0.8],
            length_m: [200.0, 200.0, 50.0],
        };
        for dt in [0.02, 0.1, 0.5] {
            let mut rng = ChaCha8Rng::seed_from_u64(7);
            let mut gust = Dryden::new();
            let n = (40_000.0 / dt) as usize;
            let mut sum_sq = [0.0; 3];
            for _ in 0..n {
                let g = gust.step(dt, 20.0, &turbulence, &mut rng);
                for (sum, g) in sum_sq.iter_mut().zip(g) {
                    *sum += g * g;
                }
            }
            for (sum, sigma) in sum_sq.iter().zip(turbulence.sigma_m_s) {
                let sd = (sum / n as f64).sqrt();
                // 40,000 s hold at least 2,000 independent gusts: 5 % is over three standard errors.
                assert!(
                    (sd / sigma - 1.0).abs() < 0.05,
                    "step {dt} s: {sd} for {sigma}"
                );
            }
        }
    }
}
