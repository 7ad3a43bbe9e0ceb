//! ArduPilot's DataFlash logs (`.bin`): records whose form is given by records before them.
//!
//! Layout (ardupilot.org, *Logging*, and `libraries/AP_Logger/LogStructure.h`): `A3 95`, the number of the record's
//! type, and its fields in little endian. A record of type 128 (`FMT`) gives type, length, name (4 letters), the
//! fields' types (16 letters) and names (64 letters, separated by commas).
//!
//! A reader of our own: `ardupilot-binlog` 0.2.0 gives up after 256 damaged records in a row without a word, neither counts
//! the bytes that it skips nor reports a failed read, and does not know the type `g`.

use super::series_log::{Collected, Known, SeriesLog, Wanted};
use crate::ImportError;
use formats::binary::Kind;
use std::collections::BTreeMap;
use std::io::{BufRead, BufReader, Read};

/// What the series of these logs are.
pub const KNOWN: &[Known] = &[
    ("lat_deg", "POS.Lat GPS.Lat", "deg"),
    ("lon_deg", "POS.Lng GPS.Lng", "deg"),
    ("alt_amsl_m", "POS.Alt GPS.Alt", "m"),
    ("wind_speed_m_s", "XKF2.wind_speed NKF2.wind_speed", "m/s"),
    ("wind_from_deg", "XKF2.wind_from NKF2.wind_from", "deg"),
    ("pressure_hpa", "BARO.Press", "Pa"),
    ("airspeed_m_s", "ARSP.Airspeed", "m/s"),
    ("angle_of_attack_deg", "AOA.AOA", "deg"),
    ("sideslip_deg", "AOA.SSA", "deg"),
    ("roll_deg", "ATT.Roll", "deg"),
    ("pitch_deg", "ATT.Pitch", "deg"),
    ("yaw_deg", "ATT.Yaw", "deg"),
    ("roll_rate_deg_s", "IMU.GyrX", "rad/s"),
    ("pitch_rate_deg_s", "IMU.GyrY", "rad/s"),
    ("yaw_rate_deg_s", "IMU.GyrZ", "rad/s"),
    ("accel_x_m_s2", "IMU.AccX", "m/s2"),
    ("accel_y_m_s2", "IMU.AccY", "m/s2"),
    ("accel_z_m_s2", "IMU.AccZ", "m/s2"),
    ("vel_north_m_s", "XKF1.VN NKF1.VN", "m/s"),
    ("vel_east_m_s", "XKF1.VE NKF1.VE", "m/s"),
    ("vel_down_m_s", "XKF1.VD NKF1.VD", "m/s"),
];

/// The type of records that give the form of others.
const FORMAT: u8 = 128;
/// Bytes of such a record after its head.
const FORMAT_BYTES: usize = 86;
/// GPS time began at 1980-01-06T00:00:00Z, s since 1970.
const GPS_EPOCH_S: f64 = 315_964_800.0;
/// What GPS time is ahead of UTC since 2017, s (IERS Bulletin C).
const LEAP_S: f64 = 18.0;
/// Seconds of a week.
const WEEK_S: f64 = 604_800.0;
/// A fix in three dimensions (ArduPilot, `GPS_OK_FIX_3D`).
const FIX_3D: f64 = 3.0;

/// The form of a type of record.
#[derive(Debug, Clone, Default)]
struct Form {
    name: String,
    bytes: usize,
    fields: Vec<Field>,
    /// The field that numbers sensors of one kind, if there is one.
    instance: Option<usize>,
}

#[derive(Debug, Clone)]
struct Field {
    label: String,
    kind: u8,
    at: usize,
    /// Name of its series, where it is kept.
    kept: Option<String>,
}

