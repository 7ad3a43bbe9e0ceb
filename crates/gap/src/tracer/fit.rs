//! Fit and evidence of models over trials, whole and with one trial left out at a time.
//!
//! Residuals of logarithms in one trial share an error of level and one of growth with distance
//! (a trial's weather is never quite what its numbers say), next to an error of each arc. A
//! trial may be odd as a whole: with probability 0.05 its errors are three times as large.
//! Parameters are fitted by Gauss–Newton steps with their priors, sizes of the errors by a
//! pattern search with weak priors; the evidence is Laplace's.

use infer::parallel_map;
use nalgebra::{Cholesky, DMatrix, DVector, Dyn};
use statrs::distribution::{ContinuousCDF, Normal};
use std::f64::consts::PI;

use super::arcs::TrialArcs;
use super::model::{Datum, Model, Numbers, PRIOR_SD, Quantity, WORDS, is_positive, written};
use super::predicted::Weighted;
use crate::statistics::{jackknife_se, probabilities};
use crate::verdict::Parameter;

/// Standard deviations of the errors of each arc, of a trial's level, and of its growth for a factor of e in distance.
type Sizes = [f64; 3];
/// Where the fit of the sizes starts, and the centre of their weak priors.
const USUAL: Sizes = [0.12, 0.2, 0.15];
/// Standard deviation of those priors, ln.
const SIZES_LN_SD: f64 = 0.7;
/// Probability of an odd trial, and the factor on its standard deviations.
const ODD: (f64, f64) = (0.05, 3.0);
/// Standard deviation of ln σ_z from towers: some tens of samplers, and a profile that is not
/// quite normal.
const TOWER_SD: f64 = 0.25;
/// Most steps of a fit, and of the weights of odd trials within one; both settle in a few.
const MOST_STEPS: usize = 6;
/// Sizes of the errors between which is searched, first and last step of that search, ln, and the least gain that counts,
/// nats.
const SIZES: [f64; 2] = [1e-3, 3.0];
const SEARCH: [f64; 2] = [0.4, 0.02];
const LEAST_GAIN: f64 = 1e-9;
/// A step of less than this, in standard deviations of the priors, ends a fit.
const SETTLED_SD: f64 = 1e-4;
/// Steps of the differences for slopes, in standard deviations of the priors.
const STEP_SD: f64 = 0.02;

/// Trials of one kind of air, with what one question is about in each.
pub struct Trials<'a> {
    pub trials: &'a [&'a TrialArcs],
    pub data: Vec<Vec<Datum>>,
}

/// A fitted model.
#[derive(Debug, Clone, PartialEq)]
pub struct Fit {
    pub numbers: Numbers,
    /// Covariance of those that are free, in standard deviations of their priors.
    pub covariance: DMatrix<f64>,
    pub sizes: Sizes,
    /// Log likelihood at the fit, nats.
    pub log_score: f64,
    /// Log evidence with the model's prior, nats.
    pub log_evidence: f64,
}

/// A model's fit to all trials, and its fits without one of them.
#[derive(Debug, Clone)]
pub struct Scored {
    pub model: Model,
    pub fit: Fit,
    /// Probability among the models of the question.
    pub probability: f64,
    /// The fits without each trial.
    pub without: Vec<Fit>,
    /// Scores of each trial by them, nats.
    pub held_out: Vec<f64>,
    /// The causes that show in it, once judged.
    pub causes: Vec<&'static str>,
}

/// A trial linearised: residuals at 0 of the numbers, and slopes by those that are free, in standard deviations of their
/// priors.
struct Linear<'a> {
    data: &'a [Datum],
    residual: DVector<f64>,
    slopes: DMatrix<f64>,
}

/// The most probable free numbers of linearised trials, in standard deviations of their priors, their precision, and the
/// log likelihood there, nats.
type Solved = (DVector<f64>, Cholesky<f64, Dyn>, f64);

fn vector(values: impl Iterator<Item = f64>) -> DVector<f64> {
    DVector::from_vec(values.collect())
}

fn covariance(data: &[Datum], [arc, level, growth]: &Sizes) -> DMatrix<f64> {
    let is_tower = |datum: &Datum| datum.quantity == Quantity::TowerSpread;
    DMatrix::from_fn(data.len(), data.len(), |a, b| {
        let (p, q) = (&data[a], &data[b]);
        // Towers take no part in the trial's errors.
        let shared = match is_tower(p) || is_tower(q) {
            true => 0.0,
            false => level.powi(2) + growth.powi(2) * p.ln_x * q.ln_x,
        };
        let own = if is_tower(p) { TOWER_SD } else { *arc };
        shared + if a == b { own.powi(2) } else { 0.0 }
    })
}

