//! Calibration from logs with flaws, from the folder that PLUMAGE_DATA names. Ignored, with the reason,
//! where that is not set.

#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    reason = "a test may fail by a panic"
)]

use std::path::Path;
use std::process::ExitCode;

#[path = "../../../tests/bar/mod.rs"]
mod bar;

use libtest_mimic::{Arguments, Completion, Trial};
use plume::Gas;
use scenario::Scenario;
use scenario::observations::{Flaw, Observations, checks, parse};
use scenario::uncertain::Uncertain;
use ws::calibration::offline::{OfflineCalibration, calibrate};

/// What the made-up sources of the cases emit, kg/s.
const EMISSION_KG_S: f64 = 160.0;

/// A test that gets the folder of cases.
fn on_cases(name: &str, test: fn(&Path)) -> Trial {
    Trial::ignorable_test(name, move || {
        let Some(folder) = std::env::var_os("PLUMAGE_DATA") else {
            let reason = "needs PLUMAGE_DATA, the folder of measured data";
            return Ok(Completion::ignored_with(reason));
        };
        let cases = Path::new(&folder).join("cases");
        if !cases.is_dir() {
            return Ok(Completion::ignored_with("needs PLUMAGE_DATA/cases"));
        }
        test(&cases);
        Ok(Completion::Completed)
    })
}

fn main() -> ExitCode {
    let trials = vec![
        on_cases(
            "rows_without_a_fix_change_nothing",
            rows_without_a_fix_change_nothing,
        ),
        on_cases(
            "codes_for_a_direction_cost_no_certainty",
            codes_for_a_direction_cost_no_certainty,
        ),
        on_cases(
            "codes_for_a_direction_cost_a_fifth_at_most",
            codes_for_a_direction_cost_a_fifth_at_most,
        ),
        on_cases(
            "a_direction_of_where_the_wind_blows_to_is_said",
            a_direction_of_where_the_wind_blows_to_is_said,
        ),
        on_cases(
            "one_code_is_said_and_left_out",
            one_code_is_said_and_left_out,
        ),
        on_cases("field_data_lose_no_row", field_data_lose_no_row),
        on_cases(
            "sensors_at_rest_state_the_metered_rate",
            sensors_at_rest_state_the_metered_rate,
        ),
        on_cases(
            "a_calibrated_network_has_no_absurd_name",
            a_calibrated_network_has_no_absurd_name,
        ),
    ];
    libtest_mimic::run(&Arguments::from_args(), trials).exit_code()
}

fn text(path: &Path) -> String {
    std::fs::read_to_string(path)
        .unwrap_or_else(|e| panic!("PLUMAGE_DATA: {}: {e}", path.display()))
}

fn observations(folder: &Path, name: &str) -> Observations {
    parse(&[(name, &text(&folder.join(name)))], Gas::Co2).unwrap()
}

/// A log and its world of the field data, where methane may stand under the name of CO2.
fn of_field(field: &Path, log: &str, world: &str) -> (Observations, Scenario) {
    let world_text = text(&field.join(world));
    let named = |text: &str| match world_text.contains("gas = \"ch4\"") {
        true => text.replace("co2_ppm", "ch4_ppm"),
        false => text.to_owned(),
    };
    let scenario = Scenario::parse(world, &named(&world_text)).unwrap();
    let log_text = named(&text(&field.join(log)));
    (
        parse(&[(log, &log_text)], scenario.gas()).unwrap(),
        scenario,
    )
}

fn scenario(folder: &Path, name: &str) -> Scenario {
    Scenario::parse(name, &text(&folder.join(name))).unwrap()
}

fn checked(scenario: &Scenario, observations: &Observations) -> checks::Checked {
    let base = scenario.dispersion_spec().unwrap();
    checks::check(observations, &base, &scenario.frame().unwrap())
}

fn emission_kg_s(found: &OfflineCalibration) -> (f64, f64) {
    let sd = found.scenario.prior_sd(Uncertain::Emission).unwrap();
    (found.scenario.sources[0].emission_kg_s.unwrap(), sd)
}

