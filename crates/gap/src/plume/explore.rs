//! One round of naming: screen everything, fit the best fully, rank by evidence, and hold the
//! nameless rivals against them.

use ::plume::effects::HOUR_S;
use ::plume::mechanism::MechanismId;

use super::candidate::{self, Start};
use super::chance::Chance;
use super::fit::{Context, Fitted};
use super::followed::followed;
use super::lid;
use super::model::Model;
use super::parallel;
use super::rival::{self, Rival, Rivals};
use super::screen::{self, Equations, Scored};
use super::start;

/// Probability of a false alarm that a round allows.
pub(crate) const FALSE_ALARM: f64 = 1e-4;
/// Most mechanisms that are fitted under fixed noise.
const MOST_FITTED: usize = 18;
/// How far below the best one is still fitted, nats.
const WITHIN_NATS: f64 = 14.0;
const WITHIN_PART: f64 = 0.3;
/// What a lid must gain where it stands to be fitted, nats.
const LEAST_LID_NATS: f64 = 2.0;
/// By how much a null must gain for its other place to count as one, nats.
const ANOTHER_PLACE_NATS: f64 = 1.0;
/// From how many standard deviations of its prior on a tolerance may stand for another.
const FAR_SD: f64 = 0.8;
/// How many of the best trials lend the null their parameters.
const STARTS_OF_NULL: usize = 3;

/// A mechanism fitted on top of the model before.
#[derive(Debug, Clone)]
pub(crate) struct Tried {
    pub id: MechanismId,
    pub platform: Option<usize>,
    /// Part of the model that it is.
    pub part: usize,
    /// Gain of the log likelihood, nats.
    pub log_score: f64,
    /// Gain of the log evidence, with its share of the prior, nats.
    pub log_evidence: f64,
    /// The fit under the null's noise.
    pub fitted: Fitted,
}

/// What came of a round.
pub(crate) struct Round {
    /// The best first.
    pub tried: Vec<Tried>,
    /// Scores of all that were not fitted further.
    pub screened: Vec<(MechanismId, Scored)>,
    pub starts: Vec<Start>,
    pub equations: Equations,
    pub rivals: Option<Rivals>,
    /// How large the best gain gets where nothing is hidden.
    pub chance: Chance,
    /// Gain that a false alarm exceeds as rarely as asked, nats.
    pub threshold: f64,
    /// Largest gain found by the screen or by a wider prior of the base, nats.
    pub best_gain: f64,
    /// Where the null fits better than where it stood, if somewhere.
    pub better_null: Option<Model>,
}

/// Where a trial starts from.
struct Trial {
    id: MechanismId,
    platform: Option<usize>,
    part: usize,
    model: Model,
    ln_weight: f64,
}

/// A cause that was named, which is to be tried again on top of a null without it.
pub(crate) struct Incumbent {
    pub id: MechanismId,
    pub platform: Option<usize>,
    pub part: usize,
    /// The null with it, where it was at its best.
    pub model: Model,
}

/// One round on top of `null`, with nameless rivals.
pub(crate) fn round(ctx: &Context<'_>, null: &Fitted, seed: u64) -> Round {
    let names = names(ctx, null, seed, None);
    let mut rivals = rival::rivals(ctx, null, FALSE_ALARM, seed ^ 0x5eed);
    let best = names.tried.first();
    let log_score = best.map_or(0.0, |b| b.log_score);
    rivals.beside_name(ctx, log_score, |r| best.is_some_and(|b| holds(r, b)));
    Round {
        rivals: Some(rivals),
        ..names
    }
}

/// Whether a nameless term describes what the name does, and more: a delay that comes and goes may
/// also stay.
fn holds(rival: &Rival, name: &Tried) -> bool {
    let delays = matches!(name.id, MechanismId::ClockOffset | MechanismId::SensorLag);
    rival.delays && delays && name.platform.is_none_or(|p| rival.platform == Some(p))
}

