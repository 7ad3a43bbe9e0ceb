//! A summary in words, for the terminal.

use crate::colour::number;
use crate::intervals::positive_interval_95;
use crate::summary::{
    CORRECTED, FluxSummary, GapSummary, HighestReading, MissionSummary, ModelNumber, Outcome,
    ppm_of,
};
use formats::list::listed;
use formats::number::{plus_minus, significant, value_and_sd};
use plume::Gas;
use protocol::message::{
    Estimate, Flux, FluxMethod, MechanismSetting, Peak, PeakStatus, VehicleKind, verdict_text,
};
use scenario::contradiction::Contradiction;
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
    line(&mut text, format_args!("{}", peak(summary)));
    for said in fluxes(summary) {
        line(&mut text, format_args!("{said}"));
    }
    if let Some(found) = &summary.gap {
        line(&mut text, format_args!("{}", gap(found)));
    }
    model(&mut text, summary, real);
    if let Some(said) = not_landed(summary) {
        line(&mut text, format_args!("{said}"));
    }
    text
}

/// Vehicles listed by name in a sentence: a team of that size is still read one by one.
const MOST_LISTED: usize = 30;

/// Which vehicles of the team had not landed at the end; none where all had.
pub fn not_landed(summary: &MissionSummary) -> Option<String> {
    let of = |outcome: Outcome| {
        let ids = summary.vehicles.iter().filter(|v| v.outcome == outcome);
        let ids: Vec<&str> = ids.map(|v| v.id.as_str()).collect();
        listed(&ids, MOST_LISTED)
    };
    let said = |what: &str, ids: String| (!ids.is_empty()).then(|| format!("{what}: {ids}."));
    let airborne = said(
        "NOT LANDED at the mission's end, still in the air",
        of(Outcome::Airborne),
    );
    let lost = said(
        "NOT HEARD at the mission's end, last reported in the air",
        of(Outcome::Lost),
    );
    let both: Vec<String> = airborne.into_iter().chain(lost).collect();
    (!both.is_empty()).then(|| both.join(" "))
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

/// Why a peak that readings support is not confirmed.
pub const NOT_CONFIRMED: &str =
    "too few crossings are near it, or its interval is wider than asked for";

/// The peak, how far readings stand behind it, and what it is held against.
pub fn peak(summary: &MissionSummary) -> String {
    let (peak, gas) = (&summary.peak, summary.gas);
    let estimate = |p: &Peak| estimate(gas, p);
    let mut text = match (peak.status, &peak.estimate) {
        (PeakStatus::NotFound, _) if !peak.came_near => {
            "Not found: no reading was taken where the plume could be, so there is no peak to report.".to_owned()
        }
        (PeakStatus::NotFound, _) => {
            "Not found: the real readings do not follow any plume that the model allows, so there is no peak to \
             report.".to_owned()
        }
        (_, None) => {
            "Doubtful: a plume was read, but the real readings do not follow any plume that the model allows, so \
             there is no peak to report.".to_owned()
        }
        (PeakStatus::Confirmed, Some(p)) => format!(
            "Found and confirmed: a peak of {}. Readings of real crossings near it agree with the prediction.",
            estimate(p)
        ),
        (PeakStatus::Supported, Some(p)) => format!(
            "Found: a peak of {}. Real readings support it, but do not confirm it: {NOT_CONFIRMED}.",
            estimate(p)
        ),
        (PeakStatus::Doubtful, Some(p)) => {
            let why = match &summary.contradictions[..] {
                [] => "Real readings contradict it or constrain it too little.".to_owned(),
                found => contradictions(found),
            };
            format!("Doubtful: a peak of {}. {why}", estimate(p))
        }
    };
    if let Some(HighestReading { place: at, .. }) = &peak.highest_reading {
        let _ = write!(
            text,
            " The highest real reading was {} {} at {}.",
            number(gas, at.co2_ppm),
            ppm_of(gas),
            place(at.lat_deg, at.lon_deg, at.alt_amsl_m)
        );
    }
    if let Some(truth) = &peak.truth {
        let away = peak
            .error_m
            .map_or(String::new(), |m| format!(", {m:.0} m from the estimate"));
        let _ = write!(
            text,
            " In the stand-in's simulated reality, the highest value within the fence is {} {}{away}.",
            number(gas, truth.co2_ppm),
            ppm_of(gas)
        );
    }
    text
}

/// What of a scenario readings contradict, a sentence each.
pub fn contradictions(found: &[Contradiction]) -> String {
    let said = found.iter().map(|c| {
        let mut letters = c.says.chars();
        let first = letters.next().map(|c| c.to_uppercase().to_string());
        first.unwrap_or_default() + letters.as_str() + "."
    });
    said.collect::<Vec<_>>().join(" ")
}

fn estimate(gas: Gas, peak: &Peak) -> String {
    format!(
        "{} {} at {}, the highest value within the fence",
        plus_minus(peak.co2_ppm, peak.sd_ppm),
        ppm_of(gas),
        place(peak.lat_deg, peak.lon_deg, peak.alt_amsl_m)
    )
}

/// How a flux was found, in words.
pub fn flux_method(method: FluxMethod) -> &'static str {
    match method {
        FluxMethod::Inference => "the fit to all readings",
        FluxMethod::MassBalance => "the mass balance of passes",
        FluxMethod::Combined => "both methods",
    }
}

