//! The way of logs, one or several, into one of Plumage's files.

use crate::ImportError;
use crate::delimited::Delimited;
use crate::delimited::plan::Column;
use crate::in_order::Stamps;
use crate::join;
use crate::logs::Format;
use crate::map::{LogMap, Map, Output};
use crate::quantity::{FLIGHT, OBSERVATION, Quantity};
use crate::series_log::PlannedSeries;
use crate::sink::{CsvSink, Table};
use std::io::{self, Cursor, Read, Write};

/// The logs that belong together, and what is stated of them.
pub struct Request<'a> {
    /// Their names, for messages and to find their tables in the mapping file.
    pub names: &'a [String],
    /// Opens one of them, by its place in `names`.
    pub open: &'a dyn Fn(usize) -> io::Result<Box<dyn Read>>,
    /// The mapping file.
    pub map: &'a Map,
    /// What is stated of all logs on the command line; it counts before the mapping file.
    pub stated: &'a LogMap,
    /// What is added to the times of readings that are joined with a track, s; told from both if not given.
    pub offset_s: Option<f64>,
    /// Whether rows that run back in time are sorted, in memory.
    pub sorts: bool,
}

/// What came of logs.
#[derive(Debug, Clone, PartialEq)]
pub struct Report {
    /// What was found and assumed, in words, log by log.
    pub notices: Vec<String>,
    /// The mapping file that does the same again.
    pub map: Map,
    /// Which file came out.
    pub output: Output,
    /// Its columns beside time and platform.
    pub columns: Vec<&'static str>,
    /// Rows written.
    pub rows: usize,
    /// Names of the platforms.
    pub platforms: Vec<String>,
}

/// A log that is open and planned.
enum Log<'a> {
    Text(Box<Delimited<'a>>),
    Series(Box<PlannedSeries>),
}

impl Log<'_> {
    /// Its name: that of its file, with the platform where the file has several.
    fn name(&self) -> &str {
        match self {
            Self::Text(log) => log.name(),
            Self::Series(log) => &log.name,
        }
    }

    fn columns(&self) -> Vec<&'static Quantity> {
        match self {
            Self::Text(log) => log.columns(),
            Self::Series(log) => log.columns(),
        }
    }

    /// What was found and assumed of it, but for columns that the output does not have.
    fn notices(&self, output: Output) -> Vec<String> {
        let (mut notices, columns): (Vec<String>, Vec<&Column>) = match self {
            Self::Text(log) => {
                let columns = log.plan.members.iter().flat_map(|m| &m.columns);
                (log.plan.notices.clone(), columns.collect())
            }
            Self::Series(log) => (log.notices.clone(), log.plan().collect()),
        };
        let is_wanted = |c: &&&Column| belongs(output, c.quantity);
        notices.extend(
            columns
                .iter()
                .filter(is_wanted)
                .flat_map(|c| c.notices.iter().cloned()),
        );
        let others = columns.iter().filter(|c| !is_wanted(c));
        let others: Vec<&str> = others.map(|c| c.quantity.name).collect();
        if !others.is_empty() {
            notices.push(format!(
                "recognised but not part of this output: {}",
                others.join(", ")
            ));
        }
        notices
    }

    /// The mapping that does the same, but for columns that the output does not have.
    fn map_of(&self, output: Output) -> LogMap {
        let wanted = |name: &str| Quantity::named(name).is_some_and(|q| belongs(output, q));
        let mut map = self.map().clone();
        map.column
            .retain(|name, c| c.skip == Some(true) || wanted(name));
        map
    }

    fn map(&self) -> &LogMap {
        match self {
            Self::Text(log) => &log.plan.map,
            Self::Series(log) => &log.map,
        }
    }
}

