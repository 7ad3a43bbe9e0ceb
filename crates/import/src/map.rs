//! The mapping file: which column of a log is what, in which unit, zone and datum.

use crate::ImportError;
use crate::height::{Datum, StatedHeights};
use crate::quantity::Quantity;
use crate::time::{self, DateOrder};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Which of Plumage's files comes out.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Output {
    /// Observations.
    Observations,
    /// A flight.
    Flight,
}

/// A mapping file. All of it may be left out: what is not stated is told from the logs.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Map {
    /// What comes out; a flight where no log has a gas.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub output: Option<Output>,
    /// The time from which `time_s` counts, RFC 3339; 1970-01-01T00:00:00Z if not given.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub zero: Option<String>,
    /// One table a log.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub log: Vec<LogMap>,
}

/// What is stated of one log.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct LogMap {
    /// Name of the file, with `*` for any letters; all files if not given.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub name: Option<String>,
    /// A preset whose statements come before these.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub preset: Option<String>,
    /// What stands between cells: `,`, `;`, `|`, `tab` or `space`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub delimiter: Option<String>,
    /// The decimal sign: `.` or `,`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub decimal: Option<String>,
    /// Line of the header, from 1.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub header_line: Option<u64>,
    /// Names of the columns of a log without a header.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub header: Vec<String>,
    /// Further texts that mean that there is no value, such as `-9999`.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub missing: Vec<String>,
    /// Name of the platform.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub platform: Option<String>,
    /// Column with the names of platforms.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub platform_column: Option<String>,
    /// Column of the time, or columns: date and time; seconds and nanoseconds; or year, month, day, hour, minute
    /// and perhaps second.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub time: Option<Names>,
    /// Unit of a time that is a number: `s`, `ms`, `us`, `ns`, `min` or `h`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub time_unit: Option<String>,
    /// `dmy` or `mdy`, where the year is not first.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub date_order: Option<String>,
    /// The clock's zone where times do not say it: `UTC`, `+02:00`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub zone: Option<String>,
    /// Seconds that are added to all times of this log.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub offset_s: Option<f64>,
    /// Height of the geoid above the ellipsoid, m.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub undulation_m: Option<f64>,
    /// Altimeter setting, hPa.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub qnh_hpa: Option<f64>,
    /// Altitude from which heights above home or ground count, m above mean sea level.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub base_amsl_m: Option<f64>,
    /// Temperature to which masses of gas in a volume refer, °C.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub mass_temperature_c: Option<f64>,
    /// Pressure to which masses of gas in a volume refer, hPa.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub mass_pressure_hpa: Option<f64>,
    /// The wind where the log has its components.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub wind: Option<WindMap>,
    /// Places where the log has them in metres east and north.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub position: Option<PositionMap>,
    /// The sensors of a log that has a column for each.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub sensor: Vec<SensorMap>,
    /// What is stated of Plumage's columns, by their names.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    pub column: BTreeMap<String, ColumnMap>,
}

/// Columns of the components of the wind, positive in the direction *towards* which it blows; behind a minus sign, the
/// opposite. Either east and north, or right and forward of a platform with its yaw.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct WindMap {
    /// Towards east.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub east: Option<String>,
    /// Towards north.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub north: Option<String>,
    /// Towards the platform's right.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub right: Option<String>,
    /// Towards the platform's front.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub forward: Option<String>,
    /// The platform's heading, degrees clockwise from true north.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub yaw: Option<String>,
    /// The platform's velocity towards east, to be added: the wind was measured against the moving platform.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub vel_east: Option<String>,
    /// The same towards north.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub vel_north: Option<String>,
    /// Unit of components and velocities, where their headers name none: `m/s`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub unit: Option<String>,
}

/// Columns of places in metres east and north of a zone of UTM or of a place.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PositionMap {
    /// Column of the easting, m.
    pub east: String,
    /// Column of the northing, m.
    pub north: String,
    /// Zone of UTM: its number and N or S, the hemisphere.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub utm_zone: Option<String>,
    /// Latitude of the place that metres count from, degrees.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub origin_lat_deg: Option<f64>,
    /// Longitude of that place, degrees.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub origin_lon_deg: Option<f64>,
}

