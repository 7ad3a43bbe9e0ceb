//! Stability margins of the inner loops, broken at the servo's command, on the linearised
//! aircraft with servo, delay, and the hold of the controller. The controller computes during one
//! tick and holds during the next: a delay of one and a half.

use nalgebra::{Complex, DMatrix};
use serde::Serialize;

use super::flights::TICK_S;
use crate::aircraft::{Aircraft, ControlGains};
use crate::autopilot::{InnerGains, inner_gains};
use crate::dynamics::Dynamics;
use crate::error::FdmError;
use crate::extended::ExtendedAircraft;
use crate::trim;
use std::sync::Arc;

const FREQUENCIES: usize = 600;
/// Points of a frequency response that are kept.
const MOST_POINTS: usize = 60;
/// Range of frequencies scanned, rad/s.
const RANGE_RAD_S: (f64, f64) = (0.5, 150.0);

/// How far a loop is from instability.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct LoopMargin {
    /// `roll`, `pitch`, `heading`, `height` or `airspeed`.
    pub name: String,
    /// Airspeed at which the loop was looked at, m/s.
    pub airspeed_m_s: f64,
    /// Gain that may be added, dB; infinite when no gain destabilises.
    pub gain_margin_db: f64,
    /// Phase that may be lost at the crossover, degrees; 180 when the loop's gain never reaches 1.
    pub phase_margin_deg: f64,
    /// Delay that may be added, s.
    pub delay_margin_s: f64,
    /// Highest frequency at which the loop's gain is 1, rad/s; 0 where it never is.
    pub crossover_rad_s: f64,
    /// Whether no −1 is encircled, as far as both margins can tell.
    pub stable: bool,
    /// The loop's frequency response (rad/s, dB, degrees).
    pub bode: Vec<(f64, f64, f64)>,
}

/// Least margins a set of gains must keep.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Required {
    /// Gain margin, dB.
    pub gain_db: f64,
    /// Phase margin, degrees.
    pub phase_deg: f64,
}

impl Required {
    /// 6 dB and 45°, the usual ones of MIL-F-9490D.
    pub const USUAL: Self = Self {
        gain_db: 6.0,
        phase_deg: 45.0,
    };

    /// Whether a loop keeps them.
    pub fn met_by(&self, margin: &LoopMargin) -> bool {
        margin.stable
            && margin.gain_margin_db >= self.gain_db
            && margin.phase_margin_deg >= self.phase_deg
    }
}

/// Margins of the roll and pitch loop at an airspeed.
pub(super) fn inner_loops(
    aircraft: &Arc<Aircraft>,
    gains: &ControlGains,
    airspeed_m_s: f64,
) -> Result<[LoopMargin; 2], FdmError> {
    let extended = ExtendedAircraft::of(aircraft)?.aircraft;
    let dynamics = Dynamics::new(&extended);
    let trim = trim::level(&dynamics, airspeed_m_s, 1.225)?;
    let linear = trim::linearise(&dynamics, &trim);
    let feedback = inner_gains(aircraft, gains, airspeed_m_s, 1.225);
    let b_roll = linear.b_lateral.columns(0, 1).into_owned();
    let b_pitch = linear.b_longitudinal.columns(0, 1).into_owned();
    // Lateral state (v, p, r, roll), longitudinal state (u, w, q, pitch).
    let lateral = (linear.a_lateral, b_roll, 1, 3);
    let longitudinal = (linear.a_longitudinal, b_pitch, 2, 3);
    Ok([
        margin("roll", airspeed_m_s, &extended, &lateral, &feedback[0]),
        margin(
            "pitch",
            airspeed_m_s,
            &extended,
            &longitudinal,
            &feedback[1],
        ),
    ])
}

/// Loop transfer function at jω: controller × delay × servo × airframe.
fn open_loop(
    aircraft: &Arc<Aircraft>,
    (a, b, rate, angle): &(DMatrix<f64>, DMatrix<f64>, usize, usize),
    feedback: &InnerGains,
    frequency: f64,
) -> Complex<f64> {
    let s = Complex::new(0.0, frequency);
    let matrix = DMatrix::from_fn(4, 4, |i, j| {
        Complex::from(-a[(i, j)]) + if i == j { s } else { Complex::from(0.0) }
    });
    let Some(x) = matrix.lu().solve(&b.map(Complex::from)) else {
        return Complex::from(0.0);
    };
    let servo = &aircraft.surfaces;
    let w = servo.natural_frequency_rad_s;
    let lag = Complex::from(w * w) / (s * s + s * (2.0 * servo.damping_ratio * w) + w * w);
    let delay = (-s * (1.5 * TICK_S + servo.delay_s)).exp();
    let controller = x[*rate] * feedback.rate
        + x[*angle] * (Complex::from(feedback.angle) + Complex::from(feedback.integral) / s);
    controller * lag * delay
}