/// Reads the logs of `request` and writes Plumage's file to `out`.
///
/// # Errors
/// What cannot be read or told, with what to state; [`ImportError::Disorder`] where rows of one log run back in time
/// and the request does not sort.
pub fn run<W: Write>(request: &Request<'_>, out: W) -> Result<Report, ImportError> {
    let zero_s = zero_s(request.map)?;
    let mut files = Vec::new();
    for (index, name) in request.names.iter().enumerate() {
        files.push(open(request, index, name, zero_s)?);
    }
    let output = output(request, files.iter().flatten())?;
    let mut notices = Vec::new();
    for log in files.iter().flatten() {
        let name = log.name();
        notices.extend(log.notices(output).iter().map(|s| format!("{name}: {s}")));
    }
    let map = Map {
        output: Some(output),
        zero: request.map.zero.clone(),
        log: files
            .iter()
            .flat_map(|logs| logs.first())
            .map(|log| log.map_of(output))
            .collect(),
    };
    let mut report = Report {
        notices,
        map,
        output,
        columns: Vec::new(),
        rows: 0,
        platforms: Vec::new(),
    };
    let mut logs = Vec::new();
    for (file, of_file) in files.into_iter().enumerate() {
        logs.extend(of_file.into_iter().map(|log| (file, log)));
    }
    match logs.pop() {
        Some((_, Log::Text(log))) if logs.is_empty() => single(request, *log, &mut report, out)?,
        Some(last) => {
            logs.push(last);
            several(request, logs, &mut report, out)?;
        }
        None => {}
    }
    Ok(report)
}

fn zero_s(map: &Map) -> Result<f64, ImportError> {
    let file = "mapping file".to_owned();
    map.zero_s().map_err(|what| ImportError::Map { file, what })
}

fn open<'a>(
    request: &Request<'a>,
    index: usize,
    name: &str,
    zero_s: f64,
) -> Result<Vec<Log<'a>>, ImportError> {
    let mut bytes = (request.open)(index).map_err(ImportError::bytes(name))?;
    let map = request.stated.clone().over(&request.map.of(name));
    let platform = map
        .platform
        .clone()
        .unwrap_or_else(|| stem(name).to_owned());
    let mut head = Vec::new();
    let got = bytes
        .by_ref()
        .take(crate::logs::TELLING_BYTES)
        .read_to_end(&mut head);
    got.map_err(ImportError::bytes(name))?;
    let format = Format::of(name, &head)?;
    let mut all: Box<dyn Read> = Box::new(Cursor::new(head).chain(bytes));
    if format == Format::Spreadsheet {
        all = Box::new(Cursor::new(crate::logs::spreadsheet::text(name, all)?));
    }
    if matches!(format, Format::Text | Format::Spreadsheet) {
        return Delimited::open(name, all, &map, &platform, zero_s)
            .map(|log| vec![Log::Text(Box::new(log))]);
    }
    let logs = PlannedSeries::open(name, format, all, &map, &platform, zero_s)?;
    Ok(logs
        .into_iter()
        .map(|log| Log::Series(Box::new(log)))
        .collect())
}

/// The name of a file without folders.
fn base(name: &str) -> &str {
    name.rsplit(['/', '\\']).next().unwrap_or(name)
}

/// The name of a file without folders and ending.
fn stem(name: &str) -> &str {
    base(name)
        .rsplit_once('.')
        .map_or(base(name), |(stem, _)| stem)
}

/// What comes out: as stated, else observations where a gas is there, else a flight where its angles are.
fn output<'a, 'b: 'a>(
    request: &Request<'_>,
    logs: impl Iterator<Item = &'a Log<'b>>,
) -> Result<Output, ImportError> {
    if let Some(output) = request.map.output {
        return Ok(output);
    }
    let columns: Vec<&Quantity> = logs.flat_map(Log::columns).collect();
    let has = |name: &str| columns.iter().any(|c| c.name == name);
    if columns.iter().any(|c| c.is_gas()) {
        return Ok(Output::Observations);
    }
    if has("roll_deg") && has("pitch_deg") {
        return Ok(Output::Flight);
    }
    Err(ImportError::log(
        request.names.join(", "),
        format!(
            "no gas (and no roll and pitch of a flight) among the recognised columns: {}",
            columns
                .iter()
                .map(|c| c.name)
                .collect::<Vec<_>>()
                .join(", ")
        ),
        "state which column is the gas in a mapping file (--map): [[log]] and below it [log.column.ch4_ppb] with from \
         and unit, or give the log of the gas as a further file",
    ))
}

