//! Every message on the bus into one MCAP file.
//!
//! One channel a key, JSON with its JSON Schema, so that any MCAP tool reads it. Chunks are
//! closed after [`CHUNK_SIM_NS`] of simulated or [`CHUNK_WALL`] of wall time and handed to the
//! system whole, so that a killed program loses less than a second. The scenario stands at the
//! front as an attachment, seed and versions as metadata: a file cut short still has them.

use crate::RecordError;
use crate::appended::Appended;
use formats::calendar::rfc_3339;
use mcap::records::{MessageHeader, Metadata};
use mcap::{Attachment, Compression, WriteOptions};
use plume::Gas;
use protocol::key::Name;
use protocol::message::{Message, VehicleKind};
use protocol::{Envelope, SimTime, Topic, WIRE_VERSION};
use std::borrow::Cow;
use std::collections::{BTreeMap, HashMap};
use std::fs::File;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, sync_channel};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// Simulated time after which a chunk is closed, ns. With a batch on its way and one being filled
/// (0.1 s each) a killed program loses less than a second; shorter chunks compress worse.
pub const CHUNK_SIM_NS: i64 = 400_000_000;
/// Wall time after which a chunk is closed.
pub const CHUNK_WALL: Duration = Duration::from_millis(400);
/// Uncompressed size at which a chunk is closed, bytes: a chunk has an index for each channel in it, and a thousand
/// vehicles have three thousand.
const CHUNK_BYTES: u64 = 4 << 20;
/// Name of the metadata record at the front of a recording.
pub(crate) const RUN_METADATA: &str = "plumage.run";
/// Name of the metadata record at the end of a finished recording.
pub(crate) const END_METADATA: &str = "plumage.end";
/// Names of the attachments that hold the files which the scenario names begin with this.
pub(crate) const FILE_ATTACHMENT: &str = "files/";
/// Name of the attachment that holds the resolved scenario.
pub(crate) const SCENARIO_ATTACHMENT: &str = "scenario.toml";

/// What a recording says about its run.
#[derive(Debug, Clone, PartialEq)]
pub struct RunInfo {
    /// Name of the mission, as in its keys.
    pub mission: Name,
    /// The resolved scenario, TOML.
    pub scenario_toml: String,
    /// The gas that was read: `co2_ppm` of all messages is its mole fraction.
    pub gas: Gas,
    /// The files that the scenario names, by the names that it gives them.
    pub files: BTreeMap<String, Vec<u8>>,
    /// When the mission began, whole s in ns since 1970, where its scenario says so.
    pub start_unix_ns: Option<i64>,
    /// Rate at which states, readings and ambients of each simulated vehicle are recorded, Hz; none where all are.
    pub state_hz: Option<f64>,
    /// Seed of the run.
    pub seed: u64,
    /// Versions of what ran, by name: `plumage`, `git`, …
    pub versions: BTreeMap<String, String>,
}

/// What became of a recording.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct RecordingTotals {
    /// Messages written.
    pub messages: u64,
    /// Messages left out because they hold a number that is not finite, by key.
    pub not_finite: BTreeMap<String, u64>,
}

/// Writes a recording. Dropped without [`Recorder::finish`] it still closes the file.
pub struct Recorder {
    path: PathBuf,
    mission: Name,
    start_unix_ns: i64,
    writer: mcap::Writer<Appended>,
    /// Nobody iterates over it.
    channels: HashMap<Topic, Channel>,
    /// Schemas by the kind of message.
    schemas: BTreeMap<&'static str, u16>,
    /// The JSON of one message, for the next as well.
    json: Vec<u8>,
    /// Channels of messages that stand beside the mission's.
    beside: BTreeMap<String, Channel>,
    chunk: Option<(SimTime, Instant)>,
    totals: RecordingTotals,
    /// None where every message is recorded.
    thinning: Option<Thinning>,
}

