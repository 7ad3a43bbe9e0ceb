//! What has no name: nameless terms weighed against names, and what stands beside names or in
//! their place.

use super::answer::unexplained;
use super::explore::{FALSE_ALARM, Round, Tried};
use super::fit::{Context, Effort, Fitted};
use super::followed::correlation;
use super::naming::{Grown, LEAST_EVIDENCE, Named, REST_PART};
use super::rival::{self, Rival, Rivals};
use crate::verdict::Unexplained;

/// By how much a nameless rival must beat the best name, nats.
const RIVAL_MARGIN: f64 = 6.0;
/// What a nameless rival needs beyond its own false-alarm threshold: it is there for strong
/// effects, and weak ones of many forms are everywhere, nats.
const RIVAL_MORE: f64 = 9.0;
/// Names that gain this many times what they are due once the noise is their own show that the
/// base's noise hid what they explain: evidence under it then does not count.
const HIDDEN_BY_NOISE: f64 = 4.0;
/// What a swing to and fro must seem to gain for a closer look, with its prior, nats.
const SWING_HINT_NATS: f64 = 0.0;
/// Probability that all names together must have where a nameless rival is called for.
const NAMES_AT: f64 = 0.5;
/// Probability of the whole catalogue, nameless terms counted in, from which on a name is said
/// without one beside it, and a set of names, which says less.
const NAME_SURE_AT: f64 = 0.95;
const SET_SURE_AT: f64 = 0.9;
/// Rows in a plume from which a correlation can be told, and the least that readings of one have.
const LEAST_PLUME_ROWS: usize = 60;
const LEAST_CORRELATION: f64 = 0.3;

/// A nameless rival that beat the best name, until it is seen whether names together beat it.
pub(super) struct Doubt {
    rest: Vec<f64>,
    unexplained: Unexplained,
    /// How many were named before it, and the model with them.
    named: usize,
    last: Fitted,
    /// Log evidence that names must have gained in all, nats.
    due: f64,
}

impl Doubt {
    /// Whether it stands against names that have `gained` so much in all and end at `last`.
    pub(super) fn stands(&self, last: &Fitted, gained: f64) -> bool {
        let with_own_noise = last.score_with_prior() - self.last.score_with_prior();
        gained < self.due && with_own_noise < HIDDEN_BY_NOISE * self.due
    }
}

/// Probability of the whole catalogue from which on a set of so many names stands by itself.
fn sure_at(names: usize) -> f64 {
    match names {
        1 => NAME_SURE_AT,
        _ => SET_SURE_AT,
    }
}

/// A slow swing on top of a model, if there is one, and the model under a noise that holds none.
fn swing_beside(ctx: &Context<'_>, null: &Fitted, seed: u64) -> Option<(Fitted, Rival)> {
    let beside = ctx.refine_with(&null.model, null.noise, Effort::BESIDE_SWINGS);
    let rivals = rival::rivals(ctx, &beside, FALSE_ALARM, seed);
    let needed = rivals.threshold + RIVAL_MORE;
    let best = rivals.ranked.into_iter().find(|r| r.swings);
    let swing = best.filter(|r| r.log_evidence > needed)?;
    Some((beside, swing))
}

/// Readings that do not follow the predicted plume at all, though the noise could hold them: of
/// another track, another clock, or another plume. Where what was named leaves no plume to be
/// followed, it is the base's.
pub(super) fn unrelated(ctx: &Context<'_>, base: &Fitted, last: &Fitted) -> Option<Unexplained> {
    let rows: Vec<usize> = (0..ctx.data.len()).filter(|i| ctx.data.used[*i]).collect();
    // The noise fitted to readings that follow nothing is whatever they are.
    let floor_ppm = 5.0 * last.noise.expected_white_ppm();
    let has_plume = |f: &&Fitted| {
        let seen = rows.iter().filter(|i| f.prediction.plume[**i] > floor_ppm);
        seen.count() >= LEAST_PLUME_ROWS
    };
    let followed = [last, base].into_iter().find(has_plume)?;
    let correlation = correlation(ctx.data, &followed.prediction.reading);
    let times = ctx.data.track.time_s();
    (correlation < LEAST_CORRELATION).then(|| Unexplained {
        coordinate: "map".to_string(),
        term: format!(
            "readings that do not follow the predicted plume (correlation {correlation:.2})"
        ),
        from_s: times[rows[0]],
        to_s: rows
            .iter()
            .map(|i| times[*i])
            .fold(f64::NEG_INFINITY, f64::max),
        platforms: ctx.data.track.platforms().to_vec(),
        delta_log_evidence: 0.0,
    })
}

