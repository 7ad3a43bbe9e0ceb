//! NetCDF in its classic form (versions 1, 2 and 5), with the names and units of the CF conventions.
//!
//! Layout: Unidata, *NetCDF Classic Format Specification*. Numbers are big endian; names, attributes and values are
//! padded to four bytes; variables over the unlimited dimension stand record by record.

use super::series_log::{Collected, Known, SeriesLog};
use crate::ImportError;
use crate::quantity::Dimension;
use crate::time;
use crate::unit::{Conversion, Unit};
use formats::binary::Kind;
use formats::calendar::DAY_S;
use formats::netcdf::{CHAR, kind};
use std::collections::BTreeMap;
use std::io::Read;

/// What the series of these logs are, by CF's standard names; their units are their own.
pub const KNOWN: &[Known] = &[
    ("lat_deg", "latitude", ""),
    ("lon_deg", "longitude", ""),
    ("wind_speed_m_s", "wind_speed", ""),
    ("wind_from_deg", "wind_from_direction", ""),
    ("temperature_c", "air_temperature", ""),
    ("relative_humidity_pct", "relative_humidity", ""),
    ("pressure_hpa", "air_pressure", ""),
];

/// The most dimensions, attributes or variables that a file may say it has: more is damage.
const MOST: usize = 100_000;

/// Reads the head of a file from the left.
struct Head<'a> {
    bytes: &'a [u8],
    at: usize,
    /// Whether counts have eight bytes (version 5).
    wide: bool,
}

impl<'a> Head<'a> {
    fn take(&mut self, count: usize) -> Option<&'a [u8]> {
        let taken = self.bytes.get(self.at..self.at.checked_add(count)?)?;
        self.at += count;
        Some(taken)
    }

    fn padded(&mut self, count: usize) -> Option<&'a [u8]> {
        let taken = self.take(count)?;
        self.take((4 - count % 4) % 4)?;
        Some(taken)
    }

    fn u32(&mut self) -> Option<u32> {
        self.take(4)?.try_into().ok().map(u32::from_be_bytes)
    }

    fn u64(&mut self) -> Option<u64> {
        self.take(8)?.try_into().ok().map(u64::from_be_bytes)
    }

    fn size(&mut self) -> Option<usize> {
        let size = if self.wide {
            self.u64()?
        } else {
            u64::from(self.u32()?)
        };
        usize::try_from(size).ok()
    }

    fn count(&mut self) -> Option<usize> {
        self.size().filter(|n| *n <= MOST)
    }

    fn name(&mut self) -> Option<String> {
        let count = self.count()?;
        self.padded(count).map(crate::decode::letters)
    }

    /// The number of entries of a list, behind its tag.
    fn list(&mut self) -> Option<usize> {
        self.u32()?;
        self.count()
    }

    fn attributes(&mut self) -> Option<BTreeMap<String, Attribute>> {
        let mut all = BTreeMap::new();
        for _ in 0..self.list()? {
            let name = self.name()?;
            let kind = self.u32()?;
            let count = self.size()?;
            let bytes = self.padded(count.checked_mul(width(kind)?)?)?;
            let attribute = Attribute {
                text: crate::decode::letters(bytes)
                    .trim_end_matches('\0')
                    .to_owned(),
                number: number(kind, bytes),
            };
            all.insert(name, attribute);
        }
        Some(all)
    }
}

#[derive(Debug, Default)]
struct Attribute {
    text: String,
    number: f64,
}

#[derive(Debug)]
struct Variable {
    name: String,
    dimensions: Vec<usize>,
    attributes: BTreeMap<String, Attribute>,
    kind: u32,
    /// Bytes of all of it, or of a record.
    bytes: usize,
    begin: usize,
}

impl Variable {
    fn text(&self, attribute: &str) -> &str {
        self.attributes
            .get(attribute)
            .map_or("", |a| a.text.as_str())
    }

