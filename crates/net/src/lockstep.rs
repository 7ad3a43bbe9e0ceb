//! Lockstep: a conductor sends tick *n*; messages stamped in tick *n* are handled in *n* + 1 in
//! the order of time, sender and sequence. An agent's `done` names the last sequence it wrote on
//! each key, the next tick carries the union, and an agent starts a tick only when it holds all
//! of these, since Zenoh keeps no order across publishers.

use crate::hosted::Hosted;
use crate::refusals::Refusals;
use crate::{Net, NetError, joining};
use protocol::message::{Done, LastSequences, Message, Tick};
use protocol::{Agent, AgentId, Envelope, Event, Interest, Outbox, ProtocolError, SimTime, Topic};
use std::collections::{BTreeMap, BTreeSet};

/// `done` of an agent that stands ready before the first tick.
pub const READY: i64 = -1;

/// Messages that came in and wait for the tick in which they are handled.
#[derive(Default)]
struct Inbox {
    waiting: Vec<(Topic, Envelope)>,
    held: BTreeMap<String, u64>,
}

impl Inbox {
    fn take_in(&mut self, topic: Topic, envelope: Envelope) {
        let held = self.held.entry(topic.path()).or_default();
        *held = (*held).max(envelope.sequence);
        self.waiting.push((topic, envelope));
    }

    fn holds(&self, expect: &LastSequences, interests: &[Interest]) -> bool {
        expect.iter().all(|(path, sequence)| {
            self.held.get(path).is_some_and(|held| held >= sequence)
                || !Topic::parse_path(path).is_ok_and(|t| interests.iter().any(|i| i.covers(&t)))
        })
    }

    /// What was said before `now`, in order.
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
    let hosted = Hosted::of(agents);
    net.tells_for(&hosted.ids);
    net.subscribe(&hosted.all).await?;
    net.subscribe(&[Interest::One(Topic::Tick)]).await?;
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
    net.wait_for(&others).await;
    joining::ask(net).await?;
    for id in &hosted.ids {
        say_done(net, id, SimTime::ZERO, READY, LastSequences::new()).await?;
    }
    let mut inbox = Inbox::default();
    let mut outbox = Outbox::default();
    let mut refusals = Refusals::default();
    loop {
        let tick = next_tick(net, &mut inbox, &hosted.all, &mut refusals).await?;
        let now = SimTime::of_tick(tick.tick, tick_ns);
        let said = inbox.before(now);
        let event = if tick.last { Event::Stop } else { Event::Tick };
        for (k, agent) in agents.iter_mut().enumerate() {
            let own = &hosted.ids[k];
            if k == 0 {
                // Garbage is told of, once a process, and otherwise does not exist.
                refusals.say(own, now, &mut outbox);
            }
            hosted.hand_out(k, agent, &said, now, &mut outbox);
            agent.handle(event, now, &mut outbox);
            let wrote = net.publish_all(own, now, &mut outbox).await?;
            say_done(net, own, now, tick.tick as i64, wrote).await?;
        }
        if tick.last {
            return Ok(());
        }
    }
}

/// Waits for the next tick and for all that it expects.
async fn next_tick(
    net: &mut Net,
    inbox: &mut Inbox,
    interests: &[Interest],
    refusals: &mut Refusals,
) -> Result<Tick, NetError> {
    let mut tick: Option<Tick> = None;
    loop {
        if let Some(tick) = tick.take_if(|t| inbox.holds(&t.expect, interests)) {
            return Ok(tick);
        }
        match net.receive().await {
            None => return Err(NetError::Closed),
            Some(Ok((
                Topic::Tick,
                Envelope {
                    message: Message::Tick(t),
                    ..
                },
            ))) => tick = Some(t),
            Some(Ok((topic, envelope))) => inbox.take_in(topic, envelope),
            Some(Err(e)) => refusals.add(e),
        }
    }
}

async fn say_done(
    net: &mut Net,
    own: &AgentId,
    now: SimTime,
    tick: i64,
    wrote: LastSequences,
) -> Result<(), NetError> {
    let topic = Topic::Done(own.clone());
    let message = Message::Done(Done { tick, wrote });
    // The clock's own traffic has numbers of its own: agents' sequences must not depend on it.
    let envelope = Envelope {
        sender: own.clone(),
        sequence: (tick + 2) as u64,
        time: now,
        message,
    };
    net.publish(&topic, &envelope).await
}

