//! How visible an effect is here: D, nats, by the moments of many realisations of the same turbulence.
//!
//! Means and variances of readings come from realisations other than the one that is shown. D is half the sum of
//! squares of the difference that the effect makes to the mean readings, over the variance of turbulence and sensor,
//! less what the scenario's uncertain keys and each sensor's own zero take up. Readings that scatter together count as
//! so many fewer.

use super::effects::{self, Changes};
use super::{World, sensors};
use crate::case::{CaseSpec, HiddenEffect};
use crate::linear;
use crate::visibility::Tuned;

/// Realisations of which moments are taken.
const REALISATIONS: u64 = 8;
/// Trials for a strength, the part of the wanted D by which what is reached may differ, and the most strength.
const TRIALS: usize = 5;
const WITHIN: f64 = 0.3;
const STRONGEST: f64 = 60.0;

/// Mean readings of a platform's rows, and the variance that turbulence gives them.
struct Moments {
    mean: Vec<f64>,
    variance: Vec<f64>,
}

/// The highest mean excess that any platform meets, ppm.
pub(super) fn peak_ppm(world: &World) -> f64 {
    let own = moments(world, &Changes::none(world));
    let highest = own.mean.iter().copied().fold(0.0, f64::max);
    (highest - world.background_ppm).max(5.0)
}

fn moments(world: &World, changes: &Changes) -> Moments {
    let all: Vec<Vec<f64>> = (1..=REALISATIONS)
        .map(|r| {
            let excess = world.excess_ppm(changes, r);
            let of = |(p, e): (usize, &Vec<f64>)| sensors::mean_ppm(world, changes, p, e);
            excess.iter().enumerate().flat_map(of).collect()
        })
        .collect();
    let n = REALISATIONS as f64;
    let mean: Vec<f64> = (0..all[0].len())
        .map(|i| all.iter().map(|a| a[i]).sum::<f64>() / n)
        .collect();
    let square = |i: usize| all.iter().map(|a| (a[i] - mean[i]).powi(2)).sum::<f64>() / (n - 1.0);
    let variance: Vec<f64> = (0..mean.len()).map(square).collect();
    // Rows that follow each other scatter together.
    let next: f64 = all
        .iter()
        .map(|a| {
            (1..mean.len())
                .map(|i| (a[i] - mean[i]) * (a[i - 1] - mean[i - 1]))
                .sum::<f64>()
        })
        .sum();
    let own: f64 = variance.iter().sum::<f64>() * (n - 1.0);
    let alike = (next / own.max(1e-12)).clamp(0.0, 0.95);
    let widened = (1.0 + alike) / (1.0 - alike);
    Moments {
        variance: variance.into_iter().map(|v| v * widened).collect(),
        mean,
    }
}

/// D of the effect `which` beside the others.
fn nats(world: &World, hidden: &[HiddenEffect], which: usize, peak_ppm: f64) -> f64 {
    let mut others = hidden.to_vec();
    others[which].strength = 0.0;
    let with = moments(world, &effects::hide(world, hidden, peak_ppm).0);
    let base = effects::hide(world, &others, peak_ppm).0;
    let without = moments(world, &base);
    let sensor = world.sensor.white_ppm.powi(2) + world.sensor.step_ppm.powi(2) / 12.0;
    let variance = |i: usize| 0.5 * (with.variance[i] + without.variance[i]) + sensor;
    let less = |a: &[f64], step: f64| -> Vec<f64> {
        a.iter()
            .zip(&without.mean)
            .map(|(a, b)| (a - b) / step)
            .collect()
    };
    let rows = without.mean.len() / world.tracks.len();
    let mut columns: Vec<(Vec<f64>, f64)> = Vec::new();
    for (key, sd, _) in &world.uncertain {
        let mut moved = base.clone();
        let step = match *key {
            "weather.wind_from_deg" => {
                moved.turn_deg += 0.3;
                0.3
            }
            "source.effective_height_m" => {
                moved.rise_m += 1.0;
                1.0
            }
            "background.co2_ppm" => {
                moved.level_ppm += 1.0;
                1.0
            }
            _ => {
                moved.ln_emission += 0.1;
                0.1 * world.emission_kg_s
            }
        };
        columns.push((less(&moments(world, &moved).mean, step), *sd));
    }
    // A zero that walks for the whole record is known to about its walk.
    let walk = world.sensor.walk_ppm_per_root_h * (world.rows as f64 / 3600.0).sqrt();
    for p in 0..world.tracks.len() {
        let own = |i: usize| f64::from(i / rows == p);
        columns.push(((0..without.mean.len()).map(own).collect(), walk));
        let slope = |i: usize| own(i) * ((i % rows) as f64 / rows as f64 - 0.5);
        columns.push(((0..without.mean.len()).map(slope).collect(), walk));
    }
    let change = less(&with.mean, 1.0);
    let inner =
        |a: &[f64], b: &[f64]| -> f64 { (0..a.len()).map(|i| a[i] * b[i] / variance(i)).sum() };
    let normal: Vec<Vec<f64>> = (0..columns.len())
        .map(|i| {
            let of = |j: usize| {
                inner(&columns[i].0, &columns[j].0)
                    + f64::from(u8::from(i == j)) / columns[i].1.powi(2)
            };
            (0..columns.len()).map(of).collect()
        })
        .collect();
    let right: Vec<f64> = columns.iter().map(|c| inner(&c.0, &change)).collect();
    let taken = linear::solve(&normal, &right)
        .map_or(0.0, |x| x.iter().zip(&right).map(|(a, b)| a * b).sum());
    0.5 * (inner(&change, &change) - taken).max(0.0)
}

/// `spec` with strengths that make each effect about as visible beside the others as wanted; none where the scene does
/// not show one so strongly.
pub fn tuned(spec: &CaseSpec, wanted: &[f64]) -> Option<Tuned> {
    let world = World::draw(spec);
    let peak_ppm = peak_ppm(&world);
    let mut spec = spec.clone();
    for (hidden, wanted) in spec.hidden.iter_mut().zip(wanted) {
        hidden.strength = 2.0 * (wanted / 20.0).sqrt();
    }
    let near = |nats: f64, wanted: f64| (nats / wanted - 1.0).abs() < WITHIN;
    for (which, &target) in wanted.iter().enumerate() {
        for _ in 0..TRIALS {
            let reached = nats(&world, &spec.hidden, which, peak_ppm);
            if near(reached, target) {
                break;
            }
            let factor = (target / reached.max(1e-3)).sqrt().clamp(0.25, 4.0);
            spec.hidden[which].strength *= factor;
            if spec.hidden[which].strength > STRONGEST {
                return None;
            }
        }
    }
    let all: Vec<f64> = (0..wanted.len())
        .map(|which| nats(&world, &spec.hidden, which, peak_ppm))
        .collect();
    let is_seen = all.iter().zip(wanted).all(|(n, w)| {
        if wanted.len() > 1 {
            *n > 20.0
        } else {
            near(*n, *w)
        }
    });
    is_seen.then_some(Tuned { spec, nats: all })
}
