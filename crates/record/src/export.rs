//! What was flown, in formats that other people's tools open.
//!
//! - [`Flown`]: the readings and motions of a recording, or the rows of observations;
//! - [`columns`]: one row a reading, for CSV and Parquet;
//! - [`netcdf`]: trajectories by the CF conventions;
//! - [`geojson`]: readings, tracks and plume for maps;
//! - [`ros2`]: messages of ROS 2, and a bag of them;
//! - [`foxglove`]: a recording with Foxglove's messages beside its own.

pub mod columns;
pub mod foxglove;
pub mod geojson;
pub mod netcdf;
pub mod pose;
pub mod ros2;

use crate::RecordError;
use crate::recording::Recording;
use crate::tracks::{TrackPoint, Tracks};
use plume::Gas;
use protocol::message::{Message, Model, Reading, State, VehicleKind};
use protocol::{Envelope, SimTime, Topic};
use scenario::observations::Observations;
use std::collections::BTreeMap;

/// A state counts for a reading for this long, s: simulated vehicles say theirs ten times a second, real ones four.
const STATE_HOLDS_S: f64 = 1.0;

/// What was flown.
#[derive(Debug, Clone, PartialEq)]
pub struct Flown {
    /// Name of the mission or of the file.
    pub name: String,
    /// The gas that was read.
    pub gas: Gas,
    /// What times count from, ns since 1970; none where that is not known.
    pub start_unix_ns: Option<i64>,
    /// The vehicles in order of their names.
    pub vehicles: Vec<Vehicle>,
    /// What was read, in order of time.
    pub readings: Vec<Read>,
    /// How the vehicles moved, in order of time; none of observations.
    pub motions: Vec<Moved>,
    /// What was known of the plume from each time on, s; none of observations.
    pub models: Vec<(f64, Model)>,
    /// What is missing, in words.
    pub notices: Vec<String>,
}

/// A vehicle.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Vehicle {
    /// Its name.
    pub name: String,
    /// Simulated or real, where that is known.
    pub kind: Option<VehicleKind>,
}

/// A reading.
#[derive(Debug, Clone, PartialEq)]
pub struct Read {
    /// When it was read, s.
    pub time_s: f64,
    /// Number of its vehicle.
    pub vehicle: usize,
    /// Latitude, degrees (WGS84).
    pub lat_deg: f64,
    /// Longitude, degrees (WGS84).
    pub lon_deg: f64,
    /// Altitude, m above mean sea level.
    pub alt_amsl_m: f64,
    /// Mole fraction of the gas, ppm.
    pub ppm: Option<f64>,
    /// Wind speed, m/s.
    pub wind_speed_m_s: Option<f64>,
    /// Direction from which it blows, degrees.
    pub wind_from_deg: Option<f64>,
    /// Air temperature, °C.
    pub temperature_c: Option<f64>,
    /// Static pressure, hPa.
    pub pressure_hpa: Option<f64>,
    /// The vehicle's last state before, if it is no older than a second.
    pub state: Option<State>,
}

/// A vehicle's state at a time.
#[derive(Debug, Clone, PartialEq)]
pub struct Moved {
    /// When it was so, s.
    pub time_s: f64,
    /// Number of the vehicle.
    pub vehicle: usize,
    /// Its state.
    pub state: State,
}

/// Makes a [`Flown`] of messages as they come.
#[derive(Debug, Clone)]
pub struct FlownBuilder {
    flown: Flown,
    last: BTreeMap<usize, (SimTime, State)>,
}

impl FlownBuilder {
    /// Nothing heard yet of a mission called `name` in which `gas` is read, and which began at `start_unix_ns`.
    pub fn new(name: &str, gas: Gas, start_unix_ns: Option<i64>) -> Self {
        Self {
            flown: Flown {
                name: name.to_owned(),
                gas,
                start_unix_ns,
                vehicles: Vec::new(),
                readings: Vec::new(),
                motions: Vec::new(),
                models: Vec::new(),
                notices: Vec::new(),
            },
            last: BTreeMap::new(),
        }
    }

    /// Takes in a message; they come in order of time.
    pub fn take(&mut self, topic: &Topic, envelope: &Envelope) {
        match (topic, &envelope.message) {
            (Topic::State(id), Message::State(state)) => {
                let vehicle = self.flown.vehicle(id.as_str(), state.kind);
                self.last.insert(vehicle, (envelope.time, state.clone()));
                self.flown.motions.push(Moved {
                    time_s: envelope.time.s(),
                    vehicle,
                    state: state.clone(),
                });
            }
            (Topic::Reading(id), Message::Reading(reading)) => {
                let vehicle = self.flown.vehicle(id.as_str(), reading.kind);
                let time = reading.read_at(envelope.time);
                let holds = |(at, _): &&(SimTime, State)| time.since_s(*at) <= STATE_HOLDS_S;
                let state = self.last.get(&vehicle).filter(holds);
                let state = state.map(|(_, state)| state.clone());
                let read = Read::of(time, vehicle, reading, state);
                self.flown.readings.push(read);
            }
            (Topic::Model, Message::Model(model)) => {
                let known = Model::clone(model);
                self.flown.models.push((envelope.time.s(), known));
            }
            _ => {}
        }
    }

    /// What was flown.
    pub fn flown(mut self) -> Flown {
        self.flown.in_order();
        self.flown
    }
}

