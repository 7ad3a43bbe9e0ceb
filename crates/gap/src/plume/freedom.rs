//! Every cause of the catalogue at once, to first order: what a noise is fitted beside.
//!
//! A noise that is fitted to the base's residual grows until it hides what the base lacks. Here
//! the noise's likelihood has the amplitudes of all mechanisms integrated out under their
//! physical priors, each sensor with faults of its own, so that what any of them could explain
//! does not count as noise, and what none explains does.

use ::plume::mechanism::{Family, MechanismId};
use nalgebra::DVector;

use super::candidate::{self, Start};
use super::fit::{Context, Effort};
use super::linear::{self, marginal, scores};
use super::model::{Model, Prediction};
use super::noise::{Loading, NoiseModel, Rows, Whitener};
use super::nuisance::{Spacing, hats};

/// Columns before whitening, with the standard deviations of their coefficients.
#[derive(Debug, Clone, Default)]
pub(crate) struct Freedom {
    pub raw: Vec<Vec<f64>>,
    pub sd: Vec<f64>,
}

/// Slow swings of the plume that no wind shows, where they are free too: their knots and their
/// size, degrees.
const SWINGS: Spacing = Spacing {
    s: 60.0,
    most: 10.0,
};
const SWINGS_DEG: f64 = 1.0;

/// The start that stands for a mechanism, where one does.
fn stands_for(id: MechanismId, starts: &[Start]) -> Option<&Start> {
    use MechanismId as M;
    match id {
        // A delay, an offset in pressure and a gain about zero are first-order twins of others;
        // a limit and the grid of further sources have no first order.
        M::SensorLag | M::CrossSensitivityPressure | M::SensorSaturation | M::SecondSource => None,
        M::SensorGain => starts.last(),
        M::MixingLid => starts.get(starts.len() / 2),
        _ => starts.first(),
    }
}

impl Freedom {
    /// The columns at a model.
    pub fn new(
        ctx: &Context<'_>,
        model: &Model,
        prediction: &Prediction,
        loading: &[Loading],
        effort: Effort,
    ) -> Self {
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
        if effort.slow_swings {
            let slow = hats(ctx, loading, SWINGS);
            out.sd.extend(vec![SWINGS_DEG; slow.len()]);
            out.raw.extend(slow);
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
        let own = |of: &dyn Fn(usize) -> f64| DVector::from_fn(columns.len(), |k, _| of(k));
        let (centre, precision) = (own(&|k| -at[k]), own(&|k| self.sd[k].powi(-2)));
        let gram = linear::gram(&columns);
        let Some(known) = marginal(&gram, &scores(&columns, &white), &centre, &precision) else {
            return f64::NEG_INFINITY;
        };
        // What the priors' own width and the way from their centres take.
        let taken = |k: usize| self.sd[k].ln() + 0.5 * (at[k] / self.sd[k]).powi(2);
        whitener.log_likelihood + known - (0..columns.len()).map(taken).sum::<f64>()
    }
}
