use super::*;
use crate::Scenario;
use plume::{Gas, Strength, Unit};
use proptest::prelude::*;
use rand::RngExt;

const SCENARIO: &str = "\
[site]
lat_deg = 43.4417
lon_deg = -7.8631
ground_amsl_m = 340.0
[weather]
wind_speed_m_s = 7.0
wind_height_agl_m = 300.0
wind_from_deg = 250.0
stability = \"D\"
[[source]]
lat_deg = 43.4417
lon_deg = -7.8631
stack_height_m = 200.0
effective_height_m = 300.0
emission_kg_s = 160.0
[background]
co2_ppm = 420.0
[sensor]
noise_sd_ppm = 3.0
";

/// A Gaussian plume from 250°, written out with Briggs' (1973) class D, that is 300 ppm at 1 km, ppm.
fn plume_ppm(east_m: f64, north_m: f64, above_m: f64) -> f64 {
    let (s, c) = 70f64.to_radians().sin_cos();
    let (x, y) = (east_m * s + north_m * c, east_m * c - north_m * s);
    if x <= 0.0 {
        return 0.0;
    }
    let sigma_y = |x: f64| 0.08 * x / (1.0 + 1e-4 * x).sqrt();
    let sigma_z = |x: f64| 0.06 * x / (1.0 + 1.5e-3 * x).sqrt();
    let axis = 300.0 * sigma_y(1e3) * sigma_z(1e3) / (sigma_y(x) * sigma_z(x));
    axis * (-0.5 * (y / sigma_y(x)).powi(2) - 0.5 * (above_m / sigma_z(x)).powi(2)).exp()
}

fn frame() -> LocalFrame {
    LocalFrame::new(43.4417, -7.8631, 340.0).unwrap()
}

/// A clean log of two platforms: passes to and fro across the plume at 18 m/s, a second apart.
fn log() -> Observations {
    let mut random = crate::random::stream(3, "checks");
    // Irwin and Hall: the sum of twelve uniform numbers less six is normal enough.
    let mut noise = |sd: f64| {
        let sum: f64 = (0..12).map(|_| random.random::<f64>()).sum();
        sd * (sum - 6.0)
    };
    let frame = frame();
    let mut rows = Vec::new();
    for second in 0..1000 {
        for platform in 0..2 {
            let time_s = f64::from(second);
            let (leg, on) = ((time_s / 50.0).floor(), time_s % 50.0);
            let across_m = if leg % 2.0 == 0.0 {
                18.0 * on - 450.0
            } else {
                450.0 - 18.0 * on
            };
            let along_m = 900.0 + 300.0 * platform as f64 + 30.0 * leg;
            let (s, c) = 70f64.to_radians().sin_cos();
            let east_m = along_m * s + across_m * c;
            let north_m = along_m * c - across_m * s;
            let at = frame.to_geodetic(air::geo::Enu { east_m, north_m });
            let ppm = 420.0 + plume_ppm(east_m, north_m, 10.0) + noise(3.0);
            rows.push(ObservationRow {
                time_s,
                platform,
                lat_deg: at.lat_deg,
                lon_deg: at.lon_deg,
                alt_amsl_m: 650.0 + noise(0.5),
                co2_ppm: Some((100.0 * ppm).round() / 100.0),
                wind_speed_m_s: Some((7.0 + noise(0.5)).max(0.0)),
                wind_from_deg: Some(250.0 + noise(2.0)),
                temperature_c: Some(15.0 + noise(0.3)),
                relative_humidity_pct: Some(60.0 + noise(2.0)),
                pressure_hpa: Some(938.0 + noise(0.2)),
                sd_ppm: Some(3.0),
                averaging_s: None,
                line_end: None,
                spread_s: 0.0,
            });
        }
    }
    Observations {
        rows,
        platforms: vec!["A".to_owned(), "B".to_owned()],
        ..Observations::default()
    }
}

fn base() -> DispersionSpec {
    Scenario::parse("test.toml", SCENARIO)
        .unwrap()
        .dispersion_spec()
        .unwrap()
}

