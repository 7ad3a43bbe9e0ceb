//! What an extension gains on blocks of time that it was not fitted to.
//!
//! On each block in turn, everything is fitted to the others: the base (tolerances and winds), the
//! base with what was found, and, where the truth is known, the base around the truth. All three
//! are scored on the block under the same noise and the same linearisation, so that they can be
//! compared. The base may lean on its tolerances in each of them. The expected score of an effect
//! (its D) also counts what that leaning costs; a score on held-out blocks does not, and is the
//! smaller for it.

use nalgebra::{DMatrix, DVector};

use super::evidence::sum;
use super::normal::Block;
use super::study::{Linear, Study};
use crate::verdict::{Gain, HeldOut};

/// Sum of squares of each block's innovations where `fit` tells the columns from the information
/// and score of all other blocks.
fn squares(
    linear: &Linear,
    fit: impl Fn(&DMatrix<f64>, &DVector<f64>) -> DVector<f64>,
) -> Vec<f64> {
    let (a, b) = sum(&linear.blocks);
    let of_block = |block: &Block| {
        let values = fit(&(&a - &block.a), &(&b - &block.b));
        block.squares - 2.0 * values.dot(&block.b) + values.dot(&(&block.a * &values))
    };
    linear.blocks.iter().map(of_block).collect()
}

/// Gain over the base, nats, that the truth has on the blocks left out: `shift` is the truth's
/// departure in every parameter, about which the base's tolerances are fitted.
pub fn of_truth(study: &Study<'_>, linear: &Linear, shift: &[f64]) -> f64 {
    let before = squares(linear, |a, b| study.posterior(a, b, &[]).0);
    let after = squares(linear, |a, b| {
        let truth = DVector::from_fn(b.len(), |j, _| shift.get(j).copied().unwrap_or(0.0));
        study.posterior(a, &(b - a * &truth), &[]).0 + truth
    });
    before.iter().zip(&after).map(|(b, a)| 0.5 * (b - a)).sum()
}

/// Scores of the base and of the base with `set` on the blocks left out.
pub fn of_set(study: &Study<'_>, last: &Linear, set: &[usize]) -> Gain {
    let before = squares(last, |a, b| study.posterior(a, b, &[]).0);
    let after = squares(last, |a, b| study.posterior(a, b, set).0);
    let pairs = before.iter().zip(&after);
    let gains: Vec<f64> = pairs.map(|(b, a)| 0.5 * (b - a)).collect();
    let (before, after): (f64, f64) = (before.iter().sum(), after.iter().sum());
    let count: f64 = last.blocks.iter().map(|b| b.count as f64).sum();
    let n = gains.len() as f64;
    let total: f64 = gains.iter().sum();
    let variance: f64 = gains.iter().map(|g| (g - total / n).powi(2)).sum::<f64>();
    let error = 1.96 * (variance * n / (n - 1.0)).sqrt();
    let rmse = |squares: f64| (squares / count).sqrt();
    let nan = f64::NAN;
    Gain {
        blocks: last.blocks.len(),
        held_out: HeldOut {
            log_score_before: last.log_score - total,
            log_score_after: last.log_score,
            log_score_gain_low: total - error,
            log_score_gain_high: total + error,
            rmse_before: rmse(before),
            rmse_after: rmse(after),
            // The gain's interval, as squares.
            rmse_change_low: rmse((before - 2.0 * (total + error)).max(0.0)) - rmse(before),
            rmse_change_high: rmse((before - 2.0 * (total - error)).max(0.0)) - rmse(before),
            fac2_before: nan,
            fac2_after: nan,
            fb_before: nan,
            fb_after: nan,
            nmse_before: nan,
            nmse_after: nan,
            mg_before: nan,
            mg_after: nan,
            vg_before: nan,
            vg_after: nan,
            intervals_before: [[nan; 2]; 5],
            intervals_after: [[nan; 2]; 5],
        },
    }
}
