//! What was measured, from files: observations (CSV, or recordings wherever CSV is taken), flights,
//! and the aircraft that flew them.

use crate::TaskError;
use fdm::{Aircraft, Airframe};
use gap::flight::log::FlightLog;
use mission::Setup;
use plume::Gas;
use scenario::observations::{self, ObservationRow, Observations};
use scenario::world::WorldError;
use std::path::{Path, PathBuf};
use ws::wind::WorldWind;

/// Reads the readings of `gas` in all `files` as one set of observations.
///
/// # Errors
/// A file that cannot be read or holds no observations, with line and column.
pub fn load(files: &[PathBuf], gas: Gas) -> Result<Observations, TaskError> {
    let texts: Result<Vec<Text>, TaskError> =
        files.iter().map(|file| Text::of_file(file)).collect();
    of_texts(&texts?, gas)
}

/// The text of observations (CSV).
#[derive(Debug, Clone)]
pub struct Text {
    /// What it is called in messages.
    pub name: String,
    /// What it says.
    pub text: String,
    /// What was noticed when it was made.
    pub notices: Vec<String>,
}

/// Reads the readings of `gas` in all `texts` as one set of observations.
///
/// # Errors
/// A text that holds no observations, with line and column.
pub fn of_texts(texts: &[Text], gas: Gas) -> Result<Observations, TaskError> {
    let named: Vec<(&str, &str)> = texts
        .iter()
        .map(|t| (t.name.as_str(), t.text.as_str()))
        .collect();
    let mut all = observations::parse(&named, gas)?;
    let notices = texts.iter().flat_map(|t| &t.notices);
    all.notices.extend(notices.cloned());
    Ok(all)
}

/// `setup` with the weather of its series at the times of `observations`, which get a notice where they reach beyond it.
/// Those that `are_recordings` count from the start of a mission, as the series did when it was flown.
///
/// # Errors
/// Weather at times that cannot be compared with those of the observations, or that share none with them.
pub fn weather_over(
    setup: Setup,
    observations: &mut Observations,
    are_recordings: bool,
) -> Result<Setup, TaskError> {
    let times = || observations.rows.iter().map(|r| r.time_s);
    let (Some(from_s), Some(to_s)) = (times().reduce(f64::min), times().reduce(f64::max)) else {
        return Ok(setup);
    };
    if are_recordings {
        return Ok(setup);
    }
    let (setup, notice) = setup.at_times(from_s, to_s)?;
    observations.notices.extend(notice);
    Ok(setup)
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

impl Text {
    /// That of a file: CSV, or a recording.
    ///
    /// # Errors
    /// A file that cannot be read, or a recording in which nothing was read.
    pub fn of_file(file: &Path) -> Result<Self, TaskError> {
        let name = file.display().to_string();
        if file.extension().is_some_and(|e| e == "mcap") {
            let recording = record::read_mcap(file)?;
            let raw = record::observations::of_recording(&recording)?;
            // As the correction in flight takes them in.
            let rows = gap::plume::averaged(&raw);
            return Ok(Self {
                name,
                text: rows.to_csv(),
                notices: raw.notices.clone(),
            });
        }
        Ok(Self {
            name,
            text: read(file, "observations")?,
            notices: Vec::new(),
        })
    }
}

/// The text of a file; `what` names it in the message where it cannot be read.
///
/// # Errors
/// A file that cannot be read or is no text.
pub fn read(file: &Path, what: &'static str) -> Result<String, TaskError> {
    let name = || file.display().to_string();
    let bytes = std::fs::read(file).map_err(|source| TaskError::Read {
        file: name(),
        what,
        source,
    })?;
    String::from_utf8(bytes).map_err(|e| {
        let good = e.utf8_error().valid_up_to();
        let lines = e.as_bytes()[..good].iter().filter(|b| **b == b'\n');
        TaskError::NotText {
            file: name(),
            what,
            line: lines.count() + 1,
        }
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
    pub fn read(file: &Path) -> Result<Self, TaskError> {
        let name = file.display().to_string();
        let text = read(file, "aircraft")?;
        let aircraft = Aircraft::from_toml(&name, &text)?;
        Ok(Self {
            name,
            text,
            aircraft,
        })
    }
}

/// Reads an aircraft file of either kind.
///
/// # Errors
/// As [`AircraftFile::read`].
pub fn airframe(file: &Path) -> Result<Airframe, TaskError> {
    let text = read(file, "aircraft")?;
    Ok(Airframe::from_toml(&file.display().to_string(), &text)?)
}

/// Reads a measured flight.
///
/// # Errors
/// A file that cannot be read or is not a flight, with line and column; a recorded mission, which
/// has no commands to the surfaces.
pub fn flight(file: &Path) -> Result<FlightLog, TaskError> {
    let name = file.display().to_string();
    if file.extension().is_some_and(|e| e == "mcap") {
        return Err(TaskError::Gap(gap::GapError::Data {
            what: name,
            problem: "a recorded mission holds no commands to the surfaces".into(),
            expected: "the flight log of the autopilot as CSV".into(),
        }));
    }
    Ok(FlightLog::parse(&name, &read(file, "flight")?)?)
}
