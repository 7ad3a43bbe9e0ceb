//! What the extension gains on trials left out.

use plume::score::{Pair, Scores, WithInterval, with_interval};
use rand::rngs::ChaCha8Rng;
use rand::{RngExt, SeedableRng};

use super::Answer;
use super::detail::ArcDetail;
use super::trial_scores::Scored;
use crate::GapError;
use crate::verdict::{Gain, HeldOut};

/// Smallest concentration that counts in ratios, as a part of the lowest arc maximum.
pub(super) const FLOOR_PART: f64 = 1e-3;
/// Bootstrap samples over trials.
const RESAMPLES: usize = 2000;

/// Scores of arc maxima, trials left out one at a time, before (Briggs, measured wind) and after.
pub(super) fn gain(
    answers: &[Answer<'_>],
    arcs: &[ArcDetail],
    seed: u64,
) -> Result<Gain, GapError> {
    let mut logs: (Vec<f64>, Vec<f64>) = (Vec::new(), Vec::new());
    for answer in answers {
        for question in answer.questions() {
            log_scores(&question.scored, &mut logs);
        }
    }
    gain_on(arcs, &logs, seed)
}

/// The same from log scores of parts of the data, none of which need be known.
pub(super) fn gain_on(
    arcs: &[ArcDetail],
    logs: &(Vec<f64>, Vec<f64>),
    seed: u64,
) -> Result<Gain, GapError> {
    let (before, after) = by_trial(arcs);
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let floor = floor_mg_m3(arcs);
    let mut scored = |groups: &[Vec<Pair>]| {
        let slices: Vec<&[Pair]> = groups.iter().map(Vec::as_slice).collect();
        with_interval(&slices, floor, RESAMPLES, &mut rng)
    };
    let (b, a) = (scored(&before)?, scored(&after)?);
    let (log_low, log_high) = interval(&logs.0, &logs.1, &mut rng);
    let rmse = |groups: &[Vec<Pair>]| {
        let all = groups.iter().flatten();
        let squares: Vec<f64> = all.map(|(m, p)| (m - p).powi(2)).collect();
        (squares.iter().sum::<f64>() / squares.len() as f64).sqrt()
    };
    let changes = rmse_changes(&before, &after, &mut rng);
    Ok(Gain {
        blocks: before.len(),
        held_out: HeldOut {
            log_score_before: sum(&logs.0),
            log_score_after: sum(&logs.1),
            log_score_gain_low: log_low,
            log_score_gain_high: log_high,
            rmse_before: rmse(&before),
            rmse_after: rmse(&after),
            rmse_change_low: changes.0,
            rmse_change_high: changes.1,
            fac2_before: b.value.fac2,
            fac2_after: a.value.fac2,
            fb_before: b.value.fb,
            fb_after: a.value.fb,
            nmse_before: b.value.nmse,
            nmse_after: a.value.nmse,
            mg_before: b.value.mg,
            mg_after: a.value.mg,
            vg_before: b.value.vg,
            vg_after: a.value.vg,
            intervals_before: intervals(&b),
            intervals_after: intervals(&a),
        },
    })
}

/// Smallest concentration that counts in ratios, mg/m³.
fn floor_mg_m3(arcs: &[ArcDetail]) -> f64 {
    let lowest = arcs.iter().map(|a| a.max_mg_m3).fold(f64::MAX, f64::min);
    FLOOR_PART * lowest
}

/// Sum of log scores; not a number where none is known.
fn sum(logs: &[f64]) -> f64 {
    if logs.is_empty() {
        f64::NAN
    } else {
        logs.iter().sum()
    }
}

/// 95 % interval over trials of the change of the mean square of ln(measured / predicted) of arc maxima.
pub(super) fn log_square_change(arcs: &[ArcDetail], seed: u64) -> [f64; 2] {
    let (before, after) = by_trial(arcs);
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let floor = floor_mg_m3(arcs);
    let square = |(m, p): &Pair| (m.max(floor) / p.max(floor)).ln().powi(2);
    let sums = |group: &Vec<Pair>| group.iter().map(square).sum::<f64>();
    let each: Vec<(f64, f64)> = before
        .iter()
        .zip(&after)
        .map(|(b, a)| (sums(a) - sums(b), b.len() as f64))
        .collect();
    let (low, high) = quantiles((0..RESAMPLES).map(|_| {
        let drawn = (0..each.len()).map(|_| each[rng.random_range(0..each.len())]);
        let (change, n) = drawn.fold((0.0, 0.0), |s, d| (s.0 + d.0, s.1 + d.1));
        change / n
    }));
    [low, high]
}

/// (measured, predicted) arc maxima of each trial, by the base and from the other trials.
fn by_trial(arcs: &[ArcDetail]) -> (Vec<Vec<Pair>>, Vec<Vec<Pair>>) {
    let mut before: Vec<Vec<Pair>> = Vec::new();
    let mut after: Vec<Vec<Pair>> = Vec::new();
    let mut last = "";
    for arc in arcs {
        if arc.trial != last {
            before.push(Vec::new());
            after.push(Vec::new());
            last = &arc.trial;
        }
        if let (Some(b), Some(a)) = (before.last_mut(), after.last_mut()) {
            b.push((arc.max_mg_m3, arc.base_max_mg_m3));
            a.push((arc.max_mg_m3, arc.held_out_max_mg_m3));
        }
    }
    (before, after)
}

fn intervals(scored: &WithInterval) -> [[f64; 2]; 5] {
    let list = |s: &Scores| [s.fac2, s.fb, s.nmse, s.mg, s.vg];
    let (low, high) = (list(&scored.low), list(&scored.high));
    [0, 1, 2, 3, 4].map(|k| [low[k], high[k]])
}

/// Adds each trial's log score by the base and by the mixture of models.
fn log_scores(question: &[(usize, Scored)], logs: &mut (Vec<f64>, Vec<f64>)) {
    let Some((_, base)) = question.iter().find(|s| s.1.ids.is_empty()) else {
        return;
    };
    for (i, before) in base.held_out.iter().enumerate() {
        let top = question
            .iter()
            .map(|s| s.1.held_out[i])
            .fold(f64::NEG_INFINITY, f64::max);
        let sum: f64 = question
            .iter()
            .map(|s| s.1.weight_without[i] * (s.1.held_out[i] - top).exp())
            .sum();
        logs.0.push(*before);
        logs.1.push(top + sum.ln());
    }
}

/// 95 % bootstrap interval of the sum of paired gains.
fn interval(before: &[f64], after: &[f64], rng: &mut ChaCha8Rng) -> (f64, f64) {
    if before.is_empty() {
        return (f64::NAN, f64::NAN);
    }
    let gains: Vec<f64> = after.iter().zip(before).map(|(a, b)| a - b).collect();
    quantiles((0..RESAMPLES).map(|_| {
        (0..gains.len())
            .map(|_| gains[rng.random_range(0..gains.len())])
            .sum()
    }))
}

fn rmse_changes(before: &[Vec<Pair>], after: &[Vec<Pair>], rng: &mut ChaCha8Rng) -> (f64, f64) {
    let sums = |group: &Vec<Pair>| group.iter().map(|(m, p)| (m - p).powi(2)).sum::<f64>();
    let each: Vec<(f64, f64, f64)> = before
        .iter()
        .zip(after)
        .map(|(b, a)| (sums(b), sums(a), b.len() as f64))
        .collect();
    quantiles((0..RESAMPLES).map(|_| {
        let (mut b, mut a, mut n) = (0.0, 0.0, 0.0);
        for _ in 0..each.len() {
            let drawn = each[rng.random_range(0..each.len())];
            b += drawn.0;
            a += drawn.1;
            n += drawn.2;
        }
        (a / n).sqrt() - (b / n).sqrt()
    }))
}

fn quantiles(values: impl Iterator<Item = f64>) -> (f64, f64) {
    let mut sorted: Vec<f64> = values.collect();
    sorted.sort_by(f64::total_cmp);
    let at = |q: f64| sorted[((sorted.len() - 1) as f64 * q).round() as usize];
    (at(0.025), at(0.975))
}
