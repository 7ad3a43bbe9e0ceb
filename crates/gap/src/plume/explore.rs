//! One round of naming: screen everything, fit the best fully, rank by evidence, and hold the
//! nameless rivals against them.

use ::plume::mechanism::MechanismId;

use super::candidate::{self, Start};
use super::fit::{Context, Fitted};
use super::model::Model;
use super::parallel;
use super::rival::{self, Rivals};
use super::screen::{self, Scored};

/// Probability of a false alarm that a round allows.
pub(crate) const FALSE_ALARM: f64 = 0.001;
/// Most mechanisms that are fitted under fixed noise.
const MOST_FITTED: usize = 14;
/// Most mechanisms whose noise is fitted too.
const MOST_REFINED: usize = 8;
/// How far below the best one is still fitted, nats.
const WITHIN_NATS: f64 = 14.0;
/// How far below the best one is still refined, nats.
const REFINE_WITHIN_NATS: f64 = 12.0;
/// Evidence is taken as this power: the noise model and Laplace's approximation are not exact,
/// and stated probabilities must be right.
pub(crate) const TEMPER: f64 = 0.8;

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
    /// Probability among all tried and the rivals.
    pub probability: f64,
    /// The fit; only of those that were fitted with their noise.
    pub fitted: Option<Box<Fitted>>,
}

/// What came of a round.
pub(crate) struct Round {
    /// The best first.
    pub tried: Vec<Tried>,
    /// Scores of all that were not fitted further.
    pub screened: Vec<(MechanismId, Scored)>,
    pub starts: Vec<Start>,
    pub rivals: Option<Rivals>,
    pub p_value: f64,
    /// Gain that a false alarm exceeds as rarely as asked, nats.
    pub threshold: f64,
    /// Largest gain found by the screen or by a wider prior of the base, nats.
    pub best_gain: f64,
}

/// Where a trial starts from.
struct Trial {
    id: MechanismId,
    platform: Option<usize>,
    part: usize,
    model: Model,
    ln_weight: f64,
}

/// One round on top of `null`.
pub(crate) fn round(ctx: &Context<'_>, null: &Fitted, seed: u64, with_rivals: bool) -> Round {
    let starts = candidate::starts(ctx, null);
    let columns = screen::columns(ctx, null, &starts);
    let screen = screen::screen(ctx, null, &starts, &columns, FALSE_ALARM, seed);
    let rivals = with_rivals.then(|| rival::rivals(ctx, null, FALSE_ALARM, seed ^ 0x5eed));
    let mut best_gain = screen.scored.iter().map(|s| s.gain).fold(0.0f64, f64::max);
    let mut trials = widened(null, &mut best_gain);
    trials.extend(from_screen(ctx, null, &starts, &screen.scored));
    let tried = fit_trials(ctx, null, trials);
    let screened = screen
        .scored
        .into_iter()
        .map(|s| (starts[s.start].id, s))
        .collect();
    let mut round = Round {
        tried,
        screened,
        starts,
        rivals,
        p_value: screen.p_value,
        threshold: screen.threshold,
        best_gain,
    };
    round.share_probability();
    round
}

/// Parameters of the base whose prior the data contradict: the same with a physical prior.
fn widened(null: &Fitted, best_gain: &mut f64) -> Vec<Trial> {
    let mut out = Vec::new();
    for (k, free) in null.model.free.iter().enumerate() {
        let spec = null.model.spec_of(k);
        if free.sd >= 0.7 * spec.prior_sd {
            continue;
        }
        let own = null.posterior.covariance[(k, k)];
        let prior = free.sd * free.sd;
        let departure = null.model.coordinate(k) - free.centre;
        // What the data alone say, and how it sits with the prior.
        let known = 1.0 / own - 1.0 / prior;
        if known <= 0.0 {
            continue;
        }
        let alone = departure / (own * known);
        let gain = 0.5 * alone * alone / (prior + 1.0 / known);
        if gain < 2.0 {
            continue;
        }
        *best_gain = best_gain.max(gain);
        let mut model = null.model.clone();
        model.free[k].sd = spec.prior_sd;
        let part = free.part;
        out.push(Trial {
            id: model.parts[part].id,
            platform: model.parts[part].platform,
            part,
            model,
            ln_weight: 0.0,
        });
    }
    out
}

