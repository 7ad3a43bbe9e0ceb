//! What no base gets exactly right and no one should name: small departures that every fit
//! may take up at a price.
//!
//! The wind's error is shared by all platforms: hat functions in time along the derivative by
//! wind direction, with one size fitted to the data. Swings that no log resolves widen the mean
//! plume; spread, strength and logged places are right to a per cent or a metre only. Each is
//! a column with a normal prior, integrated over together with the free parameters.

use ::plume::mechanism::MechanismId;
use nalgebra::{Cholesky, DMatrix, DVector, Dyn};

use super::fit::Context;
use super::linear::dot;
use super::model::{Model, Part, Prediction};
use super::noise::{Loading, NoiseModel, Whitener};

/// Time between the knots of the shared swing, s, and most of them.
const KNOT_S: f64 = 12.0;
const MOST_KNOTS: f64 = 75.0;
/// Sizes tried for the shared swing, degrees.
const SIZES_DEG: [f64; 8] = [0.05, 0.1, 0.2, 0.35, 0.6, 1.0, 2.0, 4.0];
/// Median and logarithmic spread of the shared swing's prior, degrees.
const SHARED_PRIOR: (f64, f64) = (0.25, 0.7);
/// Largest shared swing where the wind is logged, degrees: more is a finding.
const SHARED_MOST_DEG: f64 = 1.0;

/// Swing at the very start, whose wind came before the record, degrees.
const EARLY_DEG: f64 = 1.0;

/// Mechanisms of which a little is always there: a step, and one standard deviation in steps.
const TOLERATED: [(MechanismId, usize, f64, f64); 7] = [
    // Unresolved swings: variance is linear in the square of the angle.
    (MechanismId::Meander, 0, 1.0, 1.5),
    (MechanismId::SigmaYScale, 0, 1.02, 1.5),
    (MechanismId::SigmaZScale, 0, 1.02, 1.0),
    (MechanismId::EmissionScale, 0, 1.02, 1.0),
    (MechanismId::PositionOffset, 0, 1.0, 1.0),
    (MechanismId::PositionOffset, 1, 1.0, 1.0),
    (MechanismId::AltitudeOffset, 0, 1.0, 0.6),
];

/// Columns before whitening, with the standard deviations of their coefficients.
#[derive(Debug, Clone)]
pub(crate) struct Nuisance {
    pub raw: Vec<Vec<f64>>,
    pub sd: Vec<f64>,
    /// Swing allowed at the hats of the shared swing, which stand first, because the wind before
    /// the record is not known, degrees.
    early_deg: Vec<f64>,
}

impl Nuisance {
    /// The columns at a model.
    pub fn new(
        ctx: &Context<'_>,
        model: &Model,
        prediction: &Prediction,
        loading: &[Loading],
        noise: &NoiseModel,
    ) -> Self {
        let mut raw = hats(ctx, loading);
        let hats = raw.len();
        let early_deg = early(ctx, hats);
        let mut sd: Vec<f64> = early_deg
            .iter()
            .map(|e| e.hypot(noise.shared_swing_deg))
            .collect();
        for (id, which, step, size) in TOLERATED {
            let mut moved = model.clone();
            let mut values = super::model::defaults(id);
            values[which] = step;
            moved.parts.push(Part {
                id,
                platform: None,
                values,
            });
            let mut column = ctx.readings(&moved);
            column
                .iter_mut()
                .zip(&prediction.reading)
                .for_each(|(c, r)| *c -= r);
            raw.push(column);
            sd.push(size);
        }
        Self { raw, sd, early_deg }
    }
}

impl Nuisance {
    /// Gives the shared swing another size, degrees.
    pub fn resize_swing(&mut self, size_deg: f64) {
        for (sd, early) in self.sd.iter_mut().zip(&self.early_deg) {
            *sd = early.hypot(size_deg);
        }
    }
}

/// What a plume that left its source before the record began may be off by at each hat: it fades
/// as the record comes to cover the plume's time on its way.
fn early(ctx: &Context<'_>, hats: usize) -> Vec<f64> {
    let (from, to) = ctx.data.span_s();
    let track = &ctx.data.track;
    let source = ctx.setup.base.sources[0].place;
    let n = track.len().max(1) as f64;
    let (mut distance, mut speed) = (0.0, 0.0);
    for i in 0..track.len() {
        let p = track.place(i);
        distance += (p.east_m - source.east_m).hypot(p.north_m - source.north_m) / n;
        speed += track.transport()[i].speed_m_s / n;
    }
    let way_s = distance / speed.max(0.5);
    (0..hats)
        .map(|k| {
            let since = (to - from) * k as f64 / (hats - 1).max(1) as f64;
            EARLY_DEG * (1.0 - since / way_s).max(0.0)
        })
        .collect()
}