fn checked(observations: &Observations) -> Checked {
    check(observations, &base(), &frame())
}

/// What is found after a change to the rows of A from 100 s to 150 s.
fn damaged(change: impl Fn(&mut ObservationRow)) -> Checked {
    let mut damaged = log();
    let there = |r: &&mut ObservationRow| r.platform == 0 && (100.0..150.0).contains(&r.time_s);
    damaged.rows.iter_mut().filter(there).for_each(change);
    checked(&damaged)
}

/// The one flaw that is said.
fn only(checked: &Checked) -> &DataQuality {
    assert_eq!(checked.flaws.len(), 1, "{:?}", checked.flaws);
    &checked.flaws[0]
}

#[test]
fn a_clean_log_passes_as_it_is() {
    let clean = log();
    let checked = checked(&clean);
    assert_eq!((checked.observations, checked.flaws), (clean, Vec::new()));
}

#[test]
fn codes_are_said_by_column_and_left_out() {
    type Cell = fn(&mut ObservationRow) -> &mut Option<f64>;
    let columns: [(&str, Cell, &[f64]); 6] = [
        (
            "wind_from_deg",
            |r| &mut r.wind_from_deg,
            &[-999.0, 999.0, 9999.0, -9999.0],
        ),
        (
            "wind_speed_m_s",
            |r| &mut r.wind_speed_m_s,
            &[99.0, 99.9, 999.0, -999.0, 9999.0, -9999.0],
        ),
        (
            "temperature_c",
            |r| &mut r.temperature_c,
            &[99.0, -99.0, 99.9, 999.0, -999.0, -9999.0],
        ),
        (
            "relative_humidity_pct",
            |r| &mut r.relative_humidity_pct,
            &[999.0, -999.0, -9999.0],
        ),
        (
            "pressure_hpa",
            |r| &mut r.pressure_hpa,
            &[-999.0, 9999.0, 99999.0],
        ),
        (
            "co2_ppm",
            |r| &mut r.co2_ppm,
            &[-999.0, -9999.0, 9999.0, 99999.0],
        ),
    ];
    for (name, cell, codes) in columns {
        for code in codes {
            // Every tenth row, and a single one.
            for (every, count) in [(10.0, 5), (50.0, 1)] {
                let found = damaged(|r| {
                    if r.time_s % every == 0.0 {
                        *cell(r) = Some(*code);
                    }
                });
                let flaw = only(&found);
                let said = format!("{count} values of {code} in column {name} are ignored: a code");
                assert!(flaw.message.starts_with(&said), "{}", flaw.message);
                assert_eq!((flaw.kind, flaw.platform.as_str()), (Flaw::Outlier, "A"));
                let mut rows = found.observations.rows.clone();
                let missing = rows
                    .iter_mut()
                    .filter_map(|r| cell(r).is_none().then_some(r.time_s));
                assert_eq!(missing.count(), count, "{name} {code}");
            }
        }
    }
}

#[test]
fn codes_among_the_readings_that_a_plume_reaches_are_told_by_their_lack_of_flanks() {
    // 999 where the plume itself makes 700.
    let found = damaged(|r| {
        if r.time_s % 10.0 == 0.0 {
            r.co2_ppm = Some(999.0);
        }
    });
    assert!(
        only(&found)
            .message
            .contains("5 values of 999 in column co2_ppm")
    );
    // Three in a row each time.
    let found = damaged(|r| {
        if r.time_s % 10.0 < 3.0 {
            r.co2_ppm = Some(999.0);
        }
    });
    assert!(
        only(&found)
            .message
            .contains("15 values of 999 in column co2_ppm")
    );
    // A plume that has flanks may make 999.
    let found = damaged(|r| {
        if r.time_s % 10.0 < 3.0 {
            r.co2_ppm = Some(if r.time_s % 10.0 == 1.0 { 999.0 } else { 850.0 });
        }
    });
    assert_eq!(found.flaws, Vec::new());
    // Zeros in air of 420.
    let found = damaged(|r| {
        if r.time_s % 10.0 == 0.0 {
            r.co2_ppm = Some(0.0);
        }
    });
    assert!(
        only(&found)
            .message
            .contains("5 values of 0 in column co2_ppm")
    );
    // One that is not written as a code: a peak may be as high.
    let found = damaged(|r| {
        if r.time_s == 130.0 {
            r.co2_ppm = Some(1150.0);
        }
    });
    assert_eq!(found.flaws, Vec::new());
}

