//! What a meander does to numbers that hold in the mean.
//!
//! The fit follows the axis from crossing to crossing, so that its spread is that of the plume about an axis that
//! wanders, and its axis and height are as sure as if it lay still. In the mean over meanders the plume is wider,
//! σ² = σ_r² + σ_m² (Gifford 1959), and axis and height are those of a few crossings that stand for all. Across,
//! crossings show the meander; in height they show a plume that is now strong and now weak. It is
//! taken for as large there, over the plume's spread, as across: eddies that move a plume are wider than it in
//! both directions.

use super::parameters::Unknowns;
use super::peak::Predicted;
use nalgebra::{DMatrix, DVector};
use plume::{DispersionSpec, MechanismId, Strength};

/// Crossings below which no meander can be told.
const LEAST_CROSSINGS: usize = 4;

/// The meander that crossings show.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Meander {
    /// Its standard deviation as seen from the source, degrees.
    pub sd_deg: f64,
    /// The same over the plume's own width.
    pub ratio: f64,
    /// From how many crossings.
    pub crossings: f64,
    /// The plume's own height where it was crossed, one standard deviation, m.
    pub sigma_z_m: f64,
}

impl Meander {
    /// None where there are too few crossings, or where the axis turns by more than the plume is wide: that is a
    /// wind that turns. What turns steadily is a wind too.
    pub fn of(predicted: &Predicted, width_deg: f64) -> Option<Self> {
        let turns = predicted.turns();
        let n = turns.len() as f64;
        if turns.len() < LEAST_CROSSINGS {
            return None;
        }
        let mean = |of: fn(&(f64, f64)) -> f64| turns.iter().map(of).sum::<f64>() / n;
        let (mean_s, mean_deg) = (mean(|t| t.0), mean(|t| t.1));
        let (mut product, mut square) = (0.0, 0.0);
        for (time_s, turn_deg) in &turns {
            product += (time_s - mean_s) * (turn_deg - mean_deg);
            square += (time_s - mean_s).powi(2);
        }
        let slope = product / square.max(f64::MIN_POSITIVE);
        let off = |(time_s, turn_deg): &(f64, f64)| turn_deg - mean_deg - slope * (time_s - mean_s);
        // A mean and a slope are taken from them.
        let variance = turns.iter().map(|t| off(t).powi(2)).sum::<f64>() / (n - 2.0);
        // What wanders within a crossing is no turn of it, and of the mean spread all the same.
        let sd_deg = variance.sqrt().hypot(predicted.wander_deg());
        (variance > 0.0 && sd_deg < width_deg).then_some(Self {
            sd_deg,
            ratio: sd_deg / width_deg,
            crossings: n,
            sigma_z_m: predicted.sigma_z_m(),
        })
    }

    /// The unknowns and their covariance in the mean over meanders.
    pub fn in_the_mean(
        &self,
        unknowns: &Unknowns,
        base: &DispersionSpec,
        at: &mut DVector<f64>,
        covariance: &mut DMatrix<f64>,
    ) {
        use MechanismId as M;
        let squared = self.ratio * self.ratio;
        let ln_wider = 0.5 * squared.ln_1p();
        // A standard deviation of n values is known to 1/√2n of itself.
        let ln_wider_sd = squared / (1.0 + squared) / (2.0 * (self.crossings - 1.0)).sqrt();
        // Across, the plume followed is as strong as it is narrow; in height, crossings have met its mean. What is
        // stated on the axis falls with the width across, and an emission holds what the height adds.
        let ln_strength = match base.sources[0].strength {
            Strength::CMax { .. } => -ln_wider,
            Strength::EmissionKgS(_) => ln_wider,
        };
        let of_mean = 1.0 / self.crossings.sqrt();
        for (id, shift, sd) in [
            (M::WindDirectionOffset, 0.0, self.sd_deg * of_mean),
            (
                M::EffectiveHeightOffset,
                0.0,
                self.ratio * self.sigma_z_m * of_mean,
            ),
            (M::SigmaYScale, ln_wider, ln_wider_sd),
            (
                M::SigmaZScale,
                ln_wider,
                ln_wider_sd.hypot(self.ratio * of_mean),
            ),
            (
                M::EmissionScale,
                ln_strength,
                ln_wider_sd.hypot(self.ratio * of_mean),
            ),
        ] {
            if let Some(k) = unknowns.index(id, None) {
                at[k] += shift;
                covariance[(k, k)] += sd * sd;
            }
        }
    }
}
