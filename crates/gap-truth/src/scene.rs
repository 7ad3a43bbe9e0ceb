//! The scene of a case: site, weather, source, what the scenario knows of them and how well,
//! and who flies where.

use std::f64::consts::PI;
use std::fmt::Write as _;

use rand::RngExt;
use rand::rngs::ChaCha8Rng;

use crate::law::{self, Troposphere};
use crate::random::{between, between_log, normal, pick, stream};
use crate::tracks::{self, PlumePoint, Reach, TrackKind};
use crate::wind::WindLaw;

/// What a scene must offer for an effect to show.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Need {
    /// Nothing special.
    Any,
    /// A plume near the ground.
    LowPlume,
    /// Tracks at very different distances.
    Distances,
    /// Tracks at very different heights, and a wind log of the site rather than of each platform.
    Heights,
    /// A logged wind.
    WindLog,
}

/// Whose wind is logged.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum LoggedWind {
    /// Each platform's, at its place and height.
    OnBoard,
    /// The site's, the same for all platforms.
    Site,
    /// None: the scenario's stands for the whole time.
    Absent,
}

/// A parameter that the scenario states with a prior, and how far off it is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PriorError {
    /// Dotted key in `[uncertain]`.
    pub key: &'static str,
    /// Prior standard deviation, in the key's unit.
    pub sd: f64,
    /// Truth minus the scenario's value, in standard deviations.
    pub off: f64,
}

/// Time between two points of a track, s.
pub const SUB_STEP_S: f64 = 0.25;
/// Tracks start this long before and end this long after the rows, s.
pub const MARGIN_S: f64 = 30.0;

/// A scene.
#[derive(Debug, Clone)]
pub struct Scene {
    /// Origin, degrees.
    pub origin_deg: (f64, f64),
    /// Ground, m above mean sea level.
    pub ground_amsl_m: f64,
    /// The source east and north of the origin, m.
    pub source_m: [f64; 2],
    /// Height of the axis above ground as the scenario says, m.
    pub axis_m: f64,
    /// Class number, 0 for A.
    pub class: usize,
    /// Wind at the axis as the scenario says it.
    pub wind: WindLaw,
    /// Height of the scenario's wind, m above ground.
    pub wind_height_agl_m: f64,
    /// Power law's exponent.
    pub wind_exponent: f64,
    /// Whose wind is logged.
    pub logged_wind: LoggedWind,
    /// The air.
    pub air: Troposphere,
    /// Emission as the scenario says, kg/s.
    pub emission_kg_s: f64,
    /// States c_max at this distance rather than the emission, m.
    pub c_max_at_m: Option<f64>,
    /// Background as the scenario says, ppm.
    pub background_ppm: f64,
    /// The sensors' time constant as the scenario says, s.
    pub lag_s: f64,
    /// The sensors' white noise as the scenario says, ppm.
    pub noise_sd_ppm: f64,
    /// Length of the rows, s.
    pub duration_s: f64,
    /// From row to row of a platform, s.
    pub row_step_s: usize,
    /// What the tracks see.
    pub reach: Reach,
    /// One track a platform, every [`SUB_STEP_S`], from -[`MARGIN_S`], in plume axes about the
    /// scenario's source and mean wind.
    pub tracks: Vec<Vec<PlumePoint>>,
    /// What is marked uncertain.
    pub uncertain: Vec<PriorError>,
}

impl Scene {
    /// The scene of `seed`, made so that what `needs` ask for is there; the keys of `certain`
    /// are not marked uncertain and are exactly as the scenario says.
    pub fn draw(seed: u64, needs: &[Need], certain: &[&str], least_platforms: usize) -> Self {
        Self::draw_with(seed, needs, certain, least_platforms, None)
    }

