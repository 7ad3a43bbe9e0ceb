//! The next flight: where to fly so that the rivals of an ambiguous answer come apart.
//!
//! Candidate tracks are predicted under both rivals. The separation m of a track is the whitened
//! distance of the two predictions, once the second rival has moved its parameters as far as the
//! data so far and the flight's noise let it: min over θ of ½ |d(θ)|² + ½ (θ − θ₀)ᵀ C⁻¹ (θ − θ₀),
//! with C its posterior. The log-likelihood ratio that the flight will give is then normal with
//! mean m and variance 2 m, to which what the laws are not known by is applied as in the naming;
//! the flight settles the matter where that reaches ln 19.

mod otherwise;
mod plans;
mod separation;

use ::plume::field::DispersionModel;
use statrs::distribution::{ContinuousCDF, Normal};

use self::plans::{Flier, Plan, PlumeAxis, outside, plans, waypoints};
use self::separation::Flown;
use super::accepted::{Accepted, law_power};
use super::fit::{Context, Fitted};
use super::model::Model;
use super::naming::Named;
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

/// The rivals of an ambiguous cause, each fitted.
struct Rivals<'a> {
    cause: &'a Accepted,
    first: &'a Fitted,
    base: &'a Fitted,
    others: Vec<Fitted>,
    axis: PlumeAxis,
}

/// What a flight promises of one rival.
#[derive(Debug, Clone, Copy)]
struct Promise {
    /// By how much the odds will shift on average, nats.
    nats: f64,
    /// How probably that settles the matter.
    settles: f64,
}

/// A flight and what it promises of each rival.
struct Proposal {
    plan: Plan,
    flier: Flier,
    promises: Vec<Promise>,
}

impl Promise {
    /// Of predictions `apart_nats` apart, of which `power` counts.
    fn new(apart_nats: f64, power: f64) -> Self {
        let spread = (2.0 * apart_nats).sqrt();
        let reach = (apart_nats - APART_NATS / power) / spread;
        Self {
            nats: power * apart_nats,
            settles: if spread > 0.0 {
                Normal::standard().cdf(reach)
            } else {
                0.0
            },
        }
    }
}

impl Proposal {
    fn settled(&self) -> f64 {
        self.promises.iter().map(|p| p.settles).sum()
    }

    fn worth(&self) -> f64 {
        let nats = self.promises.iter().map(|p| p.nats.min(ENOUGH_NATS));
        self.settled() + NAT_PART * nats.sum::<f64>()
    }
}

/// The flight that separates the most probable member of an ambiguous cause from as many of the
/// others as one flight can. Where none of those tried is likely to, it is the one that comes
/// nearest to it, and its words say so, and what would tell instead.
pub(crate) fn propose(ctx: &Context<'_>, named: &Named) -> Option<NextFlight> {
    let world = named
        .last
        .model
        .world(&ctx.setup.base, ctx.data.track.platforms())?;
    let ambiguous = named.accepted.iter().filter(|a| a.set.len() > 1);
    let rivals = ambiguous.map(|cause| Rivals::new(ctx, named, cause));
    let proposals = rivals.filter_map(|r| {
        let best = r.best(ctx, &world)?;
        Some((r, best))
    });
    let (rivals, best) = proposals.max_by(|a, b| a.1.worth().total_cmp(&b.1.worth()))?;
    rivals.stated(ctx, &best)
}

/// When the next flight begins, s.
fn start_s(ctx: &Context<'_>) -> f64 {
    ctx.data.span_s().1 + PAUSE_S
}

impl<'a> Rivals<'a> {
    fn new(ctx: &Context<'_>, named: &'a Named, cause: &'a Accepted) -> Self {
        let fitted = |model: &Model| ctx.settle(model, &named.last.metric, &named.last, 0);
        Self {
            cause,
            first: &named.last,
            base: &named.base,
            axis: PlumeAxis::of(ctx, &named.last.model, start_s(ctx)),
            others: cause.others.iter().map(|(_, _, m)| fitted(m)).collect(),
        }
    }

    /// The best of the flights tried, as long as it pays.
    fn best(&self, ctx: &Context<'_>, world: &DispersionModel) -> Option<Proposal> {
        let flier = |length_s: f64| Flier {
            platform: self.cause.platform.unwrap_or(0),
            start_s: start_s(ctx),
            length_s,
        };
        let [first_s, longer_s @ ..] = LENGTHS_S;
        let tried = plans(self.axis, world)
            .into_iter()
            .map(|plan| self.promised(ctx, world, plan, flier(first_s)));
        let mut best = tried.max_by(|a, b| a.worth().total_cmp(&b.worth()))?;
        for length_s in longer_s {
            let longer = self.promised(ctx, world, best.plan.clone(), flier(length_s));
            if longer.settled() > best.settled() + WORTH_LONGER {
                best = longer;
            }
        }
        Some(best)
    }

    fn promised(
        &self,
        ctx: &Context<'_>,
        world: &DispersionModel,
        plan: Plan,
        flier: Flier,
    ) -> Proposal {
        let flown = Flown::new(ctx, self.first, &plan, self.axis, world, flier);
        let from = |other: &Fitted| {
            let nats = flown.as_ref().and_then(|f| f.separation(ctx, other));
            nats.unwrap_or(0.0)
        };
        // The more the effect itself shows, the less a difference of laws will count.
        let shown = self.cause.evidence.delta_log_score + from(self.base);
        let pairs = self.others.iter().zip(&self.cause.others);
        let promises = pairs
            .map(|(rival, (id, _, _))| {
                Promise::new(from(rival), law_power(self.cause.id, Some(*id), shown))
            })
            .collect();
        Proposal {
            plan,
            flier,
            promises,
        }
    }

    fn stated(&self, ctx: &Context<'_>, best: &Proposal) -> Option<NextFlight> {
        let promises = &best.promises;
        let likely: Vec<usize> = (0..promises.len())
            .filter(|k| promises[*k].settles > WORTH_FLYING)
            .collect();
        let most =
            (0..promises.len()).max_by(|a, b| promises[*a].nats.total_cmp(&promises[*b].nats))?;
        let flies = !likely.is_empty();
        let shown = if flies { likely } else { vec![most] };
        let id = |k: &usize| self.cause.others.get(*k).map(|o| o.0);
        let others = shown.iter().filter_map(id);
        let least = |of: fn(&Promise) -> f64| {
            let all = shown.iter().map(|k| of(&promises[*k]));
            all.fold(f64::INFINITY, f64::min)
        };
        let minutes = best.flier.length_s / 60.0;
        let mut words = format!("{}, for {minutes:.0} minutes", best.plan.words);
        if let Some(wrong) = outside(ctx, self.axis, &best.plan) {
            words += &format!(" (not within the scenario's fence: {wrong})");
        }
        let ids = self.cause.set.iter().map(|s| s.0);
        let description = if flies {
            words
        } else {
            otherwise::instead(ids, &words)
        };
        Some(NextFlight {
            separates: std::iter::once(self.cause.id)
                .chain(others)
                .map(|id| id.as_str().to_string())
                .collect(),
            platform: self
                .cause
                .platform
                .map(|p| ctx.data.track.platforms()[p].clone()),
            description,
            waypoints: waypoints(ctx, self.axis, &best.plan, best.flier),
            expected_nats: least(|p| p.nats),
            settles_probability: least(|p| p.settles),
        })
    }
}
