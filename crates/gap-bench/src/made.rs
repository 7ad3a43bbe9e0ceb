//! The case of a task: made so that what is hidden is as visible as the task asks, by the noise that
//! the generator knows ([`gap_truth::visibility`]).

use gap_truth::mutation::{Mutation, mutate};
use gap_truth::{Case, CaseSpec, Truth};
use gap_truth::{puffs, visibility};
use plume::mechanism::{Coordinate, MechanismId};

use crate::plan::{Generator, Kind, Task};

/// A case made for a task.
#[derive(Debug, Clone, PartialEq)]
pub struct Made {
    /// What was made.
    pub spec: CaseSpec,
    /// The case; its files are changed where the task says so.
    pub case: Case,
    /// D of each hidden effect beside the others, nats.
    pub nats: Vec<f64>,
}

/// Scenes tried for one task.
const SCENES: u64 = 4;
/// Standard deviations of a mechanism's prior beyond which its size is absurd.
const ABSURD_SD: f64 = 3.0;

/// Makes the case of `task`; `None` where no scene tried shows an effect strongly enough.
pub fn make(task: &Task) -> Option<Made> {
    let mut tried = (0..SCENES * SCENES).map(|scene| task.seed + scene * 1_000);
    let mut made = if task.generator == Generator::Puffs {
        tried
            .by_ref()
            .take(SCENES as usize)
            .find_map(|seed| of_puffs(task, seed))
    } else if task.effects().is_empty() {
        // Labels can only be swapped where a file has two.
        let two = task.kind == Kind::Mutated(Mutation::LabelsSwapped);
        tried
            .map(|seed| plain(task.spec(seed)))
            .find(|m| !two || m.case.observations.iter().any(has_two))
    } else {
        tried
            .by_ref()
            .take(SCENES as usize)
            .find_map(|seed| hidden(task, seed))
    }?;
    if let Kind::Mutated(mutation) = task.kind {
        for (_, text) in &mut made.case.observations {
            *text = mutate(text, mutation, task.seed);
        }
    }
    Some(made)
}

fn of_puffs(task: &Task, seed: u64) -> Option<Made> {
    let spec = task.spec(seed);
    let (spec, nats) = if task.nats.is_empty() {
        (spec, Vec::new())
    } else {
        let tuned = puffs::tuned(&spec, &task.nats)?;
        (tuned.spec, tuned.nats)
    };
    let case = puffs::make(&spec);
    (!absurd(&case.truth)).then_some(Made { spec, case, nats })
}

fn plain(spec: CaseSpec) -> Made {
    Made {
        case: Case::make(&spec),
        nats: Vec::new(),
        spec,
    }
}

fn hidden(task: &Task, seed: u64) -> Option<Made> {
    let spec = task.spec(seed);
    let (spec, nats) = if task.nats.is_empty() {
        let nats = visibility::nats(&spec);
        (spec, nats)
    } else {
        let tuned = visibility::tuned(&spec, &task.nats)?;
        (tuned.spec, tuned.nats)
    };
    let case = Case::make(&spec);
    // What is of another world is as it is there.
    (task.nats.is_empty() || !absurd(&case.truth)).then_some(Made { spec, case, nats })
}

fn has_two((_, text): &(String, String)) -> bool {
    text.contains(",uav1,") && text.contains(",uav2,")
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
