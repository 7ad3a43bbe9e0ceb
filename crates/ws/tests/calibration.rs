//! The model is corrected by readings that another code made: a Gaussian plume written out here
//! from Briggs' (1973) class D, with a lagging, noisy sensor, flown on crosswind passes.

#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    reason = "a test may fail by a panic"
)]

use plume::Place;
use rand::rngs::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use scenario::Scenario;
use scenario::random::stream;
use ws::Calibrator;

const SCENARIO: &str = "\
[site]
lat_deg = 43.4417
lon_deg = -7.8631
ground_amsl_m = 340.0
[weather]
wind_speed_m_s = 7.0
wind_height_agl_m = 486.0
wind_from_deg = 240.0
[background]
co2_ppm = 449.0
[sensor]
time_constant_s = 1.5
noise_sd_ppm = 3.0
[[source]]
lat_deg = 43.4417
lon_deg = -7.8631
effective_height_m = 486.0
c_max_ppm = 410.0
c_max_distance_m = 2400.0
[uncertain]
\"weather.wind_from_deg\" = 12.0
\"source.effective_height_m\" = 50.0
\"source.c_max_ppm\" = 120.0
\"background.co2_ppm\" = 4.0
\"plume.sigma_y_scale\" = 0.3
\"plume.sigma_z_scale\" = 0.3
";

struct Truth {
    background: f64,
    height: f64,
    towards_deg: f64,
    c_max: f64,
    y_scale: f64,
    z_scale: f64,
    decay_per_m: f64,
    /// Standard deviation of the logarithm of its strength, over 5 s.
    flicker: f64,
    /// Standard deviation of its direction, degrees, over a minute.
    wander_deg: f64,
}

const TRUTH: Truth = Truth {
    background: 446.0,
    height: 540.0,
    towards_deg: 72.0,
    c_max: 500.0,
    y_scale: 1.25,
    z_scale: 0.85,
    decay_per_m: 0.0,
    flicker: 0.0,
    wander_deg: 0.0,
};

impl Truth {
    fn ppm(&self, p: &Place) -> f64 {
        let (s, c) = self.towards_deg.to_radians().sin_cos();
        let x = p.east_m * s + p.north_m * c;
        let y = p.east_m * c - p.north_m * s;
        if x <= 1.0 {
            return self.background;
        }
        let spread_y = |x: f64| 0.08 * x / (1.0 + 1e-4 * x).sqrt() * self.y_scale;
        let spread_z = |x: f64| 0.06 * x / (1.0 + 1.5e-3 * x).sqrt() * self.z_scale;
        let (sy, sz) = (spread_y(x), spread_z(x));
        let axis = self.c_max * spread_y(2400.0) * spread_z(2400.0) / (sy * sz);
        let z = p.height_agl_m - self.height;
        let exponent = -0.5 * (y / sy).powi(2) - 0.5 * (z / sz).powi(2) - self.decay_per_m * x;
        self.background + axis * exponent.exp()
    }
}

/// Crosswind passes at `heights` and `distances` from the believed axis, at 18 m/s and 10 Hz.
fn fly(calibrator: &mut Calibrator, distances: &[f64], heights: &[f64], rng: &mut ChaCha8Rng) {
    fly_in(&TRUTH, calibrator, distances, heights, rng);
}

fn fly_in(
    truth: &Truth,
    calibrator: &mut Calibrator,
    distances: &[f64],
    heights: &[f64],
    rng: &mut ChaCha8Rng,
) {
    fly_from(0, truth, calibrator, distances, heights, rng);
}

