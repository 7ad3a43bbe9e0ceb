//! From the last view of the data to causes: sets that the data cannot tell apart, and what has no
//! name.

use fdm::mechanism::{CATALOGUE, Mechanism, ParameterSpec, spec};
use nalgebra::DVector;
use statrs::distribution::{ChiSquared, ContinuousCDF};

use super::evidence::{Kind, Model, sum};
use super::normal::Block;
use super::parameters::Effect;
use super::study::{Linear, Study};
use crate::statistics::probabilities;
use crate::verdict::{
    BaseParameter, Cause, DETECTABLE_NATS, Detectable, Evidence, Parameter, Ranked, Unexplained,
    UnexplainedKind, Verdict,
};

/// Explanations less probable than this are rejected, 99 to 1 as in [`infer::Policy::rest_nats`]: chance, by the p-value over all
/// candidates and onsets, and a rival cause, by its share among its rivals.
const REJECTED_P: f64 = 0.01;
/// Blocks that gain more than this part of the strongest block's gain belong to the interval of an unnamed term. Gain grows with
/// the square of the term's size, so the interval is where the term has at least half of its largest size.
const HALF_SIZE_GAIN: f64 = 0.25;
/// Times so far apart are different onsets, s: nearer ones the readings tell apart only by the answer of speed and attitude, which
/// takes about as long.
const ONSETS_APART_S: f64 = 2.0;
/// Nats for each of which the evidence is taken to be a hundredth less sure: no law of the
/// catalogue is exactly that of the aircraft.
const NATS_PER_DOUBT: f64 = 60.0;

/// What the data came to.
pub struct Answer {
    /// The word.
    pub verdict: Verdict,
    /// Causes, the strongest first.
    pub causes: Vec<Cause>,
    /// Candidates alone, the best first.
    pub ranking: Vec<Ranked>,
    /// What has no name.
    pub unexplained: Option<Unexplained>,
    /// Places of the candidates that were added.
    pub set: Vec<usize>,
}

/// Probability of a gain of `nats` by `columns` free parameters, the best of `tried`, by chance.
pub(super) fn p_value(nats: f64, columns: usize, tried: usize) -> f64 {
    let tail = ChiSquared::new(columns as f64).map_or(1.0, |c| c.sf(2.0 * nats.max(0.0)));
    (tail * tried as f64).min(1.0)
}

/// Judges the last view.
pub fn judge(study: &Study<'_>, last: &Linear) -> Answer {
    let best = &last.models[0];
    let mut causes = Vec::new();
    let mut unexplained: Option<Unexplained> = None;
    let mut set = Vec::new();
    for &item in &best.set {
        let rest: Vec<usize> = best.set.iter().copied().filter(|&k| k != item).collect();
        let without = last.word.model(&study.candidates, rest.clone(), 0.0);
        let gain = best.log_score - without.log_score;
        // An onset is one number more, and could be at so many times.
        let (more, times) = if study.has_late(&[item]) {
            (1, (study.flown_s() / ONSETS_APART_S).max(1.0) as usize)
        } else {
            (0, 1)
        };
        let columns = study.candidates[item].columns.len() + more;
        let evidence = Evidence {
            delta_log_score: gain,
            delta_log_evidence: best.log_evidence - without.log_evidence,
            p_value: p_value(gain, columns, study.candidates.len() * times),
        };
        if evidence.p_value > REJECTED_P {
            continue;
        }
        set.push(item);
        let rivals = in_place_of(study, last, &rest);
        if let Kind::Nameless(group) = study.candidates[rivals[0].0].kind {
            let found = nameless(
                study,
                last,
                (rivals[0].0, group),
                evidence.delta_log_evidence,
            );
            let stronger = |u: &Unexplained| u.delta_log_evidence < found.delta_log_evidence;
            if unexplained.as_ref().is_none_or(stronger) {
                unexplained = Some(found);
            }
        } else {
            causes.push(cause(study, last, evidence, &rivals));
        }
    }
    let strength = |c: &Cause| c.evidence.delta_log_evidence;
    causes.sort_by(|a, b| strength(b).total_cmp(&strength(a)));
    causes.dedup_by(|b, a| a.mechanisms == b.mechanisms && a.onset_s == b.onset_s);
    Answer {
        verdict: Verdict::of(&causes, unexplained.is_some()),
        causes,
        ranking: ranking(study, last),
        unexplained,
        set,
    }
}

