//! Reading observations: the columns of their files, and how several files are joined.

use std::collections::BTreeMap;

use formats::delimited::{Column, Header, Row, Table, TableError};
use plume::{Gas, Unit};

use super::{
    ExtraColumn, LINE_END, LineEnd, OPTIONAL, ObservationError, ObservationRow, Observations,
    REQUIRED, SD_PPB,
};

/// Places of the columns in [`columns`].
const TIME: usize = 0;
const PLATFORM: usize = 1;
const LAT: usize = 2;
const LON: usize = 3;
const ALT: usize = 4;
const READING: usize = 5;
const WIND_SPEED: usize = 6;
const WIND_FROM: usize = 7;
const TEMPERATURE: usize = 8;
const HUMIDITY: usize = 9;
const PRESSURE: usize = 10;
const SD: usize = 11;
const AVERAGING: usize = 12;
/// The first of three.
const END: usize = 13;

const A_TIME: &str = "a time in seconds with a decimal point, from -1e11 to 1e11";
/// Farthest time from zero, s: 3,000 years. Milliseconds since 1970 are beyond it.
const FARTHEST_S: f64 = 1e11;
const A_LINE: &str = "lat2_deg, lon2_deg and alt2_amsl_m together, or none of them";

/// The columns of a file of readings of `gas`.
fn columns(gas: Gas) -> Vec<Column> {
    let mut columns: Vec<Column> = REQUIRED.map(Column::required).to_vec();
    columns[TIME] = columns[TIME].of((-FARTHEST_S, FARTHEST_S, A_TIME));
    columns.push(Column::required(gas.column(Unit::Ppm)).or(gas.column(Unit::Ppb)));
    columns.extend(OPTIONAL.map(Column::optional));
    columns[SD] = columns[SD].or(SD_PPB);
    columns.extend(LINE_END.map(Column::optional));
    columns
}

/// Parses and joins the readings of `gas` in the CSV texts of `files`, each a (name, text) pair; the
/// name serves the messages only.
///
/// Rows without place are ignored and exact repetitions of a row dropped, both with a notice.
///
/// # Errors
/// [`ObservationError`] names file, line, column and what was expected.
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

/// The rows of the files read so far.
#[derive(Debug, Default)]
pub(super) struct FileJoin {
    pub(super) gas: Gas,
    /// That of the first file.
    pub(super) unit: Option<Unit>,
    pub(super) platforms: Vec<String>,
    pub(super) notices: Vec<String>,
    rows: Vec<LocatedRow>,
    platform_index: BTreeMap<String, usize>,
    extra_names: Vec<String>,
}

/// The columns of one file.
#[derive(Debug)]
pub(super) struct Layout {
    pub(super) header: Header,
    pub(super) unit: Unit,
    sd_unit: Unit,
    has_lines: bool,
    /// (cell of the row, index into the extra columns)
    extra: Vec<(usize, usize)>,
}

/// What of a file is kept from row to row.
#[derive(Debug, Clone, Default)]
pub(super) struct Progress {
    /// The last time of each platform, s.
    pub(super) last_s: BTreeMap<usize, f64>,
    without_place: usize,
    first_without_place: Option<u64>,
    nan: BTreeMap<&'static str, usize>,
}

impl FileJoin {
    pub(super) fn of(gas: Gas) -> Self {
        Self {
            gas,
            ..Self::default()
        }
    }

    /// A header of a file of this gas, before it is checked.
    pub(super) fn header(&self, file: &str, cells: &formats::delimited::Cells) -> Header {
        Header::find(file, 1, cells, &columns(self.gas))
    }

    fn file(&mut self, index: usize, name: &str, text: &str) -> Result<(), ObservationError> {
        let mut table = Table::unchecked(name, text, &columns(self.gas), false);
        let layout = self.layout(table.header.clone())?;
        let before = self.rows.len();
        let mut progress = Progress::default();
        while let Some(row) = table.next_row()? {
            let Some(read) = self.row(&row, &layout, &mut progress)? else {
                continue;
            };
            let extra = layout.extra.iter();
            let extra = extra.map(|&(cell, extra)| (extra, row.cell(cell)));
            let extra = extra.filter(|(_, cell)| !cell.is_empty());
            self.rows.push(LocatedRow {
                row: read,
                file: index,
                line: row.line,
                extra: extra.map(|(at, cell)| (at, cell.to_owned())).collect(),
            });
        }
        self.notices.extend(progress.notices(name));
        if self.rows.len() == before && progress.without_place == 0 {
            return Err(table.no_rows().into());
        }
        Ok(())
    }

