//! Delays between commands and what they do.

use serde::Serialize;

use super::smooth::{Smooth, detrended};
use super::{Axis, EquationError};
use crate::statistics::jackknife_se;

/// Longest delay sought, s.
const LONGEST_S: f64 = 0.4;
/// Fewest blocks that an error is told by.
const FEWEST_BLOCKS: usize = 3;
/// Step of delays, s.
const DELAY_STEP_S: f64 = 0.01;

/// Delays between a command and what it does.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Delay {
    /// Axis that the command turns about: roll, pitch, yaw.
    #[serde(skip)]
    axis: usize,
    /// Which command and which response.
    pub of: String,
    /// Lag of the rate behind the command at the peak of their cross-correlation, s; the
    /// airframe's own lag is in it.
    pub rate_lag_s: f64,
    /// Correlation there.
    pub correlation: f64,
    /// Pure delay at which the moment equation with free derivatives fits best, s.
    pub moment_delay_s: f64,
    /// Its standard error over blocks, s.
    pub moment_delay_se_s: f64,
    /// What it is beyond the lag of the published servo, s.
    pub beyond_servo_s: f64,
}

/// How much later than published the surfaces are, by all moments.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Late {
    /// Mean over the axes by their errors, s.
    pub value_s: f64,
    /// Its standard error, s: of the delays, widened where the axes differ by more.
    pub se_s: f64,
}

impl Delay {
    /// About an axis; none without a command that moves.
    pub(super) fn of(parts: &[Smooth], axis: &Axis<'_>) -> Option<Self> {
        let (rate_lag_s, correlation) = rate_lag(parts, axis.axis)?;
        let (moment_delay_s, moment_delay_se_s) = best_delay(parts, axis)?;
        let servo = &axis.aircraft.surfaces;
        // At the frequencies of flight a servo is late by so much.
        let servo_s = servo.delay_s + 2.0 * servo.damping_ratio / servo.natural_frequency_rad_s;
        let command = ["aileron", "elevator", "rudder"][axis.axis];
        Some(Self {
            axis: axis.axis,
            of: format!("{} rate to {command} command", axis.name),
            rate_lag_s,
            correlation,
            moment_delay_s,
            moment_delay_se_s,
            beyond_servo_s: moment_delay_s - servo_s,
        })
    }
}

impl EquationError {
    /// How much later than published the surfaces that turn roll and pitch are; none where no
    /// delay is known.
    pub fn late(&self) -> Option<Late> {
        let delays: Vec<&Delay> = self.delays.iter().filter(|d| d.axis < 2).collect();
        let weighted = |of: &dyn Fn(&Delay) -> f64| -> f64 {
            let weight = |d: &Delay| d.moment_delay_se_s.powi(-2);
            delays.iter().map(|d| weight(d) * of(d)).sum()
        };
        let total = weighted(&|_| 1.0);
        let value_s = weighted(&|d| d.beyond_servo_s) / total;
        let squares = weighted(&|d| (d.beyond_servo_s - value_s).powi(2));
        let freedom = (delays.len() as f64 - 1.0).max(1.0);
        (total > 0.0).then(|| Late {
            value_s,
            se_s: ((squares / freedom).max(1.0) / total).sqrt(),
        })
    }
}

/// Pure delay with the least squares left, refined by a parabola, and its standard error by
/// leaving out each block in turn; none where the best lies at an end of what is sought, since it
/// is then not bracketed, or where blocks are too few to tell an error.
fn best_delay(parts: &[Smooth], axis: &Axis<'_>) -> Option<(f64, f64)> {
    let count = (0.5 * LONGEST_S / DELAY_STEP_S) as usize;
    let mut left: Vec<Vec<f64>> = Vec::with_capacity(count + 1);
    for k in 0..=count {
        let regression = axis.regression(parts, k as f64 * DELAY_STEP_S);
        if !axis.is_excited(&regression) {
            return None;
        }
        left.push(regression.left_without_each());
    }
    // A block that only some delays fill is in no comparison.
    let width = left.iter().map(Vec::len).min().unwrap_or(0);
    if width <= FEWEST_BLOCKS {
        return None;
    }
    let best = |k: usize| peak(&left.iter().map(|l| -l[k]).collect::<Vec<_>>());
    let whole = best(0);
    if whole <= 0.0 || whole >= count as f64 {
        return None;
    }
    let without: Vec<f64> = (1..width).map(|k| best(k) * DELAY_STEP_S).collect();
    // A command is known to the row: each of its changes comes anywhere between two, and a block
    // holds at least one change.
    let of_rows = parts[0].interval / (12.0 * (width as f64 - 1.0)).sqrt();
    let error = jackknife_se(&without).hypot(of_rows);
    error.is_finite().then_some((whole * DELAY_STEP_S, error))
}

/// Place of the largest value, between the samples by a parabola.
fn peak(values: &[f64]) -> f64 {
    let best = (0..values.len())
        .rev()
        .max_by(|a, b| values[*a].total_cmp(&values[*b]));
    let best = best.unwrap_or(0);
    if best == 0 || best + 1 == values.len() {
        return best as f64;
    }
    let (a, b, c) = (values[best - 1], values[best], values[best + 1]);
    let bend = a - 2.0 * b + c;
    best as f64
        + if bend < 0.0 {
            0.5 * (a - c) / bend
        } else {
            0.0
        }
}

/// Lag of a rate behind the command of its surface, and the correlation there.
fn rate_lag(parts: &[Smooth], axis: usize) -> Option<(f64, f64)> {
    // Surface that turns about the axis, and its sense: elevator and rudder turn against their sign.
    let (surface, sign) = [(1, 1.0), (0, -1.0), (2, -1.0)][axis];
    let interval = parts[0].interval;
    let mut cross = vec![0.0; (LONGEST_S / interval) as usize + 1];
    let (mut uu, mut yy) = (0.0, 0.0);
    let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
    for part in parts {
        let u = detrended(&part.told[surface], interval);
        let y = detrended(&part.raw_rate[axis], interval);
        for (lag, sum) in cross.iter_mut().enumerate() {
            *sum += sign * dot(&u, &y[lag..]);
        }
        uu += dot(&u, &u);
        yy += dot(&y, &y);
    }
    let at = peak(&cross);
    let correlation = sign * cross[at.round() as usize] / (uu * yy).sqrt();
    (uu > 0.0 && yy > 0.0).then_some((at * interval, correlation))
}
