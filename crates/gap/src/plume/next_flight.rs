//! The next flight: where to fly so that rivals come apart between which the readings do not tell.
//!
//! Flights that could be flown are predicted under the first of the rivals and under each of the
//! others; [`infer::PredictedReadings`] tells by how much one would set them apart. The logarithm of the
//! likelihood ratio that a flight gives is normal with that mean m and variance 2 m; it settles the
//! matter where it reaches ln 19.

mod airspace;
mod axis;
mod flown;
mod ground_check;
mod plans;

use ::plume::mechanism::MechanismId;
use infer::{FittedSet, InferError, NormalPosterior, without};
use statrs::distribution::{ContinuousCDF, Normal};

use self::airspace::outside;
use self::axis::PlumeAxis;
use self::flown::{Air, Flight};
use self::plans::{Plan, plans};
use super::catalogue::Hypothesis;
use super::model::PlumeModel;
use super::{Options, Study, answer};
use crate::verdict::NextFlight;

/// Evidence at which one of two rivals at even odds is sure at 95 %, nats: ln 19.
const APART_NATS: f64 = 2.944;
/// Time between the last row and the next flight, s.
const PAUSE_S: f64 = 60.0;
/// Lengths of a flight, s; the longest is a small flying wing's endurance.
const LENGTHS_S: [f64; 3] = [1200.0, 2400.0, 3600.0];
/// A longer flight is proposed where it settles so many rivals more.
const WORTH_LONGER: f64 = 0.2;
/// Probability of settling the matter from which a flight is worth flying.
const WORTH_FLYING: f64 = 0.5;
/// Separation beyond which more is worth nothing, nats, and what a nat is worth beside a rival
/// that is settled.
const ENOUGH_NATS: f64 = 12.0;
const NAT_PART: f64 = 1e-3;

/// What a flight may set a cause apart from besides other causes.
const NO_CAUSE: &str = "none";

/// A set of names that may be the true one, and the name that the others do not have.
struct Rival<'s, 'a> {
    /// None of the set without that name.
    id: Option<MechanismId>,
    platform: Option<usize>,
    found: &'s FittedSet<PlumeModel<'a>>,
}

/// Rivals, and what is the same for all flights that could tell them apart.
struct Matter<'s, 'a> {
    study: &'s Study<'a>,
    first: Rival<'s, 'a>,
    others: Vec<(Rival<'s, 'a>, NormalPosterior)>,
    axis: PlumeAxis,
    air: Air,
    /// Who flies, where only one can tell.
    platform: Option<usize>,
}

/// What a flight promises of one rival.
#[derive(Debug, Clone, Copy)]
struct Promise {
    /// By how much the odds will shift on average, nats.
    nats: f64,
    /// How probably that settles the matter.
    settles: f64,
}

impl Promise {
    fn new(apart_nats: f64) -> Self {
        let spread = (2.0 * apart_nats).sqrt();
        let settles = if spread > 0.0 {
            Normal::standard().cdf((apart_nats - APART_NATS) / spread)
        } else {
            0.0
        };
        Self {
            nats: apart_nats,
            settles,
        }
    }
}

/// A flight and what it promises of each rival.
struct Proposal {
    plan: Plan,
    length_s: f64,
    /// What of the airspace it does not keep to.
    outside: Option<String>,
    promises: Vec<Promise>,
}

impl Proposal {
    fn settled(&self) -> f64 {
        self.promises.iter().map(|p| p.settles).sum()
    }

    fn flies(&self) -> bool {
        self.promises.iter().any(|p| p.settles > WORTH_FLYING)
    }

    fn worth(&self) -> f64 {
        let nats = self.promises.iter().map(|p| p.nats.min(ENOUGH_NATS));
        self.settled() + NAT_PART * nats.sum::<f64>()
    }

    /// A flight that is worth it goes before one that is not, then one that may be flown before one
    /// that may not.
    fn is_better_than(&self, other: &Self) -> bool {
        let rank = |p: &Self| (p.flies(), p.outside.is_none());
        let (own, others) = (rank(self), rank(other));
        own > others || (own == others && self.worth() > other.worth())
    }
}

