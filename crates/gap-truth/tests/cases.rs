//! The cases themselves: repeatable, independent of what they test, and with effects that
//! show.

use std::process::Command;

use gap_truth::case::{DamageKind, TrackForm};
use gap_truth::{CATALOGUE, Case, CaseSpec, Forward, OUTSIDE, PlumeEffect};

/// Readings of a case's files in order.
fn readings(files: &[(String, String)]) -> Vec<Option<f64>> {
    let cells = |text: &String| -> Vec<Option<f64>> {
        text.lines()
            .skip(1)
            .map(|l| l.split(',').nth(5).and_then(|c| c.parse().ok()))
            .collect()
    };
    files.iter().flat_map(|(_, text)| cells(text)).collect()
}

#[test]
fn the_finder_is_not_among_the_dependencies() {
    let tree = Command::new(env!("CARGO"))
        .args([
            "tree",
            "--package",
            "gap-truth",
            "--edges",
            "normal",
            "--prefix",
            "none",
        ])
        .args([
            "--offline",
            "--manifest-path",
            concat!(env!("CARGO_MANIFEST_DIR"), "/Cargo.toml"),
        ])
        .output()
        .unwrap();
    let tree = String::from_utf8(tree.stdout).unwrap();
    assert!(
        tree.contains("rand_chacha") || tree.contains("chacha20"),
        "{tree}"
    );
    for line in tree.lines() {
        let name = line.split(' ').next().unwrap_or("");
        assert!(
            !["plume", "gap", "air", "scenario", "fdm"].contains(&name),
            "{line}"
        );
    }
}

#[test]
fn a_seed_makes_the_same_files_and_another_seed_others() {
    let spec = CaseSpec::one(7, PlumeEffect::SensorLag, 3.0);
    let case = Case::make(&spec);
    assert_eq!(case, Case::make(&spec));
    assert_ne!(
        case.scenario_toml,
        Case::make(&CaseSpec { seed: 8, ..spec }).scenario_toml
    );
}

/// The same without what is hidden.
fn control(spec: &CaseSpec) -> Case {
    let mut spec = spec.clone();
    spec.hidden.iter_mut().for_each(|h| h.strength = 0.0);
    Case::make(&spec)
}

#[test]
fn every_effect_shows_in_the_readings_or_places() {
    for &effect in CATALOGUE.iter().chain(&OUTSIDE) {
        let mut seen = false;
        for seed in 0..2 {
            let spec = CaseSpec::one(seed, effect, 6.0);
            let case = Case::make(&spec);
            seen |= case.observations != control(&spec).observations;
            let truth = &case.truth.effects[0];
            assert_eq!(
                truth.parameters.is_empty(),
                !effect.in_catalogue(),
                "{effect}"
            );
            assert!(truth.parameters.iter().all(|p| p.value.is_finite()));
            for r in readings(&case.observations).into_iter().flatten() {
                assert!(
                    r.is_finite() && r > 100.0 && r < 20_000.0,
                    "{effect} {seed}: {r}"
                );
            }
        }
        assert!(seen, "{effect}");
    }
}

#[test]
fn a_stronger_effect_is_farther_from_the_control() {
    for effect in [
        PlumeEffect::SigmaYScale,
        PlumeEffect::SensorLag,
        PlumeEffect::BackgroundDrift,
        PlumeEffect::SlowSwing,
    ] {
        // The control is the same for every strength.
        let plain = readings(&control(&CaseSpec::one(4, effect, 1.0)).observations);
        let miss = |strength: f64| {
            let spec = CaseSpec::one(4, effect, strength);
            let read = readings(&Case::make(&spec).observations);
            read.iter()
                .zip(&plain)
                .map(|(a, b)| (a.unwrap_or(0.0) - b.unwrap_or(0.0)).powi(2))
                .sum::<f64>()
        };
        let misses = [1.0, 3.0, 8.0].map(miss);
        assert!(misses.is_sorted_by(|a, b| a < b), "{effect}: {misses:?}");
    }
}

#[test]
fn puffs_are_at_least_half_of_the_truths() {
    let puffs = (0..100)
        .filter(|&seed| Case::forward(&CaseSpec::none(seed)) == Forward::Puffs)
        .count();
    assert!((50..=75).contains(&puffs), "{puffs}");
}

#[test]
fn damage_is_in_the_rows() {
    let made = |kind| {
        Case::make(&CaseSpec {
            damage: Some(kind),
            ..CaseSpec::none(3)
        })
    };
    let frozen = readings(&made(DamageKind::Frozen).observations);
    let plain = readings(&Case::make(&CaseSpec::none(3)).observations);
    assert_ne!(frozen, plain);
    let gap = readings(&made(DamageKind::Gap).observations);
    assert!(gap.iter().filter(|r| r.is_none()).count() >= 59);
    let highest = |r: &[Option<f64>]| r.iter().flatten().fold(0.0_f64, |a, &b| a.max(b));
    assert!(highest(&readings(&made(DamageKind::Clipped).observations)) <= highest(&plain));
}

/// Time, platform and latitude of each row of a case.
fn places(case: &Case) -> Vec<(f64, String, f64)> {
    let row = |line: &str| -> Option<(f64, String, f64)> {
        let mut cells = line.split(',');
        let time_s = cells.next()?.parse().ok()?;
        let platform = cells.next()?.to_owned();
        Some((time_s, platform, cells.next()?.parse().ok()?))
    };
    let rows = case
        .observations
        .iter()
        .flat_map(|(_, t)| t.lines().skip(1));
    rows.filter_map(row).collect()
}

#[test]
fn rows_are_as_far_apart_as_asked_and_fixed_sensors_stand() {
    let case = Case::make(&CaseSpec {
        row_step_s: 4,
        tracks: TrackForm::Fixed,
        ..CaseSpec::none(3)
    });
    let rows = places(&case);
    let own: Vec<&(f64, String, f64)> = rows.iter().filter(|r| r.1 == "uav1").collect();
    assert!(own.windows(2).all(|w| w[1].0 - w[0].0 == 4.0));
    // A degree is 111 km; what moves is the position's noise, a metre or two.
    assert!(own.iter().all(|r| (r.2 - own[0].2).abs() * 111e3 < 6.0));
}

#[test]
fn a_position_jumps_and_comes_back() {
    let made = |damage| {
        let spec = CaseSpec {
            damage,
            ..CaseSpec::none(3)
        };
        places(&Case::make(&spec))
    };
    let (plain, jumps) = (made(None), made(Some(DamageKind::Jumps)));
    let moved = |(a, b): (&(f64, String, f64), &(f64, String, f64))| (a.2 - b.2).abs() > 1e-3;
    let away: Vec<bool> = plain.iter().zip(&jumps).map(moved).collect();
    let count = away.iter().filter(|a| **a).count();
    assert!((4..=21).contains(&count), "{count}");
    assert!(!away[0] && !away[away.len() - 1]);
}
