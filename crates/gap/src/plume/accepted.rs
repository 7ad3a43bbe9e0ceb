//! A cause that was accepted: its set, its probability, and where it may be instead.

use ::plume::mechanism::MechanismId;

use super::explore::{Round, Tried};
use super::model::Model;
use crate::verdict::Evidence;

/// Probability at which a name stands alone.
const NAME_AT: f64 = 0.95;
/// Probability that several hold together: a set is there to hold the cause, more surely than a
/// name that is worth its risk.
const SET_AT: f64 = 0.975;
/// No law of the catalogue is nature's own: of what a cause gains, a part goes to whichever law
/// has the form that happens to be nearer. At this gain differences count for half, nats.
const LAW_NATS: f64 = 60.0;
/// However large the gain, a difference of evidence counts for this part of itself at least.
const LEAST_POWER: f64 = 0.2;

/// A mechanism that was accepted.
#[derive(Debug, Clone)]
pub(crate) struct Accepted {
    pub id: MechanismId,
    pub platform: Option<usize>,
    pub part: usize,
    /// Ids that the data cannot tell from it, itself first, with their probabilities.
    pub set: Vec<(MechanismId, f64)>,
    /// Probability that it is any mechanism of the catalogue, nameless terms counted in.
    pub of_catalogue: f64,
    pub evidence: Evidence,
    /// What it gained when it was called for, under the noise of the model then, nats: how strong
    /// it is. Under a noise that was fitted with all names it may seem to gain several times that.
    pub strength_nats: f64,
    pub nats_to_next: f64,
    /// Fits of the other members of the set.
    pub others: Vec<(MechanismId, Option<usize>, Model)>,
    /// Other platforms, or all together, that may have the same fault instead, each with the
    /// probability of that.
    pub elsewhere: Vec<(Option<usize>, f64)>,
}

/// The power that evidence is taken to between two causes, so that what laws differ by does not
/// pass for knowledge.
pub(crate) fn law_power(one: MechanismId, other: Option<MechanismId>, strength_nats: f64) -> f64 {
    let by_definition = |id: MechanismId| id.spec().by_definition;
    if by_definition(one) && other.is_some_and(by_definition) {
        return 1.0;
    }
    (1.0 / (1.0 + strength_nats.max(0.0) / LAW_NATS)).max(LEAST_POWER)
}

/// A name as a round gives it, with all that the data cannot tell from it; one that had been
/// called for before was as strong as it was then, if it seems stronger now.
pub(crate) fn accept(round: &Round, best: &Tried, before: Option<&Accepted>) -> Accepted {
    let strength_nats = before.map_or(best.log_score, |b| b.strength_nats.min(best.log_score));
    let ids = round.by_id(|evidence, id| {
        let power = law_power(best.id, id, strength_nats);
        best.log_evidence + power * (evidence - best.log_evidence)
    });
    // Nameless rivals and the base take part in the probabilities, but not in the set.
    let of_catalogue: f64 = ids.iter().map(|i| i.1).sum();
    // Of what the catalogue has, where nameless terms leave it less than that.
    let enough = |at: f64| {
        if of_catalogue > at {
            at
        } else {
            at * of_catalogue
        }
    };
    let mut set: Vec<(MechanismId, f64)> = Vec::new();
    let own = ids.iter().find(|i| i.0 == best.id).copied();
    set.extend(own);
    for &(id, p) in &ids {
        let at = if set.len() < 2 { NAME_AT } else { SET_AT };
        if sum(&set) >= enough(at) {
            break;
        }
        if id != best.id {
            set.push((id, p));
        }
    }
    let next = round
        .tried
        .iter()
        .filter(|t| !set.iter().any(|s| s.0 == t.id))
        .map(|t| t.log_evidence)
        .fold(0.0f64, f64::max);
    let others = set[1..]
        .iter()
        .filter_map(|(id, _)| {
            let t = round.tried.iter().find(|t| t.id == *id)?;
            Some((*id, t.platform, t.fitted.model.clone()))
        })
        .collect();
    Accepted {
        id: best.id,
        platform: best.platform,
        part: best.part,
        set,
        of_catalogue,
        evidence: Evidence {
            delta_log_score: best.log_score,
            delta_log_evidence: best.log_evidence,
            p_value: round.chance.p_value(best.log_score),
        },
        strength_nats,
        nats_to_next: best.log_evidence - next,
        others,
        elsewhere: elsewhere(round, best, strength_nats),
    }
}

/// Where a fault may be instead, if not where it is named.
fn elsewhere(round: &Round, best: &Tried, strength_nats: f64) -> Vec<(Option<usize>, f64)> {
    let power = law_power(best.id, Some(best.id), strength_nats);
    let odds = |t: &Tried| (power * (t.log_evidence - best.log_evidence)).exp();
    let same = || round.tried.iter().filter(|t| t.id == best.id);
    let all: f64 = same().map(odds).sum();
    same()
        .filter(|t| t.platform != best.platform)
        .map(|t| (t.platform, odds(t) / all))
        .filter(|(_, probability)| *probability > 1.0 - NAME_AT)
        .collect()
}

/// Probability of a set.
pub(crate) fn sum(set: &[(MechanismId, f64)]) -> f64 {
    set.iter().map(|s| s.1).sum::<f64>().min(1.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_laws_may_be_wrong() {
        use MechanismId as M;
        let power = |one, other| law_power(one, Some(other), LAW_NATS);
        assert_eq!(power(M::SensorOffset, M::BackgroundOffset), 1.0);
        assert_eq!(power(M::SensorOffset, M::SigmaYScale), 0.5);
        assert_eq!(power(M::SigmaYScale, M::StabilityClass), 0.5);
        assert_eq!(law_power(M::SensorOffset, None, LAW_NATS), 0.5);
        assert_eq!(law_power(M::SigmaYScale, None, 1e6), LEAST_POWER);
    }
}
