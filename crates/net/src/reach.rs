//! Broken connections are made again, between any two processes of a mission.
//!
//! Zenoh dials again only those endpoints that a process was told to connect to. Peers that met by gossip stay apart
//! for good once their connection breaks (eclipse-zenoh/zenoh#2806), and gossip does not help: it is said once, when
//! often one of the two has not noticed yet that the old connection is gone. So each process says where it is reached
//! for as long as it lives, as a liveliness token, remembers where others are reached, and dials whom it does not
//! hear any more. What it never heard itself, as after a first dial that failed, it asks the others for.
//!
//! A process that still holds the old connection takes the new one for a second link of it if it opened the old one
//! itself, and does not say again what it hears and where it is: the other stays deaf to it for good (Zenoh 1.10). It
//! refuses the new one, and so notices the loss first, if the other opened the old one too. So between two it is always
//! the same who dials: not he to whom the others were told to connect, and else he with the greater id. The other, who
//! alone may be able to reach him, dials now and then where it was never he who was reached.

use crate::asking::{Asking, Reply};
use crate::locks::lock;
use crate::{Figures, NetError};
use protocol::key::Name;
use protocol::seal::MissionKey;
use std::collections::BTreeMap;
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};
use tokio::task::JoinHandle;
use zenoh::config::{Locator, ZenohId};
use zenoh::internal::runtime::Runtime;
use zenoh::sample::SampleKind;

/// Time between two attempts to reach somebody, however long he is gone: once his network is back he is to be heard.
const DIAL_EVERY: Duration = Duration::from_secs(1);
/// Somebody who was not reached for this long is forgotten.
pub(crate) const FORGET_AFTER: Duration = Duration::from_secs(600);
/// Attempts of the one with the greater id to one of the other's.
const OTHER_EVERY: u64 = 7;
/// After its start, and after a loss, a process asks for this long whom the others know.
const ASK_FOR: Duration = Duration::from_secs(30);
/// Attempts to reach somebody between two questions.
const ASK_EVERY: u64 = 2;
/// Time to answer such a question.
const ANSWER_WITHIN: Duration = Duration::from_secs(2);

/// Where a process is reached, and whether it is heard.
#[derive(Debug, Clone)]
struct Known {
    locators: Vec<Locator>,
    /// Since when it has not been heard; none while it is.
    lost: Option<Instant>,
    dialling: bool,
    opener: Opener,
}

/// Who opened the connection with another process, as far as that is known.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Opener {
    Nobody,
    This,
    Other,
}

impl Known {
    fn new(lost: Option<Instant>) -> Self {
        Self {
            locators: Vec::new(),
            lost,
            dialling: false,
            opener: Opener::Nobody,
        }
    }
}

/// Somebody to dial.
#[derive(Debug, Clone)]
struct Due {
    zid: String,
    locators: Vec<Locator>,
    opener: Opener,
}

/// The processes of a mission that this one knows, by their Zenoh id as text.
#[derive(Debug, Default)]
struct Peers {
    known: BTreeMap<String, Known>,
    restless_until: Option<Instant>,
}

impl Peers {
    fn heard(&mut self, zid: &str, locator: Locator) {
        let known = self.known.entry(zid.to_owned());
        let known = known.or_insert_with(|| Known::new(None));
        known.lost = None;
        if known.opener == Opener::Nobody {
            known.opener = Opener::Other;
        }
        if !known.locators.contains(&locator) {
            known.locators.push(locator);
        }
    }

    fn lost(&mut self, zid: &str) {
        if let Some(known) = self.known.get_mut(zid) {
            known.lost.get_or_insert_with(Instant::now);
        }
        self.ask_again();
    }

    fn ask_again(&mut self) {
        self.restless_until = Some(Instant::now() + ASK_FOR);
    }

    /// Learns from another process of one that is not known.
    fn learn(&mut self, zid: &str, locator: Locator) {
        let known = self.known.entry(zid.to_owned());
        let known = known.or_insert_with(|| Known::new(Some(Instant::now())));
        if known.lost.is_some() && !known.locators.contains(&locator) {
            known.locators.push(locator);
        }
    }

    /// Those who are heard, a line each: id, space, locator.
    fn list(&self) -> String {
        let mut list = String::new();
        for (zid, known) in self.known.iter().filter(|(_, k)| k.lost.is_none()) {
            for locator in &known.locators {
                list += &format!("{zid} {locator}\n");
            }
        }
        list
    }

    /// Whom to dial.
    fn due(&mut self) -> Vec<Due> {
        let age = |known: &Known| known.lost.map_or(Duration::ZERO, |since| since.elapsed());
        self.known.retain(|_, known| age(known) < FORGET_AFTER);
        let mut due = Vec::new();
        for (zid, known) in &mut self.known {
            if known.lost.is_some() && !known.dialling {
                known.dialling = true;
                due.push(Due {
                    zid: zid.clone(),
                    locators: known.locators.clone(),
                    opener: known.opener,
                });
            }
        }
        due
    }

