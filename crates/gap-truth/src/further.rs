//! One more flight after those of a case: the same air, source and instruments, later.

use crate::scene::{MARGIN_S, SUB_STEP_S, Scene};
use crate::tracks::PlumePoint;

/// Where one platform flies after its own track.
#[derive(Debug, Clone, PartialEq)]
pub struct FurtherFlight {
    /// The platform's name.
    pub platform: String,
    /// Time in s, latitude and longitude in degrees, and height above mean sea level in m of
    /// each corner; straight and steady in between.
    pub waypoints: Vec<TrackWaypoint>,
}

/// A corner of a flight.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TrackWaypoint {
    /// When, s.
    pub time_s: f64,
    /// Latitude, degrees.
    pub lat_deg: f64,
    /// Longitude, degrees.
    pub lon_deg: f64,
    /// Height above mean sea level, m.
    pub alt_amsl_m: f64,
}

impl FurtherFlight {
    /// When its readings begin, s.
    pub fn start_s(&self) -> f64 {
        self.waypoints.first().map_or(0.0, |w| w.time_s)
    }

    fn end_s(&self) -> f64 {
        self.waypoints.last().map_or(0.0, |w| w.time_s)
    }

    /// `scene` with its record prolonged: platform `index` flies on, the others hold.
    pub fn prolong(&self, scene: &mut Scene, index: usize) {
        scene.duration_s = self.end_s().floor().max(scene.duration_s);
        let count = ((scene.duration_s + 2.0 * MARGIN_S) / SUB_STEP_S) as usize + 2;
        let corners: Vec<(f64, PlumePoint)> = self
            .waypoints
            .iter()
            .map(|w| (w.time_s, plume_point(scene, w)))
            .collect();
        for (k, track) in scene.tracks.iter_mut().enumerate() {
            let Some(&last) = track.last() else { continue };
            let left_s = track.len() as f64 * SUB_STEP_S - MARGIN_S;
            let mut corners = corners.clone();
            corners.insert(0, (left_s.min(self.start_s() - SUB_STEP_S), last));
            while track.len() < count {
                let time_s = track.len() as f64 * SUB_STEP_S - MARGIN_S;
                track.push(if k == index {
                    at(&corners, time_s)
                } else {
                    last
                });
            }
        }
    }
}

/// The place at `time_s` on the way from corner to corner.
fn at(corners: &[(f64, PlumePoint)], time_s: f64) -> PlumePoint {
    let next = corners
        .partition_point(|c| c.0 <= time_s)
        .clamp(1, corners.len() - 1);
    let ((t0, a), (t1, b)) = (corners[next - 1], corners[next]);
    let share = ((time_s - t0) / (t1 - t0).max(1e-9)).clamp(0.0, 1.0);
    [0, 1, 2].map(|k| a[k] + share * (b[k] - a[k]))
}

/// A corner in plume axes, by Newton steps on the scene's own way to latitude and longitude.
fn plume_point(scene: &Scene, w: &TrackWaypoint) -> PlumePoint {
    const STEP_M: f64 = 10.0;
    let mut east_north = [0.0, 0.0];
    for _ in 0..4 {
        let here = scene.lat_lon_deg(east_north);
        let east = scene.lat_lon_deg([east_north[0] + STEP_M, east_north[1]]);
        let north = scene.lat_lon_deg([east_north[0], east_north[1] + STEP_M]);
        let (a, b) = (east.0 - here.0, north.0 - here.0);
        let (c, d) = (east.1 - here.1, north.1 - here.1);
        let (lat, lon) = (w.lat_deg - here.0, w.lon_deg - here.1);
        let det = a * d - b * c;
        east_north[0] += STEP_M * (lat * d - lon * b) / det;
        east_north[1] += STEP_M * (lon * a - lat * c) / det;
    }
    let (sin, cos) = scene.wind.from_deg.to_radians().sin_cos();
    let (e, n) = (
        east_north[0] - scene.source_m[0],
        east_north[1] - scene.source_m[1],
    );
    [
        -sin * e - cos * n,
        -cos * e + sin * n,
        w.alt_amsl_m - scene.ground_amsl_m,
    ]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::Need;

    #[test]
    fn corners_come_back_in_plume_axes() {
        let scene = Scene::draw(11, &[Need::Any], &[], 1);
        let point = [1200.0, -340.0, 180.0];
        let (lat_deg, lon_deg) = scene.lat_lon_deg(scene.east_north_m(&point));
        let corner = TrackWaypoint {
            time_s: 0.0,
            lat_deg,
            lon_deg,
            alt_amsl_m: 180.0 + scene.ground_amsl_m,
        };
        let back = plume_point(&scene, &corner);
        for k in 0..3 {
            assert!((back[k] - point[k]).abs() < 1e-3, "{back:?}");
        }
    }

    #[test]
    fn a_platform_flies_on_from_where_it_was() {
        let mut scene = Scene::draw(11, &[Need::Any], &[], 2);
        let before = scene.tracks.clone();
        let (lat_deg, lon_deg) = scene.lat_lon_deg(scene.east_north_m(&[900.0, 0.0, 0.0]));
        let start_s = scene.duration_s + 60.0;
        let corner = |time_s: f64| TrackWaypoint {
            time_s,
            lat_deg,
            lon_deg,
            alt_amsl_m: 200.0 + scene.ground_amsl_m,
        };
        let flight = FurtherFlight {
            platform: "uav2".to_owned(),
            waypoints: vec![corner(start_s), corner(start_s + 100.0)],
        };
        flight.prolong(&mut scene, 1);
        assert_eq!(scene.tracks[1][..before[1].len()], before[1][..]);
        let there = ((start_s + 50.0 + MARGIN_S) / SUB_STEP_S) as usize;
        assert!((scene.tracks[1][there][0] - 900.0).abs() < 1e-3);
        assert_eq!(scene.tracks[0].last(), before[0].last());
    }
}
