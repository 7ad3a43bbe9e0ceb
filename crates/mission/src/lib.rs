//! A whole mission put together: the team that a scenario asks for, run in one process in
//! virtual time or member by member in processes of their own, and what is known of the
//! stand-ins' reality to hold the result against.
//!
//! Pure: files come in through a closure, time through ticks.
//!
//! - [`setup`]: a scenario with all the files it names;
//! - [`preflight`]: what speaks against taking off;
//! - [`team`]: the agents;
//! - [`real_vehicle`]: a real vehicle's agent with bridge and stand-in in one;
//! - [`released`]: a real aircraft that was given to its pilot;
//! - [`fed_vehicle`]: one that is not of the team, and of which there are only observations;
//! - [`run`]: a mission in virtual time;
//! - [`truth`]: the reality's numbers and its highest reachable concentration;
//! - [`campaign`]: many seeds and what they show.
//!
//! # Example
//!
//! A minute of a mission with the default team, five simulated aircraft and one stand-in:
//!
//! ```
//! use mission::{Run, Setup};
//! use protocol::message::Message;
//!
//! # fn main() -> Result<(), mission::MissionError> {
//! let text = r#"
//! [mission]
//! duration_s = 60.0
//! [site]
//! lat_deg = 43.4417
//! lon_deg = -7.8631
//! ground_amsl_m = 340.0
//! [[source]]
//! lat_deg = 43.4417
//! lon_deg = -7.8631
//! stack_height_m = 356.0
//! effective_height_m = 486.0
//! emission_kg_s = 352.0
//! "#;
//! let no_files = |name: &str| Err(format!("{name}: nothing here"));
//! let setup = Setup::load("own.toml", text, &no_files)?;
//! let fly = || -> Result<(f64, String), mission::MissionError> {
//!     let mut run = Run::new(&setup)?;
//!     let mut highest_amsl_m = 340.0_f64;
//!     while !run.ended() {
//!         for (_, envelope) in run.step() {
//!             if let Message::State(state) = &envelope.message {
//!                 highest_amsl_m = highest_amsl_m.max(state.alt_amsl_m);
//!             }
//!         }
//!     }
//!     Ok((highest_amsl_m, run.digest()))
//! };
//! let (highest_amsl_m, digest) = fly()?;
//! assert!(highest_amsl_m > 400.0, "{highest_amsl_m}");
//! // Flown again it is the same mission, bit for bit.
//! assert_eq!(fly()?.1, digest);
//! # Ok(())
//! # }
//! ```

pub mod campaign;
pub mod fed_vehicle;
pub mod flight_plan;
pub mod plan;
pub mod preflight;
pub mod real_vehicle;
pub mod released;
pub mod run;
pub mod setup;
pub mod swap;
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