fn margin(
    name: &str,
    airspeed_m_s: f64,
    aircraft: &Arc<Aircraft>,
    plant: &(DMatrix<f64>, DMatrix<f64>, usize, usize),
    feedback: &InnerGains,
) -> LoopMargin {
    let points: Vec<(f64, Complex<f64>)> = frequencies(RANGE_RAD_S, FREQUENCIES)
        .map(|frequency| (frequency, open_loop(aircraft, plant, feedback, frequency)))
        .collect();
    of_response(name, airspeed_m_s, &points)
}

/// `count` frequencies from `low` to `high`, each the same factor above the last.
pub(super) fn frequencies((low, high): (f64, f64), count: usize) -> impl Iterator<Item = f64> {
    let ratio: f64 = high / low;
    (0..count).map(move |k| low * ratio.powf(k as f64 / (count - 1) as f64))
}

/// Margins of a loop whose frequency response is known at rising frequencies (rad/s).
pub(super) fn of_response(
    name: &str,
    airspeed_m_s: f64,
    points: &[(f64, Complex<f64>)],
) -> LoopMargin {
    let (mut highest_gain, mut phase_margin) = (0.0_f64, 180.0_f64);
    let (mut delay_margin, mut crossover) = (f64::INFINITY, 0.0);
    for pair in points.windows(2) {
        let ((w0, l0), (w1, l1)) = (pair[0], pair[1]);
        // Crossing of the negative real axis.
        if l0.im.signum() != l1.im.signum() {
            let share = l0.im / (l0.im - l1.im);
            highest_gain = highest_gain.max(-(l0.re + share * (l1.re - l0.re)));
        }
        // Crossing of the unit circle.
        let (g0, g1) = (l0.norm().ln(), l1.norm().ln());
        if g0.signum() != g1.signum() {
            let share = g0 / (g0 - g1);
            crossover = w0 + share * (w1 - w0);
            // Angle from −1, positive while the phase is above −180°.
            let angle = (-l0).arg() + share * (l1 / l0).arg();
            phase_margin = phase_margin.min(angle.abs().to_degrees());
            let lag = angle.rem_euclid(std::f64::consts::TAU);
            delay_margin = delay_margin.min(lag / crossover);
        }
    }
    let step = points.len().div_ceil(MOST_POINTS);
    let phases = unwrapped_deg(points);
    LoopMargin {
        name: name.to_owned(),
        airspeed_m_s,
        gain_margin_db: if highest_gain > 0.0 {
            -20.0 * highest_gain.log10()
        } else {
            f64::INFINITY
        },
        phase_margin_deg: phase_margin,
        delay_margin_s: delay_margin,
        crossover_rad_s: crossover,
        stable: highest_gain < 1.0,
        bode: points
            .iter()
            .zip(phases)
            .step_by(step)
            .map(|((w, l), phase)| (*w, 20.0 * l.norm().log10(), phase))
            .collect(),
    }
}

/// Phases without jumps, degrees; the first in (−270°, 90°].
fn unwrapped_deg(points: &[(f64, Complex<f64>)]) -> Vec<f64> {
    let mut last = -90.0;
    points
        .iter()
        .map(|(_, l)| {
            let phase = l.arg().to_degrees();
            last = phase - 360.0 * ((phase - last) / 360.0).round();
            last
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// L = 8/(s (s + 2)(s + 3)). scipy 1.15: `brentq(lambda w: abs(L(1j*w)) - 1, .1, 5)` gives
    /// 1.0976867, there 180 + phase = 41.1427625°, 0.6541727 s; at √6 rad/s 1/|L| = 3.75.
    #[test]
    fn margins_of_a_known_loop() {
        let points: Vec<_> = frequencies(RANGE_RAD_S, FREQUENCIES)
            .map(|w| {
                let s = Complex::new(0.0, w);
                (w, Complex::from(8.0) / (s * (s + 2.0) * (s + 3.0)))
            })
            .collect();
        let margin = of_response("known", 18.0, &points);
        assert!((margin.gain_margin_db - 20.0 * 3.75_f64.log10()).abs() < 0.01);
        assert!((margin.crossover_rad_s - 1.097_686_7).abs() < 1e-4);
        assert!((margin.phase_margin_deg - 41.142_76).abs() < 0.01);
        assert!((margin.delay_margin_s - 0.654_173).abs() < 1e-3);
        assert!(margin.stable);
    }
}
