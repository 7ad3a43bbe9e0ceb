//! `plumage export`: what was flown or measured, in formats of other people's tools.

use crate::outputs::{TRACK_INTERVAL_S, TRACK_POINTS};
use crate::progress::Waiting;
use crate::ros2::Undulation;
use crate::{Failure, importing, measured, mission_files, plume_lines, ranges, reports, site};
use air::geo::LocalFrame;
use clap::ValueEnum;
use mission::{Setup, campaign};
use plume::{Gas, Unit};
use protocol::message::{Message, Model, Peak};
use protocol::text::printable;
use record::colour::Shown;
use record::contour::PlumeLine;
use record::export::foxglove::Converter;
use record::export::{Flown, columns, geojson, netcdf, ros2};
use record::files::write_whole;
use record::kml::{Map, MapFeatures};
use record::summary::Summariser;
use record::{Recorder, Recording, kml, kmz};
use std::io::Write as _;
use std::ops::RangeInclusive;
use std::path::{Path, PathBuf};
use views::site::SiteMap;

/// What is said where the beginning is not known, and where heights of the ellipsoid are not.
const NO_START: &str = "the start is unknown (mission.start of the scenario, or --zero for observations); dates count \
    from 1970, in KML and NetCDF from 2000";
const NO_ALTITUDE: &str = "NavSatFix needs heights above the ellipsoid; without --undulation-m its altitude is omitted. \
    Odometry heights count from the site's ground, those of gas readings from mean sea level";

/// Times between readings that can be asked for, s: from that of the fastest sensors to a day.
const EVERY_S: RangeInclusive<f64> = 0.1..=86_400.0;

/// A format of other people's tools.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Format {
    /// One row per reading, as text
    Csv,
    /// Readings, tracks, plume and fence for maps (RFC 7946)
    Geojson,
    /// Trajectories by the CF conventions, classic NetCDF
    Netcdf,
    /// One row per reading, in columns
    Parquet,
    /// Tracks and plume for Google Earth
    Kml,
    /// KML, compressed
    Kmz,
    /// ROS 2 bag: a folder with MCAP and metadata.yaml
    Ros2,
    /// Recording with Foxglove messages added (MCAP)
    Foxglove,
    /// A report.html on paper; needs Chromium or Chrome
    Pdf,
}

impl Format {
    /// What the output's name ends with.
    fn ending(self) -> &'static str {
        match self {
            Self::Csv => ".csv",
            Self::Geojson => ".geojson",
            Self::Netcdf => ".nc",
            Self::Parquet => ".parquet",
            Self::Kml => ".kml",
            Self::Kmz => ".kmz",
            Self::Ros2 => "-ros2",
            Self::Foxglove => "-foxglove.mcap",
            Self::Pdf => ".pdf",
        }
    }
}

/// Arguments of `plumage export`.
#[derive(Debug, clap::Args)]
#[command(after_help = "Example: plumage export out/seed-7/mission.mcap --to geojson")]
pub struct ExportArguments {
    /// Recording of a mission (MCAP), or observations (CSV) from `plumage import`; for pdf a report (HTML)
    pub file: PathBuf,
    /// Output format
    #[arg(long, value_name = "FORMAT")]
    pub to: Format,
    /// Output file or folder, - for standard output [default: next to the input]
    #[arg(long, value_name = "PATH")]
    pub out: Option<PathBuf>,
    /// Export one reading of each vehicle every S seconds, 0.1 to 86400 s [default: all]
    #[arg(long, value_name = "S", value_parser = ranges::real(EVERY_S, " s"))]
    pub every_s: Option<f64>,
    /// Replace an earlier output
    #[arg(long)]
    pub force: bool,
    /// For observations: the time that time_s counts from [default: as in FILE.import.toml]
    #[arg(long, value_name = "RFC3339")]
    pub zero: Option<String>,
    /// For observations: the gas to export [default: the first one with a column]
    #[arg(long, value_name = "GAS")]
    pub gas: Option<Gas>,
    /// The geoid
    #[command(flatten)]
    pub undulation: Undulation,
}

