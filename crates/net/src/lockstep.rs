//! Lockstep: a conductor sends tick *n*; messages stamped in tick *n* are handled in *n* + 1 in
//! the order of time, sender and sequence. An agent's `done` names the last sequence it wrote on
//! each key, the next tick carries the union, and an agent starts a tick only when it holds all
//! of these, since Zenoh keeps no order across publishers.
//!
//! No process continues without the others: if one is missing, or a message does not arrive, the run ends for
//! all within 10 s. The conductor names the missing process to the others and leaves; they end when it has left.

use crate::hosted::Hosted;
use crate::presence::CALL_EVERY;
use crate::refusals::Refusals;
use crate::run::Run;
use crate::{Net, NetError, joining};
use futures_core::future::BoxFuture;
use protocol::jobs::Arrival;
use protocol::message::{Done, LastSequences, Message, Severity, Tick};
use protocol::{Agent, AgentId, Envelope, Event, Interest, Outbox, ProtocolError, SimTime, Topic};
use std::collections::{BTreeMap, BTreeSet};
use std::time::{Duration, Instant};

/// Number of checks, [`CALL_EVERY`] apart, for which a message may be under way. It is not sent
/// again after a connection is lost.
const ON_ITS_WAY: u32 = 7;
/// Code of the conductor's event that names the missing process.
const MISSING: &str = "missing";
/// Time for that event to arrive before the conductor's connections close.
const LEAVE: Duration = Duration::from_millis(200);

/// `done` of an agent that is ready before the first tick.
pub const READY: i64 = -1;

/// Received messages that wait for their tick.
#[derive(Default)]
struct Inbox {
    waiting: Vec<(Topic, Envelope)>,
    held: BTreeMap<String, u64>,
    /// Number of the next tick, for error messages.
    next_tick: u64,
}

impl Inbox {
    fn take_in(&mut self, topic: Topic, envelope: Envelope) {
        let held = self.held.entry(topic.path()).or_default();
        *held = (*held).max(envelope.sequence);
        self.waiting.push((topic, envelope));
    }

    fn holds(&self, expect: &LastSequences, interests: &[Interest]) -> bool {
        self.lacks(expect, interests).is_none()
    }

    /// The first expected message that has not arrived.
    fn lacks(&self, expect: &LastSequences, interests: &[Interest]) -> Option<(String, u64)> {
        let lacking = expect.iter().find(|(path, sequence)| {
            self.held.get(*path).is_none_or(|held| held < *sequence)
                && Topic::parse_path(path).is_ok_and(|t| interests.iter().any(|i| i.covers(&t)))
        });
        lacking.map(|(path, sequence)| (path.clone(), *sequence))
    }

    /// Messages from before `now`, in order.
    fn before(&mut self, now: SimTime) -> Vec<(Topic, Envelope)> {
        let waiting = std::mem::take(&mut self.waiting);
        let (mut due, later) = waiting
            .into_iter()
            .partition::<Vec<_>, _>(|(_, e)| e.time < now);
        self.waiting = later;
        due.sort_by(|(_, a), (_, b)| a.order().cmp(&b.order()));
        due
    }
}

