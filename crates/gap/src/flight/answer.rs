//! From the last view of the data to causes: sets that the data cannot tell apart, and what has no
//! name.

use fdm::mechanism::{CATALOGUE, Mechanism, spec};
use statrs::distribution::{ChiSquared, ContinuousCDF};

use super::evidence::{Candidate, Fit, sum};
use super::parameters::Effect;
use super::study::{Linear, Study};
use crate::verdict::{
    BaseParameter, Cause, Detectable, Evidence, Parameter, Ranked, Unexplained, UnexplainedKind,
    Verdict,
};

/// Probability of so large a score by chance, over all candidates, that a cause may have.
const LARGEST_P: f64 = 0.01;
/// Nats at which an effect is seen almost surely.
const VISIBLE_NATS: f64 = 20.0;
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

fn name(study: &Study<'_>, candidate: usize) -> String {
    if study.is_named(candidate) {
        study.ids[candidate].to_owned()
    } else {
        study.terms.groups[candidate - study.ids.len()].words()
    }
}

fn fit(study: &Study<'_>, last: &Linear, set: &[usize]) -> Fit {
    let chosen: Vec<&Candidate> = set.iter().map(|&k| &study.candidates[k]).collect();
    last.word.fit(&chosen)
}

/// Judges the last view.
pub fn judge(study: &Study<'_>, last: &Linear) -> Answer {
    let best = &last.models[0];
    let mut causes = Vec::new();
    let mut unexplained: Option<Unexplained> = None;
    let mut set = Vec::new();
    for &item in &best.set {
        let rest: Vec<usize> = best.set.iter().copied().filter(|&k| k != item).collect();
        let without = fit(study, last, &rest);
        let gain = best.fit.log_score - without.log_score;
        let columns = study.candidates[item].columns.len();
        let (columns, tried) = if study.has_late(&[item]) {
            // Its onset is one number more, and could be at so many times.
            let times = (study.flown_s() / ONSETS_APART_S).max(1.0);
            (columns + 1, study.candidates.len() * times as usize)
        } else {
            (columns, study.candidates.len())
        };
        let evidence = Evidence {
            delta_log_score: gain,
            delta_log_evidence: best.fit.log_evidence - without.log_evidence,
            p_value: p_value(gain, columns, tried),
        };
        if evidence.p_value > LARGEST_P {
            continue;
        }
        set.push(item);
        let rivals = in_place_of(study, last, &rest);
        if study.is_named(rivals[0].0) {
            causes.push(cause(study, last, evidence, &rivals));
            continue;
        }
        let found = nameless(study, last, rivals[0].0, evidence.delta_log_evidence);
        let stronger = |u: &Unexplained| u.delta_log_evidence < found.delta_log_evidence;
        if unexplained.as_ref().is_none_or(stronger) {
            unexplained = Some(found);
        }
    }
    causes.sort_by(|a, b| {
        b.evidence
            .delta_log_evidence
            .total_cmp(&a.evidence.delta_log_evidence)
    });
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
    let mut rivals: Vec<(usize, f64)> = (0..study.candidates.len())
        .filter(|k| !rest.contains(k))
        .map(|k| {
            let mut other = rest.to_vec();
            other.push(k);
            let evidence = fit(study, last, &other).log_evidence;
            (k, evidence + study.candidates[k].log_prior)
        })
        .collect();
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
    let mut mechanisms = Vec::new();
    for &(k, value) in rivals.iter().filter(|r| study.is_named(r.0)) {
        if probability >= named || weight(value) / total < 0.01 {
            break;
        }
        probability += weight(value) / total;
        let id = study.ids[k].to_owned();
        if !mechanisms.contains(&id) {
            mechanisms.push(id);
        }
    }
    let inside =
        |k: usize| study.is_named(k) && mechanisms.iter().any(|m| m.as_str() == study.ids[k]);
    let next = rivals.iter().find(|r| !inside(r.0));
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
    let mut fits: Vec<(usize, f64, f64)> = (0..study.candidates.len())
        .map(|k| {
            let fit = last.word.fit(&[&study.candidates[k]]);
            (k, fit.log_score, fit.log_evidence)
        })
        .collect();
    fits.sort_by(|a, b| b.2.total_cmp(&a.2));
    let top = fits[0].2;
    let total: f64 = fits.iter().map(|f| (f.2 - top).exp()).sum();
    fits.into_iter()
        .map(|(k, score, evidence)| Ranked {
            mechanisms: vec![name(study, k)],
            platform: None,
            delta_log_score: score,
            log_evidence: evidence,
            probability: (evidence - top).exp() / total,
        })
        .collect()
}

