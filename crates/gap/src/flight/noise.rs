//! The noise of a flight and how it is fitted: white noise of each sensor, gusts, and
//! disturbances of force and moment that remember.

use super::channel::{ALL, CHANNELS};
use super::filter::{Pass, correlation_s, run};
use super::gate::Segment;
use super::motion::{LEAN, SMOOTHED_LATERAL, SMOOTHED_VERTICAL, World};
use serde::Serialize;

/// Sizes of the noise, one standard deviation each.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Noise {
    /// White noise of each channel, SI.
    pub sensor: [f64; CHANNELS],
    /// Gusts: north, east (one size) and down, m/s.
    pub gust_m_s: [f64; 2],
    /// Disturbing angular acceleration, rad/s².
    pub spin_rad_s2: [f64; 3],
    /// Disturbing specific force, m/s².
    pub push_m_s2: [f64; 3],
    /// Slow error of the logged roll and pitch angle, rad.
    pub lean_rad: f64,
}

/// Number of sizes that are searched for (the sensors' are found by a fixed point).
const SEARCHED: usize = 9;
/// Axes that disturbances act about and along.
pub const AXES: usize = 6;
/// Part of a disturbance that is tried in its place.
pub const QUIETER: f64 = 0.5;
/// Most such steps of one disturbance in a round.
const RIDGE_STEPS: usize = 3;
/// Prior of the logarithm of every size: wide.
const LOG_SD: f64 = 1.2;
/// Samples on which the noise is fitted at most.
const FIT_SAMPLES: usize = 800;
/// Length of a stretch of them.
const STRETCH: usize = 200;

impl Noise {
    /// Before anything is known: the middle of the priors.
    pub fn usual() -> Self {
        let mut sensor = [0.0; CHANNELS];
        for (size, channel) in sensor.iter_mut().zip(&ALL) {
            *size = channel.usual_noise * channel.si;
        }
        Self {
            sensor,
            gust_m_s: [1.0, 0.6],
            spin_rad_s2: [0.8, 0.5, 0.3],
            push_m_s2: [0.15, 0.15, 0.3],
            lean_rad: 0.004,
        }
    }

    /// The same with one disturbance `part` as large: angular acceleration about each axis, then
    /// specific force along each.
    pub fn quieter(&self, axis: usize, part: f64) -> Self {
        let mut quieter = self.clone();
        match axis {
            0..3 => quieter.spin_rad_s2[axis] *= part,
            _ => quieter.push_m_s2[axis - 3] *= part,
        }
        quieter
    }

    fn searched(&self) -> [f64; SEARCHED] {
        let [h, v] = self.gust_m_s;
        let [l, m, n] = self.spin_rad_s2;
        let [x, y, z] = self.push_m_s2;
        [h, v, l, m, n, x, y, z, self.lean_rad]
    }

    fn with_searched(&self, s: [f64; SEARCHED]) -> Self {
        Self {
            sensor: self.sensor,
            gust_m_s: [s[0], s[1]],
            spin_rad_s2: [s[2], s[3], s[4]],
            push_m_s2: [s[5], s[6], s[7]],
            lean_rad: s[8],
        }
    }

    /// Log prior density, up to a constant.
    pub fn log_prior(&self) -> f64 {
        let usual = Self::usual();
        let part = |a: f64, b: f64| -0.5 * ((a / b).ln() / LOG_SD).powi(2);
        let searched = self.searched().into_iter().zip(usual.searched());
        searched.map(|(a, b)| part(a, b)).sum()
    }

    /// Stationary standard deviation of a state that remembers, places as in the filter.
    pub fn stationary(&self, state: usize) -> f64 {
        match state {
            9 | 10 | SMOOTHED_LATERAL => self.gust_m_s[0],
            11 | SMOOTHED_VERTICAL => self.gust_m_s[1],
            12..15 => self.spin_rad_s2[state - 12],
            15..18 => self.push_m_s2[state - 15],
            LEAN..SMOOTHED_LATERAL => self.lean_rad,
            _ => 0.0,
        }
    }

    /// Variance that an interval adds to a state.
    pub fn process(&self, state: usize, dt_s: f64) -> f64 {
        if !(9..SMOOTHED_LATERAL).contains(&state) {
            // What the step's own error may be: keeps the covariance positive.
            return 1e-9 * dt_s;
        }
        let gone = 1.0 - (-2.0 * dt_s / correlation_s(state)).exp();
        self.stationary(state).powi(2) * gone
    }
}

