//! Telemetry logs of ground stations (`.tlog`): MAVLink frames, each behind the time of its reception.
//!
//! Layout (mavlink.io, *MAVLink Guide*, and Mission Planner's documentation): eight bytes, big endian, microseconds
//! since 1970, then a frame as on the wire.

use super::series_log::{Collected, Known, SeriesLog, Wanted};
use crate::ImportError;
use mavlink::dialects::ardupilotmega::{MavAutopilot, MavMessage};
use mavlink::{MavlinkVersion, Message as _};
use std::io::Read;

/// What the series of these logs are.
pub const KNOWN: &[Known] = &[
    ("lat_deg", "GLOBAL_POSITION_INT.lat GPS_RAW_INT.lat", "deg"),
    ("lon_deg", "GLOBAL_POSITION_INT.lon GPS_RAW_INT.lon", "deg"),
    ("alt_amsl_m", "GLOBAL_POSITION_INT.alt GPS_RAW_INT.alt", "m"),
    ("wind_speed_m_s", "WIND.speed WIND_COV.wind_speed", "m/s"),
    ("wind_from_deg", "WIND.direction WIND_COV.wind_from", "deg"),
    ("temperature_c", "HYGROMETER_SENSOR.temperature", "C"),
    ("relative_humidity_pct", "HYGROMETER_SENSOR.humidity", "%"),
    ("pressure_hpa", "SCALED_PRESSURE.press_abs", "hPa"),
    ("airspeed_m_s", "VFR_HUD.airspeed", "m/s"),
    ("roll_deg", "ATTITUDE.roll", "rad"),
    ("pitch_deg", "ATTITUDE.pitch", "rad"),
    ("yaw_deg", "ATTITUDE.yaw", "rad"),
    ("roll_rate_deg_s", "ATTITUDE.rollspeed", "rad/s"),
    ("pitch_rate_deg_s", "ATTITUDE.pitchspeed", "rad/s"),
    ("yaw_rate_deg_s", "ATTITUDE.yawspeed", "rad/s"),
    ("accel_x_m_s2", "SCALED_IMU2.xacc SCALED_IMU.xacc", "mg"),
    ("accel_y_m_s2", "SCALED_IMU2.yacc SCALED_IMU.yacc", "mg"),
    ("accel_z_m_s2", "SCALED_IMU2.zacc SCALED_IMU.zacc", "mg"),
    ("throttle", "VFR_HUD.throttle", "%"),
    ("vel_north_m_s", "GLOBAL_POSITION_INT.vx", "cm/s"),
    ("vel_east_m_s", "GLOBAL_POSITION_INT.vy", "cm/s"),
    ("vel_down_m_s", "GLOBAL_POSITION_INT.vz", "cm/s"),
];

/// Bytes of a time.
const TIME_BYTES: usize = 8;
/// Times before 2001-09-09 or after 2096 are none, µs since 1970.
const TIMES_US: std::ops::Range<u64> = 1_000_000_000_000_000..4_000_000_000_000_000;
/// The longest frame: head, payload, checksum and signature.
const LONGEST_FRAME: usize = 10 + 255 + 2 + 13;

/// A frame on its way.
struct Frame<'a> {
    version: MavlinkVersion,
    system: u8,
    message: u32,
    payload: &'a [u8],
    /// Bytes of all of it.
    length: usize,
    /// What its checksum is over, and the checksum.
    checked: &'a [u8],
    checksum: [u8; 2],
}

/// The frame at the beginning of `bytes`; none where there is none, or not all of it.
fn frame(bytes: &[u8]) -> Option<Frame<'_>> {
    let length = usize::from(*bytes.get(1)?);
    let (version, head, signature) = match bytes[0] {
        0xFE => (MavlinkVersion::V1, 6, 0),
        0xFD => (
            MavlinkVersion::V2,
            10,
            if bytes.get(2)? & 1 != 0 { 13 } else { 0 },
        ),
        _ => return None,
    };
    let end = head + length;
    let checksum = bytes.get(end..end + 2)?;
    bytes.get(..end + 2 + signature)?;
    let (system, message) = match version {
        MavlinkVersion::V1 => (bytes[3], u32::from(bytes[5])),
        MavlinkVersion::V2 => (
            bytes[5],
            u32::from_le_bytes([bytes[7], bytes[8], bytes[9], 0]),
        ),
    };
    Some(Frame {
        version,
        system,
        message,
        payload: &bytes[head..end],
        length: end + 2 + signature,
        checked: &bytes[1..end],
        checksum: [checksum[0], checksum[1]],
    })
}

