//! Every cause of the catalogue at once, to first order: what a noise is fitted beside.
//!
//! A noise that is fitted to the base's residual grows until it hides what the base lacks. Here
//! the noise's likelihood has the amplitudes of all mechanisms integrated out under their
//! physical priors, each sensor with faults of its own, so that what any of them could explain
//! does not count as noise, and what none explains does.

use ::plume::mechanism::{Family, MechanismId};
use nalgebra::{Cholesky, DMatrix, DVector};

use super::candidate::{self, Start};
use super::fit::Context;
use super::linear::{products, scores};
use super::model::{Model, Prediction};
use super::noise::{NoiseModel, Rows, Whitener};

/// Columns before whitening, with the standard deviations of their coefficients.
#[derive(Debug, Clone, Default)]
pub(crate) struct Freedom {
    pub raw: Vec<Vec<f64>>,
    pub sd: Vec<f64>,
}

/// The start that stands for a mechanism, where one does.
fn stands_for(id: MechanismId, starts: &[Start]) -> Option<&Start> {
    use MechanismId as M;
    match id {
        // A delay, an offset in pressure and a gain about zero are first-order twins of others;
        // a limit and the grid of further sources have no first order.
        M::SensorLag | M::CrossSensitivityPressure | M::SensorSaturation | M::SecondSource => None,
        M::SensorGain => starts.last(),
        M::MixingLid => starts.get(1),
        _ => starts.first(),
    }
}

impl Freedom {
    /// The columns at a model.
    pub fn new(ctx: &Context<'_>, model: &Model, prediction: &Prediction) -> Self {
        let all = candidate::starts(ctx, model, prediction);
        let platforms = ctx.data.ranges().len();
        let mut out = Self::default();
        for (k, derivative) in ctx
            .derivatives(model, &prediction.reading)
            .into_iter()
            .enumerate()
        {
            out.raw.push(derivative);
            out.sd.push(model.free[k].sd.max(model.spec_of(k).prior_sd));
        }
        for &id in MechanismId::ALL {
            let own: Vec<Start> = all.iter().filter(|s| s.id == id).cloned().collect();
            let Some(start) = stands_for(id, &own) else {
                continue;
            };
            for (k, sd) in start.sd.iter().enumerate() {
                let column = start.column(ctx, model, prediction, k);
                if id.spec().family == Family::Sensor && platforms > 1 {
                    for range in ctx.data.ranges() {
                        let mut own = vec![0.0; column.len()];
                        own[range.clone()].copy_from_slice(&column[range.clone()]);
                        out.raw.push(own);
                        out.sd.push(*sd);
                    }
                } else {
                    out.raw.push(column);
                    out.sd.push(*sd);
                }
            }
        }
        out
    }

    /// Log likelihood of a noise with the coefficients integrated out, nats; `residual` has
    /// the columns with coefficients `at` taken from it already.
    pub fn marginal(
        &self,
        rows: &Rows<'_>,
        noise: &NoiseModel,
        residual: &[f64],
        at: &[f64],
    ) -> f64 {
        let whitener = Whitener::new(rows, noise, residual);
        let mut white = residual.to_vec();
        let mut columns = self.raw.clone();
        let mut views: Vec<&mut [f64]> = columns.iter_mut().map(Vec::as_mut_slice).collect();
        views.push(&mut white);
        whitener.whiten(&mut views);
        let n = columns.len();
        let centre = DVector::from_fn(n, |k, _| -at[k] / self.sd[k]);
        let gram = products(&columns, &columns);
        let a = DMatrix::from_fn(n, n, |i, j| {
            self.sd[i] * self.sd[j] * gram[(i, j)] + if i == j { 1.0 } else { 0.0 }
        });
        let plain = scores(&columns, &white);
        let score = DVector::from_fn(n, |k, _| self.sd[k] * plain[k]) + &centre;
        let Some(chol) = Cholesky::new(a) else {
            return f64::NEG_INFINITY;
        };
        let half_log_det: f64 = (0..n).map(|k| chol.l_dirty()[(k, k)].ln()).sum();
        whitener.log_likelihood + 0.5 * score.dot(&chol.solve(&score))
            - 0.5 * centre.norm_squared()
            - half_log_det
    }
}
