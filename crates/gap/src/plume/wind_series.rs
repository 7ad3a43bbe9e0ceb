//! A wind as a series: on an even grid of times, smoothed, carried on before the record; and the
//! straight line through it. Logged winds are vectors, a direction is a number.

use ::plume::field::Transport;

/// How long the weather remembers its swings, s.
const WEATHER_S: f64 = 400.0;

/// Most points of the grid.
const MOST_POINTS: f64 = 40_000.0;

/// A series of `N` numbers on an even grid of times, straight between them and level beyond.
pub(super) struct Grid<const N: usize> {
    pub start_s: f64,
    pub step_s: f64,
    pub values: Vec<[f64; N]>,
}

impl Grid<2> {
    /// Weighted mean of `(time, vector)` in every cell, empty cells filled from both sides.
    pub fn new(samples: impl Iterator<Item = (f64, [f64; 2])>, span_s: (f64, f64)) -> Option<Self> {
        let length = (span_s.1 - span_s.0).max(1.0);
        let step_s = (length / MOST_POINTS).max(1.0);
        let n = (length / step_s).ceil() as usize + 1;
        let mut sums = vec![[0.0; 3]; n];
        for (t, v) in samples {
            let k = (((t - span_s.0) / step_s).round().max(0.0) as usize).min(n - 1);
            sums[k] = [sums[k][0] + v[0], sums[k][1] + v[1], sums[k][2] + 1.0];
        }
        let mut values: Vec<Option<[f64; 2]>> = sums
            .iter()
            .map(|s| (s[2] > 0.0).then(|| [s[0] / s[2], s[1] / s[2]]))
            .collect();
        fill(&mut values)?;
        Some(Self {
            start_s: span_s.0,
            step_s,
            values: values.into_iter().flatten().collect(),
        })
    }

    /// Smooths what departs from the straight line, whose ends would else be bent level, with four
    /// passes of an exponential, two each way: nearly a bell of that width.
    pub fn smooth(&mut self, width_s: f64) {
        let keep = (-self.step_s * std::f64::consts::SQRT_2 / width_s.max(1e-9)).exp();
        let Some(line) = self.line() else { return };
        self.add(&line, -1.0);
        for _ in 0..2 {
            sweep(&mut self.values, keep);
            self.values.reverse();
            sweep(&mut self.values, keep);
            self.values.reverse();
        }
        self.add(&line, 1.0);
    }

    /// Puts winds of `length_s` before the first.
    pub fn lead_in(&mut self, length_s: f64) {
        let count = (length_s / self.step_s).ceil() as usize;
        let mut values = carried_on(&self.values, self.step_s, mean(&self.values), count);
        values.append(&mut self.values);
        self.values = values;
        self.start_s -= count as f64 * self.step_s;
    }
}

impl<const N: usize> Grid<N> {
    /// The straight line through all values.
    fn line(&self) -> Option<Line<N>> {
        let values = self.values.iter().enumerate();
        Line::through(values.map(|(k, v)| (self.time_s(k), *v)))
    }

    /// The time of a value, s.
    pub fn time_s(&self, k: usize) -> f64 {
        self.start_s + k as f64 * self.step_s
    }

    /// Adds a line `times`.
    pub fn add(&mut self, line: &Line<N>, times: f64) {
        for k in 0..self.values.len() {
            let on_it = line.at(self.time_s(k));
            for (value, on_it) in self.values[k].iter_mut().zip(on_it) {
                *value += times * on_it;
            }
        }
    }

    /// The values of every second from the first to the last.
    pub fn each_second(&self) -> impl Iterator<Item = [f64; N]> {
        let length_s = (self.values.len() - 1) as f64 * self.step_s;
        (0..=length_s as usize).map(|s| self.at(self.start_s + s as f64))
    }

    /// The values at a time.
    pub fn at(&self, time_s: f64) -> [f64; N] {
        let last = self.values.len() - 1;
        let place = ((time_s - self.start_s) / self.step_s).clamp(0.0, last as f64);
        let i = (place as usize).min(last.saturating_sub(1));
        let part = place - i as f64;
        let (a, b) = (self.values[i], self.values[(i + 1).min(last)]);
        std::array::from_fn(|c| a[c] + part * (b[c] - a[c]))
    }
}

/// The mean of vectors.
pub(super) fn mean(values: &[[f64; 2]]) -> [f64; 2] {
    let sum = values
        .iter()
        .fold([0.0; 2], |s, v| [s[0] + v[0], s[1] + v[1]]);
    sum.map(|s| s / values.len().max(1) as f64)
}

