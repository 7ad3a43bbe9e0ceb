//! The virtual aircraft as an agent on the bus.

use crate::bridged::BridgedVehicle;
use crate::error::VaError;
use crate::safety_monitor::SafetyMonitor;
use crate::simulated::SimulatedVehicle;
use air::geo::Geodetic;
use protocol::control_level::ControlEvent;
use protocol::key::Name;
use protocol::message::{
    Control, ControlLevel, ControlWish, Destination, EventMessage, Mode, Setpoint, Severity, State,
    Swap,
};
use protocol::{Agent, AgentId, Event, Interest, Message, Outbox, SimTime, Topic};

/// Time between two states and two readings, s.
const REPORT_S: f64 = 0.1;

/// Shortest time between two events that report a rejected setpoint, s.
const REFUSAL_S: f64 = 1.0;

/// The vehicle behind the agent.
pub enum VehicleBackend {
    /// Plumage's own flight dynamics.
    Simulated(Box<SimulatedVehicle>),
    /// A real aircraft behind a bridge.
    Bridged(Box<BridgedVehicle>),
}

/// One vehicle of the team.
pub struct VirtualAircraft {
    id: AgentId,
    name: Name,
    backend: VehicleBackend,
    monitor: SafetyMonitor,
    /// The operator's order to replace it by another aircraft.
    swap: Option<Swap>,
    /// The operator ended the heartbeat to the real aircraft that it replaces.
    release: bool,
    /// Events of its host that are not published yet.
    pending_events: Vec<EventMessage>,
    next_report_s: f64,
    last_mode: Option<Mode>,
    last_refusal: Option<SimTime>,
}

impl VirtualAircraft {
    /// The agent `va/<name>` of the vehicle `backend`, with its safety `monitor`.
    ///
    /// # Errors
    /// A name that cannot be part of a key.
    pub fn new(
        name: &str,
        backend: VehicleBackend,
        monitor: SafetyMonitor,
    ) -> Result<Self, VaError> {
        let real = matches!(backend, VehicleBackend::Bridged(_));
        Ok(Self {
            id: AgentId::va(name)?,
            name: Name::new(name)?,
            backend,
            monitor: monitor.of_kind(real),
            swap: None,
            release: false,
            pending_events: Vec::new(),
            next_report_s: 0.0,
            last_mode: None,
            last_refusal: None,
        })
    }

    /// Restores the control level that it had before its process restarted: a pilot keeps it, in a circle at its
    /// position until the next command, and a vehicle on its way home continues.
    pub fn resume(&mut self, level: ControlLevel, state: &State, now: SimTime) {
        let VehicleBackend::Simulated(backend) = &mut self.backend else {
            return;
        };
        if level == ControlLevel::Automatic {
            return;
        }
        backend.take_over(None, now);
        backend.send_to(&Destination {
            lat_deg: state.lat_deg,
            lon_deg: state.lon_deg,
            alt_amsl_m: state.alt_amsl_m,
        });
        if level == ControlLevel::Guardian {
            backend.handle_control(ControlEvent::RemoteLost);
        }
    }

    /// The vehicle behind the agent.
    pub fn backend(&self) -> &VehicleBackend {
        &self.backend
    }

    /// The same, mutable, to pass on a bridge's report or take its setpoints.
    pub fn backend_mut(&mut self) -> &mut VehicleBackend {
        &mut self.backend
    }

    /// The control level last published; none before the first.
    pub fn level(&self) -> Option<ControlLevel> {
        self.last_mode.as_ref().map(|mode| mode.level)
    }

    /// Publishes an event of its host at the next tick.
    pub fn tell(&mut self, event: EventMessage) {
        self.pending_events.push(event);
    }

    /// Takes the operator's order to replace it, once.
    pub fn take_swap(&mut self) -> Option<Swap> {
        self.swap.take()
    }

    /// Whether the operator has ended the heartbeat to the real aircraft that it replaces; true once.
    pub fn take_release(&mut self) -> bool {
        std::mem::take(&mut self.release)
    }

    pub(crate) fn monitor(&self) -> &SafetyMonitor {
        &self.monitor
    }

