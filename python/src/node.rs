//! Keys and payloads of the bus, for a node in Python.

use crate::convert;
use crate::error;
use protocol::key::Name;
use protocol::{AgentId, Envelope, Topic, WIRE_VERSION};
use pyo3::prelude::*;

fn name(mission: &str) -> PyResult<Name> {
    Name::new(mission).map_err(|e| error::input(&e))
}

/// The key of a topic such as `va/1/destination` in a mission.
#[pyfunction]
pub(crate) fn key(mission: &str, topic: &str) -> PyResult<String> {
    let topic = Topic::parse_path(topic).map_err(|e| error::input(&e))?;
    Ok(topic.key(&name(mission)?))
}

/// The payload of a message, given as JSON, that the operator says on a topic.
#[pyfunction]
pub(crate) fn encode(
    topic: &str,
    message: &str,
    sequence: u64,
    time_ns: i64,
    as_json: bool,
) -> PyResult<Vec<u8>> {
    let topic = Topic::parse_path(topic).map_err(|e| error::input(&e))?;
    let operator = AgentId::operator();
    let text = format!(
        "{{\"wire_version\":{WIRE_VERSION},\"sender\":\"{operator}\",\"sequence\":{sequence},\"time_ns\":{time_ns},\
         \"message\":{message}}}"
    );
    let envelope = Envelope::from_json(&topic, &text).map_err(|e| error::input(&e))?;
    let checked = envelope.message.check(&topic, &operator);
    checked.map_err(|e| error::input(&e))?;
    Ok(match as_json {
        true => envelope.to_json().into_bytes(),
        false => envelope.to_bytes(),
    })
}

/// The topic of a key and the envelope of a payload on it.
#[pyfunction]
pub(crate) fn decode<'py>(
    py: Python<'py>,
    mission: &str,
    key: &str,
    payload: &[u8],
    as_json: bool,
) -> PyResult<(String, Bound<'py, PyAny>)> {
    let topic = Topic::parse_key(key, &name(mission)?).map_err(|e| error::input(&e))?;
    let envelope = match as_json {
        true => Envelope::from_json(&topic, &String::from_utf8_lossy(payload)),
        false => Envelope::from_bytes(&topic, payload),
    };
    let envelope = envelope.map_err(|e| error::input(&e))?;
    Ok((topic.path(), convert::json(py, &envelope.to_json())?))
}