/// The `count` winds before `values`, which are `step_s` apart: from the mean of their first minute
/// back to that of `all`, as far as the weather remembers.
pub(super) fn carried_on(
    values: &[[f64; 2]],
    step_s: f64,
    all: [f64; 2],
    count: usize,
) -> Vec<[f64; 2]> {
    let first = mean(&values[..first_minute(step_s, values.len())]);
    let at = |k: usize| {
        let keep = kept((count - k) as f64 * step_s);
        [0, 1].map(|c| all[c] + keep * (first[c] - all[c]))
    };
    (0..count).map(at).collect()
}

/// How many of `count` winds that are `step_s` apart are of their first minute, at least one.
pub(super) fn first_minute(step_s: f64, count: usize) -> usize {
    ((60.0 / step_s).ceil() as usize).max(1).min(count)
}

/// What the weather remembers of a wind `before_s` before it: a part.
pub(super) fn kept(before_s: f64) -> f64 {
    (-before_s / WEATHER_S).exp()
}

/// Stretches of the log whose means tell what its slope may be by chance.
const STRETCHES: usize = 10;

/// `N` numbers that change evenly.
pub(super) struct Line<const N: usize> {
    mean_time_s: f64,
    mean: [f64; N],
    /// What each changes by in a second.
    pub per_s: [f64; N],
}

impl<const N: usize> Line<N> {
    /// By least squares through `(time, values)`; level where all are of one time, `None` where
    /// there are none.
    pub fn through(samples: impl Iterator<Item = (f64, [f64; N])>) -> Option<Self> {
        let samples: Vec<(f64, [f64; N])> = samples.collect();
        if samples.is_empty() {
            return None;
        }
        let n = samples.len() as f64;
        let mean_time_s = samples.iter().map(|s| s.0).sum::<f64>() / n;
        let mean = std::array::from_fn(|c| samples.iter().map(|s| s.1[c]).sum::<f64>() / n);
        let square: f64 = samples.iter().map(|s| (s.0 - mean_time_s).powi(2)).sum();
        let per_s = std::array::from_fn(|c| {
            let both: f64 = samples
                .iter()
                .map(|s| (s.0 - mean_time_s) * (s.1[c] - mean[c]))
                .sum();
            if square > 0.0 { both / square } else { 0.0 }
        });
        Some(Self {
            mean_time_s,
            mean,
            per_s,
        })
    }

    /// The values on it at a time.
    pub fn at(&self, time_s: f64) -> [f64; N] {
        std::array::from_fn(|c| self.mean[c] + self.per_s[c] * (time_s - self.mean_time_s))
    }
}

impl Line<2> {
    /// Standard deviation of what gusts make by chance of the trend of its direction, by the
    /// scatter of the means of stretches of `samples` about it, degrees an hour.
    pub fn chance_deg_per_h(&self, samples: &[(f64, [f64; 2])]) -> f64 {
        let mean = towards(self.mean);
        let across = |v: [f64; 2]| v[1] * mean.east - v[0] * mean.north;
        let times = samples.iter().map(|s| s.0);
        let (from, to) = times.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), t| {
            (a.min(t), b.max(t))
        });
        // Of each stretch the count, and the sums of the times and of the distances from the line.
        let mut sums = [[0.0; 3]; STRETCHES];
        for (time_s, value) in samples {
            let place = (time_s - from) / (to - from).max(1e-9) * STRETCHES as f64;
            let sum = &mut sums[(place as usize).min(STRETCHES - 1)];
            let off = across(*value) - across(self.at(*time_s));
            *sum = [
                sum[0] + 1.0,
                sum[1] + time_s - self.mean_time_s,
                sum[2] + off,
            ];
        }
        let full: Vec<_> = sums.iter().filter(|s| s[0] > 0.0).collect();
        let square: f64 = full.iter().map(|s| (s[1] / s[0]).powi(2)).sum();
        let scatter: f64 = full.iter().map(|s| (s[2] / s[0]).powi(2)).sum();
        if full.len() < 3 || square == 0.0 {
            return 0.0;
        }
        let per_s = (scatter / (full.len() - 2) as f64 / square).sqrt();
        (per_s / mean.speed_m_s.max(0.5)).to_degrees() * 3600.0
    }
}

fn sweep(values: &mut [[f64; 2]], keep: f64) {
    // Starting from the mean of the first stretch keeps the ends from leaning on one value.
    let stretch = ((1.0 / (1.0 - keep)) as usize).clamp(1, values.len());
    let mut state = [0.0; 2];
    for v in &values[..stretch] {
        state = [
            state[0] + v[0] / stretch as f64,
            state[1] + v[1] / stretch as f64,
        ];
    }
    for v in values {
        state = [
            keep * state[0] + (1.0 - keep) * v[0],
            keep * state[1] + (1.0 - keep) * v[1],
        ];
        *v = state;
    }
}

