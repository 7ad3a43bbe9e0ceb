//! How visible an effect is, and the strength that makes it as visible as wanted.
//!
//! Visibility is the log score by which the true extension at its true parameters beats the
//! finder's base, under the noise that the finder fits to the case. Effects that the catalogue does
//! not have but that only multiply or turn the plume do so to the finder's plume in that extension.
//! Of other effects it is what they cost the base: its score of the control case, the same readings
//! without the effect, less that of the case. Of two effects each is as visible as asked beside the
//! other.

use gap::plume::{Known, PlumeChange, Setup, Visibility};
use gap_truth::mutation::Mutation;
use gap_truth::{Case, TrueEffect, Truth};
use plume::Mechanism;
use plume::mechanism::{Coordinate, MechanismId};
use scenario::Scenario;
use scenario::observations::{self, Observations};

use crate::plan::{Kind, Task};

/// A case read back as the finder reads it.
pub struct Read {
    /// The base.
    pub setup: Setup,
    /// The readings.
    pub observations: Observations,
}

/// Reads files of a case.
///
/// # Errors
/// What the reader or the finder says of them.
pub fn read(scenario_toml: &str, files: &[(String, String)]) -> Result<Read, String> {
    let scenario = Scenario::parse("scenario.toml", scenario_toml).map_err(|e| e.to_string())?;
    let setup = Setup::new(&scenario).map_err(|e| e.to_string())?;
    let texts: Vec<(&str, &str)> = files
        .iter()
        .map(|(n, t)| (n.as_str(), t.as_str()))
        .collect();
    let observations = observations::parse(&texts).map_err(|e| e.to_string())?;
    Ok(Read {
        setup,
        observations,
    })
}

/// A case with a strength of one of its effects, and how visible that is.
struct Shown {
    strength: f64,
    case: Case,
    /// Base and noise that are fitted to the case.
    fitted: Visibility,
    nats: f64,
}

impl Shown {
    /// The effect `which` of a case that has `strength`; `None` where the effects leave too few
    /// readings to see anything by.
    fn new(case: Case, strength: f64, which: usize) -> Result<Option<Self>, String> {
        let own = read(&case.scenario_toml, &case.observations)?;
        let fitted = Visibility::new(&own.setup, &own.observations).map_err(|e| e.to_string())?;
        let Some(fitted) = fitted else {
            return Ok(None);
        };
        let nats = visible(&case, &fitted, which)?;
        Ok(Some(Self {
            strength,
            case,
            fitted,
            nats,
        }))
    }
}

/// How visible the effect of a case is, nats; of two, the one `which` beside the other.
fn visible(case: &Case, fitted: &Visibility, which: usize) -> Result<f64, String> {
    let mechanisms = mechanisms(&case.truth)?;
    if mechanisms.len() > 1 {
        return Ok(fitted.nats_beside(&mechanisms, which));
    }
    let control;
    let of = |c: &gap_truth::TruePlumeChange| PlumeChange {
        platform: c.platform.clone(),
        time_s: c.time_s,
        factor: c.factor,
        turned_deg: c.turned_deg,
    };
    let changes: Vec<PlumeChange> = case.plume_changes.iter().map(of).collect();
    let known = if !changes.is_empty() {
        Known::Plume(&changes)
    } else if mechanisms.is_empty() {
        control = read(&case.scenario_toml, &case.control)?;
        Known::Twin(&control.observations)
    } else {
        Known::Mechanisms(&mechanisms)
    };
    fitted.nats(known).map_err(|e| e.to_string())
}

/// Whether a parameter is farther from what is usual than the catalogue's prior can mean.
fn absurd(truth: &Truth) -> bool {
    truth.effects.iter().any(|e| {
        let spec = MechanismId::from_name(e.effect.id()).map(MechanismId::spec);
        spec.is_some_and(|spec| {
            e.parameters.iter().any(|p| {
                let known = spec.parameters.iter().find(|s| s.name == p.name);
                known.is_some_and(|s| {
                    let away = match s.coordinate {
                        Coordinate::Log => (p.value / s.prior_centre).ln(),
                        Coordinate::Linear => p.value - s.prior_centre,
                    };
                    s.default.is_none() && away.abs() > ABSURD_SD * s.prior_sd
                })
            })
        })
    })
}

/// The hidden effects as the catalogue has them; none where one of them is not in it, or
/// follows another law.
///
/// # Errors
/// Parameters that the catalogue refuses.
pub fn mechanisms(truth: &Truth) -> Result<Vec<Mechanism>, String> {
    if truth.other_laws || truth.effects.iter().any(|e| !e.effect.in_catalogue()) {
        return Ok(Vec::new());
    }
    let of = |e: &TrueEffect| {
        let values: Vec<(&str, f64)> = e.parameters.iter().map(|p| (p.name, p.value)).collect();
        let mechanism = Mechanism::new(e.effect.id(), &values).map_err(|e| e.to_string())?;
        Ok(mechanism.for_platforms(&e.platforms))
    };
    truth.effects.iter().map(of).collect()
}

