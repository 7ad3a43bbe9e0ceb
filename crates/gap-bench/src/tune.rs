//! How visible an effect is, and the strength that makes it as visible as wanted.
//!
//! Visibility is the log score that knowing the effect would gain: the finder's base on the
//! case's twin, which lacks the effect, minus the same base on the case, each under the noise
//! that the finder fits. So it is measured for effects outside the catalogue too. What the
//! noise of the case can swallow does not count as visible.

use gap::plume::{Setup, base_score};
use gap_truth::Case;
use gap_truth::mutation::Mutation;
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

/// Score of the base on files of a case, with the noise fitted there, nats.
fn score(scenario_toml: &str, files: &[(String, String)]) -> Result<f64, String> {
    let read = read(scenario_toml, files)?;
    let score = base_score(&read.setup, &read.observations, None).map_err(|e| e.to_string())?;
    Ok(score.log_score)
}

/// A case whose effects are as visible as the task asks.
pub struct Tuned {
    /// The case.
    pub case: Case,
    /// Its visibility, nats (of the first effect alone where there are two).
    pub nats: f64,
}

/// Strength beyond which an effect is given up as not to be seen in a scene.
const STRONGEST: f64 = 300.0;
/// Scenes tried for one task.
const SCENES: u64 = 4;

/// Makes the case of `task`. `None` where no scene tried shows the effect strongly enough.
///
/// # Errors
/// What the reader or the finder says of the case's files.
pub fn tune(task: &Task) -> Result<Option<Tuned>, String> {
    let effects = task.effects();
    if effects.is_empty() {
        return Ok(plain(task).map(|case| Tuned { case, nats: 0.0 }));
    }
    for scene in 0..SCENES {
        let seed = task.seed + scene * 1_000;
        let mut strengths = vec![0.0; effects.len()];
        let mut reached = Vec::new();
        for which in 0..effects.len() {
            // Each effect alone, the others left out.
            let make = |strength: f64| {
                let mut alone = vec![0.0; effects.len()];
                alone[which] = strength;
                Case::make(&task.spec(seed, &alone))
            };
            match strength_for(task.nats, make)? {
                Some((strength, nats)) => {
                    strengths[which] = strength;
                    reached.push(nats);
                }
                None => break,
            }
        }
        if reached.len() == effects.len() {
            let case = Case::make(&task.spec(seed, &strengths));
            return Ok(Some(Tuned {
                case,
                nats: reached[0],
            }));
        }
    }
    Ok(None)
}

/// A case without effects; labels can only be swapped where there are two.
fn plain(task: &Task) -> Option<Case> {
    let two = task.kind == Kind::Mutated(Mutation::LabelsSwapped);
    (0..SCENES * SCENES)
        .map(|scene| Case::make(&task.spec(task.seed + scene * 1_000, &[])))
        .find(|case| !two || case.observations.iter().any(|f| f.1.contains(",uav2,")))
}

/// The strength whose visibility is within a tenth of `target`, with that visibility: growing
/// steps until it is bracketed, then regula falsi in the logarithms (visibility grows about as
/// the square of strength).
fn strength_for(target: f64, make: impl Fn(f64) -> Case) -> Result<Option<(f64, f64)>, String> {
    let mut strength: f64 = 2.0;
    let first = make(strength);
    let twin = score(&first.scenario_toml, &first.twin)?;
    let visible = |case: &Case| -> Result<f64, String> {
        Ok(twin - score(&case.scenario_toml, &case.observations)?)
    };
    let mut nats = visible(&first)?;
    let mut low: Option<(f64, f64)> = None;
    let mut high: Option<(f64, f64)> = None;
    for _ in 0..12 {
        if (nats / target - 1.0).abs() < 0.1 {
            return Ok(Some((strength, nats)));
        }
        if nats < target {
            low = Some((strength, nats))
        } else {
            high = Some((strength, nats))
        }
        let by_square = strength * (target / nats.max(0.05 * target)).sqrt();
        strength = match (low, high) {
            (Some(l), Some(h)) => {
                let log = |n: f64| n.max(0.02 * target).ln();
                let share = (log(target) - log(l.1)) / (log(h.1) - log(l.1));
                (l.0.ln() + share.clamp(0.1, 0.9) * (h.0 / l.0).ln()).exp()
            }
            _ => by_square.clamp(strength / 5.0, strength * 4.0),
        };
        if strength > STRONGEST {
            return Ok(None);
        }
        nats = visible(&make(strength))?;
    }
    // Some effects jump (a lid, a limit): what is reached counts if it is near enough.
    Ok(((nats / target - 1.0).abs() < 0.3).then_some((strength, nats)))
}
