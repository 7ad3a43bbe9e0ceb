//! The world simulator: wind, air and plume around the simulated vehicles, and the correction
//! of its own model by what the real ones measure.
//!
//! Pure: no clock, socket, file, environment or global random number.
//!
//! - [`agent`]: the state machine on the bus;
//! - [`calibration`]: base level, plume height, axis, strength and spread from readings, with
//!   uncertainties; used in flight by the agent and off-line on files;
//! - [`wind`]: the wind that the world follows.

pub mod agent;
pub mod calibration;
pub mod wind;

pub use agent::{WorldSimulator, WorldSimulatorConfig};
pub use calibration::Calibrator;

/// Why the world simulator refuses to work.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum WsError {
    /// The scenario describes no world.
    #[error(transparent)]
    World(#[from] scenario::world::WorldError),
    /// A name that cannot be part of a key.
    #[error(transparent)]
    Name(#[from] protocol::ProtocolError),
    /// The plume model refused a corrected value.
    #[error("plume model: {0}")]
    Plume(String),
}

impl From<plume::PlumeError> for WsError {
    fn from(error: plume::PlumeError) -> Self {
        Self::Plume(error.to_string())
    }
}
