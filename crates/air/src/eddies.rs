//! Eddies: what makes the wind meander about its mean over minutes, slower than the gusts of
//! [`crate::dryden`], and moves everything in it alike, aircraft and plumes.
//!
//! Each component of the deviation from the mean wind is an Ornstein-Uhlenbeck process with the
//! Lagrangian time scale T of the air, u' = σ OU(t/T). Air that went with it for a time τ has a variance
//! of place of 2 σ² T² (τ/T − 1 + exp(−τ/T)) (Taylor 1921): as σ² τ² at first, by and by as 2 σ² T τ.
//! With height the processes of neighbouring levels ([`LEVEL_M`] apart) take over from each other.

use rand::rngs::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

/// Time between two drawn winds, s: a hundredth of the shortest time scale that is usual.
const STEP_S: f64 = 1.0;
/// Heights that far apart have winds that are independent, m: the length scale of horizontal turbulence
/// above the surface layer (MIL-F-8785C: 1000 ft).
pub const LEVEL_M: f64 = 300.0;
/// Levels above that of the carried air.
const LEVELS_ABOVE: usize = 4;
/// Air is followed back in time for so long, s.
pub const LONGEST_WAY_S: f64 = 3600.0;

/// How strong and how slow eddies are.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct EddySpec {
    /// Standard deviation of the east, north and upward wind, m/s.
    pub sigma_m_s: [f64; 3],
    /// Lagrangian time scale of the same, s.
    pub time_scale_s: [f64; 3],
    /// Height of the air that is followed on its way, m above ground.
    pub height_agl_m: f64,
}

impl EddySpec {
    /// Variance of the place of air after `age_s` on its way, by component, m² (Taylor 1921, for an
    /// exponential correlation).
    pub fn way_variance_m2(&self, age_s: f64) -> [f64; 3] {
        std::array::from_fn(|k| {
            let (sd, scale) = (self.sigma_m_s[k], self.time_scale_s[k]);
            let n = age_s.max(0.0) / scale;
            // n − 1 + exp(−n) loses all digits for short times, where it is n²/2 − n³/6.
            let shape = if n < 1e-3 {
                n * n * (0.5 - n / 6.0)
            } else {
                n + (-n).exp_m1()
            };
            2.0 * sd * sd * scale * scale * shape
        })
    }
}

/// The winds of one moment.
#[derive(Debug, Clone)]
struct Moment {
    /// East, north and up, m/s, by level.
    wind: Vec<[f64; 3]>,
    /// Way of the followed air from the first moment to this, m.
    way_m: [f64; 3],
}

/// Eddies over time. The same seed gives the same eddies, in whatever order they are asked for.
#[derive(Debug)]
pub struct Eddies {
    spec: EddySpec,
    /// Index of the level of the followed air.
    own: usize,
    rng: ChaCha8Rng,
    moments: Vec<Moment>,
}

impl Eddies {
    /// Eddies that `rng` draws.
    pub fn new(spec: EddySpec, rng: ChaCha8Rng) -> Self {
        let own = (spec.height_agl_m.max(0.0) / LEVEL_M).ceil() as usize;
        let mut eddies = Self {
            spec,
            own,
            rng,
            moments: Vec::new(),
        };
        eddies.reach(0.0);
        eddies
    }

    /// How strong and how slow they are.
    pub fn spec(&self) -> &EddySpec {
        &self.spec
    }

    /// Draws moments until `time_s` lies before the last.
    fn reach(&mut self, time_s: f64) {
        let count = ((time_s + LONGEST_WAY_S) / STEP_S).max(0.0) as usize + 2;
        while self.moments.len() < count {
            let next = self.next();
            self.moments.push(next);
        }
    }

    fn next(&mut self) -> Moment {
        let levels = self.own + 1 + LEVELS_ABOVE;
        let EddySpec {
            sigma_m_s: sd,
            time_scale_s: scale,
            ..
        } = self.spec;
        let (rng, before) = (&mut self.rng, self.moments.last());
        let mut wind = vec![[0.0; 3]; levels];
        for (level, wind) in wind.iter_mut().enumerate() {
            for k in 0..3 {
                let white: f64 = StandardNormal.sample(rng);
                // Exact for any step (Gillespie 1996, equation 3.1).
                wind[k] = before.map_or(sd[k] * white, |b| {
                    let decay = (-STEP_S / scale[k]).exp();
                    decay * b.wind[level][k] + sd[k] * (1.0 - decay * decay).sqrt() * white
                });
            }
        }
        let way_m = before.map_or([0.0; 3], |b| {
            let (from, to) = (b.wind[self.own], wind[self.own]);
            std::array::from_fn(|k| b.way_m[k] + 0.5 * STEP_S * (from[k] + to[k]))
        });
        Moment { wind, way_m }
    }

    /// The moment before a time and the part of the step to the next that is behind.
    fn at(&mut self, time_s: f64) -> (usize, f64) {
        self.reach(time_s);
        let steps = ((time_s + LONGEST_WAY_S) / STEP_S).max(0.0);
        (steps as usize, steps.fract())
    }

