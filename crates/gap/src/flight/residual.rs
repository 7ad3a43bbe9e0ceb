//! Where the misfit of the base lives: mean standardised innovations by time, airspeed and angle
//! of attack, channel by channel.

use super::channel::{ALL, at};
use super::study::{Linear, Study};
use crate::verdict::ResidualBin;

/// Bins of a coordinate.
const BINS: usize = 20;

/// The bins of every channel that was read often.
pub fn bins(study: &Study<'_>, first: &Linear) -> Vec<ResidualBin> {
    let passes = study.passes(&first.theta, &first.noise);
    let mut out = Vec::new();
    for c in [
        at::AIRSPEED,
        at::ALPHA,
        at::ROLL_RATE,
        at::ROLL_RATE + 1,
        at::ROLL_RATE + 2,
        at::FORCE,
        at::FORCE + 2,
    ] {
        for (coordinate, unit, of) in [("time", "s", None), ("airspeed", "m/s", Some(at::AIRSPEED))]
        {
            let mut points = Vec::new();
            for (segment, pass) in study.gated.segments.iter().zip(&passes) {
                for (i, nu) in pass.standardised.iter().enumerate() {
                    let x = of.map_or(segment.time_s[i], |k| segment.measured[i][k]);
                    if nu[c].is_finite() && x.is_finite() {
                        points.push((x, nu[c]));
                    }
                }
            }
            out.extend(binned(&points, c, coordinate, unit));
        }
    }
    out
}

fn binned(points: &[(f64, f64)], channel: usize, coordinate: &str, unit: &str) -> Vec<ResidualBin> {
    let low = points.iter().map(|p| p.0).fold(f64::MAX, f64::min);
    let high = points.iter().map(|p| p.0).fold(f64::MIN, f64::max);
    let width = (high - low) / BINS as f64;
    (0..BINS)
        .filter_map(|k| {
            let (from, to) = (low + k as f64 * width, low + (k + 1) as f64 * width);
            let inside: Vec<f64> = points
                .iter()
                .filter(|p| p.0 >= from && p.0 < to)
                .map(|p| p.1)
                .collect();
            let n = inside.len();
            (n > 20).then(|| ResidualBin {
                coordinate: coordinate.to_owned(),
                platform: Some(ALL[channel].label.to_owned()),
                from,
                to,
                unit: unit.to_owned(),
                count: n,
                mean_ppm: f64::NAN,
                standardised: inside.iter().sum::<f64>() / (n as f64).sqrt(),
            })
        })
        .collect()
}