/// Which states, readings and ambients of simulated vehicles are recorded.
struct Thinning {
    period_ns: i64,
    /// When the next message on a topic is due; nobody iterates over it.
    due: HashMap<Topic, SimTime>,
}

impl Thinning {
    fn of(info: &RunInfo) -> Option<Self> {
        let period_s = 1.0 / info.state_hz?;
        Some(Self {
            period_ns: SimTime::from_s(period_s).ns(),
            due: HashMap::new(),
        })
    }

    /// Whether a message is recorded; what is measured by a real vehicle always is.
    fn keeps(&mut self, topic: &Topic, envelope: &Envelope) -> bool {
        let is_periodic = match &envelope.message {
            Message::State(state) => state.kind == VehicleKind::Simulated,
            Message::Reading(reading) => reading.kind == VehicleKind::Simulated,
            Message::Ambient(_) => true,
            _ => false,
        };
        if !is_periodic {
            return true;
        }
        let is_due = self.due.get(topic).is_none_or(|due| envelope.time >= *due);
        if is_due {
            let next = envelope.time.later(self.period_ns);
            self.due.insert(topic.clone(), next);
        }
        is_due
    }
}

struct Channel {
    id: u16,
    sequence: u32,
}

impl Recorder {
    /// Starts a recording at `path`, which must not exist: nothing recorded is ever overwritten.
    ///
    /// # Errors
    /// The file exists or cannot be written.
    pub fn create(path: &Path, info: &RunInfo) -> Result<Self, RecordError> {
        let file = File::create_new(path).map_err(|source| match source.kind() {
            ErrorKind::AlreadyExists => RecordError::Exists {
                path: path.to_owned(),
                what: "a recording of this name exists",
            },
            _ => RecordError::File {
                path: path.to_owned(),
                what: "create the recording",
                source,
            },
        })?;
        let fail = |source| RecordError::Mcap {
            path: path.to_owned(),
            source,
        };
        let mut writer = WriteOptions::new()
            .compression(Some(Compression::Zstd))
            .compression_level(1)
            .compression_threads(0)
            .chunk_size(Some(CHUNK_BYTES))
            // Compression in this thread at the lowest level: the recorder's own thread must keep up
            // with a mission many times faster than real time, and JSON shrinks well at any level.
            // A chunk is built in memory and appended whole: no half-written header after a kill.
            .disable_seeking(true)
            .library(format!("plumage {}", env!("CARGO_PKG_VERSION")))
            .create(Appended::new(file))
            .map_err(fail)?;
        write_front(&mut writer, info).map_err(fail)?;
        Ok(Self {
            path: path.to_owned(),
            mission: info.mission.clone(),
            start_unix_ns: info.start_unix_ns.unwrap_or(0),
            writer,
            channels: HashMap::new(),
            schemas: BTreeMap::new(),
            json: Vec::new(),
            beside: BTreeMap::new(),
            chunk: None,
            totals: RecordingTotals::default(),
            thinning: Thinning::of(info),
        })
    }

    /// Records one message, if those of its kind are recorded now ([`RunInfo::state_hz`]). One with a number that is not
    /// finite is left out and counted.
    ///
    /// # Errors
    /// The file cannot be written (disk full, …); what was recorded before stays.
    pub fn record(&mut self, topic: &Topic, envelope: &Envelope) -> Result<(), RecordError> {
        if let Some(thinning) = &mut self.thinning
            && !thinning.keeps(topic, envelope)
        {
            return Ok(());
        }
        envelope.write_json(&mut self.json);
        if !is_faithful(&self.json, topic, envelope) {
            let key = topic.key(&self.mission);
            *self.totals.not_finite.entry(key).or_default() += 1;
            return Ok(());
        }
        self.close_chunk_if_due(envelope.time)?;
        let channel = self.channel(topic)?;
        // Both times are simulated, from the start that the scenario says, in the order of time, sender and
        // sequence in which agents handle messages: MCAP tools sort by log_time, and no wall clock may enter a
        // repeatable file.
        let json = std::mem::take(&mut self.json);
        let written = self.write(channel, envelope.time, &json);
        self.json = json;
        written?;
        self.totals.messages += 1;
        Ok(())
    }

