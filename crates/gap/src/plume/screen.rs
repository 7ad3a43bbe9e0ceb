//! The screen: how much every mechanism would gain to first order, and how large the best of
//! them gets where nothing is hidden.
//!
//! Whitened columns of all starts are taken once; their inner products, platform by platform,
//! give the score of every start for all platforms or one, with the base's parameters
//! projected out, and the joint law of all scores under the null, from which the law of the
//! largest is drawn by a parametric bootstrap.

use ::plume::mechanism::MechanismId;
use nalgebra::{Cholesky, DMatrix, DVector};
use rand::SeedableRng;
use rand::rngs::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

use super::candidate::Start;
use super::chance::Chance;
use super::fit::{Context, Fitted};
use super::linear;
use super::model::Model;
use super::parallel;

/// How many of the best gains are looked at for clustering, and from which on, nats.
const MOST_DISCOUNTED: usize = 24;
const LEAST_DISCOUNTED_NATS: f64 = 3.0;

/// One start, for all platforms or one, and what it would gain.
#[derive(Debug, Clone)]
pub(crate) struct Scored {
    pub start: usize,
    pub platform: Option<usize>,
    /// Amplitudes of its columns at their best.
    pub amplitude: Vec<f64>,
    /// Gain of the log likelihood, nats, less what tolerance and clustering of the residual
    /// take from it.
    pub gain: f64,
    /// Gain of the log evidence to first order, nats.
    pub log_evidence: f64,
    /// Information on the first column's amplitude with the base projected out.
    pub information: f64,
}

/// The screen's answer.
pub(crate) struct Screen {
    pub scored: Vec<Scored>,
    pub equations: Equations,
    /// How large the best gain gets where nothing is hidden.
    pub chance: Chance,
}

/// Inner products of base and start columns on one platform.
struct Products {
    gram: DMatrix<f64>,
    score: DVector<f64>,
}

/// The normal equations of everything that is tried.
pub(crate) struct Equations {
    per_platform: Vec<Products>,
    /// Inner products on all platforms.
    all: Products,
    /// Score of the base's columns, less what its prior takes.
    base_score: DVector<f64>,
    /// Of the starts.
    pub hypotheses: Vec<Hypothesis>,
    /// Of the base's own parameters with a wider prior than theirs.
    pub widened: Vec<Hypothesis>,
}

/// Whitened columns of all starts, side by side.
pub(crate) fn columns(ctx: &Context<'_>, fitted: &Fitted, starts: &[Start]) -> Vec<Vec<f64>> {
    let ends: Vec<(usize, usize)> = starts
        .iter()
        .enumerate()
        .flat_map(|(s, start)| (0..start.ends.len()).map(move |k| (s, k)))
        .collect();
    let chunks: Vec<&[(usize, usize)]> = ends.chunks(8).collect();
    let done = parallel::map(&chunks, ctx.threads, |chunk| {
        let mut group: Vec<Vec<f64>> = chunk
            .iter()
            .map(|&(s, k)| starts[s].column(ctx, &fitted.model, &fitted.prediction, k))
            .collect();
        let mut views: Vec<&mut [f64]> = group.iter_mut().map(Vec::as_mut_slice).collect();
        fitted.metric.whitener.whiten(&mut views);
        group
    });
    done.into_iter().flatten().collect()
}

/// The starts of one mechanism, each with the first of its columns.
pub(crate) fn of_mechanism<'c>(
    starts: &[Start],
    columns: &'c [Vec<f64>],
    id: MechanismId,
) -> (Vec<Start>, Vec<&'c [f64]>) {
    let mut at = 0;
    let mut out = (Vec::new(), Vec::new());
    for start in starts {
        if start.id == id {
            out.0.push(start.clone());
            out.1.push(columns[at].as_slice());
        }
        at += start.ends.len();
    }
    out
}

