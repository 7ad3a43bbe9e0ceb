//! From scored models to causes: which changes the data ask for, which they cannot tell apart,
//! and how sure that is over trials.

use std::collections::BTreeSet;

use serde::Serialize;
use statrs::distribution::{ContinuousCDF, Normal};

use super::evidence::Fit;
use super::model::PIVOT_M;
use super::trial_scores::{Scored, difference};
use crate::verdict::{Cause, Evidence, Parameter};

/// Changes that stand for a choice of input and not for a cause.
const INPUTS: [&str; 1] = ["wind-at-plume-height"];
/// Nats of evidence over the base below which nothing is found.
const LEAST_NATS: f64 = 3.0;
/// Probability that a set of causes must hold.
const SET_PROBABILITY: f64 = 0.95;

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
    /// The cause; none where the base does.
    pub cause: Option<Cause>,
    /// All models, the most probable first.
    pub tried: Vec<TriedModel>,
    /// Index of the best model among those given.
    pub best: usize,
}

/// Changes of a model that are causes.
fn causes_of(ids: &[&'static str]) -> Vec<&'static str> {
    ids.iter().copied().filter(|id| !INPUTS.contains(id)).collect()
}

/// Whether the model's causes gain over the same inputs without them, on trials left out.
fn earns(scored: &[(usize, Scored)], model: &Scored) -> bool {
    let inputs: Vec<&str> = model.ids.iter().copied().filter(|id| INPUTS.contains(id)).collect();
    let plain = scored.iter().map(|s| &s.1).find(|s| s.ids == inputs);
    plain.is_none_or(|plain| difference(&model.held_out, &plain.held_out).0 > 1.0)
}

/// Judges the scored models of one question; `group` names the kind of air. `owner` says which
/// of a model's changes is at issue: `None` takes all that are causes.
pub fn judge(scored: &[(usize, Scored)], group: &str) -> Option<Finding> {
    let mut order: Vec<&(usize, Scored)> = scored.iter().collect();
    order.sort_by(|a, b| b.1.probability.total_cmp(&a.1.probability));
    let base = &scored.iter().find(|s| s.1.ids.is_empty())?.1;
    let tried = order.iter().map(|s| tried(&s.1, base)).collect();
    let best = order.first()?;
    let found = best.1.fit.log_evidence - base.fit.log_evidence > LEAST_NATS
        && !causes_of(&best.1.ids).is_empty();
    let cause = if found { Some(cause(scored, &best.1, base, group)) } else { None };
    Some(Finding { cause, tried, best: best.0 })
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

fn cause(scored: &[(usize, Scored)], best: &Scored, base: &Scored, group: &str) -> Cause {
    // The set: models in order of probability until 95 % are in, and those that are not worse on
    // trials left out by two standard errors; each must earn its place over its own inputs.
    let mut order: Vec<&Scored> = scored.iter().map(|s| &s.1).collect();
    order.sort_by(|a, b| b.probability.total_cmp(&a.probability));
    let mut set: Vec<&'static str> = causes_of(&best.ids);
    let mut sum = 0.0;
    for model in &order {
        let needed = sum < SET_PROBABILITY;
        sum += model.probability;
        let (behind, error) = difference(&best.held_out, &model.held_out);
        let plausible = needed || behind < 2.0 * error;
        // A model that is less probable than the base has no claim.
        let above = model.fit.log_evidence > base.fit.log_evidence;
        if plausible && above && earns(scored, model) {
            for id in causes_of(&model.ids) {
                if !set.contains(&id) {
                    set.push(id);
                }
            }
        }
    }
    let members: BTreeSet<&str> = set.iter().copied().collect();
    let inside = |m: &Scored| {
        let own = causes_of(&m.ids);
        !own.is_empty() && own.iter().all(|id| members.contains(id))
    };
    let top_outside =
        order.iter().filter(|m| !inside(m)).map(|m| m.fit.log_evidence).fold(f64::NAN, f64::max);
    let (gain, error) = difference(&best.held_out, &base.held_out);
    let p_value = Normal::new(0.0, 1.0).map_or(f64::NAN, |n| n.cdf(-gain / error.max(1e-9)));
    Cause {
        mechanisms: set.iter().map(|id| (*id).to_owned()).collect(),
        probability: order.iter().filter(|m| inside(m)).map(|m| m.probability).sum(),
        evidence: Evidence {
            delta_log_score: best.fit.log_score - base.fit.log_score,
            delta_log_evidence: best.fit.log_evidence - base.fit.log_evidence,
            p_value,
        },
        parameters: parameters(&best.ids, &best.fit),
        platforms: vec![group.to_owned()],
        nats_to_next: best.fit.log_evidence - top_outside,
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
                let variance = c[(k, k)]
                    + 2.0 * lever * c[(k, k + 1)]
                    + lever * lever * c[(k + 1, k + 1)];
                let scale = if id == "sigma-z-growth" { "sigma-z-scale" } else { "sigma-y-scale" };
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
