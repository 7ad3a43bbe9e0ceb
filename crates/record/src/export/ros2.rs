//! A bag of ROS 2: an MCAP file with messages in CDR, and the text that describes it.
//!
//! rosbag2, *metadata.yaml* (version 5); mcap.dev, *Well-known encodings*; ROS 2 common interfaces. Of each vehicle
//! `/vehicle_<name>/` `fix` (sensor_msgs/NavSatFix), `odom` (nav_msgs/Odometry), `velocity` (geometry_msgs/TwistStamped)
//! and `gas` (plumage_msgs/GasReading, described in the file).

use super::{Flown, Moved, Read, pose};
use crate::RecordError;
use air::geo::{Geodetic, LocalFrame};
use formats::cdr::CdrWriter;
use mcap::records::MessageHeader;
use mcap::{Compression, WriteOptions};
use std::collections::BTreeMap;
use std::io::Cursor;

/// The frame of the site: east, north and up from its origin on the ground.
const SITE: &str = "map";
/// NavSatStatus: a fix, of GPS.
const FIX: u8 = 0;
const GPS: u16 = 1;
/// 36 numbers of a covariance that is not known.
const NO_COVARIANCE: [f64; 36] = [0.0; 36];

const HEADER: &str =
    "================================================================================
MSG: std_msgs/Header
builtin_interfaces/Time stamp
string frame_id
================================================================================
MSG: builtin_interfaces/Time
int32 sec
uint32 nanosec
";
const GEOMETRY: &str =
    "================================================================================
MSG: geometry_msgs/Twist
geometry_msgs/Vector3 linear
geometry_msgs/Vector3 angular
================================================================================
MSG: geometry_msgs/Vector3
float64 x
float64 y
float64 z
";

/// What is said of a vehicle: the last part of the topic, the type and its definition.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Kind {
    Fix,
    Odometry,
    Velocity,
    Gas,
}

impl Kind {
    fn topic(self) -> &'static str {
        match self {
            Self::Fix => "fix",
            Self::Odometry => "odom",
            Self::Velocity => "velocity",
            Self::Gas => "gas",
        }
    }

    fn name(self) -> &'static str {
        match self {
            Self::Fix => "sensor_msgs/msg/NavSatFix",
            Self::Odometry => "nav_msgs/msg/Odometry",
            Self::Velocity => "geometry_msgs/msg/TwistStamped",
            Self::Gas => "plumage_msgs/msg/GasReading",
        }
    }

    fn definition(self) -> String {
        match self {
            Self::Fix => format!(
                "std_msgs/Header header\nsensor_msgs/NavSatStatus status\nfloat64 latitude\nfloat64 longitude\n\
                 float64 altitude\nfloat64[9] position_covariance\nuint8 COVARIANCE_TYPE_UNKNOWN = 0\n\
                 uint8 COVARIANCE_TYPE_APPROXIMATED = 1\nuint8 COVARIANCE_TYPE_DIAGONAL_KNOWN = 2\n\
                 uint8 COVARIANCE_TYPE_KNOWN = 3\nuint8 position_covariance_type\n{HEADER}\
                 ================================================================================\n\
                 MSG: sensor_msgs/NavSatStatus\nint8 STATUS_NO_FIX = -1\nint8 STATUS_FIX = 0\n\
                 int8 STATUS_SBAS_FIX = 1\nint8 STATUS_GBAS_FIX = 2\nint8 status\nuint16 SERVICE_GPS = 1\n\
                 uint16 SERVICE_GLONASS = 2\nuint16 SERVICE_COMPASS = 4\nuint16 SERVICE_GALILEO = 8\nuint16 service\n"
            ),
            Self::Odometry => format!(
                "std_msgs/Header header\nstring child_frame_id\ngeometry_msgs/PoseWithCovariance pose\n\
                 geometry_msgs/TwistWithCovariance twist\n{HEADER}\
                 ================================================================================\n\
                 MSG: geometry_msgs/PoseWithCovariance\ngeometry_msgs/Pose pose\nfloat64[36] covariance\n\
                 ================================================================================\n\
                 MSG: geometry_msgs/Pose\ngeometry_msgs/Point position\ngeometry_msgs/Quaternion orientation\n\
                 ================================================================================\n\
                 MSG: geometry_msgs/Point\nfloat64 x\nfloat64 y\nfloat64 z\n\
                 ================================================================================\n\
                 MSG: geometry_msgs/Quaternion\nfloat64 x 0\nfloat64 y 0\nfloat64 z 0\nfloat64 w 1\n\
                 ================================================================================\n\
                 MSG: geometry_msgs/TwistWithCovariance\ngeometry_msgs/Twist twist\nfloat64[36] covariance\n{GEOMETRY}"
            ),
            Self::Velocity => {
                format!("std_msgs/Header header\ngeometry_msgs/Twist twist\n{HEADER}{GEOMETRY}")
            }
            Self::Gas => format!(
                "# A reading of a gas sensor. What is not known is not a number.\nstd_msgs/Header header\n\
                 # co2, ch4 and so on\nstring gas\n# mole fraction, ppm\nfloat64 mole_fraction_ppm\n\
                 # degrees (WGS84)\nfloat64 latitude\nfloat64 longitude\n# m above mean sea level\n\
                 float64 altitude_amsl\n# m/s, and degrees from which it blows\nfloat64 wind_speed\n\
                 float64 wind_from_direction\n# degrees Celsius\nfloat64 temperature\n# hPa\nfloat64 pressure\n{HEADER}"
            ),
        }
    }
}

