//! Recordings of ROS 2 in MCAP: messages in CDR, described by their definitions in the file.
//!
//! Formats: mcap.dev, *Specification* and *Well-known encodings*; design.ros2.org, *ROS 2 Message definition*; OMG, *DDS
//! X-Types 1.3*, 7.4.3 (XCDR1: values are aligned to their own size, behind four bytes that say which end comes first).

use super::{Collected, Known, SeriesLog, Wanted};
use crate::ImportError;
use mcap::records::Record;
use mcap::sans_io::linear_reader::{LinearReadEvent, LinearReader, LinearReaderOptions};
use std::collections::BTreeMap;
use std::io::Read;

/// What the series of these recordings are; those of well-known messages are called by their type.
pub const KNOWN: &[Known] = &[
    ("lat_deg", "NavSatFix.latitude", "deg"),
    ("lon_deg", "NavSatFix.longitude", "deg"),
    ("temperature_c", "Temperature.temperature", "C"),
    (
        "relative_humidity_pct",
        "RelativeHumidity.relative_humidity",
        "share",
    ),
    ("pressure_hpa", "FluidPressure.fluid_pressure", "Pa"),
];

/// Messages of these types are called by their type.
const CALLED_BY_TYPE: [&str; 4] = [
    "NavSatFix",
    "Temperature",
    "RelativeHumidity",
    "FluidPressure",
];
/// The series of NavSatFix's altitudes.
const ELLIPSOIDAL: &str = "ellipsoidal_height";
/// Longer arrays are images and clouds.
const LONGEST_ARRAY: usize = 16;
/// Types within types at most: definitions that hold themselves are damage.
const DEEPEST: usize = 12;

/// The fields of the types of a definition, by the types' names without package.
#[derive(Debug, Default)]
struct Definitions(BTreeMap<String, Vec<Field>>);

#[derive(Debug, Clone)]
struct Field {
    name: String,
    kind: String,
    array: Option<Array>,
}

#[derive(Debug, Clone, Copy)]
enum Array {
    Fixed(usize),
    Counted,
}

/// A type's name without its package.
fn short(kind: &str) -> &str {
    kind.rsplit('/').next().unwrap_or(kind)
}

impl Definitions {
    fn parse(root: &str, text: &str) -> Self {
        let mut all = Self::default();
        let mut current = short(root).to_owned();
        all.0.insert(current.clone(), Vec::new());
        for line in text.lines() {
            let line = line.split('#').next().unwrap_or("").trim();
            if line.is_empty() || line.starts_with("===") {
                continue;
            }
            if let Some(kind) = line.strip_prefix("MSG:") {
                short(kind.trim()).clone_into(&mut current);
                all.0.entry(current.clone()).or_default();
                continue;
            }
            // A constant has a sign of equality and no place in the bytes.
            let mut words = line.split_whitespace();
            if let (Some(kind), Some(name)) = (words.next(), words.next())
                && !name.contains('=')
                && words.next() != Some("=")
            {
                let (kind, array) = array_of(kind);
                let field = Field {
                    name: name.to_owned(),
                    kind: short(kind.split("<=").next().unwrap_or(kind)).to_owned(),
                    array,
                };
                all.0.entry(current.clone()).or_default().push(field);
            }
        }
        for kind in ["Time", "Duration"] {
            let part = |name: &str, kind: &str| Field {
                name: name.to_owned(),
                kind: kind.to_owned(),
                array: None,
            };
            let parts = || vec![part("sec", "int32"), part("nanosec", "uint32")];
            all.0.entry(kind.to_owned()).or_insert_with(parts);
        }
        all
    }
}

fn array_of(kind: &str) -> (&str, Option<Array>) {
    let Some((kind, count)) = kind.split_once('[') else {
        return (kind, None);
    };
    let count = count.trim_end_matches(']').parse();
    (kind, Some(count.map_or(Array::Counted, Array::Fixed)))
}