/// Follows a lockstep run of `team` as its recorder until its end: `take` is handed what was said
/// in each tick, in order.
///
/// # Errors
/// [`NetError`], or what `take` refuses.
pub async fn observe<E: From<NetError>>(
    net: &mut Net,
    team: &[AgentId],
    tick_ns: i64,
    mut take: impl FnMut(&[(Topic, Envelope)]) -> Result<(), E>,
) -> Result<(), E> {
    let own = AgentId::recorder();
    let interests = [Interest::Everything];
    net.subscribe(&interests).await?;
    let _presence = net.announce(&own).await?;
    // Who is seen has heard of the subscription above, so that nothing is missed.
    let others: Vec<AgentId> = team.iter().chain([&AgentId::clock()]).cloned().collect();
    net.wait_for(&others).await;
    joining::ask(net).await?;
    say_done(net, &own, SimTime::ZERO, READY, LastSequences::new()).await?;
    let mut inbox = Inbox::default();
    let mut ending = false;
    loop {
        // A recorder has nobody to tell of garbage; the agents it came to do.
        let tick = next_tick(net, &mut inbox, &interests, &mut Refusals::default()).await?;
        let now = SimTime::of_tick(tick.tick, tick_ns);
        take(&inbox.before(now))?;
        if ending {
            return Ok(());
        }
        ending = tick.last;
        say_done(net, &own, now, tick.tick as i64, LastSequences::new()).await?;
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
    /// Waits until all of `team` stand ready. The conductor hears everything, so that its owner
    /// can record the run.
    ///
    /// # Errors
    /// [`NetError`].
    pub async fn gather(net: &mut Net, team: &[AgentId], tick_ns: i64) -> Result<Self, NetError> {
        joining::open(net, || 0).await?;
        net.subscribe(&[Interest::Everything]).await?;
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
    }

    /// Number of the tick to come.
    pub fn next_tick(&self) -> u64 {
        self.tick
    }

    /// Simulated time of the tick to come.
    pub fn now(&self) -> SimTime {
        SimTime::of_tick(self.tick, self.tick_ns)
    }

    /// Runs one tick, the last one if `last`, and returns what was said in it, in order.
    ///
    /// # Errors
    /// [`NetError`], also when an agent of the team has gone.
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
        let envelope = Envelope {
            sender: AgentId::clock(),
            sequence: self.tick + 1,
            time: now,
            message: Message::Tick(tick),
        };
        net.publish(&Topic::Tick, &envelope).await?;
        self.all_done(net, self.tick as i64).await?;
        self.tick += 1;
        Ok(self.inbox.before(self.now()))
    }

    /// Tells a recorder what the last tick held, after all agents have gone.
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
        let envelope = Envelope {
            sender: AgentId::clock(),
            sequence: self.tick + 1,
            time: now,
            message,
        };
        net.publish(&Topic::Tick, &envelope).await
    }

    /// What was refused since the last call: garbage and foreign senders.
    pub fn refused(&mut self) -> Vec<ProtocolError> {
        std::mem::take(&mut self.refused)
    }

    async fn all_done(&mut self, net: &mut Net, tick: i64) -> Result<(), NetError> {
        let mut missing: BTreeSet<AgentId> = self.team.iter().cloned().collect();
        loop {
            if missing.is_empty() && self.inbox.holds(&self.expect, &[Interest::Everything]) {
                return Ok(());
            }
            let patience = std::time::Duration::from_secs(1);
            match tokio::time::timeout(patience, net.receive()).await {
                Err(_) if tick != READY => self.check_presence(net, &missing)?,
                Err(_) => {}
                Ok(None) => {
                    return Err(NetError::Closed);
                }
                Ok(Some(Ok((
                    Topic::Done(agent),
                    Envelope {
                        message: Message::Done(done),
                        ..
                    },
                )))) => {
                    if done.tick == tick && missing.remove(&agent) {
                        self.expect.extend(done.wrote);
                    }
                }
                Ok(Some(Ok((Topic::Tick, _)))) => {}
                Ok(Some(Ok((topic, envelope)))) => self.inbox.take_in(topic, envelope),
                Ok(Some(Err(e))) => self.refused.push(e),
            }
        }
    }

    fn check_presence(&self, net: &Net, missing: &BTreeSet<AgentId>) -> Result<(), NetError> {
        let peers = net.peers();
        match missing
            .iter()
            .find(|agent| !peers.contains(&agent.to_string()))
        {
            Some(gone) => Err(NetError::Gone {
                agent: gone.clone(),
                tick: self.tick,
            }),
            None => Ok(()),
        }
    }
}
