//! One step of each search strategy with 100,000 samples in the archive, and what adding a
//! sample costs on average.
#![allow(missing_docs, clippy::expect_used)]

use criterion::{BatchSize, Criterion, criterion_group, criterion_main};
use csea::Sampler;
use csea::{Archive, ArchiveOptions, CsEaOptions, Domain, Position, STRATEGIES, Sample};
use rand::rngs::ChaCha8Rng;
use rand::{RngExt, SeedableRng};

#[path = "../crates/csea/tests/common/mod.rs"]
#[allow(clippy::unwrap_used)]
mod common;

const SAMPLES: usize = 100_000;
const TEAM: usize = 6;

fn team() -> [Sampler; TEAM] {
    let of = |id: usize| Sampler {
        id,
        position: Position::new(2000.0, 100.0 * id as f64, 500.0),
        heading_deg: 0.0,
        speed_m_s: 18.0,
        turn_radius_m: 60.0,
        climb_m_s: 3.0,
    };
    std::array::from_fn(of)
}

fn domain() -> Domain {
    Domain::of_box(
        Position::new(-3000.0, -3000.0, 300.0),
        Position::new(3000.0, 3000.0, 700.0),
    )
    .expect("a box")
}

/// Samples as six vehicles leave them: straight legs at 18 m/s, ten a second.
fn track(count: usize) -> Vec<Sample> {
    let mut rng = ChaCha8Rng::seed_from_u64(7);
    let domain = domain();
    let mut out = Vec::with_capacity(count);
    let (mut from, mut to) = (domain.draw(&mut rng), domain.draw(&mut rng));
    let mut gone = 0.0;
    while out.len() < count {
        let length = from.at.distance_m(to.at).max(1.0);
        gone += 1.8 / length;
        if gone >= 1.0 {
            (from, to, gone) = (to, domain.draw(&mut rng), 0.0);
        }
        let mix = |a: f64, b: f64| a + gone * (b - a);
        let position = Position::new(
            mix(from.at.east_m, to.at.east_m),
            mix(from.at.north_m, to.at.north_m),
            mix(from.height_m, to.height_m),
        );
        let noise: f64 = rng.random();
        let value =
            449.0 + 400.0 * (-position.at.distance_m(Position::default().at) / 500.0).exp() + noise;
        out.push(Sample { position, value });
    }
    out
}

fn filled(cell_m: Option<f64>, samples: &[Sample]) -> Archive {
    let options = ArchiveOptions {
        cell_m,
        ..ArchiveOptions::default()
    };
    let mut archive = Archive::new(options).expect("options");
    for &sample in samples {
        archive.push(sample).expect("finite");
    }
    archive
}

fn steps(c: &mut Criterion) {
    let samples = track(SAMPLES);
    let archive = filled(None, &samples);
    assert_eq!(archive.len(), SAMPLES);
    let mut group = c.benchmark_group("step with 100,000 samples");
    for name in STRATEGIES {
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        let options = CsEaOptions::default();
        let mut strategy =
            csea::strategy_by_name(name, domain(), options, &common::prior(180.0), &mut rng)
                .expect("known");
        for (k, sample) in samples.iter().enumerate() {
            strategy.sense(k as f64 / 60.0, k % TEAM, sample, &mut rng);
        }
        group.bench_function(name, |b| {
            b.iter(|| {
                strategy.step(&archive, &mut rng);
                team().map(|s| strategy.direct(&s, 45.0, &mut rng))
            });
        });
    }
    group.finish();
}

fn filling(c: &mut Criterion) {
    let samples = track(SAMPLES);
    let mut group = c.benchmark_group("fill with 100,000 samples");
    group.sample_size(10);
    for (name, cell_m) in [("every sample", None), ("20 m cells", Some(20.0))] {
        group.bench_function(name, |b| {
            b.iter_batched(|| (), |()| filled(cell_m, &samples), BatchSize::LargeInput);
        });
    }
    group.finish();
}

criterion_group!(benches, steps, filling);
criterion_main!(benches);