#[test]
fn round_heights_and_pressures_are_no_codes() {
    let mut passes = log();
    for row in &mut passes.rows {
        let low = (row.time_s / 50.0).floor() % 2.0 == 0.0;
        row.alt_amsl_m = if low { 640.0 } else { 990.0 };
        row.pressure_hpa = Some(if low { 940.0 } else { 900.0 });
    }
    passes
        .rows
        .iter_mut()
        .take(2)
        .for_each(|r| r.pressure_hpa = Some(999.0));
    assert_eq!(checked(&passes).flaws, Vec::new());
    // Nobody flies at 9999 m in between.
    passes.rows[500].alt_amsl_m = 9999.0;
    assert!(
        only(&checked(&passes))
            .message
            .contains("1 values of 9999 in column alt_amsl_m")
    );
}

#[test]
fn neighbours_on_a_coarse_grid_are_no_codes() {
    // A gas that is not in clean air, in whole ppb.
    let mut coarse = log();
    for (k, row) in coarse.rows.iter_mut().enumerate() {
        let plume = row.co2_ppm.map(|c| ((c - 420.0) / 10.0).round().max(1.0));
        row.co2_ppm = if k % 300 < 2 { Some(0.0) } else { plume };
    }
    let mut none = base();
    (none.background_ppm, none.sensor.noise_sd_ppm) = (1.0, 0.1);
    assert_eq!(check(&coarse, &none, &frame()).flaws, Vec::new());
    for row in &mut coarse.rows {
        let level = if row.time_s % 100.0 == 7.0 { 9.9 } else { 10.0 };
        row.co2_ppm = Some(level + 0.1 * (row.time_s % 3.0));
    }
    none.background_ppm = 10.0;
    assert_eq!(check(&coarse, &none, &frame()).flaws, Vec::new());
}

#[test]
fn a_wind_of_which_a_part_is_a_code_is_none() {
    let found = damaged(|r| r.wind_speed_m_s = Some(-999.0));
    let rows = found.observations.rows.iter();
    let gone = rows.filter(|r| r.wind_from_deg.is_none() && r.wind_speed_m_s.is_none());
    assert_eq!(gone.count(), 50);
    // A vane without an anemometer keeps its directions.
    let mut vane = log();
    vane.rows
        .iter_mut()
        .for_each(|r| r.wind_speed_m_s = Some(99.0));
    let found = checked(&vane);
    assert_eq!(found.flaws.len(), 2, "{:?}", found.flaws);
    let rows = &found.observations.rows;
    assert!(
        rows.iter()
            .all(|r| r.wind_from_deg.is_some() && r.wind_speed_m_s.is_none())
    );
}

