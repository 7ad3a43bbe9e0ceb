//! Who flies the vehicle: what its heartbeats show becomes events of the one state machine
//! [`fdm::control_level`], and what the bridge is about follows from its level.
//!
//! The bridge knows which mode it has asked for. A vehicle in any other mode has been taken
//! over: by its own failsafe if it says so (or if its link has just come back and it is on its
//! way home), else by a pilot. Either keeps it until an explicit hand-back.

use crate::arduplane::{self, AUTO, CIRCLE, GUIDED, RTL, mode_name};
use fdm::control_level::{ControlLevel, Danger, Event, Level, Outcome};
use protocol::message::{EventMessage, Severity};

/// Mode AUTOLAND of newer ArduPlane.
const AUTOLAND: u32 = 26;

/// What the bridge is about while the level is automatic.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Task {
    /// On the ground, nobody flies.
    Ground,
    /// The bridge has commanded take-off.
    TakeOff,
    /// GUIDED: setpoints go through.
    Guided,
    /// The bridge has commanded the landing sequence or the return home.
    Landing,
    /// GUIDED has been asked for upon a hand-back and is not shown yet; the level is still that
    /// from which it is handed back.
    HandingBack,
}

/// Who flies and what the bridge is about.
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
    /// GUIDED has been asked for upon a hand-back.
    HandingBack,
    /// It is on its way home, by its own failsafe or by the bridge's command.
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

/// Keeps the level and the task.
#[derive(Debug, Clone)]
pub(crate) struct Authority {
    control: ControlLevel,
    task: Task,
    foreign: bool,
    /// The mode from which the last one was asked for.
    from: u32,
    /// The mode asked for last.
    to: u32,
    /// The mode asked for before that, if it was not shown yet: it may still come.
    earlier: Option<u32>,
    confirmed: bool,
    link_up: bool,
    /// The link was down between the last heartbeat and this one.
    returned: bool,
    seen: Option<Seen>,
}

impl Authority {
    pub(crate) fn new() -> Self {
        Self {
            control: ControlLevel::new(),
            task: Task::Ground,
            foreign: false,
            from: arduplane::INITIALISING,
            to: arduplane::INITIALISING,
            earlier: None,
            confirmed: false,
            link_up: false,
            returned: false,
            seen: None,
        }
    }

    pub(crate) fn control(&self) -> &ControlLevel {
        &self.control
    }

