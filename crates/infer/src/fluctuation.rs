//! Fluctuation of concentrations: turbulence brings puffs and clean air by turns, so that a reading in the
//! plume is the mean times a log-normal factor with a memory (Yee and Chan 1997 compare such densities;
//! Mylne and Mason 1991 measured standard deviations of .5 to 3 times the mean).
//!
//! The factor is exp(u − σ²/2) with u an Ornstein-Uhlenbeck process of standard deviation σ, so that its
//! mean is one. The model is linearised at the most probable u of every row (Laplace's approximation of a
//! state-space model: Durbin and Koopman 2012, section 10.6); what remains is linear and normal, for the
//! filter of [`crate::noise`].

use crate::noise::{Loadings, Noise, smoothed_fluctuation};
use crate::rows::Rows;

/// Most steps towards the most probable deviations, and the change that ends them.
const MOST_STEPS: usize = 12;
const SETTLED: f64 = 0.02;
/// Longest step: exp bends over one.
const LONGEST_STEP: f64 = 1.0;
/// A deviation is at most so many standard deviations: what reads beyond is not this plume.
const FARTHEST_SD: f64 = 4.0;

/// How concentrations in the plume scatter about their mean.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum FluctuationLaw {
    /// Normally, in proportion to the mean: a model that is wrong is left more easily, and a small fluctuation is
    /// the same by either law.
    Normal,
    /// By a log-normal factor.
    LogNormal,
}

/// The most probable fluctuation at every row.
#[derive(Debug, Clone, Default)]
pub(crate) struct Fluctuation {
    /// u, zero where none is told.
    deviation: Vec<f64>,
    /// exp(u − σ²/2).
    factor: Vec<f64>,
    /// What is added to the misfit so that it is linear in u about nothing.
    shift: Vec<f64>,
}

impl Fluctuation {
    /// None: every factor is one.
    pub fn none(rows: usize) -> Self {
        Self {
            deviation: vec![0.0; rows],
            factor: vec![1.0; rows],
            shift: vec![0.0; rows],
        }
    }

    /// The most probable fluctuation where `misfit` is what rows read beyond a plume that does not fluctuate, `plume`
    /// the plume's part of what is expected there; `loadings` become those of the linearised problem. The search starts
    /// from `before`.
    pub fn most_probable(
        rows: &Rows,
        noise: &Noise,
        loadings: &mut Loadings,
        inflation: &[f64],
        (misfit, plume): (&[f64], &[f64]),
        before: Option<&Self>,
    ) -> Self {
        let n = rows.len();
        let sd: Vec<f64> = (0..n)
            .map(|i| noise.fluctuation_sd(loadings.response_s(i), rows.averaging_s(i)))
            .collect();
        let mut deviation = before.map_or_else(|| vec![0.0; n], |b| b.deviation.clone());
        for (u, sd) in deviation.iter_mut().zip(&sd) {
            *u = u.clamp(-FARTHEST_SD * sd, FARTHEST_SD * sd);
        }
        let factor = |u: f64, sd: f64| (u - 0.5 * sd * sd).exp();
        let mut at_mode = loadings.clone();
        let mut linear = vec![0.0; n];
        for _ in 0..MOST_STEPS {
            for i in 0..n {
                let e = factor(deviation[i], sd[i]);
                at_mode.plume[i] = loadings.plume[i] * e;
                at_mode.per_degree[i] = loadings.per_degree[i] * e;
                at_mode.per_sigma_z[i] = loadings.per_sigma_z[i] * e;
                linear[i] =
                    misfit[i] - loadings.plume[i] * (e - 1.0) + at_mode.plume[i] * deviation[i];
            }
            let next = smoothed_fluctuation(rows, noise, &at_mode, inflation, &linear);
            let mut most = 0.0f64;
            for ((u, next), sd) in deviation.iter_mut().zip(next).zip(&sd) {
                let to = next.clamp(-FARTHEST_SD * sd, FARTHEST_SD * sd);
                let step = (to - *u).clamp(-LONGEST_STEP, LONGEST_STEP);
                most = most.max(step.abs());
                *u += step;
            }
            if most < SETTLED {
                break;
            }
        }
        let factor: Vec<f64> = deviation
            .iter()
            .zip(&sd)
            .map(|(u, sd)| factor(*u, *sd))
            .collect();
        let shift = (0..n).map(|i| {
            let beyond = (loadings.plume[i] - plume[i]) * (factor[i] - 1.0);
            loadings.plume[i] * factor[i] * deviation[i] - beyond
        });
        let shift = shift.collect();
        for (i, e) in factor.iter().enumerate() {
            loadings.plume[i] *= e;
            loadings.per_degree[i] *= e;
            loadings.per_sigma_z[i] *= e;
            loadings.per_degree_up[i] *= e;
        }
        Self {
            deviation,
            factor,
            shift,
        }
    }

    /// The factors on the plume of all rows.
    pub fn factors(&self) -> &[f64] {
        &self.factor
    }

    /// What is added to the misfit of a row.
    pub fn shift(&self, row: usize) -> f64 {
        self.shift[row]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const NOISE: Noise = Noise {
        white: 1.0,
        slow: 0.1,
        slow_s: 100.0,
        fluctuation: 1.0,
        fluctuation_s: 5.0,
        wander_deg: 1.0,
        wander_s: 60.0,
        wander_sigma_z: 0.1,
    };

    /// One reading of a plume of 100: the most probable u has no slope of the joint density
    /// (r - 100 (exp(u - 1/2) - 1))² / (2 · 1.01) + u² / 2, with the white and slow noise of a single row.
    #[test]
    fn a_reading_alone_has_the_deviation_of_its_density() {
        for read in [5.0, 60.0, 400.0] {
            let rows = Rows::new(
                std::iter::once(0..1).collect(),
                vec![0.0],
                vec![read],
                vec![f64::NAN],
                vec![true],
            );
            let mut loadings = Loadings {
                plume: vec![100.0],
                per_degree: vec![0.0],
                per_sigma_z: vec![0.0],
                per_degree_up: vec![0.0],
                response_s: Vec::new(),
            };
            let misfit = [read - 100.0];
            let at = (&misfit[..], &[100.0][..]);
            let found =
                Fluctuation::most_probable(&rows.unwrap(), &NOISE, &mut loadings, &[1.0], at, None);
            let cost = |u: f64| {
                let rest = read - 100.0 * (u - 0.5).exp();
                0.5 * (rest * rest / 1.01 + u * u)
            };
            let u = found.deviation[0];
            assert!(
                cost(u) < cost(u - 0.03) && cost(u) < cost(u + 0.03),
                "{read}: {u}"
            );
            assert_eq!(loadings.plume[0], 100.0 * found.factor[0]);
        }
    }
}