/// The same after `flown` passes.
fn fly_from(
    flown: u32,
    truth: &Truth,
    calibrator: &mut Calibrator,
    distances: &[f64],
    heights: &[f64],
    rng: &mut ChaCha8Rng,
) {
    let (s, c) = 60f64.to_radians().sin_cos();
    let mut time_s = 100.0 * f64::from(flown);
    let mut lagged: f64 = truth.background;
    let (mut flicker, mut wander) = (0.0, 0.0);
    for (pass, (&x, &h)) in (flown..).zip(
        distances
            .iter()
            .flat_map(|x| heights.iter().map(move |h| (x, h))),
    ) {
        let side = if pass % 2 == 0 { 1.0 } else { -1.0 };
        for k in 0..1000 {
            let y = side * (-900.0 + 1.8 * f64::from(k));
            let place = Place {
                east_m: x * s + y * c,
                north_m: x * c - y * s,
                height_agl_m: h,
            };
            // Ornstein-Uhlenbeck processes in steps of .1 s.
            for (state, memory_s) in [(&mut flicker, 5.0), (&mut wander, 60.0)] {
                let kept = (-0.1f64 / memory_s).exp();
                let random: f64 = StandardNormal.sample(rng);
                *state = kept * *state + (1.0 - kept * kept).sqrt() * random;
            }
            let now = Truth {
                towards_deg: truth.towards_deg + truth.wander_deg * wander,
                c_max: truth.c_max * (truth.flicker * flicker).exp(),
                ..*truth
            };
            lagged += (now.ppm(&place) - lagged) * (1.0 - (-0.1f64 / 2.0).exp());
            let noise: f64 = StandardNormal.sample(rng);
            calibrator.observe(0, time_s, place, None, lagged + 3.0 * noise);
            time_s += 0.1;
        }
    }
}

fn calibrator() -> Calibrator {
    let scenario = Scenario::parse("s.toml", SCENARIO).unwrap();
    Calibrator::new(&scenario, &["6".to_owned()], None).unwrap()
}

#[test]
fn crosswind_passes_find_the_plume() {
    passes_find_the_plume(true);
}

#[test]
fn crosswind_passes_find_the_plume_from_files() {
    passes_find_the_plume(false);
}

fn passes_find_the_plume(in_flight: bool) {
    for seed in 1..=5 {
        let mut c = calibrator();
        fly(
            &mut c,
            &[1200.0, 2000.0],
            &[440.0, 520.0, 600.0],
            &mut stream(seed, "test"),
        );
        if in_flight {
            c.update().unwrap();
        } else {
            c.conclude(1000.0).unwrap();
        }
        let found = c.calibrated();
        let close = |name: &str, e: protocol::message::Estimate, truth: f64, before: f64| {
            let error = (e.value - truth).abs();
            assert!(
                error < (before - truth).abs() / 5.0,
                "{name} of seed {seed}: {e:?}, truth {truth}"
            );
            assert!(
                error < 4.0 * e.sd,
                "{name} of seed {seed}: {e:?}, truth {truth}"
            );
        };
        close("height", found.effective_height_agl_m, TRUTH.height, 486.0);
        close("axis", found.axis_deg, TRUTH.towards_deg, 60.0);
        close("c_max", found.c_max_ppm, TRUTH.c_max, 410.0);
        close("background", found.background_ppm, TRUTH.background, 449.0);
        close("sigma_y", found.sigma_y_scale, TRUTH.y_scale, 1.0);
        close("sigma_z", found.sigma_z_scale, TRUTH.z_scale, 1.0);
    }
}

/// Corrected after each pass, the answer is that of all readings at once from files. The noise is found less
/// well in flight: standard deviations agree within a third.
#[test]
fn the_correction_in_flight_agrees_with_that_from_files() {
    let truth = Truth {
        flicker: 0.1,
        wander_deg: 0.5,
        ..TRUTH
    };
    for seed in 1..=3 {
        let mut c = calibrator();
        let mut rng = stream(seed, "agree");
        let mut flown = 0;
        for distance in [1200.0, 1600.0, 2000.0] {
            for height in [440.0, 520.0, 600.0] {
                fly_from(flown, &truth, &mut c, &[distance], &[height], &mut rng);
                flown += 1;
                c.update().unwrap();
            }
        }
        let mut from_files = c.clone();
        from_files.conclude(1000.0).unwrap();
        let (flown, filed) = (c.calibrated(), from_files.calibrated());
        for (name, a, b) in [
            (
                "height",
                flown.effective_height_agl_m,
                filed.effective_height_agl_m,
            ),
            ("axis", flown.axis_deg, filed.axis_deg),
            ("c_max", flown.c_max_ppm, filed.c_max_ppm),
            ("background", flown.background_ppm, filed.background_ppm),
            ("sigma_y", flown.sigma_y_scale, filed.sigma_y_scale),
            ("sigma_z", flown.sigma_z_scale, filed.sigma_z_scale),
        ] {
            let apart = (a.value - b.value).abs() / b.sd;
            assert!(apart < 0.5, "{name} of seed {seed}: {a:?}, {b:?}");
            let ratio = a.sd / b.sd;
            assert!(
                (0.75..1.33).contains(&ratio),
                "{name} of seed {seed}: {a:?}, {b:?}"
            );
        }
    }
}

