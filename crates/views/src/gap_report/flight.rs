//! The report of an analysis of measured flights.

use super::{Card, bins, left_out, name_extend_gain, opening_with, remains, unit_or_dash};
use crate::figure::{
    Axis, BASE, Column, Figure, Layer, Line, MEASURED, MODEL, Panel, Points, stride,
};
use crate::html::{Document, number};
use formats::number::{significant, value_and_sd};
use gap::flight::FlightReport;
use gap::flight::equation_error::{EquationError, Moment};
use gap::flight::estimate::Estimate;
use gap::flight::histories::{History, WINDOW_S};
use gap::flight::windows::MotionError;

/// Points of a line in a figure.
const POINTS: usize = 1800;
/// Channels in the figure of histories.
const SHOWN: [&str; 8] = [
    "airspeed",
    "angle of attack",
    "roll angle",
    "pitch angle",
    "roll rate",
    "pitch rate",
    "specific force forward",
    "specific force down",
];
/// Channels whose errors open the report.
const CARDS: [&str; 3] = ["roll rate", "pitch rate", "airspeed"];
/// Seconds of a flight that the closer figure shows.
const CLOSE_S: f64 = 30.0;

/// The report of measured flights against an aircraft. `title` names the data.
pub fn flight(title: &str, report: &FlightReport) -> Document {
    let json = &report.gap;
    let motion = &report.flight.motion;
    let cards: Vec<Card> = CARDS.iter().filter_map(|c| card(motion, c)).collect();
    let mut page = opening_with("Plumage gap report: flight", title, json, &cards);
    page.section("Measured against simulated");
    if !report.histories.is_empty() {
        let caption = format!(
            "Red: measured. Grey: predicted with the aircraft of the file from the measured commands, in windows \
             of {WINDOW_S} s with a start each (dots). Blue: predicted with the extended aircraft. Thirty \
             seconds from the middle of the longest flight; gusts are not predicted and explain a part of the \
             deviation."
        );
        page.figure(histories(&report.histories), &caption);
        errors(&mut page, motion, "extended");
        page.figure(
            residuals(&report.histories),
            "Innovations of the filter over the whole flight, in standard deviations of its noise (means of \
             short stretches); an explained motion stays within about one.",
        );
    }
    bins(&mut page, json);
    let equations = &report.flight.equation_error;
    equation_error(&mut page, equations);
    name_extend_gain(&mut page, json);
    let mut shown: Vec<&str> = equations.moments.iter().map(|m| m.words.as_str()).collect();
    shown.extend(equations.lift.as_ref().map(|lift| lift.words.as_str()));
    remains(&mut page, json, &shown);
    page
}

/// The report of an aircraft that was estimated from flights. `title` names the data.
pub fn estimate(title: &str, found: &Estimate) -> Document {
    let mut page = Document::new("Plumage report: aircraft from flights", title);
    let determined = found.coefficients.iter().filter(|c| c.told).count();
    let count = found.coefficients.len();
    let error = found.motion.iter().find(|e| e.label == CARDS[0]);
    page.lead(&[
        format!("The aerodynamic coefficients of {title} were estimated, starting from those of the aircraft file."),
        format!("These flights determine {determined} of {count} coefficients to less than half of their prior uncertainty."),
        error.map_or(String::new(), |e| {
            format!(
                "Predicted for {:.0} s, the {} of flights not used for it has an error of {} {} with the estimate, \
                 and of {} {} with the file.",
                e.window_s,
                e.label,
                significant(e.after),
                e.unit,
                significant(e.before),
                e.unit
            )
        }),
    ]);
    let cards: Vec<Card> = CARDS
        .iter()
        .filter_map(|c| card(&found.motion, c))
        .collect();
    page.cards(&cards);
    page.section("Coefficients");
    let rows = found.coefficients.iter().map(|c| {
        let [value, sd] = value_and_sd(c.value, c.sd);
        let determined = if c.told { "yes" } else { "no" };
        vec![
            c.name.clone(),
            value,
            sd,
            unit_or_dash(c.unit),
            significant(c.start),
            significant(c.prior_sd),
            determined.to_owned(),
        ]
    });
    page.table(
        &format!(
            "Coefficients per radian, as in aircraft.toml. Both halves of the flights were estimated alone, and all ± \
             are {} times those of the filter so that the halves agree.",
            significant(found.widened)
        ),
        &["coefficient", "estimate", "± 1 sd", "unit", "file", "prior sd", "determined"],
        &rows.collect::<Vec<_>>(),
    );
    let moves = found.coefficients.iter().map(|c| {
        let by = |value: f64| (value - c.start) / c.prior_sd;
        let interval = [c.value, c.value - 1.96 * c.sd, c.value + 1.96 * c.sd];
        (c.name.clone(), interval.map(by))
    });
    page.intervals(
        "By how many prior standard deviations each coefficient differs from the file, with its 95 % interval.",
        ("estimate minus file", "prior sd"),
        &moves.collect::<Vec<_>>(),
    );
    if !found.motion.is_empty() {
        page.section("Prediction of motion");
        errors(&mut page, &found.motion, "estimate");
    }
    if !(found.notices.is_empty() && found.data_quality.is_empty()) {
        page.section("Raw data");
        page.list(&found.notices);
        left_out(&mut page, &found.data_quality);
    }
    page
}

