//! Hides an effect from the team in the reality of a mission, or in generated data, and checks that the programs find it.
//!
//! Tests with a mission do what a user does: they fly it with `plumage run`, find the error of the model with
//! `plumage gap plume`, and fly the extended scenario. The team learns of the reality only by the readings of one aircraft.

use crate::program::{folder, plumage, text};
use gap_truth::{Case, CaseSpec, PlumeEffect};
use scenario::Scenario;
use serde_json::Value;
use std::fs;
use std::path::{Path, PathBuf};

const STEADY: &str = include_str!("../scenarios/as-pontes-steady.toml");
const UNSTEADY: &str = include_str!("../scenarios/as-pontes.toml");
const HIDDEN_CAUSE: &str = include_str!("../scenarios/hidden-cause.toml");

/// Largest accepted error of a number, in its standard deviations; one test checks up to three numbers.
const WITHIN_SD: f64 = 3.0;
/// Seed of the flight of an extended scenario, different from that of the first flight.
const SEED_AGAIN: &str = "103";

/// A hidden effect, with its keys in a scenario.
struct Hidden {
    id: &'static str,
    parameters: &'static [(&'static str, f64)],
}

impl Hidden {
    /// The scenario `base` with the effect in its reality.
    fn in_reality_of(&self, base: &str) -> String {
        let parameters: String = self
            .parameters
            .iter()
            .map(|(name, value)| format!("{name} = {value:?}\n"))
            .collect();
        format!(
            "{base}\n[[reality.mechanism]]\nid = \"{}\"\n{parameters}",
            self.id
        )
    }
}

fn succeeds(arguments: &[&str]) {
    let output = plumage(arguments);
    let told = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{arguments:?}: {told}");
}

fn json(path: &Path) -> Value {
    serde_json::from_str(&fs::read_to_string(path).unwrap()).unwrap()
}

/// Flies a scenario and returns its summary.
fn flown(scenario: &Path, seed: &str, out: &Path) -> Value {
    succeeds(&[
        "run",
        text(scenario),
        "--seed",
        seed,
        "--no-serve",
        "--out",
        text(out),
    ]);
    json(&out.join("summary.json"))
}

/// Compares `scenario` with `data` by `gap plume` and returns the output folder.
fn analysed(data: &[PathBuf], scenario: &Path, dir: &Path) -> PathBuf {
    let out = dir.join("gap");
    let mut arguments = vec!["gap", "plume"];
    arguments.extend(data.iter().map(|file| text(file)));
    arguments.extend(["--scenario", text(scenario), "--out", text(&out)]);
    succeeds(&arguments);
    out
}

/// The cause `id` of an answer, if it is reported with a probability of 0.95.
fn cause<'a>(answer: &'a Value, id: &str) -> Option<&'a Value> {
    let mut causes = answer["causes"].as_array().unwrap().iter();
    let is_reported = |c: &&Value| {
        c["mechanisms"] == serde_json::json!([id]) && c["probability"].as_f64().unwrap() >= 0.95
    };
    causes.find(is_reported)
}

/// Checks that the answer has the cause `id` with the true `parameters`, and that the extended model predicts held-out
/// readings better.
fn is_named(answer: &Value, id: &str, parameters: &[(&str, f64)]) {
    let cause = cause(answer, id).unwrap_or_else(|| panic!("{}", answer["causes"]));
    let found = cause["parameters"].as_array().unwrap();
    for (name, truth) in parameters {
        let found = found.iter().find(|p| p["name"] == *name).unwrap();
        let off = found["value"].as_f64().unwrap() - truth;
        let sd = found["sd"].as_f64().unwrap();
        assert!(
            off.abs() < WITHIN_SD * sd,
            "{name}: {off} off, sd {sd} for {truth}"
        );
    }
    let gain = &answer["gain"]["held_out"];
    assert!(gain["log_score_gain_low"].as_f64().unwrap() > 0.0, "{gain}");
}

/// Checks that nothing else is named, and that the extended model reduces the error of held-out readings.
fn nothing_else_is_named(answer: &Value) {
    assert_eq!(answer["verdict"], "named", "{}", answer["causes"]);
    assert_eq!(answer["causes"].as_array().unwrap().len(), 1);
    let gain = &answer["gain"]["held_out"];
    let of = |key: &str| gain[key].as_f64().unwrap();
    assert!(of("rmse_after") < of("rmse_before"), "{gain}");
}

/// The reality in which a scenario flies.
fn reality(scenario: &Path) -> plume::DispersionSpec {
    let read = fs::read_to_string(scenario).unwrap();
    let parsed = Scenario::parse(text(scenario), &read).unwrap();
    parsed.in_reality().dispersion_spec().unwrap()
}

/// The answer of the analysis, and the summary of the flight of the extended scenario.
struct Found {
    answer: Value,
    again: Value,
}

