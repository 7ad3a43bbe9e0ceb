//! The noise of readings along a track.
//!
//! What a reading differs by from a right mean model is white noise of the sensor, plus three
//! Ornstein–Uhlenbeck processes: an additive one (slow wander of sensor and background), one
//! in proportion to the plume's part of the reading (intermittency), and one along the
//! derivative of the reading by wind direction (the plume is not exactly where the wind says).
//! The latter two also have parts that are white in time. They are what the air does, and a slow
//! sensor still shows some of what it was: what it shows is a state of its own, which forgets with
//! the sensor's time constant and takes in what the row's share of the loading is times the process.
//! Platforms are independent. All is linear and Gaussian
//! in state space, so that a Kalman filter gives the likelihood in linear time; an innovation
//! beyond three standard deviations is taken as an outlier and its variance raised until it is
//! at three, so that one spike counts a few nats and no more.

use std::ops::Range;

use multiversion::multiversion;

use super::linear::is_busy;

/// Number of noise parameters.
pub(crate) const NOISE_PARAMETERS: usize = 9;
/// Number of states.
const STATES: usize = 4;
/// Those that are processes; the last is what the sensor shows of the latter two.
const PROCESSES: usize = 3;
/// Standardised innovation beyond which a reading is an outlier.
const OUTLIER: f64 = 3.0;
/// The same beyond which it is said: of a million normal ones less than one is.
const SPIKE: f64 = 5.0;
/// Largest swing of a platform's plume that counts as noise where the wind is logged, degrees,
/// and the logarithmic width of that cap.
const MOST_SWING_DEG: f64 = 1.0;
const CAP_SOFTNESS: f64 = 0.1;
/// Logarithm of sqrt(2 pi).
const LN_ROOT_TAU: f64 = 0.918_938_533_204_672_7;

/// Noise sizes and time scales, as logarithms with normal priors.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct NoiseModel {
    pub(crate) ln: [f64; NOISE_PARAMETERS],
    pub(crate) prior: [(f64, f64); NOISE_PARAMETERS],
    /// Swing of the plume that all platforms share: standard deviation, degrees.
    pub(crate) shared_swing_deg: f64,
    /// White noise that readings on a grid have at least, ppm.
    pub(crate) least_white_ppm: f64,
    /// Swing of a platform's plume beyond which it is a finding rather than noise, degrees.
    pub(crate) most_swing_deg: f64,
}

/// Positions of the parameters.
const WHITE: usize = 0;
const SLOW: usize = 1;
const SLOW_S: usize = 2;
const GUST: usize = 3;
const GUST_S: usize = 4;
const SWING: usize = 5;
const SWING_S: usize = 6;
const FAST_GUST: usize = 7;
const FAST_SWING: usize = 8;

impl NoiseModel {
    /// A prior noise: the sensor's white noise as stated (or as seen between neighbouring
    /// readings in clean air), and what turbulence usually does.
    pub fn prior(white_ppm: f64) -> Self {
        let white = white_ppm.max(1e-3);
        let prior = [
            (white.ln(), 0.5),
            ((0.4 * white).ln(), 0.8),
            (40f64.ln(), 0.6),
            (0.12f64.ln(), 0.8),
            (6f64.ln(), 0.7),
            (0.8f64.ln(), 0.9),
            (25f64.ln(), 0.8),
            (0.03f64.ln(), 0.8),
            (0.2f64.ln(), 0.8),
        ];
        Self {
            ln: prior.map(|p| p.0),
            prior,
            shared_swing_deg: 0.25,
            least_white_ppm: 0.0,
            most_swing_deg: f64::INFINITY,
        }
    }

    /// The same where the wind is logged along the tracks: the plume is about where it says.
    pub(crate) fn with_logged_wind(self) -> Self {
        Self {
            most_swing_deg: MOST_SWING_DEG,
            ..self
        }
    }

    /// The same for readings on a grid of this step, ppm.
    pub(crate) fn with_grid(self, step_ppm: f64) -> Self {
        Self {
            least_white_ppm: of_grid(step_ppm),
            ..self
        }
    }

    /// White noise of a reading in clean air, ppm.
    pub fn white_ppm(&self) -> f64 {
        self.ln[WHITE].exp()
    }

    /// What was expected of that before any fit, ppm.
    pub fn expected_white_ppm(&self) -> f64 {
        self.prior[WHITE].0.exp()
    }

    /// Slow additive noise: standard deviation, ppm, and time constant, s.
    pub fn slow(&self) -> (f64, f64) {
        (self.ln[SLOW].exp(), self.ln[SLOW_S].exp())
    }

