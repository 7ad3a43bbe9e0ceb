//! Who flies: the rules by which the [`ControlLevel`] of a vehicle changes, the same for every
//! vehicle of the team, simulated or real.
//!
//! *Automatic* follows the setpoints of the squadron controller; *Pilot* is a human with the
//! remote control; *Guardian* brings the vehicle home by itself. There is always exactly one of
//! them. The pilot can take over at any time and keeps control until he hands it back; a
//! setpoint never moves a vehicle that the pilot or Guardian flies; Guardian ends only when every
//! one of its reasons is gone and somebody hands control back. That somebody is the vehicle itself where Guardian took
//! over in automatic flight for the silence of an agent alone ([`ControlState::resumes`]): it ends with a pause that
//! nobody near the vehicle has seen. `docs/control-levels.md` draws it.
//!
//! Pure: a state and an event give the next state and what became of the event.

use crate::message::ControlLevel;

/// Why Guardian watches or acts. Links can come back; a low battery cannot; a broken fence is
/// over when it is back inside.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Danger {
    /// The link to the ground is lost.
    Link,
    /// The squadron controller is silent.
    SquadronController,
    /// The world simulator is silent.
    World,
    /// The bridge to the real vehicle is silent.
    Bridge,
    /// The battery is low; stays until the vehicle is on the ground.
    Battery,
    /// The vehicle is outside its fence.
    Fence,
    /// The vehicle does not hear its pilot's remote control.
    Remote,
    /// A failsafe of the vehicle's own, which does not say why.
    Failsafe,
}

impl Danger {
    /// Every reason.
    pub const ALL: [Self; 8] = [
        Self::Link,
        Self::SquadronController,
        Self::World,
        Self::Bridge,
        Self::Battery,
        Self::Fence,
        Self::Remote,
        Self::Failsafe,
    ];

    /// What it is, as text for people.
    pub fn description(self) -> &'static str {
        match self {
            Self::Link => "no link to the vehicle",
            Self::SquadronController => "no message from the squadron controller",
            Self::World => "no message from the world simulator",
            Self::Bridge => "the vehicle receives nothing from its bridge",
            Self::Battery => "battery low",
            Self::Fence => "outside the fence",
            Self::Remote => "the vehicle receives nothing from its remote control",
            Self::Failsafe => "the vehicle's own failsafe, for a reason that it does not report",
        }
    }

    /// Whether it is the silence of an agent of the team, which ends when the agent is heard again.
    fn is_silence(self) -> bool {
        matches!(self, Self::SquadronController | Self::World)
    }

    fn bit(self) -> u8 {
        1 << self as u8
    }
}

/// What can happen.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ControlEvent {
    /// A setpoint of the squadron controller.
    Setpoint,
    /// The pilot moves his switch: he flies.
    Takeover,
    /// The pilot, or an operator where Guardian flies, hands control back explicitly.
    HandBack,
    /// The pilot's remote control falls silent while he flies.
    RemoteLost,
    /// A danger begins.
    Begins(Danger),
    /// A danger is over.
    Ends(Danger),
    /// The vehicle has landed and stands.
    Landed,
}

/// What became of an event.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ControlOutcome {
    /// It was taken; the level may have changed.
    Taken,
    /// A setpoint that is to be followed.
    Followed,
    /// A setpoint that is not followed because of the level; to be shown as ignored.
    Ignored(ControlLevel),
    /// A hand-back that is refused while a danger lasts.
    Refused(Danger),
}

/// The control level of one vehicle with the dangers that last.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ControlState {
    level: ControlLevel,
    dangers: u8,
    ignored: u64,
    /// Guardian took over in automatic flight, for silences alone, and nothing else happened since.
    by_silence: bool,
    /// It flies on after such a silence.
    resumed: bool,
}

impl Default for ControlState {
    fn default() -> Self {
        Self::new()
    }
}

impl ControlState {
    /// Automatic, without danger.
    pub fn new() -> Self {
        Self {
            level: ControlLevel::Automatic,
            dangers: 0,
            ignored: 0,
            by_silence: false,
            resumed: false,
        }
    }

    /// Who flies now.
    pub fn level(&self) -> ControlLevel {
        self.level
    }

