//! Where a fit starts: the most promising place of the plume, a fit that is robust against a
//! plume of another form, and the drift of the axis that the readings show.

use crate::InferError;
use crate::fit::{Point, Problem, axis_drift_alone};
use crate::noise::Noise;
use crate::rows::{AxisTurn, ForwardModel, Prediction, Prior};
use nalgebra::{DMatrix, DVector};
use std::ops::Range;

/// A misfit of eight standard deviations counts as all larger ones: half its square.
const MOST_SCORE: f64 = 32.0;
/// Part of the plume by which a model may be off everywhere.
const ROUGH: f64 = 0.3;
/// Rounds of a first fit and a metric there.
const ROUNDS: usize = 3;
/// Fluctuation of a plume of uncertain form, over what is most probable.
const FLICKER: f64 = 3.0;
/// Turns that are looked for: to both sides, and how far apart, degrees.
const WIDEST_DEG: f64 = 90.0;
const SPACING_DEG: f64 = 1.5;
/// Turns change once in this time, s, and by about so much in a minute, degrees.
const HELD_S: f64 = 20.0;
const PER_MINUTE_DEG: f64 = 10.0;
/// Readings a few seconds apart repeat each other: what one of them counts.
const REPEATED: f64 = 0.25;

impl<M: ForwardModel> Problem<'_, M> {
    /// The most promising of the model's starts, each with the strength that its readings ask for.
    pub(crate) fn search(&self) -> Result<Point, InferError> {
        let priors = self.model.priors();
        let mut starts = self.model.starts();
        starts.push(priors.iter().map(|p| p.mean).collect());
        let still = vec![AxisTurn::NONE; self.rows.len()];
        let mut best: Option<(f64, Vec<f64>)> = None;
        for mut at in starts {
            let mut there = self.model.predict(&at, &still)?;
            if let Some(k) = self.model.ln_strength() {
                let factor = self.asked_strength(&there, &priors[k]);
                at[k] += factor.ln();
                for (reading, plume) in there.reading.iter_mut().zip(&mut there.plume) {
                    *reading += (factor - 1.0) * *plume;
                    *plume *= factor;
                }
            }
            let far = |(x, p): (&f64, &Prior)| 0.5 * ((x - p.mean) / p.sd).powi(2);
            let score = self.rough_scores(&there).iter().sum::<f64>()
                + at.iter().zip(priors).map(far).sum::<f64>();
            if best.as_ref().is_none_or(|b| score < b.0) {
                best = Some((score, at));
            }
        }
        let at = best.map_or_else(Vec::new, |b| b.1);
        Ok(Point {
            at,
            weights: vec![0.0; self.turning.axis_drift.len()],
        })
    }

    /// The factor on the plume that fits best by least squares, within three standard deviations of
    /// what is known of its logarithm.
    fn asked_strength(&self, there: &Prediction, known: &Prior) -> f64 {
        let (mut square, mut product) = (0.0, 0.0);
        for i in (0..self.rows.len()).filter(|&i| self.rows.is_used(i)) {
            let rest = self.rows.measured()[i] - (there.reading[i] - there.plume[i]);
            square += there.plume[i] * there.plume[i];
            product += there.plume[i] * rest;
        }
        let most = (3.0 * known.sd).exp();
        if square > 0.0 {
            (product / square).clamp(1.0 / most, most)
        } else {
            1.0
        }
    }

    /// Half the square of each row's misfit by a plume of uncertain form, no more than `MOST_SCORE`:
    /// what is not this plume must not decide where it is.
    pub(crate) fn rough_scores(&self, there: &Prediction) -> Vec<f64> {
        let score = |i: usize| {
            if !self.rows.is_used(i) {
                return 0.0;
            }
            let misfit = self.rows.measured()[i] - there.reading[i];
            let variance = self.sensor_sd.powi(2) + (ROUGH * there.plume[i]).powi(2);
            (0.5 * misfit * misfit / variance).min(MOST_SCORE)
        };
        (0..self.rows.len()).map(score).collect()
    }

    /// A fit without a discrepancy, whose noise grows with what was read as well as with what is
    /// expected: a plume that is wider than the model's must widen it, not be fled from.
    pub(crate) fn rough_fit(
        &self,
        start: &Point,
        axis_drift_deg: f64,
    ) -> Result<Point, InferError> {
        let prior = self.usual_noise();
        let noise = Noise {
            fluctuation: FLICKER * prior.fluctuation,
            ..prior
        };
        let basis = self.turning.axis_drift.clone();
        let inflation = vec![1.0; self.rows.len()];
        let mut point = start.clone();
        for _ in 0..ROUNDS {
            let mut loadings = self.loadings(&point, &basis, &noise)?;
            let there = self
                .model
                .predict(&point.at, &vec![AxisTurn::NONE; self.rows.len()])?;
            for i in (0..self.rows.len()).filter(|&i| self.rows.is_used(i)) {
                let read = self.rows.measured()[i] - (there.reading[i] - there.plume[i]);
                loadings.plume[i] = loadings.plume[i].max(read);
            }
            let metric = self.metric_of(loadings, &noise, &inflation);
            (point, _) =
                self.steps_under(&point, &basis, axis_drift_alone(axis_drift_deg), &metric)?;
        }
        Ok(point)
    }

    /// The point with the drift of the axis that the readings show, and the axis drift's size in degrees:
    /// the most probable sequence of turns (Viterbi 1967) of a random walk, made smooth.
    pub(crate) fn swung(&self, point: &Point) -> Result<(Point, f64), InferError> {
        let half = (WIDEST_DEG / SPACING_DEG) as i32;
        let turns: Vec<f64> = (-half..=half).map(|k| f64::from(k) * SPACING_DEG).collect();
        let mut scores = Vec::with_capacity(turns.len());
        for turn in &turns {
            let there = self.model.predict(
                &point.at,
                &vec![AxisTurn::clockwise(*turn); self.rows.len()],
            )?;
            scores.push(self.rough_scores(&there));
        }
        let mut path = vec![AxisTurn::NONE; self.rows.len()];
        for range in self.rows.series() {
            self.walk(range, &turns, &scores, &mut path);
        }
        let square: f64 = path.iter().map(|t| t.clockwise_deg.powi(2)).sum();
        let size_deg = (square / path.len().max(1) as f64).sqrt();
        let next = Point {
            weights: self.drift_weights(&path),
            ..point.clone()
        };
        Ok((next, size_deg))
    }

    /// The most probable turns of one series.
    fn walk(
        &self,
        series: Range<usize>,
        turns: &[f64],
        scores: &[Vec<f64>],
        path: &mut [AxisTurn],
    ) {
        let time_s = self.rows.time_s();
        let mut held: Vec<Range<usize>> = Vec::new();
        for i in series {
            match held.last_mut() {
                Some(h) if time_s[i] - time_s[h.start] < HELD_S => h.end = i + 1,
                _ => held.push(i..i + 1),
            }
        }
        let mut total = vec![0.0; turns.len()];
        let mut came: Vec<Vec<usize>> = Vec::with_capacity(held.len());
        for (k, rows) in held.iter().enumerate() {
            let mut next = vec![0.0; turns.len()];
            let mut from: Vec<usize> = (0..turns.len()).collect();
            for to in 0..turns.len() {
                if k > 0 {
                    let dt_s = time_s[rows.start] - time_s[held[k - 1].start];
                    let walk = PER_MINUTE_DEG * PER_MINUTE_DEG * dt_s / 60.0;
                    let way =
                        |f: usize| (total[f] + 0.5 * (turns[to] - turns[f]).powi(2) / walk, f);
                    let best = (0..turns.len()).map(way).min_by(|a, b| a.0.total_cmp(&b.0));
                    (next[to], from[to]) = best.unwrap_or((0.0, to));
                }
                next[to] += REPEATED * scores[to][rows.clone()].iter().sum::<f64>();
            }
            total = next;
            came.push(from);
        }
        let least = (0..turns.len()).min_by(|a, b| total[*a].total_cmp(&total[*b]));
        let mut at = least.unwrap_or_default();
        for (rows, from) in held.iter().zip(&came).rev() {
            path[rows.clone()].fill(AxisTurn::clockwise(turns[at]));
            at = from[at];
        }
    }

    /// Weights of the axis drift whose turns are nearest to `turns`, by least squares.
    pub(crate) fn drift_weights(&self, turns: &[AxisTurn]) -> Vec<f64> {
        // Keeps basis functions that no row tells apart at rest.
        const RIDGE: f64 = 1e-3;
        let n = self.turning.axis_drift.functions_per_direction();
        let (rows, values) = (turns.len(), &self.turning.basis_functions);
        let basis_functions = DMatrix::from_column_slice(n, rows, values);
        let ridge = DMatrix::identity(n, n) * RIDGE * rows.max(1) as f64;
        let square = (&basis_functions * basis_functions.transpose() + ridge).cholesky();
        let nearest = |of: fn(&AxisTurn) -> f64| {
            let path = DVector::from_iterator(rows, turns.iter().map(of));
            let solved = square.as_ref().map(|c| c.solve(&(&basis_functions * path)));
            solved.unwrap_or_else(|| DVector::zeros(n))
        };
        let sideways = nearest(|turn| turn.clockwise_deg);
        let upward = nearest(|turn| turn.upward_deg);
        sideways.iter().chain(&upward).copied().collect()
    }
}
