//! Fitting a model and its noise: Gauss–Newton on whitened residuals, noise by maximum
//! posterior, evidence by Laplace's approximation.

use std::sync::Arc;

use nalgebra::{DMatrix, DVector};

use super::data::{Data, Setup};
use super::freedom::Freedom;
use super::linear::{Posterior, posterior, posterior_mean, products, scores};
use super::model::{Model, Part, Prediction};
use super::noise::{self, Loading, NoiseModel, Rows, Whitener};
use super::nuisance::{Metric, Nuisance};

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

/// What log likelihoods under one noise have in common.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Scale {
    /// Log likelihood of a residual of nothing, with the noise's prior, nats.
    nothing_nats: f64,
    /// The part of the nuisance in it, ½ ln |I + S Zᵀ Z|, nats.
    volume: f64,
}

impl Scale {
    /// That of a metric which was made with the noise and the residual `cleaned`.
    fn new(metric: &Metric, noise: &NoiseModel, cleaned: &[f64]) -> Self {
        Self {
            nothing_nats: metric.nats_of_nothing(cleaned) + noise.ln_prior(),
            volume: metric.half_log_det,
        }
    }
}

/// A model at its best, with its noise.
#[derive(Debug, Clone)]
pub(crate) struct Fitted {
    pub model: Model,
    pub prediction: Prediction,
    pub noise: NoiseModel,
    pub loading: Vec<Loading>,
    pub metric: Arc<Metric>,
    /// Whitened residual.
    pub residual: Vec<f64>,
    /// Whitened derivatives by the free parameters.
    derivatives: Vec<Vec<f64>>,
    /// Centres of the columns' priors, as steps from where the model stands.
    pub centre: DVector<f64>,
    /// Precisions of the columns' priors.
    pub precision: DVector<f64>,
    /// Posterior of the columns' coefficients about where the model stands.
    pub posterior: Posterior,
    scale: Scale,
    /// Log likelihood, nats; of swings and tolerances that are not those of the noise's own fit
    /// without the volume.
    pub log_score: f64,
    /// Log likelihood with the volume, prior, and their curvature, nats.
    pub log_evidence: f64,
}

impl Fitted {
    /// Log score with the prior of the parameters, nats.
    pub fn score_with_prior(&self) -> f64 {
        self.log_score + self.model.ln_prior()
    }

    /// Log score that there would be with a residual of nothing, nats.
    pub fn log_score_of_nothing(&self) -> f64 {
        self.scale.nothing_nats
    }

    /// Whitened derivatives by the free parameters, then the nuisance columns.
    pub fn columns(&self) -> Vec<&[f64]> {
        self.metric.after(&self.derivatives)
    }

    /// The whitened residual less its columns with these coefficients.
    pub fn less(&self, coefficients: &DVector<f64>) -> Vec<f64> {
        let mut left = self.residual.clone();
        for (column, c) in self.columns().iter().zip(coefficients.iter()) {
            for (l, value) in left.iter_mut().zip(*column) {
                *l -= c * value;
            }
        }
        left
    }
}

/// How far the noise is fitted.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Effort {
    /// Rounds of cleaning the residual and fitting the noise to the rest.
    pub rounds: usize,
    /// Steps after that with all that is free integrated out, which is exact and slow.
    pub marginal_steps: usize,
    /// Whether slow swings of the plume are free beside the catalogue.
    pub slow_swings: bool,
}

impl Effort {
    /// Good enough to rank by.
    pub const QUICK: Self = Self {
        rounds: 2,
        marginal_steps: 0,
        slow_swings: false,
    };
    /// From a noise that is near already.
    pub const FULL: Self = Self {
        rounds: 1,
        marginal_steps: 15,
        slow_swings: false,
    };
    /// The same with slow swings free: a noise that holds none of them.
    pub const BESIDE_SWINGS: Self = Self {
        slow_swings: true,
        ..Self::FULL
    };
}

/// A noise fitted with everything free, and what came with it.
pub(crate) struct Wide {
    pub noise: NoiseModel,
    pub prediction: Prediction,
    pub loading: Vec<Loading>,
    /// Residual less all that is free.
    pub cleaned: Vec<f64>,
    /// Log likelihood with all that is free integrated out, nats.
    pub log_score: f64,
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

    /// Time that the plume takes from the first source to the place of each row, s.
    pub fn way_s(&self) -> impl Iterator<Item = f64> {
        self.data.way_s(self.setup.base.sources[0].place)
    }

