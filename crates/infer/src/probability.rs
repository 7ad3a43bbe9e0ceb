//! The probability that a cause is true, from how far it departs from doing nothing.
//!
//! Evidence alone is too sure of itself: all models are wrong in ways that their discrepancy does not hold, and a mechanism
//! takes up part of that. A logistic regression on cases with known truth tells how often causes that depart so far were true.

/// What the probability of a cause follows from.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Features {
    /// Standard deviations by which it departs from doing nothing.
    pub departs_sd: f64,
    /// Factor by which the scatter from pass to pass widens its uncertainty, 1 or more.
    pub widening: f64,
    /// Other causes of its set.
    pub others: usize,
}

/// Number of terms of the logistic regression, without its constant.
pub const TERMS: usize = 3;

impl Features {
    /// Terms of the regression. Bounds keep a single number from deciding what no case has shown.
    pub fn terms(&self) -> [f64; TERMS] {
        [
            self.widening.clamp(1.0, 10.0).ln(),
            self.departs_sd.clamp(0.3, 30.0).ln(),
            self.others as f64,
        ]
    }
}

/// A logistic regression on the terms of [`Features`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CauseMap {
    /// Log odds where all terms are zero.
    pub constant: f64,
    /// Log odds per unit of each term.
    pub slopes: [f64; TERMS],
}

impl CauseMap {
    /// Probability that a cause of these features is true.
    pub fn probability(&self, of: &Features) -> f64 {
        let terms = of.terms();
        let sum: f64 = self.slopes.iter().zip(terms).map(|(s, t)| s * t).sum();
        1.0 / (1.0 + (-self.constant - sum).exp())
    }
}

#[cfg(test)]
mod tests {
    use super::{CauseMap, Features};

    // By hand: ln odds -3 + 2 ln 10 - 2 ln 2 - 0.5 = -0.281; and what is beyond the bounds counts as they do.
    #[test]
    fn the_probability_is_that_of_the_log_odds() {
        let map = CauseMap {
            constant: -3.0,
            slopes: [-2.0, 2.0, -0.5],
        };
        let of = |departs_sd| {
            map.probability(&Features {
                departs_sd,
                widening: 2.0,
                others: 1,
            })
        };
        assert!((of(10.0) - 1.0 / (1.0 + 0.281_124_2_f64.exp())).abs() < 1e-6);
        assert!(of(5.0) < of(10.0) && of(1e9) == of(30.0));
    }
}
