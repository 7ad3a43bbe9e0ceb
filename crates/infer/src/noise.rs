//! The noise of readings, as a linear Gaussian process in time whose likelihood a Kalman filter
//! gives in one pass.
//!
//! Five independent parts make the misfit of a row: white noise of the sensor; a slow wander of
//! its zero; the fluctuation of concentrations in the plume, proportional to the plume's part
//! of the reading; and the wander of the plume's axis to the sides and up and down, proportional to the
//! derivatives of the reading by the axis' direction and height. The last four are Ornstein-Uhlenbeck processes:
//! stationary, Gaussian, forgetting exponentially. The last three are of the air. A sensor with a lag of first order
//! shows them smoothed. The filter's innovations are independent, so the same recursion whitens any column of a
//! least-squares problem (Durbin and Koopman 2012, section 4).

use crate::rows::Rows;
use multiversion::multiversion;
use std::ops::Range;

/// Processes of the air: fluctuation, wander of the axis to the sides, and up and down.
const OF_AIR: usize = 3;
/// The slow wander of the zero, and of each process of the air what is there and what the sensor shows of it.
const STATES: usize = 1 + 2 * OF_AIR;
/// What the sensor shows of the fluctuation, among the states.
const FLUCTUATION_SHOWN: usize = 2;

/// Half the logarithm of 2π.
const HALF_LN_TAU: f64 = 0.918_938_533_204_672_8;

/// Sizes (standard deviations) and memories of the parts of the noise.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Noise {
    /// White noise of a row, in the unit of the readings.
    pub white: f64,
    /// Slow wander of the sensor's zero, in the unit of the readings.
    pub slow: f64,
    /// Memory of the slow wander, s.
    pub slow_s: f64,
    /// Fluctuation of concentrations, as a part of the plume's share of the reading.
    pub fluctuation: f64,
    /// Memory of the fluctuation, s.
    pub fluctuation_s: f64,
    /// Fast wander of the plume's axis, degrees.
    pub wander_deg: f64,
    /// Memory of the axis' wander, s.
    pub wander_s: f64,
    /// Wander of the axis up and down, as a part of the plume's σz; it has the memory of the wander to the sides, as the
    /// same eddies make both.
    pub wander_sigma_z: f64,
}

impl Noise {
    /// Number of sizes and memories.
    pub const PARAMETERS: usize = 8;

    /// Natural logarithms of sizes and memories, in the order of the fields.
    pub fn ln(&self) -> [f64; Self::PARAMETERS] {
        [
            self.white,
            self.slow,
            self.slow_s,
            self.fluctuation,
            self.fluctuation_s,
            self.wander_deg,
            self.wander_s,
            self.wander_sigma_z,
        ]
        .map(f64::ln)
    }

    /// The noise of these logarithms.
    pub fn from_ln(ln: [f64; Self::PARAMETERS]) -> Self {
        let [
            white,
            slow,
            slow_s,
            fluctuation,
            fluctuation_s,
            wander_deg,
            wander_s,
            wander_sigma_z,
        ] = ln.map(f64::exp);
        Self {
            white,
            slow,
            slow_s,
            fluctuation,
            fluctuation_s,
            wander_deg,
            wander_s,
            wander_sigma_z,
        }
    }

    /// Standard deviation of the fluctuation that a sensor of a response time shows in a mean over a time.
    pub(crate) fn fluctuation_sd(&self, response_s: f64, averaging_s: f64) -> f64 {
        let shown = shown_part(self.fluctuation_s, response_s).sqrt();
        self.fluctuation * shown * left_of_means(self.fluctuation_s, averaging_s)
    }

    fn of_air(&self) -> [(f64, f64); OF_AIR] {
        [
            (self.fluctuation, self.fluctuation_s),
            (self.wander_deg, self.wander_s),
            (self.wander_sigma_z, self.wander_s),
        ]
    }
}

