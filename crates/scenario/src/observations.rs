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

use std::collections::BTreeMap;

use air::geo::{Geodetic, LocalFrame};
use csv::{ReaderBuilder, StringRecord, Trim, WriterBuilder};
use plume::{Gas, Place, Span, Unit};

pub mod checks;
mod error;
mod quality;
mod stream;
mod zero;

pub use error::ObservationError;
pub use quality::{DataQuality, Flaw};
pub use stream::{ObservationStream, Streamed};

/// What is right in a cell of numbers, and in one of times.
const A_NUMBER: &str = "a finite number with a decimal point, or an empty cell";
const A_TIME: &str = "a time in seconds as a finite number with a decimal point";

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
const A_LINE: &str = "lat2_deg, lon2_deg and alt2_amsl_m together, or none of them";

/// Place of `sd_ppm` in [`OPTIONAL`].
const SD: usize = 5;
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

/// Parses and joins the readings of `gas` in the CSV texts of `files`, each a (name, text) pair; the
/// name serves the messages only.
///
/// Rows without place are left out and exact repetitions of a row dropped, both with a notice.
///
/// # Errors
/// [`ObservationError`] says file, line, column and what would be right.
pub fn parse(files: &[(&str, &str)], gas: Gas) -> Result<Observations, ObservationError> {
    if files.is_empty() {
        return Err(ObservationError::NoFile);
    }
    let mut join = FileJoin::of(gas);
    for (index, (name, text)) in files.iter().enumerate() {
        join.file(index, name, text)?;
    }
    join.finish(files)
}

/// A row on its way into [`Observations`], with where it stood.
#[derive(Debug)]
struct LocatedRow {
    row: ObservationRow,
    file: usize,
    line: u64,
    extra: Vec<(usize, String)>,
}

#[derive(Debug, Default)]
struct FileJoin {
    gas: Gas,
    /// That of the first file.
    unit: Option<Unit>,
    rows: Vec<LocatedRow>,
    platforms: Vec<String>,
    platform_index: BTreeMap<String, usize>,
    notices: Vec<String>,
    extra_names: Vec<String>,
}

/// Where the columns of one file are.
#[derive(Debug)]
struct Columns {
    required: [usize; 5],
    reading: (usize, Unit),
    optional: [Option<usize>; 7],
    line_end: Option<[usize; 3]>,
    sd_unit: Unit,
    /// (cell of the record, index into the extra columns)
    extra: Vec<(usize, usize)>,
}

impl FileJoin {
    fn of(gas: Gas) -> Self {
        Self {
            gas,
            ..Self::default()
        }
    }

    fn file(&mut self, index: usize, name: &str, text: &str) -> Result<(), ObservationError> {
        // Spreadsheet programs begin UTF-8 files with a byte order mark; it is no part of the header.
        let text = text.strip_prefix('\u{feff}').unwrap_or(text);
        if text.trim().is_empty() {
            return Err(ObservationError::Empty { file: name.into() });
        }
        let mut reader = ReaderBuilder::new()
            .trim(Trim::All)
            .from_reader(text.as_bytes());
        let header = reader.headers().map_err(|e| line_error(name, &e))?.clone();
        let header_line = header.position().map_or(1, csv::Position::line);
        let columns = self.columns(name, header_line, &header)?;
        let before = self.rows.len();
        let mut tally = Tally::default();
        let mut last: BTreeMap<usize, f64> = BTreeMap::new();
        for record in reader.records() {
            let record = record.map_err(|e| line_error(name, &e))?;
            let line = record.position().map_or(0, csv::Position::line);
            let cells = RecordCells {
                file: name,
                line,
                record: &record,
            };
            if let Some(row) = self.row(&cells, &columns, &mut tally, &mut last)? {
                let extra = columns
                    .extra
                    .iter()
                    .map(|&(cell, extra)| (extra, record.get(cell).unwrap_or("").to_owned()))
                    .filter(|(_, cell)| !cell.is_empty())
                    .collect();
                self.rows.push(LocatedRow {
                    row,
                    file: index,
                    line,
                    extra,
                });
            }
        }
        self.notices.extend(tally.notices(name));
        if self.rows.len() == before && tally.without_place == 0 {
            return Err(ObservationError::NoRows { file: name.into() });
        }
        Ok(())
    }

