//! The plume without a discrepancy that is nearest to what is believed.
//!
//! A discrepancy and the unknowns may do the same, so that the readings do not tell which of them does it
//! (Brynjarsdóttir and O'Hagan 2014). The plume of the model's own form that is nearest to both together, by
//! least squares over the readings, they do tell (Tuo and Wu 2015). A plume that is to be flown in as it
//! stands has to be this one.

use crate::InferError;
use crate::evidence::{Known, Products};
use crate::fit::{Fit, Problem};
use crate::passes::passes;
use crate::posterior::{Posterior, widened};
use crate::rows::ForwardModel;
use nalgebra::{DMatrix, DVector};
use std::ops::Range;

/// The unknowns of the nearest plume.
#[derive(Debug, Clone)]
pub struct ClosestModel {
    /// Mean.
    pub mean: DVector<f64>,
    /// Covariance.
    pub covariance: DMatrix<f64>,
    /// Variances before any reading: those of the priors, and what a discrepancy may add.
    pub prior: DVector<f64>,
}

impl ClosestModel {
    /// The same where what is known beforehand, `prior_mean` and `prior_sd`, is known of this plume: of unknowns to which an
    /// discrepancy or a meander adds, a posterior that knows it of the unknowns alone forgets a part. Discrepancies and
    /// unknowns so are independent where it counts (Plumlee 2017).
    #[must_use]
    pub fn known_beforehand(self, prior_mean: &DVector<f64>, prior_sd: &DVector<f64>) -> Self {
        let Some(told) = self.covariance.clone().cholesky() else {
            return self;
        };
        let forgotten = DVector::from_fn(prior_sd.len(), |k, _| {
            (prior_sd[k].powi(-2) - self.prior[k].recip()).max(0.0)
        });
        let mut precision = told.inverse();
        let pull = &precision * &self.mean + forgotten.component_mul(prior_mean);
        precision += DMatrix::from_diagonal(&forgotten);
        match precision.cholesky() {
            Some(precision) => Self {
                mean: precision.solve(&pull),
                covariance: precision.inverse(),
                prior: prior_sd.map(|sd| sd * sd),
            },
            None => self,
        }
    }
}

impl<M: ForwardModel> Problem<'_, M> {
    /// The unknowns of the plume without a discrepancy that is nearest to what is believed. Their
    /// standard deviations are at least those of its scatter from pass to pass, which other passes of
    /// the same plume would have as well (White 1982).
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
        // What each column changes at the readings, in units of the unknowns.
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
        // The misfit of that plume pulls each pass elsewhere.
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

    /// Cuts the record into passes by how far readings stand out beside a fit.
    pub(crate) fn passes(&self, fit: &Fit) -> Result<Vec<Vec<Range<usize>>>, InferError> {
        let there = self.expected_of(fit)?;
        let excess: Vec<f64> = (0..self.rows.len())
            .map(|i| (fit.misfit[i] + there.plume[i]) / fit.noise.white)
            .collect();
        Ok(passes(self.rows, &excess, self.policy.passes))
    }
}