/// Flies `scenario`, checks that `hidden` is found in flight and from the record, and flies the extended scenario in the same
/// reality.
fn finds(name: &str, scenario: &str, seed: &str, hidden: &Hidden) -> Found {
    let dir = folder(name);
    let before = dir.join("before.toml");
    fs::write(&before, scenario).unwrap();
    let flight = dir.join("flight");
    let summary = flown(&before, seed, &flight);
    let gap = analysed(&[flight.join("mission.mcap")], &before, &dir);
    let answer = json(&gap.join("gap.json"));
    is_named(&answer, hidden.id, hidden.parameters);
    assert_eq!(summary["gap"]["verdict"], answer["verdict"]);
    assert!(cause(&summary["gap"], hidden.id).is_some());

    let extended = gap.join("extended.toml");
    // Compared as text, since a setting may be NaN.
    let [of_extended, of_before] = [&extended, &before].map(|s| format!("{:?}", reality(s)));
    assert_eq!(of_extended, of_before);
    let again = flown(&extended, SEED_AGAIN, &dir.join("again"));
    assert!(
        cause(&again["gap"], hidden.id).is_none(),
        "{}",
        again["gap"]
    );
    let peak = &again["peak"];
    let of = |value: &Value| value.as_f64().unwrap();
    let off_ppm = of(&peak["estimate"]["co2_ppm"]) - of(&peak["truth"]["co2_ppm"]);
    let sd_ppm = of(&peak["estimate"]["sd_ppm"]);
    assert!(off_ppm.abs() < WITHIN_SD * sd_ppm, "{peak}");
    Found { answer, again }
}

/// The same in steady air, where the hidden effect is the only deviation, so that the extended scenario explains all readings.
fn finds_alone(name: &str, scenario: &str, hidden: &Hidden) {
    let Found { answer, again } = finds(name, scenario, "3", hidden);
    nothing_else_is_named(&answer);
    assert_eq!(again["gap"]["verdict"], "none", "{}", again["gap"]);
    assert_eq!(again["peak"]["status"], "confirmed", "{}", again["peak"]);
}

/// The mission of README, *Find a hidden cause*.
fn a_second_source_is_found_and_flown() {
    let hidden = Hidden {
        id: "second-source",
        parameters: &[("east_m", 200.0), ("north_m", -330.0), ("ratio", 0.6)],
    };
    finds_alone("hidden-second-source", HIDDEN_CAUSE, &hidden);
}

fn a_wind_that_veers_with_height_is_found_and_flown() {
    let hidden = Hidden {
        id: "wind-veer-with-height",
        parameters: &[("rate_deg_per_100m", 5.0)],
    };
    let scenario = hidden.in_reality_of(STEADY);
    finds_alone("hidden-veer", &scenario, &hidden);
}

fn an_emission_that_grows_is_found_and_flown() {
    let hidden = Hidden {
        id: "emission-trend",
        parameters: &[("rate_per_h", 1.5)],
    };
    let scenario = hidden.in_reality_of(STEADY);
    finds_alone("hidden-trend", &scenario, &hidden);
}

fn a_gradient_of_the_background_is_found_in_unsteady_air() {
    let hidden = Hidden {
        id: "background-gradient",
        parameters: &[("east_ppm_per_km", 6.0), ("north_ppm_per_km", -4.0)],
    };
    let scenario = hidden.in_reality_of(UNSTEADY);
    finds("hidden-gradient", &scenario, "6", &hidden);
}

/// Observations of a generator that shares no code with the analysis.
fn an_effect_in_measured_data_is_found() {
    let effect = PlumeEffect::WindDirectionDrift;
    let case = Case::make(&CaseSpec::one(2, effect, 8.0));
    let dir = folder("hidden-in-data");
    let scenario = dir.join("scenario.toml");
    fs::write(&scenario, &case.scenario_toml).unwrap();
    let written = case.observations.iter().map(|(name, csv)| {
        let file = dir.join(name);
        fs::write(&file, csv).unwrap();
        file
    });
    let data: Vec<PathBuf> = written.collect();
    let gap = analysed(&data, &scenario, &dir);
    let truth = &case.truth.effects[0];
    let parameters: Vec<(&str, f64)> = truth.parameters.iter().map(|p| (p.name, p.value)).collect();
    let answer = json(&gap.join("gap.json"));
    is_named(&answer, effect.id(), &parameters);
    nothing_else_is_named(&answer);
}

crate::runner::tests! {
    Cores {
        a_second_source_is_found_and_flown,
        a_wind_that_veers_with_height_is_found_and_flown,
        an_emission_that_grows_is_found_and_flown,
        a_gradient_of_the_background_is_found_in_unsteady_air,
        an_effect_in_measured_data_is_found,
    }
}