/// ln of the sum of the usual and the odd density of a trial, and the weight of its precision.
fn log_density(residual: &DVector<f64>, factor: &Cholesky<f64, Dyn>) -> (f64, f64) {
    let n = residual.len() as f64;
    let square = residual.dot(&factor.solve(residual));
    let constant = -0.5 * (n * (2.0 * PI).ln() + factor.ln_determinant());
    let usual = (1.0 - ODD.0).ln() + constant - 0.5 * square;
    let odd = ODD.0.ln() + constant - n * ODD.1.ln() - 0.5 * square / ODD.1.powi(2);
    let top = usual.max(odd);
    let sum = (usual - top).exp() + (odd - top).exp();
    let share_odd = (odd - top).exp() / sum;
    (top + sum.ln(), 1.0 - share_odd + share_odd / ODD.1.powi(2))
}

impl Trials<'_> {
    fn predict(&self, model: &Model, i: usize, numbers: &Numbers) -> DVector<f64> {
        let each = self.data[i].iter();
        vector(each.map(|d| model.predict(&self.trials[i].weather, d, numbers)))
    }

    fn linear(&self, model: &Model, i: usize, numbers: &Numbers) -> Linear<'_> {
        let at = self.predict(model, i, numbers);
        let mut slopes = DMatrix::zeros(at.len(), model.free.len());
        for (column, &k) in model.free.iter().enumerate() {
            let mut moved = *numbers;
            moved[k] += STEP_SD * PRIOR_SD[k];
            let change = self.predict(model, i, &moved) - &at;
            slopes.set_column(column, &(change / STEP_SD));
        }
        let measured = vector(self.data[i].iter().map(|d| d.ln));
        Linear {
            data: &self.data[i],
            residual: measured - at + &slopes * free(model, numbers),
            slopes,
        }
    }

    /// Fits a model to all trials, or to all but one with the sizes of the errors of the fit to all: three numbers that
    /// one trial hardly moves. None where no fit is possible (a model that is not finite).
    pub fn fit(&self, model: &Model, without: Option<(usize, &Fit)>) -> Option<Fit> {
        let start = (Numbers::default(), USUAL);
        let (mut numbers, mut sizes) = without.map_or(start, |w| (w.1.numbers, w.1.sizes));
        let used = (0..self.data.len()).filter(|i| without.is_none_or(|w| w.0 != *i));
        let mut fit = None;
        for _ in 0..MOST_STEPS {
            let trials = used.clone().map(|i| self.linear(model, i, &numbers));
            let trials: Vec<Linear<'_>> = trials.collect();
            let before = free(model, &numbers);
            if without.is_none() {
                sizes = search(&trials, &before, sizes);
            }
            let (theta, precision, log_score) = solve(&trials, &before, &sizes)?;
            let covariance = precision.inverse();
            let mut log_evidence = model.ln_prior() + log_score
                - 0.5 * (theta.norm_squared() + precision.ln_determinant());
            let normal = Normal::new(0.0, 1.0).ok()?;
            for (column, &k) in model.free.iter().enumerate() {
                numbers[k] = theta[column] * PRIOR_SD[k];
                if is_positive(k) {
                    // Half of the prior, and only the positive part of the posterior.
                    let in_sd = theta[column] / covariance[(column, column)].sqrt();
                    log_evidence += 2.0_f64.ln() + normal.cdf(in_sd).max(1e-300).ln();
                }
            }
            fit = Some(Fit {
                numbers,
                covariance,
                sizes,
                log_score,
                log_evidence,
            });
            if (theta - before).amax() < SETTLED_SD {
                break;
            }
        }
        fit.filter(|f| f.log_evidence.is_finite() && numbers.iter().all(|n| n.is_finite()))
    }

    /// Score of a trial that a fit did not see, nats. The fit's own uncertainty belongs to the prediction.
    fn held_out(&self, model: &Model, i: usize, fit: &Fit) -> f64 {
        let linear = self.linear(model, i, &fit.numbers);
        let spread = &linear.slopes * &fit.covariance * linear.slopes.transpose();
        let whole = covariance(linear.data, &fit.sizes) + spread;
        let residual = linear.residual - linear.slopes * free(model, &fit.numbers);
        let factor = whole.cholesky();
        factor.map_or(f64::NEG_INFINITY, |f| log_density(&residual, &f).0)
    }

    /// All models that can be fitted, the most probable first.
    pub fn score(&self, models: &[Model]) -> Vec<Scored> {
        let trials = 0..self.data.len();
        let scored = parallel_map(models, |model| {
            let fit = self.fit(model, None)?;
            let without = trials.clone().map(|i| self.fit(model, Some((i, &fit))));
            let without = without.collect::<Option<Vec<Fit>>>()?;
            let held_out = trials.clone().map(|i| self.held_out(model, i, &without[i]));
            Some(Scored {
                model: model.clone(),
                probability: 0.0,
                held_out: held_out.collect(),
                causes: Vec::new(),
                without,
                fit,
            })
        });
        let mut scored: Vec<Scored> = scored.into_iter().flatten().collect();
        let evidences: Vec<f64> = scored.iter().map(|s| s.fit.log_evidence).collect();
        for (scored, p) in scored.iter_mut().zip(probabilities(&evidences)) {
            scored.probability = p;
        }
        scored.sort_by(|a, b| b.probability.total_cmp(&a.probability));
        scored
    }
}