/// Every candidate beside `rest`, with the log evidence and prior that it brings; the best first.
fn in_place_of(study: &Study<'_>, last: &Linear, rest: &[usize]) -> Vec<(usize, f64)> {
    let evidence = |k: usize| {
        let other = [rest, &[k]].concat();
        last.word.model(&study.candidates, other, 0.0).log_evidence
    };
    let others = (0..study.candidates.len()).filter(|k| !rest.contains(k));
    let judged = others.map(|k| (k, evidence(k) + study.candidates[k].log_prior));
    let mut rivals: Vec<(usize, f64)> = judged.collect();
    rivals.sort_by(|a, b| b.1.total_cmp(&a.1));
    rivals
}

/// The set of what may stand in one place, by the evidence of its `rivals`.
fn cause(study: &Study<'_>, last: &Linear, evidence: Evidence, rivals: &[(usize, f64)]) -> Cause {
    let doubt = (1.0 + evidence.delta_log_evidence.max(0.0) / NATS_PER_DOUBT).sqrt();
    let (first, top) = rivals[0];
    let named = infer::Policy::default().named;
    let weight = |v: f64| ((v - top) / doubt).exp();
    let total: f64 = rivals.iter().map(|r| weight(r.1)).sum();
    let mut probability = 0.0;
    let mut mechanisms: Vec<String> = Vec::new();
    for &(k, value) in rivals.iter().filter(|r| study.candidates[r.0].is_named()) {
        if probability >= named || weight(value) / total < REJECTED_P {
            break;
        }
        probability += weight(value) / total;
        let name = &study.candidates[k].name;
        if !mechanisms.contains(name) {
            mechanisms.push(name.clone());
        }
    }
    let next = rivals
        .iter()
        .find(|r| !mechanisms.contains(&study.candidates[r.0].name));
    Cause {
        parameters: parameters(study, last, &last.models[0].set, first),
        probability,
        evidence,
        platforms: Vec::new(),
        settings: Vec::new(),
        onset_s: study.onset_s.filter(|_| study.has_late(&[first])),
        nats_to_next: next.map_or(f64::NAN, |n| top - n.1),
        mechanisms,
    }
}

/// Every candidate alone, as seen from the last view.
fn ranking(study: &Study<'_>, last: &Linear) -> Vec<Ranked> {
    let alone = |k: usize| last.word.model(&study.candidates, vec![k], 0.0);
    let mut fits: Vec<Model> = (0..study.candidates.len()).map(alone).collect();
    fits.sort_by(|a, b| b.log_evidence.total_cmp(&a.log_evidence));
    let evidences: Vec<f64> = fits.iter().map(|f| f.log_evidence).collect();
    let ranked = |(f, probability): (&Model, f64)| Ranked {
        mechanisms: vec![study.candidates[f.set[0]].name.clone()],
        platform: None,
        delta_log_score: f.log_score,
        log_evidence: f.log_evidence,
        probability,
    };
    let each = fits.iter().zip(probabilities(&evidences));
    each.map(ranked).collect()
}

/// Where a nameless term lives: the block in which it gains most, with its neighbours that gain.
fn nameless(
    study: &Study<'_>,
    last: &Linear,
    (candidate, group): (usize, usize),
    evidence: f64,
) -> Unexplained {
    let fit = last.word.model(&study.candidates, vec![candidate], 0.0);
    let mut values = DVector::zeros(study.width());
    for (&j, value) in study.candidates[candidate].columns.iter().zip(&fit.values) {
        values[j] = *value;
    }
    let gain = |block: &Block| values.dot(&block.b) - 0.5 * values.dot(&(&block.a * &values));
    let gains: Vec<f64> = last.blocks.iter().map(gain).collect();
    let most = gains.iter().copied().fold(f64::MIN, f64::max);
    let strongest = gains.iter().position(|g| *g == most).unwrap_or(0);
    let gains_too = |k: &usize| gains[*k] > HALF_SIZE_GAIN * most;
    let from = (0..strongest).rev().take_while(gains_too).last();
    let to = (strongest + 1..gains.len()).take_while(gains_too).last();
    let (from, to) = (from.unwrap_or(strongest), to.unwrap_or(strongest));
    let group = &study.terms.groups[group];
    Unexplained {
        kind: UnexplainedKind::Discrepancy,
        coordinate: group.coordinate().to_owned(),
        term: group.words(),
        from_s: last.blocks[from].from_s,
        to_s: last.blocks[to].to_s,
        platforms: Vec::new(),
        delta_log_evidence: evidence,
        candidates: Vec::new(),
    }
}