#[test]
fn what_cannot_be_is_said_and_left_out() {
    type Change = fn(&mut ObservationRow);
    let changes: [(&str, Change); 11] = [
        ("co2_ppm", |r| r.co2_ppm = Some(1e300)),
        ("co2_ppm", |r| r.co2_ppm = Some(1e7 + r.time_s)),
        ("sd_ppm", |r| r.sd_ppm = Some(1e300)),
        ("wind_speed_m_s", |r| {
            r.wind_speed_m_s = Some(-3.0 - 0.01 * r.time_s)
        }),
        ("wind_from_deg", |r| r.wind_from_deg = Some(800.0)),
        ("relative_humidity_pct", |r| {
            r.relative_humidity_pct = Some(130.0)
        }),
        ("temperature_c", |r| r.temperature_c = Some(288.15)),
        ("pressure_hpa", |r| r.pressure_hpa = Some(95_000.0)),
        ("sd_ppm", |r| r.sd_ppm = Some(0.0)),
        ("lat_deg", |r| r.lat_deg = 434.417),
        ("alt_amsl_m", |r| r.alt_amsl_m = 65_000.0),
    ];
    for (name, change) in changes {
        let found = damaged(change);
        let message = &found.flaws[0].message;
        assert!(
            message.contains(&format!("in column {name} are ignored: expected")),
            "{message}"
        );
        assert!(message.starts_with("50 values of "), "{message}");
        // Rows without a place are none, and readings that are left out leave a gap.
        let gaps = found.flaws[1..].iter().filter(|f| f.kind == Flaw::Gap);
        assert_eq!(gaps.count(), found.flaws.len() - 1);
    }
    // Readings below zero: by less than noise does, they are noise.
    let mut low = base();
    low.background_ppm = 0.0;
    let mut own = log();
    own.rows
        .iter_mut()
        .for_each(|r| r.co2_ppm = r.co2_ppm.map(|c| c - 420.0));
    assert_eq!(check(&own, &low, &frame()).flaws, Vec::new());
    for row in own.rows.iter_mut().filter(|r| r.time_s % 100.0 == 0.0) {
        row.co2_ppm = Some(-100.0 - 0.01 * row.time_s);
    }
    let found = check(&own, &low, &frame());
    assert_eq!(found.flaws.len(), 2, "{:?}", found.flaws);
    assert!(found.flaws[0].message.starts_with("10 values of "));
}

#[test]
fn a_column_in_another_unit_is_asked_about() {
    let mut other = log();
    for row in &mut other.rows {
        row.pressure_hpa = row.pressure_hpa.map(|p| 100.0 * p);
        row.temperature_c = row.temperature_c.map(|t| t + 273.15);
    }
    let found = checked(&other);
    assert_eq!(found.flaws.len(), 4);
    for (flaw, unit) in found.flaws.iter().zip(["K?", "Pa?", "K?", "Pa?"]) {
        assert_eq!(flaw.kind, Flaw::Unit);
        assert!(flaw.message.ends_with(unit), "{}", flaw.message);
    }
    assert_eq!(found.observations.readings(), 2000);
}

/// A car that drives for 100 s and then stands for 300, its receiver a tenth of a metre to and fro.
fn car() -> Observations {
    let drive = log();
    let mut rows = Vec::new();
    for row in &drive.rows {
        let shift_s = 300.0 * (row.time_s / 100.0).floor();
        let at = |later_s: f64, off_deg: f64| ObservationRow {
            time_s: row.time_s + shift_s + later_s,
            lat_deg: row.lat_deg + off_deg,
            ..*row
        };
        rows.push(at(0.0, 0.0));
        if row.time_s % 100.0 == 99.0 {
            rows.extend((1..=300).map(|k| at(f64::from(k), 1e-6 * f64::from(k % 2))));
        }
    }
    rows.sort_by(|a, b| {
        (a.time_s, a.platform)
            .partial_cmp(&(b.time_s, b.platform))
            .unwrap()
    });
    Observations { rows, ..drive }
}

#[test]
fn a_car_that_stands_most_of_the_time_has_its_times_in_seconds() {
    let mut car = car();
    let rows = car.rows.len();
    let found = checked(&car);
    assert!(
        found.flaws.iter().all(|f| f.kind != Flaw::Unit),
        "{:?}",
        found.flaws
    );
    assert_eq!(found.observations.rows.len(), rows);
    // The same in milliseconds.
    car.rows.iter_mut().for_each(|r| r.time_s *= 1000.0);
    let found = checked(&car);
    assert!(
        found
            .flaws
            .iter()
            .any(|f| f.message.ends_with("(ms or ns?)"))
    );
    assert_eq!(found.observations.rows.len(), 0);
}

