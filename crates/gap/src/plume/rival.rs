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

use super::fit::{Context, Fitted};
use super::linear::{dot, products};
use super::parallel;

/// What a term multiplies.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Load {
    /// Nothing: it adds to the reading.
    Additive,
    /// The plume's part of the reading.
    Proportional,
    /// The derivative by wind direction: it moves the plume.
    Swing,
    /// The derivative by time: it shifts the reading in time.
    Delay,
}

/// A flexible term.
#[derive(Debug, Clone)]
struct Term {
    coordinate: &'static str,
    words: String,
    platform: Option<usize>,
    /// Log of its share of the rivals' prior.
    ln_weight: f64,
    /// Positions of its columns.
    columns: std::ops::Range<usize>,
}

/// A rival and what it would gain.
#[derive(Debug, Clone)]
pub(crate) struct Rival {
    pub coordinate: &'static str,
    pub words: String,
    pub platform: Option<usize>,
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
const LN_SHARE: f64 = -5.0;

/// Columns as they are made, before whitening.
struct Builder<'a> {
    ctx: &'a Context<'a>,
    fitted: &'a Fitted,
    delay: Vec<f64>,
    columns: Vec<Vec<f64>>,
    terms: Vec<Term>,
}

impl<'a> Builder<'a> {
    fn load(&self, load: Load, i: usize) -> f64 {
        match load {
            Load::Additive => 1.0,
            Load::Proportional => self.fitted.loading[i].gust,
            Load::Swing => self.fitted.loading[i].swing,
            Load::Delay => self.delay[i],
        }
    }

    /// Time at each row less this part of the plume's time on its way there, s: at 1 the time of
    /// emission, at 0.5 that of the wind which turned it most.
    fn time_on_the_way(&self, part: f64) -> Vec<f64> {
        let track = &self.ctx.data.track;
        let source = self.ctx.setup.base.sources[0].place;
        (0..track.len())
            .map(|i| {
                let p = track.place(i);
                let far = (p.east_m - source.east_m).hypot(p.north_m - source.north_m);
                track.time_s()[i] - part * far / track.transport()[i].speed_m_s.max(0.5)
            })
            .collect()
    }

    /// Hat functions over `at` (one value a row) times the load.
    fn hats(&mut self, at: &[f64], knots: usize, load: Load) -> std::ops::Range<usize> {
        let start = self.columns.len();
        let knots = self.knots(at, knots, load);
        if knots.len() < 2 {
            return start..start;
        }
        let mut columns = vec![vec![0.0; at.len()]; knots.len()];
        for (i, u) in at.iter().enumerate() {
            let load = self.load(load, i);
            let k = knots.partition_point(|x| x <= u).clamp(1, knots.len() - 1);
            let part = ((u - knots[k - 1]) / (knots[k] - knots[k - 1])).clamp(0.0, 1.0);
            columns[k - 1][i] = (1.0 - part) * load;
            columns[k][i] = part * load;
        }
        self.columns.extend(columns);
        start..self.columns.len()
    }

    /// Knots at even shares of the information that the load gives.
    fn knots(&self, at: &[f64], count: usize, load: Load) -> Vec<f64> {
        let mut order: Vec<usize> = (0..at.len()).filter(|i| self.ctx.data.used[*i]).collect();
        order.sort_by(|a, b| at[*a].total_cmp(&at[*b]));
        let total: f64 = order.iter().map(|i| self.load(load, *i).powi(2)).sum();
        if total <= 0.0 || order.is_empty() {
            return Vec::new();
        }
        let (mut sum, mut out) = (0.0, Vec::with_capacity(count));
        for i in order {
            let due = total * out.len() as f64 / (count - 1) as f64;
            sum += self.load(load, i).powi(2);
            if sum > due && out.len() < count {
                out.push(at[i]);
            }
        }
        out.dedup_by(|b, a| *b - *a < 1e-6);
        out
    }

    fn add(&mut self, coordinate: &'static str, words: &str, columns: std::ops::Range<usize>) {
        self.add_weighted(coordinate, words.to_string(), None, 0.0, columns);
    }

    fn add_weighted(
        &mut self,
        coordinate: &'static str,
        words: String,
        platform: Option<usize>,
        ln_weight: f64,
        columns: std::ops::Range<usize>,
    ) {
        if !columns.is_empty() {
            self.terms.push(Term {
                coordinate,
                words,
                platform,
                ln_weight,
                columns,
            });
        }
    }
}

/// Builds, whitens and ranks all rivals on top of `fitted`.
pub(crate) fn rivals(ctx: &Context<'_>, fitted: &Fitted, false_alarm: f64, seed: u64) -> Rivals {
    let mut b = Builder {
        ctx,
        fitted,
        delay: rate_of_change(ctx, fitted),
        columns: Vec::new(),
        terms: Vec::new(),
    };
    in_time(&mut b);
    in_place(&mut b);
    periodic(&mut b);
    let Builder {
        mut columns, terms, ..
    } = b;
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
    let base = Base::new(ctx, fitted);
    let spectra: Vec<Option<Spectrum>> =
        parallel::map(&terms, ctx.threads, |t| base.spectrum(t, &whitened));
    let (location, scale) = null_law(&spectra, &terms, seed);
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
                log_evidence,
                fitted: spectrum.fitted(&terms[k], &whitened, size, ctx),
            })
        })
        .collect();
    Rivals {
        ranked,
        threshold: location - scale * (-(1.0 - false_alarm).ln()).ln(),
    }
}