    /// The same with tracks that are all of one `kind`, if one is given.
    pub fn draw_with(
        seed: u64,
        needs: &[Need],
        certain: &[&str],
        least_platforms: usize,
        kind: Option<TrackKind>,
    ) -> Self {
        let mut rng = stream(seed, "scene");
        let tall = needs.contains(&Need::Heights);
        let reach = draw_reach(needs, &mut rng);
        let duration_s = pick(&mut rng, &[600.0, 600.0, 600.0, 900.0]);
        let platforms = rng.random_range(1..=6_usize).max(least_platforms);
        let team = kind.map(|kind| tracks::all_alike(kind, platforms));
        let tracks = draw_tracks(&reach, platforms, team, duration_s, &mut rng);
        let logged_wind = match rng.random_range(0..8) {
            _ if tall => pick(&mut rng, &[LoggedWind::Site, LoggedWind::Absent]),
            0 => LoggedWind::Site,
            1 if !needs.contains(&Need::WindLog) => LoggedWind::Absent,
            _ => LoggedWind::OnBoard,
        };
        let (class, axis_m, distance_m) = (reach.class as usize, reach.axis_m, reach.distance_m);
        let wind = draw_wind(seed, logged_wind);
        let air = Troposphere {
            temperature_c: between(&mut rng, 5.0, 25.0),
            pressure_hpa: between(&mut rng, 920.0, 1020.0),
        };
        // The strength is such that the axis at the geometric middle shows a clear plume.
        let middle = (distance_m.0 * distance_m.1).sqrt();
        let peak_ppm = between_log(&mut rng, 80.0, 450.0);
        let spread = law::sigma_y_m(class as f64, middle) * law::sigma_z_m(class as f64, middle);
        let emission_kg_s =
            peak_ppm / air.ppm_per_kg_m3(axis_m) * 2.0 * PI * wind.speed_m_s * spread;
        let stated_c_max = rng.random_bool(0.4)
            && !certain
                .iter()
                .any(|c| *c == "emission" || *c == "weather.wind_speed_m_s");
        let mut scene = Self {
            origin_deg: (
                between(&mut rng, -55.0, 60.0),
                between(&mut rng, -170.0, 170.0),
            ),
            ground_amsl_m: between(&mut rng, 0.0, 600.0),
            source_m: [
                between(&mut rng, -300.0, 300.0),
                between(&mut rng, -300.0, 300.0),
            ],
            axis_m,
            class,
            wind,
            wind_height_agl_m: pick(&mut rng, &[10.0, 100.0, axis_m.round()]),
            wind_exponent: pick(&mut rng, &[0.0, 0.12, 0.2]),
            logged_wind,
            air,
            emission_kg_s,
            c_max_at_m: stated_c_max.then_some(middle.round()),
            background_ppm: between(&mut rng, 410.0, 460.0),
            lag_s: pick(&mut rng, &[0.0, 1.0, 1.5, 3.0]),
            noise_sd_ppm: between(&mut rng, 0.8, 3.0),
            duration_s,
            row_step_s: 1,
            reach,
            tracks,
            uncertain: Vec::new(),
        };
        scene.uncertain = scene.draw_uncertain(seed, certain);
        scene
    }

    fn draw_uncertain(&self, seed: u64, certain: &[&str]) -> Vec<PriorError> {
        let mut rng = stream(seed, "uncertain");
        let strength = match self.c_max_at_m {
            Some(_) => ("source.c_max_ppm", self.c_max_ppm()),
            None => ("source.emission_kg_s", self.emission_kg_s),
        };
        let mut all = Vec::new();
        for (key, chance, sd) in [
            ("weather.wind_from_deg", 0.7, between(&mut rng, 1.0, 4.0)),
            (
                "source.effective_height_m",
                0.8,
                self.axis_m * between(&mut rng, 0.02, 0.06),
            ),
            (strength.0, 0.9, strength.1 * between(&mut rng, 0.1, 0.25)),
            ("background.co2_ppm", 0.9, between(&mut rng, 1.0, 4.0)),
        ] {
            // Drawn in any case, so that leaving one out does not change the others.
            let (here, off) = (rng.random_bool(chance), normal(&mut rng).clamp(-2.5, 2.5));
            let stated =
                certain.contains(&key) || (certain.contains(&"emission") && key == strength.0);
            if here && !stated {
                all.push(PriorError { key, sd, off });
            }
        }
        all
    }

