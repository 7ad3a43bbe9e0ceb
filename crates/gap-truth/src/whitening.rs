//! The noise of one platform's readings as its covariance has it: differences of mean readings, turned
//! into independent ones of unit variance.
//!
//! Slow noise, intermittency, errors of the logged place and what a swing of the wind does between two
//! knots are Ornstein–Uhlenbeck processes, and the sensor's stages filter what intermittency makes of
//! the plume: a linear state whose innovations a Kalman filter gives (Anderson & Moore 1979,
//! chapter 5). Outliers and the third moment of other noise are not in it.

use crate::instrument::{MeanLog, NoiseLevels, PLACE_NOISE, PLACE_WHITE_M};
use crate::scene::SUB_STEP_S;

/// Processes that add to a reading as they are: slow noise, three errors of place, and a swing.
const ADDED: usize = 5;
/// After them the intermittency, and at most three stages of a sensor.
const GUST: usize = ADDED;
const STATES: usize = GUST + 4;

type State = [f64; STATES];
type Square = [State; STATES];

/// What the errors of a model's inputs do to the readings, row by row.
#[derive(Debug, Clone, Default)]
pub struct InputErrors {
    /// ppm a metre east, north and up.
    pub by_place: [Vec<f64>; 3],
    /// ppm a degree of the wind's direction.
    pub by_direction: Vec<f64>,
    /// Swing of the wind between knots: standard deviation, degrees, and correlation time, s.
    pub swing_deg: (f64, f64),
}

/// Noise of one platform's readings.
pub struct Whitener<'a> {
    /// Excess met at every sub-step times the relative size of intermittency, ppm.
    gust_ppm: Vec<f64>,
    seen_at: Vec<usize>,
    lags_s: Vec<f64>,
    white_variance: f64,
    slow_ppm: f64,
    /// What each process keeps over a sub-step.
    keep: [f64; ADDED + 1],
    errors: Option<&'a InputErrors>,
}

/// A way of the state: what it becomes, and the covariance of what comes to it.
struct Way {
    becomes: Square,
    added: Square,
}

impl<'a> Whitener<'a> {
    /// The noise of readings of a platform whose air `log` tells, through a sensor with a gain and
    /// stages of these time constants, s.
    pub fn new(noise: &NoiseLevels, log: &MeanLog, gain: f64, lags_s: Vec<f64>) -> Self {
        let ((slow_ppm, slow_s), (gust, gust_s)) = (noise.slow_ppm(), noise.gusts());
        let [east, north, up] = PLACE_NOISE.map(|p| p.1);
        let keep = |lasts_s: f64| (-SUB_STEP_S / lasts_s).exp();
        Self {
            gust_ppm: log.air_ppm.iter().map(|e| gust * gain * e).collect(),
            seen_at: log.seen_at.clone(),
            lags_s,
            white_variance: noise.white_variance(),
            slow_ppm,
            keep: [slow_s, east, north, up, 1.0, gust_s].map(keep),
            errors: None,
        }
    }

    /// The same with errors of what a model takes for its inputs.
    pub fn with_errors(mut self, errors: &'a InputErrors) -> Self {
        self.keep[ADDED - 1] = (-SUB_STEP_S / errors.swing_deg.1).exp();
        self.errors = Some(errors);
        self
    }

    /// The step from sub-step `k` to the next.
    fn step(&self, k: usize) -> Way {
        let mut way = Way {
            becomes: [[0.0; STATES]; STATES],
            added: [[0.0; STATES]; STATES],
        };
        for (i, keep) in self.keep.iter().enumerate() {
            way.becomes[i][i] = *keep;
            way.added[i][i] = 1.0 - keep * keep;
        }
        let mut new = [0.0; STATES];
        let keep_gust = self.keep[GUST];
        new[GUST] = (1.0 - keep_gust.powi(2)).sqrt();
        // What enters the first stage now and after the step, by the state before it.
        let mut before: State = [0.0; STATES];
        before[GUST] = self.gust_ppm[k];
        let scaled = self.gust_ppm[k + 1];
        let mut after: (State, f64) = ([0.0; STATES], scaled * new[GUST]);
        after.0[GUST] = scaled * keep_gust;
        for (j, tau_s) in self.lags_s.iter().enumerate() {
            let own = GUST + 1 + j;
            // Exact for what is straight between two sub-steps, as the sensor itself.
            let keep = (-SUB_STEP_S / tau_s).exp();
            let mean = (1.0 - keep) * tau_s / SUB_STEP_S;
            let mut row = [0.0; STATES];
            for (r, (b, a)) in row.iter_mut().zip(before.iter().zip(&after.0)) {
                *r = (mean - keep) * b + (1.0 - mean) * a;
            }
            row[own] += keep;
            before = [0.0; STATES];
            before[own] = 1.0;
            after = (row, (1.0 - mean) * after.1);
            (way.becomes[own], new[own]) = after;
        }
        for i in GUST..STATES {
            for j in GUST..STATES {
                way.added[i][j] = new[i] * new[j];
            }
        }
        way
    }

