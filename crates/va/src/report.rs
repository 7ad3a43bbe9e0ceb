//! What comes of a tick.

use protocol::message::{EventMessage, Mode, Reading, State};

/// What a vehicle has to publish after a tick.
#[derive(Debug, Default)]
pub(crate) struct TickReport {
    pub state: Option<State>,
    pub readings: Vec<Reading>,
    pub mode: Option<Mode>,
    pub events: Vec<EventMessage>,
}