    /// This process is about to open a connection to another.
    fn opening(&mut self, zid: &str) {
        if let Some(known) = self.known.get_mut(zid) {
            known.opener = Opener::This;
        }
    }

    /// A dial has ended; before it the `opener` was that. Whom it did not reach it opened nothing to.
    fn dialled(&mut self, zid: &str, reached: bool, opener: Opener) {
        if let Some(known) = self.known.get_mut(zid) {
            known.dialling = false;
            if !reached && known.lost.is_some() {
                known.opener = opener;
            }
        }
    }

    /// Whom to ask next for those that he knows.
    fn to_ask(&self, round: u64) -> Option<String> {
        self.restless_until
            .filter(|until| Instant::now() < *until)?;
        let heard: Vec<&String> = self
            .known
            .iter()
            .filter(|(_, known)| known.lost.is_none())
            .map(|(zid, _)| zid)
            .collect();
        let turn = usize::try_from(round / ASK_EVERY).unwrap_or_default();
        Some(heard.get(turn % heard.len().max(1))?.to_string())
    }
}

/// Keeps a process connected to all others until it is dropped.
#[derive(Debug)]
pub(crate) struct Reach {
    task: JoinHandle<()>,
}

impl Drop for Reach {
    fn drop(&mut self) {
        self.task.abort();
    }
}

fn prefix(mission: &Name) -> String {
    format!("plumage/{mission}/peer/at/")
}

/// Where a process is reached, as a key. What Zenoh adds to a locator, such as priorities, cannot stand in one.
fn key(mission: &Name, zid: &str, locator: &str) -> Option<String> {
    let plain = !locator.contains(['?', '#', '$', '*']);
    plain.then(|| format!("{}{zid}/{locator}", prefix(mission)))
}

/// Reads what comes after the prefix of such a key.
fn parse(rest: &str) -> Option<(&str, Locator)> {
    let (zid, locator) = rest.split_once('/')?;
    Some((zid, locator.parse().ok()?))
}

impl Reach {
    /// Begins. `dials`: whether this process was told to connect to anybody; if not, the others were told to connect to
    /// it.
    pub(crate) async fn begin(
        session: &zenoh::Session,
        runtime: &Runtime,
        mission: &Name,
        asking: Asking,
        dials: bool,
        figures: &Figures,
    ) -> Result<Self, NetError> {
        let peers: Arc<Mutex<Peers>> = Arc::default();
        lock(&peers).ask_again();
        let own = session.zid();
        let mut tokens = Vec::new();
        for locator in runtime.get_locators() {
            if let Some(key) = key(mission, &own.to_string(), locator.as_str()) {
                let token = session.liveliness().declare_token(key).await;
                tokens.push(token.map_err(NetError::zenoh)?);
            }
        }
        watch(session, mission, &peers, figures.clone()).await?;
        let heard = Arc::clone(&peers);
        let path = whom(&own.to_string());
        let own_path = path.clone();
        let list = move |_: &str| Some((path.clone(), lock(&heard).list().into_bytes()));
        asking.answer(&own_path, list).await?;
        let dialler = Dialler {
            session: session.clone(),
            runtime: runtime.clone(),
            asking,
            dials,
            peers,
        };
        let task = tokio::spawn(async move {
            let _tokens = tokens;
            dialler.run().await;
        });
        Ok(Self { task })
    }
}

/// Follows who is heard.
async fn watch(
    session: &zenoh::Session,
    mission: &Name,
    peers: &Arc<Mutex<Peers>>,
    figures: Figures,
) -> Result<(), NetError> {
    let own = session.zid().to_string();
    let prefix = prefix(mission);
    let peers = Arc::clone(peers);
    session
        .liveliness()
        .declare_subscriber(format!("{prefix}**"))
        .history(true)
        .callback(move |sample| {
            let rest = sample.key_expr().as_str().strip_prefix(&prefix);
            match rest.and_then(parse) {
                Some((zid, locator)) if zid != own => match sample.kind() {
                    SampleKind::Put => lock(&peers).heard(zid, locator),
                    SampleKind::Delete => {
                        figures.one_lost();
                        lock(&peers).lost(zid);
                    }
                },
                _ => {}
            }
        })
        .background()
        .await
        .map_err(NetError::zenoh)
}

/// The question whom a process hears.
fn whom(zid: &str) -> String {
    format!("peer/hears/{zid}")
}

struct Dialler {
    session: zenoh::Session,
    runtime: Runtime,
    asking: Asking,
    dials: bool,
    peers: Arc<Mutex<Peers>>,
}

impl Dialler {
    async fn run(&self) {
        let own = self.session.zid().to_string();
        for round in 0_u64.. {
            tokio::time::sleep(DIAL_EVERY).await;
            let due = lock(&self.peers).due();
            for due in due {
                self.dial(due, round);
            }
            if round.is_multiple_of(ASK_EVERY) {
                let asked = lock(&self.peers).to_ask(round);
                if let Some(zid) = asked {
                    for (zid, locator) in self.ask(&zid).await {
                        if zid != own {
                            lock(&self.peers).learn(&zid, locator);
                        }
                    }
                }
            }
        }
    }

