//! The ratio to a tracer.

use crate::made::SCENARIO;
use crate::{scenario, trial};
use libtest_mimic::Trial;
use plume::Gas;
use scenario::observations::parse;

pub fn trials() -> Vec<Trial> {
    vec![
        trial(
            "a_tracer_gives_the_rate_by_the_ratio",
            a_tracer_gives_the_rate_by_the_ratio,
        ),
        trial(
            "noise_that_both_gases_share_bends_no_ratio",
            noise_that_both_gases_share_bends_no_ratio,
        ),
    ]
}

/// Methane and carbon monoxide in one plume that comes and goes, and noise of another period. Molar masses 16.043 and
/// 28.010 g/mol; two of methane for one of carbon monoxide.
fn a_tracer_gives_the_rate_by_the_ratio() {
    let text = |ch4_per_co: f64| {
        let mut text = String::from("time_s,platform,lat_deg,lon_deg,alt_amsl_m,ch4_ppm,co_ppm\n");
        for k in 0..1200u32 {
            let t = f64::from(k);
            let plume = (t / 23.0).sin().max(0.0) * (1.0 + 0.5 * (t / 7.0).cos());
            let noise = 0.01 * (t / 3.1).sin();
            let (ch4, co) = (2.0 + ch4_per_co * plume + noise, 0.1 + plume - noise);
            text += &format!("{t},car,45.0,5.0,103.0,{ch4:.6},{co:.6}\n");
        }
        text
    };
    let log = text(2.0);
    let read = |gas| parse(&[("made.csv", log.as_str())], gas).unwrap();
    let found = study::tracer::estimate(
        &scenario(SCENARIO),
        &read(Gas::Ch4),
        (&read(Gas::Co), 1.0e-3),
    )
    .unwrap();
    let expected = 2.0 * 1.0e-3 * 16.043 / 28.010;
    assert!(
        (found.kg_s.value / expected - 1.0).abs() < 0.02,
        "{found:?}"
    );
    assert!(found.kg_s.low95 < expected && expected < found.kg_s.high95);
    // Without methane in the plume both have nothing in common.
    let log = text(0.0);
    let read = |gas| parse(&[("made.csv", log.as_str())], gas).unwrap();
    let refused = study::tracer::estimate(
        &scenario(SCENARIO),
        &read(Gas::Ch4),
        (&read(Gas::Co), 1.0e-3),
    );
    assert!(
        refused
            .unwrap_err()
            .to_string()
            .contains("do not vary together")
    );
}

/// The file and the figures are those of `tests/oracle/tracer.py`.
fn noise_that_both_gases_share_bends_no_ratio() {
    let log = include_str!("../../../tests/oracle/tracer.csv");
    let read = |gas| parse(&[("tracer.csv", log)], gas).unwrap();
    let tracer = (&read(Gas::C2h2), 0.8e-3);
    let found = study::tracer::estimate(&scenario(SCENARIO), &read(Gas::Ch4), tracer).unwrap();
    let (truth, ordinary) = (1.5e-3, 1.4352e-3);
    let rate = found.kg_s;
    assert!(
        (rate.value - truth).abs() < 0.3 * (truth - ordinary),
        "{found:?}"
    );
    assert!(rate.low95 < truth && truth < rate.high95, "{found:?}");
    // As sharp as the gains and the metered release allow.
    assert!(rate.ln_sd() < 0.1, "{found:?}");
}
