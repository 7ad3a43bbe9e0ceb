//! From scored models to causes: which changes the data ask for, which they cannot tell apart,
//! and how sure that is over trials.

use serde::Serialize;
use statrs::distribution::{ContinuousCDF, Normal};

use super::evidence::Fit;
use super::model::PIVOT_M;
use super::trial_scores::{Scored, difference};
use crate::verdict::{Cause, Evidence, Parameter};

/// Changes that stand for a choice of input and not for a cause.
const INPUTS: [&str; 2] = ["wind-at-plume-height", "spread-by-obukhov-length"];
/// Nats of evidence over the base below which nothing is found: some thirty models are tried.
const LEAST_NATS: f64 = 5.0;
/// Probability that a set of causes must hold.
const SET_PROBABILITY: f64 = 0.95;
/// Standard errors of a one-sided test at the 5 % level.
const ONE_SIDED: f64 = 1.645;
/// Probability below which a mechanism has no part in a set.
const LEAST_PART: f64 = 0.05;

/// A model that was tried on a group of trials.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct TriedModel {
    /// Its changes; empty for Briggs with the wind as measured.
    pub mechanisms: Vec<String>,
    /// Gain of the log score over the base, nats.
    pub delta_log_score: f64,
    /// Gain of the log evidence over the base, nats.
    pub delta_log_evidence: f64,
    /// Probability among the models tried.
    pub probability: f64,
    /// Gain over the base on trials left out, nats.
    pub held_out_gain: f64,
    /// Its standard error over trials, nats.
    pub held_out_gain_se: f64,
    /// Fitted parameters.
    pub parameters: Vec<Parameter>,
}

/// What a question (vertical or lateral, in one kind of air) came to.
pub struct Finding {
    /// The causes; none where the base does.
    pub causes: Vec<Cause>,
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

/// Judges the scored models of one question; `group` names the kind of air.
pub fn judge(scored: &[(usize, Scored)], group: &str) -> Option<Finding> {
    let mut order: Vec<&Scored> = scored.iter().map(|s| &s.1).collect();
    order.sort_by(|a, b| b.probability.total_cmp(&a.probability));
    let base = order.iter().find(|s| s.ids.is_empty())?;
    let best = order.first()?;
    let gain = best.fit.log_evidence - base.fit.log_evidence;
    let sets = if gain > LEAST_NATS {
        answer_sets(&order)
    } else {
        Vec::new()
    };
    let causes = sets
        .iter()
        .map(|set| cause(&order, set, base, group))
        .collect();
    let tried = order.iter().map(|s| tried(s, base)).collect();
    Some(Finding { causes, tried })
}

/// Probability that the true model has one of `ids`.
fn inclusion(order: &[&Scored], ids: &[&str]) -> f64 {
    let has = |s: &&&Scored| s.ids.iter().any(|id| ids.contains(id));
    order.iter().filter(has).map(|s| s.probability).sum()
}

/// The mechanisms of the answer. Each that the data cannot do without stands alone: it is in the true
/// model with 95 %, and every model without it is worse on trials left out, at the 5 % level. Else all that have a part in it: a probability of 5 %, and a gain of a nat in score
/// over the same model without (so that a change whose prior lets it do nothing has none).
fn answer_sets(order: &[&Scored]) -> Vec<Vec<&'static str>> {
    let best = order[0];
    let mut ids: Vec<&'static str> = order.iter().flat_map(|s| causes_of(&s.ids)).collect();
    ids.sort_unstable();
    ids.dedup();
    ids.sort_by(|a, b| inclusion(order, &[*b]).total_cmp(&inclusion(order, &[*a])));
    let cannot_do_without = |id: &&&'static str| {
        inclusion(order, &[**id]) >= SET_PROBABILITY
            && order.iter().filter(|s| !s.ids.contains(*id)).all(|s| {
                let (behind, error) = difference(&best.held_out, &s.held_out);
                behind > ONE_SIDED * error
            })
    };
    let alone: Vec<Vec<&'static str>> = ids
        .iter()
        .filter(cannot_do_without)
        .map(|id| vec![*id])
        .collect();
    if !alone.is_empty() {
        return alone;
    }
    let shows = |id: &&'static str| {
        order.iter().filter(|s| s.ids.contains(id)).any(|s| {
            let rest: Vec<&str> = s.ids.iter().copied().filter(|other| other != id).collect();
            let plain = order.iter().find(|p| p.ids == rest);
            plain.is_some_and(|p| s.fit.log_score - p.fit.log_score > 1.0)
        })
    };
    let has_a_part = |id: &&&'static str| inclusion(order, &[**id]) >= LEAST_PART && shows(id);
    let set: Vec<&'static str> = ids.iter().filter(has_a_part).copied().collect();
    if set.is_empty() {
        Vec::new()
    } else {
        vec![set]
    }
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
        parameters: parameters(&model.ids, &model.fit),
    }
}

