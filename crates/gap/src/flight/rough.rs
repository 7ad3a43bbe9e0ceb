//! What may be said where the whole fits roughly: names then follow tests that need no model of
//! the rest, and sizes that nothing real has are not said.

use fdm::mechanism::spec;

use super::answer::{Answer, p_value};
use super::equation_error::{EquationError, Lift};
use super::study::{Linear, Study};
use crate::verdict::{Cause, Evidence, Parameter, Unexplained, Verdict};

/// Dispersion beyond which the model fits roughly.
const ROUGH: f64 = 4.0;
/// Prior standard deviations beyond which a size is not that of a mechanism.
const PLAUSIBLE_SD: f64 = 3.0;
/// Standard errors by which a delay must differ from the published servo's lag.
const PLAIN_SE: f64 = 3.0;
/// Delay and lag: at the frequencies of flight the one is as late as the other.
const LATE: [&str; 2] = ["actuator-delay", "actuator-lag"];

/// Holds `answer` to what a rough fit can carry; as it is where the fit is not rough.
pub fn restrain(
    answer: &mut Answer,
    study: &Study<'_>,
    last: &Linear,
    equation_error: &EquationError,
) {
    if last.word.dispersion <= ROUGH {
        return;
    }
    drop_implausible(answer, study, last);
    if let Some(lift) = &equation_error.lift {
        keep_together(answer, lift);
    }
    answer
        .causes
        .extend(late_surfaces(answer, study, equation_error));
    answer.verdict = Verdict::of(&answer.causes, answer.unexplained.is_some());
}

/// A cause of a size that nothing real has stands for something else, which has no name.
fn drop_implausible(answer: &mut Answer, study: &Study<'_>, last: &Linear) {
    let (kept, dropped): (Vec<Cause>, Vec<Cause>) = std::mem::take(&mut answer.causes)
        .into_iter()
        .partition(|c| c.parameters.iter().all(plausible));
    answer.causes = kept;
    answer.set.retain(|&k| {
        let stated = |c: &Cause| c.mechanisms.first().is_some_and(|m| m == study.ids[k]);
        !study.is_named(k) || !dropped.iter().any(stated)
    });
    let Some(strongest) = dropped.first() else {
        return;
    };
    let evidence = strongest.evidence.delta_log_evidence;
    let stronger = |u: &Unexplained| u.delta_log_evidence >= evidence;
    if answer.unexplained.as_ref().is_some_and(stronger) {
        return;
    }
    let sizes: Vec<String> = dropped
        .iter()
        .flat_map(|c| &c.parameters)
        .filter(|p| !plausible(p))
        .map(|p| format!("{}.{} of {:.2}", p.mechanism, p.name, p.value))
        .collect();
    answer.unexplained = Some(Unexplained {
        coordinate: "time".to_owned(),
        term: format!("as if by the implausible {}", sizes.join(" and ")),
        from_s: last.blocks.first().map_or(f64::NAN, |b| b.from_s),
        to_s: last.blocks.last().map_or(f64::NAN, |b| b.to_s),
        platforms: Vec::new(),
        delta_log_evidence: evidence,
        candidates: Vec::new(),
    });
}

fn plausible(parameter: &Parameter) -> bool {
    let known = spec(&parameter.mechanism);
    let p = known.and_then(|s| s.parameters.iter().find(|p| p.name == parameter.name));
    p.is_none_or(|p| (parameter.value - p.neutral).abs() <= PLAUSIBLE_SD * p.prior_sd)
}

/// Keeps vane and lift slope together as a set where lift against the vane cannot tell them
/// apart.
fn keep_together(answer: &mut Answer, lift: &Lift) {
    const PAIR: [&str; 2] = ["alpha-vane-scale", "lift-slope"];
    if lift.at_fault != "cannot be told" {
        return;
    }
    for cause in &mut answer.causes {
        for (one, other) in [(PAIR[0], PAIR[1]), (PAIR[1], PAIR[0])] {
            let has = |id: &str| cause.mechanisms.iter().any(|m| m == id);
            if has(one) && !has(other) {
                cause.mechanisms.push(other.to_owned());
            }
        }
    }
}

/// Surfaces later than published, where the moment equations show it and no cause says so yet.
fn late_surfaces(
    answer: &Answer,
    study: &Study<'_>,
    equation_error: &EquationError,
) -> Option<Cause> {
    let late = equation_error.late()?;
    let said = |c: &Cause| c.mechanisms.iter().any(|m| LATE.contains(&m.as_str()));
    if late.value_s < PLAIN_SE * late.se_s || answer.causes.iter().any(said) {
        return None;
    }
    let parameter = spec(LATE[0])?.parameters.first()?;
    let nats = 0.5 * (late.value_s / late.se_s).powi(2);
    // The prior's width over the estimate's is what one free parameter costs.
    let cost = (parameter.prior_sd / late.se_s).ln().max(0.0);
    Some(Cause {
        mechanisms: LATE.map(str::to_owned).to_vec(),
        probability: 1.0 - p_value(nats, 1, study.ids.len()),
        evidence: Evidence {
            delta_log_score: nats,
            delta_log_evidence: nats - cost,
            p_value: p_value(nats, 1, study.ids.len()),
        },
        parameters: vec![Parameter {
            mechanism: LATE[0].to_owned(),
            name: parameter.name.to_owned(),
            value: late.value_s,
            sd: late.se_s,
            unit: parameter.unit.to_owned(),
        }],
        platforms: Vec::new(),
        nats_to_next: f64::NAN,
    })
}
