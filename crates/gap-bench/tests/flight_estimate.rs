//! Coefficients of an aircraft without published ones, from flights by a flight model that shares nothing with the
//! finder: what is stated of them holds, and the aircraft flies as the one that flew.

use fdm::Aircraft;
use gap::flight::estimate::{Estimate, estimate};
use gap::flight::log::FlightLog;
use gap_truth::flight::{FlightSpec, make};

const ULTRASTICK: &str = include_str!("../../../aircraft/ultrastick-25e.toml");
const X8: &str = include_str!("../../../aircraft/x8.toml");

/// Names of an aircraft file's coefficients that a flight tells well, with those of `flew`.
fn told_well(flew: &Aircraft) -> [(&'static str, f64); 10] {
    [
        ("lift.alpha", flew.lift.alpha),
        ("pitch.alpha", flew.pitch.alpha),
        ("pitch.q", flew.pitch.q),
        ("pitch.elevator", flew.pitch.elevator),
        ("roll.p", flew.roll.p),
        ("roll.aileron", flew.roll.aileron),
        ("roll.beta", flew.roll.beta),
        ("yaw.beta", flew.yaw.beta),
        ("yaw.r", flew.yaw.r),
        ("side.beta", flew.side.beta),
    ]
}

/// Estimates from two flights of 90 s, begun with coefficients that are wrong by up to two fifths.
fn of(toml: &str, seed: u64) -> (Aircraft, Estimate) {
    let fly = |seed: u64| make(&FlightSpec::none(seed), toml).unwrap();
    let logs = [seed, seed + 1].map(|s| FlightLog::parse("case", &fly(s).csv).unwrap());
    let flew = Aircraft::from_toml("aircraft", toml).unwrap();
    let mut start = flew.clone();
    start.lift.alpha *= 1.2;
    start.lift.zero += 0.08;
    start.lift.q *= 0.5;
    start.lift.elevator *= 1.5;
    start.pitch.alpha *= 1.4;
    start.pitch.q *= 0.6;
    start.pitch.elevator *= 0.65;
    start.roll.p *= 1.4;
    start.roll.aileron *= 0.65;
    start.roll.beta *= 0.6;
    start.yaw.beta *= 1.5;
    start.yaw.r *= 0.6;
    start.side.beta *= 1.4;
    (flew, estimate(&logs, &start, &mut |_| ()).unwrap())
}

/// How many standard deviations each coefficient is off; the airframe of a flight differs from its file by less than
/// one per cent.
fn off_sd(flew: &Aircraft, found: &Estimate) -> Vec<(&'static str, f64)> {
    let of = |(name, truth): (&'static str, f64)| {
        let c = found.coefficients.iter().find(|c| c.name == name).unwrap();
        assert!(c.told, "{name} is not told: {c:?}");
        (name, (c.value - truth) / c.sd)
    };
    told_well(flew).into_iter().map(of).collect()
}

fn holds(toml: &str, seed: u64) {
    let (flew, found) = of(toml, seed);
    for (name, off) in off_sd(&flew, &found) {
        assert!(off.abs() < 3.0, "{name}: {off:.1} standard deviations");
    }
    // The motion of a half that the estimate has not seen.
    for label in ["roll rate", "pitch rate"] {
        let m = found.motion.iter().find(|m| m.label == label).unwrap();
        assert!(m.after < 0.6 * m.before, "{m:?}");
    }
}

#[test]
fn a_conventional_aircraft_is_found_from_its_flights() {
    holds(ULTRASTICK, 61);
}

#[test]
fn a_flying_wing_is_found_from_its_flights() {
    holds(X8, 71);
}

// Two standard deviations hold 95 of 100; of eighty that lie together by flights, 68 to 80 are asked for.
#[test]
#[ignore = "second tier: a rate over many flights"]
fn what_is_stated_of_coefficients_holds() {
    let mut inside = Vec::new();
    for toml in [ULTRASTICK, X8] {
        for seed in [81, 91, 101, 111] {
            let (flew, found) = of(toml, seed);
            let off = off_sd(&flew, &found);
            println!("seed {seed}: {off:.1?}");
            inside.extend(off.into_iter().map(|(_, off)| off.abs() < 2.0));
        }
    }
    let hits = inside.iter().filter(|inside| **inside).count();
    assert!(hits >= 68, "{hits} of {}", inside.len());
}
