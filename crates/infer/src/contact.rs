//! Whether readings follow the plume at all: pass by pass it is turned through all directions, and
//! held against the direction in which the model has it.

use crate::InferError;
use crate::fit::Problem;
use crate::passes::passes;
use crate::posterior::Estimate;
use crate::rows::ForwardModel;

/// Directions that are tried, degrees apart.
const SPACING_DEG: f64 = 2.0;
/// A pass shows the plume where turning it there gains this over no plume at all, nats: one in
/// 160,000 of noise, and more than that allows for the directions tried.
const SEEN_NATS: f64 = 12.0;
/// Factors on the plume's strength that are tried with each direction: how strong it is, is another
/// question.
const STRENGTHS: [f64; 5] = [0.2, 0.5, 1.0, 2.0, 5.0];

/// How the readings meet the plume.
#[derive(Debug, Clone, PartialEq)]
pub struct Contact {
    /// Passes that show a plume, in whatever direction.
    pub passes: usize,
    /// Part of what these gain at best that they gain where the model has the plume.
    pub share: f64,
    /// Turn of the axis, degrees clockwise, at which the passes meet it best, with the standard deviation
    /// from pass to pass.
    pub turn_deg: Estimate,
}

impl<M: ForwardModel> Problem<'_, M> {
    /// How the readings meet the plume of the unknowns `at`, in about `count` passes; none where no pass
    /// shows a plume.
    pub(crate) fn contact(&self, at: &[f64], count: usize) -> Result<Option<Contact>, InferError> {
        let n = self.rows.len();
        let still = self.model.predict(at, &vec![0.0; n])?;
        let level = self.level(&still.reading, &still.plume);
        let excess: Vec<f64> = (0..n)
            .map(|i| {
                let rest = still.reading[i] - still.plume[i] + level[i];
                (self.rows.measured()[i] - rest) / self.sensor_sd
            })
            .collect();
        let passes = passes(self.rows, &excess, count);
        let nothing = self.scores(&still.reading, &still.plume, &level, 0.0);
        let of = |scores: &[f64], pass: &[std::ops::Range<usize>]| -> f64 {
            pass.iter().flat_map(|r| &scores[r.clone()]).sum()
        };
        let steps = (360.0 / SPACING_DEG) as usize;
        let mut best = vec![(0.0, 0.0); passes.len()];
        let mut own = vec![0.0; passes.len()];
        for k in 0..steps {
            let turn_deg = f64::from(k as u32) * SPACING_DEG;
            let there = self.model.predict(at, &vec![turn_deg; n])?;
            for strength in STRENGTHS {
                let scores = self.scores(&there.reading, &there.plume, &level, strength);
                for (p, pass) in passes.iter().enumerate() {
                    let gain = of(&nothing, pass) - of(&scores, pass);
                    if gain > best[p].0 {
                        best[p] = (gain, turn_deg);
                    }
                    if k == 0 {
                        own[p] = f64::max(own[p], gain);
                    }
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

    /// By what each series' readings lie above what is expected without a plume: the median, which a
    /// plume that is seldom met does not move.
    fn level(&self, reading: &[f64], plume: &[f64]) -> Vec<f64> {
        let mut out = vec![0.0; self.rows.len()];
        for series in self.rows.series() {
            let used = series.clone().filter(|&i| self.rows.is_used(i));
            let mut off: Vec<f64> = used
                .map(|i| self.rows.measured()[i] - (reading[i] - plume[i]))
                .collect();
            off.sort_by(f64::total_cmp);
            if let Some(median) = off.get(off.len() / 2) {
                out[series].fill(*median);
            }
        }
        out
    }

    /// Rough scores of a plume of some strength above a level.
    fn scores(&self, reading: &[f64], plume: &[f64], level: &[f64], strength: f64) -> Vec<f64> {
        let there = crate::Prediction {
            reading: (0..reading.len())
                .map(|i| reading[i] + level[i] + (strength - 1.0) * plume[i])
                .collect(),
            plume: plume.iter().map(|p| strength * p).collect(),
        };
        self.rough_scores(&there)
    }
}