/// A sensor of a log that has a column for each: a platform that stands.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SensorMap {
    /// Name of its platform.
    pub platform: String,
    /// Its latitude, degrees; that of the log's column where left out, as the other two.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub lat_deg: Option<f64>,
    /// Its longitude, degrees.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub lon_deg: Option<f64>,
    /// Its altitude, m above mean sea level.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub alt_amsl_m: Option<f64>,
    /// The log's columns that are its own, by the names of Plumage's: `{ ch4_ppm = "CH4 north" }`.
    pub from: BTreeMap<String, String>,
}

impl SensorMap {
    /// What is stated of the log, as it is for this sensor.
    pub fn of_log(&self, log: &LogMap) -> LogMap {
        let mut own = log.clone();
        for (name, from) in &self.from {
            own.column.entry(name.clone()).or_default().from = Some(Names::One(from.clone()));
        }
        let place = [
            ("lat_deg", self.lat_deg),
            ("lon_deg", self.lon_deg),
            ("alt_amsl_m", self.alt_amsl_m),
        ];
        for (name, value) in place {
            if value.is_some() {
                own.column.entry(name.to_owned()).or_default().value = value;
            }
        }
        own
    }
}

/// One name or several.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(untagged)]
pub enum Names {
    /// One.
    One(String),
    /// Several.
    Many(Vec<String>),
}

impl Names {
    /// All names.
    pub fn all(&self) -> &[String] {
        match self {
            Self::One(name) => std::slice::from_ref(name),
            Self::Many(names) => names,
        }
    }
}

/// What is stated of one of Plumage's columns.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct ColumnMap {
    /// The log's column; of several the first that is there.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub from: Option<Names>,
    /// A value for all rows, instead of a column.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub value: Option<f64>,
    /// The log's unit.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub unit: Option<String>,
    /// Factor by which values are multiplied before their unit is converted.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub scale: Option<f64>,
    /// What is added after that, in the log's unit.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub offset: Option<f64>,
    /// From what a height is counted.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub datum: Option<Datum>,
    /// Further texts that mean that there is no value, besides those of the log.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub missing: Vec<String>,
    /// True to leave the column out although the log has it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub skip: Option<bool>,
}

impl Map {
    /// Reads the text of a mapping file; `file` is for messages.
    ///
    /// # Errors
    /// [`ImportError::Map`] with the line, or with what would be right.
    pub fn parse(file: &str, text: &str) -> Result<Self, ImportError> {
        let wrong = |what: String| ImportError::Map {
            file: file.to_owned(),
            what,
        };
        let map: Self = toml::from_str(text).map_err(|e| wrong(e.to_string()))?;
        map.zero_s().map_err(&wrong)?;
        for log in &map.log {
            log.check().map_err(&wrong)?;
        }
        Ok(map)
    }

    /// The text of this mapping file, below `remarks` as comments.
    pub fn to_toml(&self, remarks: &[String]) -> String {
        let mut text = String::new();
        for remark in remarks.iter().flat_map(|r| r.lines()) {
            text.push_str("# ");
            text.push_str(remark);
            text.push('\n');
        }
        // Plain structures of texts and numbers: nothing in them that TOML cannot say.
        text + &toml::to_string(self).unwrap_or_default()
    }

    /// Seconds since 1970 of `zero`.
    ///
    /// # Errors
    /// In words, where it is no time in UTC.
    pub fn zero_s(&self) -> Result<f64, String> {
        let Some(zero) = &self.zero else {
            return Ok(0.0);
        };
        time::stamp(zero.as_bytes(), None)
            .and_then(|s| Some(s.clock_s - s.ahead_s?))
            .ok_or_else(|| {
                format!("zero = \"{zero}\": expected a time such as 2024-05-01T10:00:00Z")
            })
    }

    /// What is stated of the log `name`.
    pub fn of(&self, name: &str) -> LogMap {
        let base = name.rsplit(['/', '\\']).next().unwrap_or(name);
        let fits = |log: &&LogMap| log.name.as_deref().is_none_or(|n| is_like(n, base));
        self.log.iter().find(fits).cloned().unwrap_or_default()
    }
}