/// What the processes make of each row.
#[derive(Debug, Clone, Default)]
pub struct Loadings {
    /// The plume's part of each row.
    pub plume: Vec<f64>,
    /// Change of each row's reading by one degree of wander.
    pub per_degree: Vec<f64>,
    /// Change of each row's reading where the axis is higher by one σz.
    pub per_sigma_z: Vec<f64>,
    /// Change of each row's reading where the axis turns up by one degree.
    pub per_degree_up: Vec<f64>,
    /// Response time of each row's sensor, s; empty where all show the air at once.
    pub response_s: Vec<f64>,
}

impl Loadings {
    fn of_air(&self, row: usize) -> [f64; OF_AIR] {
        [self.plume[row], self.per_degree[row], self.per_sigma_z[row]]
    }

    /// Response time of a row's sensor, s.
    pub(crate) fn response_s(&self, row: usize) -> f64 {
        self.response_s.get(row).copied().unwrap_or(0.0)
    }
}

/// What becomes of the states from one row to the next.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Transition {
    slow: f64,
    /// Of each process of the air: what lasts of it, what lasts of what is shown, and what is shown of it anew.
    of_air: [(f64, f64, f64); OF_AIR],
}

impl Transition {
    const NONE: Self = Self {
        slow: 1.0,
        of_air: [(1.0, 1.0, 0.0); OF_AIR],
    };

    fn over(dt_s: f64, noise: &Noise, averaging_s: f64, response_s: f64) -> Self {
        let of = |(_, memory_s): (f64, f64)| {
            let memory_s = memory_of_means_s(memory_s, averaging_s);
            let lasts = (-dt_s / memory_s).exp();
            let shown = if response_s > 0.0 {
                (-dt_s / response_s).exp()
            } else {
                0.0
            };
            let apart = 1.0 - response_s / memory_s;
            // Of times alike: what the formula leaves of rounding.
            let anew = if apart.abs() < LEAST_PART {
                dt_s / memory_s * lasts
            } else {
                (lasts - shown) / apart
            };
            (lasts, shown, anew)
        };
        Self {
            slow: (-dt_s / memory_of_means_s(noise.slow_s, averaging_s)).exp(),
            of_air: noise.of_air().map(of),
        }
    }

    #[inline]
    fn apply(&self, state: &mut [f64; STATES]) {
        state[0] *= self.slow;
        for (k, (lasts, shown, anew)) in self.of_air.iter().enumerate() {
            let (air, seen) = (1 + 2 * k, 2 + 2 * k);
            state[seen] = shown * state[seen] + anew * state[air];
            state[air] *= lasts;
        }
    }

    /// Its transpose, for what later rows say of earlier ones.
    #[inline]
    fn apply_back(&self, state: &mut [f64; STATES]) {
        state[0] *= self.slow;
        for (k, (lasts, shown, anew)) in self.of_air.iter().enumerate() {
            let (air, seen) = (1 + 2 * k, 2 + 2 * k);
            state[air] = lasts * state[air] + anew * state[seen];
            state[seen] *= shown;
        }
    }
}

/// Part of a process' variance that a sensor of a response time shows.
fn shown_part(memory_s: f64, response_s: f64) -> f64 {
    memory_s / (memory_s + response_s)
}

/// What the filter does to any column at a row.
#[derive(Debug, Clone, Copy)]
struct Step {
    transition: Transition,
    loading: Loading,
    gain: [f64; STATES],
    inverse_sd: f64,
}

/// What a reading has of the slow wander and of what is shown of each process of the air.
#[derive(Debug, Clone, Copy)]
struct Loading([f64; 1 + OF_AIR]);

impl Loading {
    #[inline]
    fn times(&self, state: &[f64; STATES]) -> f64 {
        let mut sum = 0.0;
        for (k, loading) in self.0.iter().enumerate() {
            sum += loading * state[2 * k];
        }
        sum
    }

    #[inline]
    fn add_to(&self, state: &mut [f64; STATES], times: f64) {
        for (k, loading) in self.0.iter().enumerate() {
            state[2 * k] += loading * times;
        }
    }
}

