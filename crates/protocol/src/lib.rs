//! What Plumage's agents say to each other, and how: messages, key expressions, codec,
//! simulated time, the agent's own shape, and an in-memory bus.
//!
//! Pure: no clock, socket, file, environment or global random number.
//!
//! One [`Envelope`] (wire version, sender, sequence, simulated time) surrounds one [`Message`]
//! on one [`Topic`]. An [`Agent`] is a state machine: it is handed [`Event`]s with the time now
//! and answers with messages, so that the same code runs in one process in virtual time and as
//! separate processes over a network.
//!
//! # Example
//!
//! An agent that says once a second that it is there, run for three seconds in virtual time:
//!
//! ```
//! use protocol::bus::Conductor;
//! use protocol::message::{Message, Severity};
//! use protocol::{Agent, AgentId, Envelope, Event, Interest, Outbox, SimTime, Topic};
//!
//! struct Beacon(AgentId);
//!
//! impl Agent for Beacon {
//!     fn id(&self) -> &AgentId {
//!         &self.0
//!     }
//!     fn interests(&self) -> Vec<Interest> {
//!         Vec::new()
//!     }
//!     fn handle(&mut self, event: Event<'_>, now: SimTime, out: &mut Outbox) {
//!         if matches!(event, Event::Tick) && now.ns() % 1_000_000_000 == 0 {
//!             out.event(&self.0, Severity::Info, "here", format!("at {} s", now.s()));
//!         }
//!     }
//! }
//!
//! # fn main() -> Result<(), protocol::ProtocolError> {
//! let beacon = Beacon(AgentId::va("1")?);
//! let mut conductor = Conductor::new(vec![beacon], 20_000_000);
//! let mut said: Vec<(Topic, Envelope)> = Vec::new();
//! while conductor.now() < SimTime::from_s(3.0) {
//!     said.extend_from_slice(conductor.step());
//! }
//! assert_eq!(said.len(), 3);
//!
//! // On the wire an envelope is bytes or JSON, and the topic says what may be in it.
//! let (topic, envelope) = &said[2];
//! assert_eq!(topic.path(), "va/1/event");
//! assert_eq!(&Envelope::from_bytes(topic, &envelope.to_bytes())?, envelope);
//! assert_eq!(&Envelope::from_json(topic, &envelope.to_json())?, envelope);
//! assert!(Envelope::from_bytes(&Topic::Plan, &envelope.to_bytes()).is_err());
//! let Message::Event(event) = &envelope.message else { panic!("a beacon says events") };
//! assert_eq!(event.text, "at 2 s");
//! # Ok(())
//! # }
//! ```

pub mod agent;
pub mod bundle;
pub mod bus;
mod codec;
pub mod control_level;
pub mod digest;
pub mod envelope;
mod error;
pub mod jobs;
pub mod joining;
pub mod key;
pub mod message;
mod plausible;
pub mod seal;
pub mod text;
pub mod time;

pub use agent::{Agent, Event, Outbox};
pub use envelope::{Envelope, OLDEST_JSON_VERSION, WIRE_VERSION};
pub use error::ProtocolError;
pub use key::{AgentId, AgentKind, Interest, Topic};
pub use message::Message;
pub use time::{Pauses, SimTime};