#[test]
fn rows_without_a_fix_feed_nothing() {
    let clean = log();
    let first = |r: &ObservationRow| r.time_s < 60.0;
    let mut damaged = clean.clone();
    for row in damaged.rows.iter_mut().filter(|r| first(r)) {
        (row.lat_deg, row.lon_deg, row.alt_amsl_m) = (0.0, 0.0, 0.0);
    }
    let found = checked(&damaged);
    let left: Vec<ObservationRow> = clean.rows.iter().copied().filter(|r| !first(r)).collect();
    assert_eq!(found.observations.rows, left);
    let said: Vec<&str> = found.flaws.iter().map(|f| f.message.as_str()).collect();
    assert_eq!(said.len(), 2);
    assert!(
        said.iter()
            .all(|m| m.starts_with("60 rows without a position fix"))
    );
}

#[test]
fn extra_columns_follow_the_rows_that_are_left() {
    let mut damaged = log();
    let cells = (0..damaged.rows.len()).map(|i| i.to_string()).collect();
    damaged.extra = vec![ExtraColumn {
        name: "note".to_owned(),
        cells,
    }];
    damaged.rows[1].lat_deg = 999.0;
    let found = checked(&damaged);
    assert_eq!(found.observations.rows.len(), 1999);
    assert_eq!(found.observations.extra[0].cells[..3], ["0", "2", "3"]);
    assert_eq!(found.observations.extra[0].cells.len(), 1999);
}

#[test]
fn jumps_there_and_back_feed_nothing_wherever_they_are() {
    // Beside the track for 3 s, in two places one after the other, in height, and at the very start.
    type Jump = fn(&mut ObservationRow);
    let jumps: [(f64, f64, Jump); 4] = [
        (200.0, 203.0, |r| r.lat_deg += 0.01),
        (300.0, 302.0, |r| r.lon_deg += 0.01 * (r.time_s - 301.5)),
        (400.0, 404.0, |r| r.alt_amsl_m = 0.0),
        (0.0, 20.0, |r| r.lat_deg -= 0.02),
    ];
    for (from_s, to_s, jump) in jumps {
        let clean = log();
        let there = |r: &ObservationRow| r.platform == 1 && (from_s..to_s).contains(&r.time_s);
        let mut damaged = clean.clone();
        damaged.rows.iter_mut().filter(|r| there(r)).for_each(jump);
        let found = checked(&damaged);
        let left: Vec<ObservationRow> = clean.rows.iter().copied().filter(|r| !there(r)).collect();
        assert_eq!(found.observations.rows, left, "from {from_s}");
        let flaw = &found.flaws[0];
        assert!(
            flaw.message.contains("jumps there and back"),
            "{}",
            flaw.message
        );
        assert_eq!((flaw.from_s, flaw.to_s), (from_s, to_s - 1.0));
    }
}

/// A log of one platform that goes along a line by `way_m` at every time, in clean air.
fn along(way_m: impl Fn(f64) -> f64, steps: u32, step_s: f64) -> Observations {
    let mut own = log();
    let (row, frame) = (own.rows[0], frame());
    own.rows = (0..steps)
        .map(|k| {
            let time_s = f64::from(k) * step_s;
            let at = frame.to_geodetic(air::geo::Enu {
                east_m: way_m(time_s),
                north_m: 500.0,
            });
            ObservationRow {
                time_s,
                lat_deg: at.lat_deg,
                lon_deg: at.lon_deg,
                co2_ppm: Some(420.0 + f64::from(k * 7919 % 1000) / 100.0),
                ..row
            }
        })
        .collect();
    own
}

#[test]
fn what_a_vehicle_does_is_no_jump() {
    // A fix a second in a log of ten rows a second; hovering but for one dash there and back; standing for
    // most of the time, then a flight; passes of a fast aircraft; a pause of an hour, and elsewhere then.
    let held = along(|t| 18.0 * t.floor(), 3000, 0.1);
    let dash = along(
        |t| 15.0 * (20.0 - (t - 500.0).abs()).max(0.0) + 0.3 * (7.0 * t).sin(),
        1000,
        1.0,
    );
    let stood = along(|t| 20.0 * (t - 900.0).max(0.0), 1000, 1.0);
    let fast = along(|t| 5000.0 * (t / 40.0).sin(), 600, 1.0);
    let mut pause = along(|t| 10.0 * t, 600, 1.0);
    for row in pause.rows.iter_mut().filter(|r| r.time_s > 570.0) {
        (row.time_s, row.lat_deg) = (row.time_s + 3600.0, row.lat_deg + 0.1);
    }
    for own in [held, dash, stood, fast, pause] {
        let found = checked(&own);
        assert_eq!(
            found.observations.rows.len(),
            own.rows.len(),
            "{:?}",
            found.flaws
        );
    }
}

