//! A recording read back, also one cut short, with the run's digest.

use crate::RecordError;
use crate::recorder::{END_METADATA, FILE_ATTACHMENT, RUN_METADATA, RunInfo, SCENARIO_ATTACHMENT};
use mcap::McapError;
use mcap::records::Record;
use mcap::sans_io::linear_reader::{LinearReadEvent, LinearReader, LinearReaderOptions};
use protocol::digest::Digest;
use protocol::key::Name;
use protocol::{AgentId, Envelope, OLDEST_JSON_VERSION, SimTime, Topic, WIRE_VERSION};
use std::collections::{BTreeMap, VecDeque};
use std::fs::File;
use std::io::{BufReader, Read as _};
use std::path::{Path, PathBuf};

/// Largest record or chunk that is read, bytes: no file can make a reader allocate more.
const RECORD_LIMIT: usize = 1 << 28;
/// How far messages of several senders may be apart in a file recorded from a network and still
/// be brought into order, simulated ns. Zenoh keeps the order of one publisher, not across several;
/// in lockstep they are a tick apart, in real time as far as a link delays them.
const REORDER_WINDOW_NS: i64 = 2_000_000_000;

/// A recording of a mission.
#[derive(Debug, Clone)]
pub struct Recording {
    path: PathBuf,
    /// What it says about its run.
    pub info: RunInfo,
}

/// How a recording ends.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum RecordingEnd {
    /// It was finished.
    Complete {
        /// Digest of the run, if it was known.
        digest: Option<String>,
    },
    /// It was cut short: its program was killed, the disk was full, or a copy broke off.
    Truncated {
        /// Bytes of the file.
        bytes: u64,
        /// Time of the last message that could be read.
        last: SimTime,
    },
}

impl RecordingEnd {
    /// What was lost, in words; nothing for a complete recording.
    pub fn loss(&self) -> Option<String> {
        match self {
            Self::Complete { .. } => None,
            Self::Truncated { bytes, last } => Some(format!(
                "the recording was cut short after {bytes} bytes: everything up to {:.2} s of \
                 simulated time is read, what followed is lost",
                last.s()
            )),
        }
    }
}

/// Opens the recording at `path` and reads what it says about its run.
///
/// # Errors
/// No file, no MCAP, an MCAP of somebody else, another wire version, or a file cut short before
/// its scenario.
pub fn read_mcap(path: &Path) -> Result<Recording, RecordError> {
    let refuse = |why: String| RecordError::NotARecording {
        path: path.to_owned(),
        why,
    };
    let mut records = Records::open(path)?;
    let mut entries: Option<BTreeMap<String, String>> = None;
    let mut scenario: Option<String> = None;
    let mut files = BTreeMap::new();
    while entries.is_none() || scenario.is_none() {
        match records.next()? {
            Some(Record::Metadata(m)) if m.name == RUN_METADATA => entries = Some(m.metadata),
            Some(Record::Attachment { header, data, .. }) if header.name == SCENARIO_ATTACHMENT => {
                let text = String::from_utf8(data.into_owned());
                scenario = Some(text.map_err(|_| refuse("its scenario is not UTF-8".to_owned()))?);
            }
            Some(Record::Attachment { header, data, .. }) => {
                if let Some(name) = header.name.strip_prefix(FILE_ATTACHMENT) {
                    files.insert(name.to_owned(), data.into_owned());
                }
            }
            Some(Record::Message { .. } | Record::DataEnd(_)) => {
                return Err(refuse("it holds no run and no scenario".to_owned()));
            }
            Some(_) => {}
            None => return Err(refuse("it ends before its scenario".to_owned())),
        }
    }
    let info = run_info(entries.unwrap_or_default(), scenario.unwrap_or_default());
    Ok(Recording {
        path: path.to_owned(),
        info: RunInfo {
            files,
            ..info.map_err(refuse)?
        },
    })
}

fn run_info(
    mut entries: BTreeMap<String, String>,
    scenario_toml: String,
) -> Result<RunInfo, String> {
    let mut take = |name: &str| {
        entries
            .remove(name)
            .ok_or_else(|| format!("its metadata lacks {name}"))
    };
    let wire = take("wire_version")?;
    let read = OLDEST_JSON_VERSION..=WIRE_VERSION;
    if !wire.parse().is_ok_and(|v| read.contains(&v)) {
        return Err(format!(
            "its messages are of wire version {wire} and this program reads {OLDEST_JSON_VERSION} to \
             {WIRE_VERSION}"
        ));
    }
    let mission = take("mission")?;
    let seed = take("seed")?;
    Ok(RunInfo {
        mission: Name::new(&mission).map_err(|e| e.to_string())?,
        scenario_toml,
        files: BTreeMap::new(),
        seed: seed.parse().map_err(|_| format!("its seed is '{seed}'"))?,
        versions: entries,
    })
}

