//! The noise of a flight and how it is fitted: white noise of each sensor, gusts, and
//! disturbances of force and moment that remember.

use super::channel::{ALL, CHANNELS};
use super::filter::{Keep, Step, run};
use super::gate::Segment;
use super::motion::{
    GUST, LEAN, SMOOTHED_LATERAL, SMOOTHED_VERTICAL, STATES, World, correlation_s,
};
use super::transition::{Error, Matrix, across, between, times};

/// Number of sizes: of the sensors, and of gusts, disturbances and slow errors.
const SIZES: usize = CHANNELS + 9;
/// The first of the disturbances.
const DISTURBANCES: usize = CHANNELS + 2;
/// Usual sizes beside those of the sensors: gusts to the sides and down (m/s), disturbing angular accelerations
/// (rad/s²) and specific forces (m/s²), slow errors of logged angles (rad).
const USUAL: [f64; 9] = [1.0, 0.6, 0.8, 0.5, 0.3, 0.15, 0.15, 0.3, 0.004];
/// Axes that disturbances act about and along.
pub const AXES: usize = 6;
/// Farthest step of the logarithm of a size.
const FARTHEST: f64 = 1.0;
/// Power of the sure step that is tried first, and by how much more after one that gained.
const FIRST_POWER: f64 = 2.0;
const FASTER: f64 = 1.3;
/// Gain of a step, nats, below which the noise has settled.
const SETTLED_NATS: f64 = 2.0;
/// Prior of the logarithm of every size: wide.
const LOG_SD: f64 = 1.2;

/// Sizes of the noise, one standard deviation each, SI: white noise of each channel, then those of `USUAL`.
#[derive(Debug, Clone, PartialEq)]
pub struct Noise([f64; SIZES]);

impl Noise {
    /// Before anything is known: the middle of the priors.
    pub fn usual() -> Self {
        let of = |k: usize| ALL.get(k).map(|c| c.usual_noise * c.si);
        Self(std::array::from_fn(|k| {
            of(k).unwrap_or_else(|| USUAL[k - CHANNELS])
        }))
    }

    /// White noise of a channel, SI.
    pub fn sensor(&self, channel: usize) -> f64 {
        self.0[channel]
    }

    /// Place among the sizes of what drives a state; none of what has no memory of its own.
    fn size_of(state: usize) -> Option<usize> {
        match state {
            9 | 10 => Some(CHANNELS),
            11..LEAN => Some(CHANNELS + state - 10),
            LEAN..SMOOTHED_LATERAL => Some(SIZES - 1),
            _ => None,
        }
    }

    /// Logarithm of each size over its usual one, in prior standard deviations.
    fn departures(&self) -> [f64; SIZES] {
        let usual = Self::usual().0;
        std::array::from_fn(|k| (self.0[k] / usual[k]).ln() / LOG_SD)
    }

    /// The disturbance that is larger than usual by most, and by how many prior standard deviations: angular
    /// acceleration about each axis, then specific force along each.
    pub fn most_disturbed(&self) -> (usize, f64) {
        let departures = self.departures();
        let all = departures[DISTURBANCES..].iter().copied().take(AXES);
        all.enumerate()
            .max_by(|a, b| a.1.total_cmp(&b.1))
            .unwrap_or((0, 0.0))
    }

    /// The same with a disturbance smaller by so many prior standard deviations.
    pub fn less_disturbed(&self, axis: usize, sds: f64) -> Self {
        let mut less = self.clone();
        less.0[DISTURBANCES + axis] *= (-sds * LOG_SD).exp();
        less
    }

    /// Log prior density, up to a constant.
    pub fn log_prior(&self) -> f64 {
        self.departures().iter().map(|d| -0.5 * d * d).sum()
    }

    /// Stationary standard deviation of a state that remembers, places as in the filter.
    pub fn stationary(&self, state: usize) -> f64 {
        match state {
            SMOOTHED_LATERAL => self.0[CHANNELS],
            SMOOTHED_VERTICAL => self.0[CHANNELS + 1],
            _ => Self::size_of(state).map_or(0.0, |k| self.0[k]),
        }
    }

    /// Variance that an interval adds to a state.
    pub fn process(&self, state: usize, dt_s: f64) -> f64 {
        if !(GUST..SMOOTHED_LATERAL).contains(&state) {
            // What the step's own error may be: keeps the covariance positive.
            return 1e-9 * dt_s;
        }
        let gone = 1.0 - (-2.0 * dt_s / correlation_s(state)).exp();
        self.stationary(state).powi(2) * gone
    }
}

/// Fits the noise to `flights`, from `noise`, in so many steps. Each moves the logarithms of all sizes
/// by what is seen of their squares over what is expected: the square root of that ratio leads
/// uphill for sure (Zhou et al. 2019), and a power of it mostly further.
pub fn fit(flights: &[(&Segment, World)], noise: Noise, steps: usize) -> Noise {
    let mut power = FIRST_POWER;
    let mut at = (looked(flights, &noise), noise);
    for _ in 0..steps {
        let ((_, ratio), noise) = &at;
        let step = |k: usize| (0.25 * power * ratio[k].ln()).clamp(-FARTHEST, FARTHEST);
        let next = Noise(std::array::from_fn(|k| noise.0[k] * step(k).exp()));
        let there = looked(flights, &next);
        let gained = there.0 - at.0.0;
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

/// What flights say of the noise that they are followed with: the log score, and of each size's square what is seen
/// over what is expected.
fn looked(flights: &[(&Segment, World)], noise: &Noise) -> (f64, [f64; SIZES]) {
    let mut score = noise.log_prior();
    let mut sums = [[0.0; 2]; SIZES];
    for (segment, world) in flights {
        let pass = run(segment, world, noise, Keep::Steps, None);
        score += pass.log_score;
        add_slopes(&mut sums, &pass.steps, noise);
    }
    for (sums, departure) in sums.iter_mut().zip(noise.departures()) {
        sums[usize::from(departure > 0.0)] += departure.abs() / LOG_SD;
    }
    // One that is not told of is as expected.
    (
        score,
        sums.map(|[seen, expected]| (seen + 1e-9) / (expected + 1e-9)),
    )
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
    for state in GUST..SMOOTHED_LATERAL {
        if let Some(size) = Noise::size_of(state) {
            slope[size][0] += r[state] * r[state] * variance(state);
            slope[size][1] += n[state][state] * variance(state);
        }
    }
}
