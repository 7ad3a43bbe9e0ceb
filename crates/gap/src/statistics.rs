//! What several analyses compute of samples alike.

/// Middle of the values that are known, the upper of two; none of nothing.
pub(crate) fn median(mut values: Vec<f64>) -> Option<f64> {
    values.retain(|v| !v.is_nan());
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied()
}

/// Standard error of an estimate from the estimates without each part of the data (jackknife; Efron 1982).
pub(crate) fn jackknife_se(without: &[f64]) -> f64 {
    let n = without.len() as f64;
    let mean = without.iter().sum::<f64>() / n;
    let squares: f64 = without.iter().map(|v| (v - mean).powi(2)).sum();
    (squares * (n - 1.0) / n).sqrt()
}

/// Probabilities in proportion to the exponentials.
pub(crate) fn probabilities(logs: &[f64]) -> Vec<f64> {
    let top = logs.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let sum: f64 = logs.iter().map(|l| (l - top).exp()).sum();
    logs.iter().map(|l| (l - top).exp() / sum).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn probabilities_add_up_far_from_zero() {
        let p = probabilities(&[-1000.0, -1000.0 + 3.0_f64.ln()]);
        assert!((p[1] - 0.75).abs() < 1e-12 && (p[0] - 0.25).abs() < 1e-12);
    }

    // The jackknife of a mean is its standard error: of 1, 2, 6 it is 7^½ / 3^½ = 1.527525.
    #[test]
    fn jackknife_of_a_mean() {
        let got = jackknife_se(&[4.0, 3.5, 1.5]);
        assert!((got - 1.527_525).abs() < 1e-6, "{got}");
    }
}
