//! The agents of one process and their subscriptions.

use crate::{Net, NetError};
use protocol::jobs::{Arrival, Jobs};
use protocol::{Agent, AgentId, Envelope, Event, Interest, Outbox, SimTime, Topic};

/// A process with more vehicles than this subscribes to the messages for all: each key expression costs
/// all other processes some work per message on the bus.
const MANY: usize = 8;

/// The agents that one process hosts on one session.
pub(crate) struct Hosted {
    pub(crate) ids: Vec<AgentId>,
    interests: Vec<Vec<Interest>>,
    jobs: Vec<Jobs>,
    arrival: Arrival,
    /// The interests of all agents, each once.
    pub(crate) all: Vec<Interest>,
}

impl Hosted {
    /// Hosts `agents`; the results of their jobs arrive as `arrival` states.
    pub(crate) fn of<A: Agent>(agents: &[A], arrival: Arrival) -> Self {
        let interests: Vec<Vec<Interest>> = agents.iter().map(Agent::interests).collect();
        let mut all: Vec<Interest> = Vec::new();
        for interest in interests.iter().flatten() {
            let wide = match interest {
                Interest::One(topic) if agents.len() > MANY && topic.vehicle().is_some() => {
                    Interest::OfAny(topic.clone())
                }
                interest => interest.clone(),
            };
            if !all.iter().any(|known| covers(known, &wide)) {
                all.push(wide);
            }
        }
        Self {
            ids: agents.iter().map(|a| a.id().clone()).collect(),
            interests,
            jobs: agents.iter().map(|_| Jobs::default()).collect(),
            arrival,
            all,
        }
    }

    /// Subscribes to what its agents are interested in: in bundles where that is many vehicles' messages.
    pub(crate) async fn subscribe(&self, net: &mut Net) -> Result<(), NetError> {
        let one = |interest: &Interest| matches!(interest, Interest::One(_));
        if self.all.iter().all(one) {
            net.subscribe(&self.all).await
        } else {
            net.subscribe_bundled(&self.all).await
        }
    }

    /// Lets the `k`-th agent handle a tick or the stop, with its jobs.
    pub(crate) fn act<A: Agent>(
        &mut self,
        k: usize,
        agent: &mut A,
        event: Event<'_>,
        now: SimTime,
        outbox: &mut Outbox,
    ) {
        self.jobs[k].run(agent, self.arrival, event, now, outbox);
    }

    /// Passes a message to the `k`-th agent if it is interested.
    pub(crate) fn hand_out<A: Agent>(
        &self,
        k: usize,
        agent: &mut A,
        said: &[(Topic, Envelope)],
        now: SimTime,
        outbox: &mut Outbox,
    ) {
        for (topic, envelope) in said {
            let wanted = self.interests[k].iter().any(|i| i.covers(topic));
            if wanted && envelope.sender != self.ids[k] {
                agent.handle(Event::Message(topic, envelope), now, outbox);
            }
        }
    }
}

/// Whether a subscription covers an interest already.
fn covers(known: &Interest, wanted: &Interest) -> bool {
    match (known, wanted) {
        (Interest::OfAny(_), Interest::OfAny(topic)) => known.covers(topic),
        (known, wanted) => known == wanted,
    }
}
