//! What a node in Python hears and says on the bus: keys, payloads and seals. Its socket is Python's.

use crate::convert;
use crate::error::{self, RunError};
use protocol::digest::hex;
use protocol::joining::{Answer, Question, RollEntry, time_key};
use protocol::key::Name;
use protocol::seal::{MissionKey, Sealer};
use protocol::{AgentId, Envelope, SimTime, Topic, WIRE_VERSION};
use pyo3::prelude::*;
use pyo3::types::PyBytes;
use std::path::PathBuf;
use tasks::mission_key;

fn name(mission: &str) -> PyResult<Name> {
    Name::new(mission).map_err(|e| error::input(&e))
}

/// The key of a topic such as `va/1/destination` in a mission.
#[pyfunction]
pub(crate) fn key(mission: &str, topic: &str) -> PyResult<String> {
    let topic = Topic::parse_path(topic).map_err(|e| error::input(&e))?;
    Ok(topic.key(&name(mission)?))
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

/// The path on which an agent answers the call of the roll.
fn call_path(agent: &str) -> String {
    format!("{agent}/call")
}

/// Bytes of a payload and of its code or seal.
type Sealed<'py> = (Bound<'py, PyBytes>, Bound<'py, PyBytes>);

/// Says what the operator says, sealed by the mission's key.
#[pyclass(module = "plumage._plumage")]
pub(crate) struct Speaker {
    mission: Name,
    key: MissionKey,
    sealer: Sealer,
    /// The last question to who keeps the time.
    question: String,
    run: Option<u64>,
    sequence: u64,
}

#[pymethods]
impl Speaker {
    /// With the key of `key_file`, or as the commands find it.
    #[new]
    fn new(mission: &str, endpoints: Vec<String>, key_file: Option<PathBuf>) -> PyResult<Self> {
        let mission = name(mission)?;
        let key =
            mission_key::find(&mission, key_file.as_deref(), &endpoints).map_err(error::of_task)?;
        let stream = mission_key::random().map_err(error::of_task)?;
        Ok(Self {
            sealer: Sealer::new(key.clone(), u64::from_be_bytes(stream)),
            mission,
            key,
            question: String::new(),
            run: None,
            sequence: 0,
        })
    }

    /// On which key who keeps the mission's time is asked.
    #[getter]
    fn time_key(&self) -> String {
        time_key(&self.mission)
    }

    /// The next question to who keeps the time: payload and code.
    fn question<'py>(&mut self, py: Python<'py>) -> PyResult<Sealed<'py>> {
        let number: [u8; 16] = mission_key::random().map_err(error::of_task)?;
        self.question = hex(&number);
        let question = Question {
            question: self.question.clone(),
            wire_version: Some(WIRE_VERSION),
            stream: self.sealer.so_far().0,
            announced: false,
            hears: Vec::new(),
            introduction: None,
        };
        let (payload, code) = question.coded(&self.key);
        Ok((PyBytes::new(py, &payload), PyBytes::new(py, &code)))
    }

    /// Takes an answer: the mission's time, ns; None for what is no answer to the last question by who holds the key.
    fn answered(&mut self, payload: &[u8], code: &[u8]) -> PyResult<Option<i64>> {
        let Some(answer) = Answer::read(&self.key, &self.question, payload, code) else {
            return Ok(None);
        };
        if let Some(refused) = answer.refused {
            return Err(RunError::new_err(refused.why));
        }
        self.run = Some(answer.run);
        Ok(Some(answer.now_ns))
    }

    /// The key on which an agent is called, and a new question for it.
    fn call<'py>(&self, py: Python<'py>, agent: &str) -> PyResult<(String, Bound<'py, PyBytes>)> {
        let question: [u8; 16] = mission_key::random().map_err(error::of_task)?;
        let key = format!("plumage/{}/{}", self.mission, call_path(agent));
        Ok((key, PyBytes::new(py, &question)))
    }

    /// Whether an answer to such a question shows that the agent flies in the run of this node.
    fn is_there(&self, agent: &str, question: &[u8], payload: &[u8], code: &[u8]) -> bool {
        // The code covers the path as well: an answer of one is not to be passed off as another's.
        let question = [question, call_path(agent).as_bytes()].concat();
        let is_answer = self.key.is_answer(&question, payload, code);
        let entry = is_answer.then(|| serde_json::from_slice::<RollEntry>(payload).ok());
        entry.flatten().is_some_and(|entry| {
            let run = entry.run.map(|run| run.number);
            entry.agent == agent && !entry.ended && run.is_some() && run == self.run
        })
    }

    /// Key, payload and seal of a message, given as JSON, that the operator says on a topic.
    fn say<'py>(
        &mut self,
        py: Python<'py>,
        topic: &str,
        message: &str,
        time_ns: i64,
    ) -> PyResult<(String, Sealed<'py>)> {
        let Some(run) = self.run else {
            return Err(RunError::new_err("the number of the run is not known yet"));
        };
        let topic = Topic::parse_path(topic).map_err(|e| error::input(&e))?;
        let operator = AgentId::operator();
        let (sequence, now) = (self.sequence + 1, SimTime::from_ns(time_ns).ns());
        let text = format!(
            "{{\"wire_version\":{WIRE_VERSION},\"sender\":\"{operator}\",\"sequence\":{sequence},\"time_ns\":{now},\
             \"message\":{message}}}"
        );
        let envelope = Envelope::from_json(&topic, &text).map_err(|e| error::input(&e))?;
        self.sequence = sequence;
        let (key, payload) = (topic.key(&self.mission), envelope.to_bytes());
        let seal = self.sealer.seal(run, &key, &payload);
        Ok((key, (PyBytes::new(py, &payload), PyBytes::new(py, &seal))))
    }
}
