//! The virtual aircraft: one agent for each UAV of the team.
//!
//! It looks the same from outside whether its body is simulated here ([`simulated`]) or is a real
//! aircraft whose state comes through a bridge ([`bridged`]): it says state, reading and mode,
//! and follows setpoints when it may. Who flies is decided by the one state machine
//! [`fdm::control_level`], in the simulated body or in the bridge; what it is told of the rest of
//! the team and of the fence comes from [`watch`].
//!
//! Pure: no clock, socket, file, environment or global random number.

pub mod agent;
pub mod bridged;
pub mod control;
pub mod display;
mod guardian;
pub mod simulated;
pub mod watch;

pub use agent::{Body, VirtualAircraft};
pub use bridged::{BridgedBody, FromBridge};
pub use simulated::{SimulatedBody, SimulatedConfig};
pub use watch::Watch;

/// Why a virtual aircraft refuses to work.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum VaError {
    /// The scenario describes no world.
    #[error(transparent)]
    World(#[from] scenario::world::WorldError),
    /// The aircraft cannot fly.
    #[error(transparent)]
    Flight(#[from] fdm::FdmError),
    /// A name that cannot be part of a key.
    #[error(transparent)]
    Name(#[from] protocol::ProtocolError),
    /// There is no such vehicle in the scenario.
    #[error("vehicle {0}: not in the scenario's team")]
    NoSuchVehicle(String),
}
