//! The in-memory bus: agents in one process under a conductor in virtual time.
//!
//! Tick by tick, every agent first handles what others said in the tick before, in the order of
//! time, sender and sequence, then acts. What is said in tick *n* is heard in tick *n* + 1, the
//! same rule that separate processes follow in lockstep.

use crate::ProtocolError;
use crate::agent::{Agent, Event, Outbox};
use crate::envelope::Envelope;
use crate::jobs::{Arrival, Jobs};
use crate::key::{AgentId, Interest, Topic};
use crate::message::Message;
use crate::time::SimTime;
use rayon::prelude::*;
use std::collections::BTreeMap;
use std::sync::Arc;

/// One message that went over the bus.
pub type Publication = (Topic, Envelope);

/// Index of subscriptions by topic: with a thousand vehicles no agent can filter all messages.
#[derive(Default)]
struct Routes {
    /// Places of members by topic …
    one: BTreeMap<Topic, Vec<usize>>,
    /// … and by interests of several topics.
    wide: Vec<(Interest, Vec<usize>)>,
}

impl Routes {
    fn of<A: Agent>(members: &[Member<A>]) -> Self {
        let mut routes = Self::default();
        for (place, member) in members.iter().enumerate() {
            for interest in member.agent.interests() {
                let to = match interest {
                    Interest::One(topic) => routes.one.entry(topic).or_default(),
                    wide => {
                        let known = routes.wide.iter().position(|(of, _)| *of == wide);
                        let at = known.unwrap_or_else(|| {
                            routes.wide.push((wide, Vec::new()));
                            routes.wide.len() - 1
                        });
                        &mut routes.wide[at].1
                    }
                };
                to.push(place);
            }
        }
        routes
    }

    /// Places of the members who want to hear `topic`, some perhaps twice.
    fn to(&self, topic: &Topic) -> impl Iterator<Item = usize> {
        let one = self.one.get(topic).into_iter().flatten();
        let wide = self.wide.iter().filter(|(of, _)| of.covers(topic));
        one.chain(wide.flat_map(|(_, to)| to)).copied()
    }
}

struct Member<A> {
    agent: A,
    sequence: u64,
    /// Places in what was said of what it hears, in order.
    hears: Vec<usize>,
    outbox: Outbox,
    jobs: Jobs,
    /// What it says in this tick.
    says: Vec<Publication>,
}

impl<A: Agent> Member<A> {
    /// Hears what it wants of all that was said, and acts.
    fn act(&mut self, said: &[Publication], event: Event<'_>, arrival: Arrival, now: SimTime) {
        for &k in &self.hears {
            let (topic, envelope) = &said[k];
            if envelope.sender != *self.agent.id() {
                let event = Event::Message(topic, envelope);
                self.agent.handle(event, now, &mut self.outbox);
            }
        }
        self.hears.clear();
        self.jobs
            .run(&mut self.agent, arrival, event, now, &mut self.outbox);
        for (topic, message) in self.outbox.drain() {
            self.sequence += 1;
            let envelope = Envelope::new(self.agent.id().clone(), self.sequence, now, message);
            self.says.push((topic, envelope));
        }
    }
}

/// Members that a thread takes at a time: a tick of so many vehicles takes longer than to wake a thread, some 50 µs.
const MEMBERS_AT_A_TIME: usize = 32;

/// Lets all members act; where they are many and work is shared, on as many threads as there are processors. Nobody
/// receives in a tick what is published in it, so the result does not depend on who acts first.
fn all_act<A: Agent + Send>(
    members: &mut [Member<A>],
    said: &[Publication],
    event: Event<'_>,
    arrival: Arrival,
    now: SimTime,
    shares_work: bool,
) {
    let act = |members: &mut [Member<A>]| {
        for member in members {
            member.act(said, event, arrival, now);
        }
    };
    if !shares_work || members.len() < 2 * MEMBERS_AT_A_TIME {
        return act(members);
    }
    // The first is `sc/main` and the last `ws/main`, which have most to do: each begins at once, and alone.
    let (first, others) = members.split_at_mut(1);
    let (vehicles, last) = others.split_at_mut(others.len() - 1);
    let vehicles = vehicles.par_chunks_mut(MEMBERS_AT_A_TIME).with_max_len(1);
    rayon::join(
        || act(first),
        || rayon::join(|| act(last), || vehicles.for_each(act)),
    );
}

