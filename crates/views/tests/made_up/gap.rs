//! A made-up gap analysis: a sensor's lag of 8 s, found.

use gap::plume::{GapReport, Series};
use gap::verdict::*;

pub fn json() -> GapJson {
    let evidence = Evidence {
        delta_log_score: 61.3,
        delta_log_evidence: 55.0,
        p_value: 0.002,
    };
    let parameter = Parameter {
        mechanism: "sensor-lag".into(),
        name: "time_constant_s".into(),
        value: 8.02,
        sd: 0.21,
        unit: "s".into(),
    };
    GapJson {
        schema: SCHEMA,
        gas: None,
        readings: None,
        verdict: Verdict::Named,
        summary: "The misfit is a sensor-lag of 8.0 ± 0.2 s on platform 6 (probability .99)."
            .into(),
        causes: vec![Cause {
            mechanisms: vec!["sensor-lag".into()],
            probability: 0.991,
            evidence,
            parameters: vec![parameter],
            platforms: vec!["6".into()],
            settings: Vec::new(),
            onset_s: None,
            nats_to_next: 7.4,
        }],
        ranking: ranking(),
        residual: residual(),
        gain: Some(Gain {
            blocks: 12,
            held_out: held_out(),
        }),
        detectable: vec![Detectable {
            mechanism: "clock-offset".into(),
            parameter: "offset_s".into(),
            value: 0.11,
            unit: "s".into(),
        }],
        next_flight: Some(NextFlight {
            separates: vec!["sensor-lag".into(), "clock-offset".into()],
            platform: Some("uav2".into()),
            description: "cross the plume at half the speed".into(),
            waypoints: vec![Waypoint {
                time_s: 0.0,
                lat_deg: 43.43,
                lon_deg: -7.84,
                alt_amsl_m: 826.0,
            }],
            expected_nats: 31.0,
            settles_probability: 0.99,
        }),
        base: vec![BaseParameter {
            name: "background.co2_ppm".into(),
            platform: None,
            value: 448.9,
            sd: 0.1,
            prior: 5.0,
        }],
        unexplained: None,
        insufficient: None,
        pairs: Vec::new(),
        contact: None,
        discrepancy: None,
        noise: None,
        applied: None,
        data_quality: vec![DataQuality {
            platform: "6".into(),
            kind: Flaw::Frozen,
            from_s: 20.0,
            to_s: 31.0,
            message: "the reading stands still at <449> ppm".into(),
        }],
        notices: vec!["the plume is carried by the scenario's wind".into()],
    }
}

fn ranking() -> Vec<Ranked> {
    let tried = [
        ("sensor-lag", 55.0, 0.991),
        ("clock-offset", 47.6, 0.006),
        ("meander", 3.1, 0.0),
        ("sigma-y-scale", -1.2, 0.0),
        ("second-source", -4.4, 0.0),
    ];
    tried
        .map(|(id, nats, probability)| Ranked {
            mechanisms: vec![id.into()],
            platform: (id == "sensor-lag").then(|| "6".into()),
            delta_log_score: nats + 3.0,
            log_evidence: nats,
            probability,
        })
        .to_vec()
}

fn residual() -> Vec<ResidualBin> {
    let mut bins = Vec::new();
    for (coordinate, unit, width) in [
        ("time", "s", 60.0),
        ("along_wind", "m", 300.0),
        ("across_wind", "σy", 1.0),
    ] {
        for i in -4..5 {
            let from = width * f64::from(i);
            bins.push(ResidualBin {
                coordinate: coordinate.into(),
                platform: None,
                from,
                to: from + width,
                unit: unit.into(),
                count: 60,
                mean_ppm: 4.0 * f64::from(i),
                standardised: (1.3 * f64::from(i)).sin() * 2.0,
            });
        }
    }
    bins
}

fn held_out() -> HeldOut {
    HeldOut {
        log_score_before: -1840.0,
        log_score_after: -1792.0,
        log_score_gain_low: 31.0,
        log_score_gain_high: 66.0,
        rmse_before: 31.0,
        rmse_after: 9.2,
        rmse_change_low: -25.0,
        rmse_change_high: -17.0,
        fac2_before: 0.71,
        fac2_after: 0.93,
        fb_before: 0.12,
        fb_after: 0.01,
        nmse_before: 0.9,
        nmse_after: 0.1,
        mg_before: 1.3,
        mg_after: 1.02,
        vg_before: 2.9,
        vg_after: 1.1,
        intervals_before: [[0.6, 0.8]; 5],
        intervals_after: [[0.9, 0.96]; 5],
    }
}

pub fn report() -> GapReport {
    let n = 600;
    let along = |f: &dyn Fn(f64) -> f64| -> Vec<f64> { (0..n).map(|i| f(f64::from(i))).collect() };
    let plume = |t: f64| 449.0 + 300.0 * (-((t / 20.0).sin() * 2.5).powi(2)).exp();
    let series = Series {
        platform: "6".into(),
        time_s: along(&|t| t),
        east_m: along(&|t| 900.0 + t + 60.0 * (t / 20.0).cos()),
        north_m: along(&|t| -500.0 - 0.6 * t + 500.0 * (t / 20.0).sin()),
        height_agl_m: along(&|_| 486.0),
        along_wind_m: along(&|t| 1000.0 + t),
        across_wind_sigma: along(&|t| 2.5 * (t / 20.0).sin()),
        measured_ppm: along(&|t| if t == 100.0 { f64::NAN } else { plume(t - 8.0) }),
        used: vec![true; 600],
        before_ppm: along(&plume),
        after_ppm: along(&|t| plume(t - 7.9)),
        before_standardised: along(&|t| (plume(t - 8.0) - plume(t)) / 20.0),
        after_standardised: along(&|t| (plume(t - 8.0) - plume(t - 7.9)) / 4.0),
    };
    GapReport {
        series: vec![series],
        autocorrelation_raw: (0..40).map(|k| (-f64::from(k) / 15.0).exp()).collect(),
        autocorrelation_before: (0..40).map(|k| (-f64::from(k) / 6.0).exp()).collect(),
        autocorrelation_after: (0..40).map(|k| if k == 0 { 1.0 } else { 0.02 }).collect(),
        noise: vec![("white".into(), 3.1, "ppm".into())],
        blocks: (0..12)
            .map(|b| {
                (
                    50.0 * f64::from(b),
                    50.0 * f64::from(b + 1),
                    5.0 - 0.6 * f64::from(b),
                )
            })
            .collect(),
        source_m: (0.0, 0.0),
        wind_from_deg: [240.0, 244.0],
    }
}
