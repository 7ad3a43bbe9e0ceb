//! A body that is a real aircraft: its news come from a bridge, its setpoints go there.

use crate::agent::Report;
use protocol::message::{EventMessage, Mode, Reading, Setpoint, State};

/// News of a real aircraft, as a bridge tells them.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct FromBridge {
    /// Latest state, if there is a new one.
    pub state: Option<State>,
    /// Latest reading, if there is a new one.
    pub reading: Option<Reading>,
    /// Who flies, if that was told.
    pub mode: Option<Mode>,
    /// What happened.
    pub events: Vec<EventMessage>,
}

/// A real aircraft behind a bridge.
#[derive(Debug, Default)]
pub struct BridgedBody {
    news: FromBridge,
    setpoints: Vec<Setpoint>,
}

impl BridgedBody {
    /// A body that waits for its first news.
    pub fn new() -> Self {
        Self::default()
    }

    /// Takes in news; newer values replace those not said yet.
    pub fn news(&mut self, news: FromBridge) {
        let FromBridge {
            state,
            reading,
            mode,
            events,
        } = news;
        self.news.state = state.or(self.news.state.take());
        self.news.reading = reading.or(self.news.reading.take());
        self.news.mode = mode.or(self.news.mode.take());
        self.news.events.extend(events);
    }

    /// Setpoints that wait for the bridge, in order.
    pub fn take_setpoints(&mut self) -> Vec<Setpoint> {
        std::mem::take(&mut self.setpoints)
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
