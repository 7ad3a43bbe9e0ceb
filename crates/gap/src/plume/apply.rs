//! Causes found in some readings, held against others. Of the extension nothing is fitted; what the
//! scenario marks uncertain is, for base and extension alike, on the passes that are not scored.

use std::borrow::Cow;

use ::plume::mechanism::{Mechanism, MechanismId};
use infer::Judgement;
use scenario::observations::Observations;

use super::data::Setup;
use super::gain::gain;
use super::records::Records;
use super::wind;
use super::{
    Analysis, Considered, FEWEST_READINGS, Options, Progress, Study, answer, gate, report,
    residual, zero,
};
use crate::GapError;
use crate::applied::{Applied, Earlier, Outcome, scores_in_words};
use crate::verdict::{Cause, GapJson, Readings, SCHEMA};

/// Holds the causes of `earlier` against readings that had no part in finding them: scores of base and
/// extension on passes of the new readings, of which the other passes have fitted what the scenario marks
/// uncertain.
///
/// # Errors
/// A finding of another kind or without causes, platforms that the readings do not have, too few readings,
/// or a base that the plume model refuses.
pub fn apply(
    setup: &Setup,
    observations: &Observations,
    earlier: &Earlier,
    options: &Options,
    progress: &mut dyn FnMut(Progress),
) -> Result<Analysis, GapError> {
    let mut tell = |part: f64, doing: &'static str| progress(Progress { part, doing });
    let readings = Readings::of(observations);
    let (observations, zero_s) = observations.counted_from_near_zero()?;
    let setup = &setup.counted_from(zero_s);
    let (extension, mut notices) = extension(earlier, &observations)?;
    notices.extend(earlier.was_found_in(&readings));
    earlier.check_gas(setup.gas())?;
    tell(0.0, "checking the raw data");
    let (passed, quality) = gate::passed(setup, &observations)?;
    let data = passed
        .filter(|d| d.used_count() >= FEWEST_READINGS)
        .ok_or_else(|| GapError::Data {
            what: "observations".into(),
            problem: "too few readings are usable".into(),
            expected: format!("at least {FEWEST_READINGS} that pass the checks"),
        })?;
    let (rows, policy) = (options.rows_of_a_search, &options.policy);
    let records = Records::new(setup, Cow::Borrowed(&data), rows, policy, false)?;
    let setup = records.setup();
    let extended = extended(setup, &extension, data.track.platforms());
    tell(0.1, "fitting the base");
    let carried = records.carried(setup)?;
    let tracks = records.tracks(setup, carried);
    let base = records.fitted(setup, &tracks, carried)?;
    tell(0.4, "fitting the base with the extension");
    let own_carried = records.carried(&extended)?;
    let own_tracks = records.tracks(&extended, own_carried);
    let set = records.fitted(&extended, &own_tracks, own_carried)?;
    tell(0.7, "scoring hold-out passes");
    let question = records.question();
    let first_model = records
        .model(setup, &tracks[0])
        .following(base.model.axis_drift());
    let contact = records.first_question().contact(&first_model, base.at())?;
    let study = Study {
        setup: &extended,
        data: &data,
        question,
        tried: Vec::new(),
        contact,
        found: Vec::new(),
        judged: Judgement {
            set,
            causes: Vec::new(),
            dropped: Vec::new(),
            is_doubted: false,
            rest: infer::Rest {
                nats: f64::NAN,
                kind: infer::RestKind::None,
            },
            candidates: Vec::new(),
            passes: question.passes(&base)?,
            considered: Vec::new(),
        },
        base,
        carried,
    };
    let gained = gain(&study, options.seed)?;
    let fitted = answer::base_parameters(&study, &study.judged.set)?;
    notices.splice(0..0, data.notices.iter().cloned());
    notices.push(format!(
        "the plume of the base is carried by {}, that of the extension by {}",
        wind::describe(carried),
        wind::describe(own_carried)
    ));
    let applied = applied(&extended, &gained.gain, &earlier.name);
    let json = GapJson {
        schema: SCHEMA,
        gas: Some(setup.gas()),
        readings: Some(readings),
        verdict: earlier.verdict,
        summary: applied.says.clone(),
        causes: earlier.causes.clone(),
        ranking: Vec::new(),
        residual: residual::bins(&study),
        gain: Some(gained.gain),
        detectable: Vec::new(),
        next_flight: None,
        base: fitted,
        unexplained: None,
        insufficient: None,
        contact: answer::contact(&study),
        pairs: Vec::new(),
        discrepancy: None,
        noise: None,
        applied: Some(applied),
        data_quality: quality,
        notices,
    };
    let mut analysis = Analysis {
        extension,
        base: Vec::new(),
        logged_wind: None,
        report: report::report(&study, Some(&gained)),
        named: None,
        considered: Considered::default(),
        json,
    };
    zero::told_from(&mut analysis, zero_s);
    tell(1.0, "done");
    Ok(analysis)
}

