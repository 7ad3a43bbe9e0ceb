//! Every model on every trial of a group, whole and with one trial left out at a time.

use super::evidence::Fit;
use super::ladder::{Group, Tried};

/// A model's fit to all trials and its scores on trials left out.
#[derive(Debug, Clone)]
pub struct Scored {
    /// Ids of its changes.
    pub ids: Vec<&'static str>,
    /// The fit to all trials.
    pub fit: Fit,
    /// Its probability among the models of the question.
    pub probability: f64,
    /// Score of each trial by the fit to the others, nats.
    pub held_out: Vec<f64>,
    /// Probability of the model given the other trials, for each trial left out.
    pub weight_without: Vec<f64>,
    /// Parameters fitted without each trial.
    pub theta_without: Vec<Vec<f64>>,
}

/// Fits all `models`. Models that cannot be fitted are left out.
///
/// The sizes of the errors are those of the fit to all trials also where one is left out: three
/// numbers that one trial hardly moves.
pub fn score<T: Tried>(group: &Group<'_>, models: &[T]) -> Vec<(usize, Scored)> {
    let all: Vec<usize> = (0..group.trials.len()).collect();
    let mut out: Vec<(usize, Scored)> = Vec::new();
    let mut evidence_without: Vec<Vec<f64>> = Vec::new();
    for (index, model) in models.iter().enumerate() {
        let Some(fit) = model.fit(group, &all, None) else {
            continue;
        };
        let folds: Option<Vec<Fit>> = all
            .iter()
            .map(|&i| without(group, model, &all, i, &fit))
            .collect();
        let Some(folds) = folds else { continue };
        let held_out = folds
            .iter()
            .zip(&all)
            .map(|(f, &i)| model.held_out(group, i, f))
            .collect();
        evidence_without.push(folds.iter().map(|f| f.log_evidence).collect());
        out.push((
            index,
            Scored {
                ids: model.ids(),
                probability: 0.0,
                held_out,
                weight_without: Vec::new(),
                theta_without: folds.into_iter().map(|f| f.theta).collect(),
                fit,
            },
        ));
    }
    let evidences: Vec<f64> = out.iter().map(|s| s.1.fit.log_evidence).collect();
    for (scored, p) in out.iter_mut().zip(probabilities(&evidences)) {
        scored.1.probability = p;
    }
    for &i in &all {
        let column: Vec<f64> = evidence_without.iter().map(|e| e[i]).collect();
        for (scored, w) in out.iter_mut().zip(probabilities(&column)) {
            scored.1.weight_without.push(w);
        }
    }
    out
}

fn without<T: Tried>(
    group: &Group<'_>,
    model: &T,
    all: &[usize],
    i: usize,
    of_all: &Fit,
) -> Option<Fit> {
    let rest: Vec<usize> = all.iter().copied().filter(|&k| k != i).collect();
    model.fit(group, &rest, Some(of_all))
}

/// Probabilities in proportion to the exponentials.
fn probabilities(logs: &[f64]) -> Vec<f64> {
    let top = logs.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let sum: f64 = logs.iter().map(|l| (l - top).exp()).sum();
    logs.iter().map(|l| (l - top).exp() / sum).collect()
}

/// Sum of paired differences over trials, and its standard error.
pub fn difference(better: &[f64], worse: &[f64]) -> (f64, f64) {
    let n = better.len() as f64;
    let each: Vec<f64> = better.iter().zip(worse).map(|(a, b)| a - b).collect();
    let sum: f64 = each.iter().sum();
    let spread: f64 = each.iter().map(|d| (d - sum / n).powi(2)).sum();
    (sum, (spread * n / (n - 1.0).max(1.0)).sqrt())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn standard_error_of_a_sum() {
        // Differences 1, 2, 3: sum 6, sd 1, standard error of the sum √3.
        let (sum, error) = difference(&[2.0, 2.0, 3.0], &[1.0, 0.0, 0.0]);
        assert!((sum - 6.0).abs() < 1e-12 && (error - 3.0_f64.sqrt()).abs() < 1e-12);
    }

    #[test]
    fn probabilities_add_up_far_from_zero() {
        let p = probabilities(&[-1000.0, -1000.0 + 3.0_f64.ln()]);
        assert!((p[1] - 0.75).abs() < 1e-12 && (p[0] - 0.25).abs() < 1e-12);
    }
}