    /// Intermittency: relative standard deviation and time constant, s.
    pub fn gust(&self) -> (f64, f64) {
        (self.ln[GUST].exp(), self.ln[GUST_S].exp())
    }

    /// Swings of the plume: standard deviation, degrees, and time constant, s.
    pub fn swing(&self) -> (f64, f64) {
        (self.ln[SWING].exp(), self.ln[SWING_S].exp())
    }

    /// Swing of the plume that all platforms share, degrees.
    pub fn shared_swing_deg(&self) -> f64 {
        self.shared_swing_deg
    }

    /// The longest time over which it remembers, s.
    pub fn memory_s(&self) -> f64 {
        self.ln[SLOW_S]
            .max(self.ln[GUST_S])
            .max(self.ln[SWING_S])
            .exp()
    }

    /// Log prior density of its parameters, up to a constant.
    pub(crate) fn ln_prior(&self) -> f64 {
        let z = |(x, (mean, sd)): (&f64, &(f64, f64))| -0.5 * ((x - mean) / sd).powi(2);
        let over = (self.ln[SWING] - self.most_swing_deg.ln()).max(0.0);
        let under = (self.least_white_ppm.ln() - self.ln[WHITE]).max(0.0);
        self.ln.iter().zip(&self.prior).map(z).sum::<f64>()
            - 0.5 * (over / CAP_SOFTNESS).powi(2)
            - 0.5 * (under / CAP_SOFTNESS).powi(2)
    }
}

/// Standard deviation of what rounding to a grid takes, in the grid's unit.
pub(crate) fn of_grid(step: f64) -> f64 {
    step / 12f64.sqrt()
}

/// What the noise of one row depends on besides its parameters.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Loading {
    /// The plume's part of the reading, ppm.
    pub gust: f64,
    /// Derivative of the reading by wind direction, ppm per degree.
    pub swing: f64,
    /// Share of what the sensor showed at the row before that it still shows.
    pub shown: f64,
}

/// The rows that the filter runs over.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Rows<'a> {
    /// Rows of each platform.
    pub ranges: &'a [Range<usize>],
    /// Times, s.
    pub time_s: &'a [f64],
    /// Whether the reading is used.
    pub used: &'a [bool],
    /// Stated white noise, ppm; not a number where not stated.
    pub sd_ppm: &'a [f64],
    /// Loadings of the noise.
    pub loading: &'a [Loading],
}

/// What the filter does to any column at a row.
#[derive(Debug, Clone, Copy)]
struct Step {
    keep: [f64; STATES],
    /// What the sensor takes in of gust and swing.
    taken: [f64; 2],
    gain: [f64; STATES],
    inv_sd: f64,
}

/// The filter's gains for given noise and outliers: whitens any column.
#[derive(Debug, Clone)]
pub(crate) struct Whitener {
    steps: Vec<Step>,
    ranges: Vec<Range<usize>>,
    /// Log likelihood of the residual it was made with.
    pub log_likelihood: f64,
    /// Rows whose innovation is beyond what normal noise shows.
    pub spikes: Vec<usize>,
}

/// Part of a column's largest value that the filter's memory of it counts as nothing.
const FORGOTTEN: f64 = 1e-9;
/// Columns whitened side by side, and rows of them at a time.
const LANES: usize = 8;
const BLOCK_ROWS: usize = 64;

/// Runs the filter over `residual`; gives the log likelihood and, if asked, the gains.
fn filter(
    rows: &Rows<'_>,
    noise: &NoiseModel,
    residual: &[f64],
    mut keep_steps: Option<(&mut Vec<Step>, &mut Vec<usize>)>,
) -> f64 {
    let p = noise.ln.map(f64::exp);
    let size_sq = [p[SLOW] * p[SLOW], p[GUST] * p[GUST], p[SWING] * p[SWING]];
    let scale_s = [p[SLOW_S], p[GUST_S], p[SWING_S]];
    let (fast_gust, fast_swing) = (p[FAST_GUST] * p[FAST_GUST], p[FAST_SWING] * p[FAST_SWING]);
    let white_sq = p[WHITE] * p[WHITE];
    let mut total = 0.0;
    for range in rows.ranges {
        let mut state = State::stationary(size_sq);
        let (mut last_dt, mut keep) = (0.0, [1.0; PROCESSES]);
        let mut before: Option<usize> = None;
        for i in range.clone() {
            let dt = before.map_or(0.0, |b| rows.time_s[i] - rows.time_s[b]);
            if dt != last_dt {
                keep = [0, 1, 2].map(|k| (-dt / scale_s[k]).exp());
                last_dt = dt;
            }
            let l = rows.loading[i];
            let was = before.map_or((0.0, 0.0), |b| {
                let l = rows.loading[b];
                (l.gust, l.swing)
            });
            before = Some(i);
            let taken = [l.gust - l.shown * was.0, l.swing - l.shown * was.1];
            let keep = [keep[0], keep[1], keep[2], l.shown];
            state.forget(&keep, &size_sq);
            let fast = fast_gust * taken[0] * taken[0] + fast_swing * taken[1] * taken[1];
            state.take_in(&taken, fast);
            let mut step = Step {
                keep,
                taken,
                gain: [0.0; STATES],
                inv_sd: 0.0,
            };
            if rows.used[i] {
                let sd = rows.sd_ppm[i];
                let white = if sd.is_nan() { white_sq } else { sd * sd };
                let (score, spike) = state.learn(&mut step, white, residual[i]);
                total += score;
                if let (true, Some((_, spikes))) = (spike, keep_steps.as_mut()) {
                    spikes.push(i);
                }
            }
            if let Some((steps, _)) = keep_steps.as_mut() {
                steps.push(step);
            }
        }
    }
    total
}

