//! Measured samples smoothed by a local parabola, with accelerations as its slopes and the published
//! moments through the same filter.

use fdm::Aircraft;
use fdm::dynamics::flow;

use super::super::channel::at;
use super::super::gate::Segment;
use super::super::motion::World;
use super::*;

/// Samples of one uninterrupted part, smoothed, with the accelerations.
pub(super) struct Smooth {
    pub(super) interval: f64,
    pub(super) block: usize,
    pub(super) rate: [Vec<f64>; 3],
    pub(super) spin: [Vec<f64>; 3],
    pub(super) flow: [Vec<f64>; 3],
    pub(super) force: [Vec<f64>; 3],
    /// Elevator, aileron, rudder as told, raw.
    pub(super) told: [Vec<f64>; 3],
    pub(super) raw_rate: [Vec<f64>; 3],
    pub(super) density: Vec<f64>,
    /// Moment of the published model, smoothed likewise, N m.
    pub(super) published: [Vec<f64>; 3],
    pub(super) roll: Vec<f64>,
    pub(super) pitch: Vec<f64>,
}

/// Weights of value and slope of a parabola over `n` samples either side.
pub(super) fn savitzky_golay(n: usize, interval: f64) -> (Vec<f64>, Vec<f64>) {
    let m = n as f64;
    let count = 2.0 * m + 1.0;
    let second: f64 = m * (m + 1.0) * count / 3.0;
    let fourth: f64 = second * (3.0 * m * m + 3.0 * m - 1.0) / 5.0;
    let k = |i: usize| i as f64 - m;
    let det = count * fourth - second * second;
    let value = (0..=2 * n)
        .map(|i| (fourth - second * k(i) * k(i)) / det)
        .collect();
    let slope = (0..=2 * n).map(|i| k(i) / (second * interval)).collect();
    (value, slope)
}

pub(super) fn filtered(x: &[f64], weights: &[f64]) -> Vec<f64> {
    let n = weights.len() / 2;
    (0..x.len())
        .map(|i| {
            if i < n || i + n >= x.len() {
                return f64::NAN;
            }
            let window = &x[i - n..=i + n];
            window.iter().zip(weights).map(|(x, w)| x * w).sum()
        })
        .collect()
}

/// Gaps bridged by straight lines; at the ends the nearest value.
pub(super) fn bridged(x: &[f64]) -> Vec<f64> {
    let known: Vec<usize> = (0..x.len()).filter(|&i| x[i].is_finite()).collect();
    let mut out = vec![0.0; x.len()];
    let (Some(&first), Some(&last)) = (known.first(), known.last()) else {
        return out;
    };
    out[..=first].fill(x[first]);
    out[last..].fill(x[last]);
    for pair in known.windows(2) {
        let (a, b) = (pair[0], pair[1]);
        for i in a..=b {
            let part = (i - a) as f64 / (b - a) as f64;
            out[i] = x[a] + part * (x[b] - x[a]);
        }
    }
    out
}

impl Smooth {
    pub(super) fn new(segment: &Segment, world: &World) -> Option<Self> {
        let time = &segment.time_s;
        let interval = (time[time.len() - 1] - time[0]) / (time.len() - 1) as f64;
        let n = ((0.5 * WINDOW_S / interval).round() as usize).max(2);
        if time.len() < 8 * n {
            return None;
        }
        let (value, slope) = savitzky_golay(n, interval);
        let raw = |k: usize| bridged(&segment.measured.iter().map(|m| m[k]).collect::<Vec<_>>());
        let smooth = |k: usize| filtered(&raw(k), &value);
        let raw_rate: [Vec<f64>; 3] = std::array::from_fn(|k| raw(at::ROLL_RATE + k));
        let told = |f: fn(&fdm::SurfaceCommand) -> f64| segment.command.iter().map(f).collect();
        let air: [Vec<f64>; 3] = std::array::from_fn(raw);
        let mut published: [Vec<f64>; 3] = std::array::from_fn(|_| Vec::new());
        for i in 0..segment.len() {
            let (sin_a, cos_a) = air[at::ALPHA][i].sin_cos();
            let (sin_b, cos_b) = air[at::BETA][i].sin_cos();
            let speed = air[at::AIRSPEED][i];
            let body = [speed * cos_a * cos_b, speed * sin_b, speed * sin_a * cos_b];
            let level = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
            let flow = flow(&level, &body, &[0.0; 3]);
            let rate = [raw_rate[0][i], raw_rate[1][i], raw_rate[2][i]];
            let (_, moment) = world.load(segment, i, &flow, &rate);
            for k in 0..3 {
                published[k].push(moment[k]);
            }
        }
        Some(Self {
            interval,
            block: (BLOCK_S / interval) as usize,
            spin: std::array::from_fn(|k| filtered(&raw_rate[k], &slope)),
            rate: std::array::from_fn(|k| smooth(at::ROLL_RATE + k)),
            flow: std::array::from_fn(smooth),
            force: std::array::from_fn(|k| smooth(at::FORCE + k)),
            told: [
                told(|c| c.elevator_rad),
                told(|c| c.aileron_rad),
                told(|c| c.rudder_rad),
            ],
            raw_rate,
            density: segment.density.clone(),
            published: published.map(|p| filtered(&p, &value)),
            roll: raw(at::ROLL),
            pitch: raw(at::ROLL + 1),
        })
    }

    pub(super) fn len(&self) -> usize {
        self.density.len()
    }

    /// A command `delay` seconds ago, smoothed, rad.
    pub(super) fn late(&self, surface: usize, delay: f64) -> Vec<f64> {
        let n = ((0.5 * WINDOW_S / self.interval).round() as usize).max(2);
        let told = &self.told[surface];
        let shifted: Vec<f64> = (0..told.len())
            .map(|i| {
                let at = (i as f64 - delay / self.interval).max(0.0);
                let (low, part) = (at.floor() as usize, at.fract());
                told[low] + part * (told[(low + 1).min(told.len() - 1)] - told[low])
            })
            .collect();
        filtered(&shifted, &savitzky_golay(n, self.interval).0)
    }

    /// Measured moment coefficient about `axis` and what makes it one.
    pub(super) fn coefficient(&self, a: &Aircraft, axis: usize, i: usize) -> (f64, f64) {
        let b = &a.body;
        let [p, q, r] = [self.rate[0][i], self.rate[1][i], self.rate[2][i]];
        let [pd, qd, rd] = [self.spin[0][i], self.spin[1][i], self.spin[2][i]];
        let moment = match axis {
            0 => {
                b.ixx_kg_m2 * pd - b.ixz_kg_m2 * (rd + p * q) + (b.izz_kg_m2 - b.iyy_kg_m2) * q * r
            }
            1 => {
                b.iyy_kg_m2 * qd
                    + (b.ixx_kg_m2 - b.izz_kg_m2) * p * r
                    + b.ixz_kg_m2 * (p * p - r * r)
            }
            _ => {
                b.izz_kg_m2 * rd - b.ixz_kg_m2 * (pd - q * r) + (b.iyy_kg_m2 - b.ixx_kg_m2) * p * q
            }
        };
        (moment, self.scale(a, axis, i))
    }

    /// Dynamic pressure times area times length, N m.
    pub(super) fn scale(&self, a: &Aircraft, axis: usize, i: usize) -> f64 {
        let length = if axis == 1 {
            a.wing.chord_m
        } else {
            a.wing.span_m
        };
        0.5 * self.density[i] * self.flow[at::AIRSPEED][i].powi(2) * a.wing.area_m2 * length
    }
}