/// Fitted parameters of one mechanism when `set` is at work. Their deviations have the whole
/// dispersion: what chance may have added to it is as likely not chance.
fn parameters(study: &Study<'_>, last: &Linear, set: &[usize], of: usize) -> Vec<Parameter> {
    let (a, b) = sum(&last.blocks);
    let (a, b) = (a / last.dispersion, b / last.dispersion);
    let with = if set.contains(&of) {
        set.to_vec()
    } else {
        [set, &[of]].concat()
    };
    let (values, covariance) = study.posterior(&a, &b, &with);
    study.candidates[of]
        .columns
        .iter()
        .filter_map(|&j| {
            // From an onset on what was there before stays.
            let before = j.checked_sub(study.first_late());
            let parameter = &study.parameters[before.unwrap_or(j)];
            let Effect::Mechanism(m, k) = parameter.effect else {
                return None;
            };
            let of = |i: usize| covariance[(i, i)] + 2.0 * covariance[(i, j)];
            let variance = covariance[(j, j)] + before.map_or(0.0, of);
            let p = &CATALOGUE[m].parameters[k];
            let value = values[j] + before.map_or(0.0, |i| values[i]);
            Some(Parameter {
                mechanism: CATALOGUE[m].id.to_owned(),
                name: p.name.to_owned(),
                value: (p.neutral + value).clamp(p.low, p.high),
                sd: variance.sqrt().hypot(parameter.law_sd),
                unit: p.unit.to_owned(),
            })
        })
        .collect()
}

/// The fitted base: tolerances that moved, and the winds.
pub fn base(study: &Study<'_>, last: &Linear, set: &[usize]) -> Vec<BaseParameter> {
    let (a, b) = sum(&last.blocks);
    let (values, covariance) = study.posterior(&a, &b, set);
    study
        .parameters
        .iter()
        .enumerate()
        .filter(|(_, p)| p.prior_sd.is_none())
        .map(|(j, p)| BaseParameter {
            platform: None,
            name: p.name.clone(),
            value: values[j],
            sd: covariance[(j, j)].sqrt(),
            prior: p.tolerance,
        })
        .collect()
}

/// The smallest effect of each parameter that these data could have shown.
pub fn detectable(study: &Study<'_>, last: &Linear) -> Vec<Detectable> {
    study
        .parameters
        .iter()
        .enumerate()
        .filter_map(|(j, p)| {
            let Effect::Mechanism(m, k) = p.effect else {
                return None;
            };
            let information = last.word.s[(j, j)];
            (information > 0.0).then(|| Detectable {
                mechanism: CATALOGUE[m].id.to_owned(),
                parameter: CATALOGUE[m].parameters[k].name.to_owned(),
                value: (2.0 * DETECTABLE_NATS / information).sqrt(),
                unit: p.unit.to_owned(),
            })
        })
        .collect()
}

/// The mechanisms of the first name of each cause, for an aircraft file: as they are once all have set in.
pub fn extension(causes: &[Cause]) -> Vec<Mechanism> {
    let is_replaced = |cause: &Cause| {
        let mut same = causes
            .iter()
            .filter(|c| c.mechanisms.first() == cause.mechanisms.first());
        cause.onset_s.is_none() && same.any(|c| c.onset_s.is_some())
    };
    let mechanism = |cause: &Cause| {
        let id = cause.mechanisms.first()?;
        let value = |p: &ParameterSpec| {
            let fitted = cause.parameters.iter().find(|f| f.name == p.name);
            fitted.map_or(p.neutral, |f| f.value)
        };
        let values: Vec<f64> = spec(id)?.parameters.iter().map(value).collect();
        Mechanism::with_values(id, &values).ok()
    };
    let kept = causes.iter().filter(|cause| !is_replaced(cause));
    kept.filter_map(mechanism).collect()
}
