//! Faults that set in during a flight, made by a flight model that shares nothing with the finder: what they
//! are, how large, and when they began.

use fdm::Aircraft;
use gap::flight::log::FlightLog;
use gap::flight::{Finding, gate};
use gap_truth::flight::{FlightEffect, FlightSpec, make};

const ULTRASTICK: &str = include_str!("../../../aircraft/ultrastick-25e.toml");
const X8: &str = include_str!("../../../aircraft/x8.toml");

/// Flies `toml` for a minute with an effect of `strength` from `onset_s` on, and asks for its name, its size
/// within four standard deviations and its onset within 3 s.
fn sets_in(toml: &str, seed: u64, effect: FlightEffect, strength: f64, onset_s: f64) {
    let spec = FlightSpec {
        duration_s: 60.0,
        hidden: vec![(effect, strength)],
        onset_s: Some(onset_s),
        ..FlightSpec::none(seed)
    };
    let case = make(&spec, toml).unwrap();
    assert!(case.flown);
    let aircraft = Aircraft::from_toml("aircraft", toml).unwrap();
    let log = FlightLog::parse("case", &case.csv).unwrap();
    let gated = gate::pass(&[log], &aircraft).unwrap();
    let found = Finding::of(&aircraft, &gated, 1, &mut |_| ()).unwrap();
    let [cause] = found.answer.causes.as_slice() else {
        panic!("{effect:?}: {:?}", found.answer.causes)
    };
    assert_eq!(cause.mechanisms, [effect.id()]);
    let onset = cause.onset_s.unwrap();
    println!("{effect:?}, seed {seed}: {onset:?}, truth {onset_s}");
    assert!(
        (onset.value - onset_s).abs() < 3.0 && onset.sd < 3.0,
        "{onset:?}"
    );
    for truth in &case.truth {
        let p = cause
            .parameters
            .iter()
            .find(|p| p.name == truth.name)
            .unwrap();
        assert!(
            (p.value - truth.whole).abs() < 4.0 * p.sd,
            "{p:?} {truth:?}"
        );
    }
}

#[test]
fn surfaces_that_lose_effect_tell_when() {
    sets_in(
        ULTRASTICK,
        31,
        FlightEffect::ControlEffectiveness,
        3.0,
        27.3,
    );
    sets_in(X8, 32, FlightEffect::ControlEffectiveness, 3.0, 35.8);
}

#[test]
fn a_motor_that_loses_thrust_tells_when() {
    sets_in(ULTRASTICK, 33, FlightEffect::ThrustLoss, 3.0, 31.6);
    sets_in(ULTRASTICK, 34, FlightEffect::ThrustLoss, 2.0, 22.2);
}

#[test]
fn sensors_that_fail_tell_when() {
    sets_in(ULTRASTICK, 35, FlightEffect::AirspeedScale, 2.0, 24.9);
    sets_in(X8, 36, FlightEffect::GyroBias, 2.0, 38.1);
}