/// Errors of motion before and after, as one card.
fn card(motion: &[MotionError], label: &str) -> Option<Card> {
    let e = motion.iter().find(|e| e.label == label)?;
    let value = format!("{} → {}", significant(e.before), significant(e.after));
    let what = format!("error of the {label} predicted for {:.0} s", e.window_s);
    Some((value, e.unit, what))
}

/// The table of errors of motion, with those of the aircraft `of` another file.
fn errors(page: &mut Document, motion: &[MotionError], of: &str) {
    let row = |e: &MotionError| {
        vec![
            e.label.to_owned(),
            significant(e.before),
            significant(e.after),
            e.unit.to_owned(),
            format!("{} of {}", e.better_in, e.windows),
        ]
    };
    page.table(
        "Root mean square error of the predicted motion in the middle window. A window in which the simulation \
         diverged counts once.",
        &[
            "channel",
            "file",
            of,
            "unit",
            &format!("{of} is better in"),
        ],
        &motion.iter().map(row).collect::<Vec<_>>(),
    );
}

fn equation_error(page: &mut Document, equations: &EquationError) {
    if equations.delays.is_empty() && equations.moments.is_empty() {
        return;
    }
    page.section("Quick look at the accelerations");
    page.paragraph(&format!("Angular accelerations: {}.", equations.filter));
    let delays: Vec<Vec<String>> = equations
        .delays
        .iter()
        .map(|d| {
            vec![
                d.of.clone(),
                number(1000.0 * d.rate_lag_s, 0),
                number(d.correlation, 2),
                number(1000.0 * d.moment_delay_s, 0),
            ]
        })
        .collect();
    page.table(
        "Delays. The lag of the rate includes that of the airframe; the delay in the moment equation is that of \
         the command only.",
        &[
            "response",
            "lag of the rate, ms",
            "correlation",
            "delay in the moment, ms",
        ],
        &delays,
    );
    let rows: Vec<Vec<String>> = equations.moments.iter().map(moment_row).collect();
    page.table(
        "Angular acceleration, (rad/s²)²: its variance, the mean square residual of the published model, and \
         that of refitted derivatives on hold-out blocks of 10 s.",
        &[
            "axis",
            "variance",
            "residual of the published model",
            "of it constant",
            "hold-out residual of the refit",
            "share of it explained",
            "of the variance",
        ],
        &rows,
    );
    for moment in &equations.moments {
        let rows: Vec<Vec<String>> = (0..moment.derivatives.len())
            .map(|k| {
                let inflation = k.checked_sub(1).and_then(|i| moment.inflation.get(i));
                vec![
                    moment.derivatives[k].to_owned(),
                    significant(moment.published[k]),
                    significant(moment.refitted[k]),
                    inflation.map_or(String::new(), |v| number(*v, 1)),
                ]
            })
            .collect();
        page.table(
            &format!(
                "Derivatives of the {} moment, per radian. {}",
                moment.axis, moment.words
            ),
            &["derivative", "published", "refitted", "variance inflation"],
            &rows,
        );
    }
    if let Some(lift) = &equations.lift {
        page.paragraph(&lift.words);
    }
}