impl Frame<'_> {
    /// The message, where the checksum is right and the dialect knows it.
    fn decoded(&self) -> Option<MavMessage> {
        let checksum = mavlink::calculate_crc(self.checked, MavMessage::extra_crc(self.message));
        if checksum.to_le_bytes() != self.checksum {
            return None;
        }
        MavMessage::parse(self.version, self.message, self.payload).ok()
    }
}

#[derive(Default)]
struct Gathered {
    series: Collected,
    /// The vehicle's system.
    system: Option<u8>,
    others: Vec<u8>,
    frames: usize,
    strange_bytes: usize,
}

/// Reads a telemetry log.
///
/// # Errors
/// Bytes that hold no frames of a vehicle, or that cannot be read.
pub fn read(
    name: &str,
    mut bytes: Box<dyn Read + '_>,
    wanted: &Wanted,
) -> Result<SeriesLog, ImportError> {
    let mut gathered = Gathered::default();
    let mut waiting: Vec<u8> = Vec::new();
    let mut piece = vec![0; 1 << 18];
    loop {
        let count = bytes.read(&mut piece).map_err(ImportError::bytes(name))?;
        waiting.extend_from_slice(&piece[..count]);
        let used = gathered.take(&waiting, count == 0, wanted);
        waiting.drain(..used);
        if count == 0 {
            gathered.strange_bytes += waiting.len();
            break;
        }
    }
    let Some(system) = gathered.system else {
        return Err(ImportError::log(
            name,
            format!(
                "a telemetry log without a vehicle's heartbeat ({} frames)",
                gathered.frames
            ),
            "give the .tlog as the ground station wrote it",
        ));
    };
    let mut notices = vec![
        format!("telemetry of system {system}, {} frames", gathered.frames),
        "times are UTC by the ground station's clock at reception".to_owned(),
    ];
    if !gathered.others.is_empty() {
        notices.push(format!("systems {:?} are ignored", gathered.others));
    }
    if gathered.strange_bytes > 0 {
        notices.push(format!(
            "{} bytes outside of frames are skipped",
            gathered.strange_bytes
        ));
    }
    Ok(SeriesLog {
        kind: "a telemetry log",
        series: gathered.series.finish(0.0),
        is_absolute: true,
        notices,
        ..SeriesLog::default()
    })
}

impl Gathered {
    /// Takes all whole frames of `bytes`, and the rest too at the log's `end`. How many bytes were used.
    fn take(&mut self, bytes: &[u8], end: bool, wanted: &Wanted) -> usize {
        let mut at = 0;
        while bytes.len() - at > TIME_BYTES
            && (end || bytes.len() - at >= TIME_BYTES + LONGEST_FRAME)
        {
            let mut time = [0; TIME_BYTES];
            time.copy_from_slice(&bytes[at..at + TIME_BYTES]);
            let time_us = u64::from_be_bytes(time);
            let frame = frame(&bytes[at + TIME_BYTES..]).filter(|_| TIMES_US.contains(&time_us));
            match frame {
                Some(frame) => {
                    at += TIME_BYTES + frame.length;
                    self.frames += 1;
                    if let Some(message) = frame.decoded() {
                        self.message(frame.system, &message, time_us as f64 * 1e-6, wanted);
                    }
                }
                None => {
                    at += 1;
                    self.strange_bytes += 1;
                }
            }
        }
        at
    }

    fn message(&mut self, system: u8, message: &MavMessage, time_s: f64, wanted: &Wanted) {
        if let MavMessage::HEARTBEAT(m) = message
            && m.autopilot != MavAutopilot::MAV_AUTOPILOT_INVALID
            && self.system.is_none()
        {
            self.system = Some(system);
        }
        if self.system != Some(system) {
            if matches!(message, MavMessage::HEARTBEAT(_)) && !self.others.contains(&system) {
                self.others.push(system);
            }
            return;
        }
        for (name, value) in values(message) {
            if wanted.keeps(&name) {
                self.series.push(&name, time_s, value);
            }
        }
    }
}

