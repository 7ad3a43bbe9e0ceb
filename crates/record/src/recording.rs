//! A recording read back, also one cut short, with the run's digest.

use crate::RecordError;
use crate::recorder::{END_METADATA, FILE_ATTACHMENT, RUN_METADATA, RunInfo, SCENARIO_ATTACHMENT};
use formats::calendar::iso_8601;
use formats::mcap_records::{End, Records, RecordsError, flat};
use mcap::records::Record;
use plume::Gas;
use protocol::digest::Digest;
use protocol::key::Name;
use protocol::{AgentId, Envelope, OLDEST_JSON_VERSION, SimTime, Topic, WIRE_VERSION};
use std::collections::{BTreeMap, VecDeque};
use std::fs::File;
use std::io::{Read as _, Seek as _, SeekFrom};
use std::path::{Path, PathBuf};

/// Bytes of the record that ends a file, with the closing magic.
const FOOTER_BYTES: usize = 37;
/// Largest index at a file's end that is read, bytes.
const SUMMARY_LIMIT: usize = 1 << 28;

type FileRecords = Records<File>;

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
    /// It was finished, and is damaged since.
    Damaged {
        /// What is damaged, in words.
        what: String,
        /// Digest of the run, if it was known and can still be read.
        digest: Option<String>,
    },
    /// It was cut short: its program was killed, the disk was full, or a copy broke off.
    Truncated {
        /// Bytes of the file.
        bytes: u64,
        /// Time of the last message that could be read.
        last: SimTime,
        /// What is damaged before, in words.
        damage: Option<String>,
    },
}

impl RecordingEnd {
    /// What was lost, in words; nothing for a complete recording.
    pub fn loss(&self) -> Option<String> {
        match self {
            Self::Complete { .. } => None,
            Self::Damaged { what, .. } => Some(format!("the recording is {what}")),
            Self::Truncated {
                bytes,
                last,
                damage,
            } => {
                let before = damage
                    .as_ref()
                    .map(|what| format!("; before that it is {what}"));
                Some(format!(
                    "the recording was cut short after {bytes} bytes: all messages up to {:.2} s of simulated \
                     time are read, later ones are lost{}",
                    last.s(),
                    before.unwrap_or_default()
                ))
            }
        }
    }
}

