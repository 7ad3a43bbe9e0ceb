//! Which cases are made: rows of the table, and their seeds.

use gap_truth::case::DamageKind;
use gap_truth::mutation::{MUTATIONS, Mutation};
use gap_truth::{CATALOGUE, CaseSpec, HiddenEffect, NoiseForm, OUTSIDE, PlumeEffect};
use serde::{Deserialize, Serialize};

/// What a task is about.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub enum Kind {
    /// Nothing is hidden.
    Nothing,
    /// One effect of the catalogue, by its own law.
    One(PlumeEffect),
    /// One effect of the catalogue, by a law that differs a little.
    OtherLaw(PlumeEffect),
    /// One effect outside the catalogue.
    Outside(PlumeEffect),
    /// Two effects of the catalogue.
    Two(PlumeEffect, PlumeEffect),
    /// Damage to the raw data and nothing else.
    Damaged(DamageKind),
    /// Nothing is hidden, and then the file is changed.
    Mutated(Mutation),
}

/// One case to make and judge.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Task {
    /// What it is about.
    pub kind: Kind,
    /// Visibility of each effect, nats.
    pub nats: f64,
    /// Form of the noise.
    pub noise: NoiseForm,
    /// Seed.
    pub seed: u64,
}

impl Task {
    /// The row of the table that it belongs to.
    pub fn row(&self) -> String {
        match &self.kind {
            Kind::Nothing => match self.noise {
                NoiseForm::Usual => "none, usual noise".into(),
                NoiseForm::Unusual => "none, other noise".into(),
                NoiseForm::SlowSensors => "none, slow sensors".into(),
                NoiseForm::GustyWind => "none, gusty wind".into(),
                NoiseForm::UnloggedWind => "none, swinging wind not logged".into(),
            },
            Kind::One(effect) => format!("{effect}, D = {}", self.nats),
            Kind::OtherLaw(effect) => format!("other law: {effect}, D = {}", self.nats),
            Kind::Outside(effect) => format!("outside: {effect}, D = {}", self.nats),
            Kind::Two(..) => format!("two effects, D = {} each", self.nats),
            Kind::Damaged(kind) => format!("damaged: {}", kind.as_str()),
            Kind::Mutated(mutation) => format!("mutated: {mutation:?}"),
        }
    }

    /// The effects to hide.
    pub fn effects(&self) -> Vec<PlumeEffect> {
        match &self.kind {
            Kind::One(e) | Kind::OtherLaw(e) | Kind::Outside(e) => vec![*e],
            Kind::Two(a, b) => vec![*a, *b],
            _ => Vec::new(),
        }
    }

    /// The case, with effects of these strengths.
    pub fn spec(&self, seed: u64, strengths: &[f64]) -> CaseSpec {
        let hidden = self
            .effects()
            .into_iter()
            .zip(strengths)
            .map(|(effect, &strength)| HiddenEffect { effect, strength })
            .collect();
        CaseSpec {
            hidden,
            noise: self.noise,
            other_laws: matches!(self.kind, Kind::OtherLaw(_)),
            damage: match self.kind {
                Kind::Damaged(kind) => Some(kind),
                _ => None,
            },
            ..CaseSpec::none(seed)
        }
    }
}

/// Effects whose law has another form.
const OTHER_LAWS: [PlumeEffect; 12] = [
    PlumeEffect::DryDeposition,
    PlumeEffect::FirstOrderDecay,
    PlumeEffect::SigmaZGrowth,
    PlumeEffect::SigmaYScale,
    PlumeEffect::SigmaZScale,
    PlumeEffect::MixingLid,
    PlumeEffect::BuildingDownwash,
    PlumeEffect::WindVeerWithHeight,
    PlumeEffect::EmissionTrend,
    PlumeEffect::BackgroundDrift,
    PlumeEffect::SensorLag,
    PlumeEffect::Meander,
];

/// Pairs of effects that data of six tracks can tell apart.
const PAIRS: [(PlumeEffect, PlumeEffect); 8] = [
    (PlumeEffect::SensorLag, PlumeEffect::BackgroundDrift),
    (PlumeEffect::SigmaYScale, PlumeEffect::SensorOffset),
    (PlumeEffect::SecondSource, PlumeEffect::ClockOffset),
    (
        PlumeEffect::EffectiveHeightOffset,
        PlumeEffect::EmissionTrend,
    ),
    (
        PlumeEffect::WindDirectionOffset,
        PlumeEffect::CrossSensitivityHumidity,
    ),
    (PlumeEffect::SigmaZScale, PlumeEffect::BackgroundGradient),
    (
        PlumeEffect::SensorSaturation,
        PlumeEffect::WindDirectionDrift,
    ),
    (PlumeEffect::SensorDrift, PlumeEffect::SigmaZGrowth),
];

/// All tasks for `seeds` seeds a case: twenty-five times as many without an effect, half of that
/// with other noise, and five times each with slow sensors, in a gusty wind and in a
/// swinging one that nobody logs.
pub fn plan(seeds: u64, first_seed: u64) -> Vec<Task> {
    let mut tasks = Vec::new();
    // Each row has seeds of its own.
    let mut row = first_seed;
    let mut push = |kind: Kind, nats: f64, noise: NoiseForm, count: u64| {
        row += 100_000;
        tasks.extend((0..count).map(|k| Task {
            kind: kind.clone(),
            nats,
            noise,
            seed: row + k,
        }));
    };
    push(Kind::Nothing, 0.0, NoiseForm::Usual, 25 * seeds);
    push(Kind::Nothing, 0.0, NoiseForm::Unusual, 12 * seeds);
    for nats in [20.0, 60.0] {
        for effect in CATALOGUE {
            push(Kind::One(effect), nats, NoiseForm::Usual, seeds);
        }
    }
    for effect in OTHER_LAWS {
        push(Kind::OtherLaw(effect), 60.0, NoiseForm::Usual, seeds);
    }
    for effect in OUTSIDE {
        push(Kind::Outside(effect), 100.0, NoiseForm::Usual, seeds);
    }
    for (a, b) in PAIRS {
        push(Kind::Two(a, b), 40.0, NoiseForm::Usual, seeds.div_ceil(2));
    }
    for kind in [DamageKind::Frozen, DamageKind::Gap, DamageKind::Clipped] {
        push(Kind::Damaged(kind), 0.0, NoiseForm::Usual, seeds);
    }
    for mutation in MUTATIONS {
        push(
            Kind::Mutated(mutation),
            0.0,
            NoiseForm::Usual,
            seeds.div_ceil(4),
        );
    }
    push(Kind::Nothing, 0.0, NoiseForm::SlowSensors, 5 * seeds);
    push(Kind::Nothing, 0.0, NoiseForm::GustyWind, 5 * seeds);
    push(Kind::Nothing, 0.0, NoiseForm::UnloggedWind, 5 * seeds);
    tasks
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn twenty_seeds_make_five_hundred_cases_without_effect_and_no_seed_twice() {
        let tasks = plan(20, 0);
        let none = tasks
            .iter()
            .filter(|t| t.row() == "none, usual noise")
            .count();
        assert!(none >= 500, "{none}");
        let mut seeds: Vec<u64> = tasks.iter().map(|t| t.seed).collect();
        seeds.sort_unstable();
        seeds.dedup();
        assert_eq!(seeds.len(), tasks.len());
    }
}