impl Flown {
    /// Of a recording.
    ///
    /// # Errors
    /// A message that cannot be read, or a recording without readings.
    pub fn of_recording(recording: &Recording) -> Result<Self, RecordError> {
        let info = &recording.info;
        let mut heard = FlownBuilder::new(info.mission.as_str(), info.gas, info.start_unix_ns);
        let mut messages = recording.in_order()?;
        for message in messages.by_ref() {
            let (topic, envelope) = message?;
            heard.take(&topic, &envelope);
        }
        let mut flown = heard.flown();
        flown.notices.extend(messages.ending().loss());
        if flown.readings.is_empty() {
            return Err(RecordError::NothingRead {
                path: recording.path().to_owned(),
            });
        }
        Ok(flown)
    }

    /// Of observations called `name`, whose times count from `zero_unix_ns`.
    pub fn of_observations(name: &str, all: &Observations, zero_unix_ns: Option<i64>) -> Self {
        let vehicle = |name: &String| Vehicle {
            name: name.clone(),
            kind: None,
        };
        let read = |row: &scenario::observations::ObservationRow| Read {
            time_s: row.time_s,
            vehicle: row.platform,
            lat_deg: row.lat_deg,
            lon_deg: row.lon_deg,
            alt_amsl_m: row.alt_amsl_m,
            ppm: row.co2_ppm,
            wind_speed_m_s: row.wind_speed_m_s,
            wind_from_deg: row.wind_from_deg,
            temperature_c: row.temperature_c,
            pressure_hpa: row.pressure_hpa,
            state: None,
        };
        let mut flown = Self {
            name: name.to_owned(),
            gas: all.gas,
            start_unix_ns: zero_unix_ns,
            vehicles: all.platforms.iter().map(vehicle).collect(),
            readings: all.rows.iter().map(read).collect(),
            motions: Vec::new(),
            models: Vec::new(),
            notices: all.notices.clone(),
        };
        flown.in_order();
        flown
    }

    fn vehicle(&mut self, name: &str, kind: VehicleKind) -> usize {
        let known = self.vehicles.iter().position(|v| v.name == name);
        if let Some(known) = known {
            self.vehicles[known].kind = Some(kind);
            return known;
        }
        self.vehicles.push(Vehicle {
            name: name.to_owned(),
            kind: Some(kind),
        });
        self.vehicles.len() - 1
    }

    /// Vehicles by their names, readings by their times: those that were said late stand where they were read.
    fn in_order(&mut self) {
        let mut order: Vec<usize> = (0..self.vehicles.len()).collect();
        order.sort_by_key(|&k| {
            let name = &self.vehicles[k].name;
            (name.parse::<u64>().unwrap_or(u64::MAX), name.clone())
        });
        let place = |k: usize| order.iter().position(|o| *o == k).unwrap_or(k);
        for read in &mut self.readings {
            read.vehicle = place(read.vehicle);
        }
        for moved in &mut self.motions {
            moved.vehicle = place(moved.vehicle);
        }
        self.vehicles = order.iter().map(|&k| self.vehicles[k].clone()).collect();
        self.readings.sort_by(|a, b| a.time_s.total_cmp(&b.time_s));
    }

    /// Leaves of each vehicle the first reading in each `every_s`, counted from time 0.
    pub fn thin(&mut self, every_s: f64) {
        // A hair less than a rounding error puts into the interval before.
        const ROUNDING: f64 = 1e-9;
        let mut last = vec![None; self.vehicles.len()];
        self.readings.retain(|read| {
            let interval = Some((read.time_s / every_s + ROUNDING).floor());
            std::mem::replace(&mut last[read.vehicle], interval) != interval
        });
    }

    /// A time in ns since 1970, or since the unknown beginning.
    pub fn unix_ns(&self, time_s: f64) -> i64 {
        self.start_unix_ns
            .unwrap_or(0)
            .saturating_add(SimTime::from_s(time_s).ns())
    }

    /// The tracks for a map, with at most `points` each.
    pub fn tracks(&self, points: usize, interval_s: f64) -> Tracks {
        let mut tracks = Tracks::new(points, interval_s);
        let begun_s = self.readings.first().map_or(0.0, |r| r.time_s);
        for read in &self.readings {
            let vehicle = &self.vehicles[read.vehicle];
            let Some(co2_ppm) = read.ppm else { continue };
            let point = TrackPoint {
                time_s: read.time_s,
                lat_deg: read.lat_deg,
                lon_deg: read.lon_deg,
                alt_amsl_m: read.alt_amsl_m,
                co2_ppm,
            };
            let kind = vehicle.kind.unwrap_or(VehicleKind::Real);
            let since = SimTime::from_s(read.time_s - begun_s);
            tracks.push(&vehicle.name, kind, since, point);
        }
        tracks
    }
}

impl Read {
    fn of(time: SimTime, vehicle: usize, reading: &Reading, state: Option<State>) -> Self {
        Self {
            time_s: time.s(),
            vehicle,
            lat_deg: reading.lat_deg,
            lon_deg: reading.lon_deg,
            alt_amsl_m: reading.alt_amsl_m,
            ppm: Some(reading.co2_ppm),
            wind_speed_m_s: reading.wind_speed_m_s,
            wind_from_deg: reading.wind_from_deg,
            temperature_c: reading.temperature_c,
            pressure_hpa: reading.pressure_hpa,
            state,
        }
    }
}
