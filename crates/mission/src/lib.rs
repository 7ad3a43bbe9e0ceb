//! A whole mission put together: the team that a scenario asks for, run in one process in
//! virtual time or member by member in processes of their own, and what is known of the
//! stand-ins' reality to hold the result against.
//!
//! Pure: files come in through a closure, time through ticks.
//!
//! - [`setup`]: a scenario with all the files it names;
//! - [`team`]: the agents;
//! - [`real_vehicle`]: a real vehicle's agent with bridge and stand-in in one;
//! - [`run`]: a mission in virtual time;
//! - [`truth`]: the reality's numbers and its highest reachable concentration;
//! - [`campaign`]: many seeds and what they show.

pub mod campaign;
pub mod real_vehicle;
pub mod run;
pub mod setup;
pub mod team;
pub mod truth;

pub use run::Run;
pub use setup::Setup;
pub use team::Member;

/// Why a mission cannot be flown.
#[derive(Debug, thiserror::Error)]
pub enum MissionError {
    /// The scenario was refused.
    #[error(transparent)]
    Scenario(#[from] scenario::ScenarioError),
    /// A file that the scenario names.
    #[error("{file}: {why} (named by {named_by})")]
    File {
        /// The file.
        file: String,
        /// What is wrong with it.
        why: String,
        /// Where it is named.
        named_by: String,
    },
    /// The scenario describes no world.
    #[error(transparent)]
    World(#[from] scenario::world::WorldError),
    /// The world simulator.
    #[error("world simulator: {0}")]
    Ws(#[from] ws::WsError),
    /// A vehicle.
    #[error("vehicle: {0}")]
    Va(#[from] va::VaError),
    /// The squadron controller.
    #[error("squadron controller: {0}")]
    Sc(#[from] sc::ScError),
    /// A bridge.
    #[error("bridge: {0}")]
    Bridge(#[from] mav_bridge::BridgeError),
    /// A stand-in.
    #[error("stand-in: {0}")]
    StandIn(#[from] stand_in::StandInError),
    /// A name that cannot be part of a key.
    #[error(transparent)]
    Name(#[from] protocol::ProtocolError),
    /// A request that the scenario cannot meet.
    #[error("{0}")]
    Request(String),
}
