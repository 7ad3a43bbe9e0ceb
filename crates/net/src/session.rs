//! One process's session on the bus of one mission: what it says, and what it hears.

use crate::presence::{self, Presence};
use crate::{NetError, NetOptions};
use protocol::key::Name;
use protocol::message::LastSequences;
use protocol::{AgentId, Envelope, Interest, Outbox, ProtocolError, SimTime, Topic};
use std::collections::{BTreeMap, BTreeSet};
use tokio::sync::mpsc;
use zenoh::bytes::Encoding;
use zenoh::qos::CongestionControl;
use zenoh::sample::Sample;

/// Something that came in: an envelope on its topic, or why it was refused.
pub type Received = Result<(Topic, Envelope), ProtocolError>;

/// An open session on the bus of one mission.
pub struct Net {
    pub(crate) session: zenoh::Session,
    pub(crate) mission: Name,
    json: bool,
    publishers: BTreeMap<Topic, zenoh::pubsub::Publisher<'static>>,
    presence: Presence,
    sender: mpsc::UnboundedSender<Received>,
    receiver: mpsc::UnboundedReceiver<Received>,
    /// Last sequence number of each agent that speaks through this session.
    sequences: BTreeMap<AgentId, u64>,
}

impl Net {
    /// Joins the bus of `mission`.
    ///
    /// # Errors
    /// An option that Zenoh does not take, or a port that is taken.
    pub async fn open(mission: Name, options: &NetOptions) -> Result<Self, NetError> {
        let session = zenoh::open(options.configuration()?)
            .await
            .map_err(NetError::zenoh)?;
        let presence = Presence::watch(&session, &mission).await?;
        let (sender, receiver) = mpsc::unbounded_channel();
        Ok(Self {
            session,
            mission,
            json: options.json,
            publishers: BTreeMap::new(),
            presence,
            sender,
            receiver,
            sequences: BTreeMap::new(),
        })
    }

    /// Hears everything that `interests` cover. To be called before [`Net::announce`].
    ///
    /// # Errors
    /// [`NetError::Zenoh`].
    pub async fn subscribe(&self, interests: &[Interest]) -> Result<(), NetError> {
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
                .map_err(NetError::zenoh)?;
        }
        Ok(())
    }

    /// Shows the others that `agent` is there, until the returned token is dropped.
    ///
    /// # Errors
    /// [`NetError::Zenoh`].
    pub async fn announce(
        &self,
        agent: &AgentId,
    ) -> Result<zenoh::liveliness::LivelinessToken, NetError> {
        self.session
            .liveliness()
            .declare_token(presence::key(&self.mission, agent))
            .await
            .map_err(NetError::zenoh)
    }

    /// Those whose presence is seen now, as `kind/name`.
    pub fn peers(&self) -> BTreeSet<String> {
        self.presence.now()
    }

    /// A look at who is present that can be taken elsewhere.
    pub fn presence(&self) -> Presence {
        self.presence.clone()
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
    /// [`NetError::Zenoh`].
    pub async fn publish(&mut self, topic: &Topic, envelope: &Envelope) -> Result<(), NetError> {
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
                .map_err(NetError::zenoh)?;
            self.publishers.insert(topic.clone(), publisher);
        }
        let Some(publisher) = self.publishers.get(topic) else {
            return Ok(());
        };
        publisher
            .put(payload)
            .encoding(encoding)
            .await
            .map_err(NetError::zenoh)
    }

    /// Publishes all that `agent` said in `outbox` at `now`, and tells the last sequence per key.
    ///
    /// # Errors
    /// [`NetError::Zenoh`].
    pub async fn publish_all(
        &mut self,
        agent: &AgentId,
        now: SimTime,
        outbox: &mut Outbox,
    ) -> Result<LastSequences, NetError> {
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
    /// [`NetError::Zenoh`].
    pub async fn close(self) -> Result<(), NetError> {
        self.session.close().await.map_err(NetError::zenoh)
    }
}

/// Whether a payload is JSON whatever its encoding says: a script that puts a string need not know of encodings. No
/// binary envelope begins so: its first byte is the wire version, far below.
fn looks_like_json(bytes: &[u8]) -> bool {
    bytes.iter().find(|b| !b.is_ascii_whitespace()) == Some(&b'{')
}

fn read(sample: &Sample, mission: &Name) -> Received {
    let topic = Topic::parse_key(sample.key_expr().as_str(), mission)?;
    let bytes = sample.payload().to_bytes();
    let said_json = matches!(sample.encoding(), e if *e == Encoding::APPLICATION_JSON || *e == Encoding::TEXT_JSON);
    let envelope = if said_json || looks_like_json(&bytes) {
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
