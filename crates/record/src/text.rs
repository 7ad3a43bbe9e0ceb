//! A summary in words, for the terminal.

use crate::summary::{CORRECTED, MissionSummary, ModelNumber, ModelSummary, PeakSummary};
use protocol::message::{Estimate, VehicleKind};
use std::fmt::Write as _;

/// What was found, and how far the model was and is from the stand-in's reality.
pub fn summary(summary: &MissionSummary) -> String {
    let mut text = String::new();
    let real = count(summary, VehicleKind::Real);
    let simulated = count(summary, VehicleKind::Simulated);
    // An empty sum of floats is -0.
    let distance_m = summary
        .vehicles
        .iter()
        .fold(0.0, |sum, v| sum + v.distance_m);
    let distance_km = distance_m / 1000.0;
    line(
        &mut text,
        format_args!(
            "Flown: {} in {:.1} s of wall time ({:.0} x real time), {simulated} simulated and {real} \
             real vehicles, {distance_km:.0} km in all.",
            duration(summary.sim_s),
            summary.wall_s,
            summary.real_time_factor
        ),
    );
    line(&mut text, format_args!("{}", peak(&summary.peak)));
    model(&mut text, &summary.model, real);
    text
}

fn line(text: &mut String, arguments: std::fmt::Arguments<'_>) {
    // Writing into a String cannot fail.
    let _ = writeln!(text, "{arguments}");
}

/// A kind of vehicle in words.
pub fn vehicle_kind(kind: VehicleKind) -> &'static str {
    match kind {
        VehicleKind::Simulated => "simulated",
        VehicleKind::Real => "real",
    }
}

fn count(summary: &MissionSummary, kind: VehicleKind) -> usize {
    summary.vehicles.iter().filter(|v| v.kind == kind).count()
}

/// A time span in words: `48 s`, `30 min 20 s`.
pub fn duration(seconds: f64) -> String {
    let whole = seconds.max(0.0).round() as u64;
    match (whole / 60, whole % 60) {
        (0, s) => format!("{s} s"),
        (m, 0) => format!("{m} min"),
        (m, s) => format!("{m} min {s} s"),
    }
}

/// A place in words: `43.4417 N, 7.8631 W, 826 m AMSL`.
pub fn place(lat_deg: f64, lon_deg: f64, alt_amsl_m: f64) -> String {
    let ns = if lat_deg < 0.0 { 'S' } else { 'N' };
    let ew = if lon_deg < 0.0 { 'W' } else { 'E' };
    format!(
        "{:.4} {ns}, {:.4} {ew}, {alt_amsl_m:.0} m AMSL",
        lat_deg.abs(),
        lon_deg.abs()
    )
}

/// The peak in one sentence or two.
pub fn peak(peak: &PeakSummary) -> String {
    let Some(found) = peak.estimate else {
        return "Found: no peak; the mission ended before its search had one.".to_owned();
    };
    let mut text = format!(
        "Found: a peak of {:.0} ± {:.0} ppm at {}.",
        found.co2_ppm,
        found.sd_ppm,
        place(found.lat_deg, found.lon_deg, found.alt_amsl_m)
    );
    if let (Some(truth), Some(error_m)) = (peak.truth, peak.error_m) {
        let _ = write!(
            text,
            " That is {error_m:.0} m from the highest reachable point of the stand-in's reality \
             ({:.0} ppm).",
            truth.co2_ppm
        );
    }
    text
}

fn model(text: &mut String, model: &ModelSummary, real: usize) {
    let Some(reality) = &model.reality else {
        line(text, format_args!("{}", without_reality(model, real)));
        return;
    };
    line(
        text,
        format_args!("Model against the stand-in's reality, before -> after the mission:"),
    );
    for number in &CORRECTED {
        let truth = (number.of)(reality);
        let (before, after) = ((number.of)(&model.before), (number.of)(&model.after));
        line(
            text,
            format_args!(
                "  {:<17} {:>7} -> {:>7}   reality {:>7}   error {:>7} -> {:>7} {}",
                number.name,
                figure(number, before.value),
                figure(number, after.value),
                figure(number, truth.value),
                figure(number, number.error(before.value, truth.value).abs()),
                figure(number, number.error(after.value, truth.value).abs()),
                number.unit
            ),
        );
    }
}

fn figure(number: &ModelNumber, value: f64) -> String {
    format!("{value:.*}", number.digits)
}

fn without_reality(model: &ModelSummary, real: usize) -> String {
    if real == 0 {
        return "Model: no real vehicle flew, so nothing corrected it.".to_owned();
    }
    let mut text = "Model after the mission:".to_owned();
    for number in &CORRECTED {
        let Estimate { value, sd } = (number.of)(&model.after);
        let (v, s) = (figure(number, value), figure(number, sd));
        let _ = write!(text, "\n  {:<17} {v:>7} ± {s} {}", number.name, number.unit);
    }
    text
}