/// A Kalman filter's gains for given noise and loadings.
#[derive(Debug, Clone)]
pub(crate) struct Whitener {
    steps: Vec<Step>,
    /// The noise it is for.
    pub noise: Noise,
}

impl Whitener {
    /// The filter for `noise`. `inflation` multiplies the variance of a row's own white noise.
    pub fn new(rows: &Rows, noise: &Noise, loadings: &Loadings, inflation: &[f64]) -> Self {
        let mut steps = Vec::with_capacity(rows.len());
        run(rows, noise, loadings, inflation, |_, step, _| {
            steps.push(step)
        });
        Self {
            steps,
            noise: *noise,
        }
    }

    /// Whitens `matrix` in place: one row of `columns` numbers for each reading. Rows that are not
    /// used become zero.
    pub fn whiten(&self, rows: &Rows, matrix: &mut [f64], columns: usize) {
        for range in rows.series() {
            let part = &mut matrix[range.start * columns..range.end * columns];
            self.whiten_next(range, &mut Means::new(columns), part);
        }
    }

    /// Whitens further rows of a series, up to which the filter's `means` have come.
    pub fn whiten_next(&self, rows: Range<usize>, means: &mut Means, part: &mut [f64]) {
        whiten_part(part, &self.steps[rows], means);
    }

    /// Sum over rows of ln(inverse sd) - ln(2π)/2: the density's normalisation.
    pub fn ln_normalisation_of(&self, rows: &Range<usize>) -> f64 {
        let mut density = LnProduct::ONE;
        let steps = self.steps[rows.clone()].iter();
        let told = steps.filter(|s| s.inverse_sd > 0.0);
        told.for_each(|s| density.times(s.inverse_sd));
        density.normalisation()
    }

    /// Standard deviation of a row's innovation, infinite where the row is not used.
    pub fn innovation_sd(&self, row: usize) -> f64 {
        1.0 / self.steps[row].inverse_sd
    }
}

/// The filter's means of all processes at a row, for each of several columns.
pub(crate) struct Means([Vec<f64>; STATES]);

impl Means {
    /// Those before the first row of a series.
    pub fn new(columns: usize) -> Self {
        Self(std::array::from_fn(|_| vec![0.0; columns]))
    }
}

/// The logarithm of a product, taken once for several factors.
struct LnProduct {
    ln: f64,
    factors: f64,
    count: u32,
}

impl LnProduct {
    /// So many factors neither overflow nor vanish.
    const AT_ONCE: u32 = 8;
    const ONE: Self = Self {
        ln: 0.0,
        factors: 1.0,
        count: 0,
    };

    fn times(&mut self, factor: f64) {
        self.factors *= factor;
        self.count += 1;
        if self.count.is_multiple_of(Self::AT_ONCE) {
            self.ln += self.factors.ln();
            self.factors = 1.0;
        }
    }

    /// The density's normalisation where the factors are inverse standard deviations.
    fn normalisation(&self) -> f64 {
        self.ln + self.factors.ln() - HALF_LN_TAU * f64::from(self.count)
    }
}

/// Log likelihood of `misfit` under `noise`, nats.
pub(crate) fn log_likelihood(
    rows: &Rows,
    noise: &Noise,
    loadings: &Loadings,
    inflation: &[f64],
    misfit: &[f64],
) -> f64 {
    let mut mean = [0.0; STATES];
    let (mut square, mut density) = (0.0, LnProduct::ONE);
    run(rows, noise, loadings, inflation, |row, step, _| {
        if row.is_first {
            mean = [0.0; STATES];
        }
        step.transition.apply(&mut mean);
        let expected = step.loading.times(&mean);
        if step.inverse_sd > 0.0 {
            let innovation = misfit[row.index] - expected;
            for (mean, gain) in mean.iter_mut().zip(step.gain) {
                *mean += gain * innovation;
            }
            let z = innovation * step.inverse_sd;
            square += z * z;
            density.times(step.inverse_sd);
        }
    });
    density.normalisation() - 0.5 * square
}

