//! The check before take-off says what cannot be flown, with numbers.

use mission::Setup;
use mission::preflight::{Finding, Verdict, check};

const AS_PONTES: &str = include_str!("../../../scenarios/as-pontes.toml");
const X8: &str = include_str!("../../../aircraft/x8.toml");

/// What is found in the reference mission with the texts `changes` in the place of others, over a
/// tile of `plateau_m` all over.
fn found_over(plateau_m: i16, changes: &[(&str, &str)]) -> Vec<Finding> {
    let mut text = AS_PONTES.to_owned();
    for (from, to) in changes {
        assert!(text.contains(from), "{from}");
        text = text.replace(from, to);
    }
    let read = |file: &str| match file {
        "n43w008.SRTMGL1.hgt" => Ok((0..1201 * 1201)
            .flat_map(|_| plateau_m.to_be_bytes())
            .collect()),
        "aircraft/tired.toml" => Ok(X8.replace("237.0", "60.0").into_bytes()),
        "aircraft/weak.toml" => Ok(X8.replace("237.0", "10.0").into_bytes()),
        "storm.csv" => Ok(b"time_s,wind_speed_m_s,wind_from_deg\n0,5,240\n900,17,240\n".to_vec()),
        _ => Err("no such file".to_owned()),
    };
    check(&Setup::load("s.toml", &text, &read).unwrap()).unwrap()
}

fn found(changes: &[(&str, &str)]) -> Vec<Finding> {
    found_over(0, changes)
}

/// That there is a finding of this kind whose words hold `parts`.
fn says(findings: &[Finding], verdict: Verdict, about: &str, parts: &[&str]) {
    let of_kind = |f: &&Finding| f.verdict == verdict && f.about == about;
    let holds = |f: &Finding| parts.iter().all(|part| f.words.contains(part));
    assert!(
        findings.iter().filter(of_kind).any(holds),
        "{about} {parts:?}: {findings:#?}"
    );
}

const WIND: &str = "wind_speed_m_s = 7.0";
const AIRCRAFT: &str = "aircraft/x8.toml";
const GROUND: &str = "ground_amsl_m = 340.0";
const TILE: &str = "ground_amsl_m = 340.0\nterrain = \"n43w008.SRTMGL1.hgt\"";

#[test]
fn the_reference_mission_may_take_off() {
    assert_eq!(found(&[]), []);
    assert_eq!(found_over(345, &[(GROUND, TILE)]), []);
}

#[test]
fn wind_is_held_against_the_airspeed() {
    let gale = found(&[(WIND, "wind_speed_m_s = 20.0")]);
    says(
        &gale,
        Verdict::Refused,
        "wind",
        &["16.2 m/s at 120 m", "18 m/s"],
    );
    let strong = found(&[(WIND, "wind_speed_m_s = 11.0")]);
    says(&strong, Verdict::Warned, "wind", &["12.1 m/s at 900 m"]);
    let storm = found(&[("wind_exponent", "series = \"storm.csv\"\nwind_exponent")]);
    says(&storm, Verdict::Warned, "wind", &["at 900 m"]);
}

#[test]
fn a_source_that_is_nowhere_near_its_fence_is_refused() {
    // A wrong digit of the longitude: a degree has 81 km on this latitude, and the fence ends 5 km east of the site.
    let second = "[[source]]\nname = \"second\"\nlat_deg = 43.4417\nlon_deg = -6.8631\nemission_kg_s = 10.0\n\n[background]";
    let far = found(&[("[background]", second)]);
    let parts = [
        "source second at 43.4417, -6.8631",
        "76 km from the fence",
        "50 km",
    ];
    says(&far, Verdict::Refused, "source", &parts);
}

#[test]
fn heights_that_cannot_be_are_refused() {
    // A digit of the effective height, and one of the ground's: 974.7 hPa at 3400 m are some 1440 hPa at sea level.
    let low = found(&[("effective_height_m = 486.0", "effective_height_m = 48.6")]);
    let parts = ["49 m above ground", "356 m high", "effective_height_m"];
    says(&low, Verdict::Refused, "source", &parts);
    let high = found(&[(GROUND, "ground_amsl_m = 3400.0")]);
    let parts = ["ground_amsl_m = 3400", "at sea level", "850 to 1100"];
    says(&high, Verdict::Refused, "pressure", &parts);
}

#[test]
fn batteries_and_airspeeds_are_held_against_the_mission() {
    let tired = found(&[(AIRCRAFT, "aircraft/tired.toml")]);
    says(
        &tired,
        Verdict::Warned,
        "battery",
        &["60 Wh", "20 %", "2100"],
    );
    let weak = found(&[(AIRCRAFT, "aircraft/weak.toml")]);
    says(&weak, Verdict::Refused, "battery", &["10 Wh", "300 s"]);
    let slow = found(&[("airspeed_m_s = 18.0", "airspeed_m_s = 9.0")]);
    says(
        &slow,
        Verdict::Refused,
        "airspeed",
        &["expected 12 to 28 m/s"],
    );
}

