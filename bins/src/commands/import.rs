//! `plumage import`: logs as people have them, made observations or a flight.

use crate::progress::Waiting;
use crate::{Failure, importing, measured};
use import::map::{ColumnMap, LogMap};
use import::quantity::Quantity;
use import::run::Report;
use plume::Gas;
use record::files::{WholeFile, write_whole};
use std::io::{BufWriter, Write as _};
use std::path::{Path, PathBuf};

/// Bytes that are written at a time.
const BUFFER: usize = 1 << 20;

/// Arguments of `plumage import`.
#[derive(Debug, clap::Args)]
pub struct ImportArguments {
    /// Logs; of several, tracks and gas logs are joined by time
    #[arg(required = true, value_name = "FILE")]
    pub files: Vec<PathBuf>,
    /// The observations or the flight (CSV); FILE.import.toml beside it says how it was made
    #[arg(long, value_name = "FILE")]
    pub out: PathBuf,
    /// Mapping file: which column is what (TOML)
    #[arg(long, value_name = "FILE")]
    pub map: Option<PathBuf>,
    /// Read text as that of an instrument: airdata, dji, sniffer4d, picarro, licor-7810, licor-850, aeris, ndbc, toa5
    #[arg(long = "as", value_name = "PRESET")]
    pub preset: Option<String>,
    /// Replace an earlier output
    #[arg(long)]
    pub force: bool,
    /// Name of the platform; the file's own if not given
    #[arg(long, value_name = "NAME")]
    pub platform: Option<String>,
    /// Zone of clocks that do not say theirs: UTC or an offset such as +02:00
    #[arg(long, allow_hyphen_values = true)]
    pub zone: Option<String>,
    /// Dates whose year is not first: dmy or mdy
    #[arg(long, value_name = "ORDER")]
    pub date_order: Option<String>,
    /// Of readings that are joined with a track: what is added to their times, s; told from both if not given
    #[arg(long, value_name = "S", allow_hyphen_values = true)]
    pub offset_s: Option<f64>,
    /// What time_s counts from, such as a mission's start; 1970 if not given
    #[arg(long, value_name = "RFC3339")]
    pub zero: Option<String>,
    /// Of heights above the ellipsoid: the geoid's height above it, m
    #[arg(long, value_name = "M", allow_hyphen_values = true)]
    pub undulation_m: Option<f64>,
    /// Of pressure altitudes: the altimeter setting, hPa
    #[arg(long, value_name = "HPA")]
    pub qnh_hpa: Option<f64>,
    /// Of heights above take-off or ground: the altitude of that place, m above mean sea level
    #[arg(long, value_name = "M", allow_hyphen_values = true)]
    pub base_amsl_m: Option<f64>,
    /// One value for a whole column, such as lat_deg=43.4 of an instrument that stands still
    #[arg(long, value_name = "COLUMN=VALUE")]
    pub set: Vec<String>,
}

/// Reads the logs and writes what they give, with the mapping file that does the same again.
///
/// # Errors
/// Logs that cannot be read, with what to state, or an output that cannot be written.
pub fn import(arguments: &ImportArguments) -> Result<(), Failure> {
    let out = &arguments.out;
    if out.exists() && !arguments.force {
        return Err(Failure::usage(format!(
            "{}: the file exists; give another --out, or --force to replace it",
            out.display()
        )));
    }
    if arguments.files.iter().all(|f| is_own_recording(f)) {
        return recordings(arguments);
    }
    let mut map = importing::map(arguments.map.as_deref())?;
    map.zero = arguments.zero.clone().or(map.zero);
    let stated = stated(arguments)?;
    let create = || -> Result<_, Failure> {
        let file = WholeFile::create(out).map_err(Failure::input)?;
        Ok(BufWriter::with_capacity(BUFFER, file))
    };
    let reading = Waiting::new("reading the logs");
    let (report, mut writer) =
        importing::read(&arguments.files, &map, &stated, arguments.offset_s, create)?;
    drop(reading);
    writer.flush()?;
    let file = writer.into_inner().map_err(|e| e.into_error())?;
    let how = how(out);
    write_whole(
        &how,
        report.map.to_toml(&remarks(arguments, &report)).as_bytes(),
    )?;
    file.place()?;
    measured::tell(&report.said);
    println!(
        "{} rows of {}: {}",
        report.rows,
        report.platforms.join(", "),
        report.columns.join(", ")
    );
    println!("Outputs: {}, {}", out.display(), how.display());
    Ok(())
}

/// Whether a file is a recording of Plumage's own.
fn is_own_recording(file: &Path) -> bool {
    file.extension().is_some_and(|e| e == "mcap") && record::read_mcap(file).is_ok()
}

/// What real vehicles read in recorded missions: nothing has to be assumed of it.
fn recordings(arguments: &ImportArguments) -> Result<(), Failure> {
    // Recordings of several gases are refused by the first one's.
    let first = arguments.files.first().map(|file| record::read_mcap(file));
    let first = first.transpose().map_err(Failure::input)?;
    let gas = first.map_or_else(Gas::default, |recording| recording.info.gas);
    let observations = measured::load(&arguments.files, gas)?;
    write_whole(&arguments.out, observations.to_csv().as_bytes())?;
    measured::tell(&observations.notices);
    println!(
        "{} rows of {}",
        observations.rows.len(),
        observations.platforms.join(", ")
    );
    println!("Outputs: {}", arguments.out.display());
    Ok(())
}

/// The file that says how `out` was made.
pub(crate) fn how(out: &Path) -> PathBuf {
    let mut name = out.file_name().unwrap_or_default().to_owned();
    name.push(".import.toml");
    out.with_file_name(name)
}

fn remarks(arguments: &ImportArguments, report: &Report) -> Vec<String> {
    let files: Vec<String> = arguments
        .files
        .iter()
        .map(|f| f.display().to_string())
        .collect();
    let mut remarks = vec![
        format!(
            "How {} was made of {}.",
            arguments.out.display(),
            files.join(", ")
        ),
        "plumage import FILE --map THIS does the same with other logs of this kind.".to_owned(),
        String::new(),
    ];
    remarks.extend(report.said.iter().cloned());
    remarks
}

/// What the options state of all logs.
fn stated(arguments: &ImportArguments) -> Result<LogMap, Failure> {
    let mut stated = LogMap {
        preset: arguments.preset.clone(),
        platform: arguments.platform.clone(),
        zone: arguments.zone.clone(),
        date_order: arguments.date_order.clone(),
        undulation_m: arguments.undulation_m,
        qnh_hpa: arguments.qnh_hpa,
        base_amsl_m: arguments.base_amsl_m,
        ..LogMap::default()
    };
    for set in &arguments.set {
        let expected = || {
            Failure::usage(format!(
                "--set {set}: expected COLUMN=VALUE, such as lat_deg=43.4"
            ))
        };
        let (name, value) = set.split_once('=').ok_or_else(expected)?;
        let value: f64 = value.trim().parse().map_err(|_| expected())?;
        if Quantity::named(name).is_none() {
            return Err(expected());
        }
        let column = ColumnMap {
            value: Some(value),
            ..ColumnMap::default()
        };
        stated.column.insert(name.to_owned(), column);
    }
    stated
        .check()
        .map_err(|what| Failure::usage(format!("what is stated of the logs: {what}")))?;
    Ok(stated)
}