/// Scores all starts on top of `fitted`.
pub(crate) fn screen(
    ctx: &Context<'_>,
    fitted: &Fitted,
    starts: &[Start],
    columns: &[Vec<f64>],
    seed: u64,
) -> Screen {
    let per_platform = products(ctx, fitted, columns);
    let base = fitted.precision.len();
    let n = base + columns.len();
    let mut gram = DMatrix::zeros(n, n);
    let mut score = DVector::zeros(n);
    for p in &per_platform {
        gram += &p.gram;
        score += &p.score;
    }
    let frame = Frame::new(fitted, &gram, base);
    let first: Vec<usize> = starts
        .iter()
        .scan(base, |at, s| {
            let here = *at;
            *at += s.ends.len();
            Some(here)
        })
        .collect();
    let hypotheses = frame.hypotheses(starts, &first, &per_platform, &gram);
    let widened = frame.widened(&fitted.model, &gram);
    // At the posterior's peak the base's own gradient balances its prior.
    let (centre, precision) = (&fitted.centre, &fitted.precision);
    let base_score = DVector::from_fn(base, |k, _| score[k] + precision[k] * centre[k]);
    let left = fitted.less(&(&frame.inverse * &base_score));
    let equations = Equations {
        per_platform,
        all: Products { gram, score },
        base_score,
        hypotheses,
        widened,
    };
    let mut scored = equations.score_all();
    let column_of = |h: &Hypothesis| columns[first[h.start] - base].as_slice();
    discount(
        ctx,
        fitted,
        &left,
        column_of,
        &equations.hypotheses,
        &mut scored,
    );
    let chance = equations.null_law(&frame, seed);
    Screen {
        scored,
        equations,
        chance,
    }
}

fn products(ctx: &Context<'_>, fitted: &Fitted, columns: &[Vec<f64>]) -> Vec<Products> {
    let mut all = fitted.columns();
    all.extend(columns.iter().map(Vec::as_slice));
    parallel::map(ctx.data.ranges(), ctx.threads, |range| {
        let own: Vec<&[f64]> = all.iter().map(|c| &c[range.clone()]).collect();
        Products {
            gram: linear::gram(&own),
            score: linear::scores(&own, &fitted.residual[range.clone()]),
        }
    })
}

/// The base's part of the normal equations.
struct Frame {
    base: usize,
    /// Inverse of base information with its prior.
    inverse: DMatrix<f64>,
    /// Standard deviations of the base's priors.
    sd: Vec<f64>,
}

/// One start, all platforms or one, or a parameter of the base, with the base projected out.
pub(crate) struct Hypothesis {
    /// Which start it is, or which free parameter of the base.
    pub start: usize,
    pub platform: Option<usize>,
    columns: Vec<usize>,
    /// Rows: inner products of its columns with the base's.
    cross: DMatrix<f64>,
    /// Rows: how its columns lean on the base's.
    lean: DMatrix<f64>,
    pub information: DMatrix<f64>,
    inverse: DMatrix<f64>,
    pub one_sided: bool,
    tolerance: Vec<f64>,
    /// Standard deviations of its amplitudes' priors.
    pub sd: Vec<f64>,
    /// Log of its share of the prior.
    pub ln_weight: f64,
}

impl Frame {
    fn new(fitted: &Fitted, gram: &DMatrix<f64>, base: usize) -> Self {
        let precision = &fitted.precision;
        let a = DMatrix::from_fn(base, base, |i, j| {
            gram[(i, j)]
                + if i == j {
                    precision[i] * (1.0 + 1e-9)
                } else {
                    0.0
                }
        });
        let inverse = Cholesky::new(a).map_or_else(|| DMatrix::zeros(base, base), |c| c.inverse());
        let sd = precision.iter().map(|p| p.powf(-0.5)).collect();
        Self { base, inverse, sd }
    }

