//! Fit and evidence of a model over trials.
//!
//! Residuals of logarithms in one trial share an error of level and one of growth with distance
//! (a trial's weather is never quite what its numbers say), next to an error of each arc. A
//! trial may be odd as a whole: with probability 0.05 its errors are three times as large.
//! Parameters are fitted by Gauss–Newton steps with their priors, sizes of the errors by a
//! pattern search with weak priors; the evidence is Laplace's.

use nalgebra::{DMatrix, DVector};
use statrs::distribution::{ContinuousCDF, Normal};

use super::model::Prior;

/// One measured logarithm.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Datum {
    /// Measured.
    pub value: f64,
    /// Logarithm of distance over the pivot.
    pub log_distance: f64,
    /// Own standard deviation besides the model's; `Some` takes no part in the trial's errors.
    pub own_sd: Option<f64>,
}

/// What one trial measured.
pub type Trial = Vec<Datum>;

/// Standard deviations of the errors.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Noise {
    /// Of each arc.
    pub arc: f64,
    /// Of the trial's level.
    pub level: f64,
    /// Of the trial's growth, for a factor of e in distance.
    pub growth: f64,
}

/// Where the search for the noise starts, and the centre of its weak priors (log sd 0.7).
const USUAL: Noise = Noise {
    arc: 0.12,
    level: 0.2,
    growth: 0.15,
};
const NOISE_LOG_SD: f64 = 0.7;
/// Probability of an odd trial, and the factor on its standard deviations.
const ODD: (f64, f64) = (0.05, 3.0);

/// A fitted model.
#[derive(Debug, Clone, PartialEq)]
pub struct Fit {
    /// Parameters.
    pub theta: Vec<f64>,
    /// Their covariance.
    pub covariance: DMatrix<f64>,
    /// Errors.
    pub noise: Noise,
    /// Log likelihood at the fit, nats.
    pub log_score: f64,
    /// Log evidence, nats.
    pub log_evidence: f64,
}

/// A model: predictions of every datum of trial `i` for parameters.
pub trait Model {
    /// Priors of the parameters.
    fn priors(&self) -> &[Prior];
    /// Predictions for trial `i`, in the order of its data.
    fn predict(&self, i: usize, theta: &[f64]) -> Vec<f64>;
}

/// Residuals and slopes of one trial about some parameters.
struct Linear {
    residual: DVector<f64>,
    slopes: DMatrix<f64>,
}

/// Log density of `r` under the trial's errors, and the weighted normal equations.
fn covariance(trial: &Trial, noise: &Noise) -> DMatrix<f64> {
    DMatrix::from_fn(trial.len(), trial.len(), |a, b| {
        let (p, q) = (&trial[a], &trial[b]);
        let mut v = 0.0;
        if p.own_sd.is_none() && q.own_sd.is_none() {
            v += noise.level.powi(2) + noise.growth.powi(2) * p.log_distance * q.log_distance;
        }
        if a == b {
            v += p.own_sd.unwrap_or(noise.arc).powi(2);
        }
        v
    })
}

/// ln of the sum of the usual and the odd density, and the precision's weight.
fn log_density(square: f64, log_det: f64, count: usize) -> (f64, f64) {
    let n = count as f64;
    let constant = -0.5 * (n * (2.0 * std::f64::consts::PI).ln() + log_det);
    let usual = (1.0 - ODD.0).ln() + constant - 0.5 * square;
    let odd = ODD.0.ln() + constant - n * ODD.1.ln() - 0.5 * square / ODD.1.powi(2);
    let top = usual.max(odd);
    let sum = (usual - top).exp() + (odd - top).exp();
    let share_odd = (odd - top).exp() / sum;
    (top + sum.ln(), 1.0 - share_odd + share_odd / ODD.1.powi(2))
}

/// Score of a trial that a fit did not see, nats.
pub fn held_out(model: &dyn Model, trials: &[Trial], i: usize, fit: &Fit) -> f64 {
    let predicted = model.predict(i, &fit.theta);
    let residual = DVector::from_iterator(
        trials[i].len(),
        trials[i].iter().zip(&predicted).map(|(d, p)| d.value - p),
    );
    // The fit's own uncertainty belongs to the prediction.
    let slopes = slopes(model, trials, i, &fit.theta, &predicted);
    let spread = &slopes * &fit.covariance * slopes.transpose();
    let whole = covariance(&trials[i], &fit.noise) + spread;
    match whole.cholesky() {
        Some(factor) => {
            let square = residual.dot(&factor.solve(&residual));
            log_density(square, factor.ln_determinant(), trials[i].len()).0
        }
        None => f64::NEG_INFINITY,
    }
}

fn slopes(
    model: &dyn Model,
    trials: &[Trial],
    i: usize,
    theta: &[f64],
    at: &[f64],
) -> DMatrix<f64> {
    let priors = model.priors();
    let mut slopes = DMatrix::zeros(trials[i].len(), priors.len());
    for (k, prior) in priors.iter().enumerate() {
        let step = 0.02 * prior.sd;
        let mut moved = theta.to_vec();
        moved[k] += step;
        for (j, value) in model.predict(i, &moved).iter().enumerate() {
            slopes[(j, k)] = (value - at[j]) / step;
        }
    }
    slopes
}

fn linear(model: &dyn Model, trials: &[Trial], used: &[usize], theta: &[f64]) -> Vec<Linear> {
    used.iter()
        .map(|&i| {
            let at = model.predict(i, theta);
            let residual = trials[i].iter().zip(&at).map(|(d, p)| d.value - p);
            Linear {
                residual: DVector::from_iterator(trials[i].len(), residual),
                slopes: slopes(model, trials, i, theta, &at),
            }
        })
        .collect()
}