/// The numbers that a model leaves free, in standard deviations of their priors.
fn free(model: &Model, numbers: &Numbers) -> DVector<f64> {
    vector(model.free.iter().map(|k| numbers[*k] / PRIOR_SD[*k]))
}

/// The most probable sizes of the errors near some others, by a pattern search.
fn search(trials: &[Linear<'_>], theta: &DVector<f64>, start: Sizes) -> Sizes {
    let post = |sizes: &Sizes| {
        let off = |k: usize| (sizes[k] / USUAL[k]).ln() / SIZES_LN_SD;
        let prior = -0.5 * (0..sizes.len()).map(|k| off(k).powi(2)).sum::<f64>();
        match solve(trials, theta, sizes) {
            Some((theta, _, log_score)) => log_score - 0.5 * theta.norm_squared() + prior,
            None => f64::NEG_INFINITY,
        }
    };
    let (mut best, mut highest) = (start, post(&start));
    let [mut step, last] = SEARCH;
    while step > last {
        let before = highest;
        for k in 0..best.len() {
            for way in [step, -step] {
                let mut tried = best;
                tried[k] = (tried[k] * way.exp()).clamp(SIZES[0], SIZES[1]);
                let value = post(&tried);
                if value > highest + LEAST_GAIN {
                    (best, highest) = (tried, value);
                }
            }
        }
        if highest == before {
            step *= 0.5;
        }
    }
    best
}

fn solve(trials: &[Linear<'_>], start: &DVector<f64>, sizes: &Sizes) -> Option<Solved> {
    let factors = trials.iter().map(|t| covariance(t.data, sizes).cholesky());
    let factors = factors.collect::<Option<Vec<_>>>()?;
    let mut theta = start.clone();
    let mut last = None;
    // The weights of odd trials depend on the step: a few rounds settle both.
    for _ in 0..MOST_STEPS {
        let mut precision = DMatrix::identity(theta.len(), theta.len());
        let mut right = DVector::zeros(theta.len());
        let mut log_score = 0.0;
        for (trial, factor) in trials.iter().zip(&factors) {
            let (score, weight) = log_density(&(&trial.residual - &trial.slopes * &theta), factor);
            log_score += score;
            let solved = factor.solve(&trial.slopes) * weight;
            precision += trial.slopes.tr_mul(&solved);
            right += solved.tr_mul(&trial.residual);
        }
        let precision = precision.cholesky()?;
        theta = precision.solve(&right);
        last = Some((precision, log_score));
    }
    last.map(|(precision, log_score)| (theta, precision, log_score))
}

/// The models fitted without a trial, with their probabilities without it.
pub fn without(scored: &[Scored], i: usize) -> Vec<Weighted> {
    let evidences: Vec<f64> = scored.iter().map(|s| s.without[i].log_evidence).collect();
    let weighted = scored.iter().zip(probabilities(&evidences));
    weighted
        .map(|(s, weight)| (weight, s.model.clone(), s.without[i].numbers))
        .collect()
}

/// Sum of paired differences over trials, and its standard error.
pub fn difference(better: &[f64], worse: &[f64]) -> (f64, f64) {
    let n = better.len() as f64;
    let each: Vec<f64> = better.iter().zip(worse).map(|(a, b)| a - b).collect();
    let sum: f64 = each.iter().sum();
    let spread: f64 = each.iter().map(|d| (d - sum / n).powi(2)).sum();
    (sum, (spread * n / (n - 1.0).max(1.0)).sqrt())
}

impl Scored {
    /// Numbers in the catalogue's words. The standard deviation is that of the fit or, where it is larger, the
    /// jackknife's over trials, which asks nothing of the errors but that trials are independent.
    pub fn parameters(&self) -> Vec<Parameter> {
        let (fit, free) = (&self.fit, &self.model.free);
        let moved = |k: usize, sds: f64| {
            let mut numbers = fit.numbers;
            numbers[k] += sds * PRIOR_SD[k];
            written(&numbers)
        };
        let parameter = |&p: &usize| {
            let slope =
                |&k: &usize| (moved(k, STEP_SD)[p] - moved(k, -STEP_SD)[p]) / (2.0 * STEP_SD);
            let slopes = vector(free.iter().map(slope));
            let without = self.without.iter().map(|f| written(&f.numbers)[p]);
            let [mechanism, name, unit] = WORDS[p].map(str::to_owned);
            let least = if is_positive(p) {
                0.0
            } else {
                f64::NEG_INFINITY
            };
            let variance = slopes.dot(&(&fit.covariance * &slopes));
            Parameter {
                mechanism,
                name,
                value: written(&fit.numbers)[p].max(least),
                sd: variance
                    .sqrt()
                    .max(jackknife_se(&without.collect::<Vec<f64>>())),
                unit,
            }
        };
        free.iter().map(parameter).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn standard_error_of_a_sum() {
        // Differences 1, 2, 3: sum 6, sd 1, standard error of the sum √3.
        let (sum, error) = difference(&[2.0, 2.0, 3.0], &[1.0, 0.0, 0.0]);
        assert!((sum - 6.0).abs() < 1e-12 && (error - 3.0_f64.sqrt()).abs() < 1e-12);
    }
}
