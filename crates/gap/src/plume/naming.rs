//! Naming: round after round until the data ask for no more; then every accepted cause is put
//! to the test again with the others in place, which gives its set and its probability.

use ::plume::mechanism::{Mechanism, MechanismId};

use super::Options;
use super::accepted::{Accepted, accept, sum};
use super::answer::{parameters, ranking, unexplained};
use super::ceiling::{Ceiling, ceilings};
use super::explore::{self, FALSE_ALARM, Incumbent, Round, Tried};
use super::fit::{Context, Effort, Fitted};
use super::held_out;
use super::model::{Model, mechanism};
use super::pair;
use super::rival::{self, Rival, Rivals};
use super::tested::{Tested, much_worse, put_to_the_test, without};
use crate::verdict::{Cause, Ranked, Unexplained, Verdict};

/// By how much a nameless rival must beat the best name, nats.
const RIVAL_MARGIN: f64 = 6.0;
/// What a nameless rival needs beyond its own false-alarm threshold: it is there for strong
/// effects, and weak ones of many forms are everywhere, nats.
const RIVAL_MORE: f64 = 9.0;
/// What a full fit must gain beyond the screen's threshold to count by itself, nats.
const REFIT_MARGIN: f64 = 3.0;
/// Names that gain this many times what they are due once the noise is their own show that the
/// base's noise hid what they explain: evidence under it then does not count.
const HIDDEN_BY_NOISE: f64 = 4.0;
/// What a swing to and fro must seem to gain for a closer look, with its prior, nats.
const SWING_HINT_NATS: f64 = 0.0;
/// Probability that all names together must have where a nameless rival is called for.
const NAMES_AT: f64 = 0.5;
/// Least gains of log score and log evidence for a name, nats. The screen's threshold knows the
/// noise model's own chance; what nature does besides is seen in cases in which nothing is
/// hidden.
const LEAST_SCORE: f64 = 14.0;
const LEAST_EVIDENCE: f64 = 9.0;
/// Probability, that of nameless terms counted in, from which on one name is said as the cause.
const SURE_AT: f64 = 0.9;
/// How often a null may move to a better place.
const MOST_MOVES: usize = 2;
/// Rows in a plume from which a correlation can be told, and the least that readings of one have.
const LEAST_PLUME_ROWS: usize = 60;
const LEAST_CORRELATION: f64 = 0.3;
/// A rest after naming counts when its evidence is this part of what naming gained …
const REST_PART: f64 = 0.06;
/// … or more than a false alarm would have by this, nats.
const REST_MARGIN: f64 = 4.0;

/// A nameless rival that beat the best name, until it is seen whether names together beat it.
struct Doubt {
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
    fn stands(&self, last: &Fitted, gained: f64) -> bool {
        let with_own_noise = last.score_with_prior() - self.last.score_with_prior();
        gained < self.due && with_own_noise < HIDDEN_BY_NOISE * self.due
    }
}

