//! States and readings of vehicles as messages of ROS 2 in CDR, and a bag of them.
//!
//! ROS 2 common interfaces. Of each vehicle `/vehicle_<name>/` `fix` (sensor_msgs/NavSatFix), `odom` (nav_msgs/Odometry),
//! `velocity` (geometry_msgs/TwistStamped) and `gas` (plumage_msgs/GasReading, described in the bag).

mod bag;

pub use bag::{Bag, bag};

use super::{Read, pose};
use air::geo::{Geodetic, LocalFrame};
use formats::cdr::CdrWriter;
use plume::Gas;
use protocol::message::{Message, State};
use protocol::{Envelope, Topic};

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

/// Type of a message.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Kind {
    /// Where it is.
    Fix,
    /// Where it is in the site's frame, how it lies and how it moves.
    Odometry,
    /// How fast it goes towards east, north and up.
    Velocity,
    /// What its gas sensor read.
    Gas,
}

impl Kind {
    /// The last part of its topic.
    fn topic(self) -> &'static str {
        match self {
            Self::Fix => "fix",
            Self::Odometry => "odom",
            Self::Velocity => "velocity",
            Self::Gas => "gas",
        }
    }

    /// Name of its type.
    pub fn name(self) -> &'static str {
        match self {
            Self::Fix => "sensor_msgs/msg/NavSatFix",
            Self::Odometry => "nav_msgs/msg/Odometry",
            Self::Velocity => "geometry_msgs/msg/TwistStamped",
            Self::Gas => "plumage_msgs/msg/GasReading",
        }
    }

    /// The hash of its type (REP 2016), by which subscribers know that they mean the same: by rosbags 0.10 and later,
    /// `get_typestore(Stores.ROS2_JAZZY)` and `hash_rihs01` of the name, after `register` of [`Self::definition`] for gas.
    pub fn hash(self) -> &'static str {
        match self {
            Self::Fix => "RIHS01_62223ab3fe210a15976021da7afddc9e200dc9ec75231c1b6a557fc598a65404",
            Self::Odometry => {
                "RIHS01_3cc97dc7fb7502f8714462c526d369e35b603cfc34d946e3f2eda2766dfec6e0"
            }
            Self::Velocity => {
                "RIHS01_5f0fcd4f81d5d06ad9b4c4c63e3ea51b82d6ae4d0558f1d475229b1121db6f64"
            }
            Self::Gas => "RIHS01_cede12582d9d4697b02df7ec44e97c53cf359c1fce73a0a77e7a90109cd10b71",
        }
    }

    /// Definition of its type, and of those in it.
    pub fn definition(self) -> String {
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

/// A message.
#[derive(Debug, Clone, PartialEq)]
pub struct RosMessage {
    /// Its topic, such as `/vehicle_3/fix`.
    pub topic: String,
    /// What it is.
    pub kind: Kind,
    /// When what it says was so, ns since 1970.
    pub at_unix_ns: i64,
    /// Its bytes.
    pub cdr: Vec<u8>,
}

/// Converts messages of the bus to messages of ROS 2.
#[derive(Debug, Clone)]
pub struct Converter {
    /// The gas that is read.
    pub gas: Gas,
    /// The frame of positions.
    pub frame: LocalFrame,
    /// Height of the geoid above the ellipsoid, m: NavSatFix counts from the latter, and has no altitude without.
    pub undulation_m: Option<f64>,
}

impl Converter {
    /// What an envelope of the bus says, if time zero was `start_unix_ns`; nothing where it is no state and no reading.
    pub fn take(&self, topic: &Topic, envelope: &Envelope, start_unix_ns: i64) -> Vec<RosMessage> {
        match (topic, &envelope.message) {
            (Topic::State(id), Message::State(state)) => {
                let at = start_unix_ns.saturating_add(envelope.time.ns());
                self.state(id.as_str(), at, state).into()
            }
            (Topic::Reading(id), Message::Reading(reading)) => {
                let time = reading.read_at(envelope.time);
                let at = start_unix_ns.saturating_add(time.ns());
                vec![self.reading(id.as_str(), at, &Read::of(time, 0, reading, None))]
            }
            _ => Vec::new(),
        }
    }

    /// Where the vehicle was and how it moved.
    fn state(&self, vehicle: &str, at: i64, state: &State) -> [RosMessage; 3] {
        let place = [state.lat_deg, state.lon_deg, state.alt_amsl_m];
        let foot = self.frame.to_enu(Geodetic {
            lat_deg: state.lat_deg,
            lon_deg: state.lon_deg,
        });
        let up_m = state.alt_amsl_m - self.frame.ground_amsl_m;
        let attitude = pose::quaternion(state);
        let velocity = pose::velocity_enu(state);
        let child = format!("{}/base_link", namespace(vehicle));
        let odometry = CdrWriter::default()
            .header(at, SITE)
            .string(&child)
            .f64s(&[foot.east_m, foot.north_m, up_m])
            .f64s(&attitude)
            .f64s(&NO_COVARIANCE)
            .f64s(&pose::into_body(attitude, velocity))
            .f64s(&[0.0; 3])
            .f64s(&NO_COVARIANCE);
        let twist = CdrWriter::default()
            .header(at, SITE)
            .f64s(&velocity)
            .f64s(&[0.0; 3]);
        [
            self.fix(vehicle, at, place),
            message(vehicle, Kind::Odometry, at, odometry),
            message(vehicle, Kind::Velocity, at, twist),
        ]
    }

    /// What a sensor read.
    fn reading(&self, vehicle: &str, at: i64, read: &Read) -> RosMessage {
        let known = |value: Option<f64>| value.unwrap_or(f64::NAN);
        let frame = format!("{}/base_link", namespace(vehicle));
        let gas = CdrWriter::default()
            .header(at, &frame)
            .string(self.gas.as_str())
            .f64s(&[known(read.ppm), read.lat_deg, read.lon_deg, read.alt_amsl_m])
            .f64s(&[known(read.wind_speed_m_s), known(read.wind_from_deg)])
            .f64s(&[known(read.temperature_c), known(read.pressure_hpa)]);
        message(vehicle, Kind::Gas, at, gas)
    }

    /// Where a vehicle was: latitude and longitude, degrees, and altitude, m above mean sea level.
    fn fix(&self, vehicle: &str, at: i64, [lat_deg, lon_deg, alt_amsl_m]: [f64; 3]) -> RosMessage {
        let altitude = self
            .undulation_m
            .map_or(f64::NAN, |undulation| alt_amsl_m + undulation);
        let frame = format!("{}/base_link", namespace(vehicle));
        let fix = CdrWriter::default()
            .header(at, &frame)
            .byte(FIX)
            .u16(GPS)
            .f64s(&[lat_deg, lon_deg, altitude])
            .f64s(&[0.0; 9])
            .byte(0);
        message(vehicle, Kind::Fix, at, fix)
    }
}

fn message(vehicle: &str, kind: Kind, at_unix_ns: i64, cdr: CdrWriter) -> RosMessage {
    RosMessage {
        topic: format!("/{}/{}", namespace(vehicle), kind.topic()),
        kind,
        at_unix_ns,
        cdr: cdr.finish(),
    }
}

/// Names of ROS have letters, digits and underscores.
fn namespace(vehicle: &str) -> String {
    let plain = |c: char| if c.is_ascii_alphanumeric() { c } else { '_' };
    format!("vehicle_{}", vehicle.chars().map(plain).collect::<String>())
}
