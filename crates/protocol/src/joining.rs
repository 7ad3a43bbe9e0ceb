//! Joining a run: what who wants in asks the keeper of the mission's time, and what he answers, both with the code of the
//! mission's key.

use crate::key::Name;
use crate::seal::MissionKey;
use serde::{Deserialize, Serialize};

/// Version of how the processes of a mission publish: from 3 on in [bundles](crate::bundle). Processes of another version
/// do not receive each other, so they are not admitted. The version of single envelopes is [`crate::WIRE_VERSION`].
pub const BUS_VERSION: u8 = 3;

/// What has to be the same in all processes of a mission.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct MissionIdentity {
    /// SHA-256 of the scenario, without seed and duration, hexadecimal.
    pub scenario_sha256: String,
    /// Seed of every random number.
    pub seed: u64,
    /// Tick, ns.
    pub tick_ns: i64,
    /// Origin of the site: latitude and longitude, degrees.
    pub site_deg: [f64; 2],
}

impl MissionIdentity {
    /// What `other` has otherwise, in words; nothing where it is the same.
    pub fn difference(&self, other: &Self) -> Option<String> {
        let mut words = Vec::new();
        if self.seed != other.seed {
            words.push(format!("seed {} instead of {}", other.seed, self.seed));
        }
        if self.tick_ns != other.tick_ns {
            let ms = |ns: i64| ns as f64 * 1e-6;
            words.push(format!(
                "a tick of {} ms instead of {} ms",
                ms(other.tick_ns),
                ms(self.tick_ns)
            ));
        }
        if self.site_deg != other.site_deg {
            let at = |[lat, lon]: [f64; 2]| format!("{lat}, {lon}");
            words.push(format!(
                "site {} instead of {}",
                at(other.site_deg),
                at(self.site_deg)
            ));
        }
        if words.is_empty() && self.scenario_sha256 != other.scenario_sha256 {
            words.push("another scenario".to_owned());
        }
        (!words.is_empty()).then(|| words.join(", "))
    }
}

/// Who a process is.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Introduction {
    /// The agents that it hosts, as `kind/name`; none of who only looks or speaks for the operator.
    pub agents: Vec<String>,
    /// What it flies.
    pub mission: MissionIdentity,
}

/// Asks to be let in.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Question {
    /// A random number, hexadecimal, unique to this request.
    pub question: String,
    /// The [`BUS_VERSION`] of who asks.
    #[serde(default)]
    pub wire_version: Option<u8>,
    /// The number of the process among those that speak.
    #[serde(default)]
    pub stream: u64,
    /// It shows itself on the bus already, as after its keeper was started again.
    #[serde(default)]
    pub announced: bool,
    /// The numbers of the runs in which it has found agents of the team.
    #[serde(default)]
    pub hears: Vec<u64>,
    /// The agents of the process that asks; empty if it hosts none.
    #[serde(default)]
    pub introduction: Option<Introduction>,
}

impl Question {
    /// The question as it is sent, and its code.
    pub fn coded(&self, key: &MissionKey) -> (Vec<u8>, Vec<u8>) {
        coded(key, &[], self)
    }

    /// The question of `payload` and `code`; none if it was asked without the mission's key.
    pub fn read(key: &MissionKey, payload: &[u8], code: &[u8]) -> Option<Self> {
        key.is_answer(&[], payload, code)
            .then(|| serde_json::from_slice(payload).ok())?
    }
}

/// What the keeper of the mission's time answers.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Answer {
    /// The mission's time, ns.
    pub now_ns: i64,
    /// The number of the run.
    pub run: u64,
    /// The keeper's number among those that speak.
    pub stream: u64,
    /// How often it has spoken.
    pub number: u64,
    /// Why who asks is not let in.
    #[serde(default)]
    pub refused: Option<Refused>,
}

impl Answer {
    /// The answer to `question` as it is sent, and its code.
    pub fn coded(&self, key: &MissionKey, question: &str) -> (Vec<u8>, Vec<u8>) {
        coded(key, question.as_bytes(), self)
    }

    /// The answer of `payload` and `code`; none if it was not given to `question`, or without the mission's key.
    pub fn read(key: &MissionKey, question: &str, payload: &[u8], code: &[u8]) -> Option<Self> {
        key.is_answer(question.as_bytes(), payload, code)
            .then(|| serde_json::from_slice(payload).ok())?
    }
}

/// Reason for a rejection.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Refused {
    /// In words.
    pub why: String,
    /// It may be otherwise in a moment.
    pub passes: bool,
}

/// What an agent answers when the roll is called.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct RollEntry {
    /// Who it is, as `kind/name`: an answer of one is not to be taken for another's.
    pub agent: String,
    /// The number of its process among those that speak.
    pub stream: u64,
    /// How often that process has spoken.
    pub number: u64,
    /// The run that it is in; none before it has joined one.
    pub run: Option<RunAge>,
    /// Its process ends in good order.
    pub ended: bool,
}

/// A run, and for how long it has been flying when that is said.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct RunAge {
    /// Its number.
    pub number: u64,
    /// Its age, ns.
    pub age_ns: i64,
}

/// The key expression on which the keeper of the time of `mission` is asked.
pub fn time_key(mission: &Name) -> String {
    format!("plumage/{mission}/clock/main/now")
}

fn coded(key: &MissionKey, question: &[u8], said: &impl Serialize) -> (Vec<u8>, Vec<u8>) {
    // Numbers, words and lists always have a JSON.
    let payload = serde_json::to_vec(said).unwrap_or_default();
    let code = key.answer_code(question, &payload);
    (payload, code)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The code by Python's `hmac`: `hmac.new(bytes([7]) * 32, b"plumage answer\0" + struct.pack(">Q", 1) + b"q" + payload,
    /// "sha256").hexdigest()`.
    #[test]
    fn an_answer_is_read_by_who_asked_with_the_key_alone() {
        let key = |byte| MissionKey::new([byte; 32]);
        let answer = Answer {
            now_ns: 5,
            run: 7,
            stream: 2,
            number: 3,
            refused: None,
        };
        let (payload, code) = answer.coded(&key(7), "q");
        assert_eq!(
            payload,
            br#"{"now_ns":5,"run":7,"stream":2,"number":3,"refused":null}"#
        );
        assert_eq!(
            crate::digest::hex(&code),
            "1238ec9d974b23d1bdb33a9fbdf4a7a410ad93d3d595097b7e820d893032428b"
        );
        let read = |byte, question| Answer::read(&key(byte), question, &payload, &code);
        assert_eq!(read(7, "q"), Some(answer));
        assert_eq!(read(7, "p"), None);
        assert_eq!(read(6, "q"), None);
    }

    /// As a script asks that knows the seal's layout alone.
    #[test]
    fn a_short_question_is_one() {
        let key = MissionKey::new([1; 32]);
        let payload = br#"{"question":"00ff","stream":4}"#;
        let question = Question::read(&key, payload, &key.answer_code(&[], payload));
        let expected = Question {
            question: "00ff".to_owned(),
            wire_version: None,
            stream: 4,
            announced: false,
            hears: Vec::new(),
            introduction: None,
        };
        assert_eq!(question, Some(expected));
        assert_eq!(Question::read(&key, payload, &[0; 32]), None);
    }
}
