//! `report.html` of a tuning: the gains found, what they do to steps, margins and weather, and
//! what happens when the aircraft is not as described.

mod figures;

use crate::html::{Document, number};
use fdm::tune::{Judged, LoopMargin, TuneReport};
use serde_json::Value;

/// The report. `file` is the name of the aircraft file that lies beside it.
pub fn page(report: &TuneReport, file: &str) -> Document {
    let mut page = Document::new("Plumage tuning report", &report.aircraft);
    page.lead(&lead(report, file));
    page.cards(&cards(report));
    gains(&mut page, report);
    steps(&mut page, report);
    margins(&mut page, report);
    weather(&mut page, report);
    robustness(&mut page, report);
    remains(&mut page, report);
    repeat(&mut page, report, file);
    page
}

fn lead(report: &TuneReport, file: &str) -> [String; 3] {
    let (before, after) = (&report.before, &report.after);
    let first = if report.changed {
        format!(
            "The cost of {} flights in hold-out weather and of five steps changed from {} with the gains of the \
             file to {} with the tuned gains.",
            after.held_out.len(),
            number(before.held_out_cost, 2),
            number(after.held_out_cost, 2)
        )
    } else {
        "No gains were found that keep the margins and are also better in hold-out weather: the gains of the \
         file are kept."
            .to_owned()
    };
    let done = match &report.mechanism[..] {
        [] => format!(
            "The gains of the autopilot of {} were tuned in simulated flights.",
            report.aircraft
        ),
        found => format!(
            "The gains of the autopilot of {} were tuned in simulated flights with the mechanisms found in a measured \
             flight: {}.",
            report.aircraft,
            found.iter().map(mechanism).collect::<Vec<_>>().join("; ")
        ),
    };
    let margins = format!(
        "{} dB and {}°",
        number(report.required.gain_db, 0),
        number(report.required.phase_deg, 0)
    );
    let worth = if before.has_margins {
        format!(
            "{file} has the aircraft with these gains, ready to fly; every loop keeps margins of {margins}."
        )
    } else {
        format!(
            "{file} has the aircraft with these gains, ready to fly; the gains of the file do not keep margins of {margins} \
             in every loop, so they were not eligible."
        )
    };
    [done, first, worth]
}

fn mechanism(mechanism: &fdm::mechanism::Mechanism) -> String {
    let parameters: Vec<String> = mechanism
        .parameters
        .iter()
        .map(|(name, value)| format!("{name} = {value}"))
        .collect();
    format!("{} ({})", mechanism.id, parameters.join(", "))
}

/// The least of what all loops have.
fn least(judged: &Judged, of: fn(&LoopMargin) -> f64) -> f64 {
    judged.margins.iter().map(of).fold(f64::INFINITY, f64::min)
}

fn cards(report: &TuneReport) -> Vec<(String, &'static str, String)> {
    let (before, after) = (&report.before, &report.after);
    let change = 100.0 * (after.held_out_cost / before.held_out_cost - 1.0);
    let was = |of: fn(&LoopMargin) -> f64, unit: &str| {
        format!(
            "; with the gains of the file {}{unit}",
            number(least(before, of), 0)
        )
    };
    vec![
        (
            number(change, 0),
            "%",
            "change of the cost in hold-out weather".to_owned(),
        ),
        (
            number(least(after, |m| m.gain_margin_db), 1),
            "dB",
            format!("least gain margin{}", was(|m| m.gain_margin_db, " dB")),
        ),
        (
            number(least(after, |m| m.phase_margin_deg), 0),
            "°",
            format!("least phase margin{}", was(|m| m.phase_margin_deg, "°")),
        ),
    ]
}