fn moment_row(m: &Moment) -> Vec<String> {
    let percent = |share: f64| format!("{} %", number(100.0 * share, 0));
    vec![
        m.axis.to_owned(),
        significant(m.variance),
        significant(m.published_leaves),
        percent(m.published_constant_part),
        significant(m.held_out_leaves),
        percent(m.held_out_share),
        percent(m.held_out_r2),
    ]
}

/// The longest history of each shown channel.
fn shown(histories: &[History]) -> Vec<&History> {
    SHOWN
        .iter()
        .filter_map(|label| {
            histories
                .iter()
                .filter(|h| h.label == *label)
                .max_by_key(|h| h.time_s.len())
        })
        .collect()
}

/// Two columns of panels, one a channel.
fn panels(all: &[History], panel: impl Fn(&History) -> (Axis, Vec<Layer>)) -> Figure {
    let one = |h: &&History| {
        let (y, layers) = panel(h);
        Panel {
            title: h.label.to_owned(),
            height: Some(130),
            linked: Some("time"),
            x: Axis::new("time", "s"),
            y,
            layers,
            ..Panel::default()
        }
    };
    Figure {
        columns: 2,
        panels: shown(all).iter().map(one).collect(),
        scale: None,
    }
}

fn line(name: &str, colour: &'static str, x: Column, y: Column) -> Layer {
    Layer::Line(Line {
        name: name.to_owned(),
        colour,
        width: 1.4,
        x,
        y,
        ..Line::default()
    })
}

fn histories(all: &[History]) -> Figure {
    panels(all, |h| (Axis::new("", h.unit), history(h)))
}

/// Thirty seconds of a channel: as read, and as predicted in windows, each a line of its own.
fn history(h: &History) -> Vec<Layer> {
    let middle = h.time_s[h.time_s.len() / 2];
    let is_near = |i: &usize| (h.time_s[*i] - middle).abs() < 0.5 * CLOSE_S;
    let inside: Vec<usize> = (0..h.time_s.len()).filter(is_near).collect();
    let is_start = |i: usize| h.starts.binary_search(&i).is_ok();
    let step = stride(inside.len(), POINTS);
    let is_drawn = |i: &usize| is_start(*i) || i.is_multiple_of(step);
    let drawn: Vec<usize> = inside.into_iter().filter(is_drawn).collect();
    let starts: Vec<usize> = (0..drawn.len()).filter(|&k| is_start(drawn[k])).collect();
    let column = |values: &[f64]| Column::new(drawn.iter().map(|&i| values[i]), 1000.0);
    let at_starts = |values: &[f64]| Column::new(starts.iter().map(|&k| values[drawn[k]]), 1000.0);
    let time = || column(&h.time_s);
    let window = |name: &str, colour, values: &[f64]| {
        line(
            name,
            colour,
            time().broken(&starts),
            column(values).broken(&starts),
        )
    };
    vec![
        line("measured", MEASURED, time(), column(&h.measured)),
        window("file", BASE, &h.base),
        window("extended", MODEL, &h.extended),
        Layer::Points(Points {
            name: "start".to_owned(),
            colour: Some(MODEL),
            size: 4.0,
            x: at_starts(&h.time_s),
            y: at_starts(&h.extended),
            ..Points::default()
        }),
    ]
}

/// Means of stretches of the innovations.
fn residuals(all: &[History]) -> Figure {
    panels(all, |h| {
        let width = stride(h.time_s.len(), 200);
        let mean = |chunk: &[f64]| {
            let known: Vec<f64> = chunk.iter().copied().filter(|v| v.is_finite()).collect();
            known.iter().sum::<f64>() / (known.len() as f64).sqrt()
        };
        let means = |values: &[f64]| Column::new(values.chunks(width).map(mean), 100.0);
        let time = || Column::new(h.time_s.chunks(width).map(|c| c[c.len() / 2]), 10.0);
        let layers = vec![
            line("file", BASE, time(), means(&h.base_standardised)),
            line("extended", MODEL, time(), means(&h.extended_standardised)),
        ];
        (Axis::new("", "sd"), layers)
    })
}