    /// Deviation from the mean wind at a time and height, east, north and up, m/s.
    pub fn wind_m_s(&mut self, time_s: f64, height_agl_m: f64) -> [f64; 3] {
        let (i, part) = self.at(time_s);
        let last = self.own + LEVELS_ABOVE;
        let above = (height_agl_m - self.spec.height_agl_m) / LEVEL_M + self.own as f64;
        let above = above.clamp(0.0, last as f64);
        let low = (above as usize).min(last - 1);
        // Of two independent processes, so weighted that the variance is the same between them.
        let share = above - low as f64;
        let norm = (1.0 - share).hypot(share);
        let (a, b) = (&self.moments[i].wind, &self.moments[i + 1].wind);
        std::array::from_fn(|k| {
            let of = |level: usize| a[level][k] + part * (b[level][k] - a[level][k]);
            ((1.0 - share) * of(low) + share * of(low + 1)) / norm
        })
    }

    /// Way of the followed air from the time of the beginning, beside that of the mean wind, m: of
    /// two times the difference counts. Before [`LONGEST_WAY_S`] before time 0 nothing moves.
    pub fn way_m(&mut self, time_s: f64) -> [f64; 3] {
        let (i, part) = self.at(time_s);
        let (a, b) = (&self.moments[i], &self.moments[i + 1]);
        std::array::from_fn(|k| {
            // The wind is linear between moments: so the way is a parabola.
            let (from, to) = (a.wind[self.own][k], b.wind[self.own][k]);
            a.way_m[k] + STEP_S * part * (from + 0.5 * part * (to - from))
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;

    fn eddies(seed: u64) -> Eddies {
        let spec = EddySpec {
            sigma_m_s: [0.6, 0.6, 0.3],
            time_scale_s: [120.0, 120.0, 60.0],
            height_agl_m: 486.0,
        };
        Eddies::new(spec, ChaCha8Rng::seed_from_u64(seed))
    }

    #[test]
    fn the_order_of_questions_changes_nothing() {
        let (mut a, mut b) = (eddies(1), eddies(1));
        let late = a.wind_m_s(2000.0, 300.0);
        let early = a.wind_m_s(10.0, 300.0);
        assert_eq!(b.wind_m_s(10.0, 300.0), early);
        assert_eq!(b.wind_m_s(2000.0, 300.0), late);
        assert_ne!(eddies(2).wind_m_s(10.0, 300.0), early);
    }

    #[test]
    fn wind_and_way_have_the_variances_of_taylor() {
        // Over 400 independent histories; a sample variance is then good to 7 %, 4 of its sds are 28 %.
        let ages = [20.0, 120.0, 600.0];
        let (mut wind, mut between, mut way) = ([0.0; 3], 0.0, [[0.0; 3]; 3]);
        for seed in 0..400 {
            let mut e = eddies(seed);
            let now = e.way_m(900.0);
            for (sum, age_s) in way.iter_mut().zip(ages) {
                let then = e.way_m(900.0 - age_s);
                for k in 0..3 {
                    sum[k] += (now[k] - then[k]).powi(2) / 400.0;
                }
            }
            let at = e.wind_m_s(900.3, 486.0);
            let other = e.wind_m_s(900.3, 620.0);
            for k in 0..3 {
                wind[k] += at[k] * at[k] / 400.0;
            }
            between += other[0] * other[0] / 400.0;
        }
        // python: [2*s*s*T*T*(a/T-1+math.exp(-a/T)) for a in (20,120,600) for T,s in ((120,.6),(60,.3))]
        let expected = [
            [136.3, 136.3, 32.3],
            [3814.2, 3814.2, 735.7],
            [41_542.0, 41_542.0, 5_832.0],
        ];
        for (way, expected) in way.iter().zip(expected) {
            for k in 0..3 {
                assert!((way[k] / expected[k] - 1.0).abs() < 0.28, "{way:?}");
            }
        }
        for (k, variance) in [0.36, 0.36, 0.09].into_iter().enumerate() {
            assert!((wind[k] / variance - 1.0).abs() < 0.28, "{wind:?}");
        }
        assert!((between / 0.36 - 1.0).abs() < 0.28, "{between}");
        for (age_s, expected) in ages.into_iter().zip(expected) {
            let said = eddies(0).spec().way_variance_m2(age_s);
            for k in 0..3 {
                assert!((said[k] / expected[k] - 1.0).abs() < 2e-3, "{said:?}");
            }
        }
        assert!(eddies(0).spec().way_variance_m2(1e-3)[0] > 0.0);
    }

    #[test]
    fn the_way_is_the_integral_of_the_wind() {
        let mut e = eddies(3);
        let steps = 4000;
        let sum: f64 = (0..steps)
            .map(|k| e.wind_m_s(100.0 + 0.01 * (f64::from(k) + 0.5), 486.0)[1] * 0.01)
            .sum();
        let way = e.way_m(140.0)[1] - e.way_m(100.0)[1];
        assert!((sum - way).abs() < 1e-6, "{sum} {way}");
    }
}
