//! The fit: the most probable unknowns, discrepancy and axis drift by Gauss-Newton steps under the metric of the noise,
//! and the linearised problem there, which gives evidence and standard deviations.

use crate::InferError;
use crate::discrepancy::{AXIS_DRIFT, Active, Basis, Growth, Sizes, precision_of};
use crate::evidence::{Known, Layout, Products};
use crate::fluctuation::{Fluctuation, FluctuationLaw};
use crate::maximise::maximise;
use crate::noise::{Loadings, Means, Noise, Whitener, log_likelihood};
use crate::policy::Policy;
use crate::rows::{AxisTurn, ForwardModel, PlumePlace, Prediction, Rows};
use crate::slopes::slopes;
use nalgebra::{Cholesky, DMatrix, DVector};
use std::borrow::Cow;
use std::ops::Range;
use std::sync::Arc;

/// Difference for derivatives, degrees of the axis.
const DIFFERENCE_DEG: f64 = 0.05;
/// Longest step of a weight, in its own standard deviations.
const LONGEST_WEIGHT_SD: f64 = 2.0;
/// Most tries to shorten a step until the next one promises less.
const TRIES: usize = 3;
/// Most factor from the part of one step to that of the next, and the least part.
const MOST_CHANGE: f64 = 4.0;
const LEAST_PART: f64 = 0.1;
/// Factor that shortens a step without gain, and its shortest part.
const SHORTER: f64 = 0.4;
const SHORTEST_PART: f64 = 1e-3;
/// A row counts as in the plume where the plume's part is more than this of its largest.
const IN_PLUME: f64 = 0.02;
/// A row's plume is nothing below this part of its largest.
const NO_PLUME: f64 = 1e-9;
/// A spike's neighbours are off by less than this part of it.
const OUT_OF_ITS_NEIGHBOURS: f64 = 0.5;
/// White noise is at least this part of the sensor's own: none is a hundred times better than it is said to
/// be, and readings without any would leave nothing to divide by.
const LEAST_WHITE: f64 = 0.01;
/// Rows whose columns are whitened at once: with a hundred columns they stay in a second-level cache.
const ROWS_AT_ONCE: usize = 256;
/// Most steps of one search for the noise.
const NOISE_STEPS: usize = 25;

/// A model, the readings that it should explain, and the rules.
#[derive(Debug)]
pub struct Problem<'a, M> {
    pub(crate) model: &'a M,
    pub(crate) rows: &'a Rows,
    pub(crate) policy: &'a Policy,
    pub(crate) sensor_sd: f64,
    pub(crate) asked: &'a [PlumePlace],
    pub(crate) turning: Arc<AxisDrift>,
    /// Distribution of the concentration fluctuation.
    pub(crate) fluctuation: FluctuationLaw,
}

/// Effect of an axis drift on the rows, which all sets of mechanisms share.
#[derive(Debug)]
pub(crate) struct AxisDrift {
    /// Basis functions of an axis drift alone, which those of every basis end with, and their values, row after row.
    pub axis_drift: Basis,
    pub basis_functions: Vec<f64>,
    /// When the first air that was met left the source, s.
    from_s: f64,
    /// Their means over the rows, and their slopes over time.
    steady: [Vec<f64>; 2],
}

impl AxisDrift {
    fn new(model: &impl ForwardModel, rows: &Rows, policy: &Policy) -> Self {
        let left_s = |row: usize| rows.time_s()[row] - model.under_way_s(row);
        let from_s = (0..rows.len()).map(left_s).fold(f64::INFINITY, f64::min);
        let axis_drift = Basis::of_axis_drift(rows.time_s(), from_s, policy);
        let count = axis_drift.functions_per_direction();
        let mut basis_functions = vec![0.0; rows.len() * count];
        for (row, out) in basis_functions.chunks_exact_mut(count).enumerate() {
            axis_drift.fill_axis_drift_since(rows.time_s()[row], model.under_way_s(row), out);
        }
        Self {
            steady: steady(rows.time_s(), &basis_functions, count),
            axis_drift,
            basis_functions,
            from_s,
        }
    }
}

/// Values of everything unknown except the noise.
#[derive(Debug, Clone, PartialEq)]
pub struct Point {
    /// The model's unknowns.
    pub at: Vec<f64>,
    /// Weights of the discrepancy and of the axis drift.
    pub weights: Vec<f64>,
}

/// The most probable point under given noise and sizes.
#[derive(Debug, Clone)]
pub struct Fit {
    /// The point.
    pub point: Point,
    /// The noise.
    pub noise: Noise,
    /// Sizes of discrepancy and axis drift under which the point was found.
    pub sizes: Sizes,
    /// Basis functions of discrepancy and axis drift.
    pub basis: Basis,
    /// Factor on the variance of each row's white noise: above one at a spike.
    pub inflation: Vec<f64>,
    loadings: Loadings,
    fluctuation: Fluctuation,
    /// The model near the point; none where the point is another's.
    tangent: Option<Arc<Tangent>>,
    /// Reading minus prediction of each row; zero for unused rows.
    pub misfit: Vec<f64>,
    /// The same, linear in every part of the noise, so that whitened it is a sum of squares.
    pub(crate) linear_misfit: Vec<f64>,
}

/// The metric of misfits, constant during the steps of a fit.
pub(crate) struct Metric {
    pub loadings: Loadings,
    /// The same of a plume that does not fluctuate, and that plume.
    calm: (Loadings, Vec<f64>),
    fluctuation: Fluctuation,
    whitener: Whitener,
    inflation: Vec<f64>,
}

/// A model linearised at a point.
struct Linearised {
    /// Products of the columns of unknowns, weights that may differ from zero, and misfit.
    products: Products,
    columns: usize,
    local: Local,
    /// Minus the density of the point, nats, up to a constant.
    cost: f64,
}

/// A Gauss-Newton step, no longer than the linearised problem is valid.
struct NewtonStep {
    /// Of the unknowns and of the weights that may differ from zero.
    step: DVector<f64>,
    /// Nats that the linearised problem promises for the whole step.
    promised_nats: f64,
    information: DMatrix<f64>,
}

impl NewtonStep {
    /// The part of this step to be taken where a `part` of the step `before` led here: what remains of a step tells by how
    /// much it was too long or too short (Irons and Tuck 1969).
    fn relaxation(&self, before: &Self, part: f64) -> f64 {
        let bend = &before.step - &self.step;
        let weighted = &self.information * &bend;
        let relaxed = part * before.step.dot(&weighted) / bend.dot(&weighted);
        let relaxed = if relaxed > 0.0 {
            relaxed.clamp(part / MOST_CHANGE, part * MOST_CHANGE)
        } else {
            2.0 * part
        };
        relaxed.clamp(LEAST_PART, 1.0)
    }
}

