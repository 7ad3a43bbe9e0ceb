//! The stated standard deviation holds when the model is wrong in form: readings are made by formulas
//! that the model does not have, and the concentration at a place nearer the source than any reading
//! is asked.

#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    reason = "a test may fail by a panic"
)]

#[path = "../../../tests/bar/mod.rs"]
mod bar;
mod gaussian;

use gaussian::{Model, PEAK, Reality, measured, peak_truth, readings, realities, rows_of};
use infer::{AXIS_DRIFT, Estimate, ForwardModel, Policy, Posterior, Problem, Rows};

/// Time of the asked peak, s: within the record.
const ASKED_S: f64 = 800.0;
const SENSOR_PPM: f64 = 3.0;

fn posterior(model: &Model, rows: &Rows, unit: f64) -> Posterior {
    let policy = Policy::default();
    let asked = [gaussian::place_of_peak()];
    let problem = Problem::new(model, rows, &policy, SENSOR_PPM * unit, &asked);
    problem.posterior().unwrap()
}

fn peak(model: &Model, found: &Posterior) -> Estimate {
    found.at_place(ASKED_S, |at, turn_deg| model.at(at, turn_deg, PEAK))
}

/// Standard deviations by which the peak that seed's readings give is off, and its relative size.
fn off(reality: &Reality, seed: u64) -> (f64, f64) {
    let model = Model::new(1.0);
    let found = posterior(&model, &readings(reality, seed), 1.0);
    let (stated, truth) = (peak(&model, &found), peak_truth(reality, ASKED_S));
    ((stated.value - truth) / stated.sd, stated.sd / truth)
}

/// Realities whose axis stays where the model's may be: the asked place lies on it.
fn steady() -> impl Iterator<Item = (&'static str, Reality)> {
    realities().into_iter().filter(|r| r.1.swing_deg == 0.0)
}

/// Realities of which one case each is fixed here; all of them, with more seeds, are a rate.
const FIXED: [&str; 5] = [
    "as the model",
    "growth .3",
    "decay .003/s",
    "downwash 2e4 m2",
    LACKING,
];
/// The reality with a source that the model lacks. The peak is within what is stated, but known to less than 30 %
/// (docs/limits.md).
const LACKING: &str = "second source";
/// Relative standard deviation from which on a stated peak says nothing.
const SAYS_NOTHING: f64 = 0.3;

#[test]
fn the_truth_is_within_what_is_stated() {
    for (name, reality) in steady().filter(|r| FIXED.contains(&r.0)) {
        let (z, relative_sd) = off(&reality, 1);
        assert!(z.abs() < 3.0, "{name}: {z:.1} standard deviations");
        assert!(
            relative_sd < SAYS_NOTHING || name == LACKING,
            "{name}: {relative_sd}, which says nothing"
        );
        if name == "as the model" {
            assert!(relative_sd < 0.01, "{name}: {relative_sd}");
        }
    }
}

// Of 100 at 95 %, fewer than 88 have a chance below .5 %.
#[test]
#[ignore = "second tier: a rate over many seeds"]
fn two_standard_deviations_hold_the_truth_in_nineteen_of_twenty() {
    let (mut inside, mut all, mut lacking) = (0, 0, Vec::new());
    for (name, reality) in steady() {
        for seed in 1..=9 {
            let (z, relative_sd) = off(&reality, seed);
            println!("{name} {seed}: {z:.1}, {relative_sd:.3}");
            inside += usize::from(z.abs() < 2.0);
            all += 1;
            if name == LACKING {
                lacking.push(relative_sd);
            }
        }
    }
    bar::report(
        "peak by a model of the wrong form: truth within two stated sd",
        "more than 88 %",
        format!("{inside} of {all}"),
        inside as f64 > 0.88 * all as f64,
    );
    lacking.sort_by(f64::total_cmp);
    let median = lacking[lacking.len() / 2];
    bar::report(
        "peak by a model that lacks a source: relative standard deviation",
        "less than 30 %",
        format!("{:.0} %", 100.0 * median),
        median < SAYS_NOTHING,
    );
}