/// Derivative of the predicted reading by time on each platform.
fn rate_of_change(ctx: &Context<'_>, fitted: &Fitted) -> Vec<f64> {
    let times = ctx.data.track.time_s();
    let r = &fitted.prediction.reading;
    let mut out = vec![0.0; r.len()];
    for range in ctx.data.ranges() {
        for i in range.clone() {
            let (a, b) = (i.max(range.start + 1) - 1, (i + 1).min(range.end - 1));
            if times[b] > times[a] {
                out[i] = (r[b] - r[a]) / (times[b] - times[a]);
            }
        }
    }
    out
}

fn in_time(b: &mut Builder<'_>) {
    let time = b.ctx.data.track.time_s().to_vec();
    let (from, to) = b.ctx.data.span_s();
    let knots = ((to - from) / 45.0).clamp(5.0, 24.0) as usize;
    for (load, part, words) in [
        (
            Load::Additive,
            0.0,
            "an additive wander of all readings in time",
        ),
        (
            Load::Proportional,
            0.0,
            "the plume's strength wandering in time",
        ),
        (
            Load::Proportional,
            1.0,
            "the source's strength wandering in time",
        ),
        (
            Load::Swing,
            0.5,
            "the plume swinging in time otherwise than the wind",
        ),
    ] {
        let then = b.time_on_the_way(part);
        let columns = b.hats(&then, knots, load);
        b.add("time", words, columns);
    }
    let platforms = b.ctx.data.ranges().len();
    if platforms < 2 {
        return;
    }
    let ln_weight = -(platforms as f64).ln();
    for (load, words) in [
        (Load::Additive, "an additive wander in time"),
        (
            Load::Proportional,
            "the strength of its plume readings wandering in time",
        ),
        (Load::Delay, "a delay of its readings that comes and goes"),
    ] {
        let columns = b.hats(&time, (knots * 2 / 3).max(5), load);
        for p in 0..platforms {
            let name = &b.ctx.data.track.platforms()[p];
            let words = format!("platform {name}: {words}");
            b.add_weighted("platform", words, Some(p), ln_weight, columns.clone());
        }
    }
}

fn in_place(b: &mut Builder<'_>) {
    let track = &b.ctx.data.track;
    let source = b.ctx.setup.base.sources[0].place;
    let n = track.len();
    let (mut along, mut across, mut height) = (vec![0.0; n], vec![0.0; n], vec![0.0; n]);
    let Some(world) = b.fitted.model.world(&b.ctx.setup.base, track.platforms()) else {
        return;
    };
    for i in 0..n {
        let (p, w) = (track.place(i), track.transport()[i]);
        let (e, no) = (p.east_m - source.east_m, p.north_m - source.north_m);
        along[i] = e * w.east + no * w.north;
        let sigma = world.sigmas_m(along[i].max(10.0)).0;
        across[i] = ((e * w.north - no * w.east) / sigma).clamp(-4.0, 4.0);
        height[i] = p.height_agl_m;
    }
    for (coordinate, at, words) in [
        ("along_wind", &along, "with distance along the wind"),
        ("across_wind", &across, "with distance across the wind"),
        ("height", &height, "with height"),
    ] {
        let columns = b.hats(at, 7, Load::Proportional);
        b.add(
            coordinate,
            &format!("the plume's strength changing {words}"),
            columns,
        );
        let columns = b.hats(at, 7, Load::Additive);
        b.add(coordinate, &format!("readings changing {words}"), columns);
    }
    for (coordinate, at, words) in [
        ("along_wind", &along, "along"),
        ("across_wind", &across, "across"),
    ] {
        let columns = b.hats(at, 13, Load::Proportional);
        let words = format!("the plume's strength changing {words} the wind in narrow strips");
        b.add(coordinate, &words, columns);
    }
    map(b, &along, &across);
}

/// Products of hats east and north, and along and across the wind.
fn map(b: &mut Builder<'_>, along: &[f64], across: &[f64]) {
    let track = &b.ctx.data.track;
    let east: Vec<f64> = (0..track.len()).map(|i| track.place(i).east_m).collect();
    let north: Vec<f64> = (0..track.len()).map(|i| track.place(i).north_m).collect();
    for (load, one, other, sizes, words) in [
        (
            Load::Proportional,
            along,
            across,
            (4, 7),
            "the plume's strength changing over the map",
        ),
        (
            Load::Additive,
            &east,
            &north,
            (5, 5),
            "readings changing over the map",
        ),
    ] {
        let e = b.hats(one, sizes.0, Load::Additive);
        let n = b.hats(other, sizes.1, Load::Additive);
        let mut products = Vec::with_capacity(e.len() * n.len());
        for i in e.clone() {
            for j in n.clone() {
                let column: Vec<f64> = (0..east.len())
                    .map(|r| b.columns[i][r] * b.columns[j][r] * b.load(load, r))
                    .collect();
                products.push(column);
            }
        }
        b.columns.truncate(e.start);
        let start = b.columns.len();
        b.columns.extend(products);
        let all = start..b.columns.len();
        b.add("map", words, all);
    }
}

