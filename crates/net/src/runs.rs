//! One run per mission. A run has a number and a start time, set by its timekeeper (`sc`, or the conductor in
//! lockstep); a process stays in the run that it has joined. Agents state their run
//! in each answer to the [roll call](crate::presence). In real time these rules hold:
//!
//! 1. A timekeeper that starts searches for 2 s. If agents of the team fly in runs, it continues the oldest one: its
//!    number, time and phase.
//! 2. If it finds none, it offers a new run and continues to search. That run, and its time, begin when the
//!    first agent of the team joins. Until then the timekeeper continues any run that it finds, such as that of a
//!    team that was out of reach.
//! 3. A process does not join a run while it receives the team in another.
//! 4. If two runs have members nevertheless, as after a network was split, all processes of the younger one end with an
//!    error that names the other, after real vehicles have landed; restarted, they join the older run. Observers of a
//!    run without members end too.
//! 5. A process announces its regular end. The timekeeper ends when all others have, or have been silent for so long
//!    that they are no longer dialled.

use crate::NetError;
use crate::presence::Presence;
use crate::run::{Run, is_of_team};
use std::collections::BTreeMap;
use std::time::{Duration, Instant};

/// Difference of start times below which the run with the smaller number counts as older: each process measures
/// this difference over its own network path.
const ALIKE: Duration = Duration::from_secs(1);
/// Time for which two runs coexist before one ends: longer than a process takes to end.
const LASTS: Duration = Duration::from_secs(3);
/// Interval between two checks.
const LOOK_EVERY: Duration = Duration::from_secs(1);

/// A run that other processes have joined.
#[derive(Debug, Clone)]
pub(crate) struct FoundRun {
    pub(crate) run: Run,
    /// Agents of the team in it.
    pub(crate) members: Vec<String>,
    /// Number of messages of each of their processes, by process number.
    pub(crate) said: Vec<(u64, u64)>,
}

/// Whether `run` is older than `other`; processes of both runs agree on it.
fn is_older(run: Run, other: Run) -> bool {
    let apart = run.start.max(other.start) - run.start.min(other.start);
    match apart < ALIKE {
        true => run.number < other.number,
        false => run.start < other.start,
    }
}

impl Presence {
    /// The current runs of agents of the team, the oldest first.
    pub(crate) fn runs(&self) -> Vec<FoundRun> {
        let seen = self.seen();
        let here = seen.iter().filter(|(id, a)| is_of_team(id) && a.is_here());
        let mut found: BTreeMap<u64, FoundRun> = BTreeMap::new();
        for (id, agent) in here {
            let Some((last, run)) = agent.answered.as_ref().and_then(|a| Some((a, a.run?))) else {
                continue;
            };
            let known = found.entry(run.number).or_insert_with(|| FoundRun {
                run,
                members: Vec::new(),
                said: Vec::new(),
            });
            known.members.push(id.clone());
            known.said.push(last.said);
        }
        let mut runs: Vec<FoundRun> = found.into_values().collect();
        runs.sort_by_key(|found| found.run.start);
        runs
    }

    /// Agents of the team in other processes that are present and in no run.
    pub(crate) fn without_run(&self) -> Vec<String> {
        let seen = self.seen();
        let here = seen.iter().filter(|(id, a)| is_of_team(id) && a.is_here());
        let others = here.filter(|(_, agent)| {
            let last = agent.answered.as_ref();
            last.is_some_and(|last| last.run.is_none() && !self.is_own(last))
        });
        others.map(|(id, _)| id.clone()).collect()
    }

    /// The run for which this process ends, by rule 4.
    fn rival(&self) -> Option<FoundRun> {
        let own = self.run()?;
        let (of_own, others): (Vec<_>, Vec<_>) = self
            .runs()
            .into_iter()
            .partition(|found| found.run.number == own.number);
        let yields = |other: &FoundRun| of_own.is_empty() || is_older(other.run, own);
        others.into_iter().find(yields)
    }
}

/// Checks in real time whether this process has to end for another run, or all others have ended.
#[derive(Debug)]
pub struct OneRun {
    presence: Presence,
    next: Instant,
    since: Option<Instant>,
    others_ended: bool,
}

impl OneRun {
    /// Checks by the `presence` of a process.
    pub fn new(presence: Presence) -> Self {
        Self {
            presence,
            next: Instant::now(),
            since: None,
            others_ended: false,
        }
    }

    /// Checks, at most once a second.
    ///
    /// # Errors
    /// [`NetError::OtherRun`] if this process has to end.
    pub fn check(&mut self) -> Result<(), NetError> {
        let now = Instant::now();
        if now < self.next {
            return Ok(());
        }
        self.next = now + LOOK_EVERY;
        self.others_ended = self.presence.others_ended();
        let Some((other, own)) = self.presence.rival().zip(self.presence.run()) else {
            self.since = None;
            return Ok(());
        };
        if now - *self.since.get_or_insert(now) < LASTS {
            return Ok(());
        }
        let older = own.start.saturating_duration_since(other.run.start);
        Err(NetError::OtherRun {
            members: other.members.join(", "),
            older_s: older.as_secs(),
        })
    }

    /// Whether all other agents of the team in this run had ended at the last check, by rule 5; false if there
    /// were none.
    pub fn others_ended(&self) -> bool {
        self.others_ended
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn of_two_runs_both_sides_find_the_same_one_older() {
        let now = Instant::now();
        let run = |number, later_s: f64| Run {
            number,
            start: now + Duration::from_secs_f64(later_s),
        };
        for (one, other) in [
            (run(5, 0.0), run(2, 3.0)),
            (run(2, 0.4), run(5, 0.0)),
            (run(2, 0.0), run(5, 0.4)),
        ] {
            assert!(
                is_older(one, other) && !is_older(other, one),
                "{one:?} {other:?}"
            );
        }
    }
}