    /// Every start, for all platforms and, of sensors, for each; `first` has the first column of
    /// each start, and `gram` the inner products on all platforms.
    fn hypotheses(
        &self,
        starts: &[Start],
        first: &[usize],
        per_platform: &[Products],
        gram: &DMatrix<f64>,
    ) -> Vec<Hypothesis> {
        let many = per_platform.iter().filter(|p| p.gram.trace() > 0.0).count() > 1;
        let mut all = Vec::new();
        for (s, start) in starts.iter().enumerate() {
            let columns: Vec<usize> = (first[s]..first[s] + start.ends.len()).collect();
            if !start.one_platform {
                all.extend(self.hypothesis(s, None, &columns, gram, start));
            }
            if many && start.of_a_platform() {
                let free = |p: &usize| !start.taken.contains(p);
                for (p, own) in per_platform.iter().enumerate().filter(|(p, _)| free(p)) {
                    all.extend(self.hypothesis(s, Some(p), &columns, &own.gram, start));
                }
            }
        }
        for h in &mut all {
            h.ln_weight += starts[h.start].ln_weight_on(h.platform, per_platform.len());
        }
        all
    }

    /// Parameters of the base with a wider prior.
    fn widened(&self, model: &Model, gram: &DMatrix<f64>) -> Vec<Hypothesis> {
        let with = |k| self.hypothesis(k, None, &[k], gram, &Start::widened(model, k));
        model.held().filter_map(with).collect()
    }

    fn hypothesis(
        &self,
        start: usize,
        platform: Option<usize>,
        columns: &[usize],
        gram: &DMatrix<f64>,
        of: &Start,
    ) -> Option<Hypothesis> {
        let d = columns.len();
        let cross = DMatrix::from_fn(d, self.base, |i, j| gram[(columns[i], j)]);
        let lean = &cross * &self.inverse;
        let own = DMatrix::from_fn(d, d, |i, j| gram[(columns[i], columns[j])]);
        let information = &own - &lean * cross.transpose();
        // A column that the base can imitate to one part in a million says nothing of its own.
        for k in 0..d {
            if information[(k, k)].is_nan() || information[(k, k)] <= 1e-6 * own[(k, k)] + 1e-12 {
                return None;
            }
        }
        let inverse = Cholesky::new(information.clone())?.inverse();
        Some(Hypothesis {
            start,
            platform,
            columns: columns.to_vec(),
            cross,
            lean,
            information,
            inverse,
            one_sided: of.one_sided,
            tolerance: of.tolerance.clone(),
            sd: of.sd.clone(),
            ln_weight: of.ln_weight,
        })
    }
}

impl Hypothesis {
    /// Score of its own columns with the base projected out.
    fn own_score(&self, score: &DVector<f64>, base_score: &DVector<f64>) -> DVector<f64> {
        let own = DVector::from_fn(self.columns.len(), |k, _| score[self.columns[k]]);
        own - &self.lean * base_score
    }

    /// Amplitudes and gain in log likelihood; nothing on the forbidden side.
    fn gain(&self, own: &DVector<f64>) -> (DVector<f64>, f64) {
        let amplitude = &self.inverse * own;
        if self.one_sided && amplitude[0] <= 0.0 {
            return (DVector::zeros(own.len()), 0.0);
        }
        let mut gain = 0.5 * own.dot(&amplitude);
        let t = self.information[(0, 0)] * self.tolerance[0] * self.tolerance[0];
        gain /= 1.0 + t;
        (amplitude, gain)
    }

    /// Gain of the log evidence for a gain in likelihood, to first order.
    fn log_evidence(&self, own: &DVector<f64>) -> f64 {
        let gained = evidence(self.information.clone(), own, &self.sd);
        gained.map_or(0.0, |(_, nats)| nats + self.ln_weight_with_side())
    }

    /// Log of its share of the prior, with the density that one side has more where the other is
    /// forbidden.
    pub fn ln_weight_with_side(&self) -> f64 {
        let side = if self.one_sided {
            std::f64::consts::LN_2
        } else {
            0.0
        };
        side + self.ln_weight
    }
}

