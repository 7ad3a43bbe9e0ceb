//! The report of an analysis of measured flights.

use super::{Card, bins, figure, name_extend_gain, opening_with, remains};
use crate::html::{Document, number};
use crate::plot::{panel_title, rounded, stride};
use gap::flight::FlightReport;
use gap::flight::equation_error::{EquationError, Moment};
use gap::flight::histories::{History, WINDOW_S};
use gap::flight::windows::MotionError;
use serde_json::{Value, json};

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
pub fn flight(title: &str, report: &FlightReport) -> String {
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
        page.plot(860, histories(&report.histories), &caption);
        errors(&mut page, motion);
        page.plot(
            860,
            residuals(&report.histories),
            "Innovations of the filter over the whole flight, in standard deviations of its noise (means of \
             short stretches); an explained motion stays within about one.",
        );
    }
    bins(&mut page, json);
    equation_error(&mut page, &report.flight.equation_error);
    name_extend_gain(&mut page, json);
    remains(&mut page, json);
    page.finish()
}

/// Errors of motion before and after, as one card.
fn card(motion: &[MotionError], label: &str) -> Option<Card> {
    let e = motion.iter().find(|e| e.label == label)?;
    let value = format!("{} → {}", figure(e.before), figure(e.after));
    let what = format!("error of the {label} predicted for {:.0} s", e.window_s);
    Some((value, e.unit, what))
}

/// The table of errors of motion.
fn errors(page: &mut Document, motion: &[MotionError]) {
    let row = |e: &MotionError| {
        vec![
            e.label.to_owned(),
            figure(e.before),
            figure(e.after),
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
            "extended",
            "unit",
            "extended is better in",
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
                    figure(moment.published[k]),
                    figure(moment.refitted[k]),
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
        figure(m.variance),
        figure(m.published_leaves),
        percent(m.published_constant_part),
        figure(m.held_out_leaves),
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

/// Two columns of panels, one a channel, with these lines each.
fn panels(chosen: &[&History], lines: &dyn Fn(&History, &str) -> Vec<Value>, unit: bool) -> Value {
    let rows = chosen.len().div_ceil(2).max(1) as f64;
    let mut data = Vec::new();
    let mut layout = json!({"margin": {"t": 40}, "legend": {"orientation": "h", "y": 1.09}});
    let mut titles = Vec::new();
    for (i, history) in chosen.iter().enumerate() {
        let suffix = if i == 0 {
            String::new()
        } else {
            (i + 1).to_string()
        };
        let left = 0.54 * (i % 2) as f64;
        let top = 1.0 - (i / 2) as f64 / rows;
        let bottom = top - 0.72 / rows;
        layout[format!("xaxis{suffix}")] = json!({"domain": [left, left + 0.46],
            "anchor": format!("y{suffix}"), "matches": "x"});
        layout[format!("yaxis{suffix}")] = json!({"domain": [bottom, top],
            "anchor": format!("x{suffix}")});
        let of = if unit { history.unit } else { "sd" };
        titles.push(panel_title(history.label, of, left, top));
        for mut line in lines(history, &suffix) {
            line["showlegend"] = json!(i == 0);
            data.push(line);
        }
    }
    layout["annotations"] = json!(titles);
    json!({"data": data, "layout": layout})
}

fn line(name: &str, x: Vec<Value>, y: Vec<Value>, suffix: &str, colour: &str) -> Value {
    json!({"type": "scatter", "mode": "lines", "name": name, "legendgroup": name, "x": x, "y": y,
           "xaxis": format!("x{suffix}"), "yaxis": format!("y{suffix}"), "connectgaps": true,
           "line": {"color": colour, "width": 1.4}})
}

fn histories(all: &[History]) -> Value {
    panels(
        &shown(all),
        &|h, suffix| {
            let middle = h.time_s[h.time_s.len() / 2];
            let inside: Vec<usize> = (0..h.time_s.len())
                .filter(|&i| (h.time_s[i] - middle).abs() < 0.5 * CLOSE_S)
                .collect();
            let step = stride(inside.len(), POINTS);
            let pick = |values: &[f64]| -> Vec<Value> {
                let chosen = inside.iter().step_by(step);
                chosen.map(|&i| rounded(values[i], 1000.0)).collect()
            };
            // Each window is a line of its own.
            let apart = |values: &[f64]| -> (Vec<Value>, Vec<Value>) {
                let (mut x, mut y) = (Vec::new(), Vec::new());
                for &i in &inside {
                    let start = h.starts.binary_search(&i).is_ok();
                    if start {
                        x.push(Value::Null);
                        y.push(Value::Null);
                    }
                    if start || i % step == 0 {
                        x.push(rounded(h.time_s[i], 1000.0));
                        y.push(rounded(values[i], 1000.0));
                    }
                }
                (x, y)
            };
            let window = |name: &str, values: &[f64], colour: &str| {
                let (x, y) = apart(values);
                let mut drawn = line(name, x, y, suffix, colour);
                drawn["connectgaps"] = json!(false);
                drawn
            };
            let first: Vec<usize> = inside
                .iter()
                .copied()
                .filter(|i| h.starts.binary_search(i).is_ok())
                .collect();
            let at = |values: &[f64]| -> Vec<Value> {
                first.iter().map(|&i| rounded(values[i], 1000.0)).collect()
            };
            let mut dots = line("start", at(&h.time_s), at(&h.extended), suffix, "#2f6f9f");
            dots["mode"] = json!("markers");
            dots["marker"] = json!({"size": 4, "color": "#2f6f9f"});
            vec![
                line(
                    "measured",
                    pick(&h.time_s),
                    pick(&h.measured),
                    suffix,
                    "#d3131f",
                ),
                window("file", &h.base, "#98a2b0"),
                window("extended", &h.extended, "#2f6f9f"),
                dots,
            ]
        },
        true,
    )
}

/// Means of stretches of the innovations.
fn residuals(all: &[History]) -> Value {
    panels(
        &shown(all),
        &|h, suffix| {
            let width = stride(h.time_s.len(), 200);
            let mean = |values: &[f64]| -> Vec<Value> {
                values
                    .chunks(width)
                    .map(|chunk| {
                        let known: Vec<f64> =
                            chunk.iter().copied().filter(|v| v.is_finite()).collect();
                        let n = known.len() as f64;
                        rounded(known.iter().sum::<f64>() / n.sqrt(), 100.0)
                    })
                    .collect()
            };
            let time: Vec<Value> = h
                .time_s
                .chunks(width)
                .map(|c| rounded(c[c.len() / 2], 10.0))
                .collect();
            vec![
                line(
                    "file",
                    time.clone(),
                    mean(&h.base_standardised),
                    suffix,
                    "#98a2b0",
                ),
                line(
                    "extended",
                    time,
                    mean(&h.extended_standardised),
                    suffix,
                    "#2f6f9f",
                ),
            ]
        },
        false,
    )
}