    fn columns(
        &mut self,
        file: &str,
        line: u64,
        header: &StringRecord,
    ) -> Result<Columns, ObservationError> {
        let mut at: BTreeMap<&str, usize> = BTreeMap::new();
        for (cell, name) in header.iter().enumerate() {
            if at.insert(name, cell).is_some() {
                return Err(ObservationError::Header {
                    file: file.into(),
                    line,
                    column: name.into(),
                    what: "named twice in the header".into(),
                    expected: "expected every column once".into(),
                });
            }
        }
        let mut required = [0; 5];
        for (slot, name) in required.iter_mut().zip(REQUIRED) {
            *slot = *at
                .get(name)
                .ok_or_else(|| missing_column(file, line, name, self.gas, header))?;
        }
        if let Some((name, gas)) = header.iter().find_map(|n| Some((n, column_density(n)?))) {
            return Err(ObservationError::Header {
                file: file.into(),
                line,
                column: name.into(),
                what: "a mole fraction times a length (ppm m)".into(),
                expected: format!(
                    "expected the mean along the line as {}: divide by the line's length in m, and state its ends by \
                     lat_deg, lon_deg, alt_amsl_m and {}",
                    gas.column(Unit::Ppm),
                    LINE_END.join(", ")
                ),
            });
        }
        let place = |file_line: (&str, u64), names| in_one_unit(file_line, names, &at);
        let names = Unit::ALL.map(|unit| self.gas.column(unit));
        let reading = place((file, line), names)?
            .ok_or_else(|| missing_reading(file, line, self.gas, header))?;
        let sd = place((file, line), [OPTIONAL[SD], SD_PPB])?;
        let mut optional = OPTIONAL.map(|name| at.get(name).copied());
        optional[SD] = sd.map(|(cell, _)| cell);
        let ends = LINE_END.map(|name| at.get(name).copied());
        let line_end = match ends {
            [Some(lat), Some(lon), Some(alt)] => Some([lat, lon, alt]),
            [None, None, None] => None,
            _ => {
                let missing = ends.iter().position(Option::is_none).unwrap_or(0);
                return Err(ObservationError::Header {
                    file: file.into(),
                    line,
                    column: LINE_END[missing].into(),
                    what: "missing".into(),
                    expected: format!("expected {A_LINE}"),
                });
            }
        };
        self.unit.get_or_insert(reading.1);
        let mut extra = Vec::new();
        let fixed = [&REQUIRED[..], &OPTIONAL, &LINE_END, &names, &[SD_PPB]].concat();
        for (cell, name) in header.iter().enumerate() {
            if fixed.contains(&name) {
                continue;
            }
            let known = self.extra_names.iter().position(|n| n == name);
            let index = known.unwrap_or_else(|| {
                self.extra_names.push(name.into());
                self.extra_names.len() - 1
            });
            extra.push((cell, index));
            self.notices.push(match Gas::of_column(name) {
                Some((other, _)) => format!(
                    "{file}: column \"{name}\" is not used: the gas is {} (--gas {} selects this column)",
                    self.gas.formula(),
                    other.as_str()
                ),
                None => format!(
                    "{file}: column \"{name}\" is not used: no column of observations has this name"
                ),
            });
        }
        Ok(Columns {
            required,
            reading,
            optional,
            line_end,
            sd_unit: sd.map_or(Unit::Ppm, |(_, unit)| unit),
            extra,
        })
    }

