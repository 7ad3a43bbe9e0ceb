//! What the page shows while a mission flies, kept small from the messages on the bus.

use crate::plot::rounded;
use crate::site::{Grid, SiteMap};
use protocol::message::{
    ControlLevel, Estimate, Extension, Message, Mode, Model, Peak, Phase, PromisingPoint, Reading,
    Severity, State, VehicleKind,
};
use protocol::{Envelope, SimTime, Topic};
use record::tracks::Tracks;
use serde_json::{Value, json};
use std::collections::{BTreeMap, VecDeque};
use std::sync::Arc;

/// Points of one track on the page.
const TRACK_POINTS: usize = 700;
/// Events on the page.
const EVENTS: usize = 40;
/// Columns of the grid on which the plume is drawn.
const PLUME_COLUMNS: usize = 110;
/// How far the plume is drawn beyond the area flown in, in parts of its width: wide screens
/// show more.
const PLUME_BEYOND: f64 = 0.7;

/// How the run goes: what no message says and the program knows.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RunStatus {
    /// Held by the page's pause.
    pub paused: bool,
    /// Asked for: 1 is real time, infinite is as fast as the processor allows.
    pub speed: f64,
    /// Reached: simulated over wall time.
    pub real_time_factor: f64,
    /// The mission is over.
    pub ended: bool,
}

impl Default for RunStatus {
    fn default() -> Self {
        Self {
            paused: false,
            speed: f64::INFINITY,
            real_time_factor: f64::NAN,
            ended: false,
        }
    }
}

#[derive(Debug, Clone, Default)]
struct Vehicle {
    state: Option<State>,
    reading: Option<Reading>,
    mode: Option<Mode>,
    purpose: String,
}

/// What the page shows. Clone it behind an `Arc` to hand it to the page.
#[derive(Clone)]
pub struct LiveState {
    site: Arc<SiteMap>,
    /// How the run goes.
    pub run: RunStatus,
    time: SimTime,
    phase: Option<Phase>,
    vehicles: BTreeMap<String, Vehicle>,
    tracks: Tracks,
    promising: Vec<PromisingPoint>,
    before: Option<Box<Model>>,
    model: Option<Box<Model>>,
    peak: Option<Peak>,
    extension: Option<Extension>,
    events: VecDeque<(SimTime, String, Severity, String)>,
}

impl LiveState {
    /// A state that has heard nothing yet.
    pub fn new(site: Arc<SiteMap>) -> Self {
        Self {
            site,
            run: RunStatus::default(),
            time: SimTime::ZERO,
            phase: None,
            vehicles: BTreeMap::new(),
            tracks: Tracks::new(TRACK_POINTS, 1.0),
            promising: Vec::new(),
            before: None,
            model: None,
            peak: None,
            extension: None,
            events: VecDeque::new(),
        }
    }

    /// The site on whose map it is shown.
    pub fn site(&self) -> &SiteMap {
        &self.site
    }

    /// Takes in a message.
    pub fn take(&mut self, topic: &Topic, envelope: &Envelope) {
        self.time = self.time.max(envelope.time);
        self.tracks.take(topic, envelope);
        match (topic, &envelope.message) {
            (Topic::State(id), Message::State(state)) => {
                self.vehicle(id.as_str()).state = Some(state.clone());
            }
            (Topic::Reading(id), Message::Reading(reading)) => {
                self.vehicle(id.as_str()).reading = Some(reading.clone());
            }
            (Topic::Mode(id), Message::Mode(mode)) => {
                self.vehicle(id.as_str()).mode = Some(mode.clone());
            }
            (Topic::Plan, Message::Plan(plan)) => {
                self.phase = Some(plan.phase);
                self.peak = plan.peak.or(self.peak);
                for a in &plan.assignments {
                    self.vehicle(&a.vehicle).purpose.clone_from(&a.purpose);
                }
            }
            (Topic::Population, Message::Population(p)) => self.promising.clone_from(&p.points),
            (Topic::Model, Message::Model(model)) => self.take_model(model),
            (Topic::Extension, Message::Extension(e)) => self.extension = Some(e.clone()),
            (Topic::Event(agent), Message::Event(e)) => {
                if self.events.len() == EVENTS {
                    self.events.pop_front();
                }
                let event = (envelope.time, agent.to_string(), e.severity, e.text.clone());
                self.events.push_back(event);
            }
            _ => {}
        }
    }

    fn take_model(&mut self, model: &Model) {
        let model = Box::new(model.clone());
        if self.before.is_none() {
            self.before = Some(model.clone());
        }
        self.model = Some(model);
    }

    fn vehicle(&mut self, id: &str) -> &mut Vehicle {
        // Looked up first: a new key would be made for every message otherwise.
        if !self.vehicles.contains_key(id) {
            self.vehicles.insert(id.to_owned(), Vehicle::default());
        }
        self.vehicles.entry(id.to_owned()).or_default()
    }

