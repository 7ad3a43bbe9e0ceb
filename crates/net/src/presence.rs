//! Who is there: each agent shows itself by a liveliness token for as long as its process lives.

use crate::NetError;
use protocol::AgentId;
use protocol::key::Name;
use std::collections::BTreeSet;
use std::sync::{Arc, Mutex, PoisonError};
use zenoh::sample::SampleKind;

/// Who is present on the bus.
#[derive(Debug, Clone)]
pub struct Presence(Arc<Mutex<BTreeSet<String>>>);

impl Presence {
    /// Watches the bus of `mission` for as long as `session` is open.
    pub(crate) async fn watch(session: &zenoh::Session, mission: &Name) -> Result<Self, NetError> {
        let presence = Self(Arc::default());
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
                let mut seen = seen.0.lock().unwrap_or_else(PoisonError::into_inner);
                match sample.kind() {
                    SampleKind::Put => seen.insert(agent.to_owned()),
                    SampleKind::Delete => seen.remove(agent),
                };
            })
            .background()
            .await
            .map_err(NetError::zenoh)?;
        Ok(presence)
    }

    /// Those who are present now, as `kind/name`.
    pub fn now(&self) -> BTreeSet<String> {
        self.0
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
            .clone()
    }
}

/// Where `agent` shows that it is there.
pub(crate) fn key(mission: &Name, agent: &AgentId) -> String {
    format!("plumage/{mission}/{agent}/alive")
}
