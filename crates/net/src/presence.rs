//! Who is there, and in which run.
//!
//! Each agent shows a liveliness token for as long as its process lives. Anybody may declare one, so it is a hint and no
//! proof: the roll is called when a token comes or goes and once a second, with a random question that only the
//! holder of the mission's key can answer, on a key that access control lets the agent's host alone answer. A
//! thread of its own answers calls, however long the agent itself computes.
//!
//! An agent is present while its token is there and it answers. It is missing since its last answer.

use crate::NetError;
use crate::asking::{Asking, Reply};
use crate::locks::lock;
use crate::run::{Run, RunJoined, is_of_team};
use protocol::AgentId;
use protocol::joining::RollEntry;
use protocol::key::Name;
use std::collections::{BTreeMap, BTreeSet};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard};
use std::time::{Duration, Instant};
use tokio::sync::Notify;
use tokio::task::JoinHandle;
use zenoh::sample::SampleKind;

/// Time between two calls of the roll.
pub(crate) const CALL_EVERY: Duration = Duration::from_secs(1);
/// Least time between two calls: tokens come by the dozen when a team starts.
pub(crate) const CALL_AGAIN: Duration = Duration::from_millis(50);
/// Calls in a row without an answer after which somebody counts as gone: 6 s, in which a busy host answers. Calls and
/// not time are counted: whoever was stopped himself has heard nobody meanwhile.
const UNANSWERED: u32 = 5;
/// A call that is made so late does not count: where a thread waits so long for a processor, dozens of others share it, and
/// those who have to answer wait as well.
const LATE: Duration = Duration::from_millis(100);
/// Of calls in a row that are late one in so many counts: who is gone is found out within half a minute all the same.
const LATE_COUNT: u32 = 5;
/// How long an answer may take: as long as its agent is not yet gone without it.
const ANSWER_WITHIN: Duration = Duration::from_secs(UNANSWERED as u64 + 1);
/// Every agent's answer to the call.
const ROLL: &str = "*/*/call";

/// Who is present on the bus, and who was.
#[derive(Debug, Clone)]
pub struct Presence {
    agents: Arc<Mutex<BTreeMap<String, Seen>>>,
    arrivals: Arc<AtomicU64>,
    joined: RunJoined,
    /// The number of this process among those that speak.
    stream: u64,
}

/// An agent of which a token was seen.
#[derive(Debug, Clone, Default)]
pub(crate) struct Seen {
    has_token: bool,
    unanswered: u32,
    /// Its last answer; none before the first: somebody else may have declared the token.
    pub(crate) answered: Option<Answered>,
}

/// What an agent answered.
#[derive(Debug, Clone)]
pub(crate) struct Answered {
    /// When it was asked.
    pub(crate) at: Instant,
    /// The run that it is in, by this process's clock.
    pub(crate) run: Option<Run>,
    /// How long the answer that told so took.
    way: Duration,
    /// The number of its process, and how often it has spoken.
    pub(crate) said: (u64, u64),
    pub(crate) ended: bool,
}

impl Seen {
    pub(crate) fn is_here(&self) -> bool {
        let answers = self.answered.as_ref().is_some_and(|last| !last.ended);
        self.has_token && answers && self.unanswered <= UNANSWERED
    }

    fn take(&mut self, entry: &RollEntry, asked: Instant, way: Duration) {
        let said = entry.run.map(|run| {
            let age = Duration::from_nanos(run.age_ns.max(0).unsigned_abs());
            let told = asked + way / 2;
            Run {
                number: run.number,
                start: told.checked_sub(age).unwrap_or(told),
            }
        });
        // The answer that was shortest on its way says best when a run began.
        let known = self.answered.as_ref().filter(|before| {
            before.way < way && before.run.map(|r| r.number) == said.map(|r| r.number)
        });
        let (run, way) = known.map_or((said, way), |before| (before.run, before.way));
        // An earlier call may have taken longer.
        let before = self.answered.as_ref().map(|before| before.at);
        self.unanswered = 0;
        self.answered = Some(Answered {
            at: before.map_or(asked, |before| before.max(asked)),
            run,
            way,
            said: (entry.stream, entry.number),
            ended: entry.ended,
        });
    }
}

