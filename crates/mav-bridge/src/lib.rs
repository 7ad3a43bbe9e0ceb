//! Conversion between MAVLink 2 frames of an autopilot and Plumage's messages: state, reading,
//! control level and events; setpoints as commands.
//!
//! [`Bridge`] is pure: bytes and the time come in as arguments, frames and messages go out in a
//! [`BridgeOutput`]. It knows no socket, clock, file, environment or global random number. Behind
//! the feature `link` (off by default), the module `link` carries bytes over UDP, TCP and serial ports.
//! [`wire`] finds, writes and signs frames; [`profile`] says in which an autopilot differs from others, and
//! [`arduplane`], [`arducopter`] and [`px4`] are those that can be commanded.
//!
//! A bridge presents itself as a ground station before anything is heard:
//!
//! ```
//! use mav_bridge::dialect::MavMessage;
//! use mav_bridge::wire::FrameDecoder;
//! use mav_bridge::{Bridge, BridgeConfig, BridgeOutput};
//! use protocol::SimTime;
//!
//! let mut bridge = Bridge::new(BridgeConfig::default())?;
//! let mut out = BridgeOutput::default();
//! bridge.tick(SimTime::ZERO, &mut out);
//! let mut decoder = FrameDecoder::new();
//! decoder.push(&out.frames_to_vehicle[0]);
//! let frame = decoder.next_frame(SimTime::ZERO).expect("a whole frame");
//! assert_eq!(frame.system_id(), 255);
//! assert!(matches!(frame.message(), Some(MavMessage::HEARTBEAT(_))));
//! assert!(!bridge.follows_setpoints(), "no vehicle has been heard");
//! # Ok::<(), mav_bridge::BridgeError>(())
//! ```
//!
//! Units at the border: MAVLink's scaled integers become SI and degrees. Altitude is that of
//! GLOBAL_POSITION_INT, above mean sea level. The airspeed of VFR_HUD is ArduPlane's equivalent
//! airspeed (that of its pitot tube, or the estimate without one); true airspeed is that divided
//! by √(ρ/ρ₀), with the density ρ from the vehicle's static pressure (SCALED_PRESSURE; the
//! site's atmosphere if it sends none) and the temperature of the site's atmosphere at its
//! altitude, ρ₀ = 1.225 kg/m³. Setpoints go the same way back. The temperature of a reading is
//! that of a HYGROMETER_SENSOR, else of the airspeed sensor (AIRSPEED), else of the barometer, which
//! sits in a warm case and is not used for the density.
//!
//! Who flies is decided by [`protocol::control_level`], from what the vehicle shows and what
//! is given to [`Bridge::handle`]. The bridge never changes the mode of a vehicle that a pilot flies:
//! GUIDED (of PX4 Hold) is asked for once after the take-off, and again only upon [`Bridge::hand_back`]; a vehicle in
//! danger that still flies in a mode of the bridge's asking is sent home (RTL, of PX4 Return).

pub mod arducopter;
pub mod ardupilot;
pub mod arduplane;
mod authority;
mod bridge;
mod command_queue;
mod error;
mod event;
#[cfg(feature = "link")]
pub mod link;
pub mod profile;
pub mod px4;
mod telemetry;
pub mod wire;

pub use bridge::attitude::AttitudeTarget;
pub use bridge::checklist::Expectation;
pub use bridge::gas::{GasClock, GasInput};
pub use bridge::{Bridge, BridgeConfig, BridgeOutput};
pub use error::BridgeError;
/// The MAVLink dialect spoken: ArduPilot's, generated from its XML.
pub use mavlink::dialects::ardupilotmega as dialect;
pub use wire::{goes_over_all_links, signing};