    /// The layout of a file with this header.
    pub(super) fn layout(&mut self, header: Header) -> Result<Layout, TableError> {
        self.check(&header)?;
        let unit_of = |k: usize, ppm: &str| match header.called(k) == ppm {
            true => Unit::Ppm,
            false => Unit::Ppb,
        };
        let unit = unit_of(READING, self.gas.column(Unit::Ppm));
        let sd_unit = unit_of(SD, OPTIONAL[SD - WIND_SPEED]);
        self.unit.get_or_insert(unit);
        let mut extra = Vec::new();
        for (cell, name) in header.others() {
            let known = self.extra_names.iter().position(|n| n == name);
            let index = known.unwrap_or_else(|| {
                self.extra_names.push(name.into());
                self.extra_names.len() - 1
            });
            extra.push((cell, index));
            let why = match Gas::of_column(name) {
                Some((other, _)) => format!(
                    "is not used: the gas is {} (--gas {} selects this column)",
                    self.gas.formula(),
                    other.as_str()
                ),
                None => "is not used: no column of observations has this name".to_owned(),
            };
            self.notices
                .push(format!("{}: column \"{name}\" {why}", header.file()));
        }
        Ok(Layout {
            unit,
            sd_unit,
            has_lines: header.has(END),
            extra,
            header,
        })
    }

    fn check(&self, header: &Header) -> Result<(), TableError> {
        header.distinct(|_| true)?;
        let names = || header.names().iter().map(String::as_str);
        if let Some(name) = names().find(|n| is_column_density(n)) {
            let expected = format!(
                "the mean along the line as {}: divide by the line's length in m, and state its ends by \
                 lat_deg, lon_deg, alt_amsl_m and {}",
                self.gas.column(Unit::Ppm),
                LINE_END.join(", ")
            );
            return Err(header.error(name, "a mole fraction times a length (ppm m)", expected));
        }
        let of_others = || names().filter_map(|name| Some((name, Gas::of_column(name)?.0)));
        if let Some((_, other)) = of_others().next().filter(|_| !header.has(READING)) {
            return Err(self.another_gas(header, of_others().map(|(name, _)| name), other));
        }
        header.check()?;
        let ends = [END, END + 1, END + 2].map(|k| header.has(k));
        match ends.iter().position(|has| !has) {
            Some(k) if ends.contains(&true) => Err(header.error(LINE_END[k], "missing", A_LINE)),
            _ => Ok(()),
        }
    }