/// Calls the roll until it is dropped.
#[derive(Debug)]
pub(crate) struct Roll(JoinHandle<()>);

impl Drop for Roll {
    fn drop(&mut self) {
        self.0.abort();
    }
}

impl Presence {
    /// Watches the bus of `mission` for as long as `session` is open, from the process with that run and number.
    pub(crate) async fn watch(
        session: &zenoh::Session,
        mission: &Name,
        asking: Asking,
        (joined, stream): (RunJoined, u64),
    ) -> Result<(Self, Roll), NetError> {
        let presence = Self {
            agents: Arc::default(),
            arrivals: Arc::default(),
            joined,
            stream,
        };
        let news = Arc::new(Notify::new());
        let (seen, told) = (presence.clone(), Arc::clone(&news));
        let prefix = format!("plumage/{mission}/");
        session
            .liveliness()
            .declare_subscriber(format!("{prefix}*/*/alive"))
            .history(true)
            .callback(move |sample| {
                let key = sample.key_expr().as_str();
                let agent = key
                    .strip_prefix(&prefix)
                    .and_then(|k| k.strip_suffix("/alive"));
                let Some(agent) = agent else { return };
                let mut agents = seen.seen();
                let agent = agents.entry(agent.to_owned()).or_default();
                let had_token = agent.has_token;
                agent.has_token = sample.kind() == SampleKind::Put;
                if agent.has_token && !had_token {
                    // Who comes back has to answer first.
                    agent.unanswered = UNANSWERED + 1;
                }
                told.notify_one();
            })
            .background()
            .await
            .map_err(NetError::zenoh)?;
        let roll = tokio::spawn(presence.clone().call_the_roll(asking, news));
        Ok((presence, Roll(roll)))
    }

    async fn call_the_roll(self, asking: Asking, news: Arc<Notify>) {
        let mut next = tokio::time::Instant::now();
        let mut late: u32 = 0;
        loop {
            tokio::select! {
                () = tokio::time::sleep_until(next) => {
                    late = if next.elapsed() > LATE { late + 1 } else { 0 };
                    next = tokio::time::Instant::now() + CALL_EVERY;
                    if late.is_multiple_of(LATE_COUNT) {
                        for agent in self.seen().values_mut() {
                            agent.unanswered = agent.unanswered.saturating_add(1);
                        }
                    }
                }
                () = news.notified() => tokio::time::sleep(CALL_AGAIN).await,
            }
            let (presence, asking) = (self.clone(), asking.clone());
            tokio::spawn(async move {
                let take = |reply| presence.take(&reply);
                // Whoever cannot be asked now is asked again.
                let _ = asking.ask(ROLL, ANSWER_WITHIN, take).await;
            });
        }
    }

    fn take(&self, reply: &Reply) {
        let agent = reply.path.strip_suffix("/call").unwrap_or_default();
        let entry = serde_json::from_slice::<RollEntry>(&reply.answer);
        let Some(entry) = entry.ok().filter(|entry| entry.agent == agent) else {
            return;
        };
        let mut agents = self.seen();
        let seen = agents.entry(entry.agent.clone()).or_default();
        let was_here = seen.is_here();
        seen.take(&entry, reply.asked, reply.way);
        if !was_here && seen.is_here() {
            self.arrivals.fetch_add(1, Ordering::Relaxed);
        }
    }

