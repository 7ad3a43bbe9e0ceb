//! Bytes of an envelope. The one place that knows bincode, so that it can be replaced.

use crate::ProtocolError;
use crate::envelope::{Envelope, OLDEST_JSON_VERSION, WIRE_VERSION};
use crate::key::{AgentId, Topic};
use crate::message::Message;
use crate::time::SimTime;
use serde::{Deserialize, Serialize};

/// Largest payload that is decoded, bytes: no peer can make an agent allocate more.
const SIZE_LIMIT: usize = 1 << 20;

fn layout() -> impl bincode::config::Config {
    bincode::config::standard().with_limit::<SIZE_LIMIT>()
}

pub(crate) fn encode(envelope: &Envelope) -> Vec<u8> {
    let mut bytes = Vec::with_capacity(192);
    bytes.push(WIRE_VERSION);
    // Encoding into memory fails only for types that bincode cannot hold, and a test writes one
    // message of each kind; an empty body would be refused by every reader.
    if bincode::serde::encode_into_std_write(envelope, &mut bytes, layout()).is_err() {
        bytes.truncate(1);
    }
    bytes
}

pub(crate) fn decode(topic: &Topic, bytes: &[u8]) -> Result<Envelope, ProtocolError> {
    let garbage = |why: String| ProtocolError::Garbage {
        key: topic.path(),
        why,
    };
    let (&version, body) = bytes
        .split_first()
        .ok_or_else(|| garbage("it is empty".to_owned()))?;
    if version != WIRE_VERSION {
        return Err(ProtocolError::WireVersion {
            theirs: version,
            ours: WIRE_VERSION,
        });
    }
    let (envelope, used) =
        bincode::serde::decode_from_slice(body, layout()).map_err(|e| garbage(e.to_string()))?;
    if used != body.len() {
        return Err(garbage(format!("{} trailing bytes", body.len() - used)));
    }
    Ok(envelope)
}

#[derive(Deserialize)]
struct JsonEnvelope {
    wire_version: u8,
    sender: AgentId,
    sequence: u64,
    time_ns: SimTime,
    message: Box<serde_json::value::RawValue>,
}

/// The same to write.
#[derive(Serialize)]
struct JsonOut<'a> {
    wire_version: u8,
    sender: &'a AgentId,
    sequence: u64,
    time_ns: SimTime,
    #[serde(serialize_with = "Message::serialize_content")]
    message: &'a Message,
}

pub(crate) fn encode_json(envelope: &Envelope, to: &mut Vec<u8>) {
    to.clear();
    let json = JsonOut {
        wire_version: WIRE_VERSION,
        sender: &envelope.sender,
        sequence: envelope.sequence,
        time_ns: envelope.time,
        message: &envelope.message,
    };
    // Writing into memory does not fail, and all kinds have names for keys: a test writes each. An empty text would be
    // rejected by every reader.
    if serde_json::to_writer(&mut *to, &json).is_err() {
        to.clear();
    }
}

pub(crate) fn decode_json(topic: &Topic, text: &str) -> Result<Envelope, ProtocolError> {
    let garbage = |why: serde_json::Error| ProtocolError::Garbage {
        key: topic.path(),
        why: why.to_string(),
    };
    if text.len() > SIZE_LIMIT {
        let why = format!("{} bytes; at most {SIZE_LIMIT} are read", text.len());
        return Err(ProtocolError::Garbage {
            key: topic.path(),
            why,
        });
    }
    let json: JsonEnvelope = serde_json::from_str(text).map_err(garbage)?;
    if !(OLDEST_JSON_VERSION..=WIRE_VERSION).contains(&json.wire_version) {
        return Err(ProtocolError::WireVersion {
            theirs: json.wire_version,
            ours: WIRE_VERSION,
        });
    }
    Ok(Envelope::new(
        json.sender,
        json.sequence,
        json.time_ns,
        Message::from_json(topic, json.message.get()).map_err(garbage)?,
    ))
}

pub(crate) fn json_schema(topic: &Topic) -> serde_json::Value {
    let mut message = Message::json_schema_on(topic).to_value();
    // Definitions move to the root, where the references of the message point.
    let definitions = message.as_object_mut().and_then(|m| {
        m.remove("$schema");
        m.remove("$defs")
    });
    serde_json::json!({
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": format!("plumage.{}", Message::name_on(topic)),
        "type": "object",
        "properties": {
            "wire_version": {"type": "integer"},
            "sender": {"type": "string"},
            "sequence": {"type": "integer"},
            "time_ns": {"type": "integer", "description": "simulated time since the mission's start"},
            "message": message,
        },
        "required": ["wire_version", "sender", "sequence", "time_ns", "message"],
        "$defs": definitions.unwrap_or_else(|| serde_json::json!({})),
    })
}
