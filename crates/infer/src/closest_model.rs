//! The model without discrepancy that is closest to the posterior.
//!
//! A discrepancy and the unknowns can have the same effect, so the readings do not determine either alone (Brynjarsdóttir
//! and O'Hagan 2014). They do determine the model that is closest to both together by least squares over the readings
//! (Tuo and Wu 2015). A simulation without discrepancy must use these values.

use crate::InferError;
use crate::evidence::{Known, Products};
use crate::fit::{Fit, Problem};
use crate::passes::passes;
use crate::posterior::{Posterior, widened};
use crate::rows::{ForwardModel, Prior};
use nalgebra::{DMatrix, DVector};
use std::ops::Range;

/// The unknowns of the closest model.
#[derive(Debug, Clone)]
pub struct ClosestModel {
    /// Mean.
    pub mean: DVector<f64>,
    /// Covariance.
    pub covariance: DMatrix<f64>,
    /// Prior variances, including the part of a discrepancy.
    pub prior: DVector<f64>,
}

impl ClosestModel {
    /// Applies the priors of the unknowns to this model instead of to the unknowns alone. A discrepancy or
    /// meander adds to the unknowns, so a posterior with priors on the unknowns alone loses part of them. Discrepancies and
    /// unknowns are then independent where it matters (Plumlee 2017).
    #[must_use]
    pub fn known_beforehand(self, priors: &[Prior]) -> Self {
        let Some(told) = self.covariance.clone().cholesky() else {
            return self;
        };
        let of_each = |of: &dyn Fn(usize) -> f64| DVector::from_fn(priors.len(), |k, _| of(k));
        let forgotten = of_each(&|k| (priors[k].sd.powi(-2) - self.prior[k].recip()).max(0.0));
        let mut precision = told.inverse();
        let pull = &precision * &self.mean + of_each(&|k| forgotten[k] * priors[k].mean);
        precision += DMatrix::from_diagonal(&forgotten);
        match precision.cholesky() {
            Some(precision) => Self {
                mean: precision.solve(&pull),
                covariance: precision.inverse(),
                prior: of_each(&|k| priors[k].sd.powi(2)),
            },
            None => self,
        }
    }
}

impl<M: ForwardModel> Problem<'_, M> {
    /// The unknowns of the model without discrepancy that is closest to a posterior. Their standard deviations are at
    /// least those of its scatter between passes, which further passes would show too (White 1982).
    ///
    /// # Errors
    /// Values that the model refuses.
    pub fn nearest(&self, to: &Posterior) -> Result<ClosestModel, InferError> {
        let fit = to.fit();
        let (known, by_pass) = self.by_pass(fit)?;
        let layout = &known.layout;
        let (first, n) = (layout.unknowns, self.unknowns());
        let mut whole = Products::zero(layout.columns);
        by_pass.iter().for_each(|p| whole.add(p, 1.0));
        let precision = known.of_unknowns(&whole).ok_or(InferError::NoPosterior)?;
        let rows_of = |products: &Products| -> DMatrix<f64> {
            products.matrix(layout.columns).rows(first, n).into_owned()
        };
        // Effect of each column on the readings, in units of the unknowns.
        let change = rows_of(&whole);
        let mut worth = DMatrix::zeros(n, layout.tried);
        worth.columns_mut(first, n).fill_with_identity();
        let mut weights = DVector::zeros(layout.columns);
        let of_discrepancy = layout.weights.iter().zip(&fit.point.weights);
        for (place, weight) in of_discrepancy.take(fit.basis.of_discrepancy()) {
            worth.set_column(*place, &precision.solve(&change.column(*place)));
            weights[*place] = *weight;
        }
        let step = to.step();
        let nearest = &worth * (weights.rows(0, layout.tried) + &step);
        let mut covariance = to.covariance_of(&worth);
        let prior = to.prior_variance(&worth);
        // The misfit of that model gives each pass its own pull.
        let mut from_here = -weights;
        for (place, k) in layout.weights.iter().zip(0..) {
            if k >= fit.basis.of_discrepancy() {
                from_here[*place] = step[*place];
            }
        }
        from_here.rows_mut(first, n).copy_from(&nearest);
        let pull = |products: &Products| {
            let rows = rows_of(products);
            let misfit = rows.column(layout.columns - 1).into_owned();
            precision.solve(&(misfit - &rows * &from_here))
        };
        let pulls: Vec<DVector<f64>> = by_pass.iter().map(pull).collect();
        let count = pulls.len() as f64;
        let mean = pulls.iter().sum::<DVector<f64>>() / count;
        for k in 0..n {
            let square: f64 = pulls.iter().map(|p| (p[k] - mean[k]).powi(2)).sum();
            let scatter = square * count / (count - 1.0).max(1.0);
            let variance = covariance[(k, k)];
            let grown = widened(variance, prior[k], scatter / variance);
            covariance.row_mut(k).scale_mut(grown);
            covariance.column_mut(k).scale_mut(grown);
        }
        Ok(ClosestModel {
            mean: DVector::from_column_slice(&fit.point.at) + nearest,
            covariance,
            prior,
        })
    }

    /// Products of all columns at a fit, pass by pass.
    pub(crate) fn by_pass(&self, fit: &Fit) -> Result<(Known, Vec<Products>), InferError> {
        self.products(fit, &[], &self.passes(fit)?)
    }

    /// Divides the record into passes at the excess over a fit.
    pub(crate) fn passes(&self, fit: &Fit) -> Result<Vec<Vec<Range<usize>>>, InferError> {
        let there = self.expected_of(fit)?;
        let excess: Vec<f64> = (0..self.rows.len())
            .map(|i| (fit.misfit[i] + there.plume[i]) / fit.noise.white)
            .collect();
        Ok(passes(self.rows, &excess, self.policy.passes))
    }
}
