//! The gap of flight on a real flight: flight 75 of an Ultra Stick 25e of the University of
//! Minnesota, from the folder in PLUMAGE_DATA (default `../shared/data` beside the workspace).

#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    reason = "a test may fail by a panic"
)]

use std::path::PathBuf;

use fdm::Aircraft;
use gap::flight::log::FlightLog;
use gap::flight::study::Study;
use gap::flight::{equation_error, gate};
use gap::verdict::Verdict;

fn flight() -> Option<FlightLog> {
    let root = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../..");
    let data =
        std::env::var("PLUMAGE_DATA").map_or_else(|_| root.join("../shared/data"), PathBuf::from);
    let path = data.join("ultrastick-thor/flight.csv");
    match std::fs::read_to_string(&path) {
        Ok(text) => Some(FlightLog::parse("flight.csv", &text).unwrap()),
        Err(error) => {
            eprintln!("SKIPPED: {}: {error}; set PLUMAGE_DATA", path.display());
            None
        }
    }
}

fn published() -> Aircraft {
    let text = include_str!("../../../aircraft/ultrastick-25e.toml");
    Aircraft::from_toml("ultrastick-25e.toml", text).unwrap()
}

/// Delays: numpy's `correlate` of the commands and rates, each less its mean over 2 s, peaks at
/// 160 and 140 ms (samples of 20 ms).
#[test]
fn delays_moments_and_lift_of_a_real_flight() {
    let Some(log) = flight() else { return };
    let aircraft = published();
    let gated = gate::pass(&[log], &aircraft).unwrap();
    let flown: f64 = gated
        .segments
        .iter()
        .map(|s| s.time_s[s.len() - 1] - s.time_s[0])
        .sum();
    assert!((340.0..370.0).contains(&flown), "{flown}");
    let held = |n: &String| n.contains("vel_north_m_s is sampled every 1.0");
    assert!(gated.notices.iter().any(held), "{:?}", gated.notices);
    let study = Study::new(&aircraft, &gated, 1);
    let theta = study.start();
    let segments = gated.segments.iter();
    let worlds: Vec<_> = segments.map(|s| study.world(s, &theta)).collect();
    let told = equation_error::analyse(&gated.segments, &worlds, &aircraft);

    let [roll, pitch, ..] = &told.delays[..] else {
        panic!("{:?}", told.delays)
    };
    assert!((roll.rate_lag_s - 0.16).abs() < 0.015, "{roll:?}");
    assert!((pitch.rate_lag_s - 0.14).abs() < 0.015, "{pitch:?}");
    assert!((roll.moment_delay_s - 0.07).abs() < 0.015, "{roll:?}");
    assert!((pitch.moment_delay_s - 0.05).abs() < 0.015, "{pitch:?}");

    let moment = told.moments.iter().find(|m| m.axis == "roll").unwrap();
    assert!(moment.held_out_share > 0.5, "{moment:?}");
    // Of the variance itself, on blocks left out: half in roll, a quarter in pitch.
    assert!(moment.held_out_r2 > 0.45, "{moment:?}");
    let lift = told.lift.unwrap();
    assert!(lift.slope_by_vane < 3.5, "{lift:?}");
    assert_eq!(lift.at_fault, "cannot be told");
}

/// Sizes: no aircraft of this kind has a tenth of its published roll damping, so that such a
/// number must not be stated as a cause.
#[test]
fn a_real_flight_is_said_with_plausible_sizes() {
    let Some(log) = flight() else { return };
    let report = gap::flight::analyse(&[log], &published(), &mut |_| {}).unwrap();
    assert_ne!(report.gap.verdict, Verdict::None);
    for p in report.gap.causes.iter().flat_map(|c| &c.parameters) {
        let spec = fdm::mechanism::spec(&p.mechanism).unwrap();
        let known = spec.parameters.iter().find(|k| k.name == p.name).unwrap();
        assert!(
            (p.value - known.neutral).abs() <= 3.0 * known.prior_sd,
            "{p:?}"
        );
    }
    let says = |id: &str| {
        let mut sets = report.gap.causes.iter().map(|c| &c.mechanisms);
        sets.any(|s| s.iter().any(|m| m == id))
    };
    assert!(says("actuator-delay"), "{}", report.gap.summary);
    assert!(
        says("alpha-vane-scale") && says("lift-slope"),
        "{}",
        report.gap.summary
    );
}
