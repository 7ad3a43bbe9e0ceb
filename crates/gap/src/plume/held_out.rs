//! The gain on data that the fit did not see: blocks in time, longer than the noise's memory,
//! left out in turn.
//!
//! Leaving a block out takes its part from the normal equations at the fitted model; the
//! parameters move by one Newton step, which is exact for linear ones and good to second order
//! for the rest. The block is then predicted with what the others say; its log score is that of
//! the predictive law, with parameters and nuisance as uncertain as the others leave them:
//! what all say less what the others say.

use ::plume::score::{Pair, with_interval};
use nalgebra::{DMatrix, DVector};
use rand::rngs::ChaCha8Rng;
use rand::{RngExt, SeedableRng};

use super::fit::{Context, Fitted};
use super::linear::{self, dot, marginal, posterior, scores};
use crate::verdict::{Gain, HeldOut};

/// Number of bootstrap resamples.
const RESAMPLES: usize = 400;

/// The gain, and each block's part of it.
pub(crate) struct Gained {
    pub gain: Gain,
    /// Start and end of each block, s, and its gain of log score, nats.
    pub blocks: Vec<(f64, f64, f64)>,
}

/// Rows of every block.
fn blocks(ctx: &Context<'_>, memory_s: f64) -> (Vec<Vec<usize>>, Vec<(f64, f64)>) {
    let (from, to) = ctx.data.span_s();
    let length = (to - from).max(1e-9);
    let count = (length / (3.0 * memory_s)).clamp(5.0, 12.0) as usize;
    let mut rows = vec![Vec::new(); count];
    for (i, t) in ctx.data.track.time_s().iter().enumerate() {
        if ctx.data.used[i] {
            let k = (((t - from) / length * count as f64) as usize).min(count - 1);
            rows[k].push(i);
        }
    }
    let edge = |k: usize| from + length * k as f64 / count as f64;
    let spans: Vec<(f64, f64)> = (0..count).map(|k| (edge(k), edge(k + 1))).collect();
    rows.into_iter()
        .zip(spans)
        .filter(|(r, _)| !r.is_empty())
        .unzip()
}

/// What a model says of a block that it did not see.
struct Predicted {
    log_score: f64,
    square: f64,
    /// Excess measured and predicted.
    pairs: Vec<Pair>,
}

/// Gain of the log score alone on blocks left out, nats.
pub(crate) fn log_gain(ctx: &Context<'_>, before: &Fitted, after: &Fitted) -> f64 {
    let (rows, _) = blocks(ctx, before.noise.memory_s());
    total_log_score(after, &rows) - total_log_score(before, &rows)
}

/// Log score on blocks left out, nats.
pub(crate) fn log_score(ctx: &Context<'_>, fitted: &Fitted) -> f64 {
    total_log_score(fitted, &blocks(ctx, fitted.noise.memory_s()).0)
}

fn total_log_score(fitted: &Fitted, rows: &[Vec<usize>]) -> f64 {
    LeftOut::new(fitted, rows).log_scores(fitted, rows).sum()
}

/// The gain of `after` over `before`.
pub(crate) fn gain(ctx: &Context<'_>, before: &Fitted, after: &Fitted, seed: u64) -> Gained {
    let (rows, spans) = blocks(ctx, before.noise.memory_s());
    let old = predict(ctx, before, &rows);
    let new = predict(ctx, after, &rows);
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let n: f64 = rows.iter().map(|r| r.len() as f64).sum();
    let rmse = |p: &[Predicted]| (p.iter().map(|b| b.square).sum::<f64>() / n).sqrt();
    let total = |p: &[Predicted]| p.iter().map(|b| b.log_score).sum::<f64>();
    let mut gains = Vec::with_capacity(RESAMPLES);
    let mut changes = Vec::with_capacity(RESAMPLES);
    for _ in 0..RESAMPLES {
        let (mut gain, mut a, mut b, mut count) = (0.0, 0.0, 0.0, 0.0);
        for _ in 0..rows.len() {
            let k = rng.random_range(0..rows.len());
            gain += new[k].log_score - old[k].log_score;
            a += old[k].square;
            b += new[k].square;
            count += rows[k].len() as f64;
        }
        gains.push(gain);
        changes.push((b / count).sqrt() - (a / count).sqrt());
    }
    let (gain_low, gain_high) = middle(&mut gains);
    let (change_low, change_high) = middle(&mut changes);
    let floor = 3.0 * before.noise.white_ppm();
    let was = scores_of_excess(&old, floor, &mut rng);
    let is = scores_of_excess(&new, floor, &mut rng);
    let held_out = HeldOut {
        log_score_before: total(&old),
        log_score_after: total(&new),
        log_score_gain_low: gain_low,
        log_score_gain_high: gain_high,
        rmse_before: rmse(&old),
        rmse_after: rmse(&new),
        rmse_change_low: change_low,
        rmse_change_high: change_high,
        fac2_before: was.0[0],
        fac2_after: is.0[0],
        fb_before: was.0[1],
        fb_after: is.0[1],
        nmse_before: was.0[2],
        nmse_after: is.0[2],
        mg_before: was.0[3],
        mg_after: is.0[3],
        vg_before: was.0[4],
        vg_after: is.0[4],
        intervals_before: was.1,
        intervals_after: is.1,
    };
    let blocks = spans
        .iter()
        .zip(old.iter().zip(&new))
        .map(|(s, (a, b))| (s.0, s.1, b.log_score - a.log_score))
        .collect();
    Gained {
        gain: Gain {
            blocks: rows.len(),
            held_out,
        },
        blocks,
    }
}

