//! One process's session on the bus of one mission: what it says, and what it hears.

use crate::asking::Asking;
use crate::bundles::{ANY_HOST, Roles, Unbundler};
use crate::figures::Figures;
use crate::locks::lock;
use crate::presence::{self, CALL_AGAIN, Presence, Roll};
use crate::reach::{self, Reach};
use crate::remembered::Remembered;
use crate::run::{Run, RunJoined};
use crate::{NetError, NetOptions, random};
use futures_core::future::BoxFuture;
use protocol::bundle::{self, Bundle, BundleKind};
use protocol::joining::{Introduction, RollEntry, RunAge};
use protocol::key::Name;
use protocol::message::LastSequences;
use protocol::seal::{MissionKey, SealCheck, Sealer};
use protocol::{AgentId, Envelope, Interest, Message, Outbox, ProtocolError, SimTime, Topic};
use std::collections::{BTreeMap, BTreeSet};
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, OnceLock};
use std::time::{Duration, Instant};
use tokio::sync::mpsc;
use zenoh::bytes::Encoding;
use zenoh::qos::CongestionControl;
use zenoh::sample::Sample;

/// How long a process that ends in good order waits until the others know: they ask once a second.
const FAREWELL: Duration = Duration::from_secs(3);

/// Something that came in: an envelope on its topic, or why it was refused.
pub type Received = Result<(Topic, Envelope), ProtocolError>;

/// An open session on the bus of one mission.
pub struct Net {
    pub(crate) session: zenoh::Session,
    runtime: zenoh::internal::runtime::Runtime,
    asking: Asking,
    reach: Reach,
    pub(crate) mission: Name,
    pub(crate) key: MissionKey,
    /// Who this process is, for whoever lets it in.
    pub(crate) introduction: Option<Introduction>,
    /// It connects to somebody by itself.
    pub(crate) connects: bool,
    sealer: Arc<Mutex<Sealer>>,
    joined: RunJoined,
    /// Those who show themselves.
    announced: Mutex<Vec<AgentId>>,
    /// This process ends in good order, and how often it has told so.
    ends: Arc<AtomicBool>,
    farewells: Arc<AtomicUsize>,
    json: bool,
    /// Whether each message leaves by itself, at once: in lockstep everybody waits for it. In real time those that wait
    /// for the processor share a batch; else a few of them would fill the queue to a peer.
    express: bool,
    /// By key expression.
    publishers: BTreeMap<String, zenoh::pubsub::Publisher<'static>>,
    /// Name of this host in the keys of its bundles.
    host: Name,
    /// What was said since the last bundles.
    bundles: BTreeMap<BundleKind, Bundle>,
    presence: Presence,
    roll: Roll,
    intake: Intake,
    unbundler: Unbundler,
    receiver: mpsc::UnboundedReceiver<Received>,
    /// Key expressions.
    subscribed: BTreeSet<String>,
    pub(crate) remembered: Remembered,
    figures: Figures,
    /// What each agent said that holds until it says otherwise, by path.
    standing: BTreeMap<(AgentId, String), (Topic, Message)>,
    /// Last sequence number of each agent that speaks through this session.
    sequences: BTreeMap<AgentId, u64>,
}

