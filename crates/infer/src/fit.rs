//! The fit: the most probable unknowns, error of form and swing of the axis, by Gauss-Newton
//! steps under the noise's own metric, and the linear problem there, from which evidence and
//! standard deviations follow.

use crate::InferError;
use crate::form::{Basis, SWING, Sizes};
use crate::maximise::maximise;
use crate::noise::{Loadings, Noise, Whitener, log_likelihood};
use crate::policy::Policy;
use crate::rows::{ForwardModel, PlumePlace, Prediction, Rows};
use nalgebra::{Cholesky, DMatrix, DVector, Dyn};

/// Least size of an error of form or swing: as good as none, and its precision is still a number.
const LEAST_SIZE: f64 = 1e-4;
/// Differences for derivatives: part of a prior's standard deviation, and degrees of the axis.
const DIFFERENCE_SD: f64 = 1e-3;
const DIFFERENCE_DEG: f64 = 0.05;
/// Longest step of a weight, in its own standard deviations.
const LONGEST_WEIGHT_SD: f64 = 2.0;
/// A step that does not gain is made shorter by this, down to the shortest part.
const SHORTER: f64 = 0.4;
const SHORTEST_PART: f64 = 1e-3;
/// A row counts as in the plume where the plume's part is more than this of its largest.
const IN_PLUME: f64 = 0.02;
/// A row's plume is nothing below this part of its largest.
const NO_PLUME: f64 = 1e-9;
/// Most steps of one search for the noise.
const NOISE_STEPS: usize = 25;

/// What is to be explained, by what, under which rules.
#[derive(Debug)]
pub struct Problem<'a, M> {
    pub(crate) model: &'a M,
    pub(crate) rows: &'a Rows,
    pub(crate) policy: &'a Policy,
    pub(crate) sensor_sd: f64,
    asked: &'a [PlumePlace],
    /// Bumps of a swing alone, which those of every basis end with, and their values, row after row.
    pub(crate) swing: Basis,
    pub(crate) swing_bumps: Vec<f64>,
}

/// Values of all that is unknown but the noise.
#[derive(Debug, Clone, PartialEq)]
pub struct Point {
    /// The model's unknowns.
    pub at: Vec<f64>,
    /// Weights of the error of form and of the swing.
    pub weights: Vec<f64>,
}

/// The most probable point under given noise and sizes, and the linear problem there.
#[derive(Debug, Clone)]
pub struct Fit {
    /// The point.
    pub point: Point,
    /// The noise.
    pub noise: Noise,
    /// Sizes of error of form and swing under which the point was found.
    pub sizes: Sizes,
    /// Bumps of error of form and swing.
    pub basis: Basis,
    /// Factor on the variance of each row's white noise: above one at a spike.
    pub inflation: Vec<f64>,
    loadings: Loadings,
    misfit: Vec<f64>,
    pub(crate) linear: Linear,
}

/// Whitened products of the columns [unknowns, weights] and the misfit at a point.
#[derive(Debug, Clone)]
pub(crate) struct Linear {
    pub information: DMatrix<f64>,
    pub projection: DVector<f64>,
    pub misfit_sq: f64,
    pub ln_normalisation: f64,
}

/// What misfits are measured with, held while a fit steps.
pub(crate) struct Metric {
    pub loadings: Loadings,
    whitener: Whitener,
    inflation: Vec<f64>,
}

/// A model linearised at a point.
struct Linearised {
    linear: Linear,
    /// The bumps' values, row after row.
    bumps: Vec<f64>,
    misfit: Vec<f64>,
    /// Minus the density of the point, nats, up to a constant.
    cost: f64,
}

impl<'a, M: ForwardModel> Problem<'a, M> {
    /// `rows` to be explained by `model` under the rules of `policy`. `sensor_sd` is the standard
    /// deviation of the sensor's own noise, in the unit of the readings; `asked` are places of which
    /// something is to be told besides those that were read.
    pub fn new(
        model: &'a M,
        rows: &'a Rows,
        policy: &'a Policy,
        sensor_sd: f64,
        asked: &'a [PlumePlace],
    ) -> Self {
        let swing = Basis::of_swing(rows.time_s(), policy);
        let mut swing_bumps = vec![0.0; rows.len() * swing.len()];
        for (out, time_s) in swing_bumps.chunks_exact_mut(swing.len()).zip(rows.time_s()) {
            swing.fill_swing(*time_s, out);
        }
        Self {
            model,
            rows,
            policy,
            sensor_sd,
            asked,
            swing,
            swing_bumps,
        }
    }

