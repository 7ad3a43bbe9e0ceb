//! Rivals without a name: smooth terms in time, place and across the plume that describe a
//! misfit without saying what causes it. Where one of them beats all named mechanisms, the
//! verdict is "unexplained", and the term says where the misfit lives.
//!
//! Every term is a set of whitened columns with one common prior size; its evidence is the
//! exact marginal likelihood, maximal over a grid of sizes.

use nalgebra::{Cholesky, DMatrix, DVector, SymmetricEigen};
use rand::SeedableRng;
use rand::rngs::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

use super::chance::Chance;
use super::fit::{Context, Fitted};
use super::linear::{self, dot, products, scores};
use super::nuisance::SHARED_MOST_DEG;
use super::parallel;
use super::rival_terms::{self as terms, Term};

/// A rival and what it would gain.
#[derive(Debug, Clone)]
pub(crate) struct Rival {
    pub coordinate: &'static str,
    pub words: String,
    pub platform: Option<usize>,
    /// Whether it swings the plume to and fro.
    pub swings: bool,
    /// Whether it delays the readings of its platform.
    pub delays: bool,
    /// Whether it describes what the best name does, and more.
    pub holds_best: bool,
    /// Gain of the log evidence, with its share of the prior, nats.
    pub log_evidence: f64,
    /// What it adds to the whitened prediction.
    pub fitted: Vec<f64>,
}

/// All rivals' answer.
pub(crate) struct Rivals {
    /// The best first.
    pub ranked: Vec<Rival>,
    /// Evidence that the best exceeds under the null with the probability asked for.
    pub threshold: f64,
}

/// Rival evidence sizes tried: prior variance times the largest information of the term.
const SIZES: [f64; 6] = [3.0, 10.0, 40.0, 200.0, 1000.0, 1e4];
/// Share of the prior that nameless terms have against named mechanisms.
const LN_SHARE: f64 = -6.0;
/// What a name gains from which on its own imperfection shows, nats, and the part of what it gains
/// beyond that which it may leave to what holds it.
const IMPERFECT_FROM_NATS: f64 = 100.0;
const IMPERFECT_PART: f64 = 0.2;

/// Builds, whitens and ranks all rivals on top of `fitted`.
pub(crate) fn rivals(ctx: &Context<'_>, fitted: &Fitted, false_alarm: f64, seed: u64) -> Rivals {
    let gram = linear::gram(&fitted.columns());
    let base = Base::new(ctx, fitted, &gram, None);
    // A turn within what any logged wind may be off by is no finding, though the noise that was
    // fitted has less of it.
    let usual = (ctx.data.on_board_wind && fitted.noise.shared_swing_deg < SHARED_MOST_DEG)
        .then(|| Base::new(ctx, fitted, &gram, Some(SHARED_MOST_DEG)));
    let (mut columns, terms) = terms::all(ctx, fitted, &base.left());
    let chunks: Vec<Vec<Vec<f64>>> = {
        let mut out = Vec::new();
        while !columns.is_empty() {
            let rest = columns.split_off(columns.len().min(8));
            out.push(std::mem::replace(&mut columns, rest));
        }
        out
    };
    let whitened: Vec<Vec<f64>> = parallel::map(&chunks, ctx.threads, |chunk| {
        let mut own = chunk.clone();
        let mut views: Vec<&mut [f64]> = own.iter_mut().map(Vec::as_mut_slice).collect();
        fitted.metric.whitener.whiten(&mut views);
        own
    })
    .into_iter()
    .flatten()
    .collect();
    let spectra: Vec<Option<Spectrum>> = parallel::map(&terms, ctx.threads, |t| {
        let base = usual.as_ref().filter(|_| t.turns).unwrap_or(&base);
        base.spectrum(t, &whitened)
    });
    let chance = null_law(&spectra, &terms, seed);
    let mut order: Vec<(f64, usize, f64)> = spectra
        .iter()
        .enumerate()
        .filter_map(|(k, s)| {
            let (value, size) = s.as_ref()?.evidence(None);
            Some((value + terms[k].ln_weight + LN_SHARE, k, size))
        })
        .collect();
    order.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
    let ranked = order
        .iter()
        .take(6)
        .filter_map(|&(log_evidence, k, size)| {
            let spectrum = spectra[k].as_ref()?;
            Some(Rival {
                coordinate: terms[k].coordinate,
                words: terms[k].words.clone(),
                platform: terms[k].platform,
                swings: terms[k].swings,
                delays: terms[k].delays,
                holds_best: false,
                log_evidence,
                fitted: spectrum.fitted(&terms[k], &whitened, size, ctx),
            })
        })
        .collect();
    Rivals {
        ranked,
        threshold: chance.threshold(false_alarm),
    }
}

