//! Gaussian linear algebra in few dimensions: the evidence of whitened columns.

use std::ops::Range;

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
    let (a, b, scale) = normal_equations(gram, score, centre, precision);
    let chol = Cholesky::new(a)?;
    let x = chol.solve(&b);
    let mean = DVector::from_fn(n, |k, _| x[k] * scale[k]);
    let inverse = chol.inverse();
    let covariance = DMatrix::from_fn(n, n, |i, j| inverse[(i, j)] * scale[i] * scale[j]);
    mean.iter()
        .all(|m| m.is_finite())
        .then_some(Posterior { mean, covariance })
}

/// What is known of a residual with the coefficients of [`posterior`] integrated out, beside
/// −½ residualᵀ residual: ½ bᵀA⁻¹b − ½ ln|A|, with A = gram + precision and
/// b = score + precision · centre; a constant of the priors is left out.
pub(crate) fn marginal(
    gram: &DMatrix<f64>,
    score: &DVector<f64>,
    centre: &DVector<f64>,
    precision: &DVector<f64>,
) -> Option<f64> {
    let (a, b, scale) = normal_equations(gram, score, centre, precision);
    let chol = Cholesky::new(a)?;
    let half_log_det: f64 = (0..b.len())
        .map(|k| (chol.l_dirty()[(k, k)] / scale[k]).ln())
        .sum();
    Some(0.5 * b.dot(&chol.solve(&b)) - half_log_det)
}

/// A and b of the normal equations with priors, scaled to a unit diagonal, as columns differ by
/// many orders of magnitude; and the scale.
fn normal_equations(
    gram: &DMatrix<f64>,
    score: &DVector<f64>,
    centre: &DVector<f64>,
    precision: &DVector<f64>,
) -> (DMatrix<f64>, DVector<f64>, DVector<f64>) {
    let n = score.len();
    let scale = DVector::from_fn(n, |k, _| {
        1.0 / (gram[(k, k)] + precision[k]).sqrt().max(1e-150)
    });
    let a = DMatrix::from_fn(n, n, |i, j| {
        let own = if i == j { precision[i] } else { 0.0 };
        let jitter = if i == j { 1.0 + 1e-10 } else { 1.0 };
        (gram[(i, j)] + own) * scale[i] * scale[j] * jitter
    });
    let b = DVector::from_fn(n, |k, _| (score[k] + precision[k] * centre[k]) * scale[k]);
    (a, b, scale)
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

/// Rows that are multiplied at a time, so that they stay in the cache.
const BLOCK_ROWS: usize = 256;

/// Inner products of all columns of `a` with all of `b`, rows by columns.
pub(crate) fn products<A: AsRef<[f64]>, B: AsRef<[f64]>>(a: &[A], b: &[B]) -> DMatrix<f64> {
    let rows = a.first().map_or(0, |c| c.as_ref().len());
    let mut out = DMatrix::zeros(a.len(), b.len());
    let mut from = 0;
    while from < rows {
        let to = (from + BLOCK_ROWS).min(rows);
        let (left_at, left) = stacked(a, from..to);
        let (right_at, right) = stacked(b, from..to);
        let block = left.transpose() * right;
        for (j, to_j) in right_at.iter().enumerate() {
            for (i, to_i) in left_at.iter().enumerate() {
                out[(*to_i, *to_j)] += block[(i, j)];
            }
        }
        from = to;
    }
    out
}

/// Those columns that have something in `rows`, side by side, and which they are.
fn stacked<A: AsRef<[f64]>>(columns: &[A], rows: Range<usize>) -> (Vec<usize>, DMatrix<f64>) {
    let (mut which, mut values) = (Vec::new(), Vec::new());
    for (k, column) in columns.iter().enumerate() {
        let own = &column.as_ref()[rows.clone()];
        if own.iter().any(|v| *v != 0.0) {
            which.push(k);
            values.extend_from_slice(own);
        }
    }
    let matrix = DMatrix::from_vec(rows.len(), which.len(), values);
    (which, matrix)
}

/// Inner products of all columns with one.
pub(crate) fn scores<A: AsRef<[f64]>>(columns: &[A], one: &[f64]) -> DVector<f64> {
    DVector::from_fn(columns.len(), |k, _| dot(columns[k].as_ref(), one))
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

    // One column with information 4, score 2, prior 0.5 +- 1/sqrt(2): a = 6, b = 3.
    #[test]
    fn marginal_of_one_column() {
        let one = |v: f64| DVector::from_vec(vec![v]);
        let m = marginal(
            &DMatrix::from_row_slice(1, 1, &[4.0]),
            &one(2.0),
            &one(0.5),
            &one(2.0),
        )
        .unwrap();
        assert!((m - (0.5 * 9.0 / 6.0 - 0.5 * 6f64.ln())).abs() < 1e-8);
    }

    #[test]
    fn products_are_the_dots() {
        let columns: Vec<Vec<f64>> = (0..9)
            .map(|k| {
                (0..700)
                    .map(|i| f64::from((i * (k + 3)) % 17) - 8.0)
                    .collect()
            })
            .collect();
        let all = products(&columns, &columns[..5]);
        for i in 0..9 {
            for j in 0..5 {
                assert!((all[(i, j)] - dot(&columns[i], &columns[j])).abs() < 1e-9);
            }
        }
    }

    #[test]
    fn dot_sums_all() {
        let a: Vec<f64> = (0..29).map(f64::from).collect();
        assert_eq!(dot(&a, &a), (0..29).map(|i| f64::from(i * i)).sum::<f64>());
    }
}
