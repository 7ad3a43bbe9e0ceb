//! The plume at a million points, class D, one thread: the batch kernel, the plain version, and
//! in the same run the same formula in C and numpy (`benches/peers/`), which are left out with a
//! word where gcc or python3 with numpy are missing.
#![allow(missing_docs, clippy::expect_used)]

use std::process::Command;
use std::time::{Duration, Instant};

use air::geo::Enu;
use air::isa::Atmosphere;
use air::wind::WindProfile;
use criterion::{Criterion, Throughput, criterion_group};
use plume::sigma::Setting;
use plume::stability::Stability;
use plume::{
    DispersionModel, DispersionSpec, Gas, Place, PlaceColumns, SensorSpec, SourceSpec, Strength,
};

const POINTS: usize = 1_000_000;
const AXIS_M: f64 = 486.0;

fn world() -> DispersionModel {
    DispersionModel::new(DispersionSpec {
        ground_amsl_m: 340.0,
        atmosphere: Atmosphere::standard(),
        wind: WindProfile::new(7.0, AXIS_M, 270.0, 0.0).expect("a wind"),
        stability: Stability::D,
        setting: Setting::Rural,
        ground_reflection: false,
        mixing_height_m: None,
        lid_edge_m: 0.0,
        background_ppm: 449.0,
        sources: vec![SourceSpec {
            name: "stack".into(),
            gas: Gas::Co2,
            place: Enu::default(),
            area: None,
            stack_height_m: 356.0,
            effective_height_agl_m: AXIS_M,
            schedule: None,
            strength: Strength::CMax {
                excess_ppm: 410.0,
                distance_m: 2400.0,
            },
        }],
        sigma_y_scale: 1.0,
        sigma_z_scale: 1.0,
        mechanisms: Vec::new(),
        sensor: SensorSpec::default(),
    })
    .expect("a world")
}

/// The same points as the peers have: 100 to 5000 m downwind, ±600 m across, ±300 m in height.
fn points() -> [Vec<f64>; 3] {
    let column = |factor: u64, low: f64, width: f64| -> Vec<f64> {
        let part = |i: u64| ((i * factor) % POINTS as u64) as f64 / POINTS as f64;
        (0..POINTS as u64).map(|i| low + width * part(i)).collect()
    };
    [
        column(7919, 100.0, 4900.0),
        column(104_729, -600.0, 1200.0),
        column(15_485_863, AXIS_M - 300.0, 600.0),
    ]
}

fn columns(points: &[Vec<f64>; 3]) -> PlaceColumns<'_> {
    PlaceColumns {
        east_m: &points[0],
        north_m: &points[1],
        height_agl_m: &points[2],
    }
}

fn plume(c: &mut Criterion) {
    let (world, points) = (world(), points());
    let mut out = Vec::new();
    let mut group = c.benchmark_group("plume at 1,000,000 points");
    group.throughput(Throughput::Elements(POINTS as u64));
    group.sample_size(30);
    group.bench_function("batch", |b| {
        b.iter(|| world.fill_mean_ppm(columns(&points), 0.0, &mut out));
    });
    group.bench_function("plain", |b| {
        b.iter(|| {
            for (i, value) in out.iter_mut().enumerate() {
                let place = Place {
                    east_m: points[0][i],
                    north_m: points[1][i],
                    height_agl_m: points[2][i],
                };
                *value = world.mean_ppm(&place, 0.0);
            }
        });
    });
    group.finish();
}

/// Best and median of 60 runs of the batch kernel, ms, measured as the peers measure themselves.
fn batch_ms() -> (f64, f64) {
    let (world, points) = (world(), points());
    let mut out = Vec::new();
    let mut times: Vec<Duration> = (0..60)
        .map(|_| {
            let start = Instant::now();
            world
                .fill_mean_ppm(columns(&points), 0.0, &mut out)
                .expect("columns of one length");
            start.elapsed()
        })
        .collect();
    times.sort();
    let ms = |t: Duration| t.as_secs_f64() * 1e3;
    (ms(times[0]), ms(times[30]))
}

/// Best and median of a peer, ms, from the first two words of its output.
fn peer_ms(command: &mut Command) -> Option<(f64, f64)> {
    let output = command.output().ok().filter(|o| o.status.success())?;
    let text = String::from_utf8(output.stdout).ok()?;
    let mut numbers = text.split_whitespace().map(str::parse::<f64>);
    Some((numbers.next()?.ok()?, numbers.next()?.ok()?))
}

fn c_ms(folder: &str) -> Option<(f64, f64)> {
    let program = std::env::temp_dir().join(format!("plume-peer-{}", std::process::id()));
    let source = format!("{folder}/plume.c");
    let built = Command::new("gcc")
        .args(["-O3", "-march=native", "-ffast-math", &source, "-o"])
        .arg(&program)
        .arg("-lm")
        .status();
    let figures = built
        .ok()
        .filter(|s| s.success())
        .and_then(|_| peer_ms(&mut Command::new(&program)));
    // What is left in the folder for temporary files does no harm.
    let _ = std::fs::remove_file(&program);
    figures
}

fn compare_with_peers() {
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../../benches/peers");
    let rows = [
        ("batch", Some(batch_ms())),
        ("C -O3 -march=native -ffast-math", c_ms(folder)),
        (
            "numpy",
            peer_ms(Command::new("python3").arg(format!("{folder}/plume.py"))),
        ),
    ];
    let own = rows[0].1.map_or(f64::NAN, |(_, median)| median);
    println!("\n1,000,000 points, class D, one thread: best and median, ms; median over batch's");
    for (name, figures) in rows {
        match figures {
            Some((best, median)) => {
                println!("{name:32} {best:8.3} {median:8.3} {:6.2}", median / own);
            }
            None => println!("{name:32} left out: it could not be built or run here"),
        }
    }
}

criterion_group!(benches, plume);

fn main() {
    benches();
    // `cargo test --benches` only tries whether a bench runs at all.
    if std::env::args().any(|arg| arg == "--bench") {
        compare_with_peers();
    }
}
