//! A real aircraft: a bridge delivers its reports and receives its setpoints.

use crate::report::VehicleReport;
use fdm::aircraft::Surfaces;
use protocol::control_level::ControlEvent;
use protocol::message::{EventMessage, Setpoint, State};

/// A real aircraft behind a bridge.
#[derive(Debug)]
pub struct BridgedVehicle {
    surfaces: Option<Surfaces>,
    /// The report that is not published yet.
    pending: VehicleReport,
    last: Option<State>,
    setpoints: Vec<Setpoint>,
    control_events: Vec<ControlEvent>,
}

impl BridgedVehicle {
    /// A vehicle with these control surfaces, if it has any, that waits for its first report.
    pub fn new(surfaces: Option<Surfaces>) -> Self {
        Self {
            surfaces,
            pending: VehicleReport::default(),
            last: None,
            setpoints: Vec::new(),
            control_events: Vec::new(),
        }
    }

    pub(crate) fn surfaces(&self) -> Option<&Surfaces> {
        self.surfaces.as_ref()
    }

    /// Receives a report; a newer state and mode replace those not published yet.
    pub fn receive(&mut self, report: VehicleReport) {
        let VehicleReport {
            state,
            readings,
            mode,
            health,
            events,
        } = report;
        if let Some(state) = &state {
            self.last = Some(state.clone());
        }
        self.pending.state = state.or(self.pending.state.take());
        self.pending.readings.extend(readings);
        self.pending.mode = mode.or(self.pending.mode.take());
        self.pending.health = health.or(self.pending.health.take());
        self.pending.events.extend(events);
    }

    /// Setpoints that wait for the bridge, in order.
    pub fn take_setpoints(&mut self) -> Vec<Setpoint> {
        std::mem::take(&mut self.setpoints)
    }

    /// Takes the events for the bridge's control level, in order: dangers that begin or
    /// end, hand-backs.
    pub fn take_control_events(&mut self) -> Vec<ControlEvent> {
        std::mem::take(&mut self.control_events)
    }

    pub(crate) fn handle_control(&mut self, event: ControlEvent) {
        self.control_events.push(event);
    }

    /// The last state received.
    pub fn last_state(&self) -> Option<&State> {
        self.last.as_ref()
    }

    /// Adds an event to publish.
    pub(crate) fn push_event(&mut self, event: EventMessage) {
        self.pending.events.push(event);
    }

    pub(crate) fn setpoint(&mut self, setpoint: &Setpoint) {
        self.setpoints.push(setpoint.clone());
    }

    pub(crate) fn tick(&mut self) -> VehicleReport {
        std::mem::take(&mut self.pending)
    }
}