/// Part of the way from which on it counts as before the record, and part of what a term explains.
const BEFORE_PART: f64 = 0.3;
const LIVES_PART: f64 = 0.5;

/// The part of the plume's way at each row that lies before the record; none where nobody logged the
/// wind, of which as much is known then as later.
fn part_before(ctx: &Context<'_>) -> Vec<f64> {
    if !ctx.data.on_board_wind {
        return vec![0.0; ctx.data.len()];
    }
    let (from, _) = ctx.data.span_s();
    let times = ctx.data.track.time_s();
    ctx.way_s()
        .zip(times)
        .map(|(way_s, t)| (1.0 - (t - from) / way_s.max(1.0)).max(0.0))
        .collect()
}

/// Whether what a term explains lives in air whose way lies before the record, `before` being the
/// part of that at every row: of the wind there nothing is known.
fn lives_before(before: &[f64], fitted: &[f64]) -> bool {
    let squares = || fitted.iter().map(|v| v * v).zip(before);
    let all: f64 = squares().map(|(square, _)| square).sum();
    let early = squares().filter(|(_, part)| **part > BEFORE_PART);
    early.map(|(square, _)| square).sum::<f64>() > LIVES_PART * all
}

impl Rivals {
    /// Weighs them beside the name that gains most, `log_score` nats, of whose cause they may be a
    /// part: what `holds` it, as a delay that comes and goes holds one that stays, has to gain so
    /// much more that it is not the name's own imperfection. A delay that holds none and lives in air
    /// from before the record is the wind's.
    pub fn beside_name(
        &mut self,
        ctx: &Context<'_>,
        log_score: f64,
        holds: impl Fn(&Rival) -> bool,
    ) {
        let before = part_before(ctx);
        for rival in &mut self.ranked {
            rival.holds_best = holds(rival);
            if rival.holds_best {
                rival.log_evidence -= IMPERFECT_PART * (log_score - IMPERFECT_FROM_NATS).max(0.0);
            }
        }
        self.ranked
            .retain(|r| !r.delays || r.holds_best || !lives_before(&before, &r.fitted));
        self.ranked
            .sort_by(|a, b| b.log_evidence.total_cmp(&a.log_evidence));
    }
}

/// The base's part of the normal equations.
struct Base<'a> {
    ctx: &'a Context<'a>,
    fitted: &'a Fitted,
    inverse: DMatrix<f64>,
    score: DVector<f64>,
}

/// A term in the axes in which its coefficients are independent.
struct Spectrum {
    /// Information of each.
    information: Vec<f64>,
    /// Score of each over the square root of its information: unit normal under the null.
    z: Vec<f64>,
    sizes: [Size; SIZES.len()],
    axes: DMatrix<f64>,
    /// Scale of each column.
    scale: Vec<f64>,
}

/// A size of a term's coefficients.
struct Size {
    /// Prior variance.
    variance: f64,
    /// Part of each coefficient's information that the prior lets stand.
    kept: Vec<f64>,
    /// What the prior's width takes, nats.
    volume: f64,
}

impl Size {
    fn new(information: &[f64], size: f64) -> Self {
        let variance = size / information.iter().copied().fold(1e-12, f64::max);
        let over = |v: &f64| variance * v;
        Self {
            variance,
            kept: information
                .iter()
                .map(|v| over(v) / (1.0 + over(v)))
                .collect(),
            volume: information.iter().map(|v| 0.5 * over(v).ln_1p()).sum(),
        }
    }
}

impl<'a> Base<'a> {
    /// The base as it is fitted, or with a shared swing of another size, degrees; `gram` has the
    /// products of its columns.
    fn new(
        ctx: &'a Context<'a>,
        fitted: &'a Fitted,
        gram: &DMatrix<f64>,
        swing_deg: Option<f64>,
    ) -> Self {
        let n = fitted.precision.len();
        let (centre, mut precision) = (&fitted.centre, fitted.precision.clone());
        if let Some(size) = swing_deg {
            let hats = fitted.metric.hats();
            let own = fitted.model.dimension();
            precision.rows_mut(own, hats).fill(size.powi(-2));
        }
        let mut a = gram.clone();
        for k in 0..n {
            a[(k, k)] += precision[k] * (1.0 + 1e-9);
        }
        Self {
            ctx,
            fitted,
            inverse: Cholesky::new(a).map_or_else(|| DMatrix::zeros(n, n), |c| c.inverse()),
            score: scores(&fitted.columns(), &fitted.residual) + precision.component_mul(centre),
        }
    }