/// A row on the filter's way.
#[derive(Clone, Copy)]
struct At {
    index: usize,
    is_first: bool,
}

/// The fluctuation at every row, in the mean over its averaging time, that is most probable after all rows of
/// `misfit` (the state smoother of Durbin and Koopman 2012, equations 4.39 and 4.44).
pub(crate) fn smoothed_fluctuation(
    rows: &Rows,
    noise: &Noise,
    loadings: &Loadings,
    inflation: &[f64],
    misfit: &[f64],
) -> Vec<f64> {
    let n = rows.len();
    let mut mean = [0.0; STATES];
    // Of each row: the step, the filter's mean of the shown fluctuation before it, its covariances with all states, and the
    // innovation over its variance.
    let mut filtered: Vec<(Step, f64, [f64; STATES], f64)> = Vec::with_capacity(n);
    run(rows, noise, loadings, inflation, |row, step, p| {
        if row.is_first {
            mean = [0.0; STATES];
        }
        step.transition.apply(&mut mean);
        let expected = step.loading.times(&mean);
        let of_fluctuation = mean[FLUCTUATION_SHOWN];
        let mut scaled = 0.0;
        if step.inverse_sd > 0.0 {
            let innovation = misfit[row.index] - expected;
            for (mean, gain) in mean.iter_mut().zip(step.gain) {
                *mean += gain * innovation;
            }
            scaled = innovation * step.inverse_sd * step.inverse_sd;
        }
        filtered.push((step, of_fluctuation, p[FLUCTUATION_SHOWN], scaled));
    });
    let mut out = vec![0.0; n];
    for range in rows.series() {
        let mut later = [0.0; STATES];
        for index in range.clone().rev() {
            let (step, mean, covariance, scaled) = &filtered[index];
            let told: f64 = step.gain.iter().zip(&later).map(|(g, r)| g * r).sum();
            step.loading.add_to(&mut later, scaled - told);
            let by: f64 = covariance.iter().zip(&later).map(|(c, r)| c * r).sum();
            let left = left_of_means(noise.fluctuation_s, rows.averaging_s(index));
            out[index] = left * (mean + by);
            step.transition.apply_back(&mut later);
        }
    }
    out
}

/// Runs the filter's covariance over all rows and hands each step to `each`, with the covariance before it.
fn run(
    rows: &Rows,
    noise: &Noise,
    loadings: &Loadings,
    inflation: &[f64],
    mut each: impl FnMut(At, Step, &[[f64; STATES]; STATES]),
) {
    for range in rows.series() {
        let mut covariance = Covariance([[0.0; STATES]; STATES]);
        // What lasts from row to row, what is left of each process in a mean, and the covariance of rows that know nothing
        // of each other; computed where they change.
        let mut transition = Transition::NONE;
        let (mut left, mut stationary) = ([1.0; 1 + OF_AIR], Covariance([[0.0; STATES]; STATES]));
        let (mut last_dt, mut last) = (f64::NAN, (f64::NAN, f64::NAN));
        for index in range.clone() {
            let is_first = index == range.start;
            let (averaging_s, response_s) = (rows.averaging_s(index), loadings.response_s(index));
            let is_other = (averaging_s, response_s) != last;
            if is_other {
                left[0] = left_of_means(noise.slow_s, averaging_s);
                for (left, (_, memory_s)) in left[1..].iter_mut().zip(noise.of_air()) {
                    *left = left_of_means(memory_s, averaging_s);
                }
                stationary = Covariance::stationary(noise, averaging_s, response_s);
                last = (averaging_s, response_s);
            }
            if is_first {
                covariance.0 = stationary.0;
            } else {
                let dt = rows.time_s()[index] - rows.time_s()[index - 1];
                if dt != last_dt || is_other {
                    transition = Transition::over(dt, noise, averaging_s, response_s);
                    last_dt = dt;
                }
                covariance.forget(&transition, &stationary);
            }
            let [plume, per_degree, per_sigma_z] = loadings.of_air(index);
            let own = [1.0, plume, per_degree, per_sigma_z];
            let mut step = Step {
                transition,
                loading: Loading(std::array::from_fn(|k| own[k] * left[k])),
                gain: [0.0; STATES],
                inverse_sd: 0.0,
            };
            let before = covariance.0;
            if rows.is_used(index) {
                let white = rows.stated_sd(index).unwrap_or(noise.white);
                (step.gain, step.inverse_sd) =
                    covariance.learn(&step.loading, white * white * inflation[index]);
            }
            each(At { index, is_first }, step, &before);
        }
    }
}

