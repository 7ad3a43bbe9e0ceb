//! Tracer trials: hidden effects in trials made here, and the measured ones of Prairie Grass.

#![allow(clippy::unwrap_used, reason = "helpers of tests may fail loudly")]

use std::fmt::Write as _;

use gap::tracer::table::Tables;
use gap::tracer::{TracerReport, analyse};
use gap::verdict::Verdict;
use rand::rngs::ChaCha8Rng;
use rand::{RngExt, SeedableRng};
use rand_distr::StandardNormal;

/// What is hidden in made trials.
#[derive(Clone, Copy, Default)]
struct Hidden {
    /// σz times (x/200 m)^this.
    growth: f64,
    /// ln of a factor on σz.
    log_scale: f64,
    /// Deposition velocity, m/s: a loss that grows with the root of distance.
    deposition_m_s: f64,
    /// Width follows σ_azimuth rather than the class.
    azimuth: bool,
}

/// Sixteen trials of class C (L = -30 m) or E (L = 25 m), formulas written out here: Briggs rural
/// C σy .11 x/√(1+.0001x), σz .08 x/√(1+.0002x); E .06 x/√(1+.0001x), .03 x/(1+.0003x).
fn made(hidden: Hidden, stable: bool, seed: u64) -> Tables {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut normal = |sd: f64| sd * rng.sample::<f64, _>(StandardNormal);
    let mut receptors = String::from("trial,east_m,north_m,height_agl_m,concentration_mg_m3\n");
    let mut trials = String::from(
        "trial,source_rate_g_s,source_height_agl_m,wind_speed_m_s,wind_height_m,wind_from_deg,\
         obukhov_length_m,sigma_azimuth_deg,roughness_length_m\n",
    );
    let pi = std::f64::consts::PI;
    for trial in 0..16 {
        let u = 5.0 + normal(0.8);
        let (a_y, length) = if stable { (0.06, 25.0) } else { (0.11, -30.0) };
        let azimuth_deg = 8.0 * normal(0.3).exp();
        let _ = writeln!(
            trials,
            "{trial},90,0.46,{u},2,180,{length},{azimuth_deg},0.006"
        );
        let level = normal(0.12);
        for x in [50.0_f64, 100.0, 200.0, 400.0, 800.0] {
            let class_c = 0.08 * x / (1.0 + 2e-4 * x).sqrt();
            let class_e = 0.03 * x / (1.0 + 3e-4 * x);
            let sz = if stable { class_e } else { class_c };
            let sz = sz * (hidden.log_scale + hidden.growth * (x / 200.0).ln()).exp();
            let sy = if hidden.azimuth {
                0.8 * f64::to_radians(azimuth_deg) * x * (x / 100.0).powf(-0.1)
            } else {
                a_y * x / (1.0 + 1e-4 * x).sqrt()
            };
            let sy = sy * normal(0.06).exp();
            let lost = (-hidden.deposition_m_s * 2.2 * x.sqrt() / u).exp();
            let bell = |z: f64| (-0.5 * (z / sz).powi(2)).exp();
            let vertical = bell(1.5 - 0.46) + bell(1.5 + 0.46);
            let error = (level + normal(0.1)).exp();
            let peak = 90_000.0 / (2.0 * pi * u * sy * sz) * vertical * lost * error;
            for k in -40..=40 {
                let azimuth = f64::from(k) * 1.5_f64.to_radians();
                let c = peak * (-0.5 * (azimuth * x / sy).powi(2)).exp();
                let (e, n) = (x * azimuth.sin(), x * azimuth.cos());
                let _ = writeln!(receptors, "{trial},{e},{n},1.5,{c}");
            }
        }
    }
    Tables::parse(("receptors", &receptors), ("trials", &trials), None).unwrap()
}

fn report(tables: &Tables) -> TracerReport {
    analyse(tables, 1, &mut |_| {}).unwrap()
}

fn vertical(report: &TracerReport) -> Vec<&str> {
    let ids = [
        "sigma-z-growth",
        "sigma-z-scale",
        "dry-deposition",
        "first-order-decay",
    ];
    let causes = report
        .gap
        .causes
        .iter()
        .flat_map(|c| &c.mechanisms)
        .map(String::as_str);
    causes.filter(|m| ids.contains(m)).collect()
}

#[test]
fn nothing_hidden_nothing_found() {
    for seed in 0..2 {
        for stable in [false, true] {
            let report = report(&made(Hidden::default(), stable, seed));
            assert_eq!(
                vertical(&report),
                [""; 0],
                "{stable} {seed}: {}",
                report.gap.summary
            );
        }
    }
}

#[test]
fn a_hidden_growth_is_named_with_its_size() {
    let report = report(&made(
        Hidden {
            growth: 0.35,
            ..Hidden::default()
        },
        false,
        5,
    ));
    assert_eq!(
        vertical(&report),
        ["sigma-z-growth"],
        "{}",
        report.gap.summary
    );
    let p = &report.gap.causes[0].parameters[0];
    assert_eq!(
        (p.mechanism.as_str(), p.name.as_str()),
        ("sigma-z-growth", "exponent")
    );
    assert!((p.value - 0.35).abs() < 3.0 * p.sd && p.sd < 0.08, "{p:?}");
    assert!(report.gap.summary.contains("faster"));
    let extended = scenario::Scenario::parse("extended.toml", &report.extended_toml).unwrap();
    assert!(extended.mechanisms.iter().any(|m| m.id == "sigma-z-growth"));
    assert!(extended.world().is_ok());
}

