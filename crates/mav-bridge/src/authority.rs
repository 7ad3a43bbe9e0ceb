//! Control of the vehicle: heartbeats become events of the state machine
//! [`protocol::control_level`], and its level determines the bridge's task.
//!
//! The bridge knows which mode it has requested. A vehicle in any other mode has been taken
//! over: by its own failsafe if it says so (or if its link has just come back and it is on its
//! way home), else by a pilot. Either keeps it until an explicit hand-back.

use crate::event::event;
use crate::profile::Modes;
use protocol::control_level::{ControlEvent, ControlOutcome, ControlState, Danger};
use protocol::message::{ControlLevel, EventMessage, Severity};

/// Stands for "no mode requested": no vehicle reports it.
const NO_MODE: u32 = u32::MAX;
/// Heartbeats after a takeover within which the vehicle may still report its own failsafe as the cause.
const CAUSE_WITHIN: u8 = 3;

/// Task of the bridge while the level is automatic.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum BridgeTask {
    /// On the ground.
    Ground,
    /// The bridge has commanded take-off.
    TakeOff,
    /// In the mode in which setpoints go through.
    Guided,
    /// The bridge has commanded the landing sequence or the return home.
    Landing,
    /// That mode was requested after a hand-back and is not reported yet; the level is still that
    /// from which it is handed back.
    HandingBack,
}

/// Control level and task.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum BridgePhase {
    /// On the ground.
    Ground,
    /// The bridge has commanded take-off.
    TakeOff,
    /// In the mode in which setpoints go through.
    Guided,
    /// The bridge has commanded the landing sequence or the return home.
    Landing,
    /// A pilot flies.
    Pilot,
    /// The mode for setpoints was requested after a hand-back.
    HandingBack,
    /// It is on its way home, by its own failsafe or by the bridge's command.
    Guardian,
    /// Watched, never commanded.
    Watched,
}

/// The part of a heartbeat that concerns control.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct HeartbeatState {
    pub custom_mode: u32,
    pub armed: bool,
    pub airborne: bool,
    pub failsafe: bool,
    /// The cause of its own return home, if reported.
    pub cause: Option<Danger>,
    /// It reports a breach of the fence on board.
    pub fence_broken: bool,
    /// The bridge itself was silent just before, so that its failsafe for a lost ground station may act.
    pub unheard: bool,
}

/// Keeps the level and the task.
#[derive(Debug, Clone)]
pub(crate) struct Authority {
    modes: &'static Modes,
    /// The mode in which setpoints go through.
    guided: u32,
    control: ControlState,
    task: BridgeTask,
    /// Why it is watched and never commanded, if so.
    watched: Option<&'static str>,
    /// Whether another ground station has taken it over.
    by_station: bool,
    /// Whether the fence danger that lasts is that of the fence on board.
    own_fence: bool,
    /// Heartbeats since the last takeover, as far as they are counted.
    since_takeover: u8,
    /// The mode reported when the last one was requested.
    mode_before: u32,
    /// The mode requested last.
    mode_requested: u32,
    /// The mode requested before that, if not reported yet: it may still arrive.
    earlier: Option<u32>,
    confirmed: bool,
    /// It takes off by a command in the mode for setpoints, which go through only after the climb.
    climbing: bool,
    link_up: bool,
    /// The link was down between the last heartbeat and this one.
    link_returned: bool,
    shown: Option<HeartbeatState>,
    /// The mode in which its own failsafe flies, while its cause is not told yet.
    awaits_cause: Option<u32>,
}

impl Authority {
    /// Of a vehicle with these modes; `guided` is the one in which setpoints go through.
    pub(crate) fn new(modes: &'static Modes, guided: u32) -> Self {
        Self {
            modes,
            guided,
            control: ControlState::new(),
            task: BridgeTask::Ground,
            watched: None,
            by_station: false,
            own_fence: false,
            since_takeover: CAUSE_WITHIN,
            mode_before: modes.starting,
            mode_requested: modes.starting,
            earlier: None,
            confirmed: false,
            climbing: false,
            link_up: false,
            link_returned: false,
            shown: None,
            awaits_cause: None,
        }
    }

