//! Gaussian linear algebra in few dimensions: the evidence of whitened columns.

use std::ops::Range;

use multiversion::multiversion;
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
    let mean = finite(chol.solve(&b).component_mul(&scale))?;
    let inverse = chol.inverse();
    let covariance = DMatrix::from_fn(n, n, |i, j| inverse[(i, j)] * scale[i] * scale[j]);
    Some(Posterior { mean, covariance })
}

/// The mean of [`posterior`] alone.
pub(crate) fn posterior_mean(
    gram: &DMatrix<f64>,
    score: &DVector<f64>,
    centre: &DVector<f64>,
    precision: &DVector<f64>,
) -> Option<DVector<f64>> {
    let (a, b, scale) = normal_equations(gram, score, centre, precision);
    finite(Cholesky::new(a)?.solve(&b).component_mul(&scale))
}

fn finite(vector: DVector<f64>) -> Option<DVector<f64>> {
    vector.iter().all(|v| v.is_finite()).then_some(vector)
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

/// Inner product of two whitened columns.
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
/// Columns on either side that are multiplied at a time.
const TILE: usize = 2;
/// Partial sums of every product.
const LANES: usize = 8;

/// Inner products of all columns of `a` with all of `b`, rows by columns.
pub(crate) fn products<A: AsRef<[f64]>, B: AsRef<[f64]>>(a: &[A], b: &[B]) -> DMatrix<f64> {
    let mut out = DMatrix::zeros(a.len(), b.len());
    for rows in blocks(a) {
        let (left, right) = (busy(a, &rows), busy(b, &rows));
        for right in right.chunks(TILE) {
            for left in left.chunks(TILE) {
                add_tile(left, right, &mut out);
            }
        }
    }
    out
}

/// Inner products of all columns with each other.
pub(crate) fn gram<A: AsRef<[f64]>>(columns: &[A]) -> DMatrix<f64> {
    let n = columns.len();
    let mut out = DMatrix::zeros(n, n);
    for rows in blocks(columns) {
        let busy = busy(columns, &rows);
        for (q, right) in busy.chunks(TILE).enumerate() {
            // Tiles above the diagonal are those below it, turned.
            for left in busy.chunks(TILE).skip(q) {
                add_tile(left, right, &mut out);
            }
        }
    }
    for j in 0..n {
        for i in 0..j {
            out[(i, j)] = out[(j, i)];
        }
    }
    out
}

/// The rows of columns in blocks.
fn blocks<A: AsRef<[f64]>>(columns: &[A]) -> impl Iterator<Item = Range<usize>> {
    let rows = columns.first().map_or(0, |c| c.as_ref().len());
    (0..rows)
        .step_by(BLOCK_ROWS)
        .map(move |from| from..(from + BLOCK_ROWS).min(rows))
}

/// Those columns that have something in `rows`, each with its number.
fn busy<'a, A: AsRef<[f64]>>(columns: &'a [A], rows: &Range<usize>) -> Vec<(usize, &'a [f64])> {
    let all = columns.iter().map(|c| &c.as_ref()[rows.clone()]);
    all.enumerate().filter(|(_, own)| is_busy(own)).collect()
}

/// Whether a column has anything but zeros.
pub(crate) fn is_busy(column: &[f64]) -> bool {
    // In stretches without a way out, which the compiler turns into vector instructions; without
    // the sign, as -0 is nothing.
    let bits = |stretch: &[f64]| stretch.iter().fold(0, |all, v| all | (v.to_bits() << 1));
    column.chunks(32).any(|stretch| bits(stretch) != 0)
}

/// Adds the products of up to two columns with up to two others to their places.
fn add_tile(left: &[(usize, &[f64])], right: &[(usize, &[f64])], out: &mut DMatrix<f64>) {
    // Where there is one only, it stands in for the second, and that product is left out.
    let two = |of: &[(usize, &[f64])]| [0, of.len() - 1];
    let (of_left, of_right) = (two(left), two(right));
    let lanes = tile(of_left.map(|k| left[k].1), of_right.map(|k| right[k].1));
    for ((j, _), of_j) in right.iter().zip(&lanes) {
        for ((i, _), lanes) in left.iter().zip(of_j) {
            out[(*i, *j)] += lanes.iter().sum::<f64>();
        }
    }
}

/// Inner products of columns of equal length, right by left, each in partial sums: summed up
/// in here, the compiler would mix the lanes. No fused multiply-add: the result does not
/// depend on the processor.
#[multiversion(targets("x86_64+avx512f+avx512dq+avx512vl", "x86_64+avx2"))]
fn tile(left: [&[f64]; TILE], right: [&[f64]; TILE]) -> [[[f64; LANES]; TILE]; TILE] {
    let mut sums = [[[0.0; LANES]; TILE]; TILE];
    for (((a, b), c), d) in left[0]
        .as_chunks()
        .0
        .iter()
        .zip(left[1].as_chunks().0)
        .zip(right[0].as_chunks().0)
        .zip(right[1].as_chunks().0)
    {
        add_products(&mut sums[0][0], a, c);
        add_products(&mut sums[0][1], b, c);
        add_products(&mut sums[1][0], a, d);
        add_products(&mut sums[1][1], b, d);
    }
    for j in 0..TILE {
        for i in 0..TILE {
            let (a, b) = (
                left[i].as_chunks::<LANES>().1,
                right[j].as_chunks::<LANES>().1,
            );
            for (sum, (x, y)) in sums[j][i].iter_mut().zip(a.iter().zip(b)) {
                *sum += x * y;
            }
        }
    }
    sums
}

#[inline(always)]
fn add_products(sums: &mut [f64; LANES], a: &[f64; LANES], b: &[f64; LANES]) {
    for k in 0..LANES {
        sums[k] += a[k] * b[k];
    }
}

/// Inner products of all columns with one.
pub(crate) fn scores<A: AsRef<[f64]>>(columns: &[A], one: &[f64]) -> DVector<f64> {
    products(columns, &[one]).column(0).into_owned()
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
        let mut columns: Vec<Vec<f64>> = (0..9)
            .map(|k| {
                (0..701)
                    .map(|i| f64::from((i * (k + 3)) % 17) - 8.0)
                    .collect()
            })
            .collect();
        // As most are: nothing but in a short time.
        columns[3][..300].fill(0.0);
        columns[3][310..].fill(-0.0);
        columns[6].fill(0.0);
        let all = products(&columns, &columns[..5]);
        for i in 0..9 {
            for j in 0..5 {
                assert!((all[(i, j)] - dot(&columns[i], &columns[j])).abs() < 1e-9);
            }
        }
        let own = gram(&columns);
        let all = products(&columns, &columns);
        assert!((own - all).amax() < 1e-9);
    }

    #[test]
    fn nothing_but_zeros_is_not_busy() {
        let mut column = vec![0.0; 70];
        column[69] = -0.0;
        assert!(!is_busy(&column));
        column[69] = -1e-300;
        assert!(is_busy(&column));
        assert!(is_busy(&[f64::NAN]));
    }

    #[test]
    fn dot_sums_all() {
        let a: Vec<f64> = (0..29).map(f64::from).collect();
        assert_eq!(dot(&a, &a), (0..29).map(|i| f64::from(i * i)).sum::<f64>());
    }
}