/// Concentrations times a thousand, as from ppm to ppb, change nothing but the unit.
#[test]
fn the_answer_is_the_same_in_another_unit() {
    let (_, reality) = realities()
        .into_iter()
        .find(|r| r.0 == "decay .003/s")
        .unwrap();
    let ppm = measured(&reality, 1);
    let ppb = ppm.iter().map(|m| 1000.0 * m).collect();
    let (in_ppm, in_ppb) = (Model::new(1.0), Model::new(1000.0));
    let a = posterior(&in_ppm, &rows_of(ppm), 1.0);
    let b = posterior(&in_ppb, &rows_of(ppb), 1000.0);
    let (peak_a, peak_b) = (peak(&in_ppm, &a), peak(&in_ppb, &b));
    assert!(
        (peak_b.value / peak_a.value / 1000.0 - 1.0).abs() < 1e-6,
        "{peak_a:?} {peak_b:?}"
    );
    assert!(
        (peak_b.sd / peak_a.sd / 1000.0 - 1.0).abs() < 1e-4,
        "{peak_a:?} {peak_b:?}"
    );
    assert_eq!(a.likeliest_sizes(), b.likeliest_sizes());
}

/// An axis that swings by 60 degrees in 35 minutes: height and strength as they are, where a still
/// plume would find neither.
#[test]
fn a_swinging_axis_is_followed() {
    let (_, reality) = realities()
        .into_iter()
        .find(|r| r.1.swing_deg > 0.0)
        .unwrap();
    let found = posterior(&Model::new(1.0), &readings(&reality, 1), 1.0);
    let (mean, covariance) = (found.mean(), found.covariance());
    for (k, truth) in [
        (1, 540.0),
        (2, 500f64.ln()),
        (3, 1.25f64.ln()),
        (4, 0.85f64.ln()),
    ] {
        let sd = covariance[(k, k)].sqrt();
        assert!(
            (mean[k] - truth).abs() < 3.0 * sd,
            "{k}: {} ± {sd}, truth {truth}",
            mean[k]
        );
    }
    assert!(found.likeliest_sizes()[AXIS_DRIFT] > 0.0);
    // 60 degrees in 2100 s.
    let turned = found.turn_deg(800.0) - found.turn_deg(200.0);
    assert!((turned - 60.0 * 600.0 / 2100.0).abs() < 2.0, "{turned}");
}

/// A quick fit may promise more, by a discrepancy that it has not tried, than a linear problem keeps: its mean stays
/// within the way of a whole search, ten of its longest steps.
#[test]
fn a_mean_is_no_farther_from_the_fit_than_a_search_goes() {
    let model = Model::new(1.0);
    let policy = Policy::default();
    for (name, reality) in realities() {
        let rows = readings(&reality, 1);
        let problem = Problem::new(&model, &rows, &policy, SENSOR_PPM, &[]);
        let found = problem.quick_posterior().unwrap();
        let (mean, point) = (found.mean(), &found.fit().point.at);
        for (k, prior) in model.priors().iter().enumerate() {
            let step_sd = (mean[k] - point[k]).abs() / prior.sd;
            assert!(
                step_sd < 10.0 * policy.longest_step_sd + 1e-9,
                "{name}, {k}: {step_sd}"
            );
        }
    }
}

/// One wild reading is a spike and moves nothing; a plume that the model does not have is none.
#[test]
fn spikes_are_short() {
    let reality = Reality::default();
    let clean = measured(&reality, 1);
    let model = Model::new(1.0);
    let without = peak(&model, &posterior(&model, &rows_of(clean.clone()), 1.0));
    let mut spiked = clean.clone();
    spiked[5] += 800.0;
    let found = posterior(&model, &rows_of(spiked), 1.0);
    let with = peak(&model, &found);
    assert!(found.fit().inflation[5] > 10.0);
    assert!(
        (with.value - without.value).abs() < without.sd,
        "{without:?} {with:?}"
    );
    let mut stretch = clean;
    for reading in &mut stretch[0..15] {
        *reading += 200.0;
    }
    let found = posterior(&model, &rows_of(stretch), 1.0);
    let spikes = found.fit().inflation[0..15]
        .iter()
        .filter(|i| **i > 1.0)
        .count();
    assert!(
        spikes <= 2,
        "{spikes} of 15 readings of another plume count as spikes"
    );
}
