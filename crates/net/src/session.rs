//! One process's session on the bus of one mission: what it says, and what it hears.

use crate::presence::{self, Presence};
use crate::{NetError, NetOptions, random};
use protocol::joining::Introduction;
use protocol::key::Name;
use protocol::message::LastSequences;
use protocol::seal::{MissionKey, SealCheck, Sealer};
use protocol::{AgentId, Envelope, Interest, Outbox, ProtocolError, SimTime, Topic};
use std::collections::{BTreeMap, BTreeSet};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, OnceLock, PoisonError};
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
    pub(crate) key: MissionKey,
    /// Who this process is, for whoever lets it in.
    pub(crate) introduction: Option<Introduction>,
    /// It connects to somebody by itself.
    pub(crate) connects: bool,
    sealer: Arc<Mutex<Sealer>>,
    check: Arc<Mutex<SealCheck>>,
    /// The run that was joined.
    run: Mutex<Option<u64>>,
    subscribed: AtomicBool,
    announced: AtomicBool,
    refused: Arc<AtomicU64>,
    /// Those for whom this process tells of what is refused; of everything where nobody said.
    tells_for: Arc<OnceLock<Vec<AgentId>>>,
    json: bool,
    publishers: BTreeMap<Topic, zenoh::pubsub::Publisher<'static>>,
    presence: Presence,
    sender: mpsc::UnboundedSender<Received>,
    receiver: mpsc::UnboundedReceiver<Received>,
    /// Last sequence number of each agent that speaks through this session.
    sequences: BTreeMap<AgentId, u64>,
}

impl Net {
    /// Joins the bus of `mission`, the key of which is `key`.
    ///
    /// # Errors
    /// An option that Zenoh does not take, or a port that is taken.
    pub async fn open(
        mission: Name,
        key: MissionKey,
        options: &NetOptions,
    ) -> Result<Self, NetError> {
        let stream = u64::from_be_bytes(random()?);
        let session = zenoh::open(options.configuration()?)
            .await
            .map_err(NetError::zenoh)?;
        let presence = Presence::watch(&session, &mission).await?;
        let (sender, receiver) = mpsc::unbounded_channel();
        Ok(Self {
            session,
            mission,
            sealer: Arc::new(Mutex::new(Sealer::new(key.clone(), stream))),
            check: Arc::new(Mutex::new(SealCheck::new(key.clone()))),
            key,
            introduction: None,
            connects: !options.connect.is_empty(),
            run: Mutex::default(),
            subscribed: AtomicBool::new(false),
            announced: AtomicBool::new(false),
            refused: Arc::default(),
            tells_for: Arc::default(),
            json: options.json,
            publishers: BTreeMap::new(),
            presence,
            sender,
            receiver,
            sequences: BTreeMap::new(),
        })
    }

    /// Who this process is, for whoever lets it in.
    pub fn introduce(&mut self, introduction: Introduction) {
        self.introduction = Some(introduction);
    }

    /// How much was refused of what came in: unreadable, unsealed, or not its sender's to say.
    pub fn refused(&self) -> u64 {
        self.refused.load(Ordering::Relaxed)
    }

    /// Of what is refused only that is told which `agents` are to tell of.
    pub(crate) fn tells_for(&self, agents: &[AgentId]) {
        let _ = self.tells_for.set(agents.to_vec());
    }

    pub(crate) fn has_announced(&self) -> bool {
        self.announced.load(Ordering::Relaxed)
    }

    /// How this process numbers what it seals.
    pub(crate) fn sealer(&self) -> Arc<Mutex<Sealer>> {
        Arc::clone(&self.sealer)
    }

    /// From now on it speaks and hears in `run`, kept by a process that has `said` so much.
    pub(crate) fn set_run(&self, run: u64, said: Option<(u64, u64)>) {
        *lock(&self.run) = Some(run);
        let mut check = lock(&self.check);
        check.only_run(run);
        // What was on its way when this process began to listen counts.
        if let Some((stream, number)) = said.filter(|_| !self.subscribed.load(Ordering::Relaxed)) {
            check.only_after(stream, number);
        }
    }

    /// Hears everything that `interests` cover. To be called before [`Net::announce`].
    ///
    /// # Errors
    /// [`NetError::Zenoh`].
    pub async fn subscribe(&self, interests: &[Interest]) -> Result<(), NetError> {
        self.subscribed.store(true, Ordering::Relaxed);
        for interest in interests {
            let sender = self.sender.clone();
            let mission = self.mission.clone();
            let check = Arc::clone(&self.check);
            let refused = Arc::clone(&self.refused);
            let tells_for = Arc::clone(&self.tells_for);
            self.session
                .declare_subscriber(interest.key_expression(&self.mission))
                .callback(move |sample| {
                    let received = read(&sample, &mission, &check);
                    if received.is_err() {
                        refused.fetch_add(1, Ordering::Relaxed);
                        let topic = Topic::parse_key(sample.key_expr().as_str(), &mission);
                        let teller = topic.ok().and_then(|topic| topic.refusals_told_by());
                        let others = |own: &Vec<AgentId>| {
                            teller.is_some_and(|teller| !own.contains(&teller))
                        };
                        if tells_for.get().is_some_and(others) {
                            return;
                        }
                    }
                    // Foreign keys and garbage come out as errors for the owner to tell of.
                    let _ = sender.send(received);
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
        self.announced.store(true, Ordering::Relaxed);
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

    /// Publishes one envelope with a seal.
    ///
    /// # Errors
    /// [`NetError::Zenoh`]; [`NetError::NotJoined`] before a run was joined.
    pub async fn publish(&mut self, topic: &Topic, envelope: &Envelope) -> Result<(), NetError> {
        let run = (*lock(&self.run)).ok_or(NetError::NotJoined)?;
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
        let key = publisher.key_expr().as_str();
        let seal = lock(&self.sealer).seal(run, key, &payload);
        publisher
            .put(payload)
            .encoding(encoding)
            .attachment(seal)
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

/// What is behind a lock; a panic elsewhere leaves what can still be used.
pub(crate) fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

fn read(sample: &Sample, mission: &Name, check: &Mutex<SealCheck>) -> Received {
    let key = sample.key_expr().as_str();
    let topic = Topic::parse_key(key, mission)?;
    let bytes = sample.payload().to_bytes();
    let seal = sample.attachment().map(zenoh::bytes::ZBytes::to_bytes);
    lock(check)
        .take(key, &bytes, seal.as_deref())
        .map_err(|fault| ProtocolError::Seal {
            key: topic.path(),
            fault,
        })?;
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
    envelope.message.check_numbers(&topic)?;
    Ok((topic, envelope))
}
