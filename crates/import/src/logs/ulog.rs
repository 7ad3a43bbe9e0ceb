//! PX4's ULog (`.ulg`), by the parser of the PX4 project.

use super::{Collected, Known, SeriesLog, Wanted, middle};
use crate::ImportError;
use px4_ulog::stream_parser::LogParser;
use px4_ulog::stream_parser::model::{DataMessage, FlattenedField, FlattenedFieldType};
use std::collections::BTreeMap;
use std::io::Read;

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
/// Bytes that are read at a time.
const PIECE: usize = 1 << 18;
/// 2001-09-09, s since 1970: times of receivers without a fix lie before.
const FIRST_FIX_S: f64 = 1e9;

/// The fields of a topic that are kept, by their series' names.
type Kept = Vec<(FlattenedField, String, f64)>;

#[derive(Default)]
struct Gathered {
    series: Collected,
    kept: BTreeMap<(String, u8), Kept>,
    ahead_s: Vec<f64>,
    messages: usize,
}

/// The number in a field; NaN where the message is too short.
fn number(field: &FlattenedField, data: &[u8]) -> f64 {
    let at = usize::from(field.offset);
    let bytes = |n: usize| data.get(at..at + n);
    macro_rules! little_endian {
        ($kind:ty) => {
            bytes(size_of::<$kind>())
                .and_then(|b| b.try_into().ok())
                .map_or(f64::NAN, |b| <$kind>::from_le_bytes(b) as f64)
        };
    }
    match field.field_type {
        FlattenedFieldType::Int8 => little_endian!(i8),
        FlattenedFieldType::UInt8 | FlattenedFieldType::Bool | FlattenedFieldType::Char => {
            little_endian!(u8)
        }
        FlattenedFieldType::Int16 => little_endian!(i16),
        FlattenedFieldType::UInt16 => little_endian!(u16),
        FlattenedFieldType::Int32 => little_endian!(i32),
        FlattenedFieldType::UInt32 => little_endian!(u32),
        FlattenedFieldType::Int64 => little_endian!(i64),
        FlattenedFieldType::UInt64 => little_endian!(u64),
        FlattenedFieldType::Float => little_endian!(f32),
        FlattenedFieldType::Double => little_endian!(f64),
    }
}

/// What a field's number is multiplied by: receivers' integers are 1e-7 degrees and millimetres.
fn factor(topic: &str, field: &FlattenedField) -> f64 {
    let is_integer = field.field_type == FlattenedFieldType::Int32;
    match field.flattened_field_name.as_str() {
        "lat" | "lon" if is_integer && RECEIVERS.contains(&topic) => 1e-7,
        "alt" if is_integer && RECEIVERS.contains(&topic) => 1e-3,
        _ => 1.0,
    }
}

impl Gathered {
    fn take(&mut self, message: &DataMessage<'_>, wanted: &Wanted) {
        let topic = message.flattened_format.message_name();
        let value = |name: &str| {
            let field = message
                .flattened_format
                .field_iter()
                .find(|f| f.flattened_field_name == name);
            field.map(|f| number(f, message.data))
        };
        let Some(time_s) = value("timestamp").map(|us| us * 1e-6) else {
            return;
        };
        self.messages += 1;
        let instance = message.multi_id.value();
        let key = (topic.to_owned(), instance);
        let kept = self
            .kept
            .entry(key)
            .or_insert_with(|| kept(message, instance, wanted));
        for (field, name, factor) in kept.iter() {
            self.series
                .push(name, time_s, number(field, message.data) * factor);
        }
        if instance > 0 {
            return;
        }
        match topic {
            "vehicle_attitude" => {
                let q = [0, 1, 2, 3].map(|k| value(&format!("q[{k}]")).unwrap_or(f64::NAN));
                for (name, angle) in ["roll", "pitch", "yaw"].into_iter().zip(angles_deg(q)) {
                    self.series.push(&format!("{topic}.{name}"), time_s, angle);
                }
            }
            "wind" | "wind_estimate" => {
                if let (Some(north), Some(east)) =
                    (value("windspeed_north"), value("windspeed_east"))
                {
                    super::push_wind(&mut self.series, topic, time_s, north, east);
                }
            }
            _ if RECEIVERS.contains(&topic) => {
                let utc_s = value("time_utc_usec").map(|us| us * 1e-6);
                self.ahead_s
                    .extend(utc_s.filter(|t| *t > FIRST_FIX_S).map(|t| t - time_s));
            }
            "debug_key_value" => self.named(message, time_s, value("value")),
            _ => {}
        }
    }

    /// A value with a name of its own, as gas sensors are often logged.
    fn named(&mut self, message: &DataMessage<'_>, time_s: f64, value: Option<f64>) {
        let letters = message.flattened_format.field_iter();
        let letters = letters.filter(|f| f.flattened_field_name.starts_with("key["));
        let name: String = letters
            .map(|f| number(f, message.data))
            .take_while(|c| *c > 0.0)
            .map(|c| char::from(c as u8))
            .collect();
        if let Some(value) = value {
            self.series
                .push(&format!("debug_key_value.{name}"), time_s, value);
        }
    }
}

fn kept(message: &DataMessage<'_>, instance: u8, wanted: &Wanted) -> Kept {
    let topic = message.flattened_format.message_name();
    let named = |f: &FlattenedField| match instance {
        0 => format!("{topic}.{}", f.flattened_field_name),
        i => format!("{topic}[{i}].{}", f.flattened_field_name),
    };
    let fields = message.flattened_format.field_iter();
    let all = fields.map(|f| (f.clone(), named(f), factor(topic, f)));
    all.filter(|(_, name, _)| wanted.keeps(name)).collect()
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
    mut bytes: Box<dyn Read + '_>,
    wanted: &Wanted,
) -> Result<SeriesLog, ImportError> {
    let mut gathered = Gathered::default();
    let mut at = 0_usize;
    let mut broken = None;
    {
        let mut take = |message: &DataMessage<'_>| gathered.take(message, wanted);
        let mut parser = LogParser::default();
        parser.set_data_message_callback(&mut take);
        let mut piece = vec![0; PIECE];
        loop {
            let count = bytes.read(&mut piece).map_err(ImportError::bytes(name))?;
            if count == 0 {
                break;
            }
            if let Err(error) = parser.consume_bytes(&piece[..count]) {
                broken = Some(format!(
                    "cannot be read beyond byte {at}, or somewhat later: {error}"
                ));
                break;
            }
            at += count;
        }
    }
    if gathered.messages == 0 {
        let what = broken.unwrap_or_else(|| "a ULog without data".to_owned());
        return Err(ImportError::log(
            name,
            what,
            "give the .ulg as the autopilot wrote it",
        ));
    }
    let ahead_s = middle(gathered.ahead_s);
    let mut said = vec![format!("PX4's ULog, {} messages", gathered.messages)];
    said.extend(broken);
    said.push(match ahead_s {
        Some(_) => "times are UTC by the GPS".to_owned(),
        None => "assumed: no GPS fix gives the time, times count from the start of the autopilot"
            .to_owned(),
    });
    Ok(SeriesLog {
        kind: "a PX4 log",
        series: gathered.series.finish(ahead_s.unwrap_or(0.0)),
        is_absolute: ahead_s.is_some(),
        said,
    })
}
