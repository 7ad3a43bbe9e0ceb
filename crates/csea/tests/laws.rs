//! Laws that hold for any samples, domain and seed.

use crate::common;
use air::geo::wrap_signed_deg;
use csea::{
    Archive, ArchiveOptions, CsEaOptions, CseaError, DifferentialEvolution, Domain, Position,
    PromisingPoint, STRATEGIES, Sample, SmoothingKernel, choose_within_cone, strategy_by_name,
};
use proptest::prelude::*;
use rand::SeedableRng;
use rand::rngs::ChaCha8Rng;

fn position() -> impl Strategy<Value = Position> {
    (-2000.0..2000.0, -2000.0..2000.0, 0.0..800.0).prop_map(|(e, n, h)| Position::new(e, n, h))
}

/// Positions as flights leave them: many share a height or lie on one line.
fn flown() -> impl Strategy<Value = Vec<Position>> {
    let leg = (position(), 0.0f64..360.0, 1usize..120);
    proptest::collection::vec(leg, 1..8).prop_map(|legs| {
        legs.iter()
            .flat_map(|&(from, heading_deg, count)| {
                (0..count).map(move |i| Position {
                    at: from.at.displaced(heading_deg, 1.8 * i as f64),
                    height_m: from.height_m,
                })
            })
            .collect()
    })
}

fn archive(positions: &[Position], cell_m: Option<f64>) -> Archive {
    let options = ArchiveOptions {
        cell_m,
        ..ArchiveOptions::default()
    };
    let mut archive = Archive::new(options).unwrap();
    for (i, &position) in positions.iter().enumerate() {
        let value = (i % 17) as f64;
        archive.push(Sample { position, value }).unwrap();
    }
    archive
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn nearest_is_what_a_full_scan_finds(
        positions in flown(), query in position(), count in 1usize..20, radius in 50.0f64..3000.0,
    ) {
        let archive = archive(&positions, None);
        let mut found = Vec::new();
        archive.nearest(query, count, radius, &mut found);
        let weight = ArchiveOptions::default().height_weight;
        let mut expected: Vec<f64> = positions
            .iter()
            .map(|p| {
                let d_h = weight * (p.height_m - query.height_m);
                p.at.distance_m(query.at).powi(2) + d_h * d_h
            })
            .filter(|d| *d <= radius * radius)
            .collect();
        expected.sort_by(f64::total_cmp);
        expected.truncate(count);
        prop_assert_eq!(found.len(), expected.len());
        for (n, e) in found.iter().zip(&expected) {
            prop_assert!((n.distance_sq_m2 - e).abs() <= 1e-9 * e.max(1.0), "{:?} {}", n, e);
        }
    }

    #[test]
    fn cells_bound_the_archive_and_keep_the_mean(positions in flown(), cell_m in 5.0f64..200.0) {
        let kept = archive(&positions, Some(cell_m));
        let cells: std::collections::BTreeSet<_> = positions
            .iter()
            .map(|p| [p.at.east_m, p.at.north_m, p.height_m].map(|c| (c / cell_m).floor() as i64))
            .collect();
        prop_assert_eq!(kept.len(), cells.len());
        let mean = (0..positions.len()).map(|i| (i % 17) as f64).sum::<f64>() / positions.len() as f64;
        prop_assert!((kept.mean() - mean).abs() < 1e-9);
        // Flying the same way again adds nothing.
        let twice: Vec<_> = positions.iter().chain(&positions).copied().collect();
        prop_assert_eq!(archive(&twice, Some(cell_m)).len(), kept.len());
    }

    #[test]
    fn an_estimate_lies_between_the_values_sensed(positions in flown(), query in position()) {
        let archive = archive(&positions, Some(20.0));
        let kernel = SmoothingKernel { length_m: 150.0, neighbours: 8 };
        let estimate = archive.estimate(query, kernel, 1.0, &mut Vec::new());
        prop_assert!((0.0..=16.0).contains(&estimate.value));
        prop_assert!((0.0..=8.0).contains(&estimate.support));
    }

    #[test]
    fn closure_is_feasible(wanted in position(), seed in 0u64..1000, radius in 1.0f64..900.0) {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let (low, high) = (Position::new(-1000.0, -900.0, 100.0), Position::new(1000.0, 900.0, 500.0));
        let keep_out = move |p: Position| p.at.distance_m(Position::default().at) >= radius;
        let domain = Domain::new(low, high, keep_out, &mut rng).unwrap();
        let from = domain.draw(&mut rng);
        prop_assert!(domain.contains(domain.repair(wanted, from, &mut rng)));
        let members: Vec<_> = (0..10).map(|_| domain.draw(&mut rng)).collect();
        let de = DifferentialEvolution::new(0.9, 0.5).unwrap();
        for target in 0..10 {
            prop_assert!(domain.contains(de.trial(&members, target, &domain, &mut rng)));
        }
    }

    #[test]
    fn every_strategy_stays_in_its_domain(positions in flown(), seed in 0u64..1000) {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let (low, high) = (Position::new(-1000.0, -900.0, 100.0), Position::new(1000.0, 900.0, 500.0));
        let keep_out = |p: Position| p.at.distance_m(Position::default().at) >= 400.0;
        let domain = Domain::new(low, high, keep_out, &mut rng).unwrap();
        let archive = archive(&positions, Some(20.0));
        for name in STRATEGIES {
            let mut strategy = strategy_by_name(name, domain.clone(), CsEaOptions::default(), &common::prior(180.0), &mut rng).unwrap();
            for _ in 0..3 {
                let points = strategy.step(&archive, &mut rng).to_vec();
                prop_assert!(!points.is_empty());
                for p in &points {
                    prop_assert!(domain.contains(p.position), "{name} {p:?}");
                    prop_assert!(p.fitness.is_finite());
                }
                prop_assert_eq!(strategy.population(), &points[..]);
            }
        }
    }

    #[test]
    fn the_choice_is_ahead_if_anything_is(
        places in proptest::collection::vec(position(), 0..40),
        at in position(), heading_deg in 0.0f64..360.0, cone_deg in 1.0f64..180.0, seed in 0u64..1000,
    ) {
        let points: Vec<_> = places.iter().map(|&position| PromisingPoint { position, fitness: 0.0 }).collect();
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let off = |p: &PromisingPoint| wrap_signed_deg(at.at.bearing_deg(p.position.at) - heading_deg).abs();
        match choose_within_cone(&points, at, heading_deg, cone_deg, &mut rng) {
            None => prop_assert!(points.is_empty()),
            Some(chosen) => {
                let least = points.iter().map(off).fold(f64::INFINITY, f64::min);
                prop_assert!(off(&chosen) <= cone_deg.max(least));
            }
        }
    }
}