/// The values of a message by their names.
fn values(message: &MavMessage) -> Vec<(String, f64)> {
    let named = |topic: &str, values: &[(&str, f64)]| -> Vec<(String, f64)> {
        values
            .iter()
            .map(|(field, value)| (format!("{topic}.{field}"), *value))
            .collect()
    };
    match message {
        // Without a fix receivers say 0, 0.
        MavMessage::GLOBAL_POSITION_INT(m) if (m.lat, m.lon) != (0, 0) => named(
            "GLOBAL_POSITION_INT",
            &[
                ("lat", f64::from(m.lat) * 1e-7),
                ("lon", f64::from(m.lon) * 1e-7),
                ("alt", f64::from(m.alt) * 1e-3),
                ("vx", f64::from(m.vx)),
                ("vy", f64::from(m.vy)),
                ("vz", f64::from(m.vz)),
            ],
        ),
        MavMessage::GPS_RAW_INT(m) if (m.lat, m.lon) != (0, 0) => named(
            "GPS_RAW_INT",
            &[
                ("lat", f64::from(m.lat) * 1e-7),
                ("lon", f64::from(m.lon) * 1e-7),
                ("alt", f64::from(m.alt) * 1e-3),
            ],
        ),
        MavMessage::ATTITUDE(m) => named(
            "ATTITUDE",
            &[
                ("roll", f64::from(m.roll)),
                ("pitch", f64::from(m.pitch)),
                ("yaw", f64::from(m.yaw)),
                ("rollspeed", f64::from(m.rollspeed)),
                ("pitchspeed", f64::from(m.pitchspeed)),
                ("yawspeed", f64::from(m.yawspeed)),
            ],
        ),
        MavMessage::VFR_HUD(m) => named(
            "VFR_HUD",
            &[
                ("airspeed", f64::from(m.airspeed)),
                ("throttle", f64::from(m.throttle)),
            ],
        ),
        MavMessage::WIND(m) => named(
            "WIND",
            &[
                ("speed", f64::from(m.speed)),
                ("direction", air::geo::wrap_deg(f64::from(m.direction))),
            ],
        ),
        MavMessage::WIND_COV(m) => {
            let (north, east) = (f64::from(m.wind_x), f64::from(m.wind_y));
            named(
                "WIND_COV",
                &[
                    ("wind_speed", north.hypot(east)),
                    ("wind_from", air::wind::from_deg(east, north)),
                ],
            )
        }
        MavMessage::SCALED_PRESSURE(m) => named(
            "SCALED_PRESSURE",
            &[
                ("press_abs", f64::from(m.press_abs)),
                ("temperature", f64::from(m.temperature) * 0.01),
            ],
        ),
        MavMessage::HYGROMETER_SENSOR(m) => named(
            "HYGROMETER_SENSOR",
            &[
                ("temperature", f64::from(m.temperature) * 0.01),
                ("humidity", f64::from(m.humidity) * 0.01),
            ],
        ),
        MavMessage::SCALED_IMU(m) => named(
            "SCALED_IMU",
            &[
                ("xacc", f64::from(m.xacc)),
                ("yacc", f64::from(m.yacc)),
                ("zacc", f64::from(m.zacc)),
            ],
        ),
        MavMessage::SCALED_IMU2(m) => named(
            "SCALED_IMU2",
            &[
                ("xacc", f64::from(m.xacc)),
                ("yacc", f64::from(m.yacc)),
                ("zacc", f64::from(m.zacc)),
            ],
        ),
        MavMessage::SERVO_OUTPUT_RAW(m) => named(
            "SERVO_OUTPUT_RAW",
            &[
                ("servo1_raw", f64::from(m.servo1_raw)),
                ("servo2_raw", f64::from(m.servo2_raw)),
                ("servo3_raw", f64::from(m.servo3_raw)),
                ("servo4_raw", f64::from(m.servo4_raw)),
            ],
        ),
        MavMessage::NAMED_VALUE_FLOAT(m) => {
            let name = m.name.to_str().unwrap_or_default();
            named("NAMED_VALUE_FLOAT", &[(name, f64::from(m.value))])
        }
        _ => Vec::new(),
    }
}
