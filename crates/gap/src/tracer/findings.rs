//! From scored models to causes: which changes the data ask for, which they cannot tell apart,
//! and how sure that is over trials.

use super::parameters::parameters;
use super::trial_scores::{Scored, difference};
use super::tried::TriedModel;
use crate::verdict::{Cause, Evidence, Parameter};

/// Changes that stand for a choice of input and not for a cause.
const INPUTS: [&str; 2] = ["wind-at-plume-height", "spread-by-obukhov-length"];
/// Nats of evidence over the base below which nothing is found: some thirty models are tried.
const LEAST_NATS: f64 = 5.0;
/// Width by the measured deviation of azimuth: a choice of input too, but one that is asked for.
const AZIMUTH: &str = "sigma-y-from-azimuth";
/// Probability that a set of causes must hold.
const SET_PROBABILITY: f64 = 0.95;
/// Probability of some cause below which no set is stated.
const LIKELY: f64 = 0.5;
/// Nats of score that a change must be worth to be a part of a model at all.
const LEAST_SHOWN: f64 = 1.0;
/// Part of the gain in evidence that a law not quite right may cost.
const LAW_ERROR: f64 = 0.1;
/// Standard errors of a one-sided test at the 5 % level.
const ONE_SIDED: f64 = 1.645;

/// What a question (vertical or lateral, in one kind of air) came to.
pub struct Finding {
    /// The causes; none where the base does.
    pub causes: Vec<Cause>,
    /// Inputs of the model behind the first cause, or of the most probable: what the numbers are
    /// relative to.
    pub relative_to: Vec<&'static str>,
    /// Gain of that model over the base on trials left out and its standard error, nats.
    pub held_out_gain: (f64, f64),
    /// Probability of any cause, whether stated or not.
    pub some_cause: f64,
    /// All models, the most probable first.
    pub tried: Vec<TriedModel>,
}

