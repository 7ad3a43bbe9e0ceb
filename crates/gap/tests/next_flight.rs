//! The next flight of the whole analysis on small made cases.

#![allow(clippy::unwrap_used, reason = "a test may fail by a panic")]

use ::plume::field::{DispersionModel, Place};
use ::plume::{Mechanism, Sensor};
use air::geo::{Enu, Geodetic};
use air::wind::WindProfile;
use gap::plume::{Options, Setup, analyse};
use gap::verdict::{GapJson, NextFlight, Verdict};
use rand::SeedableRng;
use rand::rngs::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use scenario::Scenario;
use scenario::observations::{ObservationRow, Observations};

const SCENARIO: &str = r#"
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

fn setup() -> Setup {
    Setup::new(&Scenario::parse("test.toml", SCENARIO).unwrap()).unwrap()
}

fn normal(rng: &mut ChaCha8Rng) -> f64 {
    StandardNormal.sample(rng)
}

/// A hidden mechanism: id, parameters, platforms (none for all).
type Hidden<'a> = (&'a str, &'a [(&'a str, f64)], &'a [&'a str]);

/// Three platforms weaving across the plume for ten minutes in a wandering wind, logged by all.
fn observe(mechanisms: &[Hidden<'_>], seed: u64) -> Observations {
    observe_in(mechanisms, seed, 0.6)
}

/// The same in a wind that turns by this much from second to second, degrees.
fn observe_in(mechanisms: &[Hidden<'_>], seed: u64, turns_deg: f64) -> Observations {
    let setup = setup();
    let mut spec = setup.base.clone();
    for (id, p, platforms) in mechanisms {
        let names: Vec<String> = platforms.iter().map(|s| s.to_string()).collect();
        spec.mechanisms
            .push(Mechanism::new(id, p).unwrap().for_platforms(&names));
    }
    let world = DispersionModel::new(spec.clone()).unwrap();
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
            let mean = world.mean_ppm_in(&place, time_s, &now);
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
                temperature_c: None,
                relative_humidity_pct: None,
                pressure_hpa: None,
                sd_ppm: None,
            });
        }
    }
    Observations {
        rows,
        platforms: names.iter().map(|n| n.to_string()).collect(),
        ..Observations::default()
    }
}

/// The rows that platform "a" logs on its way along the waypoints, in the wind of the scenario.
fn flown(next: &NextFlight, (id, p): (&str, &[(&str, f64)]), seed: u64) -> Vec<ObservationRow> {
    let setup = setup();
    let mut spec = setup.base.clone();
    spec.mechanisms.push(Mechanism::new(id, p).unwrap());
    let world = DispersionModel::new(spec.clone()).unwrap();
    let mut sensor = Sensor::new(&spec.sensor, &spec.mechanisms, "a");
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut gust = normal(&mut rng);
    let wind = WindProfile::new(7.0, 300.0, 250.0, 0.0).unwrap();
    let mut rows = Vec::new();
    for leg in next.waypoints.windows(2) {
        let (from, to) = (&leg[0], &leg[1]);
        let seconds = (to.time_s - from.time_s).floor() as usize;
        for k in 0..seconds {
            let part = k as f64 / (to.time_s - from.time_s);
            let between = |a: f64, b: f64| a + part * (b - a);
            let lat_deg = between(from.lat_deg, to.lat_deg);
            let lon_deg = between(from.lon_deg, to.lon_deg);
            let alt_amsl_m = between(from.alt_amsl_m, to.alt_amsl_m);
            let at = setup.frame.to_enu(Geodetic { lat_deg, lon_deg });
            let place = Place {
                east_m: at.east_m,
                north_m: at.north_m,
                height_agl_m: alt_amsl_m - 340.0,
            };
            let time_s = from.time_s + k as f64;
            gust = 0.85 * gust + 0.53 * normal(&mut rng);
            let mean = world.mean_ppm_in(&place, time_s, &wind);
            let turbulent = mean + 0.12 * gust * (mean - 449.0);
            rows.push(ObservationRow {
                time_s,
                platform: 0,
                lat_deg,
                lon_deg,
                alt_amsl_m,
                co2_ppm: Some(sensor.read(turbulent, 1.0, &mut rng)),
                wind_speed_m_s: Some(7.0 + 0.3 * normal(&mut rng)),
                wind_from_deg: Some(250.0 + 1.5 * normal(&mut rng)),
                temperature_c: None,
                relative_humidity_pct: None,
                pressure_hpa: None,
                sd_ppm: None,
            });
        }
    }
    rows
}

fn run(observations: &Observations, complete: bool) -> GapJson {
    let options = Options {
        complete,
        ..Options::default()
    };
    let found = analyse(&setup(), observations, &options, &mut |_| ());
    found.unwrap().json
}

/// By how much the first of two mechanisms, alone, explains more than the second does.
fn odds_nats(json: &GapJson, of: &[String]) -> f64 {
    let alone = |id: &String| {
        let sets = json.ranking.iter();
        let own = sets.filter(|r| r.mechanisms.len() == 1 && r.mechanisms[0] == *id);
        own.map(|r| r.log_evidence)
            .fold(f64::NEG_INFINITY, f64::max)
    };
    alone(&of[0]) - alone(&of[1])
}

// Meander widens the plume by an angle, a factor on σy by a part: near the source they differ little.
#[test]
#[ignore = "not reached: the rival named after the flight is the other one; needs a rate over many draws"]
fn an_ambiguous_answer_proposes_a_flight_that_keeps_its_promise() {
    let hidden = ("sigma-y-scale", &[("factor", 1.5)][..]);
    let mut o = observe(&[(hidden.0, hidden.1, &[])], 20);
    let before = run(&o, true);
    assert_eq!(before.verdict, Verdict::Ambiguous, "{}", before.summary);
    let next = before.next_flight.clone().unwrap();
    assert_eq!(next.separates, before.causes[0].mechanisms);
    assert!(next.expected_nats > 0.0 && next.settles_probability > 0.5);
    assert!(next.waypoints[0].time_s > 600.0);
    let times = next.waypoints.windows(2).map(|w| w[1].time_s - w[0].time_s);
    assert!(next.waypoints.len() > 2 && times.clone().all(|s| s > 0.0));
    o.rows.extend(flown(&next, hidden, 1));
    let after = run(&o, false);
    // What it promised is a normal law with mean m and variance 2 m.
    let shift = odds_nats(&after, &next.separates) - odds_nats(&before, &next.separates);
    let off = (shift - next.expected_nats).abs() / (2.0 * next.expected_nats).sqrt();
    println!("{} nats promised, {shift} flown", next.expected_nats);
    assert!(
        off < 3.0,
        "{} {shift} {}",
        next.expected_nats,
        after.summary
    );
}

#[test]
fn what_is_light_proposes_none() {
    let o = observe(&[("sigma-y-scale", &[("factor", 1.5)], &[])], 20);
    let light = run(&o, false);
    assert_eq!(light.verdict, Verdict::Ambiguous, "{}", light.summary);
    assert!(light.next_flight.is_none());
}
