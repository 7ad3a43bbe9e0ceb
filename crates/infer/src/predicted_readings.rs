//! Predicted readings of a future flight: the separation of two sets of mechanisms that they would give.
//!
//! The separation of a second set from a first is the whitened distance between their predictions, after the unknowns of
//! the second have moved as far as its posterior and the noise allow:
//!
//! > min over θ of ½ |W (first − second(θ))|² + ½ (θ − θ₀)ᵀ C⁻¹ (θ − θ₀),
//!
//! with θ₀ and C the second's values and their covariance. This is a fit to the first's predictions in coordinates with
//! θ₀ = 0 and C = 1, with free axis drift and discrepancy. If the first set is the truth, the logarithm of the likelihood ratio is then normal with
//! mean m and variance 2 m, where m is the separation.

use crate::InferError;
use crate::discrepancy::{Basis, Sizes};
use crate::fit::{Point, Problem};
use crate::mechanism_search::{Catalogue, FittedSet, Question};
use crate::noise::{Loadings, Noise};
use crate::rows::{AxisTurn, ForwardModel, PlumePlace, Prediction, Prior, Rows};
use nalgebra::{Cholesky, DMatrix, DVector};

/// Future readings as one set predicts them.
pub struct PredictedReadings<'a> {
    question: Question<'a>,
    /// The predictions, in place of measured readings.
    rows: Rows,
    basis: Basis,
    sizes: Sizes,
    noise: Noise,
    loadings: Loadings,
}

/// Normal approximation of a set's posterior, with its sizes of discrepancy, axis drift and noise.
#[derive(Debug, Clone)]
pub struct NormalPosterior {
    at: DVector<f64>,
    /// Lower triangle whose product with itself transposed is the covariance.
    root: DMatrix<f64>,
    sizes: Sizes,
    noise: Noise,
}

impl NormalPosterior {
    fn new(
        at: &[f64],
        covariance: DMatrix<f64>,
        sizes: Sizes,
        noise: Noise,
    ) -> Result<Self, InferError> {
        Ok(Self {
            at: DVector::from_column_slice(at),
            root: Cholesky::new(covariance)
                .ok_or(InferError::NoPosterior)?
                .l(),
            sizes,
            noise,
        })
    }

    fn moved(&self, by: &[f64]) -> Vec<f64> {
        let at = &self.at + &self.root * DVector::from_column_slice(by);
        at.as_slice().to_vec()
    }
}

impl<'a> Question<'a> {
    /// The normal approximation of a set's posterior.
    ///
    /// # Errors
    /// A problem that has no posterior.
    pub fn believed<M: Catalogue>(&self, of: &FittedSet<M>) -> Result<NormalPosterior, InferError> {
        let covariance = self.posterior(of)?.covariance();
        NormalPosterior::new(of.at(), covariance, of.likeliest_sizes(), of.fit().noise)
    }

    /// Predictions of a set for one sensor at `time_s`; `there` is its model along the future track.
    ///
    /// # Errors
    /// Values that the model refuses, and times that do not grow.
    pub fn ahead<M: Catalogue>(
        &self,
        first: &FittedSet<M>,
        there: &impl ForwardModel,
        time_s: &[f64],
    ) -> Result<PredictedReadings<'a>, InferError> {
        let n = time_s.len();
        let expected = there.predict(first.at(), &vec![AxisTurn::NONE; n])?.reading;
        let unstated = vec![f64::NAN; n];
        let rows = Rows::new(
            std::iter::once(0..n).collect(),
            time_s.to_vec(),
            expected,
            unstated,
            vec![true; n],
        )?;
        let problem = Problem::new(there, &rows, self.policy, self.sensor_sd, &[]);
        let at = |weights: usize| Point {
            at: first.at().to_vec(),
            weights: vec![0.0; weights],
        };
        let basis = problem.basis(&at(0))?;
        let noise = first.fit().noise;
        let loadings = problem.loadings(&at(basis.len()), &basis, &noise)?;
        Ok(PredictedReadings {
            question: *self,
            sizes: first.likeliest_sizes(),
            basis,
            noise,
            loadings,
            rows,
        })
    }
}