impl Recording {
    /// Where it is.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// All messages, in the order of the file.
    ///
    /// # Errors
    /// The file is gone.
    pub fn envelopes(&self) -> Result<Envelopes, RecordError> {
        Ok(Envelopes {
            records: Records::open(&self.path)?,
            mission: self.info.mission.clone(),
            channels: BTreeMap::new(),
            index: 0,
            last: SimTime::ZERO,
            digest: None,
            ending: None,
        })
    }

    /// All messages, in the order in which they are handled: time, sender, sequence.
    ///
    /// # Errors
    /// The file is gone.
    pub fn in_order(&self) -> Result<OrderedEnvelopes, RecordError> {
        Ok(OrderedEnvelopes {
            envelopes: self.envelopes()?,
            waiting: BTreeMap::new(),
            ready: VecDeque::new(),
            given: SimTime::ZERO,
        })
    }

    /// The digest of the run as recorded, and how the recording ends.
    ///
    /// # Errors
    /// A message that cannot be read or comes too late in the file.
    pub fn digest(&self) -> Result<(String, RecordingEnd), RecordError> {
        let mut digest = Digest::new();
        let mut messages = self.in_order()?;
        for message in messages.by_ref() {
            let (topic, envelope) = message?;
            digest.add(&topic, &envelope);
        }
        Ok((digest.hex(), messages.ending()))
    }
}

/// The messages of a recording, in the order of the file.
pub struct Envelopes {
    records: Records,
    mission: Name,
    channels: BTreeMap<u16, Result<Topic, String>>,
    index: u64,
    last: SimTime,
    digest: Option<String>,
    ending: Option<RecordingEnd>,
}

impl Envelopes {
    /// How the recording ends, once all messages have been taken; before, as if cut short here.
    pub fn ending(&self) -> RecordingEnd {
        self.ending.clone().unwrap_or(RecordingEnd::Truncated {
            bytes: self.records.bytes,
            last: self.last,
        })
    }

    fn channel(&mut self, channel: mcap::records::Channel) {
        let topic = Topic::parse_key(&channel.topic, &self.mission);
        let topic = topic.map_err(|_| channel.topic);
        self.channels.insert(channel.id, topic);
    }

    /// The message, or nothing for a channel that is not of this mission: others may add theirs.
    fn message(
        &mut self,
        channel: u16,
        data: &[u8],
    ) -> Option<Result<(Topic, Envelope), RecordError>> {
        self.index += 1;
        let topic = match self.channels.get(&channel) {
            Some(Ok(topic)) => topic.clone(),
            Some(Err(_)) => return None,
            None => {
                return Some(Err(
                    self.broken(format!("channel {channel}"), "no such channel")
                ));
            }
        };
        let read = std::str::from_utf8(data)
            .map_err(|e| e.to_string())
            .and_then(|text| Envelope::from_json(&topic, text).map_err(|e| e.to_string()));
        Some(match read {
            Ok(envelope) => {
                self.last = self.last.max(envelope.time);
                Ok((topic, envelope))
            }
            Err(why) => Err(self.broken(topic.path(), &why)),
        })
    }

    fn broken(&self, key: String, why: &str) -> RecordError {
        RecordError::Message {
            path: self.records.path.clone(),
            index: self.index,
            key,
            why: why.to_owned(),
        }
    }
}

impl Iterator for Envelopes {
    type Item = Result<(Topic, Envelope), RecordError>;

    fn next(&mut self) -> Option<Self::Item> {
        while self.ending.is_none() {
            match self.records.next() {
                Ok(Some(Record::Channel(channel))) => self.channel(channel),
                Ok(Some(Record::Message { header, data })) => {
                    let message = self.message(header.channel_id, &data);
                    if message.is_some() {
                        return message;
                    }
                }
                Ok(Some(Record::Metadata(m))) if m.name == END_METADATA => {
                    self.digest = m.metadata.get("digest").cloned();
                }
                Ok(Some(Record::DataEnd(_))) => {
                    self.ending = Some(RecordingEnd::Complete {
                        digest: self.digest.clone(),
                    });
                }
                Ok(Some(_)) => {}
                Ok(None) => self.ending = Some(self.ending()),
                Err(e) => {
                    self.ending = Some(self.ending());
                    return Some(Err(e));
                }
            }
        }
        None
    }
}