#[test]
fn another_site_and_swapped_places_leave_nothing() {
    for change in [
        (|r| (r.lat_deg, r.lon_deg) = (r.lon_deg, r.lat_deg)) as fn(&mut ObservationRow),
        |r| r.lat_deg += 5.0,
        |r| r.alt_amsl_m -= 340.0 + 250.0,
        |r| r.time_s *= 1e3,
        |r| r.time_s /= 60.0,
    ] {
        let mut other = log();
        other.rows.iter_mut().for_each(change);
        let found = checked(&other);
        assert_eq!(found.observations.rows.len(), 0);
        assert_eq!(found.flaws.len(), 2);
        assert!(found.flaws.iter().all(|f| f.kind == Flaw::Unit));
    }
}

/// Twice at one value, for 12 s and for 21: the longer one does not hide behind the other.
#[test]
fn what_stands_still_twice_at_one_value_is_found_twice() {
    let mut own = log();
    for row in &mut own.rows {
        if row.time_s < 12.0 || (310.0..331.0).contains(&row.time_s) {
            row.co2_ppm = Some(430.0);
        }
    }
    let found = checked(&own);
    let frozen = |platform: &str| -> Vec<(f64, f64)> {
        let flaws = found.flaws.iter();
        let own = flaws.filter(|f| f.kind == Flaw::Frozen && f.platform == platform);
        own.map(|f| (f.from_s, f.to_s)).collect()
    };
    for platform in ["A", "B"] {
        let mut runs = frozen(platform);
        runs.sort_by(|a, b| a.0.total_cmp(&b.0));
        assert_eq!(runs, [(0.0, 11.0), (310.0, 330.0)], "{platform}");
    }
}

#[test]
fn what_stands_still_is_left_out_but_for_its_first_reading() {
    let found = damaged(|r| r.co2_ppm = Some(431.0));
    let flaw = only(&found);
    assert_eq!(
        (flaw.kind, flaw.from_s, flaw.to_s),
        (Flaw::Frozen, 100.0, 149.0)
    );
    assert_eq!(found.observations.readings(), 2000 - 49);
    // Its place and wind are as good as before.
    assert_eq!(found.observations.rows.len(), 2000);
    assert!(
        found
            .observations
            .rows
            .iter()
            .all(|r| r.wind_from_deg.is_some())
    );
}

#[test]
fn clean_air_below_what_a_sensor_detects_does_not_stand_still() {
    let mut blind = log();
    for row in &mut blind.rows {
        row.co2_ppm = row.co2_ppm.map(|c| if c < 440.0 { 0.0 } else { c - 420.0 });
    }
    let mut none = base();
    none.background_ppm = 0.0;
    assert_eq!(check(&blind, &none, &frame()).flaws, Vec::new());
}

#[test]
fn clean_air_on_a_coarse_grid_does_not_stand_still() {
    // A precise instrument written with two digits: air that drifts by a digit in an hour.
    let mut precise = log();
    for row in &mut precise.rows {
        let drift = 1.755 + 0.015 * (row.time_s / 160.0).sin();
        let in_plume = row.time_s % 250.0 > 200.0;
        let plume = if in_plume {
            0.3 + 0.2 * (row.time_s * 1.7).sin()
        } else {
            0.0
        };
        row.co2_ppm = Some((100.0 * (drift + plume)).round() / 100.0);
    }
    let mut methane = base();
    (methane.background_ppm, methane.sensor.noise_sd_ppm) = (1.76, 0.002);
    assert_eq!(check(&precise, &methane, &frame()).flaws, Vec::new());
}

