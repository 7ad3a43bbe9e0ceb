//! What no base gets exactly right and no one should name: small departures that every fit
//! may take up at a price.
//!
//! The wind's error is shared by all platforms: hat functions in time along the derivative by
//! wind direction, with one size fitted to the data. Swings that no log resolves widen the mean
//! plume; spread, strength and logged places are right to a per cent or a metre only. Each is
//! a column with a normal prior, integrated over together with the free parameters.

use std::sync::Arc;

use ::plume::mechanism::MechanismId;
use nalgebra::{Cholesky, DMatrix, DVector, Dyn};

use super::fit::Context;
use super::freedom::Freedom;
use super::linear::{self, dot, scores};
use super::model::{Model, Part, Prediction};
use super::noise::{Loading, NoiseModel, Whitener};
use super::ways::Knots;

/// Time between knots, s, and most stretches between them.
#[derive(Clone, Copy)]
pub(crate) struct Spacing {
    pub s: f64,
    pub most: f64,
}

/// Knots of the shared swing: of gusts, and of what a log's smoothing leaves.
const KNOTS: Spacing = Spacing {
    s: 12.0,
    most: 75.0,
};
const SLOW_KNOTS: Spacing = Spacing {
    s: 50.0,
    most: 15.0,
};
/// Size of the slow ones over that of the fast ones: winds turn more, the longer they take.
const SLOW_OVER_FAST: f64 = 2.0;
/// Sizes tried for the shared swing, degrees.
const SIZES_DEG: [f64; 8] = [0.05, 0.1, 0.2, 0.35, 0.6, 1.0, 2.0, 4.0];
/// Median and logarithmic spread of the shared swing's prior, degrees.
const SHARED_PRIOR: (f64, f64) = (0.25, 0.7);
/// Largest shared swing where the wind is logged, degrees: more is a finding.
pub(crate) const SHARED_MOST_DEG: f64 = 0.35;

/// What the wind before the record may be off by, at knots, from what the record's beginning suggests,
/// degrees; and its speed, which dilutes what it took up: a part of the plume.
const EARLY_DEG: f64 = 4.0;
const EARLY_PART: f64 = 0.08;
const EARLY_KNOTS: Spacing = Spacing {
    s: 60.0,
    most: 10.0,
};
/// Slow wander of a wind that nobody logged: its knots, and its size, degrees.
const WANDER_KNOTS: Spacing = Spacing {
    s: 200.0,
    most: 75.0,
};
const WANDER_DEG: f64 = 1.0;
/// Knots of what is not known of one whose swing was found by the plume alone.
const SHOWN_KNOTS: Spacing = Spacing {
    s: 40.0,
    most: 75.0,
};
/// Standard deviation of the wind's speed along its mean over that across (Panofsky & Dutton 1984,
/// neutral air: 2.4 and 1.9 friction velocities): a wind that swings surges too.
const ALONG_OVER_ACROSS: f64 = 1.25;

/// Mechanisms of which a little is always there: a step, and one standard deviation in steps.
const TOLERATED: [(MechanismId, usize, f64, f64); 8] = [
    // Unresolved swings: variance is linear in the square of the angle.
    (MechanismId::Meander, 0, 1.0, 1.5),
    (MechanismId::SigmaYScale, 0, 1.02, 1.5),
    (MechanismId::SigmaZScale, 0, 1.02, 1.0),
    (MechanismId::EmissionScale, 0, 1.02, 1.0),
    (MechanismId::PositionOffset, 0, 1.0, 1.0),
    (MechanismId::PositionOffset, 1, 1.0, 1.0),
    (MechanismId::AltitudeOffset, 0, 1.0, 0.6),
    (MechanismId::ClockOffset, 0, 0.1, 0.5),
];

/// What a sensor's zero is never better known than, as part of its white noise.
const ZERO_PART: f64 = 0.2;

/// Columns before whitening, with the standard deviations of their coefficients.
#[derive(Debug, Clone)]
pub(crate) struct Nuisance {
    pub raw: Vec<Vec<f64>>,
    pub sd: Vec<f64>,
    /// How many columns, which stand first, are hats of the shared swing.
    hats: usize,
    /// The mechanism that each column stands for, if any.
    tolerates: Vec<Option<MechanismId>>,
}

