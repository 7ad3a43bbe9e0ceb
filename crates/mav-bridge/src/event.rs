//! Events for the team, in short.

use protocol::message::{EventMessage, Severity};

/// An event of that `code` with a `text` for people.
pub(crate) fn event(severity: Severity, code: &str, text: impl Into<String>) -> EventMessage {
    EventMessage {
        severity,
        code: code.to_owned(),
        text: text.into(),
    }
}