    fn setpoint(&mut self, setpoint: &Setpoint) {
        match &mut self.backend {
            VehicleBackend::Simulated(backend) => backend.setpoint(setpoint),
            VehicleBackend::Bridged(backend) => backend.setpoint(setpoint),
        }
    }

    /// Checks a place against its own fence and height band, the last line of defence, and reports a rejection by an
    /// event.
    fn goes_to(&mut self, lat_deg: f64, lon_deg: f64, alt_amsl_m: f64, now: SimTime) -> bool {
        let to = Geodetic::new(lat_deg, lon_deg);
        let Some(why) = self.monitor.refuses(to, alt_amsl_m) else {
            return true;
        };
        let told = |last| now.since_s(last) < REFUSAL_S;
        if !self.last_refusal.is_some_and(told) {
            self.last_refusal = Some(now);
            self.pending_events.push(EventMessage::new(
                Severity::Warning,
                "setpoint-refused",
                format!("setpoint {lat_deg:.5}, {lon_deg:.5} rejected: {why}"),
            ));
        }
        false
    }

    /// Executes an operator's command.
    fn control(&mut self, control: &Control, now: SimTime) {
        match (&mut self.backend, control.wish) {
            (VehicleBackend::Simulated(backend), ControlWish::HandBack) => {
                backend.handle_control(ControlEvent::HandBack)
            }
            (VehicleBackend::Simulated(backend), ControlWish::TakeOver) => {
                backend.take_over(control.sticks, now)
            }
            // Its host sends that heartbeat.
            (_, ControlWish::Release) => self.release = true,
            // The squadron controller brings it home, so an operator's control ends.
            (VehicleBackend::Simulated(backend), ControlWish::Home) => {
                if !backend.follows_setpoints() {
                    backend.handle_control(ControlEvent::HandBack);
                }
            }
            // A real vehicle's pilot keeps it until a hand-back by remote control.
            (VehicleBackend::Bridged(_), ControlWish::Home) => {}
            (VehicleBackend::Bridged(backend), ControlWish::HandBack) => {
                backend.handle_control(ControlEvent::HandBack)
            }
            (VehicleBackend::Bridged(backend), ControlWish::TakeOver) => {
                let text = "take-over rejected: the pilot takes over a real vehicle with the remote control";
                backend.push_event(EventMessage::new(
                    Severity::Warning,
                    "takeover-refused",
                    text,
                ))
            }
        }
    }

    /// Reports dangers that begin or end to the control level.
    fn update_dangers(&mut self, now: SimTime) {
        let position = match &self.backend {
            VehicleBackend::Simulated(backend) => Some(backend.observed_position()),
            VehicleBackend::Bridged(backend) => {
                backend.last_state().map(|state| self.monitor.locate(state))
            }
        };
        for event in self.monitor.check(now, position) {
            match &mut self.backend {
                VehicleBackend::Simulated(backend) => backend.handle_control(event),
                VehicleBackend::Bridged(backend) => backend.handle_control(event),
            }
        }
        if let VehicleBackend::Simulated(backend) = &mut self.backend {
            backend.resume();
        }
    }

    fn tick(&mut self, now: SimTime, out: &mut Outbox) {
        let due = now.s() + 1e-9 >= self.next_report_s;
        if due {
            self.next_report_s = now.s() + REPORT_S;
        }
        self.update_dangers(now);
        let report = match &mut self.backend {
            VehicleBackend::Simulated(backend) => backend.tick(now, due),
            VehicleBackend::Bridged(backend) => backend.tick(),
        };
        if let Some(state) = report.state {
            out.say(Topic::State(self.name.clone()), Message::State(state));
        }
        for reading in report.readings {
            out.say(Topic::Reading(self.name.clone()), Message::Reading(reading));
        }
        if let Some(mode) = report.mode.filter(|m| self.last_mode.as_ref() != Some(m)) {
            self.last_mode = Some(mode.clone());
            out.say(Topic::Mode(self.name.clone()), Message::Mode(mode));
        }
        if let Some(health) = report.health {
            out.say(Topic::Health(self.name.clone()), Message::Health(health));
        }
        for event in self.pending_events.drain(..).chain(report.events) {
            out.say(Topic::Event(self.id.clone()), Message::Event(event));
        }
    }
}