    fn row(
        &mut self,
        cells: &RecordCells<'_>,
        columns: &Columns,
        tally: &mut Tally,
        last: &mut BTreeMap<usize, f64>,
    ) -> Result<Option<ObservationRow>, ObservationError> {
        let [time, platform, lat, lon, alt] = columns.required;
        let (cell, unit) = columns.reading;
        let time_s = cells
            .number(time, "time_s", A_TIME, tally)?
            .ok_or_else(|| cells.error(time, "time_s", A_TIME))?;
        let platform_name = cells.record.get(platform).unwrap_or("");
        if platform_name.is_empty() {
            return Err(cells.error(platform, "platform", "the platform's name"));
        }
        let platform = self.platform(platform_name);
        if let Some(before) = last.insert(platform, time_s).filter(|b| *b > time_s) {
            return Err(ObservationError::TimeOrder {
                file: cells.file.into(),
                line: cells.line,
                platform: platform_name.into(),
                time_s: time_s.to_string(),
                before_s: before.to_string(),
            });
        }
        let lat_deg = cells.number(lat, "lat_deg", A_NUMBER, tally)?;
        let lon_deg = cells.number(lon, "lon_deg", A_NUMBER, tally)?;
        let alt_amsl_m = cells.number(alt, "alt_amsl_m", A_NUMBER, tally)?;
        let co2_ppm = cells.ppm((cell, unit), self.gas.column(unit), tally)?;
        let more = cells.optional(columns, tally)?;
        let line_end = cells.line_end(columns, tally)?;
        let (Some(lat_deg), Some(lon_deg), Some(alt_amsl_m)) = (lat_deg, lon_deg, alt_amsl_m)
        else {
            tally.without_place += 1;
            tally.first_without_place.get_or_insert(cells.line);
            return Ok(None);
        };
        let [
            wind_speed_m_s,
            wind_from_deg,
            temperature_c,
            relative_humidity_pct,
            pressure_hpa,
            sd_ppm,
            averaging_s,
        ] = more;
        Ok(Some(ObservationRow {
            time_s,
            platform,
            lat_deg,
            lon_deg,
            alt_amsl_m,
            co2_ppm,
            wind_speed_m_s,
            wind_from_deg,
            temperature_c,
            relative_humidity_pct,
            pressure_hpa,
            sd_ppm,
            averaging_s,
            line_end,
        }))
    }

    fn platform(&mut self, name: &str) -> usize {
        if let Some(&index) = self.platform_index.get(name) {
            return index;
        }
        self.platforms.push(name.into());
        let index = self.platforms.len() - 1;
        self.platform_index.insert(name.into(), index);
        index
    }

    fn finish(mut self, files: &[(&str, &str)]) -> Result<Observations, ObservationError> {
        let names = || files.iter().map(|f| f.0).collect::<Vec<_>>().join(", ");
        // The sort is stable: rows of one time and platform stay in the order of the files, so that
        // what is said of a repeated row names the later one.
        let order = |p: &LocatedRow| (p.row.time_s, p.row.platform);
        self.rows.sort_by(|a, b| {
            order(a)
                .partial_cmp(&order(b))
                .unwrap_or(std::cmp::Ordering::Equal)
        });
        self.drop_repeated(files)?;
        if self.rows.iter().all(|p| p.row.co2_ppm.is_none()) {
            let unit = self.unit.unwrap_or_default();
            return Err(ObservationError::NoReading {
                files: names(),
                column: self.gas.column(unit),
                rows: self.rows.len(),
            });
        }
        let mut extra: Vec<ExtraColumn> = self
            .extra_names
            .into_iter()
            .map(|name| ExtraColumn {
                name,
                cells: vec![String::new(); self.rows.len()],
            })
            .collect();
        for (index, located) in self.rows.iter_mut().enumerate() {
            for (column, cell) in located.extra.drain(..) {
                extra[column].cells[index] = cell;
            }
        }
        Ok(Observations {
            gas: self.gas,
            unit: self.unit.unwrap_or_default(),
            rows: self.rows.into_iter().map(|p| p.row).collect(),
            platforms: self.platforms,
            notices: self.notices,
            extra,
        })
    }

