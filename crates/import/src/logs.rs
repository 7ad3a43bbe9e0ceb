//! Logs that are no delimited text: tracks and the logs of autopilots.

pub mod dataflash;
pub mod netcdf;
pub mod ros;
pub mod spreadsheet;
pub mod tlog;
pub mod track;
pub mod ulog;

use crate::ImportError;
use crate::height::Datum;
use crate::map::{ColumnMap, LogMap, Names};
use crate::quantity::Quantity;
use crate::recognise::Header;
use crate::series::Series;
use plume::units::{Gas, Unit};
use std::collections::{BTreeMap, BTreeSet};
use std::io::Read;

/// A log as series.
#[derive(Debug, Clone, Default)]
pub struct SeriesLog {
    /// What kind of log it is, in words.
    pub kind: &'static str,
    /// Its series.
    pub series: Vec<Series>,
    /// Whether times count from 1970; else from the start of what logged.
    pub is_absolute: bool,
    /// What was found, in words.
    pub notices: Vec<String>,
    /// Name of the platform, where the log has several.
    pub platform: Option<String>,
    /// What this log shows of its columns, beside what is [known](Format::known) of its format.
    pub known: LogMap,
}

/// A kind of log.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Format {
    /// Delimited text.
    Text,
    /// PX4's ULog.
    Ulog,
    /// ArduPilot's DataFlash log.
    DataFlash,
    /// MAVLink frames with times, as ground stations keep them.
    Tlog,
    /// GPX.
    Gpx,
    /// KML.
    Kml,
    /// NetCDF in its classic form.
    NetCdf,
    /// ROS 2 in MCAP.
    Ros,
    /// A spreadsheet, which is read as text.
    Spreadsheet,
}

/// Bytes by which a format is told.
pub const TELLING_BYTES: u64 = 1024;

impl Format {
    /// The format of a log that begins with `head`.
    ///
    /// # Errors
    /// A format that is known and not read, with what to do.
    pub fn of(name: &str, head: &[u8]) -> Result<Self, ImportError> {
        let text = String::from_utf8_lossy(head).to_lowercase();
        let refused = |what: &str, todo: &str| Err(ImportError::log(name, what, todo));
        match head {
            [0x55, 0x4C, 0x6F, 0x67, 0x01, 0x12, 0x35, ..] => Ok(Self::Ulog),
            [0xA3, 0x95, ..] => Ok(Self::DataFlash),
            // Eight bytes of time before a frame.
            [0, _, _, _, _, _, _, _, 0xFD | 0xFE, ..] => Ok(Self::Tlog),
            [0x89, b'H', b'D', b'F', ..] => refused(
                "HDF5, or NetCDF-4, which is HDF5",
                "write it as NetCDF-3 (nccopy -k classic IN.nc OUT.nc) or as text (ncdump, h5dump)",
            ),
            [b'C', b'D', b'F', 1 | 2 | 5, ..] => Ok(Self::NetCdf),
            [0x89, b'M', b'C', b'A', b'P', ..] => Ok(Self::Ros),
            _ if spreadsheet::is_spreadsheet(head) => Ok(Self::Spreadsheet),
            [b'P', b'K', 3, 4, ..] => refused(
                "a compressed file (zip, or a spreadsheet such as xlsx, or kmz)",
                "unpack it, or save the spreadsheet as CSV",
            ),
            [0x1F, 0x8B, ..] => refused("a gzip file", "unpack it (gunzip)"),
            _ if text.contains("<gpx") => Ok(Self::Gpx),
            _ if text.contains("<kml") => Ok(Self::Kml),
            _ if text.trim_start().starts_with("<?xml") => refused(
                "XML that is neither GPX nor KML",
                "save the log as CSV, GPX or KML",
            ),
            _ => Ok(Self::Text),
        }
    }

    /// Reads a log of this format, keeping the series that `map` names: one for each platform.
    ///
    /// # Errors
    /// Bytes that are no such log, with where and what to do.
    pub fn read(
        self,
        name: &str,
        bytes: Box<dyn Read + '_>,
        map: &LogMap,
    ) -> Result<Vec<SeriesLog>, ImportError> {
        let wanted = &Wanted::of(map);
        let log = match self {
            Self::Ulog => ulog::read(name, bytes, wanted),
            Self::DataFlash => dataflash::read(name, bytes, wanted),
            Self::Tlog => tlog::read(name, bytes, wanted),
            Self::Gpx => track::gpx(name, bytes),
            Self::Kml => track::kml(name, bytes),
            Self::NetCdf => netcdf::read(name, bytes),
            Self::Ros => {
                let lat = map.column.get("lat_deg").and_then(|c| c.from.as_ref());
                let position = lat.and_then(|n| n.all().first());
                return ros::read(name, bytes, wanted, position.map(String::as_str));
            }
            Self::Text | Self::Spreadsheet => {
                Err(ImportError::log(name, "text", "read it as text"))
            }
        };
        log.map(|log| vec![log])
    }

