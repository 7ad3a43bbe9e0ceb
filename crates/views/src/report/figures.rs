//! The figures of a mission report, as data and layout for the plotting library.

use super::Expected;
use crate::plot::{panel_title, rounded};
use crate::site::{Area, Grid, SiteMap};
use air::geo::{Enu, wrap_deg, wrap_signed_deg};
use protocol::message::{Model, VehicleKind};
use record::colour::{Shown, stops};
use record::summary::{CORRECTED, MissionSummary, ModelNumbers};
use record::tracks::{Tracks, VehicleTrack};
use serde_json::{Value, json};

/// Columns of the grid of a contour.
const COLUMNS: usize = 110;

fn km(value_m: f64) -> Value {
    rounded(value_m / 1000.0, 1e4)
}

/// The map of tracks with the plume of the model and of reality.
pub(super) fn map(
    site: &SiteMap,
    tracks: &Tracks,
    after: Option<&Model>,
    summary: &MissionSummary,
) -> Value {
    let area = site.area(tracks).widened(400.0);
    let mut data = Vec::new();
    if let Some(model) = after {
        data.extend(plumes(site, model, area));
    }
    data.extend(track_traces(site, tracks));
    data.extend(surroundings(site));
    let peak = |[lat_deg, lon_deg, ppm]: [f64; 3], name: &str, symbol: &str, colour: &str| {
        let at = site.enu(lat_deg, lon_deg);
        json!({"type": "scatter", "mode": "markers", "name": name, "x": [km(at.east_m)],
               "y": [km(at.north_m)], "marker": {"symbol": symbol, "size": 15, "color": colour,
               "line": {"width": 2, "color": colour}},
               "hovertemplate": format!("{name}: {} ppm<extra></extra>", site.shown.number(ppm))})
    };
    let found = summary.peak.estimate.as_ref();
    let found = found.map(|p| [p.lat_deg, p.lon_deg, p.co2_ppm]);
    data.extend(found.map(|p| peak(p, "peak found", "circle-open", "#d3131f")));
    let truth = summary.peak.truth.as_ref();
    let truth = truth.map(|p| [p.lat_deg, p.lon_deg, p.co2_ppm]);
    data.extend(truth.map(|p| peak(p, "true peak", "cross-thin-open", "#16181d")));
    data.extend(after.map(|model| axis(site, model, area)));
    json!({"data": data, "layout": {
        "annotations": after.map(wind).into_iter().flatten().collect::<Vec<_>>(),
        "xaxis": {"title": {"text": "east, km"}, "range": [km(area.low.east_m), km(area.high.east_m)],
                  "constrain": "domain"},
        "yaxis": {"title": {"text": "north, km"}, "range": [km(area.low.north_m), km(area.high.north_m)],
                  "scaleanchor": "x", "constrain": "domain"},
    }})
}

/// The model's axis from the first source to beyond the map.
fn axis(site: &SiteMap, model: &Model, area: Area) -> Value {
    let source = site.stacks.first();
    let from = source.map_or(Enu::default(), |s| site.enu(s.lat_deg, s.lon_deg));
    let far = from.displaced(model.axis_deg.value, area.low.distance_m(area.high));
    json!({"type": "scatter", "mode": "lines", "name": "the model's axis", "hoverinfo": "skip",
        "x": [km(from.east_m), km(far.east_m)], "y": [km(from.north_m), km(far.north_m)],
        "line": {"color": "rgba(47,111,159,.8)", "width": 1.2, "dash": "dashdot"}})
}

/// The wind in words, and below them an arrow that goes with it, in the map's upper right.
fn wind(model: &Model) -> [Value; 2] {
    let (sin, cos) = model.axis_deg.value.to_radians().sin_cos();
    let from_deg = wrap_deg(model.axis_deg.value + 180.0);
    let words = json!({"xref": "paper", "yref": "paper", "x": 0.98, "y": 0.98, "xanchor": "right", "yanchor": "top",
        "showarrow": false, "text": format!("wind {:.1} m/s from {from_deg:.0}°", model.wind_speed_m_s),
        "font": {"color": "#2f6f9f"}, "bgcolor": "rgba(255,255,255,.8)"});
    // In pixels with y downwards: its middle stands below the middle of the words, its tail a whole length behind its head.
    let arrow = json!({"xref": "paper", "yref": "paper", "x": 0.98, "y": 0.98, "text": "",
        "xshift": -70.0 + 22.0 * sin, "yshift": -52.0 + 22.0 * cos, "ax": -44.0 * sin, "ay": 44.0 * cos,
        "showarrow": true, "arrowhead": 2, "arrowwidth": 2.5, "arrowcolor": "#2f6f9f"});
    [words, arrow]
}

