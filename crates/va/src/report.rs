//! What comes of a tick.

use protocol::message::{EventMessage, Health, Mode, Reading, State};

/// What a vehicle has to publish after a tick.
#[derive(Debug, Default)]
pub(crate) struct TickReport {
    pub state: Option<State>,
    pub readings: Vec<Reading>,
    pub mode: Option<Mode>,
    pub health: Option<Box<Health>>,
    pub events: Vec<EventMessage>,
}
