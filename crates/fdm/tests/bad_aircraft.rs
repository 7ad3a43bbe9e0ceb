//! Aircraft files that no aircraft can have are refused, with file, line and reason.

use fdm::{Aircraft, FdmError};

const X8: &str = include_str!("../../../aircraft/x8.toml");
const ULTRA_STICK: &str = include_str!("../../../aircraft/ultrastick-25e.toml");

/// The X8's file with one line replaced.
fn changed(from: &str, to: &str) -> String {
    assert!(X8.contains(from), "{from}");
    X8.replacen(from, to, 1)
}

/// Line, from 1, which is `part`.
fn line_of(text: &str, part: &str) -> usize {
    let bare = |line: &str| line.split('#').next().unwrap().trim() == part;
    text.lines().position(bare).unwrap() + 1
}

#[test]
fn both_aircraft_are_accepted() {
    assert_eq!(
        Aircraft::from_toml("x8.toml", X8).unwrap().name,
        "Skywalker X8"
    );
    assert!(
        Aircraft::from_toml("u.toml", ULTRA_STICK)
            .unwrap()
            .has_rudder()
    );
}

// A unit is wrong by 1,000 at times: mm, g, mAh. The names of the refused numbers stand in the file itself.
#[test]
fn no_number_may_be_a_thousand_times_larger() {
    for text in [X8, ULTRA_STICK] {
        let (mut table, mut tried) = (String::new(), 0);
        for line in text.lines() {
            let bare = line.split('#').next().unwrap().trim();
            if let Some(name) = bare.strip_prefix('[') {
                table = name.trim_end_matches(']').to_owned();
            }
            let Some((key, value)) = bare.split_once(" = ") else {
                continue;
            };
            let Ok(value) = value.parse::<f64>() else {
                continue;
            };
            if value == 0.0 {
                continue;
            }
            let wrong = text.replacen(line, &format!("{key} = {}", 1000.0 * value), 1);
            let told = Aircraft::from_toml("a.toml", &wrong).map(|a| a.name);
            let told = told.unwrap_err().to_string();
            // Airspeeds are refused by their order, which the next of them breaks.
            let named = told.contains(&format!("{table}.{key}")) || key.starts_with("airspeed_");
            assert!(named, "{table}.{key} = {}: {told}", 1000.0 * value);
            tried += 1;
        }
        assert!(tried > 40, "{tried}");
    }
}

/// A line of the X8's file, what it is changed to, and what is said of it.
const IMPOSSIBLE: &[(&str, &str, &str)] = &[
    (
        "mass_kg = 3.364",
        "mass_kg = 0.0",
        "body.mass_kg is 0; expected a number above 0",
    ),
    (
        "mass_kg = 3.364",
        "mass_kg = -3.0",
        "body.mass_kg is -3; expected a number above 0",
    ),
    ("mass_kg = 3.364", "mass_kg = nan", "body.mass_kg is NaN"),
    (
        "ixx_kg_m2 = 0.340",
        "ixx_kg_m2 = -0.340",
        "body.ixx_kg_m2 is -0.34",
    ),
    (
        "ixz_kg_m2 = 0.031",
        "ixz_kg_m2 = 0.37",
        "not positive definite",
    ),
    (
        "ixz_kg_m2 = 0.031",
        "ixz_kg_m2 = -0.37",
        "not positive definite",
    ),
    (
        "q = -1.3012",
        "q = 1.3012",
        "pitch.q is 1.3012; expected a number below 0 (pitch damping)",
    ),
    ("alpha = -0.4629", "alpha = 0.4629", "static stability"),
    (
        "elevator = -0.2292",
        "elevator = 0.2292",
        "pitch.elevator is 0.2292",
    ),
    ("p = -0.40420", "p = 0.40420", "roll damping"),
    ("r = -0.0720", "r = 0.0720", "yaw damping"),
    ("beta = 0.0283", "beta = -0.0283", "yaw.beta is -0.0283"),
    (
        "aileron = 0.12019",
        "aileron = -0.12019",
        "roll.aileron is -0.12019",
    ),
    ("alpha = 4.0203", "alpha = -4.0203", "lift.alpha is -4.0203"),
    ("zero = 0.01970", "zero = 0.0", "drag.zero is 0"),
    ("span_m = 2.1", "span_m = 0.0", "wing.span_m is 0"),
    // In mm, cm, cm², g and kg cm².
    (
        "span_m = 2.1",
        "span_m = 2100.0",
        "wing.span_m is 2100; expected 1.000e-1 to 1.200e2",
    ),
    ("span_m = 2.1", "span_m = 210.0", "wing.span_m is 210"),
    (
        "chord_m = 0.35714",
        "chord_m = 35.714",
        "wing.chord_m is 35.714",
    ),
    ("area_m2 = 0.75", "area_m2 = 7500.0", "wing.area_m2 is 7500"),
    (
        "mass_kg = 3.364",
        "mass_kg = 3364.0",
        "body.mass_kg is 3364; expected 3.750e-2 to 7.500e2",
    ),
    (
        "iyy_kg_m2 = 0.165",
        "iyy_kg_m2 = 1650.0",
        "body.iyy_kg_m2 is 1650",
    ),
    (
        "min_deg = -30.0",
        "min_deg = 30.0",
        "surfaces.min_deg is 30; expected -90 to -1",
    ),
    (
        "rate_deg_s = 200.0",
        "rate_deg_s = 0.0",
        "surfaces.rate_deg_s is 0",
    ),
    (
        "exit_speed_m_s = 40.0",
        "exit_speed_m_s = 15.0",
        "gives no thrust in flight",
    ),
    (
        "airspeed_max_m_s = 28.0",
        "airspeed_max_m_s = 11.0",
        "airspeed_min_m_s < airspeed_cruise_m_s",
    ),
];

#[test]
fn numbers_no_aircraft_has_are_refused_with_their_line() {
    for &(from, to, expected) in IMPOSSIBLE {
        let text = changed(from, to);
        let error = Aircraft::from_toml("x8.toml", &text).unwrap_err();
        let said = error.to_string();
        assert!(said.contains(expected), "{from} -> {to}: {said}");
        assert!(matches!(error, FdmError::Refused { .. }));
        if expected.contains(" is ") && !said.contains("cruise") {
            let at = format!("x8.toml:{}: ", line_of(&text, to));
            assert!(said.starts_with(&at), "{said}, not {at}");
        }
    }
}

#[test]
fn missing_and_unknown_keys_are_named() {
    for (from, to, says) in [
        ("mass_kg = 3.364\n", "", "mass_kg"),
        ("[pitch]\n", "[pich]\n", "pich"),
        ("span_m = 2.1", "spam_m = 2.1", "spam_m"),
        ("span_m = 2.1", "span_m = \"2.1 m\"", "expected"),
        ("span_m = 2.1", "span_m = ", ""),
    ] {
        let error = Aircraft::from_toml("x8.toml", &changed(from, to)).unwrap_err();
        assert!(matches!(error, FdmError::Syntax { .. }), "{error}");
        let said = error.to_string();
        assert!(
            said.starts_with("x8.toml:") && said.contains(says),
            "{said}"
        );
    }
    let gains = format!("{X8}\n[control]\nbank_max_deg = 120.0\n");
    let said = Aircraft::from_toml("x8.toml", &gains)
        .unwrap_err()
        .to_string();
    assert!(
        said.contains("control.bank_max_deg is 120; expected 5 to 75"),
        "{said}"
    );
}