impl Agent for VirtualAircraft {
    fn id(&self) -> &AgentId {
        &self.id
    }

    fn interests(&self) -> Vec<Interest> {
        // A simulated and a real aircraft may replace each other, so it subscribes to the messages for both.
        vec![
            Interest::One(Topic::Setpoint(self.name.clone())),
            Interest::One(Topic::Control(self.name.clone())),
            Interest::One(Topic::Destination(self.name.clone())),
            Interest::One(Topic::Swap(self.name.clone())),
            Interest::One(Topic::Ambient(self.name.clone())),
            Interest::One(Topic::Model),
            Interest::One(Topic::Plan),
        ]
    }

    fn handle(&mut self, event: Event<'_>, now: SimTime, out: &mut Outbox) {
        match event {
            Event::Message(_, envelope) => {
                self.monitor.observe(&envelope.message, now);
                match &envelope.message {
                    Message::Setpoint(to)
                        if self.goes_to(to.lat_deg, to.lon_deg, to.alt_amsl_m, now) =>
                    {
                        self.setpoint(to);
                    }
                    Message::Control(control) => self.control(control, now),
                    Message::Destination(to) => {
                        if matches!(&self.backend, VehicleBackend::Simulated(b) if b.is_piloted())
                            && self.goes_to(to.lat_deg, to.lon_deg, to.alt_amsl_m, now)
                            && let VehicleBackend::Simulated(backend) = &mut self.backend
                        {
                            backend.send_to(to);
                        }
                    }
                    Message::Swap(swap) => self.swap = Some(swap.clone()),
                    Message::Ambient(ambient) => {
                        if let VehicleBackend::Simulated(backend) = &mut self.backend {
                            backend.ambient(ambient);
                        }
                    }
                    _ => {}
                }
            }
            Event::Tick => self.tick(now, out),
            Event::Computed(_) | Event::Stop => {}
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use protocol::Envelope;
    use protocol::message::PathKind;
    use scenario::Scenario;

    fn setpoint(lat_deg: f64, alt_amsl_m: f64) -> Setpoint {
        Setpoint {
            path: PathKind::GoTo,
            lat_deg,
            lon_deg: -7.8631,
            alt_amsl_m,
            airspeed_m_s: 18.0,
            orbit_radius_m: 80.0,
        }
    }

    /// Time at which a real vehicle in the air reports the world simulator as silent, if that sends what `sends` returns
    /// once a second, s.
    fn world_missed_at_s(until_s: f64, sends: impl Fn(f64) -> Option<Message>) -> Option<f64> {
        let text = include_str!("../../../scenarios/as-pontes.toml");
        let scenario = Scenario::parse("as-pontes.toml", text).unwrap();
        let aircraft =
            fdm::Aircraft::from_toml("x8.toml", include_str!("../../../aircraft/x8.toml")).unwrap();
        let monitor = SafetyMonitor::new(&scenario, 5).unwrap();
        let body = BridgedVehicle::new(Some(aircraft.surfaces));
        let mut va =
            VirtualAircraft::new("6", VehicleBackend::Bridged(Box::new(body)), monitor).unwrap();
        let name = Name::new("6").unwrap();
        let mut out = Outbox::default();
        for tick in 0..(until_s * 10.0) as u64 {
            let now = SimTime::of_tick(tick, 100_000_000);
            let mut said = vec![(Topic::Plan, Message::Plan(plan()))];
            if tick % 10 == 0 {
                said.extend(sends(now.s()).map(|m| (Topic::Ambient(name.clone()), m)));
            }
            for (topic, message) in said {
                let envelope = Envelope {
                    sender: topic.writer(),
                    sequence: tick + 1,
                    time: now,
                    message,
                };
                va.handle(Event::Message(&topic, &envelope), now, &mut out);
            }
            let VehicleBackend::Bridged(body) = va.backend_mut() else {
                panic!("a bridge")
            };
            body.receive(crate::VehicleReport {
                state: Some(in_the_air()),
                ..crate::VehicleReport::default()
            });
            va.handle(Event::Tick, now, &mut out);
            let VehicleBackend::Bridged(body) = va.backend_mut() else {
                panic!("a bridge")
            };
            let missed = ControlEvent::Begins(protocol::control_level::Danger::World);
            if body.take_control_events().contains(&missed) {
                return Some(now.s());
            }
        }
        None
    }

    fn plan() -> protocol::message::Plan {
        protocol::message::Plan {
            phase: protocol::message::Phase::Search,
            assignments: Vec::new(),
            peak: None,
        }
    }

    fn in_the_air() -> State {
        State {
            kind: protocol::message::VehicleKind::Real,
            lat_deg: 43.45,
            lon_deg: -7.8631,
            alt_amsl_m: 700.0,
            vel_ned_m_s: [18.0, 0.0, 0.0],
            roll_deg: 0.0,
            pitch_deg: 0.0,
            heading_deg: 0.0,
            airspeed_m_s: 18.0,
            throttle: 0.5,
            airborne: true,
        }
    }

    fn ambient() -> Message {
        Message::Ambient(protocol::message::Ambient {
            wind_ned_m_s: [0.0; 3],
            gust_ned_m_s: [0.0; 3],
            temperature_k: 288.0,
            pressure_pa: 95_000.0,
            co2_ppm: 420.0,
            ground_amsl_m: 340.0,
        })
    }

    #[test]
    fn a_real_vehicle_misses_the_world_25_s_after_its_last_heartbeat_and_not_when_it_is_back() {
        let alive = |s: f64| s < 40.0;
        let gone = world_missed_at_s(120.0, |s| alive(s).then(ambient));
        // The last one came at 39 s.
        assert!(gone.is_some_and(|s| (64.0..64.3).contains(&s)), "{gone:?}");
        let back = |s: f64| (alive(s) || s >= 62.0).then(ambient);
        assert_eq!(world_missed_at_s(120.0, back), None);
    }

    /// The reference mission: the fence ends at 43.480° north, and reaches from 460 to 1,240 m AMSL.
    #[test]
    fn it_does_not_leave_its_fence_and_height_band_whoever_sends_it() {
        let text = include_str!("../../../scenarios/as-pontes.toml");
        let scenario = Scenario::parse("as-pontes.toml", text).unwrap();
        let aircraft =
            fdm::Aircraft::from_toml("x8.toml", include_str!("../../../aircraft/x8.toml")).unwrap();
        let monitor = SafetyMonitor::new(&scenario, 0).unwrap();
        let top_m = scenario.fence_top_amsl_m();
        let body = BridgedVehicle::new(Some(aircraft.surfaces));
        let body = VehicleBackend::Bridged(Box::new(body));
        let mut va = VirtualAircraft::new("1", body, monitor).unwrap();
        let topic = Topic::Setpoint(Name::new("1").unwrap());
        let mut out = Outbox::default();
        let mut flown = |va: &mut VirtualAircraft, tick: u64, to: Setpoint| {
            let now = SimTime::of_tick(tick, 20_000_000);
            let envelope = Envelope::new(AgentId::sc(), tick + 1, now, Message::Setpoint(to));
            va.handle(Event::Message(&topic, &envelope), now, &mut out);
            va.handle(Event::Tick, now, &mut out);
            let VehicleBackend::Bridged(body) = va.backend_mut() else {
                panic!("a bridge")
            };
            body.take_setpoints().len()
        };
        assert_eq!(flown(&mut va, 0, setpoint(43.45, top_m - 50.0)), 1);
        // 9 km outside at 2,500 m; above and below the band; not a number.
        for (k, to) in [
            setpoint(43.561, 2500.0),
            setpoint(43.561, top_m - 50.0),
            setpoint(43.45, top_m + 31.0),
            setpoint(43.45, 341.0),
            setpoint(f64::NAN, top_m - 50.0),
            setpoint(43.45, f64::INFINITY),
        ]
        .into_iter()
        .enumerate()
        {
            assert_eq!(flown(&mut va, 1 + k as u64, to.clone()), 0, "{to:?}");
        }
        assert_eq!(flown(&mut va, 8, setpoint(43.45, top_m - 50.0)), 1);
        // Six are rejected within 0.2 s, and reported by one event.
        let told = out.messages().iter().filter(|(_, message)| {
            matches!(message, Message::Event(event) if event.code == "setpoint-refused")
        });
        assert_eq!(told.count(), 1);
    }
}