/// The numbers of a field of this type, and what each is divided by; none of text, arrays and unknown types.
fn kind(of: u8) -> Option<(Kind, f64)> {
    Some(match of {
        b'b' => (Kind::I8, 1.0),
        b'B' | b'M' => (Kind::U8, 1.0),
        b'h' => (Kind::I16, 1.0),
        b'H' => (Kind::U16, 1.0),
        b'c' => (Kind::I16, 100.0),
        b'C' => (Kind::U16, 100.0),
        b'i' => (Kind::I32, 1.0),
        b'I' => (Kind::U32, 1.0),
        b'e' => (Kind::I32, 100.0),
        b'E' => (Kind::U32, 100.0),
        b'L' => (Kind::I32, 1e7),
        b'f' => (Kind::F32, 1.0),
        b'd' => (Kind::F64, 1.0),
        b'q' => (Kind::I64, 1.0),
        b'Q' => (Kind::U64, 1.0),
        _ => return None,
    })
}

/// Bytes of a field of this type; none of an unknown one.
fn size(of: u8) -> Option<usize> {
    let other = match of {
        b'g' => Some(2),
        b'n' => Some(4),
        b'N' => Some(16),
        b'Z' | b'a' => Some(64),
        _ => None,
    };
    kind(of).map(|(kind, _)| kind.width()).or(other)
}

/// The number in a field; NaN of one that is none.
fn number(of: u8, bytes: &[u8]) -> f64 {
    kind(of).map_or(f64::NAN, |(kind, per_unit)| {
        kind.little_endian(bytes) / per_unit
    })
}

fn letters(bytes: &[u8]) -> String {
    let end = bytes.iter().position(|b| *b == 0).unwrap_or(bytes.len());
    crate::decode::letters(&bytes[..end])
}

/// What a record of type 128 gives: a type and its form.
fn form(record: &[u8], wanted: &Wanted) -> Option<(u8, Form)> {
    let bytes = usize::from(record[1]).checked_sub(3)?;
    let name = letters(&record[2..6]);
    let kinds = letters(&record[6..22]);
    let labels = letters(&record[22..FORMAT_BYTES]);
    let mut at = 0;
    let mut fields = Vec::new();
    for (kind, label) in kinds.bytes().zip(labels.split(',')) {
        let next = at + size(kind)?;
        if next > bytes {
            return None;
        }
        let full = format!("{name}.{label}");
        let label = label.trim().to_owned();
        let kept = wanted.keeps(&full).then_some(full);
        fields.push(Field {
            label,
            kind,
            at,
            kept,
        });
        at = next;
    }
    let numbers = |f: &Field| ["I", "C"].contains(&f.label.as_str()) && f.kind == b'B';
    let instance = fields.iter().position(numbers).filter(|k| *k == 1);
    Some((
        record[0],
        Form {
            name,
            bytes,
            fields,
            instance,
        },
    ))
}

impl Form {
    fn value(&self, record: &[u8], label: &str) -> Option<f64> {
        let field = self.fields.iter().find(|f| f.label == label)?;
        Some(number(field.kind, &record[field.at..]))
    }

    /// Time since the start, s.
    fn time_s(&self, record: &[u8]) -> Option<f64> {
        let field = self.fields.first()?;
        match field.label.as_str() {
            "TimeUS" => Some(number(field.kind, record) * 1e-6),
            "TimeMS" => Some(number(field.kind, record) * 1e-3),
            _ => None,
        }
    }
}

/// What is gathered while a log is read.
#[derive(Default)]
struct Gathered {
    series: Collected,
    /// What UTC is ahead of the log's clock, s, by each fix.
    ahead_s: Vec<f64>,
    records: usize,
    strange_bytes: usize,
}