impl LogMap {
    /// Whether what is stated can be.
    ///
    /// # Errors
    /// In words.
    pub fn check(&self) -> Result<(), String> {
        self.date_order()?;
        self.ahead_s()?;
        self.preset
            .as_deref()
            .map(crate::preset::Preset::named)
            .transpose()?;
        let no_column =
            |name: &str| format!("{name}: expected one of {}", column_names().join(", "));
        for sensor in &self.sensor {
            let mut names = sensor.from.keys();
            if let Some(name) = names.find(|n| Quantity::named(n).is_none()) {
                return Err(no_column(&format!("sensor.from.{name}")));
            }
        }
        for (name, column) in &self.column {
            let Some(quantity) = Quantity::named(name) else {
                return Err(no_column(&format!("column.{name}")));
            };
            if let Some(unit) = &column.unit
                && column.datum != Some(Datum::Pressure)
                && crate::unit::Unit::parse(quantity.dimension, unit).is_none()
            {
                return Err(format!(
                    "column.{name}.unit = \"{unit}\": expected one of {}",
                    crate::unit::Unit::names(quantity.dimension)
                ));
            }
            if column.datum.is_some() && name != "alt_amsl_m" {
                return Err(format!("column.{name}.datum: only alt_amsl_m has a datum"));
            }
        }
        Ok(())
    }

    /// The order of day and month, if it is stated.
    ///
    /// # Errors
    /// In words.
    pub fn date_order(&self) -> Result<Option<DateOrder>, String> {
        match self.date_order.as_deref() {
            None => Ok(None),
            Some("dmy") => Ok(Some(DateOrder::DayFirst)),
            Some("mdy") => Ok(Some(DateOrder::MonthFirst)),
            Some(other) => Err(format!("date_order = \"{other}\": expected dmy or mdy")),
        }
    }

    /// What the log's clock is ahead of UTC, s, if it is stated.
    ///
    /// # Errors
    /// In words.
    pub fn ahead_s(&self) -> Result<Option<f64>, String> {
        let Some(zone) = &self.zone else {
            return Ok(None);
        };
        let wrong = || format!("zone = \"{zone}\": expected UTC or an offset such as +02:00");
        time::zone(zone).map(Some).ok_or_else(wrong)
    }

    /// What is stated of heights.
    pub fn heights(&self) -> StatedHeights {
        StatedHeights {
            undulation_m: self.undulation_m,
            qnh_hpa: self.qnh_hpa,
            base_amsl_m: self.base_amsl_m,
        }
    }

    /// These statements, and those of `under` where there are none.
    pub fn over(self, under: &Self) -> Self {
        let mut column = under.column.clone();
        for (name, of_this) in self.column {
            // A gas comes out once: what is stated in ppb stands for what was stated in ppm below.
            if let Some(gas) = Quantity::named(&name).and_then(Quantity::gas) {
                column.retain(|n, _| {
                    *n == name || Quantity::named(n).and_then(Quantity::gas) != Some(gas)
                });
            }
            let merged = match column.remove(&name) {
                Some(below) => of_this.over(below),
                None => of_this,
            };
            column.insert(name, merged);
        }
        let or = |a: Option<String>, b: &Option<String>| a.or_else(|| b.clone());
        let list = |a: Vec<String>, b: &Vec<String>| if a.is_empty() { b.clone() } else { a };
        Self {
            name: or(self.name, &under.name),
            preset: or(self.preset, &under.preset),
            delimiter: or(self.delimiter, &under.delimiter),
            decimal: or(self.decimal, &under.decimal),
            header_line: self.header_line.or(under.header_line),
            header: list(self.header, &under.header),
            missing: list(self.missing, &under.missing),
            platform: or(self.platform, &under.platform),
            platform_column: or(self.platform_column, &under.platform_column),
            time: self.time.or_else(|| under.time.clone()),
            time_unit: or(self.time_unit, &under.time_unit),
            date_order: or(self.date_order, &under.date_order),
            zone: or(self.zone, &under.zone),
            offset_s: self.offset_s.or(under.offset_s),
            undulation_m: self.undulation_m.or(under.undulation_m),
            qnh_hpa: self.qnh_hpa.or(under.qnh_hpa),
            base_amsl_m: self.base_amsl_m.or(under.base_amsl_m),
            mass_temperature_c: self.mass_temperature_c.or(under.mass_temperature_c),
            mass_pressure_hpa: self.mass_pressure_hpa.or(under.mass_pressure_hpa),
            wind: self.wind.or_else(|| under.wind.clone()),
            position: self.position.or_else(|| under.position.clone()),
            sensor: if self.sensor.is_empty() {
                under.sensor.clone()
            } else {
                self.sensor
            },
            column,
        }
    }
}

