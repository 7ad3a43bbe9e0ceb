//! The figures of a report of an emission rate.

use crate::figure::{
    Axis, BASE, Bars, Column, Figure, INK, Layer, Line, MODEL, Panel, Points, Text, colour_of,
    intervals,
};
use study::flux::SourceFlux;
use study::{PassFlux, Share};

/// Sectors of a wind rose.
const SECTORS: usize = 16;
/// Upper ends of its speed classes, m/s.
const SPEEDS_M_S: [f64; 3] = [2.0, 5.0, f64::INFINITY];
/// Names of these.
const SPEED_NAMES: [&str; 3] = ["below 2 m/s", "2 to 5 m/s", "above 5 m/s"];

fn one(panel: Panel) -> Figure {
    Figure {
        columns: 1,
        panels: vec![panel],
        scale: None,
    }
}

/// Shares of the terms of a budget.
pub(crate) fn budget(shares: &[Share], name: &dyn Fn(&Share) -> String) -> Figure {
    let rows: Vec<&Share> = shares.iter().rev().collect();
    let bars = Bars {
        colour: MODEL,
        horizontal: true,
        y: Column::new((0..rows.len()).map(|k| k as f64), 1.0),
        x: Column::new(rows.iter().map(|s| 100.0 * s.share), 10.0),
        texts: Some(
            rows.iter()
                .map(|s| format!("{:.0} %", 100.0 * s.share))
                .collect(),
        ),
        ..Bars::default()
    };
    one(Panel {
        x: Axis {
            range: Some([0.0, 110.0]),
            ..Axis::new("share of the variance of ln rate", "%")
        },
        y: Axis {
            names: Some(rows.iter().map(|s| name(s)).collect()),
            ..Axis::default()
        },
        layers: vec![Layer::Bars(bars)],
        ..Panel::default()
    })
}

/// Rates with their intervals, one row a method.
pub(crate) fn methods(rows: &[&SourceFlux]) -> Figure {
    let rated = rows.iter().filter_map(|r| {
        let rate = r.kg_s?;
        let g_s = [rate.value, rate.low95, rate.high95].map(|kg_s| 1e3 * kg_s);
        Some((r.method.name().to_owned(), g_s))
    });
    intervals(("rate", "g/s"), &rated.collect::<Vec<_>>())
}

/// What each pass stands for, in order of time.
pub(crate) fn passes(passes: &[PassFlux]) -> Figure {
    let known: Vec<&PassFlux> = passes.iter().filter(|p| p.kg_s.is_some()).collect();
    let bars = Bars {
        colour: MODEL,
        colours: Some(
            known
                .iter()
                .map(|p| if p.used { MODEL } else { BASE })
                .collect(),
        ),
        x: Column::new(known.iter().map(|p| 0.5 * (p.from_s + p.to_s)), 1.0),
        widths: Some(Column::new(known.iter().map(|p| p.to_s - p.from_s), 1.0)),
        y: Column::new(known.iter().map(|p| 1e3 * p.kg_s.unwrap_or(0.0)), 1e6),
        ..Bars::default()
    };
    one(Panel {
        height: Some(170),
        x: Axis::new("time", "s"),
        y: Axis::new("rate", "g/s"),
        layers: vec![Layer::Bars(bars)],
        ..Panel::default()
    })
}

/// How often the wind came from where and how fast; `winds` are speed, m/s, and direction, degrees.
pub(crate) fn wind_rose(winds: &[(f64, f64)]) -> Figure {
    let mut shares = [[0.0; SECTORS]; SPEEDS_M_S.len()];
    let part = 100.0 / winds.len().max(1) as f64;
    for &(speed_m_s, from_deg) in winds {
        let width_deg = 360.0 / SECTORS as f64;
        let sector = (from_deg.rem_euclid(360.0) / width_deg).round() as usize % SECTORS;
        let class = SPEEDS_M_S.iter().position(|end| speed_m_s < *end);
        shares[class.unwrap_or(SPEEDS_M_S.len() - 1)][sector] += part;
    }
    let mut layers = Vec::new();
    let mut longest = 0.0f64;
    let mut radius = [0.0; SECTORS];
    for (class, share) in shares.iter().enumerate() {
        for (sum, own) in radius.iter_mut().zip(share) {
            *sum += own;
            longest = longest.max(*sum);
        }
        if share.iter().all(|s| *s == 0.0) {
            continue;
        }
        let (x, y): (Vec<f64>, Vec<f64>) = outline(&radius).into_iter().unzip();
        layers.push(Layer::Line(Line {
            name: SPEED_NAMES[class].to_owned(),
            colour: colour_of(class),
            width: 1.8,
            silent: true,
            x: Column::new(x, 100.0),
            y: Column::new(y, 100.0),
            ..Line::default()
        }));
    }
    let at = 1.12 * longest;
    layers.push(Layer::Text(Text {
        x: Column::new([0.0, at, 0.0, -at], 100.0),
        y: Column::new([at, 0.0, -at, 0.0], 100.0),
        texts: ["N", "E", "S", "W"].map(str::to_owned).to_vec(),
    }));
    layers.push(Layer::Points(Points {
        colour: Some(INK),
        size: 4.0,
        silent: true,
        x: Column::new([0.0], 1.0),
        y: Column::new([0.0], 1.0),
        ..Points::default()
    }));
    let axis = |name: &str| Axis {
        range: Some([-1.25 * longest, 1.25 * longest]),
        ..Axis::new(name, "% of the time")
    };
    one(Panel {
        height: Some(300),
        equal: true,
        x: axis("from west or east"),
        y: axis("from south or north"),
        layers,
        ..Panel::default()
    })
}

/// The wedges of a rose as one closed line.
fn outline(radius: &[f64; SECTORS]) -> Vec<(f64, f64)> {
    let half = 180.0 / SECTORS as f64;
    let mut out = Vec::new();
    for (sector, r) in radius.iter().enumerate() {
        let middle = sector as f64 * 2.0 * half;
        for off in [-half, 0.0, half] {
            let (sin, cos) = (middle + off).to_radians().sin_cos();
            out.push((r * sin, r * cos));
        }
    }
    out.extend(out.first().copied());
    out
}
