//! Small made cases: platforms that weave across a plume in a wandering wind. They share the forward
//! model with the finder. Whoever includes this has `Setup` and `Observations` in scope.

use super::{Observations, Setup};
use ::plume::field::{DispersionModel, Place};
use ::plume::{Mechanism, Sensor};
use air::geo::Enu;
use air::wind::WindProfile;
use rand::SeedableRng;
use rand::rngs::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use scenario::Scenario;
use scenario::observations::ObservationRow;

pub const SCENARIO: &str = r#"
[site]
lat_deg = 43.4417
lon_deg = -7.8631
ground_amsl_m = 340.0
[weather]
wind_speed_m_s = 7.0
wind_height_agl_m = 300.0
wind_from_deg = 250.0
wind_exponent = 0.0
stability = "D"
[[source]]
lat_deg = 43.4417
lon_deg = -7.8631
stack_height_m = 200.0
effective_height_m = 300.0
emission_kg_s = 120.0
[background]
co2_ppm = 449.0
[sensor]
noise_sd_ppm = 1.0
[uncertain]
"source.emission_kg_s" = 20.0
"source.effective_height_m" = 10.0
"background.co2_ppm" = 2.0
"#;

pub fn setup() -> Setup {
    setup_with("")
}

/// The same with more text at the scenario's end, which is in `[uncertain]`.
pub fn setup_with(uncertain: &str) -> Setup {
    let text = format!("{SCENARIO}{uncertain}");
    Setup::new(&Scenario::parse("test.toml", &text).unwrap()).unwrap()
}

pub fn normal(rng: &mut ChaCha8Rng) -> f64 {
    StandardNormal.sample(rng)
}

/// A hidden mechanism: id, parameters, platforms (none for all).
pub type Hidden<'a> = (&'a str, &'a [(&'a str, f64)], &'a [&'a str]);

/// Three platforms weaving across the plume for ten minutes in a wandering wind, logged by all.
pub fn observe(mechanisms: &[Hidden<'_>], seed: u64) -> Observations {
    observe_in(mechanisms, seed, 0.6)
}

/// The same in a wind that turns by this much from second to second, degrees.
pub fn observe_in(mechanisms: &[Hidden<'_>], seed: u64, turns_deg: f64) -> Observations {
    let setup = setup();
    let mut spec = setup.base.clone();
    for (id, p, platforms) in mechanisms {
        let names: Vec<String> = platforms.iter().map(|s| s.to_string()).collect();
        spec.mechanisms
            .push(Mechanism::new(id, p).unwrap().for_platforms(&names));
    }
    let in_wind = |wind| {
        let mut spec = spec.clone();
        spec.wind = wind;
        DispersionModel::new(spec).unwrap()
    };
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut wind = vec![0.0f64; 600];
    for t in 1..600 {
        wind[t] = 0.97 * wind[t - 1] + turns_deg * normal(&mut rng);
    }
    let names = ["a", "b", "c"];
    let mut rows = Vec::new();
    for (p, name) in names.iter().enumerate() {
        let mut sensor = Sensor::new(&spec.sensor, &spec.mechanisms, name);
        let (mut slow, mut gust) = (normal(&mut rng), normal(&mut rng));
        for (t, swing) in wind.iter().enumerate() {
            let time_s = t as f64;
            let phase = time_s * 18.0 / 1300.0 + p as f64 * 0.3;
            let triangle = 4.0 * (phase - (phase + 0.5).floor()).abs() - 1.0;
            let x = 900.0 + 600.0 * p as f64;
            let at = Enu::default()
                .displaced(70.0, x)
                .displaced(160.0, 320.0 * triangle);
            let height_agl_m = 300.0 + 40.0 * (time_s / 47.0 + p as f64).sin();
            let place = Place {
                east_m: at.east_m,
                north_m: at.north_m,
                height_agl_m,
            };
            let now = WindProfile::new(7.0, 300.0, 250.0 + swing, 0.0).unwrap();
            slow = 0.97 * slow + 0.24 * normal(&mut rng);
            gust = 0.85 * gust + 0.53 * normal(&mut rng);
            let mean = in_wind(now).mean_ppm(&place, time_s);
            let turbulent = mean + 0.12 * gust * (mean - 449.0);
            let dt = if t == 0 { 0.0 } else { 1.0 };
            let read = sensor.read(turbulent, dt, &mut rng) + 0.4 * slow;
            let back = setup.frame.to_geodetic(at);
            rows.push(ObservationRow {
                time_s,
                platform: p,
                lat_deg: back.lat_deg,
                lon_deg: back.lon_deg,
                alt_amsl_m: 340.0 + height_agl_m,
                co2_ppm: Some(read),
                wind_speed_m_s: Some(7.0 + 0.3 * normal(&mut rng)),
                wind_from_deg: Some(250.0 + swing + 1.5 * normal(&mut rng)),
                ..ObservationRow::default()
            });
        }
    }
    Observations {
        rows,
        platforms: names.iter().map(|n| n.to_string()).collect(),
        ..Observations::default()
    }
}