/// The columns that a file of this kind has, in order; behind them gases of `there` that the table does not have.
fn of_output(output: Output, there: &[&'static Quantity]) -> Vec<&'static Quantity> {
    let mut columns: Vec<&'static Quantity> = match output {
        Output::Observations => OBSERVATION.iter().collect(),
        Output::Flight => FLIGHT.iter().chain(&OBSERVATION[..3]).collect(),
    };
    if output == Output::Observations {
        for gas in there.iter().filter(|q| q.is_gas()) {
            if !columns.iter().any(|c| c.name == gas.name) {
                columns.push(gas);
            }
        }
    }
    columns
}

/// Whether a file of this kind has the column.
fn belongs(output: Output, column: &'static Quantity) -> bool {
    let columns = of_output(output, &[column]);
    columns.iter().any(|c| c.name == column.name)
}

/// Refuses columns without which a file is none.
fn check(name: &str, output: Output, columns: &[&Quantity]) -> Result<(), ImportError> {
    let needed: &[&str] = match output {
        Output::Observations => &["lat_deg", "lon_deg", "alt_amsl_m"],
        Output::Flight => &[],
    };
    let missing: Vec<&str> = needed
        .iter()
        .copied()
        .filter(|n| !columns.iter().any(|c| c.name == *n))
        .collect();
    if missing.is_empty() {
        return Ok(());
    }
    let sets: Vec<String> = missing.iter().map(|m| format!("--set {m}=VALUE")).collect();
    let has_pressure = columns.iter().any(|c| c.name == "pressure_hpa");
    let by_pressure = if missing == ["alt_amsl_m"] && has_pressure {
        ", or --qnh-hpa, the altimeter setting, for heights by the log's pressure"
    } else {
        ""
    };
    let by_metres = if missing.contains(&"lat_deg") {
        "; places in metres (UTM or local) are stated as [log.position] in a mapping file"
    } else {
        ""
    };
    Err(ImportError::log(
        name,
        format!("no column for {}", missing.join(", ")),
        format!(
            "name the columns in a mapping file (--map), give the track as a further file, or, for a fixed \
             instrument, state {}{by_pressure}{by_metres}",
            sets.join(" ")
        ),
    ))
}

/// One log of text: its rows are held nowhere, unless they have to be sorted.
fn single<W: Write>(
    request: &Request<'_>,
    log: Delimited<'_>,
    report: &mut Report,
    out: W,
) -> Result<(), ImportError> {
    let name = log.name().to_owned();
    let there = log.columns();
    let taken: Vec<usize> = of_output(report.output, &there)
        .iter()
        .filter_map(|w| there.iter().position(|c| c.name == w.name))
        .collect();
    let columns: Vec<&'static Quantity> = taken.iter().map(|t| there[*t]).collect();
    check(&name, report.output, &columns)?;
    report.columns = columns.iter().map(|c| c.name).collect();
    let mut sink = CsvSink::new(out, report.output, &columns)?;
    let outcome = if request.sorts {
        let mut table = Table::new(columns);
        let stamps = log.stamps();
        let mut outcome = log.rows(&taken, true, &mut table)?;
        outcome
            .notices
            .push("rows ran back in time and were sorted".to_owned());
        outcome
            .notices
            .extend(table.write(stamps, &mut sink)?.notice(stamps));
        outcome
    } else {
        log.rows(&taken, false, &mut sink)?
    };
    sink.finish()?;
    report
        .notices
        .extend(outcome.notices.iter().map(|s| format!("{name}: {s}")));
    report.rows = outcome.rows;
    report.platforms = outcome.platforms;
    Ok(())
}

/// A log's rows in memory, with its name.
struct Rows {
    name: String,
    /// Place of its file among the files.
    file: usize,
    table: Table,
    /// Whether an offset of its clock is stated.
    is_set: bool,
}

impl Rows {
    fn has(&self, name: &str) -> bool {
        self.table.columns.iter().any(|c| c.name == name)
    }

    /// Whether it has what a file of this kind is about.
    fn is_about(&self, output: Output) -> bool {
        match output {
            Output::Observations => self.table.columns.iter().any(|c| c.is_gas()),
            Output::Flight => self.has("roll_deg"),
        }
    }

    fn times_s(&self) -> (f64, f64) {
        let times = &self.table.time_s;
        let first = times.iter().copied().fold(f64::INFINITY, f64::min);
        (
            first,
            times.iter().copied().fold(f64::NEG_INFINITY, f64::max),
        )
    }
}

/// Several logs, or one that is no text: readings one after the other, with what the others know of their times.
fn several<W: Write>(
    request: &Request<'_>,
    logs: Vec<(usize, Log<'_>)>,
    report: &mut Report,
    out: W,
) -> Result<(), ImportError> {
    let mut all = Vec::new();
    for (file, log) in logs {
        let is_set = log.map().offset_s.is_some();
        let name = log.name().to_owned();
        let table = in_memory(log, report)?;
        all.push(Rows {
            name,
            file,
            table,
            is_set,
        });
    }
    let output = report.output;
    let (mut readings, others): (Vec<Rows>, Vec<Rows>) =
        all.into_iter().partition(|r| r.is_about(output));
    for rows in &mut readings {
        let offset_s = completed(request, rows, &others, &mut report.notices)?;
        if let (Some(offset_s), Some(map)) = (offset_s, report.map.log.get_mut(rows.file)) {
            *map.offset_s.get_or_insert(0.0) += offset_s;
        }
    }
    let tables: Vec<Table> = readings.into_iter().map(|r| r.table).collect();
    let there: Vec<&'static Quantity> = tables.iter().flat_map(|t| t.columns.clone()).collect();
    let table = join::appended(&tables, &of_output(output, &there));
    check(&request.names.join(", "), output, &table.columns)?;
    let names: Vec<&str> = request.names.iter().map(String::as_str).collect();
    name_logs(&names, &mut report.map.log);
    report.columns = table.columns.iter().map(|c| c.name).collect();
    report.rows = table.len();
    report.platforms.clone_from(&table.platforms);
    let mut sink = CsvSink::new(out, output, &table.columns)?;
    table.write(Stamps::AS_THEY_ARE, &mut sink)?;
    sink.finish()?;
    Ok(())
}

/// All rows of a log in order of time, those of one stamp spread.
fn in_memory(log: Log<'_>, report: &mut Report) -> Result<Table, ImportError> {
    match log {
        Log::Text(log) => {
            let (name, stamps, columns) = (log.name().to_owned(), log.stamps(), log.columns());
            let taken: Vec<usize> = (0..columns.len()).collect();
            let mut table = Table::new(columns.clone());
            let outcome = log.rows(&taken, true, &mut table)?;
            let mut sorted = Table::new(columns);
            let done = table.write(stamps, &mut sorted)?;
            let notices = outcome.notices.into_iter().chain(done.notice(stamps));
            report
                .notices
                .extend(notices.map(|s| format!("{name}: {s}")));
            Ok(sorted)
        }
        Log::Series(log) => {
            let (table, notices) = log.table(report.output);
            report
                .notices
                .extend(notices.iter().map(|s| format!("{}: {s}", log.name)));
            Ok(table)
        }
    }
}

/// Adds to `rows` what they lack and `others` have. The offset that was told or stated, if there was one.
fn completed(
    request: &Request<'_>,
    rows: &mut Rows,
    others: &[Rows],
    notices: &mut Vec<String>,
) -> Result<Option<f64>, ImportError> {
    let mut set_s = None;
    for other in others {
        let platform = platform(rows, other)?;
        let track = join::series(&other.table, platform);
        let has_place = other.has("lat_deg") && other.has("lon_deg");
        let mut offset_s = 0.0;
        if has_place && set_s.is_none() {
            offset_s = clock_offset(request, rows, other, &track, notices);
            set_s = Some(offset_s);
        }
        let times = rows.times_s();
        let whole = join::fill(&mut rows.table, &track, offset_s);
        notices.push(format!(
            "{}: {whole} of {} rows lie within the times of {}",
            rows.name,
            rows.table.len(),
            other.name
        ));
        if whole == 0 {
            return Err(apart(rows, times, other));
        }
        if !has_place && other.has("wind_speed_m_s") {
            notices.push(format!(
                "assumed: the wind of {} was measured at the platform's place and height",
                other.name
            ));
        }
    }
    Ok(set_s.filter(|s| *s != 0.0))
}

/// The platform of `other` that `rows` are of.
fn platform(rows: &Rows, other: &Rows) -> Result<usize, ImportError> {
    let names = &other.table.platforms;
    let same = names.iter().position(|n| rows.table.platforms.contains(n));
    match (names.len(), same) {
        (..=1, _) => Ok(0),
        (_, Some(same)) if rows.table.platforms.len() == 1 => Ok(same),
        _ => Err(ImportError::log(
            &other.name,
            format!(
                "the track has the platforms {}, and none of them is the platform of {}",
                names.join(", "),
                rows.name
            ),
            "state the platform of the readings by --platform, or import one platform after the other",
        )),
    }
}

/// What is added to the times of `rows`: as stated, as both logs tell it, or nothing.
fn clock_offset(
    request: &Request<'_>,
    rows: &Rows,
    other: &Rows,
    track: &[(&'static Quantity, crate::series::Series)],
    notices: &mut Vec<String>,
) -> f64 {
    let mut note = |what: &str| notices.push(format!("{}: {what}", rows.name));
    if let Some(offset_s) = request.offset_s {
        note(&format!("{offset_s} s are added to its times, as stated"));
        return offset_s;
    }
    if rows.is_set || other.is_set {
        return 0.0;
    }
    let own = join::series(&rows.table, 0);
    match join::offset(&own, track) {
        Some(offset) => {
            note(&format!(
                "assumed: {} with {}; it is added (otherwise state --offset-s)",
                offset.basis, other.name
            ));
            offset.offset_s
        }
        None => {
            note(&format!(
                "assumed: its clock agrees with that of {}; no quantity that both measure shows an offset \
                 (otherwise state --offset-s)",
                other.name
            ));
            0.0
        }
    }
}

/// Two logs that share no time.
fn apart(rows: &Rows, (from_s, to_s): (f64, f64), other: &Rows) -> ImportError {
    let (first_s, last_s) = other.times_s();
    ImportError::log(
        format!("{}, {}", rows.name, other.name),
        format!(
            "the logs share no time: {from_s} to {to_s} s and {first_s} to {last_s} s; they are {:.2} h apart",
            (first_s - from_s) / 3600.0
        ),
        "state --zone of the one that has local times (in a mapping file where they differ), or --offset-s",
    )
}

/// Names the tables of several logs: by their endings where these tell them apart.
fn name_logs(names: &[&str], logs: &mut [LogMap]) {
    if names.len() < 2 {
        return;
    }
    let ending = |name: &str| base(name).rsplit_once('.').map(|(_, e)| format!("*.{e}"));
    let mut endings: Vec<String> = names.iter().filter_map(|n| ending(n)).collect();
    endings.sort();
    endings.dedup();
    for (name, log) in names.iter().zip(logs) {
        let by_ending = (endings.len() == names.len())
            .then(|| ending(name))
            .flatten();
        log.name
            .get_or_insert(by_ending.unwrap_or_else(|| base(name).to_owned()));
    }
}
