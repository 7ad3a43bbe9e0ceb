//! What each unknown changes at every row, by differences. Unknowns that move different rows, as those of single
//! sensors do, share one prediction.

use crate::InferError;
use crate::rows::{AxisTurn, ForwardModel, Prediction};
use std::ops::Range;

/// Differences for derivatives: part of a prior's standard deviation.
const DIFFERENCE_SD: f64 = 1e-3;

/// The change of every row's reading by each unknown at the point `at`, where the model expects `here` and the plume of
/// row `i` has grown by the factor `growth(i)`.
pub(crate) fn slopes(
    model: &impl ForwardModel,
    at: &[f64],
    turns: &[AxisTurn],
    here: &Prediction,
    growth: impl Fn(usize) -> f64,
) -> Result<Vec<Vec<f64>>, InferError> {
    let n = here.reading.len();
    let step = |k: usize| DIFFERENCE_SD * model.priors()[k].sd.min(1.0 + at[k].abs());
    let rows_of: Vec<Range<usize>> = (0..at.len())
        .map(|k| model.rows_of(k).unwrap_or(0..n))
        .collect();
    let mut out = vec![Vec::new(); at.len()];
    for together in apart(&rows_of) {
        let mut aside = at.to_vec();
        together.iter().for_each(|&k| aside[k] += step(k));
        let there = model.predict(&aside, turns)?;
        for k in together {
            let mut slope = vec![0.0; n];
            for i in rows_of[k].clone() {
                let grown = (there.plume[i] - here.plume[i]) * (growth(i) - 1.0);
                slope[i] = (there.reading[i] - here.reading[i] + grown) / step(k);
            }
            out[k] = slope;
        }
    }
    Ok(out)
}

/// The unknowns in groups, each of which moves no row twice.
fn apart(rows_of: &[Range<usize>]) -> Vec<Vec<usize>> {
    let mut groups: Vec<Vec<usize>> = Vec::new();
    let meet = |a: &Range<usize>, b: &Range<usize>| a.start < b.end && b.start < a.end;
    for (k, rows) in rows_of.iter().enumerate() {
        let free = |group: &&mut Vec<usize>| group.iter().all(|g| !meet(&rows_of[*g], rows));
        match groups.iter_mut().find(free) {
            Some(group) => group.push(k),
            None => groups.push(vec![k]),
        }
    }
    groups
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn unknowns_of_different_rows_share_a_prediction() {
        assert_eq!(
            apart(&[0..9, 0..4, 4..9, 2..6, 6..9]),
            [vec![0], vec![1, 2], vec![3, 4]]
        );
    }
}
