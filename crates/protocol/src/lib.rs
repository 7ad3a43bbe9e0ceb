//! What Plumage's agents say to each other, and how: messages, key expressions, codec,
//! simulated time, the agent's own shape, and an in-memory bus.
//!
//! Pure: no clock, socket, file, environment or global random number.
//!
//! One [`Envelope`] (wire version, sender, sequence, simulated time) surrounds one [`Message`]
//! on one [`Topic`]. An [`Agent`] is a state machine: it is handed [`Event`]s with the time now
//! and answers with messages, so that the same code runs in one process in virtual time and as
//! separate processes over a network.

pub mod agent;
pub mod bus;
mod codec;
pub mod control_level;
pub mod digest;
pub mod envelope;
pub mod key;
pub mod message;
pub mod time;

pub use agent::{Agent, Event, Outbox};
pub use envelope::{Envelope, WIRE_VERSION};
pub use key::{AgentId, AgentKind, Interest, Topic};
pub use message::Message;
pub use time::SimTime;

/// Why something on the bus was refused.
#[derive(Debug, Clone, thiserror::Error, PartialEq)]
pub enum ProtocolError {
    /// A peer speaks another version of the wire format.
    #[error(
        "wire version {theirs} from the peer, but this program speaks {ours}: update the older one"
    )]
    WireVersion {
        /// Version byte received.
        theirs: u8,
        /// Version spoken here.
        ours: u8,
    },
    /// Bytes that are no envelope.
    #[error("not an envelope on {key}: {why}")]
    Garbage {
        /// Key expression it came in on.
        key: String,
        /// What the decoder met.
        why: String,
    },
    /// The message is of another kind than its key promises.
    #[error("{key} carries a {found} message; expected {expected}")]
    WrongMessage {
        /// Key expression it came in on.
        key: String,
        /// The kind found.
        found: &'static str,
        /// The kind that belongs on that key.
        expected: &'static str,
    },
    /// A sender wrote on a key that belongs to somebody else.
    #[error("{sender} may not write on {key}")]
    ForeignSender {
        /// Who claims to have sent it.
        sender: String,
        /// Key expression it came in on.
        key: String,
    },
    /// A key that is none of Plumage's.
    #[error("key '{0}' is not one of plumage/<mission>/<kind>/<id>/<topic>")]
    UnknownKey(String),
    /// A name that cannot be part of a key.
    #[error("name '{0}': expected 1 to 32 of letters, digits, '-' and '_'")]
    BadName(String),
}