/// What is left of a tolerance that is taken away.
const NOT_TOLERATED: f64 = 1e-3;

impl Nuisance {
    /// The columns at a model.
    pub fn new(
        ctx: &Context<'_>,
        model: &Model,
        prediction: &Prediction,
        loading: &[Loading],
        noise: &NoiseModel,
    ) -> Self {
        let mut own = Self::swings(ctx, loading, noise);
        for (id, which, step, size) in TOLERATED {
            let size = if id == MechanismId::PositionOffset {
                size.max(displaced_m(ctx))
            } else {
                size
            };
            let mut values = super::model::defaults(id);
            values[which] = step;
            let part = Part {
                id,
                platform: None,
                values,
            };
            let column = ctx.change(model, prediction, part);
            let known = model
                .parts
                .iter()
                .any(|p| p.id == id && p.platform.is_none());
            own.raw.push(column);
            own.sd.push(if known { NOT_TOLERATED * size } else { size });
            own.tolerates.push(Some(id));
        }
        own.zeros(ctx, ZERO_PART * noise.white_ppm());
        own
    }

    /// A zero for every sensor, and how it wanders from the record's beginning to its end.
    fn zeros(&mut self, ctx: &Context<'_>, sd_ppm: f64) {
        let (from, to) = ctx.data.span_s();
        let times = ctx.data.track.time_s();
        for range in ctx.data.ranges() {
            let on_it = |of: &dyn Fn(usize) -> f64| {
                let mut column = vec![0.0; times.len()];
                for i in range.clone() {
                    column[i] = of(i);
                }
                column
            };
            let along = |i: usize| 2.0 * (times[i] - from) / (to - from).max(1.0) - 1.0;
            self.raw.push(on_it(&|_| 1.0));
            self.raw.push(on_it(&along));
            self.sd.extend([sd_ppm; 2]);
            self.tolerates.extend([None; 2]);
        }
    }

    /// The shared swing and everything that the catalogue could add.
    pub fn wide(
        ctx: &Context<'_>,
        loading: &[Loading],
        noise: &NoiseModel,
        freedom: &Freedom,
    ) -> Self {
        let mut own = Self::swings(ctx, loading, noise);
        own.raw.extend(freedom.raw.iter().cloned());
        own.sd.extend(&freedom.sd);
        own.tolerates.resize(own.raw.len(), None);
        own
    }

    /// Swings that all platforms share: as fast as the knots resolve; of the wind before the
    /// record; and, where nobody logged the wind, its slow wander.
    fn swings(ctx: &Context<'_>, loading: &[Loading], noise: &NoiseModel) -> Self {
        let mut raw = hats(ctx, loading, KNOTS);
        for mut hat in hats(ctx, loading, SLOW_KNOTS) {
            hat.iter_mut().for_each(|v| *v *= SLOW_OVER_FAST);
            raw.push(hat);
        }
        let hats_count = raw.len();
        let mut sd = vec![noise.shared_swing_deg; hats_count];
        if ctx.data.on_board_wind {
            let early = Knots::before(ctx, EARLY_KNOTS);
            for (columns, size) in [
                (early.turning(loading), EARLY_DEG),
                (early.taking_up(loading), EARLY_PART),
            ] {
                sd.extend(vec![size; columns.len()]);
                raw.extend(columns);
            }
        } else if let Some(swing_deg) = ctx.data.shown_swing_deg {
            let slow = Knots::over(ctx, SHOWN_KNOTS).turning(loading);
            sd.extend(vec![swing_deg; slow.len()]);
            raw.extend(slow);
            let surges = hats_along(ctx, loading, WANDER_KNOTS, |l| l.gust);
            let surge = ALONG_OVER_ACROSS * swing_deg.to_radians();
            sd.extend(vec![surge; surges.len()]);
            raw.extend(surges);
        } else {
            let slow = hats(ctx, loading, WANDER_KNOTS);
            sd.extend(vec![WANDER_DEG; slow.len()]);
            raw.extend(slow);
        }
        Self {
            tolerates: vec![None; raw.len()],
            raw,
            sd,
            hats: hats_count,
        }
    }
}

