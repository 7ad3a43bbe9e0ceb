//! The wind that carries the plume: one gusty vector for the whole site at a time, and what
//! the platforms log of it.

use rand::rngs::ChaCha8Rng;
use rand::{Rng, SeedableRng};

use crate::random::{OrnsteinUhlenbeck, normal};

/// How the wind at the plume's axis varies.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct WindLaw {
    /// Mean speed at the axis, m/s.
    pub speed_m_s: f64,
    /// Mean direction *from*, degrees.
    pub from_deg: f64,
    /// Slow swings of direction: standard deviation, degrees, and correlation time, s.
    pub slow_meander: (f64, f64),
    /// Gusts of direction: standard deviation, degrees, and correlation time, s.
    pub direction_gust: (f64, f64),
    /// Gusts of speed: standard deviation over the mean, and correlation time, s.
    pub speed_gust: (f64, f64),
    /// A periodic swing that the log does not show: amplitude, degrees, and period, s.
    pub unlogged_oscillation: Option<(f64, f64)>,
    /// A wander that the log does not show: standard deviation, degrees, and correlation time, s.
    pub unlogged_wander: Option<(f64, f64)>,
    /// Steady turning of the true transport against the logged one, degrees an hour.
    pub drift_deg_per_h: f64,
}

/// Step of the wind's history, s.
const STEP_S: f64 = 1.0;

/// The history of the wind at the axis.
#[derive(Debug, Clone)]
pub struct WindTruth {
    start_s: f64,
    /// Direction from, degrees, as a perfect log would have it.
    logged_deg: Vec<f64>,
    /// Speed, m/s.
    speed_m_s: Vec<f64>,
    /// Metres east and north that the air has moved since the start.
    moved: Vec<[f64; 2]>,
    /// Metres of path since the start.
    path_m: Vec<f64>,
}

/// Where the wind has carried the air that was at the source.
#[derive(Debug, Clone, Copy)]
pub struct Travel {
    /// Displacement east, m.
    pub east_m: f64,
    /// Displacement north, m.
    pub north_m: f64,
    /// Length of the path, m.
    pub path_m: f64,
}

impl WindTruth {
    /// A history from `before_s` before time 0 to `until_s`; `transport_offset_deg` is added to
    /// the logged direction to get that of the transport.
    pub fn draw<R: Rng>(
        law: &WindLaw,
        before_s: f64,
        until_s: f64,
        transport_offset_deg: f64,
        rng: &mut R,
    ) -> Self {
        let steps = ((before_s + until_s) / STEP_S).ceil() as usize + 2;
        // Turbulence as Ornstein–Uhlenbeck processes: normal, with an exponential autocorrelation
        // (Pope 2000, section 12.3).
        let mut slow = OrnsteinUhlenbeck::new(law.slow_meander.1, rng);
        let mut gust = OrnsteinUhlenbeck::new(law.direction_gust.1, rng);
        let mut speed_gust = OrnsteinUhlenbeck::new(law.speed_gust.1, rng);
        let phase = rng.next_u32() as f64 / f64::from(u32::MAX) * std::f64::consts::TAU;
        // A stream of its own, so that a wander leaves all else as it was.
        let mut wander_rng = ChaCha8Rng::seed_from_u64(phase.to_bits());
        let wander = law.unlogged_wander.unwrap_or((0.0, 1.0));
        let mut wandering = OrnsteinUhlenbeck::new(wander.1, &mut wander_rng);
        let mut truth = Self {
            start_s: -before_s,
            logged_deg: Vec::with_capacity(steps),
            speed_m_s: Vec::with_capacity(steps),
            moved: vec![[0.0, 0.0]],
            path_m: vec![0.0],
        };
        for k in 0..steps {
            let time_s = k as f64 * STEP_S - before_s;
            let swing = law.slow_meander.0 * slow.step(STEP_S, rng)
                + law.direction_gust.0 * gust.step(STEP_S, rng);
            let logged = law.from_deg + swing;
            let hidden = law
                .unlogged_oscillation
                .map_or(0.0, |(amplitude, period_s)| {
                    amplitude * (std::f64::consts::TAU * time_s / period_s + phase).sin()
                });
            let wander = wander.0 * wandering.step(STEP_S, &mut wander_rng);
            let drift = law.drift_deg_per_h * time_s / 3600.0;
            let speed =
                law.speed_m_s * (1.0 + law.speed_gust.0 * speed_gust.step(STEP_S, rng)).max(0.2);
            let from = (logged + transport_offset_deg + hidden + wander + drift).to_radians();
            let last = truth.moved[k];
            let (sin, cos) = from.sin_cos();
            let moved = [
                last[0] - speed * sin * STEP_S,
                last[1] - speed * cos * STEP_S,
            ];
            truth.moved.push(moved);
            truth.path_m.push(truth.path_m[k] + speed * STEP_S);
            truth.logged_deg.push(logged);
            truth.speed_m_s.push(speed);
        }
        truth
    }

    fn at(&self, time_s: f64) -> (usize, f64) {
        let place =
            ((time_s - self.start_s) / STEP_S).clamp(0.0, self.speed_m_s.len() as f64 - 1.0);
        let index = (place.floor() as usize).min(self.speed_m_s.len() - 1);
        (index, place - index as f64)
    }