impl Gathered {
    fn take(&mut self, form: &Form, record: &[u8]) {
        self.records += 1;
        let Some(time_s) = form.time_s(record) else {
            return;
        };
        let instance = form
            .instance
            .map(|k| number(form.fields[k].kind, &record[form.fields[k].at..]));
        let instance = instance.filter(|i| *i > 0.0);
        for field in &form.fields {
            let Some(name) = &field.kept else { continue };
            let value = number(field.kind, &record[field.at..]);
            match instance {
                None => self.series.push(name, time_s, value),
                Some(i) => {
                    let numbered = format!("{}[{i}].{}", form.name, field.label);
                    self.series.push(&numbered, time_s, value);
                }
            }
        }
        match form.name.as_str() {
            "GPS" if instance.is_none() => self.fix(form, record, time_s),
            "XKF2" | "NKF2" if instance.is_none() => self.wind(form, record, time_s),
            _ => {}
        }
    }

    fn fix(&mut self, form: &Form, record: &[u8], time_s: f64) {
        let value = |label| form.value(record, label);
        if let (Some(week), Some(ms), Some(status)) = (value("GWk"), value("GMS"), value("Status"))
            && status >= FIX_3D
            && week > 0.0
        {
            let utc_s = GPS_EPOCH_S + week * WEEK_S + ms * 1e-3 - LEAP_S;
            self.ahead_s.push(utc_s - time_s);
        }
    }

    /// The filter's wind is a vector towards north and east.
    fn wind(&mut self, form: &Form, record: &[u8], time_s: f64) {
        if let (Some(north), Some(east)) = (form.value(record, "VWN"), form.value(record, "VWE")) {
            super::series_log::push_wind(&mut self.series, &form.name, time_s, north, east);
        }
    }
}

/// Reads a DataFlash log.
///
/// # Errors
/// Bytes that hold no records, or that cannot be read.
pub fn read(
    name: &str,
    bytes: Box<dyn Read + '_>,
    wanted: &Wanted,
) -> Result<SeriesLog, ImportError> {
    let mut reader = BufReader::with_capacity(1 << 18, bytes);
    let mut forms: BTreeMap<u8, Form> = BTreeMap::new();
    let mut gathered = Gathered::default();
    let mut record = Vec::new();
    while let Some(kind) =
        next_head(&mut reader, &mut gathered.strange_bytes).map_err(ImportError::bytes(name))?
    {
        let length = if kind == FORMAT {
            Some(FORMAT_BYTES)
        } else {
            forms.get(&kind).map(|f| f.bytes)
        };
        let Some(length) = length else {
            gathered.strange_bytes += 3;
            continue;
        };
        record.resize(length, 0);
        if reader.read_exact(&mut record).is_err() {
            gathered.strange_bytes += 3;
            break;
        }
        if kind == FORMAT {
            if let Some((kind, form)) = form(&record, wanted) {
                forms.insert(kind, form);
            }
        } else if let Some(form) = forms.get(&kind) {
            gathered.take(form, &record);
        }
    }
    if gathered.records == 0 {
        return Err(ImportError::log(
            name,
            "a DataFlash log without records",
            "give the .bin as the autopilot wrote it",
        ));
    }
    let mut notices = vec![format!("ArduPilot's log, {} records", gathered.records)];
    if gathered.strange_bytes > 0 {
        notices.push(format!(
            "{} bytes outside of records are skipped",
            gathered.strange_bytes
        ));
    }
    let Gathered {
        series, ahead_s, ..
    } = gathered;
    let clock = "times are UTC by the GPS, with 18 leap seconds";
    Ok(series.of_autopilot("an ArduPilot log", ahead_s, notices, clock))
}

/// Goes to the next head of a record: its type, or none at the end. Bytes before it are counted as `strange`.
fn next_head(reader: &mut impl BufRead, strange: &mut usize) -> std::io::Result<Option<u8>> {
    let mut before = 0;
    loop {
        let mut byte = [0];
        if reader.read(&mut byte)? == 0 {
            return Ok(None);
        }
        if before == 0xA3 && byte[0] == 0x95 {
            *strange -= 1;
            let mut kind = [0];
            let got = reader.read(&mut kind)?;
            return Ok((got > 0).then_some(kind[0]));
        }
        *strange += 1;
        before = byte[0];
    }
}