    /// Number of the model's unknowns.
    pub(crate) fn unknowns(&self) -> usize {
        self.model.priors().len()
    }

    /// The noise that is most probable before any reading.
    pub(crate) fn noise_beforehand(&self) -> Noise {
        Noise::from_ln(self.noise_prior().map(|(mean, _)| mean))
    }

    fn noise_prior(&self) -> [(f64, f64); Noise::PARAMETERS] {
        let median = self.policy.noise_median;
        let scaled = Noise {
            white: median.white * self.sensor_sd,
            slow: median.slow * self.sensor_sd,
            ..median
        };
        let (mean, sd) = (scaled.ln(), self.policy.noise_ln_sd);
        std::array::from_fn(|k| (mean[k], sd[k]))
    }

    /// Density of the noise beforehand, up to a constant, nats.
    pub(crate) fn ln_noise_prior(&self, noise: &Noise) -> f64 {
        let ln = noise.ln();
        let z = |(k, (mean, sd)): (usize, (f64, f64))| ((ln[k] - mean) / sd).powi(2);
        -0.5 * self
            .noise_prior()
            .into_iter()
            .enumerate()
            .map(z)
            .sum::<f64>()
    }

    /// Bumps over the readings in the plume of a point and over what is asked.
    pub(crate) fn basis(&self, point: &Point) -> Result<Basis, InferError> {
        let there = self.model.predict(&point.at, &self.turns(point))?;
        let places = self.model.places(&point.at)?;
        let most = there.plume.iter().fold(0.0f64, |m, p| m.max(p.abs()));
        let read = places.iter().zip(&there.plume);
        let read = read
            .filter(|(_, p)| p.abs() > IN_PLUME * most)
            .map(|(place, _)| *place);
        let asked = self.asked.iter().copied();
        Ok(Basis::over(
            read.chain(asked),
            self.rows.time_s(),
            self.policy,
        ))
    }

    /// Turn of the axis at every row, degrees: the swing's weights are always the last.
    fn turns(&self, point: &Point) -> Vec<f64> {
        let n = self.swing.len();
        let weights = &point.weights[point.weights.len().saturating_sub(n)..];
        if weights.iter().all(|w| *w == 0.0) {
            return vec![0.0; self.rows.len()];
        }
        let turn = |bumps: &[f64]| bumps.iter().zip(weights).map(|(b, w)| b * w).sum();
        self.swing_bumps.chunks_exact(n).map(turn).collect()
    }

    /// The most probable point from `start` under `noise` and `sizes`.
    ///
    /// # Errors
    /// Values that the model refuses.
    pub(crate) fn fit(
        &self,
        start: &Point,
        basis: &Basis,
        noise: Noise,
        sizes: Sizes,
    ) -> Result<Fit, InferError> {
        let mut point = start.clone();
        let missing = basis.len().saturating_sub(point.weights.len());
        point
            .weights
            .splice(0..0, std::iter::repeat_n(0.0, missing));
        self.settle(point, basis, noise, sizes, vec![1.0; self.rows.len()])
    }

    /// The same point under the noise that it makes most probable, settled again.
    ///
    /// # Errors
    /// Values that the model refuses.
    pub(crate) fn refit_noise(&self, fit: &Fit) -> Result<Fit, InferError> {
        let prior = self.noise_prior();
        let used = self.rows.used_count() as f64;
        // The white noise is known to every reading, the rest to few.
        let curvature =
            std::array::from_fn(|k| prior[k].1.powi(-2) + if k == 0 { used } else { 0.03 * used });
        let ln = maximise(fit.noise.ln(), curvature, NOISE_STEPS, |ln| {
            let noise = Noise::from_ln(*ln);
            let (loadings, inflation) = (&fit.loadings, &fit.inflation);
            log_likelihood(self.rows, &noise, loadings, inflation, &fit.misfit)
                + self.ln_noise_prior(&noise)
        });
        let (point, inflation) = (fit.point.clone(), fit.inflation.clone());
        self.settle(point, &fit.basis, Noise::from_ln(ln), fit.sizes, inflation)
    }