fn fill(values: &mut [Option<[f64; 2]>]) -> Option<()> {
    let known: Vec<usize> = (0..values.len()).filter(|i| values[*i].is_some()).collect();
    let (first, last) = (*known.first()?, *known.last()?);
    let (head, tail) = (values[first], values[last]);
    values[..first].fill(head);
    values[last + 1..].fill(tail);
    for pair in known.windows(2) {
        let (Some(a), Some(b)) = (values[pair[0]], values[pair[1]]) else {
            continue;
        };
        let steps = (pair[1] - pair[0]) as f64;
        for (k, value) in values[pair[0] + 1..pair[1]].iter_mut().enumerate() {
            let part = (k + 1) as f64 / steps;
            *value = Some([a[0] + part * (b[0] - a[0]), a[1] + part * (b[1] - a[1])]);
        }
    }
    Some(())
}

/// A wind given as metres a second towards east and north.
pub(super) fn towards(v: [f64; 2]) -> Transport {
    let speed_m_s = v[0].hypot(v[1]);
    let (east, north) = if speed_m_s > 0.0 {
        (v[0] / speed_m_s, v[1] / speed_m_s)
    } else {
        (1.0, 0.0)
    };
    Transport {
        east,
        north,
        speed_m_s,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;
    use rand::rngs::ChaCha8Rng;
    use rand_distr::{Distribution, StandardNormal};

    /// Half an hour of gusts of 1 m/s that last about a minute, about a steady wind from the
    /// south-west.
    fn gusts(seed: u64) -> Vec<(f64, [f64; 2])> {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let mut normal = || -> f64 { StandardNormal.sample(&mut rng) };
        let keep = (-1.0 / 60.0f64).exp();
        let mut gust = [normal(), normal()];
        let wind = |t: u32| {
            gust = gust.map(|g| keep * g + (1.0 - keep * keep).sqrt() * normal());
            (f64::from(t), gust.map(|g| 5.0 + g))
        };
        (0..1800).map(wind).collect()
    }

    // The trend that is fitted is all chance there: over the deviation stated it has a mean square
    // of one, or of 8/6 by Student's law of eight degrees of freedom.
    #[test]
    fn what_gusts_make_of_a_trend_is_stated() {
        let squares = (0..400).map(|seed| {
            let samples = gusts(seed);
            let line = Line::through(samples.iter().copied()).unwrap();
            let from = |t: f64| line.at(t)[1].atan2(line.at(t)[0]).to_degrees();
            let trend = (from(1800.0) - from(0.0)) / 0.5;
            (trend / line.chance_deg_per_h(&samples)).powi(2)
        });
        let mean = squares.sum::<f64>() / 400.0;
        assert!((0.9..2.0).contains(&mean), "{mean}");
        let even = |t: i32| (f64::from(t), [7.0, 1e-3 * f64::from(t)]);
        let steady: Vec<_> = (0..1800).map(even).collect();
        let line = Line::through(steady.iter().copied()).unwrap();
        assert!(line.chance_deg_per_h(&steady) < 1e-6);
        assert_eq!(line.chance_deg_per_h(&steady[..2]), 0.0);
    }

    #[test]
    fn smoothing_keeps_a_constant_and_halves_noise() {
        let samples = (0..600).map(|i| (f64::from(i), [5.0, if i % 2 == 0 { 1.0 } else { -1.0 }]));
        let mut grid = Grid::new(samples, (0.0, 599.0)).unwrap();
        grid.smooth(10.0);
        for v in &grid.values {
            assert!((v[0] - 5.0).abs() < 1e-9 && v[1].abs() < 0.1);
        }
    }

    #[test]
    fn smoothing_keeps_what_a_log_drifts_by() {
        let at = |t: f64| [5.0 + 0.002 * t, -0.004 * t];
        let samples = (0..600).map(|i| (f64::from(i), at(f64::from(i))));
        let mut grid = Grid::new(samples, (0.0, 599.0)).unwrap();
        grid.smooth(120.0);
        for (k, v) in grid.values.iter().enumerate() {
            let want = at(k as f64);
            assert!((v[0] - want[0]).abs() < 1e-9 && (v[1] - want[1]).abs() < 1e-9);
        }
    }

    #[test]
    fn gaps_are_bridged_straight() {
        let mut v = vec![None, Some([1.0, 0.0]), None, Some([3.0, 0.0]), None];
        fill(&mut v).unwrap();
        let east: Vec<f64> = v.iter().flatten().map(|v| v[0]).collect();
        assert_eq!(east, [1.0, 1.0, 2.0, 3.0, 3.0]);
        assert!(fill(&mut [None, None]).is_none());
    }
}