fn plumes(site: &SiteMap, model: &Model, area: Area) -> Vec<Value> {
    let alt = site.axis_amsl_m(model);
    let background = model.background_ppm.value;
    let fields = [
        Some(Grid::fill(area, COLUMNS, alt, |s| (site.field)(model, s))),
        site.reality
            .as_ref()
            .map(|reality| Grid::fill(area, COLUMNS, alt, |s| reality(s))),
    ];
    let styles = [
        ("model", "rgba(47,111,159,.9)", "solid"),
        ("reality", "#3a3f48", "dash"),
    ];
    let mut traces = Vec::new();
    for (grid, (name, colour, dash)) in fields.iter().zip(styles) {
        let Some(grid) = grid else { continue };
        let excess = |shown: fn(f64) -> f64| -> Vec<Vec<Value>> {
            let cell = |p: &f64| {
                rounded(
                    shown((p - background).max(0.0)),
                    1e2 * site.shown.steps_per_ppm(),
                )
            };
            grid.rows()
                .map(|row| row.iter().map(cell).collect())
                .collect()
        };
        let axis = |m: &[f64]| m.iter().map(|&v| km(v)).collect::<Vec<_>>();
        let (x, y) = (axis(&grid.east_m), axis(&grid.north_m));
        if name == "model" {
            traces.push(
                json!({"type": "heatmap", "x": x, "y": y, "z": excess(f64::sqrt),
                "zsmooth": "best", "showscale": false, "hoverinfo": "skip", "zmin": 0, "zmax": site.shown.darkest_ppm().sqrt(),
                "colorscale": [[0, "rgba(47,111,159,0)"], [1, "rgba(47,111,159,.55)"]]}),
            );
        }
        // One trace a level: contour levels grow by a factor, which one trace cannot do.
        for (i, level) in site.shown.levels_ppm().iter().enumerate() {
            traces.push(
                json!({"type": "contour", "x": x, "y": y, "z": excess(|p| p),
                "name": name, "legendgroup": name, "showlegend": i == 0, "showscale": false,
                "hoverinfo": "skip", "autocontour": false,
                "contours": {"start": level, "end": level, "size": 1, "coloring": "none"},
                "line": {"color": colour, "width": 1.1, "dash": dash}}),
            );
        }
    }
    traces
}

/// Most vehicles of which each has its own name in the map and in the legend: more names than these cover the plume.
const NAMED_VEHICLES: usize = 12;

fn track_traces(site: &SiteMap, tracks: &Tracks) -> Vec<Value> {
    let scale: Vec<Value> = stops().into_iter().map(|(at, c)| json!([at, c])).collect();
    // Readings below its foot and above its head have the colours of these.
    let (low, high) = (site.shown.grey_ppm, site.shown.red_ppm);
    let ticks = [0.0, 1.0 / 3.0, 2.0 / 3.0, 1.0].map(|along| low + along * (high - low));
    let signs = ["≤ ", "", "", "≥ "];
    let labels: Vec<String> = signs
        .iter()
        .zip(ticks)
        .map(|(sign, ppm)| format!("{sign}{}", site.shown.number(ppm)))
        .collect();
    let simulated = |t: &VehicleTrack| t.kind == VehicleKind::Simulated;
    let mut by_vehicle = tracks.by_vehicle().iter();
    let first_simulated = by_vehicle.find(|(_, t)| simulated(t)).map(|(id, _)| id);
    let each = tracks.by_vehicle().len() <= NAMED_VEHICLES;
    let trace = |(i, (id, track)): (usize, (&String, &VehicleTrack))| {
        let points = track.points.items();
        let places: Vec<Enu> = points
            .iter()
            .map(|p| site.enu(p.lat_deg, p.lon_deg))
            .collect();
        let real = track.kind == VehicleKind::Real;
        let own = real || each;
        let kind = if real { "real" } else { "simulated" };
        json!({"type": "scatter", "mode": "markers",
            "name": if own { format!("vehicle {id}, {kind}") } else { "simulated vehicles".to_owned() },
            "legendgroup": if own { id.as_str() } else { "simulated" },
            "showlegend": own || first_simulated == Some(id),
            "x": places.iter().map(|p| km(p.east_m)).collect::<Vec<_>>(),
            "y": places.iter().map(|p| km(p.north_m)).collect::<Vec<_>>(),
            "text": points.iter().map(|p| format!("{:.0} s, {:.0} m AMSL", p.time_s, p.alt_amsl_m))
                .collect::<Vec<_>>(),
            "hovertemplate": format!("vehicle {id}, %{{text}}<br>%{{marker.color:.{}f}} ppm<extra></extra>", site.shown.gas.digits()),
            "marker": {"size": points.iter().map(|p| size(real, site.shown.along(p.co2_ppm))).collect::<Vec<_>>(),
                "line": {"width": 0}, "symbol": if real { "diamond" } else { "circle" },
                "color": points.iter().map(|p| rounded(p.co2_ppm, 10.0 * site.shown.steps_per_ppm())).collect::<Vec<_>>(),
                "colorscale": scale, "cmin": low, "cmax": high,
                "showscale": i == 0,
                "colorbar": {"title": {"text": site.shown.axis()}, "thickness": 12, "len": 0.6, "tickvals": ticks,
                    "ticktext": labels}}})
    };
    let mut traces: Vec<Value> = tracks.by_vehicle().iter().enumerate().map(trace).collect();
    if each {
        traces.extend(
            tracks
                .by_vehicle()
                .iter()
                .filter_map(|(id, track)| name(site, id, track)),
        );
    }
    traces
}