    /// Steps under a metric that is held, and a metric made anew at the point that they come to, until
    /// the point's density stays. A metric that followed each step would make variances small where
    /// the plume is not, and chase it away.
    fn settle(
        &self,
        start: Point,
        basis: &Basis,
        noise: Noise,
        sizes: Sizes,
        inflation: Vec<f64>,
    ) -> Result<Fit, InferError> {
        let precision = self.precision(basis, sizes);
        let mut point = start;
        let mut metric = self.metric(&point, basis, &noise, &inflation)?;
        let mut density = f64::NEG_INFINITY;
        let mut left = self.policy.most_steps;
        let mut here = self.linearised(&point, basis, &precision, &metric)?;
        while left > 0 {
            let used;
            (point, here, used) = self.steps(point, here, basis, &precision, &metric, left)?;
            left -= used.min(left);
            let spikes = self.spikes(&point, &here, &metric)?;
            metric = self.metric(&point, basis, &noise, &spikes)?;
            here = self.linearised(&point, basis, &precision, &metric)?;
            let reached = here.linear.ln_normalisation - here.cost;
            let settled = (reached - density).abs() < self.policy.settled_nats;
            density = reached;
            if settled {
                break;
            }
        }
        Ok(Fit {
            point,
            noise,
            sizes,
            basis: basis.clone(),
            inflation: metric.inflation,
            loadings: metric.loadings,
            misfit: here.misfit,
            linear: here.linear,
        })
    }

    /// Steps under one metric until they gain nothing: the point, the model linearised there, and the
    /// number of steps.
    fn steps(
        &self,
        mut point: Point,
        mut here: Linearised,
        basis: &Basis,
        precision: &DVector<f64>,
        metric: &Metric,
        most_steps: usize,
    ) -> Result<(Point, Linearised, usize), InferError> {
        for k in 0..most_steps {
            let Some(next) = self.step(&point, basis, precision, metric, &here) else {
                return Ok((point, here, k + 1));
            };
            let before = here.cost;
            point = next;
            here = self.linearised(&point, basis, precision, metric)?;
            if before - here.cost < self.policy.settled_nats {
                return Ok((point, here, k + 1));
            }
        }
        Ok((point, here, most_steps))
    }

    /// Steps under a metric of somebody's own.
    pub(crate) fn steps_under(
        &self,
        start: &Point,
        basis: &Basis,
        sizes: Sizes,
        metric: &Metric,
    ) -> Result<Point, InferError> {
        let precision = self.precision(basis, sizes);
        let steps = self.policy.most_steps;
        let here = self.linearised(start, basis, &precision, metric)?;
        let settled = self.steps(start.clone(), here, basis, &precision, metric, steps)?;
        Ok(settled.0)
    }

    /// Precision of unknowns and weights beforehand.
    pub(crate) fn precision(&self, basis: &Basis, sizes: Sizes) -> DVector<f64> {
        let unknowns = self.model.priors().iter().map(|p| p.sd.powi(-2));
        let weights = basis
            .coordinates()
            .map(|c| sizes[c].max(LEAST_SIZE).powi(-2));
        DVector::from_iterator(self.unknowns() + basis.len(), unknowns.chain(weights))
    }

    /// How far a point is from the middle of what is known beforehand.
    pub(crate) fn offset_of(&self, point: &Point) -> DVector<f64> {
        let unknowns = point
            .at
            .iter()
            .zip(self.model.priors())
            .map(|(x, p)| x - p.mean);
        let all = unknowns.chain(point.weights.iter().copied());
        DVector::from_iterator(point.at.len() + point.weights.len(), all)
    }

    /// Minus the density beforehand of unknowns and weights, nats, up to a constant.
    fn prior_cost(&self, point: &Point, precision: &DVector<f64>) -> f64 {
        let offset = self.offset_of(point);
        0.5 * precision.dot(&offset.component_mul(&offset))
    }