fn hats(ctx: &Context<'_>, loading: &[Loading]) -> Vec<Vec<f64>> {
    let (from, to) = ctx.data.span_s();
    let intervals = ((to - from) / KNOT_S).clamp(3.0, MOST_KNOTS).floor();
    let width = ((to - from) / intervals).max(1e-9);
    let mut out = vec![vec![0.0; loading.len()]; intervals as usize + 1];
    for (i, t) in ctx.data.track.time_s().iter().enumerate() {
        let place = ((t - from) / width).clamp(0.0, intervals);
        let k = (place as usize).min(out.len() - 2);
        let part = place - k as f64;
        out[k][i] = (1.0 - part) * loading[i].swing;
        out[k + 1][i] = part * loading[i].swing;
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
    half_log_det: f64,
}

impl Metric {
    pub fn new(whitener: Whitener, nuisance: Nuisance) -> Self {
        let mut columns = nuisance.raw.clone();
        let mut views: Vec<&mut [f64]> = columns.iter_mut().map(Vec::as_mut_slice).collect();
        whitener.whiten(&mut views);
        let n = columns.len();
        let mut gram = DMatrix::<f64>::zeros(n, n);
        for i in 0..n {
            for j in 0..=i {
                gram[(i, j)] = dot(&columns[i], &columns[j]);
                gram[(j, i)] = gram[(i, j)];
            }
        }
        let sd = &nuisance.sd;
        let a = DMatrix::from_fn(n, n, |i, j| {
            sd[i] * sd[j] * gram[(i, j)] + if i == j { 1.0 } else { 0.0 }
        });
        let factor = Cholesky::new(a);
        let half_log_det = factor
            .as_ref()
            .map_or(0.0, |f| (0..n).map(|k| f.l_dirty()[(k, k)].ln()).sum());
        Self {
            whitener,
            nuisance,
            columns,
            gram,
            factor,
            half_log_det,
        }
    }

    fn score(&self, whitened: &[f64]) -> DVector<f64> {
        DVector::from_fn(self.columns.len(), |k, _| {
            self.nuisance.sd[k] * dot(&self.columns[k], whitened)
        })
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

    /// `residual` less the most probable nuisance.
    pub fn cleaned(&self, residual: &[f64], used: &[bool]) -> Vec<f64> {
        let mut whitened = residual.to_vec();
        self.whitener.whiten_one(&mut whitened);
        let coefficients = self.coefficients(&whitened);
        let mut out = residual.to_vec();
        for (c, column) in coefficients.iter().zip(&self.nuisance.raw) {
            for i in 0..out.len() {
                if used[i] {
                    out[i] -= c * column[i];
                }
            }
        }
        out
    }

    /// Log likelihood of a whitened residual, nats; `cleaned` is what the whitener was made with.
    pub fn log_likelihood(&self, whitened: &[f64], cleaned: &[f64]) -> f64 {
        let mut own = cleaned.to_vec();
        self.whitener.whiten_one(&mut own);
        self.whitener.log_likelihood + 0.5 * dot(&own, &own)
            - 0.5 * self.square(whitened)
            - self.half_log_det
    }

    /// The size of the shared swing that the residual asks for, degrees.
    pub fn shared_swing_deg(&self, whitened: &[f64], logged: bool) -> f64 {
        let n = self.nuisance.early_deg.len();
        let mut gram = self.gram.view((0, 0), (n, n)).into_owned();
        let mut score = DVector::from_fn(n, |k, _| dot(&self.columns[k], whitened));
        // A constant offset is a mechanism with a name: where the wind is logged it must not
        // pass for swing. Where it is not, a wandering wind is no finding.
        let smooth = DMatrix::from_element(n, 1, 1.0);
        let lean = &gram * &smooth;
        let inverse = (smooth.transpose() * &lean).try_inverse();
        if let Some(inverse) = inverse.filter(|_| logged) {
            score -= &lean * (&inverse * (smooth.transpose() * &score));
            gram -= &lean * inverse * lean.transpose();
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
