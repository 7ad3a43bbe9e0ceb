//! PX4's ULog (`.ulg`): messages of topics whose fields are given by messages before them.
//!
//! Layout (docs.px4.io, *ULog File Format*): a head of 16 bytes, then messages of a size (2 bytes), a type (1 byte) and
//! as many bytes, little endian. `F` gives a format (`name:type field;...`), `A` binds a number to one, `D` is data.
//!
//! A reader of our own: `px4-ulog` 0.6.1 panics on a subscription or parameter that is too short, and ends at the first
//! datum of an unknown subscription, behind which most of a damaged log may still be read.

use super::series_log::{Collected, Known, SeriesLog, Wanted};
use crate::ImportError;
use formats::binary::Kind;
use std::collections::BTreeMap;
use std::io::{BufReader, Read};

/// What the series of these logs are.
pub const KNOWN: &[Known] = &[
    (
        "lat_deg",
        "vehicle_global_position.lat sensor_gps.latitude_deg vehicle_gps_position.latitude_deg sensor_gps.lat vehicle_gps_position.lat",
        "deg",
    ),
    (
        "lon_deg",
        "vehicle_global_position.lon sensor_gps.longitude_deg vehicle_gps_position.longitude_deg sensor_gps.lon vehicle_gps_position.lon",
        "deg",
    ),
    (
        "alt_amsl_m",
        "vehicle_global_position.alt sensor_gps.altitude_msl_m vehicle_gps_position.altitude_msl_m sensor_gps.alt vehicle_gps_position.alt",
        "m",
    ),
    (
        "wind_speed_m_s",
        "wind.wind_speed wind_estimate.wind_speed",
        "m/s",
    ),
    (
        "wind_from_deg",
        "wind.wind_from wind_estimate.wind_from",
        "deg",
    ),
    ("pressure_hpa", "vehicle_air_data.baro_pressure_pa", "Pa"),
    (
        "airspeed_m_s",
        "airspeed_validated.true_airspeed_m_s airspeed.true_airspeed_m_s",
        "m/s",
    ),
    ("roll_deg", "vehicle_attitude.roll", "deg"),
    ("pitch_deg", "vehicle_attitude.pitch", "deg"),
    ("yaw_deg", "vehicle_attitude.yaw", "deg"),
    (
        "roll_rate_deg_s",
        "vehicle_angular_velocity.xyz[0] sensor_combined.gyro_rad[0]",
        "rad/s",
    ),
    (
        "pitch_rate_deg_s",
        "vehicle_angular_velocity.xyz[1] sensor_combined.gyro_rad[1]",
        "rad/s",
    ),
    (
        "yaw_rate_deg_s",
        "vehicle_angular_velocity.xyz[2] sensor_combined.gyro_rad[2]",
        "rad/s",
    ),
    (
        "accel_x_m_s2",
        "sensor_combined.accelerometer_m_s2[0] vehicle_acceleration.xyz[0]",
        "m/s2",
    ),
    (
        "accel_y_m_s2",
        "sensor_combined.accelerometer_m_s2[1] vehicle_acceleration.xyz[1]",
        "m/s2",
    ),
    (
        "accel_z_m_s2",
        "sensor_combined.accelerometer_m_s2[2] vehicle_acceleration.xyz[2]",
        "m/s2",
    ),
    ("vel_north_m_s", "vehicle_local_position.vx", "m/s"),
    ("vel_east_m_s", "vehicle_local_position.vy", "m/s"),
    ("vel_down_m_s", "vehicle_local_position.vz", "m/s"),
    (
        "throttle",
        "vehicle_thrust_setpoint.xyz[0] actuator_controls_0.control[3]",
        "share",
    ),
];

/// Receivers' topics.
const RECEIVERS: [&str; 2] = ["sensor_gps", "vehicle_gps_position"];
/// Bytes before the first message.
const HEAD_BYTES: usize = 16;
/// Formats within formats at most: definitions that hold themselves are damage.
const DEEPEST: usize = 8;
/// Fields of a topic at most.
const MOST_FIELDS: usize = 4096;
/// 2001-09-09, s since 1970: times of receivers without a fix lie before.
const FIRST_FIX_S: f64 = 1e9;

/// A number in a message.
#[derive(Debug, Clone)]
struct Field {
    name: String,
    kind: Kind,
    at: usize,
}

/// A topic that is logged, or a further instance of one.
#[derive(Debug, Clone)]
struct Topic {
    name: String,
    instance: u8,
    fields: Vec<Field>,
    /// Of the fields that are kept: which, the name of the series, and the factor.
    kept: Vec<(usize, String, f64)>,
}

