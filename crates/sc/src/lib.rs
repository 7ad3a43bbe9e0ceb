//! The squadron controller: sends a team of vehicles through a mission, keeps every setpoint
//! safe, passes what real vehicles read on to the world simulator, and says where the peak is.
//!
//! [`SquadronController`] is an agent of the bus: a pure state machine. A mission goes through
//! take-off, preliminary flight (real vehicles fly crosswind passes that show the plume's axis,
//! height and strength), search (the whole team follows a [`csea::SearchStrategy`] over all
//! readings), characterisation (real vehicles pass across and along the peak found) and home.
//!
//! - [`airspace`]: fence, height band and keep-outs, and ways around them;
//! - [`separation`]: vehicles keep apart in height or distance;
//! - [`fleet`]: the vehicles, where they are and where they are sent;
//! - [`live_gap`]: what real readings say of the model, in flight;
//! - [`passes`]: straight passes through the plume;
//! - [`peak`]: the highest place of a model that may be flown to;
//! - [`controller`]: the agent and its phases.
//!
//! Pure: no clock, file, socket, environment or global random number.

pub mod airspace;
pub mod controller;
pub mod fleet;
pub mod live_gap;
pub mod passes;
pub mod peak;
pub mod separation;
mod tasks;

pub use airspace::Airspace;
pub use controller::SquadronController;
pub use separation::Separation;

/// Why there can be no squadron controller for a scenario.
#[derive(Debug, thiserror::Error, PartialEq)]
pub enum ScError {
    /// The scenario describes no world.
    #[error(transparent)]
    World(#[from] scenario::world::WorldError),
    /// A name cannot stand in a key.
    #[error(transparent)]
    Name(#[from] protocol::ProtocolError),
    /// The model cannot be held against readings.
    #[error("reality gap: {0}")]
    Gap(String),
    /// The search cannot be set up.
    #[error(transparent)]
    Search(#[from] csea::CseaError),
    /// The fence leaves nowhere to fly.
    #[error(
        "fence: no place keeps {margin_m:.0} m from the fence and from the keep-out of \
         {keep_out_m:.0} m around each stack; expected a larger fence or a smaller keep-out"
    )]
    NoAirspace {
        /// Margin for turns, m.
        margin_m: f64,
        /// Keep-out radius, m.
        keep_out_m: f64,
    },
}