/// Most probable amplitudes of columns with priors of `sd` about zero, and the gain of their log
/// evidence, nats.
pub(crate) fn evidence(
    information: DMatrix<f64>,
    score: &DVector<f64>,
    sd: &[f64],
) -> Option<(DVector<f64>, f64)> {
    let mut precision = information;
    for (k, sd) in sd.iter().enumerate() {
        precision[(k, k)] += sd.powi(-2);
    }
    let chol = Cholesky::new(precision)?;
    let amplitude = chol.solve(score);
    let half_log_det: f64 = sd
        .iter()
        .enumerate()
        .map(|(k, sd)| chol.l_dirty()[(k, k)].ln() + sd.ln())
        .sum();
    let nats = 0.5 * score.dot(&amplitude) - half_log_det;
    Some((amplitude, nats))
}

impl Equations {
    /// Score of a hypothesis's columns with the base projected out.
    pub fn score_of(&self, h: &Hypothesis) -> DVector<f64> {
        let on = h.platform.map_or(&self.all, |p| &self.per_platform[p]);
        h.own_score(&on.score, &self.base_score)
    }

    /// Information that two hypotheses share with the base projected out.
    pub fn shared(&self, one: &Hypothesis, other: &Hypothesis) -> DMatrix<f64> {
        let mut out = -(&one.lean * other.cross.transpose());
        let on = match (one.platform, other.platform) {
            (Some(p), Some(q)) if p != q => return out,
            (Some(p), _) | (None, Some(p)) => &self.per_platform[p],
            (None, None) => &self.all,
        };
        for (i, a) in one.columns.iter().enumerate() {
            for (j, b) in other.columns.iter().enumerate() {
                out[(i, j)] += on.gram[(*a, *b)];
            }
        }
        out
    }

    /// What every parameter of the base would gain by a wider prior; `start` says which it is.
    pub fn score_widened(&self) -> Vec<Scored> {
        self.widened.iter().map(|h| self.score_one(h)).collect()
    }

    /// What every hypothesis would gain.
    fn score_all(&self) -> Vec<Scored> {
        self.hypotheses.iter().map(|h| self.score_one(h)).collect()
    }

    fn score_one(&self, h: &Hypothesis) -> Scored {
        let own = self.score_of(h);
        let (amplitude, gain) = h.gain(&own);
        let log_evidence = if gain > 0.0 {
            h.log_evidence(&own)
        } else {
            f64::NEG_INFINITY
        };
        Scored {
            start: h.start,
            platform: h.platform,
            amplitude: amplitude.iter().copied().collect(),
            gain,
            log_evidence,
            information: h.information[(0, 0)],
        }
    }

    /// The law of the largest gain under the null, from draws.
    fn null_law(&self, frame: &Frame, seed: u64) -> Chance {
        const DRAWS: usize = 200;
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let factors: Vec<DMatrix<f64>> = self
            .per_platform
            .iter()
            .map(|p| square_root(&p.gram))
            .collect();
        let mut largest = Vec::with_capacity(DRAWS);
        for _ in 0..DRAWS {
            // What the base's priors allow is part of the null.
            let allowed: Vec<f64> = frame
                .sd
                .iter()
                .map(|sd| {
                    let z: f64 = StandardNormal.sample(&mut rng);
                    sd * z
                })
                .collect();
            let own: Vec<DVector<f64>> = factors
                .iter()
                .zip(&self.per_platform)
                .map(|(f, p)| {
                    let z = DVector::from_fn(f.ncols(), |_, _| StandardNormal.sample(&mut rng));
                    let mut score = f * z;
                    for (k, a) in allowed.iter().enumerate() {
                        score.axpy(*a, &p.gram.column(k), 1.0);
                    }
                    score
                })
                .collect();
            let total: DVector<f64> = own.iter().fold(
                DVector::zeros(own.first().map_or(0, |o| o.len())),
                |s, o| s + o,
            );
            let base_score = DVector::from_fn(frame.base, |k, _| total[k]);
            let best = self
                .hypotheses
                .iter()
                .map(|h| {
                    let score = h.platform.map_or(&total, |p| &own[p]);
                    h.gain(&h.own_score(score, &base_score)).1
                })
                .fold(0.0f64, f64::max);
            largest.push(best);
        }
        Chance::of(&largest)
    }
}

