//! Naming: round after round until the data ask for no more; then every accepted cause is put
//! to the test again with the others in place, which gives its set and its probability.

use ::plume::mechanism::{Mechanism, MechanismId};

use super::Options;
use super::accepted::{Accepted, accept, sum};
use super::answer::{parameters, ranking};
use super::ceiling::{Ceiling, ceilings};
use super::explore::{self, Incumbent, Round, Tried};
use super::fit::{Context, Fitted};
use super::held_out;
use super::model::{Model, mechanism};
use super::nameless::{Doubt, names_are_few, preferred, unrelated};
use super::pair;
use super::rival::Rival;
use super::tested::{Tested, much_worse, put_to_the_test, without};
use crate::verdict::{Cause, Ranked, Unexplained, Verdict};

/// What a full fit must gain beyond the screen's threshold to count by itself, nats.
const REFIT_MARGIN: f64 = 3.0;
/// Least gains of log score and log evidence for a name, nats. The screen's threshold knows the
/// noise model's own chance; what nature does besides is seen in cases in which nothing is
/// hidden.
const LEAST_SCORE: f64 = 14.0;
pub(super) const LEAST_EVIDENCE: f64 = 9.0;
/// Evidence against a prior that the scenario states from which on it is given up, nats: ln 19.
const CONTRADICTED_NATS: f64 = 2.944;
/// How often a null may move to a better place.
const MOST_MOVES: usize = 2;
/// A rest after naming counts when its evidence is this part of what naming gained …
pub(super) const REST_PART: f64 = 0.06;
/// … or more than a false alarm would have by this, nats.
const REST_MARGIN: f64 = 4.0;

/// How naming until the data asked for no more went.
pub(super) struct Grown {
    /// Whether a nameless rival was weighed against names, to the end.
    pub doubted: bool,
    /// Log evidence that what stands has gained, nats.
    pub due_nats: f64,
}

/// The outcome of naming.
pub(crate) struct Named {
    pub first: Round,
    pub base: Fitted,
    pub last: Fitted,
    pub accepted: Vec<Accepted>,
    /// As [`Named::conclude`] states them.
    pub causes: Vec<Cause>,
    pub ranking: Vec<Ranked>,
    pub unexplained: Option<Unexplained>,
    /// The nameless term, whitened, where there is one beside what was named.
    pub rest: Option<Vec<f64>>,
    /// The best nameless term against which the first name was weighed.
    pub against: Option<Rival>,
    /// Readings held at a ceiling below what the model predicts.
    pub ceilings: Vec<Ceiling>,
}