/// Reads a message's bytes.
struct Cdr<'a> {
    bytes: &'a [u8],
    at: usize,
    little: bool,
}

impl<'a> Cdr<'a> {
    fn new(data: &'a [u8]) -> Option<Self> {
        let (head, bytes) = data.split_at_checked(4)?;
        Some(Self {
            bytes,
            at: 0,
            little: head[1] & 1 == 1,
        })
    }

    fn take<const N: usize>(&mut self) -> Option<[u8; N]> {
        self.at = self.at.next_multiple_of(N);
        let mut bytes: [u8; N] = self.bytes.get(self.at..self.at + N)?.try_into().ok()?;
        self.at += N;
        if !self.little {
            bytes.reverse();
        }
        Some(bytes)
    }

    fn number(&mut self, kind: &str) -> Option<f64> {
        Some(match kind {
            "bool" | "uint8" | "byte" | "char" => f64::from(u8::from_le_bytes(self.take()?)),
            "int8" => f64::from(i8::from_le_bytes(self.take()?)),
            "int16" => f64::from(i16::from_le_bytes(self.take()?)),
            "uint16" => f64::from(u16::from_le_bytes(self.take()?)),
            "int32" => f64::from(i32::from_le_bytes(self.take()?)),
            "uint32" => f64::from(u32::from_le_bytes(self.take()?)),
            "int64" => i64::from_le_bytes(self.take()?) as f64,
            "uint64" => u64::from_le_bytes(self.take()?) as f64,
            "float32" => f64::from(f32::from_le_bytes(self.take()?)),
            "float64" => f64::from_le_bytes(self.take()?),
            _ => return None,
        })
    }

    fn count(&mut self) -> Option<usize> {
        let count = u32::from_le_bytes(self.take()?) as usize;
        (count <= self.bytes.len()).then_some(count)
    }

    /// All numbers of a `kind` under `path`; none where the bytes end or the type is not described.
    fn all(
        &mut self,
        definitions: &Definitions,
        kind: &str,
        path: &str,
        depth: usize,
        found: &mut Vec<(String, f64)>,
    ) -> Option<()> {
        if kind == "string" {
            let count = self.count()?;
            self.at = self.at.checked_add(count)?;
            return Some(());
        }
        if let Some(fields) = definitions.0.get(kind) {
            if depth == DEEPEST {
                return None;
            }
            for field in fields {
                let inner = if path.is_empty() {
                    field.name.clone()
                } else {
                    format!("{path}.{}", field.name)
                };
                match field.array {
                    None => self.all(definitions, &field.kind, &inner, depth + 1, found)?,
                    Some(array) => {
                        let count = match array {
                            Array::Fixed(count) => count,
                            Array::Counted => self.count()?,
                        };
                        for k in 0..count {
                            let at = format!("{inner}[{k}]");
                            let kept = found.len();
                            self.all(definitions, &field.kind, &at, depth + 1, found)?;
                            if k >= LONGEST_ARRAY {
                                found.truncate(kept);
                            }
                        }
                    }
                }
            }
            return Some(());
        }
        let value = self.number(kind)?;
        found.push((path.to_owned(), value));
        Some(())
    }
}

/// A record at most, bytes: larger ones are damage.
const RECORD_LIMIT: usize = 1 << 28;

/// What is gathered while a recording is read.
#[derive(Default)]
struct Gathered {
    series: Collected,
    /// Names, encodings and texts of the definitions.
    schemas: BTreeMap<u16, (String, String, String)>,
    channels: BTreeMap<u16, Channel>,
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
                }
            }
            Record::Message { header, data } => {
                self.message(header.channel_id, header.log_time, &data, wanted)
            }
            _ => {}
        }
    }

    fn message(&mut self, channel: u16, log_time_ns: u64, data: &[u8], wanted: &Wanted) {
        let Some(channel) = self.channels.get(&channel) else {
            self.passed += 1;
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
        let called = (channel.kind.as_str(), channel.topic.as_str());
        take(
            &mut self.series,
            wanted,
            called,
            &found,
            log_time_ns as f64 * 1e-9,
        );
    }
}

