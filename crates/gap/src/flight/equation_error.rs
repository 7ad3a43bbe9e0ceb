//! What the measured motion says at once, without a filter (equation error; Jategaonkar 2015,
//! ch. 6): delays, and moments and lift from accelerations against the published model.
//!
//! Angular accelerations are slopes of a parabola fitted over [`WINDOW_S`] of measured rates
//! (Savitzky & Golay 1964); what they are compared with passes the same filter.

use fdm::Aircraft;
use serde::Serialize;

mod delay;
mod lift;
mod regression;
mod smooth;

use super::channel::at;
use super::gate::Segment;
use super::motion::World;
pub use delay::{Delay, Late};
pub use lift::Lift;
use regression::{Regression, solve};
use smooth::Smooth;

/// Length of the local parabola, s.
pub const WINDOW_S: f64 = 0.2;
/// Least standard deviation of a surface that excites its axis, rad: a twentieth of a degree, the
/// play of a servo of this size.
const LEAST_SURFACE_RAD: f64 = 1e-3;
/// Fewest rows of a regression.
const FEWEST_ROWS: usize = 200;

/// A moment from measured accelerations against the published model and a refitted one.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Moment {
    /// "roll", "pitch" or "yaw".
    pub axis: &'static str,
    /// Variance of the measured angular acceleration, (rad/s²)².
    pub variance: f64,
    /// Mean square that the published model leaves, its own servos in it, (rad/s²)².
    pub published_leaves: f64,
    /// Part of that which is a constant.
    pub published_constant_part: f64,
    /// Mean square left on blocks that the refitted derivatives have not seen, (rad/s²)².
    pub held_out_leaves: f64,
    /// Share of what the published model leaves that is explained there.
    pub held_out_share: f64,
    /// Share of the acceleration's variance explained there.
    pub held_out_r2: f64,
    /// Names of the refitted derivatives.
    pub derivatives: Vec<&'static str>,
    /// Published values (per radian).
    pub published: Vec<f64>,
    /// Refitted values (per radian), of all data.
    pub refitted: Vec<f64>,
    /// Variance inflation of each but the first by its correlation with the others.
    pub inflation: Vec<f64>,
    /// What it means, in words.
    pub words: String,
}

/// Everything that equation error tells.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct EquationError {
    /// Filter of the accelerations, in words.
    pub filter: String,
    /// Delays, surface by surface.
    pub delays: Vec<Delay>,
    /// Moments.
    pub moments: Vec<Moment>,
    /// Lift, where there is a vane.
    pub lift: Option<Lift>,
}

/// The equation of the moment about one axis.
struct Axis<'a> {
    aircraft: &'a Aircraft,
    axis: usize,
    name: &'static str,
    inertia: f64,
}

impl<'a> Axis<'a> {
    fn of(aircraft: &'a Aircraft, axis: usize) -> Self {
        let body = &aircraft.body;
        Self {
            aircraft,
            axis,
            name: ["roll", "pitch", "yaw"][axis],
            inertia: [body.ixx_kg_m2, body.iyy_kg_m2, body.izz_kg_m2][axis],
        }
    }

    /// Names of the derivatives with their published values, those of surfaces last.
    fn published(&self) -> Vec<(&'static str, f64)> {
        let a = self.aircraft;
        if self.axis == 1 {
            let d = &a.pitch;
            return vec![
                ("zero", d.zero),
                ("alpha", d.alpha),
                ("q", d.q),
                ("elevator", d.elevator),
            ];
        }
        let d = if self.axis == 0 { &a.roll } else { &a.yaw };
        let turns = [("zero", 0.0), ("beta", d.beta), ("p", d.p), ("r", d.r)];
        [&turns[..], &[("aileron", d.aileron), ("rudder", d.rudder)]].concat()
    }

    /// Measured moment against free derivatives, with surfaces that are `delay` s late.
    fn regression(&self, parts: &[Smooth], delay: f64) -> Regression {
        let (a, mut out) = (self.aircraft, Regression::default());
        for (k, part) in parts.iter().enumerate() {
            let late: [Vec<f64>; 3] = std::array::from_fn(|s| part.late(s, delay));
            for i in 0..part.len() {
                let hat = |r: usize, m: f64| 0.5 * part.rate[r][i] * m / part.flow[at::AIRSPEED][i];
                let (alpha, beta) = (part.flow[at::ALPHA][i], part.flow[at::BETA][i]);
                let (c, b) = (a.wing.chord_m, a.wing.span_m);
                let x: &[f64] = if self.axis == 1 {
                    &[1.0, alpha, hat(1, c), late[0][i]]
                } else {
                    &[1.0, beta, hat(0, b), hat(2, b), late[1][i], late[2][i]]
                };
                let scale = part.scale(a, self.axis, i);
                let moment = part.moment(a, self.axis, i) / scale;
                out.add(
                    part.block_of(k, i),
                    (scale / self.inertia).powi(2),
                    x,
                    moment,
                );
            }
        }
        out
    }

