//! Contact with the plume: whether the readings follow it at all. Each pass tries the plume in all directions and compares
//! the best with the model's direction.

use crate::InferError;
use crate::fit::Problem;
use crate::parallel_map::parallel_map;
use crate::passes::passes;
use crate::posterior::Estimate;
use crate::rows::{AxisTurn, ForwardModel, Prediction};

/// Step between the directions to try, degrees.
const SPACING_DEG: f64 = 2.0;
/// A pass shows the plume where turning it there gains this over no plume at all, nats: one in
/// 160,000 of noise, and more than that allows for the directions tried.
const SEEN_NATS: f64 = 12.0;
/// Factors on the plume's strength to try in each direction, because contact does not depend on strength.
const STRENGTHS: [f64; 5] = [0.2, 0.5, 1.0, 2.0, 5.0];

/// Largest offset of a sensor's level, in its prior standard deviations.
const LEVEL_SDS: f64 = 3.0;

/// Contact of the readings with the plume.
#[derive(Debug, Clone, PartialEq)]
pub struct Contact {
    /// Number of passes that show a plume in any direction.
    pub passes: usize,
    /// Gain in the model's direction, within the tolerated axis drift, as a part of the best gain.
    pub share: f64,
    /// Turn of the axis of the best fit, degrees clockwise, with the standard deviation between passes.
    pub turn_deg: Estimate,
}

impl<M: ForwardModel> Problem<'_, M> {
    /// Contact with the plume of the unknowns `at`, in about `count` passes; none if no pass shows a plume.
    pub(crate) fn contact(&self, at: &[f64], count: usize) -> Result<Option<Contact>, InferError> {
        let n = self.rows.len();
        let still = self.model.predict(at, &vec![AxisTurn::NONE; n])?;
        let nothing = self.levelled(&still, 0.0);
        let excess: Vec<f64> = (0..n)
            .map(|i| (self.rows.measured()[i] - nothing.reading[i]) / self.sensor_sd)
            .collect();
        let passes = passes(self.rows, &excess, count);
        let nothing = self.rough_scores(&nothing);
        let of = |scores: &[f64], pass: &[std::ops::Range<usize>]| -> f64 {
            pass.iter().flat_map(|r| &scores[r.clone()]).sum()
        };
        let steps = (360.0 / SPACING_DEG) as u32;
        let turns_deg: Vec<f64> = (0..steps).map(|k| f64::from(k) * SPACING_DEG).collect();
        let gains = |turn_deg: &f64| -> Result<Vec<f64>, InferError> {
            let there = self
                .model
                .predict(at, &vec![AxisTurn::clockwise(*turn_deg); n])?;
            let mut gains = vec![f64::NEG_INFINITY; passes.len()];
            for strength in STRENGTHS {
                let scores = self.rough_scores(&self.levelled(&there, strength));
                for (gain, pass) in gains.iter_mut().zip(&passes) {
                    *gain = gain.max(of(&nothing, pass) - of(&scores, pass));
                }
            }
            Ok(gains)
        };
        let mut best = vec![(0.0, 0.0); passes.len()];
        let mut own = vec![0.0; passes.len()];
        for (turn_deg, gains) in turns_deg.iter().zip(parallel_map(&turns_deg, gains)) {
            let is_own = turn_deg.min(360.0 - turn_deg) <= self.policy.noise_tolerated.wander_deg;
            for (p, gain) in gains?.into_iter().enumerate() {
                if gain > best[p].0 {
                    best[p] = (gain, *turn_deg);
                }
                if is_own {
                    own[p] = f64::max(own[p], gain);
                }
            }
        }
        let seen: Vec<usize> = (0..passes.len())
            .filter(|&p| best[p].0 > SEEN_NATS)
            .collect();
        if seen.is_empty() {
            return Ok(None);
        }
        let gained: f64 = seen.iter().map(|&p| best[p].0).sum();
        let own: f64 = seen.iter().map(|&p| own[p].max(0.0)).sum();
        let (sin, cos) = seen.iter().fold((0.0, 0.0), |(s, c), &p| {
            let (sin, cos) = best[p].1.to_radians().sin_cos();
            (s + best[p].0 * sin / gained, c + best[p].0 * cos / gained)
        });
        let length = sin.hypot(cos).clamp(1e-9, 1.0);
        Ok(Some(Contact {
            passes: seen.len(),
            share: own / gained,
            turn_deg: Estimate {
                value: sin.atan2(cos).to_degrees(),
                // Mardia and Jupp (2000), equation 2.3.11: the circular standard deviation.
                sd: (-2.0 * length.ln()).sqrt().to_degrees().max(SPACING_DEG),
            },
        }))
    }

    /// A prediction with a plume of some strength, each series at the level of its readings: by the median,
    /// which a plume that is seldom met does not move, as far as a level may be off.
    fn levelled(&self, there: &Prediction, strength: f64) -> Prediction {
        let most = LEVEL_SDS * self.model.level_sd();
        let mut out = Prediction {
            reading: there.reading.clone(),
            plume: there.plume.iter().map(|p| strength * p).collect(),
        };
        for (reading, plume) in out.reading.iter_mut().zip(&there.plume) {
            *reading += (strength - 1.0) * plume;
        }
        for series in self.rows.series() {
            let used = series.clone().filter(|&i| self.rows.is_used(i));
            let mut off: Vec<f64> = used
                .map(|i| self.rows.measured()[i] - out.reading[i])
                .collect();
            if off.is_empty() {
                continue;
            }
            let middle = off.len() / 2;
            let (_, level, _) = off.select_nth_unstable_by(middle, f64::total_cmp);
            let level = level.clamp(-most, most);
            out.reading[series].iter_mut().for_each(|r| *r += level);
        }
        out
    }
}
