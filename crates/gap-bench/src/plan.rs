//! Which cases are made: rows of the table, and their seeds.

use gap_truth::case::{DamageKind, TrackForm};
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
    /// Several effects of the catalogue.
    Several(Vec<PlumeEffect>),
    /// Damage to the raw data and nothing else.
    Damaged(DamageKind),
    /// Nothing is hidden, and then the file is changed.
    Mutated(Mutation),
}

/// What makes the cases.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, clap::ValueEnum)]
pub enum Generator {
    /// A mean plume, or puffs in a common wind, with noise ([`gap_truth::Case::make`]).
    #[default]
    Plume,
    /// Puffs that turbulence moves about ([`gap_truth::puffs`]).
    Puffs,
}

/// One case to make and judge.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Task {
    /// What it is about.
    pub kind: Kind,
    /// D of each effect beside the others that is wanted, nats; none for effects that are as strong as
    /// in the world they are from.
    pub nats: Vec<f64>,
    /// Their strengths there; 1 where none is given.
    pub strengths: Vec<f64>,
    /// Form of the noise.
    pub noise: NoiseForm,
    /// From row to row of a platform, s.
    pub row_step_s: usize,
    /// Who reads.
    pub tracks: TrackForm,
    /// Seed.
    pub seed: u64,
    /// What makes it.
    #[serde(default)]
    pub generator: Generator,
}

/// Lower bounds of the classes of D, nats; the last class ends at [`HIGHEST_NATS`].
pub const CLASSES: [f64; 3] = [20.0, 60.0, 150.0];
/// Highest D that is asked for, nats.
pub const HIGHEST_NATS: f64 = 600.0;

/// The class of a D, for names; "" below the lowest.
pub fn class(nats: f64) -> &'static str {
    match nats {
        n if n >= CLASSES[2] => "D ≥ 150",
        n if n >= CLASSES[1] => "D 60–150",
        n if n >= CLASSES[0] => "D 20–60",
        _ => "",
    }
}

impl Task {
    /// The same by a generator; none where it has no such case.
    pub fn by(self, generator: Generator) -> Option<Self> {
        match generator {
            Generator::Plume => Some(self),
            Generator::Puffs => self.of_puffs(),
        }
    }

    fn of_puffs(&self) -> Option<Self> {
        use NoiseForm as F;
        let is_known = matches!(
            self.kind,
            Kind::Nothing | Kind::One(_) | Kind::Outside(_) | Kind::Several(_)
        ) && matches!(self.noise, F::Usual | F::Intermittent | F::Meandering)
            && self.tracks == TrackForm::Usual
            && self.row_step_s == 1
            && self.strengths.is_empty()
            && self.effects().len() == self.nats.len()
            && self.effects().into_iter().all(gap_truth::puffs::shows);
        is_known.then(|| Self {
            generator: Generator::Puffs,
            ..self.clone()
        })
    }

    /// The row of the table that it belongs to.
    pub fn row(&self) -> String {
        let nats = self.nats.iter().copied().fold(f64::INFINITY, f64::min);
        let class = match self.nats.len() {
            0 if !self.strengths.is_empty() => ", of another world".into(),
            0 => String::new(),
            _ => format!(", {}", class(nats)),
        };
        let what = match &self.kind {
            Kind::Nothing => "none".to_owned(),
            Kind::One(effect) => effect.to_string(),
            Kind::OtherLaw(effect) => format!("other law: {effect}"),
            Kind::Outside(effect) => format!("outside: {effect}"),
            Kind::Several(effects) if effects.len() == 2 => "two effects".into(),
            Kind::Several(effects) => format!("{} effects", effects.len()),
            Kind::Damaged(kind) => format!("damaged: {}", kind.as_str()),
            Kind::Mutated(mutation) => format!("mutated: {mutation:?}"),
        };
        format!("{what}{class}{}", self.circumstances())
    }

    /// What is unusual besides what is hidden, for names.
    fn circumstances(&self) -> String {
        let noise = match self.noise {
            NoiseForm::Usual => "",
            NoiseForm::Unusual => ", other noise",
            NoiseForm::SlowSensors => ", slow sensors",
            NoiseForm::GustyWind => ", gusty wind",
            NoiseForm::UnloggedWind => ", swinging wind not logged",
            NoiseForm::Realistic => ", strong noise with memory",
            NoiseForm::Intermittent => ", intermittent",
            NoiseForm::Meandering => ", meandering",
        };
        let tracks = match self.tracks {
            TrackForm::Usual => "",
            TrackForm::Spirals => ", spirals",
            TrackForm::Fixed => ", fixed sensors",
        };
        let rows = match self.row_step_s {
            0 | 1 => "",
            _ => ", sparse rows",
        };
        format!("{noise}{tracks}{rows}")
    }