    /// Writes JSON with an external `schema` beside the mission's messages, on a separate `topic`.
    ///
    /// # Errors
    /// As [`Recorder::record`].
    pub fn beside(
        &mut self,
        topic: &str,
        schema: (&str, &serde_json::Value),
        time: SimTime,
        json: &str,
    ) -> Result<(), RecordError> {
        let (id, sequence) = match self.beside.get_mut(topic) {
            Some(channel) => {
                channel.sequence = channel.sequence.wrapping_add(1);
                (channel.id, channel.sequence)
            }
            None => {
                let schema = self.add_schema(schema.0, schema.1)?;
                let id = self.add_channel(topic, schema)?;
                self.beside
                    .insert(topic.to_owned(), Channel { id, sequence: 1 });
                (id, 1)
            }
        };
        self.write((id, sequence), time, json.as_bytes())
    }

    fn write(
        &mut self,
        channel: (u16, u32),
        time: SimTime,
        json: &[u8],
    ) -> Result<(), RecordError> {
        let since_ns = time.ns();
        let time_ns = u64::try_from(self.start_unix_ns.saturating_add(since_ns)).unwrap_or(0);
        let header = MessageHeader {
            channel_id: channel.0,
            sequence: channel.1,
            log_time: time_ns,
            publish_time: time_ns,
        };
        self.writer
            .write_to_known_channel(&header, json)
            .map_err(|source| self.failed(source))
    }

    /// Hands everything recorded so far to the system.
    ///
    /// # Errors
    /// As [`Recorder::record`].
    pub fn flush(&mut self) -> Result<(), RecordError> {
        self.chunk = None;
        self.writer.flush().map_err(|source| self.failed(source))
    }

    /// Ends the recording with the run's digest, index and statistics.
    ///
    /// # Errors
    /// As [`Recorder::record`].
    pub fn finish(mut self, digest: Option<&str>) -> Result<RecordingTotals, RecordError> {
        let mut entries =
            BTreeMap::from([("messages".to_owned(), self.totals.messages.to_string())]);
        if let Some(digest) = digest {
            entries.insert("digest".to_owned(), digest.to_owned());
        }
        for (key, count) in &self.totals.not_finite {
            entries.insert(format!("not_finite {key}"), count.to_string());
        }
        let end = Metadata {
            name: END_METADATA.to_owned(),
            metadata: entries,
        };
        self.writer
            .write_metadata(&end)
            .and_then(|()| self.writer.finish())
            .map_err(|source| self.failed(source))?;
        let Self {
            writer,
            path,
            totals,
            ..
        } = self;
        // Finished means on the disk, not in the system's cache.
        let synced = writer.into_inner().sync();
        synced.map_err(|source| RecordError::File {
            path,
            what: "write",
            source,
        })?;
        Ok(totals)
    }

    fn close_chunk_if_due(&mut self, now: SimTime) -> Result<(), RecordError> {
        match self.chunk {
            None => self.chunk = Some((now, Instant::now())),
            Some((since, wall)) => {
                if now.ns() - since.ns() >= CHUNK_SIM_NS || wall.elapsed() >= CHUNK_WALL {
                    self.flush()?;
                    self.chunk = Some((now, Instant::now()));
                }
            }
        }
        Ok(())
    }