fn rows_without_a_fix_change_nothing(cases: &Path) {
    let scenario = scenario(cases, "no-fix.toml");
    let own = observations(cases, "no-fix.csv");
    // The same rows give the same answer.
    let left = checked(&scenario, &own).observations;
    assert_eq!(left.rows, observations(cases, "no-fix-without.csv").rows);
    let found = calibrate(&scenario, &own, None).unwrap();
    let (value, sd) = emission_kg_s(&found);
    assert!((value - EMISSION_KG_S).abs() < 2.0 * sd, "{value} ± {sd}");
    assert_eq!(found.calibrator.taken(), 2880);
    let without_fix = |q: &&scenario::observations::DataQuality| q.message.contains("position fix");
    assert_eq!(found.data_quality.iter().filter(without_fix).count(), 2);
}

fn codes_for_a_direction_cost_no_certainty(cases: &Path) {
    let scenario = scenario(cases, "wind-code.toml");
    let of = |name: &str| calibrate(&scenario, &observations(cases, name), None).unwrap();
    let (with, without) = (of("wind-code.csv"), of("wind-code-without.csv"));
    let [flaw] = &with.data_quality[..] else {
        panic!("{:?}", with.data_quality);
    };
    assert!(
        flaw.message
            .starts_with("30 values of -999 in column wind_from_deg")
    );
    assert!(
        without.data_quality.is_empty(),
        "{:?}",
        without.data_quality
    );
    let (value, sd) = emission_kg_s(&with);
    assert!((value - EMISSION_KG_S).abs() < 2.0 * sd, "{value} ± {sd}");
}

fn codes_for_a_direction_cost_a_fifth_at_most(cases: &Path) {
    let scenario = scenario(cases, "wind-code.toml");
    let of = |name: &str| calibrate(&scenario, &observations(cases, name), None).unwrap();
    let sd = |name: &str| emission_kg_s(&of(name)).1;
    let (with, without) = (sd("wind-code.csv"), sd("wind-code-without.csv"));
    assert!(with < 1.2 * without, "{with} {without}");
}

fn a_direction_of_where_the_wind_blows_to_is_said(cases: &Path) {
    let scenario = scenario(cases, "wind-towards.toml");
    let own = observations(cases, "wind-towards.csv");
    let found = calibrate(&scenario, &own, None).unwrap();
    let [flaw] = &found.data_quality[..] else {
        panic!("{:?}", found.data_quality);
    };
    assert_eq!(flaw.kind, Flaw::Unit);
    assert!(
        flaw.message.contains("the plume of the opposite wind"),
        "{}",
        flaw.message
    );
}

fn one_code_is_said_and_left_out(cases: &Path) {
    let text = include_str!("../../../scenarios/as-pontes.toml");
    let scenario = Scenario::parse("as-pontes.toml", text).unwrap();
    let found = calibrate(&scenario, &observations(cases, "one-code.csv"), None).unwrap();
    // The same row lies 360 m from the one before it, which is said too.
    let says = |what: &str| {
        found
            .data_quality
            .iter()
            .any(|f| f.message.starts_with(what))
    };
    assert!(
        says("1 values of -9999 in column co2_ppm"),
        "{:?}",
        found.data_quality
    );
    assert_eq!(found.calibrator.taken(), 300);
}

