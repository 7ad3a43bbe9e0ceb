//! The figures of a tuning report, as data and layout for the plotting library.

use crate::plot::{panel_title, rounded};
use fdm::tune::{Judged, LoopMargin, StepResponse};
use serde_json::{Value, json};

const BEFORE: &str = "#98a2b0";
const AFTER: &str = "#2f6f9f";
/// One colour a loop.
const LOOPS: [&str; 5] = ["#2f6f9f", "#d3131f", "#3d8b37", "#b7791f", "#6b4fa0"];
/// Columns of the step responses.
const COLUMNS: usize = 3;

/// Names an axis, from 0: the first has no number.
fn axis(letter: char, k: usize) -> String {
    if k == 0 {
        letter.to_string()
    } else {
        format!("{letter}{}", k + 1)
    }
}

/// Best cost after each candidate, with the cost of the gains of the file.
pub(super) fn history(history: &[f64], before: f64) -> Value {
    let best: Vec<Value> = history.iter().map(|v| rounded(*v, 1000.0)).collect();
    let file = [rounded(before, 1000.0), rounded(before, 1000.0)];
    json!({"data": [
        {"type": "scatter", "mode": "lines", "name": "gains of the file", "x": [1, history.len().max(2)],
         "y": file, "line": {"color": BEFORE, "width": 1.4, "dash": "dot"}},
        {"type": "scatter", "mode": "lines", "name": "best so far",
         "x": (1..=history.len()).collect::<Vec<_>>(), "y": best,
         "line": {"color": AFTER, "width": 1.8, "shape": "hv"}},
    ], "layout": {"xaxis": {"title": {"text": "candidate"}}, "yaxis": {"title": {"text": "cost"}}}})
}

/// Step responses, a panel each.
pub(super) fn steps(before: &[StepResponse], after: &[StepResponse]) -> Value {
    let mut data = Vec::new();
    let mut layout = json!({"margin": {"t": 30},
        "legend": {"orientation": "v", "x": 0.72, "y": 0.32, "yanchor": "top"}});
    let mut titles = Vec::new();
    let (wide, high) = (1.0 / COLUMNS as f64, 0.5);
    for (k, (b, a)) in before.iter().zip(after).enumerate() {
        let (x, y) = (axis('x', k), axis('y', k));
        let left = wide * (k % COLUMNS) as f64;
        let top = 1.0 - high * (k / COLUMNS) as f64;
        let end = a.series.last().map_or(1.0, |p| p.0);
        let lines = [
            ("gains of the file", BEFORE, "solid", b.series.clone()),
            ("tuned gains", AFTER, "solid", a.series.clone()),
            (
                "demand",
                "#16181d",
                "dash",
                vec![(0.0, a.size), (end, a.size)],
            ),
        ];
        for (name, colour, dash, series) in lines {
            data.push(json!({"type": "scatter", "mode": "lines", "name": name,
                "legendgroup": name, "showlegend": k == 0,
                "x": series.iter().map(|p| rounded(p.0, 100.0)).collect::<Vec<_>>(),
                "y": series.iter().map(|p| rounded(p.1, 1000.0)).collect::<Vec<_>>(),
                "xaxis": x, "yaxis": y,
                "line": {"color": colour, "width": if dash == "dash" { 1.0 } else { 1.8 }, "dash": dash}}));
        }
        layout[format!("xaxis{}", &x[1..])] = json!({"domain": [left, left + 0.84 * wide], "anchor": y, "title": {"text": "time, s", "standoff": 4}});
        layout[format!("yaxis{}", &y[1..])] =
            json!({"domain": [top - 0.62 * high, top], "anchor": x});
        titles.push(panel_title(&a.what, &a.unit, left, top));
    }
    layout["annotations"] = json!(titles);
    json!({"data": data, "layout": layout})
}

/// Magnitude and phase of every loop, at the airspeed nearest to cruise: that of the outer loops.
pub(super) fn bode(before: &[LoopMargin], after: &[LoopMargin]) -> Value {
    let cruise = after.last().map_or(0.0, |m| m.airspeed_m_s);
    let near = |m: &&LoopMargin| (m.airspeed_m_s - cruise).abs() < 0.01;
    let mut data = Vec::new();
    for (margins, dash, width) in [(before, "dot", 1.0), (after, "solid", 1.8)] {
        for (m, colour) in margins.iter().filter(near).zip(LOOPS) {
            let x: Vec<Value> = m.bode.iter().map(|p| rounded(p.0, 1000.0)).collect();
            let gain: Vec<Value> = m.bode.iter().map(|p| rounded(p.1, 100.0)).collect();
            let phase: Vec<Value> = m.bode.iter().map(|p| rounded(p.2, 10.0)).collect();
            for (values, y) in [(gain, "y"), (phase, "y2")] {
                data.push(json!({"type": "scatter", "mode": "lines", "name": m.name,
                    "legendgroup": m.name, "showlegend": dash == "solid" && y == "y",
                    "x": x, "y": values, "yaxis": y,
                    "line": {"color": colour, "width": width, "dash": dash}}));
            }
        }
    }
    let level = |y: &str, at: f64| {
        json!({"type": "line", "xref": "paper", "x0": 0, "x1": 1,
        "yref": y, "y0": at, "y1": at, "line": {"color": "#16181d", "width": 1, "dash": "dash"}})
    };
    json!({"data": data, "layout": {
        "xaxis": {"type": "log", "title": {"text": "frequency, rad/s"}, "anchor": "y2"},
        "yaxis": {"title": {"text": "gain, dB"}, "domain": [0.54, 1.0], "range": [-50, 40]},
        "yaxis2": {"title": {"text": "phase, °"}, "domain": [0.0, 0.46], "range": [-320, 10]},
        "shapes": [level("y", 0.0), level("y2", -180.0)]}})
}

/// Cost of every flight before and after.
pub(super) fn weather(before: &Judged, after: &Judged) -> Value {
    let bars = |judged: &Judged, name: &str, colour: &str| {
        let flights = || judged.flights.iter().chain(&judged.held_out);
        json!({"type": "bar", "orientation": "h", "name": name, "marker": {"color": colour},
            // The number keeps two cases of one name apart.
            "y": flights().enumerate().map(|(k, f)| format!("{}  {}", f.weather.name, k + 1)).collect::<Vec<_>>(),
            "x": flights().map(|f| rounded(f.cost, 1000.0)).collect::<Vec<_>>()})
    };
    let line = after.flights.len() as f64 - 0.5;
    json!({"data": [bars(before, "gains of the file", BEFORE), bars(after, "tuned gains", AFTER)],
      "layout": {"barmode": "group", "xaxis": {"title": {"text": "cost"}, "rangemode": "tozero"},
        "yaxis": {"autorange": "reversed", "automargin": true},
        "shapes": [{"type": "line", "xref": "paper", "x0": 0, "x1": 1, "y0": line, "y1": line,
                    "line": {"color": "#16181d", "width": 1, "dash": "dash"}}]}})
}
