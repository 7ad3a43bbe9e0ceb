//! Trim and modes against the published figures of the Skywalker X8 (Gryte et al. 2018 and the
//! inertia of its parts).

use fdm::dynamics::Dynamics;
use fdm::{Aircraft, trim};
use nalgebra::{Complex, DMatrix};
use std::sync::Arc;

fn x8() -> Arc<Aircraft> {
    Arc::new(Aircraft::from_toml("x8.toml", include_str!("../../../aircraft/x8.toml")).unwrap())
}

#[test]
fn trim_at_18_m_s() {
    let trim = trim::level(&Dynamics::new(&x8()), 18.0, 1.225).unwrap();
    println!("{trim:?}");
    assert!((trim.elevator_rad - 0.0370).abs() < 1e-4);
    assert!((trim.throttle - 0.1219).abs() < 1e-4);
    assert!((trim.pitch_rad - 0.0308).abs() < 1e-4);
}

/// Natural frequency (rad/s) and damping ratio.
fn frequency_and_damping(eigenvalue: &Complex<f64>) -> (f64, f64) {
    let frequency = eigenvalue.norm();
    (frequency, -eigenvalue.re / frequency)
}

/// The oscillations of a state matrix, the fastest first.
fn oscillations(a: &DMatrix<f64>) -> Vec<(f64, f64)> {
    let eigenvalues = a.complex_eigenvalues();
    let upper = eigenvalues.iter().filter(|e| e.im > 1e-9);
    let mut all: Vec<_> = upper.map(frequency_and_damping).collect();
    all.sort_by(|a, b| b.0.total_cmp(&a.0));
    all
}

/// Time constants of the motions that do not oscillate, s, the shortest first.
fn time_constants_s(a: &DMatrix<f64>) -> Vec<f64> {
    let eigenvalues = a.complex_eigenvalues();
    let real = eigenvalues.iter().filter(|e| e.im.abs() <= 1e-9);
    let mut all: Vec<f64> = real.map(|e| -1.0 / e.re).collect();
    all.sort_by(f64::total_cmp);
    all
}

#[test]
fn modes_at_18_m_s() {
    let dynamics = Dynamics::new(&x8());
    let trim = trim::level(&dynamics, 18.0, 1.225).unwrap();
    let linear = trim::linearise(&dynamics, &trim);
    let [short_period, phugoid] = oscillations(&linear.a_longitudinal)[..] else {
        panic!("two oscillations along the path");
    };
    let [dutch_roll] = oscillations(&linear.a_lateral)[..] else {
        panic!("one oscillation to the side");
    };
    let [roll_s, spiral_s] = time_constants_s(&linear.a_lateral)[..] else {
        panic!("roll and spiral");
    };
    println!("{short_period:?} {phugoid:?} {dutch_roll:?} {roll_s} {spiral_s}");
    assert!((short_period.0 - 13.3).abs() < 0.1 && (short_period.1 - 0.53).abs() < 0.01);
    assert!((phugoid.0 - 0.71).abs() < 0.01 && (phugoid.1 - 0.058).abs() < 0.002);
    assert!((dutch_roll.0 - 4.9).abs() < 0.1 && (dutch_roll.1 - 0.34).abs() < 0.01);
    assert!((roll_s - 0.05).abs() < 0.005);
    assert!((spiral_s - 5.5).abs() < 0.1);
}