/// The mechanisms of an earlier finding, and what to say of them: of a set its first.
fn extension(
    earlier: &Earlier,
    observations: &Observations,
) -> Result<(Vec<Mechanism>, Vec<String>), GapError> {
    let mut notices = Vec::new();
    let mut out = Vec::new();
    for cause in earlier.plume()? {
        if cause.mechanisms.len() > 1 {
            notices.push(format!(
                "{} could not be told apart; {} is applied",
                cause.mechanisms.join(" and "),
                cause.mechanisms[0]
            ));
        }
        out.push(mechanism(cause, earlier, observations)?);
    }
    Ok((out, notices))
}

fn mechanism(
    cause: &Cause,
    earlier: &Earlier,
    observations: &Observations,
) -> Result<Mechanism, GapError> {
    let wrong = |problem: String, expected: &str| GapError::Data {
        what: earlier.name.clone(),
        problem,
        expected: expected.to_owned(),
    };
    let id = cause.mechanisms.first().map_or("", String::as_str);
    let own = cause.parameters.iter().chain(&cause.settings);
    let values: Vec<(&str, f64)> = own
        .filter(|p| p.mechanism == id)
        .map(|p| (p.name.as_str(), p.value))
        .collect();
    let unknown = |p: &&String| !observations.platforms.contains(p);
    if let Some(platform) = cause.platforms.iter().find(unknown) {
        return Err(wrong(
            format!("{id} is a cause of platform {platform:?}, which these readings do not have"),
            "readings of that platform under the same name, since a sensor's error stays with the sensor",
        ));
    }
    Ok(Mechanism::new(id, &values)?.for_platforms(&cause.platforms))
}

/// The setup with the extension: what it moves is no longer uncertain, since a cause's parameters hold what
/// the scenario was unsure of as well.
fn extended(setup: &Setup, extension: &[Mechanism], platforms: &[String]) -> Setup {
    let mut out = setup.clone();
    let moves = |id: MechanismId, of: &[String]| {
        let mut same = extension.iter().filter(|m| m.id() == id);
        same.any(|m| m.platforms() == of)
    };
    out.priors.retain(|p| !moves(p.id, &[]));
    out.own.retain(|u| {
        let own = u.platform.map_or(&[][..], |p| &platforms[p..=p]);
        !moves(u.id, own)
    });
    out.base.mechanisms.extend(extension.iter().cloned());
    out
}

fn applied(extended: &Setup, gain: &crate::verdict::Gain, from: &str) -> Applied {
    let h = &gain.held_out;
    let log_score = [-h.log_score_gain_high, -h.log_score_gain_low];
    let outcome = Outcome::of(&[log_score, [h.rmse_change_low, h.rmse_change_high]]);
    let gas = extended.gas();
    let says = format!(
        "{}: in {} passes, each predicted with a base fitted to the others, the log score gains {:.1} nats (95 % \
         interval {:.1} to {:.1}), {}.",
        outcome.says(),
        gain.blocks,
        h.log_score_after - h.log_score_before,
        h.log_score_gain_low,
        h.log_score_gain_high,
        scores_in_words(h, &format!("ppm of {}", gas.formula()), 2 + gas.digits())
    );
    let mut fitted: Vec<String> = extended.priors.iter().map(|p| p.key.clone()).collect();
    if extended.own.iter().any(|u| u.platform.is_some()) {
        fitted.push("each sensor's own zero and gain".into());
    }
    fitted.push("noise, discrepancy and axis motion".into());
    Applied {
        from: from.to_owned(),
        outcome,
        says,
        fitted,
        scores: Vec::new(),
    }
}

#[cfg(test)]
#[path = "apply_tests.rs"]
mod tests;