/// One round of names alone on top of `null`, of which one may have been named before.
pub(crate) fn names(
    ctx: &Context<'_>,
    null: &Fitted,
    seed: u64,
    incumbent: Option<Incumbent>,
) -> Round {
    let starts = candidate::starts(ctx, &null.model, &null.prediction);
    let columns = screen::columns(ctx, null, &starts);
    let screen = screen::screen(ctx, null, &starts, &columns, seed);
    let mut best_gain = screen.scored.iter().map(|s| s.gain).fold(0.0f64, f64::max);
    let mut trials = widened(null, &mut best_gain);
    trials.extend(turned_otherwise(ctx, null));
    trials.extend(turned_afar(ctx, null));
    trials.extend(from_screen(ctx, null, &starts, &columns, &screen.scored));
    let platforms = ctx.data.ranges().len();
    trials.extend(incumbent.map(|i| i.trial(&starts, platforms)));
    let (tried, better_null) = fit_trials(ctx, null, trials);
    let screened = screen
        .scored
        .into_iter()
        .map(|s| (starts[s.start].id, s))
        .collect();
    Round {
        tried,
        screened,
        starts,
        equations: screen.equations,
        rivals: None,
        chance: screen.chance,
        threshold: screen.chance.threshold(FALSE_ALARM),
        best_gain,
        better_null,
    }
}

impl Trial {
    /// A model in which the base's parameter `k` has a wider prior.
    fn of_the_base(model: Model, k: usize) -> Self {
        let part = model.free[k].part;
        Self {
            id: model.parts[part].id,
            platform: model.parts[part].platform,
            part,
            model,
            ln_weight: 0.0,
        }
    }
}

impl Incumbent {
    /// What was named is tried from where it was at its best too: the screen's straight lines
    /// may not lead there from a null that others have moved.
    fn trial(self, starts: &[Start], platforms: usize) -> Trial {
        let own = starts.iter().find(|s| s.id == self.id);
        Trial {
            ln_weight: own.map_or(0.0, |s| s.ln_weight_on(self.platform, platforms)),
            id: self.id,
            platform: self.platform,
            part: self.part,
            model: self.model,
        }
    }
}

/// Parameters of the base whose prior the data contradict: the same with a wider one.
fn widened(null: &Fitted, best_gain: &mut f64) -> Vec<Trial> {
    let mut out = Vec::new();
    for k in null.model.held() {
        let free = &null.model.free[k];
        let own = null.posterior.covariance[(k, k)];
        let prior = free.sd * free.sd;
        // What the data alone say, and how it sits with the prior.
        let known = 1.0 / own - 1.0 / prior;
        if known <= 0.0 {
            continue;
        }
        let alone = null.model.departure(k) / (own * known);
        let gain = 0.5 * alone * alone / (prior + 1.0 / known);
        if gain < 2.0 {
            continue;
        }
        *best_gain = best_gain.max(gain);
        out.push(Trial::of_the_base(null.model.widened(k), k));
    }
    out
}

/// A wind that the base took to turn where it may always have stood elsewhere, or the other way
/// round: the parameter that a narrow prior holds back, with a physical one, does what the other
/// did for the plume, and that goes back to its centre. From where the other stands no straight
/// line leads there.
fn turned_otherwise(ctx: &Context<'_>, null: &Fitted) -> Vec<Trial> {
    use MechanismId as M;
    let stands = &null.model;
    let own = |id| stands.held().find(|k| stands.id_of(*k) == id);
    let (Some(offset), Some(drift)) = (own(M::WindDirectionOffset), own(M::WindDirectionDrift))
    else {
        return Vec::new();
    };
    let Some(met_h) = mean_time_in_plume_h(ctx, null) else {
        return Vec::new();
    };
    [(drift, offset, met_h), (offset, drift, 1.0 / met_h)]
        .into_iter()
        .filter(|(from, ..)| stands.departure_sd(*from).abs() > FAR_SD)
        .map(|(from, to, rate)| {
            let mut model = stands.widened(to);
            model.set_coordinate(from, model.free[from].centre);
            let turned = rate * stands.departure(from);
            model.set_coordinate(to, model.coordinate(to) + turned);
            Trial::of_the_base(model, to)
        })
        .collect()
}

