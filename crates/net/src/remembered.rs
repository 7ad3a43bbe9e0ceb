//! What was last said of where a mission stands, and what time it is, kept by those who hear it for those who start
//! again: whoever lost his memory with his process asks the others.

use crate::locks::lock;
use crate::{Net, NetError};
use futures_core::future::BoxFuture;
use protocol::{Envelope, Topic};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

/// How long others have to answer, all of them: who is stopped does not.
const ANSWER_WITHIN: Duration = Duration::from_secs(1);
/// The same for the time, which who keeps it cannot do without for long: vehicles come home 5 s after his last word.
const TIME_WITHIN: Duration = Duration::from_millis(300);

/// The last message of each topic that says where a mission stands.
#[derive(Debug, Clone, Default)]
pub(crate) struct Remembered(Arc<Mutex<BTreeMap<String, Envelope>>>);

impl Remembered {
    pub(crate) fn take(&self, said: &[(Topic, Envelope)]) {
        let mut last = lock(&self.0);
        for (topic, envelope) in said {
            // What says by itself where the mission stands.
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

/// A run that goes on, as one of its processes knows it.
#[derive(Debug, Serialize, Deserialize)]
pub(crate) struct Running {
    /// The mission's time, ns.
    now_ns: i64,
    /// Its number, with which all that is said is sealed.
    pub(crate) run: u64,
    /// The number of the process that answers, and how often it has spoken.
    pub(crate) said: (u64, u64),
}

impl Net {
    /// Answers those who start again in the middle of the mission that began at `start`.
    ///
    /// # Errors
    /// [`NetError::Zenoh`].
    pub(crate) fn remember(&self, start: Instant) -> BoxFuture<'_, Result<(), NetError>> {
        Box::pin(async move {
            let remembered = self.remembered.clone();
            let last = move |path: &str| {
                let last = remembered.of(path.strip_prefix("last/")?)?;
                Some(last.to_bytes())
            };
            self.asking().answer("last/**", last).await?;
            let (run, sealer) = (self.run()?, self.sealer());
            let running = move |_: &str| {
                let said = lock(&sealer).so_far();
                let now_ns = i64::try_from(start.elapsed().as_nanos()).ok()?;
                serde_json::to_vec(&Running { now_ns, run, said }).ok()
            };
            self.asking().answer("running", running).await
        })
    }

    /// The last word on `topic` that anybody present remembers: a state, a mode or the plan.
    ///
    /// # Errors
    /// [`NetError::Zenoh`].
    pub fn last<'a>(
        &'a self,
        topic: &'a Topic,
    ) -> BoxFuture<'a, Result<Option<Envelope>, NetError>> {
        Box::pin(async move {
            let path = format!("last/{}", topic.path());
            let answers = self.asking().ask(&path, ANSWER_WITHIN).await?;
            let read = |(bytes, _): (Vec<u8>, _)| Envelope::from_bytes(topic, &bytes).ok();
            Ok(answers.into_iter().filter_map(read).max_by_key(|e| e.time))
        })
    }

    /// What others know of the run that they are in, when it began by that, and how long the answer took to come.
    ///
    /// # Errors
    /// [`NetError::Zenoh`].
    pub(crate) async fn running(&self) -> Result<Vec<(Running, Instant, Duration)>, NetError> {
        let asked = Instant::now();
        let answers = self.asking().ask("running", TIME_WITHIN).await?;
        let read = |(bytes, way): (Vec<u8>, Duration)| {
            let running: Running = serde_json::from_slice(&bytes).ok()?;
            let since = Duration::from_nanos(running.now_ns.max(0).unsigned_abs());
            Some((running, (asked + way / 2).checked_sub(since)?, way))
        };
        Ok(answers.into_iter().filter_map(read).collect())
    }
}
