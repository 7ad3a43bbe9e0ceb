//! Two sensors on one platform, made here by steps of a hundredth of a second.

use super::*;
use rand::RngExt;
use scenario::random::stream;

const FRAME: (f64, f64, f64) = (43.4, -7.8, 0.0);

fn frame() -> LocalFrame {
    LocalFrame::new(FRAME.0, FRAME.1, FRAME.2).unwrap()
}

/// How the second sensor reads the air that the first reads at once.
#[derive(Clone, Copy)]
struct Made {
    lag_s: f64,
    delay_s: f64,
    gain: f64,
    zero_ppm: f64,
    noise_ppm: [f64; 2],
    apart_m: f64,
    above_m: f64,
    unit: f64,
}

const ALIKE: Made = Made {
    lag_s: 0.0,
    delay_s: 0.0,
    gain: 1.0,
    zero_ppm: 0.0,
    noise_ppm: [1.0, 1.0],
    apart_m: 0.0,
    above_m: 0.0,
    unit: 1.0,
};

/// Readings of both, two seconds apart for 20 minutes: clouds come by at times of chance.
fn made(of: Made, seed: u64) -> Observations {
    let mut random = stream(seed, "pair");
    // Irwin and Hall: the sum of twelve uniform numbers less six is normal enough.
    let mut normal = |sd: f64| {
        let sum: f64 = (0..12).map(|_| random.random::<f64>()).sum();
        sd * (sum - 6.0)
    };
    let clouds: Vec<(f64, f64, f64)> = (0..40)
        .map(|k| {
            let at_s = 30.0 * f64::from(k) + normal(8.0);
            (at_s, 6.0 + normal(1.5).abs(), 40.0 + normal(15.0).abs())
        })
        .collect();
    let air = |t: f64| -> f64 {
        let of = |(at_s, width_s, ppm): &(f64, f64, f64)| {
            ppm * (-0.5 * ((t - at_s) / width_s).powi(2)).exp()
        };
        420.0 + clouds.iter().map(of).sum::<f64>()
    };
    let step_s = 0.01;
    let (mut lagged, mut rows) = (air(-of.delay_s), Vec::new());
    let degrees = of.apart_m / 111_320.0;
    for k in 0..120_000 {
        let t = step_s * f64::from(k);
        let input = air(t - of.delay_s);
        lagged = if of.lag_s > 0.0 {
            lagged + step_s / of.lag_s * (input - lagged)
        } else {
            input
        };
        if k % 200 != 0 {
            continue;
        }
        let read = [
            air(t) + normal(of.noise_ppm[0]),
            of.zero_ppm + of.gain * lagged + normal(of.noise_ppm[1]),
        ];
        for (platform, ppm) in read.into_iter().enumerate() {
            rows.push(ObservationRow {
                time_s: t,
                platform,
                lat_deg: FRAME.0 + degrees * platform as f64,
                lon_deg: FRAME.1,
                alt_amsl_m: 50.0 + of.above_m * platform as f64,
                co2_ppm: Some(of.unit * ppm),
                wind_speed_m_s: None,
                wind_from_deg: None,
                temperature_c: None,
                relative_humidity_pct: None,
                pressure_hpa: None,
                sd_ppm: None,
                averaging_s: None,
                line_end: None,
                spread_s: 0.0,
            });
        }
    }
    Observations {
        rows,
        platforms: vec!["fast".to_owned(), "other".to_owned()],
        ..Observations::default()
    }
}

fn named(of: Made, seed: u64) -> (Vec<Pair>, Vec<String>) {
    let pairs = pairs(&made(of, seed), &frame());
    let late = late(&pairs, &Policy::default());
    let names = late.iter().map(|l| l.cause.mechanisms[0].clone()).collect();
    (pairs, names)
}

#[test]
fn a_follower_is_found_with_lag_delay_gain_and_zero() {
    let of = Made {
        lag_s: 12.0,
        delay_s: 5.0,
        gain: 1.2,
        zero_ppm: -60.0,
        ..ALIKE
    };
    for seed in 1..=4 {
        let (pairs, names) = named(of, seed);
        assert_eq!(names, ["sensor-lag", "clock-offset"], "{pairs:?}");
        let pair = &pairs[0];
        assert_eq!(pair.platforms, ["other", "fast"]);
        for (found, truth, sharp) in [
            (pair.time_constant_s, 12.0, 1.0),
            (pair.delay_s, 5.0, 0.5),
            (pair.gain, 1.2, 0.05),
            (pair.zero_ppm, -60.0, 20.0),
        ] {
            // Four standard deviations: sixteen numbers are held against them.
            assert!(
                (found.value - truth).abs() < 4.0 * found.sd,
                "{truth} {pair:?}"
            );
            assert!(found.sd > 0.0 && found.sd < sharp, "{truth} {pair:?}");
        }
        assert!(pair.correlation_before < pair.correlation_after);
    }
}

#[test]
fn sensors_that_differ_by_noise_gain_and_zero_are_not_late() {
    for noise_ppm in [[1.0, 1.0], [8.0, 1.0], [1.0, 8.0], [20.0, 2.0]] {
        for seed in 1..=3 {
            let of = Made {
                gain: 0.8,
                zero_ppm: 30.0,
                noise_ppm,
                ..ALIKE
            };
            let (pairs, names) = named(of, seed);
            assert!(names.is_empty(), "{noise_ppm:?} {seed}: {pairs:?}");
        }
    }
}

#[test]
fn sensors_apart_are_no_pair() {
    let late = Made {
        lag_s: 12.0,
        ..ALIKE
    };
    for (apart_m, above_m, count) in [(40.0, 0.0, 0), (0.0, 10.0, 0), (3.0, 1.0, 1)] {
        let of = Made {
            apart_m,
            above_m,
            ..late
        };
        assert_eq!(named(of, 1).0.len(), count, "{apart_m} {above_m}");
    }
}

#[test]
fn a_thousand_times_the_gas_is_the_same_pair() {
    let of = Made {
        lag_s: 20.0,
        ..ALIKE
    };
    let (own, _) = named(of, 1);
    let (thousandfold, _) = named(Made { unit: 1e3, ..of }, 1);
    let (a, b) = (&own[0], &thousandfold[0]);
    assert!((a.time_constant_s.value / b.time_constant_s.value - 1.0).abs() < 1e-3);
    assert!((a.time_constant_s.sd / b.time_constant_s.sd - 1.0).abs() < 1e-2);
    assert!((1e3 * a.zero_ppm.value - b.zero_ppm.value).abs() < 0.1 * b.zero_ppm.sd);
}