#[test]
fn no_readings_leave_the_prior() {
    let mut c = calibrator();
    let before = c.calibrated();
    c.update().unwrap();
    assert_eq!(c.calibrated(), before);
    assert_eq!(before.effective_height_agl_m.sd, 50.0);
    assert!((before.c_max_ppm.value - 410.0).abs() < 1e-9);
    assert!((before.c_max_ppm.sd - 120.0).abs() < 1.0);
}

#[test]
fn bad_readings_are_left_out() {
    let mut c = calibrator();
    for ppm in [f64::NAN, f64::INFINITY] {
        c.observe(0, 0.0, Place::default(), None, ppm);
    }
    c.observe(7, 0.0, Place::default(), None, 400.0);
    assert_eq!(c.taken(), 0);
}

#[test]
fn clean_air_alone_tells_the_background_and_little_else() {
    let mut c = calibrator();
    for k in 0..3000 {
        let place = Place {
            east_m: -2000.0,
            north_m: -1000.0,
            height_agl_m: 300.0,
        };
        c.observe(
            0,
            f64::from(k) * 0.1,
            place,
            None,
            445.0 + f64::from(k % 3) - 1.0,
        );
    }
    c.update().unwrap();
    let found = c.calibrated();
    assert!(
        (found.background_ppm.value - 445.0).abs() < 1.0,
        "{found:?}"
    );
    assert!(found.effective_height_agl_m.sd > 40.0);
}

/// One pass that grazes the plume far below its axis tells little of its height and spread, and
/// must not be read as telling much.
#[test]
fn a_grazing_pass_alone_stays_near_the_prior() {
    for seed in 1..=8 {
        let mut c = calibrator();
        fly(&mut c, &[1500.0], &[470.0], &mut stream(seed, "graze"));
        c.update().unwrap();
        let found = c.calibrated();
        assert!(
            (300.0..700.0).contains(&found.effective_height_agl_m.value),
            "seed {seed}: {found:?}"
        );
        assert!(
            (0.3..3.0).contains(&found.sigma_z_scale.value),
            "seed {seed}: {found:?}"
        );
    }
}

/// A gas that decays on its way, which the model knows nothing of: nearer the source than any reading
/// the plume is stronger than a model fitted to the readings has it, and the standard deviation says so.
#[test]
fn a_model_that_is_wrong_says_how_far() {
    let at = |distance_m: f64| {
        let (s, c) = TRUTH.towards_deg.to_radians().sin_cos();
        Place {
            east_m: distance_m * s,
            north_m: distance_m * c,
            height_agl_m: TRUTH.height,
        }
    };
    let concluded = |truth: &Truth, seed: u64| {
        let mut c = calibrator();
        let (distances, heights) = ([1300.0, 1700.0, 2300.0], [480.0, 540.0]);
        fly_in(
            truth,
            &mut c,
            &distances,
            &heights,
            &mut stream(seed, "decay"),
        );
        c.conclude(1000.0).unwrap();
        c.mean_ppm(&at(1000.0)).unwrap()
    };
    let decaying = Truth {
        decay_per_m: 4e-4,
        ..TRUTH
    };
    for seed in 1..=3 {
        let (right, wrong) = (concluded(&TRUTH, seed), concluded(&decaying, seed));
        for (stated, truth) in [(right, &TRUTH), (wrong, &decaying)] {
            let truth_ppm = truth.ppm(&at(1000.0));
            let error = (stated.value - truth_ppm).abs();
            assert!(
                error < 3.0 * stated.sd,
                "seed {seed}: {stated:?}, truth {truth_ppm}"
            );
        }
        assert!(
            wrong.sd > 2.0 * right.sd,
            "seed {seed}: {wrong:?}, {right:?}"
        );
        assert!(right.sd < 0.02 * right.value, "seed {seed}: {right:?}");
    }
}