/// Names what the data ask for on top of `base`.
pub(crate) fn name(
    ctx: &Context<'_>,
    base: Fitted,
    options: &Options,
    tell: &mut dyn FnMut(f64, &'static str),
) -> Named {
    tell(0.2, "trying every mechanism");
    let (base, first) = settled_round(ctx, base, options.seed);
    let mut named = Named {
        ranking: ranking(ctx, &base, &first),
        first,
        last: base.clone(),
        base,
        accepted: Vec::new(),
        causes: Vec::new(),
        unexplained: None,
        rest: None,
        against: None,
        ceilings: Vec::new(),
    };
    let mut grown = named.grow(ctx, options, None, 0.0, tell);
    if let Some((round, gained)) = named.pair_instead(ctx, options, grown.due_nats) {
        grown = named.grow(ctx, options, Some(round), gained, tell);
    }
    // Names that stood against a nameless rival have the probabilities of before that.
    if named.accepted.len() > 1 || grown.doubted && named.unexplained.is_none() {
        tell(0.65, "testing every name against its rivals");
        named.swap(ctx, options);
        named.look_for_a_rest(ctx, options.seed);
    }
    named.ceilings = ceilings(ctx, &named.last);
    if named.unexplained.is_none() {
        named.look_beside_swings(ctx, options.seed);
    }
    if named.unexplained.is_none() {
        named.leave_open(ctx);
    }
    // Names that end at a plume which the readings do not follow name nothing.
    if named.unexplained.is_none() {
        named.unexplained = unrelated(ctx, &named.base, &named.last);
    }
    named
}

/// A round on top of `null`, which is moved first to where its trials show it to fit better.
fn settled_round(ctx: &Context<'_>, null: Fitted, seed: u64) -> (Fitted, Round) {
    let mut null = null;
    for _ in 0..MOST_MOVES {
        let round = explore::round(ctx, &null, seed);
        let Some(model) = &round.better_null else {
            return (null, round);
        };
        let moved = ctx.refine(model, null.noise);
        if much_worse(&moved, &null) {
            return (null, round);
        }
        null = moved;
    }
    let round = explore::round(ctx, &null, seed);
    (null, round)
}

/// What a name needs beyond the threshold once `named` causes have gained `gained` nats: those
/// may have left something that looks like another.
fn needed_beyond(named: usize, gained: f64) -> f64 {
    if named == 0 {
        0.0
    } else {
        REST_MARGIN + REST_PART * gained
    }
}

/// Whether a round calls for a name, and which. Of the base's first parts the scenario `stated` how
/// sure it is: that prior is given up where the data contradict it.
fn called_for(round: &Round, more_nats: f64, stated: usize) -> Option<&Tried> {
    let best = round.tried.first()?;
    if best.part < stated {
        return (best.log_evidence > CONTRADICTED_NATS + more_nats).then_some(best);
    }
    // Of effects that are far from linear the screen sees less than the full fit.
    let refit = best.log_score - REFIT_MARGIN;
    let seen = round.best_gain.max(refit);
    let calls = seen > round.threshold + more_nats
        && best.log_score.max(best.log_evidence) > 0.8 * round.threshold
        && best.log_score > LEAST_SCORE
        && best.log_evidence > LEAST_EVIDENCE;
    calls.then_some(best)
}

/// What a round that tests a name again finds at its best, if the data still ask for it. It was
/// called for once, against all that chance offers; now it has to be of use beside the others.
fn still_called_for(round: &Round, stated: usize) -> Option<&Tried> {
    let best = round.tried.first()?;
    let least = if best.part < stated {
        CONTRADICTED_NATS
    } else {
        LEAST_EVIDENCE
    };
    (best.log_evidence > least).then_some(best)
}

impl Named {
    /// Names until the data ask for no more; from the first round on, or from a `later` one on top
    /// of names that have `gained` so many nats.
    fn grow(
        &mut self,
        ctx: &Context<'_>,
        options: &Options,
        mut later: Option<Round>,
        mut gained: f64,
        tell: &mut dyn FnMut(f64, &'static str),
    ) -> Grown {
        let mut moved = false;
        let mut doubt: Option<Doubt> = None;
        loop {
            let k = self.accepted.len();
            let round = later.as_ref().unwrap_or(&self.first);
            let best = called_for(round, needed_beyond(k, gained), ctx.setup.priors.len());
            let best = best.filter(|_| k < options.most_causes);
            if let Some(rival) = preferred(round, best, REST_PART * gained) {
                let first = doubt.is_none();
                doubt.get_or_insert_with(|| self.doubt(ctx, rival, gained));
                // Two causes at once may look like neither: names get one more chance.
                if !first || best.is_none() {
                    return self.fall_back(doubt, gained);
                }
            } else if names_are_few(round) {
                // Neither a name nor what has none.
                break;
            }
            let Some(best) = best else { break };
            let next = match put_to_the_test(ctx, &self.last, &best.fitted, &[best.part]) {
                Tested::Null(null) if !moved => {
                    moved = true;
                    null
                }
                Tested::Chance | Tested::Null(_) => {
                    // A name that does not stand leaves what called for it unexplained.
                    if let Some(rival) = preferred(round, None, REST_PART * gained) {
                        doubt.get_or_insert_with(|| self.doubt(ctx, rival, gained));
                    }
                    break;
                }
                Tested::Extension(refined) => {
                    moved = false;
                    gained += best.log_evidence;
                    let accepted = accept(round, best, None);
                    if self.accepted.is_empty() {
                        self.against = round
                            .rivals
                            .as_ref()
                            .and_then(|r| r.ranked.first().cloned());
                    }
                    self.accepted.push(accepted);
                    refined
                }
            };
            tell(0.3 + 0.1 * k as f64, "looking for more");
            let seed = options.seed.wrapping_add(1 + k as u64);
            later = self.go_on_from(ctx, next, seed);
        }
        let doubted = doubt.is_some();
        let grown = self.fall_back(doubt.filter(|d| d.stands(&self.last, gained)), gained);
        Grown { doubted, ..grown }
    }

    /// Takes `next` for the model at hand. The round on top of it; none while nothing is named,
    /// where it is the first one.
    fn go_on_from(&mut self, ctx: &Context<'_>, next: Fitted, seed: u64) -> Option<Round> {
        let (last, round) = settled_round(ctx, next, seed);
        self.last = last;
        if !self.accepted.is_empty() {
            return Some(round);
        }
        self.base = self.last.clone();
        self.ranking = ranking(ctx, &self.base, &round);
        self.first = round;
        None
    }

    /// Two names that gain more together, tested as one, than what stands and is due so many
    /// nats: neither may be seen without the other, or a third may look like both. They take its
    /// place; the round on top of them, and what they gain.
    fn pair_instead(
        &mut self,
        ctx: &Context<'_>,
        options: &Options,
        due_nats: f64,
    ) -> Option<(Round, f64)> {
        let stands = self.accepted.len() + usize::from(self.unexplained.is_some());
        let more = 2usize.saturating_sub(stands) as f64;
        let needed = due_nats + needed_beyond(1, due_nats) + more * LEAST_EVIDENCE;
        let pair = pair::best(ctx, &self.base, &self.first, needed)?;
        let seen = 2.0 * self.first.threshold.max(LEAST_SCORE);
        if pair.log_score < seen {
            return None;
        }
        let parts = pair.halves.map(|h| h.part);
        let tested = put_to_the_test(ctx, &self.base, &pair.fitted, &parts);
        let Tested::Extension(refined) = tested else {
            return None;
        };
        let named = std::mem::replace(
            &mut self.accepted,
            pair.accepted(self.first.chance.p_value(pair.log_score)),
        );
        let last = std::mem::replace(&mut self.last, refined);
        // Beside one of them another may be better than the other before there is a third.
        self.swap(ctx, options);
        if self.accepted.len() < parts.len() {
            (self.accepted, self.last) = (named, last);
            return None;
        }
        self.unexplained = None;
        self.rest = None;
        let beside = self.last.clone();
        let (last, round) = settled_round(ctx, beside, options.seed.wrapping_add(50));
        self.last = last;
        Some((round, pair.log_evidence))
    }

    /// Puts every accepted part to the test with the others in place.
    fn swap(&mut self, ctx: &Context<'_>, options: &Options) {
        let mut k = 0;
        while k < self.accepted.len() {
            let part = self.accepted[k].part;
            let Some(without) = without(&self.last.model, &self.base.model, part) else {
                k += 1;
                continue;
            };
            let null = ctx.settle_in_its_place(&without, &self.last, 5);
            let seed = options.seed.wrapping_add(100 + k as u64);
            let moved = without.parts.len() < self.last.model.parts.len();
            let incumbent = self.incumbent(k, &without, moved);
            let round = explore::names(ctx, &null, seed, Some(incumbent));
            let best = still_called_for(&round, ctx.setup.priors.len());
            // Parts after the one taken out have moved down by one; the new one stands last.
            for other in &mut self.accepted {
                if moved && other.part > part {
                    other.part -= 1;
                }
            }
            match best {
                Some(best) => {
                    // What the base's noise hid alone was stronger than it seemed.
                    let beside_others = self.accepted.len() > 1;
                    let before = Some(&self.accepted[k]).filter(|_| beside_others);
                    self.accepted[k] = accept(&round, best, before);
                    self.last = best.fitted.clone();
                    k += 1;
                }
                // With the others in place the data no longer ask for it.
                None => {
                    self.accepted.remove(k);
                    self.last = null;
                }
            }
        }
    }

    /// The cause `k` on top of the final model `without` it, in which later parts have `moved`.
    fn incumbent(&self, k: usize, without: &Model, moved: bool) -> Incumbent {
        let own = &self.accepted[k];
        let (part, model) = if moved {
            let part = self.last.model.parts[own.part].clone();
            (without.parts.len(), without.extended(part))
        } else {
            (own.part, self.last.model.clone())
        };
        Incumbent {
            id: own.id,
            platform: own.platform,
            part,
            model,
        }
    }

    /// Brings what was named to an end: a noise that was fitted with the names stays only if the
    /// model predicts data left out better with it than with the base's. States the causes.
    pub fn conclude(&mut self, ctx: &Context<'_>) {
        // A nameless term is whitened by the noise that it was found under.
        if !self.accepted.is_empty() && self.rest.is_none() {
            let beside_base = ctx.settle(&self.last.model, &self.base.metric, &self.base, 6);
            if held_out::log_gain(ctx, &beside_base, &self.last) < 0.0 {
                self.last = beside_base;
            }
        }
        self.causes = self.describe(ctx);
    }

    /// The base at its best under the noise of the final model, so that the two can be compared.
    pub fn base_beside(&self, ctx: &Context<'_>) -> Fitted {
        ctx.settle(&self.base.model, &self.last.metric, &self.last, 6)
    }

    /// Whether one cause was found, and it is this.
    pub fn only(&self, id: MechanismId) -> bool {
        self.unexplained.is_none() && self.accepted.len() == 1 && self.accepted[0].id == id
    }

    /// The verdict.
    pub fn verdict(&self) -> Verdict {
        Verdict::of(&self.causes, self.unexplained.is_some())
    }

    /// By how much the wind's direction drifts within what every base tolerates, degrees an hour;
    /// nothing where a drift was named.
    pub fn tolerated_drift_deg_per_h(&self) -> f64 {
        let named = |part: usize| self.accepted.iter().any(|a| a.part == part);
        let parts = self.last.model.parts[..self.base.model.parts.len()].iter();
        parts
            .enumerate()
            .filter(|(k, p)| p.id == MechanismId::WindDirectionDrift && !named(*k))
            .map(|(_, p)| p.values[0])
            .sum()
    }

    /// Accepted parts as mechanisms with their fitted parameters.
    pub fn extension(&self, ctx: &Context<'_>) -> Vec<Mechanism> {
        let stated = ctx.setup.priors.len();
        let base = self.base.model.parts.len();
        let platforms = ctx.data.track.platforms();
        // A tolerance of the base that was found to be too narrow is an extension too.
        let found = |part: usize| part >= base || self.accepted.iter().any(|a| a.part == part);
        self.last
            .model
            .parts
            .iter()
            .enumerate()
            .filter(|(k, _)| *k >= stated && found(*k))
            .map(|(_, p)| mechanism(p, platforms))
            .chain(self.ceilings.iter().map(|c| {
                Mechanism::from_values(MechanismId::SensorSaturation, &[c.limit_ppm])
                    .for_platforms(std::slice::from_ref(&c.platform))
            }))
            .collect()
    }

    fn describe(&self, ctx: &Context<'_>) -> Vec<Cause> {
        let mut causes: Vec<Cause> = Vec::new();
        for a in &self.accepted {
            let parameters = parameters(ctx.setup, &self.last, a.part);
            let platforms: Vec<String> = a
                .platform
                .map(|p| ctx.data.track.platforms()[p].clone())
                .into_iter()
                .collect();
            let mechanisms: Vec<String> = a
                .set
                .iter()
                .map(|(id, _)| id.as_str().to_string())
                .collect();
            // The same fault of several platforms is one cause.
            let same = causes.iter_mut().find(|c| {
                c.mechanisms == mechanisms && !c.platforms.is_empty() && !platforms.is_empty()
            });
            if let Some(same) = same {
                same.platforms.extend(platforms);
                same.parameters.extend(parameters);
                same.probability = same.probability.min(sum(&a.set));
                continue;
            }
            causes.push(Cause {
                mechanisms,
                probability: sum(&a.set),
                evidence: a.evidence,
                parameters,
                platforms,
                nats_to_next: a.nats_to_next,
            });
        }
        for own in self.ceilings.iter().map(Ceiling::cause) {
            let same = |c: &&mut Cause| c.mechanisms == own.mechanisms && !c.platforms.is_empty();
            match causes.iter_mut().find(same) {
                Some(same) => {
                    same.platforms.extend(own.platforms);
                    same.parameters.extend(own.parameters);
                }
                None => causes.push(own),
            }
        }
        causes.sort_by(|a, b| {
            b.evidence
                .delta_log_score
                .total_cmp(&a.evidence.delta_log_score)
        });
        causes
    }
}
