//! The virtual aircraft as an agent on the bus.

use crate::VaError;
use crate::bridged::BridgedBody;
use crate::simulated::SimulatedBody;
use protocol::key::Name;
use protocol::message::{Ambient, Mode, Reading, Setpoint, State};
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
    pub events: Vec<protocol::message::EventMessage>,
}

/// One vehicle of the team.
pub struct VirtualAircraft {
    id: AgentId,
    name: Name,
    body: Body,
    next_report_s: f64,
    last_mode: Option<Mode>,
}

impl VirtualAircraft {
    /// The vehicle called `name` with `body`.
    ///
    /// # Errors
    /// A name that cannot be part of a key.
    pub fn new(name: &str, body: Body) -> Result<Self, VaError> {
        Ok(Self {
            id: AgentId::va(name)?,
            name: Name::new(name)?,
            body,
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

    fn setpoint(&mut self, setpoint: &Setpoint, now: SimTime) {
        match &mut self.body {
            Body::Simulated(body) => body.setpoint(setpoint, now),
            Body::Bridged(body) => body.setpoint(setpoint),
        }
    }

    fn ambient(&mut self, ambient: &Ambient, now: SimTime) {
        if let Body::Simulated(body) = &mut self.body {
            body.ambient(ambient, now);
        }
    }

    fn tick(&mut self, now: SimTime, out: &mut Outbox) {
        let due = now.s() + 1e-9 >= self.next_report_s;
        if due {
            self.next_report_s = now.s() + REPORT_S;
        }
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
        vec![
            Interest::One(Topic::Setpoint(self.name.clone())),
            Interest::One(Topic::Ambient(self.name.clone())),
            Interest::One(Topic::Plan),
        ]
    }

    fn handle(&mut self, event: Event<'_>, now: SimTime, out: &mut Outbox) {
        match event {
            Event::Message(_, envelope) => match &envelope.message {
                Message::Setpoint(setpoint) => self.setpoint(setpoint, now),
                Message::Ambient(ambient) => self.ambient(ambient, now),
                Message::Plan(_) => {
                    if let Body::Simulated(body) = &mut self.body {
                        body.controller_heard(now);
                    }
                }
                _ => {}
            },
            Event::Tick => self.tick(now, out),
            Event::Stop => {}
        }
    }
}
