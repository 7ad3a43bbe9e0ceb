//! What the page shows while a mission flies, kept small from the messages on the bus.
//!
//! A page gets all of it once ([`LiveState::whole`]) and from then on what is new ([`LiveState::news`]): tracks and
//! events grow, the rest is small and sent again.

mod news;

use crate::figure::Rounded;
use crate::site::SiteMap;
use news::{Piece, SentTracks};
use protocol::message::{
    ControlLevel, Estimate, Extension, Health, Message, Mode, Model, Peak, PeakStatus, Phase,
    PromisingPoint, Reading, Severity, State, VehicleKind,
};
use protocol::text::printable;
use protocol::{Envelope, SimTime, Topic};
use record::tracks::Tracks;
use serde_json::{Value, json};
use std::collections::{BTreeMap, VecDeque};
use std::sync::Arc;

/// Points of one track on the page.
const TRACK_POINTS: usize = 700;
/// Time between two of them at first, s: 36 m at 18 m/s, a chord 2 m off an orbit of 80 m.
const TRACK_STEP_S: f64 = 2.0;
/// Points of tracks in one message to a page that opens: some 40 kB.
const POINTS_IN_A_MESSAGE: usize = 1500;
/// Events on the page.
const EVENTS: usize = 200;
/// Events that a page gets which opens.
const EVENTS_BEFORE: usize = 40;

/// How the run goes: what no message says and the program knows.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RunStatus {
    /// Held by the page's pause.
    pub paused: bool,
    /// Asked for: 1 is real time, infinite is as fast as the processor allows.
    pub speed: f64,
    /// Reached of late: simulated over wall time.
    pub real_time_factor: f64,
    /// The mission is over.
    pub ended: bool,
    /// Its report can be read.
    pub reported: bool,
}

impl Default for RunStatus {
    fn default() -> Self {
        Self {
            paused: false,
            speed: f64::INFINITY,
            real_time_factor: f64::NAN,
            ended: false,
            reported: false,
        }
    }
}

#[derive(Debug, Clone, Default)]
struct Vehicle {
    state: Option<(SimTime, State)>,
    reading: Option<Reading>,
    mode: Option<Mode>,
    health: Option<Box<Health>>,
    /// No page has got this health.
    new_health: bool,
    /// Whether it was in the air.
    flew: bool,
    purpose: String,
}

#[derive(Debug, Clone)]
struct Event {
    time: SimTime,
    agent: String,
    severity: Severity,
    text: String,
}

/// What the page shows.
pub struct LiveState {
    site: Arc<SiteMap>,
    /// How the run goes.
    pub run: RunStatus,
    /// What the mission concludes, in the words of its summary; none before its end.
    pub conclusion: Option<String>,
    time: SimTime,
    phase: Option<Phase>,
    vehicles: BTreeMap<String, Vehicle>,
    tracks: Tracks,
    sent_tracks: SentTracks,
    promising: Vec<PromisingPoint>,
    before: Option<Arc<Model>>,
    model: Option<Arc<Model>>,
    /// Models taken so far.
    models: u64,
    peak: Option<Peak>,
    extension: Option<Extension>,
    events: VecDeque<Event>,
    /// How many of the last of `events` no page has got.
    new_events: usize,
    /// Pages have to begin anew.
    forgotten: bool,
}

impl LiveState {
    /// A state that has heard nothing yet.
    pub fn new(site: Arc<SiteMap>) -> Self {
        Self {
            site,
            run: RunStatus::default(),
            conclusion: None,
            time: SimTime::ZERO,
            phase: None,
            vehicles: BTreeMap::new(),
            tracks: Tracks::new(TRACK_POINTS, TRACK_STEP_S),
            sent_tracks: SentTracks::default(),
            promising: Vec::new(),
            before: None,
            model: None,
            models: 0,
            peak: None,
            extension: None,
            events: VecDeque::new(),
            new_events: 0,
            forgotten: false,
        }
    }

    /// The site on whose map it is shown.
    pub fn site(&self) -> &Arc<SiteMap> {
        &self.site
    }

    /// Mission time of the last message.
    pub fn time(&self) -> SimTime {
        self.time
    }

    /// The model of the plume, once there is one.
    pub(crate) fn model(&self) -> Option<Arc<Model>> {
        self.model.clone()
    }

    /// Where a vehicle is.
    pub(crate) fn state_of(&self, vehicle: &str) -> Option<&State> {
        let (_, state) = self.vehicles.get(vehicle)?.state.as_ref()?;
        Some(state)
    }

    /// Forgets everything but the site and how the run goes: a recording is shown from another moment on.
    pub fn forget(&mut self) {
        let run = self.run;
        *self = Self::new(Arc::clone(&self.site));
        self.run = run;
        self.forgotten = true;
    }