    pub(crate) fn phase(&self) -> Phase {
        match (self.control.level(), self.task) {
            _ if self.foreign => Phase::Foreign,
            (_, Task::HandingBack) => Phase::HandingBack,
            (Level::Pilot, _) => Phase::Pilot,
            (Level::Guardian, _) => Phase::Guardian,
            (Level::Automatic, Task::Ground) => Phase::Ground,
            (Level::Automatic, Task::TakeOff) => Phase::TakeOff,
            (Level::Automatic, Task::Guided) => Phase::Guided,
            (Level::Automatic, Task::Landing) => Phase::Landing,
        }
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

    /// What the vehicle does, in words.
    pub(crate) fn doing(&self) -> String {
        let mode = self
            .seen
            .map_or_else(|| "mode unknown".into(), |s| mode_name(s.custom_mode));
        if !self.link_up {
            return "no heartbeat from the vehicle: it relies on its own failsafe".into();
        }
        match self.phase() {
            Phase::Ground => "on the ground, waits for take-off".into(),
            Phase::TakeOff => "taking off".into(),
            Phase::Guided => "flies to setpoints".into(),
            Phase::Landing => "coming home to land".into(),
            Phase::Pilot => format!("the pilot has it in {mode} until an explicit hand-back"),
            Phase::HandingBack => format!("handed back, GUIDED asked for, still {mode}"),
            Phase::Guardian => format!("goes home in {mode}"),
            Phase::Foreign => "not an ArduPlane: watched, not commanded".into(),
        }
    }

    /// Something happens to the control level.
    pub(crate) fn handle(&mut self, event: Event) -> Outcome {
        let outcome = self.control.handle(event);
        self.give_up_hand_back();
        outcome
    }

    /// A danger while a hand-back waits for GUIDED: it is the Guardian's now.
    fn give_up_hand_back(&mut self) {
        if self.task == Task::HandingBack && self.control.dangers().next().is_some() {
            self.task = Task::Guided;
            self.control.handle(Event::HandBack);
        }
    }

    /// The bridge asks for mode `to`.
    fn ask(&mut self, to: u32) {
        self.earlier = (!self.confirmed).then_some(self.to);
        self.from = self.seen.map_or(self.from, |s| s.custom_mode);
        self.confirmed = self.from == to;
        self.to = to;
    }

    pub(crate) fn take_off(&mut self, mode: u32) {
        self.task = Task::TakeOff;
        self.ask(mode);
    }

    pub(crate) fn land(&mut self, mode: u32) {
        self.task = Task::Landing;
        self.ask(mode);
    }

    /// The Guardian brings it home.
    pub(crate) fn go_home(&mut self) {
        self.ask(RTL);
    }

    /// A hand-back on the ground, which nobody has to confirm.
    pub(crate) fn hand_back_on_ground(&mut self) -> Outcome {
        if let Some(seen) = self.seen {
            self.ask(seen.custom_mode);
        }
        self.task = Task::Ground;
        self.control.handle(Event::HandBack)
    }

    /// A hand-back in the air: refused, or given to the Guardian, while a danger lasts, else
    /// done when GUIDED is shown.
    pub(crate) fn hand_back(&mut self) -> Outcome {
        if self.control.dangers().next().is_some() {
            return self.control.handle(Event::HandBack);
        }
        self.task = Task::HandingBack;
        self.ask(GUIDED);
        self.take_back();
        Outcome::Taken
    }

    /// Takes the vehicle back if GUIDED is shown after a hand-back.
    fn take_back(&mut self) {
        let guided = self.seen.is_some_and(|s| s.custom_mode == GUIDED);
        if self.task == Task::HandingBack && guided {
            self.task = Task::Guided;
            self.control.handle(Event::HandBack);
        }
    }

    /// The mode asked for was refused; what was before remains.
    pub(crate) fn refused(&mut self) {
        self.task = match self.task {
            Task::TakeOff if self.to != GUIDED => Task::Ground,
            Task::Landing | Task::HandingBack => Task::Guided,
            other => other,
        };
        self.to = self.from;
        self.confirmed = true;
    }

    pub(crate) fn foreign(&mut self) {
        self.foreign = true;
        self.control.handle(Event::Takeover);
    }

    /// Nothing has been heard for too long.
    pub(crate) fn link_lost(&mut self) {
        self.link_up = false;
        // On the ground there is nobody to bring home.
        if self.seen.is_some_and(|s| s.airborne) {
            self.handle(Event::Begins(Danger::Link));
        } else if self.task == Task::HandingBack {
            self.task = Task::Guided;
        }
    }

    /// Takes in a heartbeat; says what changed.
    pub(crate) fn observe(&mut self, seen: Seen) -> Option<EventMessage> {
        let before = self.phase();
        self.returned = !self.link_up && self.seen.is_some();
        self.link_up = true;
        self.seen = Some(seen);
        if seen.custom_mode == self.to {
            self.confirmed = true;
        }
        self.control.handle(Event::Ends(Danger::Link));
        if !seen.failsafe {
            self.control.handle(Event::Ends(Danger::Bridge));
        }
        self.take_in(seen);
        let phase = self.phase();
        if phase == before {
            return None;
        }
        let mode = mode_name(seen.custom_mode);
        let (severity, code, text) = match phase {
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

    /// The mode shown is the one asked for, or still the one from which it was asked.
    fn as_asked(&self, mode: u32) -> bool {
        mode == self.to || (!self.confirmed && (mode == self.from || Some(mode) == self.earlier))
    }

    fn take_in(&mut self, seen: Seen) {
        let mode = seen.custom_mode;
        if self.foreign {
            return;
        }
        if !seen.airborne && !seen.armed {
            self.control.handle(Event::Landed);
            if self.task == Task::Landing || self.control.level() == Level::Guardian {
                self.task = Task::Ground;
            }
        }
        self.take_back();
        match (self.control.level(), self.task) {
            // Its pilot's remote control is silent, and its own failsafe has it.
            (Level::Pilot, _) if seen.failsafe && homeward(mode) => {
                self.control.handle(Event::RemoteLost);
                self.failsafe(seen);
            }
            (_, Task::HandingBack) if !self.as_asked(mode) => {
                self.task = Task::Guided;
                self.taken_over(seen);
            }
            (Level::Pilot, _) | (_, Task::HandingBack) => {}
            (Level::Guardian, _) if self.as_asked(mode) || homeward(mode) => {}
            (Level::Guardian, _) if !seen.airborne && !seen.armed => {}
            (Level::Guardian, _) => self.takeover(mode),
            (Level::Automatic, Task::Ground) if !seen.airborne => {}
            // Found in the air: in GUIDED it awaits setpoints, in any other mode it is not ours.
            (Level::Automatic, Task::Ground) if mode == GUIDED => self.guided(),
            (Level::Automatic, Task::Ground) => self.takeover(mode),
            (Level::Automatic, Task::TakeOff) if mode == GUIDED && self.to == GUIDED => {
                self.guided();
            }
            (Level::Automatic, _) if self.as_asked(mode) => {}
            (Level::Automatic, _) => self.taken_over(seen),
        }
    }

    fn guided(&mut self) {
        self.task = Task::Guided;
        (self.to, self.confirmed) = (GUIDED, true);
    }

    /// Somebody else has changed the mode.
    fn taken_over(&mut self, seen: Seen) {
        if seen.failsafe || (self.returned && homeward(seen.custom_mode)) {
            self.failsafe(seen);
        } else {
            self.takeover(seen.custom_mode);
        }
    }

    fn failsafe(&mut self, seen: Seen) {
        (self.to, self.confirmed) = (seen.custom_mode, true);
        self.control.handle(Event::Begins(Danger::Bridge));
        if !seen.failsafe {
            // It is over already, but only a hand-back ends its flight home.
            self.control.handle(Event::Ends(Danger::Bridge));
        }
    }

    /// From here on every mode is the pilot's own.
    fn takeover(&mut self, mode: u32) {
        (self.to, self.confirmed) = (mode, true);
        self.control.handle(Event::Takeover);
    }
}

/// Modes in which ArduPlane brings itself home.
pub(crate) fn homeward(mode: u32) -> bool {
    matches!(mode, CIRCLE | AUTO | RTL | AUTOLAND)
}
