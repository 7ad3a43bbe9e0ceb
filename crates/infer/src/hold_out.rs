//! Hold-out prediction: readings of a pass predicted from the others, and the log score.

use crate::InferError;
use crate::discrepancy::{AXIS_DRIFT, Sizes, UPWARD_DRIFT};
use crate::evidence::{Evidence, Known, Products};
use crate::mechanism_search::{Catalogue, FittedSet, Question};
use crate::parallel_map::parallel_map;
use crate::rows::{AxisTurn, Prediction};
use std::ops::Range;

/// The axis in a held-out pass is unknown, so the prediction is a mean over turns: their range in standard deviations to
/// both sides, and their number.
const REACH_SD: f64 = 2.5;
const TURNS: usize = 15;
/// Upward turns in standard deviations, with their weights: Gauss-Hermite quadrature of three nodes, as the plume is wide
/// against them.
const UPWARD: [(f64, f64); 3] = [
    (-1.732_050_807_568_877, 1.0 / 6.0),
    (0.0, 2.0 / 3.0),
    (1.732_050_807_568_877, 1.0 / 6.0),
];

/// A set's products pass by pass.
pub(crate) struct ByPass {
    known: Known,
    products: Vec<Products>,
    sizes: Sizes,
    ln_more: f64,
}

impl ByPass {
    fn sum(&self, times: &[f64]) -> Products {
        let mut sum = Products::zero(self.known.layout.columns);
        for (products, times) in self.products.iter().zip(times) {
            if *times != 0.0 {
                sum.add(products, *times);
            }
        }
        sum
    }

    /// Log evidence with these weights of the passes.
    pub fn ln(&self, times: &[f64]) -> f64 {
        let sum = self.sum(times);
        let mut evidence = Evidence::new(&sum, &self.known);
        evidence.ln(&self.sizes) + self.ln_more
    }

    /// Log predictive density of each pass given the others, nats.
    pub fn hold_out(&self) -> Vec<f64> {
        let n = self.products.len();
        let all = self.ln(&vec![1.0; n]);
        (0..n).map(|k| all - self.ln(&all_but(n, k))).collect()
    }

    /// Step of the unknowns from the fit's point without a pass.
    fn step_without(&self, k: usize, coordinates: &[usize]) -> Option<Vec<f64>> {
        let sum = self.sum(&all_but(self.products.len(), k));
        let coordinates = coordinates.iter().copied();
        let (step, _) = self.known.solved(&sum, &self.sizes, coordinates)?;
        Some(step.as_slice()[self.known.layout.unknowns..].to_vec())
    }
}

/// Weight one for every pass except one.
fn all_but(n: usize, k: usize) -> Vec<f64> {
    let mut times = vec![1.0; n];
    times[k] = 0.0;
    times
}

/// Predictions of held-out passes without discrepancy: the skill of the extended model alone.
#[derive(Debug, Clone, Default)]
pub struct Expected {
    /// The reading of each row.
    pub reading: Vec<f64>,
    /// The plume's part of it.
    pub plume: Vec<f64>,
    /// Log score of each pass, nats.
    pub ln: Vec<f64>,
}

impl Question<'_> {
    pub(crate) fn by_pass<M: Catalogue>(
        &self,
        of: &FittedSet<M>,
        passes: &[Vec<Range<usize>>],
    ) -> Result<ByPass, InferError> {
        let problem = self.beside(of, &of.model);
        let (known, products) = problem.products(of.fit(), &[], passes)?;
        let sizes = of.likeliest_sizes();
        let noise = problem.ln_noise_prior(&of.fit().noise);
        Ok(ByPass {
            known,
            products,
            ln_more: of.ln_prior + noise + self.policy.ln_sizes(&sizes),
            sizes,
        })
    }

    /// Predictions of every held-out pass by sets without and with a mechanism. Both use the axis uncertainty of the set
    /// with the mechanism; otherwise only one of them would be blurred.
    ///
    /// # Errors
    /// Values that the model refuses.
    pub fn compared<M: Catalogue>(
        &self,
        without: &FittedSet<M>,
        with: &FittedSet<M>,
        passes: &[Vec<Range<usize>>],
    ) -> Result<[Expected; 2], InferError> {
        let turns = unseen_turns(with);
        Ok([
            self.expected(without, passes, &turns)?,
            self.expected(with, passes, &turns)?,
        ])
    }

    /// Predictions of every held-out pass by a set: means over `turns` of the axis, each with its weight.
    ///
    /// # Errors
    /// Values that the model refuses.
    fn expected<M: Catalogue>(
        &self,
        of: &FittedSet<M>,
        passes: &[Vec<Range<usize>>],
        turns: &[(AxisTurn, f64)],
    ) -> Result<Expected, InferError> {
        let by_pass = self.by_pass(of, passes)?;
        let n = self.rows.len();
        let fit = of.fit();
        let coordinates: Vec<usize> = fit.basis.coordinates().collect();
        let total: f64 = turns.iter().map(|t| t.1).sum();
        let mut out = Expected {
            reading: vec![0.0; n],
            plume: vec![0.0; n],
            ln: by_pass.hold_out(),
        };
        let steps: Vec<usize> = (0..passes.len()).collect();
        let predicted = |k: &usize| -> Result<Vec<Prediction>, InferError> {
            let mut at = fit.point.at.clone();
            if let Some(step) = by_pass.step_without(*k, &coordinates) {
                at.iter_mut().zip(step).for_each(|(x, s)| *x += s);
            }
            let turned = turns.iter().map(|t| of.model.predict(&at, &vec![t.0; n]));
            turned.collect()
        };
        for (pass, predicted) in passes.iter().zip(parallel_map(&steps, predicted)) {
            for ((_, weight), there) in turns.iter().zip(predicted?) {
                for i in pass.iter().cloned().flatten() {
                    out.reading[i] += weight / total * there.reading[i];
                    out.plume[i] += weight / total * there.plume[i];
                }
            }
        }
        Ok(out)
    }
}

/// Turns that the axis may have in a held-out pass, with their weights: by its drift, and to the sides by its wander as well.
fn unseen_turns<M: Catalogue>(of: &FittedSet<M>) -> Vec<(AxisTurn, f64)> {
    let sizes = of.likeliest_sizes();
    let sideways_deg = sizes[AXIS_DRIFT].hypot(of.fit().noise.wander_deg);
    let upward_deg = sizes[UPWARD_DRIFT];
    let sideways = (0..TURNS).map(|k| REACH_SD * (2.0 * k as f64 / (TURNS - 1) as f64 - 1.0));
    let upward: &[_] = if upward_deg > 0.0 {
        &UPWARD
    } else {
        &UPWARD[1..2]
    };
    let turn = |z: f64, (up, weight): &(f64, f64)| {
        let turn = AxisTurn {
            clockwise_deg: z * sideways_deg,
            upward_deg: up * upward_deg,
        };
        (turn, weight * (-0.5 * z * z).exp())
    };
    let turns = sideways.flat_map(|z| upward.iter().map(move |up| turn(z, up)));
    turns.collect()
}
