//! Who flies, as it is said on the bus.

use fdm::control_level::{ControlLevel, Level, Outcome};
use protocol::message::{ControlLevel as Said, EventMessage, Mode, Severity};

/// The level as it is said on the bus.
pub fn said(level: Level) -> Said {
    match level {
        Level::Automatic => Said::Automatic,
        Level::Pilot => Said::Pilot,
        Level::Guardian => Said::Guardian,
    }
}

/// Who flies and why, with the dangers that last and the setpoints that were ignored; `doing` is
/// what the body itself has to say of it.
pub fn mode(control: &ControlLevel, doing: &str) -> Mode {
    let mut reason = doing.to_owned();
    let mut add = |words: &str| {
        if !reason.is_empty() {
            reason.push_str("; ");
        }
        reason.push_str(words);
    };
    for danger in control.dangers() {
        add(danger.words());
    }
    let level = control.level();
    if level == Level::Guardian && control.dangers().next().is_none() {
        add("no danger any more, waits for a hand-back");
    }
    match control.ignored_setpoints() {
        0 => {}
        1 => add("1 setpoint ignored"),
        n => add(&format!("{n} setpoints ignored")),
    }
    Mode {
        level: said(level),
        reason,
        setpoints_obeyed: level == Level::Automatic,
    }
}

/// The event that tells what became of a setpoint or a hand-back, if somebody should know.
pub(crate) fn told(outcome: Outcome) -> Option<EventMessage> {
    let (code, text) = match outcome {
        Outcome::Taken | Outcome::Followed => return None,
        Outcome::Ignored(Level::Pilot) => (
            "setpoint-ignored",
            "setpoint ignored: a pilot flies".to_owned(),
        ),
        Outcome::Ignored(_) => (
            "setpoint-ignored",
            "setpoint ignored: the Guardian flies".to_owned(),
        ),
        Outcome::Refused(danger) => (
            "hand-back-refused",
            format!("hand-back refused: {}", danger.words()),
        ),
    };
    Some(EventMessage {
        severity: Severity::Warning,
        code: code.to_owned(),
        text,
    })
}
