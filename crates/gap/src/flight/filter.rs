//! The filter-error method (Maine & Iliff 1985; Jategaonkar 2015, ch. 5): an extended Kalman
//! filter follows the flight with the measured commands as input; its innovations have the
//! likelihood of the parameters, and their derivatives with fixed gains the information.
//!
//! With the gains held, the derivative of an innovation is a function of the past alone, so the
//! score of a true parameter has mean zero; angles and speeds enter as predicted, never as
//! measured, so noise in them does not bias a slope.

use super::channel::{CHANNELS, at};
use super::gate::Segment;
use super::motion::{
    DISTURBANCE_S, GUST_S, LEAN, LEAN_S, Mean, SMOOTHED_LATERAL, STATES, World, difference, moved,
    start,
};
use super::noise::Noise;
use super::normal::Normal;
use super::rival::{Target, Terms};

/// Innovation, in standard deviations, beyond which it counts linearly (Huber 1964).
const HUBER: f64 = 3.0;

/// A vector of error states.
pub type Error = [f64; STATES];
/// A matrix of error states, column by column.
type Matrix = [Error; STATES];

/// What a pass without derivatives leaves.
#[derive(Debug, Clone)]
pub struct Pass {
    /// Log likelihood, nats.
    pub log_score: f64,
    /// Sums for the sensors' noise: innovation times what is left of it after the update.
    pub left: [f64; CHANNELS],
    /// Count of each channel's readings.
    pub count: [usize; CHANNELS],
    /// Log score of each sample.
    pub by_sample: Vec<f64>,
    /// Innovations in standard deviations, sample by sample (kept only when asked for).
    pub standardised: Vec<[f64; CHANNELS]>,
    /// States after each sample's update (kept only when asked for).
    pub means: Vec<Mean>,
}

/// Columns whose derivatives a pass takes: worlds a step aside, and nameless terms.
pub struct Columns<'a> {
    /// World of each parameter moved by its step, and the step; `moves` says whether motion
    /// changes.
    pub worlds: Vec<(World, f64, bool)>,
    /// Nameless terms.
    pub terms: &'a Terms,
}

impl Columns<'_> {
    /// Number of columns.
    pub fn count(&self) -> usize {
        self.worlds.len() + self.terms.count()
    }
}

/// The filter at one sample.
struct Filter<'a> {
    segment: &'a Segment,
    world: &'a World,
    noise: &'a Noise,
    mean: Mean,
    p: Matrix,
}

/// One reading as the filter took it.
struct Taken {
    gain: Error,
    /// Innovation in standard deviations.
    nu: f64,
    /// Huber's weight.
    weight: f64,
    variance: f64,
    /// Variance that the gain was divided by.
    used: f64,
    log_score: f64,
}

/// Derivatives of the state by the columns.
struct Sensitivity<'a, 'b> {
    columns: &'a Columns<'b>,
    state: Vec<Error>,
    /// What the nameless terms are at this sample, in the order of the columns.
    terms: Vec<(Target, f64)>,
}

/// Runs the filter over `segment`. `keep` keeps innovations and states.
pub fn run(segment: &Segment, world: &World, noise: &Noise, keep: bool) -> Pass {
    pass(segment, world, noise, keep, None)
}

/// Runs the filter and adds what the innovations say of the columns to `normal`, in blocks of
/// samples.
pub fn run_with_columns(
    segment: &Segment,
    world: &World,
    noise: &Noise,
    columns: &Columns<'_>,
    normal: &mut Normal,
) -> Pass {
    pass(segment, world, noise, false, Some((columns, normal)))
}