    /// Whether a surface moves enough to tell of the axis.
    fn is_excited(&self, regression: &Regression) -> bool {
        let surfaces = if self.axis == 1 { 1 } else { 2 };
        regression.is_excited(surfaces, LEAST_SURFACE_RAD)
    }

    /// The moment against the published model and refitted derivatives, with surfaces that are `delay` s late.
    fn moment(&self, parts: &[Smooth], delay: f64) -> Option<Moment> {
        let regression = self.regression(parts, delay);
        if regression.rows < FEWEST_ROWS || !self.is_excited(&regression) {
            return None;
        }
        // Measured angular acceleration, and that less the published.
        let of = |part: &Smooth, i: usize| {
            let moment = part.moment(self.aircraft, self.axis, i);
            [moment, moment - part.published[self.axis][i]].map(|m| m / self.inertia)
        };
        let each = parts
            .iter()
            .flat_map(|p| (0..p.len()).map(move |i| of(p, i)));
        let known: Vec<[f64; 2]> = each.filter(|of| of[1].is_finite()).collect();
        let mean =
            |f: &dyn Fn(&[f64; 2]) -> f64| known.iter().map(f).sum::<f64>() / known.len() as f64;
        let published_leaves = mean(&|of| of[1] * of[1]);
        let variance = mean(&|of| of[0] * of[0]) - mean(&|of| of[0]).powi(2);
        let held_out_leaves = regression.held_out() / regression.rows as f64;
        let (derivatives, published) = self.published().into_iter().unzip();
        let mut out = Moment {
            axis: self.name,
            variance,
            published_leaves,
            published_constant_part: mean(&|of| of[1]).powi(2) / published_leaves,
            held_out_leaves,
            held_out_share: 1.0 - held_out_leaves / published_leaves,
            held_out_r2: 1.0 - held_out_leaves / variance,
            derivatives,
            published,
            refitted: solve(&regression.all()).as_slice().to_vec(),
            inflation: regression.inflation(),
            words: String::new(),
        };
        out.words = words_of(&out, delay);
        Some(out)
    }
}

/// Looks at `segments`; `world` gives the published model of each.
pub fn analyse(segments: &[Segment], worlds: &[World], aircraft: &Aircraft) -> EquationError {
    let flown = segments.iter().zip(worlds);
    let parts: Vec<Smooth> = flown.filter_map(|(s, w)| Smooth::new(s, w)).collect();
    let mut out = EquationError {
        filter: format!(
            "slope of a parabola over {WINDOW_S} s of measured rates (Savitzky-Golay); all that is \
             compared passes the same filter"
        ),
        delays: Vec::new(),
        moments: Vec::new(),
        lift: None,
    };
    let mut readings = segments.iter().flat_map(|s| &s.measured);
    let has_alpha = readings.any(|m| m[at::ALPHA].is_finite());
    for axis in 0..3 {
        if parts.is_empty() || (axis == 2 && !aircraft.has_rudder()) || (axis == 1 && !has_alpha) {
            continue;
        }
        let equation = Axis::of(aircraft, axis);
        let found = Delay::of(&parts, &equation);
        let delay = found.as_ref().map_or(0.0, |d| d.moment_delay_s);
        out.delays.extend(found);
        out.moments.extend(equation.moment(&parts, delay));
    }
    if has_alpha {
        out.lift = lift::lift(&parts, aircraft);
    }
    out
}

fn words_of(m: &Moment, delay: f64) -> String {
    let mut text = format!(
        "{}: the published model leaves {:.1} times the variance of the measured acceleration ({:.0} % of it a \
         constant); refitted derivatives and a delay of {:.0} ms explain {:.0} % of what it leaves on hold-out \
         blocks, and {:.0} % of the acceleration's variance.",
        m.axis,
        m.published_leaves / m.variance,
        100.0 * m.published_constant_part,
        1000.0 * delay,
        100.0 * m.held_out_share,
        100.0 * m.held_out_r2
    );
    // The surface that turns about the axis is the last of the derivatives, but for roll the last but one.
    let control = m.derivatives.len() - if m.axis == "roll" { 2 } else { 1 };
    let ratio = m.refitted[control] / m.published[control];
    if (ratio - 1.0).abs() > 0.15 {
        text += &format!(
            " The surface turns it {:.0} % as strongly as published.",
            100.0 * ratio
        );
    }
    if m.held_out_r2 < 0.5 {
        let worst = m.inflation.iter().copied().fold(0.0, f64::max);
        text += &format!(
            " The rest fits poorly: the surface moves the vane and the rate together (largest \
             variance inflation {worst:.1}), gusts at the vane are not those at the tail, and no \
             manoeuvre excites this axis apart from the loop that flies it."
        );
    }
    text
}