    fn channel(&mut self, topic: &Topic) -> Result<(u16, u32), RecordError> {
        if let Some(channel) = self.channels.get_mut(topic) {
            channel.sequence = channel.sequence.wrapping_add(1);
            return Ok((channel.id, channel.sequence));
        }
        let kind = Message::name_on(topic);
        let schema = match self.schemas.get(kind) {
            Some(schema) => *schema,
            None => {
                let schema = Envelope::json_schema(topic);
                let name = schema["title"].as_str().unwrap_or("plumage").to_owned();
                let schema = self.add_schema(&name, &schema)?;
                self.schemas.insert(kind, schema);
                schema
            }
        };
        let id = self.add_channel(&topic.key(&self.mission), schema)?;
        self.channels
            .insert(topic.clone(), Channel { id, sequence: 1 });
        Ok((id, 1))
    }

    fn add_schema(&mut self, name: &str, schema: &serde_json::Value) -> Result<u16, RecordError> {
        let text = schema.to_string();
        let added = self.writer.add_schema(name, "jsonschema", text.as_bytes());
        added.map_err(|source| self.failed(source))
    }

    fn add_channel(&mut self, key: &str, schema: u16) -> Result<u16, RecordError> {
        let added = self
            .writer
            .add_channel(schema, key, "json", &BTreeMap::new());
        added.map_err(|source| self.failed(source))
    }

    fn failed(&self, source: mcap::McapError) -> RecordError {
        RecordError::Mcap {
            path: self.path.clone(),
            source,
        }
    }
}

fn write_front(writer: &mut mcap::Writer<Appended>, info: &RunInfo) -> mcap::McapResult<()> {
    let mut entries = info.versions.clone();
    entries.insert("mission".to_owned(), info.mission.to_string());
    entries.insert("gas".to_owned(), info.gas.as_str().to_owned());
    entries.insert("seed".to_owned(), info.seed.to_string());
    if let Some(start) = info.start_unix_ns {
        entries.insert("start".to_owned(), rfc_3339(start).replace(".000Z", "Z"));
    }
    if let Some(state_hz) = info.state_hz {
        entries.insert("state_hz".to_owned(), state_hz.to_string());
    }
    entries.insert("wire_version".to_owned(), WIRE_VERSION.to_string());
    writer.write_metadata(&Metadata {
        name: RUN_METADATA.to_owned(),
        metadata: entries,
    })?;
    let begun_ns = info
        .start_unix_ns
        .and_then(|ns| u64::try_from(ns).ok())
        .unwrap_or(0);
    let mut attach = |name: String, media_type: &str, data: &[u8]| {
        writer.attach(&Attachment {
            log_time: begun_ns,
            create_time: begun_ns,
            name,
            media_type: media_type.to_owned(),
            data: Cow::Borrowed(data),
        })
    };
    for (name, bytes) in &info.files {
        let name = format!("{FILE_ATTACHMENT}{name}");
        attach(name, "application/octet-stream", bytes)?;
    }
    // Last: who has read it has all of the front.
    let scenario = info.scenario_toml.as_bytes();
    attach(SCENARIO_ATTACHMENT.to_owned(), "application/toml", scenario)?;
    writer.flush()
}

/// Whether the JSON form says the same as the envelope. JSON has no form for what is not finite
/// and `null` stands in its place, which elsewhere means a value left out.
fn is_faithful(json: &[u8], topic: &Topic, envelope: &Envelope) -> bool {
    const NULL: &[u8] = b"null";
    // Of these, the most by far, all numbers are checked, and plausible ones are finite.
    let is_finite = matches!(
        envelope.message,
        Message::State(_) | Message::Reading(_) | Message::Ambient(_)
    ) && envelope.message.check_numbers(topic).is_ok();
    let read = || {
        std::str::from_utf8(json)
            .is_ok_and(|text| Envelope::from_json(topic, text).is_ok_and(|read| read == *envelope))
    };
    is_finite || !json.windows(NULL.len()).any(|at| at == NULL) || read()
}

type Batch = Vec<(Topic, Envelope)>;

/// Simulated time after which a batch goes to the recorder's thread, ns.
const BATCH_SIM_NS: i64 = 100_000_000;
/// Messages at which a batch goes to the recorder's thread.
const BATCH_MESSAGES: usize = 4096;
/// Batches that may wait: with the chunk and the batches being filled and written, less than a
/// second of simulated time is ever in memory alone.
const BATCHES_WAITING: usize = 2;

