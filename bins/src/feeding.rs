//! Observations that are passed into a mission while it flies, as those of a real vehicle that is not of
//! its team: whole files, or lines of standard input as they come.

use crate::pace::Speed;
use crate::{Failure, measured};
use mission::Setup;
use mission::fed_vehicle::{FedVehicle, FeedTimes};
use plume::{Gas, Unit};
use protocol::SimTime;
use protocol::text::printable;
use scenario::Scenario;
use scenario::observations::{
    OPTIONAL, ObservationStream, Observations, REQUIRED, SD_PPB, Streamed, checks,
};
use std::io::BufRead as _;
use std::path::{Path, PathBuf};
use std::str::FromStr;
use std::sync::mpsc::{Receiver, TryRecvError, channel};

/// The name that stands for standard input.
const STANDARD_INPUT: &str = "-";
/// Id of a vehicle whose lines come from standard input.
const STREAM_ID: &str = "feed";

/// Time at which the first row is published.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Start {
    /// At this mission time, s.
    At(f64),
    /// The times in the rows, seconds since the mission's start.
    File,
}

impl FromStr for Start {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let seconds = || text.parse::<f64>().ok().filter(|s| (0.0..=1e6).contains(s));
        match (text, seconds()) {
            ("file", _) => Ok(Self::File),
            (_, Some(s)) => Ok(Self::At(s)),
            _ => Err("expected 0 to 1000000 s since the mission's start, or file".to_owned()),
        }
    }
}

/// Input and timing of fed observations.
#[derive(Debug, Clone, Copy)]
pub struct FeedOptions<'a> {
    /// Files, or standard input as `-`.
    pub files: &'a [PathBuf],
    /// Mapping file by which these are read; none of Plumage's own.
    pub map: Option<&'a Path>,
    /// Id of the vehicle.
    pub id: Option<&'a str>,
    /// Time at which the first row is published; at its arrival if not given.
    pub start: Option<Start>,
    /// Speed of publication.
    pub speed: Speed,
}

impl FeedOptions<'_> {
    /// Whether rows come from standard input.
    pub fn is_stream(&self) -> bool {
        self.files.iter().any(|f| f == Path::new(STANDARD_INPUT))
    }
}

/// When rows are said of which the first, read at `first_s`, is there at the mission's time `now`.
fn feed_times(
    start: Option<Start>,
    speed: Speed,
    first_s: f64,
    now: SimTime,
    tick_ns: i64,
) -> FeedTimes {
    FeedTimes {
        first_s,
        start: match start {
            None => now,
            Some(Start::At(s)) => SimTime::from_s(s),
            Some(Start::File) => SimTime::from_s(first_s),
        },
        speed: speed.0,
        tick_ns,
        said: 0,
    }
}

/// Files that are read and checked.
pub struct FeedFiles {
    observations: Observations,
    ids: Vec<String>,
}

impl FeedFiles {
    /// Reads and checks the files of `options`, and says what is left out, as `plumage calibrate` does.
    ///
    /// # Errors
    /// Files that are no observations, of which nothing is left, or whose platforms cannot be vehicles.
    pub fn open(setup: &Setup, options: &FeedOptions<'_>) -> Result<Self, Failure> {
        let raw = measured::load_by(options.files, setup.scenario.gas(), options.map)?;
        measured::tell(&raw.notices);
        let scenario = &setup.scenario;
        let base = scenario.dispersion_spec().map_err(Failure::input)?;
        let frame = scenario.frame().map_err(Failure::input)?;
        let checked = checks::check(&raw, &base, &frame);
        measured::tell_flaws(&checked.flaws);
        let observations = checked.observations;
        if observations.readings() == 0 {
            return Err(Failure::usage(format!(
                "{}: the checks rejected all {} readings",
                names(options.files),
                raw.readings()
            )));
        }
        let ids: Vec<String> = match (options.id, &observations.platforms[..]) {
            (None, all) => all.to_vec(),
            (Some(id), [_]) => vec![id.to_owned()],
            (Some(id), all) => (1..=all.len()).map(|k| format!("{id}-{k}")).collect(),
        };
        for (id, platform) in ids.iter().zip(&observations.platforms) {
            // An id that cannot be is refused before anything is joined.
            FedVehicle::new(setup, id)
                .map_err(|e| Failure::usage(format!("platform {platform}: {e}")))?;
        }
        Ok(Self { observations, ids })
    }

    /// Ids of the vehicles.
    pub fn ids(&self) -> &[String] {
        &self.ids
    }

