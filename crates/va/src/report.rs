//! What a vehicle has to tell the team.

use protocol::message::{EventMessage, Health, Mode, Reading, State};

/// What is new of a vehicle: after a tick of a simulated one, or from the bridge of a real one.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct VehicleReport {
    /// Latest state, if there is a new one.
    pub state: Option<State>,
    /// New readings, in the order in which they came.
    pub readings: Vec<Reading>,
    /// Who flies.
    pub mode: Option<Mode>,
    /// The health of the vehicle and its link, where it is due.
    pub health: Option<Box<Health>>,
    /// What happened.
    pub events: Vec<EventMessage>,
}