fn middle(values: &mut [f64]) -> (f64, f64) {
    values.sort_by(f64::total_cmp);
    let at = |q: f64| values[(q * (values.len() - 1) as f64).round() as usize];
    (at(0.025), at(0.975))
}

fn pick(column: &[f64], rows: &[usize]) -> Vec<f64> {
    rows.iter().map(|i| column[*i]).collect()
}

/// The normal equations of all, and of all but each block.
struct LeftOut {
    all: (DMatrix<f64>, DVector<f64>),
    others: Vec<(DMatrix<f64>, DVector<f64>)>,
}

impl LeftOut {
    fn new(fitted: &Fitted, rows: &[Vec<usize>]) -> Self {
        let columns = fitted.columns();
        let n = columns.len();
        let parts: Vec<(DMatrix<f64>, DVector<f64>)> = rows
            .iter()
            .map(|rows| {
                let own: Vec<Vec<f64>> = columns.iter().map(|c| pick(c, rows)).collect();
                let residual = pick(&fitted.residual, rows);
                (linear::gram(&own), scores(&own, &residual))
            })
            .collect();
        let gram = parts.iter().fold(DMatrix::zeros(n, n), |s, p| s + &p.0);
        let score = parts.iter().fold(DVector::zeros(n), |s, p| s + &p.1);
        let others = parts
            .iter()
            .map(|p| (&gram - &p.0, &score - &p.1))
            .collect();
        Self {
            all: (gram, score),
            others,
        }
    }

    /// Log score of every block, nats.
    fn log_scores<'b>(
        &'b self,
        fitted: &'b Fitted,
        rows: &'b [Vec<usize>],
    ) -> impl Iterator<Item = f64> + 'b {
        let known = |(gram, score): &(DMatrix<f64>, DVector<f64>)| {
            marginal(gram, score, &fitted.centre, &fitted.precision).unwrap_or(0.0)
        };
        let all = known(&self.all);
        let log_sd = log_scales(fitted);
        self.others.iter().zip(rows).map(move |(others, rows)| {
            let residual = pick(&fitted.residual, rows);
            let scale: f64 = rows.iter().map(|i| log_sd[*i]).sum();
            all - known(others) - 0.5 * dot(&residual, &residual) - scale
        })
    }
}

fn predict(ctx: &Context<'_>, fitted: &Fitted, rows: &[Vec<usize>]) -> Vec<Predicted> {
    let n = fitted.precision.len();
    let mut raw = ctx.derivatives(&fitted.model, &fitted.prediction.reading);
    raw.extend(fitted.metric.nuisance.raw.iter().cloned());
    let left_out = LeftOut::new(fitted, rows);
    let log_scores = left_out.log_scores(fitted, rows);
    rows.iter()
        .zip(&left_out.others)
        .zip(log_scores)
        .map(|((rows, others), log_score)| {
            let step = posterior(&others.0, &others.1, &fitted.centre, &fitted.precision)
                .map_or_else(|| DVector::zeros(n), |p| p.mean);
            let mut out = Predicted {
                log_score,
                square: 0.0,
                pairs: Vec::new(),
            };
            for &i in rows {
                let moved: f64 = (0..n).map(|k| step[k] * raw[k][i]).sum();
                let predicted = fitted.prediction.reading[i] + moved;
                let error = ctx.data.reading_ppm[i] - predicted;
                out.square += error * error;
                let clean = fitted.prediction.reading[i] - fitted.prediction.plume[i];
                out.pairs
                    .push((ctx.data.reading_ppm[i] - clean, predicted - clean));
            }
            out
        })
        .collect()
}

/// Logarithm of the innovation's standard deviation and of sqrt(2 pi) at every row.
fn log_scales(fitted: &Fitted) -> Vec<f64> {
    let of = |scale: f64| {
        if scale > 0.0 {
            0.5 * std::f64::consts::TAU.ln() - scale.ln()
        } else {
            0.0
        }
    };
    fitted
        .metric
        .whitener
        .scales()
        .into_iter()
        .map(of)
        .collect()
}

/// Scores of the excess where either side has a plume, and their intervals over blocks.
fn scores_of_excess(
    predicted: &[Predicted],
    floor: f64,
    rng: &mut ChaCha8Rng,
) -> ([f64; 5], [[f64; 2]; 5]) {
    let kept: Vec<Vec<Pair>> = predicted
        .iter()
        .map(|p| {
            p.pairs
                .iter()
                .copied()
                .filter(|(m, c)| m.max(*c) > floor)
                .collect()
        })
        .collect();
    let groups: Vec<&[Pair]> = kept.iter().map(Vec::as_slice).collect();
    match with_interval(&groups, floor, RESAMPLES, rng) {
        Ok(s) => {
            let list = |s: &::plume::score::Scores| [s.fac2, s.fb, s.nmse, s.mg, s.vg];
            let (low, high) = (list(&s.low), list(&s.high));
            (list(&s.value), std::array::from_fn(|k| [low[k], high[k]]))
        }
        Err(_) => ([f64::NAN; 5], [[f64::NAN; 2]; 5]),
    }
}