impl Net {
    /// Joins the bus of `mission`, the key of which is `key`.
    ///
    /// # Errors
    /// An option that Zenoh does not take, or a port that is taken.
    pub fn open<'a>(
        mission: Name,
        key: MissionKey,
        options: &'a NetOptions,
    ) -> BoxFuture<'a, Result<Self, NetError>> {
        Box::pin(async move {
            let stream = u64::from_be_bytes(random()?);
            let dials = !options.connect.is_empty();
            let figures = Figures::default();
            let (session, runtime, asking, reach) =
                reach::connect(options.configuration()?, &mission, &key, dials, &figures).await?;
            let joined = RunJoined::new(&key);
            let told = (joined.clone(), stream);
            let (presence, roll) =
                Presence::watch(&session, &mission, asking.clone(), told).await?;
            let (sender, receiver) = mpsc::unbounded_channel();
            let intake = Intake {
                mission: mission.clone(),
                check: Arc::clone(&joined.check),
                figures: figures.clone(),
                tells_for: Arc::default(),
                sender,
            };
            let roles = Roles::of(options.access_control.as_deref());
            let host = match &options.host {
                Some(host) => host.clone(),
                None => Name::new(ANY_HOST).map_err(NetError::zenoh)?,
            };
            Ok(Self {
                session,
                runtime,
                asking,
                reach,
                mission,
                sealer: Arc::new(Mutex::new(Sealer::new(key.clone(), stream))),
                key,
                introduction: None,
                connects: dials,
                joined,
                announced: Mutex::default(),
                ends: Arc::default(),
                farewells: Arc::default(),
                json: options.json,
                express: !options.real_time,
                publishers: BTreeMap::new(),
                host,
                bundles: BTreeMap::new(),
                presence,
                roll,
                unbundler: Unbundler::new(intake.clone(), roles),
                intake,
                receiver,
                subscribed: BTreeSet::new(),
                remembered: Remembered::default(),
                figures,
                standing: BTreeMap::new(),
                sequences: BTreeMap::new(),
            })
        })
    }

    /// Who this process is, for whoever lets it in.
    pub fn introduce(&mut self, introduction: Introduction) {
        self.introduction = Some(introduction);
    }

    /// How much was refused of what came in: unreadable, unsealed, or not its sender's to say.
    pub fn refused(&self) -> u64 {
        self.figures.refused()
    }

    /// The agents that it hosts.
    pub(crate) fn own_agents(&self) -> Vec<String> {
        let introduced = self.introduction.as_ref();
        introduced.map_or_else(Vec::new, |i| i.agents.clone())
    }

    /// Of what is refused only that is told which `agents` are to tell of.
    pub(crate) fn tells_for(&self, agents: &[AgentId]) {
        let _ = self.intake.tells_for.set(agents.to_vec());
    }

    pub(crate) fn has_announced(&self) -> bool {
        !lock(&self.announced).is_empty()
    }

    /// Asks and answers beside the mission's messages.
    pub(crate) fn asking(&self) -> Asking {
        self.asking.clone()
    }

    /// The run that was joined.
    pub(crate) fn joined(&self) -> RunJoined {
        self.joined.clone()
    }

    /// How this process numbers what it seals.
    pub(crate) fn sealer(&self) -> Arc<Mutex<Sealer>> {
        Arc::clone(&self.sealer)
    }

    /// What a process that goes on has `said` so far does not count here.
    pub(crate) fn only_after(&self, said: (u64, u64)) {
        lock(&self.joined.check).only_after(said.0, said.1);
    }

    /// From now on it speaks and hears in `run`, kept by a process that has `said` so much.
    pub(crate) fn set_run(&self, run: Run, said: (u64, u64)) {
        self.joined.join(run);
        // What was on its way when this process began to listen counts.
        if self.subscribed.is_empty() {
            self.only_after(said);
        }
    }

    /// Receives the messages that `interests` cover, each on its own key. To be called before [`Net::announce`].
    ///
    /// # Errors
    /// [`NetError::Zenoh`].
    pub fn subscribe<'a>(
        &'a mut self,
        interests: &'a [Interest],
    ) -> BoxFuture<'a, Result<(), NetError>> {
        Box::pin(async move {
            for interest in interests {
                let key = interest.key_expression(&self.mission);
                self.subscribe_to(key).await?;
            }
            Ok(())
        })
    }

    /// Receives the same messages as [`Net::subscribe`], but those of the team in [bundles](bundle), one for each process and
    /// tick. For processes that follow many vehicles. To be called before [`Net::announce`].
    ///
    /// # Errors
    /// [`NetError::Zenoh`].
    pub fn subscribe_bundled<'a>(
        &'a mut self,
        interests: &'a [Interest],
    ) -> BoxFuture<'a, Result<(), NetError>> {
        Box::pin(async move {
            for interest in interests {
                for key in bundle::key_expressions_beside(interest, &self.mission) {
                    self.subscribe_to(key).await?;
                }
                for kind in self.unbundler.add(interest) {
                    let key = kind.key_expression(&self.mission);
                    if !self.subscribed.insert(key.clone()) {
                        continue;
                    }
                    let unbundler = self.unbundler.clone();
                    let subscriber = self.session.declare_subscriber(key);
                    let subscriber = subscriber.callback(move |sample| unbundler.take(&sample));
                    subscriber.background().await.map_err(NetError::zenoh)?;
                }
            }
            Ok(())
        })
    }

    async fn subscribe_to(&mut self, key_expression: String) -> Result<(), NetError> {
        // Subscribed already: everything would be received twice.
        if !self.subscribed.insert(key_expression.clone()) {
            return Ok(());
        }
        let intake = self.intake.clone();
        let subscriber = self.session.declare_subscriber(key_expression);
        let subscriber = subscriber.callback(move |sample| intake.take(&sample));
        subscriber.background().await.map_err(NetError::zenoh)
    }

    /// Shows the others that `agent` is there, until the returned token is dropped, and answers when the roll is called.
    ///
    /// # Errors
    /// [`NetError::Zenoh`].
    pub fn announce<'a>(
        &'a self,
        agent: &'a AgentId,
    ) -> BoxFuture<'a, Result<zenoh::liveliness::LivelinessToken, NetError>> {
        Box::pin(async move {
            let counts = !self.has_announced();
            lock(&self.announced).push(agent.clone());
            let (joined, sealer) = (self.joined(), Arc::clone(&self.sealer));
            let (ends, farewells) = (Arc::clone(&self.ends), Arc::clone(&self.farewells));
            let (path, name) = (format!("{agent}/call"), agent.to_string());
            let own_path = path.clone();
            let answer = move |_: &str| {
                let (stream, number) = lock(&sealer).so_far();
                let ended = ends.load(Ordering::Relaxed);
                if ended && counts {
                    farewells.fetch_add(1, Ordering::Relaxed);
                }
                let entry = RollEntry {
                    agent: name.clone(),
                    stream,
                    number,
                    run: joined.run().map(|run| RunAge {
                        number: run.number,
                        age_ns: run.age_ns(),
                    }),
                    ended,
                };
                Some((path.clone(), serde_json::to_vec(&entry).ok()?))
            };
            self.asking().answer(&own_path, answer).await?;
            self.show(agent).await
        })
    }

    async fn show(&self, agent: &AgentId) -> Result<zenoh::liveliness::LivelinessToken, NetError> {
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

    /// What this session counts.
    pub fn figures(&self) -> Figures {
        self.figures.clone()
    }

    /// Waits until all of `agents` are present.
    pub async fn wait_for(&self, agents: &[AgentId]) {
        loop {
            let peers = self.peers();
            if agents.iter().all(|a| peers.contains(&a.to_string())) {
                return;
            }
            tokio::time::sleep(Duration::from_millis(20)).await;
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

    /// Publishes one envelope at once.
    ///
    /// # Errors
    /// [`NetError::Zenoh`]; [`NetError::NotJoined`] before a run was joined.
    pub fn publish<'a>(
        &'a mut self,
        topic: &'a Topic,
        envelope: &'a Envelope,
    ) -> BoxFuture<'a, Result<(), NetError>> {
        Box::pin(async move {
            self.add(topic, envelope).await?;
            self.flush().await
        })
    }

    /// Publishes an envelope on its own key, which costs next to nothing where nobody subscribes to that, and adds it to
    /// the next bundle.
    pub(crate) fn add<'a>(
        &'a mut self,
        topic: &'a Topic,
        envelope: &'a Envelope,
    ) -> BoxFuture<'a, Result<(), NetError>> {
        Box::pin(async move {
            let bytes = envelope.to_bytes();
            if let Some(kind) = BundleKind::of(topic) {
                self.bundles.entry(kind).or_default().add(topic, &bytes);
            }
            self.figures.one_said();
            let key = topic.key(&self.mission);
            if self.json {
                let json = envelope.to_json().into_bytes();
                self.put(key, json, Encoding::APPLICATION_JSON).await
            } else {
                self.put(key, bytes, Encoding::APPLICATION_OCTET_STREAM)
                    .await
            }
        })
    }

    /// Publishes the bundles of what was added since the last call: after each tick of all agents.
    ///
    /// # Errors
    /// As [`Net::publish`].
    pub(crate) fn flush(&mut self) -> BoxFuture<'_, Result<(), NetError>> {
        Box::pin(async move {
            for kind in BundleKind::ALL {
                let bundle = self.bundles.get_mut(&kind).map(Bundle::take);
                if let Some(payload) = bundle.filter(|payload| !payload.is_empty()) {
                    let key = kind.key(&self.mission, &self.host);
                    self.put(key, payload, Encoding::APPLICATION_OCTET_STREAM)
                        .await?;
                }
            }
            Ok(())
        })
    }

    /// Publishes a payload with a seal, by a publisher that is declared once for each key.
    async fn put(
        &mut self,
        key: String,
        payload: Vec<u8>,
        encoding: Encoding,
    ) -> Result<(), NetError> {
        let run = self.joined.run().ok_or(NetError::NotJoined)?.number;
        if !self.publishers.contains_key(&key) {
            let publisher = self
                .session
                .declare_publisher(key.clone())
                .congestion_control(CongestionControl::Block)
                .express(self.express)
                .await
                .map_err(NetError::zenoh)?;
            self.publishers.insert(key.clone(), publisher);
        }
        let Some(publisher) = self.publishers.get(&key) else {
            return Ok(());
        };
        let seal = lock(&self.sealer).seal(run, &key, &payload);
        let put = publisher.put(payload).encoding(encoding).attachment(seal);
        put.await.map_err(NetError::zenoh)
    }

    /// Publishes all that `agent` said in `outbox` at `now`, in the bundle of the next [`Net::flush`] and on own keys,
    /// and returns the last sequence per key.
    ///
    /// # Errors
    /// [`NetError::Zenoh`].
    pub(crate) async fn publish_all(
        &mut self,
        agent: &AgentId,
        now: SimTime,
        outbox: &mut Outbox,
    ) -> Result<LastSequences, NetError> {
        let mut wrote = BTreeMap::new();
        let mut sequence = self.sequences.get(agent).copied().unwrap_or_default();
        for (topic, message) in outbox.drain() {
            sequence += 1;
            let envelope = Envelope::new(agent.clone(), sequence, now, message);
            self.add(&topic, &envelope).await?;
            wrote.insert(topic.path(), sequence);
            if holds_until_changed(&topic) {
                let last = (topic, envelope.message);
                self.standing.insert((agent.clone(), last.0.path()), last);
            }
        }
        self.sequences.insert(agent.clone(), sequence);
        Ok(wrote)
    }

    /// Says again what `agent` said and still holds: for those who came since, or have not heard it while they were cut
    /// off.
    ///
    /// # Errors
    /// [`NetError::Zenoh`].
    pub(crate) async fn say_again(
        &mut self,
        agent: &AgentId,
        now: SimTime,
    ) -> Result<(), NetError> {
        let own = self.standing.iter().filter(|((who, _), _)| who == agent);
        let said: Vec<_> = own.map(|(_, said)| said.clone()).collect();
        let mut outbox = Outbox::default();
        for (topic, message) in said {
            outbox.say(topic, message);
        }
        self.publish_all(agent, now, &mut outbox).await?;
        Ok(())
    }

    /// Leaves the bus in good order: the others know that its agents have ended, and are not just unheard.
    pub fn leave(self) -> BoxFuture<'static, ()> {
        Box::pin(async move {
            self.ends.store(true, Ordering::Relaxed);
            let announced = lock(&self.announced).first().cloned();
            if let Some(agent) = announced {
                // A token that comes has the roll called, by this process too.
                let token = self.show(&agent).await;
                let (begun, calls) = (Instant::now(), self.presence.processes());
                let told = || self.farewells.load(Ordering::Relaxed) >= calls;
                while !told() && begun.elapsed() < FAREWELL {
                    tokio::time::sleep(CALL_AGAIN).await;
                }
                drop(token);
            }
            self.close().await;
        })
    }

    /// Leaves the bus. Whoever does not answer while connections close, as over a bad link, notices by himself: all
    /// that was to be said has been said, and so nothing fails here.
    pub fn close(self) -> BoxFuture<'static, ()> {
        Box::pin(async move {
            drop((self.reach, self.roll));
            let _ = self.session.close().await;
            let _ = self.runtime.close().await;
        })
    }
}