/// Writes the file in the format that is asked for.
///
/// # Errors
/// A file that is neither a recording nor observations, or an output that exists or cannot be written.
pub fn export(arguments: &ExportArguments) -> Result<(), Failure> {
    let out = arguments
        .out
        .clone()
        .unwrap_or_else(|| beside(&arguments.file, arguments.to));
    let to_output = out == Path::new("-");
    if let Some(option) = arguments.unfit(to_output) {
        return Err(Failure::usage(format!(
            "{option} does not go with this format; expected --to csv, geojson, netcdf or parquet"
        )));
    }
    if out.exists() && !arguments.force && !to_output {
        return Err(Failure::usage(format!(
            "{}: the output exists; choose another --out, or replace it with --force",
            out.display()
        )));
    }
    if arguments.to == Format::Pdf {
        return print(&arguments.file, &out);
    }
    let undulation_m = arguments.undulation.m();
    let waiting = Waiting::new("reading and writing");
    let source = Source::open(arguments)?;
    let wrote = write(&source, arguments, undulation_m, &out)?;
    drop(waiting);
    for note in wrote.notes {
        eprintln!("note: {}", printable(&note));
    }
    if to_output {
        eprintln!("{}", wrote.what);
    } else {
        println!("{}", wrote.what);
        println!("Output: {}", out.display());
    }
    Ok(())
}

/// Prints a report.
fn print(report: &Path, out: &Path) -> Result<(), Failure> {
    if report.extension().is_none_or(|e| e != "html") || !report.is_file() {
        return Err(Failure::usage(format!(
            "{}: expected a report of Plumage (HTML) for --to pdf",
            report.display()
        )));
    }
    reports::pdf(report, out)?;
    println!("Output: {}", out.display());
    Ok(())
}

impl ExportArguments {
    /// The option that does not go with the format.
    fn unfit(&self, to_output: bool) -> Option<&'static str> {
        let is_folder_or_recording =
            matches!(self.to, Format::Ros2 | Format::Foxglove | Format::Pdf);
        if to_output && is_folder_or_recording {
            return Some("--out -");
        }
        let is_thinned = is_folder_or_recording || matches!(self.to, Format::Kml | Format::Kmz);
        (self.every_s.is_some() && is_thinned).then_some("--every-s")
    }
}

/// What was written, and what is to be known of it.
struct Wrote {
    what: String,
    notes: Vec<String>,
}

fn write(
    source: &Source,
    arguments: &ExportArguments,
    undulation_m: Option<f64>,
    out: &Path,
) -> Result<Wrote, Failure> {
    if arguments.to == Format::Foxglove {
        return source.foxglove(out, arguments.force);
    }
    let mut flown = source.flown()?;
    if let Some(every_s) = arguments.every_s {
        flown.thin(every_s);
    }
    let mut notes = flown.notices.clone();
    if flown.start_unix_ns.is_none() {
        notes.push(NO_START.to_owned());
    }
    if arguments.to == Format::Ros2 {
        bag(source, &flown, out, undulation_m)?;
        notes.extend(undulation_m.is_none().then(|| NO_ALTITUDE.to_owned()));
    } else {
        let bytes = source.bytes(&flown, arguments.to)?;
        if out == Path::new("-") {
            std::io::stdout().lock().write_all(&bytes)?;
        } else {
            write_whole(out, &bytes).map_err(Failure::input)?;
        }
    }
    let names: Vec<&str> = flown.vehicles.iter().map(|v| v.name.as_str()).collect();
    Ok(Wrote {
        what: format!("{} readings of {}", flown.readings.len(), names.join(", ")),
        notes,
    })
}

/// `mission.mcap` as `mission.csv` and so on.
fn beside(file: &Path, format: Format) -> PathBuf {
    let mut name = file.file_stem().unwrap_or_default().to_owned();
    name.push(format.ending());
    let out = file.with_file_name(name);
    // Observations as CSV are not replaced by themselves.
    if out == file {
        file.with_extension("export.csv")
    } else {
        out
    }
}

/// What is exported.
enum Source {
    Mission(Box<Mission>),
    Observations(Box<Flown>),
}

/// A recorded mission with its scenario.
struct Mission {
    recording: Recording,
    setup: Setup,
    site: SiteMap,
}

/// How a mission ended.
#[derive(Default)]
struct Ending {
    model: Option<Box<Model>>,
    peak: Option<Peak>,
}

