//! The last state of a mission, kept by its receivers for processes that restart: a process that lost its memory
//! queries the others.

use crate::asking::Reply;
use crate::locks::lock;
use crate::run::is_of_team;
use crate::{Net, NetError};
use futures_core::future::BoxFuture;
use protocol::{AgentId, Envelope, SimTime, Topic};
use std::collections::BTreeMap;
use std::sync::{Arc, Mutex};
use std::time::Duration;

/// Time limit for all answers: a stopped process gives none.
const ANSWER_WITHIN: Duration = Duration::from_secs(1);

/// The last message of each topic that describes the state of a mission.
#[derive(Debug, Clone, Default)]
pub(crate) struct Remembered(Arc<Mutex<BTreeMap<String, Envelope>>>);

impl Remembered {
    pub(crate) fn take(&self, said: &[(Topic, Envelope)]) {
        let mut last = lock(&self.0);
        for (topic, envelope) in said {
            // Messages that describe the mission's state without others.
            if matches!(topic, Topic::State(_) | Topic::Mode(_) | Topic::Plan) {
                last.insert(topic.path(), envelope.clone());
            }
        }
    }

    fn of(&self, path: &str) -> Option<Envelope> {
        let last = lock(&self.0);
        last.get(path).cloned()
    }
}

impl Net {
    /// Answers, as `agent`, the queries of processes that restart during the mission.
    ///
    /// # Errors
    /// [`NetError::Zenoh`].
    pub(crate) fn remember<'a>(
        &'a self,
        agent: &'a AgentId,
    ) -> BoxFuture<'a, Result<(), NetError>> {
        Box::pin(async move {
            let remembered = self.remembered.clone();
            let own = format!("{agent}/last/");
            let all = format!("{own}**");
            let last = move |asked: &str| {
                let (_, path) = asked.split_once("/last/")?;
                Some((format!("{own}{path}"), remembered.of(path)?.to_bytes()))
            };
            self.asking().answer(&all, last).await
        })
    }

    /// The last message on `topic` by `now` that an agent of the team remembers: a state, a mode or the plan. A later
    /// time belongs to another mission, and answers of observers do not count.
    ///
    /// # Errors
    /// [`NetError::Zenoh`].
    pub fn last<'a>(
        &'a self,
        topic: &'a Topic,
        now: SimTime,
    ) -> BoxFuture<'a, Result<Option<Envelope>, NetError>> {
        Box::pin(async move {
            let path = format!("*/*/last/{}", topic.path());
            let mut last: Option<Envelope> = None;
            let take = |reply: Reply| {
                let known = Envelope::from_bytes(topic, &reply.answer).ok();
                let known = known.filter(|e| e.time <= now && is_of_team(&reply.path));
                last = last.take().into_iter().chain(known).max_by_key(|e| e.time);
            };
            self.asking().ask(&path, ANSWER_WITHIN, take).await?;
            Ok(last)
        })
    }
}
