use super::*;
use crate::field::Strength;
use crate::field::tests::spec;
use crate::mechanism::Mechanism;
use crate::sensor::{Sensor, SensorSpec};
use rand::SeedableRng;
use rand::rngs::ChaCha8Rng;

fn model(mechanisms: &[Mechanism]) -> DispersionModel {
    let mut s = spec(Strength::EmissionKgS(352.0));
    s.mechanisms = mechanisms.to_vec();
    DispersionModel::new(s).unwrap()
}

/// A platform weaving across the plume.
fn row(platform: usize, time_s: f64) -> Row {
    Row {
        platform,
        time_s,
        place: Place {
            east_m: 1800.0 + 600.0 * platform as f64,
            north_m: 400.0 * (time_s / 30.0 + platform as f64).sin(),
            height_agl_m: 470.0 + 10.0 * platform as f64,
        },
        wind: None,
        air: SensorAir {
            temperature_c: 12.0,
            relative_humidity_pct: 60.0,
            pressure_hpa: 920.0,
        },
    }
}

/// Two platforms, a row a second.
fn rows() -> Vec<Row> {
    (0..2)
        .flat_map(|p| (0..300).map(move |i| row(p, f64::from(i))))
        .collect()
}

fn names() -> Vec<String> {
    vec!["1".into(), "2".into()]
}

fn predict(mechanisms: &[Mechanism]) -> Vec<f64> {
    let model = model(mechanisms);
    let track = Track::new(&model, &names(), &rows()).unwrap();
    let mut out = vec![0.0; track.len()];
    track.predict(&model, &mut out);
    out
}

// Each row is read by the model of its own class, clock and lag and all.
#[test]
fn classes_that_change_are_each_rows_own() {
    let list = [Mechanism::new("clock-offset", &[("offset_s", 2.0)]).unwrap()];
    for mechanisms in [&list[..0], &list] {
        let [neutral, stable] = [Stability::D, Stability::F].map(|stability| {
            let spec = DispersionSpec {
                stability,
                ..model(mechanisms).spec().clone()
            };
            DispersionModel::new(spec).unwrap()
        });
        let read = |track: &Track, model: &DispersionModel| {
            let mut out = vec![0.0; track.len()];
            track.predict(model, &mut out);
            out
        };
        let track = Track::new(&neutral, &names(), &rows()).unwrap();
        let (by_day, by_night) = (read(&track, &neutral), read(&track, &stable));
        let changing = track.in_classes(&|t| {
            if t < 150.0 {
                Stability::D
            } else {
                Stability::F
            }
        });
        let both = read(&changing, &neutral);
        for (i, value) in both.iter().enumerate() {
            let expected = if changing.time_s()[i] < 150.0 {
                by_day[i]
            } else {
                by_night[i]
            };
            assert!((value - expected).abs() < 1e-9, "{i}: {value} {expected}");
        }
    }
}

#[test]
fn a_plain_track_reads_the_field() {
    let model = model(&[]);
    for (row, reading) in rows().iter().zip(predict(&[])) {
        assert!((model.mean_ppm(&row.place, row.time_s) - reading).abs() < 1e-9);
    }
}

// The sensor that the simulation steps and the track that the analysis predicts are one.
#[test]
fn the_track_reads_as_the_stepped_sensor() {
    let list = [
        Mechanism::new("sensor-lag", &[("time_constant_s", 3.0)]).unwrap(),
        Mechanism::new("sensor-gain", &[("factor", 1.05)]).unwrap(),
        Mechanism::new("sensor-drift", &[("rate_ppm_per_h", 60.0)]).unwrap(),
        Mechanism::new("sensor-saturation", &[("limit_ppm", 700.0)]).unwrap(),
        Mechanism::new("cross-sensitivity-pressure", &[("ppm_per_hpa", 0.01)]).unwrap(),
    ];
    let model = model(&list);
    let readings = predict(&list);
    let mut rng = ChaCha8Rng::seed_from_u64(0);
    for (platform, name) in names().iter().enumerate() {
        let mut sensor = Sensor::new(&SensorSpec::default(), &list, name);
        // The sensor steps much faster than the rows come.
        const STEPS: i32 = 20;
        for step in 0..=299 * STEPS {
            let time_s = f64::from(step) / f64::from(STEPS);
            let at = row(platform, time_s);
            let dt = if step > 0 {
                1.0 / f64::from(STEPS)
            } else {
                0.0
            };
            let truth = model.mean_ppm(&at.place, time_s);
            let stepped = sensor.read_in(truth, &at.air, dt, &mut rng);
            let reading = readings[300 * platform + (step / STEPS) as usize];
            if step % STEPS == 0 {
                assert!(
                    (stepped - reading).abs() < 0.01,
                    "{time_s} s: {stepped} {reading}"
                );
            }
        }
    }
}

