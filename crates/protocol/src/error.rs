//! Why something on the bus is rejected.

/// Why something on the bus is rejected.
#[derive(Debug, Clone, thiserror::Error, PartialEq)]
pub enum ProtocolError {
    /// A peer speaks another version of the wire format.
    #[error(
        "the peer uses wire version {theirs}, this program uses {ours}; update the older program"
    )]
    WireVersion {
        /// Version byte received.
        theirs: u8,
        /// Version spoken here.
        ours: u8,
    },
    /// Bytes that are no envelope.
    #[error("{key}: not a valid envelope: {why}")]
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
    /// A sender published on a key of another agent.
    #[error("{sender} is not allowed to publish on {key}")]
    ForeignSender {
        /// Who claims to have sent it.
        sender: String,
        /// Key expression it came in on.
        key: String,
    },
    /// A host's bundle holds a message that its roles do not allow it to publish.
    #[error("host {host} is not allowed to publish on {key}")]
    ForeignHost {
        /// The host whose bundle it is.
        host: String,
        /// Key expression of the message.
        key: String,
    },
    /// A key that Plumage does not define.
    #[error("key '{0}': expected plumage/<mission>/<kind>/<id>/<topic>")]
    UnknownKey(String),
    /// Something without a seal of the mission's key, or with one that does not hold.
    #[error("message on {key} rejected: {fault}")]
    Seal {
        /// Key expression it came in on.
        key: String,
        /// What is wrong with it.
        fault: SealFault,
    },
    /// A number that cannot be.
    #[error("{key}: {field} is {value:?}; expected {low} to {high}")]
    Implausible {
        /// Key expression it came in on.
        key: String,
        /// The field.
        field: &'static str,
        /// What it holds.
        value: f64,
        /// The least that is taken.
        low: f64,
        /// The most that is taken.
        high: f64,
    },
    /// A text that is no key of a mission.
    #[error("not a mission key: expected 64 hexadecimal digits")]
    BadKey,
    /// A name that cannot be part of a key.
    #[error("name '{0}': expected 1 to 32 of letters, digits, '-' and '_'")]
    BadName(String),
}

/// Why a seal was not taken.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum SealFault {
    /// There is none.
    Missing,
    /// It was not made with the mission's key, or for something else.
    Wrong,
    /// It is of another run of the mission.
    OtherRun,
    /// It was heard before, or what its sender said later was.
    Replayed,
    /// It is an operator's, and was said long ago.
    Late,
}

impl std::fmt::Display for SealFault {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::Missing => "it has no seal",
            Self::Wrong => "its seal does not match the mission key",
            Self::OtherRun => "its seal belongs to another run of the mission",
            Self::Replayed => "it repeats an earlier message",
            Self::Late => "it is an operator's command older than 10 s",
        })
    }
}