/// By how much what the wind does between the knots of a swing that only the plume shows may displace
/// the plume, m; nil of other winds.
fn displaced_m(ctx: &Context<'_>) -> f64 {
    let wind = ctx.data.track.transport().first();
    let speed_m_s = wind.map_or(0.0, |wind| wind.speed_m_s);
    let swing_deg = ctx.data.shown_swing_deg.unwrap_or(0.0);
    swing_deg.to_radians() * speed_m_s * SHOWN_KNOTS.s
}

/// Hat functions in time along the derivative by wind direction.
pub(crate) fn hats(ctx: &Context<'_>, loading: &[Loading], spacing: Spacing) -> Vec<Vec<f64>> {
    hats_along(ctx, loading, spacing, |l| l.swing)
}

/// Hat functions in time along what is taken of the loading.
fn hats_along(
    ctx: &Context<'_>,
    loading: &[Loading],
    spacing: Spacing,
    along: impl Fn(&Loading) -> f64,
) -> Vec<Vec<f64>> {
    let (from, to) = ctx.data.span_s();
    let intervals = ((to - from) / spacing.s).clamp(2.0, spacing.most).floor();
    let width = ((to - from) / intervals).max(1e-9);
    let mut out = vec![vec![0.0; loading.len()]; intervals as usize + 1];
    for (i, t) in ctx.data.track.time_s().iter().enumerate() {
        let place = ((t - from) / width).clamp(0.0, intervals);
        let k = (place as usize).min(out.len() - 2);
        let part = place - k as f64;
        out[k][i] = (1.0 - part) * along(&loading[i]);
        out[k + 1][i] = part * along(&loading[i]);
    }
    out
}

/// A whitener with the nuisance columns whitened: the metric in which residuals are measured.
#[derive(Debug, Clone)]
pub(crate) struct Metric {
    pub whitener: Whitener,
    pub nuisance: Nuisance,
    /// Whitened nuisance columns.
    pub columns: Vec<Vec<f64>>,
    /// Their inner products.
    pub gram: DMatrix<f64>,
    factor: Option<Cholesky<f64, Dyn>>,
    /// ½ ln |I + S Zᵀ Z|.
    pub half_log_det: f64,
}

impl Metric {
    pub fn new(whitener: Whitener, nuisance: Nuisance) -> Self {
        let mut columns = nuisance.raw.clone();
        let mut views: Vec<&mut [f64]> = columns.iter_mut().map(Vec::as_mut_slice).collect();
        whitener.whiten(&mut views);
        let gram = linear::gram(&columns);
        let mut metric = Self {
            whitener,
            nuisance,
            columns,
            gram,
            factor: None,
            half_log_det: 0.0,
        };
        metric.factorise();
        metric
    }

    fn factorise(&mut self) {
        let (n, sd, gram) = (self.columns.len(), &self.nuisance.sd, &self.gram);
        let a = DMatrix::from_fn(n, n, |i, j| {
            sd[i] * sd[j] * gram[(i, j)] + if i == j { 1.0 } else { 0.0 }
        });
        self.factor = Cholesky::new(a);
        self.half_log_det = self
            .factor
            .as_ref()
            .map_or(0.0, |f| (0..n).map(|k| f.l_dirty()[(k, k)].ln()).sum());
    }

    /// Whitened columns with the metric's own after them.
    pub fn after<'a>(&'a self, columns: &'a [Vec<f64>]) -> Vec<&'a [f64]> {
        let all = columns.iter().chain(&self.columns);
        all.map(Vec::as_slice).collect()
    }

    /// The same without the tolerance of a mechanism that the model has: two of a kind, one of
    /// them linear, would make shapes that neither has.
    pub fn not_tolerating(self: &Arc<Self>, id: MechanismId) -> Arc<Self> {
        if !self.nuisance.tolerates.contains(&Some(id)) {
            return Arc::clone(self);
        }
        let mut out = Self::clone(self);
        for (k, own) in self.nuisance.tolerates.iter().enumerate() {
            if *own == Some(id) {
                out.nuisance.sd[k] = NOT_TOLERATED * self.nuisance.sd[k];
            }
        }
        out.factorise();
        Arc::new(out)
    }

