//! What real vehicles read in a recorded mission, as rows for calibration and gap analysis.

use crate::RecordError;
use crate::recording::Recording;
use protocol::message::{Message, Reading, VehicleKind};
use protocol::{SimTime, Topic};
use scenario::observations::{ObservationRow, Observations};
use std::collections::BTreeMap;

/// The readings of real vehicles in `recording`, in order of time and platform.
///
/// The vehicles' own `va/<id>/reading` count; a recording that holds none gives what the
/// squadron controller passed on (`sc/main/observation`). Humidity and white noise are not on
/// the bus and stay missing.
///
/// # Errors
/// A damaged recording, or one in which no real vehicle has read anything.
pub fn of_recording(recording: &Recording) -> Result<Observations, RecordError> {
    let mut own = Rows::default();
    let mut passed_on = Rows::default();
    let mut messages = recording.envelopes()?;
    for message in messages.by_ref() {
        let (topic, envelope) = message?;
        match (&topic, &envelope.message) {
            (Topic::Reading(id), Message::Reading(reading)) => {
                own.push(id.as_str(), reading.read_at(envelope.time), reading);
            }
            (Topic::Observation, Message::Observation(o)) => {
                passed_on.push(&o.vehicle, SimTime::from_ns(o.time_ns), &o.reading);
            }
            _ => {}
        }
    }
    let mut observations = if own.rows.is_empty() { passed_on } else { own }.finish();
    observations.gas = recording.info.gas;
    if observations.rows.is_empty() {
        return Err(RecordError::NothingReal {
            path: recording.path().to_owned(),
        });
    }
    let name = recording.path().display();
    let loss = messages.ending().loss();
    observations
        .notices
        .extend(loss.map(|l| format!("{name}: {l}")));
    Ok(observations)
}

#[derive(Default)]
struct Rows {
    platforms: Vec<String>,
    last: BTreeMap<String, (usize, SimTime)>,
    rows: Vec<(SimTime, ObservationRow)>,
}

impl Rows {
    fn push(&mut self, id: &str, time: SimTime, reading: &Reading) {
        if reading.kind != VehicleKind::Real {
            return;
        }
        let platform = match self.last.get(id) {
            Some(&(_, last)) if time <= last => return,
            Some(&(platform, _)) => platform,
            None => {
                self.platforms.push(id.to_owned());
                self.platforms.len() - 1
            }
        };
        self.last.insert(id.to_owned(), (platform, time));
        self.rows.push((time, row(platform, time, reading)));
    }

    fn finish(mut self) -> Observations {
        self.rows.sort_by_key(|(time, row)| (*time, row.platform));
        Observations {
            rows: self.rows.into_iter().map(|(_, row)| row).collect(),
            platforms: self.platforms,
            ..Observations::default()
        }
    }
}

fn row(platform: usize, time: SimTime, reading: &Reading) -> ObservationRow {
    ObservationRow {
        time_s: time.s(),
        platform,
        lat_deg: reading.lat_deg,
        lon_deg: reading.lon_deg,
        alt_amsl_m: reading.alt_amsl_m,
        co2_ppm: Some(reading.co2_ppm),
        wind_speed_m_s: reading.wind_speed_m_s,
        wind_from_deg: reading.wind_from_deg,
        temperature_c: reading.temperature_c,
        pressure_hpa: reading.pressure_hpa,
        ..ObservationRow::default()
    }
}