/// What is emitted, a sentence for each source and way to find it.
pub fn fluxes(summary: &MissionSummary) -> Vec<String> {
    let said = added_sources(summary).into_iter();
    let said = said.chain(summary.flux.iter().map(flux));
    said.chain(flux_notes(summary)).collect()
}

/// Where sources lie that readings showed beside the scenario's, a sentence each.
pub fn added_sources(summary: &MissionSummary) -> Vec<String> {
    summary.mechanisms.iter().filter_map(added_source).collect()
}

/// What limits the rates.
pub fn flux_notes(summary: &MissionSummary) -> Vec<String> {
    let mut said = Vec::new();
    let is = |method: FluxMethod| summary.flux.iter().any(|f| f.found.method == method);
    if summary.peak.status == PeakStatus::Doubtful && is(FluxMethod::Inference) {
        said.push("The flux by the fit is as doubtful as its peak.".to_owned());
    }
    match [FluxMethod::Inference, FluxMethod::MassBalance, FluxMethod::Combined].map(is) {
        [true, false, _] => said.push(
            "No mass balance: fewer than three passes cross the whole plume.".to_owned(),
        ),
        [true, true, false] => said.push(
            "The two methods disagree by more than chance explains: nothing is averaged, and the first line stands."
                .to_owned(),
        ),
        _ => {}
    }
    said
}

/// Where a source lies that readings showed beside the scenario's; nothing of another mechanism.
pub fn added_source(mechanism: &MechanismSetting) -> Option<String> {
    let of = |name: &str| mechanism.parameters.get(name).copied();
    let (east_m, north_m, ratio) = (of("east_m")?, of("north_m")?, of("ratio")?);
    let side = |m: f64, plus: &str, minus: &str| {
        format!("{:.0} m {}", m.abs(), if m < 0.0 { minus } else { plus })
    };
    Some(format!(
        "A second source: {} and {} of the first, with {ratio:.2} times its strength.",
        side(east_m, "east", "west"),
        side(north_m, "north", "south")
    ))
}

/// What a source emits.
fn flux(flux: &FluxSummary) -> String {
    let Flux {
        source,
        method,
        kg_s,
    } = &flux.found;
    let method = flux_method(*method);
    let reality = flux.truth_kg_s.map_or(String::new(), |q| {
        format!("; {} in the stand-in's reality", significant(q))
    });
    format!(
        "Flux of {source}: {} by {method}{reality}.",
        emission_rate(*kg_s)
    )
}

/// An emission rate with its interval, as all outputs state it. A rate is positive, and ± would reach below zero where
/// it is hardly known.
pub fn emission_rate(kg_s: Estimate) -> String {
    format!(
        "{} kg/s (95 % interval {})",
        significant(kg_s.value),
        interval_of_rate(kg_s)
    )
}

/// The 95 % interval of an emission rate, kg/s.
pub fn interval_of_rate(kg_s: Estimate) -> String {
    positive_interval_95(kg_s).map_or("unknown".to_owned(), |ends| {
        ends.map(significant).join(" to ")
    })
}

/// What real readings show of the model.
pub fn gap(gap: &GapSummary) -> String {
    let causes = gap.causes.iter().map(|c| c.mechanisms.join(" or "));
    let causes: Vec<String> = causes.collect();
    format!(
        "Reality gap in flight: {}.",
        verdict_text(&gap.verdict, &causes)
    )
}

fn model(text: &mut String, summary: &MissionSummary, real: usize) {
    let (model, gas) = (&summary.model, summary.gas);
    let Some(reality) = &model.reality else {
        line(text, format_args!("{}", without_reality(summary, real)));
        return;
    };
    line(
        text,
        format_args!("Model against the stand-in's reality, before -> after the mission:"),
    );
    for number in &CORRECTED {
        let truth = (number.of)(reality).value;
        let (before, after) = ((number.of)(&model.before), (number.of)(&model.after));
        line(
            text,
            format_args!(
                "  {:<17} {:>13} -> {:>17}   reality {:>6}   error {:>6} -> {:>7} {}",
                number.name,
                plus_minus(before.value, before.sd),
                plus_minus(after.value, after.sd),
                significant(truth),
                error(number, before, truth),
                error(number, after, truth),
                number.unit_of(gas)
            ),
        );
    }
}

/// By how much a number is off, with the digits that its standard deviation has.
pub fn error(number: &ModelNumber, found: Estimate, truth: f64) -> String {
    let error = number.error(found.value, truth).abs();
    let [error, _] = value_and_sd(error, found.sd);
    error
}

fn without_reality(summary: &MissionSummary, real: usize) -> String {
    let model = &summary.model;
    if real == 0 {
        return "Model: not corrected, since no real vehicle flew.".to_owned();
    }
    let mut text = "Model after the mission:".to_owned();
    for number in &CORRECTED {
        let Estimate { value, sd } = (number.of)(&model.after);
        let [value, sd] = value_and_sd(value, sd);
        let _ = write!(
            text,
            "\n  {:<17} {value:>7} ± {sd} {}",
            number.name,
            number.unit_of(summary.gas)
        );
    }
    text
}