    /// The dangers that last, in the order of [`Danger::ALL`].
    pub fn dangers(&self) -> impl Iterator<Item = Danger> + '_ {
        Danger::ALL.into_iter().filter(|d| self.has(*d))
    }

    /// Whether this danger lasts.
    pub fn has(&self, danger: Danger) -> bool {
        self.dangers & danger.bit() != 0
    }

    /// How many setpoints were ignored since the vehicle last followed one.
    pub fn ignored_setpoints(&self) -> u64 {
        self.ignored
    }

    /// Whether Guardian has it for no other reason than silences that are over: in the air the vehicle then hands itself
    /// back.
    pub fn resumes(&self) -> bool {
        self.level == ControlLevel::Guardian && self.by_silence && self.dangers == 0
    }

    /// Whether it flies automatically again after silences for which Guardian had it: who did not hear it meanwhile is to
    /// know.
    pub fn has_resumed(&self) -> bool {
        self.resumed
    }

    /// Takes an event; every event is allowed at every level.
    pub fn handle(&mut self, event: ControlEvent) -> ControlOutcome {
        match event {
            ControlEvent::Setpoint => return self.setpoint(),
            ControlEvent::HandBack => return self.hand_back(),
            ControlEvent::Takeover => {
                self.level = ControlLevel::Pilot;
                (self.by_silence, self.resumed) = (false, false);
            }
            ControlEvent::RemoteLost => {
                // Nobody may be left at the sticks of a silent remote control.
                if self.level == ControlLevel::Pilot {
                    self.level = ControlLevel::Guardian;
                }
            }
            ControlEvent::Begins(danger) => {
                self.dangers |= danger.bit();
                self.by_silence &= danger.is_silence();
                if self.level == ControlLevel::Automatic {
                    self.level = ControlLevel::Guardian;
                    (self.by_silence, self.resumed) = (danger.is_silence(), false);
                }
            }
            ControlEvent::Ends(Danger::Battery) => {}
            ControlEvent::Ends(danger) => self.dangers &= !danger.bit(),
            ControlEvent::Landed => {
                self.dangers &= !Danger::Battery.bit();
                self.by_silence = false;
            }
        }
        ControlOutcome::Taken
    }

    fn setpoint(&mut self) -> ControlOutcome {
        if self.level == ControlLevel::Automatic {
            self.ignored = 0;
            ControlOutcome::Followed
        } else {
            self.ignored += 1;
            ControlOutcome::Ignored(self.level)
        }
    }

    /// The pilot's hand-back goes to Guardian while a danger lasts, else to Automatic;
    /// Guardian's is refused while a danger lasts.
    fn hand_back(&mut self) -> ControlOutcome {
        let danger = self.dangers().next();
        match (self.level, danger) {
            (ControlLevel::Guardian, Some(danger)) => ControlOutcome::Refused(danger),
            (ControlLevel::Pilot, Some(_)) => {
                self.level = ControlLevel::Guardian;
                ControlOutcome::Taken
            }
            _ => {
                self.resumed |= self.resumes();
                self.level = ControlLevel::Automatic;
                ControlOutcome::Taken
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn any_event() -> impl Strategy<Value = ControlEvent> {
        let danger = || (0..Danger::ALL.len()).prop_map(|k| Danger::ALL[k]);
        prop_oneof![
            3 => Just(ControlEvent::Setpoint),
            1 => Just(ControlEvent::Takeover),
            2 => Just(ControlEvent::HandBack),
            1 => Just(ControlEvent::RemoteLost),
            2 => danger().prop_map(ControlEvent::Begins),
            2 => danger().prop_map(ControlEvent::Ends),
            1 => Just(ControlEvent::Landed),
        ]
    }

    proptest! {
        #[test]
        fn laws_hold_after_any_events(events in prop::collection::vec(any_event(), 0..200)) {
            let mut control = ControlState::new();
            // Since the last automatic flight nobody but silent agents has called for Guardian.
            let mut by_silence = true;
            for event in events {
                let before = control;
                let outcome = control.handle(event);
                let (was, is) = (before.level(), control.level());
                // A setpoint is followed in Automatic alone, and changes nobody's level.
                if event == ControlEvent::Setpoint {
                    prop_assert_eq!(outcome == ControlOutcome::Followed, was == ControlLevel::Automatic);
                    prop_assert_eq!(is, was);
                    prop_assert_eq!(
                        control.ignored_setpoints() > before.ignored_setpoints(),
                        was != ControlLevel::Automatic
                    );
                }
                // The pilot gets control by his switch alone, at once, and loses it by his
                // hand-back or his silence alone.
                if is == ControlLevel::Pilot && was != ControlLevel::Pilot {
                    prop_assert_eq!(event, ControlEvent::Takeover);
                }
                if event == ControlEvent::Takeover {
                    prop_assert_eq!(is, ControlLevel::Pilot);
                }
                if was == ControlLevel::Pilot && is != ControlLevel::Pilot {
                    prop_assert!(matches!(event, ControlEvent::HandBack | ControlEvent::RemoteLost));
                }
                // Only Guardian by silences alone is left without somebody's hand-back.
                if is == ControlLevel::Guardian && was == ControlLevel::Pilot {
                    prop_assert!(!control.resumes());
                }
                if let ControlEvent::Begins(danger) = event
                    && !matches!(danger, Danger::SquadronController | Danger::World)
                {
                    by_silence = false;
                }
                if matches!(event, ControlEvent::Takeover | ControlEvent::Landed) {
                    by_silence = false;
                }
                if is == ControlLevel::Automatic {
                    by_silence = true;
                }
                prop_assert!(!control.resumes() || (by_silence && control.dangers().count() == 0));
                // Automatic flight and danger exclude each other.
                if is == ControlLevel::Automatic {
                    prop_assert_eq!(control.dangers().count(), 0);
                }
                // Guardian ends by the pilot or by an explicit hand-back without danger.
                if was == ControlLevel::Guardian && is == ControlLevel::Automatic {
                    prop_assert_eq!(event, ControlEvent::HandBack);
                    prop_assert_eq!(before.dangers().count(), 0);
                }
            }
        }

        #[test]
        fn the_way_back_to_automatic_is_always_open(
            events in prop::collection::vec(any_event(), 0..100)
        ) {
            let mut control = ControlState::new();
            for event in events {
                control.handle(event);
            }
            for danger in Danger::ALL {
                control.handle(ControlEvent::Ends(danger));
            }
            control.handle(ControlEvent::Landed);
            control.handle(ControlEvent::HandBack);
            prop_assert_eq!(control.level(), ControlLevel::Automatic);
            prop_assert_eq!(control.handle(ControlEvent::Setpoint), ControlOutcome::Followed);
        }
    }

    #[test]
    fn a_silence_alone_is_over_when_it_ends() {
        let silent = [Danger::SquadronController, Danger::World];
        let mut control = ControlState::new();
        for danger in silent {
            control.handle(ControlEvent::Begins(danger));
        }
        control.handle(ControlEvent::Ends(silent[0]));
        assert!(!control.resumes(), "the world is silent still");
        control.handle(ControlEvent::Ends(silent[1]));
        assert!(control.resumes());
        control.handle(ControlEvent::HandBack);
        assert_eq!(control.level(), ControlLevel::Automatic);
        assert!(control.has_resumed());
        control.handle(ControlEvent::Takeover);
        control.handle(ControlEvent::HandBack);
        assert!(!control.has_resumed());
        for other in [
            ControlEvent::Begins(Danger::Fence),
            ControlEvent::Takeover,
            ControlEvent::Landed,
        ] {
            let mut control = ControlState::new();
            control.handle(ControlEvent::Begins(silent[0]));
            control.handle(other);
            control.handle(ControlEvent::Ends(Danger::Fence));
            control.handle(ControlEvent::Ends(silent[0]));
            assert!(!control.resumes(), "{other:?}");
        }
    }

    #[test]
    fn a_lost_link_brings_home_and_the_pilot_stays_above_it() {
        let mut control = ControlState::new();
        control.handle(ControlEvent::Begins(Danger::Link));
        assert_eq!(control.level(), ControlLevel::Guardian);
        assert_eq!(
            control.handle(ControlEvent::Setpoint),
            ControlOutcome::Ignored(ControlLevel::Guardian)
        );
        control.handle(ControlEvent::Takeover);
        assert_eq!(control.level(), ControlLevel::Pilot);
        control.handle(ControlEvent::HandBack);
        assert_eq!(control.level(), ControlLevel::Guardian);
        assert_eq!(
            control.handle(ControlEvent::HandBack),
            ControlOutcome::Refused(Danger::Link)
        );
        control.handle(ControlEvent::Ends(Danger::Link));
        assert_eq!(control.level(), ControlLevel::Guardian);
        control.handle(ControlEvent::HandBack);
        assert_eq!(control.level(), ControlLevel::Automatic);
    }
}
