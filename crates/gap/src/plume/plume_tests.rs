//! The whole analysis on small made cases. These share the forward model with the finder and
//! check the machine; whether it finds what another model hid is measured by `gap-bench`.

#[path = "../../tests/made/mod.rs"]
pub(super) mod made;

use super::*;
use crate::verdict::{Flaw, Verdict};
use ::plume::field::DispersionModel;
use made::{SCENARIO, observe, observe_in, setup};
use scenario::Scenario;
use scenario::observations::ObservationRow;

fn run(observations: &Observations) -> Analysis {
    analyse(&setup(), observations, &Options::default(), &mut |_| ()).unwrap()
}

#[test]
fn nothing_hidden_is_none() {
    for seed in 1..=4 {
        let a = run(&observe(&[], seed));
        assert_eq!(
            a.json.verdict,
            Verdict::None,
            "seed {seed}: {}",
            a.json.summary
        );
        assert!(a.extension.is_empty() && a.json.gain.is_none());
        assert!(!a.json.detectable.is_empty() && !a.json.residual.is_empty());
    }
}

#[test]
fn a_lag_is_named_measured_and_pays() {
    let a = run(&observe(
        &[("sensor-lag", &[("time_constant_s", 2.5)], &[])],
        11,
    ));
    assert_eq!(a.json.verdict, Verdict::Named, "{}", a.json.summary);
    assert_eq!(a.json.causes[0].mechanisms, ["sensor-lag"]);
    let lag = &a.json.causes[0].parameters[0];
    assert!(
        (lag.value - 2.5).abs() < 4.0 * lag.sd,
        "{lag:?} {:?}",
        a.json.notices
    );
    let h = a.json.gain.unwrap().held_out;
    assert!(h.log_score_after > h.log_score_before + 10.0 && h.rmse_after < h.rmse_before);
    assert_eq!(a.extension[0].id().as_str(), "sensor-lag");
    // The extension is a mechanism that the world runs.
    let mut spec = setup().base;
    spec.mechanisms.extend(a.extension.clone());
    assert!(DispersionModel::new(spec).is_ok());
}

// Wherever it cuts the band from 260 to 340 m in which the platforms weave: between two of the
// heights tried first the readings have no slope that leads to it.
// A steady wind is carried by its mean as well: that must not hide that its log drifts.
#[test]
#[ignore = "not reached: an offset is named for the drift"]
fn a_log_that_drifts_in_a_steady_wind_is_named() {
    const RATE_DEG_PER_H: f64 = 40.0;
    let mut o = observe_in(&[], 5, 0.05);
    for r in &mut o.rows {
        r.wind_from_deg = r
            .wind_from_deg
            .map(|from| from - RATE_DEG_PER_H * r.time_s / 3600.0);
    }
    let a = run(&o);
    let [cause] = a.json.causes.as_slice() else {
        panic!("{}", a.json.summary)
    };
    assert_eq!(cause.mechanisms, ["wind-direction-drift"]);
    let rate = &cause.parameters[0];
    let off = (rate.value - RATE_DEG_PER_H).abs();
    assert!(off < 2.0 * rate.sd, "{}", a.json.summary);
}

#[test]
#[ignore = "not reached: steps in a lid's height lead astray; mixing-lid is among the candidates at most"]
fn a_lid_among_the_tracks_is_found_at_its_height() {
    for (k, height_m) in [304.0, 311.0, 319.0, 328.0, 335.0].into_iter().enumerate() {
        let o = observe(
            &[("mixing-lid", &[("height_m", height_m)], &[])],
            30 + k as u64,
        );
        let a = run(&o);
        assert_eq!(a.json.verdict, Verdict::Named, "{}", a.json.summary);
        assert_eq!(a.json.causes[0].mechanisms, ["mixing-lid"]);
        let found = &a.json.causes[0].parameters[0];
        let off_m = (found.value - height_m).abs();
        assert!(off_m < 4.0 * found.sd && found.sd < 2.0, "{found:?}");
    }
}

#[test]
fn a_fault_of_one_platform_names_the_platform() {
    let a = run(&observe(
        &[("sensor-offset", &[("offset_ppm", 6.0)], &["b"])],
        12,
    ));
    assert_eq!(a.json.causes[0].platforms, ["b"], "{}", a.json.summary);
    assert!(
        a.json.causes[0]
            .mechanisms
            .contains(&"sensor-offset".to_string())
    );
}

#[test]
fn the_answer_repeats() {
    let o = observe(
        &[("background-drift", &[("rate_ppm_per_h", 60.0)], &[])],
        13,
    );
    let again = || run(&o).json.to_json().unwrap();
    assert_eq!(again(), again());
}

