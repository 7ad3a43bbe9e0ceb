//! A bag of ROS 2: an MCAP file with messages in CDR, and the text that describes it.
//!
//! rosbag2, *metadata.yaml* (version 5); mcap.dev, *Well-known encodings*.

use super::{Converter, Kind, RosMessage};
use crate::RecordError;
use crate::export::Flown;
use air::AirError;
use air::geo::LocalFrame;
use mcap::records::MessageHeader;
use mcap::{Compression, WriteOptions};
use std::collections::BTreeMap;
use std::io::Cursor;

/// A bag's two files.
#[derive(Debug)]
pub struct Bag {
    /// `<name>_0.mcap`.
    pub mcap: Vec<u8>,
    /// `metadata.yaml`.
    pub metadata: String,
}

/// A topic in the file.
struct Channel {
    id: u16,
    kind: Kind,
    messages: u32,
}

struct Writing {
    writer: mcap::Writer<Cursor<Vec<u8>>>,
    channels: BTreeMap<String, Channel>,
    /// The first and the last time, ns since 1970.
    span: Option<(i64, i64)>,
}

/// The bag called `name`, with positions in `frame`, or around the first reading where there is none. `undulation_m` is the
/// height of the geoid above the ellipsoid, m: NavSatFix counts from the latter, and has no altitude without.
///
/// # Errors
/// [`RecordError::Export`] where the writer fails or the place is none.
pub fn bag(
    flown: &Flown,
    frame: Option<LocalFrame>,
    undulation_m: Option<f64>,
    name: &str,
) -> Result<Bag, RecordError> {
    let failed = |e: mcap::McapError| RecordError::Export(e.to_string());
    let frame = frame
        .map_or_else(|| around(flown), Ok)
        .map_err(|e| RecordError::Export(e.to_string()))?;
    let converter = Converter {
        gas: flown.gas,
        frame,
        undulation_m,
    };
    let writer = WriteOptions::new()
        .profile("ros2")
        .library(concat!("plumage ", env!("CARGO_PKG_VERSION")))
        .compression(Some(Compression::Zstd))
        .create(Cursor::new(Vec::new()))
        .map_err(failed)?;
    let mut writing = Writing {
        writer,
        channels: BTreeMap::new(),
        span: None,
    };
    writing.write(flown, &converter).map_err(failed)?;
    writing.writer.finish().map_err(failed)?;
    let metadata = writing.metadata(name);
    Ok(Bag {
        mcap: writing.writer.into_inner().into_inner(),
        metadata,
    })
}

/// A frame around the first reading.
fn around(flown: &Flown) -> Result<LocalFrame, AirError> {
    let (lat_deg, lon_deg, alt_amsl_m) = flown
        .readings
        .first()
        .map_or((0.0, 0.0, 0.0), |r| (r.lat_deg, r.lon_deg, r.alt_amsl_m));
    LocalFrame::new(lat_deg, lon_deg, alt_amsl_m)
}

impl Writing {
    /// Writes all in order of time.
    fn write(&mut self, flown: &Flown, converter: &Converter) -> mcap::McapResult<()> {
        let mut motions = flown.motions.iter().peekable();
        let name = |vehicle: usize| flown.vehicles[vehicle].name.as_str();
        for read in &flown.readings {
            while let Some(moved) = motions.next_if(|moved| moved.time_s <= read.time_s) {
                let at = flown.unix_ns(moved.time_s);
                self.publish(converter.state(name(moved.vehicle), at, &moved.state))?;
            }
            let at = flown.unix_ns(read.time_s);
            if flown.motions.is_empty() {
                let place = [read.lat_deg, read.lon_deg, read.alt_amsl_m];
                self.publish([converter.fix(name(read.vehicle), at, place)])?;
            }
            self.publish([converter.reading(name(read.vehicle), at, read)])?;
        }
        for moved in motions {
            let at = flown.unix_ns(moved.time_s);
            self.publish(converter.state(name(moved.vehicle), at, &moved.state))?;
        }
        Ok(())
    }

    fn publish(&mut self, all: impl IntoIterator<Item = RosMessage>) -> mcap::McapResult<()> {
        for message in all {
            let (first, _) = self.span.unwrap_or((message.at_unix_ns, 0));
            self.span = Some((first, message.at_unix_ns));
            let (channel_id, sequence) = self.counted(&message)?;
            let time = u64::try_from(message.at_unix_ns).unwrap_or(0);
            let header = MessageHeader {
                channel_id,
                sequence,
                log_time: time,
                publish_time: time,
            };
            self.writer.write_to_known_channel(&header, &message.cdr)?;
        }
        Ok(())
    }

    /// The channel of a message and its number there.
    fn counted(&mut self, message: &RosMessage) -> mcap::McapResult<(u16, u32)> {
        if let Some(channel) = self.channels.get_mut(&message.topic) {
            channel.messages += 1;
            return Ok((channel.id, channel.messages));
        }
        let definition = message.kind.definition();
        let schema =
            self.writer
                .add_schema(message.kind.name(), "ros2msg", definition.as_bytes())?;
        let quality = BTreeMap::from([("offered_qos_profiles".to_owned(), String::new())]);
        let id = self
            .writer
            .add_channel(schema, &message.topic, "cdr", &quality)?;
        let channel = Channel {
            id,
            kind: message.kind,
            messages: 1,
        };
        self.channels.insert(message.topic.clone(), channel);
        Ok((id, 1))
    }

    /// What `metadata.yaml` says of the file `<name>_0.mcap`.
    fn metadata(&self, name: &str) -> String {
        let (first, last) = self.span.unwrap_or_default();
        let count: u32 = self.channels.values().map(|c| c.messages).sum();
        let duration = last - first;
        let topics = self.channels.iter().map(|(topic, channel)| {
            format!(
                "    - topic_metadata:\n        name: {topic}\n        type: {}\n        serialization_format: cdr\n        \
                 offered_qos_profiles: \"\"\n      message_count: {}\n",
                channel.kind.name(),
                channel.messages
            )
        });
        let topics: String = topics.collect();
        format!(
            "rosbag2_bagfile_information:\n  version: 5\n  storage_identifier: mcap\n  duration:\n    \
             nanoseconds: {duration}\n  starting_time:\n    nanoseconds_since_epoch: {first}\n  \
             message_count: {count}\n  topics_with_message_count:\n{topics}  compression_format: \"\"\n  \
             compression_mode: \"\"\n  relative_file_paths:\n    - {name}_0.mcap\n  files:\n    - path: {name}_0.mcap\n      \
             starting_time:\n        nanoseconds_since_epoch: {first}\n      duration:\n        \
             nanoseconds: {duration}\n      message_count: {count}\n"
        )
    }
}