fn gains(page: &mut Document, report: &TuneReport) {
    page.section("The gains");
    let table = |judged: &Judged| match serde_json::to_value(judged.gains) {
        Ok(Value::Object(table)) => table,
        _ => serde_json::Map::new(),
    };
    let (before, after) = (table(&report.before), table(&report.after));
    let figure =
        |value: Option<&Value>| number(value.and_then(Value::as_f64).unwrap_or(f64::NAN), 3);
    let rows: Vec<Vec<String>> = after
        .iter()
        .filter(|(name, value)| before.get(*name) != Some(*value))
        .map(|(name, value)| vec![name.clone(), figure(before.get(name)), figure(Some(value))])
        .collect();
    if rows.is_empty() {
        page.paragraph("No gain changed.");
    } else {
        let caption = "Changed keys of the table [control]; the unit is in the name. Limits, radius and approach \
                       are as in the file.";
        page.table(caption, &["gain", "before", "after"], &rows);
    }
    page.figure(
        figures::history(&report.history, report.before.cost),
        "The search: cost of the best gains so far, in the weather of the search. Grey: the gains of the file.",
    );
}

fn steps(page: &mut Document, report: &TuneReport) {
    page.section("Step responses");
    page.figure(
        figures::steps(&report.before.steps, &report.after.steps),
        "One demand is changed at time 0. Grey: gains of the file. Blue: tuned gains. Dashed: the demand. Roll, \
         airspeed and height in calm air; course over ground and the radius of an orbit in a wind of 5 m/s.",
    );
    let mut rows = Vec::new();
    for (b, a) in report.before.steps.iter().zip(&report.after.steps) {
        let pair = |before: f64, after: f64, digits: usize| {
            format!("{} → {}", number(before, digits), number(after, digits))
        };
        rows.push(vec![
            format!("{}, {} {}", a.what, number(a.size, 1), a.unit),
            pair(b.rise_s, a.rise_s, 2),
            pair(100.0 * b.overshoot, 100.0 * a.overshoot, 0),
            pair(b.settling_s, a.settling_s, 2),
        ]);
    }
    page.table(
        "Step responses, before → after: rise time (10 to 90 %), overshoot and settling time (5 %). A dash: not \
         within the time shown. Their cost is the square of the settling time over 2 s (roll), 5 s (course), 10 \
         s (height, airspeed) and 8 s (orbit), and of the overshoot over 10 %.",
        &["step", "rise, s", "overshoot, %", "settling, s"],
        &rows,
    );
}

fn margins(page: &mut Document, report: &TuneReport) {
    page.section("Stability margins");
    page.paragraph(&format!(
        "Every loop must keep {} dB and {}°. Roll and pitch: on the linearised aircraft with servo, delays and \
         the hold of the controller, broken at the servo's command. Heading, height and airspeed: measured on \
         the simulated aircraft with all its loops, by small sinusoidal demands.",
        number(report.required.gain_db, 0),
        number(report.required.phase_deg, 0)
    ));
    let mut rows = Vec::new();
    for (b, a) in report.before.margins.iter().zip(&report.after.margins) {
        let pair = |of: fn(&LoopMargin) -> f64, digits: usize| {
            // A margin without end is written as such: nothing there makes the loop unstable.
            let text = |value: f64| match value {
                v if v == f64::INFINITY => "∞".to_owned(),
                v => number(v, digits),
            };
            format!("{} → {}", text(of(b)), text(of(a)))
        };
        rows.push(vec![
            format!("{} at {} m/s", a.name, number(a.airspeed_m_s, 1)),
            pair(|m| m.gain_margin_db, 1),
            pair(|m| m.phase_margin_deg, 0),
            pair(|m| 1000.0 * m.delay_margin_s, 0),
            pair(|m| m.crossover_rad_s, 2),
        ]);
    }
    page.table(
        "Margins, before → after.",
        &[
            "loop",
            "gain, dB",
            "phase, °",
            "delay, ms",
            "crossover, rad/s",
        ],
        &rows,
    );
    page.figure(
        figures::bode(&report.before.margins, &report.after.margins),
        "Open-loop responses near cruise speed with the tuned gains; dotted: gains of the file.",
    );
}

