//! Logs as they come: counted from another time, sampled slowly, in another unit, with codes for
//! nothing, and scenarios that say how sure they are.

use super::*;

fn run_with(uncertain: &str, observations: &Observations) -> Analysis {
    let options = Options {
        complete: false,
        ..Options::default()
    };
    analyse(&setup_with(uncertain), observations, &options, &mut |_| ()).unwrap()
}

fn sets(a: &Analysis) -> Vec<&[String]> {
    a.json.causes.iter().map(|c| &c.mechanisms[..]).collect()
}

/// The world in which all sensors may be a little slow.
const ALL_MAY_BE_SLOW: &str = "\"sensor.time_constant_s\" = 0.7\n";

/// A record in which one sensor is slow.
fn one_slow_sensor() -> Observations {
    observe(&[("sensor-lag", &[("time_constant_s", 4.0)], &["b"])], 21)
}

/// Its analysis.
fn of_one_slow_sensor() -> &'static Analysis {
    static ONCE: OnceLock<Analysis> = OnceLock::new();
    ONCE.get_or_init(|| run_with(ALL_MAY_BE_SLOW, &one_slow_sensor()))
}

#[test]
fn a_record_may_count_from_elsewhere() {
    let mut epoch = one_slow_sensor();
    epoch.rows.iter_mut().for_each(|r| r.time_s += 1.7e9);
    let (a, b) = (of_one_slow_sensor(), run_with(ALL_MAY_BE_SLOW, &epoch));
    assert!(!a.json.causes.is_empty(), "{}", a.json.summary);
    assert_eq!(sets(a), sets(&b));
    let value = |a: &Analysis| a.json.causes[0].parameters[0].value;
    assert!(
        (value(a) - value(&b)).abs() < 1e-3,
        "{} {}",
        value(a),
        value(&b)
    );
    assert!(
        b.json
            .notices
            .iter()
            .any(|n| n.contains("count from there"))
    );
    let from = |a: &Analysis| {
        let bin = a.json.residual.iter().find(|b| b.coordinate == "time");
        bin.unwrap().from
    };
    assert!((from(&b) - from(a) - 1.7e9).abs() < 1e-3);
    assert!((b.report.series[0].time_s[0] - 1.7e9).abs() < 1e-3);
}

#[test]
fn times_years_apart_are_refused() {
    let mut far = observe(&[], 3);
    far.rows.last_mut().unwrap().time_s = 1e10;
    let refused = analyse(&setup(), &far, &Options::default(), &mut |_| ());
    let message = refused.unwrap_err().to_string();
    assert!(
        message.contains("time_s") && message.contains("400 days"),
        "{message}"
    );
}

#[test]
fn one_slow_sensor_is_named_though_all_may_be_slow() {
    let a = of_one_slow_sensor();
    let lag = a
        .json
        .causes
        .iter()
        .find(|c| c.mechanisms[0] == "sensor-lag");
    let lag = lag.unwrap_or_else(|| panic!("{}", a.json.summary));
    assert_eq!(lag.platforms, ["b"]);
}

// A tenth of the rows of a record that was read every second.
#[test]
fn readings_ten_seconds_apart_are_used() {
    let mut slow = observe(&[], 5);
    slow.rows.retain(|r| r.time_s % 10.0 == 0.0);
    let text = SCENARIO.replace(
        "noise_sd_ppm = 1.0",
        "noise_sd_ppm = 1.0\ntime_constant_s = 1.5",
    );
    let setup = Setup::new(&Scenario::parse("test.toml", &text).unwrap()).unwrap();
    let a = analyse(&setup, &slow, &Options::live(), &mut |_| ()).unwrap();
    let used = a.report.series.iter().flat_map(|s| &s.used);
    assert!(used.filter(|u| **u).count() > 170, "{}", a.json.summary);
}

#[test]
fn other_units_of_height_and_time_are_suspected() {
    for change in [
        |r: &mut ObservationRow| r.alt_amsl_m *= 1e-3,
        |r: &mut ObservationRow| r.time_s *= 1e3,
        |r: &mut ObservationRow| r.time_s /= 60.0,
    ] {
        let (verdict, flaws) = damaged(change);
        assert!(matches!(verdict, Verdict::None | Verdict::Insufficient));
        assert!(flaws.contains(&Flaw::Unit), "{flaws:?}");
    }
}

#[test]
fn readings_of_other_times_are_unexplained_whatever_is_named() {
    let mut shuffled = observe(&[], 6);
    for platform in 0..3 {
        let rows = || (0..shuffled.rows.len()).filter(|i| shuffled.rows[*i].platform == platform);
        let at: Vec<usize> = rows().collect();
        let read: Vec<Option<f64>> = at.iter().map(|i| shuffled.rows[*i].co2_ppm).collect();
        for (k, i) in at.iter().enumerate() {
            shuffled.rows[*i].co2_ppm = read[(k * 233 + 101) % read.len()];
        }
    }
    let a = run_with("", &shuffled);
    assert_eq!(a.json.verdict, Verdict::Unexplained, "{}", a.json.summary);
}

#[test]
fn the_base_states_the_direction_and_not_the_turn_against_the_log() {
    let mut turned = observe(&[], 7);
    for row in &mut turned.rows {
        row.wind_from_deg = row.wind_from_deg.map(|from| from + 15.0);
    }
    let a = run_with("\"weather.wind_from_deg\" = 10.0\n", &turned);
    let base = a
        .json
        .base
        .iter()
        .find(|b| b.name == "weather.wind_from_deg");
    assert!((base.unwrap().value - 250.0).abs() < 1.0, "{base:?}");
}

#[test]
fn a_mechanism_of_an_absent_platform_is_told() {
    let gain =
        "\n[[mechanism]]\nid = \"sensor-gain\"\nplatforms = [\"a\", \"uav9\"]\nfactor = 1.0\n";
    let a = run_with(gain, &observe(&[], 5));
    let told = a.json.notices.iter().filter(|n| n.contains("uav9"));
    assert_eq!(told.count(), 1, "{:?}", a.json.notices);
    assert!(!a.json.notices.iter().any(|n| n.contains("platform a ")));
}

/// Asserts that a wind is named that blows from so many degrees clockwise of where it was taken from.
fn assert_turned(a: &Analysis, by_deg: f64, within_deg: f64) {
    assert_eq!(sets(a), [["wind-direction-offset"]], "{}", a.json.summary);
    let found = &a.json.causes[0].parameters[0];
    let off_deg = air::geo::wrap_signed_deg(found.value - by_deg);
    assert!(off_deg.abs() < within_deg, "{found:?}");
}

#[test]
fn a_scenario_whose_wind_is_far_off_is_told() {
    let mut unlogged = observe(&[], 9);
    for row in &mut unlogged.rows {
        (row.wind_from_deg, row.wind_speed_m_s) = (None, None);
    }
    let text = SCENARIO.replace("wind_from_deg = 250.0", "wind_from_deg = 215.0");
    let setup = Setup::new(&Scenario::parse("test.toml", &text).unwrap()).unwrap();
    let a = analyse(&setup, &unlogged, &Options::live(), &mut |_| ()).unwrap();
    // The wind itself drifts by 2.5 degrees, for half a minute at a time.
    assert_turned(&a, 35.0, 2.5);
}
