//! Observations: what was read, where and when, as CSV text.
//!
//! Header names are fixed, their order is free. Required columns are `time_s`, `platform`,
//! `lat_deg`, `lon_deg`, `alt_amsl_m` and the readings of the gas that is asked for, `co2_ppm` or
//! `co2_ppb` and so on ([`Gas::column`]); optional ones are `wind_speed_m_s`, `wind_from_deg`,
//! `temperature_c`, `relative_humidity_pct`, `pressure_hpa`, `sd_ppm` or `sd_ppb`, and what a reading is the mean over:
//! `averaging_s`, a time that ends at `time_s`, and `lat2_deg`, `lon2_deg` and `alt2_amsl_m`, the other end of a straight
//! line. Readings of other gases are kept aside.
//! An empty cell, or one that says `nan`, is missing. Any other column is kept as text
//! ([`Observations::extra`]) and a notice says so.
//!
//! Several files are joined: they share `time_s`, and a platform of the same name in two
//! files is the same platform. Within one file the rows of one platform must be in order of
//! time. Only what is no number is refused here. Numbers that cannot be (-999 m/s, latitude 434,
//! parts per billion) are left out, and said, by [`checks::check`], which whoever concludes
//! something from observations asks first.

use air::geo::{Geodetic, LocalFrame};
use formats::table::{self, Cells, Column};
use plume::{Gas, Place, Span, Unit};

pub mod checks;
mod error;
mod quality;
mod read;
mod stream;
mod zero;

pub use error::ObservationError;
pub use quality::{DataQuality, Flaw};
pub use read::parse;
pub use stream::{ObservationStream, Streamed};

/// The columns that every file has beside its readings.
pub const REQUIRED: [&str; 5] = ["time_s", "platform", "lat_deg", "lon_deg", "alt_amsl_m"];

/// The columns that a file may have.
pub const OPTIONAL: [&str; 7] = [
    "wind_speed_m_s",
    "wind_from_deg",
    "temperature_c",
    "relative_humidity_pct",
    "pressure_hpa",
    "sd_ppm",
    "averaging_s",
];

/// The columns of the other end of the line over which readings are means: all three or none.
pub const LINE_END: [&str; 3] = ["lat2_deg", "lon2_deg", "alt2_amsl_m"];
/// `sd_ppm` in the other unit.
pub const SD_PPB: &str = "sd_ppb";

/// One row: a reading, or the place where one is missing.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct ObservationRow {
    /// Time shared by all files of one call, s; finite, any zero.
    pub time_s: f64,
    /// Index into [`Observations::platforms`].
    pub platform: usize,
    /// WGS84 latitude, degrees.
    pub lat_deg: f64,
    /// WGS84 longitude, degrees.
    pub lon_deg: f64,
    /// Altitude above mean sea level, m.
    pub alt_amsl_m: f64,
    /// Mole fraction of [`Observations::gas`] as read, ppm.
    pub co2_ppm: Option<f64>,
    /// Wind speed at the platform's place and height, m/s.
    pub wind_speed_m_s: Option<f64>,
    /// Direction *from* which that wind blows, degrees clockwise from true north.
    pub wind_from_deg: Option<f64>,
    /// Air temperature, °C.
    pub temperature_c: Option<f64>,
    /// Relative humidity, %.
    pub relative_humidity_pct: Option<f64>,
    /// Air pressure, hPa.
    pub pressure_hpa: Option<f64>,
    /// White 1-sigma noise of `co2_ppm`, ppm.
    pub sd_ppm: Option<f64>,
    /// Time that ends at `time_s` over which `co2_ppm`, and the wind, are means, s; none of a moment.
    pub averaging_s: Option<f64>,
    /// The other end of the straight line from the row's place over which `co2_ppm` is the mean; none of a point.
    pub line_end: Option<LineEnd>,
    /// Standard deviation of the times of the readings whose mean, at their mean time, the row is, s; 0 of one reading.
    pub spread_s: f64,
}

/// The other end of a line over which a reading is the mean.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LineEnd {
    /// WGS84 latitude, degrees.
    pub lat_deg: f64,
    /// WGS84 longitude, degrees.
    pub lon_deg: f64,
    /// Altitude above mean sea level, m.
    pub alt_amsl_m: f64,
}

