//! What may be said where the whole fits roughly: names then follow tests that need no model of
//! the rest, and a disturbance that no air makes is something that is not explained.

use fdm::mechanism::spec;

use super::answer::{Answer, p_value};
use super::equation_error::{EquationError, Lift};
use super::evidence::Kind;
use super::rival::Target;
use super::study::{Linear, Study};
use crate::verdict::{Cause, Evidence, Parameter, Unexplained, UnexplainedKind, Verdict};

/// Dispersion beyond which the model fits roughly.
const ROUGH: f64 = 4.0;
/// Prior standard deviations by which a disturbance is larger than usual where it stands for what the
/// model lacks.
const DISTURBED_SD: f64 = 2.0;
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
    let (axis, sds) = last.noise.most_disturbed();
    if last.word.dispersion <= ROUGH && sds <= DISTURBED_SD {
        return;
    }
    if answer.unexplained.is_none() && sds > DISTURBED_SD {
        answer.unexplained = Some(disturbed(study, last, axis, sds - DISTURBED_SD));
    }
    if let Some(lift) = &equation_error.lift {
        keep_together(answer, lift);
    }
    answer
        .causes
        .extend(late_surfaces(answer, study, equation_error));
    answer.verdict = Verdict::of(&answer.causes, answer.unexplained.is_some());
}

/// What a disturbance stands for that is larger than is tolerated by so many prior standard deviations:
/// what the data lose without the excess.
fn disturbed(study: &Study<'_>, last: &Linear, axis: usize, sds: f64) -> Unexplained {
    let without = study.log_score(&last.theta, &last.noise.less_disturbed(axis, sds));
    let target = match axis {
        0..3 => Target::Spin(axis),
        _ => Target::Push(axis - 3),
    };
    Unexplained {
        kind: UnexplainedKind::Fluctuation,
        coordinate: "time".to_owned(),
        term: format!(
            "{}, a disturbance larger than turbulence and workmanship explain",
            target.words()
        ),
        from_s: last.blocks.first().map_or(f64::NAN, |b| b.from_s),
        to_s: last.blocks.last().map_or(f64::NAN, |b| b.to_s),
        platforms: Vec::new(),
        delta_log_evidence: (last.log_score - without) / last.word.dispersion,
        candidates: Vec::new(),
    }
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
    let mechanisms = study
        .candidates
        .iter()
        .filter(|c| c.kind == Kind::Mechanism)
        .count();
    // The prior's width over the estimate's is what one free parameter costs.
    let cost = (parameter.prior_sd / late.se_s).ln().max(0.0);
    Some(Cause {
        mechanisms: LATE.map(str::to_owned).to_vec(),
        probability: 1.0 - p_value(nats, 1, mechanisms),
        evidence: Evidence {
            delta_log_score: nats,
            delta_log_evidence: nats - cost,
            p_value: p_value(nats, 1, mechanisms),
        },
        parameters: vec![Parameter {
            mechanism: LATE[0].to_owned(),
            name: parameter.name.to_owned(),
            value: late.value_s,
            sd: late.se_s,
            unit: parameter.unit.to_owned(),
        }],
        platforms: Vec::new(),
        settings: Vec::new(),
        onset_s: None,
        nats_to_next: f64::NAN,
    })
}
