//! Real time: every agent ticks by its own wall clock. The process that keeps the mission's time
//! (the squadron controller's) answers queries for it; the others query it at their start and use
//! the answer with the shortest round trip (Cristian 1989), so hosts need no synchronised clocks.

use crate::hosted::Hosted;
use crate::refusals::Refusals;
use crate::{Net, NetError, OneRun, joining};
use futures_core::future::BoxFuture;
use protocol::jobs::Arrival;
use protocol::seal::SealFault;
use protocol::{Agent, AgentId, Envelope, Event, Interest, Outbox, ProtocolError, SimTime, Topic};
use std::time::{Duration, Instant};

/// The mission's time on this process's clock.
#[derive(Debug, Clone, Copy)]
pub struct MissionClock {
    start: Instant,
}

/// Number of queries for the time at the start.
const QUESTIONS: usize = 8;

/// Time for which a starting timekeeper searches for a run before it offers one, since the others dial it every second.
const LOOK_FOR: Duration = Duration::from_secs(2);
/// Time between the discovery of a run and its continuation: the processes that remember its state connect one by one.
const FOUND_FOR: Duration = Duration::from_millis(300);
const NS_PER_S: i64 = 1_000_000_000;
/// Interval of the search.
const LOOK_AGAIN: Duration = Duration::from_millis(50);

impl MissionClock {
    /// Keeps the mission's time while `net` is open, admits the others and answers their queries: in the run that flies
    /// already, or in a new one that begins when the first agent of the team joins.
    ///
    /// # Errors
    /// [`NetError`]; also if another process keeps the mission's time, or agents are present without a run.
    pub fn keep(net: &Net) -> BoxFuture<'_, Result<Self, NetError>> {
        Box::pin(async move {
            let door = joining::door(net).await?;
            let presence = net.presence();
            let begun = Instant::now();
            let mut found_at: Option<Instant> = None;
            loop {
                if let Some(taken) = presence.taken(&net.own_agents()) {
                    if begun.elapsed() > joining::LEASE {
                        return Err(NetError::Refused(format!("{taken} is on the bus already")));
                    }
                } else if let Some(found) = presence.runs().into_iter().next()
                    && found_at.get_or_insert_with(Instant::now).elapsed() >= FOUND_FOR
                {
                    let (members, age_s) =
                        (found.members.join(", "), found.run.age_ns() / NS_PER_S);
                    eprintln!("adopts the run of {members}, active for {age_s} s");
                    for said in found.said {
                        net.only_after(said);
                    }
                    door.begin(found.run);
                }
                if let Some(run) = door.begun() {
                    return Ok(Self { start: run.start });
                }
                if begun.elapsed() >= LOOK_FOR {
                    let without = presence.without_run();
                    if !without.is_empty() {
                        return Err(NetError::NoRun(without.join(", ")));
                    }
                    door.offer();
                }
                tokio::time::sleep(LOOK_AGAIN).await;
            }
        })
    }

    /// Queries the mission's timekeeper until it answers. The answer admits the process, which can publish from then on.
    ///
    /// # Errors
    /// [`NetError::Zenoh`]; [`NetError::Refused`] if it is not admitted.
    pub fn ask(net: &Net) -> BoxFuture<'_, Result<Self, NetError>> {
        Box::pin(async move {
            let mut best = joining::ask(net).await?;
            for _ in 1..QUESTIONS {
                let told = joining::ask(net).await?;
                if told.way < best.way {
                    best = told;
                }
            }
            Ok(Self {
                start: best.run(0).start,
            })
        })
    }

    /// The mission's time now.
    pub fn now(&self) -> SimTime {
        self.at(Instant::now())
    }

    /// The mission's time at an instant.
    pub fn at(&self, instant: Instant) -> SimTime {
        SimTime::from_ns(instant.saturating_duration_since(self.start).as_nanos() as i64)
    }

    /// The instant of a mission time.
    fn instant(&self, time: SimTime) -> Instant {
        self.start + Duration::from_nanos(time.ns().max(0) as u64)
    }
}

/// Surroundings of the agents of a process apart from the bus: links, displays, and the end of the run.
pub trait Surroundings<A> {
    /// Whether the run ends with the tick due at that time.
    fn ends(&mut self, due: SimTime, agents: &mut [A]) -> bool;

    /// Called for the `k`-th agent before each of its ticks.
    fn before_tick(&mut self, k: usize, agent: &mut A);

    /// Called for the `k`-th agent between its ticks: whether it has input, as over a MAVLink link,
    /// that needs an immediate tick.
    fn has_news(&mut self, k: usize, agent: &mut A) -> bool;
}

/// Two closures, for agents without input apart from the bus.
impl<A, E, B> Surroundings<A> for (E, B)
where
    E: FnMut(SimTime, &mut [A]) -> bool,
    B: FnMut(usize, &mut A),
{
    fn ends(&mut self, due: SimTime, agents: &mut [A]) -> bool {
        self.0(due, agents)
    }

    fn before_tick(&mut self, k: usize, agent: &mut A) {
        self.1(k, agent);
    }

    fn has_news(&mut self, _: usize, _: &mut A) -> bool {
        false
    }
}

/// Polling interval, ns: a tenth of the interval of a radio's frames at 20 a second, and four per
/// tick of 20 ms, so that a frame on its way to the bus waits 2.5 ms in the mean, not 10 ms.
const LOOK_NS: i64 = 5_000_000;

