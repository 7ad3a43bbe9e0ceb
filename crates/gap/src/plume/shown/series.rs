//! The series of a wind by the plume that it carried: its direction at knots in time, of which the
//! plume at a distance has the mean over its way, by Gauss–Newton under the weather's memory.

use nalgebra::{DMatrix, DVector};

use super::super::fit::Context;
use super::super::model::{Model, Prediction};
use super::super::nuisance::Spacing;
use super::super::ways::Knots;
use super::super::wind_series::{Grid, kept};
use super::{FREEDOM, Readings};

/// Knots of the series.
const KNOTS: Spacing = Spacing {
    s: 20.0,
    most: 300.0,
};
const ITERATIONS: usize = 8;
/// How often a step that is too long is halved, and what the last one gains, nats.
const HALVINGS: i32 = 4;
const LAST_GAIN_NATS: f64 = 0.1;

/// What is fitted.
struct Problem<'a, 'b> {
    readings: &'a Readings<'a, 'b>,
    model: &'a Model,
    knots: Knots,
    precision: DMatrix<f64>,
}

/// A place of the search, and what is known there.
struct At {
    knots: DVector<f64>,
    prediction: Prediction,
    /// What a degree changes in each reading, ppm.
    per_deg: Vec<f64>,
    /// Log probability, nats.
    nats: f64,
}

/// The wind's direction whose plume is the most probable, degrees, from where each row has its plume
/// turned as `seen_deg` says for its time.
pub(super) fn fitted(
    readings: &Readings<'_, '_>,
    model: &Model,
    seen_deg: &Grid<1>,
    swing_deg: f64,
) -> Grid<1> {
    let ctx = readings.ctx;
    let knots = Knots::over(ctx, KNOTS);
    let used = ctx.way_s().zip(&ctx.data.used).filter(|(_, used)| **used);
    let (sum_s, rows) = used.fold((0.0, 0.0), |(s, n), (way_s, _)| (s + way_s, n + 1.0));
    let middle_s = 0.5 * sum_s / f64::max(rows, 1.0);
    let seen = |k: usize| seen_deg.at(knots.start_s + k as f64 * knots.step_s + middle_s)[0];
    let start = DVector::from_fn(knots.count, |k, _| seen(k));
    let problem = Problem {
        readings,
        model,
        precision: remembered(knots.count, knots.step_s, swing_deg),
        knots,
    };
    let turned_deg = problem.solved(start);
    Grid {
        start_s: problem.knots.start_s,
        step_s: problem.knots.step_s,
        values: turned_deg.iter().map(|deg| [*deg]).collect(),
    }
}

/// The precision of a swing that the weather remembers, at knots.
fn remembered(count: usize, step_s: f64, swing_deg: f64) -> DMatrix<f64> {
    let keep = kept(step_s);
    let innovation = swing_deg.powi(2) * (1.0 - keep * keep);
    let mut out = DMatrix::zeros(count, count);
    for k in 0..count {
        let inner = k > 0 && k + 1 < count;
        out[(k, k)] = (1.0 + if inner { keep * keep } else { 0.0 }) / innovation;
        if k > 0 {
            out[(k, k - 1)] = -keep / innovation;
            out[(k - 1, k)] = -keep / innovation;
        }
    }
    out
}

impl Problem<'_, '_> {
    /// What is known where the plume is turned as these knots say.
    fn at(&self, knots: DVector<f64>) -> At {
        let mut data = self.readings.ctx.data.clone();
        for (wind, way) in data.track.transport_mut().iter_mut().zip(&self.knots.turns) {
            let parts = way.parts.iter().enumerate();
            let turned_deg = parts.map(|(k, p)| p * knots[way.first + k]).sum();
            *wind = wind.turned(turned_deg);
        }
        let ctx = Context {
            data: &data,
            ..*self.readings.ctx
        };
        let prediction = ctx.predict(self.model);
        let loading = ctx.loading(self.model, &prediction);
        let rows = prediction.reading.iter().zip(&prediction.plume).enumerate();
        let own: f64 = rows.map(|(i, (r, p))| self.readings.nats(i, *r, *p)).sum();
        At {
            nats: own - 0.5 * knots.dot(&(&self.precision * &knots)),
            per_deg: loading.iter().map(|l| l.swing).collect(),
            knots,
            prediction,
        }
    }

    /// The most probable knots, from `start`.
    fn solved(&self, start: DVector<f64>) -> DVector<f64> {
        let mut at = self.at(start);
        for _ in 0..ITERATIONS {
            let Some(step) = self.step(&at) else { break };
            let mut shorter = (0..HALVINGS).map(|k| self.at(&at.knots + 0.5f64.powi(k) * &step));
            let Some(better) = shorter.find(|there| there.nats > at.nats) else {
                break;
            };
            let gained = better.nats - at.nats;
            at = better;
            if gained < LAST_GAIN_NATS {
                break;
            }
        }
        at.knots
    }

    /// A step of Gauss–Newton, by rows that count less the farther they are off (Student's law).
    fn step(&self, at: &At) -> Option<DVector<f64>> {
        let mut gram = self.precision.clone();
        let mut score = -(&self.precision * &at.knots);
        for (i, way) in self.knots.turns.iter().enumerate() {
            let off = self.readings.ctx.data.reading_ppm[i] - at.prediction.reading[i];
            let variance = self.readings.variance(at.prediction.plume[i]);
            let counts = self.readings.counts[i];
            let weight = counts * (FREEDOM + 1.0) / (FREEDOM * variance + off * off);
            let per_deg = at.per_deg[i];
            if counts == 0.0 || per_deg == 0.0 {
                continue;
            }
            for (k, p) in way.parts.iter().enumerate() {
                let own = weight * per_deg * p;
                score[way.first + k] += own * off;
                for (l, q) in way.parts.iter().enumerate() {
                    gram[(way.first + k, way.first + l)] += own * per_deg * q;
                }
            }
        }
        gram.cholesky().map(|c| c.solve(&score))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    // Ornstein & Uhlenbeck 1930: the covariance falls as exp(-t / T), here T = 400 s.
    #[test]
    fn the_weather_remembers_as_an_ornstein_uhlenbeck_walk() {
        let (step_s, swing_deg) = (20.0, 3.0);
        let covariance = remembered(30, step_s, swing_deg).try_inverse().unwrap();
        for (i, j) in [(0, 0), (5, 9), (29, 2), (12, 12)] {
            let apart_s = (i as f64 - j as f64).abs() * step_s;
            let want = 9.0 * (-apart_s / 400.0).exp();
            assert!((covariance[(i, j)] - want).abs() < 1e-9);
        }
    }
}