/// The messages of a recording in the order of time, sender and sequence. It holds two
/// simulated seconds of them at a time.
pub struct OrderedEnvelopes {
    envelopes: Envelopes,
    /// The clock's messages are numbered apart from the others of their sender.
    waiting: BTreeMap<(SimTime, AgentId, u64, bool), (Topic, Envelope)>,
    ready: VecDeque<(Topic, Envelope)>,
    given: SimTime,
}

impl OrderedEnvelopes {
    /// As [`Envelopes::ending`].
    pub fn ending(&self) -> RecordingEnd {
        self.envelopes.ending()
    }

    fn take(&mut self, topic: Topic, envelope: Envelope) -> Result<(), RecordError> {
        if envelope.time < self.given {
            return Err(RecordError::OutOfOrder {
                path: self.envelopes.records.path.clone(),
                sender: envelope.sender.to_string(),
                sequence: envelope.sequence,
                late_s: self.envelopes.last.since_s(envelope.time),
            });
        }
        // Ordered as agents handle them; one sender and sequence may stand for a message of the clock
        // and another, since these are numbered apart.
        let of_clock = matches!(topic, Topic::Tick | Topic::Done(_));
        let key = (
            envelope.time,
            envelope.sender.clone(),
            envelope.sequence,
            of_clock,
        );
        self.waiting.insert(key, (topic, envelope));
        Ok(())
    }

    fn release(&mut self, until: SimTime) {
        while let Some(first) = self.waiting.first_entry() {
            if first.key().0 > until {
                return;
            }
            self.given = first.key().0;
            self.ready.push_back(first.remove());
        }
    }
}

impl Iterator for OrderedEnvelopes {
    type Item = Result<(Topic, Envelope), RecordError>;

    fn next(&mut self) -> Option<Self::Item> {
        while self.ready.is_empty() {
            match self.envelopes.next() {
                Some(Ok((topic, envelope))) => {
                    if let Err(e) = self.take(topic, envelope) {
                        return Some(Err(e));
                    }
                    // Nothing older than the window may still come, so that what is older is in order.
                    let newest = self.envelopes.last.ns();
                    self.release(SimTime::from_ns(newest.saturating_sub(REORDER_WINDOW_NS)));
                }
                Some(Err(e)) => return Some(Err(e)),
                None if self.waiting.is_empty() => return None,
                None => self.release(SimTime::from_ns(i64::MAX)),
            }
        }
        self.ready.pop_front().map(Ok)
    }
}

/// The records of an MCAP file, chunks unpacked. Its end and being cut short are both `None`.
struct Records {
    path: PathBuf,
    file: BufReader<File>,
    reader: LinearReader,
    bytes: u64,
    ended: bool,
}

impl Records {
    fn open(path: &Path) -> Result<Self, RecordError> {
        let file = File::open(path).map_err(|source| RecordError::File {
            path: path.to_owned(),
            what: "open",
            source,
        })?;
        let options = LinearReaderOptions::default()
            // Before a chunk is unpacked: a damaged one is refused whole, not half read.
            .with_prevalidate_chunk_crcs(true)
            .with_validate_data_section_crc(true)
            .with_record_length_limit(RECORD_LIMIT);
        Ok(Self {
            path: path.to_owned(),
            file: BufReader::new(file),
            reader: LinearReader::new_with_options(options),
            bytes: 0,
            ended: false,
        })
    }

    fn next(&mut self) -> Result<Option<Record<'static>>, RecordError> {
        while !self.ended {
            match self.reader.next_event() {
                Some(Ok(LinearReadEvent::ReadRequest(need))) => {
                    let read = self.file.read(self.reader.insert(need));
                    let read = read.map_err(|source| RecordError::File {
                        path: self.path.clone(),
                        what: "read",
                        source,
                    })?;
                    self.bytes += read as u64;
                    self.reader.notify_read(read);
                }
                Some(Ok(LinearReadEvent::Record { data, opcode })) => {
                    return mcap::parse_record(opcode, data)
                        .map(|record| Some(record.into_owned()))
                        .map_err(|e| damaged(&self.path, self.bytes, &e));
                }
                Some(Err(McapError::UnexpectedEof)) | None => self.ended = true,
                Some(Err(e)) => {
                    self.ended = true;
                    return Err(damaged(&self.path, self.bytes, &e));
                }
            }
        }
        Ok(None)
    }
}

fn damaged(path: &Path, byte: u64, error: &McapError) -> RecordError {
    let why = match error {
        McapError::BadMagic if byte <= 16 => "it does not begin as an MCAP file".to_owned(),
        other => format!("it is damaged before byte {byte} ({other})"),
    };
    RecordError::NotARecording {
        path: path.to_owned(),
        why,
    }
}