/// Changes of a model that are causes.
fn causes_of(ids: &[&'static str]) -> Vec<&'static str> {
    ids.iter()
        .copied()
        .filter(|id| !INPUTS.contains(id))
        .collect()
}

/// Changes of a model that choose an input.
fn inputs_of(ids: &[&'static str]) -> Vec<&'static str> {
    let input = |id: &&'static str| INPUTS.contains(id) || *id == AZIMUTH;
    ids.iter().copied().filter(input).collect()
}

/// A set of causes with its probability.
type Combination = (Vec<&'static str>, f64);

/// Judges the scored models of one question; `group` names the kind of air.
pub fn judge(scored: &[(usize, Scored)], group: &str) -> Option<Finding> {
    let mut order: Vec<&Scored> = scored.iter().map(|s| &s.1).collect();
    order.sort_by(|a, b| b.probability.total_cmp(&a.probability));
    let base = order.iter().find(|s| s.ids.is_empty())?;
    let best = order.first()?;
    let gain = best.fit.log_evidence - base.fit.log_evidence;
    let combined = combinations(&order);
    let sets = if gain > LEAST_NATS {
        answer_sets(&order, combined.clone())
    } else {
        Vec::new()
    };
    let mut causes: Vec<Cause> = Vec::new();
    for set in &sets {
        let mut next = cause(&order, set, base, group);
        // A parameter is stated once, with its own mechanism.
        let of_another = |p: &Parameter| {
            let others = sets.iter().filter(|other| *other != set);
            others.flatten().any(|id| *id == p.mechanism)
        };
        next.parameters.retain(|p| !of_another(p));
        causes.push(next);
    }
    let behind = sets.first().map_or(*best, |set| model_of(&order, set));
    Some(Finding {
        causes,
        relative_to: inputs_of(&behind.ids),
        held_out_gain: difference(&behind.held_out, &base.held_out),
        some_cause: having(&combined, |parts| !parts.is_empty()),
        tried: order.iter().map(|s| tried(s, base)).collect(),
    })
}

/// The causes of a model that show: one that costs less than a nat of score when it is taken
/// out again is none (a loss fitted as 0, a decay whose prior lets it do nothing), and a growth
/// that a factor does as well as is that factor.
fn parts(order: &[&Scored], model: &Scored) -> Vec<&'static str> {
    let mut now = model;
    loop {
        let of = |ids: &[&str]| order.iter().copied().find(|p| p.ids == ids);
        let plainer = causes_of(&now.ids).into_iter().flat_map(|id| {
            let without: Vec<&str> = now.ids.iter().copied().filter(|i| *i != id).collect();
            let factor = |i: &&'static str| factor_in(i).filter(|_| *i == id).unwrap_or(*i);
            let as_factor: Vec<&str> = now.ids.iter().map(factor).collect();
            let growth = factor_in(id).and_then(|_| of(&as_factor));
            of(&without).into_iter().chain(growth)
        });
        let nearest = plainer.max_by(|a, b| a.fit.log_score.total_cmp(&b.fit.log_score));
        match nearest {
            Some(p) if now.fit.log_score - p.fit.log_score < LEAST_SHOWN => now = p,
            _ => return causes_of(&now.ids),
        }
    }
}

/// The factor that a change of growth has in it.
fn factor_in(id: &str) -> Option<&'static str> {
    match id {
        "sigma-z-growth" => Some("sigma-z-scale"),
        "sigma-y-growth" => Some("sigma-y-scale"),
        _ => None,
    }
}

/// Every combination of causes with its probability, the most probable first; the empty one
/// stands for no cause.
fn combinations(order: &[&Scored]) -> Vec<Combination> {
    let each = order.iter().map(|s| (parts(order, s), s.probability));
    merged(each)
}

fn merged(each: impl Iterator<Item = Combination>) -> Vec<Combination> {
    let mut out: Vec<Combination> = Vec::new();
    for (parts, p) in each {
        match out.iter_mut().find(|c| c.0 == parts) {
            Some(known) => known.1 += p,
            None => out.push((parts, p)),
        }
    }
    out.sort_by(|a, b| b.1.total_cmp(&a.1));
    out
}

fn having(combined: &[Combination], which: impl Fn(&[&str]) -> bool) -> f64 {
    combined.iter().filter(|c| which(&c.0)).map(|c| c.1).sum()
}

/// Probability that `id` has a part.
fn inclusion(combined: &[Combination], id: &str) -> f64 {
    having(combined, |parts| parts.contains(&id))
}

/// Whether the data cannot do without `id`: it has a part with probability .95, and every model
/// without it has much less evidence than the best and is worse on trials left out, at the 5 %
/// level. Much less is 5 nats and a tenth of what the best gains over the base: the laws of
/// spread and loss are not known so well that a rival which gains nine tenths is out.
fn certain(order: &[&Scored], combined: &[Combination], id: &str) -> bool {
    let best = order[0];
    let behind = |s: &Scored| best.fit.log_evidence - s.fit.log_evidence;
    let gain = order
        .iter()
        .find(|s| s.ids.is_empty())
        .map_or(0.0, |s| behind(s));
    let mut without = order.iter().filter(|s| !parts(order, s).contains(&id));
    inclusion(combined, id) >= SET_PROBABILITY
        && without.all(|s| {
            let (held_out, error) = difference(&best.held_out, &s.held_out);
            behind(s) > LEAST_NATS + LAW_ERROR * gain && held_out > ONE_SIDED * error
        })
}

/// The sets of the answer. Where all parts of the most probable combination are such that the
/// data cannot do without them, each stands alone. Else one set: the union of the fewest
/// combinations that hold .95 of what is not "no cause", if some cause is likelier than none and
/// there is more than one member; one member that is not certain is left to the ranking.
/// The deviation of azimuth, once certain, is no rival of the corrections on top of it.
fn answer_sets(order: &[&Scored], mut combined: Vec<Combination>) -> Vec<Vec<&'static str>> {
    let mut ids: Vec<&'static str> = order.iter().flat_map(|s| causes_of(&s.ids)).collect();
    ids.sort_unstable();
    ids.dedup();
    ids.sort_by(|a, b| inclusion(&combined, b).total_cmp(&inclusion(&combined, a)));
    let sure: Vec<&str> = ids
        .iter()
        .copied()
        .filter(|id| certain(order, &combined, id))
        .collect();
    let mut sets = Vec::new();
    if sure.contains(&AZIMUTH) {
        sets.push(vec![AZIMUTH]);
        combined = merged(combined.into_iter().map(|(mut parts, p)| {
            parts.retain(|id| *id != AZIMUTH);
            (parts, p)
        }));
    }
    let some = having(&combined, |parts| !parts.is_empty());
    let Some((best, _)) = combined.iter().find(|c| !c.0.is_empty()) else {
        return sets;
    };
    if some <= LIKELY {
        return sets;
    }
    if best.iter().all(|id| sure.contains(id)) {
        sets.extend(best.iter().map(|id| vec![*id]));
        return sets;
    }
    let mut held = 0.0;
    let mut set: Vec<&'static str> = Vec::new();
    for (parts, p) in combined.iter().filter(|c| !c.0.is_empty()) {
        // One member alone would be a name.
        if held >= SET_PROBABILITY * some && (set.len() > 1 || some < SET_PROBABILITY) {
            break;
        }
        held += p;
        set.extend(
            parts
                .iter()
                .filter(|id| !set.contains(id))
                .collect::<Vec<_>>(),
        );
    }
    if set.len() > 1 {
        set.sort_by(|a, b| inclusion(&combined, b).total_cmp(&inclusion(&combined, a)));
        sets.push(set);
    }
    sets
}

fn tried(model: &Scored, base: &Scored) -> TriedModel {
    let (gain, error) = difference(&model.held_out, &base.held_out);
    TriedModel {
        mechanisms: model.ids.iter().map(|id| (*id).to_owned()).collect(),
        delta_log_score: model.fit.log_score - base.fit.log_score,
        delta_log_evidence: model.fit.log_evidence - base.fit.log_evidence,
        probability: model.probability,
        held_out_gain: gain,
        held_out_gain_se: error,
        parameters: parameters(model),
    }
}

/// The most probable model in which the first of the set shows.
fn model_of<'a>(order: &[&'a Scored], set: &[&'static str]) -> &'a Scored {
    let mut with = order.iter().filter(|s| parts(order, s).contains(&set[0]));
    with.next().unwrap_or(&order[0])
}

fn cause(order: &[&Scored], set: &[&'static str], base: &Scored, group: &str) -> Cause {
    let best = model_of(order, set);
    let shown = |s: &Scored| parts(order, s).iter().any(|id| set.contains(id));
    let outside = order.iter().filter(|s| !shown(s));
    let rival = outside.map(|s| s.fit.log_evidence).fold(f64::NAN, f64::max);
    let nats_to_next = best.fit.log_evidence - rival;
    // By Markov's inequality a model without the cause gives evidence e times larger to one of
    // the others with a probability of 1/e at most.
    let p_value = (order.len() as f64 * (-nats_to_next).exp()).min(1.0);
    Cause {
        mechanisms: set.iter().map(|id| (*id).to_owned()).collect(),
        probability: order
            .iter()
            .filter(|s| shown(s))
            .map(|s| s.probability)
            .sum(),
        evidence: Evidence {
            delta_log_score: best.fit.log_score - base.fit.log_score,
            delta_log_evidence: best.fit.log_evidence - base.fit.log_evidence,
            p_value,
        },
        parameters: parameters(best),
        settings: Vec::new(),
        onset_s: None,
        platforms: vec![group.to_owned()],
        nats_to_next,
    }
}
