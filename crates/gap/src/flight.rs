//! The gap of flight: a measured flight against the aircraft of its file.
//!
//! [`log`] reads the file, [`gate`] masks what cannot be used, [`equation_error`] says at once
//! what accelerations tell (delays, moments, lift), and [`study`] follows the flight with an
//! extended Kalman filter that has the measured commands as input, wind and disturbances as
//! states, and every mechanism of the catalogue as an extension. Evidence is in closed form from
//! one pass that carries the derivatives of all innovations ([`filter`], [`evidence`]). What sets in during
//! the flight is looked for in `onset`.
//!
//! Pure: texts in, report out.

#![allow(
    clippy::needless_range_loop,
    reason = "places in vectors and matrices of fixed size are read with their formulas"
)]

pub mod answer;
pub mod channel;
pub mod equation_error;
pub mod estimate;
pub mod evidence;
pub mod filter;
pub mod gain;
pub mod gate;
#[cfg(test)]
mod gate_tests;
mod gradient;
pub mod histories;
pub mod log;
pub mod motion;
mod next_flight;
pub mod noise;
pub mod normal;
mod onset;
pub mod parameters;
mod residual;
pub mod rival;
mod rough;
mod sensitivity;
pub mod study;
mod suspect;
mod transition;
pub mod windows;

use std::sync::Arc;

use fdm::Aircraft;
use serde::Serialize;

use crate::GapError;
use crate::verdict::{GapJson, SCHEMA, Verdict};
use answer::Answer;
use equation_error::EquationError;
use gate::Gated;
use histories::History;
use log::FlightLog;
use study::{Linear, Study};
use windows::MotionError;

/// What `gap flight` found: `gap.json` with a further field `flight`.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct FlightReport {
    /// The fields that all of `gap.json` has.
    #[serde(flatten)]
    pub gap: GapJson,
    /// What stands behind them.
    pub flight: FlightDetail,
    /// Measured and simulated histories.
    #[serde(skip)]
    pub histories: Vec<History>,
    /// The aircraft with what was found.
    #[serde(skip)]
    pub extended: Aircraft,
}

impl FlightReport {
    /// The text of `gap.json`, indented; `gain` has the errors of motion besides, as `motion`.
    ///
    /// # Errors
    /// Only if serialisation itself fails.
    pub fn to_json(&self) -> Result<String, serde_json::Error> {
        let mut whole = serde_json::to_value(self)?;
        if let Some(gain) = whole["gain"].as_object_mut() {
            gain.insert(
                "motion".to_owned(),
                serde_json::to_value(&self.flight.motion)?,
            );
        }
        serde_json::to_string_pretty(&whole)
    }
}

/// What stands behind a verdict on flight.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct FlightDetail {
    /// What accelerations say without a filter.
    pub equation_error: EquationError,
    /// Factor by which the data's word was weakened, since their score varies that much more
    /// than independent innovations would.
    pub dispersion: f64,
    /// Errors of the motion predicted for short windows by the measured commands, in a pilot's
    /// units.
    pub motion: Vec<MotionError>,
}

/// What was found, with the question and the views of the data that it was found from.
pub struct Finding<'a> {
    /// The question.
    pub study: Study<'a>,
    /// What accelerations say without a filter.
    pub equation_error: EquationError,
    /// The data seen from the base.
    pub first: Linear,
    /// The data seen from where the search ended.
    pub last: Linear,
    /// What they came to.
    pub answer: Answer,
}

impl<'a> Finding<'a> {
    /// Asks what `gated`, made from `logs` logs, says of `aircraft`; `progress` gets the part done.
    ///
    /// # Errors
    /// [`GapError::Data`] when the model cannot follow the flights at all.
    pub fn of(
        aircraft: &'a Aircraft,
        gated: &'a Gated,
        logs: usize,
        progress: &mut dyn FnMut(f64),
    ) -> Result<Self, GapError> {
        let study = Study::new(aircraft, gated, logs);
        let equation_error = study.equation_error();
        progress(0.03);
        let (first, last) = study.look(&mut |part| progress(0.03 + 0.8 * part))?;
        let (study, first, last) = onset::look(study, first, last);
        progress(0.93);
        let mut answer = answer::judge(&study, &last);
        rough::restrain(&mut answer, &study, &last, &equation_error);
        Ok(Self {
            study,
            equation_error,
            first,
            last,
            answer,
        })
    }

