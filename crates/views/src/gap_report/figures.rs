//! The figures of a gap report, as data and layout for the plotting library.

use crate::plot::{colour_of, panel_title, pauses, rounded, stride, unit_of_time};
use air::geo::{Enu, wrap_deg};
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
    let span_s = s.time_s.last().unwrap_or(&0.0) - s.time_s.first().unwrap_or(&0.0);
    let (unit, seconds) = unit_of_time(span_s);
    let time: Vec<f64> = s.time_s.iter().step_by(step).map(|t| t / seconds).collect();
    let breaks = pauses(&time);
    let time = broken(list(&time, 1, 10.0 * seconds), &breaks);
    let trace = |name: &str, values: &[f64], axis: &str, colour: &str, per_unit: f64| {
        json!({"type": "scatter", "mode": "lines", "name": name, "x": time,
               "y": broken(list(values, step, per_unit), &breaks), "yaxis": axis,
               "legendgroup": name, "showlegend": axis == "y",
               "line": {"color": colour, "width": 1.4}})
    };
    let mut read = trace("read", &s.measured_ppm, "y", MEASURED, tenths);
    // Points, so that neither line hides what was read nor is hidden by it.
    read["mode"] = json!("markers");
    read["marker"] = json!({"size": 3.5, "color": MEASURED, "opacity": 0.6});
    json!({"data": [
        read,
        trace("base", &s.before_ppm, "y", BASE, tenths),
        trace("extended model", &s.after_ppm, "y", EXTENDED, tenths),
        trace("base", &s.before_standardised, "y2", BASE, 100.0),
        trace("extended model", &s.after_standardised, "y2", EXTENDED, 100.0),
    ], "layout": {
        "xaxis": {"title": {"text": format!("time, {unit}")}, "anchor": "y2"},
        "yaxis": {"title": {"text": format!("{}, ppm", gas.formula())}, "domain": [0.42, 1.0]},
        "yaxis2": {"title": {"text": "misfit, sd"}, "domain": [0.0, 0.34]},
    }})
}

/// `values` with a null before each of the `breaks`, where a line ends and begins anew.
fn broken(values: Vec<Value>, breaks: &[usize]) -> Vec<Value> {
    let mut out = Vec::with_capacity(values.len() + breaks.len());
    for (i, value) in values.into_iter().enumerate() {
        if breaks.binary_search(&i).is_ok() {
            out.push(Value::Null);
        }
        out.push(value);
    }
    out
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
    let source = Enu {
        east_m: report.source_m.0,
        north_m: report.source_m.1,
    };
    let length_m = farthest_m(report, source);
    let mut winds = Vec::new();
    for (axis, (wind_from_deg, left)) in ["", "2"].iter().zip([
        (report.wind_from_deg[0], 0.0),
        (report.wind_from_deg[1], 0.53),
    ]) {
        let far = source.displaced(wind_from_deg + 180.0, length_m);
        data.push(
            json!({"type": "scatter", "mode": "lines+markers", "hoverinfo": "skip",
            "x": [rounded(source.east_m, 1.0), rounded(far.east_m, 1.0)],
            "y": [rounded(source.north_m, 1.0), rounded(far.north_m, 1.0)],
            "xaxis": format!("x{axis}"), "yaxis": format!("y{axis}"), "showlegend": false,
            "line": {"color": "#16181d", "width": 1.2, "dash": "dashdot"},
            "marker": {"symbol": ["square", "arrow"], "angleref": "previous", "size": [8, 11],
                "color": "#16181d"}}),
        );
        winds.push(panel_title(
            &format!("wind from {:.0}°", wrap_deg(wind_from_deg)),
            "",
            left + 0.28,
            1.0,
        ));
    }
    json!({"data": data, "layout": {"margin": {"t": 30},
        "annotations": [panel_title("base", "", 0.0, 1.0), panel_title("extended model", "", 0.53, 1.0),
            winds[0], winds[1]],
        "xaxis": {"title": {"text": "east, m"}, "domain": [0.0, 0.47], "constrain": "domain"},
        "yaxis": {"title": {"text": "north, m"}, "scaleanchor": "x"},
        "xaxis2": {"title": {"text": "east, m"}, "domain": [0.53, 1.0], "anchor": "y2", "matches": "x"},
        "yaxis2": {"anchor": "x2", "matches": "y"},
    }})
}

/// Distance of the farthest reading from the source, m: as long as the axis is drawn.
fn farthest_m(report: &GapReport, source: Enu) -> f64 {
    let places = report
        .series
        .iter()
        .flat_map(|s| s.east_m.iter().zip(&s.north_m));
    let distance =
        |(east_m, north_m): (&f64, &f64)| (east_m - source.east_m).hypot(north_m - source.north_m);
    places.map(distance).fold(0.0, f64::max)
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
    let mut names: Vec<&str> = by.values().flat_map(|of| of.keys().copied()).collect();
    names.sort_unstable();
    names.dedup();
    // The misfit of all together and of each by itself are told apart by colour; one alone needs no legend.
    let mut layout = json!({"showlegend": names.len() > 1, "legend": legend_below(),
        "margin": {"t": 30, "b": if names.len() > 1 { 90 } else { 50 }}});
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
            let k = names.iter().position(|name| name == platform).unwrap_or(0);
            let first = !data.iter().any(|t: &Value| t["name"] == **platform);
            let middle = bins.iter().map(|b| match *coordinate {
                "platform" => json!(platform),
                _ => json!(rounded(0.5 * (b.from + b.to), 100.0)),
            });
            let misfit = bins.iter().map(|b| rounded(b.standardised, 100.0));
            data.push(
                json!({"type": "scatter", "mode": "lines+markers", "name": platform,
                "x": middle.collect::<Vec<_>>(), "y": misfit.collect::<Vec<_>>(),
                "xaxis": format!("x{suffix}"), "yaxis": format!("y{suffix}"),
                "legendgroup": platform, "showlegend": first,
                "marker": {"size": 5}, "line": {"width": 1.3, "color": colour_of(k)},
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
