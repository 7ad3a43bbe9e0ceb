//! Where sensors are: they climb and sink on the spot, circle up in a spiral, stand, or fly to and fro.

use super::{BEYOND, STEP_S, STEPS_PER_ROW, World};
use crate::random::{between, pick};
use rand::RngExt;
use rand::rngs::ChaCha8Rng;
use std::f64::consts::TAU;

/// Speeds of flight, along the ground and up, m/s.
const SPEED_M_S: f64 = 13.0;
const CLIMB_M_S: f64 = 3.0;
/// Lowest flight, m above ground.
const LOWEST_M: f64 = 8.0;

/// One to three sensors between two distances, each on a way of its own; never only such as stand.
pub(super) fn team(
    world: &World,
    near_m: f64,
    far_m: f64,
    rng: &mut ChaCha8Rng,
) -> Vec<Vec<[f64; 3]>> {
    let count = rng.random_range(1..=3);
    let of = |k: usize| {
        let x_m = between(rng, near_m, far_m);
        let (y_m, z_m) = world.spread_m(x_m);
        let up = |sigmas: f64| (world.axis_m + sigmas * z_m).max(LOWEST_M);
        let corners: Vec<[f64; 3]> = match if k == 0 {
            rng.random_range(0..3)
        } else {
            rng.random_range(0..4)
        } {
            // Profiles: up and down at places across the plume.
            0 => (0..200)
                .flat_map(|n| {
                    let at = [x_m, y_m * (((n * 2) % 7) as f64 - 3.0) * 0.5];
                    let ends = if n % 2 == 0 { [-1.5, 1.5] } else { [1.5, -1.5] };
                    ends.map(|e| [at[0], at[1], up(e)])
                })
                .collect(),
            // A spiral about a place near the axis, up and down.
            1 => {
                let (radius_m, middle_m) =
                    (between(rng, 0.8, 2.0) * y_m, between(rng, -0.7, 0.7) * y_m);
                (0..4000)
                    .map(|n| {
                        let (sin, cos) = (f64::from(n) / 16.0 * TAU).sin_cos();
                        let level = 1.5 * (f64::from(n) / 160.0 * TAU).sin();
                        [
                            x_m + radius_m.min(0.5 * x_m) * cos,
                            middle_m + radius_m * sin,
                            up(level),
                        ]
                    })
                    .collect()
            }
            // To and fro across, a little farther or nearer and at another height each time.
            2 => {
                let step = pick(rng, &[0.02, 0.05, 0.1]);
                (0..400)
                    .map(|n| {
                        let side = if n % 2 == 0 { 3.0 } else { -3.0 };
                        let part = (f64::from(n) * step / 2.0).rem_euclid(2.0);
                        let x = near_m + (1.0 - (1.0 - part).abs()) * (far_m - near_m);
                        let (y, z) = world.spread_m(x);
                        let level = f64::from((n / 2 * 3) % 5) * 0.6 - 1.2;
                        [
                            x,
                            side * y + 20.0 * side,
                            (world.axis_m + level * z).max(LOWEST_M),
                        ]
                    })
                    .collect()
            }
            _ => vec![[
                x_m,
                between(rng, -1.2, 1.2) * y_m,
                up(between(rng, -1.0, 1.0)),
            ]],
        };
        flown(&corners, world.rows * STEPS_PER_ROW)
    };
    (0..count).map(of).collect()
}

/// A place at every step on the way from corner to corner, which takes the longer of its two ways.
fn flown(corners: &[[f64; 3]], steps: usize) -> Vec<[f64; 3]> {
    let mut out = vec![corners[0]];
    for ends in corners.windows(2) {
        let [a, b] = [ends[0], ends[1]];
        let along_s = (b[0] - a[0]).hypot(b[1] - a[1]) / SPEED_M_S;
        let takes = (along_s.max((b[2] - a[2]).abs() / CLIMB_M_S) / STEP_S).ceil() as usize;
        out.extend((1..=takes).map(|n| {
            let part = n as f64 / takes as f64;
            [0, 1, 2].map(|k| a[k] + part * (b[k] - a[k]))
        }));
        if out.len() > steps {
            break;
        }
    }
    let last = out[out.len() - 1];
    out.resize(steps, last);
    out
}

impl World {
    /// How far puffs are followed, m.
    pub(super) fn farthest_m(&self) -> f64 {
        let places = self.tracks.iter().flatten();
        BEYOND * places.map(|p| p[0].hypot(p[1])).fold(0.0, f64::max)
    }
}
