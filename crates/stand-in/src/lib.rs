//! A vehicle that nobody needs hardware for: it behaves like an ArduPlane over MAVLink 2, flies
//! with Plumage's flight dynamics, and does so in a *reality* of its own (wind with gusts, plume,
//! sensor) of which the team learns only what its frames carry.
//!
//! [`StandInConfig`] is what it is made from, a scenario's `[reality]` above all; [`StandIn`] takes
//! frames in and gives frames out, tick by tick:
//!
//! ```
//! use mav_bridge::wire::FrameDecoder;
//! use protocol::SimTime;
//! use rand::{SeedableRng, rngs::ChaCha8Rng};
//! use stand_in::{StandIn, StandInConfig};
//!
//! let scenario = scenario::Scenario::parse(
//!     "as-pontes.toml",
//!     include_str!(concat!(env!("CARGO_MANIFEST_DIR"), "/../../scenarios/as-pontes.toml")),
//! )?;
//! let x8 = include_str!(concat!(env!("CARGO_MANIFEST_DIR"), "/../../aircraft/x8.toml"));
//! let aircraft = fdm::Aircraft::from_toml("x8.toml", x8)?;
//! let config = StandInConfig::from_scenario(&scenario, 5, aircraft)?;
//! let mut vehicle = StandIn::new(config, ChaCha8Rng::seed_from_u64(7))?;
//! let frames = vehicle.step(SimTime::ZERO, &[]);
//! let mut decoder = FrameDecoder::new();
//! decoder.push(&frames[0]);
//! assert_eq!(decoder.next_frame(SimTime::ZERO).expect("a frame").system_id(), 6);
//! assert!(!vehicle.is_armed());
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! Pure: no clock, file, socket, environment or global random number. The time is an argument
//! (`time_boot_ms` counts from the mission's start), the random numbers come from the generator
//! it is made with; the same seed and the same frames in give the same frames out, bit for bit.
//!
//! What it does as ArduPlane does: modes MANUAL, FBWA and their like (flown by sticks), LOITER,
//! CIRCLE, TAKEOFF, GUIDED, RTL, and AUTO for its landing sequence at home; commands and their
//! answers (DO_SET_MODE, NAV_RETURN_TO_LAUNCH, NAV_LOITER_UNLIM, COMPONENT_ARM_DISARM,
//! DO_REPOSITION, DO_CHANGE_SPEED, DO_LAND_START, REQUEST_MESSAGE, SET_MESSAGE_INTERVAL and their
//! older forms; every other one is answered with UNSUPPORTED); parameters by name; the failsafe on
//! loss of the ground station. What it does not: missions (none is on board, none is taken),
//! calibration, terrain following, quadplanes.

mod config;
mod error;
mod estimator;
mod flight;
pub mod json_backend;
mod parameters;
mod reality;
mod streams;
mod vehicle;

pub use config::StandInConfig;
pub use error::StandInError;
pub use fdm::autopilot::Sticks;
pub use parameters::AutopilotParameters;
pub use vehicle::StandIn;
