//! `plumage import`: logs as people have them, made observations or a flight.

use crate::progress::Waiting;
use crate::{Failure, importing, measured, ranges};
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
#[command(
    after_help = "Example: plumage import track.gpx gas.csv --out obs.csv\n\nThe mapping file also states wind as \
                  components, places in UTM or local metres, a column for each sensor, and further gases; see \
                  docs/data.md."
)]
pub struct ImportArguments {
    /// Logs to convert; tracks and gas logs are joined by time
    #[arg(required = true, value_name = "FILE")]
    pub files: Vec<PathBuf>,
    /// Observations or flight to write (CSV); FILE.import.toml, next to it, is a mapping file that repeats the import
    #[arg(long, value_name = "FILE", help_heading = "Outputs")]
    pub out: PathBuf,
    /// Mapping file (TOML): names, units and datums of the columns; wind as components, places in metres, sensors
    #[arg(long, value_name = "FILE", help_heading = "Columns")]
    pub map: Option<PathBuf>,
    /// Format of a text log: airdata, dji, sniffer4d, picarro, licor-7810, licor-850, aeris, ndbc or toa5 [default:
    /// recognised from its header]
    #[arg(long = "as", value_name = "PRESET", help_heading = "Columns")]
    pub preset: Option<String>,
    /// Replace an earlier output
    #[arg(long, help_heading = "Outputs")]
    pub force: bool,
    /// Name of the platform [default: from the log or its file name]
    #[arg(long, value_name = "NAME", help_heading = "Columns")]
    pub platform: Option<String>,
    /// Time zone of times without one: UTC or an offset such as +02:00
    #[arg(long, allow_hyphen_values = true, help_heading = "Time")]
    pub zone: Option<String>,
    /// Order of dates that do not begin with the year: dmy or mdy
    #[arg(long, value_name = "ORDER", help_heading = "Time")]
    pub date_order: Option<String>,
    /// Offset to add to the times of readings before they are joined with a track, s; at most 10^10 either way
    /// [default: estimated from both]
    #[arg(
        long,
        value_name = "S",
        value_parser = ranges::real(-1e10..=1e10, " s"),
        allow_hyphen_values = true,
        help_heading = "Time"
    )]
    pub offset_s: Option<f64>,
    /// Time that time_s counts from, such as the start of a mission [default: 1970-01-01T00:00:00Z]
    #[arg(long, value_name = "RFC3339", help_heading = "Time")]
    pub zero: Option<String>,
    /// For heights above the ellipsoid: height of the geoid above the ellipsoid, -110 to 90 m
    #[arg(
        long,
        value_name = "M",
        value_parser = ranges::real(ranges::UNDULATIONS_M, " m"),
        allow_hyphen_values = true,
        help_heading = "Altitude"
    )]
    pub undulation_m: Option<f64>,
    /// For pressure altitudes: altimeter setting (QNH), 850 to 1100 hPa
    #[arg(
        long,
        value_name = "HPA",
        value_parser = ranges::real(850.0..=1100.0, " hPa"),
        help_heading = "Altitude"
    )]
    pub qnh_hpa: Option<f64>,
    /// For heights above take-off or ground: altitude of that place, -500 to 9000 m above mean sea level
    #[arg(
        long,
        value_name = "M",
        value_parser = ranges::real(-500.0..=9000.0, " m"),
        allow_hyphen_values = true,
        help_heading = "Altitude"
    )]
    pub base_amsl_m: Option<f64>,
    /// Set a whole column to one value, such as lat_deg=43.4 for a fixed instrument; repeatable
    #[arg(long, value_name = "COLUMN=VALUE", help_heading = "Columns")]
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
            "{}: the output exists; choose another --out, or replace it with --force",
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
    measured::tell(&report.notices);
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
            "Mapping file of {}, converted from {}.",
            arguments.out.display(),
            files.join(", ")
        ),
        "Convert other logs of this format with: plumage import FILE --map THIS --out OBS.csv"
            .to_owned(),
        String::new(),
    ];
    remarks.extend(report.notices.iter().cloned());
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
        .map_err(|what| Failure::usage(format!("options for the logs: {what}")))?;
    Ok(stated)
}