impl ObservationRow {
    /// Where it was read, in the frame of a site.
    pub fn place(&self, frame: &LocalFrame) -> Place {
        let at = Geodetic {
            lat_deg: self.lat_deg,
            lon_deg: self.lon_deg,
        };
        Place::from_geodetic(frame, at, self.alt_amsl_m)
    }

    /// What its reading is the mean over, in the frame of a site.
    pub fn span(&self, frame: &LocalFrame) -> Span {
        let end = |end: LineEnd| {
            let at = Geodetic {
                lat_deg: end.lat_deg,
                lon_deg: end.lon_deg,
            };
            Place::from_geodetic(frame, at, end.alt_amsl_m)
        };
        Span {
            averaging_s: self.averaging_s.unwrap_or(0.0),
            to: self.line_end.map(end),
            spread_s: self.spread_s,
        }
    }
}

/// A column that the contract does not name, as text.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ExtraColumn {
    /// Header of the column.
    pub name: String,
    /// One cell a row of [`Observations::rows`]; empty where a file lacks the column.
    pub cells: Vec<String>,
}

/// All rows of one or several files, in order of time, then of platform.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Observations {
    /// The gas that was read.
    pub gas: Gas,
    /// The unit in which messages say readings: that of the first file. Inside all are in ppm.
    pub unit: Unit,
    /// The rows.
    pub rows: Vec<ObservationRow>,
    /// Names of the platforms, in order of their first appearance.
    pub platforms: Vec<String>,
    /// What the reader should be told although it is no error.
    pub notices: Vec<String>,
    /// Columns that the contract does not name, in order of their first appearance.
    pub extra: Vec<ExtraColumn>,
}

impl Observations {
    /// These observations as CSV text that [`parse`] reads back to the same rows. Optional
    /// columns appear only where some row has them; extra columns come last.
    pub fn to_csv(&self) -> String {
        type Of = fn(&ObservationRow) -> Option<f64>;
        let place: [Of; 4] = [
            |r| Some(r.lat_deg),
            |r| Some(r.lon_deg),
            |r| Some(r.alt_amsl_m),
            |r| r.co2_ppm,
        ];
        let optional: [Of; 7] = [
            |r| r.wind_speed_m_s,
            |r| r.wind_from_deg,
            |r| r.temperature_c,
            |r| r.relative_humidity_pct,
            |r| r.pressure_hpa,
            |r| r.sd_ppm,
            |r| r.averaging_s,
        ];
        let line: [Of; 3] = [
            |r| r.line_end.map(|e| e.lat_deg),
            |r| r.line_end.map(|e| e.lon_deg),
            |r| r.line_end.map(|e| e.alt_amsl_m),
        ];
        let numbers =
            |name, of: Of| Column::new(name, Cells::Number(self.rows.iter().map(of).collect()));
        let name = |r: &ObservationRow| self.platforms.get(r.platform).cloned().unwrap_or_default();
        let mut columns = vec![
            numbers(REQUIRED[0], |r| Some(r.time_s)),
            Column::new(
                REQUIRED[1],
                Cells::Text(self.rows.iter().map(name).collect()),
            ),
        ];
        let reading = [self.gas.column(Unit::Ppm)];
        let names = REQUIRED[2..].iter().chain(&reading);
        columns.extend(names.zip(place).map(|(name, of)| numbers(*name, of)));
        let present = OPTIONAL
            .iter()
            .zip(optional)
            .chain(LINE_END.iter().zip(line));
        let present = present.filter(|(_, of)| self.rows.iter().any(|r| of(r).is_some()));
        columns.extend(present.map(|(name, of)| numbers(*name, of)));
        for ExtraColumn { name, cells } in &self.extra {
            let mut cells = cells.clone();
            cells.resize(self.rows.len(), String::new());
            columns.push(Column::new(name, Cells::Text(cells)));
        }
        // Memory takes every write and every line has the header's length, so nothing is lost
        // by not asking.
        String::from_utf8(table::csv(&columns).unwrap_or_default()).unwrap_or_default()
    }

    /// A mole fraction in the unit of these observations, with the unit.
    pub fn said(&self, ppm: f64) -> String {
        format!("{} {}", self.unit.text(ppm), self.unit.as_str())
    }

    /// Number of rows that carry a reading.
    pub fn readings(&self) -> usize {
        self.rows.iter().filter(|r| r.co2_ppm.is_some()).count()
    }
}