/// All concentrations and their settings times a hundred change the unit alone.
#[test]
fn the_answer_is_the_same_in_another_unit() {
    let lag = [("sensor-lag", &[("time_constant_s", 4.0)][..], &[][..])];
    let ppm = observe(&lag, 14);
    let mut ppb = ppm.clone();
    for row in &mut ppb.rows {
        row.co2_ppm = row.co2_ppm.map(|c| 100.0 * c);
    }
    let text = SCENARIO
        .replace("emission_kg_s = 120.0", "emission_kg_s = 12000.0")
        .replace("co2_ppm = 449.0", "co2_ppm = 44900.0")
        .replace("noise_sd_ppm = 1.0", "noise_sd_ppm = 100.0")
        .replace(
            "\"source.emission_kg_s\" = 20.0",
            "\"source.emission_kg_s\" = 2000.0",
        )
        .replace(
            "\"background.co2_ppm\" = 2.0",
            "\"background.co2_ppm\" = 200.0",
        );
    let hundredfold = Setup::new(&Scenario::parse("test.toml", &text).unwrap()).unwrap();
    let options = Options::default();
    let a = run(&ppm).json;
    let b = analyse(&hundredfold, &ppb, &options, &mut |_| ())
        .unwrap()
        .json;
    assert_eq!(a.verdict, b.verdict, "{} | {}", a.summary, b.summary);
    assert_eq!(a.causes.len(), b.causes.len());
    for (a, b) in a.causes.iter().zip(&b.causes) {
        assert_eq!(a.mechanisms, b.mechanisms);
        let (p, q) = (&a.parameters[0], &b.parameters[0]);
        assert!(
            (p.value / q.value - 1.0).abs() < 1e-3 && (p.sd / q.sd - 1.0).abs() < 1e-2,
            "{p:?} {q:?}"
        );
    }
}

#[test]
fn progress_grows_to_one() {
    let mut parts = Vec::new();
    let o = observe(&[], 14);
    analyse(&setup(), &o, &Options::live(), &mut |p| parts.push(p.part)).unwrap();
    assert!(parts.windows(2).all(|w| w[0] <= w[1]) && parts.last() == Some(&1.0));
}

#[test]
fn no_rows_and_no_readings_are_refused() {
    let refused = |o: &Observations| {
        analyse(&setup(), o, &Options::default(), &mut |_| ())
            .unwrap_err()
            .to_string()
    };
    assert!(refused(&Observations::default()).contains("no rows"));
    let mut o = observe(&[], 15);
    o.rows.iter_mut().for_each(|r| r.co2_ppm = None);
    assert!(refused(&o).contains("missing"));
}

#[test]
fn one_reading_tells_nothing_and_says_so() {
    let mut o = observe(&[], 16);
    o.rows.truncate(1);
    let a = run(&o);
    assert_eq!(a.json.verdict, Verdict::Insufficient);
    assert!(a.json.summary.contains("fewer than the"));
}

/// The verdict and the flaws seen after a change to the rows.
fn damaged(change: impl Fn(&mut ObservationRow)) -> (Verdict, Vec<Flaw>) {
    let mut o = observe(&[], 17);
    o.rows.iter_mut().for_each(change);
    let a = run(&o);
    (
        a.json.verdict,
        a.json.data_quality.iter().map(|q| q.kind).collect(),
    )
}

#[test]
fn constant_readings_are_frozen() {
    let (verdict, flaws) = damaged(|r| r.co2_ppm = Some(450.0));
    assert_eq!(verdict, Verdict::Insufficient);
    assert!(flaws.contains(&Flaw::Frozen));
}

#[test]
fn a_frozen_stretch_is_masked_and_makes_no_verdict() {
    let (verdict, flaws) = damaged(|r| {
        if r.platform == 1 && (200.0..300.0).contains(&r.time_s) {
            r.co2_ppm = Some(470.0);
        }
    });
    assert!(flaws.contains(&Flaw::Frozen));
    assert_eq!(verdict, Verdict::None);
}

// Held in the plume only, held nearly everywhere (below the air itself), and held often by a
// sensor of a coarse resolution.
#[test]
#[ignore = "not reached: what is left between the limits of a clipped log is taken for another height"]
fn readings_held_at_a_limit_are_clipped_however_many() {
    let background = setup().base.background_ppm;
    let mut readings: Vec<f64> = observe(&[], 17)
        .rows
        .iter()
        .filter_map(|r| r.co2_ppm)
        .collect();
    readings.sort_by(f64::total_cmp);
    let middle = readings[readings.len() / 2];
    for (limit, step) in [
        (background + 25.0, 0.1),
        (background + 1.0, 0.1),
        (middle.round(), 1.0),
    ] {
        let mut o = observe(&[], 17);
        for r in &mut o.rows {
            r.co2_ppm = r.co2_ppm.map(|c| ((c / step).round() * step).min(limit));
        }
        let held = o.rows.iter().filter(|r| r.co2_ppm == Some(limit)).count();
        let a = run(&o);
        let flaws: Vec<Flaw> = a.json.data_quality.iter().map(|q| q.kind).collect();
        assert!(flaws.contains(&Flaw::Clipped), "{held} held: {flaws:?}");
        let other = |id: &String| id != "sensor-saturation";
        let named = a.json.causes.iter().flat_map(|c| &c.mechanisms);
        assert!(!named.into_iter().any(other), "{}", a.json.summary);
    }
}