fn from_screen(
    ctx: &Context<'_>,
    null: &Fitted,
    starts: &[Start],
    scored: &[Scored],
) -> Vec<Trial> {
    let mut order: Vec<&Scored> = scored.iter().filter(|s| s.gain > 1.0).collect();
    order.sort_by(|a, b| {
        b.log_evidence
            .total_cmp(&a.log_evidence)
            .then(a.start.cmp(&b.start))
    });
    let best = order.first().map_or(0.0, |s| s.log_evidence);
    let mut out: Vec<Trial> = Vec::new();
    let platforms = ctx.data.ranges().len() as f64;
    for s in order {
        let start = &starts[s.start];
        let most = if start.id == MechanismId::SecondSource {
            3
        } else {
            1
        };
        let have = out
            .iter()
            .filter(|t| t.id == start.id && t.platform == s.platform)
            .count();
        if have >= most || s.log_evidence < best - WITHIN_NATS || out.len() >= MOST_FITTED {
            continue;
        }
        let amplitude: Vec<f64> = s.amplitude.iter().map(|a| a.clamp(-2.0, 2.0)).collect();
        let model = null.model.extended(start.part(s.platform, &amplitude));
        let ln_weight = match (start.of_a_platform() && platforms > 1.0, s.platform) {
            (true, None) => -std::f64::consts::LN_2,
            (true, Some(_)) => -std::f64::consts::LN_2 - platforms.ln(),
            _ => 0.0,
        };
        out.push(Trial {
            id: start.id,
            platform: s.platform,
            part: model.parts.len() - 1,
            model,
            ln_weight,
        });
    }
    out
}

fn fit_trials(ctx: &Context<'_>, null: &Fitted, trials: Vec<Trial>) -> Vec<Tried> {
    let single = Context { threads: 1, ..*ctx };
    let still = single.settle(&null.model, null, 0);
    let fits = parallel::map(&trials, ctx.threads, |t| single.settle(&t.model, null, 5));
    let mut tried: Vec<(Tried, Fitted)> = trials
        .iter()
        .zip(fits)
        .map(|(t, f)| {
            let tried = Tried {
                id: t.id,
                platform: t.platform,
                part: t.part,
                log_score: f.log_score - still.log_score,
                log_evidence: f.log_evidence - still.log_evidence + t.ln_weight,
                probability: 0.0,
                fitted: None,
            };
            (tried, f)
        })
        .collect();
    tried.sort_by(|a, b| b.0.log_evidence.total_cmp(&a.0.log_evidence));
    tried.dedup_by(|b, a| a.0.id == b.0.id && a.0.platform == b.0.platform);
    let best = tried.first().map_or(0.0, |t| t.0.log_evidence);
    let refine: Vec<usize> = (0..tried.len())
        .filter(|k| tried[*k].0.log_evidence > best - REFINE_WITHIN_NATS)
        .take(MOST_REFINED)
        .collect();
    // The best is refined first; the others start from its noise too, since under the base the
    // noise has grown by what they explain.
    let lead = refine
        .first()
        .map(|k| ctx.refine(tried[*k].1.clone(), 2, 6));
    let rest = refine.get(1..).unwrap_or_default();
    let followers = parallel::map(rest, ctx.threads, |k| {
        let from = tried[*k].1.clone();
        let noise = lead.as_ref().map_or(from.noise, |l| l.noise);
        single.refine(Fitted { noise, ..from }, 1, 4)
    });
    let refined: Vec<Fitted> = lead.into_iter().chain(followers).collect();
    for (k, f) in refine.iter().zip(refined) {
        let t = &mut tried[*k].0;
        let weight = trials
            .iter()
            .find(|w| w.id == t.id && w.platform == t.platform)
            .map_or(0.0, |w| w.ln_weight);
        let score = f.log_score - null.log_score;
        let evidence = f.log_evidence - null.log_evidence + weight;
        // The noise's own fit is a search: it may not make a fit worse than it was.
        if evidence > t.log_evidence {
            t.log_score = score;
            t.log_evidence = evidence;
        }
        t.fitted = Some(Box::new(f));
    }
    let mut tried: Vec<Tried> = tried.into_iter().map(|t| t.0).collect();
    tried.sort_by(|a, b| {
        b.fitted
            .is_some()
            .cmp(&a.fitted.is_some())
            .then(b.log_evidence.total_cmp(&a.log_evidence))
    });
    tried
}

impl Round {
    /// Shares probability among the base as it is, all mechanisms tried, and the rivals.
    fn share_probability(&mut self) {
        let rivals: Vec<f64> = self
            .rivals
            .iter()
            .flat_map(|r| r.ranked.iter().map(|r| r.log_evidence))
            .collect();
        let peak = self
            .tried
            .iter()
            .map(|t| t.log_evidence)
            .chain(rivals.iter().copied());
        let peak = peak.fold(0.0f64, f64::max);
        let weight = |e: f64| (TEMPER * (e - peak)).exp();
        let total: f64 = self
            .tried
            .iter()
            .map(|t| weight(t.log_evidence))
            .sum::<f64>()
            + rivals.iter().map(|r| weight(*r)).sum::<f64>()
            + weight(0.0);
        for t in &mut self.tried {
            t.probability = weight(t.log_evidence) / total;
        }
    }

    /// Probability of every id, all its platforms together, the largest first.
    pub fn by_id(&self) -> Vec<(MechanismId, f64)> {
        let mut out: Vec<(MechanismId, f64)> = Vec::new();
        for t in &self.tried {
            match out.iter_mut().find(|o| o.0 == t.id) {
                Some(o) => o.1 += t.probability,
                None => out.push((t.id, t.probability)),
            }
        }
        out.sort_by(|a, b| b.1.total_cmp(&a.1).then(a.0.cmp(&b.0)));
        out
    }
}