#[test]
fn a_hidden_scale_or_loss_is_in_the_set_and_never_decay() {
    for stable in [false, true] {
        let scale = report(&made(
            Hidden {
                log_scale: -0.4,
                ..Hidden::default()
            },
            stable,
            6,
        ));
        assert!(
            vertical(&scale).contains(&"sigma-z-scale"),
            "{}",
            scale.gap.summary
        );
        let loss = report(&made(
            Hidden {
                deposition_m_s: 0.05,
                ..Hidden::default()
            },
            stable,
            7,
        ));
        let found = vertical(&loss);
        assert!(found.contains(&"dry-deposition"), "{}", loss.gap.summary);
        assert!(!found.contains(&"first-order-decay"));
    }
}

#[test]
fn a_width_that_follows_the_azimuth_is_found() {
    let report = report(&made(
        Hidden {
            azimuth: true,
            ..Hidden::default()
        },
        false,
        8,
    ));
    let names: Vec<&String> = report
        .gap
        .causes
        .iter()
        .flat_map(|c| &c.mechanisms)
        .collect();
    assert!(
        names.iter().any(|n| *n == "sigma-y-from-azimuth"),
        "{}",
        report.gap.summary
    );
}

#[test]
fn bad_tables_are_refused_with_line_and_column() {
    let header = "trial,east_m,north_m,height_agl_m,concentration_mg_m3\n";
    let trials = "trial,source_rate_g_s,source_height_agl_m,wind_speed_m_s\n1,90,0.5,5\n";
    let refused = |r: &str, t: &str| match Tables::parse(("r.csv", r), ("t.csv", t), None) {
        Ok(_) => panic!("must be refused: {r} {t}"),
        Err(error) => error.to_string(),
    };
    let row = format!("{header}1,0,50,1.5,3\n");
    assert!(refused("", trials).contains("r.csv: line 1, column trial"));
    assert!(refused(header, trials).contains("r.csv: line 2"));
    let negative = format!("{header}1,0,50,1.5,-3\n");
    assert!(refused(&negative, trials).contains("r.csv: line 2, column concentration_mg_m3"));
    assert!(refused(&row, "trial,wind_speed_m_s\n1,5\n").contains("source_rate_g_s"));
    assert!(
        refused(&row, &format!("{trials}1,90,0.5,5\n")).contains("t.csv: line 3, column trial")
    );
    // Readable, but no trial has the Obukhov length.
    let tables = Tables::parse(("r", &row), ("t", trials), None).unwrap();
    let error = analyse(&tables, 1, &mut |_| {})
        .map(|r| r.gap.summary)
        .unwrap_err()
        .to_string();
    assert!(error.contains("at least 4"), "{error}");
}

#[test]
fn trials_without_deviation_of_azimuth_keep_briggs_width() {
    let mut tables = made(
        Hidden {
            growth: 0.35,
            ..Hidden::default()
        },
        false,
        9,
    );
    for trial in &mut tables.trials {
        trial.sigma_azimuth_deg = None;
    }
    let report = report(&tables);
    assert_eq!(
        vertical(&report),
        ["sigma-z-growth"],
        "{}",
        report.gap.summary
    );
    assert!(report.gap.gain.unwrap().held_out.nmse_after.is_finite());
    // One trial alone without it, where the others' widths follow it.
    let mut tables = made(
        Hidden {
            azimuth: true,
            ..Hidden::default()
        },
        false,
        8,
    );
    tables.trials[3].sigma_azimuth_deg = None;
    let report = analyse(&tables, 1, &mut |_| {}).unwrap();
    assert!(
        report
            .tracer
            .arcs
            .iter()
            .all(|a| a.held_out_max_mg_m3.is_finite())
    );
}

fn prairie_grass(with_towers: bool) -> Option<Tables> {
    let folder = concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/../../../shared/data/prairie-grass/"
    );
    let read = |name: &str| std::fs::read_to_string(format!("{folder}{name}.csv")).ok();
    let (receptors, trials, towers) = (read("receptors")?, read("trials")?, read("towers")?);
    let towers = with_towers.then_some(("towers.csv", towers.as_str()));
    Some(
        Tables::parse(
            ("receptors.csv", &receptors),
            ("trials.csv", &trials),
            towers,
        )
        .unwrap(),
    )
}

// Barad (1958); bars: FAC2 at least .90 and NMSE at most .40 on trials left out, from .79 and .69
// by Briggs with the wind at 2 m.
#[test]
fn prairie_grass_says_what_is_known_of_it() {
    for with_towers in [true, false] {
        let Some(tables) = prairie_grass(with_towers) else {
            eprintln!("the measured trials are not on this machine: nothing checked");
            return;
        };
        let report = report(&tables);
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
        let json: serde_json::Value = serde_json::from_str(&report.to_json().unwrap()).unwrap();
        assert!(json["gain"]["held_out"]["fac2_after"].as_f64().unwrap() >= 0.90);
        assert_eq!(json["schema"], "plumage.gap/1");
    }
}
