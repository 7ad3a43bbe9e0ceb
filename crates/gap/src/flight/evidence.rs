//! Evidence of sets of causes from the normal equations, in closed form (Laplace): Gaussian
//! priors, tolerances of the base integrated out.

use nalgebra::{Cholesky, DMatrix, DVector, Dyn};

use super::normal::Block;

/// The data's word on all columns at parameter value zero: information and score, with the
/// tolerances of the base and the correction for overdispersion inside.
#[derive(Debug, Clone)]
pub struct Word {
    /// Information on the tested columns, tolerances integrated out.
    pub s: DMatrix<f64>,
    /// Score of the tested columns, likewise.
    pub t: DVector<f64>,
    /// Factor by which information and score were divided.
    pub dispersion: f64,
    /// Log evidence of the base over its point at zero.
    pub base_log_evidence: f64,
}

/// A cause that may be added: columns (places among the tested) with prior sizes.
#[derive(Debug, Clone, PartialEq)]
pub struct Candidate {
    /// Places among the tested columns.
    pub columns: Vec<usize>,
    /// Prior standard deviation of each.
    pub prior_sd: Vec<f64>,
    /// Whether the first may only grow from its neutral value.
    pub one_sided: bool,
    /// Prior standard deviations beyond which a size is not that of this cause.
    pub plausible_sd: f64,
    /// Log prior of its presence.
    pub log_prior: f64,
}

impl Candidate {
    /// Whether fitted values are such as this cause has: what can only grow did not shrink, and no
    /// size is one that nothing real has.
    fn can_be(&self, values: &[f64]) -> bool {
        let mut sizes = values.iter().zip(&self.prior_sd);
        !(self.one_sided && values[0] < 0.0)
            && sizes.all(|(value, sd)| value.abs() <= self.plausible_sd * sd)
    }
}

/// How a set of candidates fares.
#[derive(Debug, Clone, PartialEq)]
pub struct Fit {
    /// Gain of the log score at the fitted values, nats.
    pub log_score: f64,
    /// Gain of the log evidence, nats.
    pub log_evidence: f64,
    /// Fitted values, candidate by candidate.
    pub values: Vec<f64>,
}

/// Sum of the blocks, all but `without`.
pub fn sum(blocks: &[Block], without: Option<usize>) -> (DMatrix<f64>, DVector<f64>) {
    let n = blocks[0].b.len();
    let (mut a, mut b) = (DMatrix::zeros(n, n), DVector::zeros(n));
    for (k, block) in blocks.iter().enumerate() {
        if Some(k) != without {
            a += &block.a;
            b += &block.b;
        }
    }
    (a, b)
}

impl Word {
    /// The word of `a` and `b` (at zero): the first `base` columns have tolerances `tolerance`
    /// and are integrated out; the tested are all columns again, those of mechanisms as
    /// departures beyond the tolerance.
    pub fn new(a: &DMatrix<f64>, b: &DVector<f64>, tolerance: &[f64], dispersion: f64) -> Self {
        let base = tolerance.len();
        let n = b.len();
        let a = a / dispersion;
        let b = b / dispersion;
        let mut c = a.view((0, 0), (base, base)).into_owned();
        for (k, sd) in tolerance.iter().enumerate() {
            c[(k, k)] += 1.0 / (sd * sd);
        }
        let across = a.view((0, 0), (base, n)).into_owned();
        let Some(c) = Cholesky::new(c) else {
            // Only of data that are not finite: nothing is known then.
            return Self {
                s: DMatrix::zeros(n, n),
                t: DVector::zeros(n),
                dispersion,
                base_log_evidence: f64::NEG_INFINITY,
            };
        };
        let head = b.rows(0, base).into_owned();
        let s = &a - across.transpose() * c.solve(&across);
        let t = &b - across.transpose() * c.solve(&head);
        let prior: f64 = tolerance.iter().map(|sd| sd.ln()).sum();
        let base_log_evidence = 0.5 * head.dot(&c.solve(&head)) - half_log_det(&c) - prior;
        Self {
            s,
            t,
            dispersion,
            base_log_evidence,
        }
    }

    /// The fit of `set` together.
    pub fn fit(&self, set: &[&Candidate]) -> Fit {
        let columns: Vec<usize> = set.iter().flat_map(|c| c.columns.iter().copied()).collect();
        let sds: Vec<f64> = set
            .iter()
            .flat_map(|c| c.prior_sd.iter().copied())
            .collect();
        let n = columns.len();
        if n == 0 {
            return Fit {
                log_score: 0.0,
                log_evidence: 0.0,
                values: Vec::new(),
            };
        }
        let s = DMatrix::from_fn(n, n, |i, j| self.s[(columns[i], columns[j])]);
        let t = DVector::from_fn(n, |i, _| self.t[columns[i]]);
        let mut m = s.clone();
        for (k, sd) in sds.iter().enumerate() {
            m[(k, k)] += 1.0 / (sd * sd);
        }
        let Some(m) = Cholesky::new(m) else {
            return Fit {
                log_score: 0.0,
                log_evidence: f64::NEG_INFINITY,
                values: vec![0.0; n],
            };
        };
        let values = m.solve(&t);
        let prior: f64 = sds.iter().map(|sd| sd.ln()).sum();
        let mut log_evidence = 0.5 * t.dot(&values) - half_log_det(&m) - prior;
        let mut at = 0;
        for candidate in set {
            let end = at + candidate.columns.len();
            if !candidate.can_be(&values.as_slice()[at..end]) {
                log_evidence -= 0.5 * t.dot(&values) + 1.0;
            }
            at = end;
        }
        Fit {
            log_score: t.dot(&values) - 0.5 * values.dot(&(&s * &values)),
            log_evidence,
            values: values.iter().copied().collect(),
        }
    }
}