    fn dial(&self, due: Due, round: u64) {
        let theirs: Option<ZenohId> = due.zid.parse().ok();
        // Not at the start, when he with the greater id is about to dial.
        let is_turn = round % OTHER_EVERY == OTHER_EVERY - 1 && due.opener != Opener::Other;
        let theirs =
            theirs.filter(|theirs| self.dials && (is_turn || self.session.zid() > *theirs));
        let (runtime, peers) = (self.runtime.clone(), Arc::clone(&self.peers));
        tokio::spawn(async move {
            let mut reached = false;
            if let Some(theirs) = theirs {
                lock(&peers).opening(&due.zid);
                // Never cut short: Zenoh would believe for ever that it is dialling. It gives up by itself. Once
                // reached, the other's own token says that it is heard.
                reached = runtime.connect_peer(&theirs.into(), &due.locators).await;
            }
            lock(&peers).dialled(&due.zid, reached, due.opener);
        });
    }

    async fn ask(&self, zid: &str) -> Vec<(String, Locator)> {
        let line = |line: &str| {
            let (zid, locator) = line.split_once(' ')?;
            Some((zid.to_owned(), locator.parse().ok()?))
        };
        let mut told = Vec::new();
        let take = |reply: Reply| {
            let text = String::from_utf8_lossy(&reply.answer).into_owned();
            told.extend(text.lines().filter_map(line));
        };
        // Whoever cannot be asked now is asked again.
        let _ = self.asking.ask(&whom(zid), ANSWER_WITHIN, take).await;
        told
    }
}

/// Opens a session that dials again whom it loses.
pub(crate) async fn connect(
    config: zenoh::Config,
    mission: &Name,
    key: &MissionKey,
    dials: bool,
    figures: &Figures,
) -> Result<(zenoh::Session, Runtime, Asking, Reach), NetError> {
    let runtime = zenoh::internal::runtime::RuntimeBuilder::new(config);
    let mut runtime = runtime.build().await.map_err(NetError::zenoh)?;
    let session = zenoh::session::init(runtime.clone().into())
        .await
        .map_err(NetError::zenoh)?;
    runtime.start().await.map_err(NetError::zenoh)?;
    let asking = Asking::new(&session, mission, key);
    let asks = asking.clone();
    let reach = Reach::begin(&session, &runtime, mission, asks, dials, figures).await?;
    Ok((session, runtime, asking, reach))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn locator(text: &str) -> Locator {
        text.parse().unwrap()
    }

    #[test]
    fn where_a_process_is_reached_stands_in_a_key_and_is_read_back() {
        let mission = Name::new("m").unwrap();
        for text in ["tcp/127.0.0.1:7447", "tls/[2001:db8::1]:7447"] {
            let key = key(&mission, "abc", text).unwrap();
            let rest = key.strip_prefix(&prefix(&mission)).unwrap();
            assert_eq!(parse(rest), Some(("abc", locator(text))));
        }
        assert_eq!(key(&mission, "abc", "tcp/127.0.0.1:1?prio=1-2"), None);
    }

    #[test]
    fn whoever_is_lost_is_dialled_once_at_a_time_until_he_is_heard() {
        let mut peers = Peers::default();
        peers.heard("a", locator("tcp/127.0.0.1:1"));
        assert!(peers.due().is_empty());
        peers.lost("a");
        assert_eq!(peers.due().len(), 1);
        assert!(peers.due().is_empty(), "already dialling");
        peers.known.get_mut("a").unwrap().dialling = false;
        assert_eq!(peers.due().len(), 1);
        peers.heard("a", locator("tcp/127.0.0.1:1"));
        assert!(peers.due().is_empty());
    }

    #[test]
    fn only_who_is_heard_is_told_of_and_who_is_told_of_is_dialled() {
        let (mut one, mut other) = (Peers::default(), Peers::default());
        one.heard("a", locator("tcp/127.0.0.1:1"));
        one.heard("b", locator("tcp/127.0.0.1:2"));
        one.lost("b");
        assert_eq!(one.list(), "a tcp/127.0.0.1:1\n");
        other.learn("a", locator("tcp/127.0.0.1:1"));
        assert_eq!(other.due()[0].zid, "a");
    }
    #[test]
    fn who_opened_the_connection_is_kept_when_it_breaks() {
        let mut peers = Peers::default();
        peers.heard("a", locator("tcp/127.0.0.1:1"));
        peers.lost("a");
        assert_eq!(peers.due()[0].opener, Opener::Other);
        peers.learn("b", locator("tcp/127.0.0.1:2"));
        for reached in [false, true] {
            let due = peers.due().pop().unwrap();
            assert_eq!((&*due.zid, due.opener), ("b", Opener::Nobody));
            peers.opening("b");
            if reached {
                peers.heard("b", locator("tcp/127.0.0.1:2"));
            }
            peers.dialled("b", reached, due.opener);
        }
        peers.lost("b");
        assert_eq!(peers.due()[0].opener, Opener::This);
    }
}
