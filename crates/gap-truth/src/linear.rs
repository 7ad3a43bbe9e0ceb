//! Least squares with priors, for matrices of some hundred unknowns.

/// Solves `a x = b` for a symmetric positive definite matrix, given by rows; `None` where it is not.
pub fn solve(a: &[Vec<f64>], b: &[f64]) -> Option<Vec<f64>> {
    let l = cholesky(a)?;
    Some(back(&l, b))
}

/// The inverse of a symmetric positive definite matrix; `None` where it is not.
pub fn inverse(a: &[Vec<f64>]) -> Option<Vec<Vec<f64>>> {
    let l = cholesky(a)?;
    let unit = |k: usize| {
        (0..a.len())
            .map(|i| f64::from(i == k))
            .collect::<Vec<f64>>()
    };
    Some((0..a.len()).map(|k| back(&l, &unit(k))).collect())
}

/// The lower triangle `l` with `l lᵀ = a`.
fn cholesky(a: &[Vec<f64>]) -> Option<Vec<Vec<f64>>> {
    let mut l: Vec<Vec<f64>> = Vec::with_capacity(a.len());
    for (i, row) in a.iter().enumerate() {
        let mut own: Vec<f64> = Vec::with_capacity(i + 1);
        for j in 0..=i {
            let other = if j < i { &l[j] } else { &own };
            let product: f64 = own[..j].iter().zip(&other[..j]).map(|(x, y)| x * y).sum();
            let rest = row[j] - product;
            own.push(if j < i {
                rest / l[j][j]
            } else if rest > 0.0 {
                rest.sqrt()
            } else {
                return None;
            });
        }
        l.push(own);
    }
    Some(l)
}

fn back(l: &[Vec<f64>], b: &[f64]) -> Vec<f64> {
    let n = l.len();
    let mut x = b.to_vec();
    for i in 0..n {
        let known: f64 = (0..i).map(|k| l[i][k] * x[k]).sum();
        x[i] = (x[i] - known) / l[i][i];
    }
    for i in (0..n).rev() {
        let known: f64 = (i + 1..n).map(|k| l[k][i] * x[k]).sum();
        x[i] = (x[i] - known) / l[i][i];
    }
    x
}

#[cfg(test)]
mod tests {
    use super::*;

    // By hand: [[4, 2], [2, 3]] (x, y) = (10, 9) has x = 1.5, y = 2.
    #[test]
    fn two_by_hand() {
        let a = vec![vec![4.0, 2.0], vec![2.0, 3.0]];
        let x = solve(&a, &[10.0, 9.0]).unwrap();
        assert!((x[0] - 1.5).abs() < 1e-12 && (x[1] - 2.0).abs() < 1e-12);
        let inverse = inverse(&a).unwrap();
        assert!((inverse[0][0] - 0.375).abs() < 1e-12 && (inverse[0][1] + 0.25).abs() < 1e-12);
        assert!(solve(&[vec![1.0, 2.0], vec![2.0, 1.0]], &[0.0, 0.0]).is_none());
    }
}
