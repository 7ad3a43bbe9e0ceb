//! The way of logs, one or several, into one of Plumage's files.

use crate::ImportError;
use crate::delimited::Delimited;
use crate::map::{LogMap, Map, Output};
use crate::quantity::{FLIGHT, OBSERVATION, Quantity};
use crate::sink::{CsvSink, Table};
use std::io::{self, Read, Write};

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
    /// Whether rows that run back in time are sorted, in memory.
    pub sorts: bool,
}

/// What came of logs.
#[derive(Debug, Clone, PartialEq)]
pub struct Report {
    /// What was found and assumed, in words, log by log.
    pub said: Vec<String>,
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

/// Reads the logs of `request` and writes Plumage's file to `out`.
///
/// # Errors
/// What cannot be read or told, with what to state; [`ImportError::Disorder`] where rows of one log run back in time
/// and the request does not sort.
pub fn run<W: Write>(request: &Request<'_>, out: W) -> Result<Report, ImportError> {
    let zero_s = zero_s(request.map)?;
    let mut logs = Vec::new();
    for (index, name) in request.names.iter().enumerate() {
        logs.push(open(request, index, name, zero_s)?);
    }
    let output = output(request, &logs)?;
    let mut said = Vec::new();
    for log in &logs {
        said.extend(log.plan.said.iter().map(|s| format!("{}: {s}", log.name())));
    }
    let map = Map {
        output: Some(output),
        zero: request.map.zero.clone(),
        log: logs.iter().map(|log| log.plan.map.clone()).collect(),
    };
    let mut report = Report {
        said,
        map,
        output,
        columns: Vec::new(),
        rows: 0,
        platforms: Vec::new(),
    };
    match <[Delimited<'_>; 1]>::try_from(logs) {
        Ok([log]) => single(request, log, &mut report, out)?,
        Err(_) => {
            return Err(ImportError::log(
                request.names.join(", "),
                "several logs",
                "give one",
            ));
        }
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
) -> Result<Delimited<'a>, ImportError> {
    let bytes = (request.open)(index).map_err(ImportError::bytes(name))?;
    let map = request.stated.clone().over(&request.map.of(name));
    let platform = map
        .platform
        .clone()
        .unwrap_or_else(|| stem(name).to_owned());
    Delimited::open(name, bytes, &map, &platform, zero_s)
}

/// The name of a file without folders and ending.
fn stem(name: &str) -> &str {
    let base = name.rsplit(['/', '\\']).next().unwrap_or(name);
    base.rsplit_once('.').map_or(base, |(stem, _)| stem)
}

/// What comes out: as stated, else observations where a gas is there, else a flight where its angles are.
fn output(request: &Request<'_>, logs: &[Delimited<'_>]) -> Result<Output, ImportError> {
    if let Some(output) = request.map.output {
        return Ok(output);
    }
    let columns: Vec<&Quantity> = logs.iter().flat_map(Delimited::columns).collect();
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
            "no gas (and no roll and pitch of a flight) among the columns that are known: {}",
            columns
                .iter()
                .map(|c| c.name)
                .collect::<Vec<_>>()
                .join(", ")
        ),
        "state which column is the gas in a mapping file (--map): [[log]] and below it [log.column.ch4_ppb] with from \
         and unit",
    ))
}

/// The columns that a file of this kind has.
fn of_output(output: Output) -> Vec<&'static Quantity> {
    match output {
        Output::Observations => OBSERVATION.iter().collect(),
        Output::Flight => FLIGHT.iter().chain(&OBSERVATION[..3]).collect(),
    }
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
    Err(ImportError::log(
        name,
        format!("no column for {}", missing.join(", ")),
        format!(
            "name the columns in a mapping file (--map), give the track as a further file, or, of what stands still, \
             state {}",
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
    let wanted = of_output(report.output);
    let taken: Vec<usize> = wanted
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
            .said
            .push("rows ran back in time and were sorted".to_owned());
        outcome
            .said
            .extend(table.write(stamps, &mut sink)?.said(stamps));
        outcome
    } else {
        log.rows(&taken, false, &mut sink)?
    };
    sink.finish()?;
    report
        .said
        .extend(outcome.said.iter().map(|s| format!("{name}: {s}")));
    report.rows = outcome.rows;
    report.platforms = outcome.platforms;
    Ok(())
}