fn weather(page: &mut Document, report: &TuneReport) {
    page.section("Weather");
    page.paragraph(
        "In each case the aircraft flies courses, a climb, a descent, a faster and a slower leg, and an orbit, \
         in different gusts. The cost is the sum of squared errors, each divided by its tolerance: 2 m of \
         height, 1 m/s of airspeed, 0.1 rad of course, 5 m off the orbit, 0.1 rad between commanded and flown \
         bank, and 0.6 rad/s of surface motion (root mean squares). The cost of the steps is added to their mean.",
    );
    page.figure(
        figures::weather(&report.before, &report.after),
        "Cost of each flight. The cases above the line are those of the search; the others are random hold-out \
         cases.",
    );
    let rows: Vec<Vec<String>> = report
        .after
        .flights
        .iter()
        .chain(&report.after.held_out)
        .map(|f| {
            vec![
                f.weather.name.clone(),
                number(f.height_rms_m, 2),
                number(f.airspeed_rms_m_s, 2),
                number(f.course_rms_rad.to_degrees(), 1),
                number(f.orbit_rms_m, 1),
                number(f.bank_rms_rad.to_degrees(), 1),
                number(f.outside_s, 1),
                if f.flown { "yes" } else { "no" }.to_owned(),
            ]
        })
        .collect();
    page.table(
        "Flights with the tuned gains: root mean squares of the errors, and time beyond the stall angle or the \
         speed limit.",
        &[
            "weather",
            "height, m",
            "airspeed, m/s",
            "course, °",
            "orbit, m",
            "bank, °",
            "outside, s",
            "flown",
        ],
        &rows,
    );
}

fn robustness(page: &mut Document, report: &TuneReport) {
    page.section("Robustness to a different aircraft");
    let mut rows = Vec::new();
    for (b, a) in report
        .before
        .robustness
        .iter()
        .zip(&report.after.robustness)
    {
        let pair = |before: f64, after: f64, digits: usize| {
            format!("{} → {}", number(before, digits), number(after, digits))
        };
        let flown = |flown: bool| if flown { "yes" } else { "no" };
        rows.push(vec![
            a.change.clone(),
            pair(b.cost, a.cost, 2),
            pair(b.gain_margin_db, a.gain_margin_db, 1),
            pair(b.phase_margin_deg, a.phase_margin_deg, 0),
            format!("{} → {}", flown(b.flown), flown(a.flown)),
        ]);
    }
    page.table(
        &format!(
            "The gains on modified aircraft, before → after: mean cost of the flights in the weather of the \
             search (as described: {} → {}), and the least margins of roll and pitch at cruise. Gains are \
             accepted only if they fly in every case in which those of the file do, and keep half the required \
             margins (or those of the file, if lower).",
            number(report.before.cost - report.before.step_cost, 2),
            number(report.after.cost - report.after.step_cost, 2)
        ),
        &["change", "cost", "gain, dB", "phase, °", "flown"],
        &rows,
    );
}

fn remains(page: &mut Document, report: &TuneReport) {
    page.section("Limits of this result");
    let mut items = Vec::new();
    for case in &report.after.robustness {
        if !case.flown {
            let change = &case.change;
            items.push(format!(
                "With {change}, the aircraft does not complete all weather cases."
            ));
        } else if case.phase_margin_deg < 0.5 * report.required.phase_deg {
            items.push(format!(
                "With {}, only {}° of phase margin remain.",
                case.change,
                number(case.phase_margin_deg, 0)
            ));
        }
    }
    for flight in report.after.held_out.iter().filter(|f| !f.flown) {
        items.push(format!(
            "In {}, it leaves the range in which the model is valid.",
            flight.weather.name
        ));
    }
    items.push(
        "All of this is simulation, without noise and delay of the real sensors, without a flexing airframe, and \
         without anything that is not in the aircraft file. Begin the first flight high, with a pilot ready, and \
         tune again from its log."
            .to_owned(),
    );
    items.push(
        "Take-off and landing use the same loops but are not part of the search; the yaw damper and the limits \
         of bank, pitch and climb are as in the file."
            .to_owned(),
    );
    page.list(&items);
}

fn repeat(page: &mut Document, report: &TuneReport, file: &str) {
    page.section("How to repeat this");
    page.paragraph(&format!(
        "plumage tune with the same aircraft and --seed {} tries the same {} candidates in the same gusts and \
         finds the same gains. To use them, name {file} as the aircraft of a vehicle in a scenario. tune.json \
         has every figure of this page.",
        report.seed, report.candidates
    ));
}