fn cause(order: &[&Scored], set: &[&'static str], base: &Scored, group: &str) -> Cause {
    // The most probable model that has the first of the set.
    let with = order.iter().find(|s| s.ids.contains(&set[0]));
    let best = with.copied().unwrap_or(order[0]);
    let outside = order
        .iter()
        .filter(|s| !s.ids.iter().any(|id| set.contains(id)));
    let rival = outside.map(|s| s.fit.log_evidence).fold(f64::NAN, f64::max);
    let (gain, error) = difference(&best.held_out, &base.held_out);
    let p_value = Normal::new(0.0, 1.0).map_or(f64::NAN, |n| n.cdf(-gain / error.max(1e-9)));
    Cause {
        mechanisms: set.iter().map(|id| (*id).to_owned()).collect(),
        probability: inclusion(order, set),
        evidence: Evidence {
            delta_log_score: best.fit.log_score - base.fit.log_score,
            delta_log_evidence: best.fit.log_evidence - base.fit.log_evidence,
            p_value,
        },
        parameters: parameters(&best.ids, &best.fit),
        platforms: vec![group.to_owned()],
        nats_to_next: best.fit.log_evidence - rival,
    }
}

/// Parameters in the catalogue's words: a change of growth turns about 1 km there, so its level
/// is written as the factor at 1 km.
pub fn parameters(ids: &[&'static str], fit: &Fit) -> Vec<Parameter> {
    let mut out = Vec::new();
    let mut k = 0;
    let mut push = |mechanism: &str, name: &str, value: f64, sd: f64, unit: &str| {
        out.push(Parameter {
            mechanism: mechanism.to_owned(),
            name: name.to_owned(),
            value,
            sd,
            unit: unit.to_owned(),
        });
    };
    for &id in ids {
        let sd = |i: usize| fit.covariance[(i, i)].sqrt();
        match id {
            "sigma-z-growth" | "sigma-y-growth" => {
                let lever = (1000.0 / PIVOT_M).ln();
                let log = fit.theta[k] + lever * fit.theta[k + 1];
                let c = &fit.covariance;
                let variance =
                    c[(k, k)] + 2.0 * lever * c[(k, k + 1)] + lever * lever * c[(k + 1, k + 1)];
                let scale = if id == "sigma-z-growth" {
                    "sigma-z-scale"
                } else {
                    "sigma-y-scale"
                };
                push(id, "exponent", fit.theta[k + 1], sd(k + 1), "1");
                push(scale, "factor", log.exp(), log.exp() * variance.sqrt(), "1");
                k += 2;
            }
            "sigma-z-scale" | "sigma-y-scale" => {
                let factor = fit.theta[k].exp();
                push(id, "factor", factor, factor * sd(k), "1");
                k += 1;
            }
            "dry-deposition" => {
                push(id, "velocity_m_s", fit.theta[k].max(0.0), sd(k), "m/s");
                k += 1;
            }
            "first-order-decay" => {
                push(id, "rate_per_s", fit.theta[k].max(0.0), sd(k), "1/s");
                k += 1;
            }
            _ => {}
        }
    }
    out
}
