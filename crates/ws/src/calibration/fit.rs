//! The fit itself: robust maximum a posteriori by Levenberg-Marquardt.

use super::CORRELATED_ROWS;
use super::model::{SEARCH_DIRECTIONS, SEARCH_HEIGHTS, SEARCH_REACH};
use super::parameters::{CalibrationParameter, Unknowns};
use crate::WsError;
use nalgebra::{Cholesky, DMatrix, DVector};
use plume::track::Track;
use plume::{DispersionModel, DispersionSpec};

/// Misfit that grows with the plume, share of the plume's part of a reading: gusts move a plume about
/// its mean, and an instantaneous edge is sharper than the mean one.
const PLUME_SHARE: f64 = 0.08;
/// Least misfit of an averaged reading, ppm: what neither noise nor plume explains.
const LEAST_MISFIT_PPM: f64 = 1.5;
/// Standardised misfits beyond this count linearly, not by their square (Huber 1964).
const HUBER: f64 = 2.5;
/// Prior standard deviations beyond which an estimate is implausible: a normal value is there once in
/// 2000.
const IMPLAUSIBLE_SDS: f64 = 3.5;
const MAX_ITERATIONS: usize = 12;

pub(super) struct Problem<'a> {
    base: &'a DispersionSpec,
    unknowns: &'a Unknowns,
    track: &'a Track,
    measured: &'a [f64],
    prior_mean: DVector<f64>,
    prior_sd: DVector<f64>,
}

/// Prediction at one point, with the part that is due to the plume.
struct Prediction {
    ppm: Vec<f64>,
    plume: Vec<f64>,
}

impl<'a> Problem<'a> {
    pub fn new(
        base: &'a DispersionSpec,
        unknowns: &'a Unknowns,
        track: &'a Track,
        measured: &'a [f64],
    ) -> Self {
        Self {
            base,
            unknowns,
            track,
            measured,
            prior_mean: unknowns.prior_mean(),
            prior_sd: unknowns.prior_sd(),
        }
    }

    /// The best of a grid of axes and heights around the prior, and `current`.
    pub fn search(&self, current: &DVector<f64>) -> Result<DVector<f64>, WsError> {
        let mut best = (self.cost(current)?, current.clone());
        let (Some(direction), Some(height)) = (
            self.unknowns.index(CalibrationParameter::Direction),
            self.unknowns.index(CalibrationParameter::Height),
        ) else {
            return Ok(best.1);
        };
        let offset = |k: usize, step: i32, steps: i32| {
            SEARCH_REACH * self.prior_sd[k] * f64::from(step) / f64::from(steps)
        };
        for i in -SEARCH_DIRECTIONS..=SEARCH_DIRECTIONS {
            for j in -SEARCH_HEIGHTS..=SEARCH_HEIGHTS {
                let mut at = current.clone();
                at[direction] =
                    self.prior_mean[direction] + offset(direction, i, SEARCH_DIRECTIONS);
                at[height] = (self.prior_mean[height] + offset(height, j, SEARCH_HEIGHTS)).max(1.0);
                let cost = self.cost(&at)?;
                if cost < best.0 {
                    best = (cost, at);
                }
            }
        }
        Ok(best.1)
    }

    /// Whether an unknown lies implausibly far from its prior.
    pub fn is_far_from_prior(&self, at: &DVector<f64>) -> bool {
        (0..at.len())
            .any(|k| (at[k] - self.prior_mean[k]).abs() > IMPLAUSIBLE_SDS * self.prior_sd[k])
    }

    /// Estimate, covariance and cost there, from `start`, by Levenberg–Marquardt with Marquardt's
    /// (1963) scaling of the damping by the diagonal: the unknowns have different units.
    pub fn fit(&self, start: DVector<f64>) -> Result<(DVector<f64>, DMatrix<f64>, f64), WsError> {
        let mut at = start;
        let mut cost = self.cost(&at)?;
        let mut damping = 1e-3;
        let (mut information, mut descent) = self.normal_equations(&at)?;
        for _ in 0..MAX_ITERATIONS {
            let mut damped = information.clone();
            for k in 0..at.len() {
                damped[(k, k)] *= 1.0 + damping;
            }
            let Some(cholesky) = Cholesky::new(damped) else {
                break;
            };
            let step = cholesky.solve(&descent);
            let tried = &at + &step;
            let tried_cost = self.cost(&tried)?;
            if tried_cost < cost {
                let settled = cost - tried_cost < 1e-4 * (1.0 + cost);
                at = tried;
                cost = tried_cost;
                damping = (damping * 0.2).max(1e-9);
                (information, descent) = self.normal_equations(&at)?;
                if settled {
                    break;
                }
            } else {
                damping *= 8.0;
                if damping > 1e6 {
                    break;
                }
            }
        }
        // Laplace's approximation: the posterior is normal about its mode with the inverse of the
        // information matrix there (the prior's is in it).
        let prior_covariance = DMatrix::from_diagonal(&self.prior_sd.map(|sd| sd * sd));
        let covariance = Cholesky::new(information).map_or(prior_covariance, |c| c.inverse());
        Ok((at, covariance, cost))
    }

