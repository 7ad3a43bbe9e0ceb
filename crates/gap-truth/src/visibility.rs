//! How visible a hidden effect is by the noise that made the readings: D, in nats, and the strength
//! that makes it as visible as wanted.
//!
//! D is half the sum of squares of the whitened difference between what sensors read on average with
//! the effect and the best that a model without it can make of that: by what the scenario is unsure
//! of, with its priors; by each platform's own zero, gain and clock; and by a wind that is known as
//! well as its log allows (a Gaussian process of time, tied to the log). It is what somebody gains on
//! average who knows the truth and its noise. Of several effects each is judged beside the others,
//! whose strengths are free. The noise (`whitening`) is the generator's but for its outliers.

mod base;
mod least;
mod tuned;
mod wind;

use std::cell::RefCell;

use crate::case::{Air, CaseBuilder, CaseSpec, HiddenEffect, Laws};
use crate::instrument::{Faults, LogRow, MeanLog};
use crate::physics::Physics;

use base::Base;
pub use tuned::{Tuned, tuned};

/// How often the base is fitted again where it came to; its derivatives stay.
const CHORDS: usize = 2;

/// What a scene is like without and with effects of any strength.
struct Worth<'a> {
    builder: CaseBuilder<'a>,
    control: Vec<Vec<LogRow>>,
    /// Air that was asked for before: sensors change none, and several effects share much.
    known: RefCell<Vec<KnownAir>>,
}

/// The air of a world, seen from so far from where platforms flew.
struct KnownAir {
    physics: Physics,
    seen_off_m: Vec<[f64; 3]>,
    airs: Vec<Air>,
}

/// Sub-steps from one whose air is computed to the next: what is straight between them, some metres,
/// is nearly the same with and without an effect.
const STRIDE: usize = 2;
/// How many airs are kept.
const KEPT: usize = 40;

/// A value for each row, by platform.
type Column = Vec<Vec<f64>>;
/// A square matrix, by rows.
type Matrix = Vec<Vec<f64>>;

/// D of each effect of `spec` beside the others, nats.
pub fn nats(spec: &CaseSpec) -> Vec<f64> {
    let worth = Worth::new(spec);
    let strengths: Vec<f64> = spec.hidden.iter().map(|h| h.strength).collect();
    (0..strengths.len())
        .map(|which| worth.nats(&strengths, which, CHORDS))
        .collect()
}

impl<'a> Worth<'a> {
    fn new(spec: &'a CaseSpec) -> Self {
        let builder = CaseBuilder::new(spec);
        let control = builder.rows(&Physics::default(), &builder.no_faults());
        Self {
            builder,
            control,
            known: RefCell::new(Vec::new()),
        }
    }

    /// What each platform would read without noise; the air is that of places `seen_off_m` from
    /// those flown.
    fn mean_logs(
        &self,
        physics: &Physics,
        faults: &[Faults],
        seen_off_m: &[[f64; 3]],
    ) -> Vec<MeanLog> {
        let mut known = self.known.borrow_mut();
        let same = |k: &KnownAir| k.physics == *physics && k.seen_off_m == seen_off_m;
        if let Some(found) = known.iter().find(|k| same(k)) {
            return self.builder.mean_logs(&found.airs, faults);
        }
        let airs = self.builder.airs(physics, seen_off_m, STRIDE);
        let logs = self.builder.mean_logs(&airs, faults);
        if known.len() == KEPT {
            known.remove(0);
        }
        known.push(KnownAir {
            physics: physics.clone(),
            seen_off_m: seen_off_m.to_vec(),
            airs,
        });
        logs
    }

    fn laws(&self, strengths: &[f64]) -> Laws {
        let hidden: Vec<HiddenEffect> = self
            .builder
            .spec
            .hidden
            .iter()
            .zip(strengths)
            .map(|(h, &strength)| HiddenEffect { strength, ..*h })
            .collect();
        self.builder.hide_each(&hidden, &self.control)
    }

    /// D of the effect `which` beside the others, nats.
    fn nats(&self, strengths: &[f64], which: usize, chords: usize) -> f64 {
        let (physics, faults, _) = self.laws(strengths);
        let true_logs = self.mean_logs(&physics, &faults, &self.unmoved());
        let mut others = strengths.to_vec();
        others[which] = 0.0;
        let base = Base::new(self, &others, &faults);
        base.misfit(&true_logs, &faults, chords)
    }

    /// The same of many strengths of it: the base is the same unless the log of places is false.
    fn nats_by_strength(&self, strengths: &[f64], which: usize) -> impl FnMut(f64, usize) -> f64 {
        let mut others = strengths.to_vec();
        others[which] = 0.0;
        let mut kept: Option<Base<'_, '_>> = None;
        move |strength, chords| {
            let mut all = others.clone();
            all[which] = strength;
            let (physics, faults, _) = self.laws(&all);
            let true_logs = self.mean_logs(&physics, &faults, &self.unmoved());
            let base = match kept.take() {
                Some(base) if base.is_seen_from(&faults) => base,
                _ => Base::new(self, &others, &faults),
            };
            kept.insert(base).misfit(&true_logs, &faults, chords)
        }
    }

