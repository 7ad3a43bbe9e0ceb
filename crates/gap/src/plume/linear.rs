//! Gaussian linear algebra in few dimensions: the evidence of whitened columns.

use nalgebra::{Cholesky, DMatrix, DVector};

/// A Gaussian posterior of linear coefficients.
#[derive(Debug, Clone)]
pub(crate) struct Posterior {
    /// Coefficients, as steps from where the columns were taken.
    pub mean: DVector<f64>,
    /// Their covariance.
    pub covariance: DMatrix<f64>,
}

/// The posterior of coefficients a in residual = W a + unit noise, with `gram` = WᵀW,
/// `score` = Wᵀ residual and independent normal priors of `centre` and `precision`.
///
/// A precision of zero counts as flat.
pub(crate) fn posterior(
    gram: &DMatrix<f64>,
    score: &DVector<f64>,
    centre: &DVector<f64>,
    precision: &DVector<f64>,
) -> Option<Posterior> {
    let n = score.len();
    if n == 0 {
        return Some(Posterior {
            mean: DVector::zeros(0),
            covariance: DMatrix::zeros(0, 0),
        });
    }
    // Scaled to a unit diagonal: columns differ by many orders of magnitude.
    let scale = DVector::from_fn(n, |k, _| {
        1.0 / (gram[(k, k)] + precision[k]).sqrt().max(1e-150)
    });
    let a = DMatrix::from_fn(n, n, |i, j| {
        let own = if i == j { precision[i] } else { 0.0 };
        let jitter = if i == j { 1.0 + 1e-10 } else { 1.0 };
        (gram[(i, j)] + own) * scale[i] * scale[j] * jitter
    });
    let b = DVector::from_fn(n, |k, _| (score[k] + precision[k] * centre[k]) * scale[k]);
    let chol = Cholesky::new(a)?;
    let x = chol.solve(&b);
    let mean = DVector::from_fn(n, |k, _| x[k] * scale[k]);
    let inverse = chol.inverse();
    let covariance = DMatrix::from_fn(n, n, |i, j| inverse[(i, j)] * scale[i] * scale[j]);
    mean.iter()
        .all(|m| m.is_finite())
        .then_some(Posterior { mean, covariance })
}

/// Inner products of whitened columns.
pub(crate) fn dot(a: &[f64], b: &[f64]) -> f64 {
    // Eight partial sums: one chain of additions would not use the vector unit.
    let mut sums = [0.0; 8];
    let (a8, b8) = (a.chunks_exact(8), b.chunks_exact(8));
    let rest: f64 = a8
        .remainder()
        .iter()
        .zip(b8.remainder())
        .map(|(x, y)| x * y)
        .sum();
    for (x, y) in a8.zip(b8) {
        for k in 0..8 {
            sums[k] += x[k] * y[k];
        }
    }
    sums.iter().sum::<f64>() + rest
}

#[cfg(test)]
mod tests {
    use super::*;

    // Two correlated columns with priors off zero: (G + L)^-1 (s + L m), by Cramer's rule.
    #[test]
    fn posterior_of_two_columns() {
        let gram = DMatrix::from_row_slice(2, 2, &[4.0, 1.0, 1.0, 3.0]);
        let p = posterior(
            &gram,
            &DVector::from_vec(vec![2.0, -1.0]),
            &DVector::from_vec(vec![0.5, 0.0]),
            &DVector::from_vec(vec![2.0, 1.0]),
        )
        .unwrap();
        let det = 6.0 * 4.0 - 1.0;
        assert!((p.mean[0] - (3.0 * 4.0 + 1.0) / det).abs() < 1e-8);
        assert!((p.mean[1] - (-6.0 - 3.0) / det).abs() < 1e-8);
        assert!((p.covariance[(0, 0)] - 4.0 / det).abs() < 1e-8);
    }

    #[test]
    fn dot_sums_all() {
        let a: Vec<f64> = (0..29).map(f64::from).collect();
        assert_eq!(dot(&a, &a), (0..29).map(|i| f64::from(i * i)).sum::<f64>());
    }
}
