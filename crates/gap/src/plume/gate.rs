//! The gate: raw observations pass the checks that all who use them ask, and what a sensor that is
//! slow remembers of air that nobody knows is masked.

use scenario::observations::Observations;
use scenario::observations::checks;

use super::averaged::averaged;
use super::data::{Data, Setup};
use crate::GapError;
use crate::statistics::median;
use crate::verdict::{DataQuality, Flaw};

/// How many time constants a sensor remembers the air before a track: e⁻⁵ of it is left.
const REMEMBERED: f64 = 5.0;
/// Longest step between rows over which the air is known well enough, s, and over how many usual
/// steps of a record it is, whose sensor then met about as much in between.
const LONGEST_STEP_S: f64 = 4.0;
const USUAL_STEPS: f64 = 1.5;
/// Part of the readings beyond which the report says that they are ignored.
const MANY_PART: f64 = 0.2;

/// What is left of observations, if anything is, and what was wrong with them.
///
/// # Errors
/// No rows or readings even before any check, or a base that the plume model refuses.
pub(super) fn passed(
    setup: &Setup,
    observations: &Observations,
) -> Result<(Option<Data>, Vec<DataQuality>), GapError> {
    let checked = checks::check(observations, &setup.base, &setup.frame);
    if checked.observations.readings() == 0 && observations.readings() > 0 {
        return Ok((None, checked.flaws));
    }
    Ok((Some(rows_of(setup, &checked.observations)?), checked.flaws))
}

/// The rows of observations that have passed the checks: averaged over a second, without those in which a slow sensor
/// still responds to unknown air.
///
/// # Errors
/// No rows or readings, or a base that the plume model refuses.
pub(super) fn rows_of(setup: &Setup, checked: &Observations) -> Result<Data, GapError> {
    let mut data = Data::new(setup, &averaged(checked))?;
    forget_unknown_air(&mut data, setup.time_constant_s());
    Ok(data)
}

/// Leaves out the readings in which a slow sensor still remembers air of which nothing is known:
/// at the start of a track and after a gap.
fn forget_unknown_air(data: &mut Data, time_constant_s: f64) {
    let wait_s = REMEMBERED * time_constant_s;
    if wait_s <= 0.0 {
        return;
    }
    let times = data.track.time_s().to_vec();
    let before = data.used_count();
    for range in data.ranges().to_vec() {
        let usual_s = usual_step(&times[range.clone()]).unwrap_or(0.0);
        let longest_s = LONGEST_STEP_S.max(USUAL_STEPS * usual_s);
        let mut since = f64::NEG_INFINITY;
        let mut before = f64::NEG_INFINITY;
        for i in range {
            if times[i] - before > longest_s {
                since = times[i];
            }
            before = times[i];
            if times[i] - since < wait_s {
                data.used[i] = false;
            }
        }
    }
    let hold_out = before - data.used_count();
    if hold_out as f64 > MANY_PART * before as f64 {
        data.notices.push(format!(
            "{hold_out} of {before} readings are ignored: for {wait_s:.0} s after the start of a track or a gap, \
             a sensor with a time constant of {time_constant_s} s still responds to unknown air"
        ));
    }
}

/// The step that half of the steps between `times` do not exceed.
fn usual_step(times: &[f64]) -> Option<f64> {
    median(times.windows(2).map(|w| w[1] - w[0]).collect())
}

/// Single readings far from both neighbours among `rows`, whose noise the fit found to be no normal one.
pub(crate) fn spikes(data: &Data, rows: &[usize]) -> Vec<DataQuality> {
    let y = &data.reading_ppm;
    let mut found = Vec::new();
    for &i in rows {
        let range = data.ranges()[data.platform_of(i)].clone();
        if i <= range.start || i + 1 >= range.end {
            continue;
        }
        let (a, b, c) = (y[i - 1], y[i], y[i + 1]);
        let lone = (b - a).abs().min((b - c).abs());
        if lone > 4.0 * (a - c).abs() && (b - a).signum() == (b - c).signum() {
            let time_s = data.track.time_s()[i];
            found.push(DataQuality {
                platform: data.track.platforms()[data.platform_of(i)].clone(),
                kind: Flaw::Outlier,
                from_s: time_s,
                to_s: time_s,
                message: format!("a single reading of {b} ppm"),
            });
        }
    }
    found
}