    fn score(&self, whitened: &[f64]) -> DVector<f64> {
        let sd = &self.nuisance.sd;
        let plain = scores(&self.columns, whitened);
        DVector::from_fn(sd.len(), |k, _| sd[k] * plain[k])
    }

    /// Square of a whitened residual with the nuisance integrated out.
    pub fn square(&self, whitened: &[f64]) -> f64 {
        let b = self.score(whitened);
        let taken = self.factor.as_ref().map_or(0.0, |f| b.dot(&f.solve(&b)));
        dot(whitened, whitened) - taken
    }

    /// Most probable coefficients of the nuisance for a whitened residual.
    pub fn coefficients(&self, whitened: &[f64]) -> Vec<f64> {
        let b = self.score(whitened);
        match &self.factor {
            Some(f) => {
                let x = f.solve(&b);
                (0..b.len()).map(|k| x[k] * self.nuisance.sd[k]).collect()
            }
            None => vec![0.0; b.len()],
        }
    }

    /// `residual` less the nuisance with these coefficients.
    pub fn less(&self, residual: &[f64], coefficients: &[f64], used: &[bool]) -> Vec<f64> {
        let mut out = residual.to_vec();
        for (c, column) in coefficients.iter().zip(&self.nuisance.raw) {
            for (left, value) in out.iter_mut().zip(column) {
                *left -= c * value;
            }
        }
        for i in (0..out.len()).filter(|i| !used[*i]) {
            out[i] = residual[i];
        }
        out
    }

    /// Gives the shared swing another size, degrees.
    pub fn resize_swing(&mut self, size_deg: f64) {
        let hats = self.hats();
        self.nuisance.sd[..hats].fill(size_deg);
        self.factorise();
    }

    /// How many of the first columns are hats of the shared swing.
    pub fn hats(&self) -> usize {
        self.nuisance.hats
    }

    /// Log likelihood of a whitened residual, nats; `cleaned` is what the whitener was made with.
    pub fn log_likelihood(&self, whitened: &[f64], cleaned: &[f64]) -> f64 {
        self.nats_of_nothing(cleaned) - 0.5 * self.square(whitened)
    }

    /// The same of a residual of nothing.
    pub fn nats_of_nothing(&self, cleaned: &[f64]) -> f64 {
        let mut own = cleaned.to_vec();
        self.whitener.whiten_one(&mut own);
        self.whitener.log_likelihood + 0.5 * dot(&own, &own) - self.half_log_det
    }

    /// The size of the shared swing that the residual asks for, degrees.
    pub fn shared_swing_deg(&self, whitened: &[f64], logged: bool) -> f64 {
        let n = self.hats();
        let m = self.columns.len() - n;
        let mut gram = self.gram.view((0, 0), (n, n)).into_owned();
        let mut score = scores(&self.columns[..n], whitened);
        // What a mechanism with a name explains must not pass for swing.
        let cross = self.gram.view((0, n), (n, m)).into_owned();
        let sd = &self.nuisance.sd;
        let own = DMatrix::from_fn(m, m, |i, j| {
            self.gram[(n + i, n + j)] + if i == j { sd[n + i].powi(-2) } else { 0.0 }
        });
        let others = scores(&self.columns[n..], whitened);
        if let Some(chol) = Cholesky::new(own) {
            score -= &cross * chol.solve(&others);
            gram -= &cross * chol.solve(&cross.transpose());
        }
        let eigen = gram.symmetric_eigen();
        let along = eigen.eigenvectors.transpose() * score;
        let value = |size: f64| {
            let z = (size / SHARED_PRIOR.0).ln() / SHARED_PRIOR.1;
            let prior = if logged { -0.5 * z * z } else { 0.0 };
            (0..n).fold(prior, |sum, k| {
                let g = eigen.eigenvalues[k].max(0.0);
                let v = size * size;
                sum + 0.5 * along[k] * along[k] * v / (1.0 + v * g) - 0.5 * (1.0 + v * g).ln()
            })
        };
        let mut best = (f64::NEG_INFINITY, SHARED_PRIOR.0);
        for size in SIZES_DEG {
            if logged && size > SHARED_MOST_DEG {
                continue;
            }
            let v = value(size);
            if v > best.0 {
                best = (v, size);
            }
        }
        best.1
    }
}
