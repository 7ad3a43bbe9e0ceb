//! How large the best of many scores gets by chance.

/// Euler's constant.
const EULER: f64 = 0.577_215_664_901_532_9;

/// The law of the largest of many scores where nothing is hidden, in nats: Gumbel's.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Chance {
    location: f64,
    scale: f64,
}

impl Chance {
    /// With the mean and the variance of `largest`, which was drawn from the law. Half a chi square
    /// has the scale 1 in its far tail, which the fit may not undercut.
    pub fn of(largest: &[f64]) -> Self {
        let n = largest.len() as f64;
        let mean = largest.iter().sum::<f64>() / n;
        let var = largest.iter().map(|g| (g - mean).powi(2)).sum::<f64>() / (n - 1.0);
        let scale = (var.sqrt() * 6f64.sqrt() / std::f64::consts::PI).max(1.0);
        Self {
            location: mean - EULER * scale,
            scale,
        }
    }

    /// The score that the best exceeds with this probability, nats.
    pub fn threshold(&self, probability: f64) -> f64 {
        self.location - self.scale * (-(-probability).ln_1p()).ln()
    }

    /// Probability of so large a best score.
    pub fn p_value(&self, score: f64) -> f64 {
        let z = (score - self.location) / self.scale;
        -(-(-z).exp()).exp_m1()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn probability_and_threshold_are_inverse() {
        let chance = Chance::of(&[2.0, 3.5, 1.0, 6.0, 4.0]);
        for p in [0.5, 1e-4, 1e-30] {
            assert!((chance.p_value(chance.threshold(p)) / p - 1.0).abs() < 1e-9);
        }
        // Far out it falls by e a nat and never to nothing.
        let far = chance.p_value(300.0) / chance.p_value(300.0 + chance.scale);
        assert!((far - std::f64::consts::E).abs() < 1e-9);
    }
}
