//! Why a stand-in cannot be made, or a packet not be flown.

/// Why a stand-in cannot be made, or a packet not be flown.
#[derive(Debug, thiserror::Error)]
pub enum StandInError {
    /// The scenario has no vehicle at this place.
    #[error("the scenario has no vehicle number {0}")]
    NoVehicle(usize),
    /// The scenario's reality makes no world.
    #[error("the stand-in's reality: {0}")]
    Reality(String),
    /// The aircraft cannot stand on its launcher at home.
    #[error("the stand-in's aircraft: {0}")]
    Aircraft(#[from] fdm::FdmError),
    /// A datagram that is no packet of servo outputs.
    #[error("not a packet of servo outputs of ArduPilot's JSON interface: {0}")]
    ServoPacket(String),
}
