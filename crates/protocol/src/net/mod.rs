//! The bus over Zenoh: the same envelopes between processes and hosts.
//!
//! Needs a multi-thread tokio runtime. Multicast scouting is off and only the endpoints given
//! are used, so that nobody else on a network gets in; gossip lets the peers that met at one
//! endpoint find each other. Nothing is dropped: congestion control blocks the sender.
//!
//! [`lockstep`] runs an agent tick by tick under a conductor; [`realtime`] runs it by the wall
//! clock, with the squadron controller's process keeping the mission's time.

pub mod lockstep;
pub mod realtime;

use crate::agent::{Agent, Event};
use crate::envelope::Envelope;
use crate::key::{AgentId, Interest, Name, Topic};
use crate::{Outbox, ProtocolError, SimTime};
use std::collections::{BTreeMap, BTreeSet};
use std::sync::{Arc, Mutex, PoisonError};
use tokio::sync::mpsc;
use zenoh::bytes::Encoding;
use zenoh::qos::CongestionControl;
use zenoh::sample::{Sample, SampleKind};

/// Where the squadron controller listens and the others connect by default.
pub const DEFAULT_ENDPOINT: &str = "tcp/127.0.0.1:7447";

/// How a process joins the bus.
#[derive(Debug, Clone, Default)]
pub struct NetOptions {
    /// Endpoints to listen on, such as `tcp/127.0.0.1:7447` or `tls/0.0.0.0:7447`.
    pub listen: Vec<String>,
    /// Endpoints to connect to.
    pub connect: Vec<String>,
    /// Publish JSON instead of bincode, for peers in other languages.
    pub json: bool,
    /// PEM files for TLS endpoints: root certificate, own certificate, own private key.
    pub tls: Option<TlsFiles>,
    /// User name and password that every peer must show.
    pub user_password: Option<(String, String)>,
    /// File of `user:password` lines that a listening process accepts.
    pub password_file: Option<String>,
}

/// PEM files for TLS. The process needs one thread of Zenoh for all that is read and written, by the
/// environment variable `ZENOH_RUNTIME`: Zenoh 1.10 otherwise loses connections (eclipse-zenoh/zenoh#2557).
#[derive(Debug, Clone)]
pub struct TlsFiles {
    /// Certificate of the authority that signs the peers' certificates.
    pub root_ca: String,
    /// Own certificate, needed to listen.
    pub certificate: Option<String>,
    /// Own private key, needed to listen.
    pub private_key: Option<String>,
}

/// Something that came in: an envelope on its topic, or why it was refused.
pub type Received = Result<(Topic, Envelope), ProtocolError>;

/// An open session on the bus of one mission.
pub struct Net {
    session: zenoh::Session,
    mission: Name,
    json: bool,
    publishers: BTreeMap<Topic, zenoh::pubsub::Publisher<'static>>,
    peers: Arc<Mutex<BTreeSet<String>>>,
    sender: mpsc::UnboundedSender<Received>,
    receiver: mpsc::UnboundedReceiver<Received>,
    /// Last sequence number of each agent that speaks through this session.
    sequences: BTreeMap<AgentId, u64>,
}

/// The agents that one process hosts on one session.
struct Hosted {
    ids: Vec<AgentId>,
    interests: Vec<Vec<Interest>>,
    /// What any of them wants to hear, each once.
    all: Vec<Interest>,
}

impl Hosted {
    fn of<A: Agent>(agents: &[A]) -> Self {
        let interests: Vec<Vec<Interest>> = agents.iter().map(Agent::interests).collect();
        let mut all: Vec<Interest> = Vec::new();
        for interest in interests.iter().flatten() {
            if !all.contains(interest) {
                all.push(interest.clone());
            }
        }
        Self {
            ids: agents.iter().map(|a| a.id().clone()).collect(),
            interests,
            all,
        }
    }

    /// Hands the `k`-th agent what it wants to hear of what others said.
    fn hand_out<A: Agent>(
        &self,
        k: usize,
        agent: &mut A,
        said: &[(Topic, Envelope)],
        now: SimTime,
        outbox: &mut Outbox,
    ) {
        for (topic, envelope) in said {
            let wanted = self.interests[k].iter().any(|i| i.covers(topic));
            if wanted && envelope.sender != self.ids[k] {
                agent.handle(Event::Message(topic, envelope), now, outbox);
            }
        }
    }
}

/// Who is present on the bus.
#[derive(Debug, Clone)]
pub struct Presence(Arc<Mutex<BTreeSet<String>>>);

