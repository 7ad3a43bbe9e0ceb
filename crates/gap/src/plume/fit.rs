//! Fitting a model and its noise: Gauss–Newton on whitened residuals, noise by maximum
//! posterior, evidence by Laplace's approximation.

use ::plume::mechanism::MechanismId;
use nalgebra::{DMatrix, DVector};

use super::data::{Data, Setup};
use super::linear::{Posterior, dot, posterior};
use super::model::{Model, Part, Prediction};
use super::noise::{self, Loading, NoiseModel, Rows, Whitener};

/// What every fit needs.
#[derive(Clone, Copy)]
pub(crate) struct Context<'a> {
    pub setup: &'a Setup,
    pub data: &'a Data,
    pub threads: usize,
}

/// Step of wind direction for the noise's loading, degrees.
const SWING_STEP_DEG: f64 = 0.5;
/// Longest step of one iteration, in standard deviations of the prior.
const LONGEST_STEP: f64 = 3.0;

/// A model at its best, with its noise.
#[derive(Debug, Clone)]
pub(crate) struct Fitted {
    pub model: Model,
    pub prediction: Prediction,
    pub noise: NoiseModel,
    pub loading: Vec<Loading>,
    pub whitener: Whitener,
    /// Whitened residual.
    pub residual: Vec<f64>,
    /// Whitened derivatives by the free parameters.
    pub columns: Vec<Vec<f64>>,
    /// Posterior of the free parameters about where they stand.
    pub posterior: Posterior,
    /// Log likelihood, nats.
    pub log_score: f64,
    /// Log likelihood and prior and their curvature, nats.
    pub log_evidence: f64,
}

impl<'a> Context<'a> {
    pub fn rows<'b>(&'b self, loading: &'b [Loading]) -> Rows<'b> {
        Rows {
            ranges: self.data.ranges(),
            time_s: self.data.track.time_s(),
            used: &self.data.used,
            sd_ppm: &self.data.sd_ppm,
            loading,
        }
    }

    pub fn predict(&self, model: &Model) -> Prediction {
        model.predict(&self.setup.base, &self.data.track)
    }

    pub fn readings(&self, model: &Model) -> Vec<f64> {
        model.readings(&self.setup.base, &self.data.track)
    }

    /// What the noise depends on at every row.
    pub fn loading(&self, model: &Model, prediction: &Prediction) -> Vec<Loading> {
        let mut turned = model.clone();
        turned.parts.push(Part {
            id: MechanismId::WindDirectionOffset,
            platform: None,
            values: vec![SWING_STEP_DEG],
        });
        let turned = self.readings(&turned);
        (0..self.data.len())
            .map(|i| Loading {
                gust: prediction.plume[i],
                swing: (turned[i] - prediction.reading[i]) / SWING_STEP_DEG,
            })
            .collect()
    }

    /// Derivatives of the readings by the free parameters, in their coordinates.
    pub fn derivatives(&self, model: &Model, reading: &[f64]) -> Vec<Vec<f64>> {
        (0..model.dimension())
            .map(|k| {
                let step = model.difference_step(k);
                let mut moved = model.clone();
                moved.set_coordinate(k, model.coordinate(k) + step);
                let mut column = self.readings(&moved);
                for (c, r) in column.iter_mut().zip(reading) {
                    *c = (*c - r) / step;
                }
                column
            })
            .collect()
    }

    /// Gauss–Newton under a fixed whitener; gives the model and its predicted readings.
    pub fn descend(&self, start: &Model, whitener: &Whitener, iterations: usize) -> Model {
        let mut model = start.clone();
        let mut reading = self.readings(&model);
        let mut here = self.objective(&model, &reading, whitener);
        for _ in 0..iterations {
            if model.dimension() == 0 {
                break;
            }
            let (residual, columns) = self.whitened(&model, &reading, whitener);
            let Some(post) = step_of(&model, &residual, &columns) else {
                break;
            };
            let mut scale = limit(&model, &post.mean);
            let mut gained = 0.0;
            for _ in 0..4 {
                let mut moved = model.clone();
                for k in 0..model.dimension() {
                    moved.set_coordinate(k, model.coordinate(k) + scale * post.mean[k]);
                }
                let there_reading = self.readings(&moved);
                let there = self.objective(&moved, &there_reading, whitener);
                if there > here {
                    gained = there - here;
                    (model, reading, here) = (moved, there_reading, there);
                    break;
                }
                scale *= 0.3;
            }
            if gained < 0.02 {
                break;
            }
        }
        model
    }

    fn objective(&self, model: &Model, reading: &[f64], whitener: &Whitener) -> f64 {
        let mut residual = self.data.residual(reading);
        whitener.whiten_one(&mut residual);
        model.ln_prior() - 0.5 * dot(&residual, &residual)
    }

    /// Whitened residual and derivatives.
    pub fn whitened(
        &self,
        model: &Model,
        reading: &[f64],
        whitener: &Whitener,
    ) -> (Vec<f64>, Vec<Vec<f64>>) {
        let mut residual = self.data.residual(reading);
        let mut columns = self.derivatives(model, reading);
        let mut all: Vec<&mut [f64]> = columns.iter_mut().map(Vec::as_mut_slice).collect();
        all.push(&mut residual);
        whitener.whiten(&mut all);
        (residual, columns)
    }