impl Source {
    fn open(arguments: &ExportArguments) -> Result<Self, Failure> {
        let file = &arguments.file;
        if file.extension().is_some_and(|e| e == "mcap") {
            let recording = record::read_mcap(file).map_err(Failure::input)?;
            let setup = mission_files::load_recorded(&recording)?;
            let site = site::of(&setup).map_err(Failure::Input)?;
            let mission = Mission {
                recording,
                setup,
                site,
            };
            return Ok(Self::Mission(Box::new(mission)));
        }
        let zero = zero_unix_ns(arguments)?;
        let gas = arguments.gas.map_or_else(|| gas_of(file), Ok)?;
        let all = measured::load(std::slice::from_ref(file), gas)?;
        let name = file.file_stem().unwrap_or_default().to_string_lossy();
        Ok(Self::Observations(Box::new(Flown::of_observations(
            &name, &all, zero,
        ))))
    }

    fn flown(&self) -> Result<Flown, Failure> {
        match self {
            Self::Mission(mission) => {
                Flown::of_recording(&mission.recording).map_err(Failure::input)
            }
            Self::Observations(flown) => Ok((**flown).clone()),
        }
    }

    /// The output of a format that is one file.
    fn bytes(&self, flown: &Flown, format: Format) -> Result<Vec<u8>, Failure> {
        Ok(match format {
            Format::Csv => formats::table::csv(&columns::columns(flown))?,
            Format::Parquet => formats::table::parquet("reading", &columns::columns(flown))?,
            Format::Netcdf => netcdf::trajectories(flown),
            Format::Geojson => {
                let (around, plume) = self.drawn()?;
                geojson::collection(flown, around.as_ref(), &plume).into_bytes()
            }
            Format::Kml => self.kml(flown)?.into_bytes(),
            Format::Kmz => kmz::archive(&[(kmz::DOCUMENT, &self.kml(flown)?)])?,
            Format::Ros2 | Format::Foxglove | Format::Pdf => Vec::new(),
        })
    }

    /// What stands beside tracks and readings; of observations nothing.
    fn drawn(&self) -> Result<(Option<MapFeatures>, Vec<PlumeLine>), Failure> {
        let Self::Mission(mission) = self else {
            return Ok((None, Vec::new()));
        };
        let ending = mission.ending()?;
        let around = MapFeatures {
            peak: ending.peak,
            ..site::surroundings(&mission.setup)?
        };
        let plume = ending
            .model
            .map(|model| plume_lines::of(&mission.site, &model).lines);
        Ok((Some(around), plume.unwrap_or_default()))
    }

    fn kml(&self, flown: &Flown) -> Result<String, Failure> {
        let (around, plume) = self.drawn()?;
        let around = around.unwrap_or_else(|| MapFeatures {
            mission: flown.name.clone(),
            shown: shown(flown),
            stacks: Vec::new(),
            fence: Vec::new(),
            fence_top_amsl_m: 0.0,
            peak: None,
        });
        let map = Map {
            start_unix_ns: flown.start_unix_ns,
            tracks: &flown.tracks(TRACK_POINTS, TRACK_INTERVAL_S),
            around: &around,
            plume: &plume,
        };
        Ok(kml::document(&map)?)
    }

    /// The recording with Foxglove's messages beside its own.
    fn foxglove(&self, out: &Path, force: bool) -> Result<Wrote, Failure> {
        let Self::Mission(mission) = self else {
            return Err(Failure::usage(
                "--to foxglove: expected the recording of a mission (MCAP)",
            ));
        };
        if force && out.is_file() {
            std::fs::remove_file(out)?;
        }
        let info = &mission.recording.info;
        let mut converter = mission.converter()?;
        let mut recorder = Recorder::create(out, info).map_err(Failure::input)?;
        let write = |recorder: &mut Recorder,
                     messages: Vec<record::export::foxglove::FoxgloveMessage>| {
            messages.into_iter().try_for_each(|message| {
                let schema = message.kind.json_schema();
                let schema = (message.kind.name(), &schema);
                recorder.beside(
                    &message.topic,
                    schema,
                    message.time,
                    &message.json.to_string(),
                )
            })
        };
        write(&mut recorder, converter.begin())?;
        let mut messages = mission.recording.in_order().map_err(Failure::input)?;
        let mut digest = protocol::digest::Digest::new();
        for message in messages.by_ref() {
            let (topic, envelope) = message.map_err(Failure::input)?;
            digest.add(&topic, &envelope);
            recorder.record(&topic, &envelope)?;
            write(&mut recorder, converter.take(&topic, &envelope))?;
        }
        let totals = recorder.finish(Some(&digest.hex()))?;
        Ok(Wrote {
            what: format!(
                "{} messages of the mission, with Foxglove messages added",
                totals.messages
            ),
            notes: messages.ending().loss().into_iter().collect(),
        })
    }
}

