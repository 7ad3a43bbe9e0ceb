//! Stability margins of the inner loops, broken at the servo's command, on the linearised
//! aircraft with servo, delay, and the hold of the controller.

use nalgebra::{Complex, DMatrix};
use serde::Serialize;

use crate::FdmError;
use crate::aircraft::Aircraft;
use crate::autopilot::{ControlGains, InnerGains, inner_gains};
use crate::dynamics::Dynamics;
use crate::mechanism::Extended;
use crate::trim;

/// Period of the controller, s: it computes during one and holds during the next, a delay of one
/// and a half.
const TICK_S: f64 = 0.02;
const FREQUENCIES: usize = 600;
/// Range of frequencies scanned, rad/s.
const RANGE_RAD_S: (f64, f64) = (0.5, 150.0);

/// How far a loop is from instability.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct LoopMargin {
    /// `"roll"` or `"pitch"`.
    pub name: String,
    /// Airspeed of the linearisation, m/s.
    pub airspeed_m_s: f64,
    /// Factor by which the gain may grow; infinite when no gain destabilises.
    pub gain_margin: f64,
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

/// Margins of the roll and pitch loop at an airspeed.
pub(super) fn inner_loops(
    aircraft: &Aircraft,
    gains: &ControlGains,
    airspeed_m_s: f64,
) -> Result<[LoopMargin; 2], FdmError> {
    let extended = Extended::of(aircraft)?.aircraft;
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
    aircraft: &Aircraft,
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
    aircraft: &Aircraft,
    plant: &(DMatrix<f64>, DMatrix<f64>, usize, usize),
    feedback: &InnerGains,
) -> LoopMargin {
    let ratio: f64 = RANGE_RAD_S.1 / RANGE_RAD_S.0;
    let points: Vec<(f64, Complex<f64>)> = (0..FREQUENCIES)
        .map(|k| RANGE_RAD_S.0 * ratio.powf(k as f64 / (FREQUENCIES - 1) as f64))
        .map(|frequency| (frequency, open_loop(aircraft, plant, feedback, frequency)))
        .collect();
    let (mut gain_margin, mut phase_margin) = (f64::INFINITY, 180.0_f64);
    let (mut delay_margin, mut crossover) = (f64::INFINITY, 0.0);
    let mut stable = true;
    for pair in points.windows(2) {
        let ((_, l0), (w1, l1)) = (pair[0], pair[1]);
        // Crossing of the negative real axis.
        if l0.re < 0.0 && l1.re < 0.0 && l0.im.signum() != l1.im.signum() {
            let gain = -(l0.re + l1.re) / 2.0;
            stable &= gain < 1.0;
            gain_margin = gain_margin.min(1.0 / gain);
        }
        // Crossing of the unit circle.
        if (l0.norm() - 1.0).signum() != (l1.norm() - 1.0).signum() {
            // Angle from −1, positive while the phase is above −180°.
            let angle = (-l1).arg();
            crossover = w1;
            phase_margin = phase_margin.min(angle.abs().to_degrees());
            let lag = if angle >= 0.0 {
                angle
            } else {
                angle + std::f64::consts::TAU
            };
            delay_margin = delay_margin.min(lag / w1);
        }
    }
    LoopMargin {
        name: name.to_owned(),
        airspeed_m_s,
        gain_margin,
        phase_margin_deg: phase_margin,
        delay_margin_s: delay_margin,
        crossover_rad_s: crossover,
        stable,
        bode: points
            .iter()
            .step_by(10)
            .map(|(w, l)| (*w, 20.0 * l.norm().log10(), l.arg().to_degrees()))
            .collect(),
    }
}
