//! What the best vertical model leaves: a factor on all arcs at one distance, or a scatter of
//! arcs far beyond the errors of measurement. Neither has a name.

use super::LEAST_TRIALS;
use super::evidence::Fit;
use super::ladder::{Group, Tried, VerticalModel, same_distance};
use crate::verdict::{Unexplained, UnexplainedKind};

/// Nats of evidence that a factor at one distance must gain over the best model, before what its
/// search and laws not quite right may cost.
const LEAST_NATS: f64 = 5.0;
/// Part of the gain of the best model that a law not quite right may leave at one distance: the
/// ends of the arcs bend away first.
const LAW_ERROR: f64 = 0.2;
/// Scatter of arcs about their trial's line, ln, that no sampling explains: a factor of 1.8.
const LARGEST_SCATTER: f64 = 0.6;

/// The misfit without a name that is left in one kind of air, if any. `gain` is what the best
/// model gains over the base, nats.
pub(super) fn unexplained(
    group: &Group<'_>,
    air: &str,
    best: (&VerticalModel, &Fit),
    gain: f64,
) -> Option<Unexplained> {
    let (model, fit) = best;
    let mut distances: Vec<(f64, usize)> = Vec::new();
    let arcs = group.trials.iter().flat_map(|t| &t.arcs);
    for arc in arcs.filter(|a| a.whole) {
        let near = |d: &&mut (f64, usize)| same_distance(arc.distance_m, d.0);
        match distances.iter_mut().find(near) {
            Some(d) => d.1 += 1,
            None => distances.push((arc.distance_m, 1)),
        }
    }
    distances.retain(|d| d.1 >= LEAST_TRIALS);
    let all: Vec<usize> = (0..group.trials.len()).collect();
    let offsets = distances.iter().filter_map(|(x, _)| {
        let with = model.with_offset_at(*x).fit(group, &all, None)?;
        let nats = with.log_evidence - fit.log_evidence;
        Some((*x, with.theta.last()?.exp(), nats))
    });
    let strongest = offsets.max_by(|a, b| a.2.total_cmp(&b.2));
    // With two distances a factor at one is a growth.
    let at_one = strongest.filter(|s| {
        distances.len() > 2 && s.2 > LEAST_NATS + (distances.len() as f64).ln() + LAW_ERROR * gain
    });
    let (term, nats) = if let Some((x, factor, nats)) = at_one {
        let term = format!(
            "crosswind integrals at {x:.0} m are {factor:.2} times what the best model gives, and no others are; \
             check the samplers of that arc"
        );
        (term, nats)
    } else if fit.noise.arc > LARGEST_SCATTER {
        let term = format!(
            "crosswind integrals scatter about the best model by a factor of {:.1} from arc to arc",
            fit.noise.arc.exp()
        );
        (term, f64::NAN)
    } else {
        return None;
    };
    Some(Unexplained {
        kind: UnexplainedKind::Discrepancy,
        coordinate: "along_wind".into(),
        term,
        from_s: f64::NAN,
        to_s: f64::NAN,
        platforms: vec![air.to_owned()],
        delta_log_evidence: nats,
        candidates: Vec::new(),
    })
}