    /// After sorting: drops rows that say the same twice, refuses those that disagree.
    fn drop_repeated(&mut self, files: &[(&str, &str)]) -> Result<(), ObservationError> {
        // In place: a second list of a long log would double what it needs.
        let is_same = |a: &LocatedRow, b: &LocatedRow| {
            a.row.time_s == b.row.time_s && a.row.platform == b.row.platform
        };
        let differ = |w: &[LocatedRow]| is_same(&w[0], &w[1]) && w[0].row != w[1].row;
        if let Some(at) = self.rows.windows(2).position(differ) {
            let (before, located) = (&self.rows[at], &self.rows[at + 1]);
            let alike = self.rows[..at]
                .iter()
                .rev()
                .take_while(|r| is_same(r, before));
            let first = alike.last().unwrap_or(before);
            return Err(ObservationError::TimeRepeated {
                file: files[located.file].0.into(),
                line: located.line,
                platform: self.platforms[located.row.platform].clone(),
                time_s: located.row.time_s.to_string(),
                first: format!("{}, line {}", files[first.file].0, first.line),
            });
        }
        let read = self.rows.len();
        self.rows.dedup_by(|later, kept| is_same(later, kept));
        let dropped = read - self.rows.len();
        if dropped > 0 {
            self.notices.push(format!(
                "{dropped} rows that repeat the row before them (same platform, time and values) were dropped"
            ));
        }
        Ok(())
    }
}

/// What was odd in one file without being an error.
#[derive(Default)]
struct Tally {
    without_place: usize,
    first_without_place: Option<u64>,
    nan: BTreeMap<&'static str, usize>,
}

impl Tally {
    fn notices(&self, file: &str) -> Vec<String> {
        let mut notices = Vec::new();
        for (column, count) in &self.nan {
            notices.push(format!(
                "{file}: column {column}: {count} cells say \"nan\" and are taken as missing"
            ));
        }
        if let Some(line) = self.first_without_place {
            let count = self.without_place;
            notices.push(format!(
                "{file}: {count} rows without lat_deg, lon_deg or alt_amsl_m were skipped (first: line {line})"
            ));
        }
        notices
    }
}

/// One record with where it stands.
struct RecordCells<'a> {
    file: &'a str,
    line: u64,
    record: &'a StringRecord,
}

impl RecordCells<'_> {
    /// The optional columns in the order of [`OPTIONAL`].
    fn optional(
        &self,
        columns: &Columns,
        tally: &mut Tally,
    ) -> Result<[Option<f64>; 7], ObservationError> {
        let mut values = [None; 7];
        for (k, cell) in columns.optional.iter().enumerate() {
            if let Some(cell) = *cell {
                values[k] = match (k, columns.sd_unit) {
                    (SD, Unit::Ppb) => self.ppm((cell, Unit::Ppb), SD_PPB, tally)?,
                    _ => self.number(cell, OPTIONAL[k], A_NUMBER, tally)?,
                };
            }
        }
        Ok(values)
    }

    /// The other end of the line of a row, if it has one.
    fn line_end(
        &self,
        columns: &Columns,
        tally: &mut Tally,
    ) -> Result<Option<LineEnd>, ObservationError> {
        let Some(cells) = columns.line_end else {
            return Ok(None);
        };
        let mut at = [None; 3];
        for (k, cell) in cells.into_iter().enumerate() {
            at[k] = self.number(cell, LINE_END[k], A_NUMBER, tally)?;
        }
        match at {
            [Some(lat_deg), Some(lon_deg), Some(alt_amsl_m)] => Ok(Some(LineEnd {
                lat_deg,
                lon_deg,
                alt_amsl_m,
            })),
            [None, None, None] => Ok(None),
            _ => {
                let k = at.iter().position(Option::is_none).unwrap_or(0);
                Err(self.error(cells[k], LINE_END[k], A_LINE))
            }
        }
    }

    /// The mole fraction in a cell, ppm. The decimal point is moved in the text, so that 1746.333 ppb and
    /// 1.746333 ppm are one number.
    fn ppm(
        &self,
        (cell, unit): (usize, Unit),
        column: &'static str,
        tally: &mut Tally,
    ) -> Result<Option<f64>, ObservationError> {
        let value = self.number(cell, column, A_NUMBER, tally)?;
        let text = self.record.get(cell).unwrap_or("");
        let moved = || format!("{text}e-3").parse::<f64>().ok();
        Ok(value.map(|value| match unit {
            Unit::Ppm => value,
            Unit::Ppb => moved().unwrap_or_else(|| unit.to_ppm(value)),
        }))
    }

    fn number(
        &self,
        cell: usize,
        column: &'static str,
        expected: &'static str,
        tally: &mut Tally,
    ) -> Result<Option<f64>, ObservationError> {
        let text = self.record.get(cell).unwrap_or("");
        if text.is_empty() {
            return Ok(None);
        }
        if text.eq_ignore_ascii_case("nan") {
            *tally.nan.entry(column).or_default() += 1;
            return Ok(None);
        }
        match text.parse::<f64>().ok().filter(|v| v.is_finite()) {
            Some(value) => Ok(Some(value)),
            None => Err(self.error(cell, column, expected)),
        }
    }

    fn error(&self, cell: usize, column: &'static str, expected: &'static str) -> ObservationError {
        ObservationError::Cell {
            file: self.file.into(),
            line: self.line,
            column,
            found: self.record.get(cell).unwrap_or("").into(),
            expected,
        }
    }
}