/// The zeros are those of `crates/gap/tests/measured.rs`. With them in the scenario no sensor is said to end its range
/// at 2 ppm, as one was, that has read 129.
fn a_calibrated_network_has_no_absurd_name(cases: &Path) {
    let field = cases.parent().unwrap().join("field");
    let (log, scenario) = of_field(&field, "metec/event.csv", "metec/event.toml");
    let found = calibrate(&scenario, &log, None).unwrap();
    let known = [1.833, 1.921, 1.752, 1.798, 1.670, 1.983, 2.110, 1.959];
    assert_eq!(log.platforms, ["E", "N", "NE", "NW", "S", "SE", "SW", "W"]);
    let (mut worst_ppm, mut worst_sd_ppm): (f64, f64) = (0.0, 0.0);
    for (k, zero_ppm) in known.into_iter().enumerate() {
        let zero = found.calibrator.zero_ppm(k).unwrap();
        worst_ppm = worst_ppm.max((zero.value - zero_ppm).abs());
        worst_sd_ppm = worst_sd_ppm.max(zero.sd);
    }
    bar::report(
        "zeros of eight sensors round a metered leak, calibrate: largest error and standard deviation",
        "< 0.05 ppm each",
        format!("{worst_ppm:.3} and {worst_sd_ppm:.3} ppm"),
        worst_ppm.max(worst_sd_ppm) < 0.05,
    );
    // The air's background is in the zeros: nothing more is known of it.
    assert!((found.calibrated.background_ppm.sd - 0.2).abs() < 1e-3);
    let setup = gap::plume::Setup::new(&found.scenario).unwrap();
    let options = gap::plume::Options::default();
    let analysis = gap::plume::analyse(&setup, &log, &options, &mut |_| ()).unwrap();
    let json = analysis.json;
    let candidates = json.unexplained.map_or(Vec::new(), |u| u.candidates);
    let considered = candidates.iter().flat_map(|c| &c.mechanisms);
    assert!(considered.into_iter().all(|m| m != "sensor-saturation"));
    // Readings are means over a minute: what comes late is the only thing that may be named.
    let named = json.causes.iter().flat_map(|c| &c.mechanisms);
    let is_late = |m: &String| m == "sensor-lag" || m == "clock-offset";
    assert!(named.into_iter().all(is_late), "{:?}", json.causes);
}

fn field_data_lose_no_row(cases: &Path) {
    let field = cases.parent().unwrap().join("field");
    for (log, world) in [
        ("car/transects.csv", "car/source.toml"),
        ("faam/transects.csv", "faam/logged-wind.toml"),
        ("faam/transects.csv", "faam/right-wind.toml"),
        (
            "faam/synthetic-swinging.csv",
            "faam/synthetic-swinging.toml",
        ),
        ("ginninderra/neutral.csv", "ginninderra/neutral.toml"),
        ("ginninderra/stable.csv", "ginninderra/stable.toml"),
        ("metec/event.csv", "metec/event.toml"),
        ("vulcano/two-sensors.csv", "vulcano/fumaroles.toml"),
    ] {
        let (own, scenario) = of_field(&field, log, world);
        let found = checked(&scenario, &own);
        assert_eq!(found.observations, own, "{log}: {:?}", found.flaws);
        assert!(
            found.flaws.iter().all(|f| f.kind == Flaw::Gap),
            "{log}: {:?}",
            found.flaws
        );
    }
}

/// Metered releases of methane past sensors at rest, the height stated. Of n cases as many may miss as the binomial
/// distribution of 95 % allows: one in ten here.
fn sensors_at_rest_state_the_metered_rate(cases: &Path) {
    let field = cases.parent().unwrap().join("field");
    for (folder, column) in [("otm33a", "release_gps"), ("metec/releases", "kg_s")] {
        let table = text(&field.join(folder).join("truth.csv"));
        let mut lines = table.lines().map(|l| l.split(',').collect::<Vec<_>>());
        let column = lines.next().unwrap().iter().position(|c| *c == column);
        let (mut ratios, mut within) = (Vec::new(), 0);
        for cells in lines {
            let stated: f64 = cells[column.unwrap()].parse().unwrap();
            // A gram is a thousandth of a kilogram.
            let truth = if folder == "otm33a" {
                1e-3 * stated
            } else {
                stated
            };
            let (log, world) = (
                format!("{folder}/{}.csv", cells[0]),
                format!("{folder}/{}h.toml", cells[0]),
            );
            let (rows, scenario) = of_field(&field, &log, &world);
            let (value, sd) = emission_kg_s(&calibrate(&scenario, &rows, None).unwrap());
            println!(
                "{log}\tratio {:.2}\trelative sd {:.2}\t{:.1} sd off",
                value / truth,
                sd / value,
                (value - truth) / sd
            );
            ratios.push(value / truth);
            within += usize::from((value - truth).abs() < 2.0 * sd);
        }
        ratios.sort_by(f64::total_cmp);
        let n = ratios.len();
        bar::report(
            &format!("metered releases of {folder}, calibrate: truth within 2 sd"),
            "≥ 90 %",
            format!("{within} of {n}, median ratio {:.2}", ratios[n / 2]),
            10 * within >= 9 * n,
        );
    }
}