/// Mean of the states, and their covariance: the upper triangle of the processes (00 01 02 11 12
/// 22), and what each state has with what the sensor shows.
struct State {
    mean: [f64; STATES],
    cov: [f64; 6],
    with_shown: [f64; STATES],
}

impl State {
    fn stationary(size_sq: [f64; PROCESSES]) -> Self {
        let [a, b, c] = size_sq;
        Self {
            mean: [0.0; STATES],
            cov: [a, 0.0, 0.0, b, 0.0, c],
            with_shown: [0.0; STATES],
        }
    }

    #[inline]
    fn forget(&mut self, keep: &[f64; STATES], size_sq: &[f64; PROCESSES]) {
        let [a, b, c, shown] = *keep;
        for (mean, keep) in self.mean.iter_mut().zip(keep) {
            *mean *= keep;
        }
        let p = &mut self.cov;
        p[0] = a * a * p[0] + (1.0 - a * a) * size_sq[0];
        p[1] *= a * b;
        p[2] *= a * c;
        p[3] = b * b * p[3] + (1.0 - b * b) * size_sq[1];
        p[4] *= b * c;
        p[5] = c * c * p[5] + (1.0 - c * c) * size_sq[2];
        for (with, keep) in self.with_shown.iter_mut().zip(keep) {
            *with *= keep * shown;
        }
    }

    /// Lets the sensor show gust and swing as they are now, in the shares `taken`, and what is
    /// white in time with variance `fast`.
    #[inline]
    fn take_in(&mut self, taken: &[f64; 2], fast: f64) {
        let [g, s] = *taken;
        self.mean[3] += g * self.mean[1] + s * self.mean[2];
        let p = &self.cov;
        let own = [
            g * p[1] + s * p[2],
            g * p[3] + s * p[4],
            g * p[4] + s * p[5],
        ];
        let w = &mut self.with_shown;
        w[3] += 2.0 * (g * w[1] + s * w[2]) + g * own[1] + s * own[2] + fast;
        for k in 0..PROCESSES {
            w[k] += own[k];
        }
    }

    /// Takes in a residual with white variance `own`; gives its log score and whether it is a
    /// spike.
    #[inline]
    fn learn(&mut self, step: &mut Step, own: f64, residual: f64) -> (f64, bool) {
        let (p, w) = (&self.cov, &self.with_shown);
        let ph = [p[0] + w[0], p[1] + w[1], p[2] + w[2], w[0] + w[3]];
        let mut variance = ph[0] + ph[3] + own;
        let innovation = residual - (self.mean[0] + self.mean[3]);
        let least = (innovation / OUTLIER) * (innovation / OUTLIER);
        let spike = innovation * innovation > SPIKE * SPIKE * variance;
        variance = variance.max(least);
        let inverse = 1.0 / variance;
        step.gain = ph.map(|p| p * inverse);
        step.inv_sd = inverse.sqrt();
        for (mean, gain) in self.mean.iter_mut().zip(step.gain) {
            *mean += gain * innovation;
        }
        let g = &step.gain;
        let p = &mut self.cov;
        p[0] -= g[0] * ph[0];
        p[1] -= g[0] * ph[1];
        p[2] -= g[0] * ph[2];
        p[3] -= g[1] * ph[1];
        p[4] -= g[1] * ph[2];
        p[5] -= g[2] * ph[2];
        for (with, gain) in self.with_shown.iter_mut().zip(g) {
            *with -= gain * ph[3];
        }
        let score = -LN_ROOT_TAU + 0.5 * (inverse.ln() - innovation * innovation * inverse);
        (score, spike)
    }
}