    /// The vehicles with all their rows, the first at the mission's time `now` unless the options say
    /// otherwise. Also when the last row is said.
    ///
    /// # Errors
    /// An id that cannot be.
    pub fn vehicles(
        &self,
        setup: &Setup,
        options: &FeedOptions<'_>,
        now: SimTime,
    ) -> Result<(Vec<FedVehicle>, SimTime), Failure> {
        let rows = &self.observations.rows;
        let first_s = rows.first().map_or(0.0, |r| r.time_s);
        let mut times = feed_times(options.start, options.speed, first_s, now, setup.tick_ns());
        let vehicles = self.ids.iter().map(|id| FedVehicle::new(setup, id));
        let mut vehicles = vehicles
            .collect::<Result<Vec<_>, _>>()
            .map_err(Failure::input)?;
        let mut last = now;
        for row in rows {
            let when = times.next(row.time_s);
            last = last.max(when.0);
            vehicles[row.platform].push(when, row);
        }
        let (start, end) = (times.start.s(), setup.scenario.mission.duration_s);
        eprintln!(
            "feeding {} readings of {}: the first at {start:.0} s, the last at {:.0} s of mission time",
            self.observations.readings(),
            self.ids.join(", "),
            last.s()
        );
        if last.s() > end {
            eprintln!("warning: the mission ends at {end:.0} s, before the last reading");
        }
        Ok((vehicles, last))
    }
}

/// Lines of standard input on their way to a vehicle.
pub struct LineFeed {
    lines: Receiver<String>,
    id: String,
    scenario: Scenario,
    start: Option<Start>,
    speed: Speed,
    form: Option<LineForm>,
    times: Option<FeedTimes>,
    platform: Option<String>,
    /// Rows passed on, and rows or lines left out.
    passed: usize,
    left_out: usize,
    ended: bool,
}

/// How lines are read, once the first is known.
struct LineForm {
    stream: ObservationStream,
    /// Of a stream of objects.
    columns: Option<Vec<String>>,
}

impl LineFeed {
    /// The lines of standard input from now on.
    ///
    /// # Errors
    /// Files beside it, or an id that cannot be.
    pub fn new(setup: &Setup, options: &FeedOptions<'_>) -> Result<Self, Failure> {
        if options.files.len() > 1 {
            return Err(Failure::usage(
                "expected files or standard input (-), not both",
            ));
        }
        let feed = Self {
            lines: standard_input(),
            id: options.id.unwrap_or(STREAM_ID).to_owned(),
            scenario: setup.scenario.clone(),
            start: options.start,
            speed: options.speed,
            form: None,
            times: None,
            platform: None,
            passed: 0,
            left_out: 0,
            ended: false,
        };
        feed.vehicle(setup)?;
        Ok(feed)
    }

    /// Id of the vehicle that its lines are of.
    pub fn id(&self) -> &String {
        &self.id
    }

    /// That vehicle, of which nothing is known yet.
    ///
    /// # Errors
    /// An id that cannot be.
    pub fn vehicle(&self, setup: &Setup) -> Result<FedVehicle, Failure> {
        FedVehicle::new(setup, &self.id).map_err(Failure::input)
    }

    /// Hands the lines that have come by `now` to `vehicle`; says on standard error what is left out.
    ///
    /// # Errors
    /// A first line that is no header.
    pub fn serve(&mut self, vehicle: &mut FedVehicle, now: SimTime) -> Result<(), Failure> {
        loop {
            match self.lines.try_recv() {
                Ok(line) => self.line(vehicle, now, &line)?,
                Err(TryRecvError::Empty) => return Ok(()),
                Err(TryRecvError::Disconnected) => {
                    self.ended = true;
                    return Ok(());
                }
            }
        }
    }

    /// Whether no more lines will come.
    pub fn has_ended(&self) -> bool {
        self.ended
    }

    /// How many rows were passed on and how many left out, in words.
    pub fn tally(&self) -> String {
        format!("{} rows fed, {} skipped", self.passed, self.left_out)
    }

    fn line(&mut self, vehicle: &mut FedVehicle, now: SimTime, line: &str) -> Result<(), Failure> {
        if line.trim().is_empty() {
            return Ok(());
        }
        let Some(form) = &mut self.form else {
            let form = self.form.insert(LineForm::new(&self.scenario, line)?);
            // A header is no row; an object is.
            return if form.columns.is_some() {
                self.line(vehicle, now, line)
            } else {
                Ok(())
            };
        };
        match form.take(line) {
            Ok(Some(streamed)) => self.row(vehicle, now, &streamed),
            Ok(None) => {}
            Err(why) => {
                self.left_out += 1;
                eprintln!("warning: line skipped: {}", printable(&format!("{why:#}")));
            }
        }
        Ok(())
    }

    fn row(&mut self, vehicle: &mut FedVehicle, now: SimTime, streamed: &Streamed) {
        measured::tell_flaws(&streamed.flaws);
        let own = self
            .platform
            .get_or_insert_with(|| streamed.platform.clone());
        if *own != streamed.platform {
            if self.left_out == 0 {
                eprintln!(
                    "warning: rows of {} skipped: this stream carries only {own}",
                    streamed.platform
                );
            }
            self.left_out += 1;
            return;
        }
        let Some(row) = streamed.row else {
            self.left_out += 1;
            return;
        };
        let (start, speed, tick_ns) = (self.start, self.speed, self.tick_ns());
        let times = self
            .times
            .get_or_insert_with(|| feed_times(start, speed, row.time_s, now, tick_ns));
        let (due, read) = times.next(row.time_s);
        vehicle.push((due.max(now), read), &row);
        self.passed += 1;
    }

