//! What readings have taught about the sizes of their noise, to be known beforehand with the next readings of the same
//! instrument.

use crate::fit::{Fit, Problem};
use crate::noise::Noise;
use crate::rows::ForwardModel;
use nalgebra::{Cholesky, SMatrix};

/// Step of the second differences: numbers are natural logarithms.
const DIFFERENCE: f64 = 0.1;

/// Sizes and memories of the noise, and how well each is known.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LearnedNoise {
    /// The most probable.
    pub noise: Noise,
    /// Standard deviation of the natural logarithm of each, in the order of the fields of [`Noise`].
    pub ln_sd: [f64; Noise::PARAMETERS],
}

impl<M: ForwardModel> Problem<'_, M> {
    /// The noise of a fit and how well it is known: a normal distribution about it that bends as the density does there.
    /// What is not more certain than beforehand keeps what was known.
    pub fn learned_noise(&self, fit: &Fit) -> LearnedNoise {
        let here = fit.noise.ln();
        let density = |steps: &[(usize, f64)]| {
            let mut ln = here;
            for (k, sign) in steps {
                ln[*k] += sign * DIFFERENCE;
            }
            self.ln_noise_density(fit, &Noise::from_ln(ln))
        };
        let information =
            SMatrix::<f64, { Noise::PARAMETERS }, { Noise::PARAMETERS }>::from_fn(|i, j| {
                let of = |a: f64, b: f64| density(&[(i, a), (j, b)]);
                // For i = j this is the difference over two steps.
                -(of(1.0, 1.0) - of(1.0, -1.0) - of(-1.0, 1.0) + of(-1.0, -1.0))
                    / (4.0 * DIFFERENCE * DIFFERENCE)
            });
        let covariance = Cholesky::new(information).map(|c| c.inverse());
        let known = self.noise_prior();
        let sd = |k: usize| {
            let before = known[k].1;
            covariance.map_or(before, |c| c[(k, k)].sqrt().min(before))
        };
        LearnedNoise {
            noise: fit.noise,
            ln_sd: std::array::from_fn(sd),
        }
    }
}