    /// The report: `gap.json`, histories, and the aircraft with what was found.
    pub fn report(self) -> FlightReport {
        let Self {
            study,
            equation_error,
            first,
            last,
            answer,
        } = self;
        let base_theta = study.theta_of(&last, &[]);
        let mut theta = study.theta_of(&last, &answer.set);
        // What has no name is not in the extended aircraft.
        theta[study.parameters.len()..study.first_late()].fill(0.0);
        let histories = histories::histories(&study, &last.noise, [&base_theta, &theta]);
        let mut notices = study.gated.notices.clone();
        let extended = extend(study.aircraft, &answer, &mut notices);
        if answer.causes.iter().any(|c| c.onset_s.is_some()) {
            notices.push(
                "the extended aircraft is that at the end: an aircraft file does not say when something sets in"
                    .into(),
            );
        }
        notices.extend(equation_error.moments.iter().map(|m| m.words.clone()));
        notices.extend(equation_error.lift.iter().map(|l| l.words.clone()));
        let motion = windows::errors(&histories);
        let mut summary = summary(&answer, &equation_error);
        if let Some(words) = windows::in_words(&motion, !answer.set.is_empty()) {
            summary = format!("{summary} {words}");
        }
        let gap = GapJson {
            schema: SCHEMA,
            verdict: answer.verdict,
            summary,
            residual: residual::bins(&study, &first),
            gain: (!answer.set.is_empty()).then(|| gain::of_set(&study, &last, &answer.set)),
            detectable: answer::detectable(&study, &last),
            next_flight: next_flight::propose(&answer),
            base: answer::base(&study, &last, &answer.set),
            unexplained: answer.unexplained,
            data_quality: study.gated.data_quality.clone(),
            notices,
            ranking: answer.ranking,
            causes: answer.causes,
            ..GapJson::default()
        };
        FlightReport {
            gap,
            flight: FlightDetail {
                equation_error,
                dispersion: last.word.dispersion,
                motion,
            },
            histories,
            extended,
        }
    }
}

/// The aircraft with what was found, or as it is where that lies outside what a file may say.
fn extend(aircraft: &Aircraft, answer: &Answer, notices: &mut Vec<String>) -> Aircraft {
    let mut extended = aircraft.clone();
    extended.mechanism.extend(answer::extension(&answer.causes));
    let extended = Arc::new(extended);
    if fdm::extended::ExtendedAircraft::of(&extended).is_ok() {
        return Arc::unwrap_or_clone(extended);
    }
    notices.push(
        "the extended aircraft lies outside what an aircraft file may say; extended.toml is the base"
            .into(),
    );
    aircraft.clone()
}

/// What is being done when the part `done` of an analysis is, in words.
pub fn doing(done: f64) -> &'static str {
    match done {
        ..0.03 => "accelerations",
        0.03..0.23 => "noise",
        0.23..0.3 => "the aircraft of the file",
        0.3..0.83 => "causes",
        0.83..0.93 => "onsets",
        _ => "histories",
    }
}

/// Analyses the flights `logs` of `aircraft`; `progress` gets the part done, 0 to 1.
///
/// # Errors
/// [`GapError::Data`] when nothing flies in the logs, or the model cannot follow them at all.
pub fn analyse(
    logs: &[FlightLog],
    aircraft: &Aircraft,
    progress: &mut dyn FnMut(f64),
) -> Result<FlightReport, GapError> {
    let gated = gate::pass(logs, aircraft)?;
    let report = Finding::of(aircraft, &gated, logs.len(), progress)?.report();
    progress(1.0);
    Ok(report)
}

fn summary(answer: &Answer, equation_error: &EquationError) -> String {
    let sets: Vec<String> = answer
        .causes
        .iter()
        .map(|c| c.mechanisms.join(" or ") + &c.onset_after())
        .collect();
    let mut text = match answer.verdict {
        Verdict::Insufficient => {
            "These flights are too short or too quiet to test the aircraft model.".to_owned()
        }
        Verdict::None => "These flights agree with the aircraft of the file.".to_owned(),
        Verdict::Named => format!("The data show {}.", sets.join(" and ")),
        Verdict::Ambiguous => format!(
            "The data show {}; they cannot tell apart what \"or\" joins.",
            sets.join(", and ")
        ),
        Verdict::Unexplained => {
            let rest = answer
                .unexplained
                .as_ref()
                .map_or_else(String::new, |u| u.term.clone());
            if sets.is_empty() {
                format!(
                    "The data deviate from the model, and no listed mechanism accounts for it: {rest}."
                )
            } else {
                format!(
                    "The data show {}; no listed mechanism accounts for the remaining deviation: {rest}.",
                    sets.join(", and ")
                )
            }
        }
    };
    for delay in &equation_error.delays {
        text += &format!(
            " {} lags by {:.0} ms (pure delay in the moment {:.0} ms).",
            delay.of,
            1000.0 * delay.rate_lag_s,
            1000.0 * delay.moment_delay_s
        );
    }
    text
}
