//! The shape of an agent: a state machine without clock, socket or file.

use crate::envelope::Envelope;
use crate::key::{AgentId, Interest, Topic};
use crate::message::{EventMessage, Message, Severity};
use crate::time::SimTime;

/// What happens to an agent.
#[derive(Debug, Clone, Copy)]
pub enum Event<'a> {
    /// A message on a topic it is interested in.
    Message(&'a Topic, &'a Envelope),
    /// A tick: time has come to act. Messages of the tick before have been handed in.
    Tick,
    /// The run ends; last words may be said.
    Stop,
}

/// What an agent says in answer: messages to publish, in order.
#[derive(Debug, Default)]
pub struct Outbox {
    messages: Vec<(Topic, Message)>,
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