/// Opens the recording at `path` and reads what it says about its run.
///
/// # Errors
/// No file, no MCAP, an MCAP of another program, another wire version, or a file cut short before
/// its scenario.
pub fn read_mcap(path: &Path) -> Result<Recording, RecordError> {
    let refuse = |why: String| RecordError::NotARecording {
        path: path.to_owned(),
        why,
    };
    let mut records = open(path)?.outside_chunks();
    let mut entries: Option<BTreeMap<String, String>> = None;
    let mut scenario: Option<String> = None;
    let mut files = BTreeMap::new();
    while entries.is_none() || scenario.is_none() {
        match records.record().map_err(|e| unreadable(path, e))? {
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
            Some(_) => {}
            // Other tools that wrote it anew may have put them behind the messages.
            None if records.end() == End::Whole => {
                let damage = records
                    .damage()
                    .words()
                    .map(|what| format!("; it is {what}"));
                let damage = damage.unwrap_or_default();
                return Err(refuse(format!("it contains no scenario{damage}")));
            }
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
    // Recordings of earlier versions, which read nothing but CO2, do not say it.
    let gas = take("gas").unwrap_or_else(|_| Gas::Co2.as_str().to_owned());
    let start = take("start").ok();
    let rate = |text: String| {
        text.parse()
            .map_err(|_| format!("its state_hz is '{text}'"))
    };
    let state_hz = take("state_hz").ok().map(rate).transpose()?;
    Ok(RunInfo {
        mission: Name::new(&mission).map_err(|e| e.to_string())?,
        scenario_toml,
        gas: gas
            .parse()
            .map_err(|e| format!("its gas is '{gas}': {e}"))?,
        files: BTreeMap::new(),
        state_hz,
        start_unix_ns: start.map(|s| start_of(&s)).transpose()?,
        seed: seed.parse().map_err(|_| format!("its seed is '{seed}'"))?,
        versions: entries,
    })
}

fn start_of(text: &str) -> Result<i64, String> {
    let unix_s = iso_8601(text).ok_or_else(|| format!("its start is '{text}'"))?;
    Ok(unix_s as i64 * 1_000_000_000)
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
            records: open(&self.path)?,
            path: self.path.clone(),
            mission: self.info.mission.clone(),
            channels: BTreeMap::new(),
            indexed: false,
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
            window_ns: self.lateness_ns()?,
        })
    }

    /// How far behind the newest message before it a message of the file comes at most, ns. Zenoh keeps the order of one
    /// publisher, not across several. In lockstep they are a tick apart. In real time a message waits for as long as a link
    /// is down or the recorder is stopped.
    fn lateness_ns(&self) -> Result<i64, RecordError> {
        let mut records = open(&self.path)?;
        let (mut newest_ns, mut late_ns) = (0, 0);
        // Where the file is damaged the reader of its messages reports it.
        while let Ok(Some(record)) = records.record() {
            if let Record::Message { header, .. } = record {
                newest_ns = header.log_time.max(newest_ns);
                late_ns = late_ns.max(newest_ns - header.log_time);
            }
        }
        Ok(i64::try_from(late_ns).unwrap_or(i64::MAX))
    }

    /// The digest of the run as recorded, and how the recording ends. Where states are thinned
    /// ([`RunInfo::state_hz`]) it is the one that the run itself left at the end of the file.
    ///
    /// # Errors
    /// A message that cannot be read; a recording with thinned states that was cut short.
    pub fn digest(&self) -> Result<(String, RecordingEnd), RecordError> {
        if let Some(state_hz) = self.info.state_hz {
            let mut messages = self.envelopes()?;
            messages
                .by_ref()
                .try_for_each(|message| message.map(|_| ()))?;
            let ending = messages.ending();
            let known = match &ending {
                RecordingEnd::Complete { digest } | RecordingEnd::Damaged { digest, .. } => {
                    digest.clone()
                }
                RecordingEnd::Truncated { .. } => None,
            };
            let unknown = || RecordError::NoDigest {
                path: self.path.clone(),
                state_hz,
            };
            return Ok((known.ok_or_else(unknown)?, ending));
        }
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
    records: FileRecords,
    path: PathBuf,
    mission: Name,
    channels: BTreeMap<u16, Result<Topic, String>>,
    /// Whether the index at the file's end was asked.
    indexed: bool,
    index: u64,
    last: SimTime,
    digest: Option<String>,
    ending: Option<RecordingEnd>,
}

impl Envelopes {
    /// How the recording ends, once all messages have been taken; before, as if cut short here.
    pub fn ending(&self) -> RecordingEnd {
        self.ending.clone().unwrap_or(RecordingEnd::Truncated {
            bytes: self.records.bytes(),
            last: self.last,
            damage: self.records.damage().words(),
        })
    }

    /// How it ends once there is no more to read.
    fn end(&self) -> RecordingEnd {
        let digest = self.digest.clone();
        match (self.records.end(), self.records.damage().words()) {
            (End::Whole, None) => RecordingEnd::Complete { digest },
            (End::Whole, Some(what)) => RecordingEnd::Damaged { what, digest },
            _ => self.ending(),
        }
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
        // A chunk that is lost may have been the one that named it.
        if !self.channels.contains_key(&channel) && !self.indexed {
            self.indexed = true;
            for channel in indexed_channels(&self.path) {
                if !self.channels.contains_key(&channel.id) {
                    self.channel(channel);
                }
            }
        }
        let topic = match self.channels.get(&channel) {
            Some(Ok(topic)) => topic.clone(),
            Some(Err(_)) => return None,
            // What named it is damaged, and counted there.
            None if self.records.damage().places > 0 => return None,
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
            path: self.path.clone(),
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
            match self.records.record() {
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
                Ok(Some(_)) => {}
                Ok(None) => self.ending = Some(self.end()),
                Err(e) => {
                    self.ending = Some(self.ending());
                    return Some(Err(unreadable(&self.path, e)));
                }
            }
        }
        None
    }
}

