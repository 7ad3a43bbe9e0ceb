//! Time from raw observations to the verdict.
#![allow(clippy::expect_used, missing_docs)]

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use gap::plume::{Options, Setup, analyse};
use plume::field::{DispersionModel, Place};
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
stability = "D"
[[source]]
lat_deg = 43.4417
lon_deg = -7.8631
stack_height_m = 200.0
effective_height_m = 300.0
emission_kg_s = 120.0
[sensor]
noise_sd_ppm = 1.0
[uncertain]
"source.emission_kg_s" = 20.0
"source.effective_height_m" = 10.0
"background.co2_ppm" = 2.0
"#;

/// Six platforms weaving across the plume, one reading a second each.
fn observations(setup: &Setup, seconds: usize) -> Observations {
    let world = DispersionModel::new(setup.base.clone()).expect("the base is a world");
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    let mut normal = move || -> f64 { StandardNormal.sample(&mut rng) };
    let mut rows = Vec::with_capacity(6 * seconds);
    for platform in 0..6 {
        let mut gust = 0.0;
        for t in 0..seconds {
            let time_s = t as f64;
            let phase = time_s * 18.0 / 1300.0 + 0.3 * platform as f64;
            let triangle = 4.0 * (phase - (phase + 0.5).floor()).abs() - 1.0;
            let at = air::geo::Enu::default()
                .displaced(70.0, 700.0 + 400.0 * platform as f64)
                .displaced(160.0, 320.0 * triangle);
            let height_agl_m = 300.0 + 40.0 * (time_s / 47.0).sin();
            let place = Place {
                east_m: at.east_m,
                north_m: at.north_m,
                height_agl_m,
            };
            gust = 0.85 * gust + 0.53 * normal();
            let mean = world.mean_ppm(&place, time_s);
            let back = setup.frame.to_geodetic(at);
            rows.push(ObservationRow {
                time_s,
                platform,
                lat_deg: back.lat_deg,
                lon_deg: back.lon_deg,
                alt_amsl_m: 340.0 + height_agl_m,
                co2_ppm: Some(mean + 0.12 * gust * (mean - setup.base.background_ppm) + normal()),
                wind_speed_m_s: Some(7.0 + 0.3 * normal()),
                wind_from_deg: Some(250.0 + 1.5 * normal()),
                temperature_c: Some(12.0 + 0.1 * normal()),
                relative_humidity_pct: Some(60.0 + normal()),
                pressure_hpa: Some(930.0 + 0.1 * normal()),
                sd_ppm: None,
                averaging_s: None,
                line_end: None,
                spread_s: 0.0,
            });
        }
    }
    let platforms = (1..=6).map(|k| format!("uav{k}")).collect();
    Observations {
        rows,
        platforms,
        ..Observations::default()
    }
}

fn verdict(c: &mut Criterion) {
    let setup = Setup::new(&Scenario::parse("bench", SCENARIO).expect("valid")).expect("valid");
    let mut group = c.benchmark_group("gap");
    group.sample_size(10);
    for seconds in [600, 3600, 16_667] {
        let observed = observations(&setup, seconds);
        group.throughput(Throughput::Elements(observed.rows.len() as u64));
        let options = Options {
            complete: false,
            ..Options::default()
        };
        group.bench_function(
            BenchmarkId::new("gate to verdict", observed.rows.len()),
            |b| {
                b.iter(|| analyse(&setup, &observed, &options, &mut |_| ()).expect("analysed"));
            },
        );
    }
    group.finish();
}

criterion_group!(benches, verdict);
criterion_main!(benches);
