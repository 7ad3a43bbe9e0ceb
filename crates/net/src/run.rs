//! A run of a mission, and the run that a process has joined.

use crate::locks::lock;
use crate::{NetError, random};
use protocol::seal::{MissionKey, SealCheck};
use std::sync::{Arc, Mutex};
use std::time::Instant;

/// A run of a mission, by this process's clock.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Run {
    /// Its number, which enters the seal of every message.
    pub(crate) number: u64,
    pub(crate) start: Instant,
}

impl Run {
    /// A new run that begins now.
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

/// The run that a process has joined, with the seals that it accepts.
#[derive(Debug, Clone)]
pub(crate) struct RunJoined {
    run: Arc<Mutex<Option<Run>>>,
    pub(crate) check: Arc<Mutex<SealCheck>>,
}

impl RunJoined {
    /// No run yet, for a process that holds `key`.
    pub(crate) fn new(key: &MissionKey) -> Self {
        Self {
            run: Arc::default(),
            check: Arc::new(Mutex::new(SealCheck::new(key.clone()))),
        }
    }

    pub(crate) fn run(&self) -> Option<Run> {
        *lock(&self.run)
    }

    /// Joins `run`: the process publishes and receives in it from now on.
    pub(crate) fn join(&self, run: Run) {
        *lock(&self.run) = Some(run);
        lock(&self.check).only_run(run.number);
    }
}

/// Whether an agent belongs to the team: it flies, or its messages move vehicles. Others are observers.
pub(crate) fn is_of_team(agent: &str) -> bool {
    ["sc/", "ws/", "va/"]
        .iter()
        .any(|kind| agent.starts_with(kind))
}