/// A wind that blows from elsewhere altogether: no slope leads from a plume that the readings do not
/// follow to where they do.
fn turned_afar(ctx: &Context<'_>, null: &Fitted) -> Option<Trial> {
    let offset = null.model.free_of(MechanismId::WindDirectionOffset);
    let k = offset.filter(|k| null.model.wider_sd(*k).is_some())?;
    if followed(ctx.data, &null.prediction.reading) {
        return None;
    }
    let (turned, _) = start::turned_afar(ctx, &null.model, k, &null.noise);
    let far = turned.departure(k).abs() > null.model.free[k].sd;
    far.then(|| Trial::of_the_base(turned, k))
}

/// When the plume was met, hours, on average over what is predicted of it.
fn mean_time_in_plume_h(ctx: &Context<'_>, null: &Fitted) -> Option<f64> {
    let times_s = ctx.data.track.time_s();
    let rows = || (0..ctx.data.len()).filter(|i| ctx.data.used[*i]);
    let plume = |i: usize| null.prediction.plume[i];
    let met: f64 = rows().map(plume).sum();
    let mean_s = rows().map(|i| plume(i) * times_s[i]).sum::<f64>() / met;
    (met > 0.0 && mean_s > 0.0).then_some(mean_s / HOUR_S)
}

fn from_screen(
    ctx: &Context<'_>,
    null: &Fitted,
    starts: &[Start],
    columns: &[Vec<f64>],
    scored: &[Scored],
) -> Vec<Trial> {
    let mut order: Vec<&Scored> = scored.iter().filter(|s| s.gain > 1.0).collect();
    order.sort_by(|a, b| {
        b.log_evidence
            .total_cmp(&a.log_evidence)
            .then(a.start.cmp(&b.start))
    });
    let best = order.first().map_or(0.0, |s| s.log_evidence);
    // The stronger an effect, the less the screen's straight line says of it.
    let least = best - WITHIN_NATS - WITHIN_PART * best;
    let mut out: Vec<Trial> = Vec::new();
    let platforms = ctx.data.ranges().len();
    for s in order {
        let start = &starts[s.start];
        // What is far from linear is tried from several places.
        let most = match start.id {
            MechanismId::SecondSource => 3,
            MechanismId::DryDeposition | MechanismId::SensorSaturation => 2,
            _ => 1,
        };
        let have = out
            .iter()
            .filter(|t| t.id == start.id && t.platform == s.platform)
            .count();
        if have >= most || s.log_evidence < least || out.len() >= MOST_FITTED {
            continue;
        }
        let amplitude: Vec<f64> = s.amplitude.iter().map(|a| a.clamp(-2.0, 2.0)).collect();
        let model = null.model.extended(start.part(s.platform, &amplitude));
        out.push(Trial {
            id: start.id,
            platform: s.platform,
            part: model.parts.len() - 1,
            model,
            ln_weight: start.ln_weight_on(s.platform, platforms),
        });
    }
    out.extend(lids(ctx, null, starts, columns, least));
    out
}

/// Lids that gain `least_nats` where they stand, if any, and something at least.
fn lids(
    ctx: &Context<'_>,
    null: &Fitted,
    starts: &[Start],
    columns: &[Vec<f64>],
    least_nats: f64,
) -> Vec<Trial> {
    let (starts, columns) = screen::of_mechanism(starts, columns, MechanismId::MixingLid);
    let least_nats = least_nats.max(LEAST_LID_NATS);
    lid::worth_a_fit(ctx, null, &starts, &columns, least_nats)
        .into_iter()
        .map(|start| {
            let model = null.model.extended(start.part(None, &[1.0]));
            Trial {
                id: start.id,
                platform: None,
                part: model.parts.len() - 1,
                model,
                ln_weight: start.ln_weight,
            }
        })
        .collect()
}

