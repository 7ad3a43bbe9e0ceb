//! Evidence of sets of causes from the normal equations, in closed form (Laplace): Gaussian
//! priors, tolerances of the base integrated out.

use std::collections::BTreeSet;

use nalgebra::{Cholesky, DMatrix, DVector, Dyn};

use super::normal::Block;
use crate::statistics::median;

/// Part of the strongest single cause's gain that each further cause is charged: no law is exact,
/// and what a strong cause leaves by that is not a cause of its own.
const FURTHER_PART: f64 = 0.2;
/// Sets kept from one size to the next.
const BEAM: usize = 12;
/// Largest set.
const LARGEST_SET: usize = 7;

/// What a candidate is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// A mechanism of the catalogue, at work from the beginning.
    Mechanism,
    /// A smooth term without a name: place among the groups.
    Nameless(usize),
    /// A mechanism that begins at the onset.
    Late,
}

/// A cause that may be added: columns with prior sizes.
#[derive(Debug, Clone, PartialEq)]
pub struct Candidate {
    /// Id in the catalogue, or what it is in words.
    pub name: String,
    /// What it is.
    pub kind: Kind,
    /// Its columns.
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
    /// Whether it is a mechanism of the catalogue.
    pub fn is_named(&self) -> bool {
        !matches!(self.kind, Kind::Nameless(_))
    }

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
pub struct Model {
    /// Places of the candidates.
    pub set: Vec<usize>,
    /// Gain of the log score at the fitted values, nats.
    pub log_score: f64,
    /// Gain of the log evidence, nats.
    pub log_evidence: f64,
    /// Log evidence and log prior together, less what further causes are charged.
    pub log_posterior: f64,
    /// Fitted values, candidate by candidate.
    pub values: Vec<f64>,
}

/// The data's word on all columns at parameter value zero: information and score, with the
/// tolerances of the base and the correction for overdispersion inside.
#[derive(Debug, Clone)]
pub struct Word {
    /// Information on the columns, tolerances integrated out.
    pub s: DMatrix<f64>,
    /// Score of the columns, likewise.
    t: DVector<f64>,
    /// Factor by which information and score were divided.
    pub dispersion: f64,
    /// Log evidence of the base over its point at zero.
    pub base_log_evidence: f64,
}

/// Information and score of all blocks.
pub fn sum(blocks: &[Block]) -> (DMatrix<f64>, DVector<f64>) {
    let of = |f: fn(&Block) -> &DMatrix<f64>| blocks.iter().map(f).sum();
    (
        of(|block| &block.a),
        blocks.iter().map(|block| &block.b).sum(),
    )
}

impl Word {
    /// The word of `a` and `b` (at zero): the first columns have tolerances and are integrated out;
    /// those of mechanisms are departures beyond the tolerance.
    pub fn new(a: &DMatrix<f64>, b: &DVector<f64>, tolerance: &[f64], dispersion: f64) -> Self {
        let (base, n) = (tolerance.len(), b.len());
        let (a, b) = (a / dispersion, b / dispersion);
        let precision = with_priors(a.view((0, 0), (base, base)).into_owned(), tolerance);
        let across = a.view((0, 0), (base, n)).into_owned();
        let Some(c) = Cholesky::new(precision) else {
            // Only of data that are not finite: nothing is known then.
            return Self {
                s: DMatrix::zeros(n, n),
                t: DVector::zeros(n),
                dispersion,
                base_log_evidence: f64::NEG_INFINITY,
            };
        };
        let head = b.rows(0, base).into_owned();
        Self {
            s: &a - across.transpose() * c.solve(&across),
            t: &b - across.transpose() * c.solve(&head),
            dispersion,
            base_log_evidence: 0.5 * head.dot(&c.solve(&head)) - half_log_det(&c, tolerance),
        }
    }