// Rows a standard deviation of the plume or more apart: against a sensor that is stepped fifty times
// a second between them.
#[test]
fn a_plume_narrower_than_the_way_between_rows_is_met() {
    const STEPS: i32 = 50;
    const FLOWN_S: i32 = 240;
    let list = [Mechanism::new("sensor-lag", &[("time_constant_s", 3.0)]).unwrap()];
    let model = model(&list);
    for (distance_m, every_s) in [(250.0, 1), (900.0, 4)] {
        let half_m = 0.4 * distance_m;
        let at = |time_s: f64| {
            let to_and_fro_m = (time_s * 20.0 + 0.3 * half_m) % (4.0 * half_m);
            Row {
                place: Place {
                    east_m: distance_m,
                    north_m: (to_and_fro_m - 2.0 * half_m).abs() - half_m,
                    height_agl_m: model.spec().sources[0].effective_height_agl_m + 5.0,
                },
                ..row(0, time_s)
            }
        };
        let rows = (0..FLOWN_S / every_s).map(|i| at(f64::from(i * every_s)));
        let track = Track::new(&model, &names(), &rows.collect::<Vec<_>>()).unwrap();
        let mut readings = vec![0.0; track.len()];
        track.predict(&model, &mut readings);
        let peak_ppm = readings.iter().copied().fold(0.0, f64::max) - 449.0;
        let mut sensor = Sensor::new(&SensorSpec::default(), &list, "1");
        let mut rng = ChaCha8Rng::seed_from_u64(0);
        for step in 0..(FLOWN_S - every_s) * STEPS {
            let time_s = f64::from(step) / f64::from(STEPS);
            let dt_s = f64::from(step.min(1)) / f64::from(STEPS);
            let truth = model.mean_ppm(&at(time_s).place, time_s);
            let stepped = sensor.read_in(truth, &at(time_s).air, dt_s, &mut rng);
            if step % (every_s * STEPS) == 0 {
                let reading = readings[(step / (every_s * STEPS)) as usize];
                assert!(
                    (stepped - reading).abs() < 0.01 * peak_ppm,
                    "{distance_m} m, {time_s} s: {stepped} {reading}, peak {peak_ppm}"
                );
            }
        }
    }
}

#[test]
fn scoped_mechanisms_touch_their_platform_only() {
    let one = Mechanism::new("sensor-offset", &[("offset_ppm", 3.0)]).unwrap();
    let shifted = predict(&[one.for_platforms(&["2".into()])]);
    for (i, (a, b)) in shifted.iter().zip(predict(&[])).enumerate() {
        let expected = if i < 300 { 0.0 } else { 3.0 };
        assert!((a - b - expected).abs() < 1e-9);
    }
}

#[test]
fn clock_and_position_signs() {
    // Logged = true + 5 s: what stands at row i was read five rows before.
    let late = predict(&[Mechanism::new("clock-offset", &[("offset_s", 5.0)]).unwrap()]);
    let plain = predict(&[]);
    for i in (10..290).chain(310..590) {
        assert!((late[i] - plain[i - 5]).abs() < 1e-6, "row {i}");
    }
    // Logged north = true + 25 m: the true place is 25 m further south.
    let model = model(&[]);
    let p = [("east_m", 0.0), ("north_m", 25.0)];
    let moved = predict(&[Mechanism::new("position-offset", &p).unwrap()]);
    for (row, reading) in rows().iter().zip(moved) {
        let place = Place {
            north_m: row.place.north_m - 25.0,
            ..row.place
        };
        assert!((model.mean_ppm(&place, 0.0) - reading).abs() < 1e-9);
    }
}

#[test]
fn the_plume_part_and_the_rest_make_the_reading() {
    let list = [Mechanism::new("sensor-lag", &[("time_constant_s", 3.0)]).unwrap()];
    let model = model(&list);
    let track = Track::new(&model, &names(), &rows()).unwrap();
    let (mut readings, mut part) = (vec![0.0; track.len()], vec![0.0; track.len()]);
    track.predict_parts(&model, &mut readings, Some(&mut part));
    for (r, p) in readings.iter().zip(&part) {
        assert!((r - p - 449.0).abs() < 1e-9);
    }
}

#[test]
fn logged_wind_steers_the_plume() {
    let mut turned = rows();
    for row in &mut turned {
        row.wind = Some((7.0, 280.0));
    }
    let base = model(&[]);
    let track = Track::new(&base, &names(), &turned).unwrap();
    let mut out = vec![0.0; track.len()];
    track.predict(&base, &mut out);
    let offset = Mechanism::new("wind-direction-offset", &[("offset_deg", 10.0)]).unwrap();
    for (a, b) in out.iter().zip(predict(&[offset])) {
        assert!((a - b).abs() < 1e-8);
    }
}

#[test]
fn disorder_is_refused() {
    let model = model(&[]);
    let refused = |change: &dyn Fn(&mut Vec<Row>)| {
        let mut r = rows();
        change(&mut r);
        Track::new(&model, &names(), &r).unwrap_err().to_string()
    };
    assert!(refused(&|r| r.swap(3, 4)).contains("order"));
    assert!(refused(&|r| r[5].time_s = r[4].time_s).contains("order"));
    assert!(refused(&|r| r[5].platform = 9).contains("platform 9"));
    assert!(refused(&|r| r[5].place.east_m = f64::NAN).contains("finite"));
    assert!(Track::new(&model, &names(), &[]).unwrap().is_empty());
}
