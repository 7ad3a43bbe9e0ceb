//! Messages and events about the control level.

use protocol::control_level::{ControlOutcome, ControlState};
use protocol::message::{ControlLevel, EventMessage, Mode, Severity};

/// Code of the event that a vehicle resumes after a silence.
pub const RESUMED: &str = "resumed after a silence";

/// The control level with its reason, the lasting dangers and the ignored setpoints; `doing` is the vehicle's own
/// action.
pub fn mode(control: &ControlState, doing: &str) -> Mode {
    let mut reason = doing.to_owned();
    let mut add = |text: &str| {
        if !reason.is_empty() {
            reason.push_str("; ");
        }
        reason.push_str(text);
    };
    for danger in control.dangers() {
        add(danger.description());
    }
    let level = control.level();
    if level == ControlLevel::Guardian && control.dangers().next().is_none() {
        add("the danger is over; waits for a hand-back");
    }
    if control.has_resumed() {
        add(RESUMED);
    }
    match control.ignored_setpoints() {
        0 => {}
        1 => add("1 setpoint ignored"),
        n => add(&format!("{n} setpoints ignored")),
    }
    Mode {
        level,
        reason,
        setpoints_obeyed: level == ControlLevel::Automatic,
    }
}

/// The answer to a hand-back at the level `before`: who controls the vehicle now.
pub(crate) fn hand_back_event(before: ControlLevel, now: ControlLevel) -> EventMessage {
    let (severity, code, text) = match (before, now) {
        (ControlLevel::Automatic, ControlLevel::Automatic) => (
            Severity::Info,
            "hand-back",
            "hand-back ignored: the vehicle is in automatic flight already",
        ),
        (_, ControlLevel::Automatic) => (
            Severity::Info,
            "hand-back",
            "handed back to automatic flight",
        ),
        _ => (
            Severity::Warning,
            "hand-back-refused",
            "handed back to the Guardian, not to automatic flight, since a danger persists",
        ),
    };
    EventMessage::new(severity, code, text)
}

/// The event that a vehicle resumes after a silence.
pub(crate) fn resumed_event() -> EventMessage {
    EventMessage {
        severity: Severity::Info,
        code: "resumed".to_owned(),
        text: "the silent agents publish again: automatic flight resumes".to_owned(),
    }
}

/// The event for the outcome of a setpoint or a hand-back; none for an ordinary one.
pub(crate) fn outcome_event(outcome: ControlOutcome) -> Option<EventMessage> {
    let (code, text) = match outcome {
        ControlOutcome::Taken | ControlOutcome::Followed => return None,
        ControlOutcome::Ignored(ControlLevel::Pilot) => (
            "setpoint-ignored",
            "setpoint ignored: a pilot flies".to_owned(),
        ),
        ControlOutcome::Ignored(_) => (
            "setpoint-ignored",
            "setpoint ignored: the Guardian flies".to_owned(),
        ),
        ControlOutcome::Refused(danger) => (
            "hand-back-refused",
            format!("hand-back rejected: {}", danger.description()),
        ),
    };
    Some(EventMessage::new(Severity::Warning, code, text))
}
