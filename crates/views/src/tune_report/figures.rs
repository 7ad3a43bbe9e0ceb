//! The figures of a tuning report.

use crate::figure::{
    Axis, BASE, Bars, Column, Dash, Figure, INK, Layer, Line, MODEL, Panel, Rule, colour_of,
};
use fdm::tune::{Judged, LoopMargin, StepResponse};

/// A cost that many times that of the gains of the file is off the axis: such gains do not fly.
const COST_SHOWN: f64 = 4.0;

fn one(panel: Panel) -> Figure {
    Figure {
        columns: 1,
        panels: vec![panel],
        scale: None,
    }
}

fn line(name: &str, colour: &'static str, width: f64, dash: Dash, x: Column, y: Column) -> Line {
    Line {
        name: name.to_owned(),
        colour,
        width,
        dash,
        x,
        y,
        ..Line::default()
    }
}

/// Best cost after each candidate, with the cost of the gains of the file.
pub(super) fn history(history: &[f64], before: f64) -> Figure {
    let candidates = history.len().max(2) as f64;
    let file = line(
        "gains of the file",
        BASE,
        1.4,
        Dash::Dotted,
        Column::new([1.0, candidates], 1.0),
        Column::new([before, before], 1000.0),
    );
    let best = Line {
        step: true,
        ..line(
            "best so far",
            MODEL,
            1.8,
            Dash::Solid,
            Column::new((1..=history.len()).map(|k| k as f64), 1.0),
            Column::new(history.iter().copied(), 1000.0),
        )
    };
    one(Panel {
        height: Some(200),
        x: Axis::new("candidate", ""),
        y: Axis {
            floor: Some(0.0),
            limits: Some([0.0, COST_SHOWN * before]),
            ..Axis::new("cost", "")
        },
        layers: vec![Layer::Line(file), Layer::Line(best)],
        ..Panel::default()
    })
}

/// Step responses, a panel each.
pub(super) fn steps(before: &[StepResponse], after: &[StepResponse]) -> Figure {
    let panel = |(b, a): (&StepResponse, &StepResponse)| {
        let response = |name: &str, colour, of: &StepResponse| {
            let x = Column::new(of.series.iter().map(|p| p.0), 100.0);
            let y = Column::new(of.series.iter().map(|p| p.1), 1000.0);
            Layer::Line(line(name, colour, 1.8, Dash::Solid, x, y))
        };
        let end = a.series.last().map_or(1.0, |p| p.0);
        let demand = line(
            "demand",
            INK,
            1.0,
            Dash::Dashed,
            Column::new([0.0, end], 100.0),
            Column::new([a.size, a.size], 1000.0),
        );
        Panel {
            title: a.what.clone(),
            height: Some(170),
            x: Axis::new("time", "s"),
            y: Axis::new("", &a.unit),
            layers: vec![
                Layer::Line(demand),
                response("gains of the file", BASE, b),
                response("tuned gains", MODEL, a),
            ],
            ..Panel::default()
        }
    };
    Figure {
        columns: 3,
        panels: before.iter().zip(after).map(panel).collect(),
        scale: None,
    }
}

/// Magnitude and phase of every loop, at the airspeed nearest to cruise: that of the outer loops.
pub(super) fn bode(before: &[LoopMargin], after: &[LoopMargin]) -> Figure {
    let cruise = after.last().map_or(0.0, |m| m.airspeed_m_s);
    let near = |m: &&LoopMargin| (m.airspeed_m_s - cruise).abs() < 0.01;
    let lines = |of: fn(&(f64, f64, f64)) -> f64, per_unit: f64| {
        let mut lines = Vec::new();
        for (margins, dash, width) in [(before, Dash::Dotted, 1.2), (after, Dash::Solid, 1.8)] {
            for (k, m) in margins.iter().filter(near).enumerate() {
                let x = Column::new(m.bode.iter().map(|p| p.0), 1000.0);
                let y = Column::new(m.bode.iter().map(of), per_unit);
                // The legend has the loops with the gains found.
                let name = if dash == Dash::Solid { &*m.name } else { "" };
                lines.push(Layer::Line(line(name, colour_of(k), width, dash, x, y)));
            }
        }
        lines
    };
    let panel = |name: &str, unit: &str, level: f64, range, hidden, mut layers: Vec<Layer>| {
        layers.push(Layer::Rule(Rule {
            y: Some(level),
            ..Rule::default()
        }));
        Panel {
            height: Some(180),
            linked: Some("frequency"),
            x: Axis {
                log: true,
                hidden,
                ..Axis::new("frequency", "rad/s")
            },
            y: Axis {
                range: Some(range),
                ..Axis::new(name, unit)
            },
            layers,
            ..Panel::default()
        }
    };
    Figure {
        columns: 1,
        panels: vec![
            panel(
                "gain",
                "dB",
                0.0,
                [-50.0, 40.0],
                true,
                lines(|p| p.1, 100.0),
            ),
            panel(
                "phase",
                "°",
                -180.0,
                [-320.0, 10.0],
                false,
                lines(|p| p.2, 10.0),
            ),
        ],
        scale: None,
    }
}

/// Cost of every flight before and after.
pub(super) fn weather(before: &Judged, after: &Judged) -> Figure {
    let bars = |judged: &Judged, slot: usize, name: &str, colour: &'static str| {
        let costs: Vec<f64> = judged
            .flights
            .iter()
            .chain(&judged.held_out)
            .map(|f| f.cost)
            .collect();
        Layer::Bars(Bars {
            name: name.to_owned(),
            colour,
            horizontal: true,
            slot: Some([slot, 2]),
            y: Column::new((0..costs.len()).map(|k| k as f64), 1.0),
            x: Column::new(costs, 1000.0),
            ..Bars::default()
        })
    };
    let flights = after.flights.iter().chain(&after.held_out);
    one(Panel {
        x: Axis {
            limits: Some([0.0, COST_SHOWN * before.cost]),
            ..Axis::new("cost", "")
        },
        y: Axis {
            names: Some(flights.map(|f| f.weather.name.clone()).collect()),
            ..Axis::default()
        },
        layers: vec![
            bars(before, 0, "gains of the file", BASE),
            bars(after, 1, "tuned gains", MODEL),
            Layer::Rule(Rule {
                y: Some(after.flights.len() as f64 - 0.5),
                ..Rule::default()
            }),
        ],
        ..Panel::default()
    })
}
