//! Simulation-based calibration (Talts and others 2018): realities are drawn from the priors, missions are flown in them, and
//! the ranks of the true values among the stated distributions are uniform if these are right.

use crate::bar;
use mission::{MissionError, Setup, campaign};
use protocol::message::Estimate;
use record::summary::{CORRECTED, MissionSummary};
use scenario::random::stream;
use tasks::flights::fly_all;

const MISSIONS: u64 = 100;
/// Long enough to meet the plume some ten times.
const DURATION_S: f64 = 1_300.0;
/// Deciles of the standard normal distribution.
const DECILES: [f64; 9] = [
    -1.2816, -0.8416, -0.5244, -0.2533, 0.0, 0.2533, 0.5244, 0.8416, 1.2816,
];
const BINS: usize = DECILES.len() + 1;
/// Pearson's statistic of ranks that are uniform over ten bins is lower in 99 of 100 cases: χ² of nine degrees of freedom.
const MOST_CHI2: f64 = 21.67;

const STEADY: &str = include_str!("../scenarios/as-pontes-steady.toml");

fn flown(air: &str, seed: u64) -> Result<MissionSummary, MissionError> {
    let nothing = |_: &str| Err("no such file".to_owned());
    let mut setup = Setup::load("drawn.toml", STEADY, &nothing).unwrap();
    setup.scenario = setup
        .scenario
        .with_drawn_reality(&mut stream(seed, "ranks/reality"));
    let reality = setup.scenario.reality.as_mut().unwrap();
    let weather = reality["weather"].as_table_mut().unwrap();
    weather.insert("air".to_owned(), air.into());
    setup.scenario.mission.seed = seed;
    setup.scenario.mission.duration_s = DURATION_S;
    setup.scenario.gap.live = false;
    campaign::fly(&setup)
}

/// Standard deviations by which the truth is above what is stated. Factors and amounts are stated on a logarithm.
fn off(stated: Estimate, truth: f64, is_log: bool) -> f64 {
    if is_log {
        (truth / stated.value).ln() / (stated.sd / stated.value)
    } else {
        (truth - stated.value) / stated.sd
    }
}

fn ranks(air: &str) {
    let flown = fly_all(MISSIONS, |seed| flown(air, seed), || (), || false).unwrap();
    let mut off_by_name: Vec<(&str, Vec<f64>)> = Vec::new();
    for number in &CORRECTED {
        let is_log = ["c_MAX", "sigma-y scale", "sigma-z scale"].contains(&number.name);
        let of = |s: &MissionSummary| {
            let truth = (number.of)(&s.model.reality.unwrap()).value;
            off((number.of)(&s.model.after), truth, is_log)
        };
        off_by_name.push((number.name, flown.iter().map(of).collect()));
    }
    let peak = flown.iter().filter_map(|s| {
        let (stated, truth) = (s.peak.estimate.as_ref()?, s.peak.truth.as_ref()?);
        Some((truth.co2_ppm - stated.co2_ppm) / stated.sd_ppm)
    });
    off_by_name.push(("peak", peak.collect()));
    for (name, off) in off_by_name {
        let mut counts = [0_usize; BINS];
        for z in &off {
            counts[DECILES.partition_point(|edge| edge < z)] += 1;
        }
        let expected = off.len() as f64 / BINS as f64;
        let squares = counts.map(|n| (n as f64 - expected).powi(2) / expected);
        let chi2: f64 = squares.iter().sum();
        let inside = off.iter().filter(|z| z.abs() < 2.0).count();
        println!(
            "{air}, {name}: {counts:?}, within 2 sd {inside} of {}",
            off.len()
        );
        bar::report(
            &format!("ranks of the truth, {air} air, {name}: Pearson's statistic"),
            &format!("< {MOST_CHI2:.1}"),
            format!("{chi2:.1}"),
            chi2 < MOST_CHI2,
        );
    }
}

fn ranks_are_uniform_in_steady_air() {
    ranks("steady");
}

fn ranks_are_uniform_in_unsteady_air() {
    ranks("unsteady");
}

crate::runner::tests! {
    Cores {
        #[ignore = "second tier: a hundred missions"]
        ranks_are_uniform_in_steady_air,
        #[ignore = "second tier: a hundred missions"]
        ranks_are_uniform_in_unsteady_air,
    }
}