/// A bag's two files.
#[derive(Debug)]
pub struct Bag {
    /// `<name>_0.mcap`.
    pub mcap: Vec<u8>,
    /// `metadata.yaml`.
    pub metadata: String,
}

/// How the bag is made.
#[derive(Debug, Clone, Copy)]
pub struct Site {
    /// The frame of positions; around the first reading where there is none.
    pub frame: Option<LocalFrame>,
    /// Height of the geoid above the ellipsoid, m: NavSatFix counts from the latter, and has no altitude without.
    pub undulation_m: Option<f64>,
}

struct Writing<'a> {
    flown: &'a Flown,
    frame: LocalFrame,
    undulation_m: Option<f64>,
    writer: mcap::Writer<Cursor<Vec<u8>>>,
    /// Channel and number of messages by topic, with its kind.
    channels: BTreeMap<(usize, Kind), (u16, u32)>,
}

/// The bag called `name`.
///
/// # Errors
/// [`RecordError::Export`] where the writer fails or the place is none.
pub fn bag(flown: &Flown, site: &Site, name: &str) -> Result<Bag, RecordError> {
    let failed = |e: mcap::McapError| RecordError::Export(e.to_string());
    let around = || {
        let (lat_deg, lon_deg, alt_amsl_m) = flown
            .readings
            .first()
            .map_or((0.0, 0.0, 0.0), |r| (r.lat_deg, r.lon_deg, r.alt_amsl_m));
        LocalFrame::new(lat_deg, lon_deg, alt_amsl_m)
    };
    let frame = site
        .frame
        .map_or_else(around, Ok)
        .map_err(|e| RecordError::Export(e.to_string()))?;
    let writer = WriteOptions::new()
        .profile("ros2")
        .library(concat!("plumage ", env!("CARGO_PKG_VERSION")))
        .compression(Some(Compression::Zstd))
        .create(Cursor::new(Vec::new()))
        .map_err(failed)?;
    let mut writing = Writing {
        flown,
        frame,
        undulation_m: site.undulation_m,
        writer,
        channels: BTreeMap::new(),
    };
    let span = writing.write().map_err(failed)?;
    writing.writer.finish().map_err(failed)?;
    let metadata = writing.metadata(name, span);
    Ok(Bag {
        mcap: writing.writer.into_inner().into_inner(),
        metadata,
    })
}