    /// The next point: the longest part of the Gauss-Newton step that gains; none where none does.
    fn step(
        &self,
        point: &Point,
        basis: &Basis,
        precision: &DVector<f64>,
        metric: &Metric,
        here: &Linearised,
    ) -> Option<Point> {
        let offset = self.offset_of(point);
        let (step, _, _) = here.linear.solve(precision, &offset)?;
        let mut part = 1.0 / self.excess(&step, precision);
        while part > SHORTEST_PART {
            let mut next = point.clone();
            for (x, s) in next.at.iter_mut().chain(&mut next.weights).zip(step.iter()) {
                *x += part * s;
            }
            let cost = self.cost(&next, basis, precision, metric, here);
            if cost.is_some_and(|cost| cost < here.cost) {
                return Some(next);
            }
            part *= SHORTER;
        }
        None
    }

    /// By what a step exceeds what a linear problem can be trusted for; one where it does not.
    fn excess(&self, step: &DVector<f64>, precision: &DVector<f64>) -> f64 {
        let unknowns = self.unknowns();
        let of = |(k, (s, p)): (usize, (&f64, &f64))| {
            let longest = if k < unknowns {
                self.policy.longest_step_sd
            } else {
                LONGEST_WEIGHT_SD
            };
            s.abs() * p.sqrt() / longest
        };
        step.iter()
            .zip(precision.iter())
            .enumerate()
            .map(of)
            .fold(1.0, f64::max)
    }

    /// Minus the density of a point near where the model was linearised, nats, up to a constant; none
    /// where the model refuses the point.
    fn cost(
        &self,
        next: &Point,
        basis: &Basis,
        precision: &DVector<f64>,
        metric: &Metric,
        here: &Linearised,
    ) -> Option<f64> {
        let there = self.model.predict(&next.at, &self.turns(next)).ok()?;
        let n = basis.len();
        let misfit = |i: usize| {
            if !self.rows.is_used(i) {
                return 0.0;
            }
            let grown = basis.factor(&here.bumps[i * n..(i + 1) * n], &next.weights) - 1.0;
            self.rows.measured()[i] - there.reading[i] - there.plume[i] * grown
        };
        let mut misfit: Vec<f64> = (0..self.rows.len()).map(misfit).collect();
        metric.whitener.whiten(self.rows, &mut misfit, 1);
        let square: f64 = misfit.iter().map(|w| w * w).sum();
        let cost = 0.5 * square + self.prior_cost(next, precision);
        cost.is_finite().then_some(cost)
    }

    pub(crate) fn metric(
        &self,
        point: &Point,
        basis: &Basis,
        noise: &Noise,
        inflation: &[f64],
    ) -> Result<Metric, InferError> {
        Ok(self.metric_of(self.loadings(point, basis, noise)?, noise, inflation))
    }

    pub(crate) fn metric_of(&self, loadings: Loadings, noise: &Noise, inflation: &[f64]) -> Metric {
        Metric {
            whitener: Whitener::new(self.rows, noise, &loadings, inflation),
            loadings,
            inflation: inflation.to_vec(),
        }
    }

    /// What fluctuation and wander are in proportion to at every row: root mean squares over the
    /// wander of the axis, as a plume that swings is met where its mean is not.
    fn loadings(
        &self,
        point: &Point,
        basis: &Basis,
        noise: &Noise,
    ) -> Result<Loadings, InferError> {
        let (rows, n) = (self.rows.len(), basis.len());
        let turns = self.turns(point);
        let turned = |by: f64| -> Result<Prediction, InferError> {
            let turns: Vec<f64> = turns.iter().map(|t| t + by).collect();
            self.model.predict(&point.at, &turns)
        };
        // Gauss-Hermite quadrature of three nodes: 0 and ±√3 standard deviations.
        let aside = 3f64.sqrt() * noise.wander_deg;
        let mut plume_sq = vec![0.0; rows];
        for (by, weight) in [(-aside, 1.0 / 6.0), (0.0, 2.0 / 3.0), (aside, 1.0 / 6.0)] {
            for (sum, plume) in plume_sq.iter_mut().zip(turned(by)?.plume) {
                *sum += weight * plume * plume;
            }
        }
        let (left, right) = (turned(-DIFFERENCE_DEG)?, turned(DIFFERENCE_DEG)?);
        let mut plume: Vec<f64> = plume_sq.into_iter().map(f64::sqrt).collect();
        let bumps = self.bumps(point, basis, &plume)?;
        let mut per_degree = Vec::with_capacity(rows);
        for i in 0..rows {
            let factor = basis.factor(&bumps[i * n..(i + 1) * n], &point.weights);
            let grown = (right.plume[i] - left.plume[i]) * (factor - 1.0);
            let slope = right.reading[i] - left.reading[i] + grown;
            per_degree.push(slope / (2.0 * DIFFERENCE_DEG));
            plume[i] *= factor;
        }
        Ok(Loadings { plume, per_degree })
    }