/// Runs the agents of this process in lockstep until the conductor's last tick. `team` are all
/// agents of the mission, these included; they start when all of them and the conductor are
/// present.
///
/// # Errors
/// [`NetError`].
pub async fn run<A: Agent>(
    net: &mut Net,
    agents: &mut [A],
    team: &[AgentId],
    tick_ns: i64,
) -> Result<(), NetError> {
    let mut hosted = Hosted::of(agents, Arrival::Fixed);
    net.tells_for(&hosted.ids);
    hosted.subscribe(net).await?;
    net.subscribe(&[Interest::One(Topic::Tick), of_conductor()])
        .await?;
    let mut presence = Vec::new();
    for id in &hosted.ids {
        presence.push(net.announce(id).await?);
    }
    let others: Vec<AgentId> = team
        .iter()
        .chain([&AgentId::clock()])
        .filter(|a| !hosted.ids.contains(a))
        .cloned()
        .collect();
    join(net, &others).await?;
    for id in &hosted.ids {
        add_done(net, id, SimTime::ZERO, READY, LastSequences::new()).await?;
    }
    net.flush().await?;
    let mut inbox = Inbox::default();
    let mut outbox = Outbox::default();
    let mut refusals = Refusals::default();
    loop {
        let tick = next_tick(net, &mut inbox, &hosted.all, &mut refusals).await?;
        let now = SimTime::of_tick(tick.tick, tick_ns);
        let said = inbox.before(now);
        let event = if tick.last { Event::Stop } else { Event::Tick };
        for (k, agent) in agents.iter_mut().enumerate() {
            if k == 0 {
                // Unreadable messages are reported once per process and ignored.
                refusals.say(agent.id(), now, &mut outbox);
            }
            hosted.hand_out(k, agent, &said, now, &mut outbox);
            hosted.act(k, agent, event, now, &mut outbox);
            let own = &hosted.ids[k];
            let wrote = net.publish_all(own, now, &mut outbox).await?;
            add_done(net, own, now, tick.tick as i64, wrote).await?;
        }
        net.flush().await?;
        if tick.last {
            return Ok(());
        }
    }
}

/// Waits until all of `others` are present, and asks the conductor for admission.
///
/// # Errors
/// [`NetError::Gone`] if the conductor leaves meanwhile.
async fn join(net: &Net, others: &[AgentId]) -> Result<(), NetError> {
    let (presence, conductor) = (net.presence(), AgentId::clock());
    let gone = async {
        while !presence.has_gone(&conductor) {
            tokio::time::sleep(CALL_EVERY).await;
        }
    };
    let joined = async {
        net.wait_for(others).await;
        joining::ask(net).await
    };
    tokio::select! {
        told = joined => told.map(drop),
        () = gone => Err(NetError::Gone { agents: vec![conductor.clone()], tick: 0 }),
    }
}

/// The conductor's messages apart from its ticks.
fn of_conductor() -> Interest {
    Interest::One(Topic::Event(AgentId::clock()))
}

/// Waits for the next tick and for all messages that it requires.
async fn next_tick(
    net: &mut Net,
    inbox: &mut Inbox,
    interests: &[Interest],
    refusals: &mut Refusals,
) -> Result<Tick, NetError> {
    let conductor = AgentId::clock();
    let mut wait = Wait::begin();
    let mut tick: Option<Tick> = None;
    loop {
        if let Some(tick) = tick.take_if(|t| inbox.holds(&t.expect, interests)) {
            return Ok(tick);
        }
        let Some(received) = wait.receive(net).await else {
            let number = tick.as_ref().map_or(inbox.next_tick, |t| t.tick);
            if is_missing(net, &conductor) {
                return Err(NetError::Gone {
                    agents: vec![conductor],
                    tick: number,
                });
            }
            if let Some(tick) = &tick {
                wait.check_lost(inbox, &tick.expect, interests, number)?;
            }
            continue;
        };
        match received {
            None => return Err(NetError::Closed),
            Some(Ok((
                Topic::Tick,
                Envelope {
                    message: Message::Tick(t),
                    ..
                },
            ))) => {
                inbox.next_tick = t.tick + 1;
                tick = Some(t);
            }
            Some(Ok((
                Topic::Event(sender),
                Envelope {
                    message: Message::Event(event),
                    ..
                },
            ))) if sender == conductor => {
                if event.code == MISSING {
                    return Err(missing_by(&event.text, inbox.next_tick));
                }
            }
            Some(Ok((topic, envelope))) => inbox.take_in(topic, envelope),
            Some(Err(e)) => refusals.add(e),
        }
    }
}

/// The missing processes that the conductor named.
fn missing_by(text: &str, tick: u64) -> NetError {
    let agents = text
        .split(", ")
        .filter_map(|name| AgentId::parse(name).ok());
    NetError::Gone {
        agents: agents.collect(),
        tick: tick.saturating_sub(1),
    }
}

/// Whether a process has left or does not answer.
fn is_missing(net: &Net, agent: &AgentId) -> bool {
    !net.presence().everybody().contains(&agent.to_string())
}

