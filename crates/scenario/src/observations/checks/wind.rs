//! Whether the readings follow the plume only where the wind blows the other way: a direction that is
//! logged as where the wind blows to.

use air::geo::LocalFrame;
use air::wind::WindVector;
use plume::effects::SensorAir;
use plume::track::{Row, Track};
use plume::{DispersionModel, DispersionSpec};

use super::super::{DataQuality, Flaw, Observations};
use super::quantile;

/// Correlation of readings with what is predicted of them from which on they follow it, and what it is
/// above that of another prediction when only one of the two is followed.
const FOLLOWS: f64 = 0.5;
const CLEARLY: f64 = 0.25;
/// A wind may also be off by so much to either side, in such steps, degrees.
const OFF_DEG: i32 = 30;
const STEP_DEG: usize = 5;
/// Part of the readings at either end that is cut to what the rest reaches.
const CUT_PART: f64 = 0.005;
/// Logged directions are those of the mean over so long on both sides, s: gusts do not carry the plume.
const AVERAGED_S: f64 = 60.0;
/// Rows that are looked at, about; of more, every so many-th.
const ENOUGH_ROWS: usize = 4000;
/// Fewest readings from which a correlation tells something.
const FEWEST_READINGS: usize = 30;

/// What is to be said where the readings follow the plume of `base` in a wind that blows the other way,
/// and not in the one that is logged, or stated. Nothing is left out for that.
pub(super) fn blows_the_other_way(
    observations: &Observations,
    base: &DispersionSpec,
    frame: &LocalFrame,
) -> Option<DataQuality> {
    let (rows, readings) = rows(observations, frame);
    if rows.len() < FEWEST_READINGS {
        return None;
    }
    // A world that the plume model refuses is refused where it is used.
    let model = DispersionModel::new(base.clone()).ok()?;
    let track = Track::new(&model, &observations.platforms, &rows).ok()?;
    let correlation = |turn_deg: f64| correlation(&track, &model, &readings, turn_deg);
    if correlation(0.0) >= FOLLOWS {
        return None;
    }
    let about = |middle_deg: f64| {
        let turns = (-OFF_DEG..=OFF_DEG).step_by(STEP_DEG);
        turns
            .map(|off| correlation(middle_deg + f64::from(off)))
            .fold(-1.0, f64::max)
    };
    let turned = about(180.0);
    if turned < FOLLOWS || about(0.0) > turned - CLEARLY {
        return None;
    }
    let logged = rows.iter().any(|r| r.wind.is_some());
    let key = if logged {
        "wind_from_deg"
    } else {
        "the scenario's weather.wind_from_deg"
    };
    let times = || rows.iter().map(|r| r.time_s);
    Some(DataQuality {
        platform: observations.platforms.join(", "),
        kind: Flaw::Unit,
        from_s: times().fold(f64::INFINITY, f64::min),
        to_s: times().fold(f64::NEG_INFINITY, f64::max),
        message: format!(
            "the readings follow the plume of the opposite wind; {key} must be the direction that the wind blows \
             from, not to"
        ),
    })
}

/// Rows with a reading, platform by platform, each with the wind about its time, and the readings.
fn rows(observations: &Observations, frame: &LocalFrame) -> (Vec<Row>, Vec<f64>) {
    let every = observations.rows.len().div_ceil(ENOUGH_ROWS).max(1);
    let (mut rows, mut readings): (Vec<Row>, Vec<f64>) = (Vec::new(), Vec::new());
    for platform in 0..observations.platforms.len() {
        let own = observations.rows.iter().filter(|r| r.platform == platform);
        let mut own: Vec<_> = own.collect();
        own.sort_by(|a, b| a.time_s.total_cmp(&b.time_s));
        own.dedup_by_key(|r| r.time_s);
        let times: Vec<f64> = own.iter().map(|r| r.time_s).collect();
        let winds: Vec<Option<WindVector>> = own
            .iter()
            .map(|r| {
                let speed_m_s = r.wind_speed_m_s.unwrap_or(1.0);
                let from = r.wind_from_deg?;
                Some(WindVector::from_speed_and_direction(speed_m_s, from))
            })
            .collect();
        for (row, wind) in own.iter().zip(averaged(&times, &winds)).step_by(every) {
            let Some(ppm) = row.co2_ppm else { continue };
            rows.push(Row {
                platform,
                time_s: row.time_s,
                place: row.place(frame),
                wind,
                air: SensorAir::UNKNOWN,
            });
            readings.push(ppm);
        }
    }
    let mut sorted = readings.clone();
    let low = quantile(&mut sorted, CUT_PART).unwrap_or(0.0);
    let high = quantile(&mut sorted, 1.0 - CUT_PART).unwrap_or(0.0);
    readings.iter_mut().for_each(|c| *c = c.clamp(low, high));
    (rows, readings)
}

/// Speed, m/s, and direction from, degrees, of the mean wind within [`AVERAGED_S`] of every time.
fn averaged(times_s: &[f64], winds: &[Option<WindVector>]) -> Vec<Option<(f64, f64)>> {
    let (mut first, mut next) = (0, 0);
    let mut sum = [0.0; 3];
    let add = |sum: &mut [f64; 3], k: usize, sign: f64| {
        if let Some(wind) = winds[k] {
            let parts = [wind.east_m_s, wind.north_m_s, 1.0];
            sum.iter_mut().zip(parts).for_each(|(s, p)| *s += sign * p);
        }
    };
    let mut out = Vec::with_capacity(times_s.len());
    for time_s in times_s {
        while next < times_s.len() && times_s[next] <= time_s + AVERAGED_S {
            add(&mut sum, next, 1.0);
            next += 1;
        }
        while times_s[first] < time_s - AVERAGED_S {
            add(&mut sum, first, -1.0);
            first += 1;
        }
        let [east, north, count] = sum;
        out.push((count > 0.5).then(|| {
            let mean = WindVector {
                east_m_s: east / count,
                north_m_s: north / count,
            };
            (mean.speed_m_s(), mean.from_deg())
        }));
    }
    out
}

/// Correlation of readings with the plume in a wind turned clockwise by some degrees.
fn correlation(track: &Track, model: &DispersionModel, readings: &[f64], turn_deg: f64) -> f64 {
    let track = track.turned(&vec![turn_deg; track.len()]);
    let mut predicted = vec![0.0; track.len()];
    track.predict(model, &mut predicted);
    let pairs = readings.iter().copied().zip(predicted.iter().copied());
    plume::score::correlation(pairs).unwrap_or(0.0)
}