    /// Truth minus the scenario's value of an uncertain key, in its unit; 0 for a certain one.
    pub fn off(&self, key: &str) -> f64 {
        let found = self.uncertain.iter().find(|u| u.key == key);
        found.map_or(0.0, |u| u.off * u.sd)
    }

    /// Emission in truth over that which the scenario states, before any effect.
    pub fn emission_ratio(&self) -> f64 {
        let by_emission = 1.0 + self.off("source.emission_kg_s") / self.emission_kg_s;
        let by_c_max = 1.0 + self.off("source.c_max_ppm") / self.c_max_ppm();
        by_emission * by_c_max
    }

    /// Concentration above background on the axis at the distance of c_max, ppm.
    pub fn c_max_ppm(&self) -> f64 {
        let x_m = self.c_max_at_m.unwrap_or(1000.0);
        let class = self.class as f64;
        let spread = law::sigma_y_m(class, x_m) * law::sigma_z_m(class, x_m);
        self.air.ppm_per_kg_m3(self.axis_m) * self.emission_kg_s
            / (2.0 * PI * self.wind.speed_m_s * spread)
    }

    /// Where platform `index` is at `time_s`.
    pub fn track_at(&self, index: usize, time_s: f64) -> PlumePoint {
        self.tracks[index][((time_s + MARGIN_S) / SUB_STEP_S).round() as usize]
    }

    /// Speed of the scenario's wind at its reference height, m/s.
    fn reference_speed_m_s(&self) -> f64 {
        self.wind.speed_m_s * self.height_factor(self.wind_height_agl_m)
    }

    /// Wind speed at `z_m` above ground over that at the axis.
    pub fn height_factor(&self, z_m: f64) -> f64 {
        (z_m.max(1.0) / self.axis_m).powf(self.wind_exponent)
    }

    /// Metres east and north of the origin of a place in plume axes.
    pub fn east_north_m(&self, point: &PlumePoint) -> [f64; 2] {
        let (sin, cos) = self.wind.from_deg.to_radians().sin_cos();
        // Downwind is (-sin, -cos); to its right is (-cos, sin).
        [
            self.source_m[0] - sin * point[0] - cos * point[1],
            self.source_m[1] - cos * point[0] + sin * point[1],
        ]
    }

    /// Latitude and longitude of a place by the ellipsoid's radii of curvature at the origin.
    pub fn lat_lon_deg(&self, east_north_m: [f64; 2]) -> (f64, f64) {
        let (lat0, lon0) = self.origin_deg;
        let (a, e_sq) = (6_378_137.0, 6.694_379_990_14e-3);
        let w = |lat: f64| (1.0 - e_sq * lat.to_radians().sin().powi(2)).sqrt();
        let meridional = |lat: f64| a * (1.0 - e_sq) / w(lat).powi(3);
        // Once more with the radius at the middle of the way north.
        let rough = lat0 + (east_north_m[1] / meridional(lat0)).to_degrees();
        let mut lat = lat0 + (east_north_m[1] / meridional(0.5 * (lat0 + rough))).to_degrees();
        // A line due east in the tangent plane leaves the parallel towards the equator.
        let normal = a / w(lat0);
        lat -= (east_north_m[0].powi(2) * lat0.to_radians().tan()
            / (2.0 * normal * meridional(lat0)))
        .to_degrees();
        let lon = lon0 + (east_north_m[0] / (a / w(lat) * lat.to_radians().cos())).to_degrees();
        (lat, lon)
    }

