//! Who is there: each agent shows itself by a liveliness token for as long as its process lives.

use crate::NetError;
use crate::locks::lock;
use protocol::AgentId;
use protocol::key::Name;
use std::collections::{BTreeMap, BTreeSet};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard};
use std::time::Instant;
use zenoh::sample::SampleKind;

/// Who is present on the bus, and who was.
#[derive(Debug, Clone)]
pub struct Presence {
    agents: Arc<Mutex<BTreeMap<String, Seen>>>,
    arrivals: Arc<AtomicU64>,
}

/// An agent that was seen.
#[derive(Debug, Clone, Copy)]
enum Seen {
    Here,
    GoneSince(Instant),
}

impl Presence {
    /// Watches the bus of `mission` for as long as `session` is open.
    pub(crate) async fn watch(session: &zenoh::Session, mission: &Name) -> Result<Self, NetError> {
        let presence = Self {
            agents: Arc::default(),
            arrivals: Arc::default(),
        };
        let seen = presence.clone();
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
                let is = match sample.kind() {
                    SampleKind::Put => {
                        seen.arrivals.fetch_add(1, Ordering::Relaxed);
                        Seen::Here
                    }
                    SampleKind::Delete => Seen::GoneSince(Instant::now()),
                };
                seen.seen().insert(agent.to_owned(), is);
            })
            .background()
            .await
            .map_err(NetError::zenoh)?;
        Ok(presence)
    }

    fn seen(&self) -> MutexGuard<'_, BTreeMap<String, Seen>> {
        lock(&self.agents)
    }

    /// How often somebody came, or came back.
    pub(crate) fn arrivals(&self) -> u64 {
        self.arrivals.load(Ordering::Relaxed)
    }

    /// Those who are present now, as `kind/name`.
    pub fn now(&self) -> BTreeSet<String> {
        let seen = self.seen();
        let here = seen.iter().filter(|(_, is)| matches!(is, Seen::Here));
        here.map(|(id, _)| id.clone()).collect()
    }

    /// Those who were present and are heard no more, and since when.
    pub fn gone(&self) -> Vec<(String, Instant)> {
        let seen = self.seen();
        let gone = seen.iter().filter_map(|(id, is)| match is {
            Seen::GoneSince(since) => Some((id.clone(), *since)),
            Seen::Here => None,
        });
        gone.collect()
    }
}

/// Where `agent` shows that it is there.
pub(crate) fn key(mission: &Name, agent: &AgentId) -> String {
    format!("plumage/{mission}/{agent}/alive")
}
