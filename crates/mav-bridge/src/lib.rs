//! MAVLink 2 frames of an ArduPlane to and from what Plumage's agents say: state, reading,
//! who flies, events; setpoints as commands.
//!
//! [`Bridge`] is pure: bytes and the time come in as arguments, frames and messages go out in a
//! [`BridgeOutput`]. It knows no socket, clock, file, environment or global random number. Behind
//! the feature `link` (off by default), the module `link` carries bytes over UDP and TCP.
//!
//! Units at the border: MAVLink's scaled integers become SI and degrees. Altitude is that of
//! GLOBAL_POSITION_INT, above mean sea level. The airspeed of VFR_HUD is ArduPlane's equivalent
//! airspeed (that of its pitot tube, or the estimate without one); true airspeed is that divided
//! by √(ρ/ρ₀), with the density ρ from the vehicle's static pressure (SCALED_PRESSURE; the
//! site's atmosphere if it sends none) and the temperature of the site's atmosphere at its
//! altitude, ρ₀ = 1.225 kg/m³. Setpoints go the same way back. The temperature of a reading is
//! that of a HYGROMETER_SENSOR; the barometer's own sits in a warm case and is not used.
//!
//! Who flies is decided by [`fdm::control_level`], from what the vehicle shows and what
//! [`Bridge::handle`] is told. The bridge never changes the mode of a vehicle that a pilot flies:
//! GUIDED is asked for once after TAKEOFF, and again only upon [`Bridge::hand_back`]; a vehicle in
//! danger that still flies in a mode of the bridge's asking is sent home (RTL).

pub mod arduplane;
mod authority;
mod bridge;
mod commands;
#[cfg(feature = "link")]
pub mod link;
pub mod signing;
mod telemetry;
pub mod wire;

pub use bridge::{Bridge, BridgeConfig, BridgeOutput};
/// The MAVLink dialect spoken: ArduPilot's, generated from its XML.
pub use mavlink::dialects::ardupilotmega as dialect;

use protocol::message::{EventMessage, Severity};

/// What this crate refuses.
#[derive(Debug, thiserror::Error)]
pub enum BridgeError {
    /// A link as nobody writes it.
    #[error(
        "link '{0}': expected udpin:HOST:PORT (listen), udpout:HOST:PORT or tcp:HOST:PORT (connect), tcpin:HOST:PORT (wait for a client)"
    )]
    BadLink(String),
    /// A number in the configuration that cannot work.
    #[error("{what} is {value}; expected {expected}")]
    OutOfRange {
        /// The quantity, with its unit.
        what: &'static str,
        /// The value that came in.
        value: f64,
        /// What would be right.
        expected: &'static str,
    },
    /// A socket refused.
    #[error("link {link}: {source}")]
    Socket {
        /// The link as asked for.
        link: String,
        /// What the system said.
        source: std::io::Error,
    },
}

pub(crate) fn event(severity: Severity, code: &str, text: impl Into<String>) -> EventMessage {
    EventMessage {
        severity,
        code: code.to_owned(),
        text: text.into(),
    }
}
