//! Who flies: the three control levels and the rules by which they change.
//!
//! *Automatic* follows the setpoints of the squadron controller; *Pilot* is a human with the
//! remote control; *Guardian* brings the vehicle home by itself. There is always exactly one of
//! them. The pilot can take over at any time and keeps control until he hands it back; a
//! setpoint never moves a vehicle that the pilot or Guardian flies; Guardian ends only when every
//! one of its reasons is gone and somebody hands control back. `docs/control-levels.md` draws it.
//!
//! Pure: a state and an event give the next state and what became of the event.

/// Who flies.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Level {
    /// The vehicle follows setpoints.
    Automatic,
    /// A human flies by remote control.
    Pilot,
    /// The vehicle brings itself home and circles there.
    Guardian,
}

/// Why Guardian watches or acts. Links can come back; a low battery cannot; a broken fence is
/// mended by coming back inside.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Danger {
    /// Nothing is heard of the link to the ground.
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
}

impl Danger {
    /// Every reason.
    pub const ALL: [Self; 6] = [
        Self::Link,
        Self::SquadronController,
        Self::World,
        Self::Bridge,
        Self::Battery,
        Self::Fence,
    ];

    /// What it is, in words.
    pub fn words(self) -> &'static str {
        match self {
            Self::Link => "no link to the vehicle",
            Self::SquadronController => "no word from the squadron controller",
            Self::World => "no word from the world simulator",
            Self::Bridge => "the vehicle does not hear its bridge",
            Self::Battery => "battery low",
            Self::Fence => "outside the fence",
        }
    }

    fn bit(self) -> u8 {
        1 << self as u8
    }
}

/// What can happen.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Event {
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
pub enum Outcome {
    /// It was taken; the level may have changed.
    Taken,
    /// A setpoint that is to be followed.
    Followed,
    /// A setpoint that is not followed because of the level; to be shown as ignored.
    Ignored(Level),
    /// A hand-back that is refused while a danger lasts.
    Refused(Danger),
}

/// The control level of one vehicle with the dangers that last.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ControlLevel {
    level: Level,
    dangers: u8,
    ignored: u64,
}

impl Default for ControlLevel {
    fn default() -> Self {
        Self::new()
    }
}

impl ControlLevel {
    /// Automatic, without danger.
    pub fn new() -> Self {
        Self {
            level: Level::Automatic,
            dangers: 0,
            ignored: 0,
        }
    }

    /// Who flies now.
    pub fn level(&self) -> Level {
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

    /// Takes an event; every event is allowed at every level.
    pub fn handle(&mut self, event: Event) -> Outcome {
        match event {
            Event::Setpoint => return self.setpoint(),
            Event::HandBack => return self.hand_back(),
            Event::Takeover => self.level = Level::Pilot,
            Event::RemoteLost => {
                // Nobody may be left at the sticks of a silent remote control.
                if self.level == Level::Pilot {
                    self.level = Level::Guardian;
                }
            }
            Event::Begins(danger) => {
                self.dangers |= danger.bit();
                if self.level == Level::Automatic {
                    self.level = Level::Guardian;
                }
            }
            Event::Ends(Danger::Battery) => {}
            Event::Ends(danger) => self.dangers &= !danger.bit(),
            Event::Landed => self.dangers &= !Danger::Battery.bit(),
        }
        Outcome::Taken
    }

    fn setpoint(&mut self) -> Outcome {
        if self.level == Level::Automatic {
            self.ignored = 0;
            Outcome::Followed
        } else {
            self.ignored += 1;
            Outcome::Ignored(self.level)
        }
    }

    /// The pilot's hand-back goes to Guardian while a danger lasts, else to Automatic;
    /// Guardian's is refused while a danger lasts.
    fn hand_back(&mut self) -> Outcome {
        let danger = self.dangers().next();
        match (self.level, danger) {
            (Level::Guardian, Some(danger)) => Outcome::Refused(danger),
            (Level::Pilot, Some(_)) => {
                self.level = Level::Guardian;
                Outcome::Taken
            }
            _ => {
                self.level = Level::Automatic;
                Outcome::Taken
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn any_event() -> impl Strategy<Value = Event> {
        let danger = || (0..Danger::ALL.len()).prop_map(|k| Danger::ALL[k]);
        prop_oneof![
            3 => Just(Event::Setpoint),
            1 => Just(Event::Takeover),
            2 => Just(Event::HandBack),
            1 => Just(Event::RemoteLost),
            2 => danger().prop_map(Event::Begins),
            2 => danger().prop_map(Event::Ends),
            1 => Just(Event::Landed),
        ]
    }

    proptest! {
        #[test]
        fn laws_hold_after_any_events(events in prop::collection::vec(any_event(), 0..200)) {
            let mut control = ControlLevel::new();
            for event in events {
                let before = control;
                let outcome = control.handle(event);
                let (was, is) = (before.level(), control.level());
                // A setpoint is followed in Automatic alone, and changes nobody's level.
                if event == Event::Setpoint {
                    prop_assert_eq!(outcome == Outcome::Followed, was == Level::Automatic);
                    prop_assert_eq!(is, was);
                    prop_assert_eq!(
                        control.ignored_setpoints() > before.ignored_setpoints(),
                        was != Level::Automatic
                    );
                }
                // The pilot gets control by his switch alone, at once, and loses it by his
                // hand-back or his silence alone.
                if is == Level::Pilot && was != Level::Pilot {
                    prop_assert_eq!(event, Event::Takeover);
                }
                if event == Event::Takeover {
                    prop_assert_eq!(is, Level::Pilot);
                }
                if was == Level::Pilot && is != Level::Pilot {
                    prop_assert!(matches!(event, Event::HandBack | Event::RemoteLost));
                }
                // Automatic flight and danger exclude each other.
                if is == Level::Automatic {
                    prop_assert_eq!(control.dangers().count(), 0);
                }
                // Guardian ends by the pilot or by an explicit hand-back without danger.
                if was == Level::Guardian && is == Level::Automatic {
                    prop_assert_eq!(event, Event::HandBack);
                    prop_assert_eq!(before.dangers().count(), 0);
                }
            }
        }

        #[test]
        fn the_way_back_to_automatic_is_always_open(
            events in prop::collection::vec(any_event(), 0..100)
        ) {
            let mut control = ControlLevel::new();
            for event in events {
                control.handle(event);
            }
            for danger in Danger::ALL {
                control.handle(Event::Ends(danger));
            }
            control.handle(Event::Landed);
            control.handle(Event::HandBack);
            prop_assert_eq!(control.level(), Level::Automatic);
            prop_assert_eq!(control.handle(Event::Setpoint), Outcome::Followed);
        }
    }

    #[test]
    fn a_lost_link_brings_home_and_the_pilot_stays_above_it() {
        let mut control = ControlLevel::new();
        control.handle(Event::Begins(Danger::Link));
        assert_eq!(control.level(), Level::Guardian);
        assert_eq!(
            control.handle(Event::Setpoint),
            Outcome::Ignored(Level::Guardian)
        );
        control.handle(Event::Takeover);
        assert_eq!(control.level(), Level::Pilot);
        control.handle(Event::HandBack);
        assert_eq!(control.level(), Level::Guardian);
        assert_eq!(
            control.handle(Event::HandBack),
            Outcome::Refused(Danger::Link)
        );
        control.handle(Event::Ends(Danger::Link));
        assert_eq!(control.level(), Level::Guardian);
        control.handle(Event::HandBack);
        assert_eq!(control.level(), Level::Automatic);
    }
}
