//! Recordings of ROS 2 in MCAP: messages in CDR, described by their definitions in the file.
//!
//! Formats: mcap.dev, *Well-known encodings*, and those of [`formats`].

use super::series_log::{Collected, SeriesLog, Wanted};
use crate::ImportError;
use formats::cdr::{Cdr, Definitions, short};
use formats::mcap_records::{End, Records, RecordsError};
use mcap::records::Record;
use std::collections::{BTreeMap, BTreeSet};
use std::io::Read;

mod platforms;

use platforms::{FIX, Recorded};

/// Bytes of messages that are kept until their channel is known: it may stand in the index at the end, if the chunk
/// that named it is damaged.
const WAITING_LIMIT: usize = 1 << 26;

/// What is gathered while a recording is read.
#[derive(Default)]
struct Gathered {
    series: Collected,
    /// Names, encodings and texts of the definitions.
    schemas: BTreeMap<u16, (String, String, String)>,
    channels: BTreeMap<u16, Channel>,
    /// Channels whose messages cannot be read.
    others: BTreeSet<u16>,
    /// Messages on channels that nothing has named yet: channel, time, bytes.
    waiting: Vec<(u16, u64, Vec<u8>)>,
    waiting_bytes: usize,
    read: usize,
    passed: usize,
}

/// A topic whose messages can be read.
struct Channel {
    topic: String,
    /// The type's name without its package.
    kind: String,
    definitions: Definitions,
}

impl Gathered {
    fn take(&mut self, record: Record<'_>, wanted: &Wanted) {
        match record {
            Record::Schema { header, data } => {
                let text = crate::decode::letters(&data);
                self.schemas
                    .insert(header.id, (header.name, header.encoding, text));
            }
            Record::Channel(channel) => {
                let schema = self.schemas.get(&channel.schema_id);
                let schema =
                    schema.filter(|(_, e, _)| e == "ros2msg" && channel.message_encoding == "cdr");
                if let Some((name, _, text)) = schema {
                    let kind = short(name).to_owned();
                    let definitions = Definitions::parse(name, text);
                    let topic = channel.topic;
                    self.channels.insert(
                        channel.id,
                        Channel {
                            topic,
                            kind,
                            definitions,
                        },
                    );
                } else {
                    self.others.insert(channel.id);
                }
            }
            Record::Message { header, data } => {
                self.message(header.channel_id, header.log_time, &data, wanted)
            }
            _ => {}
        }
    }

    /// Reads what waited for its channel; what still has none is passed over.
    fn catch_up(&mut self, wanted: &Wanted) {
        for (channel, log_time_ns, data) in std::mem::take(&mut self.waiting) {
            if self.channels.contains_key(&channel) {
                self.message(channel, log_time_ns, &data, wanted);
            } else {
                self.passed += 1;
            }
        }
    }

    fn message(&mut self, channel: u16, log_time_ns: u64, data: &[u8], wanted: &Wanted) {
        let Some(channel) = self.channels.get(&channel) else {
            if self.others.contains(&channel) || self.waiting_bytes + data.len() > WAITING_LIMIT {
                self.passed += 1;
            } else {
                self.waiting_bytes += data.len();
                self.waiting.push((channel, log_time_ns, data.to_vec()));
            }
            return;
        };
        let mut found = Vec::new();
        let decoded = Cdr::new(data)
            .and_then(|mut cdr| cdr.all(&channel.definitions, &channel.kind, "", 0, &mut found));
        if decoded.is_none() {
            self.passed += 1;
            return;
        }
        self.read += 1;
        take(
            &mut self.series,
            wanted,
            channel,
            &found,
            log_time_ns as f64 * 1e-9,
        );
    }
}

/// Reads a recording: one log for each platform. `position` is the series of the latitude, where one is stated.
///
/// # Errors
/// Bytes that are no MCAP, or hold no messages of ROS 2; several receivers, of which none is the gas sensor's.
pub fn read(
    name: &str,
    bytes: Box<dyn Read + '_>,
    wanted: &Wanted,
    position: Option<&str>,
) -> Result<Vec<SeriesLog>, ImportError> {
    let mut records = Records::new(bytes).map_err(|e| unreadable(name, e))?;
    let mut gathered = Gathered::default();
    while let Some(record) = records.record().map_err(|e| unreadable(name, e))? {
        gathered.take(record, wanted);
    }
    let damage = records
        .damage()
        .words()
        .map(|what| format!("the recording is {what}"));
    let cut = (records.end() != End::Whole).then(|| "the recording is cut short".to_owned());
    if damage.is_some() {
        for record in records.summary().map_err(|e| unreadable(name, e))? {
            gathered.take(record, wanted);
        }
    }
    gathered.catch_up(wanted);
    let ending: Vec<String> = damage.into_iter().chain(cut).collect();
    finish(name, gathered, ending, position)
}

fn unreadable(name: &str, error: RecordsError) -> ImportError {
    match error {
        RecordsError::Read(source) => ImportError::bytes(name)(source),
        none @ RecordsError::NoMcap => {
            ImportError::log(name, none.to_string(), "give an MCAP recording of ROS 2")
        }
    }
}

fn finish(
    name: &str,
    gathered: Gathered,
    ending: Vec<String>,
    position: Option<&str>,
) -> Result<Vec<SeriesLog>, ImportError> {
    let Gathered {
        series,
        channels,
        read,
        passed,
        ..
    } = gathered;
    if read == 0 {
        let what = if ending.is_empty() {
            format!("an MCAP recording without readable ROS 2 messages ({passed} others)")
        } else {
            ending.join("; ")
        };
        return Err(ImportError::log(
            name,
            what,
            "give a recording of ROS 2 with its definitions (ros2msg, cdr); Plumage's own recordings are \
             accepted wherever observations are",
        ));
    }
    let mut notices = vec![format!("a recording of ROS 2, {read} messages")];
    if passed > 0 {
        notices.push(format!("{passed} messages in other encodings are skipped"));
    }
    notices.extend(ending);
    notices.push(
        "times are from the message headers, or from the recording for messages without one"
            .to_owned(),
    );
    let kinds = channels.into_values().map(|c| (c.topic, c.kind)).collect();
    let recorded = Recorded {
        name,
        series: series.finish(0.0),
        kinds: &kinds,
        notices,
    };
    recorded.platforms(position)
}

fn take(
    series: &mut Collected,
    wanted: &Wanted,
    channel: &Channel,
    found: &[(String, f64)],
    logged_s: f64,
) {
    let Channel { topic, kind, .. } = channel;
    let value = |name: &str| found.iter().find(|(n, _)| n == name).map(|(_, v)| *v);
    let stamped = value("header.stamp.sec").zip(value("header.stamp.nanosec"));
    // A stamp of nothing is none.
    let time_s = stamped
        .map(|(s, ns)| s + ns * 1e-9)
        .filter(|t| *t > 0.0)
        .unwrap_or(logged_s);
    // NavSatFix: below 0 there is no fix.
    if kind == FIX && value("status.status").is_some_and(|s| s < 0.0) {
        return;
    }
    for (path, value) in found {
        let name = match path.as_str() {
            // A number alone is called as its topic.
            "data" => topic.trim_start_matches('/').replace('/', "."),
            _ => format!("{topic}.{path}"),
        };
        if wanted.keeps(&name) || platforms::is_known(kind, path) {
            series.push(&name, time_s, *value);
        }
    }
}
