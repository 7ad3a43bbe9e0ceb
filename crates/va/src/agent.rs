//! The virtual aircraft as an agent on the bus.

use crate::VaError;
use crate::bridged::BridgedBody;
use crate::simulated::SimulatedBody;
use crate::watch::Watch;
use fdm::control_level::Event as Level;
use protocol::key::Name;
use protocol::message::{
    Control, ControlWish, EventMessage, Mode, Reading, Setpoint, Severity, State,
};
use protocol::{Agent, AgentId, Event, Interest, Message, Outbox, SimTime, Topic};

/// Time between two states and two readings, s.
const REPORT_S: f64 = 0.1;

/// What flies.
pub enum Body {
    /// Plumage's own flight dynamics.
    Simulated(Box<SimulatedBody>),
    /// A real aircraft behind a bridge.
    Bridged(Box<BridgedBody>),
}

/// What a body has to say after a tick.
#[derive(Debug, Default)]
pub(crate) struct Report {
    pub state: Option<State>,
    pub reading: Option<Reading>,
    pub mode: Option<Mode>,
    pub events: Vec<EventMessage>,
}

/// One vehicle of the team.
pub struct VirtualAircraft {
    id: AgentId,
    name: Name,
    body: Body,
    watch: Watch,
    next_report_s: f64,
    last_mode: Option<Mode>,
}

impl VirtualAircraft {
    /// The vehicle called `name` with `body` that watches by `watch`.
    ///
    /// # Errors
    /// A name that cannot be part of a key.
    pub fn new(name: &str, body: Body, watch: Watch) -> Result<Self, VaError> {
        Ok(Self {
            id: AgentId::va(name)?,
            name: Name::new(name)?,
            body,
            watch,
            next_report_s: 0.0,
            last_mode: None,
        })
    }

    /// What flies.
    pub fn body(&self) -> &Body {
        &self.body
    }

    /// What flies, to hand a bridge's news to it or take its setpoints.
    pub fn body_mut(&mut self) -> &mut Body {
        &mut self.body
    }

    pub(crate) fn watch(&self) -> &Watch {
        &self.watch
    }

    fn setpoint(&mut self, setpoint: &Setpoint) {
        match &mut self.body {
            Body::Simulated(body) => body.setpoint(setpoint),
            Body::Bridged(body) => body.setpoint(setpoint),
        }
    }

    /// What the operator wishes.
    fn control(&mut self, control: &Control, now: SimTime) {
        match (&mut self.body, control.wish) {
            (Body::Simulated(body), ControlWish::HandBack) => body.control(Level::HandBack),
            (Body::Simulated(body), ControlWish::TakeOver) => body.take_over(control.sticks, now),
            (Body::Bridged(body), ControlWish::HandBack) => body.control(Level::HandBack),
            (Body::Bridged(body), ControlWish::TakeOver) => body.say(EventMessage {
                severity: Severity::Warning,
                code: "takeover-refused".to_owned(),
                text: "a real vehicle is taken over by its pilot's own remote control".to_owned(),
            }),
        }
    }

    /// Dangers that begin or end.
    fn look_around(&mut self, now: SimTime) {
        let seen = match &self.body {
            Body::Simulated(body) => Some(body.seen()),
            Body::Bridged(body) => body.last().map(|state| self.watch.place(state)),
        };
        for event in self.watch.tick(now, seen) {
            match &mut self.body {
                Body::Simulated(body) => body.control(event),
                Body::Bridged(body) => body.control(event),
            }
        }
    }

    fn tick(&mut self, now: SimTime, out: &mut Outbox) {
        let due = now.s() + 1e-9 >= self.next_report_s;
        if due {
            self.next_report_s = now.s() + REPORT_S;
        }
        self.look_around(now);
        let report = match &mut self.body {
            Body::Simulated(body) => body.tick(now, due),
            Body::Bridged(body) => body.tick(),
        };
        if let Some(state) = report.state {
            out.say(Topic::State(self.name.clone()), Message::State(state));
        }
        if let Some(reading) = report.reading {
            out.say(Topic::Reading(self.name.clone()), Message::Reading(reading));
        }
        if let Some(mode) = report.mode.filter(|m| self.last_mode.as_ref() != Some(m)) {
            self.last_mode = Some(mode.clone());
            out.say(Topic::Mode(self.name.clone()), Message::Mode(mode));
        }
        for event in report.events {
            out.say(Topic::Event(self.id.clone()), Message::Event(event));
        }
    }
}

impl Agent for VirtualAircraft {
    fn id(&self) -> &AgentId {
        &self.id
    }

    fn interests(&self) -> Vec<Interest> {
        // How each kind hears that the world simulator lives.
        let world = if self.watch.is_real() {
            Topic::Model
        } else {
            Topic::Ambient(self.name.clone())
        };
        vec![
            Interest::One(Topic::Setpoint(self.name.clone())),
            Interest::One(Topic::Control(self.name.clone())),
            Interest::One(world),
            Interest::One(Topic::Plan),
        ]
    }

    fn handle(&mut self, event: Event<'_>, now: SimTime, out: &mut Outbox) {
        match event {
            Event::Message(_, envelope) => {
                self.watch.heard(&envelope.message, now);
                match &envelope.message {
                    Message::Setpoint(setpoint) => self.setpoint(setpoint),
                    Message::Control(control) => self.control(control, now),
                    Message::Ambient(ambient) => {
                        if let Body::Simulated(body) = &mut self.body {
                            body.ambient(ambient);
                        }
                    }
                    _ => {}
                }
            }
            Event::Tick => self.tick(now, out),
            Event::Stop => {}
        }
    }
}
