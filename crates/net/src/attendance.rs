//! Whether those who are waited for are still there. Presence ends at once with a process, but only after Zenoh's
//! lease, 10 s, with one that is stopped or cut off. So they are called: a call is answered by a thread of the bus,
//! however long the agent itself computes.

use crate::Net;
use crate::locks::lock;
use protocol::AgentId;
use std::collections::BTreeMap;
use std::sync::{Arc, Mutex};
use std::time::Duration;

/// Time between two calls while nothing comes.
pub(crate) const CALL_EVERY: Duration = Duration::from_secs(1);
/// Calls in a row without an answer after which somebody counts as gone. With the first call after a second of
/// silence this is 7 s: a busy host answers sooner, and the team has ended within 10 s.
const UNANSWERED: u32 = 5;

/// Calls that are not answered yet, by who was called. Calls and not time are counted: whoever was stopped himself
/// has heard nobody meanwhile.
#[derive(Default)]
pub(crate) struct Attendance(Arc<Mutex<BTreeMap<AgentId, u32>>>);

impl Attendance {
    /// Calls those who are waited for, and says who of them is gone: not present any more, or without an answer to
    /// the calls so far. To be called every [`CALL_EVERY`] while nothing comes.
    pub(crate) fn check<'a>(
        &self,
        net: &Net,
        waited_for: impl Iterator<Item = &'a AgentId>,
    ) -> Vec<AgentId> {
        let present = net.peers();
        let mut gone = Vec::new();
        for agent in waited_for {
            let unanswered = {
                let mut calls = lock(&self.0);
                let calls = calls.entry(agent.clone()).or_default();
                *calls += 1;
                *calls
            };
            if !present.contains(&agent.to_string()) || unanswered > UNANSWERED {
                gone.push(agent.clone());
                continue;
            }
            let (calls, called) = (Arc::clone(&self.0), agent.clone());
            let answer = net.call(agent);
            tokio::spawn(async move {
                if answer.await {
                    lock(&calls).remove(&called);
                }
            });
        }
        gone
    }
}
