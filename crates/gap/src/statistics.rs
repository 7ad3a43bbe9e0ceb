//! Statistics of samples that several analyses share.

/// Median of the values that are numbers; of an even count the upper of the two middle values. None of an empty list.
pub(crate) fn median(mut values: Vec<f64>) -> Option<f64> {
    values.retain(|v| !v.is_nan());
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied()
}

/// Ends of the interval that the central 95 % of draws fill; `drawn` holds at least one.
pub(crate) fn central_95(mut drawn: Vec<f64>) -> [f64; 2] {
    drawn.sort_by(f64::total_cmp);
    [0.025, 0.975].map(|part| drawn[((drawn.len() - 1) as f64 * part).round() as usize])
}

/// Standard error of an estimate from the estimates without each part of the data (jackknife; Efron 1982).
pub(crate) fn jackknife_se(without: &[f64]) -> f64 {
    let n = without.len() as f64;
    let mean = without.iter().sum::<f64>() / n;
    let squares: f64 = without.iter().map(|v| (v - mean).powi(2)).sum();
    (squares * (n - 1.0) / n).sqrt()
}

/// Probabilities of alternatives from the logarithms of their weights.
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

    #[test]
    fn one_draw_in_forty_lies_beyond_each_end() {
        let drawn = (0..=200).rev().map(f64::from).collect();
        assert_eq!(central_95(drawn), [5.0, 195.0]);
    }

    // The jackknife of a mean is its standard error: of 1, 2, 6 it is 7^½ / 3^½ = 1.527525.
    #[test]
    fn jackknife_of_a_mean() {
        let got = jackknife_se(&[4.0, 3.5, 1.5]);
        assert!((got - 1.527_525).abs() < 1e-6, "{got}");
    }
}