/// A wait for a process that may have left.
struct Wait {
    check_at: Instant,
    /// Checks at which a message had not arrived.
    lacking: u32,
}

impl Wait {
    fn begin() -> Self {
        Self {
            check_at: Instant::now() + CALL_EVERY,
            lacking: 0,
        }
    }

    /// The next message; none when a check of presence is due.
    async fn receive(&mut self, net: &mut Net) -> Option<Option<crate::Received>> {
        let now = Instant::now();
        // Also under a continuous stream of messages.
        if now < self.check_at
            && let Ok(received) = tokio::time::timeout_at(self.check_at.into(), net.receive()).await
        {
            return Some(received);
        }
        self.check_at = Instant::now() + CALL_EVERY;
        None
    }

    /// Whether an expected message is so late that it counts as lost.
    fn check_lost(
        &mut self,
        inbox: &Inbox,
        expect: &LastSequences,
        interests: &[Interest],
        tick: u64,
    ) -> Result<(), NetError> {
        let Some((path, sequence)) = inbox.lacks(expect, interests) else {
            return Ok(());
        };
        self.lacking += 1;
        if self.lacking < ON_ITS_WAY {
            return Ok(());
        }
        Err(NetError::Lost {
            path,
            sequence,
            tick,
        })
    }
}

async fn add_done(
    net: &mut Net,
    own: &AgentId,
    now: SimTime,
    tick: i64,
    wrote: LastSequences,
) -> Result<(), NetError> {
    let topic = Topic::Done(own.clone());
    let message = Message::Done(Done { tick, wrote });
    // The clock's messages are numbered apart: agents' sequence numbers must not depend on them.
    let envelope = Envelope::new(own.clone(), (tick + 2) as u64, now, message);
    net.add(&topic, &envelope).await
}

/// Records a lockstep run of `team` until its end: `take` receives the messages
/// of each tick, in order.
///
/// # Errors
/// [`NetError`], or an error of `take`.
pub async fn observe<E: From<NetError>>(
    net: &mut Net,
    team: &[AgentId],
    tick_ns: i64,
    mut take: impl FnMut(&[(Topic, Envelope)]) -> Result<(), E>,
) -> Result<(), E> {
    let own = AgentId::recorder();
    let interests = [Interest::Everything];
    net.subscribe_bundled(&interests).await?;
    let _presence = net.announce(&own).await?;
    // A present agent knows the subscription above, so no message is lost.
    let others: Vec<AgentId> = team.iter().chain([&AgentId::clock()]).cloned().collect();
    join(net, &others).await?;
    add_done(net, &own, SimTime::ZERO, READY, LastSequences::new()).await?;
    let mut inbox = Inbox::default();
    let mut ending = false;
    loop {
        // The receiving agents report unreadable messages; a recorder does not.
        let tick = next_tick(net, &mut inbox, &interests, &mut Refusals::default()).await?;
        let now = SimTime::of_tick(tick.tick, tick_ns);
        take(&inbox.before(now))?;
        if ending {
            return Ok(());
        }
        ending = tick.last;
        add_done(net, &own, now, tick.tick as i64, LastSequences::new()).await?;
    }
}

/// Conducts a lockstep run over the bus.
pub struct Conductor {
    team: Vec<AgentId>,
    tick: u64,
    tick_ns: i64,
    expect: LastSequences,
    inbox: Inbox,
    refused: Vec<ProtocolError>,
    _presence: zenoh::liveliness::LivelinessToken,
}

