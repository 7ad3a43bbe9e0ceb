//! The figures of a gap report, as data and layout for the plotting library.

use crate::plot::{panel_title, rounded, stride};
use gap::plume::{GapReport, Series};
use gap::tracer::ArcDetail;
use gap::verdict::{Ranked, ResidualBin};
use plume::Gas;
use serde_json::{Value, json};
use std::collections::BTreeMap;

/// Points of one line in a figure.
const POINTS: usize = 2500;
const BASE: &str = "#98a2b0";
const EXTENDED: &str = "#2f6f9f";
const MEASURED: &str = "#d3131f";

fn list(values: &[f64], step: usize, per_unit: f64) -> Vec<Value> {
    values
        .iter()
        .step_by(step)
        .map(|&v| rounded(v, per_unit))
        .collect()
}

/// Readings and predictions of one platform, with the standardised misfit below.
pub(super) fn series(s: &Series, gas: Gas) -> Value {
    let tenths = 10f64.powi(1 + i32::try_from(gas.digits()).unwrap_or_default());
    let step = stride(s.time_s.len(), POINTS);
    let time = list(&s.time_s, step, 10.0);
    let line = |name: &str, values: &[f64], axis: &str, colour: &str, per_unit: f64| {
        json!({"type": "scatter", "mode": "lines", "name": name, "x": time,
               "y": list(values, step, per_unit), "yaxis": axis, "legendgroup": name,
               "showlegend": axis == "y", "line": {"color": colour, "width": 1.4}})
    };
    json!({"data": [
        line("read", &s.measured_ppm, "y", MEASURED, tenths),
        line("base", &s.before_ppm, "y", BASE, tenths),
        line("extended model", &s.after_ppm, "y", EXTENDED, tenths),
        line("base", &s.before_standardised, "y2", BASE, 100.0),
        line("extended model", &s.after_standardised, "y2", EXTENDED, 100.0),
    ], "layout": {
        "xaxis": {"title": {"text": "time, s"}, "anchor": "y2"},
        "yaxis": {"title": {"text": format!("{}, ppm", gas.formula())}, "domain": [0.42, 1.0]},
        "yaxis2": {"title": {"text": "misfit, sd"}, "domain": [0.0, 0.34]},
    }})
}

/// The standardised misfit on the map, before and after.
pub(super) fn maps(report: &GapReport) -> Value {
    let mut data = Vec::new();
    let total: usize = report.series.iter().map(|s| s.time_s.len()).sum();
    let step = stride(total, 6000);
    for s in &report.series {
        for (axis, values) in [("", &s.before_standardised), ("2", &s.after_standardised)] {
            data.push(
                json!({"type": "scatter", "mode": "markers", "name": s.platform,
                "x": list(&s.east_m, step, 1.0), "y": list(&s.north_m, step, 1.0),
                "xaxis": format!("x{axis}"), "yaxis": format!("y{axis}"), "showlegend": false,
                "hovertemplate": format!("{}: %{{marker.color:.1f}} sd<extra></extra>", s.platform),
                "marker": {"size": 4.5, "color": list(values, step, 100.0), "cmin": -4, "cmax": 4,
                    "colorscale": [[0, "#1f5fa8"], [0.5, "#e3e3df"], [1, "#c4122b"]],
                    "showscale": data.is_empty(),
                    "colorbar": {"title": {"text": "sd"}, "thickness": 12, "len": 0.7}}}),
            );
        }
    }
    for axis in ["", "2"] {
        data.push(
            json!({"type": "scatter", "mode": "markers", "x": [rounded(report.source_m.0, 1.0)],
            "y": [rounded(report.source_m.1, 1.0)], "xaxis": format!("x{axis}"),
            "yaxis": format!("y{axis}"), "showlegend": false, "hoverinfo": "skip",
            "marker": {"symbol": "square", "size": 8, "color": "#16181d"}}),
        );
    }
    json!({"data": data, "layout": {"margin": {"t": 30},
        "annotations": [panel_title("base", "", 0.0, 1.0), panel_title("extended model", "", 0.53, 1.0)],
        "xaxis": {"title": {"text": "east, m"}, "domain": [0.0, 0.47], "constrain": "domain"},
        "yaxis": {"title": {"text": "north, m"}, "scaleanchor": "x"},
        "xaxis2": {"title": {"text": "east, m"}, "domain": [0.53, 1.0], "anchor": "y2", "matches": "x"},
        "yaxis2": {"anchor": "x2", "matches": "y"},
    }})
}

