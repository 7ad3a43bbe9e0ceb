//! Restores the state of an agent whose process restarts during a mission in real time.

use crate::Failure;
use mission::swap::LastHeard;
use mission::{Member, Setup};
use net::Net;
use protocol::key::AgentKind;
use protocol::{Agent as _, Message, SimTime, Topic};

/// Restores `member` at `now` from the memory of others, and reports it; does nothing without an answer.
///
/// # Errors
/// A vehicle that is lost, or a bus that fails.
pub async fn resume(
    net: &Net,
    setup: &Setup,
    member: &mut Member,
    now: SimTime,
) -> Result<(), Failure> {
    let id = member.id().clone();
    let mut heard = LastHeard::default();
    match id.kind() {
        AgentKind::Va => {
            let name = id.name().clone();
            if let Some(last) = net.last(&Topic::State(name.clone()), now).await?
                && let Message::State(state) = last.message
            {
                heard.state = Some((last.time, state));
            }
            if let Some(last) = net.last(&Topic::Mode(name), now).await?
                && let Message::Mode(mode) = last.message
            {
                heard.level = Some(mode.level);
            }
        }
        AgentKind::Sc => {
            if let Some(last) = net.last(&Topic::Plan, now).await?
                && let Message::Plan(plan) = last.message
            {
                heard.phase = Some(plan.phase);
            }
        }
        _ => return Ok(()),
    }
    if let Some(words) = member.resume(setup, &heard, now)? {
        eprintln!("{id} {words}");
    }
    Ok(())
}