/// Whether what is said on `topic` holds until something else is said, and is not said again by itself.
fn holds_until_changed(topic: &Topic) -> bool {
    matches!(topic, Topic::Mode(_) | Topic::Weather | Topic::Extension)
}

/// Whether a payload is JSON whatever its encoding says: a script that puts a string need not know of encodings. No
/// binary envelope begins so: its first byte is the wire version, far below.
fn looks_like_json(bytes: &[u8]) -> bool {
    bytes.iter().find(|b| !b.is_ascii_whitespace()) == Some(&b'{')
}

/// What comes in: read, checked and passed on.
#[derive(Clone)]
pub(crate) struct Intake {
    pub(crate) mission: Name,
    check: Arc<Mutex<SealCheck>>,
    figures: Figures,
    /// Agents whose rejected messages this process reports; unset, it reports all.
    tells_for: Arc<OnceLock<Vec<AgentId>>>,
    sender: mpsc::UnboundedSender<Received>,
}

impl Intake {
    /// Takes a message on its own key.
    fn take(&self, sample: &Sample) {
        let key = sample.key_expr().as_str();
        // A subscriber to everything receives bundled messages on their own keys, too.
        if bundle::host_of(key).is_err() {
            let topic = Topic::parse_key(key, &self.mission);
            let received = topic.clone().and_then(|topic| self.read(sample, topic));
            self.deliver(topic.as_ref().ok(), received);
        }
    }

