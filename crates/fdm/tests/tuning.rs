//! Tuning: what is found must be better where it was not searched, and safe.

use fdm::tune::{TuneOrder, TuneReport, tune, with_gains};
use fdm::{Aircraft, FdmError};

const X8: &str = include_str!("../../../aircraft/x8.toml");
const STICK: &str = include_str!("../../../aircraft/ultrastick-25e.toml");

fn quick(seed: u64, candidates: usize) -> TuneOrder {
    TuneOrder {
        candidates,
        ..TuneOrder::new(seed)
    }
}

fn tuned(aircraft: &Aircraft, order: &TuneOrder) -> Result<TuneReport, FdmError> {
    let report = tune(aircraft, order, &mut |_, _| {})?;
    println!(
        "{}: cost {:.3} -> {:.3}, held out {:.3} -> {:.3}, changed {}",
        report.aircraft,
        report.before.cost,
        report.after.cost,
        report.before.held_out_cost,
        report.after.held_out_cost,
        report.changed
    );
    Ok(report)
}

/// That an aircraft in `aircraft/` flies with margins, and no worse after tuning.
fn gains_by_tuning(text: &str, candidates: usize) {
    let aircraft = Aircraft::from_toml("aircraft", text).unwrap();
    let report = tuned(&aircraft, &quick(3, candidates)).unwrap();
    assert!(report.before.has_margins, "{}", report.aircraft);
    assert!(report.after.has_margins);
    assert!(report.after.held_out_cost <= report.before.held_out_cost);
    for flight in report.after.flights.iter().chain(&report.after.held_out) {
        assert!(flight.flown, "{flight:?}");
    }
    // Weather of another seed, which neither search nor judgement has seen.
    let mut other = aircraft.clone();
    other.control = report.after.gains;
    let order = quick(77, 0);
    let (shipped, new) = (
        tuned(&aircraft, &order).unwrap(),
        tuned(&other, &order).unwrap(),
    );
    assert!(new.before.held_out_cost <= shipped.before.held_out_cost);
}

#[test]
fn the_x8_flies_with_margin_and_gains_by_tuning() {
    gains_by_tuning(X8, 12);
}

#[test]
fn the_ultra_stick_flies_with_margin_and_gains_by_tuning() {
    gains_by_tuning(STICK, 12);
}

#[test]
fn slack_gains_are_mended_and_the_result_is_repeatable() {
    let mut aircraft = Aircraft::from_toml("x8", X8).unwrap();
    aircraft.control.roll_bandwidth_rad_s = 1.0;
    aircraft.control.pitch_bandwidth_rad_s = 0.8;
    aircraft.control.height_time_s = 15.0;
    let report = tuned(&aircraft, &quick(1, 10)).unwrap();
    assert!(report.changed);
    assert!(report.after.held_out_cost < 0.8 * report.before.held_out_cost);
    assert!(report.history.windows(2).all(|w| w[1] <= w[0]));
    // Fewer candidates show it as well.
    let again = |seed| tuned(&aircraft, &quick(seed, 3)).unwrap();
    let third = again(1);
    assert_eq!(third, again(1));
    assert_ne!(third.after.gains, again(2).after.gains);
}

#[test]
fn gains_are_found_for_a_delay_that_a_flight_showed() {
    let late = format!("{X8}\n[[mechanism]]\nid = \"actuator-delay\"\ndelay_s = 0.1\n");
    let aircraft = Aircraft::from_toml("x8", &late).unwrap();
    let report = tuned(&aircraft, &quick(1, 10)).unwrap();
    assert!(!report.before.has_margins && report.after.has_margins);
    assert!(report.after.gains.roll_damping_rad_s < report.before.gains.roll_damping_rad_s);
    assert_eq!(report.mechanism, aircraft.mechanism);
    let file = with_gains("x8", &late, &report.after.gains).unwrap();
    assert_eq!(
        Aircraft::from_toml("x8", &file).unwrap().mechanism,
        aircraft.mechanism
    );
}

#[test]
fn margins_that_cannot_be_had_are_refused() {
    let mut order = quick(1, 5);
    order.required.phase_deg = 170.0;
    let aircraft = Aircraft::from_toml("x8", X8).unwrap();
    let error = tune(&aircraft, &order, &mut |_, _| {}).unwrap_err();
    assert!(matches!(error, FdmError::NoMargins { .. }), "{error}");
    assert!(error.to_string().contains("170"), "{error}");
}