/// Cell and unit of what may be given in either unit, by its names in ppm and in ppb.
fn in_one_unit(
    (file, line): (&str, u64),
    names: [&str; 2],
    at: &BTreeMap<&str, usize>,
) -> Result<Option<(usize, Unit)>, ObservationError> {
    match names.map(|name| at.get(name)) {
        [Some(_), Some(_)] => Err(ObservationError::Header {
            file: file.into(),
            line,
            column: names[1].into(),
            what: format!("beside {}", names[0]),
            expected: "expected one of the two".into(),
        }),
        [Some(cell), None] => Ok(Some((*cell, Unit::Ppm))),
        [None, Some(cell)] => Ok(Some((*cell, Unit::Ppb))),
        [None, None] => Ok(None),
    }
}

/// The refusal of a header without readings of `gas`; it says what to write where another was read.
fn missing_reading(file: &str, line: u64, gas: Gas, header: &StringRecord) -> ObservationError {
    let (ppm, ppb) = (gas.column(Unit::Ppm), gas.column(Unit::Ppb));
    let others = header
        .iter()
        .filter_map(|name| Some((name, Gas::of_column(name)?.0)));
    let others: Vec<(&str, Gas)> = others.collect();
    let Some(&(_, other)) = others.first() else {
        return missing_column(file, line, ppm, gas, header);
    };
    let names: Vec<&str> = others.iter().map(|o| o.0).collect();
    let (formula, other) = (gas.formula(), other.as_str());
    ObservationError::Header {
        file: file.into(),
        line,
        column: ppm.into(),
        what: format!(
            "missing: the source emits {formula}, and the file has {}",
            names.join(", ")
        ),
        expected: format!(
            "expected the readings as {ppm} or {ppb} if they are of {formula}, else gas = \"{other}\" in \
             the scenario's [[source]] (--gas {other} where another source there emits it)"
        ),
    }
}

/// The gas whose mole fraction times a length a column has, by its name: `ch4_ppm_m`, `CH4 (ppm·m)`.
fn column_density(name: &str) -> Option<Gas> {
    let letters = |c: &char| c.is_ascii_alphanumeric();
    let plain: String = name.to_ascii_lowercase().chars().filter(letters).collect();
    let of = |gas: &Gas| {
        let rest = plain.strip_prefix(gas.as_str())?;
        ["ppmm", "ppbm", "ppmmeter", "ppmmetre"]
            .contains(&rest)
            .then_some(*gas)
    };
    Gas::ALL.iter().find_map(of)
}