#[test]
fn a_spike_is_said_and_what_noise_does_is_not() {
    let spikes = |flaws: &[Flaw]| flaws.iter().filter(|f| **f == Flaw::Outlier).count();
    let (_, clean) = damaged(|_| ());
    assert_eq!(spikes(&clean), 0, "{clean:?}");
    let (verdict, flaws) = damaged(|o| {
        if o.platform == 1 && o.time_s == 200.0 {
            o.co2_ppm = Some(o.co2_ppm.unwrap() + 40.0);
        }
    });
    assert_eq!((verdict, spikes(&flaws)), (Verdict::None, 1), "{flaws:?}");
}

#[test]
fn a_gap_is_reported_and_makes_no_verdict() {
    let (verdict, flaws) = damaged(|r| {
        if (200.0..300.0).contains(&r.time_s) {
            r.co2_ppm = None;
        }
    });
    assert!(flaws.contains(&Flaw::Gap));
    assert_eq!(verdict, Verdict::None);
}

#[test]
fn wrong_units_and_swapped_places_are_suspected_aloud() {
    for factor in [1e3, 1e-3, 1e-6] {
        let (verdict, flaws) = damaged(|r| r.co2_ppm = r.co2_ppm.map(|c| c * factor));
        assert!(matches!(verdict, Verdict::None | Verdict::Insufficient));
        assert!(flaws.contains(&Flaw::Unit), "factor {factor}");
    }
    let (verdict, flaws) = damaged(|r| (r.lat_deg, r.lon_deg) = (r.lon_deg, r.lat_deg));
    assert!(matches!(verdict, Verdict::None | Verdict::Insufficient));
    assert!(flaws.contains(&Flaw::Unit));
}

#[test]
fn repeated_times_are_left_out_and_said() {
    let mut o = observe(&[], 18);
    let again = o.rows[100];
    o.rows.push(again);
    let a = run(&o);
    assert!(
        a.json.notices.iter().any(|n| n.contains("repeat")),
        "{:?}",
        a.json.notices
    );
}

#[test]
fn without_wind_columns_the_scenario_stands_and_says_so() {
    let mut o = observe(&[], 19);
    for r in &mut o.rows {
        (r.wind_speed_m_s, r.wind_from_deg) = (None, None);
    }
    let a = run(&o);
    assert!(a.json.notices.iter().any(|n| n.contains("no wind columns")));
    assert!(a.json.causes.iter().all(|c| c.probability.is_finite()));
}

#[test]
fn ambiguous_answers_propose_a_flight() {
    let o = observe(&[("background-offset", &[("offset_ppm", 25.0)], &[])], 20);
    let a = run(&o);
    if a.json.verdict == Verdict::Ambiguous {
        let next = a
            .json
            .next_flight
            .expect("an ambiguous answer has a next flight");
        assert!(next.waypoints.len() > 2 && next.expected_nats >= 0.0);
    }
    assert_ne!(a.json.verdict, Verdict::None, "{}", a.json.summary);
}

// One of two sensors reads too strongly, or the other too weakly while the source is stronger.
#[test]
#[ignore = "not reached: sensor-gain is among the candidates, but not named"]
fn a_fault_that_may_be_another_platforms_is_said_so() {
    let hidden = (
        "sensor-gain",
        &[("factor", 1.3), ("pivot_ppm", 449.0)][..],
        &["a"][..],
    );
    let three = run(&observe(&[hidden], 5));
    let said = |a: &Analysis| {
        let words = "it may be that of";
        a.json.notices.iter().any(|n| n.contains(words))
    };
    assert_eq!(three.json.verdict, Verdict::Named, "{}", three.json.summary);
    assert_eq!(three.json.causes[0].platforms, ["a"]);
    assert!(!said(&three), "{:?}", three.json.notices);
    let mut two = observe(&[hidden], 5);
    two.rows.retain(|r| r.platform < 2);
    two.platforms.truncate(2);
    let two = run(&two);
    assert_eq!(two.json.verdict, Verdict::Named, "{}", two.json.summary);
    assert_eq!(two.json.causes[0].mechanisms, ["sensor-gain"]);
    assert!(said(&two), "{:?}", two.json.notices);
}

#[path = "inputs_tests.rs"]
mod inputs;
