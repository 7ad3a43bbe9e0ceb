//! What the measured motion says at once, without a filter (equation error; Jategaonkar 2015,
//! ch. 6): delays, and moments and lift from accelerations against the published model.
//!
//! Angular accelerations are slopes of a parabola fitted over [`WINDOW_S`] of measured rates
//! (Savitzky & Golay 1964); what they are compared with passes the same filter.

use nalgebra::{DMatrix, DVector};
use serde::Serialize;

mod delay;
mod lift;
mod smooth;

use super::channel::at;
use super::gate::Segment;
use super::motion::World;
pub use delay::{Delay, Late};
use fdm::Aircraft;
pub use lift::Lift;
use lift::lift;
use smooth::Smooth;

/// Length of the local parabola, s.
pub const WINDOW_S: f64 = 0.2;
/// What is slower than this is taken off before delays are sought, s.
const DETREND_S: f64 = 2.0;
/// Length of blocks left out, s.
const BLOCK_S: f64 = 10.0;
/// Least standard deviation of a surface that excites its axis, rad: a twentieth of a degree, the
/// play of a servo of this size.
const LEAST_SURFACE_RAD: f64 = 1e-3;
/// Variance inflation from which on a surface is determined by other columns: what it tells is then
/// the rounding of the file.
const MOST_INFLATION: f64 = 1e4;
/// Least part of its square that a moment must vary by: less is rounding.
const LEAST_SPREAD: f64 = 1e-9;

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
    /// Variance inflation of each by its correlation with the others.
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

/// A regression's rows, each with its block.
struct Rows {
    x: Vec<Vec<f64>>,
    y: Vec<f64>,
    weight: Vec<f64>,
    block: Vec<usize>,
}

impl Rows {
    fn solve(&self, without: Option<usize>) -> DVector<f64> {
        let width = self.x[0].len();
        let mut a = DMatrix::zeros(width, width);
        let mut b = DVector::zeros(width);
        for ((x, y), block) in self.x.iter().zip(&self.y).zip(&self.block) {
            if Some(*block) == without {
                continue;
            }
            let x = DVector::from_column_slice(x);
            b.axpy(*y, &x, 1.0);
            a.ger(1.0, &x, &x, 1.0);
        }
        for k in 0..width {
            a[(k, k)] *= 1.0 + 1e-9;
            a[(k, k)] += 1e-300;
        }
        a.cholesky()
            .map_or_else(|| DVector::zeros(width), |c| c.solve(&b))
    }

    /// Weighted squares left, of all rows or of one block.
    fn left(&self, values: &DVector<f64>, only: Option<usize>) -> f64 {
        let rows = self
            .x
            .iter()
            .zip(&self.y)
            .zip(self.weight.iter().zip(&self.block));
        rows.filter(|(_, (_, block))| only.is_none_or(|o| o == **block))
            .map(|((x, y), (w, _))| {
                let fit: f64 = x.iter().zip(values.iter()).map(|(x, v)| x * v).sum();
                w * (y - fit).powi(2)
            })
            .sum()
    }

    /// Whether there is something to explain and the surface (the last column but one of roll, the
    /// last of the others, never the first) moves apart from all else: a column that stands still,
    /// or that the others determine, tells nothing.
    fn is_excited(&self) -> bool {
        let Some(first) = self.x.first() else {
            return false;
        };
        let n = self.y.len() as f64;
        let spread = |of: &dyn Fn(usize) -> f64| {
            let mean = (0..self.y.len()).map(of).sum::<f64>() / n;
            (0..self.y.len())
                .map(|i| (of(i) - mean).powi(2))
                .sum::<f64>()
        };
        let scale: f64 = self.y.iter().map(|y| y * y).sum();
        let inflation = self.inflation();
        let surfaces = first
            .len()
            .saturating_sub(if first.len() == 4 { 1 } else { 2 })
            ..first.len();
        let moves = |k: usize| {
            spread(&|i| self.x[i][k]) > LEAST_SURFACE_RAD.powi(2) * n
                && inflation.get(k - 1).is_some_and(|v| *v < MOST_INFLATION)
        };
        spread(&|i| self.y[i]) > LEAST_SPREAD * scale && surfaces.clone().any(moves)
    }