#[test]
fn too_little_leaves_the_prior() {
    let mut c = calibrator();
    c.conclude(1000.0).unwrap();
    assert!(c.posterior().is_none());
    for k in 0..30 {
        let upwind = Place {
            east_m: -2000.0,
            north_m: -1000.0,
            height_agl_m: 300.0,
        };
        c.observe(0, f64::from(k), upwind, None, 445.0 + f64::from(k % 3));
    }
    c.finish();
    c.conclude(1000.0).unwrap();
    let found = c.calibrated();
    assert!(
        (found.background_ppm.value - 446.0).abs() < 2.0,
        "{found:?}"
    );
    assert!(found.effective_height_agl_m.sd > 40.0, "{found:?}");
}

/// Readings that carry a wind of their own are carried by it, and so is the peak that is told: the
/// scenario's wind, 12 degrees off, has no part in it.
/// Passes with the wind of the truth logged, as CSV; the readings times `factor`.
fn logged(scenario: &Scenario, factor: f64) -> String {
    let frame = scenario.frame().unwrap();
    let mut text =
        "time_s,platform,lat_deg,lon_deg,alt_amsl_m,co2_ppm,wind_speed_m_s,wind_from_deg\n"
            .to_owned();
    let (s, c) = TRUTH.towards_deg.to_radians().sin_cos();
    for k in 0..600 {
        let side = if k / 100 % 2 == 0 { 1.0 } else { -1.0 };
        let x = 1300.0 + 300.0 * f64::from(k / 100);
        let y = side * (f64::from(k % 100) * 12.0 - 600.0);
        let place = Place {
            east_m: x * s + y * c,
            north_m: x * c - y * s,
            height_agl_m: TRUTH.height,
        };
        let at = frame.to_geodetic(air::geo::Enu {
            east_m: place.east_m,
            north_m: place.north_m,
        });
        let noise = f64::from(k * 7919 % 13) - 6.0;
        text += &format!(
            "{k},6,{:.7},{:.7},{:.1},{},7,{:.1}\n",
            at.lat_deg,
            at.lon_deg,
            place.height_agl_m + 340.0,
            factor * (10.0 * (TRUTH.ppm(&place) + 0.5 * noise)).round() / 10.0,
            TRUTH.towards_deg + 180.0
        );
    }
    text
}

#[test]
fn a_logged_wind_carries_the_answer_too() {
    let scenario = Scenario::parse("s.toml", SCENARIO).unwrap();
    let (s, c) = TRUTH.towards_deg.to_radians().sin_cos();
    let text = logged(&scenario, 1.0);
    let observations = scenario::observations::parse(&[("o.csv", &text)], plume::Gas::Co2).unwrap();
    let found = ws::calibration::offline::calibrate(&scenario, &observations, None).unwrap();
    let axis_deg = found.calibrated.axis_deg;
    let off_deg = (axis_deg.value - TRUTH.towards_deg).abs();
    assert!(off_deg < 4.0 * axis_deg.sd, "{axis_deg:?}");
    let spec = found.calibrator.latest_spec();
    assert!((spec.wind.from_deg() - TRUTH.towards_deg - 180.0).abs() < 0.5);
    let on_axis = Place {
        east_m: 1200.0 * s,
        north_m: 1200.0 * c,
        height_agl_m: TRUTH.height,
    };
    let met = found.calibrator.mean_ppm(&on_axis).unwrap();
    assert!(
        (met.value - TRUTH.ppm(&on_axis)).abs() < 4.0 * met.sd,
        "{met:?}"
    );
    assert!(met.sd < 0.05 * met.value, "{met:?}");
}

