//! Passes: stretches of time that each hold about as much of the plume as the others, cut where it is
//! quiet. They are held out in turn, drawn with repetition, and met by the plume each for itself.

use crate::rows::Rows;
use std::ops::Range;

/// Readings that stand out count up to so many standard deviations: a pass near the source must
/// not be all there is.
const MOST_SD: f64 = 10.0;
/// A cut moves to where it is quiet by at most this part of a pass.
const MOVES: f64 = 0.3;

/// The rows of each of `count` passes: one range a series. `excess_sds` tells how far each row stands
/// out of the background, in standard deviations of the noise.
pub(crate) fn passes(rows: &Rows, excess_sds: &[f64], count: usize) -> Vec<Vec<Range<usize>>> {
    let cuts = cuts(rows, excess_sds, count);
    let mut out = Vec::new();
    for k in 0..=cuts.len() {
        let from_s = k.checked_sub(1).map_or(f64::NEG_INFINITY, |k| cuts[k]);
        let to_s = cuts.get(k).copied().unwrap_or(f64::INFINITY);
        let of = |series: Range<usize>| {
            let times = &rows.time_s()[series.clone()];
            let first = times.partition_point(|t| *t < from_s);
            let end = times.partition_point(|t| *t < to_s);
            series.start + first..series.start + end
        };
        let pass: Vec<Range<usize>> = rows.series().map(of).filter(|r| !r.is_empty()).collect();
        if !pass.is_empty() {
            out.push(pass);
        }
    }
    out
}

/// Times at which passes are cut.
fn cuts(rows: &Rows, excess_sds: &[f64], count: usize) -> Vec<f64> {
    let mut order: Vec<usize> = (0..rows.len()).filter(|&i| rows.is_used(i)).collect();
    order.sort_by(|a, b| rows.time_s()[*a].total_cmp(&rows.time_s()[*b]));
    // A little for every row, so that a quiet record is cut too.
    let weight = |i: &usize| 0.1 + excess_sds[*i].abs().min(MOST_SD);
    let total: f64 = order.iter().map(weight).sum();
    let reach = (MOVES * order.len() as f64 / count.max(1) as f64) as usize;
    let mut sum = 0.0;
    let mut cuts: Vec<f64> = Vec::new();
    for (k, i) in order.iter().enumerate() {
        sum += weight(i);
        if sum < total * (cuts.len() + 1) as f64 / count.max(1) as f64 || k + 1 >= order.len() {
            continue;
        }
        let near = k.saturating_sub(reach)..(k + reach + 1).min(order.len());
        let quiet = near.min_by(|a, b| {
            let far = |k: &usize| k.abs_diff(*a.min(b));
            excess_sds[order[*a]]
                .abs()
                .total_cmp(&excess_sds[order[*b]].abs())
                .then(far(a).cmp(&far(b)))
        });
        let time_s = rows.time_s()[order[quiet.unwrap_or(k)]];
        cuts.push(cuts.last().map_or(time_s, |last| time_s.max(*last)));
    }
    cuts.dedup();
    cuts
}
