//! Answers in a record's own time, where they were found in time counted from its beginning.

use super::Analysis;
use crate::verdict::GapJson;

/// Puts all times of an answer back into the record's own.
pub(super) fn told_from(analysis: &mut Analysis, zero_s: f64) {
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