/// The standard deviation of the mean of an Ornstein-Uhlenbeck process of this memory over a time, of its own.
fn left_of_means(memory_s: f64, averaging_s: f64) -> f64 {
    if averaging_s <= 0.0 {
        return 1.0;
    }
    let x = averaging_s / memory_s;
    // Of short times 1 - x/3: what the formula leaves of rounding.
    if x < LEAST_PART {
        return 1.0 - x / 6.0;
    }
    (2.0 / x * (1.0 - (1.0 - (-x).exp()) / x)).sqrt()
}

/// Below this part of a memory a mean is as good as its middle.
const LEAST_PART: f64 = 1e-4;

/// The memory of such means, s: the process's own, and half of the time over which each remembers the same moments as
/// the next.
fn memory_of_means_s(memory_s: f64, averaging_s: f64) -> f64 {
    memory_s + 0.5 * averaging_s
}

/// Covariance of the states, symmetric.
#[derive(Clone, Copy)]
struct Covariance([[f64; STATES]; STATES]);

impl Covariance {
    fn stationary(noise: &Noise, averaging_s: f64, response_s: f64) -> Self {
        let mut p = [[0.0; STATES]; STATES];
        p[0][0] = noise.slow * noise.slow;
        for (k, (size, memory_s)) in noise.of_air().into_iter().enumerate() {
            let (air, seen) = (1 + 2 * k, 2 + 2 * k);
            let part = shown_part(memory_of_means_s(memory_s, averaging_s), response_s);
            p[air][air] = size * size;
            p[seen][seen] = part * size * size;
            (p[air][seen], p[seen][air]) = (p[seen][seen], p[seen][seen]);
        }
        Self(p)
    }

    /// The covariance one row later: what differs from that of a row of its own decays.
    fn forget(&mut self, transition: &Transition, stationary: &Self) {
        let mut known = self.0;
        for (known, stationary) in known.iter_mut().zip(&stationary.0) {
            for (known, stationary) in known.iter_mut().zip(stationary) {
                *known -= stationary;
            }
        }
        known.iter_mut().for_each(|row| transition.apply(row));
        let mut columns = transposed(&known);
        columns
            .iter_mut()
            .for_each(|column| transition.apply(column));
        for (i, row) in self.0.iter_mut().enumerate() {
            for (j, p) in row.iter_mut().enumerate() {
                *p = columns[i][j] + stationary.0[i][j];
            }
        }
    }

    /// Takes in a row with white variance `own`: gain and inverse standard deviation of its innovation.
    fn learn(&mut self, loading: &Loading, own: f64) -> ([f64; STATES], f64) {
        let ph: [f64; STATES] = std::array::from_fn(|i| loading.times(&self.0[i]));
        let variance = loading.times(&ph) + own;
        let gain = ph.map(|v| v / variance);
        for (row, gain) in self.0.iter_mut().zip(gain) {
            for (p, ph) in row.iter_mut().zip(ph) {
                *p -= gain * ph;
            }
        }
        (gain, 1.0 / variance.sqrt())
    }
}

#[inline]
fn transposed(of: &[[f64; STATES]; STATES]) -> [[f64; STATES]; STATES] {
    std::array::from_fn(|i| std::array::from_fn(|j| of[j][i]))
}