/// A case whose effects are as visible as the task asks.
pub struct Tuned {
    /// The case.
    pub case: Case,
    /// Base and noise that are fitted to it; none where nothing is hidden.
    pub fitted: Option<Visibility>,
    /// Its visibility, nats (of two effects, of the one tuned last beside the other).
    pub nats: f64,
    /// Seed of its scene.
    pub scene_seed: u64,
    /// Strength of each effect.
    pub strengths: Vec<f64>,
}

/// Strength beyond which an effect is given up as not to be seen in a scene.
const STRONGEST: f64 = 300.0;
/// Standard deviations of a mechanism's prior beyond which its size is absurd.
const ABSURD_SD: f64 = 3.0;
/// The strength tried first for [`WEAK_NATS`].
const WEAK: f64 = 2.0;
/// The visibility that most effects have about at the strength [`WEAK`], nats.
const WEAK_NATS: f64 = 20.0;
/// How often two effects are tuned, each beside the other.
const ROUNDS: usize = 2;
/// Scenes tried for one task.
const SCENES: u64 = 4;

/// Makes the case of `task`. `None` where no scene tried shows the effect strongly enough.
///
/// # Errors
/// What the reader or the finder says of the case's files.
pub fn tune(task: &Task) -> Result<Option<Tuned>, String> {
    let effects = task.effects();
    if effects.is_empty() {
        return Ok(plain(task));
    }
    for scene in 0..SCENES {
        let seed = task.seed + scene * 1_000;
        if let Some(tuned) = tune_in(task, seed, effects.len())? {
            return Ok(Some(tuned));
        }
    }
    Ok(None)
}

/// The case in the scene of `seed`: each of its effects as visible alone as asked, and then, where
/// there are two, beside the other, by which it may be hidden.
fn tune_in(task: &Task, seed: u64, count: usize) -> Result<Option<Tuned>, String> {
    let weak = WEAK * (task.nats / WEAK_NATS).sqrt();
    let mut strengths = vec![0.0; count];
    let mut last = None;
    for which in 0..count {
        let make = |strength: f64| {
            let mut alone = vec![0.0; count];
            alone[which] = strength;
            Case::make(&task.spec(seed, &alone))
        };
        let Some(found) = strength_for(task.nats, weak, 0, make)? else {
            return Ok(None);
        };
        strengths[which] = found.strength;
        last = Some(found);
    }
    for _ in 0..if count > 1 { ROUNDS } else { 0 } {
        for which in 0..count {
            let make = |strength: f64| {
                let mut both = strengths.clone();
                both[which] = strength;
                Case::make(&task.spec(seed, &both))
            };
            let Some(found) = strength_for(task.nats, strengths[which], which, make)? else {
                return Ok(None);
            };
            strengths[which] = found.strength;
            last = Some(found);
        }
    }
    Ok(last.map(|shown| Tuned {
        case: shown.case,
        fitted: Some(shown.fitted),
        nats: shown.nats,
        scene_seed: seed,
        strengths,
    }))
}

fn has_two((_, text): &(String, String)) -> bool {
    text.contains(",uav1,") && text.contains(",uav2,")
}

/// A case without effects; labels can only be swapped where a file has two.
fn plain(task: &Task) -> Option<Tuned> {
    let two = task.kind == Kind::Mutated(Mutation::LabelsSwapped);
    (0..SCENES * SCENES)
        .map(|scene| task.seed + scene * 1_000)
        .map(|scene_seed| Tuned {
            case: Case::make(&task.spec(scene_seed, &[])),
            fitted: None,
            nats: 0.0,
            scene_seed,
            strengths: Vec::new(),
        })
        .find(|t| !two || t.case.observations.iter().any(has_two))
}

/// The case whose visibility is within a tenth of `target`: growing steps from `first` until it
/// is bracketed, then regula falsi in the logarithms (visibility grows about as the square of
/// strength).
fn strength_for(
    target: f64,
    first: f64,
    which: usize,
    make: impl Fn(f64) -> Case,
) -> Result<Option<Shown>, String> {
    let Some(mut shown) = Shown::new(make(first), first, which)? else {
        return Ok(None);
    };
    let mut low: Option<(f64, f64)> = None;
    let mut high: Option<(f64, f64)> = None;
    for _ in 0..12 {
        let (strength, nats) = (shown.strength, shown.nats);
        if (nats / target - 1.0).abs() < 0.1 {
            return Ok(Some(shown));
        }
        if nats < target {
            low = Some((strength, nats))
        } else {
            high = Some((strength, nats))
        }
        let by_square = strength * (target / nats.max(0.05 * target)).sqrt();
        let strength = match (low, high) {
            (Some(l), Some(h)) => {
                let log = |n: f64| n.max(0.02 * target).ln();
                let share = (log(target) - log(l.1)) / (log(h.1) - log(l.1));
                (l.0.ln() + share.clamp(0.1, 0.9) * (h.0 / l.0).ln()).exp()
            }
            _ => by_square.clamp(strength / 5.0, strength * 4.0),
        };
        let case = make(strength);
        if strength > STRONGEST || absurd(&case.truth) {
            return Ok(None);
        }
        let Some(next) = Shown::new(case, strength, which)? else {
            return Ok(None);
        };
        shown = next;
    }
    // Some effects jump (a lid, a limit): what is reached counts if it is near enough.
    Ok(((shown.nats / target - 1.0).abs() < 0.3).then_some(shown))
}