#[derive(Default)]
struct Gathered {
    series: Collected,
    formats: BTreeMap<String, String>,
    topics: BTreeMap<u16, Topic>,
    ahead_s: Vec<f64>,
    messages: usize,
}

/// The numbers of a type; none of a type that is no number.
fn kind(of: &str) -> Option<Kind> {
    Some(match of {
        "int8_t" => Kind::I8,
        "uint8_t" | "bool" | "char" => Kind::U8,
        "int16_t" => Kind::I16,
        "uint16_t" => Kind::U16,
        "int32_t" => Kind::I32,
        "uint32_t" => Kind::U32,
        "int64_t" => Kind::I64,
        "uint64_t" => Kind::U64,
        "float" => Kind::F32,
        "double" => Kind::F64,
        _ => return None,
    })
}

/// The number in a field; NaN where the message is too short.
fn number(field: &Field, data: &[u8]) -> f64 {
    let bytes = data.get(field.at..).unwrap_or_default();
    field.kind.little_endian(bytes)
}

/// What a field's number is multiplied by: receivers' integers are 1e-7 degrees and millimetres.
fn factor(topic: &str, field: &Field) -> f64 {
    let is_integer = field.kind == Kind::I32;
    match field.name.as_str() {
        "lat" | "lon" if is_integer && RECEIVERS.contains(&topic) => 1e-7,
        "alt" if is_integer && RECEIVERS.contains(&topic) => 1e-3,
        _ => 1.0,
    }
}

/// Adds the fields of the format `name`, which begins at `at`, under `path`. Where it ends; none of a format that is not
/// given, or of damage.
fn flatten(
    formats: &BTreeMap<String, String>,
    name: &str,
    path: &str,
    mut at: usize,
    depth: usize,
    fields: &mut Vec<Field>,
) -> Option<usize> {
    if depth == DEEPEST {
        return None;
    }
    for field in formats
        .get(name)?
        .split(';')
        .filter(|f| !f.trim().is_empty())
    {
        let (own_kind, field) = field.trim().split_once(' ')?;
        let (own_kind, count) = match own_kind.split_once('[') {
            Some((kind, count)) => (
                kind,
                Some(count.trim_end_matches(']').parse::<usize>().ok()?),
            ),
            None => (own_kind, None),
        };
        for k in 0..count.unwrap_or(1) {
            let own = match count {
                Some(_) => format!("{path}{field}[{k}]"),
                None => format!("{path}{field}"),
            };
            if let Some(kind) = kind(own_kind) {
                fields.push(Field {
                    name: own,
                    kind,
                    at,
                });
                at += kind.width();
            } else {
                at = flatten(formats, own_kind, &format!("{own}."), at, depth + 1, fields)?;
            }
            if fields.len() > MOST_FIELDS || k > MOST_FIELDS {
                return None;
            }
        }
    }
    Some(at)
}

impl Gathered {
    /// Takes a message of a type in; false of one that there is not.
    fn take(&mut self, kind: u8, bytes: &[u8], wanted: &Wanted) -> bool {
        match kind {
            b'F' => {
                let text = crate::decode::letters(bytes);
                if let Some((name, fields)) = text.split_once(':') {
                    self.formats.insert(name.to_owned(), fields.to_owned());
                }
            }
            b'A' => {
                if let Some((id, topic)) = self.topic(bytes, wanted) {
                    self.topics.insert(id, topic);
                }
            }
            b'D' => {
                if let Some((id, data)) = bytes.split_first_chunk() {
                    self.data(u16::from_le_bytes(*id), data);
                }
            }
            // Information, parameters, texts, dropouts, marks, flags and the end of a topic.
            b'B' | b'I' | b'M' | b'P' | b'Q' | b'R' | b'L' | b'C' | b'S' | b'O' => {}
            _ => return false,
        }
        true
    }

    fn topic(&self, bytes: &[u8], wanted: &Wanted) -> Option<(u16, Topic)> {
        let (head, name) = bytes.split_first_chunk::<3>()?;
        let (instance, name) = (head[0], crate::decode::letters(name));
        let mut fields = Vec::new();
        flatten(&self.formats, &name, "", 0, 0, &mut fields)?;
        let series = |f: &Field| match instance {
            0 => format!("{name}.{}", f.name),
            i => format!("{name}[{i}].{}", f.name),
        };
        let all = fields
            .iter()
            .enumerate()
            .map(|(k, f)| (k, series(f), factor(&name, f)));
        let kept = all.filter(|(_, series, _)| wanted.keeps(series)).collect();
        let id = u16::from_le_bytes([head[1], head[2]]);
        Some((
            id,
            Topic {
                name,
                instance,
                fields,
                kept,
            },
        ))
    }