/// The messages of a recording in the order of time, sender and sequence. It holds as many of them at a time as the latest
/// one came late.
pub struct OrderedEnvelopes {
    envelopes: Envelopes,
    /// The clock's messages are numbered apart from the others of their sender.
    waiting: BTreeMap<(SimTime, AgentId, u64, bool), (Topic, Envelope)>,
    ready: VecDeque<(Topic, Envelope)>,
    window_ns: i64,
}

impl OrderedEnvelopes {
    /// As [`Envelopes::ending`].
    pub fn ending(&self) -> RecordingEnd {
        self.envelopes.ending()
    }

    fn take(&mut self, topic: Topic, envelope: Envelope) {
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
    }

    /// Hands out what is older than `until`: of the same time another sender's message may still come.
    fn release(&mut self, until: SimTime) {
        while let Some(first) = self.waiting.first_entry() {
            if first.key().0 >= until {
                return;
            }
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
                    self.take(topic, envelope);
                    // Nothing older than the window comes any more, so that what is older is in order.
                    let newest = self.envelopes.last.ns();
                    self.release(SimTime::from_ns(newest.saturating_sub(self.window_ns)));
                }
                Some(Err(e)) => return Some(Err(e)),
                None if self.waiting.is_empty() => return None,
                None => self.release(SimTime::from_ns(i64::MAX)),
            }
        }
        self.ready.pop_front().map(Ok)
    }
}

/// The records of the file at `path`.
fn open(path: &Path) -> Result<FileRecords, RecordError> {
    let file = File::open(path).map_err(|source| RecordError::File {
        path: path.to_owned(),
        what: "open",
        source,
    })?;
    Records::new(file).map_err(|e| unreadable(path, e))
}

fn unreadable(path: &Path, error: RecordsError) -> RecordError {
    let path = path.to_owned();
    match error {
        RecordsError::Read(source) => RecordError::File {
            path,
            what: "read",
            source,
        },
        none @ RecordsError::NoMcap => RecordError::NotARecording {
            path,
            why: none.to_string(),
        },
    }
}

/// The channels that the index at the file's end names: of those that a damaged chunk would have told. None where
/// the file was cut short.
fn indexed_channels(path: &Path) -> Vec<mcap::records::Channel> {
    let summary = || {
        let mut file = File::open(path).ok()?;
        let footer_bytes = FOOTER_BYTES as u64;
        let length = file.metadata().ok()?.len();
        file.seek(SeekFrom::Start(length.checked_sub(footer_bytes)?))
            .ok()?;
        let mut footer = [0; FOOTER_BYTES];
        file.read_exact(&mut footer).ok()?;
        let Record::Footer(footer) = mcap::parse_record(footer[0], &footer[9..]).ok()? else {
            return None;
        };
        let start = Some(footer.summary_start).filter(|s| *s > 0)?;
        file.seek(SeekFrom::Start(start)).ok()?;
        let length = usize::try_from(length.checked_sub(start + footer_bytes)?).ok()?;
        let mut summary = vec![0; Some(length).filter(|l| *l <= SUMMARY_LIMIT)?];
        file.read_exact(&mut summary).ok()?;
        Some(summary)
    };
    let Some(summary) = summary() else {
        return Vec::new();
    };
    let channel = |record| match record {
        Record::Channel(channel) => Some(channel),
        _ => None,
    };
    flat(&summary).filter_map(channel).collect()
}