    /// Its modes.
    pub(crate) fn modes(&self) -> &'static Modes {
        self.modes
    }

    /// The mode in which setpoints go through.
    pub(crate) fn guided_mode(&self) -> u32 {
        self.guided
    }

    pub(crate) fn control(&self) -> &ControlState {
        &self.control
    }

    pub(crate) fn phase(&self) -> BridgePhase {
        match (self.control.level(), self.task) {
            _ if self.watched.is_some() => BridgePhase::Watched,
            (_, BridgeTask::HandingBack) => BridgePhase::HandingBack,
            (ControlLevel::Pilot, _) => BridgePhase::Pilot,
            (ControlLevel::Guardian, _) => BridgePhase::Guardian,
            (ControlLevel::Automatic, BridgeTask::Ground) => BridgePhase::Ground,
            (ControlLevel::Automatic, BridgeTask::TakeOff) => BridgePhase::TakeOff,
            (ControlLevel::Automatic, BridgeTask::Guided) => BridgePhase::Guided,
            (ControlLevel::Automatic, BridgeTask::Landing) => BridgePhase::Landing,
        }
    }

    /// The last heartbeat; none before the first.
    pub(crate) fn shown(&self) -> Option<HeartbeatState> {
        self.shown
    }

    pub(crate) fn link_up(&self) -> bool {
        self.link_up
    }

    /// The mode requested last, if the vehicle has not reported it yet.
    pub(crate) fn unconfirmed(&self) -> Option<u32> {
        (!self.confirmed).then_some(self.mode_requested)
    }

    /// The vehicle's activity as text.
    pub(crate) fn doing(&self) -> String {
        let mode = self
            .shown
            .map_or_else(|| "mode unknown".into(), |s| self.modes.name(s.custom_mode));
        if let Some(why) = self.watched {
            return format!("{why}: monitored, not commanded");
        }
        if !self.link_up {
            return "no heartbeat from the vehicle: it relies on its own failsafe".into();
        }
        match self.phase() {
            BridgePhase::Ground => "on the ground, waiting for take-off".into(),
            BridgePhase::TakeOff => "taking off".into(),
            BridgePhase::Guided => "flies to setpoints".into(),
            BridgePhase::Landing => "coming home to land".into(),
            BridgePhase::Pilot if self.by_station => {
                "another ground station controls it until an explicit hand-back".into()
            }
            BridgePhase::Pilot => {
                format!("the pilot flies it in {mode} until an explicit hand-back")
            }
            BridgePhase::HandingBack => {
                let guided = self.modes.short_name(self.guided);
                format!("handed back: {guided} requested, still in {mode}")
            }
            BridgePhase::Guardian => format!("returns home in {mode}"),
            BridgePhase::Watched => String::new(),
        }
    }

    /// Something happens to the control level.
    pub(crate) fn handle(&mut self, event: ControlEvent) -> ControlOutcome {
        let outcome = self.control.handle(event);
        self.give_up_hand_back();
        outcome
    }

    /// Whether it is in the air on its way home only for silences that have ended.
    pub(crate) fn resumes(&self) -> bool {
        let airborne = self.shown.is_some_and(|s| s.airborne);
        airborne && self.link_up && self.task != BridgeTask::HandingBack && self.control.resumes()
    }

    /// A danger while a hand-back waits for its mode: it is the Guardian's now.
    fn give_up_hand_back(&mut self) {
        if self.task == BridgeTask::HandingBack && self.control.dangers().next().is_some() {
            self.task = BridgeTask::Guided;
            self.control.handle(ControlEvent::HandBack);
        }
    }

    /// Records the bridge's request for mode `to`.
    fn request_mode(&mut self, to: u32) {
        // A mode asked for twice in short order may show itself after the second request; it is
        // then not a pilot's.
        self.earlier = (!self.confirmed).then_some(self.mode_requested);
        self.mode_before = self.shown.map_or(self.mode_before, |s| s.custom_mode);
        // Nothing to wait for when the vehicle is in that mode already.
        self.confirmed = self.mode_before == to;
        self.mode_requested = to;
    }

    pub(crate) fn take_off(&mut self, mode: u32) {
        self.climbing = false;
        self.task = BridgeTask::TakeOff;
        self.request_mode(mode);
    }

    /// The same by a command, in the mode in which setpoints go through: not before [`Self::take_off`] is called again.
    pub(crate) fn climb(&mut self, mode: u32) {
        self.take_off(mode);
        self.climbing = true;
    }

    pub(crate) fn land(&mut self, mode: u32) {
        self.task = BridgeTask::Landing;
        self.request_mode(mode);
    }

    /// The Guardian brings it home.
    pub(crate) fn go_home(&mut self) {
        self.request_mode(self.modes.home);
    }

    /// A hand-back on the ground, which needs no confirmation.
    pub(crate) fn hand_back_on_ground(&mut self) -> ControlOutcome {
        // A take-off in its present mode is a takeover.
        (self.mode_requested, self.confirmed) = (NO_MODE, true);
        self.task = BridgeTask::Ground;
        self.control.handle(ControlEvent::HandBack)
    }

    /// A hand-back in the air: refused, or given to the Guardian, while a danger lasts, else
    /// done when the mode for setpoints is shown.
    pub(crate) fn hand_back(&mut self) -> ControlOutcome {
        if self.control.dangers().next().is_some() {
            // Until the Guardian requests its own mode, the vehicle may keep the present one.
            if self.control.level() == ControlLevel::Pilot {
                let mode = self.shown.map_or(NO_MODE, |s| s.custom_mode);
                (self.mode_requested, self.confirmed) = (mode, true);
            }
            return self.control.handle(ControlEvent::HandBack);
        }
        self.task = BridgeTask::HandingBack;
        self.request_mode(self.guided);
        self.confirm_hand_back();
        ControlOutcome::Taken
    }

    /// Takes the vehicle back if the mode for setpoints is shown after a hand-back.
    fn confirm_hand_back(&mut self) {
        let guided = self.shown.is_some_and(|s| s.custom_mode == self.guided);
        if self.task == BridgeTask::HandingBack && guided {
            self.task = BridgeTask::Guided;
            self.control.handle(ControlEvent::HandBack);
        }
    }

    /// The requested mode was rejected; the former one remains.
    pub(crate) fn refused(&mut self) {
        if self.confirmed {
            return; // what was asked for is past
        }
        // The vehicle stays as it was: what had been begun is taken back, so that the next setpoint
        // may try again.
        self.task = match self.task {
            BridgeTask::TakeOff if self.mode_requested != self.guided || self.climbing => {
                BridgeTask::Ground
            }
            BridgeTask::Landing | BridgeTask::HandingBack => BridgeTask::Guided,
            other => other,
        };
        self.mode_requested = self.mode_before;
        self.confirmed = true;
    }

    /// From now on it is watched and never commanded; `why` is for people.
    pub(crate) fn watch(&mut self, why: &'static str) {
        // Counted as flown by a pilot: every command is then withheld by the same rule.
        self.watched = Some(why);
        self.control.handle(ControlEvent::Takeover);
    }

    /// Another ground station has sent it elsewhere in the mode for setpoints.
    pub(crate) fn taken_by_station(&mut self) {
        self.takeover();
        self.by_station = true;
    }

    /// The link has timed out.
    pub(crate) fn link_lost(&mut self) {
        self.link_up = false;
        // On the ground there is no way home.
        if self.shown.is_some_and(|s| s.airborne) {
            self.handle(ControlEvent::Begins(Danger::Link));
        } else if self.task == BridgeTask::HandingBack {
            self.task = BridgeTask::Guided;
        }
    }

    /// Processes a heartbeat; returns the event of a change.
    pub(crate) fn observe(&mut self, shown: HeartbeatState) -> Option<EventMessage> {
        let before = self.phase();
        self.link_returned = !self.link_up && self.shown.is_some();
        self.link_up = true;
        self.shown = Some(shown);
        if shown.custom_mode == self.mode_requested {
            self.confirmed = true;
        }
        // The earlier of two requests has come true: there is no way back behind it.
        if !self.confirmed && Some(shown.custom_mode) == self.earlier {
            (self.mode_before, self.earlier) = (shown.custom_mode, None);
        }
        // A heartbeat proves the link, whatever its content.
        self.control.handle(ControlEvent::Ends(Danger::Link));
        if !shown.failsafe {
            for danger in [Danger::Bridge, Danger::Remote, Danger::Failsafe] {
                self.control.handle(ControlEvent::Ends(danger));
            }
        }
        if self.own_fence && !shown.fence_broken {
            self.own_fence = false;
            self.control.handle(ControlEvent::Ends(Danger::Fence));
        }
        self.since_takeover = self.since_takeover.saturating_add(1);
        // A mode that was the Guardian's and was left is his no more, nor one that he has asked for
        // once the vehicle shows a third one.
        if !self.is_as_requested(shown.custom_mode)
            && self.control.level() == ControlLevel::Guardian
        {
            (self.mode_requested, self.confirmed) = (NO_MODE, true);
        }
        self.follow(shown);
        let phase = self.phase();
        if phase == before {
            return None;
        }
        let mode = self.modes.name(shown.custom_mode);
        let (severity, code, text) = match phase {
            BridgePhase::Pilot => (
                Severity::Warning,
                "pilot-takeover",
                format!("the pilot took over in {mode}; the bridge withholds setpoints"),
            ),
            BridgePhase::Guardian => {
                let cause = self.cause(shown);
                if cause == Danger::Failsafe {
                    // Its text may be on its way.
                    self.awaits_cause = Some(shown.custom_mode);
                    return None;
                }
                return Some(self.failsafe_event(shown.custom_mode, cause));
            }
            BridgePhase::Guided => (
                Severity::Info,
                "guided",
                format!(
                    "in {}: the bridge sends setpoints",
                    self.modes.short_name(self.guided)
                ),
            ),
            BridgePhase::Ground => (Severity::Info, "landed", "on the ground, disarmed".into()),
            _ => return None,
        };
        Some(event(severity, code, text))
    }

    fn failsafe_event(&self, mode: u32, cause: Danger) -> EventMessage {
        let (mode, why) = (self.modes.name(mode), cause.description());
        let text = format!("the vehicle's own failsafe took over in {mode}: {why}");
        event(Severity::Warning, "guardian", text)
    }

    /// Whether its own failsafe flies for a cause that it has not told yet.
    pub(crate) fn awaits_cause(&self) -> bool {
        self.awaits_cause.is_some()
    }

    /// The cause that was awaited, or none that it tells; returns the event of its failsafe, if that still flies.
    pub(crate) fn tell_cause(&mut self, cause: Option<Danger>) -> Option<EventMessage> {
        let mode = self.awaits_cause.take()?;
        if self.phase() != BridgePhase::Guardian {
            return None;
        }
        let unnamed = Danger::Failsafe;
        if let Some(cause) = cause {
            let lasts = self.control.dangers().any(|danger| danger == unnamed);
            self.control.handle(ControlEvent::Begins(cause));
            self.control.handle(ControlEvent::Ends(unnamed));
            let broken = self.shown.is_some_and(|shown| shown.fence_broken);
            self.own_fence = cause == Danger::Fence && broken;
            if !lasts && !self.own_fence {
                self.control.handle(ControlEvent::Ends(cause));
            }
        }
        Some(self.failsafe_event(mode, cause.unwrap_or(unnamed)))
    }

    /// Whether the reported mode is the requested one, or still the one before the request.
    fn is_as_requested(&self, mode: u32) -> bool {
        mode == self.mode_requested
            || (!self.confirmed && (mode == self.mode_before || Some(mode) == self.earlier))
    }

    /// Draws from the mode shown who flies now: what the bridge has asked for, the vehicle's own
    /// failsafe, or a pilot.
    fn follow(&mut self, shown: HeartbeatState) {
        let mode = shown.custom_mode;
        if self.watched.is_some() {
            return;
        }
        // Down and disarmed, the flight is over whatever the mode.
        if !shown.airborne && !shown.armed {
            self.control.handle(ControlEvent::Landed);
            if self.task == BridgeTask::Landing || self.control.level() == ControlLevel::Guardian {
                self.task = BridgeTask::Ground;
            }
        }
        self.confirm_hand_back();
        match (self.control.level(), self.task) {
            // Its pilot's remote control is silent, and its own failsafe has it.
            (ControlLevel::Pilot, _)
                if self.modes.is_homeward(mode)
                    && (shown.failsafe
                        || (shown.cause.is_some() && self.since_takeover < CAUSE_WITHIN)) =>
            {
                self.control.handle(ControlEvent::RemoteLost);
                self.failsafe(shown);
            }
            (_, BridgeTask::HandingBack) if !self.is_as_requested(mode) => {
                self.task = BridgeTask::Guided;
                self.taken_over(shown);
            }
            (_, BridgeTask::HandingBack) => {}
            // After a pilot has left a mode, it no longer counts as the pilot's.
            (ControlLevel::Pilot, _) => (self.mode_requested, self.confirmed) = (NO_MODE, true),
            (ControlLevel::Guardian, _)
                if self.is_as_requested(mode) || self.modes.is_homeward(mode) => {}
            (ControlLevel::Guardian, _) if !shown.airborne && !shown.armed => {}
            (ControlLevel::Guardian, _) => self.takeover(),
            (ControlLevel::Automatic, BridgeTask::Ground) if !shown.airborne => {}
            // Found in the air: in a mode that is for ground stations alone it awaits setpoints, in any other it is
            // not ours.
            (ControlLevel::Automatic, BridgeTask::Ground)
                if mode == self.guided
                    && !(mode == self.modes.places && self.modes.places_is_pilots) =>
            {
                self.guided();
            }
            (ControlLevel::Automatic, BridgeTask::Ground) => self.takeover(),
            (ControlLevel::Automatic, BridgeTask::TakeOff)
                if mode == self.guided
                    && !self.climbing
                    && (self.mode_requested == self.guided || self.ends_take_off(mode)) =>
            {
                self.guided();
            }
            (ControlLevel::Automatic, BridgeTask::TakeOff) if self.ends_take_off(mode) => {}
            (ControlLevel::Automatic, _) if self.is_as_requested(mode) => {}
            (ControlLevel::Automatic, _) => self.taken_over(shown),
        }
    }

    /// Whether the vehicle has changed to `mode` by itself after the climb of its take-off.
    fn ends_take_off(&self, mode: u32) -> bool {
        let climbed = self.confirmed || self.mode_requested == self.guided;
        climbed && self.modes.after_take_off == Some(mode)
    }

    fn guided(&mut self) {
        self.task = BridgeTask::Guided;
        (self.mode_requested, self.confirmed) = (self.guided, true);
    }

    /// The mode has changed without a request: by the vehicle itself only if that mode brings it home, for a
    /// failsafe may last while its pilot flies in a mode of his own.
    fn taken_over(&mut self, shown: HeartbeatState) {
        let by_itself =
            shown.failsafe || shown.cause.is_some() || self.link_returned || shown.unheard;
        if by_itself && self.modes.is_homeward(shown.custom_mode) {
            self.failsafe(shown);
        } else {
            self.takeover();
        }
    }

    /// The cause of the vehicle's own return home: reported, or else likely.
    fn cause(&self, shown: HeartbeatState) -> Danger {
        let silent = if self.link_returned || shown.unheard {
            Danger::Bridge
        } else {
            Danger::Failsafe
        };
        shown.cause.unwrap_or(silent)
    }

    fn failsafe(&mut self, shown: HeartbeatState) {
        (self.mode_requested, self.confirmed) = (shown.custom_mode, true);
        let danger = self.cause(shown);
        self.control.handle(ControlEvent::Begins(danger));
        self.own_fence = danger == Danger::Fence && shown.fence_broken;
        let lasts = match danger {
            Danger::Fence => self.own_fence,
            _ => shown.failsafe,
        };
        if !lasts {
            // It is over already, but only a hand-back ends its flight home.
            self.control.handle(ControlEvent::Ends(danger));
        }
    }

    /// From here on every mode is the pilot's own.
    fn takeover(&mut self) {
        (self.mode_requested, self.confirmed) = (NO_MODE, true);
        (self.by_station, self.since_takeover) = (false, 0);
        self.control.handle(ControlEvent::Takeover);
    }
}
