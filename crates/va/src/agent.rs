//! The virtual aircraft as an agent on the bus.

use crate::bridged::BridgedVehicle;
use crate::error::VaError;
use crate::safety_monitor::SafetyMonitor;
use crate::simulated::SimulatedVehicle;
use protocol::control_level::ControlEvent;
use protocol::key::Name;
use protocol::message::{
    Control, ControlLevel, ControlWish, EventMessage, Mode, Setpoint, Severity, Swap,
};
use protocol::{Agent, AgentId, Event, Interest, Message, Outbox, SimTime, Topic};

/// Time between two states and two readings, s.
const REPORT_S: f64 = 0.1;

/// What flies.
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
    /// What the operator wants in its place.
    swap: Option<Swap>,
    /// Events of its host that are not said yet.
    told: Vec<EventMessage>,
    next_report_s: f64,
    last_mode: Option<Mode>,
}

impl VirtualAircraft {
    /// The vehicle called `name` with its `backend`, watched over by `monitor`.
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
            told: Vec::new(),
            next_report_s: 0.0,
            last_mode: None,
        })
    }

    /// What flies.
    pub fn backend(&self) -> &VehicleBackend {
        &self.backend
    }

    /// What flies, to hand a bridge's report to it or take its setpoints.
    pub fn backend_mut(&mut self) -> &mut VehicleBackend {
        &mut self.backend
    }

    /// Who flies it, as it was last said; none before.
    pub fn level(&self) -> Option<ControlLevel> {
        self.last_mode.as_ref().map(|mode| mode.level)
    }

    /// Lets it say an event of its host's at its next tick.
    pub fn tell(&mut self, event: EventMessage) {
        self.told.push(event);
    }

    /// What the operator wants in its place, once.
    pub fn take_swap(&mut self) -> Option<Swap> {
        self.swap.take()
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

    /// What the operator wishes.
    fn control(&mut self, control: &Control, now: SimTime) {
        match (&mut self.backend, control.wish) {
            (VehicleBackend::Simulated(backend), ControlWish::HandBack) => {
                backend.handle_control(ControlEvent::HandBack)
            }
            (VehicleBackend::Simulated(backend), ControlWish::TakeOver) => {
                backend.take_over(control.sticks, now)
            }
            // The squadron controller brings it home: whoever else has it here gives it back.
            (VehicleBackend::Simulated(backend), ControlWish::Home) => {
                if !backend.follows_setpoints() {
                    backend.handle_control(ControlEvent::HandBack);
                }
            }
            // A real vehicle's pilot keeps it until he hands it back himself.
            (VehicleBackend::Bridged(_), ControlWish::Home) => {}
            (VehicleBackend::Bridged(backend), ControlWish::HandBack) => {
                backend.handle_control(ControlEvent::HandBack)
            }
            (VehicleBackend::Bridged(backend), ControlWish::TakeOver) => {
                backend.push_event(EventMessage {
                    severity: Severity::Warning,
                    code: "takeover-refused".to_owned(),
                    text: "a real vehicle is taken over by its pilot's own remote control"
                        .to_owned(),
                })
            }
        }
    }

    /// Dangers that begin or end.
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
        for event in self.told.drain(..).chain(report.events) {
            out.say(Topic::Event(self.id.clone()), Message::Event(event));
        }
    }
}

impl Agent for VirtualAircraft {
    fn id(&self) -> &AgentId {
        &self.id
    }

    fn interests(&self) -> Vec<Interest> {
        // Another kind of aircraft may take its place: what either gets from the world simulator is heard.
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
                    Message::Setpoint(setpoint) => self.setpoint(setpoint),
                    Message::Control(control) => self.control(control, now),
                    Message::Destination(place) => {
                        if let VehicleBackend::Simulated(backend) = &mut self.backend {
                            backend.send_to(place);
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
            Event::Stop => {}
        }
    }
}