/// Where a nameless term lives: the block in which it gains most, with its neighbours that gain.
fn nameless(study: &Study<'_>, last: &Linear, candidate: usize, evidence: f64) -> Unexplained {
    let group = &study.terms.groups[candidate - study.ids.len()];
    let columns = &study.candidates[candidate].columns;
    let fit = last.word.fit(&[&study.candidates[candidate]]);
    let gains: Vec<f64> = last
        .blocks
        .iter()
        .map(|block| {
            let mut gain = 0.0;
            for (i, &j) in columns.iter().enumerate() {
                gain += fit.values[i] * block.b[j];
                for (k, &l) in columns.iter().enumerate() {
                    gain -= 0.5 * fit.values[i] * fit.values[k] * block.a[(j, l)];
                }
            }
            gain
        })
        .collect();
    let strongest = (0..gains.len())
        .max_by(|&a, &b| gains[a].total_cmp(&gains[b]))
        .unwrap_or(0);
    let (mut from, mut to) = (strongest, strongest);
    while from > 0 && gains[from - 1] > 0.2 * gains[strongest] {
        from -= 1;
    }
    while to + 1 < gains.len() && gains[to + 1] > 0.2 * gains[strongest] {
        to += 1;
    }
    Unexplained {
        kind: UnexplainedKind::Discrepancy,
        coordinate: group.coordinate.as_str().to_owned(),
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
    let mut set = set.to_vec();
    if !set.contains(&of) {
        set.push(of);
    }
    let (a, b) = sum(&last.blocks, None);
    let (values, covariance) =
        study.posterior(&(a / last.dispersion), &(b / last.dispersion), &set);
    study.candidates[of]
        .columns
        .iter()
        .filter_map(|&j| {
            // From an onset on what was there before stays.
            let (before, m, k) = match study.parameters[j].effect {
                Effect::Mechanism(m, k) => (None, m, k),
                Effect::Later(place, m, k) => (Some(place), m, k),
                _ => return None,
            };
            let of = |i: usize| covariance[(i, i)] + 2.0 * covariance[(i, j)];
            let variance = covariance[(j, j)] + before.map_or(0.0, of);
            let p = &CATALOGUE[m].parameters[k];
            let value = values[j] + before.map_or(0.0, |i| values[i]);
            Some(Parameter {
                mechanism: CATALOGUE[m].id.to_owned(),
                name: p.name.to_owned(),
                value: (p.neutral + value).clamp(p.low, p.high),
                sd: variance.sqrt().hypot(study.parameters[j].law_sd),
                unit: p.unit.to_owned(),
            })
        })
        .collect()
}

/// The fitted base: tolerances that moved, and the winds.
pub fn base(study: &Study<'_>, last: &Linear, set: &[usize]) -> Vec<BaseParameter> {
    let (a, b) = sum(&last.blocks, None);
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
                value: (2.0 * VISIBLE_NATS / information).sqrt(),
                unit: p.unit.to_owned(),
            })
        })
        .collect()
}

/// The mechanisms of the first name of each cause, for an aircraft file: as they are once all have set in.
pub fn extension(causes: &[Cause]) -> Vec<Mechanism> {
    let later = |cause: &Cause| {
        let same = causes
            .iter()
            .filter(|c| c.mechanisms.first() == cause.mechanisms.first());
        cause.onset_s.is_none() && same.into_iter().any(|c| c.onset_s.is_some())
    };
    causes
        .iter()
        .filter(|cause| !later(cause))
        .filter_map(|cause| {
            let id = cause.mechanisms.first()?;
            let spec = spec(id)?;
            let values: Vec<f64> = spec
                .parameters
                .iter()
                .map(|p| {
                    let fitted = cause.parameters.iter().find(|f| f.name == p.name);
                    fitted.map_or(p.neutral, |f| f.value)
                })
                .collect();
            Mechanism::with_values(id, &values).ok()
        })
        .collect()
}
