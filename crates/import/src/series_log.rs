//! A log of series, planned: which of them is what, and their rows at one time each.

use crate::ImportError;
use crate::delimited::layout::Layout;
use crate::delimited::plan::{self, Column, Source};
use crate::logs::{Format, SeriesLog};
use crate::map::{LogMap, Output};
use crate::quantity::Quantity;
use crate::recognise::Header;
use crate::series::Series;
use crate::sink::Table;
use formats::delimited::{Cells, Delimiter};
use std::io::Read;

/// Values by which a series is judged.
const JUDGED: usize = 200;
/// Rows of a flight are no closer than this, s: 50 a second are more than its gap analysis asks for.
const FLIGHT_STEP_S: f64 = 0.02;

/// A log of series, planned.
#[derive(Debug, Clone)]
pub struct PlannedSeries {
    /// Its name.
    pub name: String,
    /// What was found and assumed, in words.
    pub notices: Vec<String>,
    /// What of a mapping file says the same.
    pub map: LogMap,
    columns: Vec<(Column, Option<Series>)>,
    platform: String,
}

impl PlannedSeries {
    /// Reads the log `name` of a `format` with what is stated in `map`, one for each platform; times count from `zero_s`
    /// after 1970 where they are of the calendar.
    ///
    /// # Errors
    /// What cannot be read or told, with what to state.
    pub fn open(
        name: &str,
        format: Format,
        bytes: Box<dyn Read + '_>,
        map: &LogMap,
        platform: &str,
        zero_s: f64,
    ) -> Result<Vec<Self>, ImportError> {
        let known = map.clone().over(&format.known());
        let logs = format.read(name, bytes, &known)?;
        logs.into_iter()
            .map(|log| Self::plan_log(name, log, known.clone(), platform, zero_s))
            .collect()
    }

    fn plan_log(
        name: &str,
        mut log: SeriesLog,
        map: LogMap,
        platform: &str,
        zero_s: f64,
    ) -> Result<Self, ImportError> {
        if map.wind.is_some() || map.position.is_some() || !map.sensor.is_empty() {
            return Err(ImportError::log(
                name,
                "[log.wind], [log.position] or [[log.sensor]] of a log that is not text",
                "leave them out, or import the log as text",
            ));
        }
        // The datum of one height is not that of another which is stated.
        if map.column.contains_key("alt_amsl_m") {
            log.known.column.remove("alt_amsl_m");
        }
        let map = map.over(&log.known);
        let zero_s = if log.is_absolute { zero_s } else { 0.0 };
        let shift_s = map.offset_s.unwrap_or(0.0) - zero_s;
        for series in &mut log.series {
            for time_s in &mut series.time_s {
                *time_s += shift_s;
            }
        }
        let planned = plan::columns(name, &layout(&log.series), &rows(&log.series), &map)?;
        let column = |column: Column| {
            let series = match column.source {
                Source::Value(_) | Source::Derived(_) => None,
                Source::Cell(at) => {
                    let mut series = log.series[at].clone();
                    for value in &mut series.values {
                        *value = column.of_number(*value);
                    }
                    Some(series)
                }
            };
            (column, series)
        };
        let columns = planned.columns.into_iter().map(column).collect();
        let mut notices = log.notices;
        notices.extend(planned.notices);
        // Of several platforms in one file each has columns of its own, which no one table states.
        let map = match &log.platform {
            None => planned.map,
            Some(_) => LogMap {
                column: map
                    .column
                    .into_iter()
                    .filter(|(name, _)| !log.known.column.contains_key(name))
                    .collect(),
                ..planned.map
            },
        };
        Ok(Self {
            name: match &log.platform {
                None => name.to_owned(),
                Some(platform) => format!("{name} ({platform})"),
            },
            notices,
            map,
            columns,
            platform: log.platform.unwrap_or_else(|| platform.to_owned()),
        })
    }

    /// What it has.
    pub fn columns(&self) -> Vec<&'static Quantity> {
        self.columns.iter().map(|(c, _)| c.quantity).collect()
    }

    /// How its columns are read.
    pub fn plan(&self) -> impl Iterator<Item = &Column> {
        self.columns.iter().map(|(c, _)| c)
    }

    /// The series at whose times the rows are: of the gas, of the roll, or else of the place.
    fn base(&self, output: Output) -> Option<&Series> {
        let of = |is: &dyn Fn(&Quantity) -> bool| {
            let mut columns = self.columns.iter();
            columns.find_map(|(c, s)| s.as_ref().filter(|_| is(c.quantity)))
        };
        let about = match output {
            Output::Observations => of(&Quantity::is_gas),
            Output::Flight => of(&|q| q.name == "roll_deg"),
        };
        about
            .or_else(|| of(&|q| q.name == "lat_deg"))
            .or_else(|| of(&|_| true))
    }

    /// Its rows, at the times of what the output is about, and what is to be said of them.
    pub fn table(&self, output: Output) -> (Table, Vec<String>) {
        let mut table = Table::new(self.columns());
        let Some(base) = self.base(output) else {
            return (table, Vec::new());
        };
        let mut readers: Vec<_> = self
            .columns
            .iter()
            .map(|(c, s)| (c, s.as_ref().map(|s| s.reader(c.quantity))))
            .collect();
        let mut last_s = f64::NEG_INFINITY;
        for time_s in &base.time_s {
            // A thousandth below, for steps that are no binary fractions.
            if output == Output::Flight && time_s - last_s < FLIGHT_STEP_S * 0.999 {
                continue;
            }
            last_s = *time_s;
            let values: Vec<f64> = readers
                .iter_mut()
                .map(|(column, reader)| match (column.source, reader) {
                    (Source::Value(value), _) => value,
                    (_, Some(reader)) => {
                        crate::number::rounded(reader.at(*time_s), column.quantity.decimals)
                    }
                    (_, None) => f64::NAN,
                })
                .collect();
            table.push(*time_s, &self.platform, &values);
        }
        let notices = format!(
            "rows are at the times of {} ({} of {}); the others are interpolated",
            base.name,
            table.len(),
            base.time_s.len()
        );
        (table, vec![notices])
    }
}

/// The series as a table's columns.
fn layout(series: &[Series]) -> Layout {
    Layout {
        delimiter: Delimiter::Space,
        headers: series.iter().map(|s| Header::of_series(&s.name)).collect(),
        header_cells: Cells::default(),
        header_line: 0,
        units: series.iter().map(|s| s.unit.clone()).collect(),
        rows_at: 0,
        rows_line: 0,
        decimal_comma: false,
        notices: Vec::new(),
    }
}

/// The first values of all series as a table's rows.
fn rows(series: &[Series]) -> Vec<Cells> {
    let most = series
        .iter()
        .map(|s| s.values.len())
        .max()
        .unwrap_or(0)
        .min(JUDGED);
    // Evenly through each series: its first values may be from before take-off.
    let cell = |s: &Series, k: usize| {
        let at = k * s.values.len() / most.max(1);
        s.values.get(at).map_or_else(String::new, f64::to_string)
    };
    (0..most)
        .map(|k| series.iter().map(|s| cell(s, k)).collect())
        .collect()
}