/// The flight that separates the most probable of rivals from as many of the others as one flight can.
/// Where none of those tried is likely to, it is the one that comes nearest to it, and its words say
/// so, and what would tell instead.
pub(crate) fn proposed(
    study: &Study<'_>,
    options: &Options,
) -> Result<Option<NextFlight>, InferError> {
    // Around a plume that the readings do not follow there is nowhere to fly.
    if !options.complete || !answer::follows(study) {
        return Ok(None);
    }
    let mut best: Option<(Matter<'_, '_>, Proposal)> = None;
    for rivals in open(study) {
        let Some(matter) = Matter::new(study, rivals)? else {
            continue;
        };
        let Some(proposal) = matter.best()? else {
            continue;
        };
        if best.as_ref().is_none_or(|b| proposal.is_better_than(&b.1)) {
            best = Some((matter, proposal));
        }
    }
    best.map(|(matter, proposal)| matter.stated(&proposal))
        .transpose()
}

/// Rivals between which the readings do not decide: the names of each cause, no cause where it is not sure, and the
/// candidates for what is not explained.
fn open<'s, 'a>(study: &'s Study<'a>) -> Vec<Vec<Rival<'s, 'a>>> {
    let judged = &study.judged;
    let mut out: Vec<Vec<Rival<'s, 'a>>> = Vec::new();
    for (k, cause) in judged.causes.iter().enumerate() {
        let rival = |(name, _): &(Hypothesis, f64)| {
            let mut names = judged.set.mechanisms.clone();
            names[k] = name.clone();
            let found = study.found.iter().find(|f| f.is_same_set(&names))?;
            Some(Rival::new(found, name))
        };
        let mut rivals: Vec<Rival<'_, '_>> = cause.mechanisms.iter().filter_map(rival).collect();
        if !cause.is_sure(study.question.policy) {
            rivals.push(Rival {
                id: None,
                platform: None,
                found: &study.found[without(&study.found, &judged.set, k)],
            });
        }
        out.push(rivals);
    }
    let candidates = judged.candidates.iter();
    let last = |(found, _): &'s (FittedSet<PlumeModel<'a>>, f64)| {
        Some(Rival::new(found, found.mechanisms.last()?))
    };
    out.push(candidates.filter_map(last).collect());
    out
}

impl<'s, 'a> Rival<'s, 'a> {
    fn new(found: &'s FittedSet<PlumeModel<'a>>, name: &Hypothesis) -> Self {
        Self {
            id: Some(name.part.id),
            platform: name.part.platform,
            found,
        }
    }
}

/// When the next flight begins, s.
fn start_s(study: &Study<'_>) -> f64 {
    let times = study.data.track.time_s().iter().copied();
    times.fold(f64::NEG_INFINITY, f64::max) + PAUSE_S
}

impl<'s, 'a> Matter<'s, 'a> {
    /// The matter between rivals of different mechanisms; none between fewer than two.
    fn new(study: &'s Study<'a>, rivals: Vec<Rival<'s, 'a>>) -> Result<Option<Self>, InferError> {
        let mut different: Vec<Rival<'s, 'a>> = Vec::new();
        for rival in rivals {
            if different.iter().all(|d| d.id != rival.id) {
                different.push(rival);
            }
        }
        if different.len() < 2 {
            return Ok(None);
        }
        let first = different.remove(0);
        let own = std::iter::once(&first).chain(&different);
        let platform = own.filter_map(|r| r.platform).next();
        let mut others = Vec::new();
        for rival in different {
            let believed = study.question.believed(rival.found)?;
            others.push((rival, believed));
        }
        Ok(Some(Self {
            axis: PlumeAxis::of(study, first.found, start_s(study)),
            air: Air::met(study),
            study,
            first,
            others,
            platform,
        }))
    }