    /// What one more part changes in the readings that `model` predicts.
    pub fn change(&self, model: &Model, prediction: &Prediction, part: Part) -> Vec<f64> {
        let mut with = model.clone();
        with.parts.push(part);
        let mut column = self.readings(&with);
        for (c, r) in column.iter_mut().zip(&prediction.reading) {
            *c -= r;
        }
        column
    }

    /// What the noise depends on at every row.
    pub fn loading(&self, model: &Model, prediction: &Prediction) -> Vec<Loading> {
        self.change(model, prediction, Part::turn(SWING_STEP_DEG))
            .iter()
            .zip(&prediction.plume)
            .zip(self.shown(model))
            .map(|((turned, plume), shown)| Loading {
                gust: *plume,
                swing: turned / SWING_STEP_DEG,
                shown,
            })
            .collect()
    }

    /// Share of what the sensor showed at the row before that it still shows at every row.
    fn shown(&self, model: &Model) -> Vec<f64> {
        let track = &self.data.track;
        let mut shown = vec![0.0; track.len()];
        let Some(world) = model.world(&self.setup.base, track.platforms()) else {
            return shown;
        };
        let times = track.time_s();
        for (range, lag_s) in self.data.ranges().iter().zip(track.lags_s(&world)) {
            for i in range.clone().skip(1).filter(|_| lag_s > 0.0) {
                shown[i] = (-(times[i] - times[i - 1]) / lag_s).exp();
            }
        }
        shown
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

    /// Gauss–Newton in a fixed metric.
    pub fn descend(&self, start: &Model, metric: &Metric, iterations: usize) -> Model {
        let mut model = start.clone();
        let mut reading = self.readings(&model);
        let mut here = self.objective(&model, &reading, metric);
        for _ in 0..iterations {
            let n = model.dimension();
            if n == 0 {
                break;
            }
            let (residual, derivatives) = self.whitened(&model, &reading, metric);
            let (gram, score) = normal_equations(&residual, &derivatives, metric);
            let (centre, precision) = prior_of(&model, metric);
            let Some(step) = posterior_mean(&gram, &score, &centre, &precision) else {
                break;
            };
            let better = moved_to_better(&model, &step, |moved| {
                let reading = self.readings(moved);
                let there = self.objective(moved, &reading, metric);
                (there > here).then_some((reading, there))
            });
            let mut gained = 0.0;
            if let Some((moved, (there_reading, there))) = better {
                gained = there - here;
                (model, reading, here) = (moved, there_reading, there);
            }
            if gained < 0.02 {
                break;
            }
        }
        model
    }

    fn objective(&self, model: &Model, reading: &[f64], metric: &Metric) -> f64 {
        let mut residual = self.data.residual(reading);
        metric.whitener.whiten_one(&mut residual);
        model.ln_prior() - 0.5 * metric.square(&residual)
    }

    /// Whitened residual, and whitened derivatives by the free parameters.
    fn whitened(
        &self,
        model: &Model,
        reading: &[f64],
        metric: &Metric,
    ) -> (Vec<f64>, Vec<Vec<f64>>) {
        let mut residual = self.data.residual(reading);
        let mut columns = self.derivatives(model, reading);
        let mut all: Vec<&mut [f64]> = columns.iter_mut().map(Vec::as_mut_slice).collect();
        all.push(&mut residual);
        metric.whitener.whiten(&mut all);
        (residual, columns)
    }

    /// A model at its best under the noise of `from`; no noise is fitted. The metric is that of `from`,
    /// or has other swings and tolerances.
    pub fn settle(
        &self,
        start: &Model,
        metric: &Arc<Metric>,
        from: &Fitted,
        iterations: usize,
    ) -> Fitted {
        let model = self.descend(start, metric, iterations);
        let prediction = self.predict(&model);
        self.conclude(
            model,
            prediction,
            from.noise,
            from.loading.clone(),
            Arc::clone(metric),
            from.scale,
        )
    }

    /// The same under the noise of another fit, with swings and tolerances as they are where this
    /// model stands then. Those of where the other stood may lead straight from this one to it.
    pub fn settle_in_its_place(&self, start: &Model, from: &Fitted, iterations: usize) -> Fitted {
        let model = self.descend(start, &from.metric, iterations);
        let prediction = self.predict(&model);
        let nuisance = Nuisance::new(self, &model, &prediction, &from.loading, &from.noise);
        let metric = Arc::new(Metric::new(from.metric.whitener.clone(), nuisance));
        self.settle(&model, &metric, from, iterations)
    }

    /// A model and its noise at their best; the noise is fitted beside everything that the
    /// catalogue could add ([`Freedom`]).
    pub fn refine(&self, start: &Model, noise: NoiseModel) -> Fitted {
        self.refine_with(start, noise, Effort::FULL)
    }

    /// The same with an effort.
    pub fn refine_with(&self, start: &Model, noise: NoiseModel, effort: Effort) -> Fitted {
        self.within(start, self.wide(start, noise, effort))
    }

    /// A model at its best under a noise that was fitted beside everything.
    pub fn within(&self, start: &Model, wide: Wide) -> Fitted {
        let rows = self.rows(&wide.loading);
        let whitener = Whitener::new(&rows, &wide.noise, &wide.cleaned);
        let nuisance = Nuisance::new(self, start, &wide.prediction, &wide.loading, &wide.noise);
        let metric = Arc::new(Metric::new(whitener, nuisance));
        let model = self.descend(start, &metric, 4);
        let prediction = self.predict(&model);
        let scale = Scale::new(&metric, &wide.noise, &wide.cleaned);
        self.conclude(model, prediction, wide.noise, wide.loading, metric, scale)
    }

    /// The noise fitted with everything free at `model`, and the score of that.
    pub fn wide(&self, model: &Model, noise: NoiseModel, effort: Effort) -> Wide {
        let mut noise = noise;
        let prediction = self.predict(model);
        let loading = self.loading(model, &prediction);
        let freedom = Freedom::new(self, model, &prediction, &loading, effort);
        let raw = self.data.residual(&prediction.reading);
        let rows = self.rows(&loading);
        // Outliers show only once the structure is out, and the structure once they are.
        let mut cleaned = raw.clone();
        let clean = |noise: &mut NoiseModel, cleaned: &[f64], sized: bool| {
            let whitener = Whitener::new(&rows, noise, cleaned);
            let nuisance = Nuisance::wide(self, &loading, noise, &freedom);
            let mut wide = Metric::new(whitener, nuisance);
            let mut white = raw.clone();
            wide.whitener.whiten_one(&mut white);
            if sized {
                noise.shared_swing_deg = wide.shared_swing_deg(&white, self.data.on_board_wind);
                wide.resize_swing(noise.shared_swing_deg);
            }
            let coefficients = wide.coefficients(&white);
            let out = wide.less(&raw, &coefficients, &self.data.used);
            (
                out,
                coefficients[coefficients.len() - freedom.sd.len()..].to_vec(),
            )
        };
        for round in 0..effort.rounds {
            cleaned = clean(&mut noise, &cleaned, round > 0).0;
            let plain = |n: &NoiseModel| noise::log_likelihood(&rows, n, &cleaned) + n.ln_prior();
            noise = noise::fit(&rows, &noise, 10, self.threads, &plain);
        }
        let (left, at) = clean(&mut noise, &cleaned, true);
        if effort.marginal_steps > 0 {
            let value = |n: &NoiseModel| freedom.marginal(&rows, n, &left, &at) + n.ln_prior();
            noise = noise::fit(&rows, &noise, effort.marginal_steps, self.threads, &value);
        }
        cleaned = clean(&mut noise, &left, true).0;
        let whitener = Whitener::new(&rows, &noise, &cleaned);
        let wide = Metric::new(whitener, Nuisance::wide(self, &loading, &noise, &freedom));
        let mut white = raw.clone();
        wide.whitener.whiten_one(&mut white);
        let log_score = wide.log_likelihood(&white, &cleaned) + noise.ln_prior();
        Wide {
            noise,
            prediction,
            loading,
            cleaned,
            log_score,
        }
    }

    /// A model at about its best under a given noise, with nothing else free.
    pub fn under(&self, start: &Model, noise: &NoiseModel) -> Model {
        self.under_from(start, &self.metric_under(start, noise).0, noise)
    }

    /// The same from where the metric is known.
    pub fn under_from(&self, start: &Model, metric: &Metric, noise: &NoiseModel) -> Model {
        let nearer = self.descend(start, metric, 4);
        self.descend(&nearer, &self.metric_under(&nearer, noise).0, 4)
    }

    /// Log probability of a model where it stands under a given noise, with nothing else free, nats,
    /// and the metric there.
    pub fn nats_under(&self, model: &Model, noise: &NoiseModel) -> (f64, Metric) {
        let (metric, residual) = self.metric_under(model, noise);
        let mut white = residual.clone();
        metric.whitener.whiten_one(&mut white);
        let nats = metric.log_likelihood(&white, &residual) + model.ln_prior();
        (nats, metric)
    }

    /// The metric at a model under a given noise, and the residual there.
    fn metric_under(&self, model: &Model, noise: &NoiseModel) -> (Metric, Vec<f64>) {
        let prediction = self.predict(model);
        let loading = self.loading(model, &prediction);
        let residual = self.data.residual(&prediction.reading);
        let whitener = Whitener::new(&self.rows(&loading), noise, &residual);
        let nuisance = Nuisance::new(self, model, &prediction, &loading, noise);
        (Metric::new(whitener, nuisance), residual)
    }

    /// Puts together what is known at a model.
    fn conclude(
        &self,
        model: Model,
        prediction: Prediction,
        noise: NoiseModel,
        loading: Vec<Loading>,
        metric: Arc<Metric>,
        scale: Scale,
    ) -> Fitted {
        let (residual, derivatives) = self.whitened(&model, &prediction.reading, &metric);
        let log_score = scale.nothing_nats - 0.5 * metric.square(&residual);
        let (centre, precision) = prior_of(&model, &metric);
        let n = model.dimension();
        let (gram, score) = normal_equations(&residual, &derivatives, &metric);
        let posterior =
            posterior(&gram, &score, &centre, &precision).unwrap_or_else(|| empty(&precision));
        // The nuisance is integrated over in the score already.
        let own = posterior.covariance.view((0, 0), (n, n)).into_owned();
        let log_evidence = log_score - (metric.half_log_det - scale.volume)
            + model.ln_prior()
            + 0.5 * n as f64 * std::f64::consts::TAU.ln()
            + 0.5 * log_det(&own);
        Fitted {
            model,
            prediction,
            noise,
            loading,
            metric,
            residual,
            derivatives,
            centre,
            precision,
            posterior,
            scale,
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

fn empty(precision: &DVector<f64>) -> Posterior {
    let n = precision.len();
    let covariance = DMatrix::from_fn(n, n, |i, j| if i == j { 1.0 / precision[i] } else { 0.0 });
    Posterior {
        mean: DVector::zeros(n),
        covariance,
    }
}

/// Prior centres as steps from where the model stands, and precisions, of free parameters and
/// then of the nuisance.
fn prior_of(model: &Model, metric: &Metric) -> (DVector<f64>, DVector<f64>) {
    let n = model.dimension();
    let sd = &metric.nuisance.sd;
    let all = n + sd.len();
    (
        DVector::from_fn(all, |k, _| {
            if k < n {
                model.free[k].centre - model.coordinate(k)
            } else {
                0.0
            }
        }),
        DVector::from_fn(all, |k, _| {
            if k < n {
                model.free[k].sd.powi(-2)
            } else {
                sd[k - n].powi(-2)
            }
        }),
    )
}

/// Inner products of whitened derivatives and then the metric's own columns, with each other and
/// with the residual.
fn normal_equations(
    residual: &[f64],
    derivatives: &[Vec<f64>],
    metric: &Metric,
) -> (DMatrix<f64>, DVector<f64>) {
    let columns = metric.after(derivatives);
    let (n, own) = (columns.len(), derivatives.len());
    let mut gram = DMatrix::zeros(n, n);
    gram.view_mut((own, own), (n - own, n - own))
        .copy_from(&metric.gram);
    let cross = products(derivatives, &columns);
    for i in 0..own {
        for j in 0..n {
            gram[(i, j)] = cross[(i, j)];
            gram[(j, i)] = cross[(i, j)];
        }
    }
    (gram, scores(&columns, residual))
}

/// The first of four ever shorter steps that leads to something `better`, and what that is.
pub(crate) fn moved_to_better<T>(
    model: &Model,
    step: &DVector<f64>,
    mut better: impl FnMut(&Model) -> Option<T>,
) -> Option<(Model, T)> {
    let mut scale = limit(model, step);
    for _ in 0..4 {
        let mut moved = model.clone();
        for k in 0..model.dimension() {
            moved.set_coordinate(k, model.coordinate(k) + scale * step[k]);
        }
        if let Some(found) = better(&moved) {
            return Some((moved, found));
        }
        scale *= 0.3;
    }
    None
}

/// Part of a step that keeps every parameter within reach of its prior.
fn limit(model: &Model, step: &DVector<f64>) -> f64 {
    let longest = (0..model.dimension())
        .map(|k| (step[k] / model.free[k].sd.min(model.spec_of(k).prior_sd)).abs())
        .fold(0.0f64, f64::max);
    if longest > LONGEST_STEP {
        LONGEST_STEP / longest
    } else {
        1.0
    }
}