    /// What a reading in `row`, at sub-step `k`, shows of the state.
    fn shown(&self, row: usize, k: usize) -> State {
        let mut shown = [0.0; STATES];
        shown[0] = self.slow_ppm;
        if let Some(errors) = self.errors {
            for (i, (by_m, size)) in errors.by_place.iter().zip(PLACE_NOISE).enumerate() {
                shown[1 + i] = by_m[row] * size.0;
            }
            shown[ADDED - 1] = errors.by_direction[row] * errors.swing_deg.0;
        }
        match self.lags_s.len() {
            0 => shown[GUST] = self.gust_ppm[k],
            stages => shown[GUST + stages] = 1.0,
        }
        shown
    }

    fn white(&self, row: usize) -> f64 {
        let of_place = self.errors.map_or(0.0, |e| {
            let slopes = e.by_place.iter().map(|by_m| by_m[row].powi(2));
            slopes.sum::<f64>() * PLACE_WHITE_M.powi(2)
        });
        self.white_variance + of_place
    }

    /// `columns`, each with a value a row, whitened. A row that shows earlier air than the one before
    /// it, as of a second sensor that is late, counts as of the same.
    pub fn whiten(&self, columns: &mut [Vec<f64>]) {
        let mut p: Square = [[0.0; STATES]; STATES];
        for (i, row) in p.iter_mut().enumerate().take(GUST + 1) {
            row[i] = 1.0;
        }
        let mut states = vec![[0.0; STATES]; columns.len()];
        let mut at = 0;
        for (row, &seen) in self.seen_at.iter().enumerate() {
            let mut becomes: Option<Square> = None;
            while at < seen {
                let step = self.step(at);
                p = grown(&step, &p);
                becomes = Some(becomes.map_or(step.becomes, |b| product(&step.becomes, &b)));
                at += 1;
            }
            let shown = self.shown(row, at);
            let along = p.map(|r| dot(&r, &shown));
            let variance = dot(&along, &shown) + self.white(row);
            let gain = along.map(|a| a / variance);
            for (x, column) in states.iter_mut().zip(columns.iter_mut()) {
                if let Some(becomes) = &becomes {
                    *x = becomes.map(|r| dot(&r, x));
                }
                let innovation = column[row] - dot(x, &shown);
                for (x, g) in x.iter_mut().zip(&gain) {
                    *x += g * innovation;
                }
                column[row] = innovation / variance.sqrt();
            }
            for (r, a) in p.iter_mut().zip(along) {
                for (v, g) in r.iter_mut().zip(&gain) {
                    *v -= a * g;
                }
            }
        }
    }
}

/// The covariance after a step.
fn grown(step: &Way, p: &Square) -> Square {
    let half = product(&step.becomes, p);
    let mut out = step.added;
    for (row, h) in out.iter_mut().zip(&half) {
        for (v, b) in row.iter_mut().zip(&step.becomes) {
            *v += dot(h, b);
        }
    }
    out
}

fn product(a: &Square, b: &Square) -> Square {
    a.map(|r| {
        let mut row = [0.0; STATES];
        for (x, other) in r.iter().zip(b) {
            if *x != 0.0 {
                row.iter_mut().zip(other).for_each(|(v, o)| *v += x * o);
            }
        }
        row
    })
}

fn dot(a: &State, b: &State) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}