/// A [`Recorder`] on its own thread, for missions that run faster than one core can simulate
/// and write. When the file does not keep up the caller waits; nothing is dropped.
pub struct ThreadedRecorder {
    path: PathBuf,
    batch: Batch,
    since: SimTime,
    /// In place of the recorder's own: what is not recorded is not copied.
    thinning: Option<Thinning>,
    sender: SyncSender<Batch>,
    thread: JoinHandle<Result<Recorder, RecordError>>,
}

impl ThreadedRecorder {
    /// Starts a recording as [`Recorder::create`] does, and the thread.
    ///
    /// # Errors
    /// As [`Recorder::create`].
    pub fn create(path: &Path, info: &RunInfo) -> Result<Self, RecordError> {
        let mut recorder = Recorder::create(path, info)?;
        let thinning = recorder.thinning.take();
        let (sender, receiver) = sync_channel(BATCHES_WAITING);
        let thread = std::thread::Builder::new()
            .name("recorder".to_owned())
            .spawn(move || write_all(recorder, &receiver))
            .map_err(|source| RecordError::File {
                path: path.to_owned(),
                what: "start the recording thread",
                source,
            })?;
        Ok(Self {
            path: path.to_owned(),
            batch: Vec::new(),
            since: SimTime::ZERO,
            thinning,
            sender,
            thread,
        })
    }

    /// Takes one message to be recorded. Waits while the file does not keep up.
    ///
    /// # Errors
    /// [`RecordError::Stopped`] once the thread has failed; [`ThreadedRecorder::finish`] says why.
    pub fn record(&mut self, topic: &Topic, envelope: &Envelope) -> Result<(), RecordError> {
        if let Some(thinning) = &mut self.thinning
            && !thinning.keeps(topic, envelope)
        {
            return Ok(());
        }
        let due = envelope.time.ns() - self.since.ns() >= BATCH_SIM_NS;
        if !self.batch.is_empty() && (due || self.batch.len() >= BATCH_MESSAGES) {
            self.flush()?;
        }
        if self.batch.is_empty() {
            self.since = envelope.time;
        }
        self.batch.push((topic.clone(), envelope.clone()));
        Ok(())
    }

    /// Hands what was taken so far to the thread: before a pause, for example.
    ///
    /// # Errors
    /// As [`ThreadedRecorder::record`].
    pub fn flush(&mut self) -> Result<(), RecordError> {
        let next = Vec::with_capacity(self.batch.len());
        let batch = std::mem::replace(&mut self.batch, next);
        self.sender.send(batch).map_err(|_| RecordError::Stopped {
            path: self.path.clone(),
        })
    }

    /// Waits for the thread to write all, and ends the recording as [`Recorder::finish`] does.
    ///
    /// # Errors
    /// What the thread met, if anything; what was written before stays.
    pub fn finish(mut self, digest: Option<&str>) -> Result<RecordingTotals, RecordError> {
        // A failed hand-over has its reason in the thread's own answer.
        let _ = self.flush();
        drop(self.sender);
        match self.thread.join() {
            Ok(recorder) => recorder?.finish(digest),
            Err(_) => Err(RecordError::Stopped { path: self.path }),
        }
    }
}

fn write_all(mut recorder: Recorder, batches: &Receiver<Batch>) -> Result<Recorder, RecordError> {
    loop {
        match batches.recv_timeout(CHUNK_WALL) {
            Ok(batch) => {
                for (topic, envelope) in &batch {
                    recorder.record(topic, envelope)?;
                }
            }
            // Nobody speaks (a pause): what waits in the open chunk goes to the system.
            Err(RecvTimeoutError::Timeout) => recorder.flush()?,
            Err(RecvTimeoutError::Disconnected) => return Ok(recorder),
        }
    }
}
