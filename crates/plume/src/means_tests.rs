use super::*;
use crate::effects::SensorAir;
use crate::field::Strength;
use crate::field::tests::spec;
use crate::mechanism::Mechanism;
use air::wind::WindProfile;

fn model(mechanisms: &[Mechanism]) -> DispersionModel {
    let mut s = spec(Strength::EmissionKgS(352.0));
    s.mechanisms = mechanisms.to_vec();
    DispersionModel::new(s).unwrap()
}

fn row(platform: usize, time_s: f64, place: Place, wind: Option<(f64, f64)>) -> Row {
    Row {
        platform,
        time_s,
        place,
        wind,
        air: SensorAir::UNKNOWN,
    }
}

/// A place downwind of the source of `spec`, on its axis but for `across_m`.
fn there(model: &DispersionModel, far_m: f64, across_m: f64) -> Place {
    let source = &model.spec().sources[0];
    let towards_deg = air::wind::towards_deg(model.spec().wind.from_deg());
    let at = source
        .place
        .displaced(towards_deg, far_m)
        .displaced(towards_deg + 90.0, across_m);
    Place {
        east_m: at.east_m,
        north_m: at.north_m,
        height_agl_m: source.effective_height_agl_m,
    }
}

fn read(model: &DispersionModel, names: &[&str], rows: &[Row], spans: &[Span]) -> Vec<f64> {
    let names: Vec<String> = names.iter().map(|n| (*n).to_owned()).collect();
    let track = Track::of_means(model, &names, rows, spans).unwrap();
    let mut out = vec![0.0; track.len()];
    track.predict(model, &mut out);
    out
}

fn over(averaging_s: f64) -> Span {
    Span {
        averaging_s,
        ..Span::default()
    }
}

// Ten seconds at 20 m/s are two widths of the plume: against the mean of 2,000 moments on the way, to a
// thousandth of the axis.
#[test]
fn the_mean_of_a_moving_sensor_is_that_of_its_way() {
    let model = model(&[]);
    let at = |time_s: f64| there(&model, 1000.0, 20.0 * (time_s - 30.0));
    let top = model.mean_ppm(&at(30.0), 0.0) - model.background_ppm(&at(30.0), 0.0);
    let times: Vec<f64> = (1..=12).map(|k| 5.0 * f64::from(k)).collect();
    let rows: Vec<Row> = times.iter().map(|t| row(0, *t, at(*t), None)).collect();
    let read = read(&model, &["a"], &rows, &vec![over(10.0); rows.len()]);
    // The first begins before anybody knows where it was.
    for (time_s, read) in times.iter().zip(&read).skip(2) {
        let moment = |k: i32| time_s - 10.0 * (f64::from(k) + 0.5) / 2000.0;
        let mean = (0..2000)
            .map(|k| model.mean_ppm(&at(moment(k)), moment(k)))
            .sum::<f64>()
            / 2000.0;
        assert!((mean - read).abs() < 1e-3 * top, "{time_s}: {mean} {read}");
    }
}

// A mast logs the wind every 10 s while it turns across the plume; the sensor states means over a minute.
#[test]
fn the_wind_logged_within_a_mean_counts() {
    let model = model(&[]);
    let place = there(&model, 1500.0, 0.0);
    let axis_deg = model.spec().wind.from_deg();
    let speed = model.spec().wind.speed_at_m_s(place.height_agl_m);
    let wind = |k: i32| (speed, axis_deg + 1.5 * f64::from(k - 15));
    let mut rows: Vec<Row> = (1..=5)
        .map(|k| row(0, 60.0 * f64::from(k), place, None))
        .collect();
    let mut spans = vec![over(60.0); rows.len()];
    rows.extend((0..30).map(|k| row(1, 10.0 * f64::from(k) + 5.0, place, Some(wind(k)))));
    spans.resize(rows.len(), Span::default());
    let read = read(&model, &["sensor", "mast"], &rows, &spans);
    for (minute, read) in (0..5).zip(read) {
        let of = |k: i32| {
            let (speed, from_deg) = wind(6 * minute + k);
            let profile = model.spec().wind;
            let now = WindProfile::new(speed, place.height_agl_m, from_deg, profile.exponent());
            let mut spec = model.spec().clone();
            spec.wind = now.unwrap();
            DispersionModel::new(spec).unwrap().mean_ppm(&place, 0.0)
        };
        let mean = (0..6).map(of).sum::<f64>() / 6.0;
        assert!((mean - read).abs() < 1e-6 * mean, "{minute}: {mean} {read}");
    }
}