    /// The whitened residual that it leaves.
    fn left(&self) -> Vec<f64> {
        self.fitted.less(&(&self.inverse * &self.score))
    }

    fn spectrum(&self, term: &Term, whitened: &[Vec<f64>]) -> Option<Spectrum> {
        let rows = term.platform.map_or(0..self.ctx.data.len(), |p| {
            self.ctx.data.ranges()[p].clone()
        });
        let own: Vec<&[f64]> = whitened[term.columns.clone()]
            .iter()
            .map(|c| &c[rows.clone()])
            .collect();
        let d = own.len();
        let norms: Vec<f64> = own.iter().map(|c| dot(c, c)).collect();
        let scale: Vec<f64> = norms
            .iter()
            .map(|n| if *n > 1e-9 { 1.0 / n.sqrt() } else { 0.0 })
            .collect();
        let base = self.fitted.columns();
        let base: Vec<&[f64]> = base.iter().map(|c| &c[rows.clone()]).collect();
        let mut cross = products(&own, &base);
        let mut gram = linear::gram(&own);
        for i in 0..d {
            cross.row_mut(i).scale_mut(scale[i]);
            for j in 0..d {
                gram[(i, j)] *= scale[i] * scale[j];
            }
        }
        let lean = &cross * &self.inverse;
        gram -= &lean * cross.transpose();
        let plain = scores(&own, &self.fitted.residual[rows]);
        let score = DVector::from_fn(d, |i, _| scale[i] * plain[i]) - &lean * &self.score;
        let eigen = SymmetricEigen::new(gram);
        let along = eigen.eigenvectors.transpose() * score;
        let mut information = Vec::with_capacity(d);
        let mut z = Vec::with_capacity(d);
        for k in 0..d {
            let v = eigen.eigenvalues[k];
            information.push(v.max(0.0));
            z.push(if v > 1e-6 { along[k] / v.sqrt() } else { 0.0 });
        }
        Some(Spectrum {
            sizes: SIZES.map(|size| Size::new(&information, size)),
            information,
            z,
            axes: eigen.eigenvectors,
            scale,
        })
    }
}

impl Spectrum {
    /// Largest log evidence over the sizes, and that prior variance; of its own scores or of `z`.
    fn evidence(&self, z: Option<&[f64]>) -> (f64, f64) {
        let z = z.unwrap_or(&self.z);
        let mut best = (0.0, 0.0);
        for size in &self.sizes {
            let gained: f64 = size.kept.iter().zip(z).map(|(k, z)| k * z * z).sum();
            let value = 0.5 * gained - size.volume;
            if value > best.0 {
                best = (value, size.variance);
            }
        }
        best
    }

    /// What the term adds to the whitened prediction at its most probable coefficients.
    fn fitted(
        &self,
        term: &Term,
        whitened: &[Vec<f64>],
        variance: f64,
        ctx: &Context<'_>,
    ) -> Vec<f64> {
        let inner = DVector::from_fn(self.z.len(), |k, _| {
            let v = self.information[k];
            variance * v.sqrt() * self.z[k] / (1.0 + variance * v)
        });
        let coefficients = &self.axes * inner;
        let rows = term
            .platform
            .map_or(0..ctx.data.len(), |p| ctx.data.ranges()[p].clone());
        let mut out = vec![0.0; ctx.data.len()];
        for (k, column) in whitened[term.columns.clone()].iter().enumerate() {
            let c = coefficients[k] * self.scale[k];
            for i in rows.clone() {
                out[i] += c * column[i];
            }
        }
        out
    }
}

/// Law of the largest evidence under the null, from draws.
fn null_law(spectra: &[Option<Spectrum>], terms: &[Term], seed: u64) -> Chance {
    const DRAWS: usize = 100;
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let largest: Vec<f64> = (0..DRAWS)
        .map(|_| {
            spectra
                .iter()
                .zip(terms)
                .filter_map(|(s, t)| {
                    let s = s.as_ref()?;
                    let z: Vec<f64> =
                        s.z.iter()
                            .map(|_| StandardNormal.sample(&mut rng))
                            .collect();
                    Some(s.evidence(Some(&z)).0 + t.ln_weight + LN_SHARE)
                })
                .fold(f64::NEG_INFINITY, f64::max)
        })
        .collect();
    Chance::of(&largest)
}