/// Log likelihood of `residual` under `noise`, nats.
pub(crate) fn log_likelihood(rows: &Rows<'_>, noise: &NoiseModel, residual: &[f64]) -> f64 {
    filter(rows, noise, residual, None)
}

impl Whitener {
    /// The gains for `noise` and the spikes of `residual`.
    pub fn new(rows: &Rows<'_>, noise: &NoiseModel, residual: &[f64]) -> Self {
        let mut steps = Vec::with_capacity(residual.len());
        let mut spikes = Vec::new();
        let log_likelihood = filter(rows, noise, residual, Some((&mut steps, &mut spikes)));
        Self {
            steps,
            ranges: rows.ranges.to_vec(),
            log_likelihood,
            spikes,
        }
    }

    /// Whitens every column in place: independent with unit variance where it was noise, zero
    /// at rows not used.
    pub fn whiten(&self, columns: &mut [&mut [f64]]) {
        for range in &self.ranges {
            // Most columns are those of one sensor or of a short time: nothing elsewhere.
            let mut active: Vec<&mut [f64]> = columns
                .iter_mut()
                .map(|c| &mut c[range.clone()])
                .filter(|c| is_busy(c))
                .collect();
            for group in active.chunks_mut(LANES) {
                self.whiten_group(group, &self.steps[range.clone()]);
            }
        }
    }

    /// Inverse standard deviation of every row's innovation; zero where not used.
    pub fn scales(&self) -> Vec<f64> {
        self.steps.iter().map(|s| s.inv_sd).collect()
    }

    /// Whitens one column.
    pub fn whiten_one(&self, column: &mut [f64]) {
        self.whiten(&mut [column]);
    }

    /// Applies the transpose of the whitening: what a whitened column's products with whitened
    /// columns are as products with plain ones.
    pub fn whiten_back(&self, column: &mut [f64]) {
        for range in &self.ranges {
            let mut state = [0.0; STATES];
            let rows = column[range.clone()].iter_mut();
            for (value, s) in rows.zip(&self.steps[range.clone()]).rev() {
                let learnt: f64 = (0..STATES).map(|k| s.gain[k] * state[k]).sum();
                *value = s.inv_sd * *value + learnt;
                state[0] -= *value;
                state[3] -= *value;
                state[1] += s.taken[0] * state[3];
                state[2] += s.taken[1] * state[3];
                state = std::array::from_fn(|k| s.keep[k] * state[k]);
            }
        }
    }

    fn whiten_group(&self, group: &mut [&mut [f64]], steps: &[Step]) {
        let mut mean = [[0.0f64; LANES]; STATES];
        let mut block = [[0.0; LANES]; BLOCK_ROWS];
        let nil = |i: &usize| group.iter().all(|c| c[*i] == 0.0);
        let first = (0..steps.len()).find(|i| !nil(i)).unwrap_or(0);
        let last = (first..steps.len()).rfind(|i| !nil(i)).unwrap_or(0);
        let largest = group.iter().flat_map(|c| c.iter());
        let forgotten = FORGOTTEN * largest.fold(0.0f64, |m, v| m.max(v.abs()));
        for from in (first..steps.len()).step_by(BLOCK_ROWS) {
            if from > last && mean.iter().flatten().all(|m| m.abs() < forgotten) {
                break;
            }
            let steps = &steps[from..(from + BLOCK_ROWS).min(steps.len())];
            let rows = &mut block[..steps.len()];
            for (lane, column) in group.iter().enumerate() {
                for (row, value) in rows.iter_mut().zip(&column[from..]) {
                    row[lane] = *value;
                }
            }
            whiten_rows(rows, steps, &mut mean);
            for (lane, column) in group.iter_mut().enumerate() {
                for (row, value) in rows.iter().zip(&mut column[from..]) {
                    *value = row[lane];
                }
            }
        }
    }
}

/// Runs the filter with given gains over rows of columns side by side, from its memory `mean`
/// of them on.
#[multiversion(targets("x86_64+avx512f+avx512dq+avx512vl", "x86_64+avx2"))]
fn whiten_rows(rows: &mut [[f64; LANES]], steps: &[Step], mean: &mut [[f64; LANES]; STATES]) {
    let [mut slow, mut gust, mut swing, mut shown] = *mean;
    for (row, s) in rows.iter_mut().zip(steps) {
        for lane in 0..LANES {
            slow[lane] *= s.keep[0];
            gust[lane] *= s.keep[1];
            swing[lane] *= s.keep[2];
            shown[lane] =
                s.keep[3] * shown[lane] + s.taken[0] * gust[lane] + s.taken[1] * swing[lane];
            let innovation = row[lane] - (slow[lane] + shown[lane]);
            slow[lane] += s.gain[0] * innovation;
            gust[lane] += s.gain[1] * innovation;
            swing[lane] += s.gain[2] * innovation;
            shown[lane] += s.gain[3] * innovation;
            row[lane] = innovation * s.inv_sd;
        }
    }
    *mean = [slow, gust, swing, shown];
}