/// Shortest interval at which lasting messages are repeated for processes that joined later, s: a team starts one by one.
const SAY_AGAIN_S: f64 = 1.0;

/// Runs the agents of this process by the wall clock, ticking every `tick_ns`, until `around` ends it.
///
/// # Errors
/// [`NetError`].
pub async fn run<A: Agent>(
    net: &mut Net,
    agents: &mut [A],
    clock: MissionClock,
    tick_ns: i64,
    around: &mut impl Surroundings<A>,
) -> Result<(), NetError> {
    let mut hosted = Hosted::of(agents, Arrival::WhenComputed);
    net.tells_for(&hosted.ids);
    hosted.subscribe(net).await?;
    if let Some(speaker) = hosted.ids.first() {
        net.remember(speaker).await?;
    }
    let mut refusals = Refusals::default();
    let mut presence = Vec::new();
    for id in &hosted.ids {
        presence.push(net.announce(id).await?);
    }
    let mut outbox = Outbox::default();
    let looks = (tick_ns / LOOK_NS).max(1);
    let look_ns = tick_ns / looks;
    let mut look = clock.now().ns() / look_ns + 1;
    let mut ticks = look / looks - 1;
    let (mut arrivals, mut said_again) = (net.presence().arrivals(), clock.now());
    loop {
        let due = SimTime::from_ns(look * look_ns);
        tokio::time::sleep_until(clock.instant(due).into()).await;
        if look / looks > ticks {
            ticks = look / looks;
            if tick(
                net,
                agents,
                due,
                &mut hosted,
                &mut refusals,
                &mut outbox,
                around,
            )
            .await?
            {
                return Ok(());
            }
            if due.since_s(said_again) >= SAY_AGAIN_S && arrivals != net.presence().arrivals() {
                (arrivals, said_again) = (net.presence().arrivals(), due);
                for own in &hosted.ids {
                    net.say_again(own, due).await?;
                }
                net.flush().await?;
            }
        } else {
            for (k, agent) in agents.iter_mut().enumerate() {
                if around.has_news(k, agent) {
                    hosted.act(k, agent, Event::Tick, due, &mut outbox);
                    net.publish_all(&hosted.ids[k], due, &mut outbox).await?;
                }
            }
            net.flush().await?;
        }
        // A host that fell behind skips the missed ticks.
        look = (look + 1).max(clock.now().ns() / look_ns);
    }
}

/// One tick of all agents; true if it was the last.
async fn tick<A: Agent>(
    net: &mut Net,
    agents: &mut [A],
    due: SimTime,
    hosted: &mut Hosted,
    refusals: &mut Refusals,
    outbox: &mut Outbox,
    around: &mut impl Surroundings<A>,
) -> Result<bool, NetError> {
    let last = around.ends(due, agents);
    let event = if last { Event::Stop } else { Event::Tick };
    let said = take_in(net, due, refusals);
    net.remembered.take(&said);
    for (k, agent) in agents.iter_mut().enumerate() {
        if k == 0 {
            refusals.say(agent.id(), due, outbox);
        }
        hosted.hand_out(k, agent, &said, due, outbox);
        around.before_tick(k, agent);
        hosted.act(k, agent, event, due, outbox);
        net.publish_all(&hosted.ids[k], due, outbox).await?;
    }
    net.flush().await?;
    Ok(last)
}

/// Interval at which an observer passes on received messages.
const OBSERVED_EVERY: Duration = Duration::from_millis(100);
/// Time after the end for which an observer receives late messages.
const LAST_WORDS: Duration = Duration::from_secs(1);

/// Observes a real-time run until `until`: `take` receives the messages, ordered by time, sender
/// and sequence within a tenth of a second.
///
/// # Errors
/// [`NetError`], or an error of `take`.
pub async fn observe<E: From<NetError>>(
    net: &mut Net,
    clock: MissionClock,
    until: SimTime,
    mut take: impl FnMut(&[(Topic, Envelope)]) -> Result<(), E>,
) -> Result<(), E> {
    net.subscribe_bundled(&[Interest::Everything]).await?;
    let _presence = net.announce(&AgentId::recorder()).await?;
    let mut one_run = OneRun::new(net.presence());
    let end = clock.instant(until) + LAST_WORDS;
    loop {
        tokio::time::sleep(OBSERVED_EVERY).await;
        let mut heard: Vec<_> = std::iter::from_fn(|| net.try_receive()).flatten().collect();
        heard.sort_by(|(_, a), (_, b)| a.order().cmp(&b.order()));
        take(&heard)?;
        one_run.check()?;
        if Instant::now() >= end {
            return Ok(());
        }
    }
}

/// Age at which an operator's command expires, s: it may have been delayed, and a process that restarted since
/// cannot know whether it was executed already.
const OPERATOR_S: f64 = 10.0;

/// Messages received by `due`, in order; rejected ones go to `refusals`.
fn take_in(net: &mut Net, due: SimTime, refusals: &mut Refusals) -> Vec<(Topic, Envelope)> {
    let mut heard = Vec::new();
    while let Some(received) = net.try_receive() {
        match received {
            Ok((topic, said))
                if said.sender == AgentId::operator() && due.since_s(said.time) > OPERATOR_S =>
            {
                refusals.add(ProtocolError::Seal {
                    key: topic.path(),
                    fault: SealFault::Late,
                });
            }
            Ok(said) => heard.push(said),
            Err(e) => refusals.add(e),
        }
    }
    heard.sort_by(|(_, a), (_, b)| a.order().cmp(&b.order()));
    heard
}