    /// The scenario as text.
    pub fn to_toml(&self) -> String {
        let (lat, lon) = self.lat_lon_deg(self.source_m);
        let mut t = String::new();
        // Writing into a String cannot fail.
        let _ = write!(
            t,
            "[site]\nlat_deg = {:.8}\nlon_deg = {:.8}\nground_amsl_m = {:.2}\n\n\
             [weather]\nwind_speed_m_s = {:.4}\nwind_height_agl_m = {:.1}\nwind_from_deg = {:.3}\n\
             wind_exponent = {}\nstability = \"{}\"\nsetting = \"rural\"\ntemperature_c = {:.3}\n\
             pressure_hpa = {:.3}\n\n\
             [[source]]\nname = \"stack\"\ngas = \"co2\"\nlat_deg = {lat:.8}\nlon_deg = {lon:.8}\n\
             stack_height_m = {:.2}\neffective_height_m = {:.3}\n",
            self.origin_deg.0,
            self.origin_deg.1,
            self.ground_amsl_m,
            self.reference_speed_m_s(),
            self.wind_height_agl_m,
            self.wind.from_deg,
            self.wind_exponent,
            ["A", "B", "C", "D", "E", "F"][self.class],
            self.air.temperature_c,
            self.air.pressure_hpa,
            self.axis_m * 0.7,
            self.axis_m,
        );
        let _ = match self.c_max_at_m {
            Some(x) => write!(
                t,
                "c_max_ppm = {:.4}\nc_max_distance_m = {x:.1}\n",
                self.c_max_ppm()
            ),
            None => writeln!(t, "emission_kg_s = {:.5}", self.emission_kg_s),
        };
        let _ = write!(
            t,
            "\n[background]\nco2_ppm = {:.3}\n\n[sensor]\ntime_constant_s = {}\n\
             noise_sd_ppm = {:.3}\n\n[uncertain]\n",
            self.background_ppm, self.lag_s, self.noise_sd_ppm,
        );
        for u in &self.uncertain {
            let _ = writeln!(t, "\"{}\" = {:.5}", u.key, u.sd);
        }
        t
    }
}

/// What the tracks are to see: a low plume and far tracks where they are needed.
fn draw_reach(needs: &[Need], rng: &mut ChaCha8Rng) -> Reach {
    let tall = needs.contains(&Need::Heights);
    let low = needs.contains(&Need::LowPlume) || (!tall && rng.random_bool(0.2));
    let class = if low {
        pick(rng, &[1, 2, 3])
    } else {
        pick(rng, &[1, 2, 3, 3, 4])
    };
    let axis_m = if low {
        between(rng, 35.0, 90.0)
    } else {
        between(rng, 140.0, 480.0)
    };
    let distance_m = if needs.contains(&Need::Distances) || low {
        (between(rng, 250.0, 400.0), between(rng, 2800.0, 3800.0))
    } else {
        (between(rng, 500.0, 800.0), between(rng, 1600.0, 3200.0))
    };
    let floor = if low { 15.0 } else { 40.0 };
    Reach {
        class: f64::from(class),
        axis_m,
        distance_m,
        height_m: (floor, axis_m + 400.0),
        sigmas_up: if tall { 1.6 } else { between(rng, 0.8, 1.5) },
    }
}

fn draw_tracks(
    reach: &Reach,
    platforms: usize,
    team: Option<Vec<TrackKind>>,
    duration_s: f64,
    rng: &mut ChaCha8Rng,
) -> Vec<Vec<PlumePoint>> {
    let speed = pick(rng, &[16.0, 18.0, 20.0]);
    let whole_s = duration_s + 2.0 * MARGIN_S;
    let count = (whole_s / SUB_STEP_S) as usize + 2;
    team.unwrap_or_else(|| tracks::team(platforms, rng))
        .into_iter()
        .map(|kind| {
            let corners = tracks::corners(kind, reach, speed * whole_s * 1.05, rng);
            tracks::fly(&corners, speed, SUB_STEP_S, count)
        })
        .collect()
}