/// The name of a vehicle where it was farthest from its first place: at home they all stand together.
fn name(site: &SiteMap, id: &str, track: &VehicleTrack) -> Option<Value> {
    let places = track
        .points
        .items()
        .iter()
        .map(|p| site.enu(p.lat_deg, p.lon_deg));
    let home = places.clone().next()?;
    let at = places.max_by(|a, b| home.distance_m(*a).total_cmp(&home.distance_m(*b)))?;
    Some(
        json!({"type": "scatter", "mode": "text", "x": [km(at.east_m)], "y": [km(at.north_m)],
        "text": [id], "textposition": "top right", "showlegend": false, "legendgroup": id,
        "hoverinfo": "skip", "textfont": {"size": 13, "color": "#16181d"}}),
    )
}

/// Size of a point, px: clean air must not hide the plume.
fn size(real: bool, along: f64) -> Value {
    let least = if real { 2.6 } else { 1.8 };
    rounded(least + 3.2 * along, 10.0)
}

fn surroundings(site: &SiteMap) -> Vec<Value> {
    let mut traces = Vec::new();
    for stack in &site.stacks {
        let at = site.enu(stack.lat_deg, stack.lon_deg);
        let circle: Vec<Enu> = (0..=72)
            .map(|i| at.displaced(5.0 * f64::from(i), site.keep_out_radius_m))
            .collect();
        traces.push(outline(&circle, "keep-out cylinder", "dot"));
        traces.push(
            json!({"type": "scatter", "mode": "markers+text", "x": [km(at.east_m)],
            "y": [km(at.north_m)], "text": [stack.name], "textposition": "middle right",
            "showlegend": false, "hoverinfo": "skip",
            "marker": {"symbol": "square", "size": 8, "color": "#16181d"}}),
        );
    }
    if site.fence.len() > 2 {
        let corners = site.fence.iter().chain(site.fence.first());
        let fence: Vec<Enu> = corners.map(|&(lat, lon)| site.enu(lat, lon)).collect();
        traces.push(outline(&fence, "fence", "dash"));
    }
    traces
}

fn outline(points: &[Enu], name: &str, dash: &str) -> Value {
    json!({"type": "scatter", "mode": "lines", "name": name, "hoverinfo": "skip",
        "x": points.iter().map(|p| km(p.east_m)).collect::<Vec<_>>(),
        "y": points.iter().map(|p| km(p.north_m)).collect::<Vec<_>>(),
        "line": {"color": "#8c94a1", "width": 1.3, "dash": dash}})
}