// A line straight across a plume far narrower than it: the integral of a normal law is σ √(2π) times its middle.
#[test]
fn a_line_across_a_narrow_plume_reads_its_integral() {
    let model = model(&[]);
    for far_m in [60.0, 250.0, 1000.0] {
        let (from, to) = (there(&model, far_m, -317.0), there(&model, far_m, 683.0));
        let span = Span {
            to: Some(to),
            ..Span::default()
        };
        let read = read(&model, &["laser"], &[row(0, 0.0, from, None)], &[span])[0];
        let axis = there(&model, far_m, 0.0);
        let background = model.background_ppm(&axis, 0.0);
        let top = model.mean_ppm(&axis, 0.0) - background;
        let integral = top * model.sigmas_m(far_m).0 * std::f64::consts::TAU.sqrt();
        let mean = background + integral / 1000.0;
        assert!(
            (mean - read).abs() < 1e-3 * (mean - background),
            "{far_m}: {mean} {read}"
        );
    }
}

// A background that grows by 36 ppm an hour is in the mean that of the middle, whatever else there is.
#[test]
fn moments_and_means_of_any_length_stand_side_by_side() {
    let drift = Mechanism::new("background-drift", &[("rate_ppm_per_h", 36.0)]).unwrap();
    let model = model(&[drift]);
    let upwind = there(&model, -500.0, 0.0);
    let averaging_s = [0.0, 30.0, 300.0, 0.0, 90.0];
    let rows: Vec<Row> = (0..5)
        .map(|k| row(0, 60.0 * f64::from(k + 1), upwind, None))
        .collect();
    let spans = averaging_s.map(over);
    let read = read(&model, &["a"], &rows, &spans);
    for ((row, span), read) in rows.iter().zip(spans).zip(read) {
        let middle_s = row.time_s - 0.5 * span.averaging_s;
        assert!((read - (model.spec().background_ppm + 0.01 * middle_s)).abs() < 1e-9);
    }
}

#[test]
fn a_turn_of_the_wind_turns_all_points() {
    let model = model(&[]);
    let (from, to) = (there(&model, 800.0, -300.0), there(&model, 800.0, 200.0));
    let names = ["laser".to_owned()];
    let span = Span {
        averaging_s: 20.0,
        to: Some(to),
        ..Span::default()
    };
    let in_wind = |from_deg: f64| {
        let wind = Some((model.spec().wind.speed_at_m_s(from.height_agl_m), from_deg));
        let rows = [row(0, 0.0, from, wind), row(0, 20.0, from, wind)];
        Track::of_means(&model, &names, &rows, &[span; 2]).unwrap()
    };
    let read = |track: &Track| {
        let mut out = [0.0; 2];
        track.predict(&model, &mut out);
        out
    };
    let axis_deg = model.spec().wind.from_deg();
    let turned = read(&in_wind(axis_deg).turned(&[7.0; 2]));
    let other = read(&in_wind(axis_deg + 7.0));
    assert!((turned[1] - other[1]).abs() < 1e-9 * other[1]);
    assert!(turned[1] > 1.001 * model.spec().background_ppm);
    // Where it meets the plume is told of the line, not of its middle.
    let met = in_wind(axis_deg).in_first_plume(&model)[1].unwrap();
    assert!(met.across_sigmas.abs() < 0.3, "{met:?}");
}

// Ten readings a second of a crossing at 18 m/s, with a lag: their means a second, against the track of one row a second.
// A plume with a standard deviation of 2 s is 1 % wider in the means.
#[test]
fn rows_that_are_means_of_several_readings_are_as_wide_as_those() {
    let lag = Mechanism::new("sensor-lag", &[("time_constant_s", 2.0)]).unwrap();
    let model = model(&[lag]);
    let at = |far_m: f64, time_s: f64| there(&model, far_m, 18.0 * (time_s - 30.0));
    // Each crossing begins and ends in clean air, five standard deviations or more from the axis.
    for far_m in [500.0, 1000.0, 1400.0] {
        let fast: Vec<Row> = (0..600)
            .map(|k| f64::from(k) / 10.0)
            .map(|time_s| row(0, time_s, at(far_m, time_s), None))
            .collect();
        let readings = read(&model, &["1"], &fast, &vec![Span::default(); fast.len()]);
        let means = readings.chunks(10).map(|r| r.iter().sum::<f64>() / 10.0);
        let slow: Vec<Row> = (0..60)
            .map(|k| f64::from(k) + 0.45)
            .map(|time_s| row(0, time_s, at(far_m, time_s), None))
            .collect();
        let spread = Span {
            // Ten times a tenth of a second apart: variance of a discrete uniform law, (n² - 1) / 12.
            spread_s: (99.0_f64 / 12.0).sqrt() / 10.0,
            ..Span::default()
        };
        let rows = read(&model, &["1"], &slow, &vec![spread; slow.len()]);
        let top = readings.iter().copied().fold(0.0, f64::max) - readings[0];
        let off = rows.iter().zip(means).map(|(row, mean)| (row - mean).abs());
        let off = off.fold(0.0, f64::max) / top;
        assert!(off < 1e-3, "{far_m} m: {off}");
    }
}