    fn tick_ns(&self) -> i64 {
        SimTime::from_s(self.scenario.mission.tick_s).ns()
    }
}

impl LineForm {
    fn new(scenario: &Scenario, first: &str) -> Result<Self, Failure> {
        let base = scenario.dispersion_spec().map_err(Failure::input)?;
        let frame = scenario.frame().map_err(Failure::input)?;
        let columns = columns_of_json(first, scenario.gas());
        let header = columns.as_ref().map(|names| names.join(","));
        let header = header.as_deref().unwrap_or(first);
        let stream = ObservationStream::new("standard input", header, base, frame);
        let stream = stream.map_err(Failure::input)?;
        measured::tell(stream.notices());
        Ok(Self { stream, columns })
    }

    fn take(&mut self, line: &str) -> anyhow::Result<Option<Streamed>> {
        let Some(columns) = &self.columns else {
            return Ok(self.stream.take(line)?);
        };
        Ok(self.stream.take(&cells_of_json(line, columns)?)?)
    }
}

/// The columns of a stream of objects, by the first of them: all that a row may have, and the readings that
/// it names, or else those of `gas` in ppm. None where it is no object.
fn columns_of_json(first: &str, gas: Gas) -> Option<Vec<String>> {
    if !first.trim_start().starts_with('{') {
        return None;
    }
    let object = object(first).unwrap_or_default();
    let readings = object.keys().filter(|name| Gas::of_column(name).is_some());
    let mut columns: Vec<String> = REQUIRED.map(str::to_owned).to_vec();
    columns.extend(readings.cloned());
    if columns.len() == REQUIRED.len() {
        columns.push(gas.column(Unit::Ppm).to_owned());
    }
    let sd = if object.contains_key(SD_PPB) {
        SD_PPB
    } else {
        "sd_ppm"
    };
    let optional = OPTIONAL.into_iter().filter(|name| *name != "sd_ppm");
    columns.extend(optional.chain([sd]).map(str::to_owned));
    Some(columns)
}

fn object(line: &str) -> anyhow::Result<serde_json::Map<String, serde_json::Value>> {
    serde_json::from_str(line).map_err(|e| {
        anyhow::anyhow!("standard input: {line}: {e}; expected a JSON object of columns and values")
    })
}

/// An object with the columns' names as the cells of a row; other names are passed over.
fn cells_of_json(line: &str, columns: &[String]) -> anyhow::Result<String> {
    let object = object(line)?;
    let cell = |name: &String| match object.get(name) {
        None | Some(serde_json::Value::Null) => String::new(),
        Some(serde_json::Value::String(text)) => format!("\"{}\"", text.replace('"', "\"\"")),
        Some(other) => other.to_string(),
    };
    let cells: Vec<String> = columns.iter().map(cell).collect();
    Ok(cells.join(","))
}

fn names(files: &[PathBuf]) -> String {
    let names: Vec<String> = files.iter().map(|f| f.display().to_string()).collect();
    names.join(", ")
}

/// Lines of standard input, read on a thread of its own that ends with them or with the process.
fn standard_input() -> Receiver<String> {
    let (sender, receiver) = channel();
    std::thread::spawn(move || {
        let mut input = std::io::stdin().lock();
        let mut line = Vec::new();
        while input
            .read_until(b'\n', &mut line)
            .is_ok_and(|read| read > 0)
        {
            // Invalid UTF-8 appears in the error of its line.
            let text = String::from_utf8_lossy(&line).trim_end().to_owned();
            if sender.send(text).is_err() {
                return;
            }
            line.clear();
        }
    });
    receiver
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_object_is_a_row_of_cells() {
        let line = r#"{"time_s": 1.5, "platform": "a,b", "lat_deg": 43.4, "lon_deg": -7.8,
            "alt_amsl_m": 700, "co2_ppm": null, "battery": 3}"#;
        let columns = columns_of_json(line, Gas::Co2).unwrap();
        let cells = cells_of_json(line, &columns).unwrap();
        assert_eq!(cells, "1.5,\"a,b\",43.4,-7.8,700,,,,,,,,");
        assert!(cells_of_json("[1]", &columns).is_err());
        assert_eq!(columns_of_json("time_s,platform", Gas::Co2), None);
        // Readings are as the first object names them.
        let ppb = columns_of_json(r#"{"ch4_ppb": 1950, "sd_ppb": 2}"#, Gas::Ch4).unwrap();
        assert_eq!((ppb[5].as_str(), ppb[12].as_str()), ("ch4_ppb", "sd_ppb"));
    }

    #[test]
    fn a_start_is_a_time_or_the_files_own() {
        assert_eq!("file".parse(), Ok(Start::File));
        assert_eq!("90".parse(), Ok(Start::At(90.0)));
        assert!("-1".parse::<Start>().is_err() && "soon".parse::<Start>().is_err());
    }
}