    fn unmoved(&self) -> Vec<[f64; 3]> {
        vec![[0.0; 3]; self.builder.scene.tracks.len()]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effect::PlumeEffect;
    use crate::instrument::{NoiseForm, Platform};
    use crate::whitening::Whitener;

    /// Readings less their means, whitened, of many cases in which nothing is hidden.
    fn whitened(noise: NoiseForm, row_step_s: usize) -> Vec<Vec<f64>> {
        let mut out = Vec::new();
        for seed in 0..5 {
            let spec = CaseSpec {
                noise,
                row_step_s,
                ..CaseSpec::none(seed)
            };
            let builder = CaseBuilder::new(&spec);
            let (physics, faults) = (Physics::default(), builder.no_faults());
            let airs = builder.airs(&physics, &vec![[0.0; 3]; faults.len()], 1);
            let logs = builder.mean_logs(&airs, &faults);
            let rows = builder.rows(&physics, &faults);
            for ((log, rows), faults) in logs.iter().zip(&rows).zip(&faults) {
                let lags_s = Platform::stages_s(&builder.scene, faults);
                let noise = Whitener::new(&builder.noise, log, 1.0, lags_s);
                let left = rows.iter().map(|r| r.co2_ppm.unwrap() - r.mean_ppm);
                // A spike of 40 ppm in two thousand rows is no part of what is tested.
                let cut = 6.0 * builder.noise.white_ppm() + 60.0;
                let mut columns = vec![left.map(|x| if x.abs() > cut { 0.0 } else { x }).collect()];
                noise.whiten(&mut columns);
                out.append(&mut columns);
            }
        }
        out
    }

    // The oracle is the generator's own noise: whitened it is independent and of unit variance, but
    // for its rare outliers.
    #[test]
    fn the_generators_noise_becomes_white() {
        for (noise, step) in [
            (NoiseForm::Usual, 1),
            (NoiseForm::SlowSensors, 1),
            (NoiseForm::Usual, 4),
        ] {
            let all = whitened(noise, step);
            let count = all.iter().map(Vec::len).sum::<usize>() as f64;
            let usual = |x: &f64| x.clamp(-4.0, 4.0);
            let sum = |of: &dyn Fn(&[f64]) -> f64| all.iter().map(|c| of(c)).sum::<f64>() / count;
            let variance = sum(&|c| c.iter().map(|x| usual(x).powi(2)).sum());
            let next = sum(&|c| c.windows(2).map(|w| usual(&w[0]) * usual(&w[1])).sum());
            let bar = 6.0 / count.sqrt() + 0.03;
            assert!((variance - 1.0).abs() < bar, "{noise:?} {step}: {variance}");
            assert!(next.abs() < bar, "{noise:?} {step}: {next}");
        }
    }

    #[test]
    fn more_strength_is_more_visible_and_none_is_not() {
        for effect in [PlumeEffect::SensorLag, PlumeEffect::SigmaZScale] {
            let at = |strength| nats(&CaseSpec::one(4, effect, strength))[0];
            let (none, weak, strong) = (at(0.0), at(1.0), at(3.0));
            assert!(
                none < 0.01 && none < weak && weak < strong,
                "{none} {weak} {strong}"
            );
        }
    }

    // A level of the air that the scenario states to within some ppm: whatever the readings, no more
    // than (3 ppm)²/2 sd² can be known, and without any doubt more.
    #[test]
    fn what_the_scenario_is_unsure_of_hides_what_looks_like_it() {
        let effect = PlumeEffect::BackgroundOffset;
        let spec = CaseSpec::one(4, effect, 3.0);
        let stated = nats(&spec)[0];
        let mut worth = Worth::new(&spec);
        let sd = 2.0;
        worth
            .builder
            .scene
            .uncertain
            .push(crate::scene::PriorError {
                key: "background.co2_ppm",
                sd,
                off: 0.0,
            });
        let unsure = worth.nats(&[3.0], 0, CHORDS);
        assert!(
            unsure <= 4.5 / (sd * sd) + 1e-6 && unsure < stated,
            "{unsure} {stated}"
        );
    }

    // The oracle is the readings themselves: by so much does the truth fit them better than the base,
    // on average over cases; a single gain of D nats has the variance 2 D.
    #[test]
    fn readings_gain_by_the_truth_what_is_said() {
        let (mut said, mut gained) = (0.0, 0.0);
        for (seed, effect, strength) in [
            (1, PlumeEffect::SigmaYScale, 0.6),
            (3, PlumeEffect::WindDirectionOffset, 1.3),
            (7, PlumeEffect::ClockOffset, 0.7),
            (9, PlumeEffect::WindVeerWithHeight, 1.2),
        ] {
            let spec = CaseSpec::one(seed, effect, strength);
            let worth = Worth::new(&spec);
            let (physics, faults, _) = worth.laws(&[strength]);
            let builder = &worth.builder;
            let mut read = worth.mean_logs(&physics, &faults, &worth.unmoved());
            let rows = builder.rows(&physics, &faults);
            for (log, rows) in read.iter_mut().zip(&rows) {
                for (own, row) in log.rows.iter_mut().zip(rows) {
                    let off = row.co2_ppm.unwrap() - own.mean_ppm;
                    // Spikes are no part of the noise that is known.
                    own.mean_ppm += if off.abs() < 60.0 { off } else { 0.0 };
                }
            }
            let misfit = |strengths: &[f64]| {
                Base::new(&worth, strengths, &faults).misfit(&read, &faults, CHORDS)
            };
            said += worth.nats(&[strength], 0, CHORDS);
            gained += misfit(&[0.0]) - misfit(&[strength]);
        }
        assert!(said > 40.0, "{said}");
        assert!(
            (gained - said).abs() < 3.0 * (2.0 * said).sqrt(),
            "{gained} {said}"
        );
    }

    #[test]
    fn strengths_are_found() {
        let spec = CaseSpec::one(3, PlumeEffect::EmissionTrend, 0.0);
        let tuned = tuned(&spec, &[40.0]).unwrap();
        assert!((tuned.nats[0] / 40.0 - 1.0).abs() < 0.15, "{tuned:?}");
        assert!((nats(&tuned.spec)[0] - tuned.nats[0]).abs() < 1e-9);
    }
}
