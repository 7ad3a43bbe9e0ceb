//! A vehicle that nobody needs hardware for: it behaves like an ArduPlane, or with a multirotor like an ArduCopter, over
//! MAVLink 2, flies
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
//! let aircraft = fdm::Airframe::from_toml("x8.toml", x8)?;
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
//! What it does as ArduPlane 4.8 does: its fixed-wing modes, AUTO with an uploaded mission among them;
//! missions, fences and rally points by the mission protocol; the usual streams, single messages,
//! parameters, clock; commands with their answers and refusals, every one answered; the fence
//! and the failsafe on loss of the ground station. `docs/mavlink.md` has the list, and what it does
//! not do.
//!
//! As ArduCopter it takes off by NAV_TAKEOFF in GUIDED, flies to positions and by velocities in GUIDED, holds in LOITER,
//! and lands by RTL and LAND; it has no AUTO.
//!
//! How an ArduPlane speaks (`speaker`, and `report` for what its messages tell) is apart from what flies
//! it: in the stand-in `flight`, and `mission_run` for missions that `item_list` has carried over;
//! in a [`TeamVehicle`], by which ground stations see any vehicle of a team, whatever the bus says.

mod config;
mod error;
mod estimator;
mod fence;
mod firmware;
mod flight;
mod home_position;
mod item_list;
pub mod json_backend;
mod mission_run;
mod parameters;
mod reality;
mod report;
mod speaker;
mod streams;
mod team;
mod vehicle;

pub use config::StandInConfig;
pub use error::StandInError;
pub use fdm::autopilot::Sticks;
pub use parameters::AutopilotParameters;
pub use team::{TeamVehicle, TeamWish};
pub use vehicle::StandIn;
