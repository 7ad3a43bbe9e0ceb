//! Tracer trials: hidden effects in trials made here.

mod made;
mod told;

use gap::tracer::table::Tables;
use gap::tracer::{TracerReport, analyse};
use gap::verdict::Verdict;
use made::{Hidden, made};
use std::ops::Range;
use told::{report, vertical};

fn nothing_is_found_for(seeds: Range<u64>) {
    for seed in seeds {
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
fn nothing_hidden_nothing_found() {
    nothing_is_found_for(0..1);
}

#[test]
#[ignore = "second tier: another seed"]
fn nothing_hidden_nothing_found_of_another_seed() {
    nothing_is_found_for(1..2);
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
    assert!(extended.dispersion_model().is_ok());
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
    assert!(refused("", trials).contains("r.csv: line 1: the file is empty"));
    assert!(refused(header, trials).contains("r.csv: line 2"));
    let negative = format!("{header}1,0,50,1.5,-3\n");
    assert!(refused(&negative, trials).contains("r.csv: line 2, column concentration_mg_m3"));
    assert!(refused(&row, "trial,wind_speed_m_s\n1,5\n").contains("source_rate_g_s"));
    assert!(
        refused(&row, &format!("{trials}1,90,0.5,5\n")).contains("t.csv: line 3, column trial")
    );
    assert!(
        refused(&format!("{header}1,0,0,1.5,3\n"), trials).contains("r.csv: line 2, column east_m")
    );
    let twice = "trial,east_m,east_m,north_m,height_agl_m,concentration_mg_m3\n1,0,0,50,1.5,3\n";
    assert!(
        refused(twice, trials).contains("r.csv: line 1, column east_m: named twice in the header")
    );
    // Readable, but no trial has the Obukhov length.
    let tables = Tables::parse(("r", &row), ("t", trials), None).unwrap();
    let error = analyse(&tables, 1, &mut |_| {})
        .map(|r| r.gap.summary)
        .unwrap_err()
        .to_string();
    assert!(error.contains("at least 4"), "{error}");
    assert!(
        error.contains("of 1 trials 0 have no wind_speed_m_s, 1 no obukhov_length_m"),
        "{error}"
    );
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

fn named_alone(report: &TracerReport) -> Vec<&str> {
    let alone = report.gap.causes.iter().filter(|c| c.mechanisms.len() == 1);
    alone.map(|c| c.mechanisms[0].as_str()).collect()
}

fn names_hold_their_probability_for(seeds: Range<u64>) {
    for seed in seeds {
        for stable in [false, true] {
            let hidden = Hidden {
                growth: 0.08,
                log_scale: 0.1,
                ..Hidden::default()
            };
            let report = report(&made(hidden, stable, seed));
            for cause in &report.gap.causes {
                let alone = cause.mechanisms.len() == 1;
                assert!(
                    cause.probability > if alone { 0.95 } else { 0.5 },
                    "{cause:?}"
                );
                assert!(!alone || cause.evidence.p_value < 0.05, "{cause:?}");
            }
            if report.gap.verdict == Verdict::Named {
                assert_eq!(named_alone(&report).len(), report.gap.causes.len());
            }
        }
    }
}

#[test]
fn a_name_holds_its_probability() {
    names_hold_their_probability_for(20..21);
}

#[test]
#[ignore = "second tier: another seed"]
fn a_name_holds_its_probability_of_another_seed() {
    names_hold_their_probability_for(21..22);
}

/// How many of `seeds` name a hidden factor on the width; it is the first cause in each.
fn named_of_a_factor_on_the_width(seeds: Range<u64>) -> usize {
    let hidden = Hidden {
        log_width: 0.4,
        ..Hidden::default()
    };
    let named = seeds.filter(|&seed| {
        let report = report(&made(hidden, false, seed));
        let cause = &report.gap.causes[0];
        assert_eq!(cause.mechanisms[0], "sigma-y-scale", "{cause:?}");
        report.gap.verdict == Verdict::Named
    });
    named.count()
}

#[test]
fn a_hidden_factor_on_the_width_is_no_growth() {
    named_of_a_factor_on_the_width(36..38);
}

// A growth that is worth a nat by chance, in one of six, keeps the name from the factor.
#[test]
#[ignore = "second tier: six seeds"]
fn a_hidden_factor_on_the_width_is_named_in_two_of_three() {
    let named = named_of_a_factor_on_the_width(36..42);
    assert!(named >= 4, "{named}");
}

fn another_law_of_spread_is_no_loss_for(seeds: Range<u64>) {
    for seed in seeds {
        let hidden = Hidden {
            similarity: true,
            ..Hidden::default()
        };
        let report = report(&made(hidden, false, seed));
        assert!(!vertical(&report).is_empty(), "{}", report.gap.summary);
        assert!(
            !named_alone(&report).contains(&"dry-deposition"),
            "{}",
            report.gap.summary
        );
    }
}

#[test]
fn another_law_of_spread_is_no_loss() {
    another_law_of_spread_is_no_loss_for(0..1);
}

#[test]
#[ignore = "second tier: another seed"]
fn another_law_of_spread_is_no_loss_of_another_seed() {
    another_law_of_spread_is_no_loss_for(1..2);
}

type Slip = fn(&mut Tables);

#[test]
fn amounts_off_by_a_factor_are_said_and_nothing_is_named() {
    let slips: [(&str, Slip); 5] = [
        ("kg/s", |t| {
            t.trials.iter_mut().for_each(|t| t.source_rate_g_s *= 1e-3)
        }),
        ("ug", |t| {
            for r in &mut t.receptors {
                r.concentration_mg_m3 = r.concentration_mg_m3.map(|c| c * 1e3);
            }
        }),
        ("km", |t| {
            for r in &mut t.receptors {
                r.east_m *= 1e-3;
                r.north_m *= 1e-3;
            }
        }),
        ("km/h", |t| {
            for r in &mut t.trials {
                r.wind_speed_m_s = r.wind_speed_m_s.map(|u| u * 3.6);
            }
        }),
        ("four times as much", |t| {
            t.trials.iter_mut().for_each(|t| t.source_rate_g_s *= 4.0);
        }),
    ];
    for (what, slip) in slips {
        let mut tables = made(Hidden::default(), false, 30);
        slip(&mut tables);
        let report = report(&tables);
        assert_eq!(report.gap.verdict, Verdict::Unexplained, "{what}");
        assert!(report.gap.causes.is_empty(), "{what}");
        let unit = |d: &gap::verdict::DataQuality| d.kind == gap::verdict::Flaw::Unit;
        assert!(report.gap.data_quality.iter().any(unit), "{what}");
        let columns = [
            "source_rate_g_s",
            "concentration_mg_m3",
            "wind_speed_m_s",
            "east_m",
        ];
        let said = |n: &String| columns.iter().all(|c| n.contains(c));
        assert!(report.gap.notices.iter().any(said), "{what}");
        assert!(!report.extended_toml.contains("[[mechanism]]"), "{what}");
    }
}

#[test]
fn a_plume_elsewhere_than_the_wind_blows_is_said() {
    let notices = |slip: Slip| {
        let mut tables = made(Hidden::default(), false, 31);
        slip(&mut tables);
        report(&tables).gap.notices.join("; ")
    };
    assert!(!notices(|_| {}).contains("degrees"));
    let turned = notices(|t| {
        t.trials
            .iter_mut()
            .for_each(|t| t.wind_from_deg = Some(0.0))
    });
    assert!(turned.contains("towards"), "{turned}");
    let swapped = notices(|t| {
        for r in &mut t.receptors {
            (r.east_m, r.north_m) = (r.north_m, r.east_m);
        }
    });
    assert!(swapped.contains("swapped"), "{swapped}");
}

#[test]
fn a_width_is_asked_without_deviations_of_azimuth() {
    let hidden = Hidden {
        log_width: 1.6_f64.ln(),
        ..Hidden::default()
    };
    for known in [0, 8] {
        let mut tables = made(hidden, false, 32);
        for trial in &mut tables.trials[known..] {
            trial.sigma_azimuth_deg = None;
        }
        let report = report(&tables);
        let of_scale = |c: &&gap::verdict::Cause| c.mechanisms.iter().any(|m| m == "sigma-y-scale");
        let cause = report.gap.causes.iter().find(of_scale).unwrap();
        let p = &cause.parameters[0];
        assert!((p.value - 1.6).abs() < 3.0 * p.sd + 0.05, "{known} {p:?}");
        let models = &report.tracer.groups[0].lateral_without_azimuth;
        assert!(models[0].mechanisms.contains(&"sigma-y-scale".to_owned()));
        assert!(
            models
                .iter()
                .all(|m| !m.mechanisms.iter().any(|i| i.contains("azimuth")))
        );
    }
}

#[test]
fn one_arc_off_is_a_misfit_without_a_name() {
    let mut tables = made(Hidden::default(), false, 33);
    for r in &mut tables.receptors {
        if (r.east_m.hypot(r.north_m) - 400.0).abs() < 1.0 {
            r.concentration_mg_m3 = r.concentration_mg_m3.map(|c| 2.0 * c);
        }
    }
    let report = report(&tables);
    assert_eq!(
        report.gap.verdict,
        Verdict::Unexplained,
        "{}",
        report.gap.summary
    );
    let u = report.gap.unexplained.unwrap();
    assert_eq!(u.coordinate, "along_wind");
    assert!(u.term.contains("400 m"), "{}", u.term);
}

// The width in these trials is .8 σ_azimuth x^.9 100^.1: about the class's at 200 m times a
// factor f; what extended.toml writes must be f, not the factor on the width by azimuth.
#[test]
fn the_scenario_gets_numbers_over_what_it_runs() {
    let hidden = Hidden {
        azimuth: true,
        log_width: 0.5,
        ..Hidden::default()
    };
    let report = report(&made(hidden, false, 8));
    let mut logs: Vec<f64> = report
        .tracer
        .arcs
        .iter()
        .map(|a| (a.width_m / (0.11 * a.distance_m / (1.0 + 1e-4 * a.distance_m).sqrt())).ln())
        .collect();
    logs.sort_by(f64::total_cmp);
    let over_briggs = logs[logs.len() / 2].exp();
    let extended = scenario::Scenario::parse("extended.toml", &report.extended_toml).unwrap();
    assert!(extended.dispersion_model().is_ok());
    let line = report
        .extended_toml
        .lines()
        .skip_while(|l| !l.contains("\"sigma-y-scale\""))
        .nth(1)
        .unwrap();
    let factor: f64 = line.split(' ').nth(2).unwrap().parse().unwrap();
    assert!(
        (factor / over_briggs - 1.0).abs() < 0.2,
        "{line} {over_briggs}"
    );
    let mut causes = report.gap.causes.iter().zip(&report.tracer.relative_to);
    assert!(
        causes.any(|(c, inputs)| c.mechanisms[0].starts_with("sigma-y")
            && inputs[..] == ["sigma-y-from-azimuth"])
    );
    assert!(report.gap.summary.contains("relative to the width by it"));
}

#[test]
fn scores_do_not_hang_on_the_unit_of_amounts() {
    let tables = made(Hidden::default(), true, 34);
    let mut small = tables.clone();
    small
        .trials
        .iter_mut()
        .for_each(|t| t.source_rate_g_s *= 1e-6);
    for r in &mut small.receptors {
        r.concentration_mg_m3 = r.concentration_mg_m3.map(|c| c * 1e-6);
    }
    let scores = |t: &Tables| report(t).gap.gain.unwrap().held_out;
    let (a, b) = (scores(&tables), scores(&small));
    assert!((a.fac2_before - b.fac2_before).abs() < 1e-9);
    assert!((a.mg_after - b.mg_after).abs() < 1e-6 && (a.vg_after - b.vg_after).abs() < 1e-6);
}

#[test]
fn what_is_odd_about_samplers_is_said() {
    let plain = made(Hidden::default(), false, 35);
    let mut tables = plain.clone();
    let mut strangers: Vec<_> = tables.receptors[..7].to_vec();
    strangers
        .iter_mut()
        .for_each(|r| r.trial = "stranger".into());
    let twice = tables.receptors[10].clone();
    let mut masts = tables.receptors.clone();
    masts.truncate(30);
    masts.iter_mut().for_each(|r| r.height_agl_m = 10.0);
    tables.receptors.extend(strangers);
    tables.receptors.push(twice);
    tables.receptors.extend(masts);
    for t in &mut tables.trials {
        t.roughness_length_m = None;
        t.wind_height_m = None;
    }
    let odd = report(&tables);
    let notices = odd.gap.notices.join("; ");
    for said in [
        "7 rows of the receptors are ignored",
        "stranger",
        "1 rows of the receptors are at the place of another",
        "30 samplers at others are ignored",
        "16 trials have no roughness_length_m",
        "16 trials have no wind_height_m",
    ] {
        assert!(notices.contains(said), "{said}: {notices}");
    }
    assert!(odd.tracer.arcs.iter().all(|a| a.samplers <= 82));
    // A second height that read nothing does not drown the one that did.
    let mut above = plain.clone();
    let mut masts = above.receptors.clone();
    for r in &mut masts {
        (r.height_agl_m, r.concentration_mg_m3) = (10.0, Some(0.0));
    }
    above.receptors.extend(masts);
    let kept = report(&above);
    assert_eq!(kept.tracer.arcs, report(&plain).tracer.arcs);
    // One sampler an arc tells nothing of a plume.
    let mut lone = plain.clone();
    lone.receptors.retain(|r| r.east_m.abs() < 1e-9);
    let refused = analyse(&lone, 1, &mut |_| {}).map(|r| r.gap.summary);
    assert!(
        refused
            .unwrap_err()
            .to_string()
            .contains("0 of them whole ones")
    );
    // A road is no circle: distances that wander by 4 % stay five arcs a trial.
    let mut road = plain;
    for (k, r) in road.receptors.iter_mut().enumerate() {
        let factor = 1.0 + 0.04 * (k as f64 * 0.7).sin();
        (r.east_m, r.north_m) = (r.east_m * factor, r.north_m * factor);
    }
    assert_eq!(report(&road).tracer.arcs.len(), 80);
}