#[test]
fn readings_at_a_limit_are_left_out_and_the_limit_is_kept_in_mind() {
    let mut clipped = log();
    for row in clipped.rows.iter_mut().filter(|r| r.platform == 1) {
        row.co2_ppm = row.co2_ppm.map(|c| c.min(500.0));
    }
    let held = clipped
        .rows
        .iter()
        .filter(|r| r.co2_ppm == Some(500.0))
        .count();
    let found = checked(&clipped);
    assert_eq!(only(&found).kind, Flaw::Clipped);
    assert_eq!(found.observations.readings(), 2000 - held);
    let ceiling = &found.ceilings[0];
    assert_eq!((ceiling.platform, ceiling.limit_ppm), (1, 500.0));
    assert_eq!(ceiling.held_s.len(), held);
}

#[test]
fn gaps_and_another_unit_are_said() {
    let found = damaged(|r| r.co2_ppm = None);
    let flaw = only(&found);
    assert_eq!(
        (flaw.kind, flaw.from_s, flaw.to_s),
        (Flaw::Gap, 99.0, 150.0)
    );
    let mut other = log();
    other
        .rows
        .iter_mut()
        .for_each(|r| r.co2_ppm = r.co2_ppm.map(|c| 1e3 * c));
    let found = checked(&other);
    assert_eq!(found.observations.readings(), 0);
    assert!(
        found
            .flaws
            .iter()
            .all(|f| f.kind == Flaw::Unit && f.message.contains("ppb"))
    );
}

#[test]
fn a_direction_of_where_the_wind_blows_to_is_told() {
    // Logged in the rows, and stated by the scenario alone.
    let mut logged = log();
    for row in &mut logged.rows {
        row.wind_from_deg = row.wind_from_deg.map(|from| from - 180.0);
    }
    let found = checked(&logged);
    assert_eq!(only(&found).kind, Flaw::Unit);
    assert!(
        only(&found)
            .message
            .contains("plume of the opposite wind; wind_from_deg")
    );
    assert_eq!(found.observations, logged);
    let mut unlogged = log();
    for row in &mut unlogged.rows {
        (row.wind_from_deg, row.wind_speed_m_s) = (None, None);
    }
    assert_eq!(checked(&unlogged).flaws, Vec::new());
    let mut other_way = base();
    other_way.wind = other_way.wind.turned(180.0);
    let found = check(&unlogged, &other_way, &frame());
    assert!(
        only(&found)
            .message
            .contains("the scenario's weather.wind_from_deg")
    );
    // Off by less, or with no plume to follow, is not the other way.
    let mut off = log();
    off.rows
        .iter_mut()
        .for_each(|r| r.wind_from_deg = r.wind_from_deg.map(|from| from + 90.0));
    assert_eq!(checked(&off).flaws, Vec::new());
}

/// A damage to a log: which, from when, and for how long, s.
fn damage() -> impl Strategy<Value = (usize, f64, f64)> {
    (0..7_usize, 0.0..900.0_f64, 1.0..60.0_f64)
}

fn damage_row(which: usize, row: &mut ObservationRow, at_s: f64) {
    match which {
        0 => row.co2_ppm = Some(-9999.0),
        1 => row.co2_ppm = Some(430.0),
        2 => (row.lat_deg, row.lon_deg, row.alt_amsl_m) = (0.0, 0.0, 0.0),
        3 => row.wind_from_deg = Some(-999.0),
        4 => row.lat_deg += 0.02,
        5 => row.co2_ppm = row.co2_ppm.map(|c| c.min(500.0)),
        _ => row.co2_ppm = Some(-50.0 - 0.1 * (row.time_s - at_s)),
    }
}

#[test]
fn a_background_that_noise_hides_tells_no_unit() {
    // SO2 by a cell whose noise is five times the background, in a plume for most of the time.
    let mut sulphur = log();
    for row in &mut sulphur.rows {
        row.co2_ppm = row.co2_ppm.map(|c| 1e-3 * (c - 380.0));
    }
    let mut cell = base();
    (cell.background_ppm, cell.sensor.noise_sd_ppm) = (1e-3, 5e-3);
    assert_eq!(check(&sulphur, &cell, &frame()).flaws, Vec::new());
}