/// All concentrations and their settings by a thousandth change the unit alone, with the priors that a
/// scenario marks and with those that it does not.
#[test]
fn a_thousandth_of_the_gas_is_the_same_answer() {
    let thousandth = SCENARIO
        .replace("co2_ppm = 449.0", "co2_ppm = 0.449")
        .replace("noise_sd_ppm = 3.0", "noise_sd_ppm = 0.003")
        .replace("c_max_ppm = 410.0", "c_max_ppm = 0.41");
    let unmarked = "\"source.c_max_ppm\" = 120.0\n\"background.co2_ppm\" = 4.0\n";
    let marked = "\"source.c_max_ppm\" = 0.12\n\"background.co2_ppm\" = 0.004\n";
    for (own, other) in [
        (SCENARIO.to_owned(), thousandth.replace(unmarked, marked)),
        (
            SCENARIO.replace(unmarked, ""),
            thousandth.replace(unmarked, ""),
        ),
    ] {
        let found = [(own, 1.0), (other, 1e-3)].map(|(world, factor)| {
            let scenario = Scenario::parse("s.toml", &world).unwrap();
            let text = logged(&scenario, factor);
            let rows = scenario::observations::parse(&[("o.csv", &text)], scenario.gas()).unwrap();
            let found = ws::calibration::offline::calibrate(&scenario, &rows, None).unwrap();
            (found.calibrated, factor)
        });
        let same = |of: &dyn Fn(&ws::calibration::Calibrated) -> protocol::message::Estimate,
                    ppm: bool| {
            let [(a, _), (b, factor)] = &found;
            let (a, b) = (of(a), of(b));
            let factor = if ppm { *factor } else { 1.0 };
            for (a, b) in [(a.value, b.value), (a.sd, b.sd)] {
                assert!((b / (factor * a) - 1.0).abs() < 1e-3, "{a} {b}");
            }
        };
        same(&|c| c.c_max_ppm, true);
        same(&|c| c.background_ppm, true);
        same(&|c| c.axis_deg, false);
        same(&|c| c.effective_height_agl_m, false);
        same(&|c| c.sigma_y_scale, false);
    }
}

/// Twenty minutes of clean air by a sensor of white noise 2 ppm and a zero that wanders by 6 ppm over 40 s, an
/// Ornstein-Uhlenbeck process written out here.
#[test]
fn clean_air_teaches_the_noise_of_a_sensor() {
    let mut rng = stream(7, "noise");
    let mut normal = || -> f64 { StandardNormal.sample(&mut rng) };
    let keep = (-1.0f64 / 40.0).exp();
    let mut zero_ppm = 6.0 * normal();
    let mut text = "time_s,platform,lat_deg,lon_deg,alt_amsl_m,co2_ppm\n".to_owned();
    for k in 0..1200 {
        // To and fro two kilometres upwind of the source.
        let east_m = f64::from(k % 100) * 10.0;
        let lon_deg = -7.89 + east_m / 80_800.0;
        let ppm = 449.0 + zero_ppm + 2.0 * normal();
        text += &format!("{k},6,43.43,{lon_deg:.7},800,{ppm:.3}\n");
        zero_ppm = keep * zero_ppm + 6.0 * (1.0 - keep * keep).sqrt() * normal();
    }
    let scenario = Scenario::parse("s.toml", SCENARIO).unwrap();
    let rows = scenario::observations::parse(&[("o.csv", &text)], scenario.gas()).unwrap();
    let mut found = ws::calibration::offline::calibrate(&scenario, &rows, None).unwrap();
    found.learn_noise().unwrap();
    let text = found.scenario.to_toml();
    let learned = Scenario::parse("learned.toml", &text).unwrap();
    let sensor = learned.sensor();
    for (value, within, truth) in [
        (sensor.noise_sd_ppm, sensor.noise_sd_ppm_known_within, 2.0),
        (sensor.slow_sd_ppm, sensor.slow_sd_ppm_known_within, 6.0),
        (sensor.slow_time_s, sensor.slow_time_s_known_within, 40.0),
    ] {
        let (value, within) = (value.unwrap(), within.unwrap());
        let off = (value / truth).ln().abs() / within.ln();
        assert!(off < 3.0, "{value} for {truth}, known within {within}");
        assert!(within < 1.7, "{value} is known within {within} only");
    }
}
