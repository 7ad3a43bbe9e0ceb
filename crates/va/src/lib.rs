//! The virtual aircraft: one agent on the bus for each UAV of the team.
//!
//! [`VirtualAircraft`] looks the same from outside whether the vehicle is simulated here
//! ([`SimulatedVehicle`]) or is a real aircraft behind a bridge ([`BridgedVehicle`]): it publishes
//! state, reading and mode, and follows setpoints when it may. The control level comes from one
//! state machine [`protocol::control_level`], in the simulated vehicle or in the bridge; its
//! [`SafetyMonitor`] adds the dangers of silent peers and the fence.
//!
//! A simulated vehicle publishes with its first tick that it stands on its launcher:
//!
//! ```
//! use protocol::{Agent, Event, Message, Outbox, SimTime};
//! use va::{SafetyMonitor, SimulatedConfig, SimulatedVehicle, VehicleBackend, VirtualAircraft};
//!
//! let scenario = scenario::Scenario::parse(
//!     "as-pontes.toml",
//!     include_str!(concat!(env!("CARGO_MANIFEST_DIR"), "/../../scenarios/as-pontes.toml")),
//! )?;
//! let x8 = include_str!(concat!(env!("CARGO_MANIFEST_DIR"), "/../../aircraft/x8.toml"));
//! let aircraft = &fdm::Airframe::from_toml("x8.toml", x8)?;
//! let ground_amsl_m = scenario.site.ground_amsl_m;
//! let layer_amsl_m = scenario.layers_amsl_m()[0];
//! let config = SimulatedConfig { scenario: &scenario, index: 0, aircraft, ground_amsl_m, layer_amsl_m };
//! let backend = VehicleBackend::Simulated(Box::new(SimulatedVehicle::new(config)?));
//! let monitor = SafetyMonitor::new(&scenario, 0)?;
//! let mut vehicle = VirtualAircraft::new("1", backend, monitor)?;
//! let mut out = Outbox::default();
//! vehicle.handle(Event::Tick, SimTime::ZERO, &mut out);
//! let (_, Message::State(state)) = &out.messages()[0] else { panic!("no state") };
//! assert!(!state.airborne);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! Pure: no clock, socket, file, environment or global random number.

pub mod agent;
pub mod bridged;
pub mod control;
pub mod display;
mod error;
mod guardian;
pub mod outer_loop;
mod report;
pub mod safety_monitor;
pub mod simulated;

pub use agent::{VehicleBackend, VirtualAircraft};
pub use bridged::BridgedVehicle;
pub use error::VaError;
pub use outer_loop::OuterLoop;
pub use report::VehicleReport;
pub use safety_monitor::SafetyMonitor;
pub use simulated::{SimulatedConfig, SimulatedVehicle};
