//! Who flies the vehicle, told from its heartbeats alone.
//!
//! The bridge knows which mode it has asked for. A vehicle in any other mode has been taken
//! over: by its own failsafe if it says so (or if its link has just come back and it is on its
//! way home), else by a pilot. A pilot keeps it until an explicit hand-back.

use crate::arduplane::{self, AUTO, CIRCLE, GUIDED, RTL, mode_name};
use protocol::message::{ControlLevel, EventMessage, Severity};

/// Mode AUTOLAND of newer ArduPlane.
const AUTOLAND: u32 = 26;

/// What the bridge is about, or who has taken the vehicle from it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Phase {
    /// On the ground, nobody flies.
    Ground,
    /// The bridge has commanded take-off.
    TakeOff,
    /// GUIDED: setpoints go through.
    Guided,
    /// The bridge has commanded the landing sequence or the return home.
    Landing,
    /// A pilot flies.
    Pilot,
    /// A pilot flies and GUIDED has been asked for upon a hand-back.
    HandingBack,
    /// The vehicle's own failsafe flies.
    Guardian,
    /// Not an ArduPlane: watched, never commanded.
    Foreign,
}

/// What a heartbeat says about who flies.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Seen {
    pub custom_mode: u32,
    pub armed: bool,
    pub airborne: bool,
    pub failsafe: bool,
}

/// Keeps the phase.
#[derive(Debug, Clone)]
pub(crate) struct Authority {
    phase: Phase,
    /// The mode from which the last one was asked for.
    from: u32,
    /// The mode asked for last.
    to: u32,
    confirmed: bool,
    link_up: bool,
    /// The link was down between the last heartbeat and this one.
    returned: bool,
    seen: Option<Seen>,
}

impl Authority {
    pub(crate) fn new() -> Self {
        Self {
            phase: Phase::Ground,
            from: arduplane::INITIALISING,
            to: arduplane::INITIALISING,
            confirmed: false,
            link_up: false,
            returned: false,
            seen: None,
        }
    }

    pub(crate) fn phase(&self) -> Phase {
        self.phase
    }

    pub(crate) fn seen(&self) -> Option<Seen> {
        self.seen
    }

    pub(crate) fn link_up(&self) -> bool {
        self.link_up
    }

    /// The mode asked for last, if the vehicle has not shown it yet.
    pub(crate) fn unconfirmed(&self) -> Option<u32> {
        (!self.confirmed).then_some(self.to)
    }

    /// The level that the rest of the team is told.
    pub(crate) fn level(&self) -> ControlLevel {
        match self.phase {
            Phase::Ground => ControlLevel::Automatic,
            Phase::TakeOff | Phase::Guided | Phase::Landing if self.link_up => {
                ControlLevel::Automatic
            }
            Phase::Pilot | Phase::HandingBack | Phase::Foreign => ControlLevel::Pilot,
            _ => ControlLevel::Guardian,
        }
    }

    /// Why, in words.
    pub(crate) fn reason(&self) -> String {
        let mode = self
            .seen
            .map_or_else(|| "mode unknown".into(), |s| mode_name(s.custom_mode));
        if !self.link_up {
            return "no heartbeat from the vehicle: it relies on its own failsafe".into();
        }
        match self.phase {
            Phase::Ground => "on the ground, waits for take-off".into(),
            Phase::TakeOff => "taking off".into(),
            Phase::Guided => "flies to setpoints".into(),
            Phase::Landing => "coming home to land".into(),
            Phase::Pilot => format!("the pilot has it in {mode} until an explicit hand-back"),
            Phase::HandingBack => format!("handed back, GUIDED asked for, still {mode}"),
            Phase::Guardian => format!("its own failsafe has it in {mode}"),
            Phase::Foreign => "not an ArduPlane: watched, not commanded".into(),
        }
    }

    /// The bridge asks for mode `to` as part of `phase`.
    pub(crate) fn ask(&mut self, phase: Phase, to: u32) {
        self.phase = phase;
        self.from = self.seen.map_or(self.from, |s| s.custom_mode);
        self.confirmed = self.from == to;
        self.to = to;
    }

    /// The mode asked for was refused; `phase` is what remains.
    pub(crate) fn refused(&mut self, phase: Phase) {
        self.phase = phase;
        self.to = self.from;
        self.confirmed = true;
    }

    pub(crate) fn foreign(&mut self) {
        self.phase = Phase::Foreign;
    }

    /// Nothing has been heard for too long.
    pub(crate) fn link_lost(&mut self) {
        self.link_up = false;
        if self.phase == Phase::HandingBack {
            self.phase = Phase::Pilot;
        }
    }

    /// Takes in a heartbeat; says what changed.
    pub(crate) fn observe(&mut self, seen: Seen) -> Option<EventMessage> {
        let before = self.phase;
        self.returned = !self.link_up && self.seen.is_some();
        self.link_up = true;
        self.seen = Some(seen);
        if seen.custom_mode == self.to {
            self.confirmed = true;
        }
        self.phase = self.next(seen);
        if self.phase == Phase::Guided {
            (self.to, self.confirmed) = (GUIDED, true);
        }
        if self.phase == before {
            return None;
        }
        let mode = mode_name(seen.custom_mode);
        let (severity, code, text) = match self.phase {
            Phase::Pilot => (
                Severity::Warning,
                "pilot-takeover",
                format!("the pilot has taken over in {mode}; setpoints are withheld"),
            ),
            Phase::Guardian => (
                Severity::Warning,
                "guardian",
                format!("the vehicle's own failsafe has taken over in {mode}"),
            ),
            Phase::Guided => (
                Severity::Info,
                "guided",
                "in GUIDED: setpoints go through".into(),
            ),
            Phase::Ground => (Severity::Info, "landed", "on the ground, disarmed".into()),
            _ => return None,
        };
        Some(crate::event(severity, code, text))
    }

    fn next(&self, seen: Seen) -> Phase {
        let mode = seen.custom_mode;
        let as_asked = mode == self.to || (!self.confirmed && mode == self.from);
        match self.phase {
            Phase::Ground if !seen.airborne => Phase::Ground,
            // Found in the air: in GUIDED it awaits setpoints, in any other mode it is not ours.
            Phase::Ground if mode == GUIDED => Phase::Guided,
            Phase::Ground => Phase::Pilot,
            Phase::TakeOff if mode == GUIDED && self.to == GUIDED => Phase::Guided,
            Phase::HandingBack if mode == GUIDED => Phase::Guided,
            Phase::HandingBack if as_asked => Phase::HandingBack,
            Phase::HandingBack => Phase::Pilot,
            // The airframe is home: nothing more to take over.
            Phase::Landing if !seen.airborne && !seen.armed => Phase::Ground,
            Phase::TakeOff | Phase::Guided | Phase::Landing if as_asked => self.phase,
            Phase::TakeOff | Phase::Guided | Phase::Landing => self.taken_over(seen),
            Phase::Guardian if mode == GUIDED && !seen.failsafe => Phase::Guided,
            Phase::Guardian if homeward(mode) || seen.failsafe => Phase::Guardian,
            Phase::Guardian => Phase::Pilot,
            Phase::Pilot | Phase::Foreign => self.phase,
        }
    }

    fn taken_over(&self, seen: Seen) -> Phase {
        if seen.failsafe || (self.returned && homeward(seen.custom_mode)) {
            Phase::Guardian
        } else {
            Phase::Pilot
        }
    }
}

/// Modes in which ArduPlane brings itself home.
fn homeward(mode: u32) -> bool {
    matches!(mode, CIRCLE | AUTO | RTL | AUTOLAND)
}
