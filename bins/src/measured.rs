//! What was measured, from files, as a program wants it: logs by a mapping file too, and what was noticed told.

use crate::{Failure, importing, mission_files};
use gap::flight::log::FlightLog;
use mission::Setup;
use plume::Gas;
use protocol::text::printable;
use scenario::observations::{self, DataQuality, Observations};
use std::path::{Path, PathBuf};
use tasks::measured;
pub use tasks::measured::{AircraftFile, fill_wind};

/// Observations as input, with the scenario to which they belong.
#[derive(Debug, clap::Args)]
pub struct ObservationInput {
    /// Observations (CSV or MCAP recordings)
    #[arg(required = true)]
    pub observations: Vec<PathBuf>,
    /// Mapping file (TOML) to read logs of other formats, as from `plumage import`
    #[arg(long, value_name = "FILE", help_heading = "Input")]
    pub map: Option<PathBuf>,
    /// Scenario with site, weather and sources (TOML)
    #[arg(long, value_name = "FILE", help_heading = "Input")]
    pub scenario: PathBuf,
    /// Gas to use from the observations: co2, ch4, n2o and so on, or one that the scenario defines [default:
    /// that of the first source]
    #[arg(long, value_name = "GAS", help_heading = "Input")]
    pub gas: Option<Gas>,
}

impl ObservationInput {
    /// Loads the scenario, set to the gas and the weather of the observations, and the observations of that gas.
    ///
    /// # Errors
    /// As [`mission_files::load`] and [`load_by`]; a gas that no source of the scenario emits.
    pub fn load(&self) -> Result<(Setup, Observations), Failure> {
        let setup = mission_files::for_gas(mission_files::load(&self.scenario)?, self.gas)?;
        let mut observations = load_by(
            &self.observations,
            setup.scenario.gas(),
            self.map.as_deref(),
        )?;
        let setup = weather_over(setup, &mut observations, &self.observations)?;
        Ok((setup, observations))
    }
}

/// As [`measured::load`].
///
/// # Errors
/// A file that cannot be read or holds no observations, with line and column.
pub fn load(files: &[PathBuf], gas: Gas) -> Result<Observations, Failure> {
    measured::load(files, gas).map_err(Failure::input)
}

/// As [`measured::weather_over`] for the observations in `files`.
///
/// # Errors
/// Weather at times that cannot be compared with those of the observations, or that share none with them.
pub fn weather_over(
    setup: Setup,
    observations: &mut Observations,
    files: &[PathBuf],
) -> Result<Setup, Failure> {
    let is_recording = |file: &PathBuf| file.extension().is_some_and(|e| e == "mcap");
    let are_recordings = files.iter().all(is_recording);
    measured::weather_over(setup, observations, are_recordings).map_err(Failure::input)
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

/// The text of a file; `what` names it in the message where it cannot be read.
pub(crate) fn read(file: &Path, what: &'static str) -> Result<String, Failure> {
    measured::read(file, what).map_err(Failure::input)
}

/// As [`measured::flight`].
///
/// # Errors
/// A file that cannot be read or is not a flight, with line and column; a recorded mission, which
/// has no commands to the surfaces.
pub fn flight(file: &Path) -> Result<FlightLog, Failure> {
    measured::flight(file).map_err(Failure::input)
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
        eprintln!("note: {}", printable(notice));
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
        let platform = printable(platform);
        if before < TOLD_FLAWS {
            let message = printable(message);
            eprintln!("raw data: {platform}, {from_s:.0} to {to_s:.0} s: {message}");
        } else if before == TOLD_FLAWS {
            let more = flaws[k..].iter().filter(|f| alike(f, flaw)).count();
            eprintln!("raw data: {platform}: {more} more such stretches");
        }
    }
}