/// Agents under a conductor.
pub struct Conductor<A> {
    members: Vec<Member<A>>,
    /// From the first tick on.
    routes: Option<Routes>,
    tick_ns: i64,
    tick: u64,
    /// Said in the last tick, in order.
    said: Arc<Vec<Publication>>,
    /// Said by the operator for the tick to come.
    operator: Vec<(Topic, Message)>,
    operator_sequence: u64,
    arrival: Arrival,
    shares_work: bool,
}

impl<A: Agent + Send> Conductor<A> {
    /// A conductor of `agents` with ticks of `tick_ns`. Agents are ordered by their id.
    pub fn new(agents: Vec<A>, tick_ns: i64) -> Self {
        let mut conductor = Self {
            members: Vec::new(),
            routes: None,
            tick_ns,
            tick: 0,
            said: Arc::default(),
            operator: Vec::new(),
            operator_sequence: 0,
            arrival: Arrival::Fixed,
            shares_work: true,
        };
        agents.into_iter().for_each(|agent| conductor.join(agent));
        conductor
    }

    /// The same that waits for no job: for a run by the wall clock with real vehicles, which cannot be repeated anyway.
    #[must_use]
    pub fn in_real_time(self) -> Self {
        Self {
            arrival: Arrival::WhenComputed,
            ..self
        }
    }

    /// The same on the caller's thread alone: for a run beside others that have the other processors.
    #[must_use]
    pub fn on_one_thread(self) -> Self {
        Self {
            shares_work: false,
            ..self
        }
    }

    /// Whether it uses as many threads as there are processors.
    pub fn shares_work(&self) -> bool {
        self.shares_work
    }

    /// Adds an agent. Call it before the first tick: a later one has missed messages.
    pub fn join(&mut self, agent: A) {
        let at = self.members.partition_point(|m| m.agent.id() <= agent.id());
        let member = Member {
            agent,
            sequence: 0,
            hears: Vec::new(),
            outbox: Outbox::default(),
            jobs: Jobs::default(),
            says: Vec::new(),
        };
        self.routes = None;
        self.members.insert(at, member);
    }

    /// Number of the tick to come.
    pub fn next_tick(&self) -> u64 {
        self.tick
    }

    /// Simulated time of the tick to come.
    pub fn now(&self) -> SimTime {
        SimTime::of_tick(self.tick, self.tick_ns)
    }

    /// The agents, ordered by id.
    pub fn agents(&self) -> impl Iterator<Item = &A> {
        self.members.iter().map(|m| &m.agent)
    }

    /// The agents, ordered by id, for what is not a bus (a MAVLink link, a display).
    pub fn agents_mut(&mut self) -> impl Iterator<Item = &mut A> {
        self.members.iter_mut().map(|m| &mut m.agent)
    }

    /// The operator says `message` on `topic` in the tick to come.
    ///
    /// # Errors
    /// A message that is not the operator's to say there.
    pub fn operate(&mut self, topic: Topic, message: Message) -> Result<(), ProtocolError> {
        message.check(&topic, &AgentId::operator())?;
        self.operator.push((topic, message));
        Ok(())
    }

    /// Runs one tick and returns what was said in it, in the order of time, sender, sequence.
    pub fn step(&mut self) -> &[Publication] {
        self.run(Event::Tick)
    }

    /// What was said in the last tick, to keep beyond the next.
    pub fn said(&self) -> &Arc<Vec<Publication>> {
        &self.said
    }

    /// Lets the agents handle what was said last and say their last words.
    pub fn stop(&mut self) -> &[Publication] {
        self.run(Event::Stop)
    }

    fn run(&mut self, event: Event<'_>) -> &[Publication] {
        let now = self.now();
        let heard = std::mem::take(&mut self.said);
        let heard = heard.as_slice();
        let mut said = Vec::with_capacity(heard.len());
        // The operator's id comes before those of all agents.
        for (topic, message) in self.operator.drain(..) {
            self.operator_sequence += 1;
            let envelope = Envelope::new(AgentId::operator(), self.operator_sequence, now, message);
            said.push((topic, envelope));
        }
        let routes = self.routes.get_or_insert_with(|| Routes::of(&self.members));
        for (k, (topic, _)) in heard.iter().enumerate() {
            for place in routes.to(topic) {
                let hears = &mut self.members[place].hears;
                if hears.last() != Some(&k) {
                    hears.push(k);
                }
            }
        }
        all_act(
            &mut self.members,
            heard,
            event,
            self.arrival,
            now,
            self.shares_work,
        );
        for member in &mut self.members {
            said.append(&mut member.says);
        }
        self.tick += 1;
        self.said = Arc::new(said);
        &self.said
    }
}