fn pass(
    segment: &Segment,
    world: &World,
    noise: &Noise,
    keep: bool,
    columns: Option<(&Columns<'_>, &mut Normal)>,
) -> Pass {
    let (mean, sd) = start(segment, world, 0);
    let p = uncertain(&sd, noise);
    let mut filter = Filter {
        segment,
        world,
        noise,
        mean,
        p,
    };
    let mut out = Pass {
        log_score: 0.0,
        left: [0.0; CHANNELS],
        count: [0; CHANNELS],
        by_sample: Vec::with_capacity(segment.len()),
        standardised: Vec::new(),
        means: Vec::new(),
    };
    let (mut sensitivity, mut normal) = match columns {
        Some((columns, normal)) => (
            Some(Sensitivity {
                columns,
                state: vec![[0.0; STATES]; columns.count()],
                terms: vec![(Target::Spin(0), 0.0); columns.terms.count()],
            }),
            Some(normal),
        ),
        None => (None, None),
    };
    for i in 0..segment.len() {
        let before = out.log_score;
        filter.update(
            i,
            keep,
            &mut out,
            sensitivity.as_mut(),
            normal.as_deref_mut(),
        );
        out.by_sample.push(out.log_score - before);
        if i + 1 < segment.len() {
            filter.predict(i, sensitivity.as_mut());
        }
        if let Some(normal) = normal.as_deref_mut() {
            normal.end_of_sample(segment.log, segment.time_s[i]);
        }
    }
    out
}

/// Covariance of a state that the sensors have just told.
fn uncertain(sd: &Error, noise: &Noise) -> Matrix {
    let mut p = [[0.0; STATES]; STATES];
    for k in 0..STATES {
        p[k][k] = if k < 9 {
            sd[k] * sd[k]
        } else {
            noise.stationary(k).powi(2)
        };
    }
    p
}

/// Huber's loss of a standardised innovation, and the weight it leaves.
pub fn huber(nu: f64) -> (f64, f64) {
    let size = nu.abs();
    if size <= HUBER {
        (nu * nu, 1.0)
    } else {
        (2.0 * HUBER * size - HUBER * HUBER, HUBER / size)
    }
}

fn wrapped(angle: f64) -> f64 {
    use std::f64::consts::{PI, TAU};
    (angle + PI).rem_euclid(TAU) - PI
}

impl Filter<'_> {
    /// Derivatives of the readings by the error states, row by row.
    fn observation(&self, i: usize, at_mean: &[f64; CHANNELS]) -> [Error; CHANNELS] {
        let mut h = [[0.0; STATES]; CHANNELS];
        // Disturbing angular acceleration is felt later only, disturbing force at once.
        for k in (0..12).chain(SMOOTHED_LATERAL..STATES) {
            let mut d = [0.0; STATES];
            let step = if (3..9).contains(&k) { 1e-5 } else { 1e-4 };
            d[k] = step;
            let read = self.world.sense(self.segment, i, &moved(&self.mean, &d));
            for c in 0..CHANNELS {
                let change = read[c] - at_mean[c];
                let change = if is_angle(c) { wrapped(change) } else { change };
                h[c][k] = change / step;
            }
        }
        for k in 0..3 {
            h[at::FORCE + k][15 + k] = 1.0;
        }
        for k in 0..2 {
            h[at::ROLL + k][LEAN + k] = 1.0;
        }
        h
    }

    fn update(
        &mut self,
        i: usize,
        keep: bool,
        out: &mut Pass,
        mut sensitivity: Option<&mut Sensitivity<'_, '_>>,
        mut normal: Option<&mut Normal>,
    ) {
        let expected = self.world.sense(self.segment, i, &self.mean);
        let h = self.observation(i, &expected);
        let direct = sensitivity
            .as_deref_mut()
            .map(|s| s.direct(self, i, &expected));
        let mut d = [0.0; STATES];
        let mut standardised = [f64::NAN; CHANNELS];
        let mut innovations = [0.0; CHANNELS];
        let mut row = vec![0.0; sensitivity.as_ref().map_or(0, |s| s.state.len())];
        for c in 0..CHANNELS {
            let measured = self.segment.measured[i][c];
            if measured.is_nan() {
                continue;
            }
            let away = measured - expected[c];
            innovations[c] = if is_angle(c) { wrapped(away) } else { away };
            let taken = self.take(c, &h[c], innovations[c], &mut d);
            out.log_score += taken.log_score;
            standardised[c] = taken.nu;
            if let (Some(s), Some(direct)) = (sensitivity.as_deref_mut(), &direct) {
                s.take(c, &h[c], &taken, direct, &mut row);
                if let Some(normal) = normal.as_deref_mut() {
                    normal.add_row(&row, taken.nu * taken.weight.sqrt());
                }
            }
            out.count[c] += 1;
        }
        for c in 0..CHANNELS {
            if standardised[c].is_finite() {
                // Beyond Huber's bound a reading tells of outliers, not of noise.
                let weight = huber(standardised[c]).1;
                out.left[c] += weight * innovations[c] * (innovations[c] - dot(&h[c], &d));
            }
        }
        self.mean = moved(&self.mean, &d);
        if keep {
            out.standardised.push(standardised);
            out.means.push(self.mean);
        }
    }

    /// Takes the reading of channel `c`, whose derivatives are `h` and whose departure from what
    /// was expected before this sample is `away`: moves `d` and the covariance.
    fn take(&mut self, c: usize, h: &Error, away: f64, d: &mut Error) -> Taken {
        let e = away - dot(h, d);
        let gain: Error = times(&self.p, h);
        let r = self.noise.sensor[c].powi(2);
        let known = dot(h, &gain).max(0.0);
        let variance = known + r;
        let nu = e / variance.sqrt();
        let (loss, weight) = huber(nu);
        // An outlier counts as one with a larger noise.
        let used = known + r / (weight * weight);
        for k in 0..STATES {
            d[k] += gain[k] * e / used;
            let g = gain[k] / used;
            for l in 0..STATES {
                self.p[k][l] -= g * gain[l];
            }
        }
        Taken {
            gain,
            nu,
            weight,
            variance,
            used,
            log_score: -0.5 * (loss + (std::f64::consts::TAU * variance).ln()),
        }
    }

    fn predict(&mut self, i: usize, sensitivity: Option<&mut Sensitivity<'_, '_>>) {
        let dt = self.segment.time_s[i + 1] - self.segment.time_s[i];
        let next = self.world.step(self.segment, i, &self.mean);
        let f = self.transition(i, dt, &next);
        if let Some(s) = sensitivity {
            s.predict(self, i, dt, &next, &f);
        }
        // F P, then (F P) F'.
        let fp: Matrix = std::array::from_fn(|c| times(&f, &self.p[c]));
        let mut p = [[0.0; STATES]; STATES];
        // fp[k] is column k of F P; column c of F P F' is their sum weighted by F's row c.
        for c in 0..STATES {
            for k in 0..STATES {
                let weight = f[k][c];
                if weight != 0.0 {
                    for r in 0..STATES {
                        p[c][r] += fp[k][r] * weight;
                    }
                }
            }
        }
        for c in 0..STATES {
            for r in 0..c {
                let mean = 0.5 * (p[c][r] + p[r][c]);
                (p[c][r], p[r][c]) = (mean, mean);
            }
            p[c][c] = p[c][c].max(0.0) + self.noise.process(c, dt);
        }
        self.p = p;
        self.mean = next;
        let finite = self.p.iter().flatten().all(|v| v.is_finite());
        if !(self.mean.is_sane() && finite) {
            // The model has lost the flight: it begins anew from what the sensors tell.
            let (mean, sd) = start(self.segment, self.world, i + 1);
            self.mean = mean;
            self.p = uncertain(&sd, self.noise);
        }
    }

    /// Derivatives of the next state by the errors of this one, column by column.
    fn transition(&self, i: usize, dt: f64, next: &Mean) -> Matrix {
        let mut f = [[0.0; STATES]; STATES];
        for k in (0..12).chain(SMOOTHED_LATERAL..STATES) {
            let mut d = [0.0; STATES];
            let step = if (3..9).contains(&k) { 1e-5 } else { 1e-4 };
            d[k] = step;
            let other = self.world.step(self.segment, i, &moved(&self.mean, &d));
            f[k] = difference(next, &other).map(|v| v / step);
        }
        let m = fdm::dynamics::rotation(&self.mean.body.attitude);
        let keep = (-dt / DISTURBANCE_S).exp();
        for k in 0..3 {
            f[12 + k][6 + k] = dt;
            f[12 + k][12 + k] = keep;
            for r in 0..3 {
                f[15 + k][r] = dt * m[r][k];
            }
            f[15 + k][15 + k] = keep;
        }
        for column in LEAN..SMOOTHED_LATERAL {
            f[column][column] = (-dt / LEAN_S).exp();
        }
        f
    }
}