    /// Takes in a message.
    pub fn take(&mut self, topic: &Topic, envelope: &Envelope) {
        self.time = self.time.max(envelope.time);
        self.tracks.take(topic, envelope);
        match (topic, &envelope.message) {
            (Topic::State(id), Message::State(state)) => {
                let vehicle = self.vehicle(id.as_str());
                vehicle.flew |= state.airborne;
                vehicle.state = Some((envelope.time, state.clone()));
            }
            (Topic::Reading(id), Message::Reading(reading)) => {
                self.vehicle(id.as_str()).reading = Some(reading.clone());
            }
            (Topic::Mode(id), Message::Mode(mode)) => {
                self.vehicle(id.as_str()).mode = Some(mode.clone());
            }
            (Topic::Health(id), Message::Health(health)) => {
                let vehicle = self.vehicle(id.as_str());
                vehicle.health = Some(health.clone());
                vehicle.new_health = true;
            }
            (Topic::Plan, Message::Plan(plan)) => {
                self.phase = Some(plan.phase);
                for a in &plan.assignments {
                    self.vehicle(&a.vehicle).purpose.clone_from(&a.purpose);
                }
            }
            (Topic::Population, Message::Population(p)) => self.promising.clone_from(&p.points),
            (Topic::Model, Message::Model(model)) => self.take_model(model),
            (Topic::Extension, Message::Extension(e)) => self.extension = Some(e.clone()),
            (Topic::Event(agent), Message::Event(e)) => {
                let event = Event {
                    time: envelope.time,
                    agent: agent.to_string(),
                    severity: e.severity,
                    text: printable(&e.text).into_owned(),
                };
                self.take_event(event);
            }
            _ => {}
        }
    }

    /// Says something to who looks, as if an agent had.
    pub fn tell(&mut self, who: &str, severity: Severity, text: String) {
        self.take_event(Event {
            time: self.time,
            agent: who.to_owned(),
            severity,
            text,
        });
    }

    fn take_event(&mut self, event: Event) {
        if self.events.len() == EVENTS {
            self.events.pop_front();
        }
        self.events.push_back(event);
        self.new_events = (self.new_events + 1).min(self.events.len());
    }

    fn take_model(&mut self, model: &Model) {
        let model = Arc::new(model.clone());
        // As the summary has it, once the search has begun.
        if self.phase.is_some_and(Phase::has_searched) {
            let found = model.peak.filter(|p| p.status != PeakStatus::NotFound);
            self.peak = model.peak.map_or(self.peak, |_| found);
        }
        self.before.get_or_insert_with(|| Arc::clone(&model));
        self.model = Some(model);
        self.models += 1;
    }

    fn vehicle(&mut self, id: &str) -> &mut Vehicle {
        // Looked up first: a new key would be made for every message otherwise.
        if !self.vehicles.contains_key(id) {
            self.vehicles.insert(id.to_owned(), Vehicle::default());
        }
        self.vehicles.entry(id.to_owned()).or_default()
    }

    /// What pages lack since this was last asked for, as messages of JSON.
    pub fn news(&mut self) -> Vec<String> {
        if std::mem::take(&mut self.forgotten) {
            self.new_events = 0;
            self.sent_tracks.news(&self.tracks);
            return self.whole();
        }
        let from = self.events.len() - self.new_events;
        let events = self.events_json(from);
        self.new_events = 0;
        let pieces = self.sent_tracks.news(&self.tracks);
        let tracks: Vec<Value> = pieces.iter().map(|p| self.piece_json(p)).collect();
        let picture = self.picture(false, events, tracks).to_string();
        for vehicle in self.vehicles.values_mut() {
            vehicle.new_health = false;
        }
        vec![picture]
    }

    /// All that a page needs which has nothing yet, as messages that it takes one after the other. What is new since
    /// the last [`news`](Self::news) is in it: send that first to the pages that are there.
    pub fn whole(&self) -> Vec<String> {
        let events = self.events_json(self.events.len().saturating_sub(EVENTS_BEFORE));
        let mut messages = vec![self.picture(true, events, Vec::new()).to_string()];
        let pieces = SentTracks::all(&self.tracks, POINTS_IN_A_MESSAGE);
        let (mut tracks, mut points) = (Vec::new(), 0);
        for piece in &pieces {
            if points + piece.points.len() > POINTS_IN_A_MESSAGE {
                messages.push(json!({"tracks": std::mem::take(&mut tracks)}).to_string());
                points = 0;
            }
            points += piece.points.len();
            tracks.push(self.piece_json(piece));
        }
        if !tracks.is_empty() {
            messages.push(json!({"tracks": tracks}).to_string());
        }
        messages
    }