/// The best nameless rival if it is well beyond its own threshold and beyond `least_nats`.
fn standing(rivals: &Rivals, least_nats: f64) -> Option<&Rival> {
    let needed = (rivals.threshold + RIVAL_MORE).max(least_nats);
    rivals.ranked.first().filter(|r| r.log_evidence > needed)
}

/// The nameless rival that a round calls for rather than a name: one that stands by itself and is
/// clearly better than `best`.
pub(super) fn preferred<'a>(
    round: &'a Round,
    best: Option<&Tried>,
    least_nats: f64,
) -> Option<&'a Rival> {
    let top = standing(round.rivals.as_ref()?, least_nats)?;
    let beaten = best
        .is_none_or(|b| names_are_few(round) || top.log_evidence > b.log_evidence + RIVAL_MARGIN);
    beaten.then_some(top)
}

/// Whether all names together are less probable than what has none.
pub(super) fn names_are_few(round: &Round) -> bool {
    let names = round.probabilities(|evidence, _| evidence);
    names.map(|(_, probability)| probability).sum::<f64>() < NAMES_AT
}

impl Named {
    /// A noise that is fitted to the base may hold a slow swing, and a name may describe a part
    /// of it. Where one is hinted at, it is looked for under a noise that was fitted beside slow
    /// swings; names that are of no more use then go.
    pub(super) fn look_beside_swings(&mut self, ctx: &Context<'_>, seed: u64) {
        let hints = self.first.rivals.iter().flat_map(|r| &r.ranked);
        let hinted = |r: &Rival| r.swings && r.log_evidence > SWING_HINT_NATS;
        if !hints.into_iter().any(hinted) {
            return;
        }
        let Some(mut found) = swing_beside(ctx, &self.last, seed) else {
            return;
        };
        if !self.accepted.is_empty() {
            let (named, _) = &found;
            let settled = |model| ctx.settle(model, &named.metric, named, 6);
            let gained =
                settled(&named.model).log_evidence - settled(&self.base.model).log_evidence;
            if gained < LEAST_EVIDENCE
                && let Some(alone) = swing_beside(ctx, &self.base, seed)
            {
                self.accepted.clear();
                found = alone;
            }
        }
        let (last, swing) = found;
        self.leave_unexplained(ctx, &swing);
        self.last = last;
    }

    /// A single cause does not stand alone where nameless terms are too probable beside it: the best
    /// of them may be it instead.
    pub(super) fn leave_open(&mut self, ctx: &Context<'_>) {
        let [only] = self.accepted.as_slice() else {
            return;
        };
        if only.of_catalogue < sure_at(only.set.len()) {
            self.unexplained = self.against.as_ref().map(|term| unexplained(ctx, term));
        }
    }

    /// Lets a nameless term stand beside what was named.
    fn leave_unexplained(&mut self, ctx: &Context<'_>, term: &Rival) {
        self.rest = Some(term.fitted.clone());
        self.unexplained = Some(unexplained(ctx, term));
    }

    /// What stands if no names make up for `rival`.
    pub(super) fn doubt(&self, ctx: &Context<'_>, rival: &Rival, gained: f64) -> Doubt {
        Doubt {
            rest: rival.fitted.clone(),
            unexplained: unexplained(ctx, rival),
            named: self.accepted.len(),
            last: self.last.clone(),
            due: gained + rival.log_evidence,
        }
    }

    /// Lets a nameless rival stand, with what was named before it; where there is none, what was
    /// named, which `gained` so many nats.
    pub(super) fn fall_back(&mut self, doubt: Option<Doubt>, gained: f64) -> Grown {
        let Some(doubt) = doubt else {
            return Grown {
                doubted: false,
                due_nats: gained,
            };
        };
        self.accepted.truncate(doubt.named);
        self.last = doubt.last;
        self.rest = Some(doubt.rest);
        self.unexplained = Some(doubt.unexplained);
        Grown {
            doubted: false,
            due_nats: doubt.due,
        }
    }

    /// What the causes leave that changed when each was tested beside the others.
    pub(super) fn look_for_a_rest(&mut self, ctx: &Context<'_>, seed: u64) {
        let gained = self.accepted.iter().map(|a| a.evidence.delta_log_evidence);
        let rivals = rival::rivals(ctx, &self.last, FALSE_ALARM, seed);
        if let Some(rest) = standing(&rivals, REST_PART * gained.sum::<f64>()) {
            self.leave_unexplained(ctx, rest);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_name_alone_must_be_surer_than_a_set() {
        let stands = |names, of_catalogue: f64| of_catalogue >= sure_at(names);
        assert!(!stands(1, 0.93) && stands(2, 0.93));
        assert!(stands(1, 0.95) && !stands(2, 0.89));
    }
}
