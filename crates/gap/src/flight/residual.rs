//! Where the misfit of the base lives: mean standardised innovations by time, airspeed and angle
//! of attack, channel by channel.

use super::channel::{ALL, at};
use super::study::{Linear, Study};
use crate::verdict::ResidualBin;

/// Bins of a coordinate.
const BINS: usize = 20;

/// Fewest innovations of a bin.
const FEWEST: usize = 20;
/// Channels that are told.
const TOLD: [usize; 7] = [
    at::AIRSPEED,
    at::ALPHA,
    at::ROLL_RATE,
    at::ROLL_RATE + 1,
    at::ROLL_RATE + 2,
    at::FORCE,
    at::FORCE + 2,
];

/// The bins of every channel that was read often.
pub fn bins(study: &Study<'_>, first: &Linear) -> Vec<ResidualBin> {
    let passes = study.passes(&first.theta, &first.noise);
    // Time, airspeed and innovations, sample by sample.
    let flown = study.gated.segments.iter().zip(&passes);
    let samples: Vec<_> = flown
        .flat_map(|(s, pass)| {
            (0..s.len()).map(|i| {
                (
                    [s.time_s[i], s.measured[i][at::AIRSPEED]],
                    &pass.standardised[i],
                )
            })
        })
        .collect();
    let mut out = Vec::new();
    for c in TOLD {
        for (k, coordinate) in [("time", "s"), ("airspeed", "m/s")].into_iter().enumerate() {
            let points = samples.iter().map(|(x, nu)| (x[k], nu[c]));
            let points: Vec<(f64, f64)> = points
                .filter(|(x, nu)| x.is_finite() && nu.is_finite())
                .collect();
            out.extend(binned(&points, c, coordinate));
        }
    }
    out
}

fn binned(
    points: &[(f64, f64)],
    channel: usize,
    (coordinate, unit): (&str, &str),
) -> impl Iterator<Item = ResidualBin> {
    let low = points.iter().map(|p| p.0).fold(f64::MAX, f64::min);
    let high = points.iter().map(|p| p.0).fold(f64::MIN, f64::max);
    let width = (high - low) / BINS as f64;
    (0..BINS).filter_map(move |k| {
        let (from, to) = (low + k as f64 * width, low + (k + 1) as f64 * width);
        let inside = points.iter().filter(|p| (from..to).contains(&p.0));
        let (count, sum) = inside.fold((0, 0.0), |(n, sum), p| (n + 1, sum + p.1));
        (count > FEWEST).then(|| ResidualBin {
            coordinate: coordinate.to_owned(),
            platform: Some(ALL[channel].label.to_owned()),
            from,
            to,
            unit: unit.to_owned(),
            count,
            mean_ppm: f64::NAN,
            standardised: sum / (count as f64).sqrt(),
        })
    })
}
