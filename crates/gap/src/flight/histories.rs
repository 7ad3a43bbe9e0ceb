//! Measured against simulated time histories, channel by channel.

use serde::Serialize;

use super::channel::{ALL, CHANNELS, at};
use super::filter::Seen;
use super::gate::Segment;
use super::motion::{Mean, World};

/// Length of a window that is simulated from its own start, s: short enough that gusts, which no
/// simulation knows, do not carry it off.
pub const WINDOW_S: f64 = 2.0;

/// One channel of one flight, in the column's unit.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct History {
    /// What it is.
    pub label: &'static str,
    /// Unit.
    pub unit: &'static str,
    /// Times, s.
    pub time_s: Vec<f64>,
    /// As read.
    pub measured: Vec<f64>,
    /// As the base simulates it.
    pub base: Vec<f64>,
    /// As the extended aircraft simulates it.
    pub extended: Vec<f64>,
    /// Places at which a window starts.
    pub starts: Vec<usize>,
    /// Innovations of the base in standard deviations.
    pub base_standardised: Vec<f64>,
    /// Innovations of the extended aircraft in standard deviations.
    pub extended_standardised: Vec<f64>,
}

/// Places at which the windows of `segment` start.
fn starts(segment: &Segment) -> Vec<usize> {
    let mut out = vec![0];
    let mut since = segment.time_s[0];
    for (i, time) in segment.time_s.iter().enumerate() {
        if time - since >= WINDOW_S {
            out.push(i);
            since = *time;
        }
    }
    out
}

/// Readings simulated with the measured commands, each window from the filter's state at its
/// start.
pub fn simulate(segment: &Segment, world: &World, means: &[Mean]) -> Vec<[f64; CHANNELS]> {
    let mut out = Vec::with_capacity(segment.len());
    let mut state = means[0].undisturbed();
    let mut starts = starts(segment).into_iter().peekable();
    for i in 0..segment.len() {
        if starts.next_if_eq(&i).is_some() {
            state = means[i].undisturbed();
        }
        out.push(Seen::of(segment, world, i, state, false).expected());
        if i + 1 < segment.len() {
            state = world.at(i).step(segment, i, &state);
        }
    }
    out
}

/// Histories of every channel of `segment` from what base and extension simulate and innovate.
pub fn histories(
    segment: &Segment,
    simulated: [&[[f64; CHANNELS]]; 2],
    standardised: [&[[f64; CHANNELS]]; 2],
) -> Vec<History> {
    (0..CHANNELS)
        .filter(|&c| segment.measured.iter().any(|m| m[c].is_finite()))
        .map(|c| {
            let unit = |v: f64| v / ALL[c].si;
            let column = |of: &[[f64; CHANNELS]]| of.iter().map(|r| r[c]).collect::<Vec<f64>>();
            let measured: Vec<f64> = segment.measured.iter().map(|m| unit(m[c])).collect();
            // A compass that was unwrapped stays comparable.
            let near = |of: &[[f64; CHANNELS]]| {
                of.iter()
                    .zip(&measured)
                    .map(|(r, m)| {
                        let value = unit(r[c]);
                        if c == at::ROLL + 2 && m.is_finite() {
                            m + (value - m + 180.0).rem_euclid(360.0) - 180.0
                        } else {
                            value
                        }
                    })
                    .collect()
            };
            History {
                label: ALL[c].label,
                unit: ALL[c].unit,
                time_s: segment.time_s.clone(),
                base: near(simulated[0]),
                extended: near(simulated[1]),
                starts: starts(segment),
                measured,
                base_standardised: column(standardised[0]),
                extended_standardised: column(standardised[1]),
            }
        })
        .collect()
}