    fn data(&mut self, id: u16, data: &[u8]) {
        // Taken out, so that the series can be added to.
        let Some(topic) = self.topics.remove(&id) else {
            return;
        };
        self.values(&topic, data);
        self.topics.insert(id, topic);
    }

    fn values(&mut self, topic: &Topic, data: &[u8]) {
        let value = |name: &str| {
            let field = topic.fields.iter().find(|f| f.name == name);
            field.map(|f| number(f, data))
        };
        let Some(time_s) = value("timestamp").map(|us| us * 1e-6) else {
            return;
        };
        self.messages += 1;
        for (field, name, factor) in &topic.kept {
            self.series
                .push(name, time_s, number(&topic.fields[*field], data) * factor);
        }
        if topic.instance > 0 {
            return;
        }
        match topic.name.as_str() {
            "vehicle_attitude" => {
                let q = [0, 1, 2, 3].map(|k| value(&format!("q[{k}]")).unwrap_or(f64::NAN));
                for (name, angle) in ["roll", "pitch", "yaw"].into_iter().zip(angles_deg(q)) {
                    self.series
                        .push(&format!("vehicle_attitude.{name}"), time_s, angle);
                }
            }
            "wind" | "wind_estimate" => {
                if let (Some(north), Some(east)) =
                    (value("windspeed_north"), value("windspeed_east"))
                {
                    super::series_log::push_wind(
                        &mut self.series,
                        &topic.name,
                        time_s,
                        north,
                        east,
                    );
                }
            }
            name if RECEIVERS.contains(&name) => {
                let utc_s = value("time_utc_usec").map(|us| us * 1e-6);
                self.ahead_s
                    .extend(utc_s.filter(|t| *t > FIRST_FIX_S).map(|t| t - time_s));
            }
            "debug_key_value" => self.named(topic, data, time_s, value("value")),
            _ => {}
        }
    }

    /// A value with a name of its own, as gas sensors are often logged.
    fn named(&mut self, topic: &Topic, data: &[u8], time_s: f64, value: Option<f64>) {
        let letters = topic.fields.iter().filter(|f| f.name.starts_with("key["));
        let name: String = letters
            .map(|f| number(f, data))
            .take_while(|c| *c > 0.0)
            .map(|c| char::from(c as u8))
            .collect();
        if let Some(value) = value {
            self.series
                .push(&format!("debug_key_value.{name}"), time_s, value);
        }
    }
}

/// Roll, pitch and yaw of a rotation from body to north-east-down (Z-Y-X; Diebel 2006, eq. 290), degrees.
fn angles_deg([w, x, y, z]: [f64; 4]) -> [f64; 3] {
    let roll = (2.0 * (w * x + y * z)).atan2(1.0 - 2.0 * (x * x + y * y));
    let pitch = (2.0 * (w * y - z * x)).clamp(-1.0, 1.0).asin();
    let yaw = (2.0 * (w * z + x * y)).atan2(1.0 - 2.0 * (y * y + z * z));
    [roll, pitch, yaw].map(f64::to_degrees)
}

/// Reads a ULog.
///
/// # Errors
/// Bytes that hold no messages, or that cannot be read.
pub fn read(
    name: &str,
    bytes: Box<dyn Read + '_>,
    wanted: &Wanted,
) -> Result<SeriesLog, ImportError> {
    let mut reader = BufReader::with_capacity(1 << 18, bytes);
    let mut gathered = Gathered::default();
    let mut at = HEAD_BYTES;
    let mut broken = None;
    let mut message = vec![0; HEAD_BYTES];
    let mut head = [0; 3];
    // A log that is cut short ends with a part of a message.
    let mut goes_on = reader.read_exact(&mut message).is_ok();
    while goes_on && reader.read_exact(&mut head).is_ok() {
        let size = usize::from(u16::from_le_bytes([head[0], head[1]]));
        message.resize(size, 0);
        goes_on = reader.read_exact(&mut message).is_ok();
        if goes_on && !gathered.take(head[2], &message, wanted) {
            broken = Some(format!(
                "damaged at byte {at}: not a ULog message; the rest of the file is ignored"
            ));
            break;
        }
        at += head.len() + size;
    }
    if gathered.messages == 0 {
        let what = broken.unwrap_or_else(|| "a ULog without data".to_owned());
        return Err(ImportError::log(
            name,
            what,
            "give the .ulg as the autopilot wrote it",
        ));
    }
    let mut notices = vec![format!("PX4's ULog, {} messages", gathered.messages)];
    notices.extend(broken);
    let Gathered {
        series, ahead_s, ..
    } = gathered;
    Ok(series.of_autopilot("a PX4 log", ahead_s, notices, "times are UTC by the GPS"))
}