#[test]
fn homes_are_inside_the_fence_off_the_stacks_and_apart() {
    let home = "lat_deg = 43.4300, lon_deg = -7.8420";
    let beyond = found(&[(home, "lat_deg = 43.4300, lon_deg = -7.7800")]);
    says(
        &beyond,
        Verdict::Refused,
        "home",
        &["vehicle 1", "outside the fence"],
    );
    let near = found(&[(home, "lat_deg = 43.4420, lon_deg = -7.8631")]);
    says(
        &near,
        Verdict::Refused,
        "home",
        &["vehicle 1", "inside the keep-out"],
    );
    let same = found(&[(home, "lat_deg = 43.4300, lon_deg = -7.8412")]);
    says(
        &same,
        Verdict::Refused,
        "home",
        &["vehicles 1 and 2", "0 m apart"],
    );
    let close = found(&[(home, "lat_deg = 43.4300, lon_deg = -7.8414")]);
    says(
        &close,
        Verdict::Warned,
        "home",
        &["vehicles 1 and 2", "16 m apart"],
    );
}

#[test]
fn terrain_is_held_against_the_site_and_the_layers() {
    let off = found_over(370, &[(GROUND, TILE)]);
    says(&off, Verdict::Warned, "terrain", &["340", "370 m", "16 m"]);
    let high = found_over(520, &[(GROUND, TILE)]);
    says(
        &high,
        Verdict::Refused,
        "layer",
        &["vehicle 5", "470 m", "520 m"],
    );
    says(
        &high,
        Verdict::Warned,
        "terrain",
        &["above the lowest setpoints at 460 m"],
    );
    let void = found_over(i16::MIN, &[(GROUND, TILE)]);
    says(
        &void,
        Verdict::Warned,
        "terrain",
        &["no height at the site"],
    );
}

#[test]
fn a_team_needs_room_and_time() {
    let narrow = found(&[
        ("ceiling_agl_m = 900.0", "ceiling_agl_m = 170.0"),
        ("keep_out_radius_m = 1000.0", "keep_out_radius_m = 900.0"),
        (
            "[[43.405, -7.905], [43.405, -7.800], [43.480, -7.800], [43.480, -7.905]]",
            "[[43.427, -7.846], [43.427, -7.836], [43.434, -7.836], [43.434, -7.846]]",
        ),
    ]);
    says(&narrow, Verdict::Refused, "room", &["for 6 vehicles"]);
    let short = found(&[("duration_s = 2100.0", "duration_s = 300.0")]);
    says(&short, Verdict::Warned, "time", &["300", "for all 6"]);
    let shorter = found(&[("duration_s = 2100.0", "duration_s = 1000.0")]);
    says(
        &shorter,
        Verdict::Warned,
        "time",
        &["time for about", "for all 6"],
    );
    // Two that start in flight save at least their turns to take off, 8 s each.
    let in_flight = |home: &str, lon_deg: f64| {
        format!(
            "{home}\nairborne = {{ lat_deg = 43.4300, lon_deg = {lon_deg}, alt_amsl_m = 700.0, heading_deg = 90.0 }}"
        )
    };
    let homes = [-7.8420, -7.8412]
        .map(|lon_deg: f64| format!("home = {{ lat_deg = 43.4300, lon_deg = {lon_deg:.4} }}"));
    let starts = [in_flight(&homes[0], -7.85), in_flight(&homes[1], -7.83)];
    let flying = found(&[
        ("duration_s = 2100.0", "duration_s = 1000.0"),
        (&homes[0], &starts[0]),
        (&homes[1], &starts[1]),
    ]);
    let needed_s = |findings: &[Finding]| -> f64 {
        let time = findings.iter().find(|f| f.about == "time").unwrap();
        let (_, after) = time.words.split_once("expected ").unwrap();
        after.split(' ').next().unwrap().parse().unwrap()
    };
    assert!(needed_s(&shorter) - needed_s(&flying) >= 15.0);
}

#[test]
fn starts_in_flight_are_inside_the_fence_and_apart() {
    const HOMES: [&str; 2] = [
        "home = { lat_deg = 43.4300, lon_deg = -7.8420 }",
        "home = { lat_deg = 43.4300, lon_deg = -7.8412 }",
    ];
    let start = |home: &str, lon_deg: f64, alt_amsl_m: f64| {
        format!(
            "{home}\nairborne = {{ lat_deg = 43.43, lon_deg = {lon_deg}, alt_amsl_m = {alt_amsl_m}, heading_deg = 0.0 }}"
        )
    };
    let starts = |lon_deg: f64, alt_amsl_m: f64| {
        let first = start(HOMES[0], -7.875, 800.0);
        found(&[
            (HOMES[0], &first),
            (HOMES[1], &start(HOMES[1], lon_deg, alt_amsl_m)),
        ])
    };
    // 0.003 degrees of longitude are 243 m on this latitude, 0.001 are 81 m.
    assert_eq!(starts(-7.878, 800.0), []);
    assert_eq!(starts(-7.876, 835.0), []);
    let close = starts(-7.876, 820.0);
    says(
        &close,
        Verdict::Warned,
        "airborne",
        &["1 and 2", "81 m apart", "20 m in height"],
    );
    // The fence's western edge is at 7.905 degrees west, the ceiling at 1,240 m above mean sea level, the stack at
    // 43.4417, -7.8631 with a keep-out of 1,000 m.
    for (lon_deg, alt_amsl_m, part) in [
        (-7.91, 800.0, "outside the fence"),
        (-7.878, 1300.0, "expected at most"),
        (-7.878, 350.0, "expected at least"),
        (-7.8631, 400.0, "expected at least"),
    ] {
        let out = starts(lon_deg, alt_amsl_m);
        says(&out, Verdict::Refused, "airborne", &["vehicle 2", part]);
    }
    let near = start(HOMES[1], -7.8631, 800.0).replace("lat_deg = 43.43,", "lat_deg = 43.436,");
    let out = found(&[(HOMES[1], &near)]);
    says(&out, Verdict::Refused, "airborne", &["keep-out"]);
}