impl Writing<'_> {
    /// Writes all in order of time; the first and the last time, ns since 1970.
    fn write(&mut self) -> mcap::McapResult<(i64, i64)> {
        let flown = self.flown;
        let (mut motions, mut readings) = (
            flown.motions.iter().peekable(),
            flown.readings.iter().peekable(),
        );
        let mut span: Option<(i64, i64)> = None;
        loop {
            let moved = motions.peek().map(|m| m.time_s);
            let read = readings.peek().map(|r| r.time_s);
            let time_s = match (moved, read) {
                (None, None) => break,
                (Some(moved), read) if read.is_none_or(|read| moved <= read) => {
                    if let Some(m) = motions.next() {
                        self.motion(m)?;
                    }
                    moved
                }
                (_, read) => {
                    if let Some(r) = readings.next() {
                        self.reading(r)?;
                    }
                    read.unwrap_or_default()
                }
            };
            let at = flown.unix_ns(time_s);
            span = Some(span.map_or((at, at), |(first, _)| (first, at)));
        }
        Ok(span.unwrap_or_default())
    }

    fn motion(&mut self, moved: &Moved) -> mcap::McapResult<()> {
        let state = &moved.state;
        let at = self.flown.unix_ns(moved.time_s);
        let place = [state.lat_deg, state.lon_deg, state.alt_amsl_m];
        self.fix(moved.vehicle, at, place)?;
        let foot = self.frame.to_enu(Geodetic {
            lat_deg: state.lat_deg,
            lon_deg: state.lon_deg,
        });
        let up_m = state.alt_amsl_m - self.frame.ground_amsl_m;
        let attitude = pose::quaternion(state);
        let velocity = pose::velocity_enu(state);
        let child = format!("{}/base_link", self.namespace(moved.vehicle));
        let odometry = CdrWriter::default()
            .header(at, SITE)
            .string(&child)
            .f64s(&[foot.east_m, foot.north_m, up_m])
            .f64s(&attitude)
            .f64s(&NO_COVARIANCE)
            .f64s(&pose::into_body(attitude, velocity))
            .f64s(&[0.0; 3])
            .f64s(&NO_COVARIANCE);
        self.say(moved.vehicle, Kind::Odometry, at, odometry)?;
        let twist = CdrWriter::default()
            .header(at, SITE)
            .f64s(&velocity)
            .f64s(&[0.0; 3]);
        self.say(moved.vehicle, Kind::Velocity, at, twist)
    }

    fn reading(&mut self, read: &Read) -> mcap::McapResult<()> {
        let at = self.flown.unix_ns(read.time_s);
        if self.flown.motions.is_empty() {
            self.fix(
                read.vehicle,
                at,
                [read.lat_deg, read.lon_deg, read.alt_amsl_m],
            )?;
        }
        let known = |value: Option<f64>| value.unwrap_or(f64::NAN);
        let frame = format!("{}/base_link", self.namespace(read.vehicle));
        let gas = CdrWriter::default()
            .header(at, &frame)
            .string(self.flown.gas.as_str())
            .f64s(&[known(read.ppm), read.lat_deg, read.lon_deg, read.alt_amsl_m])
            .f64s(&[known(read.wind_speed_m_s), known(read.wind_from_deg)])
            .f64s(&[known(read.temperature_c), known(read.pressure_hpa)]);
        self.say(read.vehicle, Kind::Gas, at, gas)
    }

    fn fix(&mut self, vehicle: usize, at: i64, [lat, lon, alt]: [f64; 3]) -> mcap::McapResult<()> {
        let altitude = self
            .undulation_m
            .map_or(f64::NAN, |undulation| alt + undulation);
        let frame = format!("{}/base_link", self.namespace(vehicle));
        let fix = CdrWriter::default()
            .header(at, &frame)
            .byte(FIX)
            .u16(GPS)
            .f64s(&[lat, lon, altitude])
            .f64s(&[0.0; 9])
            .byte(0);
        self.say(vehicle, Kind::Fix, at, fix)
    }

    /// Names of ROS have letters, digits and underscores.
    fn namespace(&self, vehicle: usize) -> String {
        let plain = |c: char| if c.is_ascii_alphanumeric() { c } else { '_' };
        let name = &self.flown.vehicles[vehicle].name;
        format!("vehicle_{}", name.chars().map(plain).collect::<String>())
    }

    fn topic(&self, vehicle: usize, kind: Kind) -> String {
        format!("/{}/{}", self.namespace(vehicle), kind.topic())
    }

    fn say(&mut self, vehicle: usize, kind: Kind, at: i64, cdr: CdrWriter) -> mcap::McapResult<()> {
        let (channel_id, sequence) = match self.channels.get_mut(&(vehicle, kind)) {
            Some(channel) => {
                channel.1 += 1;
                *channel
            }
            None => {
                let definition = kind.definition();
                let schema =
                    self.writer
                        .add_schema(kind.name(), "ros2msg", definition.as_bytes())?;
                let quality = BTreeMap::from([("offered_qos_profiles".to_owned(), String::new())]);
                let topic = self.topic(vehicle, kind);
                let id = self.writer.add_channel(schema, &topic, "cdr", &quality)?;
                self.channels.insert((vehicle, kind), (id, 1));
                (id, 1)
            }
        };
        let time = u64::try_from(at).unwrap_or(0);
        let header = MessageHeader {
            channel_id,
            sequence,
            log_time: time,
            publish_time: time,
        };
        self.writer.write_to_known_channel(&header, &cdr.finish())
    }

    /// What `metadata.yaml` says of the file `<name>_0.mcap`.
    fn metadata(&self, name: &str, (first, last): (i64, i64)) -> String {
        let count: u32 = self.channels.values().map(|(_, count)| count).sum();
        let duration = last - first;
        let topics = self.channels.iter().map(|((vehicle, kind), (_, count))| {
            format!(
                "    - topic_metadata:\n        name: {}\n        type: {}\n        serialization_format: cdr\n        \
                 offered_qos_profiles: \"\"\n      message_count: {count}\n",
                self.topic(*vehicle, *kind),
                kind.name()
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