impl PredictedReadings<'_> {
    /// Separation of a second set from the predicting one by these readings, nats; `there` is the second's model along
    /// the future track.
    ///
    /// # Errors
    /// Values that the model refuses.
    pub fn separation(
        &self,
        there: &impl ForwardModel,
        believed: &NormalPosterior,
    ) -> Result<f64, InferError> {
        let unknowns = believed.at.len();
        let model = Moved {
            model: there,
            believed,
            priors: vec![Prior { mean: 0.0, sd: 1.0 }; unknowns],
        };
        let (policy, sensor_sd) = (self.question.policy, self.question.sensor_sd);
        let problem = Problem::new(&model, &self.rows, policy, sensor_sd, &[]);
        let start = Point {
            at: vec![0.0; unknowns],
            weights: vec![0.0; self.basis.len()],
        };
        // The larger of both sizes: either set may need as much on the new track as it has needed so far.
        let sizes = std::array::from_fn(|k| self.sizes[k].max(believed.sizes[k]));
        let noise = larger(&self.noise, &believed.noise);
        let metric = problem.metric_of(self.loadings.clone(), &noise, &vec![1.0; self.rows.len()]);
        Ok(problem.steps_under(&start, &self.basis, sizes, &metric)?.1)
    }
}

/// Noise whose parts are the larger of two, with the memories of the first.
fn larger(a: &Noise, b: &Noise) -> Noise {
    Noise {
        white: a.white.max(b.white),
        slow: a.slow.max(b.slow),
        fluctuation: a.fluctuation.max(b.fluctuation),
        wander_deg: a.wander_deg.max(b.wander_deg),
        wander_sigma_z: a.wander_sigma_z.max(b.wander_sigma_z),
        ..*a
    }
}

/// A model in coordinates in which the posterior of its unknowns is standard normal.
struct Moved<'m, M> {
    model: &'m M,
    believed: &'m NormalPosterior,
    priors: Vec<Prior>,
}