/// How naming until the data asked for no more went.
struct Grown {
    /// Whether a nameless rival was weighed against names, to the end.
    doubted: bool,
    /// Log evidence that what stands has gained, nats.
    due_nats: f64,
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
    against: Option<Rival>,
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
        ranking: ranking(ctx, &first),
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
    if named.accepted.is_empty() && named.unexplained.is_none() {
        named.unexplained = unrelated(ctx, &named.last);
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

/// A slow swing on top of a model, if there is one, and the model under a noise that holds none.
fn swing_beside(ctx: &Context<'_>, null: &Fitted, seed: u64) -> Option<(Fitted, Rival)> {
    let beside = ctx.refine_with(&null.model, null.noise, Effort::BESIDE_SWINGS);
    let rivals = rival::rivals(ctx, &beside, FALSE_ALARM, seed);
    let needed = rivals.threshold + RIVAL_MORE;
    let best = rivals.ranked.into_iter().find(|r| r.swings);
    let swing = best.filter(|r| r.log_evidence > needed)?;
    Some((beside, swing))
}

/// Readings that do not follow the predicted plume at all, though the noise could hold them:
/// of another track, another clock, or another plume.
fn unrelated(ctx: &Context<'_>, last: &Fitted) -> Option<Unexplained> {
    let p = &last.prediction;
    let rows: Vec<usize> = (0..ctx.data.len()).filter(|i| ctx.data.used[*i]).collect();
    let floor = 5.0 * last.noise.white_ppm();
    if rows.iter().filter(|i| p.plume[**i] > floor).count() < LEAST_PLUME_ROWS {
        return None;
    }
    let excess = |i: usize| ctx.data.reading_ppm[i] - (p.reading[i] - p.plume[i]);
    let mean = |f: &dyn Fn(usize) -> f64| rows.iter().map(|i| f(*i)).sum::<f64>();
    let n = rows.len() as f64;
    let (me, mp) = (mean(&excess) / n, mean(&|i| p.plume[i]) / n);
    let both = mean(&|i| (excess(i) - me) * (p.plume[i] - mp));
    let own = mean(&|i| (excess(i) - me).powi(2)) * mean(&|i| (p.plume[i] - mp).powi(2));
    let correlation = both / own.sqrt().max(1e-300);
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

/// What a name needs beyond the threshold once `named` causes have gained `gained` nats: those
/// may have left something that looks like another.
fn needed_beyond(named: usize, gained: f64) -> f64 {
    if named == 0 {
        0.0
    } else {
        REST_MARGIN + REST_PART * gained
    }
}

/// Whether a round calls for a name, and which.
fn called_for(round: &Round, more_nats: f64) -> Option<&Tried> {
    let best = round.tried.first()?;
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
fn still_called_for(round: &Round) -> Option<&Tried> {
    let best = round.tried.first()?;
    (best.log_evidence > LEAST_EVIDENCE).then_some(best)
}

/// The best nameless rival if it is well beyond its own threshold and beyond `least_nats`.
fn standing(rivals: &Rivals, least_nats: f64) -> Option<&Rival> {
    let needed = (rivals.threshold + RIVAL_MORE).max(least_nats);
    rivals.ranked.first().filter(|r| r.log_evidence > needed)
}

/// The nameless rival that a round calls for rather than a name: one that stands by itself and is
/// clearly better than `best`.
fn nameless<'a>(round: &'a Round, best: Option<&Tried>, least_nats: f64) -> Option<&'a Rival> {
    let top = standing(round.rivals.as_ref()?, least_nats)?;
    let beaten = best
        .is_none_or(|b| names_are_few(round) || top.log_evidence > b.log_evidence + RIVAL_MARGIN);
    beaten.then_some(top)
}

/// Whether all names together are less probable than what has none.
fn names_are_few(round: &Round) -> bool {
    let names = round.probabilities(|evidence, _| evidence);
    names.map(|(_, probability)| probability).sum::<f64>() < NAMES_AT
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
            let best = called_for(round, needed_beyond(k, gained));
            let best = best.filter(|_| k < options.most_causes);
            if let Some(rival) = nameless(round, best, REST_PART * gained) {
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
                Tested::Chance => {
                    // A name that does not carry over leaves what called for it unexplained.
                    if let Some(rival) = nameless(round, None, REST_PART * gained) {
                        doubt.get_or_insert_with(|| self.doubt(ctx, rival, gained));
                    }
                    break;
                }
                Tested::Null(_) if moved => break,
                Tested::Null(null) => {
                    moved = true;
                    null
                }
                Tested::Extension(refined) => {
                    moved = false;
                    gained += best.log_evidence;
                    let accepted = accept(round, best, None);
                    if self.accepted.is_empty() {
                        let ranked = round.rivals.iter().flat_map(|r| &r.ranked);
                        self.against = ranked.into_iter().next().cloned();
                    }
                    self.accepted.push(accepted);
                    refined
                }
            };
            tell(0.3 + 0.1 * k as f64, "looking for more");
            let seed = options.seed.wrapping_add(1 + k as u64);
            let (last, round) = settled_round(ctx, next, seed);
            if self.accepted.is_empty() {
                self.base = last.clone();
                self.ranking = ranking(ctx, &round);
                self.first = round;
                later = None;
            } else {
                later = Some(round);
            }
            self.last = last;
        }
        let doubted = doubt.is_some();
        let grown = self.fall_back(doubt.filter(|d| d.stands(&self.last, gained)), gained);
        Grown { doubted, ..grown }
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
        let named = std::mem::replace(&mut self.accepted, pair.accepted(self.first.p_value));
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

    /// A noise that is fitted to the base may hold a slow swing, and a name may describe a part
    /// of it. Where one is hinted at, it is looked for under a noise that was fitted beside slow
    /// swings; names that are of no more use then go.
    fn look_beside_swings(&mut self, ctx: &Context<'_>, seed: u64) {
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
            let settled = |fit: &Fitted| ctx.settle(&fit.model, &named.metric, fit, 6);
            let evidence = |fit: &Fitted| settled(fit).log_evidence;
            if evidence(named) - evidence(&self.base) < LEAST_EVIDENCE
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

    /// A single name that is not sure enough beside nameless terms does not stand alone: the best
    /// of them may be it instead.
    fn leave_open(&mut self, ctx: &Context<'_>) {
        let [only] = self.accepted.as_slice() else {
            return;
        };
        if only.set.len() == 1 && sum(&only.set) < SURE_AT {
            self.unexplained = self.against.as_ref().map(|term| unexplained(ctx, term));
        }
    }

    /// Lets a nameless term stand beside what was named.
    fn leave_unexplained(&mut self, ctx: &Context<'_>, term: &Rival) {
        self.rest = Some(term.fitted.clone());
        self.unexplained = Some(unexplained(ctx, term));
    }

    /// What stands if no names make up for `rival`.
    fn doubt(&self, ctx: &Context<'_>, rival: &Rival, gained: f64) -> Doubt {
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
    fn fall_back(&mut self, doubt: Option<Doubt>, gained: f64) -> Grown {
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
            let best = still_called_for(&round);
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

    /// What the causes leave that changed when each was tested beside the others.
    fn look_for_a_rest(&mut self, ctx: &Context<'_>, seed: u64) {
        let gained = self.accepted.iter().map(|a| a.evidence.delta_log_evidence);
        let rivals = rival::rivals(ctx, &self.last, FALSE_ALARM, seed);
        if let Some(rest) = standing(&rivals, REST_PART * gained.sum::<f64>()) {
            self.leave_unexplained(ctx, rest);
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

    /// The verdict.
    pub fn verdict(&self) -> Verdict {
        Verdict::of(&self.causes, self.unexplained.is_some())
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
            let parameters = parameters(&self.last, a.part);
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
