//! Our dynamics against JSBSim with the same coefficients.
//!
//! The expected numbers are written by `tests/oracle/jsbsim_flight.py` (PyPI `jsbsim` 1.3.3, an
//! aircraft of our own, planet at rest, the same gravity, density and hold of the controls).

use std::collections::BTreeMap;
use std::sync::Arc;

use fdm::dynamics::Dynamics;
use fdm::{AirAround, Aircraft, FlightSim, SurfaceCommand, trim};

const TICK_S: f64 = 0.01;

fn aircraft(name: &str) -> Arc<Aircraft> {
    let text = match name {
        "x8" => include_str!("../../../aircraft/x8.toml"),
        _ => include_str!("../../../aircraft/ultrastick-25e.toml"),
    };
    Arc::new(Aircraft::from_toml(name, text).unwrap())
}

/// Rows of a CSV: (aircraft, airspeed, case) and the numbers after them.
fn rows(text: &str, keys: usize) -> Vec<(Vec<String>, Vec<f64>)> {
    csv::Reader::from_reader(text.as_bytes())
        .records()
        .map(|record| {
            let record = record.unwrap();
            let words: Vec<String> = record.iter().take(keys).map(str::to_owned).collect();
            let numbers = record
                .iter()
                .skip(keys)
                .map(|n| n.parse().unwrap())
                .collect();
            (words, numbers)
        })
        .collect()
}

#[test]
fn trim_is_that_on_jsbsim_accelerations() {
    for (key, expected) in rows(include_str!("../../../tests/oracle/jsbsim_trim.csv"), 1) {
        let dynamics = Dynamics::new(&aircraft(&key[0]));
        let trim = trim::level(&dynamics, expected[0], 1.225).unwrap();
        let ours = [trim.alpha_rad, trim.elevator_rad, trim.throttle];
        for (ours, theirs) in ours.iter().zip(&expected[1..]) {
            assert!((ours - theirs).abs() < 1e-6, "{key:?} {ours} {theirs}");
        }
    }
}

#[test]
fn flights_stay_within_five_hundredths_for_ten_seconds() {
    let mut inputs: BTreeMap<Vec<String>, Vec<Vec<f64>>> = BTreeMap::new();
    for (key, row) in rows(include_str!("../../../tests/oracle/jsbsim_inputs.csv"), 3) {
        inputs.entry(key).or_default().push(row);
    }
    let mut flights: BTreeMap<Vec<String>, Vec<Vec<f64>>> = BTreeMap::new();
    for (key, row) in rows(include_str!("../../../tests/oracle/jsbsim_flight.csv"), 3) {
        flights.entry(key).or_default().push(row);
    }
    assert_eq!(flights.len(), 5 + 5 + 3 + 6);
    for (key, expected) in &flights {
        let (metres, degrees) = compare(key, &inputs[key], expected);
        println!("{key:?}: {metres:.4} m, {degrees:.4} deg");
        assert!(
            metres < 0.05 && degrees < 0.05,
            "{key:?}: {metres} m, {degrees} deg"
        );
    }
}

/// Flies a case and returns the largest differences in position and angle in its first 10 s
/// (glides: 60 s).
fn compare(key: &[String], inputs: &[Vec<f64>], expected: &[Vec<f64>]) -> (f64, f64) {
    let craft = aircraft(&key[0]);
    let speed: f64 = key[1].parse().unwrap();
    let mut sim = FlightSim::airborne(&craft, 0.0, 0.0, 400.0, 0.0, speed).unwrap();
    let (mut metres, mut degrees): (f64, f64) = (0.0, 0.0);
    let mut next = inputs.iter().peekable();
    let mut command = SurfaceCommand::default();
    let mut air = AirAround::STANDARD_CALM;
    let mut tick = 0_u32;
    for row in expected {
        let until = (row[0] / TICK_S).round() as u32;
        while tick < until {
            let time = f64::from(tick) * TICK_S;
            while let Some(change) = next.next_if(|change| change[0] <= time + 1e-9) {
                command = SurfaceCommand {
                    elevator_rad: change[1],
                    aileron_rad: change[2],
                    rudder_rad: change[3],
                    throttle: change[4],
                    launch: false,
                };
                air.wind_ned_m_s = [change[5], change[6], change[7]];
            }
            // JSBSim's surfaces have no servos.
            sim.set_surfaces(&command);
            sim.step(TICK_S, &air, &command);
            tick += 1;
        }
        let s = sim.state();
        let off = [s.north_m - row[1], s.east_m - row[2], s.alt_amsl_m - row[3]];
        metres = metres.max(off.iter().map(|x| x * x).sum::<f64>().sqrt());
        for (ours, theirs) in [s.roll_rad, s.pitch_rad, s.yaw_rad].iter().zip(&row[4..7]) {
            let off = (ours.to_degrees() - theirs + 180.0).rem_euclid(360.0) - 180.0;
            degrees = degrees.max(off.abs());
        }
    }
    (metres, degrees)
}
