//! The figures of a gap report.

use crate::figure::{
    Axis, BASE, Bars, ColourScale, Column, Dash, Detail, Figure, INK, Layer, Line, MEASURED, MODEL,
    Panel, Points, Rule, Symbol, Wind, colour_of, pauses, stride, unit_of_time,
};
use air::geo::{Enu, wrap_deg};
use gap::plume::{GapReport, Series};
use gap::tracer::ArcDetail;
use gap::verdict::{Ranked, ResidualBin};
use plume::Gas;
use std::collections::BTreeMap;

/// Points of one line in a figure.
const POINTS: usize = 2500;
/// Points of a map.
const MAP_POINTS: usize = 6000;
/// A misfit beyond this is off the axis, standard deviations: one spike would flatten all others.
const MISFIT_SHOWN_SD: f64 = 15.0;
/// Models are shown down to a loss of this evidence at least, nats; bars that go further are cut and have their value.
const LEAST_SHOWN_NATS: f64 = 10.0;
/// Misfits at which the colours of a map end, standard deviations.
const COLOURED_SD: f64 = 4.0;

fn figure(columns: usize, panels: Vec<Panel>) -> Figure {
    Figure {
        columns,
        panels,
        scale: None,
    }
}

fn line(name: &str, colour: &'static str, x: Column, y: Column) -> Line {
    Line {
        name: name.to_owned(),
        colour,
        width: 1.4,
        x,
        y,
        ..Line::default()
    }
}

/// Readings and predictions of one platform, with the standardised misfit below.
pub(super) fn series(s: &Series, gas: Gas) -> Figure {
    let tenths = 10f64.powi(1 + i32::try_from(gas.digits()).unwrap_or_default());
    let step = stride(s.time_s.len(), POINTS);
    let span_s = s.time_s.last().unwrap_or(&0.0) - s.time_s.first().unwrap_or(&0.0);
    let (unit, seconds) = unit_of_time(span_s);
    let time: Vec<f64> = s.time_s.iter().step_by(step).map(|t| t / seconds).collect();
    let breaks = pauses(&time);
    let time = Column::new(time, 10.0 * seconds).broken(&breaks);
    let values = |of: &[f64], per_unit: f64| {
        Column::new(of.iter().step_by(step).copied(), per_unit).broken(&breaks)
    };
    let drawn = |name: &str, of: &[f64], colour, per_unit: f64| {
        Layer::Line(line(name, colour, time.clone(), values(of, per_unit)))
    };
    // Points, so that neither line hides what was read nor is hidden by it.
    let read = Layer::Points(Points {
        name: "read".to_owned(),
        colour: Some(MEASURED),
        size: 3.5,
        opacity: Some(0.6),
        x: time.clone(),
        y: values(&s.measured_ppm, tenths),
        ..Points::default()
    });
    let above = Panel {
        height: Some(220),
        linked: Some("time"),
        x: Axis {
            hidden: true,
            ..Axis::new("time", unit)
        },
        y: Axis::new(gas.formula(), "ppm"),
        layers: vec![
            read,
            drawn("base", &s.before_ppm, BASE, tenths),
            drawn("extended model", &s.after_ppm, MODEL, tenths),
        ],
        ..Panel::default()
    };
    let below = Panel {
        height: Some(130),
        linked: Some("time"),
        x: Axis::new("time", unit),
        y: Axis {
            limits: Some([-MISFIT_SHOWN_SD, MISFIT_SHOWN_SD]),
            ..Axis::new("misfit", "sd")
        },
        layers: vec![
            drawn("base", &s.before_standardised, BASE, 100.0),
            drawn("extended model", &s.after_standardised, MODEL, 100.0),
        ],
        ..Panel::default()
    };
    figure(1, vec![above, below])
}