/// Stretches of the data on which the noise is fitted, evenly through them.
pub fn stretches(segments: &[Segment]) -> Vec<Segment> {
    let total: usize = segments.iter().map(Segment::len).sum();
    if total <= FIT_SAMPLES {
        return segments.to_vec();
    }
    let wanted = FIT_SAMPLES / STRETCH;
    let mut out = Vec::new();
    for k in 0..wanted {
        // Middle of the k-th of so many equal parts.
        let mut middle = (2 * k + 1) * total / (2 * wanted);
        for s in segments {
            if middle < s.len() {
                let length = STRETCH.min(s.len());
                let from = middle.saturating_sub(length / 2).min(s.len() - length);
                out.push(cut(s, from, from + length));
                break;
            }
            middle -= s.len();
        }
    }
    out
}

fn cut(s: &Segment, from: usize, to: usize) -> Segment {
    Segment {
        log: s.log,
        time_s: s.time_s[from..to].to_vec(),
        measured: s.measured[from..to].to_vec(),
        command: s.command[from..to].to_vec(),
        density: s.density[from..to].to_vec(),
        wind_ned: s.wind_ned.as_ref().map(|w| w[from..to].to_vec()),
    }
}

/// Sum of several passes.
fn score(flights: &[(Segment, World)], noise: &Noise) -> (f64, Vec<Pass>) {
    let passes: Vec<Pass> = flights
        .iter()
        .map(|(segment, world)| run(segment, world, noise, false))
        .collect();
    let sum = passes.iter().map(|p| p.log_score).sum::<f64>() + noise.log_prior();
    (sum, passes)
}

/// Fits the noise to `flights`, from `noise`: in turn the sensors' by what is left after the
/// update (Desroziers et al. 2005: innovation times rest has the noise's variance as mean), and
/// the others by a Newton step each on the log likelihood. `rounds` is how often.
pub fn fit(flights: &[(Segment, World)], noise: Noise, rounds: usize) -> Noise {
    const STEP: f64 = 0.25;
    const FARTHEST: f64 = 1.2;
    let mut noise = noise;
    for round in 0..rounds {
        for _ in 0..if round == 0 { 3 } else { 2 } {
            let (_, passes) = score(flights, &noise);
            noise = with_sensors(&noise, &passes);
        }
        let sizes = noise.searched();
        let middle = score(flights, &noise).0;
        let mut moved = sizes;
        for k in 0..SEARCHED {
            let at = |log: f64| {
                let mut sizes = sizes;
                sizes[k] *= log.exp();
                score(flights, &noise.with_searched(sizes)).0
            };
            let (up, down) = (at(STEP), at(-STEP));
            let slope = (up - down) / (2.0 * STEP);
            let bend = (up + down - 2.0 * middle) / (STEP * STEP);
            let step = if bend < -1e-3 {
                (-slope / bend).clamp(-FARTHEST, FARTHEST)
            } else {
                FARTHEST.copysign(slope) * 0.5
            };
            moved[k] *= step.exp();
        }
        let next = noise.with_searched(moved);
        // All at once may go too far: half the way then.
        noise = if score(flights, &next).0 > middle {
            next
        } else {
            let half: [f64; SEARCHED] = std::array::from_fn(|k| (sizes[k] * moved[k]).sqrt());
            let half = noise.with_searched(half);
            if score(flights, &half).0 > middle {
                half
            } else {
                noise
            }
        };
        noise = along_the_ridge(flights, noise);
    }
    settled(flights, &noise)
}

/// Where a disturbance is too large a rate's or an accelerometer's white noise is found too small,
/// and neither leads back alone: both are moved together, as long as that is more likely.
fn along_the_ridge(flights: &[(Segment, World)], noise: Noise) -> Noise {
    let mut best = settled(flights, &noise);
    let mut most = score(flights, &best).0;
    for axis in 0..AXES {
        for _ in 0..RIDGE_STEPS {
            let next = settled(flights, &best.quieter(axis, QUIETER));
            let there = score(flights, &next).0;
            if there <= most {
                break;
            }
            (best, most) = (next, there);
        }
    }
    best
}

/// `noise` with the sensors' part as `flights` then tell it.
pub fn settled(flights: &[(Segment, World)], noise: &Noise) -> Noise {
    let once = with_sensors(noise, &score(flights, noise).1);
    with_sensors(&once, &score(flights, &once).1)
}

fn with_sensors(noise: &Noise, passes: &[Pass]) -> Noise {
    let mut out = noise.clone();
    for c in 0..CHANNELS {
        let count: usize = passes.iter().map(|p| p.count[c]).sum();
        let left: f64 = passes.iter().map(|p| p.left[c]).sum();
        if count > 10 {
            let least = (0.01 * ALL[c].usual_noise * ALL[c].si).powi(2);
            // Weighted by what a wide prior says, worth a few readings.
            let usual = (ALL[c].usual_noise * ALL[c].si).powi(2);
            let variance = (left + 2.0 * usual) / (count as f64 + 2.0);
            out.sensor[c] = variance.max(least).sqrt();
        }
    }
    out
}