impl Sensitivity<'_, '_> {
    /// Moves the derivatives by one reading and writes those of its innovation into `row`.
    fn take(
        &mut self,
        c: usize,
        h: &Error,
        taken: &Taken,
        direct: &[[f64; CHANNELS]],
        row: &mut [f64],
    ) {
        let scale = taken.weight.sqrt() / taken.variance.sqrt();
        for (j, state) in self.state.iter_mut().enumerate() {
            let of_e = -direct[j][c] - dot(h, state);
            row[j] = of_e * scale;
            let moved = of_e / taken.used;
            for k in 0..STATES {
                state[k] += taken.gain[k] * moved;
            }
        }
    }

    /// Derivatives of the readings by the columns at a fixed state.
    fn direct(
        &mut self,
        filter: &Filter<'_>,
        i: usize,
        expected: &[f64; CHANNELS],
    ) -> Vec<[f64; CHANNELS]> {
        let segment = filter.segment;
        let mut out = Vec::with_capacity(self.state.len());
        for (world, step, _) in &self.columns.worlds {
            let read = world.sense(segment, i, &filter.mean);
            out.push(std::array::from_fn(|c| (read[c] - expected[c]) / step));
        }
        let met = filter.world.meets(segment, i, &filter.mean);
        for (column, (target, value)) in self.terms.iter_mut().zip(self.columns.terms.at(&met)) {
            let mut read = [0.0; CHANNELS];
            match target {
                Target::Push(k) => read[at::FORCE + k] = value,
                Target::Sensor(c) => read[c] = value,
                Target::Surface(_) | Target::Spin(_) => {}
            }
            *column = (target, value);
            out.push(read);
        }
        out
    }