/// The model's numbers along the mission: two rows of three panels.
pub(super) fn history(
    history: &[(f64, Box<Model>)],
    reality: Option<&ModelNumbers>,
    shown: &Shown,
) -> Value {
    let minutes: Vec<Value> = history
        .iter()
        .map(|(t, _)| rounded(t / 60.0, 1e3))
        .collect();
    let steps = 1e3 * shown.steps_per_ppm();
    let numbers: Vec<ModelNumbers> = history.iter().map(|(_, m)| m.as_ref().into()).collect();
    let mut data = Vec::new();
    let mut layout = json!({"showlegend": false, "annotations": [], "margin": {"t": 30}});
    let mut titles = Vec::new();
    for (i, n) in CORRECTED.iter().enumerate() {
        let (column, row) = (i % 3, i / 3);
        let suffix = if i == 0 {
            String::new()
        } else {
            (i + 1).to_string()
        };
        let (xaxis, yaxis) = (format!("x{suffix}"), format!("y{suffix}"));
        let left = column as f64 * 0.36;
        let foot = if row == 0 { 0.58 } else { 0.0 };
        let title = if row == 1 { "min" } else { "" };
        layout[format!("xaxis{suffix}")] =
            json!({"domain": [left, left + 0.28], "anchor": yaxis, "title": {"text": title}});
        layout[format!("yaxis{suffix}")] = json!({"domain": [foot, foot + 0.42], "anchor": xaxis,
            // None but an angle goes below nought, whatever its standard deviation.
            "rangemode": if n.turns() { "normal" } else { "nonnegative" }});
        titles.push(panel_title(
            n.name,
            &n.unit_of(shown.gas),
            left,
            foot + 0.42,
        ));
        // An angle is drawn around the last one, so that north is no cliff.
        let last = numbers.last().map_or(0.0, |m| (n.of)(m).value);
        let turned = |v: f64| {
            if n.turns() {
                last + wrap_signed_deg(v - last)
            } else {
                v
            }
        };
        let values: Vec<f64> = numbers.iter().map(|m| turned((n.of)(m).value)).collect();
        let spread: Vec<f64> = numbers.iter().map(|m| 2.0 * (n.of)(m).sd).collect();
        let line = |sign: f64| -> Vec<Value> {
            let pairs = values.iter().zip(&spread);
            pairs.map(|(v, s)| rounded(v + sign * s, steps)).collect()
        };
        let trace = |y: Vec<Value>, style: Value| {
            let mut trace = json!({"type": "scatter", "mode": "lines", "x": minutes, "y": y,
                                   "xaxis": xaxis, "yaxis": yaxis});
            if let (Some(into), Value::Object(from)) = (trace.as_object_mut(), style) {
                into.extend(from);
            }
            trace
        };
        data.push(trace(
            line(-1.0),
            json!({"line": {"width": 0}, "hoverinfo": "skip"}),
        ));
        let band = json!({"line": {"width": 0}, "hoverinfo": "skip", "fill": "tonexty",
                          "fillcolor": "rgba(47,111,159,.18)"});
        data.push(trace(line(1.0), band));
        data.push(trace(
            line(0.0),
            json!({"line": {"width": 2, "color": "#2f6f9f"}}),
        ));
        if let Some(reality) = reality {
            let truth = vec![rounded(turned((n.of)(reality).value), steps); minutes.len()];
            let dashed = json!({"line": {"width": 1.5, "color": "#3a3f48", "dash": "dash"}});
            data.push(trace(truth, dashed));
        }
    }
    layout["annotations"] = json!(titles);
    json!({"data": data, "layout": layout})
}

/// Readings of real vehicles with what was expected, and the difference.
pub(super) fn readings(expected: &[Expected<'_>], shown: &Shown) -> Value {
    let tenths = 10.0 * shown.steps_per_ppm();
    let mut data = Vec::new();
    for (i, e) in expected.iter().enumerate() {
        let minutes: Vec<Value> = e.time_s.iter().map(|t| rounded(t / 60.0, 1e3)).collect();
        let ppm = |v: &[f64]| v.iter().map(|&p| rounded(p, tenths)).collect::<Vec<_>>();
        let rest = |of: &[f64]| -> Vec<Value> {
            e.read_ppm
                .iter()
                .zip(of)
                .map(|(r, x)| rounded(r - x, tenths))
                .collect()
        };
        let mut line = |name: &str, y: Vec<Value>, axis: &str, colour: &str, width: f64| {
            data.push(
                json!({"type": "scatter", "mode": "lines", "x": minutes, "y": y,
                "name": format!("{name}, vehicle {}", e.id), "yaxis": axis,
                "legendgroup": name, "showlegend": axis == "y",
                // Several real vehicles would hide one another: the others wait in the legend.
                "visible": if i == 0 { json!(true) } else { json!("legendonly") },
                "line": {"color": colour, "width": width}}),
            );
        };
        line("read", ppm(&e.read_ppm), "y", "#d3131f", 1.4);
        line("predicted before", ppm(&e.before_ppm), "y", "#a7b0bd", 1.4);
        line("predicted after", ppm(&e.after_ppm), "y", "#2f6f9f", 1.6);
        line(
            "predicted before",
            rest(&e.before_ppm),
            "y2",
            "#a7b0bd",
            1.2,
        );
        line("predicted after", rest(&e.after_ppm), "y2", "#2f6f9f", 1.4);
    }
    json!({"data": data, "layout": {
        "xaxis": {"title": {"text": "min"}, "anchor": "y2"},
        "yaxis": {"title": {"text": shown.axis()}, "domain": [0.42, 1.0]},
        "yaxis2": {"title": {"text": "rest, ppm"}, "domain": [0.0, 0.34]},
    }})
}