impl Mission {
    fn ending(&self) -> Result<Ending, Failure> {
        let mut ending = Ending::default();
        // The peak is the summary's, as in what the run wrote itself.
        let mut summariser = Summariser::new(campaign::summary_context(&self.setup)?);
        for message in self.recording.in_order().map_err(Failure::input)? {
            let (topic, envelope) = message.map_err(Failure::input)?;
            summariser.take(&topic, &envelope);
            if let Message::Model(model) = envelope.message {
                ending.model = Some(model);
            }
        }
        ending.peak = summariser.summary("", 0.0).peak.estimate;
        Ok(ending)
    }

    fn converter(&self) -> Result<Converter<'_>, Failure> {
        let around = site::surroundings(&self.setup)?;
        let start = self.recording.info.start_unix_ns;
        let plume = |model: &Model| plume_lines::of(&self.site, model);
        Ok(Converter::new(start, self.setup.frame()?, around, plume))
    }
}

fn bag(
    source: &Source,
    flown: &Flown,
    out: &Path,
    undulation_m: Option<f64>,
) -> Result<(), Failure> {
    let frame: Option<LocalFrame> = match source {
        Source::Mission(mission) => Some(mission.setup.frame()?),
        Source::Observations(_) => None,
    };
    let name = out
        .file_name()
        .unwrap_or_default()
        .to_string_lossy()
        .into_owned();
    let bag = ros2::bag(flown, frame, undulation_m, &name)?;
    std::fs::create_dir_all(out)?;
    write_whole(&out.join(format!("{name}_0.mcap")), &bag.mcap).map_err(Failure::input)?;
    write_whole(&out.join("metadata.yaml"), bag.metadata.as_bytes()).map_err(Failure::input)?;
    Ok(())
}

/// What times of observations count from: as said, or as the mapping file beside them says.
fn zero_unix_ns(arguments: &ExportArguments) -> Result<Option<i64>, Failure> {
    let mapping = crate::commands::import::how(&arguments.file);
    let zero = match &arguments.zero {
        Some(zero) => Some(zero.clone()),
        None if mapping.is_file() => {
            let map = importing::map(Some(&mapping))?;
            // Without a zero of its own what was imported counts from 1970.
            Some(
                map.zero
                    .unwrap_or_else(|| "1970-01-01T00:00:00Z".to_owned()),
            )
        }
        None => None,
    };
    let Some(zero) = zero else { return Ok(None) };
    let unix_s =
        import::time::stamp(zero.as_bytes(), None).map(|s| s.clock_s - s.ahead_s.unwrap_or(0.0));
    let unix_s = unix_s.ok_or_else(|| {
        Failure::usage(format!(
            "--zero {zero}: expected a time such as 2026-11-27T12:30:00Z"
        ))
    })?;
    Ok(Some((unix_s * 1e9) as i64))
}

/// The first gas that the file has a column of.
fn gas_of(file: &Path) -> Result<Gas, Failure> {
    let text = measured::read(file, "observations")?;
    let header = text
        .trim_start_matches('\u{feff}')
        .lines()
        .next()
        .unwrap_or_default();
    let columns: Vec<&str> = header
        .split(',')
        .map(|c| c.trim().trim_matches('"'))
        .collect();
    let has = |gas: &Gas| {
        let named = |unit| columns.contains(&gas.column(unit));
        named(Unit::Ppm) || named(Unit::Ppb)
    };
    Ok(Gas::ALL.into_iter().find(has).unwrap_or_default())
}

/// A scale for readings without a scenario: from the lowest to the highest.
fn shown(flown: &Flown) -> Shown {
    let known = flown
        .readings
        .iter()
        .filter_map(|r| r.ppm)
        .filter(|p| p.is_finite());
    let (low, high) = known.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), p| {
        (low.min(p), high.max(p))
    });
    if high > low {
        Shown {
            gas: flown.gas,
            grey_ppm: low,
            red_ppm: high,
        }
    } else {
        Shown {
            gas: flown.gas,
            ..Shown::CO2
        }
    }
}
