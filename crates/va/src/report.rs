//! The report of a vehicle to its agent.

use protocol::message::{EventMessage, Health, Mode, Reading, State};

/// News of a vehicle: after a tick of a simulated one, or from the bridge of a real one.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct VehicleReport {
    /// Latest state, if there is a new one.
    pub state: Option<State>,
    /// New readings, in order of arrival.
    pub readings: Vec<Reading>,
    /// The control level with its reason.
    pub mode: Option<Mode>,
    /// The health of the vehicle and its link, if due.
    pub health: Option<Box<Health>>,
    /// Events.
    pub events: Vec<EventMessage>,
}
