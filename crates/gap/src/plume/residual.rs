//! Where and when the misfit of a model lives: mean residuals in bins along each coordinate, with
//! their size in standard deviations of the noise model.

use infer::FittedSet;

use super::Study;
use super::model::PlumeModel;
use crate::verdict::ResidualBin;

/// Distance along and across the wind (in σy) of every row from the first source.
pub(crate) fn wind_axes(study: &Study<'_>) -> (Vec<f64>, Vec<f64>) {
    let model = &study.base.model;
    let track = model.track();
    let source = study.setup.base.sources[0].place;
    let world = model.world(study.base.at()).ok();
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

/// The misfit of a set.
struct Misfit<'a, 'b> {
    study: &'a Study<'b>,
    of: &'a FittedSet<PlumeModel<'b>>,
    whitened: Vec<f64>,
}

/// Bins along time, across and along the wind, height, and of each platform.
pub(crate) fn bins(study: &Study<'_>) -> Vec<ResidualBin> {
    let (along, across) = wind_axes(study);
    let track = &study.data.track;
    let height: Vec<f64> = (0..track.len())
        .map(|i| track.place(i).height_agl_m)
        .collect();
    let of = &study.base;
    let misfit = Misfit {
        study,
        whitened: study.question.whitened(of, &of.fit().misfit),
        of,
    };
    let mut out = Vec::new();
    for (coordinate, unit, at, count) in [
        ("time", "s", track.time_s(), 20),
        ("across_wind", "sigma_y", &across[..], 12),
        ("along_wind", "m", &along[..], 10),
        ("height", "m AGL", &height[..], 10),
    ] {
        out.extend(misfit.along_coordinate(coordinate, unit, at, count));
    }
    if track.platforms().len() > 1 {
        for (p, range) in study.data.ranges().iter().enumerate() {
            let inside: Vec<bool> = (0..track.len()).map(|i| range.contains(&i)).collect();
            let mut bin = misfit.bin("platform", "", &inside, (p as f64, p as f64));
            bin.platform = Some(track.platforms()[p].clone());
            out.push(bin);
        }
    }
    out.retain(|b| b.count > 0);
    out
}

impl Misfit<'_, '_> {
    /// Bins with the same number of readings each.
    fn along_coordinate(
        &self,
        coordinate: &str,
        unit: &str,
        at: &[f64],
        count: usize,
    ) -> Vec<ResidualBin> {
        let used = &self.study.data.used;
        let mut values: Vec<f64> = (0..at.len()).filter(|i| used[*i]).map(|i| at[i]).collect();
        values.sort_by(f64::total_cmp);
        let edge = |k: usize| values[(k * (values.len() - 1)) / count];
        (0..count)
            .map(|k| {
                let (from, to) = (edge(k), edge(k + 1));
                let last = k + 1 == count;
                let inside: Vec<bool> = at
                    .iter()
                    .map(|v| *v >= from && (*v < to || (last && *v <= to)))
                    .collect();
                self.bin(coordinate, unit, &inside, (from, to))
            })
            .collect()
    }

    fn bin(
        &self,
        coordinate: &str,
        unit: &str,
        inside: &[bool],
        (from, to): (f64, f64),
    ) -> ResidualBin {
        let used = &self.study.data.used;
        let rows: Vec<usize> = (0..inside.len())
            .filter(|i| inside[*i] && used[*i])
            .collect();
        let misfit = &self.of.fit().misfit;
        let sum: f64 = rows.iter().map(|i| misfit[*i]).sum();
        let column: Vec<f64> = inside.iter().map(|b| f64::from(u8::from(*b))).collect();
        let column = self.study.question.whitened(self.of, &column);
        let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
        ResidualBin {
            coordinate: coordinate.to_string(),
            platform: None,
            from,
            to,
            unit: unit.to_string(),
            count: rows.len(),
            mean_ppm: sum / rows.len().max(1) as f64,
            standardised: dot(&column, &self.whitened) / dot(&column, &column).sqrt().max(1e-12),
        }
    }
}
