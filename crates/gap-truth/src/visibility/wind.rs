//! What a model may know of the wind: errors of direction and speed, straight between knots, as the
//! law of the wind and its log allow.

use super::base::{Base, excess};
use super::{Column, Matrix};
use crate::instrument::{LOG_SPEED_NOISE, LOG_TURBULENCE, wind_instrument};
use crate::linear;
use crate::physics::Forward;
use crate::scene::LoggedWind;

/// Spacing of the knots between which the wind's error is straight, s, where it acts at once: half of
/// how long the shortest gusts last; and where it acts by its mean over the way, which is long.
const KNOT_AT_ONCE_S: f64 = 10.0;
const KNOT_ON_THE_WAY_S: f64 = 25.0;

impl Base<'_, '_> {
    /// What a swing of the wind's direction does between two knots: standard deviation, degrees, and
    /// correlation time, s. A process of standard deviation s and time T that is known at both ends
    /// of a short stretch h has the mean variance s² h / 3 T in it (a Brownian bridge).
    pub(super) fn swing_between_knots(&self) -> (f64, f64) {
        let builder = &self.worth.builder;
        let knot_s = self.knot_s();
        if builder.forward != Forward::Gaussian {
            return (0.0, knot_s / 3.0);
        }
        let law = builder.scene.wind;
        let of = |(sd, lasts_s): (f64, f64)| sd.powi(2) * knot_s / (3.0 * lasts_s);
        let variance = of(law.slow_meander) + of(law.direction_gust);
        (variance.sqrt(), knot_s / 3.0)
    }

    fn knot_s(&self) -> f64 {
        match self.worth.builder.forward {
            Forward::Gaussian => KNOT_AT_ONCE_S,
            Forward::Puffs | Forward::AgedPuffs => KNOT_ON_THE_WAY_S,
        }
    }

    /// The errors of the wind's direction and speed, straight between knots.
    pub(super) fn add_wind(&mut self, by_direction: Column) {
        let slower = excess(&self.logs)
            .into_iter()
            .map(|rows| rows.into_iter().map(|e| -e).collect())
            .collect();
        let scene = &self.worth.builder.scene;
        let law = scene.wind;
        let direction = [law.slow_meander, law.direction_gust];
        let log = self.log_information(|white_deg| (LOG_TURBULENCE.0, white_deg));
        let speed_log = self.log_information(|_| (LOG_TURBULENCE.1, LOG_SPEED_NOISE));
        let parts = [
            (by_direction, &direction[..], log),
            (slower, &[law.speed_gust][..], speed_log),
        ];
        let mut wind = Vec::new();
        for (by_unit, processes, information) in parts {
            if let Some(prior) = self.knots_prior(processes, information) {
                wind.push((self.knots_columns(&by_unit), prior));
            }
        }
        self.wind = wind;
    }

    /// Start of the wind's knots, s, and their number.
    fn knots(&self) -> (f64, usize) {
        let scene = &self.worth.builder.scene;
        let (from_s, until_s) = (-self.longest_way_s(), scene.duration_s);
        (
            from_s,
            ((until_s - from_s) / self.knot_s()).ceil() as usize + 1,
        )
    }

    /// The knot before `time_s`, and how far the time is on the way to the next.
    fn knot(&self, time_s: f64) -> (usize, f64) {
        let (from_s, count) = self.knots();
        let place = ((time_s - from_s) / self.knot_s()).clamp(0.0, count as f64 - 1.000_001);
        (place as usize, place.fract())
    }

    /// Longest time that what is read has been under way, s.
    fn longest_way_s(&self) -> f64 {
        let scene = &self.worth.builder.scene;
        match self.worth.builder.forward {
            Forward::Gaussian => 0.0,
            _ => 1.3 * scene.reach.distance_m.1 / scene.wind.speed_m_s,
        }
    }

    /// What a second of all logs tells of the wind: one over the variance; none where nobody logs.
    /// `noise` gives standard deviations of turbulence and white noise of the log.
    fn log_information(&self, noise: impl Fn(f64) -> (f64, f64)) -> f64 {
        let builder = &self.worth.builder;
        let (scene, seed) = (&builder.scene, builder.spec.seed);
        let logs = match scene.logged_wind {
            LoggedWind::Absent => 0,
            LoggedWind::Site => 1,
            LoggedWind::OnBoard => scene.tracks.len(),
        };
        let step_s = scene.row_step_s as f64;
        let keep = (-step_s / LOG_TURBULENCE.2).exp();
        (0..logs)
            .map(|index| {
                let (turbulence, white) = noise(wind_instrument(scene, seed, index).0);
                // Variance of a mean of many rows of a first-order process, times their number.
                let long = turbulence.powi(2) * (1.0 + keep) / (1.0 - keep) + white.powi(2);
                1.0 / (long * step_s)
            })
            .sum()
    }

    /// Inverse covariance of the knots: `processes` (standard deviation and correlation time of
    /// each), and what a second of the log tells.
    fn knots_prior(&self, processes: &[(f64, f64)], per_second: f64) -> Option<Matrix> {
        let count = self.knots().1;
        let covariance = |i: usize, j: usize| {
            let apart_s = self.knot_s() * (i as f64 - j as f64).abs();
            let of = |(sd, lasts_s): &(f64, f64)| sd.powi(2) * (-apart_s / lasts_s).exp();
            // A trifle on the diagonal keeps a process that hardly changes from being singular.
            processes.iter().map(of).sum::<f64>() * if i == j { 1.0 + 1e-9 } else { 1.0 }
        };
        let rows: Vec<Vec<f64>> = (0..count)
            .map(|i| (0..count).map(|j| covariance(i, j)).collect())
            .collect();
        let mut prior = linear::inverse(&rows)?;
        for second in 0..self.worth.builder.scene.duration_s as usize {
            let (k, share) = self.knot(second as f64);
            for (i, a) in [(k, 1.0 - share), (k + 1, share)] {
                for (j, b) in [(k, 1.0 - share), (k + 1, share)] {
                    prior[i][j] += per_second * a * b;
                }
            }
        }
        Some(prior)
    }

    /// What each knot adds to each row, where a whole turn adds `by_unit`: the wind's mean over the
    /// way of what is read.
    fn knots_columns(&self, by_unit: &[Vec<f64>]) -> Vec<Column> {
        let (from_s, count) = self.knots();
        let mut columns = vec![self.everywhere(0.0); count];
        let scene = &self.worth.builder.scene;
        for (p, log) in self.logs.iter().enumerate() {
            for (r, row) in log.rows.iter().enumerate() {
                let way_s = match self.worth.builder.forward {
                    Forward::Gaussian => 0.0,
                    _ => {
                        let point = scene.track_at(p, row.time_s);
                        (point[0].hypot(point[1]) / scene.wind.speed_m_s).min(-from_s)
                    }
                };
                // By some points of the way: it is long beside none of the knots' spaces.
                let points = (way_s / (0.5 * self.knot_s())).ceil() as usize + 1;
                for n in 0..points {
                    let part = (n as f64 + 0.5) / points as f64;
                    let (k, share) = self.knot(row.time_s - part * way_s);
                    let whole = by_unit[p][r] / points as f64;
                    columns[k][p][r] += (1.0 - share) * whole;
                    columns[k + 1][p][r] += share * whole;
                }
            }
        }
        columns
    }
}