/// Memory of the misfit.
pub(super) fn autocorrelation(report: &GapReport) -> Value {
    let line = |name: &str, values: &[f64], colour: &str, dash: &str| {
        json!({"type": "scatter", "mode": "lines", "name": name, "y": list(values, 1, 1000.0),
               "line": {"color": colour, "width": 1.8, "dash": dash}})
    };
    json!({"data": [
        line("base, raw", &report.autocorrelation_raw, BASE, "dot"),
        line("base, standardised", &report.autocorrelation_before, BASE, "solid"),
        line("extended model, standardised", &report.autocorrelation_after, EXTENDED, "solid"),
    ], "layout": {"xaxis": {"title": {"text": "readings later"}},
                  "yaxis": {"title": {"text": "correlation"}, "range": [-0.3, 1.02]}}})
}

/// Mean standardised misfit along each coordinate, one panel a coordinate.
pub(super) fn bins(residual: &[ResidualBin]) -> Value {
    let mut by: BTreeMap<&str, BTreeMap<&str, Vec<&ResidualBin>>> = BTreeMap::new();
    for bin in residual {
        let platform = bin.platform.as_deref().unwrap_or("all");
        by.entry(&bin.coordinate)
            .or_default()
            .entry(platform)
            .or_default()
            .push(bin);
    }
    let panels = by.len().max(1) as f64;
    let mut data = Vec::new();
    let mut layout = json!({"showlegend": false, "margin": {"t": 30}});
    let mut titles = Vec::new();
    for (i, (coordinate, platforms)) in by.iter().enumerate() {
        let suffix = if i == 0 {
            String::new()
        } else {
            (i + 1).to_string()
        };
        let left = i as f64 / panels;
        let right = left + 0.82 / panels;
        let unit = platforms
            .values()
            .flatten()
            .next()
            .map_or("", |b| b.unit.as_str());
        layout[format!("xaxis{suffix}")] = json!({"domain": [left, right], "anchor": format!("y{suffix}"),
            "title": {"text": unit}, "type": if *coordinate == "platform" { "category" } else { "linear" }});
        layout[format!("yaxis{suffix}")] = json!({"anchor": format!("x{suffix}"),
            "title": {"text": if i == 0 { "misfit, sd" } else { "" }}});
        titles.push(panel_title(&coordinate.replace('_', " "), "", left, 1.0));
        for (platform, bins) in platforms {
            let middle = bins.iter().map(|b| match *coordinate {
                "platform" => json!(platform),
                _ => json!(rounded(0.5 * (b.from + b.to), 100.0)),
            });
            let misfit = bins.iter().map(|b| rounded(b.standardised, 100.0));
            data.push(
                json!({"type": "scatter", "mode": "lines+markers", "name": platform,
                "x": middle.collect::<Vec<_>>(), "y": misfit.collect::<Vec<_>>(),
                "xaxis": format!("x{suffix}"), "yaxis": format!("y{suffix}"),
                "marker": {"size": 5}, "line": {"width": 1.3},
                "hovertemplate": format!("{platform}: %{{y:.2f}} sd<extra></extra>")}),
            );
        }
    }
    layout["annotations"] = json!(titles);
    json!({"data": data, "layout": layout})
}

/// Height of the ranking, px.
pub(super) fn ranking_height(ranking: &[Ranked], most: usize) -> u32 {
    let rows = u32::try_from(ranking.len().min(most)).unwrap_or(0);
    90 + 22 * rows
}

/// Every model tried, by its evidence.
pub(super) fn ranking(ranking: &[Ranked], most: usize) -> Value {
    let shown: Vec<&Ranked> = ranking.iter().take(most).collect();
    let name = |(i, r): (usize, &&Ranked)| {
        let platform = r
            .platform
            .as_ref()
            .map_or_else(String::new, |p| format!(" ({p})"));
        // Two rows of one name would be drawn as one bar: the rank keeps them apart.
        format!("{}{platform}  {}", r.mechanisms.join(" + "), i + 1)
    };
    let colour = |r: &&Ranked| {
        if r.log_evidence > 0.0 {
            EXTENDED
        } else {
            "#c9cdd4"
        }
    };
    json!({"data": [{"type": "bar", "orientation": "h",
        "y": shown.iter().enumerate().map(name).collect::<Vec<_>>(),
        "x": shown.iter().map(|r| rounded(r.log_evidence, 10.0)).collect::<Vec<_>>(),
        "text": shown.iter().map(|r| format!("p {:.3}", r.probability)).collect::<Vec<_>>(),
        "textposition": "auto", "hovertemplate": "%{x:.1f} nats, %{text}<extra></extra>",
        "marker": {"color": shown.iter().map(colour).collect::<Vec<_>>()}}],
      "layout": {"xaxis": {"title": {"text": "gain of log evidence, nats"}},
                 "yaxis": {"autorange": "reversed", "automargin": true}}})
}