impl ColumnMap {
    fn over(self, under: Self) -> Self {
        Self {
            from: self.from.or(under.from),
            value: self.value.or(under.value),
            unit: self.unit.or(under.unit),
            scale: self.scale.or(under.scale),
            offset: self.offset.or(under.offset),
            datum: self.datum.or(under.datum),
            missing: if self.missing.is_empty() {
                under.missing
            } else {
                self.missing
            },
            skip: self.skip.or(under.skip),
        }
    }
}

/// Names of all of Plumage's columns.
fn column_names() -> Vec<&'static str> {
    let all = crate::quantity::OBSERVATION
        .iter()
        .chain(crate::quantity::FLIGHT.iter());
    let mut names: Vec<&str> = all.map(|q| q.name).collect();
    names.dedup();
    names
}

/// Whether `name` is like `pattern`, in which `*` stands for any letters.
fn is_like(pattern: &str, name: &str) -> bool {
    let mut parts = pattern.split('*');
    let first = parts.next().unwrap_or("");
    let Some(mut rest) = name.strip_prefix(first) else {
        return false;
    };
    let parts: Vec<&str> = parts.collect();
    let Some((last, between)) = parts.split_last() else {
        return rest.is_empty();
    };
    for part in between {
        match rest.find(part) {
            Some(at) => rest = &rest[at + part.len()..],
            None => return false,
        }
    }
    rest.ends_with(last)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_mapping_file_is_read_and_written_again() {
        let text = "output = \"observations\"\nzero = \"2024-05-01T10:00:00Z\"\n\n[[log]]\nname = \"*.csv\"\n\
            time = [\"Date\", \"Time\"]\nzone = \"+02:00\"\n\n[log.column.alt_amsl_m]\nfrom = \"height\"\n\
            unit = \"ft\"\ndatum = \"home\"\n\n[log.column.ch4_ppb]\nunit = \"ppb\"\n";
        let map = Map::parse("m.toml", text).unwrap();
        assert_eq!(map.zero_s().unwrap(), 1_714_557_600.0);
        assert_eq!(map.of("/data/a.csv").ahead_s(), Ok(Some(7200.0)));
        assert_eq!(map.of("a.gpx"), LogMap::default());
        let again = map.to_toml(&["made of a.csv\nand b.csv".to_owned()]);
        assert!(
            again.starts_with("# made of a.csv\n# and b.csv\n"),
            "{again}"
        );
        assert_eq!(Map::parse("m.toml", &again).unwrap(), map);
    }

    #[test]
    fn what_is_wrong_is_told_with_what_would_be_right() {
        for (text, expected) in [
            ("[[log]]\ncolum = 1", "unknown field"),
            ("[[log]]\nzone = \"CET\"", "+02:00"),
            ("[[log]]\ndate_order = \"ymd\"", "dmy or mdy"),
            ("[[log]]\n[log.column.co2]\nunit = \"ppm\"", "co2_ppm"),
            ("[[log]]\n[log.column.co2_ppm]\nunit = \"m/s\"", "ppm, ppb"),
            ("zero = \"noon\"", "2024-05-01T10:00:00Z"),
        ] {
            let error = Map::parse("m.toml", text).unwrap_err().to_string();
            assert!(
                error.starts_with("m.toml: ") && error.contains(expected),
                "{error}"
            );
        }
    }

    #[test]
    fn patterns_stand_for_names() {
        assert!(is_like("*.csv", "a.csv") && is_like("a*b*c", "a1b2c") && is_like("x", "x"));
        assert!(!is_like("*.csv", "a.gpx") && !is_like("x", "xy") && !is_like("a*b", "b"));
    }
}
