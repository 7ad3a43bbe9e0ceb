//! Gaussian linear algebra in few dimensions: the evidence of whitened columns.

use nalgebra::{Cholesky, DMatrix, DVector};

/// A Gaussian posterior of linear coefficients.
#[derive(Debug, Clone)]
pub(crate) struct Posterior {
    /// Coefficients, as steps from where the columns were taken.
    pub mean: DVector<f64>,
    /// Their covariance.
    pub covariance: DMatrix<f64>,
    /// Gain of the log likelihood over no step at all, nats.
    pub gain: f64,
    /// Log evidence relative to no step and no parameters, nats.
    pub log_evidence: f64,
}

/// The posterior of coefficients a in residual = W a + unit noise, with `gram` = WᵀW,
/// `score` = Wᵀ residual and independent normal priors of `centre` and `precision`.
///
/// log Z = ½ bᵀA⁻¹b − ½ mᵀΛm + ½ ln|Λ| − ½ ln|A| with A = G + Λ, b = s + Λm: the exact
/// marginal likelihood of the linear model, less that of the residual alone. A precision of
/// zero counts as flat, with a unit density.
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
            gain: 0.0,
            log_evidence: 0.0,
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
    let log_det: f64 = (0..n).map(|k| chol.l()[(k, k)].ln() - scale[k].ln()).sum();
    let log_prior: f64 = precision
        .iter()
        .filter(|p| **p > 0.0)
        .map(|p| 0.5 * p.ln())
        .sum();
    let offset: f64 = (0..n).map(|k| precision[k] * centre[k] * centre[k]).sum();
    let log_evidence = 0.5 * b.dot(&x) - 0.5 * offset + log_prior - log_det;
    let gain = score.dot(&mean) - 0.5 * (gram * &mean).dot(&mean);
    log_evidence.is_finite().then_some(Posterior {
        mean,
        covariance,
        gain,
        log_evidence,
    })
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

    // One column w with residual r: evidence of N(0, I + s² w wᵀ) over N(0, I) is
    // ½ s² (wᵀr)²/(1 + s² wᵀw) − ½ ln(1 + s² wᵀw) (matrix determinant lemma).
    #[test]
    fn evidence_of_one_column() {
        let (g, s, sd) = (12.0, 7.0, 0.8f64);
        let p = posterior(
            &DMatrix::from_element(1, 1, g),
            &DVector::from_element(1, s),
            &DVector::zeros(1),
            &DVector::from_element(1, sd.powi(-2)),
        )
        .unwrap();
        let k = 1.0 + sd * sd * g;
        let exact = 0.5 * sd * sd * s * s / k - 0.5 * k.ln();
        assert!(
            (p.log_evidence - exact).abs() < 1e-7,
            "{} {exact}",
            p.log_evidence
        );
        assert!((p.mean[0] - s / (g + sd.powi(-2))).abs() < 1e-7);
    }

    // A prior away from zero: evidence of N(m w, I + s² w wᵀ) over N(0, I), by numbers:
    // python3: import numpy as np; w=np.array([1,2.]); r=np.array([.5,1.]); s2=.25; m=.7
    // C=np.eye(2)+s2*np.outer(w,w); d=r-m*w
    // -.5*d@np.linalg.solve(C,d)-.5*np.log(np.linalg.det(C))+.5*r@r  ->  0.1305…
    #[test]
    fn evidence_with_an_offset_prior() {
        let (s2, m) = (0.25, 0.7);
        let p = posterior(
            &DMatrix::from_element(1, 1, 5.0),
            &DVector::from_element(1, 2.5),
            &DVector::from_element(1, m),
            &DVector::from_element(1, 1.0 / s2),
        )
        .unwrap();
        // d = -0.2 w: dᵀC⁻¹d = 0.04 * 5/(1 + 0.25*5); det C = 2.25; rᵀr = 1.25.
        let exact = -0.5 * 0.04 * 5.0 / 2.25 - 0.5 * 2.25f64.ln() + 0.625;
        assert!(
            (p.log_evidence - exact).abs() < 1e-7,
            "{} {exact}",
            p.log_evidence
        );
    }

    #[test]
    fn dot_sums_all() {
        let a: Vec<f64> = (0..29).map(f64::from).collect();
        assert_eq!(dot(&a, &a), (0..29).map(|i| f64::from(i * i)).sum::<f64>());
    }
}
