//! Trim and modes against the published figures of the Skywalker X8 (Gryte et al. 2018 and the
//! inertia of its parts).

use fdm::dynamics::Dynamics;
use fdm::{Aircraft, trim};

fn x8() -> Aircraft {
    Aircraft::from_toml("x8.toml", include_str!("../../../aircraft/x8.toml")).unwrap()
}

#[test]
fn trim_at_18_m_s() {
    let trim = trim::level(&Dynamics::new(&x8()), 18.0, 1.225).unwrap();
    println!("{trim:?}");
    assert!((trim.elevator_rad - 0.0370).abs() < 1e-4);
    assert!((trim.throttle - 0.1219).abs() < 1e-4);
    assert!((trim.pitch_rad - 0.0308).abs() < 1e-4);
}

#[test]
fn modes_at_18_m_s() {
    let dynamics = Dynamics::new(&x8());
    let trim = trim::level(&dynamics, 18.0, 1.225).unwrap();
    let modes = trim::linearise(&dynamics, &trim).modes();
    println!("{modes:?}");
    assert!(
        (modes.short_period.0 - 13.3).abs() < 0.1 && (modes.short_period.1 - 0.53).abs() < 0.01
    );
    assert!((modes.phugoid.0 - 0.71).abs() < 0.01 && (modes.phugoid.1 - 0.058).abs() < 0.002);
    assert!((modes.dutch_roll.0 - 4.9).abs() < 0.1 && (modes.dutch_roll.1 - 0.34).abs() < 0.01);
    assert!((modes.roll_s - 0.05).abs() < 0.005);
    assert!((modes.spiral_s - 5.5).abs() < 0.1);
}
