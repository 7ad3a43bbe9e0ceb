//! When time 0 is.
//!
//! Trends and drifts count from time 0, which a mission has at its start. A log may count from
//! midnight or from 1970 instead; a drift of the wind by a degree an hour would then be one of ten
//! or of half a million degrees all along. Such a record is counted from its first row, and what is
//! said of it is put back into its own time.

use std::borrow::Cow;

use scenario::observations::Observations;

use super::Analysis;
use crate::GapError;
use crate::verdict::GapJson;

/// A record that begins so much after time 0, or before it, counts from elsewhere, s.
const NEAR_S: f64 = 3600.0;

/// A record longer than this is none of one occasion, s: a month.
const LONGEST_S: f64 = 30.0 * 86_400.0;

/// The observations counted from their own beginning where time 0 is not near it, and that beginning
/// in their own time, s; zero where they stay as they are.
///
/// # Errors
/// Times that are a month and more apart.
pub(crate) fn counted(
    observations: &Observations,
) -> Result<(Cow<'_, Observations>, f64), GapError> {
    let times = || observations.rows.iter().map(|r| r.time_s);
    let first_s = times().fold(f64::INFINITY, f64::min);
    let last_s = times().fold(f64::NEG_INFINITY, f64::max);
    if last_s - first_s > LONGEST_S {
        return Err(GapError::Data {
            what: "observations, column time_s".to_string(),
            problem: format!("times from {first_s} to {last_s} s"),
            expected: "one record, in seconds of one clock, shorter than 30 days".to_string(),
        });
    }
    if !first_s.is_finite() || (0.0..NEAR_S).contains(&first_s) {
        return Ok((Cow::Borrowed(observations), 0.0));
    }
    let mut own = observations.clone();
    own.rows.iter_mut().for_each(|r| r.time_s -= first_s);
    own.notices.push(format!(
        "time_s begins at {first_s:.0} s: trends and drifts are counted from there"
    ));
    Ok((Cow::Owned(own), first_s))
}

/// Puts all times of an answer back into the record's own.
pub(crate) fn told_from(analysis: &mut Analysis, zero_s: f64) {
    if zero_s == 0.0 {
        return;
    }
    of_answer(&mut analysis.json, zero_s);
    let report = &mut analysis.report;
    let series = report.series.iter_mut().flat_map(|s| &mut s.time_s);
    series.for_each(|t| *t += zero_s);
    for (from_s, to_s, _) in &mut report.blocks {
        *from_s += zero_s;
        *to_s += zero_s;
    }
}

fn of_answer(json: &mut GapJson, zero_s: f64) {
    for bin in json.residual.iter_mut().filter(|b| b.coordinate == "time") {
        bin.from += zero_s;
        bin.to += zero_s;
    }
    for flaw in &mut json.data_quality {
        flaw.from_s += zero_s;
        flaw.to_s += zero_s;
    }
    if let Some(rest) = &mut json.unexplained {
        rest.from_s += zero_s;
        rest.to_s += zero_s;
    }
    let flight = json.next_flight.iter_mut().flat_map(|f| &mut f.waypoints);
    flight.for_each(|w| w.time_s += zero_s);
}
