//! The shape of an agent: a state machine without clock, socket or file.

use crate::envelope::Envelope;
use crate::jobs::{Job, JobResult};
use crate::key::{AgentId, Interest, Topic};
use crate::message::{EventMessage, Message, Severity};
use crate::time::SimTime;
use std::any::Any;

/// What happens to an agent.
#[derive(Debug, Clone, Copy)]
pub enum Event<'a> {
    /// A message on a topic it is interested in.
    Message(&'a Topic, &'a Envelope),
    /// The result of a job that it handed out.
    Computed(&'a JobResult),
    /// A tick: time has come to act. Messages of the tick before have been handed in.
    Tick,
    /// The run ends; last words may be said.
    Stop,
}

/// What an agent says in answer: messages to publish, in order, and jobs to compute.
#[derive(Debug, Default)]
pub struct Outbox {
    messages: Vec<(Topic, Message)>,
    jobs: Vec<Job>,
}

impl Outbox {
    /// Says `message` on `topic`.
    pub fn say(&mut self, topic: Topic, message: Message) {
        self.messages.push((topic, message));
    }

    /// Says on the own event topic of `agent` what happened.
    pub fn event(
        &mut self,
        agent: &AgentId,
        severity: Severity,
        code: &str,
        text: impl Into<String>,
    ) {
        self.say(
            Topic::Event(agent.clone()),
            Message::Event(EventMessage::new(severity, code, text)),
        );
    }

    /// Has `compute` computed beside the ticks; its result comes back as [`Event::Computed`].
    pub fn compute<T: Any + Send>(&mut self, compute: impl FnOnce() -> T + Send + 'static) {
        self.jobs.push(Job::new(compute));
    }

    pub(crate) fn take_jobs(&mut self) -> Vec<Job> {
        std::mem::take(&mut self.jobs)
    }

    /// Takes all that was said.
    pub fn drain(&mut self) -> std::vec::Drain<'_, (Topic, Message)> {
        self.messages.drain(..)
    }

    /// What was said so far.
    pub fn messages(&self) -> &[(Topic, Message)] {
        &self.messages
    }
}

/// An agent: `handle(event, now)` answers into `out`. It keeps no time of its own.
pub trait Agent {
    /// Who it is.
    fn id(&self) -> &AgentId;

    /// What it wants to hear. Asked once, before the start.
    fn interests(&self) -> Vec<Interest>;

    /// Handles `event` at the simulated time `now`; what it says goes to `out`.
    fn handle(&mut self, event: Event<'_>, now: SimTime, out: &mut Outbox);
}