    /// Weighted squares left by a weighted fit to all rows, then to those without each block.
    fn left_without_each(&self) -> Vec<f64> {
        let width = self.x[0].len() + 1;
        let blocks = self.blocks();
        // Normal equations of each block, the response as last column.
        let mut parts = vec![DMatrix::<f64>::zeros(width, width); blocks.len()];
        let mut at = 0;
        for (i, x) in self.x.iter().enumerate() {
            if self.block[i] != blocks[at] {
                at += 1;
            }
            let row = DVector::from_iterator(width, x.iter().chain([&self.y[i]]).copied());
            parts[at].ger(self.weight[i], &row, &row, 1.0);
        }
        let all: DMatrix<f64> = parts.iter().sum();
        let left = |whole: &DMatrix<f64>| {
            let n = width - 1;
            let mut a = whole.view((0, 0), (n, n)).into_owned();
            for k in 0..n {
                a[(k, k)] = a[(k, k)] * (1.0 + 1e-9) + 1e-300;
            }
            let b = whole.view((0, n), (n, 1)).into_owned();
            let told = a.cholesky().map_or(0.0, |c| b.dot(&c.solve(&b)));
            whole[(n, n)] - told
        };
        let mut out = vec![left(&all)];
        out.extend(parts.iter().map(|part| left(&(&all - part))));
        out
    }

    fn blocks(&self) -> Vec<usize> {
        let mut blocks = self.block.clone();
        blocks.dedup();
        blocks
    }

    /// Weighted squares left on each block by a fit to the others.
    fn held_out(&self) -> f64 {
        self.blocks()
            .into_iter()
            .map(|b| self.left(&self.solve(Some(b)), Some(b)))
            .sum()
    }

    /// Variance inflation of each column but the first, which is the constant.
    fn inflation(&self) -> Vec<f64> {
        let width = self.x[0].len();
        (1..width)
            .map(|k| {
                let rest = Rows {
                    x: self
                        .x
                        .iter()
                        .map(|x| (0..width).filter(|j| *j != k).map(|j| x[j]).collect())
                        .collect(),
                    y: self.x.iter().map(|x| x[k]).collect(),
                    weight: vec![1.0; self.y.len()],
                    block: self.block.clone(),
                };
                let mean = rest.y.iter().sum::<f64>() / rest.y.len() as f64;
                let whole: f64 = rest.y.iter().map(|y| (y - mean).powi(2)).sum();
                // A column that stands still has none.
                if whole > 0.0 {
                    whole / rest.left(&rest.solve(None), None).max(1e-12 * whole)
                } else {
                    f64::NAN
                }
            })
            .collect()
    }
}

/// Surface that turns about an axis: place among the told.
const SURFACE_OF: [usize; 3] = [1, 0, 2];
const AXES: [&str; 3] = ["roll", "pitch", "yaw"];

/// Rows of a moment equation with free derivatives and the surfaces `delay` late.
fn rows(parts: &[Smooth], a: &Aircraft, axis: usize, delay: f64, inertia: f64) -> Rows {
    let mut out = Rows {
        x: Vec::new(),
        y: Vec::new(),
        weight: Vec::new(),
        block: Vec::new(),
    };
    for (k, part) in parts.iter().enumerate() {
        let late: Vec<Vec<f64>> = (0..3).map(|s| part.late(s, delay)).collect();
        for i in 0..part.len() {
            let (moment, scale) = part.coefficient(a, axis, i);
            let per_2v = 0.5 / part.flow[at::AIRSPEED][i];
            let x = if axis == 1 {
                let q_hat = part.rate[1][i] * per_2v * a.wing.chord_m;
                vec![1.0, part.flow[at::ALPHA][i], q_hat, late[0][i]]
            } else {
                let hat = |r: usize| part.rate[r][i] * per_2v * a.wing.span_m;
                vec![
                    1.0,
                    part.flow[at::BETA][i],
                    hat(0),
                    hat(2),
                    late[1][i],
                    late[2][i],
                ]
            };
            let y = moment / scale;
            if y.is_finite() && x.iter().all(|v| v.is_finite()) {
                out.x.push(x);
                out.y.push(y);
                out.weight.push((scale / inertia).powi(2));
                out.block.push(1000 * k + i / part.block.max(1));
            }
        }
    }
    out
}

