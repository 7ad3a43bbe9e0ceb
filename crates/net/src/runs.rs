//! One run per mission. A run is a number and a beginning, which the keeper of its time (`sc`, or the conductor in
//! lockstep) gives it; a process that has joined one stays in it for life. Agents tell the run that they are in
//! whenever the [roll](crate::presence) is called, and by that in real time:
//!
//! 1. A keeper that starts looks for 2 s. Where agents of the team fly in a run, it takes up the oldest of these: its
//!    number, its time, its phase.
//! 2. Where it has found nobody, it offers a new run and goes on looking. The run begins, and its time with it, when the
//!    first agent of the team joins. Until then the keeper takes up whatever run it meets: that of a team that its
//!    network or a pause had kept from it.
//! 3. Nobody joins a run while he hears the team in another.
//! 4. Where two runs have members nevertheless, as after hosts were apart, all processes of the younger one end with an
//!    error that names the other, once real vehicles are down; started again they join the older. So does who only
//!    looks on at a run that nobody is in any more.
//! 5. Who ends in good order says so. The keeper ends when all others have, or have been silent for so long that nobody
//!    dials them any more.

use crate::NetError;
use crate::presence::Presence;
use crate::run::{Run, is_of_team};
use std::collections::BTreeMap;
use std::time::{Duration, Instant};

/// Of runs that began at the same time but for this, the one with the smaller number counts as older: each process measures
/// the time between them over a network of its own.
const ALIKE: Duration = Duration::from_secs(1);
/// How long two runs have to be there at once before one ends: longer than a process takes to end.
const LASTS: Duration = Duration::from_secs(3);
/// Time between two looks.
const LOOK_EVERY: Duration = Duration::from_secs(1);

/// A run that others are in.
#[derive(Debug, Clone)]
pub(crate) struct FoundRun {
    pub(crate) run: Run,
    /// Agents of the team in it.
    pub(crate) members: Vec<String>,
    /// How often their processes have spoken, by their numbers.
    pub(crate) said: Vec<(u64, u64)>,
}

/// Whether `run` is older than `other`, as both their processes will find.
fn is_older(run: Run, other: Run) -> bool {
    let apart = run.start.max(other.start) - run.start.min(other.start);
    match apart < ALIKE {
        true => run.number < other.number,
        false => run.start < other.start,
    }
}

impl Presence {
    /// The runs that agents of the team are in now, the oldest first.
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

    /// Agents of the team of other processes that are here and in no run.
    pub(crate) fn without_run(&self) -> Vec<String> {
        let seen = self.seen();
        let here = seen.iter().filter(|(id, a)| is_of_team(id) && a.is_here());
        let others = here.filter(|(_, agent)| {
            let last = agent.answered.as_ref();
            last.is_some_and(|last| last.run.is_none() && !self.is_own(last))
        });
        others.map(|(id, _)| id.clone()).collect()
    }

    /// The run that makes this process's end, by rule 4.
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

/// Watches in real time whether another run makes this process's end, or all others have ended.
#[derive(Debug)]
pub struct OneRun {
    presence: Presence,
    next: Instant,
    since: Option<Instant>,
    others_ended: bool,
}

impl OneRun {
    /// For a process that knows of others by `presence`.
    pub fn new(presence: Presence) -> Self {
        Self {
            presence,
            next: Instant::now(),
            since: None,
            others_ended: false,
        }
    }

    /// Looks, once a second however often it is called.
    ///
    /// # Errors
    /// [`NetError::OtherRun`] where this process has to end.
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

    /// Whether all other agents of the team that were in this run had ended at the last look, by rule 5; not where there
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
