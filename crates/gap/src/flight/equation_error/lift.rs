//! Lift from accelerations against the vane, and which of the two is at fault.

use fdm::Aircraft;
use formats::number::plus_minus;
use nalgebra::DVector;
use serde::Serialize;

use super::smooth::{Smooth, bridged};
use super::{Rows, detrended};
use crate::flight::channel::at;

/// Level of a two-sided test of 5 %, standard errors.
const TWO_SIDED: f64 = 1.96;

/// Lift against the vane.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Lift {
    /// Slope of lift by vane angle, 1/rad, and its standard error over blocks.
    pub slope_by_vane: f64,
    /// Standard error.
    pub slope_by_vane_se: f64,
    /// Published slope, 1/rad.
    pub published_slope: f64,
    /// Lift at zero vane angle beyond the published.
    pub offset: f64,
    /// Vane against the angle that rates and accelerations imply, moved by the elevator: slope.
    pub vane_by_inertia: f64,
    /// Standard errors by which a true vane is refuted.
    pub against_true_vane: f64,
    /// Standard errors by which a true lift slope (all in the vane) is refuted.
    pub against_true_lift: f64,
    /// "vane", "lift-slope", "neither" or "cannot be told".
    pub at_fault: &'static str,
    /// In words.
    pub words: String,
}

/// Lift from accelerations against the vane, and whether vane or slope is at fault.
pub(super) fn lift(parts: &[Smooth], a: &Aircraft) -> Option<Lift> {
    let mut rows = Rows {
        x: Vec::new(),
        y: Vec::new(),
        weight: Vec::new(),
        block: Vec::new(),
    };
    // Instrument, vane and inertial angle without what is slow, block by block.
    let mut moved: Vec<(usize, f64, f64, f64)> = Vec::new();
    for (k, part) in parts.iter().enumerate() {
        let elevator = part.late(0, 0.0);
        let inertial = inertial_alpha(part);
        let clean = |x: &[f64]| detrended(&detrended(&bridged(x), part.interval), part.interval);
        let (z, vane, inertial) = (
            clean(&elevator),
            clean(&part.flow[at::ALPHA]),
            clean(&inertial),
        );
        let lag = (0.16 / part.interval) as usize;
        for i in lag..part.len() {
            let block = 1000 * k + i / part.block.max(1);
            let (sin, cos) = part.flow[at::ALPHA][i].sin_cos();
            let pressure = 0.5 * part.density[i] * part.flow[at::AIRSPEED][i].powi(2);
            let measured = -a.body.mass_kg * (part.force[2][i] * cos - part.force[0][i] * sin)
                / (pressure * a.wing.area_m2);
            let q_hat = 0.5 * part.rate[1][i] * a.wing.chord_m / part.flow[at::AIRSPEED][i];
            let y = measured - a.lift.q * q_hat - a.lift.elevator * elevator[i] - a.lift.zero;
            if y.is_finite() && part.flow[at::ALPHA][i].is_finite() {
                rows.x.push(vec![1.0, part.flow[at::ALPHA][i]]);
                rows.y.push(y);
                rows.weight.push(1.0);
                rows.block.push(block);
            }
            moved.push((block, z[i - lag], vane[i], inertial[i]));
        }
    }
    if rows.y.len() < 200 {
        return None;
    }
    let all = rows.solve(None);
    let blocks = rows.blocks();
    let n = blocks.len() as f64;
    let spread: f64 = blocks
        .iter()
        .map(|&b| (rows.solve(Some(b))[1] - all[1]).powi(2))
        .sum();
    let slope_by_vane_se = ((n - 1.0) / n * spread).sqrt();
    let ratio = a.lift.alpha / all[1];
    Some(judged(&moved, &all, slope_by_vane_se, ratio, a.lift.alpha))
}