/// A point moved by a part of a step.
fn moved(point: &Point, shape: &Shape<'_>, step: &DVector<f64>, part: f64) -> Point {
    let mut next = point.clone();
    let (unknowns, weights) = step.as_slice().split_at(next.at.len());
    for (x, s) in next.at.iter_mut().zip(unknowns) {
        *x += part * s;
    }
    for (k, s) in shape.active.weights().zip(weights) {
        next.weights[k] += part * s;
    }
    next
}

/// A model near a point, row by row: expensive, and independent of noise and sizes.
#[derive(Debug)]
pub(crate) struct Tangent {
    here: Prediction,
    /// Derivative of every row with respect to each unknown.
    slopes: Vec<Vec<f64>>,
}

/// A model near a point with the derivatives of the weights, row by row.
struct Local {
    tangent: Arc<Tangent>,
    /// Derivative of every row with respect to the discrepancy's exponent.
    per_discrepancy: Vec<f64>,
    /// The values of the basis functions of the discrepancy that may have weights, row after row.
    basis_functions: Vec<f64>,
    misfit: Vec<f64>,
}

/// Columns of the first unknown and of the weights that may differ from zero.
struct Columns<'p> {
    unknowns: usize,
    discrepancy: &'p [usize],
    sideways: &'p [usize],
    upward: &'p [usize],
}

impl<'p> Columns<'p> {
    /// The columns of unknowns from `unknowns` on, and of the active weights.
    fn of(active: &Active, unknowns: usize, weights: &'p [usize]) -> Self {
        let (discrepancy, axis_drift) = weights.split_at(active.of_discrepancy());
        let of_sideways = active.coordinates().filter(|c| *c == AXIS_DRIFT).count();
        let (sideways, upward) = axis_drift.split_at(of_sideways);
        Self {
            unknowns,
            discrepancy,
            sideways,
            upward,
        }
    }
}

/// Basis functions with their sizes: which may have weights, and precisions of unknowns and these weights.
struct Shape<'b> {
    basis: &'b Basis,
    sizes: Sizes,
    active: Active,
    precision: Vec<f64>,
}

impl Shape<'_> {
    fn growth(
        &self,
        basis_functions: &[f64],
        point: &Point,
        fluctuation: &Fluctuation,
    ) -> Vec<Growth> {
        growth_of(basis_functions, &self.active, point, fluctuation)
    }
}

/// Effect of discrepancy and fluctuation on the plume at every row.
fn growth_of(
    basis_functions: &[f64],
    active: &Active,
    point: &Point,
    fluctuation: &Fluctuation,
) -> Vec<Growth> {
    let n = active.of_discrepancy();
    if n == 0 {
        let factors = fluctuation.factors().iter();
        return factors.map(|f| Growth::NONE.times(*f)).collect();
    }
    let weights: Vec<f64> = active.weights().take(n).map(|k| point.weights[k]).collect();
    basis_functions
        .chunks_exact(n)
        .zip(fluctuation.factors())
        .map(|(b, f)| Basis::growth(b, &weights).times(*f))
        .collect()
}

/// The plume of a prediction with discrepancy and fluctuation.
fn grown(there: &Prediction, growth: &[Growth]) -> Vec<f64> {
    let plume = there.plume.iter().zip(growth);
    plume.map(|(p, g)| p * g.factor).collect()
}

/// Number of steady parts of an axis drift: its mean and its slope to the sides, and its mean upwards.
const STEADY: usize = 3;

/// Means of basis functions over rows, and the standard deviations over rows of the straight lines through them.
fn steady(time_s: &[f64], basis_functions: &[f64], count: usize) -> [Vec<f64>; 2] {
    let rows = time_s.len().max(1) as f64;
    let middle_s = time_s.iter().sum::<f64>() / rows;
    let square: f64 = time_s.iter().map(|t| (t - middle_s).powi(2)).sum();
    let spread_s = (square / rows).sqrt().max(f64::MIN_POSITIVE);
    let (mut mean, mut slope) = (vec![0.0; count], vec![0.0; count]);
    for (basis_functions, time_s) in basis_functions.chunks_exact(count.max(1)).zip(time_s) {
        for ((mean, slope), basis_function) in mean.iter_mut().zip(&mut slope).zip(basis_functions)
        {
            *mean += basis_function / rows;
            *slope += basis_function * (time_s - middle_s) / spread_s / rows;
        }
    }
    [mean, slope]
}

/// Whether rows differ abruptly from those before and after them. An unexpected plume rises and falls gradually, so it
/// does not count as a series of spikes.
fn stands_out(misfit: &[f64], series: Range<usize>, rows: Range<usize>) -> bool {
    let beside = |edge: usize, neighbour: Option<usize>| {
        let neighbour = neighbour.filter(|n| series.contains(n));
        neighbour
            .is_none_or(|n| misfit[n] * misfit[edge] < OUT_OF_ITS_NEIGHBOURS * misfit[edge].powi(2))
    };
    beside(rows.start, rows.start.checked_sub(1)) && beside(rows.end - 1, Some(rows.end))
}

impl<'a, M: ForwardModel> Problem<'a, M> {
    /// A problem of `rows` and `model` under the rules of `policy`. `sensor_sd` is the standard deviation of the sensor's own
    /// noise, in the unit of the readings; `asked` are further places that need a prediction.
    pub fn new(
        model: &'a M,
        rows: &'a Rows,
        policy: &'a Policy,
        sensor_sd: f64,
        asked: &'a [PlumePlace],
    ) -> Self {
        Self {
            turning: AxisDrift::new(model, rows, policy).into(),
            model,
            rows,
            policy,
            sensor_sd,
            asked,
            fluctuation: FluctuationLaw::Normal,
        }
    }

    /// Number of the model's unknowns.
    pub(crate) fn unknowns(&self) -> usize {
        self.model.priors().len()
    }

    /// The most probable noise of the prior.
    pub(crate) fn usual_noise(&self) -> Noise {
        Noise::from_ln(self.noise_prior().map(|(mean, _)| mean))
    }

    /// Noise one prior standard deviation below its median, except for the white part.
    pub(crate) fn quiet_noise(&self) -> Noise {
        let known = self.noise_prior();
        let mut ln = known.map(|(mean, _)| mean);
        for k in [1, 3, 5] {
            ln[k] -= known[k].1;
        }
        Noise::from_ln(ln)
    }

