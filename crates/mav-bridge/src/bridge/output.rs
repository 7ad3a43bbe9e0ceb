//! What a call of the bridge gives.

use protocol::message::{EventMessage, Reading, State};

/// Output of a call; clear it, or create a new one, for each call.
#[derive(Debug, Clone, Default)]
pub struct BridgeOutput {
    /// Frames to send to the vehicle, in order.
    pub frames_to_vehicle: Vec<Vec<u8>>,
    /// Frames that came from the link and had a valid checksum, in order.
    pub frames_from_vehicle: Vec<Vec<u8>>,
    /// The vehicle's state, if a new position came; the last of several.
    pub state: Option<State>,
    /// New readings of its sensor, in order.
    pub readings: Vec<Reading>,
    /// Events.
    pub events: Vec<EventMessage>,
}

impl BridgeOutput {
    /// Clears it for the next call.
    pub fn clear(&mut self) {
        self.frames_to_vehicle.clear();
        self.frames_from_vehicle.clear();
        self.readings.clear();
        self.events.clear();
        self.state = None;
    }
}