    fn read(&self, sample: &Sample, topic: Topic) -> Received {
        let bytes = sample.payload().to_bytes();
        self.check_seal(sample, &bytes, || topic.path())?;
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

    /// Checks the seal of what came in, which messages name `key`.
    pub(crate) fn check_seal(
        &self,
        sample: &Sample,
        bytes: &[u8],
        key: impl FnOnce() -> String,
    ) -> Result<(), ProtocolError> {
        let seal = sample.attachment().map(zenoh::bytes::ZBytes::to_bytes);
        lock(&self.check)
            .take(sample.key_expr().as_str(), bytes, seal.as_deref())
            .map_err(|fault| ProtocolError::Seal { key: key(), fault })
    }

    /// Passes on what came in on `topic`; none if it has none. Foreign keys and garbage come out as errors, for the
    /// owner to tell of.
    pub(crate) fn deliver(&self, topic: Option<&Topic>, received: Received) {
        self.figures.received(received.is_ok());
        if received.is_err() {
            let teller = topic.and_then(Topic::refusals_told_by);
            let others = |own: &Vec<AgentId>| teller.is_some_and(|teller| !own.contains(&teller));
            if self.tells_for.get().is_some_and(others) {
                return;
            }
        }
        let _ = self.sender.send(received);
    }
}