/// Looks at `segments`; `world` gives the published model of each.
pub fn analyse(segments: &[Segment], worlds: &[World], aircraft: &Aircraft) -> EquationError {
    let parts: Vec<Smooth> = segments
        .iter()
        .zip(worlds)
        .filter_map(|(s, w)| Smooth::new(s, w))
        .collect();
    let mut out = EquationError {
        filter: format!(
            "slope of a parabola over {WINDOW_S} s of measured rates (Savitzky-Golay); all that is \
             compared passes the same filter"
        ),
        delays: Vec::new(),
        moments: Vec::new(),
        lift: None,
    };
    let has_alpha = segments
        .iter()
        .any(|s| s.measured.iter().any(|m| m[at::ALPHA].is_finite()));
    for axis in 0..3 {
        if parts.is_empty() || (axis == 2 && !aircraft.has_rudder()) || (axis == 1 && !has_alpha) {
            continue;
        }
        let inertia = [
            aircraft.body.ixx_kg_m2,
            aircraft.body.iyy_kg_m2,
            aircraft.body.izz_kg_m2,
        ][axis];
        let found = Delay::of(&parts, aircraft, axis, inertia);
        let delay = found.as_ref().map_or(0.0, |d| d.moment_delay_s);
        out.delays.extend(found);
        out.moments
            .extend(moment(&parts, aircraft, axis, delay, inertia));
    }
    if has_alpha {
        out.lift = lift(&parts, aircraft);
    }
    out
}

/// `x` without what is slower than [`DETREND_S`].
fn detrended(x: &[f64], interval: f64) -> Vec<f64> {
    let half = (0.5 * DETREND_S / interval) as usize;
    let mut sums = vec![0.0];
    for v in x {
        sums.push(sums[sums.len() - 1] + v);
    }
    (0..x.len())
        .map(|i| {
            let (from, to) = (i.saturating_sub(half), (i + half + 1).min(x.len()));
            x[i] - (sums[to] - sums[from]) / (to - from) as f64
        })
        .collect()
}

/// A moment against the published model and refitted derivatives.
fn moment(parts: &[Smooth], a: &Aircraft, axis: usize, delay: f64, inertia: f64) -> Option<Moment> {
    let rows = rows(parts, a, axis, delay, inertia);
    if rows.y.len() < 200 || !rows.is_excited() {
        return None;
    }
    let n = rows.y.len() as f64;
    let mut away = Vec::new();
    let mut spin = Vec::new();
    for part in parts {
        for i in 0..part.len() {
            let (moment, _) = part.coefficient(a, axis, i);
            let off = (moment - part.published[axis][i]) / inertia;
            if off.is_finite() {
                away.push(off);
                spin.push(moment / inertia);
            }
        }
    }
    let mean = |x: &[f64]| x.iter().sum::<f64>() / x.len() as f64;
    let square = |x: &[f64]| x.iter().map(|v| v * v).sum::<f64>() / x.len() as f64;
    let published_leaves = square(&away);
    let variance = square(&spin) - mean(&spin).powi(2);
    let held_out_leaves = rows.held_out() / n;
    let (derivatives, published): (Vec<&'static str>, Vec<f64>) = if axis == 1 {
        (
            vec!["zero", "alpha", "q", "elevator"],
            vec![a.pitch.zero, a.pitch.alpha, a.pitch.q, a.pitch.elevator],
        )
    } else {
        let d = if axis == 0 { &a.roll } else { &a.yaw };
        (
            vec!["zero", "beta", "p", "r", "aileron", "rudder"],
            vec![0.0, d.beta, d.p, d.r, d.aileron, d.rudder],
        )
    };
    let mut out = Moment {
        axis: AXES[axis],
        variance,
        published_leaves,
        published_constant_part: mean(&away).powi(2) / published_leaves,
        held_out_leaves,
        held_out_share: 1.0 - held_out_leaves / published_leaves,
        held_out_r2: 1.0 - held_out_leaves / variance,
        derivatives,
        published,
        refitted: rows.solve(None).iter().copied().collect(),
        inflation: rows.inflation(),
        words: String::new(),
    };
    out.words = words_of(&out, delay);
    Some(out)
}

fn words_of(m: &Moment, delay: f64) -> String {
    let control = if m.axis == "roll" {
        4
    } else {
        m.refitted.len() - 1
    };
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