/// The filter's means for all columns at once.
#[multiversion(targets("x86_64+avx512f+avx512dq+avx512vl", "x86_64+avx2"))]
fn whiten_part(matrix: &mut [f64], steps: &[Step], means: &mut Means) {
    let n = means.0[0].len();
    let [slow, air1, seen1, air2, seen2, air3, seen3] = means.0.each_mut().map(|m| &mut m[..n]);
    for (row, s) in matrix.chunks_exact_mut(n).zip(steps) {
        let [t1, t2, t3] = s.transition.of_air;
        let h = s.loading.0;
        for k in 0..n {
            slow[k] *= s.transition.slow;
            seen1[k] = t1.1 * seen1[k] + t1.2 * air1[k];
            seen2[k] = t2.1 * seen2[k] + t2.2 * air2[k];
            seen3[k] = t3.1 * seen3[k] + t3.2 * air3[k];
            air1[k] *= t1.0;
            air2[k] *= t2.0;
            air3[k] *= t3.0;
            let expected = h[0] * slow[k] + h[1] * seen1[k] + h[2] * seen2[k] + h[3] * seen3[k];
            let innovation = row[k] - expected;
            slow[k] += s.gain[0] * innovation;
            air1[k] += s.gain[1] * innovation;
            seen1[k] += s.gain[2] * innovation;
            air2[k] += s.gain[3] * innovation;
            seen2[k] += s.gain[4] * innovation;
            air3[k] += s.gain[5] * innovation;
            seen3[k] += s.gain[6] * innovation;
            row[k] = innovation * s.inverse_sd;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Cholesky, DMatrix, DVector};

    const NOISE: Noise = Noise {
        white: 2.0,
        slow: 3.0,
        slow_s: 40.0,
        fluctuation: 0.2,
        fluctuation_s: 5.0,
        wander_deg: 1.5,
        wander_s: 30.0,
        wander_sigma_z: 0.3,
    };

    /// Two sensors with uneven times, of which one reading does not count and one states its noise.
    fn rows_and_loadings() -> (Rows, Loadings, Vec<f64>) {
        let time_s = [0.0, 1.0, 2.5, 3.0, 9.0, 0.5, 1.5, 30.0];
        let misfit = [1.0, -4.0, 9.0, 2.0, 0.0, -3.0, 5.0, 1.5];
        let mut stated_sd = vec![f64::NAN; 8];
        stated_sd[6] = 0.7;
        let mut used = vec![true; 8];
        used[2] = false;
        let rows = Rows::new(
            vec![0..5, 5..8],
            time_s.to_vec(),
            misfit.to_vec(),
            stated_sd,
            used,
        );
        let loadings = Loadings {
            plume: vec![0.0, 10.0, 40.0, 30.0, 0.5, 0.0, 20.0, 3.0],
            per_degree: vec![0.0, 4.0, 1.0, -6.0, -0.2, 0.0, -8.0, 1.0],
            per_sigma_z: vec![0.0, 6.0, -20.0, 9.0, 0.1, 0.0, -5.0, 2.0],
            per_degree_up: Vec::new(),
            response_s: vec![4.0, 4.0, 4.0, 4.0, 4.0, 0.0, 0.0, 0.0],
        };
        (rows.unwrap(), loadings, misfit.to_vec())
    }

    /// Covariance of what a sensor of a response time shows of a process of the air at two times: two exponentials.
    fn shown(
        loadings: &Loadings,
        (i, j): (usize, usize),
        size: f64,
        memory_s: f64,
        dt_s: f64,
    ) -> f64 {
        let response_s = loadings.response_s(i);
        assert_eq!(response_s, loadings.response_s(j));
        let apart = memory_s * memory_s - response_s * response_s;
        let mut sum = memory_s * (-dt_s / memory_s).exp();
        if response_s > 0.0 {
            sum -= response_s * (-dt_s / response_s).exp();
        }
        size * size * memory_s / apart * sum
    }

    /// The same process as a covariance matrix, written out from its definition, and a normal density
    /// by Cholesky's decomposition.
    fn dense_log_likelihood(rows: &Rows, loadings: &Loadings, inflation: &[f64]) -> f64 {
        let mut total = 0.0;
        for range in rows.series() {
            let used: Vec<usize> = range.filter(|&i| rows.is_used(i)).collect();
            let n = used.len();
            let covariance = DMatrix::from_fn(n, n, |a, b| {
                let (i, j) = (used[a], used[b]);
                let dt = (rows.time_s()[i] - rows.time_s()[j]).abs();
                let part = |size: f64, memory_s: f64| size * size * (-dt / memory_s).exp();
                let own = if a == b {
                    rows.stated_sd(i).unwrap_or(NOISE.white).powi(2) * inflation[i]
                } else {
                    0.0
                };
                let of_air = |size: f64, memory_s: f64| shown(loadings, (i, j), size, memory_s, dt);
                own + part(NOISE.slow, NOISE.slow_s)
                    + of_air(NOISE.fluctuation, NOISE.fluctuation_s)
                        * loadings.plume[i]
                        * loadings.plume[j]
                    + of_air(NOISE.wander_deg, NOISE.wander_s)
                        * loadings.per_degree[i]
                        * loadings.per_degree[j]
                    + of_air(NOISE.wander_sigma_z, NOISE.wander_s)
                        * loadings.per_sigma_z[i]
                        * loadings.per_sigma_z[j]
            });
            let misfit = DVector::from_fn(n, |a, _| rows.measured()[used[a]]);
            let cholesky = Cholesky::new(covariance).unwrap();
            let square = misfit.dot(&cholesky.solve(&misfit));
            let ln_determinant = 2.0 * cholesky.l().diagonal().iter().map(|d| d.ln()).sum::<f64>();
            total -= 0.5 * (square + ln_determinant + n as f64 * std::f64::consts::TAU.ln());
        }
        total
    }

    #[test]
    fn the_filter_gives_the_normal_density_of_the_whole_series() {
        let (rows, loadings, misfit) = rows_and_loadings();
        let mut inflation = vec![1.0; rows.len()];
        inflation[3] = 4.0;
        let dense = dense_log_likelihood(&rows, &loadings, &inflation);
        let filtered = log_likelihood(&rows, &NOISE, &loadings, &inflation, &misfit);
        assert!((dense - filtered).abs() < 1e-9, "{dense} {filtered}");
        // Whitened, it is a sum of squares.
        let whitener = Whitener::new(&rows, &NOISE, &loadings, &inflation);
        let mut matrix: Vec<f64> = misfit.iter().flat_map(|m| [*m, 2.0 * m]).collect();
        whitener.whiten(&rows, &mut matrix, 2);
        let square: f64 = matrix.chunks_exact(2).map(|w| w[0] * w[0]).sum();
        assert!((whitener.ln_normalisation_of(&(0..8)) - 0.5 * square - dense).abs() < 1e-9);
        assert!(
            matrix
                .chunks_exact(2)
                .all(|w| (w[1] - 2.0 * w[0]).abs() < 1e-12)
        );
        assert_eq!(matrix[2 * 2], 0.0, "a row that is not used says nothing");
    }

    /// The conditional mean of a normal density, written out: the covariances of the fluctuation with the misfits, times
    /// the inverse of the misfits' own.
    #[test]
    fn the_smoother_gives_the_conditional_mean() {
        let (rows, loadings, misfit) = rows_and_loadings();
        let inflation = vec![1.0; rows.len()];
        let smoothed = smoothed_fluctuation(&rows, &NOISE, &loadings, &inflation, &misfit);
        for range in rows.series() {
            let used: Vec<usize> = range.clone().filter(|&i| rows.is_used(i)).collect();
            let part = |size: f64, memory_s: f64, i: usize, j: usize| {
                let dt_s = (rows.time_s()[i] - rows.time_s()[j]).abs();
                size * size * (-dt_s / memory_s).exp()
            };
            let of_air = |size: f64, memory_s: f64, i: usize, j: usize| {
                let dt_s = (rows.time_s()[i] - rows.time_s()[j]).abs();
                shown(&loadings, (i, j), size, memory_s, dt_s)
            };
            let fluctuation = |i, j| of_air(NOISE.fluctuation, NOISE.fluctuation_s, i, j);
            let covariance = DMatrix::from_fn(used.len(), used.len(), |a, b| {
                let (i, j) = (used[a], used[b]);
                let white = rows.stated_sd(i).unwrap_or(NOISE.white);
                part(NOISE.slow, NOISE.slow_s, i, j)
                    + fluctuation(i, j) * loadings.plume[i] * loadings.plume[j]
                    + of_air(NOISE.wander_deg, NOISE.wander_s, i, j)
                        * loadings.per_degree[i]
                        * loadings.per_degree[j]
                    + of_air(NOISE.wander_sigma_z, NOISE.wander_s, i, j)
                        * loadings.per_sigma_z[i]
                        * loadings.per_sigma_z[j]
                    + if a == b { white * white } else { 0.0 }
            });
            let read = DVector::from_fn(used.len(), |a, _| misfit[used[a]]);
            let weights = Cholesky::new(covariance).unwrap().solve(&read);
            for i in range {
                let with = used.iter().map(|j| fluctuation(i, *j) * loadings.plume[*j]);
                let mean: f64 = with.zip(weights.iter()).map(|(c, w)| c * w).sum();
                assert!((smoothed[i] - mean).abs() < 1e-9, "{} {mean}", smoothed[i]);
            }
        }
    }

    // The mean of exp(-|a - b| / 5) over a and b from 0 to 10, and from 0 to 300: numpy, 4,000 midpoints each way,
    // .567678 and .032779.
    #[test]
    fn means_fluctuate_less() {
        for (averaging_s, variance) in [(10.0, 0.567_678), (300.0, 0.032_779)] {
            let left = left_of_means(5.0, averaging_s);
            assert!((left * left - variance).abs() < 2e-5, "{left}");
        }
        assert_eq!(left_of_means(5.0, 0.0), 1.0);
        let (short, shorter) = (left_of_means(5.0, 5.1e-4), left_of_means(5.0, 4.9e-4));
        assert!(short < shorter && shorter - short < 1e-5);
        // The processes have that much less of it, the white noise has not.
        let (rows, mut loadings, _) = rows_and_loadings();
        loadings.response_s.clear();
        let first = |averaging_s: f64| {
            let rows = rows.clone().averaged_over(vec![averaging_s; 8]).unwrap();
            let whitener = Whitener::new(&rows, &NOISE, &loadings, &[1.0; 8]);
            whitener.innovation_sd(0).powi(2) - NOISE.white.powi(2)
        };
        let [plume, per_degree, per_sigma_z] = loadings.of_air(0);
        let parts = [
            (NOISE.slow, NOISE.slow_s),
            (NOISE.fluctuation * plume, NOISE.fluctuation_s),
            (NOISE.wander_deg * per_degree, NOISE.wander_s),
            (NOISE.wander_sigma_z * per_sigma_z, NOISE.wander_s),
        ];
        for averaging_s in [0.0, 60.0] {
            let part = |(size, memory_s): &(f64, f64)| {
                (size * left_of_means(*memory_s, averaging_s)).powi(2)
            };
            let expected: f64 = parts.iter().map(part).sum();
            assert!((first(averaging_s) - expected).abs() < 1e-12 + 1e-9 * expected);
        }
    }

    #[test]
    fn logarithms_and_back() {
        let back = Noise::from_ln(NOISE.ln());
        for (a, b) in back.ln().iter().zip(NOISE.ln()) {
            assert!((a - b).abs() < 1e-12);
        }
    }
}
