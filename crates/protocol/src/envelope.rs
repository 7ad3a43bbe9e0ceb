//! The envelope around every message.

use crate::key::{AgentId, Topic};
use crate::message::Message;
use crate::time::SimTime;
use crate::{ProtocolError, codec};
use serde::{Deserialize, Serialize};

/// Version of the wire format: the first byte of every binary payload and a field of the JSON.
/// It rises whenever a message changes its meaning or layout.
pub const WIRE_VERSION: u8 = 2;
/// The oldest version whose JSON is still read, so that recordings stay readable: what a message lacked then is
/// filled with what it meant.
pub const OLDEST_JSON_VERSION: u8 = 1;

/// One message with who sent it, in which order, and when in simulated time.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Envelope {
    /// Who sent it.
    pub sender: AgentId,
    /// Number of this message among all that its sender has sent, from 1.
    pub sequence: u64,
    /// Simulated time at which it was sent.
    pub time: SimTime,
    /// What is said.
    pub message: Message,
}

impl Envelope {
    /// The `sequence`-th message of `sender`, sent at `time`.
    pub fn new(sender: AgentId, sequence: u64, time: SimTime, message: Message) -> Self {
        Self {
            sender,
            sequence,
            time,
            message,
        }
    }

    /// Order in which messages are handled: by time, sender, sequence.
    pub fn order(&self) -> (SimTime, &AgentId, u64) {
        (self.time, &self.sender, self.sequence)
    }

    /// The canonical bytes: version byte, then bincode. What goes over the wire and into the digest.
    pub fn to_bytes(&self) -> Vec<u8> {
        codec::encode(self)
    }

    /// Reads canonical bytes that came in on `topic`.
    ///
    /// # Errors
    /// Another wire version, garbage, a message that does not belong on the topic or a sender
    /// that may not write there.
    pub fn from_bytes(topic: &Topic, bytes: &[u8]) -> Result<Self, ProtocolError> {
        let envelope = codec::decode(topic, bytes)?;
        envelope.message.check(topic, &envelope.sender)?;
        Ok(envelope)
    }

    /// The JSON form: `{"wire_version", "sender", "sequence", "time_ns", "message": {…}}`.
    pub fn to_json(&self) -> String {
        let mut text = Vec::new();
        codec::encode_json(self, &mut text);
        String::from_utf8(text).unwrap_or_default()
    }

    /// Writes the JSON form into `buffer`, in place of what it holds: for who writes many.
    pub fn write_json(&self, buffer: &mut Vec<u8>) {
        codec::encode_json(self, buffer);
    }

    /// Reads the JSON form of a message that came in on `topic`.
    ///
    /// # Errors
    /// As [`Envelope::from_bytes`].
    pub fn from_json(topic: &Topic, text: &str) -> Result<Self, ProtocolError> {
        let envelope = codec::decode_json(topic, text)?;
        envelope.message.check(topic, &envelope.sender)?;
        Ok(envelope)
    }

    /// JSON Schema of the JSON form of the messages on `topic`.
    pub fn json_schema(topic: &Topic) -> serde_json::Value {
        codec::json_schema(topic)
    }
}