    fn picture(&self, whole: bool, events: Value, tracks: Vec<Value>) -> Value {
        json!({
            "whole": whole,
            "time_s": self.time.s(),
            "phase": self.phase,
            "paused": self.run.paused,
            "ended": self.run.ended,
            "reported": self.run.reported,
            "speed": finite(self.run.speed),
            "factor": finite(self.run.real_time_factor),
            "vehicles": self.vehicles_json(),
            "health": self.health_json(whole),
            "tracks": tracks,
            "stars": self.promising.iter().map(|p| {
                let at = self.site.enu(p.lat_deg, p.lon_deg);
                json!([integer(at.east_m), integer(at.north_m)])
            }).collect::<Vec<_>>(),
            "before": self.before.as_deref().map(model_json),
            "model": self.model.as_deref().map(model_json),
            "models": self.models,
            "peak": self.peak.map(|p| {
                let at = self.site.enu(p.lat_deg, p.lon_deg);
                json!({"e": at.east_m, "n": at.north_m, "alt": p.alt_amsl_m,
                       "lat": p.lat_deg, "lon": p.lon_deg,
                       "ppm": p.co2_ppm, "sd": p.sd_ppm,
                       "status": p.status.words()})
            }),
            "conclusion": self.conclusion,
            "extension": self.extension,
            "events": events,
        })
    }

    fn events_json(&self, from: usize) -> Value {
        let events = self.events.iter().skip(from);
        events
            .map(|e| json!([e.time.s(), e.agent, e.severity, e.text]))
            .collect()
    }

    fn vehicles_json(&self) -> Vec<Value> {
        let vehicles = self.vehicles.iter();
        vehicles
            .filter_map(|(id, vehicle)| self.vehicle_json(id, vehicle))
            .collect()
    }

    /// How real vehicles are: all that is known, or what is new.
    fn health_json(&self, whole: bool) -> Value {
        let asked = self.vehicles.iter().filter(|(_, v)| whole || v.new_health);
        let of = |(id, v): (&String, &Vehicle)| Some((id.clone(), json!(v.health.as_deref()?)));
        Value::Object(asked.filter_map(of).collect())
    }

    fn vehicle_json(&self, id: &str, vehicle: &Vehicle) -> Option<Value> {
        let (heard, state) = vehicle.state.as_ref()?;
        let at = self.site.enu(state.lat_deg, state.lon_deg);
        let level = vehicle
            .mode
            .as_ref()
            .map_or(ControlLevel::Automatic, |m| m.level);
        let mut json = json!({
            "id": id,
            "real": state.kind == VehicleKind::Real,
            "e": integer(at.east_m),
            "n": integer(at.north_m),
            "alt": integer(state.alt_amsl_m),
            "agl": integer(state.alt_amsl_m - self.site.ground_amsl_m(at)),
            "heading": integer(state.heading_deg),
            "airspeed": Rounded::new(state.airspeed_m_s, 10.0),
            "airborne": state.airborne,
            "flew": vehicle.flew,
            "silent_s": integer(self.time.since_s(*heard)),
            "ppm": vehicle.reading.as_ref().map(|r| self.shown(r.co2_ppm)),
            "level": level,
            "purpose": vehicle.purpose,
        });
        // Sent where somebody asks why, not for a hundred vehicles that do as they are told.
        let reason = vehicle.mode.as_ref().map(|m| &m.reason);
        if level != ControlLevel::Automatic
            && let Some(fields) = json.as_object_mut()
        {
            fields.insert("reason".to_owned(), json!(reason));
        }
        Some(json)
    }

    /// A piece of a track as one flat list of time, east, north, altitude and ppm: rounded numbers keep it small.
    fn piece_json(&self, piece: &Piece<'_>) -> Value {
        let flat = piece.points.iter().flat_map(|p| {
            let at = self.site.enu(p.lat_deg, p.lon_deg);
            let [time, east, north, alt] =
                [p.time_s, at.east_m, at.north_m, p.alt_amsl_m].map(integer);
            [time, east, north, alt, self.shown(p.co2_ppm)]
        });
        let points: Vec<Value> = flat.collect();
        json!({"id": piece.id, "halvings": piece.halvings, "points": points})
    }

    /// ppm with the digits that are shown, as a whole number where there are none.
    fn shown(&self, ppm: f64) -> Value {
        match self.site.shown.gas.digits() {
            0 => integer(ppm),
            _ => json!(Rounded::new(ppm, self.site.shown.steps_per_ppm())),
        }
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
        "flux": model.flux.iter().map(|f| json!([
            f.source, record::text::flux_method(f.method), record::text::emission_rate(f.kg_s)
        ])).collect::<Vec<_>>(),
        "wind_speed_m_s": model.wind_speed_m_s,
        "observations": model.observations,
        "mechanisms": model.mechanisms.iter().map(|m| {
            record::text::added_source(m).unwrap_or_else(|| format!("Extended by {}.", m.id))
        }).collect::<Vec<_>>(),
    })
}

fn pair(estimate: Estimate) -> [f64; 2] {
    [estimate.value, estimate.sd]
}

/// JSON has no word for an infinite number; null stands for "as fast as possible" or "unknown".
fn finite(value: f64) -> Option<f64> {
    value.is_finite().then_some(value)
}

/// Rounded to whole metres, seconds, degrees or ppm of CO2.
fn integer(value: f64) -> Value {
    json!(value.round() as i64)
}