    fn predict(&self, at: &DVector<f64>) -> Result<Prediction, WsError> {
        let world = DispersionModel::new(self.unknowns.spec(self.base, at.as_slice()))?;
        let mut ppm = vec![0.0; self.track.len()];
        let mut plume = vec![0.0; self.track.len()];
        self.track.predict_parts(&world, &mut ppm, Some(&mut plume));
        Ok(Prediction { ppm, plume })
    }

    /// Variance of the misfit of a row in which the plume has this part, ppm².
    fn variance(&self, plume_ppm: f64) -> f64 {
        let noise = self.base.sensor.noise_sd_ppm.hypot(LEAST_MISFIT_PPM);
        CORRELATED_ROWS * (noise * noise + (PLUME_SHARE * plume_ppm).powi(2))
    }

    /// Minus the logarithm of the posterior density, up to a constant.
    fn cost(&self, at: &DVector<f64>) -> Result<f64, WsError> {
        let prediction = self.predict(at)?;
        let prior: f64 = (0..at.len())
            .map(|k| ((at[k] - self.prior_mean[k]) / self.prior_sd[k]).powi(2))
            .sum();
        let data: f64 = (0..self.measured.len())
            .map(|i| {
                let variance = self.variance(prediction.plume[i]);
                let z = (self.measured[i] - prediction.ppm[i]).abs() / variance.sqrt();
                let misfit = if z < HUBER {
                    z * z
                } else {
                    HUBER * (2.0 * z - HUBER)
                };
                // The variance depends on the unknowns, so that its logarithm belongs to the
                // likelihood: without it a fit would inflate the plume to excuse its misfits. It
                // counts as little as the row does.
                misfit + variance.ln() / CORRELATED_ROWS
            })
            .sum();
        Ok(0.5 * (prior + data))
    }

    /// Gauss-Newton information matrix and negative gradient of the cost. The variance is held at its
    /// value here, as in iteratively reweighted least squares; the cost decides whether a step is
    /// taken.
    fn normal_equations(&self, at: &DVector<f64>) -> Result<(DMatrix<f64>, DVector<f64>), WsError> {
        let here = self.predict(at)?;
        let n = at.len();
        let rows = self.measured.len();
        let mut jacobian = DMatrix::zeros(rows, n);
        for k in 0..n {
            // A forward difference, small beside the prior: its error only slows the fit, since the
            // cost itself decides on every step.
            let step = 1e-3 * self.prior_sd[k].min(1.0 + at[k].abs());
            let mut aside = at.clone();
            aside[k] += step;
            let there = self.predict(&aside)?;
            for i in 0..rows {
                jacobian[(i, k)] = (there.ppm[i] - here.ppm[i]) / step;
            }
        }
        let mut information = DMatrix::zeros(n, n);
        let mut descent = DVector::zeros(n);
        for i in 0..rows {
            let variance = self.variance(here.plume[i]);
            let misfit = self.measured[i] - here.ppm[i];
            let z = misfit.abs() / variance.sqrt();
            // Huber's (1964) weight: beyond the threshold a misfit pulls with constant force.
            let weight = if z < HUBER { 1.0 } else { HUBER / z } / variance;
            for a in 0..n {
                let weighted = weight * jacobian[(i, a)];
                descent[a] += weighted * misfit;
                for b in 0..=a {
                    information[(a, b)] += weighted * jacobian[(i, b)];
                }
            }
        }
        for a in 0..n {
            let precision = self.prior_sd[a].powi(-2);
            information[(a, a)] += precision;
            descent[a] += precision * (self.prior_mean[a] - at[a]);
            for b in 0..a {
                information[(b, a)] = information[(a, b)];
            }
        }
        Ok((information, descent))
    }
}