    pub(crate) fn seen(&self) -> MutexGuard<'_, BTreeMap<String, Seen>> {
        lock(&self.agents)
    }

    /// Whether this process itself has answered.
    pub(crate) fn is_own(&self, answered: &Answered) -> bool {
        answered.said.0 == self.stream
    }

    /// The run that this process is in.
    pub(crate) fn run(&self) -> Option<Run> {
        self.joined.run()
    }

    /// How often somebody came, or came back.
    pub(crate) fn arrivals(&self) -> u64 {
        self.arrivals.load(Ordering::Relaxed)
    }

    /// How many processes host those who are present now, this one among them.
    pub(crate) fn processes(&self) -> usize {
        let seen = self.seen();
        let here = seen.values().filter(|agent| agent.is_here());
        let hosts = here.filter_map(|agent| Some(agent.answered.as_ref()?.said.0));
        hosts.chain([self.stream]).collect::<BTreeSet<u64>>().len()
    }

    /// Those who are present now, as `kind/name`, in whatever run.
    pub(crate) fn everybody(&self) -> BTreeSet<String> {
        let seen = self.seen();
        let here = seen.iter().filter(|(_, agent)| agent.is_here());
        here.map(|(id, _)| id.clone()).collect()
    }

    /// Those who are present now, as `kind/name`, but for those who are in another run than this process: neither
    /// takes in what the other says.
    pub fn now(&self) -> BTreeSet<String> {
        let own = self.run().map(|run| run.number);
        let seen = self.seen();
        let of_run = |agent: &Seen| {
            let run = agent.answered.as_ref().and_then(|last| last.run);
            run.zip(own).is_none_or(|(run, own)| run.number == own)
        };
        let here = seen.iter().filter(|(_, a)| a.is_here() && of_run(a));
        here.map(|(id, _)| id.clone()).collect()
    }

    /// Whether all of `agents` are in the run of this process.
    pub fn is_one_run<'a>(&self, agents: impl IntoIterator<Item = &'a String>) -> bool {
        let Some(own) = self.run() else { return false };
        let seen = self.seen();
        let in_it = |id: &String| {
            let answered = seen.get(id).and_then(|agent| agent.answered.as_ref());
            answered.is_some_and(|last| last.run.is_some_and(|run| run.number == own.number))
        };
        agents.into_iter().all(in_it)
    }

    /// Those who were present and are heard no more, and when they answered last.
    pub fn gone(&self) -> Vec<(String, Instant)> {
        let seen = self.seen();
        let gone = seen.iter().filter(|(_, agent)| !agent.is_here());
        gone.filter_map(|(id, agent)| Some((id.clone(), agent.answered.as_ref()?.at)))
            .collect()
    }

    /// When somebody answered last; none before he did.
    pub fn last_heard(&self, agent: &str) -> Option<Instant> {
        let seen = self.seen();
        let answered = seen.get(agent)?.answered.as_ref();
        answered.map(|last| last.at)
    }

    /// The first of `agents` that another process hosts.
    pub(crate) fn taken(&self, agents: &[String]) -> Option<String> {
        let seen = self.seen();
        let is_taken = |id: &&String| {
            let agent = seen.get(*id).filter(|agent| agent.is_here());
            let answered = agent.and_then(|agent| agent.answered.as_ref());
            answered.is_some_and(|last| !self.is_own(last))
        };
        agents.iter().find(is_taken).cloned()
    }

    /// Whether somebody was here and is not any more.
    pub(crate) fn has_gone(&self, agent: &AgentId) -> bool {
        let seen = self.seen();
        let agent = seen.get(&agent.to_string());
        agent.is_some_and(|agent| agent.answered.is_some() && !agent.is_here())
    }

    /// Whether all agents of the team that were in this process's run, besides its own, have ended; not where there were
    /// none.
    pub(crate) fn others_ended(&self) -> bool {
        let Some(run) = self.run() else { return false };
        let seen = self.seen();
        let members = seen.iter().filter_map(|(id, agent)| {
            let last = agent.answered.as_ref()?;
            let others = is_of_team(id) && !self.is_own(last);
            (others && last.run?.number == run.number).then_some((agent, last))
        });
        let mut ended = members.map(|(agent, last)| {
            let forgotten = !agent.is_here() && last.at.elapsed() > crate::reach::FORGET_AFTER;
            last.ended || forgotten
        });
        ended
            .next()
            .is_some_and(|first| first && ended.all(|is| is))
    }
}

/// Where `agent` shows that it is there.
pub(crate) fn key(mission: &Name, agent: &AgentId) -> String {
    format!("plumage/{mission}/{agent}/alive")
}