/// The noise of the largest `value` from where `noise` stands: a quasi-Newton search with
/// differences for derivatives, at most `iterations` steps.
pub(crate) fn fit(
    rows: &Rows<'_>,
    noise: &NoiseModel,
    iterations: usize,
    threads: usize,
    value: &(dyn Fn(&NoiseModel) -> f64 + Sync),
) -> NoiseModel {
    const STEP: f64 = 0.02;
    let value = |ln: &[f64; NOISE_PARAMETERS]| value(&NoiseModel { ln: *ln, ..*noise });
    let gradient = |ln: &[f64; NOISE_PARAMETERS], here: f64| -> [f64; NOISE_PARAMETERS] {
        let which: Vec<usize> = (0..NOISE_PARAMETERS).collect();
        let g = super::parallel::map(&which, threads, |&k| {
            let mut moved = *ln;
            moved[k] += STEP;
            (value(&moved) - here) / STEP
        });
        std::array::from_fn(|k| g[k])
    };
    let mut at = noise.ln;
    let mut here = value(&at);
    let mut slope = gradient(&at, here);
    // Inverse curvature: at first that of the prior and of a few hundred effective readings.
    let mut inverse = [[0.0; NOISE_PARAMETERS]; NOISE_PARAMETERS];
    let used = rows.used.iter().filter(|u| **u).count() as f64;
    for (k, row) in inverse.iter_mut().enumerate() {
        let informed = if k == WHITE { used } else { 0.03 * used };
        row[k] = 1.0 / (noise.prior[k].1.powi(-2) + informed);
    }
    for _ in 0..iterations {
        let mut step: [f64; NOISE_PARAMETERS] = std::array::from_fn(|k| {
            (0..NOISE_PARAMETERS)
                .map(|j| inverse[k][j] * slope[j])
                .sum()
        });
        let longest = step.iter().fold(0.0f64, |m, s| m.max(s.abs()));
        if longest > 1.0 {
            step = step.map(|s| s / longest);
        }
        let expected: f64 = step.iter().zip(&slope).map(|(s, g)| s * g).sum();
        let mut scale = 1.0;
        let mut moved = at;
        let mut there = f64::NEG_INFINITY;
        for _ in 0..4 {
            moved = std::array::from_fn(|k| at[k] + scale * step[k]);
            there = value(&moved);
            if there > here {
                break;
            }
            scale *= 0.3;
        }
        if there.is_nan() || there <= here {
            break;
        }
        let gained = there - here;
        let new_slope = gradient(&moved, there);
        let s: [f64; NOISE_PARAMETERS] = std::array::from_fn(|k| moved[k] - at[k]);
        let y: [f64; NOISE_PARAMETERS] = std::array::from_fn(|k| slope[k] - new_slope[k]);
        update_inverse(&mut inverse, &s, &y);
        (at, here, slope) = (moved, there, new_slope);
        if gained < 0.05 && expected < 0.2 {
            break;
        }
    }
    NoiseModel { ln: at, ..*noise }
}

/// The BFGS update of the inverse curvature.
fn update_inverse(
    h: &mut [[f64; NOISE_PARAMETERS]; NOISE_PARAMETERS],
    s: &[f64; NOISE_PARAMETERS],
    y: &[f64; NOISE_PARAMETERS],
) {
    let sy: f64 = s.iter().zip(y).map(|(a, b)| a * b).sum();
    if sy <= 1e-10 {
        return;
    }
    let hy: [f64; NOISE_PARAMETERS] =
        std::array::from_fn(|k| (0..NOISE_PARAMETERS).map(|j| h[k][j] * y[j]).sum());
    let yhy: f64 = y.iter().zip(&hy).map(|(a, b)| a * b).sum();
    for k in 0..NOISE_PARAMETERS {
        for j in 0..NOISE_PARAMETERS {
            h[k][j] += (1.0 + yhy / sy) * s[k] * s[j] / sy - (hy[k] * s[j] + s[k] * hy[j]) / sy;
        }
    }
}

#[cfg(test)]
#[path = "noise_tests.rs"]
mod tests;