fn missing_column(
    file: &str,
    line: u64,
    name: &str,
    gas: Gas,
    header: &StringRecord,
) -> ObservationError {
    let required = REQUIRED.join(", ");
    let [ppm, ppb] = Unit::ALL.map(|unit| gas.column(unit));
    let mut expected = format!("expected the header to name {required}, {ppm} (or {ppb})");
    let semicolons = header.iter().any(|h| h.contains(';') || h.contains('\t'));
    if semicolons {
        expected.push_str(", separated by commas");
    }
    let found = header.iter().collect::<Vec<_>>().join(", ");
    ObservationError::Header {
        file: file.into(),
        line,
        column: name.into(),
        what: format!("missing; the header has {found}"),
        expected,
    }
}

fn line_error(file: &str, error: &csv::Error) -> ObservationError {
    let line = error.position().map_or(1, csv::Position::line);
    let (what, expected) = match error.kind() {
        csv::ErrorKind::UnequalLengths {
            expected_len, len, ..
        } => (
            format!("{len} cells"),
            format!("{expected_len} cells, as in the header"),
        ),
        csv::ErrorKind::Utf8 { .. } => ("not UTF-8".into(), "text in UTF-8".into()),
        _ => (error.to_string(), "comma-separated values".into()),
    };
    ObservationError::Line {
        file: file.into(),
        line,
        what,
        expected,
    }
}

impl Observations {
    /// These observations as CSV text that [`parse`] reads back to the same rows. Optional
    /// columns appear only where some row has them; extra columns come last.
    pub fn to_csv(&self) -> String {
        let optional: [fn(&ObservationRow) -> Option<f64>; 7] = [
            |r| r.wind_speed_m_s,
            |r| r.wind_from_deg,
            |r| r.temperature_c,
            |r| r.relative_humidity_pct,
            |r| r.pressure_hpa,
            |r| r.sd_ppm,
            |r| r.averaging_s,
        ];
        let line: [fn(&LineEnd) -> f64; 3] = [|e| e.lat_deg, |e| e.lon_deg, |e| e.alt_amsl_m];
        let has_lines = self.rows.iter().any(|r| r.line_end.is_some());
        let present: Vec<usize> = (0..OPTIONAL.len())
            .filter(|&i| self.rows.iter().any(|r| optional[i](r).is_some()))
            .collect();
        let mut header: Vec<&str> = REQUIRED.to_vec();
        header.push(self.gas.column(Unit::Ppm));
        header.extend(present.iter().map(|&i| OPTIONAL[i]));
        header.extend(LINE_END.iter().filter(|_| has_lines));
        header.extend(self.extra.iter().map(|a| a.name.as_str()));
        // Memory takes every write and every line has the header's length, so nothing is lost
        // by not asking.
        let mut out = WriterBuilder::new().from_writer(Vec::new());
        let _ = out.write_record(&header);
        for (index, row) in self.rows.iter().enumerate() {
            let name = self.platforms.get(row.platform).map_or("", String::as_str);
            let mut cells = vec![
                row.time_s.to_string(),
                name.to_owned(),
                row.lat_deg.to_string(),
                row.lon_deg.to_string(),
                row.alt_amsl_m.to_string(),
                cell_text(row.co2_ppm),
            ];
            cells.extend(present.iter().map(|&i| cell_text(optional[i](row))));
            let end = |of: &fn(&LineEnd) -> f64| cell_text(row.line_end.as_ref().map(of));
            cells.extend(line.iter().filter(|_| has_lines).map(end));
            let extra = |a: &ExtraColumn| a.cells.get(index).cloned().unwrap_or_default();
            cells.extend(self.extra.iter().map(extra));
            let _ = out.write_record(&cells);
        }
        String::from_utf8(out.into_inner().unwrap_or_default()).unwrap_or_default()
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

fn cell_text(value: Option<f64>) -> String {
    value.map_or_else(String::new, |v| v.to_string())
}
