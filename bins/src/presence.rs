//! Who is missing on the bus, said aloud: a wrong password, a wrong endpoint or a process that was
//! not started look alike from inside, as silence.

use crate::Failure;
use mission::{Setup, team};
use net::Net;
use std::collections::BTreeSet;
use std::time::Duration;
use tasks::loopback;
use tokio::task::JoinHandle;

/// How long others may take to appear before somebody is told.
const PATIENCE: Duration = Duration::from_secs(5);
/// How often those who are still missing are named.
const AGAIN: Duration = Duration::from_secs(15);
/// How often is looked.
const LOOK: Duration = Duration::from_millis(500);

/// Watches who is present besides `own` until it is aborted, and says who is missing.
///
/// # Errors
/// A vehicle's id that cannot be part of a key.
pub fn watch(
    net: &Net,
    setup: &Setup,
    own: &[String],
    connects_to: String,
) -> Result<JoinHandle<()>, Failure> {
    let team = team::agent_ids(setup).map_err(Failure::input)?;
    let others: BTreeSet<String> = team
        .iter()
        .map(ToString::to_string)
        .filter(|id| !own.contains(id))
        .collect();
    let presence = net.presence();
    let own = own.to_vec();
    Ok(tokio::spawn(async move {
        let mut known = BTreeSet::new();
        let mut told = false;
        let (mut wait, mut waited) = (PATIENCE, Duration::ZERO);
        loop {
            tokio::time::sleep(LOOK).await;
            waited += LOOK;
            let mut present = presence.now();
            present.retain(|id| !own.contains(id));
            if present != known {
                (wait, waited) = (PATIENCE, Duration::ZERO);
            }
            let missing: Vec<&str> = others.difference(&present).map(String::as_str).collect();
            if missing.is_empty() && told {
                told = false;
                eprintln!("the team is complete");
            } else if waited >= wait && !missing.is_empty() {
                (wait, waited, told) = (AGAIN, Duration::ZERO, true);
                eprintln!("warning: {}", words(&present, &missing, &connects_to));
            }
            known = present;
        }
    }))
}

fn words(present: &BTreeSet<String>, missing: &[&str], connects_to: &str) -> String {
    if !present.is_empty() || connects_to.is_empty() {
        return format!("missing in the team: {}", missing.join(", "));
    }
    format!(
        "no connection to anybody of the mission at {connects_to} yet, waiting: is sc running there, \
         and do --user, PLUMAGE_PASSWORD and the TLS files match its own?"
    )
}

/// Why peers on other hosts cannot reach this process, if that can be told from its endpoints.
pub fn unreachable(listen: &[String], connect: &[String]) -> Option<String> {
    let afar = connect
        .iter()
        .find(|endpoint| !loopback::is_endpoint(endpoint))?;
    let hidden = listen
        .iter()
        .all(|endpoint| loopback::is_endpoint(endpoint));
    hidden.then(|| {
        format!(
            "this process connects to {afar} but listens on loopback only, and peers do not relay: \
             those that are neither on this host nor at that endpoint will not hear it; expected \
             --listen with an address of this host, such as tcp/192.0.2.2:0"
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn endpoints_that_others_cannot_reach_are_told() {
        let all = |list: &[&str]| list.iter().map(ToString::to_string).collect::<Vec<_>>();
        let told =
            |listen: &[&str], connect: &[&str]| unreachable(&all(listen), &all(connect)).is_some();
        assert!(told(&[], &["tcp/192.0.2.1:7447"]));
        assert!(told(&["tls/localhost:0"], &["tls/[2001:db8::1]:7447"]));
        assert!(!told(&["tcp/192.0.2.2:0"], &["tcp/192.0.2.1:7447"]));
        assert!(!told(&[], &["tcp/127.0.0.1:7447"]) && !told(&[], &[]));
    }
}
