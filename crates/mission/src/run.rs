//! A mission in one process in virtual time.

use crate::team::Member;
use crate::{MissionError, Setup};
use protocol::SimTime;
use protocol::bus::{Conductor, Said};
use protocol::digest::Digest;

/// A mission under way.
pub struct Run {
    conductor: Conductor<Member>,
    digest: Digest,
    ticks: u64,
}

impl Run {
    /// A mission at its start.
    ///
    /// # Errors
    /// A member that cannot be made.
    pub fn new(setup: &Setup) -> Result<Self, MissionError> {
        Ok(Self {
            conductor: Conductor::new(Member::all(setup)?, setup.tick_ns()),
            digest: Digest::new(),
            ticks: setup.ticks(),
        })
    }

    /// Simulated time of the tick to come.
    pub fn now(&self) -> SimTime {
        self.conductor.now()
    }

    /// Whether the mission has come to its end.
    pub fn ended(&self) -> bool {
        self.conductor.next_tick() > self.ticks
    }

    /// Runs the next tick and returns what was said in it, in order; nothing after the end. The
    /// last tick is the one at the mission's duration, in which the agents say their last words.
    pub fn step(&mut self) -> &[Said] {
        let said = match self.conductor.next_tick().cmp(&self.ticks) {
            std::cmp::Ordering::Less => self.conductor.step(),
            std::cmp::Ordering::Equal => self.conductor.stop(),
            std::cmp::Ordering::Greater => return &[],
        };
        for (topic, envelope) in said {
            self.digest.add(topic, envelope);
        }
        said
    }

    /// Digest of all that was said so far.
    pub fn digest(&self) -> String {
        self.digest.hex()
    }
}
