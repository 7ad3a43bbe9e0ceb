//! The noise of a flight and how it is fitted: white noise of each sensor, gusts, and
//! disturbances of force and moment that remember.

use super::channel::{ALL, CHANNELS};
use super::filter::{Pass, Step, correlation_s, run, steps};
use super::gate::Segment;
use super::motion::{LEAN, SMOOTHED_LATERAL, SMOOTHED_VERTICAL, STATES, World};
use super::transition::{Error, Matrix, across, between, times};
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

/// Number of sizes: of the sensors, and of gusts, disturbances and slow errors.
const SIZES: usize = CHANNELS + 9;
/// Axes that disturbances act about and along.
pub const AXES: usize = 6;
/// Part of a disturbance that is tried in its place.
pub const QUIETER: f64 = 0.5;
/// Farthest step of the logarithm of a size.
const FARTHEST: f64 = 1.0;
/// Power of the sure step that is tried first, and by how much more after one that gained.
const FIRST_POWER: f64 = 2.0;
const FASTER: f64 = 1.3;
/// Gain of a step, nats, below which the noise has settled.
const SETTLED_NATS: f64 = 2.0;
/// Prior of the logarithm of every size: wide.
const LOG_SD: f64 = 1.2;

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

    fn sizes(&self) -> [f64; SIZES] {
        let mut sizes = [self.lean_rad; SIZES];
        sizes[..CHANNELS].copy_from_slice(&self.sensor);
        sizes[CHANNELS..CHANNELS + 2].copy_from_slice(&self.gust_m_s);
        sizes[CHANNELS + 2..CHANNELS + 5].copy_from_slice(&self.spin_rad_s2);
        sizes[CHANNELS + 5..CHANNELS + 8].copy_from_slice(&self.push_m_s2);
        sizes
    }

    fn of_sizes(sizes: &[f64; SIZES]) -> Self {
        let three = |k: usize| [sizes[k], sizes[k + 1], sizes[k + 2]];
        Self {
            sensor: std::array::from_fn(|c| sizes[c]),
            gust_m_s: [sizes[CHANNELS], sizes[CHANNELS + 1]],
            spin_rad_s2: three(CHANNELS + 2),
            push_m_s2: three(CHANNELS + 5),
            lean_rad: sizes[CHANNELS + 8],
        }
    }

    /// Place among the sizes of what drives a state; none of what has no memory of its own.
    fn size_of(state: usize) -> Option<usize> {
        match state {
            9 | 10 => Some(CHANNELS),
            11..18 => Some(CHANNELS + state - 10),
            LEAN..SMOOTHED_LATERAL => Some(CHANNELS + 8),
            _ => None,
        }
    }

    /// Logarithm of each size over its usual one, in prior standard deviations.
    fn departures(&self) -> [f64; SIZES] {
        let (here, usual) = (self.sizes(), Self::usual().sizes());
        std::array::from_fn(|k| (here[k] / usual[k]).ln() / LOG_SD)
    }

    /// The disturbance that is larger than usual by most, and by how many prior standard deviations.
    pub fn most_disturbed(&self) -> (usize, f64) {
        let departures = self.departures();
        let all = departures[CHANNELS + 2..].iter().copied().take(AXES);
        all.enumerate()
            .max_by(|a, b| a.1.total_cmp(&b.1))
            .unwrap_or((0, 0.0))
    }

    /// The same with a disturbance smaller by so many prior standard deviations.
    pub fn less_disturbed(&self, axis: usize, sds: f64) -> Self {
        self.quieter(axis, (-sds * LOG_SD).exp())
    }

    /// Log prior density, up to a constant.
    pub fn log_prior(&self) -> f64 {
        self.departures().iter().map(|d| -0.5 * d * d).sum()
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

/// At most so many stretches of so many samples, evenly through the data; all data where they are
/// fewer.
pub fn stretches(segments: &[Segment], most: usize, samples: usize) -> Vec<Segment> {
    let total: usize = segments.iter().map(Segment::len).sum();
    if total <= most * samples {
        return segments.to_vec();
    }
    let mut out = Vec::new();
    for k in 0..most {
        // Middle of the k-th of so many equal parts.
        let mut middle = (2 * k + 1) * total / (2 * most);
        for s in segments {
            if middle < s.len() {
                let length = samples.min(s.len());
                let from = middle.saturating_sub(length / 2).min(s.len() - length);
                out.push(cut(s, from, from + length));
                break;
            }
            middle -= s.len();
        }
    }
    out
}

/// Part of a stretch.
pub fn cut(s: &Segment, from: usize, to: usize) -> Segment {
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

/// Fits the noise to `flights`, from `noise`, in so many steps. Each moves the logarithms of all sizes
/// by what is seen of their squares over what is expected: the square root of that ratio leads
/// uphill for sure (Zhou et al. 2019), and a power of it mostly further.
pub fn fit(flights: &[(Segment, World)], noise: Noise, steps: usize) -> Noise {
    let mut power = FIRST_POWER;
    let mut at = (looked(flights, &noise), noise);
    for _ in 0..steps {
        let (Looked { ratio, .. }, noise) = &at;
        let sizes = noise.sizes();
        let step = |k: usize| (0.25 * power * ratio[k].ln()).clamp(-FARTHEST, FARTHEST);
        let next = Noise::of_sizes(&std::array::from_fn(|k| sizes[k] * step(k).exp()));
        let there = looked(flights, &next);
        let gained = there.score - at.0.score;
        if gained > 0.0 {
            at = (there, next);
            power *= FASTER;
            if gained < SETTLED_NATS {
                break;
            }
        } else {
            power = (0.5 * power).max(1.0);
        }
    }
    at.1
}

/// What flights say of the noise that they are followed with.
struct Looked {
    score: f64,
    /// Of each size's square what is seen over what is expected.
    ratio: [f64; SIZES],
}

fn looked(flights: &[(Segment, World)], noise: &Noise) -> Looked {
    let mut score = noise.log_prior();
    let mut sums = [[0.0; 2]; SIZES];
    for (segment, world) in flights {
        let (log_score, steps) = steps(segment, world, noise);
        score += log_score;
        add_slopes(&mut sums, &steps, noise);
    }
    for (sums, departure) in sums.iter_mut().zip(noise.departures()) {
        sums[usize::from(departure > 0.0)] += departure.abs() / LOG_SD;
    }
    // One that is not told of is as expected.
    let ratio = sums.map(|[seen, expected]| (seen + 1e-9) / (expected + 1e-9));
    Looked { score, ratio }
}

/// Adds to `slope` the slope of the log likelihood by the logarithms of all sizes: what is seen and, to
/// be taken off, what is expected of each, by one way back through the flight (Koopman and
/// Shephard 1992). `r` and `n` are how the rest of the flight depends on the state.
fn add_slopes(slope: &mut [[f64; 2]; SIZES], steps: &[Step], noise: &Noise) {
    let mut r = [0.0; STATES];
    let mut n = [[0.0; STATES]; STATES];
    for step in steps.iter().rev() {
        add_driven(slope, &r, &n, |state| step.process[state]);
        r = across(&step.keep, &r);
        n = between(&n, &step.keep);
        for taken in step.taken.iter().rev() {
            let gain = taken.gain.map(|g| g / taken.used);
            let v = times(&n, &gain);
            let dot = |a: &Error, b: &Error| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
            let u = taken.away / taken.used - dot(&gain, &r);
            let d = 1.0 / taken.used + dot(&gain, &v);
            slope[taken.channel][0] += u * u * taken.noise;
            slope[taken.channel][1] += d * taken.noise;
            for &(k, h) in &taken.told {
                r[k] += h * u;
                for l in 0..STATES {
                    n[k][l] -= h * v[l];
                    n[l][k] -= h * v[l];
                }
            }
            for &(k, h) in &taken.told {
                for &(l, other) in &taken.told {
                    n[k][l] += d * h * other;
                }
            }
        }
    }
    add_driven(slope, &r, &n, |state| noise.stationary(state).powi(2));
}

/// Adds what states that are driven by so much variance add to the slope.
fn add_driven(
    slope: &mut [[f64; 2]; SIZES],
    r: &Error,
    n: &Matrix,
    variance: impl Fn(usize) -> f64,
) {
    for state in 9..SMOOTHED_LATERAL {
        if let Some(size) = Noise::size_of(state) {
            slope[size][0] += r[state] * r[state] * variance(state);
            slope[size][1] += n[state][state] * variance(state);
        }
    }
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