    /// What the page's script draws, as JSON.
    pub fn to_json(&self) -> String {
        json!({
            "time_s": self.time.s(),
            "area": self.site.area(&self.tracks).ends().map(whole),
            "phase": self.phase,
            "paused": self.run.paused,
            "ended": self.run.ended,
            "speed": finite(self.run.speed),
            "factor": finite(self.run.real_time_factor),
            "vehicles": self.vehicles_json(),
            "tracks": self.tracks_json(),
            "stars": self.promising.iter().map(|p| {
                let at = self.site.enu(p.lat_deg, p.lon_deg);
                json!([whole(at.east_m), whole(at.north_m), self.tenths(p.fitness_ppm)])
            }).collect::<Vec<_>>(),
            "before": self.before.as_deref().map(model_json),
            "model": self.model.as_deref().map(model_json),
            "plume": self.model.as_deref().map(|m| self.plume_json(m)),
            "peak": self.peak.map(|p| {
                let at = self.site.enu(p.lat_deg, p.lon_deg);
                json!({"e": at.east_m, "n": at.north_m, "alt": p.alt_amsl_m,
                       "ppm": p.co2_ppm, "sd": p.sd_ppm,
                       "status": record::text::status(p.status)})
            }),
            "extension": self.extension,
            "events": self.events.iter().map(|(time, who, severity, text)| {
                json!([time.s(), who, severity, text])
            }).collect::<Vec<_>>(),
        })
        .to_string()
    }

    fn vehicles_json(&self) -> Vec<Value> {
        self.vehicles
            .iter()
            .filter_map(|(id, vehicle)| {
                let state = vehicle.state.as_ref()?;
                let at = self.site.enu(state.lat_deg, state.lon_deg);
                let mode = vehicle.mode.as_ref();
                Some(json!({
                    "id": id,
                    "real": state.kind == VehicleKind::Real,
                    "e": at.east_m,
                    "n": at.north_m,
                    "agl": state.alt_amsl_m - self.site.frame.ground_amsl_m,
                    "heading": state.heading_deg,
                    "airspeed": state.airspeed_m_s,
                    "airborne": state.airborne,
                    "ppm": vehicle.reading.as_ref().map(|r| r.co2_ppm),
                    "level": mode.map_or(ControlLevel::Automatic, |m| m.level),
                    "reason": mode.map(|m| &m.reason),
                    "obeyed": mode.is_none_or(|m| m.setpoints_obeyed),
                    "purpose": vehicle.purpose,
                }))
            })
            .collect()
    }

    /// Each track as one flat list of time, east, north and ppm: rounded numbers keep it small.
    fn tracks_json(&self) -> BTreeMap<&str, Vec<Value>> {
        self.tracks
            .by_vehicle()
            .iter()
            .map(|(id, track)| {
                let flat = track.points.items().iter().flat_map(|p| {
                    let at = self.site.enu(p.lat_deg, p.lon_deg);
                    let [time, east, north] = [p.time_s, at.east_m, at.north_m].map(whole);
                    [time, east, north, self.shown(p.co2_ppm)]
                });
                (id.as_str(), flat.collect())
            })
            .collect()
    }

    /// The plume at the height of its axis, where it is strongest, as a grid for contours.
    fn plume_json(&self, model: &Model) -> Value {
        let alt = self.site.axis_amsl_m(model);
        let area = self.site.area(&self.tracks);
        let area = area.widened(PLUME_BEYOND * (area.high.east_m - area.low.east_m));
        let grid = Grid::fill(area, PLUME_COLUMNS, alt, |points| {
            (self.site.field)(model, points)
        });
        let step = |axis: &[f64]| axis.get(1).zip(axis.first()).map(|(b, a)| b - a);
        json!({
            "e": grid.east_m.first(),
            "n": grid.north_m.first(),
            "step": step(&grid.east_m),
            "columns": grid.east_m.len(),
            "rows": grid.north_m.len(),
            "agl": grid.alt_amsl_m - self.site.frame.ground_amsl_m,
            "ppm": grid.ppm.iter().map(|&p| self.tenths(p)).collect::<Vec<_>>(),
        })
    }
}

impl LiveState {
    /// ppm with the digits that are shown, as a whole number where there are none.
    fn shown(&self, ppm: f64) -> Value {
        match self.site.shown.gas.digits() {
            0 => whole(ppm),
            _ => rounded(ppm, self.site.shown.steps_per_ppm()),
        }
    }

    /// ppm with a digit more than is shown.
    fn tenths(&self, ppm: f64) -> Value {
        rounded(ppm, 10.0 * self.site.shown.steps_per_ppm())
    }
}

fn model_json(model: &Model) -> Value {
    json!({
        "background_ppm": pair(model.background_ppm),
        "effective_height_agl_m": pair(model.effective_height_agl_m),
        "axis_deg": pair(model.axis_deg),
        "c_max_ppm": pair(model.c_max_ppm),
        "sigma_y_scale": pair(model.sigma_y_scale),
        "sigma_z_scale": pair(model.sigma_z_scale),
        "wind_speed_m_s": model.wind_speed_m_s,
        "observations": model.observations,
        "mechanisms": model.mechanisms.iter().map(|m| &m.id).collect::<Vec<_>>(),
    })
}

fn pair(estimate: Estimate) -> [f64; 2] {
    [estimate.value, estimate.sd]
}

/// JSON has no word for an infinite number; null stands for "as fast as possible" or "unknown".
fn finite(value: f64) -> Option<f64> {
    value.is_finite().then_some(value)
}

/// Rounded to whole metres, seconds or ppm of CO2.
fn whole(value: f64) -> Value {
    json!(value.round() as i64)
}