    fn predict(&mut self, filter: &Filter<'_>, i: usize, dt: f64, next: &Mean, f: &Matrix) {
        let m = fdm::dynamics::rotation(&filter.mean.body.attitude);
        for (state, (world, step, moves)) in self.state.iter_mut().zip(&self.columns.worlds) {
            *state = times(f, state);
            if *moves {
                let other = world.step(filter.segment, i, &filter.mean);
                let change = difference(next, &other);
                for k in 0..STATES {
                    state[k] += change[k] / step;
                }
            }
        }
        let nameless = &mut self.state[self.columns.worlds.len()..];
        for (state, &(target, value)) in nameless.iter_mut().zip(&self.terms) {
            *state = times(f, state);
            match target {
                Target::Spin(k) | Target::Surface(k) => state[6 + k] += dt * value,
                Target::Push(k) => {
                    for r in 0..3 {
                        state[r] += dt * m[r][k] * value;
                    }
                }
                Target::Sensor(_) => {}
            }
        }
    }
}

fn is_angle(channel: usize) -> bool {
    (at::ROLL..at::ROLL_RATE).contains(&channel)
}

fn dot(a: &Error, b: &Error) -> f64 {
    let mut sum = [0.0; 2];
    for k in 0..STATES / 2 {
        sum[0] += a[2 * k] * b[2 * k];
        sum[1] += a[2 * k + 1] * b[2 * k + 1];
    }
    sum[0] + sum[1]
}

/// Matrix (column by column) times vector.
fn times(m: &Matrix, v: &Error) -> Error {
    let mut out = [0.0; STATES];
    for (column, weight) in m.iter().zip(v) {
        for k in 0..STATES {
            out[k] += column[k] * weight;
        }
    }
    out
}

/// Correlation time of a state that remembers and is driven, s.
pub fn correlation_s(state: usize) -> f64 {
    match state {
        ..12 => GUST_S[state - 9],
        12..18 => DISTURBANCE_S,
        _ => LEAN_S,
    }
}
