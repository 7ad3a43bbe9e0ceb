//! The answer in the words of `gap.json`: parameters, the ranking, and where a nameless rest lives.

use ::plume::mechanism::{Coordinate, MechanismId};

use super::data::Setup;
use super::explore::Round;
use super::fit::{Context, Fitted};
use super::rival::Rival;
use crate::verdict::{Parameter, Ranked, Unexplained};

/// What the stated standard deviations are wider by than the curvature at the best fit says. The
/// noise's own uncertainty and the tail of nonlinear parameters are not in it: without a factor
/// 95 % intervals cover 85 % of the benchmark's truths, with one of 1.35 they cover 91 %.
pub(crate) const SD_FACTOR: f64 = 1.5;

/// Parameters of a part with their standard deviations. An uncertain time constant is fitted as a
/// whole; what is said of it as a cause is by how much it is more than the scenario's.
pub(crate) fn parameters(setup: &Setup, fitted: &Fitted, part: usize) -> Vec<Parameter> {
    let stated = setup.priors.get(part);
    let whole = stated.filter(|p| p.id == MechanismId::SensorLag);
    let counted_from = whole.map_or(0.0, |p| p.value);
    let mut out = Vec::new();
    for (k, free) in fitted.model.free.iter().enumerate() {
        if free.part != part {
            continue;
        }
        let spec = fitted.model.spec_of(k);
        let value = fitted.model.parts[part].values[free.parameter];
        let sd = SD_FACTOR * fitted.posterior.covariance[(k, k)].max(0.0).sqrt();
        let sd = sd.hypot(free.chance_sd);
        out.push(Parameter {
            mechanism: fitted.model.parts[part].id.as_str().to_string(),
            name: spec.name.to_string(),
            value: value - counted_from,
            sd: if spec.coordinate == Coordinate::Log {
                sd * value
            } else {
                sd
            },
            unit: spec.unit.to_string(),
        });
    }
    out
}

/// Every mechanism tried in the first round on top of `base`, with its best score.
pub(crate) fn ranking(ctx: &Context<'_>, base: &Fitted, round: &Round) -> Vec<Ranked> {
    let name = |p: Option<usize>| p.map(|p| ctx.data.track.platforms()[p].clone());
    let mut out: Vec<Ranked> = round
        .probabilities(|evidence, _| evidence)
        .map(|(t, probability)| Ranked {
            mechanisms: vec![t.id.as_str().to_string()],
            platform: name(t.platform),
            delta_log_score: t.log_score,
            log_evidence: t.log_evidence,
            probability,
        })
        .collect();
    let mut rest: Vec<Ranked> = Vec::new();
    let widened = round.equations.score_widened();
    let of_base = widened.iter().map(|s| (base.model.id_of(s.start), s));
    let screened = round.screened.iter().map(|(id, s)| (*id, s));
    for (id, s) in screened.chain(of_base) {
        let known = |r: &Ranked| r.mechanisms[0] == id.as_str() && r.platform == name(s.platform);
        if out.iter().any(known) {
            continue;
        }
        let entry = Ranked {
            mechanisms: vec![id.as_str().to_string()],
            platform: name(s.platform),
            delta_log_score: s.gain,
            log_evidence: s.log_evidence,
            probability: 0.0,
        };
        match rest.iter_mut().find(|r| known(r)) {
            Some(r) if r.log_evidence < entry.log_evidence => *r = entry,
            Some(_) => {}
            None => rest.push(entry),
        }
    }
    out.append(&mut rest);
    out.sort_by(|a, b| {
        b.probability
            .total_cmp(&a.probability)
            .then(b.log_evidence.total_cmp(&a.log_evidence))
    });
    out
}

/// A nameless rival with the stretch and the platforms that show it.
pub(crate) fn unexplained(ctx: &Context<'_>, rival: &Rival) -> Unexplained {
    // The stretch that holds the middle four fifths of what the term explains.
    let times = ctx.data.track.time_s();
    let mut order: Vec<usize> = (0..times.len()).collect();
    order.sort_by(|a, b| times[*a].total_cmp(&times[*b]));
    let total: f64 = rival.fitted.iter().map(|v| v * v).sum();
    let (mut sum, mut from_s, mut to_s) = (0.0, f64::NAN, f64::NAN);
    let mut by_platform = vec![0.0; ctx.data.ranges().len()];
    for i in order {
        let v = rival.fitted[i] * rival.fitted[i];
        by_platform[ctx.data.platform_of(i)] += v;
        sum += v;
        if from_s.is_nan() && sum > 0.1 * total {
            from_s = times[i];
        }
        if to_s.is_nan() && sum >= 0.9 * total {
            to_s = times[i];
        }
    }
    let names = ctx.data.track.platforms();
    let platforms = match rival.platform {
        Some(p) => vec![names[p].clone()],
        None => (0..names.len())
            .filter(|p| by_platform[*p] > 0.1 * total)
            .map(|p| names[p].clone())
            .collect(),
    };
    Unexplained {
        coordinate: rival.coordinate.to_string(),
        term: rival.words.clone(),
        from_s,
        to_s,
        platforms,
        delta_log_evidence: rival.log_evidence,
    }
}
