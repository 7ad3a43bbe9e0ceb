//! A run of a mission, and the one that a process is in.

use crate::locks::lock;
use crate::{NetError, random};
use protocol::seal::{MissionKey, SealCheck};
use std::sync::{Arc, Mutex};
use std::time::Instant;

/// A run of a mission, by this process's clock.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Run {
    /// Its number, with which all that is said in it is sealed.
    pub(crate) number: u64,
    pub(crate) start: Instant,
}

impl Run {
    /// A new one that begins now.
    ///
    /// # Errors
    /// [`NetError::Random`].
    pub(crate) fn begin() -> Result<Self, NetError> {
        Ok(Self {
            number: u64::from_be_bytes(random()?),
            start: Instant::now(),
        })
    }

    pub(crate) fn age_ns(self) -> i64 {
        i64::try_from(self.start.elapsed().as_nanos()).unwrap_or(i64::MAX)
    }
}

/// The run that a process has joined, with what it takes in.
#[derive(Debug, Clone)]
pub(crate) struct RunJoined {
    run: Arc<Mutex<Option<Run>>>,
    pub(crate) check: Arc<Mutex<SealCheck>>,
}

impl RunJoined {
    /// None yet, of a process that holds `key`.
    pub(crate) fn new(key: &MissionKey) -> Self {
        Self {
            run: Arc::default(),
            check: Arc::new(Mutex::new(SealCheck::new(key.clone()))),
        }
    }

    pub(crate) fn run(&self) -> Option<Run> {
        *lock(&self.run)
    }

    /// From now on the process speaks and hears in `run`.
    pub(crate) fn join(&self, run: Run) {
        *lock(&self.run) = Some(run);
        lock(&self.check).only_run(run.number);
    }
}

/// Whether an agent is of the team: it flies, or what it says moves what flies. The others only look on.
pub(crate) fn is_of_team(agent: &str) -> bool {
    ["sc/", "ws/", "va/"]
        .iter()
        .any(|kind| agent.starts_with(kind))
}