/// The standardised misfit on the map, before and after.
pub(super) fn maps(report: &GapReport) -> Figure {
    let total: usize = report.series.iter().map(|s| s.time_s.len()).sum();
    let step = stride(total, MAP_POINTS);
    let source = Enu {
        east_m: report.source_m.0,
        north_m: report.source_m.1,
    };
    let length_m = farthest_m(report, source);
    let [base, extended] = report.wind_from_deg;
    let panel = |title: &str, of: fn(&Series) -> &[f64], wind_from_deg: f64| {
        let mut layers: Vec<Layer> = report
            .series
            .iter()
            .map(|s| misfits(s, of(s), step))
            .collect();
        layers.extend(transport(source, wind_from_deg, length_m));
        Panel {
            title: title.to_owned(),
            height: Some(460),
            equal: true,
            linked: Some("map"),
            wind: Some(Wind {
                text: format!("wind from {:.0}°", wrap_deg(wind_from_deg)),
                towards_deg: wind_from_deg + 180.0,
            }),
            x: Axis::new("east", "m"),
            y: Axis::new("north", "m"),
            layers,
        }
    };
    let panels = vec![
        panel("base", |s| &s.before_standardised, base),
        panel("extended model", |s| &s.after_standardised, extended),
    ];
    Figure {
        columns: 2,
        panels,
        scale: Some(misfit_scale()),
    }
}

/// The misfit of one platform at its places.
fn misfits(s: &Series, misfit: &[f64], step: usize) -> Layer {
    let thinned =
        |values: &[f64], per_unit: f64| Column::new(values.iter().step_by(step).copied(), per_unit);
    let detail = |name: &str, unit: &str, values: Column| Detail {
        name: name.to_owned(),
        unit: unit.to_owned(),
        values: Some(values),
        texts: None,
    };
    let misfit = thinned(misfit, 100.0);
    let platform = vec![s.platform.clone(); s.time_s.len().div_ceil(step)];
    Layer::Points(Points {
        size: 4.5,
        x: thinned(&s.east_m, 1.0),
        y: thinned(&s.north_m, 1.0),
        details: vec![
            Detail {
                name: "platform".to_owned(),
                texts: Some(platform),
                ..Detail::default()
            },
            detail("misfit", "sd", misfit.clone()),
            detail("time", "s", thinned(&s.time_s, 1.0)),
        ],
        values: Some(misfit),
        ..Points::default()
    })
}

/// The source, and the way of the plume as far as anything was read.
fn transport(source: Enu, wind_from_deg: f64, length_m: f64) -> [Layer; 2] {
    let far = source.displaced(wind_from_deg + 180.0, length_m);
    let axis = Line {
        dash: Dash::Mixed,
        width: 1.2,
        arrow: true,
        silent: true,
        ..line(
            "",
            INK,
            Column::new([source.east_m, far.east_m], 1.0),
            Column::new([source.north_m, far.north_m], 1.0),
        )
    };
    let at = Points {
        colour: Some(INK),
        symbol: Symbol::Square,
        size: 8.0,
        silent: true,
        x: Column::new([source.east_m], 1.0),
        y: Column::new([source.north_m], 1.0),
        ..Points::default()
    };
    [Layer::Line(axis), Layer::Points(at)]
}

