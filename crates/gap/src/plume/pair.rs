//! Two causes at once that look like neither: where one hides the other each gains next to
//! nothing alone, or less than a third that looks like both. All pairs are scored to first order
//! from the screen's normal equations; the best are fitted in full.

use ::plume::mechanism::MechanismId;
use nalgebra::{DMatrix, DVector};

use super::accepted::Accepted;
use super::candidate::Start;
use super::explore::Round;
use super::fit::{Context, Fitted};
use super::model::Model;
use super::parallel;
use super::screen::{self, Equations, Hypothesis};
use crate::verdict::Evidence;

/// Most pairs that are fitted.
const MOST_FITTED: usize = 8;
/// How far below the best one is still fitted, nats.
const WITHIN_NATS: f64 = 10.0;
/// Part of what a pair needs that it must have to first order to be fitted.
const FIRST_ORDER_PART: f64 = 0.7;

/// One of two causes.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Half {
    pub id: MechanismId,
    pub platform: Option<usize>,
    /// Part of the model that it is.
    pub part: usize,
}

/// Two causes fitted together on top of a null.
pub(crate) struct Pair {
    pub halves: [Half; 2],
    /// Gain of the log likelihood, nats.
    pub log_score: f64,
    /// Gain of the log evidence, with their shares of the prior, nats.
    pub log_evidence: f64,
    /// The fit under the null's noise.
    pub fitted: Fitted,
}

impl Pair {
    /// Both as accepted causes, each with half of the gain until it is tested beside the other.
    pub fn accepted(&self, p_value: f64) -> Vec<Accepted> {
        let of = |h: &Half| Accepted {
            id: h.id,
            platform: h.platform,
            part: h.part,
            set: vec![(h.id, 1.0)],
            of_catalogue: 1.0,
            evidence: Evidence {
                delta_log_score: 0.5 * self.log_score,
                delta_log_evidence: 0.5 * self.log_evidence,
                p_value,
            },
            strength_nats: 0.5 * self.log_score,
            nats_to_next: 0.0,
            others: Vec::new(),
            elsewhere: Vec::new(),
        };
        self.halves.iter().map(of).collect()
    }
}

/// What may be one of two: a start of the screen, or a parameter of the base with a physical prior.
#[derive(Clone, Copy)]
struct Candidate<'a> {
    id: MechanismId,
    /// None of the base's own.
    start: Option<&'a Start>,
    hypothesis: &'a Hypothesis,
}

/// Two together, to first order.
struct Linear<'a> {
    of: [Candidate<'a>; 2],
    amplitude: DVector<f64>,
    log_evidence: f64,
}

/// The pair that gains most on top of `null`, if one gains more evidence than `least_nats`.
pub(crate) fn best(
    ctx: &Context<'_>,
    null: &Fitted,
    round: &Round,
    least_nats: f64,
) -> Option<Pair> {
    let candidates = candidates(null, round);
    let chosen = worth_a_fit(&round.equations, &candidates, FIRST_ORDER_PART * least_nats);
    let single = Context { threads: 1, ..*ctx };
    let fits = parallel::map(&chosen, ctx.threads, |linear| linear.fit(&single, null));
    let evidence = |linear: &Linear<'_>, fit: &Fitted| fit.log_evidence + linear.ln_weight();
    let (linear, (fitted, halves)) = chosen
        .iter()
        .zip(fits)
        .max_by(|a, b| evidence(a.0, &a.1.0).total_cmp(&evidence(b.0, &b.1.0)))?;
    let still = null_at_its_best(ctx, null, &fitted.model);
    let was = still.log_score + still.model.ln_departure(|_| true);
    // What the pair frees does not speak against itself.
    let others = |k: usize| {
        let part = fitted.model.free[k].part;
        k < null.model.dimension() && halves.iter().all(|h| h.part != part)
    };
    let log_score = fitted.log_score + fitted.model.ln_departure(others) - was;
    let log_evidence = evidence(linear, &fitted) - still.log_evidence;
    (log_evidence > least_nats).then_some(Pair {
        halves,
        log_score,
        log_evidence,
        fitted,
    })
}

fn candidates<'a>(null: &Fitted, round: &'a Round) -> Vec<Candidate<'a>> {
    let of_start = |h: &'a Hypothesis| {
        let start = &round.starts[h.start];
        Candidate {
            id: start.id,
            start: Some(start),
            hypothesis: h,
        }
    };
    let of_base = |h: &'a Hypothesis| Candidate {
        id: null.model.id_of(h.start),
        start: None,
        hypothesis: h,
    };
    let (starts, widened) = (&round.equations.hypotheses, &round.equations.widened);
    starts
        .iter()
        .map(of_start)
        .chain(widened.iter().map(of_base))
        .collect()
}