    /// The fit of a `set` of the candidates together.
    pub fn model(&self, candidates: &[Candidate], set: Vec<usize>, charge: f64) -> Model {
        let chosen = || set.iter().map(|&k| &candidates[k]);
        let columns: Vec<usize> = chosen().flat_map(|c| c.columns.iter().copied()).collect();
        let sds: Vec<f64> = chosen().flat_map(|c| c.prior_sd.iter().copied()).collect();
        let s = self.s.select_rows(&columns).select_columns(&columns);
        let t = self.t.select_rows(&columns);
        let (mut log_score, mut log_evidence) = (0.0, f64::NEG_INFINITY);
        let mut values = vec![0.0; columns.len()];
        if let Some(m) = Cholesky::new(with_priors(s.clone(), &sds)) {
            let fitted = m.solve(&t);
            log_score = t.dot(&fitted) - 0.5 * fitted.dot(&(&s * &fitted));
            log_evidence = 0.5 * t.dot(&fitted) - half_log_det(&m, &sds);
            let mut rest = fitted.as_slice();
            for candidate in chosen() {
                let (own, others) = rest.split_at(candidate.columns.len());
                if !candidate.can_be(own) {
                    log_evidence -= 0.5 * t.dot(&fitted) + 1.0;
                }
                rest = others;
            }
            values = fitted.as_slice().to_vec();
        }
        let prior: f64 = chosen().map(|c| c.log_prior).sum();
        let further = set.len().saturating_sub(1) as f64;
        Model {
            set,
            log_score,
            log_evidence,
            log_posterior: log_evidence + prior - further * charge,
            values,
        }
    }

    /// What each cause beyond the first is charged, nats.
    pub fn charge(&self, candidates: &[Candidate]) -> f64 {
        let single = (0..candidates.len()).map(|k| self.model(candidates, vec![k], 0.0).log_score);
        FURTHER_PART * single.fold(0.0, f64::max)
    }

    /// The best sets of candidates up to `LARGEST_SET`, the best first. All pairs with one of the
    /// strongest dozen are tried, and so on, so that one may stand for two and two for one.
    pub fn search(&self, candidates: &[Candidate]) -> Vec<Model> {
        let charge = self.charge(candidates);
        let mut all = vec![self.model(candidates, Vec::new(), charge)];
        let mut front = all.clone();
        for _ in 0..LARGEST_SET {
            let sets = grown_by_one(&front, candidates.len());
            front = sets
                .into_iter()
                .map(|set| self.model(candidates, set, charge))
                .collect();
            front.sort_by(|a, b| b.log_posterior.total_cmp(&a.log_posterior));
            all.extend(front.iter().cloned());
            front.truncate(BEAM);
        }
        all.sort_by(|a, b| b.log_posterior.total_cmp(&a.log_posterior));
        all
    }
}

/// The precision of columns of this information with priors.
pub fn with_priors(mut information: DMatrix<f64>, sds: &[f64]) -> DMatrix<f64> {
    for (k, sd) in sds.iter().enumerate() {
        information[(k, k)] += sd.powi(-2);
    }
    information
}

/// Half the logarithm of the determinant of a precision over that of its priors.
fn half_log_det(precision: &Cholesky<f64, Dyn>, sds: &[f64]) -> f64 {
    let diagonal = precision.l_dirty().diagonal();
    diagonal.iter().zip(sds).map(|(d, sd)| (d * sd).ln()).sum()
}

/// The sets of `front` with one more of `count` candidates, each once.
fn grown_by_one(front: &[Model], count: usize) -> BTreeSet<Vec<usize>> {
    let grown = |model: &Model, k: usize| {
        let mut set = model.set.clone();
        set.push(k);
        set.sort_unstable();
        set
    };
    let others = |model: &Model| {
        (0..count)
            .filter(|k| !model.set.contains(k))
            .collect::<Vec<_>>()
    };
    let each = front
        .iter()
        .map(|m| others(m).into_iter().map(|k| grown(m, k)));
    each.flatten().collect()
}

/// How much more the score varies from block to block than the information says, by columns
/// that the model's own parameters span: the median over columns of the ratio, at least 1.
pub fn dispersion(
    blocks: &[Block],
    fitted: &DVector<f64>,
    columns: impl Iterator<Item = usize>,
) -> f64 {
    let n = blocks.len() as f64;
    let ratio = |k: usize| {
        let score = |block: &Block| block.b[k] - (block.a.row(k) * fitted)[0];
        let scores: Vec<f64> = blocks.iter().map(score).collect();
        let mean = scores.iter().sum::<f64>() / n;
        let squares: f64 = scores.iter().map(|s| (s - mean).powi(2)).sum();
        let information: f64 = blocks.iter().map(|block| block.a[(k, k)]).sum();
        (information > 0.0).then(|| squares * n / (n - 1.0) / information)
    };
    median(columns.filter_map(ratio).collect()).map_or(1.0, |m| m.max(1.0))
}

/// What of a dispersion over so many blocks is more than chance may add to 1.
pub fn beyond_chance(dispersion: f64, blocks: usize) -> f64 {
    let error = (2.0 / (blocks as f64 - 1.0)).sqrt();
    (dispersion / (1.0 + error)).max(1.0)
}
