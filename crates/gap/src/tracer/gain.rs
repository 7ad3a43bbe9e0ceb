//! What the extension gains on trials left out.

use plume::score::{Pair, Scores, WithInterval, scores, with_interval};
use rand::rngs::ChaCha8Rng;
use rand::{RngExt, SeedableRng};

use super::findings::base;
use super::fit::{Scored, without};
use super::predicted::ArcDetail;
use crate::GapError;
use crate::applied::AppliedScore;
use crate::statistics::central_95;
use crate::verdict::{Gain, HeldOut};

/// Smallest concentration that counts in ratios, as a part of the lowest arc maximum.
const FLOOR_PART: f64 = 1e-3;
/// Bootstrap samples over trials.
const RESAMPLES: usize = 2000;

/// A quantity of an arc as it is measured, by the base and by the extension.
pub type Values = [f64; 3];

pub fn maximum(a: &ArcDetail) -> Values {
    [a.max_mg_m3, a.base_max_mg_m3, a.held_out_max_mg_m3]
}

fn pairs(of: &[Values], by: usize) -> Vec<Pair> {
    of.iter().map(|v| (v[0], v[by])).collect()
}

/// Smallest of measured values that counts in ratios.
fn floor<'a>(of: impl Iterator<Item = &'a Values>) -> f64 {
    FLOOR_PART * of.map(|v| v[0]).fold(f64::MAX, f64::min)
}

/// Scores of arc maxima before (Briggs, measured wind) and after, and the 95 % interval of the change of the mean square
/// of ln(measured / predicted). `logs` are the log scores of independent parts of the data, before and after; empty where
/// none is known.
pub fn gain(
    arcs: &[ArcDetail],
    logs: &[[f64; 2]],
    seed: u64,
) -> Result<(Gain, [f64; 2]), GapError> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let trials = arcs.chunk_by(|a, b| a.trial == b.trial);
    let trials: Vec<Vec<Values>> = trials.map(|t| t.iter().map(maximum).collect()).collect();
    let floor = floor(trials.iter().flatten());
    let mut scored = |by: usize| {
        let pairs: Vec<Vec<Pair>> = trials.iter().map(|t| pairs(t, by)).collect();
        let groups: Vec<&[Pair]> = pairs.iter().map(Vec::as_slice).collect();
        with_interval(&groups, floor, RESAMPLES, &mut rng)
    };
    let (before, after) = (scored(1)?, scored(2)?);
    let [log_score_before, log_score_after] = match logs {
        [] => [f64::NAN; 2],
        logs => sum(logs.iter().copied()),
    };
    let log_score = interval(logs, |[before, after]| after - before, &mut rng);
    let squares = |v: &Values| {
        let ln_square = |k: usize| (v[0].max(floor) / v[k].max(floor)).ln().powi(2);
        let square = |k: usize| (v[0] - v[k]).powi(2);
        [square(1), square(2), ln_square(2) - ln_square(1), 1.0]
    };
    let squares = trials.iter().map(|t| sum(t.iter().map(squares)));
    let squares: Vec<[f64; 4]> = squares.collect();
    let rmse = |[b, h, _, n]: [f64; 4]| [b, h].map(|square| (square / n).sqrt());
    let [rmse_before, rmse_after] = rmse(sum(squares.iter().copied()));
    let change = |squares| {
        let [before, after] = rmse(squares);
        after - before
    };
    let rmse_change = interval(&squares, change, &mut rng);
    let mut again = ChaCha8Rng::seed_from_u64(seed);
    let ln_square_change = interval(&squares, |[_, _, change, n]| change / n, &mut again);
    let held_out = HeldOut {
        log_score_before,
        log_score_after,
        log_score_gain_low: log_score[0],
        log_score_gain_high: log_score[1],
        rmse_before,
        rmse_after,
        rmse_change_low: rmse_change[0],
        rmse_change_high: rmse_change[1],
        fac2_before: before.value.fac2,
        fac2_after: after.value.fac2,
        fb_before: before.value.fb,
        fb_after: after.value.fb,
        nmse_before: before.value.nmse,
        nmse_after: after.value.nmse,
        mg_before: before.value.mg,
        mg_after: after.value.mg,
        vg_before: before.value.vg,
        vg_after: after.value.vg,
        intervals_before: intervals(&before),
        intervals_after: intervals(&after),
    };
    let blocks = trials.len();
    Ok((Gain { blocks, held_out }, ln_square_change))
}

/// Scores of a quantity, `what`, of all arcs that were measured or of one kind of air.
pub fn score(what: &str, air: Option<&str>, of: &[Values]) -> Result<AppliedScore, GapError> {
    let floor = floor(of.iter());
    let by = |k: usize| scores(&pairs(of, k), floor);
    let (before, after) = (by(1)?, by(2)?);
    let rms_ln = |vg: f64| vg.ln().max(0.0).sqrt();
    Ok(AppliedScore {
        what: what.to_owned(),
        of: air.map(str::to_owned),
        count: of.len(),
        fac2_before: before.fac2,
        fac2_after: after.fac2,
        nmse_before: before.nmse,
        nmse_after: after.nmse,
        rms_ln_before: rms_ln(before.vg),
        rms_ln_after: rms_ln(after.vg),
    })
}

/// Each trial's log score by the base and by the mixture of models.
pub fn log_scores(scored: &[Scored]) -> Vec<[f64; 2]> {
    let before = base(scored).map_or(&[][..], |b| &b.held_out);
    let after = |i: usize| {
        let of = |s: &Scored| s.held_out[i];
        let top = scored.iter().map(of).fold(f64::NEG_INFINITY, f64::max);
        let weighted = scored.iter().zip(without(scored, i));
        let each = weighted.map(|(s, (weight, ..))| weight * (of(s) - top).exp());
        top + each.sum::<f64>().ln()
    };
    let trials = before.iter().enumerate();
    trials.map(|(i, before)| [*before, after(i)]).collect()
}

fn intervals(scored: &WithInterval) -> [[f64; 2]; 5] {
    let list = |s: &Scores| [s.fac2, s.fb, s.nmse, s.mg, s.vg];
    let (low, high) = (list(&scored.low), list(&scored.high));
    std::array::from_fn(|k| [low[k], high[k]])
}

fn sum<const N: usize>(parts: impl Iterator<Item = [f64; N]>) -> [f64; N] {
    let add = |sum: [f64; N], part: [f64; N]| std::array::from_fn(|k| sum[k] + part[k]);
    parts.fold([0.0; N], add)
}

/// 95 % bootstrap interval of a function of the sums of independent parts; not a number where there are none.
fn interval<const N: usize>(
    parts: &[[f64; N]],
    of: impl Fn([f64; N]) -> f64,
    rng: &mut ChaCha8Rng,
) -> [f64; 2] {
    if parts.is_empty() {
        return [f64::NAN; 2];
    }
    let n = parts.len();
    let mut draw = || of(sum((0..n).map(|_| parts[rng.random_range(0..n)])));
    central_95((0..RESAMPLES).map(|_| draw()).collect())
}