#[test]
fn the_choice_is_even_among_those_ahead() {
    // Three ahead of a sampler that flies north, one behind: 1/3 each over 3000 draws,
    // 4 standard deviations of the binomial are 103.
    let at = Position::default();
    let points =
        [(0.0, 100.0), (50.0, 100.0), (-90.0, 100.0), (0.0, -100.0)].map(|(e, n)| PromisingPoint {
            position: Position::new(e, n, 0.0),
            fitness: 0.0,
        });
    let mut rng = ChaCha8Rng::seed_from_u64(5);
    let mut counts = [0u32; 4];
    for _ in 0..3000 {
        let chosen = choose_within_cone(&points, at, 0.0, 45.0, &mut rng).unwrap();
        counts[points.iter().position(|p| *p == chosen).unwrap()] += 1;
    }
    assert_eq!(counts[3], 0);
    assert!(
        counts[..3].iter().all(|c| c.abs_diff(1000) < 103),
        "{counts:?}"
    );
}

#[test]
fn what_is_not_finite_is_refused_and_changes_nothing() {
    let mut archive = Archive::new(ArchiveOptions::default()).unwrap();
    let position = Position::default();
    for bad in [
        Sample {
            position,
            value: f64::NAN,
        },
        Sample {
            position: Position::new(f64::INFINITY, 0.0, 0.0),
            value: 1.0,
        },
    ] {
        assert_eq!(archive.push(bad), Err(CseaError::NotFinite));
    }
    assert!(archive.is_empty() && archive.mean() == 0.0);
}

#[test]
fn wrong_settings_say_what_would_be_right() {
    let domain = Domain::of_box(Position::default(), Position::new(1.0, 1.0, 1.0)).unwrap();
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    let unknown = strategy_by_name(
        "genetic",
        domain.clone(),
        CsEaOptions::default(),
        &common::prior(12.0),
        &mut rng,
    );
    let Err(unknown) = unknown else {
        panic!("an unknown strategy was taken")
    };
    assert_eq!(
        unknown.to_string(),
        "search.strategy is \"genetic\"; expected one of posterior, lawnmower, arcs, infotaxis, particle-swarm, cs-ea, ascent, random, outside \
         (baselines: particle-swarm, ascent, random)"
    );
    let options = CsEaOptions {
        population: 3,
        ..CsEaOptions::default()
    };
    let Err(small) = strategy_by_name("cs-ea", domain, options, &common::prior(12.0), &mut rng)
    else {
        panic!("NP 3 was taken")
    };
    assert_eq!(
        small.to_string(),
        "search.population is 3; expected 4 to 10000 members"
    );
    assert!(Domain::of_box(Position::new(2.0, 0.0, 0.0), Position::new(1.0, 1.0, 1.0)).is_err());
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    let nothing = Domain::new(
        Position::default(),
        Position::new(1.0, 1.0, 1.0),
        |_| false,
        &mut rng,
    );
    assert!(nothing.is_err());
}