/// Best step from the point of linearisation, with its precision and the log posterior there.
struct Step {
    step: DVector<f64>,
    precision: DMatrix<f64>,
    log_score: f64,
    log_prior: f64,
}

fn solve(
    trials: &[Trial],
    used: &[usize],
    linear: &[Linear],
    theta: &[f64],
    priors: &[Prior],
    noise: &Noise,
) -> Option<Step> {
    let d = priors.len();
    let factors = used
        .iter()
        .map(|&i| covariance(&trials[i], noise).cholesky())
        .collect::<Option<Vec<_>>>()?;
    let mut step = DVector::zeros(d);
    let mut precision = DMatrix::zeros(d, d);
    let mut log_score = 0.0;
    // The weights of odd trials depend on the step: a few rounds settle both.
    for _ in 0..if d == 0 { 1 } else { 6 } {
        precision.fill(0.0);
        let mut right = DVector::zeros(d);
        for (k, prior) in priors.iter().enumerate() {
            precision[(k, k)] = prior.sd.powi(-2);
            right[k] = -theta[k] / prior.sd.powi(2);
        }
        log_score = 0.0;
        for (part, (factor, &i)) in linear.iter().zip(factors.iter().zip(used)) {
            let residual = &part.residual - &part.slopes * &step;
            let square = residual.dot(&factor.solve(&residual));
            let (score, weight) = log_density(square, factor.ln_determinant(), trials[i].len());
            log_score += score;
            let solved = factor.solve(&part.slopes) * weight;
            precision += part.slopes.transpose() * &solved;
            right += solved.transpose() * &part.residual;
        }
        if d > 0 {
            step = precision.clone().cholesky()?.solve(&right);
        }
    }
    let at = |k: usize| theta[k] + step[k];
    let log_prior = (0..d)
        .map(|k| {
            let sd = priors[k].sd;
            -0.5 * ((at(k) / sd).powi(2) + (2.0 * std::f64::consts::PI).ln()) - sd.ln()
        })
        .sum();
    Some(Step {
        step,
        precision,
        log_score,
        log_prior,
    })
}

fn noise_prior(noise: &Noise) -> f64 {
    let term = |value: f64, usual: f64| -0.5 * ((value / usual).ln() / NOISE_LOG_SD).powi(2);
    term(noise.arc, USUAL.arc) + term(noise.level, USUAL.level) + term(noise.growth, USUAL.growth)
}

/// Fits `model` to the trials `used`; a fit to more trials (`of_all`) fixes the errors and says
/// where to start. `None` where no fit is possible (a model that is not finite).
pub fn fit(
    model: &dyn Model,
    trials: &[Trial],
    used: &[usize],
    of_all: Option<&Fit>,
) -> Option<Fit> {
    let priors = model.priors();
    let mut theta = of_all.map_or_else(|| vec![0.0; priors.len()], |f| f.theta.clone());
    let mut errors = of_all.map_or(USUAL, |f| f.noise);
    let mut last = None;
    for _ in 0..6 {
        let parts = linear(model, trials, used, &theta);
        let post = |errors: &Noise| {
            solve(trials, used, &parts, &theta, priors, errors).map_or(f64::NEG_INFINITY, |s| {
                s.log_score + s.log_prior + noise_prior(errors)
            })
        };
        if of_all.is_none() {
            errors = search(errors, post);
        }
        let step = solve(trials, used, &parts, &theta, priors, &errors)?;
        let moved = step
            .step
            .iter()
            .zip(priors)
            .map(|(s, p)| (s / p.sd).abs())
            .fold(0.0, f64::max);
        for (t, s) in theta.iter_mut().zip(step.step.iter()) {
            *t += s;
        }
        last = Some(step);
        if moved < 1e-4 {
            break;
        }
    }
    finish(priors, theta, errors, last?)
}

fn finish(priors: &[Prior], theta: Vec<f64>, noise: Noise, step: Step) -> Option<Fit> {
    let d = priors.len();
    let covariance = step.precision.clone().try_inverse()?;
    let log_det = step.precision.cholesky()?.ln_determinant();
    let mut log_evidence = step.log_score
        + step.log_prior
        + 0.5 * (d as f64 * (2.0 * std::f64::consts::PI).ln() - log_det);
    let normal = Normal::new(0.0, 1.0).ok()?;
    for (k, prior) in priors.iter().enumerate() {
        if prior.positive {
            // Half of the prior, and only the positive part of the posterior.
            let part = normal.cdf(theta[k] / covariance[(k, k)].sqrt()).max(1e-300);
            log_evidence += 2.0_f64.ln() + part.ln();
        }
    }
    let finite = log_evidence.is_finite() && theta.iter().all(|t| t.is_finite());
    let log_score = step.log_score;
    finite.then_some(Fit {
        theta,
        covariance,
        noise,
        log_score,
        log_evidence,
    })
}

/// Pattern search over the logarithms of the errors.
fn search(start: Noise, post: impl Fn(&Noise) -> f64) -> Noise {
    let mut best = start;
    let mut height = post(&best);
    let mut size: f64 = 0.4;
    while size > 0.02 {
        let mut better = false;
        for which in 0..3 {
            for factor in [size.exp(), (-size).exp()] {
                let mut tried = best;
                match which {
                    0 => tried.arc = (tried.arc * factor).clamp(1e-3, 3.0),
                    1 => tried.level = (tried.level * factor).clamp(1e-3, 3.0),
                    _ => tried.growth = (tried.growth * factor).clamp(1e-3, 3.0),
                }
                let value = post(&tried);
                if value > height + 1e-9 {
                    (best, height, better) = (tried, value, true);
                }
            }
        }
        if !better {
            size *= 0.5;
        }
    }
    best
}
