//! Computations that last longer than a tick: an agent hands one out and receives its result as an event, so that it
//! goes on publishing meanwhile. Without that, vehicles would count its silence and fly home.
//!
//! A [`Job`] is a pure function over a snapshot. The agent's host computes it on a thread. In virtual time and in
//! lockstep the [`JobResult`] arrives [`RESULT_AFTER_NS`] after the start, whatever the computation takes, so that all
//! ways of running give the same digest; in real time it arrives as soon as it is there.

use crate::agent::{Agent, Event, Outbox};
use crate::time::SimTime;
use std::any::Any;
use std::collections::VecDeque;
use std::sync::{Mutex, PoisonError};
use std::thread::{self, JoinHandle};

/// Simulated time from the start of a job to its result where runs are repeatable, ns: longer than nine in ten fits of a
/// mission take on two cores, so that a run paced by the wall clock seldom waits for one.
pub const RESULT_AFTER_NS: i64 = 5_000_000_000;

type Computed = Box<dyn Any + Send>;

/// A computation that an agent hands out.
pub struct Job(Box<dyn FnOnce() -> Computed + Send>);

impl Job {
    pub(crate) fn new<T: Any + Send>(compute: impl FnOnce() -> T + Send + 'static) -> Self {
        Self(Box::new(move || Box::new(compute())))
    }
}

impl std::fmt::Debug for Job {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("Job")
    }
}

/// What a job has computed.
#[derive(Debug)]
pub struct JobResult(Mutex<Option<Computed>>);

impl JobResult {
    /// Moves the result out, once; nothing where it is of another type.
    pub fn take<T: Any>(&self) -> Option<T> {
        let mut held = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        match held.take()?.downcast() {
            Ok(result) => Some(*result),
            Err(other) => {
                *held = Some(other);
                None
            }
        }
    }
}

/// When results arrive.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Arrival {
    /// [`RESULT_AFTER_NS`] after the start; the run waits for those that are not computed by then.
    Fixed,
    /// As soon as it is computed.
    WhenComputed,
}

struct Started {
    due: SimTime,
    thread: JoinHandle<Computed>,
}

/// The jobs of one agent that are being computed, in the order of their start.
#[derive(Default)]
pub struct Jobs(VecDeque<Started>);

impl Jobs {
    /// Hands `agent` the results that arrive at `now` and then `event`, a tick or the stop, and starts the jobs that it
    /// hands out. A stop waits for all results.
    pub fn run<A: Agent>(
        &mut self,
        agent: &mut A,
        arrival: Arrival,
        event: Event<'_>,
        now: SimTime,
        out: &mut Outbox,
    ) {
        while let Some(result) = self.next(arrival, event, now) {
            agent.handle(Event::Computed(&result), now, out);
        }
        agent.handle(event, now, out);
        for Job(compute) in out.take_jobs() {
            self.0.push_back(Started {
                due: now.later(RESULT_AFTER_NS),
                thread: thread::spawn(compute),
            });
        }
    }

    /// The next result that arrives; a panic of its computation goes on here.
    fn next(&mut self, arrival: Arrival, event: Event<'_>, now: SimTime) -> Option<JobResult> {
        let arrives = |first: &mut Started| match (event, arrival) {
            (Event::Stop, _) => true,
            (_, Arrival::Fixed) => now >= first.due,
            (_, Arrival::WhenComputed) => first.thread.is_finished(),
        };
        let first = self.0.pop_front_if(arrives)?;
        match first.thread.join() {
            Ok(computed) => Some(JobResult(Mutex::new(Some(computed)))),
            Err(panic) => std::panic::resume_unwind(panic),
        }
    }
}
