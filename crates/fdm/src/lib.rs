//! How a small aircraft flies, fixed wing or multirotor: aerodynamics, propulsion, rigid body, and the autopilot's
//! loops.
//!
//! - [`Airframe`]: an aircraft file of either kind; [`PilotedFlight`]: such an aircraft in flight with its autopilot;
//! - [`multirotor`]: a multirotor, its rotors, and its autopilot; what follows is the fixed wing;
//! - [`Aircraft`]: the aircraft as its TOML file describes it; [`extended::ExtendedAircraft`] adds
//!   the [`mechanism`]s by which the one that flies differs from that description;
//! - [`FlightSim`]: one vehicle in flight or on the ground, stepped through [`AirAround`] by
//!   [`SurfaceCommand`]s; what is known of it is a [`FlightState`];
//! - [`autopilot::Autopilot`]: from a path, an altitude and an airspeed to a `SurfaceCommand`;
//! - [`dynamics`], [`trim`]: equations of motion, steady flight, linear model and modes;
//! - [`tune`]: finding and judging the autopilot's gains.
//!
//! A minute of flight by autopilot:
//!
//! ```
//! use fdm::autopilot::{Autopilot, Demand, Path, Sensed};
//! use fdm::{AirAround, Aircraft, FlightSim};
//! use std::sync::Arc;
//!
//! let text = include_str!(concat!(env!("CARGO_MANIFEST_DIR"), "/../../aircraft/x8.toml"));
//! let aircraft = Arc::new(Aircraft::from_toml("x8.toml", text)?);
//! let mut sim = FlightSim::airborne(&aircraft, 0.0, 0.0, 400.0, 0.0, 18.0)?;
//! let mut autopilot = Autopilot::new(&aircraft);
//! let (air, dt_s) = (AirAround::STANDARD_CALM, 0.02);
//! let path = Path::Course { deg: 90.0 };
//! let demand = Demand { path, alt_amsl_m: 430.0, airspeed_m_s: 18.0 };
//! for _ in 0..3000 {
//!     let sensed = Sensed::perfect(&sim.state(), air.density_kg_m3);
//!     let command = autopilot.command(dt_s, &sensed, &demand);
//!     sim.step(dt_s, &air, &command);
//! }
//! assert!((sim.state().alt_amsl_m - 430.0).abs() < 1.0);
//! assert!((sim.state().yaw_rad.to_degrees() - 90.0).abs() < 1.0);
//! # Ok::<(), fdm::FdmError>(())
//! ```
//!
//! Pure: no clock, file, socket, environment or global random number. Time steps and seeds are
//! arguments, and the same arguments give the same bits.
//!
//! Frames: *NED* is metres north, east and down in a flat, non-rotating local frame around the
//! site's origin (altitude is given as metres above mean sea level instead of down); *body* is
//! forward, right, down. Angles are radians unless the name says `_deg`. Wind is a vector
//! *towards* which the air moves.

pub mod aircraft;
mod aircraft_file;
mod airframe;
pub mod autopilot;
pub mod dynamics;
mod error;
pub mod extended;
pub mod flight;
pub mod flightgear;
pub mod mechanism;
mod mixing;
pub mod multirotor;
mod piloted;
mod range;
mod scalar;
pub mod servo;
pub mod state;
pub mod trim;
pub mod tune;

pub use aircraft::Aircraft;
pub use airframe::{Airframe, SpeedRange};
pub use dynamics::quaternion;
pub use error::FdmError;
pub use flight::FlightSim;
pub use multirotor::Multirotor;
pub use piloted::PilotedFlight;
pub use state::{AirAround, FlightFlags, FlightPhase, FlightState, SurfaceCommand};