/// Blue where less was read than predicted, red where more.
fn misfit_scale() -> ColourScale {
    let stops = [(0.0, "#1f5fa8"), (0.5, "#e3e3df"), (1.0, "#c4122b")];
    let ticks = [
        (-COLOURED_SD, "≤ −4"),
        (-2.0, "−2"),
        (0.0, "0"),
        (2.0, "2"),
        (COLOURED_SD, "≥ 4"),
    ];
    let owned = |list: &[(f64, &str)]| -> Vec<(f64, String)> {
        let one = |(value, text): &(f64, &str)| (*value, (*text).to_owned());
        list.iter().map(one).collect()
    };
    ColourScale {
        title: "misfit, sd".to_owned(),
        low: -COLOURED_SD,
        high: COLOURED_SD,
        colours: owned(&stops),
        ticks: owned(&ticks),
        both: true,
    }
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
pub(super) fn autocorrelation(report: &GapReport) -> Figure {
    let drawn = |name: &str, values: &[f64], colour, dash| {
        Layer::Line(Line {
            width: 1.8,
            dash,
            ..line(
                name,
                colour,
                Column::new((0..values.len()).map(|k| k as f64), 1.0),
                Column::new(values.iter().copied(), 1000.0),
            )
        })
    };
    let (raw, before, after) = (
        &report.autocorrelation_raw,
        &report.autocorrelation_before,
        &report.autocorrelation_after,
    );
    let panel = Panel {
        height: Some(200),
        x: Axis::new("readings later", ""),
        y: Axis {
            range: Some([-0.3, 1.02]),
            ..Axis::new("correlation", "")
        },
        layers: vec![
            drawn("base, raw", raw, BASE, Dash::Dotted),
            drawn("base, standardised", before, BASE, Dash::Solid),
            drawn("extended model, standardised", after, MODEL, Dash::Solid),
        ],
        ..Panel::default()
    };
    figure(1, vec![panel])
}

/// Mean standardised misfit along each coordinate, one panel a coordinate.
pub(super) fn bins(residual: &[ResidualBin]) -> Figure {
    let mut by: BTreeMap<&str, BTreeMap<&str, Vec<&ResidualBin>>> = BTreeMap::new();
    for bin in residual {
        let platform = bin.platform.as_deref().unwrap_or("all");
        let of_coordinate = by.entry(&bin.coordinate).or_default();
        of_coordinate.entry(platform).or_default().push(bin);
    }
    let mut names: Vec<&str> = by.values().flat_map(|of| of.keys().copied()).collect();
    names.sort_unstable();
    names.dedup();
    let colour = |platform: &str| {
        let k = names.iter().position(|name| *name == platform);
        colour_of(k.unwrap_or(0))
    };
    let panel = |(coordinate, platforms): (&&str, &BTreeMap<&str, Vec<&ResidualBin>>)| {
        let title = coordinate.replace('_', " ");
        if *coordinate == "platform" {
            by_platform(title, platforms)
        } else {
            by_coordinate(title, platforms, colour)
        }
    };
    let panels: Vec<Panel> = by.iter().map(panel).collect();
    figure(panels.len().min(3), panels)
}

/// The misfit of each platform as a whole.
fn by_platform(title: String, platforms: &BTreeMap<&str, Vec<&ResidualBin>>) -> Panel {
    let misfit: Vec<f64> = platforms
        .values()
        .filter_map(|bins| bins.first())
        .map(|b| b.standardised)
        .collect();
    let bars = Bars {
        colour: MODEL,
        horizontal: true,
        y: Column::new((0..misfit.len()).map(|k| k as f64), 1.0),
        x: Column::new(misfit, 100.0),
        ..Bars::default()
    };
    Panel {
        title,
        x: Axis::new("misfit", "sd"),
        y: Axis {
            names: Some(platforms.keys().map(|name| (*name).to_owned()).collect()),
            ..Axis::default()
        },
        layers: vec![Layer::Bars(bars)],
        ..Panel::default()
    }
}

/// The misfit of each platform along a coordinate.
fn by_coordinate(
    title: String,
    platforms: &BTreeMap<&str, Vec<&ResidualBin>>,
    colour: impl Fn(&str) -> &'static str,
) -> Panel {
    let mut bins = platforms.values().flatten();
    let unit = bins.next().map_or("", |b| b.unit.as_str());
    let mut layers = Vec::new();
    for (platform, bins) in platforms {
        let middle = Column::new(bins.iter().map(|b| 0.5 * (b.from + b.to)), 100.0);
        let misfit = Column::new(bins.iter().map(|b| b.standardised), 100.0);
        let colour = colour(platform);
        layers.push(Layer::Line(Line {
            silent: true,
            ..line(platform, colour, middle.clone(), misfit.clone())
        }));
        layers.push(Layer::Points(Points {
            name: (*platform).to_owned(),
            colour: Some(colour),
            size: 5.0,
            x: middle,
            y: misfit,
            ..Points::default()
        }));
    }
    Panel {
        x: Axis::new(&title, unit),
        title,
        height: Some(200),
        y: Axis {
            shared: Some("misfit"),
            ..Axis::new("misfit", "sd")
        },
        layers,
        ..Panel::default()
    }
}

/// Every model tried, by its evidence.
pub(super) fn ranking(ranking: &[Ranked], most: usize) -> Figure {
    let shown: Vec<&Ranked> = ranking.iter().take(most).collect();
    let name = |r: &&Ranked| {
        let platform = r.platform.as_ref();
        let platform = platform.map_or_else(String::new, |p| format!(" ({p})"));
        format!("{}{platform}", r.mechanisms.join(" + "))
    };
    let colour = |r: &&Ranked| match r.log_evidence > 0.0 {
        true => MODEL,
        false => BASE,
    };
    let bars = Bars {
        colour: MODEL,
        colours: Some(shown.iter().map(colour).collect()),
        horizontal: true,
        y: Column::new((0..shown.len()).map(|k| k as f64), 1.0),
        x: Column::new(shown.iter().map(|r| r.log_evidence), 10.0),
        texts: Some(
            shown
                .iter()
                .map(|r| format!("p {:.3}", r.probability))
                .collect(),
        ),
        ..Bars::default()
    };
    // A model that is far worse than the base would hide the others.
    let most = shown
        .iter()
        .map(|r| r.log_evidence)
        .fold(LEAST_SHOWN_NATS, f64::max);
    let panel = Panel {
        x: Axis {
            limits: Some([-most, most]),
            ..Axis::new("gain of log evidence", "nats")
        },
        y: Axis {
            names: Some(shown.iter().map(name).collect()),
            ..Axis::default()
        },
        layers: vec![Layer::Bars(bars)],
        ..Panel::default()
    };
    figure(1, vec![panel])
}

/// Gain on each block left out: from, to in s, and nats.
pub(super) fn blocks(blocks: &[(f64, f64, f64)]) -> Figure {
    let colour = |b: &(f64, f64, f64)| if b.2 >= 0.0 { MODEL } else { MEASURED };
    let bars = Bars {
        colour: MODEL,
        colours: Some(blocks.iter().map(colour).collect()),
        x: Column::new(blocks.iter().map(|b| 0.5 * (b.0 + b.1)), 1.0),
        widths: Some(Column::new(blocks.iter().map(|b| 0.9 * (b.1 - b.0)), 1.0)),
        y: Column::new(blocks.iter().map(|b| b.2), 100.0),
        ..Bars::default()
    };
    let panel = Panel {
        height: Some(170),
        x: Axis::new("time", "s"),
        y: Axis::new("gain", "nats"),
        layers: vec![Layer::Bars(bars)],
        ..Panel::default()
    };
    figure(1, vec![panel])
}

/// Predicted over measured on tracer arcs, by distance.
pub(super) fn arcs(arcs: &[ArcDetail]) -> Figure {
    let integral = arcs_panel(
        arcs,
        "crosswind integral",
        |a| a.base_integrated_mg_m2 / a.integrated_mg_m2,
        |a| a.held_out_integrated_mg_m2 / a.integrated_mg_m2,
    );
    let width = arcs_panel(
        arcs,
        "width",
        |a| a.base_width_m / a.width_m,
        |a| a.held_out_width_m / a.width_m,
    );
    figure(2, vec![integral, width])
}

type OfArc = fn(&ArcDetail) -> f64;

fn arcs_panel(arcs: &[ArcDetail], title: &str, base: OfArc, extended: OfArc) -> Panel {
    let mut layers = vec![Layer::Rule(Rule {
        y: Some(1.0),
        ..Rule::default()
    })];
    // Either side of the arc's distance, so that the points do not hide each other.
    for (air, symbol, beside) in [
        ("unstable", Symbol::Dot, 0.97),
        ("stable", Symbol::Diamond, 1.03),
    ] {
        let of_air = |a: &&ArcDetail| a.whole && a.group == air;
        let whole: Vec<&ArcDetail> = arcs.iter().filter(of_air).collect();
        if whole.is_empty() {
            continue;
        }
        let trial = |a: &&ArcDetail| format!("{}, class {}", a.trial, a.class);
        for (model, of, colour, aside) in [
            ("base", base, BASE, 0.98 * beside),
            ("extended model", extended, MODEL, 1.02 * beside),
        ] {
            layers.push(Layer::Points(Points {
                name: format!("{model}, {air} air"),
                colour: Some(colour),
                symbol,
                size: 6.0,
                opacity: Some(0.75),
                x: Column::new(whole.iter().map(|a| a.distance_m * aside), 10.0),
                y: Column::new(whole.iter().map(|a| of(a)), 1000.0),
                details: vec![Detail {
                    name: "trial".to_owned(),
                    texts: Some(whole.iter().map(trial).collect()),
                    ..Detail::default()
                }],
                ..Points::default()
            }));
        }
    }
    let log = |name: &str, unit: &str| Axis {
        log: true,
        ..Axis::new(name, unit)
    };
    Panel {
        title: title.to_owned(),
        height: Some(280),
        x: log("distance", "m"),
        y: log("predicted / measured", ""),
        layers,
        ..Panel::default()
    }
}