/// Where residuals cluster more than the noise model says, a gain is worth less: checked for the
/// best, whose order alone matters. `left` is the whitened residual that the base leaves, and
/// `column_of` gives a hypothesis's whitened column.
fn discount<'c>(
    ctx: &Context<'_>,
    fitted: &Fitted,
    left: &[f64],
    column_of: impl Fn(&Hypothesis) -> &'c [f64],
    hypotheses: &[Hypothesis],
    scored: &mut [Scored],
) {
    let mut order: Vec<usize> = (0..scored.len()).collect();
    order.sort_by(|a, b| scored[*b].gain.total_cmp(&scored[*a].gain).then(a.cmp(b)));
    for &i in order.iter().take(MOST_DISCOUNTED) {
        let h = &hypotheses[i];
        if scored[i].gain >= LEAST_DISCOUNTED_NATS && h.columns.len() == 1 {
            let amplitude = scored[i].amplitude[0];
            scored[i].gain /= clustering(ctx, fitted, left, column_of(h), h, amplitude);
        }
    }
}

/// Ratio of the variance of a score as its blocks in time show it to that of the noise model;
/// at least 1.
fn clustering(
    ctx: &Context<'_>,
    fitted: &Fitted,
    left: &[f64],
    column: &[f64],
    h: &Hypothesis,
    amplitude: f64,
) -> f64 {
    let block_s = (2.0 * fitted.noise.memory_s()).clamp(15.0, 120.0);
    let times = ctx.data.track.time_s();
    let base_columns = fitted.columns();
    let (mut sum, mut expected, mut fourth) = (0.0, 0.0, 0.0);
    for (p, range) in ctx.data.ranges().iter().enumerate() {
        if h.platform.is_some_and(|own| own != p) {
            continue;
        }
        let mut i = range.start;
        while i < range.end {
            let end = times[i] + block_s;
            let (mut block, mut information) = (0.0, 0.0);
            while i < range.end && times[i] < end {
                let mut own = column[i];
                for (k, base) in base_columns.iter().enumerate() {
                    own -= h.lean[(0, k)] * base[i];
                }
                block += own * (left[i] - amplitude * own);
                information += own * own;
                i += 1;
            }
            sum += block * block;
            expected += information;
            fourth += information * information;
        }
    }
    if expected <= 0.0 || fourth <= 0.0 {
        return 1.0;
    }
    // Few effective blocks tell little: the estimate is drawn towards 1 by as many as ten.
    let blocks = expected * expected / fourth;
    let ratio = sum / expected;
    ((blocks * ratio + 10.0) / (blocks + 10.0)).max(1.0)
}

/// A factor F with F Fᵀ = `gram`, also where some columns are dependent.
fn square_root(gram: &DMatrix<f64>) -> DMatrix<f64> {
    let n = gram.nrows();
    let scale: Vec<f64> = (0..n).map(|k| gram[(k, k)].sqrt()).collect();
    let unit = DMatrix::from_fn(n, n, |i, j| {
        let s = scale[i] * scale[j];
        let own = if i == j { 1e-8 } else { 0.0 };
        if s > 0.0 { gram[(i, j)] / s + own } else { own }
    });
    match Cholesky::new(unit) {
        Some(c) => {
            let mut l = c.unpack();
            for i in 0..n {
                for j in 0..n {
                    l[(i, j)] *= scale[i];
                }
            }
            l
        }
        None => DMatrix::from_fn(n, n, |i, j| if i == j { scale[i] } else { 0.0 }),
    }
}

#[cfg(test)]
#[path = "screen_tests.rs"]
mod tests;
