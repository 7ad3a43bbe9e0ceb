//! The in-memory bus: agents in one process under a conductor in virtual time.
//!
//! Tick by tick, every agent first handles what others said in the tick before, in the order of
//! time, sender and sequence, then acts. What is said in tick *n* is heard in tick *n* + 1, the
//! same rule that separate processes follow in lockstep.

use crate::ProtocolError;
use crate::agent::{Agent, Event, Outbox};
use crate::envelope::Envelope;
use crate::key::{AgentId, Interest, Topic};
use crate::message::Message;
use crate::time::SimTime;
use std::collections::BTreeMap;

/// One message that went over the bus.
pub type Publication = (Topic, Envelope);

/// What was said in a tick, by who wants to hear it: with a thousand vehicles nobody can look through all of it.
struct Routes<'a> {
    heard: &'a [Publication],
    /// Places in `heard` by topic …
    by_topic: BTreeMap<&'a Topic, Vec<usize>>,
    /// … and by interests of several topics.
    wide: Vec<(&'a Interest, Vec<usize>)>,
}

impl<'a> Routes<'a> {
    fn of(heard: &'a [Publication], wide: &'a [Interest]) -> Self {
        let mut by_topic: BTreeMap<&Topic, Vec<usize>> = BTreeMap::new();
        for (k, (topic, _)) in heard.iter().enumerate() {
            by_topic.entry(topic).or_default().push(k);
        }
        let covered = |interest: &Interest| {
            let all = heard.iter().enumerate();
            all.filter(|(_, (topic, _))| interest.covers(topic))
                .map(|(k, _)| k)
                .collect()
        };
        Self {
            heard,
            by_topic,
            wide: wide.iter().map(|i| (i, covered(i))).collect(),
        }
    }

    fn places(&self, interest: &Interest) -> &[usize] {
        let places = match interest {
            Interest::One(topic) => self.by_topic.get(topic),
            wide => self.wide.iter().find(|(i, _)| *i == wide).map(|(_, p)| p),
        };
        places.map_or(&[], Vec::as_slice)
    }

    /// What `interests` cover, each once, in the order in which it was said.
    fn wanted(&self, interests: &[Interest]) -> impl Iterator<Item = &'a Publication> + use<'a> {
        let mut places: Vec<usize> = interests
            .iter()
            .flat_map(|interest| self.places(interest))
            .copied()
            .collect();
        places.sort_unstable();
        places.dedup();
        let heard = self.heard;
        places.into_iter().map(move |k| &heard[k])
    }
}

struct Member<A> {
    agent: A,
    interests: Vec<Interest>,
    sequence: u64,
}

/// Agents under a conductor.
pub struct Conductor<A> {
    members: Vec<Member<A>>,
    /// The members' interests of several topics, each once.
    wide: Vec<Interest>,
    tick_ns: i64,
    tick: u64,
    /// Said in the last tick, in order.
    said: Vec<Publication>,
    outbox: Outbox,
    /// Said by the operator for the tick to come.
    operator: Vec<(Topic, Message)>,
    operator_sequence: u64,
}

impl<A: Agent> Conductor<A> {
    /// A conductor of `agents` with ticks of `tick_ns`. Agents are ordered by their id.
    pub fn new(agents: Vec<A>, tick_ns: i64) -> Self {
        let mut conductor = Self {
            members: Vec::new(),
            wide: Vec::new(),
            tick_ns,
            tick: 0,
            said: Vec::new(),
            outbox: Outbox::default(),
            operator: Vec::new(),
            operator_sequence: 0,
        };
        agents.into_iter().for_each(|agent| conductor.join(agent));
        conductor
    }

    /// Takes in one more agent; before the first tick, for whoever joins later has missed something.
    pub fn join(&mut self, agent: A) {
        let at = self.members.partition_point(|m| m.agent.id() <= agent.id());
        let member = Member {
            interests: agent.interests(),
            agent,
            sequence: 0,
        };
        for interest in &member.interests {
            if !matches!(interest, Interest::One(_)) && !self.wide.contains(interest) {
                self.wide.push(interest.clone());
            }
        }
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

    /// Lets the agents handle what was said last and say their last words.
    pub fn stop(&mut self) -> &[Publication] {
        self.run(Event::Stop)
    }

    fn run(&mut self, event: Event<'_>) -> &[Publication] {
        let now = self.now();
        let heard = std::mem::take(&mut self.said);
        let mut said = Vec::with_capacity(heard.len());
        // The operator's id comes before those of all agents.
        for (topic, message) in self.operator.drain(..) {
            self.operator_sequence += 1;
            let envelope = Envelope {
                sender: AgentId::operator(),
                sequence: self.operator_sequence,
                time: now,
                message,
            };
            said.push((topic, envelope));
        }
        let routes = Routes::of(&heard, &self.wide);
        for member in &mut self.members {
            let own = member.agent.id().clone();
            for (topic, envelope) in routes.wanted(&member.interests) {
                if envelope.sender != own {
                    member
                        .agent
                        .handle(Event::Message(topic, envelope), now, &mut self.outbox);
                }
            }
            member.agent.handle(event, now, &mut self.outbox);
            for (topic, message) in self.outbox.drain() {
                member.sequence += 1;
                let envelope = Envelope {
                    sender: own.clone(),
                    sequence: member.sequence,
                    time: now,
                    message,
                };
                said.push((topic, envelope));
            }
        }
        self.tick += 1;
        self.said = said;
        &self.said
    }
}