/// Reads a recording.
///
/// # Errors
/// Bytes that are no MCAP, or hold no messages of ROS 2.
pub fn read(
    name: &str,
    mut bytes: Box<dyn Read + '_>,
    wanted: &Wanted,
) -> Result<SeriesLog, ImportError> {
    let options = LinearReaderOptions::default()
        .with_prevalidate_chunk_crcs(true)
        .with_record_length_limit(RECORD_LIMIT);
    let mut reader = LinearReader::new_with_options(options);
    let mut gathered = Gathered::default();
    let mut ending = None;
    while let Some(event) = reader.next_event() {
        let record = match event {
            Ok(LinearReadEvent::ReadRequest(need)) => {
                let count = bytes
                    .read(reader.insert(need))
                    .map_err(ImportError::bytes(name))?;
                reader.notify_read(count);
                continue;
            }
            Ok(LinearReadEvent::Record { data, opcode }) => mcap::parse_record(opcode, data),
            Err(error) => Err(error),
        };
        match record {
            Ok(record) => gathered.take(record, wanted),
            Err(error) => {
                ending = Some(format!("the recording is cut short or damaged: {error}"));
                break;
            }
        }
    }
    finish(name, gathered, ending)
}

fn finish(
    name: &str,
    gathered: Gathered,
    ending: Option<String>,
) -> Result<SeriesLog, ImportError> {
    let Gathered {
        series,
        read,
        passed,
        ..
    } = gathered;
    if read == 0 {
        let what = ending.unwrap_or_else(|| {
            format!(
                "an MCAP recording without messages of ROS 2 that can be read ({passed} others)"
            )
        });
        return Err(ImportError::log(
            name,
            what,
            "give a recording of ROS 2 with its definitions (ros2msg, cdr); Plumage's own are read where observations are",
        ));
    }
    let mut said = vec![format!("a recording of ROS 2, {read} messages")];
    if passed > 0 {
        said.push(format!(
            "{passed} messages in other encodings are passed over"
        ));
    }
    said.extend(ending);
    said.push(
        "times are those of the messages' headers, or of their recording without one".to_owned(),
    );
    Ok(SeriesLog {
        kind: "a recording of ROS 2",
        series: series.finish(0.0),
        is_absolute: true,
        said,
    })
}

fn take(
    series: &mut Collected,
    wanted: &Wanted,
    (kind, topic): (&str, &str),
    found: &[(String, f64)],
    logged_s: f64,
) {
    let value = |name: &str| found.iter().find(|(n, _)| n == name).map(|(_, v)| *v);
    let stamped = value("header.stamp.sec").zip(value("header.stamp.nanosec"));
    // A stamp of nothing is none.
    let time_s = stamped
        .map(|(s, ns)| s + ns * 1e-9)
        .filter(|t| *t > 0.0)
        .unwrap_or(logged_s);
    let called = if CALLED_BY_TYPE.contains(&kind) {
        kind
    } else {
        topic
    };
    // NavSatFix: below 0 there is no fix.
    if kind == "NavSatFix" && value("status.status").is_some_and(|s| s < 0.0) {
        return;
    }
    for (path, value) in found {
        let name = match (path.as_str(), kind) {
            // The message's altitude is above the ellipsoid (sensor_msgs/NavSatFix).
            ("altitude", "NavSatFix") => ELLIPSOIDAL.to_owned(),
            // A number alone is called as its topic.
            ("data", _) => topic.trim_start_matches('/').replace('/', "."),
            _ => format!("{called}.{path}"),
        };
        if wanted.keeps(&name) || name == ELLIPSOIDAL {
            series.push(&name, time_s, *value);
            if name == ELLIPSOIDAL {
                series.unit(&name, "m");
            }
        }
    }
}