#[test]
fn what_is_said_is_in_the_unit_of_the_file() {
    let mut ppb = log();
    (ppb.gas, ppb.unit) = (Gas::Ch4, Unit::Ppb);
    for (k, row) in ppb.rows.iter_mut().enumerate() {
        row.co2_ppm = if k % 50 == 7 {
            Some(-9.999)
        } else {
            row.co2_ppm.map(|c| 1e-3 * c)
        };
    }
    let mut air = base();
    (air.background_ppm, air.sensor.noise_sd_ppm) = (0.42, 1e-3);
    let said = &check(&ppb, &air, &frame()).flaws[0].message;
    assert!(
        said.contains("values of -9999 in column ch4_ppb are ignored: a code"),
        "{said}"
    );
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

    #[test]
    fn in_another_unit_of_concentration_the_same_is_said(
        damages in proptest::collection::vec(damage(), 0..3)
    ) {
        let mut own = log();
        for (which, from_s, lasts_s) in damages {
            let there = |r: &&mut ObservationRow| (from_s..from_s + lasts_s).contains(&r.time_s);
            own.rows.iter_mut().filter(there).for_each(|r| damage_row(which, r, from_s));
        }
        let mut thousandfold = own.clone();
        for row in &mut thousandfold.rows {
            row.co2_ppm = row.co2_ppm.map(|c| 1e3 * c);
            row.sd_ppm = row.sd_ppm.map(|c| 1e3 * c);
        }
        let mut other = base();
        other.background_ppm *= 1e3;
        other.sensor.noise_sd_ppm *= 1e3;
        for source in &mut other.sources {
            if let Strength::EmissionKgS(emission) = &mut source.strength {
                *emission *= 1e3;
            }
        }
        let (a, b) = (checked(&own), check(&thousandfold, &other, &frame()));
        let said = |c: &Checked| -> Vec<_> {
            let flaws = c.flaws.iter();
            flaws.map(|f| (f.platform.clone(), f.kind, f.from_s, f.to_s)).collect()
        };
        prop_assert_eq!(said(&a), said(&b));
        prop_assert_eq!(a.observations.rows.len(), b.observations.rows.len());
        for (a, b) in a.observations.rows.iter().zip(&b.observations.rows) {
            prop_assert_eq!(a.co2_ppm.map(|c| 1e3 * c), b.co2_ppm);
        }
    }

    #[test]
    fn what_is_left_has_nothing_more_to_say_of_its_values(
        damages in proptest::collection::vec(damage(), 1..4)
    ) {
        let mut own = log();
        for (which, from_s, lasts_s) in damages {
            let there = |r: &&mut ObservationRow| (from_s..from_s + lasts_s).contains(&r.time_s);
            own.rows.iter_mut().filter(there).for_each(|r| damage_row(which, r, from_s));
        }
        let left = checked(&own).observations;
        let again = checked(&left);
        let more = again.flaws.iter().filter(|f| f.kind != Flaw::Gap);
        prop_assert_eq!(more.count(), 0, "{:?}", again.flaws);
        prop_assert_eq!(again.observations, left);
    }

    #[test]
    fn no_rows_make_it_panic(
        rows in proptest::collection::vec(proptest::array::uniform7(any::<f64>()), 0..40)
    ) {
        let mut own = log();
        let template = own.rows[0];
        own.rows = rows
            .into_iter()
            .map(|[time_s, lat_deg, lon_deg, alt_amsl_m, ppm, speed, from]| ObservationRow {
                time_s,
                lat_deg,
                lon_deg,
                alt_amsl_m,
                co2_ppm: Some(ppm),
                wind_speed_m_s: Some(speed),
                wind_from_deg: Some(from),
                ..template
            })
            .collect();
        checked(&own);
    }
}
