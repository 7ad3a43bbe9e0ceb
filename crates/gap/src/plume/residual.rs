//! Where and when the misfit of a model lives: mean residuals in bins along each coordinate,
//! with their size in standard deviations of the noise model.

use super::fit::{Context, Fitted};
use super::linear::dot;
use crate::verdict::ResidualBin;

/// Distance along and across the wind (in σy) of every row from the first source.
pub(crate) fn wind_axes(ctx: &Context<'_>, fitted: &Fitted) -> (Vec<f64>, Vec<f64>) {
    let track = &ctx.data.track;
    let source = ctx.setup.base.sources[0].place;
    let world = fitted.model.world(&ctx.setup.base, track.platforms());
    (0..track.len())
        .map(|i| {
            let (p, w) = (track.place(i), track.transport()[i]);
            let (e, n) = (p.east_m - source.east_m, p.north_m - source.north_m);
            let along = e * w.east + n * w.north;
            let sigma = world
                .as_ref()
                .map_or(1.0, |w| w.sigmas_m(along.max(10.0)).0);
            (along, (e * w.north - n * w.east) / sigma)
        })
        .unzip()
}

/// Bins along time, across and along the wind, height, and of each platform.
pub(crate) fn bins(ctx: &Context<'_>, fitted: &Fitted) -> Vec<ResidualBin> {
    let (along, across) = wind_axes(ctx, fitted);
    let track = &ctx.data.track;
    let height: Vec<f64> = (0..track.len())
        .map(|i| track.place(i).height_agl_m)
        .collect();
    let mut out = Vec::new();
    for (coordinate, unit, at, count) in [
        ("time", "s", track.time_s(), 20),
        ("across_wind", "sigma_y", &across[..], 12),
        ("along_wind", "m", &along[..], 10),
        ("height", "m AGL", &height[..], 10),
    ] {
        out.extend(along_coordinate(ctx, fitted, coordinate, unit, at, count));
    }
    if track.platforms().len() > 1 {
        for (p, range) in ctx.data.ranges().iter().enumerate() {
            let inside: Vec<bool> = (0..track.len()).map(|i| range.contains(&i)).collect();
            let mut bin = bin(ctx, fitted, "platform", "", &inside, (p as f64, p as f64));
            bin.platform = Some(track.platforms()[p].clone());
            out.push(bin);
        }
    }
    out.retain(|b| b.count > 0);
    out
}

/// Bins with the same number of readings each.
fn along_coordinate(
    ctx: &Context<'_>,
    fitted: &Fitted,
    coordinate: &str,
    unit: &str,
    at: &[f64],
    count: usize,
) -> Vec<ResidualBin> {
    let mut used: Vec<f64> = (0..at.len())
        .filter(|i| ctx.data.used[*i])
        .map(|i| at[i])
        .collect();
    used.sort_by(f64::total_cmp);
    let edge = |k: usize| used[(k * (used.len() - 1)) / count];
    (0..count)
        .map(|k| {
            let (from, to) = (edge(k), edge(k + 1));
            let last = k + 1 == count;
            let inside: Vec<bool> = at
                .iter()
                .map(|v| *v >= from && (*v < to || (last && *v <= to)))
                .collect();
            bin(ctx, fitted, coordinate, unit, &inside, (from, to))
        })
        .collect()
}

fn bin(
    ctx: &Context<'_>,
    fitted: &Fitted,
    coordinate: &str,
    unit: &str,
    inside: &[bool],
    (from, to): (f64, f64),
) -> ResidualBin {
    let data = ctx.data;
    let residual = data.residual(&fitted.prediction.reading);
    let rows: Vec<usize> = (0..data.len())
        .filter(|i| inside[*i] && data.used[*i])
        .collect();
    let sum: f64 = rows.iter().map(|i| residual[*i]).sum();
    let mut column: Vec<f64> = inside.iter().map(|b| f64::from(u8::from(*b))).collect();
    fitted.metric.whitener.whiten_one(&mut column);
    let information = dot(&column, &column);
    ResidualBin {
        coordinate: coordinate.to_string(),
        platform: None,
        from,
        to,
        unit: unit.to_string(),
        count: rows.len(),
        mean_ppm: sum / rows.len().max(1) as f64,
        standardised: dot(&column, &fitted.residual) / information.sqrt().max(1e-12),
    }
}
