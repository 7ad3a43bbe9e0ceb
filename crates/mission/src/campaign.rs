//! One scenario flown with many seeds, and what the missions show together.

use crate::{MissionError, Run, Setup, truth};
use record::summary::{CORRECTED, MissionSummary, Summariser, SummaryContext};
use std::fmt::Write as _;

/// A found peak within this distance of the truth counts as found, m.
pub const FOUND_WITHIN_M: f64 = 150.0;

/// What a summary needs to know of a scenario beside its messages.
///
/// # Errors
/// A scenario that describes no world.
pub fn summary_context(setup: &Setup) -> Result<SummaryContext, MissionError> {
    let scenario = &setup.scenario;
    let has_reality = truth::has_stand_in(scenario);
    let reality = has_reality
        .then(|| truth::reality_numbers(scenario))
        .transpose()?;
    let true_peak = has_reality.then(|| truth::true_peak(setup)).transpose()?;
    let true_flux = if has_reality {
        truth::true_flux(scenario)?
    } else {
        Vec::new()
    };
    Ok(SummaryContext {
        seed: scenario.mission.seed,
        team: scenario.vehicles.iter().map(|v| v.id.clone()).collect(),
        frame: setup.frame()?,
        before: truth::numbers(scenario)?,
        reality,
        true_peak,
        true_flux,
    })
}

/// Flies one mission in virtual time and summarises it; `wall_s` of the summary is zero.
///
/// # Errors
/// A mission that cannot be flown.
pub fn fly(setup: &Setup) -> Result<MissionSummary, MissionError> {
    let mut run = Run::new(setup)?;
    let mut summariser = Summariser::new(summary_context(setup)?);
    while !run.ended() {
        for (topic, envelope) in run.step() {
            summariser.take(topic, envelope);
        }
    }
    Ok(summariser.summary(&run.digest(), 0.0))
}

/// Summaries of missions with different seeds.
#[derive(Debug, Clone, Default)]
pub struct Campaign {
    /// One summary a seed.
    pub missions: Vec<MissionSummary>,
}

impl Campaign {
    /// Errors left over errors before, one a mission, of the n-th of the corrected numbers;
    /// only where there was an error before.
    pub fn remaining(&self, number: usize) -> Vec<f64> {
        self.missions
            .iter()
            .filter_map(|m| {
                let reality = (CORRECTED[number].of)(m.model.reality.as_ref()?).value;
                let model_error = |v: f64| CORRECTED[number].error(v, reality).abs();
                let before = model_error((CORRECTED[number].of)(&m.model.before).value);
                let after = model_error((CORRECTED[number].of)(&m.model.after).value);
                (before > 0.0).then_some(after / before)
            })
            .collect()
    }

    /// Missions whose peak was found, and missions in which there was one to find.
    pub fn found(&self) -> (usize, usize) {
        let errors: Vec<f64> = self
            .missions
            .iter()
            .filter(|m| m.peak.truth.is_some())
            .map(|m| m.peak.error_m.unwrap_or(f64::INFINITY))
            .collect();
        (
            errors.iter().filter(|e| **e <= FOUND_WITHIN_M).count(),
            errors.len(),
        )
    }

    /// The campaign as a table in Markdown.
    pub fn to_markdown(&self) -> String {
        let mut text = String::from("| seed | peak error, m |");
        for number in &CORRECTED {
            let _ = write!(text, " {} before → after |", number.name);
        }
        text.push_str("\n|---|---|");
        text.push_str(&"---|".repeat(CORRECTED.len()));
        for mission in &self.missions {
            let error = mission
                .peak
                .error_m
                .map_or("-".to_owned(), |e| format!("{e:.0}"));
            let _ = write!(text, "\n| {} | {error} |", mission.seed);
            for number in &CORRECTED {
                let Some(reality) = &mission.model.reality else {
                    text.push_str(" - |");
                    continue;
                };
                let truth = (number.of)(reality).value;
                let model_error = |numbers| number.error((number.of)(numbers).value, truth);
                let digits = number.digits;
                let _ = write!(
                    text,
                    " {:+.digits$} → {:+.digits$} {} |",
                    model_error(&mission.model.before),
                    model_error(&mission.model.after),
                    number.unit
                );
            }
        }
        let (found, of) = self.found();
        let _ = writeln!(
            text,
            "\n\nPeak found within {FOUND_WITHIN_M:.0} m: {found} of {of}.\n"
        );
        text.push_str("| number | median error left, share of the error before |\n|---|---|\n");
        for (k, number) in CORRECTED.iter().enumerate() {
            let left = median(self.remaining(k)).map_or("-".to_owned(), |m| format!("{m:.3}"));
            let _ = writeln!(text, "| {} | {left} |", number.name);
        }
        text
    }
}

/// Median; none of nothing.
pub fn median(mut values: Vec<f64>) -> Option<f64> {
    values.sort_by(f64::total_cmp);
    let n = values.len();
    match n {
        0 => None,
        _ if n % 2 == 1 => Some(values[n / 2]),
        _ => Some(f64::midpoint(values[n / 2 - 1], values[n / 2])),
    }
}
