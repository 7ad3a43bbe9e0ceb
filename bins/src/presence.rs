//! Reports of agents that are missing on the bus: a wrong password, a wrong endpoint and a process that was
//! not started have the same symptom, silence.

use crate::Failure;
use mission::{Setup, team};
use net::Net;
use protocol::message::Severity;
use protocol::text::printable;
use protocol::{AgentId, SimTime};
use std::collections::{BTreeMap, BTreeSet};
use std::time::Duration;
use tasks::loopback;
use tokio::task::JoinHandle;

/// Time after which missing processes are reported.
const PATIENCE: Duration = Duration::from_secs(5);
/// Interval at which missing agents are reported again.
const AGAIN: Duration = Duration::from_secs(15);
/// Said once by a process whose team has left, as a bridge does that waits for a landing after the mission.
const ALONE: &str = "all other processes of the team have ended, or are out of reach";
/// How often is looked.
const LOOK: Duration = Duration::from_millis(500);

/// Watches who is present besides `own` until it is aborted, and says who is missing, in lockstep the conductor too.
///
/// # Errors
/// A vehicle's id that cannot be part of a key.
pub fn watch(
    net: &Net,
    setup: &Setup,
    own: &[String],
    connects_to: String,
    lockstep: bool,
) -> Result<JoinHandle<()>, Failure> {
    let mut team = team::agent_ids(setup).map_err(Failure::input)?;
    if lockstep {
        team.push(AgentId::clock());
    }
    let others: BTreeSet<String> = team
        .iter()
        .map(ToString::to_string)
        .filter(|id| !own.contains(id))
        .collect();
    let presence = net.presence();
    let own = own.to_vec();
    Ok(tokio::spawn(async move {
        let mut known = BTreeSet::new();
        let (mut told, mut met) = (false, false);
        let (mut wait, mut waited) = (PATIENCE, Duration::ZERO);
        loop {
            tokio::time::sleep(LOOK).await;
            waited += LOOK;
            let mut present = presence.now();
            present.retain(|id| !own.contains(id));
            met |= !present.is_empty();
            if present != known {
                (wait, waited) = (PATIENCE, Duration::ZERO);
            }
            let missing: Vec<&str> = others.difference(&present).map(String::as_str).collect();
            // Agents in other runs do not receive the team's messages.
            if missing.is_empty() && told && presence.is_one_run(&others) {
                told = false;
                eprintln!("the team is complete");
            } else if waited >= wait && !missing.is_empty() {
                let alone = met && present.is_empty();
                if !(alone && told) {
                    let words = match alone {
                        true => ALONE.to_owned(),
                        false => words(&present, &missing, &connects_to),
                    };
                    eprintln!("warning: {}", printable(&words));
                }
                (wait, waited, told) = (AGAIN, Duration::ZERO, true);
            }
            known = present;
        }
    }))
}

fn words(present: &BTreeSet<String>, missing: &[&str], connects_to: &str) -> String {
    if !present.is_empty() || connects_to.is_empty() {
        return format!("missing processes of the team: {}", missing.join(", "));
    }
    format!(
        "waiting: no process of the mission answers at {connects_to}; check that sc runs there, and that --user, \
         PLUMAGE_PASSWORD and the TLS files match its own"
    )
}

/// An agent of the team that has left or returned.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Change {
    /// How much it matters.
    pub severity: Severity,
    /// The code of its event.
    pub code: &'static str,
    /// In words.
    pub text: String,
}

/// Who of a team is there and since when somebody is not, for those who keep or show it.
#[derive(Debug)]
pub struct RollCall {
    team: BTreeSet<String>,
    begun: Option<SimTime>,
    /// Start of the absence of an expected agent.
    missing: BTreeMap<String, SimTime>,
    came: BTreeSet<String>,
    until: SimTime,
}

impl RollCall {
    /// That of a mission's team.
    ///
    /// # Errors
    /// A vehicle's id that cannot be part of a key.
    pub fn of(setup: &Setup) -> Result<Self, Failure> {
        let team = team::agent_ids(setup).map_err(Failure::input)?;
        Ok(Self {
            team: team.iter().map(ToString::to_string).collect(),
            begun: None,
            missing: BTreeMap::new(),
            came: BTreeSet::new(),
            until: SimTime::from_s(setup.scenario.mission.duration_s),
        })
    }

    /// Takes in who is present at mission time `now`, and says what has changed; `last_heard` tells when somebody answered
    /// last, for a loss is noticed seconds later. At the mission's end all go.
    pub fn call(
        &mut self,
        present: &BTreeSet<String>,
        last_heard: impl Fn(&str) -> Option<SimTime>,
        now: SimTime,
    ) -> Vec<Change> {
        if now >= self.until {
            return Vec::new();
        }
        let begun = *self.begun.get_or_insert(now);
        let patience_over = now.since_s(begun) >= PATIENCE.as_secs_f64();
        let mut changes = Vec::new();
        for id in &self.team {
            if present.contains(id) {
                self.came.insert(id.clone());
                if let Some(since) = self.missing.remove(id) {
                    changes.push(Change {
                        severity: Severity::Info,
                        code: "heard-again",
                        text: format!("{id} is back after {:.0} s", now.since_s(since)),
                    });
                }
                continue;
            }
            let came = self.came.contains(id);
            if self.missing.contains_key(id) || !(came || patience_over) {
                continue;
            }
            let since = match came {
                true => last_heard(id).unwrap_or(now),
                false => begun,
            };
            self.missing.insert(id.clone(), since);
            changes.push(Change {
                severity: Severity::Warning,
                code: "missing",
                text: format!(
                    "{id} is missing: no heartbeat since {:.0} s of mission time",
                    since.s()
                ),
            });
        }
        changes
    }
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
            "this process connects to {afar} but listens on loopback only; processes on other hosts cannot connect to it, \
             since peers do not relay messages; expected --listen with an address of this host, such as tcp/192.0.2.2:0"
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn who_goes_and_comes_back_is_told_once_each_with_the_time() {
        let all = |list: &[&str]| list.iter().map(ToString::to_string).collect();
        let mut roll = RollCall {
            team: all(&["sc/main", "va/1", "va/2"]),
            begun: None,
            missing: BTreeMap::new(),
            came: BTreeSet::new(),
            until: SimTime::from_s(100.0),
        };
        // Noticed 8 s after they were heard last.
        let mut told = |present: &[&str], s: f64| {
            let last_heard = |_: &str| Some(SimTime::from_s(s - 8.0));
            let changes = roll.call(&all(present), last_heard, SimTime::from_s(s));
            changes.into_iter().map(|c| c.text).collect::<Vec<_>>()
        };
        let none: [&str; 0] = [];
        assert_eq!(told(&["sc/main", "va/1"], 10.0), none);
        // An agent that was never present has some time to appear.
        assert_eq!(
            told(&["sc/main", "va/1"], 15.0),
            ["va/2 is missing: no heartbeat since 10 s of mission time"]
        );
        assert_eq!(
            told(&["sc/main"], 40.0),
            ["va/1 is missing: no heartbeat since 32 s of mission time"]
        );
        assert_eq!(told(&["sc/main"], 41.0), none);
        assert_eq!(
            told(&["sc/main", "va/1", "va/2"], 60.0),
            ["va/1 is back after 28 s", "va/2 is back after 50 s"]
        );
        assert_eq!(told(&[], 100.0), none, "the mission is over");
    }

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