    /// Its name by the conventions, or its own.
    fn title(&self) -> &str {
        Some(self.text("standard_name"))
            .filter(|n| !n.is_empty())
            .unwrap_or(&self.name)
    }

    /// A packed value as what it means; NaN where there is none.
    fn unpacked(&self, value: f64) -> f64 {
        let number = |name: &str| self.attributes.get(name).map(|a| a.number);
        let is_none = ["_FillValue", "missing_value"]
            .into_iter()
            .filter_map(number)
            .any(|none| none == value);
        if is_none {
            return f64::NAN;
        }
        value * number("scale_factor").unwrap_or(1.0) + number("add_offset").unwrap_or(0.0)
    }
}

/// The first number of `bytes`; NaN of text and of nothing.
fn number(of: u32, bytes: &[u8]) -> f64 {
    let kind = kind(of).filter(|_| of != CHAR);
    kind.map_or(f64::NAN, |kind| kind.big_endian(bytes))
}

fn width(of: u32) -> Option<usize> {
    kind(of).map(Kind::width)
}

/// A file whose head is read.
struct File<'a> {
    bytes: &'a [u8],
    /// Lengths of the dimensions; the unlimited one has the number of records.
    dimensions: Vec<usize>,
    unlimited: Option<usize>,
    variables: Vec<Variable>,
    record_bytes: usize,
}

impl<'a> File<'a> {
    fn read(bytes: &'a [u8]) -> Option<Self> {
        let version = *bytes.get(3)?;
        let mut head = Head {
            bytes,
            at: 4,
            wide: version == 5,
        };
        let records = head.size()?;
        let mut dimensions = Vec::new();
        let mut unlimited = None;
        for k in 0..head.list()? {
            head.name()?;
            let length = head.size()?;
            if length == 0 {
                unlimited = Some(k);
            }
            dimensions.push(if length == 0 { records } else { length });
        }
        head.attributes()?;
        let mut variables = Vec::new();
        for _ in 0..head.list()? {
            let name = head.name()?;
            let rank = head.count()?;
            let over = (0..rank)
                .map(|_| head.size())
                .collect::<Option<Vec<usize>>>()?;
            let attributes = head.attributes()?;
            let kind = head.u32()?;
            let bytes = head.size()?;
            let begin = if version == 1 {
                head.u32().map(u64::from)
            } else {
                head.u64()
            };
            variables.push(Variable {
                name,
                dimensions: over,
                attributes,
                kind,
                bytes,
                begin: usize::try_from(begin?).ok()?,
            });
        }
        let in_records =
            |v: &&Variable| v.dimensions.first().is_some_and(|d| Some(*d) == unlimited);
        let sizes: Vec<usize> = variables
            .iter()
            .filter(in_records)
            .map(|v| v.bytes)
            .collect();
        let mut record_bytes = sizes
            .iter()
            .try_fold(0_usize, |sum, b| sum.checked_add(*b))?;
        // A single variable in records is not padded.
        if let (1, Some(only)) = (sizes.len(), variables.iter().find(in_records)) {
            let mut inner = only.dimensions[1..]
                .iter()
                .map(|d| dimensions.get(*d).copied());
            let inner = inner.try_fold(1_usize, |n, d| n.checked_mul(d?))?;
            record_bytes = inner.checked_mul(width(only.kind)?)?;
        }
        Some(Self {
            bytes,
            dimensions,
            unlimited,
            variables,
            record_bytes,
        })
    }

    /// The values of a variable over one dimension, or of a single one.
    fn values(&self, variable: &Variable) -> Vec<f64> {
        let Some(width) = width(variable.kind) else {
            return Vec::new();
        };
        let over = variable.dimensions.first();
        let (count, step) = match over {
            None => (1, width),
            Some(d) if Some(*d) == self.unlimited => (self.dimensions[*d], self.record_bytes),
            Some(d) => (self.dimensions.get(*d).copied().unwrap_or(0), width),
        };
        let mut values = Vec::new();
        for k in 0..count {
            let at = k
                .checked_mul(step)
                .and_then(|n| n.checked_add(variable.begin));
            let Some(bytes) = at.and_then(|at| self.bytes.get(at..at.checked_add(width)?)) else {
                break;
            };
            values.push(variable.unpacked(number(variable.kind, bytes)));
        }
        values
    }