impl<M: ForwardModel> ForwardModel for Moved<'_, M> {
    fn priors(&self) -> &[Prior] {
        &self.priors
    }

    fn ln_strength(&self) -> Option<usize> {
        None
    }

    fn starts(&self) -> Vec<Vec<f64>> {
        Vec::new()
    }

    fn predict(&self, at: &[f64], turns: &[AxisTurn]) -> Result<Prediction, InferError> {
        self.model.predict(&self.believed.moved(at), turns)
    }

    fn under_way_s(&self, row: usize) -> f64 {
        self.model.under_way_s(row)
    }

    fn response_s(&self, at: &[f64]) -> Result<Vec<f64>, InferError> {
        self.model.response_s(&self.believed.moved(at))
    }

    fn places(&self, at: &[f64]) -> Result<Vec<PlumePlace>, InferError> {
        self.model.places(&self.believed.moved(at))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Policy;
    use crate::discrepancy::COORDINATES;

    const NOISE: Noise = Noise {
        white: 2.0,
        slow: 3.0,
        slow_s: 40.0,
        fluctuation: 0.2,
        fluctuation_s: 5.0,
        wander_deg: 1.0,
        wander_s: 60.0,
        wander_sigma_z: 0.1,
    };
    const ROWS: usize = 80;

    /// A background, a slope in time and an offset, of which the last two are unknown.
    struct Line {
        background: f64,
        priors: [Prior; 2],
    }

    impl ForwardModel for Line {
        fn priors(&self) -> &[Prior] {
            &self.priors
        }

        fn ln_strength(&self) -> Option<usize> {
            None
        }

        fn starts(&self) -> Vec<Vec<f64>> {
            Vec::new()
        }

        fn predict(&self, at: &[f64], turns: &[AxisTurn]) -> Result<Prediction, InferError> {
            let bent = |t: f64| self.background * (t / 25.0).sin();
            let row = |k: usize| bent(k as f64) + at[0] * k as f64 / 40.0 + at[1];
            Ok(Prediction {
                reading: (0..turns.len()).map(row).collect(),
                plume: vec![0.0; turns.len()],
            })
        }

        fn places(&self, _: &[f64]) -> Result<Vec<PlumePlace>, InferError> {
            let nowhere = PlumePlace {
                ln_distance: f64::NAN,
                ..PlumePlace::default()
            };
            Ok(vec![nowhere; ROWS])
        }
    }

    fn line(background: f64) -> Line {
        let priors = [Prior { mean: 0.0, sd: 9.0 }; 2];
        Line { background, priors }
    }

    /// The same minimum as a normal density has it: the difference under the noise's covariance and
    /// what the unknowns make of theirs, written out.
    fn dense(difference: &DVector<f64>, covariance: &DMatrix<f64>) -> f64 {
        let columns = DMatrix::from_fn(ROWS, 2, |k, j| if j == 0 { k as f64 / 40.0 } else { 1.0 });
        let noise = DMatrix::from_fn(ROWS, ROWS, |i, j| {
            let slow = NOISE.slow.powi(2) * (-(i as f64 - j as f64).abs() / NOISE.slow_s).exp();
            slow + if i == j { NOISE.white.powi(2) } else { 0.0 }
        });
        let all = noise + &columns * covariance * columns.transpose();
        0.5 * difference.dot(&Cholesky::new(all).unwrap().solve(difference))
    }

    #[test]
    fn the_separation_is_that_of_normal_densities() {
        let policy = Policy::default();
        let (first, second) = (line(8.0), line(0.0));
        let time_s: Vec<f64> = (0..ROWS).map(|k| k as f64).collect();
        let expected = first
            .predict(&[1.0, 5.0], &[AxisTurn::NONE; ROWS])
            .unwrap()
            .reading;
        let series = std::iter::once(0..ROWS).collect();
        let unstated = vec![f64::NAN; ROWS];
        let rows = Rows::new(series, time_s, expected.clone(), unstated, vec![true; ROWS]).unwrap();
        let problem = Problem::new(&first, &rows, &policy, 1.0, &[]);
        let none = Loadings {
            plume: vec![0.0; ROWS],
            per_degree: vec![0.0; ROWS],
            per_sigma_z: vec![0.0; ROWS],
            per_degree_up: vec![0.0; ROWS],
            response_s: Vec::new(),
        };
        let ahead = PredictedReadings {
            question: Question {
                rows: &rows,
                policy: &policy,
                sensor_sd: 1.0,
                asked: &[],
            },
            basis: problem.turning.axis_drift.clone(),
            sizes: [0.0; COORDINATES],
            noise: NOISE,
            loadings: none,
            rows: rows.clone(),
        };
        let at = [0.5, -2.0];
        let believed = |covariance: &DMatrix<f64>| {
            NormalPosterior::new(&at, covariance.clone(), [0.0; COORDINATES], NOISE).unwrap()
        };
        let there = second
            .predict(&at, &[AxisTurn::NONE; ROWS])
            .unwrap()
            .reading;
        let apart = DVector::from_vec(expected) - DVector::from_vec(there);
        for size in [0.01, 1.0, 10.0] {
            let covariance: DMatrix<f64> =
                size * DMatrix::from_row_slice(2, 2, &[1.0, -0.6, -0.6, 2.0]);
            let believed = believed(&covariance);
            let nats = ahead.separation(&second, &believed).unwrap();
            let oracle = dense(&apart, &covariance);
            // A fit ends where a step promises less than this.
            assert!(
                (nats - oracle).abs() < policy.settled_nats,
                "{nats} {oracle}"
            );
        }
        // What can do the same is not told apart.
        let nats = ahead.separation(&first, &believed(&(1e4 * DMatrix::identity(2, 2))));
        let nats = nats.unwrap();
        assert!(nats < policy.settled_nats, "{nats}");
    }
}
