//! The squadron controller: sends a team of vehicles through a mission, keeps every setpoint
//! safe, passes what real vehicles read on to the world simulator, and publishes where the peak is.
//!
//! [`SquadronController`] is an agent of the bus: a pure state machine. A mission goes through
//! take-off, preliminary flight (real vehicles look for the plume, by passes or, where its direction
//! is not known, by the [`csea::SearchStrategy`]), search (from the first reading of the plume on:
//! real vehicles fly crosswind passes that show its axis, height and strength, the others follow the
//! strategy over all readings), characterisation (real vehicles pass where it tells most of the plume), flux (a
//! curtain of passes) and home. Each begins as soon as the belief allows it.
//!
//! - [`route_graph`]: routes around fence and keep-outs;
//! - [`separation`]: vehicles keep apart in height or distance;
//! - [`fleet`]: the vehicles, where they are and where they are sent;
//! - [`plume_estimate`]: where the plume is, as far as is known;
//! - [`patterns`]: curtains, profiles, spirals and transects of aircraft that can stop;
//! - [`passes`]: straight passes through the plume;
//! - [`information`]: what crossings tell, by which the next is chosen;
//! - [`controller`]: the agent and its phases.
//!
//! At every decision it publishes a plan, by which the vehicles know that it is alive:
//!
//! ```
//! use protocol::message::Phase;
//! use protocol::{Agent, Event, Message, Outbox, SimTime};
//! use sc::SquadronController;
//!
//! let scenario = scenario::Scenario::parse(
//!     "as-pontes.toml",
//!     include_str!(concat!(env!("CARGO_MANIFEST_DIR"), "/../../scenarios/as-pontes.toml")),
//! )?;
//! let mut controller = SquadronController::new(&scenario)?;
//! let mut out = Outbox::default();
//! controller.handle(Event::Tick, SimTime::ZERO, &mut out);
//! let Some((_, Message::Plan(plan))) = out.messages().last() else { panic!("no plan") };
//! assert_eq!(plan.phase, Phase::TakeOff);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! Pure: no clock, file, socket, environment or global random number.

pub mod controller;
mod error;
pub mod fleet;
pub mod information;
mod occupancy;
pub mod passes;
pub mod patterns;
pub mod plume_estimate;
mod prior;
pub mod route_graph;
pub mod separation;
mod tasks;

pub use controller::SquadronController;
pub use csea::OUTSIDE;
pub use error::ScError;
pub use separation::Separation;