    /// What is known of the columns of such logs.
    pub fn known(self) -> LogMap {
        let columns = match self {
            Self::Ulog => ulog::KNOWN,
            Self::DataFlash => dataflash::KNOWN,
            Self::Tlog => tlog::KNOWN,
            Self::Gpx | Self::Kml => track::KNOWN,
            Self::NetCdf => netcdf::KNOWN,
            Self::Ros | Self::Text | Self::Spreadsheet => &[],
        };
        let mut map = LogMap::default();
        if self == Self::NetCdf {
            let named = |gas: Gas| ColumnMap {
                from: Some(Names::Many(vec![gas.standard_name()])),
                ..ColumnMap::default()
            };
            let columns = Gas::ALL.map(|gas| (gas.column(Unit::Ppm).to_owned(), named(gas)));
            map.column.extend(columns);
        }
        // Autopilots say in their documents that these altitudes are above the sea.
        let is_autopilot = matches!(self, Self::Ulog | Self::DataFlash | Self::Tlog);
        for (column, from, unit) in columns {
            let from: Vec<String> = from.split(' ').map(str::to_owned).collect();
            let datum = Some(Datum::Amsl).filter(|_| is_autopilot && *column == "alt_amsl_m");
            let known = known_column(from, unit, datum);
            map.column.insert((*column).to_owned(), known);
        }
        map
    }
}

/// A column that is one of the series `from`, the first that is there; with an empty unit where the log says it.
pub(crate) fn known_column(from: Vec<String>, unit: &str, datum: Option<Datum>) -> ColumnMap {
    ColumnMap {
        from: Some(Names::Many(from)),
        unit: Some(unit.to_owned()).filter(|u| !u.is_empty()),
        datum,
        ..ColumnMap::default()
    }
}

/// What is known of a column: its name, the series that may be it (parted by blanks, the first that is there), and
/// their unit (empty where the log says it).
pub type Known = (&'static str, &'static str, &'static str);

/// Which series of a log are kept.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Wanted(BTreeSet<String>);

impl Wanted {
    /// Those that `map` names.
    pub fn of(map: &LogMap) -> Self {
        let named = map.column.values().filter_map(|c| c.from.as_ref());
        Self(named.flat_map(|n| n.all()).cloned().collect())
    }

    /// Whether the series `name` is kept: those that are named, and gases.
    pub fn keeps(&self, name: &str) -> bool {
        self.0.contains(name) || is_gas(name)
    }
}

/// Whether the field of a series is called like a gas.
pub fn is_gas(name: &str) -> bool {
    let field = Header::new(name.rsplit('.').next().unwrap_or(name));
    let gases = crate::quantity::OBSERVATION.iter().filter(|q| q.is_gas());
    gases
        .into_iter()
        .any(|q: &Quantity| field.quantity(q).is_some())
}

/// Series by their names, while a log is read.
#[derive(Debug, Default)]
pub struct Collected(BTreeMap<String, Series>);

impl Collected {
    /// Adds a value to the series `name`.
    pub fn push(&mut self, name: &str, time_s: f64, value: f64) {
        if let Some(series) = self.0.get_mut(name) {
            series.push(time_s, value);
            return;
        }
        let mut series = Series::new(name);
        series.push(time_s, value);
        self.0.insert(name.to_owned(), series);
    }

    /// States the unit of the series `name`.
    pub fn unit(&mut self, name: &str, unit: &str) {
        if let Some(series) = self.0.get_mut(name) {
            unit.clone_into(&mut series.unit);
        }
    }

    /// The log of an autopilot of this `kind`: its times in UTC, as `clock` words it, where fixes say what UTC is ahead of
    /// them, s, and since its start where there was no fix.
    pub fn of_autopilot(
        self,
        kind: &'static str,
        mut ahead_s: Vec<f64>,
        mut notices: Vec<String>,
        clock: &str,
    ) -> SeriesLog {
        // The median: a few wrong fixes do not move it.
        ahead_s.sort_by(f64::total_cmp);
        let ahead_s = ahead_s.get(ahead_s.len() / 2).copied();
        notices.push(match ahead_s {
            Some(_) => clock.to_owned(),
            None => {
                "assumed: times count from the start of the autopilot, since no GPS fix gives the time"
                    .to_owned()
            }
        });
        SeriesLog {
            kind,
            series: self.finish(ahead_s.unwrap_or(0.0)),
            is_absolute: ahead_s.is_some(),
            notices,
            ..SeriesLog::default()
        }
    }

    /// All series, their times moved by `shift_s` and in order.
    pub fn finish(self, shift_s: f64) -> Vec<Series> {
        let mut all: Vec<Series> = self.0.into_values().collect();
        for series in &mut all {
            for time_s in &mut series.time_s {
                *time_s += shift_s;
            }
            series.sort();
        }
        all.retain(|s| !s.time_s.is_empty());
        all
    }
}

/// Adds the speed and direction of a wind that blows *towards* `north` and `east`, m/s.
pub fn push_wind(series: &mut Collected, topic: &str, time_s: f64, north: f64, east: f64) {
    series.push(&format!("{topic}.wind_speed"), time_s, north.hypot(east));
    series.push(
        &format!("{topic}.wind_from"),
        time_s,
        air::wind::from_deg(east, north),
    );
}
