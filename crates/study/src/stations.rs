//! Sensors at rest: where they stand, what they read, and the wind that blew meanwhile.

use crate::{StudyError, not_calm};
use air::geo::{Enu, LocalFrame, wrap_signed_deg};
use plume::{DispersionSpec, Place};
use scenario::observations::{ObservationRow, Observations};
use std::collections::BTreeMap;

/// A sensor is at rest within this distance of its mean place, m: position errors of a GNSS receiver.
const AT_REST_M: f64 = 5.0;
/// A reading without a wind of its own takes the one that was logged at most so long before or after it, s: an eddy near
/// the ground.
const SAME_WIND_S: f64 = 60.0;

/// A sensor at rest.
#[derive(Debug, Clone)]
pub(crate) struct Station {
    /// Its platform.
    pub name: String,
    /// Distance from the source, m.
    pub distance_m: f64,
    /// Direction from the source to it, degrees clockwise from north.
    pub bearing_deg: f64,
    /// Height above ground, m.
    pub height_agl_m: f64,
    /// What it read, in order of time.
    pub readings: Vec<Reading>,
}

/// A reading with its wind.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Reading {
    pub time_s: f64,
    pub ppm: f64,
    pub speed_m_s: f64,
    /// Wind direction off the direction that leads from the source to the sensor, degrees.
    pub off_deg: f64,
}

/// The stations of `observations`, all platforms of which must be at rest and read with a wind.
///
/// # Errors
/// [`StudyError::Refused`] where a platform moves, readings have no wind, or the scenario has more than one source.
pub(crate) fn stations(
    spec: &DispersionSpec,
    frame: &LocalFrame,
    observations: &Observations,
) -> Result<Vec<Station>, StudyError> {
    let [source] = spec.sources.as_slice() else {
        let refusal = format!("{} sources; expected one", spec.sources.len());
        return Err(StudyError::Refused(refusal));
    };
    let winds = winds(observations);
    let (mut read, mut with_wind) = (0, 0);
    let mut out = Vec::new();
    for (platform, name) in observations.platforms.iter().enumerate() {
        let own = observations
            .rows
            .iter()
            .filter(|r| r.platform == platform)
            .filter_map(|row| Some((row, row.co2_ppm?)));
        let (mut places, mut readings) = (Vec::new(), Vec::new());
        for (row, ppm) in own {
            read += 1;
            places.push(row.place(frame));
            let Some((speed_m_s, from_deg)) = logged(row).or_else(|| near(&winds, row.time_s))
            else {
                continue;
            };
            readings.push((row.time_s, ppm, speed_m_s, from_deg));
        }
        if places.is_empty() {
            continue;
        }
        with_wind += readings.len();
        let at = at_rest(name, &places)?;
        let to = Enu::new(at.east_m, at.north_m);
        let bearing_deg = source.place.bearing_deg(to);
        out.push(Station {
            name: name.clone(),
            distance_m: source.place.distance_m(to),
            bearing_deg,
            height_agl_m: at.height_agl_m,
            readings: readings
                .into_iter()
                .map(|(time_s, ppm, speed_m_s, from_deg)| Reading {
                    time_s,
                    ppm,
                    speed_m_s,
                    off_deg: wrap_signed_deg(from_deg + 180.0 - bearing_deg),
                })
                .collect(),
        });
    }
    if 2 * with_wind < read || with_wind == 0 {
        return Err(StudyError::Refused(format!(
            "{with_wind} of {read} readings have a wind; expected wind_speed_m_s and wind_from_deg beside the sensor"
        )));
    }
    let speeds = out.iter().flat_map(|s| &s.readings).map(|r| r.speed_m_s);
    not_calm(speeds.sum::<f64>() / with_wind as f64)?;
    Ok(out)
}

fn logged(row: &ObservationRow) -> Option<(f64, f64)> {
    Some((row.wind_speed_m_s?, row.wind_from_deg?))
}

/// All logged winds by time, ms.
fn winds(observations: &Observations) -> BTreeMap<i64, (f64, f64)> {
    let by_time = |row: &ObservationRow| Some(((1e3 * row.time_s) as i64, logged(row)?));
    observations.rows.iter().filter_map(by_time).collect()
}

fn near(winds: &BTreeMap<i64, (f64, f64)>, time_s: f64) -> Option<(f64, f64)> {
    let (at, within) = ((1e3 * time_s) as i64, (1e3 * SAME_WIND_S) as i64);
    let around = winds.range(at - within..=at + within);
    around
        .min_by_key(|(t, _)| (*t - at).abs())
        .map(|(_, wind)| *wind)
}

fn at_rest(name: &str, places: &[Place]) -> Result<Place, StudyError> {
    let n = places.len() as f64;
    let mean = |of: fn(&Place) -> f64| places.iter().map(of).sum::<f64>() / n;
    let middle = Place {
        east_m: mean(|p| p.east_m),
        north_m: mean(|p| p.north_m),
        height_agl_m: mean(|p| p.height_agl_m),
    };
    let off_m = |p: &Place| {
        (p.east_m - middle.east_m)
            .hypot(p.north_m - middle.north_m)
            .hypot(p.height_agl_m - middle.height_agl_m)
    };
    let farthest_m = places.iter().map(off_m).fold(0.0, f64::max);
    if farthest_m > AT_REST_M {
        return Err(StudyError::Refused(format!(
            "{name} moves by {farthest_m:.0} m; expected a sensor at rest within {AT_REST_M} m"
        )));
    }
    Ok(middle)
}

/// A sensor as seen from a source that stands elsewhere than stated.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Sight {
    /// Distance from the source, m.
    pub distance_m: f64,
    /// How far its direction is turned clockwise from that of the stated source, degrees.
    pub turn_deg: f64,
}

/// A source is at least so far from a sensor, m: the inlet is no leak.
const LEAST_DISTANCE_M: f64 = 1.0;

impl Station {
    /// The sensor from a source that is displaced by so many metres east and north.
    pub fn seen_from(&self, [east_m, north_m]: [f64; 2]) -> Sight {
        let (sin, cos) = self.bearing_deg.to_radians().sin_cos();
        let to = Enu::new(self.distance_m * sin, self.distance_m * cos);
        let source = Enu::new(east_m, north_m);
        Sight {
            distance_m: source.distance_m(to).max(LEAST_DISTANCE_M),
            turn_deg: wrap_signed_deg(source.bearing_deg(to) - self.bearing_deg),
        }
    }

    /// Distance from the source and height above ground, m.
    pub fn at(&self) -> (f64, f64) {
        (self.distance_m, self.height_agl_m)
    }

    /// Mean wind speed of its readings, m/s.
    pub fn mean_speed_m_s(&self) -> f64 {
        self.readings.iter().map(|r| r.speed_m_s).sum::<f64>() / self.readings.len() as f64
    }
}