fn draw_wind(seed: u64, logged: LoggedWind) -> WindLaw {
    let mut rng = stream(seed, "weather");
    let unlogged = logged == LoggedWind::Absent;
    let slow_sd = if unlogged {
        between(&mut rng, 0.3, 0.8)
    } else {
        between(&mut rng, 0.8, 3.0)
    };
    let speed_gust_sd = if unlogged {
        0.02
    } else {
        between(&mut rng, 0.02, 0.06)
    };
    WindLaw {
        speed_m_s: between(&mut rng, 4.0, 11.0),
        from_deg: between(&mut rng, 0.0, 360.0),
        slow_meander: (slow_sd, between(&mut rng, 500.0, 1500.0)),
        direction_gust: (between(&mut rng, 0.3, 0.9), between(&mut rng, 20.0, 60.0)),
        speed_gust: (speed_gust_sd, between(&mut rng, 60.0, 300.0)),
        unlogged_oscillation: None,
        unlogged_wander: None,
        drift_deg_per_h: 0.0,
    }
}

/// The wind of a scene as turbulence makes it: swings of some degrees that last about a minute, and
/// surges. It is logged, or nobody could know.
pub(crate) fn make_gusty(scene: &mut Scene, seed: u64) {
    swing(scene, (2.0, 6.0), (20.0, 120.0), &mut stream(seed, "gusty"));
    if scene.logged_wind == LoggedWind::Absent {
        scene.logged_wind = LoggedWind::OnBoard;
    }
}

/// The same as the weather makes it: swings of some degrees that last for minutes. Nobody logs it.
pub(crate) fn make_unlogged(scene: &mut Scene, seed: u64) {
    swing(
        scene,
        (3.0, 8.0),
        (100.0, 400.0),
        &mut stream(seed, "unlogged"),
    );
    scene.logged_wind = LoggedWind::Absent;
}

/// Swings and surges with standard deviations and lasting times from these ranges.
fn swing(scene: &mut Scene, deg: (f64, f64), lasts_s: (f64, f64), rng: &mut ChaCha8Rng) {
    scene.wind.direction_gust = (
        between(rng, deg.0, deg.1),
        between(rng, lasts_s.0, lasts_s.1),
    );
    scene.wind.speed_gust = (between(rng, 0.03, 0.15), between(rng, lasts_s.0, lasts_s.1));
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn plume_axes_follow_the_wind() {
        let mut scene = Scene::draw(5, &[Need::Any], &[], 1);
        scene.wind.from_deg = 270.0;
        scene.source_m = [0.0, 0.0];
        let p = scene.east_north_m(&[100.0, 10.0, 0.0]);
        // West wind: downwind is east, to the right of that is south.
        assert!(
            (p[0] - 100.0).abs() < 1e-9 && (p[1] + 10.0).abs() < 1e-9,
            "{p:?}"
        );
    }

    // From the tangent plane's east and north by ECEF, done in Python with WGS84:
    // origin 43.4417 N, 7.8631 W; the foot of (3000, -2000) by Newton steps.
    #[test]
    fn places_agree_with_the_ellipsoid() {
        let mut scene = Scene::draw(5, &[Need::Any], &[], 1);
        scene.origin_deg = (43.4417, -7.8631);
        let (lat, lon) = scene.lat_lon_deg([3000.0, -2000.0]);
        let (want_lat, want_lon) = (43.423_692_4, -7.826_053_1);
        let metres = ((lat - want_lat) * 111_100.0).hypot((lon - want_lon) * 80_800.0);
        assert!(metres < 0.02, "{metres} m: {lat} {lon}");
    }

    #[test]
    fn certain_keys_stay_out() {
        for seed in 0..40 {
            let scene = Scene::draw(seed, &[Need::Any], &["emission", "background.co2_ppm"], 2);
            assert!((scene.emission_ratio() - 1.0).abs() < 1e-12);
            assert!(
                scene
                    .uncertain
                    .iter()
                    .all(|u| u.key != "background.co2_ppm")
            );
            assert!(scene.c_max_at_m.is_none() && scene.tracks.len() >= 2);
        }
    }
}
