//! The gap in measured data: flight 75 of an Ultra Stick 25e of the University of Minnesota, and the
//! tracer trials of Prairie Grass, from the folder that PLUMAGE_DATA names. Ignored, with the reason,
//! where that is not set.

#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    reason = "a test may fail by a panic"
)]

#[path = "tracer/told.rs"]
mod told;

use std::path::Path;
use std::process::ExitCode;

use fdm::Aircraft;
use gap::applied::{Earlier, Outcome};
use gap::flight::log::FlightLog;
use gap::flight::study::Study;
use gap::flight::{equation_error, gate};
use gap::tracer::TracerReport;
use gap::tracer::table::{Receptor, Tables};
use gap::verdict::{GapJson, Verdict};
use libtest_mimic::{Arguments, Completion, Trial};
use scenario::Scenario;
use scenario::observations::parse;
use told::{report, vertical};

/// A test that gets the folder of measured data.
fn on_data(name: &str, test: fn(&Path)) -> Trial {
    Trial::ignorable_test(name, move || {
        let Some(folder) = std::env::var_os("PLUMAGE_DATA") else {
            let reason = "needs PLUMAGE_DATA, the folder of measured data";
            return Ok(Completion::ignored_with(reason));
        };
        test(Path::new(&folder));
        Ok(Completion::Completed)
    })
}

fn main() -> ExitCode {
    let trials = vec![
        on_data(
            "delays_moments_and_lift_of_a_real_flight",
            delays_moments_and_lift_of_a_real_flight,
        ),
        on_data(
            "a_real_flight_is_said_with_plausible_sizes",
            a_real_flight_is_said_with_plausible_sizes,
        ),
        on_data(
            "prairie_grass_says_what_is_known_of_it",
            prairie_grass_says_what_is_known_of_it,
        ),
        on_data(
            "an_extension_holds_on_prairie_grass_trials_that_it_was_not_found_on",
            an_extension_holds_on_prairie_grass_trials_that_it_was_not_found_on,
        ),
        on_data("arc_maxima_alone_are_scored", arc_maxima_alone_are_scored),
        on_data(
            "two_sensors_of_one_drone_are_held_against_each_other",
            two_sensors_of_one_drone_are_held_against_each_other,
        ),
        on_data(
            "methane_in_ppm_and_in_ppb_has_one_answer",
            methane_in_ppm_and_in_ppb_has_one_answer,
        ),
        on_data(
            "methane_of_other_sites_in_ppm_and_in_ppb_has_one_answer",
            methane_of_other_sites_in_ppm_and_in_ppb_has_one_answer,
        )
        .with_kind("second tier: four analyses")
        .with_ignored_flag(true),
        on_data(
            "a_leak_in_a_wind_that_turns_all_day_is_unexplained",
            a_leak_in_a_wind_that_turns_all_day_is_unexplained,
        ),
        on_data(
            "cases_of_an_independent_generator_are_answered_right",
            cases_of_an_independent_generator_are_answered_right,
        ),
        on_data(
            "flaws_of_raw_logs_change_no_answer",
            flaws_of_raw_logs_change_no_answer,
        ),
        on_data(
            "codes_and_a_direction_of_where_the_wind_blows_to_are_said",
            codes_and_a_direction_of_where_the_wind_blows_to_are_said,
        ),
    ];
    libtest_mimic::run(&Arguments::from_args(), trials).exit_code()
}

fn text(data: &Path, file: &str) -> String {
    let path = data.join(file);
    std::fs::read_to_string(&path)
        .unwrap_or_else(|e| panic!("PLUMAGE_DATA: {}: {e}", path.display()))
}

fn flight(data: &Path) -> FlightLog {
    FlightLog::parse("flight.csv", &text(data, "ultrastick-thor/flight.csv")).unwrap()
}

fn published() -> Aircraft {
    let text = include_str!("../../../aircraft/ultrastick-25e.toml");
    Aircraft::from_toml("ultrastick-25e.toml", text).unwrap()
}

