//! Events for the team, in short.

use protocol::message::{EventMessage, Severity};
use protocol::text::printable;

/// An event of that `code` with a `text` for people, whatever the vehicle has put into it.
pub(crate) fn event(severity: Severity, code: &str, text: impl AsRef<str>) -> EventMessage {
    EventMessage::new(severity, code, printable(text.as_ref()))
}
