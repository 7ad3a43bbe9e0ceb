//! Logs that are no delimited text: tracks and the logs of autopilots.

pub mod dataflash;
pub mod netcdf;
pub mod ros;
mod series_log;
pub mod spreadsheet;
pub mod tlog;
pub mod track;
pub mod ulog;

pub use series_log::{Collected, Known, SeriesLog, Wanted, is_gas, push_wind};

use crate::ImportError;
use crate::height::Datum;
use crate::map::{ColumnMap, LogMap, Names};
use plume::units::{Gas, Unit};
use series_log::known_column;
use std::io::Read;

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