impl Presence {
    /// Those who are present now, as `kind/name`.
    pub fn now(&self) -> BTreeSet<String> {
        self.0
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
            .clone()
    }
}

fn network(error: impl std::fmt::Display) -> ProtocolError {
    ProtocolError::Network(error.to_string())
}

fn configuration(options: &NetOptions) -> Result<zenoh::Config, ProtocolError> {
    let mut config = zenoh::Config::default();
    let mut set = |key: &str, value: serde_json::Value| {
        config
            .insert_json5(key, &value.to_string())
            .map_err(|e| ProtocolError::Network(format!("option {key} = {value}: {e}")))
    };
    set("mode", "peer".into())?;
    set("scouting/multicast/enabled", false.into())?;
    set("scouting/gossip/enabled", true.into())?;
    // A process that only connects still listens on a free loopback port, so that the peers
    // it meets by gossip can reach it: peers do not relay for each other.
    let loopback = vec!["tcp/127.0.0.1:0".to_owned()];
    let listen = if options.listen.is_empty() {
        &loopback
    } else {
        &options.listen
    };
    set("listen/endpoints", listen.clone().into())?;
    set("connect/endpoints", options.connect.clone().into())?;
    // Agents may be started in any order: keep trying until the other side is there.
    set("connect/timeout_ms", (-1).into())?;
    set("connect/exit_on_failure", false.into())?;
    if let Some(tls) = &options.tls {
        set(
            "transport/link/tls/root_ca_certificate",
            tls.root_ca.clone().into(),
        )?;
        if let Some(certificate) = &tls.certificate {
            set(
                "transport/link/tls/listen_certificate",
                certificate.clone().into(),
            )?;
        }
        if let Some(key) = &tls.private_key {
            set("transport/link/tls/listen_private_key", key.clone().into())?;
        }
    }
    if let Some((user, password)) = &options.user_password {
        // Two peers that show each other a password refuse the second of two connections that they
        // open at once, and may be left with none (eclipse-zenoh/zenoh#2577): one side opens it.
        // Without passwords both may, as only one of them may be able to reach the other.
        set(
            "scouting/gossip/autoconnect_strategy",
            serde_json::json!({"peer": {"to_router": "always", "to_peer": "greater-zid"}}),
        )?;
        set("transport/auth/usrpwd/user", user.clone().into())?;
        set("transport/auth/usrpwd/password", password.clone().into())?;
    }
    if let Some(file) = &options.password_file {
        set("transport/auth/usrpwd/dictionary_file", file.clone().into())?;
    }
    Ok(config)
}

impl Net {
    /// Joins the bus of `mission`.
    ///
    /// # Errors
    /// An option that Zenoh does not take, or a port that is taken.
    pub async fn open(mission: Name, options: &NetOptions) -> Result<Self, ProtocolError> {
        let session = zenoh::open(configuration(options)?)
            .await
            .map_err(network)?;
        let (sender, receiver) = mpsc::unbounded_channel();
        let net = Self {
            session,
            mission,
            json: options.json,
            publishers: BTreeMap::new(),
            peers: Arc::default(),
            sender,
            receiver,
            sequences: BTreeMap::new(),
        };
        net.watch_presence().await?;
        Ok(net)
    }

    async fn watch_presence(&self) -> Result<(), ProtocolError> {
        let peers = Arc::clone(&self.peers);
        let prefix = format!("plumage/{}/", self.mission);
        self.session
            .liveliness()
            .declare_subscriber(format!("{prefix}*/*/alive"))
            .history(true)
            .callback(move |sample| {
                let key = sample.key_expr().as_str();
                let agent = key
                    .strip_prefix(&prefix)
                    .and_then(|k| k.strip_suffix("/alive"));
                let Some(agent) = agent else { return };
                let mut peers = peers.lock().unwrap_or_else(PoisonError::into_inner);
                match sample.kind() {
                    SampleKind::Put => peers.insert(agent.to_owned()),
                    SampleKind::Delete => peers.remove(agent),
                };
            })
            .background()
            .await
            .map_err(network)
    }