    /// The effects to hide.
    pub fn effects(&self) -> Vec<PlumeEffect> {
        match &self.kind {
            Kind::One(e) | Kind::OtherLaw(e) | Kind::Outside(e) => vec![*e],
            Kind::Several(effects) => effects.clone(),
            _ => Vec::new(),
        }
    }

    /// The case in the scene of `seed`, with the strengths that are given.
    pub fn spec(&self, seed: u64) -> CaseSpec {
        let hide = |(k, effect)| HiddenEffect {
            effect,
            strength: self.strengths.get(k).copied().unwrap_or(1.0),
        };
        CaseSpec {
            hidden: self.effects().into_iter().enumerate().map(hide).collect(),
            noise: self.noise,
            row_step_s: self.row_step_s,
            tracks: self.tracks,
            other_laws: matches!(self.kind, Kind::OtherLaw(_)),
            damage: match self.kind {
                Kind::Damaged(kind) => Some(kind),
                _ => None,
            },
            ..CaseSpec::none(seed)
        }
    }
}

use PlumeEffect as E;

/// Effects whose law has another form.
const OTHER_LAWS: [E; 12] = [
    E::DryDeposition,
    E::FirstOrderDecay,
    E::SigmaZGrowth,
    E::SigmaYScale,
    E::SigmaZScale,
    E::MixingLid,
    E::BuildingDownwash,
    E::WindVeerWithHeight,
    E::EmissionTrend,
    E::BackgroundDrift,
    E::SensorLag,
    E::Meander,
];

/// Effects that are hidden together.
const TOGETHER: [&[E]; 14] = [
    &[E::SensorLag, E::BackgroundDrift],
    &[E::SigmaYScale, E::SensorOffset],
    &[E::SecondSource, E::ClockOffset],
    &[E::EffectiveHeightOffset, E::EmissionTrend],
    &[E::WindDirectionOffset, E::CrossSensitivityHumidity],
    &[E::SigmaZScale, E::BackgroundGradient],
    &[E::SensorSaturation, E::WindDirectionDrift],
    &[E::SensorDrift, E::SigmaZGrowth],
    &[E::FirstOrderDecay, E::WindVeerWithHeight],
    &[E::EmissionScale, E::Meander],
    &[E::SensorLag, E::SigmaYScale, E::BackgroundDrift],
    &[E::WindDirectionOffset, E::EmissionTrend, E::SensorOffset],
    &[E::EffectiveHeightOffset, E::SigmaZScale, E::SensorDrift],
    &[E::SecondSource, E::BackgroundGradient, E::ClockOffset],
];

/// Effects that rows far apart, fixed sensors and spirals must show too.
const ELSEWHERE: [E; 6] = [
    E::WindDirectionOffset,
    E::SigmaYScale,
    E::EmissionTrend,
    E::BackgroundDrift,
    E::SensorOffset,
    E::EffectiveHeightOffset,
];

/// Realities of another form that the catalogue has a name for, with their strengths: two classes off
/// (class B for D), and a decay of .003/s with a growth of σ_z of .3.
fn realities() -> [(Kind, Vec<f64>); 2] {
    [
        (Kind::One(E::StabilityClass), vec![8.0]),
        (
            Kind::Several(vec![E::FirstOrderDecay, E::SigmaZGrowth]),
            vec![15.0, 2.5],
        ),
    ]
}

/// A number from 0 to 1 for the seed, evenly spread over successive ones.
fn share(seed: u64) -> f64 {
    // The golden ratio's multiples, modulo 1.
    (seed as f64 * 0.618_033_988_749_895).fract()
}

/// A D in the class that begins at `low`, nats, even in its logarithm.
fn in_class(low: f64, seed: u64) -> f64 {
    let next = CLASSES.iter().find(|c| **c > low);
    let high = next.copied().unwrap_or(HIGHEST_NATS);
    low * (high / low).powf(share(seed))
}

/// D of effects together: the weakest in the lowest class, the next one to four times as visible.
fn unequal(count: usize, seed: u64) -> Vec<f64> {
    let first = in_class(CLASSES[0], seed);
    let of = |k: usize| {
        let ratio = [1.0, 2.0, 4.0][(seed as usize + k) % 3];
        if k == 0 { first } else { first * ratio }
    };
    (0..count).map(of).collect()
}

/// Makes tasks row by row.
struct Rows {
    tasks: Vec<Task>,
    first: u64,
}

impl Rows {
    /// `count` tasks like `task`, each with its own seed and what `nats` gives for it.
    fn push(&mut self, task: &Task, count: u64, nats: impl Fn(u64) -> Vec<f64>) {
        // Each row has seeds of its own.
        self.first += 100_000;
        for seed in self.first..self.first + count {
            self.tasks.push(Task {
                seed,
                nats: nats(seed),
                ..task.clone()
            });
        }
    }
}