/// Sines and cosines of periods from 30 s to half the record.
fn periodic(b: &mut Builder<'_>) {
    const COUNT: usize = 20;
    let time = b.ctx.data.track.time_s().to_vec();
    let (from, to) = b.ctx.data.span_s();
    let longest = 0.7 * (to - from);
    let shortest = 30.0f64;
    if longest < 2.0 * shortest {
        return;
    }
    let platforms = b.ctx.data.ranges().len();
    let (emitted, turned) = (b.time_on_the_way(1.0), b.time_on_the_way(0.5));
    for k in 0..COUNT {
        let period = shortest * (longest / shortest).powf(k as f64 / (COUNT - 1) as f64);
        for (load, time, words) in [
            (Load::Additive, &time, "a periodic wave of all readings"),
            (
                Load::Proportional,
                &emitted,
                "the source's strength pulsing",
            ),
            (Load::Swing, &turned, "the plume swinging to and fro"),
        ] {
            let start = b.columns.len();
            for phase in [0.0, std::f64::consts::FRAC_PI_2] {
                let wave = |i: usize| (std::f64::consts::TAU * time[i] / period + phase).sin();
                let column = (0..time.len()).map(|i| wave(i) * b.load(load, i)).collect();
                b.columns.push(column);
            }
            let own = start..b.columns.len();
            let ln_weight = -(COUNT as f64).ln();
            let text = format!("{words}, period about {period:.0} s");
            b.add_weighted("time", text, None, ln_weight, own.clone());
            if load == Load::Additive && platforms > 1 {
                for p in 0..platforms {
                    let name = &b.ctx.data.track.platforms()[p];
                    let text =
                        format!("platform {name}: a periodic wave, period about {period:.0} s");
                    let share = ln_weight - (platforms as f64).ln();
                    b.add_weighted("platform", text, Some(p), share, own.clone());
                }
            }
        }
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
    axes: DMatrix<f64>,
    /// Scale of each column.
    scale: Vec<f64>,
}

impl<'a> Base<'a> {
    fn new(ctx: &'a Context<'a>, fitted: &'a Fitted) -> Self {
        let n = fitted.columns.len();
        let (centre, precision) = (&fitted.centre, &fitted.precision);
        let mut a = products(&fitted.columns, &fitted.columns);
        for k in 0..n {
            a[(k, k)] += precision[k] * (1.0 + 1e-9);
        }
        Self {
            ctx,
            fitted,
            inverse: Cholesky::new(a).map_or_else(|| DMatrix::zeros(n, n), |c| c.inverse()),
            score: DVector::from_fn(n, |k, _| {
                dot(&fitted.columns[k], &fitted.residual) + precision[k] * centre[k]
            }),
        }
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
        let base: Vec<&[f64]> = self
            .fitted
            .columns
            .iter()
            .map(|c| &c[rows.clone()])
            .collect();
        let mut cross = products(&own, &base);
        let mut gram = products(&own, &own);
        for i in 0..d {
            cross.row_mut(i).scale_mut(scale[i]);
            for j in 0..d {
                gram[(i, j)] *= scale[i] * scale[j];
            }
        }
        let lean = &cross * &self.inverse;
        gram -= &lean * cross.transpose();
        let residual = &self.fitted.residual[rows];
        let score =
            DVector::from_fn(d, |i, _| scale[i] * dot(own[i], residual)) - &lean * &self.score;
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
            information,
            z,
            axes: eigen.eigenvectors,
            scale,
        })
    }
}

impl Spectrum {
    /// Largest log evidence over the sizes, and that size; of its own scores or of `z`.
    fn evidence(&self, z: Option<&[f64]>) -> (f64, f64) {
        let z = z.unwrap_or(&self.z);
        let largest = self.information.iter().copied().fold(1e-12f64, f64::max);
        let mut best = (0.0, 0.0);
        for size in SIZES {
            let variance = size / largest;
            let value: f64 = self
                .information
                .iter()
                .zip(z)
                .map(|(v, z)| {
                    let k = variance * v;
                    0.5 * z * z * k / (1.0 + k) - 0.5 * (1.0 + k).ln()
                })
                .sum();
            if value > best.0 {
                best = (value, variance);
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

/// Law of the largest evidence under the null, as location and scale of a Gumbel law.
fn null_law(spectra: &[Option<Spectrum>], terms: &[Term], seed: u64) -> (f64, f64) {
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
    let mean = largest.iter().sum::<f64>() / DRAWS as f64;
    let var = largest.iter().map(|g| (g - mean).powi(2)).sum::<f64>() / (DRAWS - 1) as f64;
    let scale = (var.sqrt() * 6f64.sqrt() / std::f64::consts::PI).max(1.0);
    (mean - 0.577_215_66 * scale, scale)
}
