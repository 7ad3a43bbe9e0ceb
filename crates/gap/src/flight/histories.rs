//! Measured against simulated time histories, channel by channel.

use air::geo::wrap_signed_deg;
use serde::Serialize;

use super::channel::{ALL, CHANNELS, at};
use super::filter::Seen;
use super::gate::Segment;
use super::motion::{Mean, World};
use super::noise::Noise;
use super::study::Study;

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

/// Readings simulated with the measured commands, each window from the filter's state at its start.
fn simulate(
    segment: &Segment,
    world: &World,
    means: &[Mean],
    starts: &[usize],
) -> Vec<[f64; CHANNELS]> {
    let mut state = means[0];
    let mut reading = |i: usize| {
        if starts.binary_search(&i).is_ok() {
            state = means[i].undisturbed();
        }
        let read = Seen::of(segment, world, i, state, false).expected();
        if i + 1 < segment.len() {
            state = world.at(i).step(segment, i, &state);
        }
        read
    };
    (0..segment.len()).map(&mut reading).collect()
}

/// Histories of every channel of all segments with the departures of base and extension.
pub fn histories(study: &Study<'_>, noise: &Noise, theta: [&[f64]; 2]) -> Vec<History> {
    let passes = theta.map(|theta| study.passes(theta, noise));
    let mut all = Vec::new();
    for (k, segment) in study.gated.segments.iter().enumerate() {
        let starts = starts(segment);
        let simulated = [0, 1].map(|v| {
            let world = study.world(segment, theta[v]);
            simulate(segment, &world, &passes[v][k].means, &starts)
        });
        for (c, channel) in ALL.iter().enumerate() {
            let column = |of: &[[f64; CHANNELS]], si: f64| {
                of.iter().map(|r| r[c] / si).collect::<Vec<f64>>()
            };
            let measured = column(&segment.measured, channel.si);
            if measured.iter().all(|m| m.is_nan()) {
                continue;
            }
            let [mut base, mut extended] = [0, 1].map(|v| column(&simulated[v], channel.si));
            if c == at::ROLL + 2 {
                // A compass that was unwrapped stays comparable.
                for (value, m) in base
                    .iter_mut()
                    .chain(&mut extended)
                    .zip(measured.iter().cycle())
                {
                    let near = m + wrap_signed_deg(*value - m);
                    *value = if m.is_finite() { near } else { *value };
                }
            }
            all.push(History {
                label: channel.label,
                unit: channel.unit,
                time_s: segment.time_s.clone(),
                measured,
                base,
                extended,
                starts: starts.clone(),
                base_standardised: column(&passes[0][k].standardised, 1.0),
                extended_standardised: column(&passes[1][k].standardised, 1.0),
            });
        }
    }
    all
}