fn usual(kind: Kind) -> Task {
    Task {
        kind,
        nats: Vec::new(),
        strengths: Vec::new(),
        noise: NoiseForm::Usual,
        row_step_s: 1,
        tracks: TrackForm::Usual,
        seed: 0,
        generator: Generator::Plume,
    }
}

/// All tasks for `seeds` seeds a case: more of them where nothing is hidden, for that is what the
/// rarest error is measured by.
pub fn plan(seeds: u64, first_seed: u64) -> Vec<Task> {
    let mut rows = Rows {
        tasks: Vec::new(),
        first: first_seed,
    };
    without_effects(&mut rows, seeds);
    for low in CLASSES {
        for effect in CATALOGUE {
            rows.push(&usual(Kind::One(effect)), seeds, |seed| {
                vec![in_class(low, seed)]
            });
        }
    }
    elsewhere(&mut rows, seeds);
    for effect in OTHER_LAWS {
        rows.push(&usual(Kind::OtherLaw(effect)), seeds, |seed| {
            vec![in_class(CLASSES[1], seed)]
        });
    }
    for effect in OUTSIDE {
        let as_in_its_world = effect.is_a_reality();
        rows.push(&usual(Kind::Outside(effect)), seeds, |seed| {
            if as_in_its_world {
                Vec::new()
            } else {
                vec![in_class(CLASSES[1 + (seed % 2) as usize], seed)]
            }
        });
    }
    for (kind, strengths) in realities() {
        let task = Task {
            strengths,
            ..usual(kind)
        };
        rows.push(&task, seeds, |_| Vec::new());
    }
    for effects in TOGETHER {
        let kind = Kind::Several(effects.to_vec());
        rows.push(&usual(kind), seeds.div_ceil(2), |seed| {
            unequal(effects.len(), seed)
        });
    }
    unsteady(&mut rows, seeds);
    rows.tasks
}

/// Air that is intermittent, and whose plume meanders as well.
fn unsteady(rows: &mut Rows, seeds: u64) {
    for noise in [NoiseForm::Intermittent, NoiseForm::Meandering] {
        let task = |kind| Task {
            noise,
            ..usual(kind)
        };
        rows.push(&task(Kind::Nothing), 5 * seeds, |_| Vec::new());
        for effect in ELSEWHERE {
            rows.push(&task(Kind::One(effect)), seeds, |seed| {
                vec![in_class(CLASSES[1], seed)]
            });
        }
    }
}

fn without_effects(rows: &mut Rows, seeds: u64) {
    let none = |_: u64| Vec::new();
    let nothing = usual(Kind::Nothing);
    for (noise, times) in [
        (NoiseForm::Usual, 10),
        (NoiseForm::Unusual, 5),
        (NoiseForm::SlowSensors, 5),
        (NoiseForm::GustyWind, 5),
        (NoiseForm::UnloggedWind, 5),
        (NoiseForm::Realistic, 10),
    ] {
        let task = Task {
            noise,
            ..nothing.clone()
        };
        rows.push(&task, times * seeds, none);
    }
    for row_step_s in [3, 4, 5] {
        let task = Task {
            noise: NoiseForm::SlowSensors,
            row_step_s,
            ..nothing.clone()
        };
        rows.push(&task, 3 * seeds, none);
    }
    for tracks in [TrackForm::Spirals, TrackForm::Fixed] {
        let task = Task {
            tracks,
            ..nothing.clone()
        };
        rows.push(&task, 3 * seeds, none);
    }
    for kind in [
        DamageKind::Frozen,
        DamageKind::Gap,
        DamageKind::Clipped,
        DamageKind::Jumps,
    ] {
        rows.push(&usual(Kind::Damaged(kind)), seeds, none);
    }
    for mutation in MUTATIONS {
        rows.push(&usual(Kind::Mutated(mutation)), seeds.div_ceil(4), none);
    }
}

/// One effect where rows or tracks are unusual.
fn elsewhere(rows: &mut Rows, seeds: u64) {
    for (k, effect) in ELSEWHERE.into_iter().enumerate() {
        let one = usual(Kind::One(effect));
        let sparse = Task {
            noise: NoiseForm::SlowSensors,
            row_step_s: 3 + k % 3,
            ..one.clone()
        };
        let spirals = Task {
            tracks: TrackForm::Spirals,
            ..one.clone()
        };
        let fixed = Task {
            tracks: TrackForm::Fixed,
            ..one.clone()
        };
        let realistic = Task {
            noise: NoiseForm::Realistic,
            ..one
        };
        for task in [sparse, spirals, fixed, realistic] {
            rows.push(&task, seeds.div_ceil(2), |seed| {
                vec![in_class(CLASSES[(seed % 2) as usize], seed)]
            });
        }
    }
}