    /// The best of the flights tried.
    fn best(&self) -> Result<Option<Proposal>, InferError> {
        let world = self.first.found.model.world(self.first.found.at())?;
        let [first_s, longer_s @ ..] = LENGTHS_S;
        let mut best: Option<Proposal> = None;
        for plan in plans(self.axis, &world, &self.study.setup.airspace) {
            let tried = self.promised(plan, first_s)?;
            if best.as_ref().is_none_or(|b| tried.is_better_than(b)) {
                best = Some(tried);
            }
        }
        let Some(mut best) = best else {
            return Ok(None);
        };
        for length_s in longer_s {
            // Where all is settled a longer flight cannot be worth it.
            if best.settled() + WORTH_LONGER > self.others.len() as f64 {
                break;
            }
            let longer = self.promised(best.plan.clone(), length_s)?;
            if longer.settled() > best.settled() + WORTH_LONGER {
                best = longer;
            }
        }
        Ok(Some(best))
    }

    fn flight<'p>(&'p self, plan: &'p Plan, length_s: f64) -> Flight<'p> {
        Flight {
            setup: self.study.setup,
            axis: self.axis,
            plan,
            start_s: start_s(self.study),
            length_s,
        }
    }

    fn promised(&self, plan: Plan, length_s: f64) -> Result<Proposal, InferError> {
        let (question, found) = (self.study.question, self.first.found);
        let platforms = self.study.data.track.platforms();
        let platform = self.platform.unwrap_or(0);
        let flight = self.flight(&plan, length_s);
        let track = flight.track(
            &found.model.world(found.at())?,
            platforms,
            platform,
            &self.air,
        )?;
        let ahead = question.ahead(found, &found.model.on(&track), track.time_s())?;
        let promise = |(rival, believed): &(Rival<'_, '_>, NormalPosterior)| {
            let there = rival.found.model.on(&track);
            // Where a rival's model refuses what the flight would ask of it, nothing is promised.
            Promise::new(ahead.separation(&there, believed).unwrap_or(0.0))
        };
        Ok(Proposal {
            promises: self.others.iter().map(promise).collect(),
            outside: outside(self.study.setup, self.axis, &plan),
            plan,
            length_s,
        })
    }

    fn stated(&self, best: &Proposal) -> Result<NextFlight, InferError> {
        let promises = &best.promises;
        let mut shown: Vec<usize> = (0..promises.len())
            .filter(|k| promises[*k].settles > WORTH_FLYING)
            .collect();
        if !best.flies() {
            shown.extend(
                (0..promises.len()).max_by(|a, b| promises[*a].nats.total_cmp(&promises[*b].nats)),
            );
        }
        let least = |of: fn(&Promise) -> f64| {
            let all = shown.iter().map(|k| of(&promises[*k]));
            all.fold(f64::INFINITY, f64::min)
        };
        let mut words = format!(
            "{}, for {:.0} minutes",
            best.plan.words,
            best.length_s / 60.0
        );
        if let Some(wrong) = &best.outside {
            words += &format!(" (not within the scenario's fence: {wrong})");
        }
        let all = std::iter::once(self.first.id).chain(self.others.iter().map(|o| o.0.id));
        let told = std::iter::once(self.first.id).chain(shown.iter().map(|k| self.others[*k].0.id));
        let platforms = self.study.data.track.platforms();
        Ok(NextFlight {
            separates: told
                .map(|id| id.map_or(NO_CAUSE, |id| id.as_str()).to_string())
                .collect(),
            platform: self.platform.map(|p| platforms[p].clone()),
            description: if best.flies() {
                words
            } else {
                ground_check::recommend_ground_check(all.flatten(), &words)
            },
            waypoints: self.flight(&best.plan, best.length_s).waypoints(),
            expected_nats: least(|p| p.nats),
            settles_probability: least(|p| p.settles),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    // Of a normal law with mean m and variance 2 m: half lies above its mean, .8413 above a standard
    // deviation below it.
    #[test]
    fn a_promise_is_the_part_of_a_normal_law_beyond_what_settles() {
        let ln19 = 19f64.ln();
        assert!((Promise::new(ln19).settles - 0.5).abs() < 1e-3);
        // m - √(2 m) = ln 19 has the root √m = √½ + √(½ + ln 19).
        let root = 0.5f64.sqrt() + (0.5 + ln19).sqrt();
        assert!((Promise::new(root * root).settles - 0.841_345).abs() < 1e-3);
        assert_eq!(Promise::new(0.0).settles, 0.0);
    }
}