    /// Hears everything that `interests` cover. To be called before [`Net::announce`].
    ///
    /// # Errors
    /// [`ProtocolError::Network`].
    pub async fn subscribe(&self, interests: &[Interest]) -> Result<(), ProtocolError> {
        for interest in interests {
            let sender = self.sender.clone();
            let mission = self.mission.clone();
            self.session
                .declare_subscriber(interest.key_expression(&self.mission))
                .callback(move |sample| {
                    // Foreign keys and garbage come out as errors for the owner to tell of.
                    let _ = sender.send(read(&sample, &mission));
                })
                .background()
                .await
                .map_err(network)?;
        }
        Ok(())
    }

    /// Shows the others that `agent` is there, until the returned token is dropped.
    ///
    /// # Errors
    /// [`ProtocolError::Network`].
    pub async fn announce(
        &self,
        agent: &AgentId,
    ) -> Result<zenoh::liveliness::LivelinessToken, ProtocolError> {
        self.session
            .liveliness()
            .declare_token(format!("plumage/{}/{agent}/alive", self.mission))
            .await
            .map_err(network)
    }

    /// Those whose presence is seen now, as `kind/name`.
    pub fn peers(&self) -> BTreeSet<String> {
        self.presence().now()
    }

    /// A look at who is present that can be taken elsewhere.
    pub fn presence(&self) -> Presence {
        Presence(Arc::clone(&self.peers))
    }

    /// Waits until all of `agents` are present.
    pub async fn wait_for(&self, agents: &[AgentId]) {
        loop {
            let peers = self.peers();
            if agents.iter().all(|a| peers.contains(&a.to_string())) {
                return;
            }
            tokio::time::sleep(std::time::Duration::from_millis(20)).await;
        }
    }

    /// The next thing that came in.
    pub async fn receive(&mut self) -> Option<Received> {
        self.receiver.recv().await
    }

    /// What came in by now, without waiting.
    pub fn try_receive(&mut self) -> Option<Received> {
        self.receiver.try_recv().ok()
    }

    /// Publishes one envelope.
    ///
    /// # Errors
    /// [`ProtocolError::Network`].
    pub async fn publish(
        &mut self,
        topic: &Topic,
        envelope: &Envelope,
    ) -> Result<(), ProtocolError> {
        let (payload, encoding) = if self.json {
            (envelope.to_json().into_bytes(), Encoding::APPLICATION_JSON)
        } else {
            (envelope.to_bytes(), Encoding::APPLICATION_OCTET_STREAM)
        };
        if !self.publishers.contains_key(topic) {
            let publisher = self
                .session
                .declare_publisher(topic.key(&self.mission))
                .congestion_control(CongestionControl::Block)
                .express(true)
                .await
                .map_err(network)?;
            self.publishers.insert(topic.clone(), publisher);
        }
        let Some(publisher) = self.publishers.get(topic) else {
            return Ok(());
        };
        publisher
            .put(payload)
            .encoding(encoding)
            .await
            .map_err(network)
    }

    /// Publishes all that `agent` said in `outbox` at `now`, and tells the last sequence per key.
    ///
    /// # Errors
    /// [`ProtocolError::Network`].
    pub async fn publish_all(
        &mut self,
        agent: &AgentId,
        now: SimTime,
        outbox: &mut Outbox,
    ) -> Result<crate::message::LastSequences, ProtocolError> {
        let mut wrote = BTreeMap::new();
        let mut sequence = self.sequences.get(agent).copied().unwrap_or_default();
        for (topic, message) in outbox.drain() {
            sequence += 1;
            let envelope = Envelope {
                sender: agent.clone(),
                sequence,
                time: now,
                message,
            };
            self.publish(&topic, &envelope).await?;
            wrote.insert(topic.path(), sequence);
        }
        self.sequences.insert(agent.clone(), sequence);
        Ok(wrote)
    }

    /// Leaves the bus.
    ///
    /// # Errors
    /// [`ProtocolError::Network`].
    pub async fn close(self) -> Result<(), ProtocolError> {
        self.session.close().await.map_err(network)
    }
}

fn read(sample: &Sample, mission: &Name) -> Received {
    let topic = Topic::parse_key(sample.key_expr().as_str(), mission)?;
    let bytes = sample.payload().to_bytes();
    let is_json = matches!(sample.encoding(), e if *e == Encoding::APPLICATION_JSON || *e == Encoding::TEXT_JSON);
    let envelope = if is_json {
        let text = std::str::from_utf8(&bytes).map_err(|e| ProtocolError::Garbage {
            key: topic.path(),
            why: e.to_string(),
        })?;
        Envelope::from_json(&topic, text)?
    } else {
        Envelope::from_bytes(&topic, &bytes)?
    };
    Ok((topic, envelope))
}
