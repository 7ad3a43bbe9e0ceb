//! Where a mixing lid may be. Close above the plume it leaves out readings one by one as it comes
//! down, which has no slope that leads to its height: it is looked for height by height.

use ::plume::mechanism::MechanismId;
use nalgebra::DMatrix;

use super::candidate::{Start, single};
use super::fit::{Context, Fitted};
use super::linear::{dot, gram, marginal, scores};
use super::model::Model;

/// Heights above the axis that are tried first, in sigma z at the farthest reading.
const ABOVE_AXIS: [f64; 12] = [0.05, 0.1, 0.2, 0.3, 0.4, 0.6, 0.8, 1.0, 1.3, 1.6, 1.9, 2.6];
/// What a lid may lose beside the right one, nats.
const MOST_LOST_NATS: f64 = -10.0;
/// By what part of it the plume below a lid may be stronger or weaker.
const STRENGTH_SD: f64 = 0.5;
/// How many of them are looked around, and at how many heights on either side.
const LOOKED_AROUND: usize = 2;
const ON_EITHER_SIDE: usize = 5;

/// Lids at several heights above the axis.
pub(crate) fn starts(ctx: &Context<'_>, model: &Model) -> Vec<Start> {
    let Some(world) = model.world(&ctx.setup.base, ctx.data.track.platforms()) else {
        return Vec::new();
    };
    let source = &ctx.setup.base.sources[0];
    let axis_m = source.effective_height_agl_m;
    let far_m = ctx.data.farthest_m(source.place).max(100.0);
    let sigma_z_m = world.sigmas_m(far_m).1;
    ABOVE_AXIS
        .iter()
        .map(|k| at((axis_m + k * sigma_z_m).clamp(10.0, 10_000.0)))
        .collect()
}

fn at(height_m: f64) -> Start {
    single(MechanismId::MixingLid, height_m)
}

/// The lids that are worth a fit, the best first, of `starts` with their whitened `columns`: they
/// gain `least_nats` as a whole.
pub(crate) fn worth_a_fit(
    ctx: &Context<'_>,
    null: &Fitted,
    starts: &[Start],
    columns: &[&[f64]],
    least_nats: f64,
) -> Vec<Start> {
    let gain = Gain::new(null);
    let mut rough: Vec<(f64, usize)> = columns
        .iter()
        .enumerate()
        .filter(|(_, column)| 0.5 * dot(column, column) > least_nats)
        .map(|(k, column)| (gain.of(column), k))
        .filter(|(gained, _)| *gained > MOST_LOST_NATS)
        .collect();
    rough.sort_by(|a, b| b.0.total_cmp(&a.0));
    let mut out: Vec<(f64, Start)> = rough
        .iter()
        .take(LOOKED_AROUND)
        .filter_map(|(_, k)| around(ctx, null, &gain, starts, *k))
        .filter(|(gained, _)| *gained > least_nats)
        .collect();
    out.sort_by(|a, b| b.0.total_cmp(&a.0));
    // Two neighbours may lead to one lid.
    let height_m = |lid: &(f64, Start)| lid.1.ends[0][0];
    out.dedup_by(|b, a| (height_m(a) - height_m(b)).abs() < 1e-6 * height_m(a));
    out.into_iter().map(|(_, start)| start).collect()
}

/// The best lid between the two neighbours of start `k`, and what it gains, nats.
fn around(
    ctx: &Context<'_>,
    null: &Fitted,
    gain: &Gain<'_>,
    starts: &[Start],
    k: usize,
) -> Option<(f64, Start)> {
    let height_m = |k: usize| starts[k].ends[0][0];
    let (own, below) = (height_m(k), height_m(k.saturating_sub(1)));
    let above = height_m((k + 1).min(starts.len() - 1));
    let n = ON_EITHER_SIDE;
    let part = |j: usize| j as f64 / n as f64;
    let mut near: Vec<Start> = (1..n)
        .map(|j| at(below + part(j) * (own - below)))
        .collect();
    near.extend((0..n).map(|j| at(own + part(j) * (above - own))));
    let mut columns: Vec<Vec<f64>> = near
        .iter()
        .map(|s| s.column(ctx, &null.model, &null.prediction, 0))
        .collect();
    let mut views: Vec<&mut [f64]> = columns.iter_mut().map(Vec::as_mut_slice).collect();
    null.metric.whitener.whiten(&mut views);
    let gained = columns.iter().map(|c| gain.of(c));
    gained.zip(near).max_by(|a, b| a.0.total_cmp(&b.0))
}

/// What lids gain as a whole, with the null's columns at their best beside them and the plume
/// below the lid stronger or weaker than without.
struct Gain<'a> {
    null: &'a Fitted,
    gram: DMatrix<f64>,
    /// The plume without a lid, whitened.
    plume: Vec<f64>,
    before: f64,
}

impl<'a> Gain<'a> {
    fn new(null: &'a Fitted) -> Self {
        let mut plume = null.prediction.plume.clone();
        null.metric.whitener.whiten_one(&mut plume);
        let gram = gram(&null.columns());
        let own = scores(&null.columns(), &null.residual);
        let known = marginal(&gram, &own, &null.centre, &null.precision).unwrap_or(f64::INFINITY);
        Self {
            null,
            gram,
            plume,
            before: known - 0.5 * dot(&null.residual, &null.residual),
        }
    }

    /// Nats that a lid gains which changes the readings, whitened, by `change`.
    fn of(&self, change: &[f64]) -> f64 {
        let pairs = |a: &[f64], f: fn((&f64, &f64)) -> f64| -> Vec<f64> {
            a.iter().zip(change).map(f).collect()
        };
        let left = pairs(&self.null.residual, |(r, c)| r - c);
        let below = pairs(&self.plume, |(p, c)| p + c);
        let mut columns = self.null.columns();
        columns.push(&below);
        let n = self.gram.nrows();
        let beside = scores(&columns, &below);
        let mut gram = self.gram.clone().resize(n + 1, n + 1, 0.0);
        gram.set_column(n, &beside);
        gram.set_row(n, &beside.transpose());
        let centre = self.null.centre.clone().push(0.0);
        let precision = self.null.precision.clone().push(STRENGTH_SD.powi(-2));
        marginal(&gram, &scores(&columns, &left), &centre, &precision)
            .map_or(f64::NEG_INFINITY, |known| {
                known - STRENGTH_SD.ln() - 0.5 * dot(&left, &left) - self.before
            })
    }
}