impl Conductor {
    /// Waits until all of `team` are ready. The conductor subscribes to everything, so that its owner
    /// can record the run.
    ///
    /// # Errors
    /// [`NetError`].
    pub fn gather<'a>(
        net: &'a mut Net,
        team: &'a [AgentId],
        tick_ns: i64,
    ) -> BoxFuture<'a, Result<Self, NetError>> {
        Box::pin(async move {
            joining::door(net).await?.begin(Run::begin()?);
            net.subscribe_bundled(&[Interest::Everything]).await?;
            let presence = net.announce(&AgentId::clock()).await?;
            let mut conductor = Self {
                team: team.to_vec(),
                tick: 0,
                tick_ns,
                expect: LastSequences::new(),
                inbox: Inbox::default(),
                refused: Vec::new(),
                _presence: presence,
            };
            conductor.all_done(net, READY).await?;
            Ok(conductor)
        })
    }

    /// Number of the next tick.
    pub fn next_tick(&self) -> u64 {
        self.tick
    }

    /// Simulated time of the next tick.
    pub fn now(&self) -> SimTime {
        SimTime::of_tick(self.tick, self.tick_ns)
    }

    /// Runs one tick, the last one if `last`, and returns its messages, in order.
    ///
    /// # Errors
    /// [`NetError`], also if an agent of the team has left.
    pub async fn step(
        &mut self,
        net: &mut Net,
        last: bool,
    ) -> Result<Vec<(Topic, Envelope)>, NetError> {
        let now = self.now();
        let tick = Tick {
            tick: self.tick,
            expect: std::mem::take(&mut self.expect),
            last,
        };
        let envelope = Envelope::new(AgentId::clock(), self.tick + 1, now, Message::Tick(tick));
        net.publish(&Topic::Tick, &envelope).await?;
        self.all_done(net, self.tick as i64).await?;
        self.tick += 1;
        Ok(self.inbox.before(self.now()))
    }

    /// Announces the messages of the last tick to a recorder, after all agents have left.
    ///
    /// # Errors
    /// [`NetError`].
    pub async fn close(self, net: &mut Net) -> Result<(), NetError> {
        let now = self.now();
        let tick = Tick {
            tick: self.tick,
            expect: self.expect,
            last: true,
        };
        let message = Message::Tick(tick);
        let envelope = Envelope::new(AgentId::clock(), self.tick + 1, now, message);
        net.publish(&Topic::Tick, &envelope).await
    }

    /// Messages rejected since the last call: unreadable ones and foreign senders.
    pub fn refused(&mut self) -> Vec<ProtocolError> {
        std::mem::take(&mut self.refused)
    }

    async fn all_done(&mut self, net: &mut Net, tick: i64) -> Result<(), NetError> {
        let mut missing: BTreeSet<AgentId> = self.team.iter().cloned().collect();
        let mut wait = Wait::begin();
        loop {
            if missing.is_empty() && self.inbox.holds(&self.expect, &[Interest::Everything]) {
                return Ok(());
            }
            let Some(received) = wait.receive(net).await else {
                // Before the first tick agents may come in any order, and late.
                if tick != READY {
                    self.check(net, &mut wait, &missing).await?;
                }
                continue;
            };
            match received {
                None => return Err(NetError::Closed),
                Some(Ok((
                    Topic::Done(agent),
                    Envelope {
                        message: Message::Done(done),
                        ..
                    },
                ))) => {
                    if done.tick == tick && missing.remove(&agent) {
                        self.expect.extend(done.wrote);
                    }
                }
                Some(Ok((Topic::Tick, _))) => {}
                Some(Ok((topic, envelope))) => self.inbox.take_in(topic, envelope),
                Some(Err(e)) => self.refused.push(e),
            }
        }
    }

    /// Checks that the awaited agents are present and their messages arrive; if not, notifies the others.
    async fn check(
        &self,
        net: &mut Net,
        wait: &mut Wait,
        missing: &BTreeSet<AgentId>,
    ) -> Result<(), NetError> {
        let missing = missing.iter().filter(|agent| is_missing(net, agent));
        let agents: Vec<AgentId> = missing.cloned().collect();
        if agents.is_empty() {
            let everything = [Interest::Everything];
            return wait.check_lost(&self.inbox, &self.expect, &everything, self.tick);
        }
        let envelope = Envelope::new(
            AgentId::clock(),
            self.tick + 2,
            self.now(),
            Message::event(Severity::Error, MISSING, crate::names(&agents)),
        );
        net.publish(&Topic::Event(AgentId::clock()), &envelope)
            .await?;
        tokio::time::sleep(LEAVE).await;
        Err(NetError::Gone {
            agents,
            tick: self.tick,
        })
    }
}
