//! Lift from accelerations against the vane, and which of the two is at fault.

use fdm::Aircraft;
use formats::number::plus_minus;
use serde::Serialize;

use super::FEWEST_ROWS;
use super::regression::{Regression, solve};
use super::smooth::{Smooth, bridged, detrended};
use crate::flight::channel::at;
use crate::statistics::jackknife_se;

/// Level of a two-sided test of 5 %, standard errors.
const TWO_SIDED: f64 = 1.96;
/// What the vane lags behind the elevator, s: that of a short period.
const LAG_S: f64 = 0.16;

/// Lift against the vane.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Lift {
    /// Slope of lift by vane angle, 1/rad.
    pub slope_by_vane: f64,
    /// Its standard error over blocks.
    pub slope_by_vane_se: f64,
    /// Published slope, 1/rad.
    pub published_slope: f64,
    /// Standard errors by which a true vane is refuted.
    pub against_true_vane: f64,
    /// Standard errors by which a true lift slope (all in the vane) is refuted.
    pub against_true_lift: f64,
    /// "vane", "lift-slope", "neither" or "cannot be told".
    pub at_fault: &'static str,
    /// In words.
    pub words: String,
}

/// Lift from accelerations against the vane, and whether the vane or the slope is at fault by the part of the motion
/// that the elevator makes: gusts move the vane but are not correlated with it (an instrument; tests after Anderson
/// and Rubin 1949 hold also where it is weak).
pub(super) fn lift(parts: &[Smooth], a: &Aircraft) -> Option<Lift> {
    let mut regression = Regression::default();
    // Block by block, the elevator's motion times the vane's and times that of the inertial angle.
    let mut moved: Vec<[f64; 2]> = Vec::new();
    for (k, part) in parts.iter().enumerate() {
        let elevator = part.late(0, 0.0);
        let clean = |x: &[f64]| detrended(&detrended(&bridged(x), part.interval), part.interval);
        let vane = &part.flow[at::ALPHA];
        let motion = [clean(vane), clean(&inertial_alpha(part))];
        let instrument = clean(&elevator);
        let lag = (LAG_S / part.interval) as usize;
        let mut block = usize::MAX;
        for i in lag..part.len() {
            let measured = -a.body.mass_kg * part.normal_force(i) / part.lift_scale(a, i);
            let q_hat = 0.5 * part.rate[1][i] * a.wing.chord_m / part.flow[at::AIRSPEED][i];
            let y = measured - a.lift.q * q_hat - a.lift.elevator * elevator[i] - a.lift.zero;
            regression.add(part.block_of(k, i), 1.0, &[1.0, vane[i]], y);
            if part.block_of(k, i) != block {
                block = part.block_of(k, i);
                moved.push([0.0; 2]);
            }
            if let Some(sums) = moved.last_mut() {
                for (sum, motion) in sums.iter_mut().zip(&motion) {
                    *sum += instrument[i - lag] * motion[i];
                }
            }
        }
    }
    if regression.rows < FEWEST_ROWS {
        return None;
    }
    let slope = solve(&regression.all())[1];
    let without = regression.without_each();
    let without: Vec<f64> = without.map(|(others, _)| solve(&others)[1]).collect();
    let se = jackknife_se(&without);
    let published = a.lift.alpha;
    let ratio = published / slope;
    let (true_vane, true_lift) = (against(&moved, 1.0), against(&moved, ratio));
    let is_wrong = ((slope - published) / se).abs() > TWO_SIDED;
    let at_fault = match (is_wrong, true_vane > TWO_SIDED, true_lift > TWO_SIDED) {
        (false, ..) => "neither",
        (true, true, false) => "vane",
        (true, false, true) => "lift-slope",
        _ => "cannot be told",
    };
    let words = format!(
        "Lift grows with the vane by {} per radian where {published:.2} is \
         published: the vane reads {ratio:.2} times the true change, or the slope is {:.2} times the \
         published. {}",
        plus_minus(slope, se),
        1.0 / ratio,
        in_words(at_fault, true_vane, true_lift)
    );
    Some(Lift {
        slope_by_vane: slope,
        slope_by_vane_se: se,
        published_slope: published,
        against_true_vane: true_vane,
        against_true_lift: true_lift,
        at_fault,
        words,
    })
}

/// Standard errors by which the elevator's motion refutes that the vane reads `slope` times the
/// inertial angle.
fn against(moved: &[[f64; 2]], slope: f64) -> f64 {
    let values: Vec<f64> = moved
        .iter()
        .map(|[vane, inertial]| vane - slope * inertial)
        .collect();
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
    let slope = |i: usize| {
        let (sin, cos) = part.flow[at::ALPHA][i].sin_cos();
        let [roll, pitch] = [0, 1].map(|k| part.angle[k][i]);
        let weight =
            air::STANDARD_GRAVITY_M_S2 * (pitch.cos() * roll.cos() * cos + pitch.sin() * sin);
        part.rate[1][i] + (part.normal_force(i) + weight) / part.flow[at::AIRSPEED][i]
            - part.rate[0][i] * part.flow[at::BETA][i].tan()
    };
    let slope: Vec<f64> = (0..part.len()).map(slope).collect();
    let known = || slope.iter().filter(|s| s.is_finite());
    let mean = known().sum::<f64>() / known().count().max(1) as f64;
    let integral = slope.iter().scan(0.0, |sum, s| {
        if s.is_finite() {
            *sum += (s - mean) * part.interval;
        }
        Some(*sum)
    });
    integral.collect()
}