/// Whether the vane or the slope is at fault, by the part of the motion that the elevator makes:
/// gusts move the vane but are not correlated with it (an instrument; tests after Anderson and
/// Rubin 1949 hold also where it is weak).
fn judged(
    moved: &[(usize, f64, f64, f64)],
    fit: &DVector<f64>,
    slope_se: f64,
    ratio: f64,
    published: f64,
) -> Lift {
    let blocks = products(moved);
    let (zv, zi) = blocks
        .iter()
        .fold((0.0, 0.0), |s, b| (s.0 + b.1, s.1 + b.2));
    let (true_vane, true_lift) = (against(&blocks, 1.0), against(&blocks, ratio));
    let wrong = ((fit[1] - published) / slope_se).abs() > TWO_SIDED;
    let at_fault = match (wrong, true_vane > TWO_SIDED, true_lift > TWO_SIDED) {
        (false, ..) => "neither",
        (true, true, false) => "vane",
        (true, false, true) => "lift-slope",
        _ => "cannot be told",
    };
    let words = format!(
        "Lift grows with the vane by {} per radian where {published:.2} is \
         published: the vane reads {ratio:.2} times the true change, or the slope is {:.2} times the \
         published. {}",
        plus_minus(fit[1], slope_se),
        1.0 / ratio,
        in_words(at_fault, true_vane, true_lift)
    );
    Lift {
        slope_by_vane: fit[1],
        slope_by_vane_se: slope_se,
        published_slope: published,
        offset: fit[0],
        vane_by_inertia: zv / zi,
        against_true_vane: true_vane,
        against_true_lift: true_lift,
        at_fault,
        words,
    }
}

/// Block by block, the elevator's part times the vane's and times the inertial angle's.
fn products(moved: &[(usize, f64, f64, f64)]) -> Vec<(usize, f64, f64)> {
    let mut blocks: Vec<(usize, f64, f64)> = Vec::new();
    for &(block, z, vane, inertial) in moved {
        if !(vane.is_finite() && inertial.is_finite() && z.is_finite()) {
            continue;
        }
        if blocks.last().is_none_or(|b| b.0 != block) {
            blocks.push((block, 0.0, 0.0));
        }
        if let Some(last) = blocks.last_mut() {
            last.1 += z * vane;
            last.2 += z * inertial;
        }
    }
    blocks
}

/// Standard errors by which the elevator's motion refutes that the vane reads `slope` times the
/// inertial angle.
fn against(blocks: &[(usize, f64, f64)], slope: f64) -> f64 {
    let values: Vec<f64> = blocks.iter().map(|b| b.1 - slope * b.2).collect();
    let n = values.len() as f64;
    let mean = values.iter().sum::<f64>() / n;
    let variance = values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / (n - 1.0);
    (mean / (variance / n).sqrt()).abs()
}

fn in_words(at_fault: &str, true_vane: f64, true_lift: f64) -> String {
    match at_fault {
        "neither" => "The two agree.".to_owned(),
        "vane" => format!(
            "The motion that the elevator makes refutes a true vane ({true_vane:.1} standard errors): the vane \
             is wrong."
        ),
        "lift-slope" => format!(
            "The motion that the elevator makes refutes so wrong a vane ({true_lift:.1} standard errors): the \
             slope is wrong."
        ),
        _ => format!(
            "This flight cannot decide between them: the motion that the elevator makes speaks against a true \
             vane with {true_vane:.1} and against a true slope with {true_lift:.1} standard errors. Pull-ups and \
             push-overs at constant power would decide."
        ),
    }
}

/// Change of the angle of attack that rates and specific force imply, integrated, rad.
fn inertial_alpha(part: &Smooth) -> Vec<f64> {
    let gravity = air::STANDARD_GRAVITY_M_S2;
    let mut sum = 0.0;
    let slope: Vec<f64> = (0..part.len())
        .map(|i| {
            let (sin, cos) = part.flow[at::ALPHA][i].sin_cos();
            let (roll, pitch) = (part.roll[i], part.pitch[i]);
            let normal = part.force[2][i] * cos - part.force[0][i] * sin
                + gravity * (pitch.cos() * roll.cos() * cos + pitch.sin() * sin);
            part.rate[1][i] + normal / part.flow[at::AIRSPEED][i]
                - part.rate[0][i] * part.flow[at::BETA][i].tan()
        })
        .collect();
    let known: Vec<f64> = slope.iter().copied().filter(|s| s.is_finite()).collect();
    let mean = known.iter().sum::<f64>() / known.len().max(1) as f64;
    slope
        .iter()
        .map(|s| {
            if s.is_finite() {
                sum += (s - mean) * part.interval;
            }
            sum
        })
        .collect()
}