fn half_log_det(c: &Cholesky<f64, Dyn>) -> f64 {
    c.l_dirty().diagonal().iter().map(|d| d.ln()).sum()
}

/// How much more the score varies from block to block than the information says, by columns
/// that the model's own parameters span: the median over columns of the ratio, at least 1.
pub fn dispersion(blocks: &[Block], fitted: &DVector<f64>, columns: usize) -> f64 {
    let mut ratios = Vec::new();
    for k in 0..columns {
        let mut scores = Vec::new();
        let mut information = 0.0;
        for block in blocks {
            let score = block.b[k]
                - block
                    .a
                    .row(k)
                    .columns(0, fitted.len())
                    .transpose()
                    .dot(fitted);
            scores.push(score);
            information += block.a[(k, k)];
        }
        let n = scores.len() as f64;
        let mean = scores.iter().sum::<f64>() / n;
        let variance = scores.iter().map(|s| (s - mean).powi(2)).sum::<f64>() * n / (n - 1.0);
        if information > 0.0 {
            ratios.push(variance / information);
        }
    }
    ratios.sort_by(f64::total_cmp);
    let median = ratios.get(ratios.len() / 2).copied().unwrap_or(1.0);
    median.max(1.0)
}

/// What of a dispersion over so many blocks is more than chance may add to 1.
pub fn beyond_chance(dispersion: f64, blocks: usize) -> f64 {
    let error = (2.0 / (blocks as f64 - 1.0)).sqrt();
    (dispersion / (1.0 + error)).max(1.0)
}

/// One model found by [`search`]: places of its candidates, ascending, and its fit.
#[derive(Debug, Clone, PartialEq)]
pub struct Model {
    /// Places of the candidates.
    pub set: Vec<usize>,
    /// The fit.
    pub fit: Fit,
    /// Log evidence and log prior together, less what further causes are charged.
    pub log_posterior: f64,
}

/// Part of the strongest single cause's gain that each further cause is charged: no law is exact,
/// and what a strong cause leaves by that is not a cause of its own.
const FURTHER_PART: f64 = 0.2;
/// Sets kept from one size to the next.
const BEAM: usize = 12;
/// Largest set.
pub const LARGEST_SET: usize = 7;

/// What each cause beyond the first is charged, nats.
pub fn charge(word: &Word, candidates: &[Candidate]) -> f64 {
    let single = candidates.iter().map(|c| word.fit(&[c]).log_score);
    FURTHER_PART * single.fold(0.0, f64::max)
}

/// The best sets of candidates up to [`LARGEST_SET`], the best first. All pairs with one of the
/// strongest dozen are tried, and so on, so that one may stand for two and two for one.
pub fn search(word: &Word, candidates: &[Candidate]) -> Vec<Model> {
    let charge = charge(word, candidates);
    let judge = |set: Vec<usize>| {
        let chosen: Vec<&Candidate> = set.iter().map(|&k| &candidates[k]).collect();
        let fit = word.fit(&chosen);
        let prior: f64 = chosen.iter().map(|c| c.log_prior).sum();
        let further = set.len().saturating_sub(1) as f64;
        Model {
            log_posterior: fit.log_evidence + prior - further * charge,
            set,
            fit,
        }
    };
    let mut all = vec![judge(Vec::new())];
    let mut front = all.clone();
    for _ in 0..LARGEST_SET {
        let mut grown: Vec<Model> = grown_by_one(&front, candidates.len())
            .into_iter()
            .map(judge)
            .collect();
        grown.sort_by(|a, b| b.log_posterior.total_cmp(&a.log_posterior));
        let best = all.iter().map(|m| m.log_posterior).fold(f64::MIN, f64::max);
        let Some(next) = grown.first() else { break };
        let still = next.log_posterior > best - 6.0 - charge;
        all.extend(grown.iter().cloned());
        grown.truncate(BEAM);
        front = grown;
        if !still {
            break;
        }
    }
    all.sort_by(|a, b| b.log_posterior.total_cmp(&a.log_posterior));
    all
}

/// The sets of `front` with one more of `count` candidates, each once.
fn grown_by_one(front: &[Model], count: usize) -> Vec<Vec<usize>> {
    let mut sets: Vec<Vec<usize>> = Vec::new();
    for model in front {
        for k in (0..count).filter(|k| !model.set.contains(k)) {
            let mut set = model.set.clone();
            set.push(k);
            set.sort_unstable();
            sets.push(set);
        }
    }
    sets.sort();
    sets.dedup();
    sets
}