    /// The error of a header with readings of `other` gases alone; it says what to write instead.
    fn another_gas<'n>(
        &self,
        header: &Header,
        names: impl Iterator<Item = &'n str>,
        other: Gas,
    ) -> TableError {
        let [ppm, ppb] = Unit::ALL.map(|unit| self.gas.column(unit));
        let (formula, other) = (self.gas.formula(), other.as_str());
        let names = names.collect::<Vec<_>>().join(", ");
        let problem = format!("missing: the source emits {formula}, and the file has {names}");
        let expected = format!(
            "the readings as {ppm} or {ppb} if they are of {formula}, else gas = \"{other}\" in \
             the scenario's [[source]] (--gas {other} where another source there emits it)"
        );
        header.error(ppm, problem, expected)
    }

    /// The observation in `row`; none without a place.
    pub(super) fn row(
        &mut self,
        row: &Row<'_>,
        layout: &Layout,
        progress: &mut Progress,
    ) -> Result<Option<ObservationRow>, TableError> {
        let time_s = row.needed(TIME)?;
        let name = row.name(PLATFORM)?;
        let platform = self.platform(name);
        let before_s = progress.last_s.insert(platform, time_s);
        if let Some(before_s) = before_s.filter(|b| *b > time_s) {
            let problem = format!("platform {name} is at {time_s} s after it was at {before_s} s");
            return Err(row.error("time_s", problem, "times that increase within a platform"));
        }
        let mut number = |k: usize| -> Result<Option<f64>, TableError> {
            let value = row.number(k)?;
            if value.is_none() && !row.text(k).is_empty() {
                *progress.nan.entry(layout.header.called(k)).or_default() += 1;
            }
            Ok(value)
        };
        let (lat_deg, lon_deg, alt_amsl_m) = (number(LAT)?, number(LON)?, number(ALT)?);
        let co2_ppm = in_ppm(number(READING)?, row.text(READING), layout.unit);
        let read = ObservationRow {
            time_s,
            platform,
            co2_ppm,
            wind_speed_m_s: number(WIND_SPEED)?,
            wind_from_deg: number(WIND_FROM)?,
            temperature_c: number(TEMPERATURE)?,
            relative_humidity_pct: number(HUMIDITY)?,
            pressure_hpa: number(PRESSURE)?,
            sd_ppm: in_ppm(number(SD)?, row.text(SD), layout.sd_unit),
            averaging_s: number(AVERAGING)?,
            line_end: match layout.has_lines {
                true => line_end(row, [number(END)?, number(END + 1)?, number(END + 2)?])?,
                false => None,
            },
            ..ObservationRow::default()
        };
        let (Some(lat_deg), Some(lon_deg), Some(alt_amsl_m)) = (lat_deg, lon_deg, alt_amsl_m)
        else {
            progress.without_place += 1;
            progress.first_without_place.get_or_insert(row.line);
            return Ok(None);
        };
        Ok(Some(ObservationRow {
            lat_deg,
            lon_deg,
            alt_amsl_m,
            ..read
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
        // The sort is stable: rows of one time and platform stay in the order of the files, so that
        // the error of a repeated row names the later one.
        let order = |p: &LocatedRow| (p.row.time_s, p.row.platform);
        self.rows.sort_by(|a, b| {
            order(a)
                .partial_cmp(&order(b))
                .unwrap_or(std::cmp::Ordering::Equal)
        });
        self.drop_repeated(files)?;
        let unit = self.unit.unwrap_or_default();
        if self.rows.iter().all(|p| p.row.co2_ppm.is_none()) {
            return Err(ObservationError::NoReading {
                files: files.iter().map(|f| f.0).collect::<Vec<_>>().join(", "),
                column: self.gas.column(unit),
                rows: self.rows.len(),
            });
        }
        let empty = |name| ExtraColumn {
            name,
            cells: vec![String::new(); self.rows.len()],
        };
        let mut extra: Vec<ExtraColumn> = self.extra_names.into_iter().map(empty).collect();
        for (index, located) in self.rows.iter_mut().enumerate() {
            for (column, cell) in located.extra.drain(..) {
                extra[column].cells[index] = cell;
            }
        }
        Ok(Observations {
            gas: self.gas,
            unit,
            rows: self.rows.into_iter().map(|p| p.row).collect(),
            platforms: self.platforms,
            notices: self.notices,
            extra,
        })
    }

    /// After sorting: drops exact repetitions of rows, rejects rows of one time and platform that differ.
    fn drop_repeated(&mut self, files: &[(&str, &str)]) -> Result<(), TableError> {
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
            return Err(TableError {
                file: files[located.file].0.into(),
                line: located.line,
                column: REQUIRED[TIME].into(),
                problem: format!(
                    "platform {} has a second, different row at {} s (first in {}, line {})",
                    self.platforms[located.row.platform],
                    located.row.time_s,
                    files[first.file].0,
                    first.line
                ),
                expected: "one row a platform and time".into(),
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

impl Progress {
    fn notices(&self, file: &str) -> Vec<String> {
        let nan = self.nan.iter().map(|(column, count)| {
            format!("{file}: column {column}: {count} cells say \"nan\" and are taken as missing")
        });
        let count = self.without_place;
        let places = self.first_without_place.map(|line| {
            format!(
                "{file}: {count} rows without lat_deg, lon_deg or alt_amsl_m were skipped (first: line {line})"
            )
        });
        nan.chain(places).collect()
    }
}

/// A mole fraction in ppm. The decimal point is moved in the text, so that 1746.333 ppb and
/// 1.746333 ppm are one number.
fn in_ppm(value: Option<f64>, text: &str, unit: Unit) -> Option<f64> {
    let moved = || format!("{text}e-3").parse().ok();
    value.map(|value| match unit {
        Unit::Ppm => value,
        Unit::Ppb => moved().unwrap_or_else(|| unit.to_ppm(value)),
    })
}

/// The other end of the line of a row, if it has one.
fn line_end(row: &Row<'_>, at: [Option<f64>; 3]) -> Result<Option<LineEnd>, TableError> {
    match at {
        [Some(lat_deg), Some(lon_deg), Some(alt_amsl_m)] => Ok(Some(LineEnd {
            lat_deg,
            lon_deg,
            alt_amsl_m,
        })),
        [None, None, None] => Ok(None),
        _ => {
            let k = at.iter().position(Option::is_none).unwrap_or(0);
            Err(row.wrong(END + k, A_LINE))
        }
    }
}

/// Whether a column is a mole fraction times a length by its name: `ch4_ppm_m`, `CH4 (ppm·m)`.
fn is_column_density(name: &str) -> bool {
    let letters = |c: &char| c.is_ascii_alphanumeric();
    let plain: String = name.to_ascii_lowercase().chars().filter(letters).collect();
    let rest = Gas::ALL
        .iter()
        .filter_map(|g| plain.strip_prefix(g.as_str()));
    let densities = ["ppmm", "ppbm", "ppmmeter", "ppmmetre"];
    rest.into_iter().any(|rest| densities.contains(&rest))
}
