//! What was measured, from files: observations (CSV, or recordings wherever CSV is taken), flights,
//! and the aircraft that flew them.

use crate::{Failure, importing};
use anyhow::Context as _;
use fdm::Aircraft;
use gap::flight::log::FlightLog;
use mission::Setup;
use plume::Gas;
use scenario::observations::{self, DataQuality, ObservationRow, Observations};
use scenario::world::WorldError;
use std::path::{Path, PathBuf};
use ws::wind::WorldWind;

/// Readings of a recording are taken at most this often, s: closer ones say little more.
const RECORDING_INTERVAL_S: f64 = 1.0;

/// Reads the readings of `gas` in all `files` as one set of observations.
///
/// # Errors
/// A file that cannot be read or holds no observations, with line and column.
pub fn load(files: &[PathBuf], gas: Gas) -> Result<Observations, Failure> {
    let mut texts = Vec::with_capacity(files.len());
    let mut notices = Vec::new();
    for file in files {
        let (text, more) = text_of(file)?;
        texts.push((file.display().to_string(), text));
        notices.extend(more);
    }
    let named: Vec<(&str, &str)> = texts
        .iter()
        .map(|(n, t)| (n.as_str(), t.as_str()))
        .collect();
    let mut all = observations::parse(&named, gas).map_err(Failure::input)?;
    all.notices.extend(notices);
    Ok(all)
}

/// Reads the readings of `gas` in all `files` as one set of observations: by the mapping file `map` as logs, or else as Plumage's own.
///
/// # Errors
/// A file that cannot be read or holds no observations, with line and column; a log with what to state.
pub fn load_by(files: &[PathBuf], gas: Gas, map: Option<&Path>) -> Result<Observations, Failure> {
    let Some(map) = map else {
        return load(files, gas);
    };
    let (text, said) = importing::text(files, map)?;
    let mut all =
        observations::parse(&[("the imported rows", &text)], gas).map_err(Failure::input)?;
    all.notices.extend(said);
    Ok(all)
}

/// Where nobody logged the wind and the scenario has a series of it, that is the log: put into every
/// row, at its height. Whether it was.
///
/// # Errors
/// A scenario that describes no wind.
pub fn fill_wind(observations: &mut Observations, setup: &Setup) -> Result<bool, WorldError> {
    let Some(series) = &setup.wind_series else {
        return Ok(false);
    };
    let logged = |row: &ObservationRow| row.wind_from_deg.is_some();
    if observations.rows.iter().any(logged) {
        return Ok(false);
    }
    // As the world simulator would have it: the same interpolation, or a series that was read and one
    // that was flown would differ.
    let wind = WorldWind::new(setup.scenario.wind_profile()?, Some(series.clone()), false);
    let ground_amsl_m = setup.scenario.site.ground_amsl_m;
    for row in &mut observations.rows {
        let now = wind.at(row.time_s, 0.0);
        row.wind_speed_m_s = Some(now.speed_at_m_s(row.alt_amsl_m - ground_amsl_m));
        row.wind_from_deg = Some(now.from_deg());
    }
    observations
        .notices
        .push("no wind columns: the scenario's series is the log of the wind".to_string());
    Ok(true)
}

fn text_of(file: &Path) -> Result<(String, Vec<String>), Failure> {
    if file.extension().is_some_and(|e| e == "mcap") {
        let recording = record::read_mcap(file).map_err(Failure::input)?;
        let rows = record::observations::of_recording(&recording, RECORDING_INTERVAL_S)
            .map_err(Failure::input)?;
        return Ok((rows.to_csv(), rows.notices));
    }
    Ok((read(file, "observations")?, Vec::new()))
}

/// The text of a file; `what` names it in the message where it cannot be read.
pub(crate) fn read(file: &Path, what: &str) -> Result<String, Failure> {
    let bytes = std::fs::read(file)
        .with_context(|| format!("{}: cannot read the {what}", file.display()))
        .map_err(Failure::Input)?;
    String::from_utf8(bytes).map_err(|e| {
        let good = e.utf8_error().valid_up_to();
        let lines = e.as_bytes()[..good].iter().filter(|b| **b == b'\n');
        let line = lines.count() + 1;
        Failure::Input(anyhow::anyhow!(
            "{}: line {line}: not UTF-8 text; expected the {what} as text in UTF-8",
            file.display()
        ))
    })
}

/// An aircraft as its file has it.
#[derive(Debug, Clone)]
pub struct AircraftFile {
    /// The file, for messages.
    pub name: String,
    /// Its text.
    pub text: String,
    /// What it says.
    pub aircraft: Aircraft,
}

impl AircraftFile {
    /// Reads an aircraft file.
    ///
    /// # Errors
    /// A file that cannot be read, or an aircraft that the simulator refuses, with the reason.
    pub fn read(file: &Path) -> Result<Self, Failure> {
        let name = file.display().to_string();
        let text = read(file, "aircraft")?;
        let aircraft = Aircraft::from_toml(&name, &text).map_err(Failure::input)?;
        Ok(Self {
            name,
            text,
            aircraft,
        })
    }
}

/// Reads a measured flight.
///
/// # Errors
/// A file that cannot be read or is not a flight, with line and column; a recorded mission, which
/// has no commands to the surfaces.
pub fn flight(file: &Path) -> Result<FlightLog, Failure> {
    let name = file.display().to_string();
    if file.extension().is_some_and(|e| e == "mcap") {
        return Err(Failure::input(gap::GapError::Data {
            what: name,
            problem: "a recorded mission holds no commands to the surfaces".into(),
            expected: "the flight log of the autopilot as CSV".into(),
        }));
    }
    FlightLog::parse(&name, &read(file, "flight")?).map_err(Failure::input)
}

/// Reads a measured flight: by the mapping file `map` as a log, or else as Plumage's own.
///
/// # Errors
/// As [`flight`]; a log with what to state.
pub fn flight_by(file: &Path, map: Option<&Path>) -> Result<FlightLog, Failure> {
    let Some(map) = map else {
        return flight(file);
    };
    let (text, said) = importing::text(&[file.to_owned()], map)?;
    let name = file.display().to_string();
    let mut log = FlightLog::parse(&name, &text).map_err(Failure::input)?;
    log.notices.extend(said);
    Ok(log)
}

/// Tells what was noticed in the data, on standard error.
pub fn tell(notices: &[String]) {
    for notice in notices {
        eprintln!("note: {notice}");
    }
}

/// Most flaws of one kind and platform that are told one by one.
const TOLD_FLAWS: usize = 3;

/// Tells what was wrong with raw data, on standard error.
pub fn tell_flaws(flaws: &[DataQuality]) {
    let alike = |a: &DataQuality, b: &DataQuality| a.platform == b.platform && a.kind == b.kind;
    for (k, flaw) in flaws.iter().enumerate() {
        let before = flaws[..k].iter().filter(|f| alike(f, flaw)).count();
        let DataQuality {
            platform,
            from_s,
            to_s,
            message,
            ..
        } = flaw;
        if before < TOLD_FLAWS {
            eprintln!("raw data: {platform}, {from_s:.0} to {to_s:.0} s: {message}");
        } else if before == TOLD_FLAWS {
            let more = flaws[k..].iter().filter(|f| alike(f, flaw)).count();
            eprintln!("raw data: {platform}: {more} more of this kind");
        }
    }
}