    /// Displacement and path since the start of the history.
    pub fn moved_at(&self, time_s: f64) -> Travel {
        let (i, share) = self.at(time_s);
        let mix = |a: f64, b: f64| a + share * (b - a);
        Travel {
            east_m: mix(self.moved[i][0], self.moved[i + 1][0]),
            north_m: mix(self.moved[i][1], self.moved[i + 1][1]),
            path_m: mix(self.path_m[i], self.path_m[i + 1]),
        }
    }

    /// First and last whole second at which air passed the source that is `least_m` to `most_m`
    /// of path away at `time_s`; none (first after last) where there is no such second.
    pub fn emitted_between(&self, time_s: f64, least_m: f64, most_m: f64) -> (i64, i64) {
        let now = self.moved_at(time_s).path_m;
        let first = self.path_m.partition_point(|&p| p < now - most_m).max(1) as i64;
        let last = self
            .path_m
            .partition_point(|&p| p <= now - least_m.max(0.0)) as i64
            - 1;
        let start = self.start_s as i64;
        (first + start, last + start)
    }

    /// Unit vector towards which the transport goes at `time_s`, and its speed, m/s.
    pub fn transport(&self, time_s: f64) -> ([f64; 2], f64) {
        let (i, _) = self.at(time_s);
        let step = [
            self.moved[i + 1][0] - self.moved[i][0],
            self.moved[i + 1][1] - self.moved[i][1],
        ];
        let length = step[0].hypot(step[1]).max(1e-9);
        ([step[0] / length, step[1] / length], self.speed_m_s[i])
    }

    /// Direction from, degrees, that a perfect instrument at the axis logs at `time_s`.
    pub fn logged_from_deg(&self, time_s: f64) -> f64 {
        self.logged_deg[self.at(time_s).0]
    }

    /// Speed at the axis at `time_s`, m/s.
    pub fn speed_m_s(&self, time_s: f64) -> f64 {
        self.speed_m_s[self.at(time_s).0]
    }
}

/// What one platform's wind instrument adds: local turbulence and noise.
#[derive(Debug, Clone)]
pub struct WindLog {
    turbulence: [OrnsteinUhlenbeck; 2],
    turbulence_sd: [f64; 2],
    noise_sd: [f64; 2],
}

impl WindLog {
    /// Turbulence and noise as (degrees, share of speed), with a correlation time of
    /// `time_scale_s` for the former.
    pub fn new<R: Rng>(
        turbulence_sd: [f64; 2],
        noise_sd: [f64; 2],
        time_scale_s: f64,
        rng: &mut R,
    ) -> Self {
        let turbulence = [
            OrnsteinUhlenbeck::new(time_scale_s, rng),
            OrnsteinUhlenbeck::new(time_scale_s, rng),
        ];
        Self {
            turbulence,
            turbulence_sd,
            noise_sd,
        }
    }

    /// The (direction, speed) logged `step_s` after the last where the wind is
    /// (`from_deg`, `speed_m_s`).
    pub fn read<R: Rng>(
        &mut self,
        from_deg: f64,
        speed_m_s: f64,
        step_s: f64,
        rng: &mut R,
    ) -> (f64, f64) {
        let mut off = [0.0; 2];
        for (k, off) in off.iter_mut().enumerate() {
            *off = self.turbulence_sd[k] * self.turbulence[k].step(step_s, rng)
                + self.noise_sd[k] * normal(rng);
        }
        let logged = (from_deg + off[0]).rem_euclid(360.0);
        (logged, (speed_m_s * (1.0 + off[1])).max(0.1))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::stream;

    const STEADY: WindLaw = WindLaw {
        speed_m_s: 5.0,
        from_deg: 270.0,
        slow_meander: (0.0, 100.0),
        direction_gust: (0.0, 10.0),
        speed_gust: (0.0, 50.0),
        unlogged_oscillation: None,
        unlogged_wander: None,
        drift_deg_per_h: 0.0,
    };

    #[test]
    fn a_steady_west_wind_carries_east() {
        let wind = WindTruth::draw(&STEADY, 300.0, 100.0, 0.0, &mut stream(1, "w"));
        let (from, to) = (wind.moved_at(-200.0), wind.moved_at(20.5));
        let travel = Travel {
            east_m: to.east_m - from.east_m,
            north_m: to.north_m - from.north_m,
            path_m: to.path_m - from.path_m,
        };
        assert!((travel.east_m - 5.0 * 220.5).abs() < 1e-6 && travel.north_m.abs() < 1e-6);
        assert!((travel.path_m - travel.east_m).abs() < 1e-6);
        let turned = WindTruth::draw(&STEADY, 300.0, 100.0, 90.0, &mut stream(1, "w"));
        // Logged west, carried as by a north wind.
        assert!((turned.logged_from_deg(3.0) - 270.0).abs() < 1e-9);
        assert!(turned.transport(3.0).0[1] < -0.999);
    }

    #[test]
    fn direction_varies_as_said() {
        let law = WindLaw {
            slow_meander: (3.0, 50.0),
            ..STEADY
        };
        let wind = WindTruth::draw(&law, 0.0, 50_000.0, 0.0, &mut stream(2, "w"));
        let var: f64 = (0..50_000)
            .map(|t| (wind.logged_from_deg(f64::from(t)) - 270.0).powi(2))
            .sum::<f64>()
            / 50_000.0;
        assert!((var.sqrt() / 3.0 - 1.0).abs() < 0.1, "{}", var.sqrt());
    }
}
