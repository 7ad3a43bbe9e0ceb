//! What a sensor makes of the air, and the file of it.

use super::effects::Changes;
use super::{STEP_S, STEPS_PER_ROW, World};
use crate::random::{between, between_log, normal, pick, stream};
use rand::rngs::ChaCha8Rng;
use std::fmt::Write as _;

/// A first-order sensor whose zero walks at random.
pub(super) struct Sensor {
    pub lag_s: f64,
    /// White noise as the scenario states it, ppm.
    pub white_ppm: f64,
    /// Standard deviation of the zero's walk in an hour, ppm.
    pub walk_ppm_per_root_h: f64,
    /// Step of the reading, ppm.
    pub step_ppm: f64,
}

/// Errors of logged wind of one row: direction, degrees, and speed, parts.
const WIND_LOG: (f64, f64) = (4.0, 0.08);

impl Sensor {
    pub fn draw(rng: &mut ChaCha8Rng) -> Self {
        Self {
            lag_s: pick(rng, &[0.0, 1.0, 2.0, 4.0]),
            white_ppm: between_log(rng, 0.4, 3.0),
            walk_ppm_per_root_h: between_log(rng, 0.3, 4.0),
            step_ppm: pick(rng, &[0.01, 0.1, 1.0]),
        }
    }
}

/// Readings of platform `p` without noise, one a row, ppm.
pub(super) fn mean_ppm(world: &World, changes: &Changes, p: usize, excess: &[f64]) -> Vec<f64> {
    let own = &changes.sensors[p];
    let lag_s = world.sensor.lag_s + own.lag_s;
    // Exact for air that changes in a straight line from step to step.
    let keep = (-STEP_S / lag_s.max(1e-6)).exp();
    let mean = (1.0 - keep) * lag_s / STEP_S;
    let air = |k: usize| {
        excess[k] + changes.background_ppm(world, &changes.seen_m(world, p, k), k as f64 * STEP_S)
    };
    let mut state = air(0);
    let of_step = |k: usize| {
        state = keep * state + (mean - keep) * air(k.saturating_sub(1)) + (1.0 - mean) * air(k);
        state
    };
    let shown: Vec<f64> = (0..excess.len()).map(of_step).collect();
    // A row has what the sensor read when a late clock says that it is now.
    let of_row = |row: usize| {
        let time_s = row as f64 - own.clock_s;
        let k = (time_s / STEP_S)
            .round()
            .clamp(0.0, shown.len() as f64 - 1.0) as usize;
        own.read_ppm(shown[k], time_s, world.background_ppm)
    };
    (0..world.rows).map(of_row).collect()
}

/// The observations, one row a second and platform.
pub(super) fn csv(world: &World, changes: &Changes, excess: &[Vec<f64>]) -> String {
    let wind = if world.has_wind_log {
        ",wind_speed_m_s,wind_from_deg"
    } else {
        ""
    };
    let mut csv = format!("time_s,platform,lat_deg,lon_deg,alt_amsl_m,co2_ppm{wind}\n");
    let turns = world.turns_deg();
    for (p, excess) in excess.iter().enumerate() {
        let mut rng = stream(world.seed, &format!("puffs/sensor {p}"));
        let white = world.sensor.white_ppm * between(&mut rng, 0.85, 1.15);
        let walk = world.sensor.walk_ppm_per_root_h / 60.0;
        let mut zero = 0.0;
        for (row, mean_ppm) in mean_ppm(world, changes, p, excess).into_iter().enumerate() {
            zero += walk * normal(&mut rng);
            let read = (mean_ppm + zero + white * normal(&mut rng)) / world.sensor.step_ppm;
            let (time_s, k) = (row as f64, row * STEPS_PER_ROW);
            let (lat, lon, alt) = world.logged_place(&world.tracks[p][k]);
            // Writing into a String cannot fail.
            let _ = write!(
                csv,
                "{time_s:.1},uav{},{lat:.7},{lon:.7},{alt:.2},{:.2}",
                p + 1,
                read.round() * world.sensor.step_ppm
            );
            if world.has_wind_log {
                let from = world.from_deg + turns[k] + WIND_LOG.0 * normal(&mut rng);
                let speed = world.speed_m_s * (1.0 + WIND_LOG.1 * normal(&mut rng));
                let _ = write!(csv, ",{:.2},{:.1}", speed.max(0.1), from.rem_euclid(360.0));
            }
            csv.push('\n');
        }
    }
    csv
}

impl World {
    /// East and north of a place in the plume's axes, m.
    pub(super) fn east_north(&self, [along, right]: [f64; 2]) -> [f64; 2] {
        let (sin, cos) = self.from_deg.to_radians().sin_cos();
        // Downwind is (-sin, -cos); to its right is (-cos, sin).
        [-sin * along - cos * right, -cos * along + sin * right]
    }

    /// Latitude, longitude and altitude that are logged of a place, by the ellipsoid's radii halfway.
    fn logged_place(&self, place_m: &[f64; 3]) -> (f64, f64, f64) {
        let [east_m, north_m] = self.east_north([place_m[0], place_m[1]]);
        let (lat0, lon0) = self.origin_deg;
        let bulge = |lat: f64| 1.0 - 6.694_38e-3 * lat.to_radians().sin().powi(2);
        let meridional_m = 6_378_137.0 * (1.0 - 6.694_38e-3) / bulge(lat0).powf(1.5);
        // A line due east in the tangent plane leaves the parallel towards the equator.
        let sag_m =
            east_m * east_m * lat0.to_radians().tan() / (2.0 * 6_378_137.0 / bulge(lat0).sqrt());
        let lat = lat0 + ((north_m - sag_m) / meridional_m).to_degrees();
        let parallel_m = 6_378_137.0 / bulge(lat).sqrt() * lat.to_radians().cos();
        let lon = lon0 + (east_m / parallel_m).to_degrees();
        (lat, lon, self.ground_amsl_m + place_m[2])
    }
}
