//! A body that is a real aircraft: its news come from a bridge, its setpoints go there.

use crate::agent::Report;
use fdm::aircraft::Surfaces;
use fdm::control_level::Event;
use protocol::message::{EventMessage, Mode, Reading, Setpoint, State};

/// News of a real aircraft, as a bridge tells them.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct FromBridge {
    /// Latest state, if there is a new one.
    pub state: Option<State>,
    /// Latest reading, if there is a new one.
    pub reading: Option<Reading>,
    /// Who flies.
    pub mode: Option<Mode>,
    /// What happened.
    pub events: Vec<EventMessage>,
}

/// A real aircraft behind a bridge.
#[derive(Debug)]
pub struct BridgedBody {
    surfaces: Surfaces,
    news: FromBridge,
    last: Option<State>,
    setpoints: Vec<Setpoint>,
    control: Vec<Event>,
}

impl BridgedBody {
    /// A body with these surfaces that waits for its first news.
    pub fn new(surfaces: Surfaces) -> Self {
        Self {
            surfaces,
            news: FromBridge::default(),
            last: None,
            setpoints: Vec::new(),
            control: Vec::new(),
        }
    }

    pub(crate) fn surfaces(&self) -> &Surfaces {
        &self.surfaces
    }

    /// Takes in news; newer values replace those not said yet.
    pub fn news(&mut self, news: FromBridge) {
        let FromBridge {
            state,
            reading,
            mode,
            events,
        } = news;
        if let Some(state) = &state {
            self.last = Some(state.clone());
        }
        self.news.state = state.or(self.news.state.take());
        self.news.reading = reading.or(self.news.reading.take());
        self.news.mode = mode.or(self.news.mode.take());
        self.news.events.extend(events);
    }

    /// Setpoints that wait for the bridge, in order.
    pub fn take_setpoints(&mut self) -> Vec<Setpoint> {
        std::mem::take(&mut self.setpoints)
    }

    /// What happened to the control level outside the bridge, in order: dangers that begin or
    /// end, hand-backs.
    pub fn take_control(&mut self) -> Vec<Event> {
        std::mem::take(&mut self.control)
    }

    pub(crate) fn control(&mut self, event: Event) {
        self.control.push(event);
    }

    /// The last state heard.
    pub(crate) fn last(&self) -> Option<&State> {
        self.last.as_ref()
    }

    /// Something for the team to know.
    pub(crate) fn say(&mut self, event: EventMessage) {
        self.news.events.push(event);
    }

    pub(crate) fn setpoint(&mut self, setpoint: &Setpoint) {
        self.setpoints.push(setpoint.clone());
    }

    pub(crate) fn tick(&mut self) -> Report {
        let FromBridge {
            state,
            reading,
            mode,
            events,
        } = std::mem::take(&mut self.news);
        Report {
            state,
            reading,
            mode,
            events,
        }
    }
}