/// Groups of rows, and how many of a dozen of [`share_of`]'s cases each has.
fn group(task: &Task) -> (usize, usize) {
    match &task.kind {
        Kind::Nothing => (0, 3),
        Kind::One(_) => (1, 4),
        Kind::Outside(_) => (2, 2),
        Kind::Several(_) => (3, 2),
        Kind::OtherLaw(_) | Kind::Damaged(_) | Kind::Mutated(_) => (4, 1),
    }
}

/// `count` tasks of the plan from `first_seed` on, spread over all kinds of rows.
pub fn share_of(count: usize, first_seed: u64) -> Vec<Task> {
    share_by(count, first_seed, Generator::Plume)
}

/// The same of cases that `generator` makes.
pub fn share_by(count: usize, first_seed: u64, generator: Generator) -> Vec<Task> {
    // Enough for any count: each group of rows gives one of each row before it gives a second.
    let seeds = match generator {
        Generator::Plume => (count as u64 / 24).max(1),
        Generator::Puffs => (count as u64 / 12).max(1),
    };
    let mut groups: Vec<Vec<Task>> = vec![Vec::new(); 5];
    let mut turns = [0; 5];
    for task in plan(seeds, first_seed)
        .into_iter()
        .filter_map(|t| t.by(generator))
    {
        let (group, times) = group(&task);
        turns[group] = times;
        groups[group].push(task);
    }
    for tasks in &mut groups {
        // The last digits of a seed count within its row.
        tasks.sort_by_key(|t| (t.seed - first_seed) % 100_000);
        spread(tasks, seeds as usize);
    }
    let mut out: Vec<Task> = Vec::new();
    let mut left: Vec<_> = groups.into_iter().map(Vec::into_iter).collect();
    while out.len() < count {
        let before = out.len();
        for (tasks, turns) in left.iter_mut().zip(turns) {
            out.extend(tasks.by_ref().take(turns));
        }
        if out.len() == before {
            break;
        }
    }
    out.truncate(count);
    out
}

/// Puts tasks that follow each other in the table far apart.
fn spread(tasks: &mut [Task], seeds: usize) {
    let each = tasks.len().div_ceil(seeds);
    for chunk in tasks.chunks_mut(each.max(1)) {
        let n = chunk.len();
        let step = (1..n.max(2))
            .rev()
            .find(|s| *s as f64 <= 0.382 * n as f64 && gcd(*s, n) == 1)
            .unwrap_or(1);
        let old = chunk.to_vec();
        for (k, place) in chunk.iter_mut().enumerate() {
            place.clone_from(&old[k * step % n]);
        }
    }
}

fn gcd(a: usize, b: usize) -> usize {
    if b == 0 { a } else { gcd(b, a % b) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_seed_is_used_twice_and_the_d_is_in_its_class() {
        let tasks = plan(20, 0);
        let none = tasks.iter().filter(|t| t.kind == Kind::Nothing).count();
        assert!(none >= 500, "{none}");
        let mut seeds: Vec<u64> = tasks.iter().map(|t| t.seed).collect();
        seeds.sort_unstable();
        seeds.dedup();
        assert_eq!(seeds.len(), tasks.len());
        for task in &tasks {
            assert!(task.nats.iter().all(|n| !class(*n).is_empty()), "{task:?}");
        }
    }

    #[test]
    fn a_share_has_every_kind() {
        for count in [60, 200] {
            let tasks = share_of(count, 7_000_000);
            assert_eq!(tasks.len(), count);
            for group_index in 0..5 {
                assert!(
                    tasks.iter().any(|t| group(t).0 == group_index),
                    "{group_index}"
                );
            }
            let all = plan(100, 7_000_000);
            assert!(tasks.iter().all(|t| all.contains(t)));
        }
    }

    #[test]
    fn the_second_generator_has_a_share_of_its_own() {
        let tasks = share_by(200, 7_000_000, Generator::Puffs);
        assert_eq!(tasks.len(), 200);
        for group_index in 0..4 {
            assert!(
                tasks.iter().any(|t| group(t).0 == group_index),
                "{group_index}"
            );
        }
        for noise in [
            NoiseForm::Usual,
            NoiseForm::Intermittent,
            NoiseForm::Meandering,
        ] {
            let is_such = |t: &Task| t.kind == Kind::Nothing && t.noise == noise;
            assert!(tasks.iter().any(is_such), "{noise:?}");
        }
        assert!(tasks.iter().all(|t| t.generator == Generator::Puffs));
    }
}
