//! Measured samples smoothed by a local parabola, with accelerations as its slopes and the published
//! moments through the same filter.

use fdm::{Aircraft, SurfaceCommand};

use super::WINDOW_S;
use crate::flight::channel::at;
use crate::flight::gate::Segment;
use crate::flight::motion::World;

/// What is slower than this is taken off before delays are sought, s.
const DETREND_S: f64 = 2.0;
/// Length of blocks left out, s.
const BLOCK_S: f64 = 10.0;

/// Samples of one uninterrupted part, smoothed, with the accelerations.
pub(super) struct Smooth {
    pub interval: f64,
    pub rate: [Vec<f64>; 3],
    pub spin: [Vec<f64>; 3],
    pub flow: [Vec<f64>; 3],
    pub force: [Vec<f64>; 3],
    /// Elevator, aileron, rudder as told, raw.
    pub told: [Vec<f64>; 3],
    pub raw_rate: [Vec<f64>; 3],
    pub density: Vec<f64>,
    /// Moment of the published model, smoothed likewise, N m.
    pub published: [Vec<f64>; 3],
    /// Roll and pitch angle, raw, rad.
    pub angle: [Vec<f64>; 2],
}

/// Weights of value and slope of a parabola over half of [`WINDOW_S`] either side.
fn savitzky_golay(interval: f64) -> [Vec<f64>; 2] {
    let n = ((0.5 * WINDOW_S / interval).round() as i32).max(2);
    let places = || (-n..=n).map(f64::from);
    let [count, second, fourth] =
        [0, 2, 4].map(|power| places().map(|k| k.powi(power)).sum::<f64>());
    let det = count * fourth - second * second;
    let value = places().map(|k| (fourth - second * k * k) / det);
    let slope = places().map(|k| k / (second * interval));
    [value.collect(), slope.collect()]
}

fn filtered(x: &[f64], weights: &[f64]) -> Vec<f64> {
    let n = weights.len() / 2;
    let mut out = vec![f64::NAN; x.len()];
    for (out, window) in out[n.min(x.len())..]
        .iter_mut()
        .zip(x.windows(weights.len()))
    {
        *out = window.iter().zip(weights).map(|(x, w)| x * w).sum();
    }
    out
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

/// `x` without what is slower than [`DETREND_S`].
pub(super) fn detrended(x: &[f64], interval: f64) -> Vec<f64> {
    let half = (0.5 * DETREND_S / interval) as usize;
    let mut sums = vec![0.0];
    for v in x {
        sums.push(sums[sums.len() - 1] + v);
    }
    let without_mean = |i: usize| {
        let (from, to) = (i.saturating_sub(half), (i + half + 1).min(x.len()));
        x[i] - (sums[to] - sums[from]) / (to - from) as f64
    };
    (0..x.len()).map(without_mean).collect()
}

impl Smooth {
    pub fn new(segment: &Segment, world: &World) -> Option<Self> {
        let time = &segment.time_s;
        let interval = (time[time.len() - 1] - time[0]) / (time.len() - 1) as f64;
        let [value, slope] = savitzky_golay(interval);
        if time.len() < 4 * value.len() {
            return None;
        }
        let raw = |k: usize| bridged(&segment.measured.iter().map(|m| m[k]).collect::<Vec<_>>());
        let smooth = |k: usize| filtered(&raw(k), &value);
        let raw_rate: [Vec<f64>; 3] = std::array::from_fn(|k| raw(at::ROLL_RATE + k));
        let told = |f: fn(&SurfaceCommand) -> f64| segment.command.iter().map(f).collect();
        let air: [Vec<f64>; 3] = std::array::from_fn(raw);
        let published = |i: usize| {
            let of = |channels: &[Vec<f64>; 3]| std::array::from_fn(|k| channels[k][i]);
            world.moment(segment, i, of(&air), of(&raw_rate))
        };
        let published: Vec<[f64; 3]> = (0..segment.len()).map(published).collect();
        let moment = |k: usize| published.iter().map(|m| m[k]).collect::<Vec<f64>>();
        Some(Self {
            interval,
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
            published: std::array::from_fn(|k| filtered(&moment(k), &value)),
            angle: std::array::from_fn(|k| raw(at::ROLL + k)),
        })
    }

    pub fn len(&self) -> usize {
        self.density.len()
    }

    /// Number of the block of sample `i`, where this is the `part`-th part.
    pub fn block_of(&self, part: usize, i: usize) -> usize {
        1000 * part + i / ((BLOCK_S / self.interval) as usize).max(1)
    }

    /// A command `delay` seconds ago, smoothed, rad.
    pub fn late(&self, surface: usize, delay: f64) -> Vec<f64> {
        let told = &self.told[surface];
        let shifted = |i: usize| {
            let at = (i as f64 - delay / self.interval).max(0.0);
            let (low, part) = (at.floor() as usize, at.fract());
            told[low] + part * (told[(low + 1).min(told.len() - 1)] - told[low])
        };
        let shifted: Vec<f64> = (0..told.len()).map(shifted).collect();
        filtered(&shifted, &savitzky_golay(self.interval)[0])
    }

    /// Measured moment about `axis`, N m.
    pub fn moment(&self, a: &Aircraft, axis: usize, i: usize) -> f64 {
        let b = &a.body;
        let [p, q, r] = [0, 1, 2].map(|k| self.rate[k][i]);
        let [pd, qd, rd] = [0, 1, 2].map(|k| self.spin[k][i]);
        let (x, y, z, xz) = (b.ixx_kg_m2, b.iyy_kg_m2, b.izz_kg_m2, b.ixz_kg_m2);
        match axis {
            0 => x * pd - xz * (rd + p * q) + (z - y) * q * r,
            1 => y * qd + (x - z) * p * r + xz * (p * p - r * r),
            _ => z * rd - xz * (pd - q * r) + (y - x) * p * q,
        }
    }

    /// Specific force across the flow, m/s², down positive.
    pub fn normal_force(&self, i: usize) -> f64 {
        let (sin, cos) = self.flow[at::ALPHA][i].sin_cos();
        self.force[2][i] * cos - self.force[0][i] * sin
    }

    /// Dynamic pressure times area times length, N m.
    pub fn scale(&self, a: &Aircraft, axis: usize, i: usize) -> f64 {
        let length = if axis == 1 {
            a.wing.chord_m
        } else {
            a.wing.span_m
        };
        self.lift_scale(a, i) * length
    }

    /// Dynamic pressure times area, N.
    pub fn lift_scale(&self, a: &Aircraft, i: usize) -> f64 {
        0.5 * self.density[i] * self.flow[at::AIRSPEED][i].powi(2) * a.wing.area_m2
    }
}