    fn is_plain(&self, variable: &Variable) -> bool {
        variable.dimensions.len() <= 1 && variable.kind != CHAR
    }
}

/// What `seconds since 2024-05-01 10:00:00` says: seconds of one, and the zero, s since 1970.
fn since(units: &str) -> Option<(f64, f64)> {
    let (unit, zero) = units.split_once(" since ")?;
    let factor_s = match Unit::parse(Dimension::Duration, unit)?.conversion {
        Conversion::Linear { factor, .. } => factor,
        _ => return None,
    };
    let zero = zero.trim();
    let stamp = time::stamp(zero.as_bytes(), None).map(|s| s.clock_s - s.ahead_s.unwrap_or(0.0));
    let date = || time::date_alone(zero.as_bytes(), None).map(|d| d as f64 * DAY_S);
    Some((factor_s, stamp.or_else(date)?))
}

/// Reads a NetCDF file.
///
/// # Errors
/// A head that is damaged, or no time over a dimension of its own.
pub fn read(name: &str, mut bytes: Box<dyn Read + '_>) -> Result<SeriesLog, ImportError> {
    let mut all = Vec::new();
    bytes
        .read_to_end(&mut all)
        .map_err(ImportError::bytes(name))?;
    let damaged = || {
        ImportError::log(
            name,
            "a NetCDF file with a damaged header",
            "give the file as it was written",
        )
    };
    let file = File::read(&all).ok_or_else(damaged)?;
    // By the conventions several stand one behind the other, and how many rows each has is said here.
    let counts = file
        .variables
        .iter()
        .find(|v| !v.text("sample_dimension").is_empty());
    let several = counts.map_or(0, |v| file.values(v).iter().filter(|n| **n > 0.0).count());
    if several > 1 {
        return Err(ImportError::log(
            name,
            format!("the trajectories of {several} platforms in one file"),
            "give each platform a file of its own, or all as text with a column platform (plumage export --to csv)",
        ));
    }
    let is_time = |v: &&Variable| since(v.text("units")).is_some() && v.dimensions.len() == 1;
    let clock = file.variables.iter().find(is_time).ok_or_else(|| {
        let names: Vec<&str> = file.variables.iter().map(|v| v.name.as_str()).collect();
        ImportError::log(
            name,
            format!("no time among the variables {}", names.join(", ")),
            "give a file with a variable whose units are such as \"seconds since 2024-05-01 10:00:00\", or write it as \
             text (ncdump)",
        )
    })?;
    let (factor_s, zero_s) = since(clock.text("units")).ok_or_else(damaged)?;
    let times: Vec<f64> = file
        .values(clock)
        .iter()
        .map(|t| zero_s + t * factor_s)
        .collect();
    let mut series = Collected::default();
    for variable in &file.variables {
        if variable.name == clock.name || !file.is_plain(variable) {
            continue;
        }
        let values = file.values(variable);
        let title = variable.title();
        if variable.dimensions == clock.dimensions {
            for (time_s, value) in times.iter().zip(values) {
                series.push(title, *time_s, value);
            }
        } else if let [value] = values[..] {
            // Of a station: the same at all times.
            for time_s in &times {
                series.push(title, *time_s, value);
            }
        } else {
            continue;
        }
        series.unit(title, variable.text("units"));
    }
    let notices = vec![format!(
        "NetCDF, {} times in {}",
        times.len(),
        clock.text("units")
    )];
    Ok(SeriesLog {
        kind: "a NetCDF file",
        series: series.finish(0.0),
        is_absolute: true,
        notices,
        ..SeriesLog::default()
    })
}