/// Delays: numpy's `correlate` of the commands and rates, each less its mean over 2 s, peaks at
/// 160 and 140 ms (samples of 20 ms).
fn delays_moments_and_lift_of_a_real_flight(data: &Path) {
    let log = flight(data);
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
fn a_real_flight_is_said_with_plausible_sizes(data: &Path) {
    let log = flight(data);
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

fn prairie_grass(data: &Path, with_towers: bool) -> Tables {
    let read = |name: &str| text(data, &format!("prairie-grass/{name}.csv"));
    let (receptors, trials, towers) = (read("receptors"), read("trials"), read("towers"));
    Tables::parse(
        ("receptors.csv", &receptors),
        ("trials.csv", &trials),
        with_towers.then_some(("towers.csv", towers.as_str())),
    )
    .unwrap()
}

// Golder's (1972) lines at z0 = .006 m.
fn classes_at_six_millimetres(report: &TracerReport) {
    let d = report
        .tracer
        .class_limits
        .iter()
        .find(|l| l.class == 'D')
        .unwrap();
    assert!(
        (d.from_per_m + 0.021).abs() < 1e-3 && (d.to_per_m - 0.022).abs() < 1e-3,
        "{d:?}"
    );
}

// Barad (1958); bars: FAC2 at least .90 and NMSE at most .40 on trials left out, from .79 and .69
// by Briggs with the wind at 2 m.
fn prairie_grass_says_what_is_known_of_it(data: &Path) {
    for with_towers in [true, false] {
        let report = report(&prairie_grass(data, with_towers));
        let gain = report.gap.gain.as_ref().unwrap();
        assert_eq!(gain.blocks, 36);
        assert_eq!(report.tracer.arcs.len(), 180);
        let h = &gain.held_out;
        assert!(
            h.fac2_after >= 0.90 && h.nmse_after <= 0.40,
            "{}",
            report.gap.summary
        );
        assert!(h.log_score_gain_low > 0.0);
        let of = |group: &str, prefix: &str| {
            let causes = report.gap.causes.iter().filter(|c| c.platforms == [group]);
            let found = causes.filter(|c| c.mechanisms.iter().any(|m| m.starts_with(prefix)));
            found.cloned().collect::<Vec<_>>()
        };
        let unstable = of("unstable", "sigma-z-growth");
        assert_eq!(
            unstable[0].mechanisms[0], "sigma-z-growth",
            "{}",
            report.gap.summary
        );
        let exponent = &unstable[0].parameters[0];
        assert!(exponent.value > 0.25 && exponent.value < 0.55 && exponent.sd < 0.06);
        assert_eq!(of("unstable", "sigma-y-from-azimuth").len(), 1);
        let allowed = ["sigma-z-growth", "sigma-z-scale", "dry-deposition"];
        assert!(
            vertical(&report).iter().all(|m| allowed.contains(m)),
            "{}",
            report.gap.summary
        );
        if with_towers {
            assert_eq!(unstable[0].mechanisms.len(), 1);
        }
        assert_eq!(report.gap.verdict, Verdict::Ambiguous);
        // The class steps do most in stable air: a cause besides is likely, not sure.
        let stable = of("stable", "sigma-z");
        assert!(stable[0].mechanisms.len() > 1 && stable[0].probability < 0.95);
        assert!(report.gap.summary.contains("of no cause"));
        classes_at_six_millimetres(&report);
        let json: serde_json::Value = serde_json::from_str(&report.to_json().unwrap()).unwrap();
        assert!(json["gain"]["held_out"]["fac2_after"].as_f64().unwrap() >= 0.90);
        assert_eq!(json["schema"], "plumage.gap/2");
    }
}

/// Those of the trials that `keep` wants.
fn some(all: &Tables, keep: impl Fn(&str) -> bool) -> Tables {
    let mut out = all.clone();
    out.trials.retain(|t| keep(&t.trial));
    out.receptors.retain(|r| keep(&r.trial));
    out.towers.retain(|r| keep(&r.trial));
    out
}

/// A third of the trials with weather, taken in three ways, predicted from the others: 108 trials. Of
/// the base FAC2 is .79 and NMSE .69 however one counts; reached are .90 and .43. Where the others hold one or two trials
/// of class F the narrow plumes of that class, and the two nights of drainage flow (39 and 40), are predicted badly.
fn an_extension_holds_on_prairie_grass_trials_that_it_was_not_found_on(data: &Path) {
    let all = prairie_grass(data, true);
    let weather = all.trials.iter().filter(|t| t.obukhov_length_m.is_some());
    let names: Vec<String> = weather.map(|t| t.trial.clone()).collect();
    let mut pairs: Vec<(f64, f64)> = Vec::new();
    for (run, part) in [1, 4, 12]
        .into_iter()
        .flat_map(|run| (0..3).map(move |p| (run, p)))
    {
        let place = |trial: &str| names.iter().position(|n| n == trial);
        let is_new = |trial: &str| place(trial).is_some_and(|k| (k / run) % 3 == part);
        let found = report(&some(&all, |t| !is_new(t)));
        let earlier = Earlier::parse("gap.json", &found.to_json().unwrap()).unwrap();
        let applied = gap::tracer::apply(&some(&all, is_new), &earlier, 1).unwrap();
        let said = applied.gap.applied.as_ref().unwrap();
        assert!(
            said.fitted.is_empty() && said.outcome != Outcome::Hurts,
            "{}",
            said.says
        );
        let arcs = applied.tracer.arcs.iter();
        pairs.extend(arcs.map(|a| (a.max_mg_m3, a.held_out_max_mg_m3)));
    }
    let scores = plume::score::scores(&pairs, 1e-3).unwrap();
    println!("{} arcs: {scores:?}", pairs.len());
    assert!(scores.fac2 > 0.88 && scores.nmse < 0.50, "{scores:?}");
}

/// Of trials that give the maximum of each arc alone the same maxima are predicted, and nothing is said of
/// integrals and widths.
fn arc_maxima_alone_are_scored(data: &Path) {
    let all = prairie_grass(data, true);
    let late = |t: &str| t.parse::<u32>().is_ok_and(|n| n >= 40);
    let found = report(&some(&all, |t| !late(t)));
    let earlier = Earlier::parse("gap.json", &found.to_json().unwrap()).unwrap();
    let whole = gap::tracer::apply(&some(&all, late), &earlier, 1).unwrap();
    let mut tables = some(&all, late);
    let arcs = whole.tracer.arcs.iter();
    tables.receptors = arcs
        .map(|a| Receptor {
            trial: a.trial.clone(),
            east_m: 0.0,
            north_m: a.distance_m,
            height_agl_m: 1.5,
            concentration_mg_m3: Some(a.max_mg_m3),
            evaporation_factor: None,
        })
        .collect();
    let maxima = gap::tracer::apply(&tables, &earlier, 1).unwrap();
    let (a, b) = (
        &whole.gap.gain.unwrap().held_out,
        &maxima.gap.gain.unwrap().held_out,
    );
    for (a, b) in [
        (a.fac2_after, b.fac2_after),
        (a.nmse_after, b.nmse_after),
        (a.rmse_before, b.rmse_before),
    ] {
        assert!((a - b).abs() < 1e-9, "{a} {b}");
    }
    let told = maxima.gap.applied.unwrap().scores;
    assert!(!told.is_empty() && told.iter().all(|s| s.what == "maximum"));
    assert!(maxima.gap.notices.iter().any(|n| n.contains("one sampler")));
}

/// Methane measured by others, in ppm as it was logged and in ppb: the same answers, in every digit.
fn methane_in_ppm_and_in_ppb_has_one_answer(data: &Path) {
    assert_one_answer(data, &["ginninderra/neutral"]);
}

fn methane_of_other_sites_in_ppm_and_in_ppb_has_one_answer(data: &Path) {
    assert_one_answer(data, &["metec/event", "ginninderra/stable"]);
}

fn assert_one_answer(data: &Path, names: &[&str]) {
    for name in names {
        let read =
            |end: &str| text(data, &format!("field/{name}.{end}")).replace("co2_ppm", "ch4_ppm");
        let (log, world) = (read("csv"), read("toml"));
        let [ppm, ppb] = [
            (log.clone(), world.clone()),
            (in_ppb(&log), world_in_ppb(&world)),
        ]
        .map(|(log, world)| answer_of(&log, &world));
        assert_eq!(ppm.gas, Some(plume::Gas::Ch4));
        let said = |json: &GapJson| {
            let mut value = serde_json::to_value(json).unwrap();
            // Of raw data is said what the file has, in its unit.
            value.as_object_mut().unwrap().remove("data_quality");
            value
        };
        assert_eq!(said(&ppm), said(&ppb), "{name}");
    }
}

/// Made by others, with what is hidden in `cases/blind-README.md`: intermittent air alone; a gradient that a second source
/// may be as well; a gradient and the zero of one sensor together.
fn cases_of_an_independent_generator_are_answered_right(data: &Path) {
    let answer = |case: &str| {
        let file = |name: &str| text(data, &format!("cases/blind-{case}/{name}"));
        let scenario = Scenario::parse("case", &file("scenario.toml")).unwrap();
        let setup = gap::plume::Setup::new(&scenario).unwrap();
        let log = parse(&[("log", &file("obs.csv"))], scenario.gas()).unwrap();
        let options = gap::plume::Options::default();
        gap::plume::analyse(&setup, &log, &options, &mut |_| ())
            .unwrap()
            .json
    };
    let intermittent = answer("028");
    assert_eq!(
        intermittent.verdict,
        Verdict::None,
        "{}",
        intermittent.summary
    );
    // 1.06 of the mean are a standard deviation of the logarithm of .86.
    assert!(intermittent.noise.unwrap().fluctuation > 0.5);
    for (case, hidden) in [
        ("058", &["background-gradient"][..]),
        ("014", &["background-gradient", "sensor-offset"]),
    ] {
        let json = answer(case);
        for mechanism in hidden {
            let has_it = |c: &gap::verdict::Cause| c.mechanisms.iter().any(|m| m == mechanism);
            assert!(json.causes.iter().any(has_it), "{case}: {}", json.summary);
        }
        assert_eq!(json.causes.len(), hidden.len(), "{case}: {}", json.summary);
    }
}

/// Eight methane sensors round a leak of METEC. What each reads in clean air: the tenth percentile of its readings in
/// minutes when the wind blew more than 60° past it, by Python with numpy (rows with a reading, `off` = wind_from_deg +
/// 180 - bearing of the sensor from the leak, `numpy.quantile(readings[abs(off) > 60], .1)`).
fn a_leak_in_a_wind_that_turns_all_day_is_unexplained(data: &Path) {
    let read =
        |end: &str| text(data, &format!("field/metec/event.{end}")).replace("co2_ppm", "ch4_ppm");
    let scenario = Scenario::parse("world", &read("toml")).unwrap();
    let setup = gap::plume::Setup::new(&scenario).unwrap();
    let log = parse(&[("log", &read("csv"))], scenario.gas()).unwrap();
    let options = gap::plume::Options::default();
    let json = gap::plume::analyse(&setup, &log, &options, &mut |_| ())
        .unwrap()
        .json;
    let known = [
        ("E", 1.833),
        ("N", 1.921),
        ("NE", 1.752),
        ("NW", 1.798),
        ("S", 1.670),
        ("SE", 1.983),
        ("SW", 2.110),
        ("W", 1.959),
    ];
    for (platform, zero_ppm) in known {
        let is_its = |b: &&gap::verdict::BaseParameter| {
            b.name == "zero_ppm" && b.platform.as_deref() == Some(platform)
        };
        let found = json.base.iter().find(is_its).unwrap();
        assert!(
            (found.value - zero_ppm).abs() < 0.05 && found.sd < 0.05,
            "{platform}: {found:?}"
        );
    }
    // A leak of 949 g/h in a wind that turns all day: nothing is named.
    assert_eq!(json.verdict, Verdict::Unexplained, "{}", json.summary);
}

/// One of a drone's two sensors is late against the other. By least squares on a grid of lags and delays, with an
/// autoregressive rest (Python with numpy): 43 s and 8 s, correlation .36 as read and .95 with them.
fn two_sensors_of_one_drone_are_held_against_each_other(data: &Path) {
    let read = |name: &str| text(data, &format!("field/vulcano/{name}"));
    let scenario = Scenario::parse("world", &read("fumaroles.toml")).unwrap();
    let setup = gap::plume::Setup::new(&scenario).unwrap();
    let log = parse(&[("log", &read("two-sensors.csv"))], scenario.gas()).unwrap();
    let options = gap::plume::Options::default();
    let json = gap::plume::analyse(&setup, &log, &options, &mut |_| ())
        .unwrap()
        .json;
    let [pair] = &json.pairs[..] else {
        panic!("{:?}", json.pairs);
    };
    assert_eq!(pair.platforms, ["raven", "smartgas"]);
    let (lag, delay) = (pair.time_constant_s, pair.delay_s);
    assert!((lag.value - 43.0).abs() < 10.0 && lag.sd < 10.0, "{lag:?}");
    assert!((delay.value - 8.0).abs() < 4.0, "{delay:?}");
    assert!(
        pair.correlation_before < 0.4 && pair.correlation_after > 0.9,
        "{pair:?}"
    );
    assert_ne!(json.verdict, Verdict::None, "{}", json.summary);
    let first = &json.causes[0];
    assert_eq!(
        (&first.mechanisms[..], &first.platforms[..]),
        (&["sensor-lag".to_owned()][..], &["raven".to_owned()][..])
    );
}

/// A log of methane in ppm with its readings in ppb.
fn in_ppb(log: &str) -> String {
    let mut lines = log.lines();
    let header = lines.next().unwrap();
    let column = header.split(',').position(|c| c == "ch4_ppm").unwrap();
    let mut out = header.replace("ch4_ppm", "ch4_ppb");
    for line in lines {
        let mut cells: Vec<String> = line.split(',').map(str::to_owned).collect();
        if !cells[column].is_empty() {
            let ppb = 1e3 * cells[column].parse::<f64>().unwrap();
            cells[column] = ((ppb * 1e6).round() / 1e6).to_string();
        }
        out = out + "\n" + &cells.join(",");
    }
    out + "\n"
}

/// The world of such a log with background and prior in ppb.
fn world_in_ppb(world: &str) -> String {
    let in_ppb = |line: &str| match line.split_once("ch4_ppm") {
        None => line.to_owned(),
        Some((before, rest)) => {
            let (between, value) = rest.split_once('=').unwrap();
            let ppb = 1e3 * value.trim().parse::<f64>().unwrap();
            format!("{before}ch4_ppb{between}= {}", (ppb * 1e6).round() / 1e6)
        }
    };
    let lines: Vec<String> = world.lines().map(in_ppb).collect();
    lines.join("\n")
}

/// The answer for a log and a world of the folder of cases.
fn answer(data: &Path, log: &str, world: &str) -> GapJson {
    answer_of(&text(data, &format!("cases/{log}")), world)
}

/// The answer for the text of a log and that of a world.
fn answer_of(log: &str, world: &str) -> GapJson {
    let scenario = Scenario::parse("world", world).unwrap();
    let setup = gap::plume::Setup::new(&scenario).unwrap();
    let log = parse(&[("log", log)], scenario.gas()).unwrap();
    let options = gap::plume::Options::live();
    gap::plume::analyse(&setup, &log, &options, &mut |_| ())
        .unwrap()
        .json
}

/// As made: nothing is hidden in either. Rows before the first fix change nothing at all; codes for the
/// direction in a twentieth of the rows, with 160 kg/s as made, cost no more than a fifth of the certainty.
fn flaws_of_raw_logs_change_no_answer(data: &Path) {
    let told = |name: &str, said: &str| {
        let world = text(data, &format!("cases/{name}.toml"));
        let with = answer(data, &format!("{name}.csv"), &world);
        let without = answer(data, &format!("{name}-without.csv"), &world);
        assert_eq!(with.verdict, Verdict::None, "{name}: {}", with.summary);
        let flaws = &with.data_quality;
        let all = flaws.iter().all(|f| f.message.starts_with(said));
        assert!(all && !flaws.is_empty(), "{flaws:?}");
        let clean = &without.data_quality;
        assert!(clean.is_empty(), "{clean:?}");
        let emission = |json: &GapJson| {
            let mut base = json.base.iter();
            let found = base.find(|b| b.name == "source.emission_kg_s");
            found.map(|b| (b.value, b.sd)).unwrap()
        };
        (emission(&with), emission(&without))
    };
    let (with, without) = told("no-fix", "60 rows without a position fix");
    assert_eq!(with, without);
    let ((value, sd), (_, clean_sd)) =
        told("wind-code", "30 values of -999 in column wind_from_deg");
    assert!((value - 160.0).abs() < 2.0 * sd, "{value} ± {sd}");
    assert!(sd < 1.2 * clean_sd, "{sd} {clean_sd}");
}

fn codes_and_a_direction_of_where_the_wind_blows_to_are_said(data: &Path) {
    let world = text(data, "cases/wind-towards.toml");
    let towards = answer(data, "wind-towards.csv", &world);
    let said =
        |json: &GapJson, what: &str| json.data_quality.iter().any(|f| f.message.contains(what));
    assert!(
        said(&towards, "the plume of the opposite wind"),
        "{:?}",
        towards.data_quality
    );
    // The log's mean is 70 degrees, of where it blows to.
    let contact = towards.contact.unwrap().best_wind_from_deg.unwrap();
    assert!((contact.value - 250.0).abs() < 15.0, "{contact:?}");
    let one = answer(
        data,
        "one-code.csv",
        include_str!("../../../scenarios/as-pontes.toml"),
    );
    assert!(
        said(&one, "1 values of -9999 in column co2_ppm"),
        "{:?}",
        one.data_quality
    );
}
