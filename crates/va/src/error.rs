//! Errors of this crate.

/// Error of a virtual aircraft.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum VaError {
    /// The scenario describes no valid world.
    #[error(transparent)]
    World(#[from] scenario::world::WorldError),
    /// The aircraft cannot fly.
    #[error(transparent)]
    Flight(#[from] fdm::FdmError),
    /// A name that cannot be part of a key.
    #[error(transparent)]
    Name(#[from] protocol::ProtocolError),
    /// There is no such vehicle in the scenario.
    #[error("vehicle {0} is not in the scenario's team")]
    NoSuchVehicle(String),
}