/// The null from where it stands or from where a larger model has its parameters.
fn null_at_its_best(ctx: &Context<'_>, null: &Fitted, larger: &Model) -> Fitted {
    let still = ctx.settle(&null.model, &null.metric, null, 5);
    let there = null.model.clone().placed_as(larger);
    let moved = ctx.settle(&there, &null.metric, null, 10);
    if moved.score_with_prior() > still.score_with_prior() {
        moved
    } else {
        still
    }
}

/// Pairs of different causes that gain `least_nats` to first order, the best first.
fn worth_a_fit<'a>(
    equations: &Equations,
    candidates: &[Candidate<'a>],
    least_nats: f64,
) -> Vec<Linear<'a>> {
    let score_of = |c: &Candidate<'_>| equations.score_of(c.hypothesis);
    let scores: Vec<DVector<f64>> = candidates.iter().map(score_of).collect();
    let mut all = Vec::new();
    for (i, one) in candidates.iter().enumerate() {
        for (j, other) in candidates.iter().enumerate().skip(i + 1) {
            if one.id == other.id {
                continue;
            }
            let linear = Linear::new(equations, [*one, *other], [&scores[i], &scores[j]]);
            all.extend(linear.filter(|l| l.log_evidence > least_nats));
        }
    }
    all.sort_by(|a, b| b.log_evidence.total_cmp(&a.log_evidence));
    let best = all.first().map_or(0.0, |l| l.log_evidence);
    let mut seen = Vec::new();
    all.retain(|l| {
        let names = l.of.map(|c| (c.id, c.hypothesis.platform));
        let new = !seen.contains(&names);
        seen.push(names);
        new && l.log_evidence > best - WITHIN_NATS
    });
    all.truncate(MOST_FITTED);
    all
}

impl<'a> Linear<'a> {
    /// None where one of them would have to be on its forbidden side.
    fn new(
        equations: &Equations,
        of: [Candidate<'a>; 2],
        scores: [&DVector<f64>; 2],
    ) -> Option<Self> {
        let [one, other] = of.map(|c| c.hypothesis);
        let (d, n) = (one.sd.len(), one.sd.len() + other.sd.len());
        let shared = equations.shared(one, other);
        let information = DMatrix::from_fn(n, n, |i, j| match (i < d, j < d) {
            (true, true) => one.information[(i, j)],
            (false, false) => other.information[(i - d, j - d)],
            (true, false) => shared[(i, j - d)],
            (false, true) => shared[(j, i - d)],
        });
        let score = DVector::from_fn(n, |k, _| {
            if k < d {
                scores[0][k]
            } else {
                scores[1][k - d]
            }
        });
        let sd: Vec<f64> = one.sd.iter().chain(&other.sd).copied().collect();
        let (amplitude, log_evidence) = screen::evidence(information, &score, &sd)?;
        let forbidden = |h: &Hypothesis, a: f64| h.one_sided && a <= 0.0;
        if forbidden(one, amplitude[0]) || forbidden(other, amplitude[d]) {
            return None;
        }
        let weights = one.ln_weight_with_side() + other.ln_weight_with_side();
        Some(Self {
            of,
            amplitude,
            log_evidence: log_evidence + weights,
        })
    }

    fn ln_weight(&self) -> f64 {
        self.of.iter().map(|c| c.hypothesis.ln_weight).sum()
    }

    /// Both on top of `null`, under its noise, and where they are in that.
    fn fit(&self, ctx: &Context<'_>, null: &Fitted) -> (Fitted, [Half; 2]) {
        let mut model = null.model.clone();
        let mut metric = null.metric.clone();
        let mut rest = self.amplitude.as_slice();
        let halves = self.of.map(|candidate| {
            let h = candidate.hypothesis;
            let (own, others) = rest.split_at(h.sd.len());
            rest = others;
            let part;
            if let Some(start) = candidate.start {
                let amplitude: Vec<f64> = own.iter().map(|a| a.clamp(-2.0, 2.0)).collect();
                part = model.parts.len();
                model = model.extended(start.part(h.platform, &amplitude));
            } else {
                part = model.free[h.start].part;
                model = model.widened(h.start);
                model.set_coordinate(h.start, model.coordinate(h.start) + own[0]);
            }
            metric = metric.not_tolerating(candidate.id);
            Half {
                id: candidate.id,
                platform: h.platform,
                part,
            }
        });
        (ctx.settle(&model, &metric, null, 10), halves)
    }
}