/// Fits the trials under the null's noise and gives what each gains, with the null at its best.
fn fit_trials(ctx: &Context<'_>, null: &Fitted, trials: Vec<Trial>) -> (Vec<Tried>, Option<Model>) {
    let single = Context { threads: 1, ..*ctx };
    let fits = parallel::map(&trials, ctx.threads, |t| {
        single.settle(&t.model, &null.metric.not_tolerating(t.id), null, 10)
    });
    let (still, moved) = best_null(&single, null, &trials, &fits);
    let count = null.model.dimension();
    let was = still.log_score + still.model.ln_departure(|_| true);
    let mut tried: Vec<Tried> = trials
        .iter()
        .zip(fits)
        .map(|(t, f)| {
            // What the trial frees does not speak against itself.
            let others = |k: usize| k < count && f.model.free[k].part != t.part;
            Tried {
                id: t.id,
                platform: t.platform,
                part: t.part,
                log_score: f.log_score + f.model.ln_departure(others) - was,
                log_evidence: f.log_evidence - still.log_evidence + t.ln_weight,
                fitted: f,
            }
        })
        .collect();
    tried.sort_by(|a, b| b.log_evidence.total_cmp(&a.log_evidence));
    let mut seen = Vec::new();
    tried.retain(|t| {
        let new = !seen.contains(&(t.id, t.platform));
        seen.push((t.id, t.platform));
        new
    });
    (tried, moved.then_some(still.model))
}

/// The null at its best from where it stands and from where the best trials have its
/// parameters: a fit that found a better place for these has found no cause.
///
/// Also whether that is another place than where it stood.
fn best_null(
    ctx: &Context<'_>,
    null: &Fitted,
    trials: &[Trial],
    fits: &[Fitted],
) -> (Fitted, bool) {
    let mut best = ctx.settle(&null.model, &null.metric, null, 5);
    let first = best.score_with_prior();
    let mut order: Vec<usize> = (0..fits.len()).collect();
    order.sort_by(|a, b| fits[*b].log_evidence.total_cmp(&fits[*a].log_evidence));
    for &k in order.iter().take(STARTS_OF_NULL) {
        let mut start = null.model.clone();
        for j in 0..start.dimension() {
            if start.free[j].part != trials[k].part {
                start.set_coordinate(j, fits[k].model.coordinate(j));
            }
        }
        let other = ctx.settle(&start, &null.metric, null, 10);
        if other.score_with_prior() > best.score_with_prior() + 0.02 {
            best = other;
        }
    }
    let moved = best.score_with_prior() > first + ANOTHER_PLACE_NATS;
    (best, moved)
}

impl Round {
    /// Log of the sum over the base as it is, all mechanisms tried, and the rivals, of the
    /// evidence as it is weighed.
    fn ln_total(&self, weighed: &impl Fn(f64, Option<MechanismId>) -> f64) -> f64 {
        let rivals = self.rivals.iter().flat_map(|r| &r.ranked);
        let tried = self.tried.iter();
        let all: Vec<f64> = std::iter::once(weighed(0.0, None))
            .chain(tried.map(|t| weighed(t.log_evidence, Some(t.id))))
            .chain(rivals.map(|r| weighed(r.log_evidence, None)))
            .collect();
        let peak = all.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        peak + all.iter().map(|e| (e - peak).exp()).sum::<f64>().ln()
    }

    /// Probability of each that was tried, in their order, with log evidence as `weighed` has
    /// it of a mechanism; of the base and of nameless rivals where there is no mechanism.
    pub fn probabilities(
        &self,
        weighed: impl Fn(f64, Option<MechanismId>) -> f64,
    ) -> impl Iterator<Item = (&Tried, f64)> {
        let ln_total = self.ln_total(&weighed);
        let own = move |t: &Tried| (weighed(t.log_evidence, Some(t.id)) - ln_total).exp();
        self.tried.iter().map(move |t| (t, own(t)))
    }

    /// Probability of every id, all its platforms together, the largest first; weighed as for
    /// [`Round::probabilities`].
    pub fn by_id(
        &self,
        weighed: impl Fn(f64, Option<MechanismId>) -> f64,
    ) -> Vec<(MechanismId, f64)> {
        let mut out: Vec<(MechanismId, f64)> = Vec::new();
        for (t, probability) in self.probabilities(weighed) {
            match out.iter_mut().find(|o| o.0 == t.id) {
                Some(o) => o.1 += probability,
                None => out.push((t.id, probability)),
            }
        }
        out.sort_by(|a, b| b.1.total_cmp(&a.1).then(a.0.cmp(&b.0)));
        out
    }
}