    pub(crate) fn noise_prior(&self) -> [(f64, f64); Noise::PARAMETERS] {
        let median = self.policy.noise_median;
        let scaled = Noise {
            white: median.white * self.sensor_sd,
            slow: median.slow * self.sensor_sd,
            ..median
        };
        let (mean, sd) = (scaled.ln(), self.policy.noise_ln_sd);
        std::array::from_fn(|k| (mean[k], sd[k]))
    }

    /// Log prior density of the noise up to a constant, nats.
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

    /// Basis functions over the readings in the plume of a point and over what is asked.
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
            self.turning.from_s,
            self.policy,
        ))
    }

    /// Turn of the axis at every row: the axis drift's weights are always the last.
    pub(crate) fn turns(&self, point: &Point) -> Vec<AxisTurn> {
        let n = self.turning.axis_drift.len();
        let weights = &point.weights[point.weights.len().saturating_sub(n)..];
        if weights.iter().all(|w| *w == 0.0) {
            return vec![AxisTurn::NONE; self.rows.len()];
        }
        let count = self.turning.axis_drift.functions_per_direction();
        let values = self.turning.basis_functions.chunks_exact(count);
        values.map(|values| Basis::turn(values, weights)).collect()
    }

    /// A fit to other rows with its axis drift expressed in the basis functions of these rows.
    pub(crate) fn with_own_axis_drift(&self, fit: &Fit) -> Fit {
        let turn = |(row, time_s): (usize, &f64)| {
            let under_way_s = self.model.under_way_s(row);
            fit.basis
                .turn_since(*time_s, under_way_s, &fit.point.weights)
        };
        let turns: Vec<AxisTurn> = self.rows.time_s().iter().enumerate().map(turn).collect();
        let mut out = fit.clone();
        out.tangent = None;
        out.basis = fit.basis.with_axis_drift_of(&self.turning.axis_drift);
        out.point.weights.truncate(fit.basis.of_discrepancy());
        out.point.weights.extend(self.drift_weights(&turns));
        out
    }

    /// The steady parts of the axis drift over their standard deviations: an axis drift turns to both sides and back. A steady
    /// turn is a wind from elsewhere, one that grows a wind that veers, and a steady climb another height of the plume.
    fn steady_turns(&self, basis: &Basis, weights: &[f64]) -> [f64; STEADY] {
        let axis_drift = basis.of_discrepancy()..weights.len();
        let mut out = [0.0; STEADY];
        for k in axis_drift {
            let by = self.steady_turns_by(basis, k);
            out.iter_mut()
                .zip(by)
                .for_each(|(out, by)| *out += by * weights[k]);
        }
        out
    }

    /// What a weight of one adds to them.
    fn steady_turns_by(&self, basis: &Basis, weight: usize) -> [f64; STEADY] {
        let [mean, slope] = &self.turning.steady;
        let policy = self.policy;
        match weight.checked_sub(basis.of_discrepancy()) {
            None => [0.0; STEADY],
            Some(k) if k < mean.len() => [
                mean[k] / policy.axis_drift_mean_deg,
                slope[k] / policy.axis_drift_slope_deg,
                0.0,
            ],
            Some(k) => {
                let upward = mean[k - mean.len()];
                [0.0, 0.0, upward / policy.axis_drift_mean_deg]
            }
        }
    }

    /// Rows of `columns` that say so, beside those of the readings: `places` gives weights with their columns.
    fn steady_rows(
        &self,
        basis: &Basis,
        weights: &[f64],
        columns: usize,
        places: impl Iterator<Item = (usize, usize)>,
    ) -> Vec<f64> {
        let mut rows = vec![0.0; STEADY * columns];
        for (k, place) in places {
            let by = self.steady_turns_by(basis, k);
            for (row, by) in rows.chunks_exact_mut(columns).zip(by) {
                row[place] = by;
            }
        }
        let steady = self.steady_turns(basis, weights);
        for (row, steady) in rows.chunks_exact_mut(columns).zip(steady) {
            row[columns - 1] = -steady;
        }
        rows
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
        let none = std::iter::repeat_n(0.0, missing);
        point.weights.splice(0..0, none);
        let shape = self.shape(basis, sizes);
        for (k, weight) in point.weights.iter_mut().enumerate() {
            if !shape.active.has(k) {
                *weight = 0.0;
            }
        }
        self.settle(point, &shape, noise, vec![1.0; self.rows.len()], None)
    }

    /// The same point under the noise that it makes most probable, settled again.
    ///
    /// # Errors
    /// Values that the model refuses.
    pub(crate) fn refit_noise(&self, fit: &Fit) -> Result<Fit, InferError> {
        self.refit_noise_within(fit, |noise| *noise)
    }

    /// Noise limited to the tolerated sizes.
    pub(crate) fn tolerated(&self, noise: &Noise) -> Noise {
        let most = &self.policy.noise_tolerated;
        Noise {
            white: noise.white.min(most.white * self.sensor_sd),
            slow: noise.slow.min(most.slow * self.sensor_sd),
            fluctuation: noise.fluctuation.min(most.fluctuation),
            wander_deg: noise.wander_deg.min(most.wander_deg),
            wander_sigma_z: noise.wander_sigma_z.min(most.wander_sigma_z),
            ..*noise
        }
    }

    /// The same with noise limited to the tolerated sizes.
    ///
    /// # Errors
    /// Values that the model refuses.
    pub(crate) fn refit_noise_tolerated(&self, fit: &Fit) -> Result<Fit, InferError> {
        self.refit_noise_within(fit, |noise| self.tolerated(noise))
    }

    fn refit_noise_within(
        &self,
        fit: &Fit,
        within: impl Fn(&Noise) -> Noise,
    ) -> Result<Fit, InferError> {
        let prior = self.noise_prior();
        let within = |noise: &Noise| {
            let noise = within(noise);
            let white = noise.white.max(LEAST_WHITE * self.sensor_sd);
            Noise { white, ..noise }
        };
        let used = self.rows.used_count() as f64;
        // The white noise is known to every reading, the rest to few.
        let curvature =
            std::array::from_fn(|k| prior[k].1.powi(-2) + if k == 0 { used } else { 0.03 * used });
        let ln = maximise(within(&fit.noise).ln(), curvature, NOISE_STEPS, |ln| {
            self.ln_noise_density(fit, &within(&Noise::from_ln(*ln)))
        });
        let ln = within(&Noise::from_ln(ln)).ln();
        let (point, inflation) = (fit.point.clone(), fit.inflation.clone());
        let shape = self.shape(&fit.basis, fit.sizes);
        let is_normal = self.fluctuation == FluctuationLaw::Normal;
        let tangent = fit.tangent.as_ref().filter(|_| is_normal);
        self.settle(point, &shape, Noise::from_ln(ln), inflation, tangent)
    }

    /// Log density of the noise given the misfit of a fit, up to a constant, nats.
    pub(crate) fn ln_noise_density(&self, fit: &Fit, noise: &Noise) -> f64 {
        let (loadings, inflation) = (&fit.loadings, &fit.inflation);
        log_likelihood(self.rows, noise, loadings, inflation, &fit.linear_misfit)
            + self.ln_noise_prior(noise)
    }

    fn shape<'b>(&self, basis: &'b Basis, sizes: Sizes) -> Shape<'b> {
        let active = basis.active(&sizes, self.policy);
        let unknowns = self.model.priors().iter().map(|p| p.sd.powi(-2));
        let weights = active.coordinates().map(|c| precision_of(sizes[c]));
        Shape {
            precision: unknowns.chain(weights).collect(),
            basis,
            sizes,
            active,
        }
    }

    /// The most probable point under the noise from `start`.
    fn settle(
        &self,
        start: Point,
        shape: &Shape<'_>,
        noise: Noise,
        inflation: Vec<f64>,
        tangent: Option<&Arc<Tangent>>,
    ) -> Result<Fit, InferError> {
        let (mut point, mut metric, mut here) =
            self.settle_normal(start, shape, &noise, (&inflation, tangent))?;
        // A normal fluctuation is linear as it is.
        let mut misfit = here.local.misfit.clone();
        if self.fluctuation == FluctuationLaw::LogNormal {
            (point, metric) = self.settle_log_normal(point, shape, &noise, &metric.inflation)?;
            here = self.linearised(&point, shape, &metric)?;
            let calm = Fluctuation::none(self.rows.len());
            let mean = shape.growth(&here.local.basis_functions, &point, &calm);
            misfit = self.misfit(&here.local.tangent.here, &mean);
        }
        Ok(Fit {
            misfit,
            point,
            noise,
            sizes: shape.sizes,
            basis: shape.basis.clone(),
            inflation: metric.inflation,
            loadings: metric.loadings,
            fluctuation: metric.fluctuation,
            tangent: Some(here.local.tangent),
            linear_misfit: here.local.misfit,
        })
    }

    /// The converged point under normal fluctuation, with the metric and the model linearised there: the point whose own
    /// metric asks for no further step. Noise in proportion to the plume changes with every step, and full steps may lead
    /// to and fro for ever. So a step counts where the next one promises less, in nats, and else is shortened
    /// (Deuflhard 2004, section 3.3); its length follows from how the step before turned out (Irons and Tuck 1969).
    fn settle_normal(
        &self,
        start: Point,
        shape: &Shape<'_>,
        noise: &Noise,
        (inflation, tangent): (&[f64], Option<&Arc<Tangent>>),
    ) -> Result<(Point, Metric, Linearised), InferError> {
        let metric = self.metric_of(self.loadings(&start, shape.basis, noise)?, noise, inflation);
        let basis = (shape.basis, &shape.active);
        let local = self.local(&start, basis, &metric.fluctuation, tangent)?;
        let here = self.linearised_by(local, &start, shape, &metric);
        let mut newton = self.newton(&start, shape, &here);
        let mut reached = (start, metric, here);
        let mut part = 1.0;
        let mut tries = 0;
        for _ in 0..self.policy.most_steps {
            if newton.promised_nats < self.policy.settled_nats || tries == TRIES {
                break;
            }
            tries += 1;
            let next = moved(&reached.0, shape, &newton.step, part);
            let there = self.remeasured(next, shape, &reached.1);
            // What the model refuses is too far.
            let then = there.map(|there| (self.newton(&there.0, shape, &there.2), there));
            match then {
                Ok((then, there)) if then.promised_nats < newton.promised_nats => {
                    part = then.relaxation(&newton, part);
                    (newton, reached, tries) = (then, there, 0);
                }
                _ => part *= SHORTER,
            }
        }
        Ok(reached)
    }

    /// A point with its own metric and the model linearised there; spikes are told by the metric `before`.
    fn remeasured(
        &self,
        point: Point,
        shape: &Shape<'_>,
        before: &Metric,
    ) -> Result<(Point, Metric, Linearised), InferError> {
        let basis = (shape.basis, &shape.active);
        let local = self.local(&point, basis, &before.fluctuation, None)?;
        let spikes = self.spikes(&point, &local.misfit, before)?;
        let noise = &before.whitener.noise;
        let metric = self.metric_of(self.loadings(&point, shape.basis, noise)?, noise, &spikes);
        // The model near the point does not depend on the metric of a plume that does not fluctuate.
        let here = self.linearised_by(local, &point, shape, &metric);
        Ok((point, metric, here))
    }

    /// The converged point under log-normal fluctuation from one near it, with the metric there.
    fn settle_log_normal(
        &self,
        start: Point,
        shape: &Shape<'_>,
        noise: &Noise,
        inflation: &[f64],
    ) -> Result<(Point, Metric), InferError> {
        let (mut point, mut metric) = self.approach(start, shape, noise, inflation)?;
        let mut here = self.linearised(&point, shape, &metric)?;
        let mut density = here.products.ln_normalisation - here.cost;
        let mut left = self.policy.most_steps;
        while left > 0 {
            let (next, there, used) = self.steps(point.clone(), here, shape, &metric, left)?;
            left -= used.min(left);
            let spikes = self.spikes(&next, &there.local.misfit, &metric)?;
            let before = Some(&metric.fluctuation);
            let anew = self.metric(&next, shape.basis, noise, &spikes, before)?;
            here = self.linearised(&next, shape, &anew)?;
            let gain = here.products.ln_normalisation - here.cost - density;
            // Under the next metric a point may be worse that was better under the last.
            if gain > 0.0 {
                (point, metric) = (next, anew);
                density += gain;
            }
            if gain < self.policy.settled_nats {
                break;
            }
        }
        Ok((point, metric))
    }

    /// Steps that the fluctuation follows, until they gain nothing: a plume that moves meets its readings with
    /// another factor at each of them.
    fn approach(
        &self,
        start: Point,
        shape: &Shape<'_>,
        noise: &Noise,
        inflation: &[f64],
    ) -> Result<(Point, Metric), InferError> {
        let mut point = start;
        let mut metric = self.metric(&point, shape.basis, noise, inflation, None)?;
        for _ in 0..self.policy.most_steps {
            let here = self.linearised(&point, shape, &metric)?;
            let next = self.step(&point, shape, &here, |next| {
                let followed = self.following(&metric, next, shape, &here.local.basis_functions)?;
                let misfit =
                    self.misfit_under(&followed, next, shape, &here.local.basis_functions)?;
                Some((self.cost(misfit, &followed, next, shape)?, followed))
            });
            let Some((next, cost, followed)) = next else {
                break;
            };
            (point, metric) = (next, followed);
            if here.cost - cost < self.policy.settled_nats {
                break;
            }
        }
        Ok((point, metric))
    }

    /// A metric at a point near its own, with the fluctuation that is most probable there.
    fn following(
        &self,
        metric: &Metric,
        next: &Point,
        shape: &Shape<'_>,
        basis_functions: &[f64],
    ) -> Option<Metric> {
        let there = self.model.predict(&next.at, &self.turns(next)).ok()?;
        let mean = shape.growth(basis_functions, next, &Fluctuation::none(self.rows.len()));
        let plume = grown(&there, &mean);
        let (before, plume_before) = &metric.calm;
        let moved = before.plume.iter().zip(plume_before).zip(&plume);
        let calm = Loadings {
            plume: moved
                .map(|((all, before), now)| all - before + now)
                .collect(),
            per_degree: before.per_degree.clone(),
            per_sigma_z: before.per_sigma_z.clone(),
            per_degree_up: before.per_degree_up.clone(),
            response_s: before.response_s.clone(),
        };
        let misfit = self.misfit(&there, &mean);
        let noise = metric.whitener.noise;
        let known = (&noise, &metric.inflation[..]);
        Some(self.fluctuating(calm, plume, &misfit, known, Some(&metric.fluctuation)))
    }

    /// Steps under one metric until they gain nothing: the point, the model linearised there, and the
    /// number of steps.
    fn steps(
        &self,
        mut point: Point,
        mut here: Linearised,
        shape: &Shape<'_>,
        metric: &Metric,
        most_steps: usize,
    ) -> Result<(Point, Linearised, usize), InferError> {
        for k in 0..most_steps {
            let next = self.step(&point, shape, &here, |next| {
                let misfit = self.misfit_under(metric, next, shape, &here.local.basis_functions)?;
                Some((self.cost(misfit, metric, next, shape)?, ()))
            });
            let Some((next, _, ())) = next else {
                return Ok((point, here, k + 1));
            };
            let before = here.cost;
            point = next;
            here = self.linearised(&point, shape, metric)?;
            if before - here.cost < self.policy.settled_nats {
                return Ok((point, here, k + 1));
            }
        }
        Ok((point, here, most_steps))
    }

    /// Converges under a given metric; returns the point and minus its log density up to a constant, nats.
    pub(crate) fn steps_under(
        &self,
        start: &Point,
        basis: &Basis,
        sizes: Sizes,
        metric: &Metric,
    ) -> Result<(Point, f64), InferError> {
        let shape = self.shape(basis, sizes);
        let here = self.linearised(start, &shape, metric)?;
        let steps = self.policy.most_steps;
        let (point, here, _) = self.steps(start.clone(), here, &shape, metric, steps)?;
        Ok((point, here.cost))
    }

    /// Offsets of unknowns and active weights from their prior means.
    fn offset_of(&self, point: &Point, shape: &Shape<'_>) -> DVector<f64> {
        let priors = self.model.priors().iter();
        let unknowns = point.at.iter().zip(priors).map(|(x, p)| x - p.mean);
        let weights = shape.active.weights().map(|k| point.weights[k]);
        let all: Vec<f64> = unknowns.chain(weights).collect();
        DVector::from_vec(all)
    }

    /// Minus the log prior density of unknowns and weights up to a constant, nats.
    fn prior_cost(&self, point: &Point, shape: &Shape<'_>) -> f64 {
        let offset = self.offset_of(point, shape);
        let square = |(o, p): (&f64, &f64)| p * o * o;
        0.5 * offset.iter().zip(&shape.precision).map(square).sum::<f64>()
    }

    /// The next point: the longest part of the Gauss-Newton step with a gain, with its cost and the second result of `cost`;
    /// none without a gain.
    fn step<T>(
        &self,
        point: &Point,
        shape: &Shape<'_>,
        here: &Linearised,
        cost: impl Fn(&Point) -> Option<(f64, T)>,
    ) -> Option<(Point, f64, T)> {
        let (information, pull) = self.normal_equations(point, shape, here);
        let step = Cholesky::new(information)?.solve(&pull);
        let mut part = 1.0 / self.excess(&step, &shape.precision);
        while part > SHORTEST_PART {
            let next = moved(point, shape, &step, part);
            if let Some((cost, more)) = cost(&next).filter(|(cost, _)| *cost < here.cost) {
                return Some((next, cost, more));
            }
            part *= SHORTER;
        }
        None
    }

    /// The Gauss-Newton step of a linearised problem, no longer than that is valid.
    fn newton(&self, point: &Point, shape: &Shape<'_>, here: &Linearised) -> NewtonStep {
        let (information, pull) = self.normal_equations(point, shape, here);
        let solved = Cholesky::new(information.clone()).map(|c| c.solve(&pull));
        let mut step = solved.unwrap_or_else(|| DVector::zeros(pull.len()));
        let promised_nats = 0.5 * step.dot(&pull);
        step.unscale_mut(self.excess(&step, &shape.precision));
        NewtonStep {
            step,
            promised_nats,
            information,
        }
    }

    /// Information and gradient of the linearised problem.
    fn normal_equations(
        &self,
        point: &Point,
        shape: &Shape<'_>,
        here: &Linearised,
    ) -> (DMatrix<f64>, DVector<f64>) {
        let n = here.columns - 1;
        let products = here.products.matrix(here.columns);
        let mut information = products.view((0, 0), (n, n)).into_owned();
        let mut pull = products.view((0, n), (n, 1)).column(0).into_owned();
        let offset = self.offset_of(point, shape);
        for (k, precision) in shape.precision.iter().enumerate() {
            information[(k, k)] += precision;
            pull[k] -= precision * offset[k];
        }
        (information, pull)
    }

    /// Factor by which a step exceeds the validity of the linearised problem; at least one.
    fn excess(&self, step: &DVector<f64>, precision: &[f64]) -> f64 {
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
            .zip(precision)
            .enumerate()
            .map(of)
            .fold(1.0, f64::max)
    }

    /// Misfit at a point near the linearisation, linear in the noise of a metric; none if the model rejects the point.
    fn misfit_under(
        &self,
        metric: &Metric,
        next: &Point,
        shape: &Shape<'_>,
        basis_functions: &[f64],
    ) -> Option<Vec<f64>> {
        let there = self.model.predict(&next.at, &self.turns(next)).ok()?;
        let growth = shape.growth(basis_functions, next, &metric.fluctuation);
        Some(self.linear_misfit(&there, &growth, &metric.fluctuation))
    }

    /// Minus the density of a point with a misfit, nats, up to a constant.
    fn cost(
        &self,
        mut misfit: Vec<f64>,
        metric: &Metric,
        next: &Point,
        shape: &Shape<'_>,
    ) -> Option<f64> {
        metric.whitener.whiten(self.rows, &mut misfit, 1);
        let square: f64 = misfit.iter().map(|w| w * w).sum();
        let steady = self.steady_turns(shape.basis, &next.weights);
        let square = square + steady.iter().map(|s| s * s).sum::<f64>();
        let cost = 0.5 * square + self.prior_cost(next, shape);
        cost.is_finite().then_some(cost)
    }

    /// Whitens one column by a fit's noise.
    pub(crate) fn whiten(&self, fit: &Fit, column: &mut [f64]) {
        let whitener = Whitener::new(self.rows, &fit.noise, &fit.loadings, &fit.inflation);
        whitener.whiten(self.rows, column, 1);
    }

    /// Factors of discrepancy and fluctuation on the plume at every row of a fit.
    pub(crate) fn factors(&self, fit: &Fit) -> Result<Vec<f64>, InferError> {
        let active = fit.basis.weighted(&fit.point.weights);
        let here = self.expected_of(fit)?;
        let basis_functions = self.basis_functions(&fit.point, &fit.basis, &active, &here.plume)?;
        let growth = growth_of(&basis_functions, &active, &fit.point, &fit.fluctuation);
        Ok(growth.iter().map(|g| g.factor).collect())
    }

    /// Readings minus a prediction with discrepancy.
    fn misfit(&self, there: &Prediction, growth: &[Growth]) -> Vec<f64> {
        let of = |i: usize| {
            if !self.rows.is_used(i) {
                return 0.0;
            }
            self.rows.measured()[i] - there.reading[i] - there.plume[i] * (growth[i].factor - 1.0)
        };
        (0..self.rows.len()).map(of).collect()
    }

    /// The same as the noise explains it.
    fn linear_misfit(
        &self,
        there: &Prediction,
        growth: &[Growth],
        fluctuation: &Fluctuation,
    ) -> Vec<f64> {
        let mut misfit = self.misfit(there, growth);
        for (i, misfit) in misfit.iter_mut().enumerate() {
            if self.rows.is_used(i) {
                *misfit += fluctuation.shift(i);
            }
        }
        misfit
    }

    /// The metric at a point: the plume fluctuates as it most probably did, which is looked for from `before`.
    fn metric(
        &self,
        point: &Point,
        basis: &Basis,
        noise: &Noise,
        inflation: &[f64],
        before: Option<&Fluctuation>,
    ) -> Result<Metric, InferError> {
        let calm = self.loadings(point, basis, noise)?;
        let there = self.model.predict(&point.at, &self.turns(point))?;
        let active = basis.weighted(&point.weights);
        let basis_functions = self.basis_functions(point, basis, &active, &there.plume)?;
        let mean = growth_of(
            &basis_functions,
            &active,
            point,
            &Fluctuation::none(self.rows.len()),
        );
        let misfit = self.misfit(&there, &mean);
        let known = (noise, inflation);
        Ok(self.fluctuating(calm, grown(&there, &mean), &misfit, known, before))
    }

    /// A metric of loadings of a plume that does not fluctuate, and of its misfit.
    fn fluctuating(
        &self,
        calm: Loadings,
        plume: Vec<f64>,
        misfit: &[f64],
        (noise, inflation): (&Noise, &[f64]),
        before: Option<&Fluctuation>,
    ) -> Metric {
        let mut loadings = calm.clone();
        let here = (misfit, &plume[..]);
        let fluctuation =
            Fluctuation::most_probable(self.rows, noise, &mut loadings, inflation, here, before);
        Metric {
            whitener: Whitener::new(self.rows, noise, &loadings, inflation),
            loadings,
            calm: (calm, plume),
            fluctuation,
            inflation: inflation.to_vec(),
        }
    }

    /// A metric of given loadings, under which the plume does not fluctuate about what is expected.
    pub(crate) fn metric_of(&self, loadings: Loadings, noise: &Noise, inflation: &[f64]) -> Metric {
        Metric {
            whitener: Whitener::new(self.rows, noise, &loadings, inflation),
            calm: (loadings.clone(), loadings.plume.clone()),
            loadings,
            fluctuation: Fluctuation::none(self.rows.len()),
            inflation: inflation.to_vec(),
        }
    }

    /// What fluctuation and wander are in proportion to at every row: root mean squares over the
    /// wander of the axis, as a plume that drifts is met where its mean is not.
    pub(crate) fn loadings(
        &self,
        point: &Point,
        basis: &Basis,
        noise: &Noise,
    ) -> Result<Loadings, InferError> {
        let rows = self.rows.len();
        let turns = self.turns(point);
        let turned = |by: AxisTurn| -> Result<Prediction, InferError> {
            let turn = |t: &AxisTurn| AxisTurn {
                clockwise_deg: t.clockwise_deg + by.clockwise_deg,
                upward_deg: t.upward_deg + by.upward_deg,
            };
            let turns: Vec<AxisTurn> = turns.iter().map(turn).collect();
            self.model.predict(&point.at, &turns)
        };
        let sideways = |by_deg: f64| turned(AxisTurn::clockwise(by_deg));
        // Gauss-Hermite quadrature of three nodes: 0 and ±√3 standard deviations.
        let aside = 3f64.sqrt() * noise.wander_deg;
        let mut plume_sq = vec![0.0; rows];
        for (by, weight) in [(-aside, 1.0 / 6.0), (0.0, 2.0 / 3.0), (aside, 1.0 / 6.0)] {
            for (sum, plume) in plume_sq.iter_mut().zip(sideways(by)?.plume) {
                *sum += weight * plume * plume;
            }
        }
        let mut plume: Vec<f64> = plume_sq.into_iter().map(f64::sqrt).collect();
        let active = basis.weighted(&point.weights);
        let basis_functions = self.basis_functions(point, basis, &active, &plume)?;
        let growth = growth_of(&basis_functions, &active, point, &Fluctuation::none(rows));
        let per_degree = |less: Prediction, more: Prediction| -> Vec<f64> {
            let of = |i: usize| {
                let grown = (more.plume[i] - less.plume[i]) * (growth[i].factor - 1.0);
                (more.reading[i] - less.reading[i] + grown) / (2.0 * DIFFERENCE_DEG)
            };
            (0..rows).map(of).collect()
        };
        let to_side = per_degree(sideways(-DIFFERENCE_DEG)?, sideways(DIFFERENCE_DEG)?);
        let upward = |upward_deg: f64| {
            turned(AxisTurn {
                clockwise_deg: 0.0,
                upward_deg,
            })
        };
        let per_degree_up = per_degree(upward(-DIFFERENCE_DEG)?, upward(DIFFERENCE_DEG)?);
        for (plume, growth) in plume.iter_mut().zip(&growth) {
            *plume *= growth.factor;
        }
        let places = self.model.places(&point.at)?;
        let per_sigma_z = |(per_degree, place): (&f64, &PlumePlace)| {
            let per_sigma_z = per_degree
                * (place.sigma_z_m / place.ln_distance.exp())
                    .atan()
                    .to_degrees();
            // Upwind of the source there is no plume to rise.
            if per_sigma_z.is_finite() {
                per_sigma_z
            } else {
                0.0
            }
        };
        Ok(Loadings {
            plume,
            per_sigma_z: per_degree_up.iter().zip(&places).map(per_sigma_z).collect(),
            per_degree: to_side,
            per_degree_up,
            response_s: self.model.response_s(&point.at)?,
        })
    }

    fn linearised(
        &self,
        point: &Point,
        shape: &Shape<'_>,
        metric: &Metric,
    ) -> Result<Linearised, InferError> {
        let basis = (shape.basis, &shape.active);
        let local = self.local(point, basis, &metric.fluctuation, None)?;
        Ok(self.linearised_by(local, point, shape, metric))
    }

    /// The same by the model near the point.
    fn linearised_by(
        &self,
        local: Local,
        point: &Point,
        shape: &Shape<'_>,
        metric: &Metric,
    ) -> Linearised {
        let columns = shape.precision.len() + 1;
        let unknowns = self.unknowns();
        let weights: Vec<usize> = (unknowns..columns - 1).collect();
        let places = Columns::of(&shape.active, 0, &weights);
        let whole = [self.rows.whole()];
        let by_block = self.products_of(&metric.whitener, columns, &whole, |i, row| {
            self.fill_row(&local, &metric.loadings, &places, i, row);
        });
        let places = shape.active.weights().zip(unknowns..);
        let steady = self.steady_rows(shape.basis, &point.weights, columns, places);
        let mut products = Products::of(&steady, columns, 0.0);
        by_block.iter().for_each(|p| products.add(p, 1.0));
        let misfit_sq = products.values[columns * columns - 1];
        Linearised {
            cost: 0.5 * misfit_sq + self.prior_cost(point, shape),
            products,
            columns,
            local,
        }
    }

    /// Products of columns that `fill` gives row by row, whitened, for each of `blocks`, which hold every row
    /// once. No table of all rows is made: it would not fit into a cache.
    fn products_of(
        &self,
        whitener: &Whitener,
        columns: usize,
        blocks: &[Vec<Range<usize>>],
        fill: impl Fn(usize, &mut [f64]),
    ) -> Vec<Products> {
        let mut out = vec![Products::zero(columns); blocks.len()];
        let mut part = vec![0.0; ROWS_AT_ONCE * columns];
        for series in self.rows.series() {
            let within = |r: &Range<usize>| r.start.max(series.start)..r.end.min(series.end);
            let of_block = |(b, ranges): (usize, &Vec<Range<usize>>)| -> Vec<_> {
                ranges.iter().map(|r| (within(r), b)).collect()
            };
            let mut stretches: Vec<(Range<usize>, usize)> =
                blocks.iter().enumerate().flat_map(of_block).collect();
            stretches.retain(|s| !s.0.is_empty());
            stretches.sort_by_key(|s| s.0.start);
            let mut means = Means::new(columns);
            for (stretch, block) in stretches {
                for from in stretch.clone().step_by(ROWS_AT_ONCE) {
                    let rows = from..stretch.end.min(from + ROWS_AT_ONCE);
                    let part = &mut part[..rows.len() * columns];
                    for (i, row) in rows.clone().zip(part.chunks_exact_mut(columns)) {
                        fill(i, row);
                    }
                    whitener.whiten_next(rows, &mut means, part);
                    out[block].add_rows(part, columns);
                }
                out[block].ln_normalisation += whitener.ln_normalisation_of(&stretch);
            }
        }
        out.iter_mut().for_each(|p| p.mirror(columns));
        out
    }

    /// Prediction at a point, whose `tangent` may be known.
    fn expected<'t>(
        &self,
        point: &Point,
        tangent: Option<&'t Arc<Tangent>>,
    ) -> Result<Cow<'t, Prediction>, InferError> {
        match tangent {
            Some(tangent) => Ok(Cow::Borrowed(&tangent.here)),
            None => Ok(Cow::Owned(
                self.model.predict(&point.at, &self.turns(point))?,
            )),
        }
    }

    /// Prediction at a fit's point.
    pub(crate) fn expected_of<'f>(&self, fit: &'f Fit) -> Result<Cow<'f, Prediction>, InferError> {
        self.expected(&fit.point, fit.tangent.as_ref())
    }

    /// The model near a point, whose `tangent` may be known.
    fn local(
        &self,
        point: &Point,
        (basis, active): (&Basis, &Active),
        fluctuation: &Fluctuation,
        tangent: Option<&Arc<Tangent>>,
    ) -> Result<Local, InferError> {
        let here = self.expected(point, tangent)?;
        let basis_functions = self.basis_functions(point, basis, active, &here.plume)?;
        let growth = growth_of(&basis_functions, active, point, fluctuation);
        let tangent = match tangent {
            Some(tangent) => Arc::clone(tangent),
            None => {
                let turns = self.turns(point);
                let factor = |i: usize| growth[i].factor;
                Arc::new(Tangent {
                    slopes: slopes(self.model, &point.at, &turns, &here, factor)?,
                    here: here.into_owned(),
                })
            }
        };
        let grown = tangent.here.plume.iter().zip(&growth);
        Ok(Local {
            misfit: self.linear_misfit(&tangent.here, &growth, fluctuation),
            per_discrepancy: grown.map(|(p, g)| p * g.slope).collect(),
            tangent,
            basis_functions,
        })
    }

    /// Derivatives of row `i` with respect to unknowns and weights, and the misfit as the last.
    fn fill_row(
        &self,
        local: &Local,
        loadings: &Loadings,
        columns: &Columns<'_>,
        i: usize,
        row: &mut [f64],
    ) {
        for (k, slope) in local.tangent.slopes.iter().enumerate() {
            row[columns.unknowns + k] = slope[i];
        }
        let mut fill = |columns: &[usize], slope: f64, basis_functions: &[f64]| {
            for (column, basis_function) in columns.iter().zip(basis_functions) {
                row[*column] = slope * basis_function;
            }
        };
        let n = columns.discrepancy.len();
        let of_discrepancy = &local.basis_functions[i * n..(i + 1) * n];
        fill(
            columns.discrepancy,
            local.per_discrepancy[i],
            of_discrepancy,
        );
        let n = self.turning.axis_drift.functions_per_direction();
        let of_drift = &self.turning.basis_functions[i * n..(i + 1) * n];
        fill(columns.sideways, loadings.per_degree[i], of_drift);
        fill(columns.upward, loadings.per_degree_up[i], of_drift);
        row[row.len() - 1] = local.misfit[i];
    }

    /// The values of active basis functions of the discrepancy at every row; none where there is no plume to speak
    /// of.
    fn basis_functions(
        &self,
        point: &Point,
        basis: &Basis,
        active: &Active,
        plume: &[f64],
    ) -> Result<Vec<f64>, InferError> {
        let n = active.of_discrepancy();
        if n == 0 {
            return Ok(Vec::new());
        }
        let mut out = vec![0.0; self.rows.len() * n];
        let most = plume.iter().fold(0.0f64, |m, p| m.max(p.abs()));
        let places = self.model.places(&point.at)?;
        for ((row, place), plume) in out.chunks_exact_mut(n).zip(&places).zip(plume) {
            if plume.abs() > NO_PLUME * most {
                basis.fill_discrepancy(active, place, row);
            }
        }
        Ok(out)
    }

    /// Products of all columns at a fit, those of `tried` (what a mechanism would change at each row) among
    /// them, for each of `blocks` of rows.
    pub(crate) fn products(
        &self,
        fit: &Fit,
        tried: &[Vec<f64>],
        blocks: &[Vec<Range<usize>>],
    ) -> Result<(Known, Vec<Products>), InferError> {
        let coordinates: Vec<usize> = fit.basis.coordinates().collect();
        let layout = Layout::new(&coordinates, self.unknowns(), tried.len());
        let all = Active::all(&fit.basis);
        let tangent = fit.tangent.as_ref();
        let local = self.local(&fit.point, (&fit.basis, &all), &fit.fluctuation, tangent)?;
        let whitener = Whitener::new(self.rows, &fit.noise, &fit.loadings, &fit.inflation);
        let places = Columns::of(&all, layout.unknowns, &layout.weights);
        let mut products = self.products_of(&whitener, layout.columns, blocks, |i, row| {
            for (column, value) in row[layout.tried..].iter_mut().zip(tried) {
                *column = value[i];
            }
            self.fill_row(&local, &fit.loadings, &places, i, row);
        });
        let places = layout.weights.iter().copied().enumerate();
        let steady = self.steady_rows(&fit.basis, &fit.point.weights, layout.columns, places);
        let turned = Products::of(&steady, layout.columns, 0.0);
        // The prior of the axis drift belongs to no single pass, so each gets a share.
        let part = 1.0 / products.len().max(1) as f64;
        products.iter_mut().for_each(|p| p.add(&turned, part));
        let mut offset = vec![0.0; layout.columns];
        for (place, weight) in layout.weights.iter().zip(&fit.point.weights) {
            offset[*place] = *weight;
        }
        for (k, (x, prior)) in fit.point.at.iter().zip(self.model.priors()).enumerate() {
            offset[layout.unknowns + k] = x - prior.mean;
        }
        let precision = self.model.priors().iter().map(|p| p.sd.powi(-2)).collect();
        let known = Known {
            layout,
            precision,
            offset,
        };
        Ok((known, products))
    }

    /// Factors on the variance of rows that are spikes: beyond what normal noise shows, and short
    /// against a crossing of the plume.
    fn spikes(
        &self,
        point: &Point,
        misfit: &[f64],
        metric: &Metric,
    ) -> Result<Vec<f64>, InferError> {
        let mut whitened = misfit.to_vec();
        metric.whitener.whiten(self.rows, &mut whitened, 1);
        // Variance of a row's innovation without what a spike has added to it, and of its own white noise:
        // a spike that is allowed for must not look like none.
        let variances = |i: usize| {
            let own = self
                .rows
                .stated_sd(i)
                .unwrap_or(metric.whitener.noise.white);
            let added = own * own * (metric.inflation[i] - 1.0);
            (metric.whitener.innovation_sd(i).powi(2) - added, own * own)
        };
        let square = |i: usize| (whitened[i] * metric.whitener.innovation_sd(i)).powi(2);
        let most = self.policy.spike_sd.powi(2);
        let far = |i: usize| self.rows.is_used(i) && square(i) > most * variances(i).0;
        let mut inflation = vec![1.0; self.rows.len()];
        let places = self.model.places(&point.at)?;
        for range in self.rows.series() {
            let mut i = range.start;
            while i < range.end {
                let first = i;
                while i < range.end && far(i) {
                    i += 1;
                }
                // What follows a spike that was not allowed for may be far off as well: as much of it as
                // is a spike by itself.
                let spike = (first + 1..=i).rev().map(|end| first..end).find(|spike| {
                    stands_out(misfit, range.clone(), spike.clone())
                        && self.is_short(&places, range.clone(), spike.start, spike.end)
                });
                for k in spike.into_iter().flatten() {
                    let (others, own) = variances(k);
                    inflation[k] = 1.0 + (square(k) / most - others) / own;
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

/// Sizes of nothing but an axis drift of so many degrees.
pub(crate) fn axis_drift_alone(deg: f64) -> Sizes {
    let mut sizes = [0.0; crate::discrepancy::COORDINATES];
    sizes[AXIS_DRIFT] = deg;
    sizes
}