    fn linearised(
        &self,
        point: &Point,
        basis: &Basis,
        precision: &DVector<f64>,
        metric: &Metric,
    ) -> Result<Linearised, InferError> {
        let (n, unknowns, weights) = (self.rows.len(), self.unknowns(), basis.len());
        let columns = unknowns + weights + 1;
        let turns = self.turns(point);
        let here = self.model.predict(&point.at, &turns)?;
        let bumps = self.bumps(point, basis, &here.plume)?;
        let factors: Vec<f64> = bumps
            .chunks_exact(weights)
            .map(|bumps| basis.factor(bumps, &point.weights))
            .collect();
        let grown =
            |there: &Prediction, i: usize| there.reading[i] + there.plume[i] * (factors[i] - 1.0);
        let expected: Vec<f64> = (0..n).map(|i| grown(&here, i)).collect();
        let mut matrix = vec![0.0; n * columns];
        for (k, prior) in self.model.priors().iter().enumerate() {
            let difference = DIFFERENCE_SD * prior.sd.min(1.0 + point.at[k].abs());
            let mut aside = point.at.clone();
            aside[k] += difference;
            let there = self.model.predict(&aside, &turns)?;
            for i in 0..n {
                matrix[i * columns + k] = (grown(&there, i) - expected[i]) / difference;
            }
        }
        let plume: Vec<f64> = here
            .plume
            .iter()
            .zip(&factors)
            .map(|(p, f)| p * f)
            .collect();
        let form = basis.of_form();
        let mut misfit = vec![0.0; n];
        for i in 0..n {
            let row = &mut matrix[i * columns..(i + 1) * columns];
            let bumps = &bumps[i * weights..(i + 1) * weights];
            for (k, (value, bump)) in row[unknowns..].iter_mut().zip(bumps).enumerate() {
                let slope = if k < form {
                    plume[i]
                } else {
                    metric.loadings.per_degree[i]
                };
                *value = slope * bump;
            }
            if self.rows.is_used(i) {
                misfit[i] = self.rows.measured()[i] - expected[i];
                row[columns - 1] = misfit[i];
            }
        }
        metric.whitener.whiten(self.rows, &mut matrix, columns);
        let linear = Linear::of(&matrix, columns, metric.whitener.ln_normalisation);
        Ok(Linearised {
            cost: 0.5 * linear.misfit_sq + self.prior_cost(point, precision),
            linear,
            bumps,
            misfit,
        })
    }

    /// The bumps' values at every row; none of the error of form where there is no plume to speak of.
    fn bumps(&self, point: &Point, basis: &Basis, plume: &[f64]) -> Result<Vec<f64>, InferError> {
        let n = basis.len();
        let mut out = vec![0.0; self.rows.len() * n];
        let most = plume.iter().fold(0.0f64, |m, p| m.max(p.abs()));
        let places = self.model.places(&point.at)?;
        let swing = self.swing_bumps.chunks_exact(self.swing.len());
        let rows = out.chunks_exact_mut(n).zip(swing);
        for (((row, swing), place), plume) in rows.zip(&places).zip(plume) {
            let (form, of_swing) = row.split_at_mut(basis.of_form());
            of_swing.copy_from_slice(swing);
            if plume.abs() > NO_PLUME * most {
                basis.fill_form(place, form);
            }
        }
        Ok(out)
    }