/// Gain on each block left out: from, to in s, and nats.
pub(super) fn blocks(blocks: &[(f64, f64, f64)]) -> Value {
    let values: Vec<f64> = blocks.iter().map(|b| b.2).collect();
    let middle = blocks.iter().map(|b| rounded(0.5 * (b.0 + b.1), 1.0));
    let width = blocks.iter().map(|b| rounded(0.9 * (b.1 - b.0), 1.0));
    let colour = |v: &f64| if *v >= 0.0 { EXTENDED } else { MEASURED };
    json!({"data": [{"type": "bar", "x": middle.collect::<Vec<_>>(), "width": width.collect::<Vec<_>>(),
        "y": list(&values, 1, 100.0),
        "marker": {"color": values.iter().map(colour).collect::<Vec<_>>()}}],
      "layout": {"xaxis": {"title": {"text": "time, s"}}, "yaxis": {"title": {"text": "gain, nats"}}}})
}

/// Predicted over measured on tracer arcs, by distance.
pub(super) fn arcs(arcs: &[ArcDetail]) -> Value {
    type Of = fn(&ArcDetail) -> f64;
    let panels: [(&str, Of, Of); 2] = [
        (
            "",
            |a| a.base_integrated_mg_m2 / a.integrated_mg_m2,
            |a| a.held_out_integrated_mg_m2 / a.integrated_mg_m2,
        ),
        (
            "2",
            |a| a.base_width_m / a.width_m,
            |a| a.held_out_width_m / a.width_m,
        ),
    ];
    let mut data = Vec::new();
    for (axis, base, extended) in panels {
        // Either side of the arc's distance, so that the points do not hide each other.
        for (air, symbol, beside) in [("unstable", "circle", 0.97), ("stable", "diamond", 1.03)] {
            let of_air = |a: &&ArcDetail| a.whole && a.group == air;
            let whole: Vec<&ArcDetail> = arcs.iter().filter(of_air).collect();
            for (model, of, colour, aside) in [
                ("base", base, BASE, 0.98 * beside),
                ("extended model", extended, EXTENDED, 1.02 * beside),
            ] {
                let name = format!("{model}, {air} air");
                data.push(json!({"type": "scatter", "mode": "markers", "name": name, "legendgroup": name,
                    "showlegend": axis.is_empty() && !whole.is_empty(),
                    "x": whole.iter().map(|a| rounded(a.distance_m * aside, 10.0)).collect::<Vec<_>>(),
                    "y": whole.iter().map(|a| rounded(of(a), 1000.0)).collect::<Vec<_>>(),
                    "text": whole.iter().map(|a| format!("trial {}, class {}, {}", a.trial, a.class, a.group)).collect::<Vec<_>>(),
                    "hovertemplate": "%{text}: %{y:.2f}<extra></extra>",
                    "xaxis": format!("x{axis}"), "yaxis": format!("y{axis}"),
                    "marker": {"size": 6, "color": colour, "symbol": symbol, "opacity": 0.75}}));
            }
        }
    }
    let log = |title: &str, domain: [f64; 2], anchor: &str| json!({"type": "log", "title": {"text": title}, "domain": domain, "anchor": anchor});
    json!({"data": data, "layout": {"margin": {"t": 48, "b": 96},
        "annotations": [panel_title("crosswind integral", "", 0.0, 1.0), panel_title("width", "", 0.55, 1.0)],
        "showlegend": true, "legend": legend_below(),
        "xaxis": log("distance, m", [0.0, 0.45], "y"), "xaxis2": log("distance, m", [0.55, 1.0], "y2"),
        "yaxis": {"type": "log", "title": {"text": "predicted / measured"}},
        "yaxis2": {"type": "log", "anchor": "x2"},
        "shapes": [line_at_one("x", "y"), line_at_one("x2", "y2")]}})
}

/// A legend below the axes, where the panels' titles stand above.
pub(super) fn legend_below() -> Value {
    json!({"orientation": "h", "x": 0.0, "y": -0.2, "yanchor": "top"})
}

fn line_at_one(x: &str, y: &str) -> Value {
    json!({"type": "line", "xref": format!("{x} domain"), "yref": y, "x0": 0, "x1": 1, "y0": 1, "y1": 1,
           "line": {"color": "#16181d", "width": 1, "dash": "dash"}})
}