    /// A model at its best under the noise that stands; no noise is fitted.
    pub fn settle(
        &self,
        start: &Model,
        noise: &NoiseModel,
        loading: &[Loading],
        whitener: &Whitener,
        iterations: usize,
    ) -> Fitted {
        let model = self.descend(start, whitener, iterations);
        let prediction = self.predict(&model);
        self.conclude(
            model,
            prediction,
            *noise,
            loading.to_vec(),
            None,
            Some(whitener),
        )
    }

    /// A model and its noise at their best, `rounds` times in turn.
    pub fn refine(&self, from: Fitted, rounds: usize, noise_steps: usize) -> Fitted {
        let mut now = from;
        for _ in 0..rounds {
            let loading = self.loading(&now.model, &now.prediction);
            let residual = self.data.residual(&now.prediction.reading);
            let rows = self.rows(&loading);
            let noise = noise::fit(&rows, &now.noise, &residual, noise_steps, self.threads);
            let whitener = Whitener::new(&rows, &noise, &residual);
            let model = self.descend(&now.model, &whitener, 3);
            let prediction = self.predict(&model);
            now = self.conclude(model, prediction, noise, loading, None, None);
        }
        now
    }

    /// The first fit: prior noise, then both in turn.
    pub fn start(&self, model: &Model, noise: NoiseModel, noise_steps: usize) -> Fitted {
        let prediction = self.predict(model);
        let loading = self.loading(model, &prediction);
        let residual = self.data.residual(&prediction.reading);
        let whitener = Whitener::new(&self.rows(&loading), &noise, &residual);
        let model = self.descend(model, &whitener, 4);
        let prediction = self.predict(&model);
        let fitted = self.conclude(model, prediction, noise, loading, None, None);
        self.refine(fitted, 1, noise_steps)
    }

    /// Puts together what is known at a model.
    pub fn conclude(
        &self,
        model: Model,
        prediction: Prediction,
        noise: NoiseModel,
        loading: Vec<Loading>,
        fresh: Option<Whitener>,
        fixed: Option<&Whitener>,
    ) -> Fitted {
        let residual_raw = self.data.residual(&prediction.reading);
        let whitener = match (fresh, fixed) {
            (Some(w), _) => w,
            (None, Some(w)) => w.clone(),
            (None, None) => Whitener::new(&self.rows(&loading), &noise, &residual_raw),
        };
        let (residual, columns) = self.whitened(&model, &prediction.reading, &whitener);
        // Under a fixed whitener only the squares change.
        let log_score = if fixed.is_some() {
            -0.5 * dot(&residual, &residual)
        } else {
            whitener.log_likelihood + noise.ln_prior()
        };
        let posterior = step_of(&model, &residual, &columns).unwrap_or_else(|| empty(&model));
        let n = model.dimension() as f64;
        let log_det = log_det(&posterior.covariance);
        let log_evidence =
            log_score + model.ln_prior() + 0.5 * n * std::f64::consts::TAU.ln() + 0.5 * log_det;
        Fitted {
            model,
            prediction,
            noise,
            loading,
            whitener,
            residual,
            columns,
            posterior,
            log_score,
            log_evidence,
        }
    }
}

fn log_det(covariance: &DMatrix<f64>) -> f64 {
    let n = covariance.nrows();
    if n == 0 {
        return 0.0;
    }
    let scale: Vec<f64> = (0..n)
        .map(|k| covariance[(k, k)].max(1e-300).sqrt())
        .collect();
    let unit = DMatrix::from_fn(n, n, |i, j| covariance[(i, j)] / (scale[i] * scale[j]));
    let det = unit.determinant().max(1e-300).ln();
    det + 2.0 * scale.iter().map(|s| s.ln()).sum::<f64>()
}

fn empty(model: &Model) -> Posterior {
    let n = model.dimension();
    let covariance = DMatrix::from_fn(n, n, |i, j| {
        if i == j {
            model.free[i].sd.powi(2)
        } else {
            0.0
        }
    });
    Posterior {
        mean: DVector::zeros(n),
        covariance,
        gain: 0.0,
        log_evidence: 0.0,
    }
}

/// Prior centres as steps from where the model stands, and precisions.
pub(crate) fn prior_of(model: &Model) -> (DVector<f64>, DVector<f64>) {
    let n = model.dimension();
    (
        DVector::from_fn(n, |k, _| model.free[k].centre - model.coordinate(k)),
        DVector::from_fn(n, |k, _| model.free[k].sd.powi(-2)),
    )
}

/// Posterior of a step from where the model stands.
pub(crate) fn step_of(model: &Model, residual: &[f64], columns: &[Vec<f64>]) -> Option<Posterior> {
    let n = columns.len();
    let mut gram = DMatrix::zeros(n, n);
    for i in 0..n {
        for j in 0..=i {
            gram[(i, j)] = dot(&columns[i], &columns[j]);
            gram[(j, i)] = gram[(i, j)];
        }
    }
    let score = DVector::from_fn(n, |k, _| dot(&columns[k], residual));
    let (centre, precision) = prior_of(model);
    posterior(&gram, &score, &centre, &precision)
}

/// Part of a step that keeps every parameter within reach of its prior.
fn limit(model: &Model, step: &DVector<f64>) -> f64 {
    let longest = (0..step.len())
        .map(|k| (step[k] / model.free[k].sd.min(model.spec_of(k).prior_sd)).abs())
        .fold(0.0f64, f64::max);
    if longest > LONGEST_STEP {
        LONGEST_STEP / longest
    } else {
        1.0
    }
}