    /// Factors on the variance of rows that are spikes: beyond what normal noise shows, and short
    /// against a crossing of the plume.
    fn spikes(
        &self,
        point: &Point,
        here: &Linearised,
        metric: &Metric,
    ) -> Result<Vec<f64>, InferError> {
        let mut whitened = here.misfit.clone();
        metric.whitener.whiten(self.rows, &mut whitened, 1);
        let far = |i: usize| whitened[i].abs() > self.policy.spike_sd;
        let mut inflation = vec![1.0; self.rows.len()];
        let places = self.model.places(&point.at)?;
        for range in self.rows.series() {
            let mut i = range.start;
            while i < range.end {
                let first = i;
                while i < range.end && far(i) {
                    i += 1;
                }
                if i > first && self.is_short(&places, range.clone(), first, i) {
                    for k in first..i {
                        // The share of the white noise in what a row was expected to be off by.
                        let own = self
                            .rows
                            .stated_sd(k)
                            .unwrap_or(metric.whitener.noise.white);
                        let share = (metric.whitener.innovation_sd(k) / own).powi(2);
                        inflation[k] = (whitened[k] / self.policy.spike_sd).powi(2) * share;
                    }
                }
                i = i.max(first + 1);
            }
        }
        Ok(inflation)
    }

    /// Whether rows `first..end` last less than the part of a crossing that a spike may take. One row
    /// by itself is always short: a crossing that one row alone meets cannot be told from a spike.
    fn is_short(
        &self,
        places: &[PlumePlace],
        series: std::ops::Range<usize>,
        first: usize,
        end: usize,
    ) -> bool {
        if end - first <= 1 {
            return true;
        }
        let time_s = self.rows.time_s();
        let (before, after) = (first.max(series.start + 1) - 1, end.min(series.end - 1));
        let lasted_s = time_s[end - 1] - time_s[first];
        let passed_s = time_s[after] - time_s[before];
        let across = (places[after].across_sigmas - places[before].across_sigmas).abs();
        let above = (places[after].above_sigmas - places[before].above_sigmas).abs();
        let crossed = across.hypot(above);
        crossed.is_finite() && lasted_s * crossed < self.policy.spike_part_of_crossing * passed_s
    }
}

impl Linear {
    /// Products of whitened columns, row after row, of which the last is the misfit.
    fn of(matrix: &[f64], columns: usize, ln_normalisation: f64) -> Self {
        let rows = matrix.len() / columns;
        let whitened = nalgebra::DMatrixView::from_slice(matrix, columns, rows);
        let products = whitened * whitened.transpose();
        let n = columns - 1;
        Self {
            information: products.view((0, 0), (n, n)).into_owned(),
            projection: products.view((0, n), (n, 1)).column(0).into_owned(),
            misfit_sq: products[(n, n)],
            ln_normalisation,
        }
    }

    /// Most probable step from the point, covariance's factor and log evidence, where `precision`
    /// is that of the priors and `offset` how far the point is from their middle.
    pub fn solve(
        &self,
        precision: &DVector<f64>,
        offset: &DVector<f64>,
    ) -> Option<(DVector<f64>, Cholesky<f64, Dyn>, f64)> {
        let mut information = self.information.clone();
        for k in 0..precision.len() {
            information[(k, k)] += precision[k];
        }
        let cholesky = Cholesky::new(information)?;
        let pull = &self.projection - precision.component_mul(offset);
        let step = cholesky.solve(&pull);
        let cost = self.misfit_sq + precision.dot(&offset.component_mul(offset)) - pull.dot(&step);
        let ln_widths: f64 = precision.iter().map(|p| 0.5 * p.ln()).sum();
        let ln_determinant: f64 = cholesky.l_dirty().diagonal().iter().map(|d| d.ln()).sum();
        let evidence = self.ln_normalisation - 0.5 * cost + ln_widths - ln_determinant;
        Some((step, cholesky, evidence))
    }
}

/// Sizes of nothing but a swing of so many degrees.
pub(crate) fn swing_alone(deg: f64) -> Sizes {
    let mut sizes = [0.0; crate::form::COORDINATES];
    sizes[SWING] = deg;
    sizes
}
