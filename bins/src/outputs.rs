//! What a run leaves behind: recording, tracks, summary, report and resolved scenario.

use crate::{Failure, plume_lines, reports, site};
use anyhow::{Context as _, Result};
use mission::{Setup, campaign};
use protocol::bus::Publication;
use protocol::message::{Model, Severity};
use protocol::{AgentId, Envelope, Message, SimTime, Topic};
use record::files::Reserve;
use record::summary::{MissionSummary, Summariser};
use record::tracks::Tracks;
use record::{ThreadedRecorder, files, kml};
use std::path::{Component, Path, PathBuf};
use std::sync::Arc;
use tasks::mission_record;
use views::report::Report;
use views::site::SiteMap;

/// The outputs of a run, in the order in which people open them.
const NAMES: [&str; 5] = [
    "report.html",
    "tracks.kml",
    "mission.mcap",
    "summary.json",
    "scenario.toml",
];

/// Names the outputs that are in `folder`: on a full disk some are not.
pub fn listed(folder: &Path) -> String {
    let there = NAMES.into_iter().filter(|name| folder.join(name).is_file());
    format!(
        "Outputs in {}: {}",
        folder.display(),
        there.collect::<Vec<_>>().join(", ")
    )
}

/// Points of one track in KML.
pub const TRACK_POINTS: usize = 4000;
/// Shortest time between points of a track in KML, s.
pub const TRACK_INTERVAL_S: f64 = 0.5;

/// Memory that a long mission needs for each vehicle, bytes: track, readings and figures of the report. Measured: 0.8 MB
/// with 250 vehicles.
const BYTES_PER_VEHICLE: u64 = 1 << 20;

/// Checks that the memory suffices for the outputs of a team; without a limit where the system does not state what
/// is free.
///
/// # Errors
/// A team that needs more than is free.
fn check_memory(vehicles: usize, free_bytes: Option<u64>) -> Result<(), Failure> {
    let needed = vehicles as u64 * BYTES_PER_VEHICLE;
    let Some(free) = free_bytes.filter(|free| needed > *free) else {
        return Ok(());
    };
    let gb = |bytes: u64| bytes as f64 / 1e9;
    Err(Failure::usage(format!(
        "a team of {vehicles} vehicles needs about {:.1} GB of memory for its outputs, and {:.1} GB are free; expected at \
         most {} vehicles",
        gb(needed),
        gb(free),
        free / BYTES_PER_VEHICLE
    )))
}

/// Memory that is free for programs, bytes, where the system is Linux.
fn free_memory_bytes() -> Option<u64> {
    let text = std::fs::read_to_string("/proc/meminfo").ok()?;
    let line = text.lines().find_map(|l| l.strip_prefix("MemAvailable:"))?;
    let kib: u64 = line.trim().strip_suffix("kB")?.trim().parse().ok()?;
    Some(kib << 10)
}

/// Space kept for report, tracks and summary, bytes: a report with the maps' code in it takes 5 MB, tracks of a team
/// of a hundred another 5.
const RESERVE_BYTES: usize = 12 << 20;

/// Collects a run's outputs as its messages come.
pub struct Outputs {
    folder: PathBuf,
    /// None once the recording cannot be written any more.
    recorder: Option<ThreadedRecorder>,
    /// Why it cannot.
    failed: Option<String>,
    /// Time of the last message.
    now: SimTime,
    /// Notes so far.
    notes: u64,
    reserve: Option<Reserve>,
    summariser: Summariser,
    report: Report,
    tracks: Tracks,
    /// The model as it was last said.
    model: Option<Box<Model>>,
    site: Arc<SiteMap>,
    setup: Setup,
}

/// A folder for a run that was given none: `out/<mission>-<n>` with the first free n.
pub fn fresh_folder(mission: &str) -> PathBuf {
    (1..)
        .map(|n| Path::new("out").join(format!("{mission}-{n}")))
        .find(|p| !p.exists())
        .unwrap_or_else(|| PathBuf::from("out"))
}

/// Keeps a file that the scenario names beside the written one, where that looks first. A name that leads out
/// of the folder is found where it is.
fn keep(folder: &Path, name: &str, bytes: &[u8]) -> Result<(), Failure> {
    let is_inside = |c: Component<'_>| matches!(c, Component::Normal(_) | Component::CurDir);
    if !Path::new(name).components().all(is_inside) {
        return Ok(());
    }
    let path = folder.join(name);
    if let Some(folder) = path.parent() {
        std::fs::create_dir_all(folder)
            .with_context(|| format!("{}: cannot create the folder", folder.display()))
            .map_err(Failure::Input)?;
    }
    files::write_whole(&path, bytes).map_err(Failure::input)
}

impl Outputs {
    /// Opens the outputs of a run in `folder`.
    ///
    /// # Errors
    /// A folder that holds something (without `force`) or cannot be written.
    pub fn open(
        folder: &Path,
        force: bool,
        setup: &Setup,
        site: Arc<SiteMap>,
    ) -> Result<Self, Failure> {
        check_memory(setup.scenario.vehicles.len(), free_memory_bytes())?;
        files::prepare_folder(folder, force).map_err(Failure::input)?;
        // The scenario first: whatever happens later, it is known what was flown.
        files::write_whole(
            &folder.join("scenario.toml"),
            setup.scenario.to_toml().as_bytes(),
        )
        .map_err(Failure::input)?;
        for (name, bytes) in setup.files.iter() {
            keep(folder, name, bytes)?;
        }
        let recorder = ThreadedRecorder::create(
            &folder.join("mission.mcap"),
            &mission_record::run_info(setup)?,
        )
        .map_err(Failure::input)?;
        let reserve = Reserve::create(folder, RESERVE_BYTES);
        Ok(Self {
            folder: folder.to_owned(),
            recorder: Some(recorder),
            failed: None,
            now: SimTime::ZERO,
            notes: 0,
            reserve: match reserve {
                Ok(reserve) => Some(reserve),
                Err(why) => {
                    eprintln!(
                        "warning: cannot reserve disk space for report, tracks and summary: {why}"
                    );
                    None
                }
            },
            summariser: Summariser::new(campaign::summary_context(setup)?),
            report: Report::new(Arc::clone(&site)),
            tracks: Tracks::new(TRACK_POINTS, TRACK_INTERVAL_S),
            model: None,
            site,
            setup: setup.clone(),
        })
    }

    /// Receives the messages of a tick. If the recording cannot be written, as on a full disk, it warns, and
    /// everything else continues.
    pub fn take(&mut self, said: &[Publication]) {
        for (topic, envelope) in said {
            self.now = self.now.max(envelope.time);
            if let Some(recorder) = &mut self.recorder
                && recorder.record(topic, envelope).is_err()
            {
                self.end_recording();
            }
            self.summariser.take(topic, envelope);
            self.report.take(topic, envelope);
            self.tracks.take(topic, envelope);
            if let Message::Model(model) = &envelope.message {
                self.model = Some(model.clone());
            }
        }
    }

    /// Records an event of the recorder itself at `time`.
    pub fn note(&mut self, time: SimTime, severity: Severity, code: &str, text: &str) {
        self.notes += 1;
        let envelope = Envelope::new(
            AgentId::recorder(),
            self.notes,
            time,
            Message::event(severity, code, text),
        );
        self.take(&[(Topic::Event(AgentId::recorder()), envelope)]);
    }

    /// Writes pending messages to the file, so that a paused run loses none.
    pub fn flush(&mut self) {
        if let Some(recorder) = &mut self.recorder
            && recorder.flush().is_err()
        {
            self.end_recording();
        }
    }

    /// Ends a recording that cannot be written any more.
    fn end_recording(&mut self) {
        // Its thread has the error.
        let why = self.recorder.take().map(|recorder| recorder.finish(None));
        if let Some(Err(why)) = why {
            let why = Failure::from(why).words();
            eprintln!(
                "warning: the recording stopped at {:.0} s of mission time: {why}; the mission continues",
                self.now.s()
            );
            self.failed = Some(why);
        }
    }

    /// Marks the run as real time, which does not repeat bit for bit.
    pub fn is_in_real_time(&mut self) {
        self.report.is_in_real_time();
    }

    /// Ends the recording and writes the other files: as many of them as can be written, and what went wrong.
    pub fn finish(mut self, digest: &str, wall_s: f64) -> (MissionSummary, Result<(), Failure>) {
        let summary = self.summariser.summary(digest, wall_s);
        let mut failed: Vec<String> = Vec::new();
        match self.recorder.take().map(|r| r.finish(Some(digest))) {
            Some(Ok(finished)) => {
                for (key, count) in finished.not_finite {
                    eprintln!(
                        "warning: {count} messages on {key} were not recorded: a number in them was not finite"
                    );
                }
            }
            Some(Err(why)) => failed.push(Failure::from(why).words()),
            None => failed.extend(self.failed.take()),
        }
        drop(self.reserve.take());
        let written = [
            self.write("summary.json", || Ok(summary.to_json())),
            self.write("tracks.kml", || self.tracks_kml(&summary)),
            self.write("report.html", || {
                Ok(reports::html(&self.report.page(&summary)))
            }),
        ];
        let why = written.into_iter().filter_map(Result::err);
        failed.extend(why.map(|why| format!("{why:#}")));
        if failed.is_empty() {
            return (summary, Ok(()));
        }
        let why = anyhow::anyhow!("some outputs are incomplete: {}", failed.join("; "));
        (summary, Err(Failure::Run(why)))
    }

    fn write(&self, name: &str, text: impl FnOnce() -> Result<String>) -> Result<()> {
        Ok(files::write_whole(
            &self.folder.join(name),
            text()?.as_bytes(),
        )?)
    }

    fn tracks_kml(&self, summary: &MissionSummary) -> Result<String> {
        let around = kml::MapFeatures {
            peak: summary.peak.estimate,
            ..site::surroundings(&self.setup)?
        };
        let plume = self
            .model
            .as_ref()
            .map(|model| plume_lines::of(&self.site, model));
        let map = kml::Map {
            start_unix_ns: self.setup.scenario.mission.start_unix_ns(),
            tracks: &self.tracks,
            around: &around,
            plume: &plume.unwrap_or_default().lines,
        };
        Ok(kml::document(&map)?)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_team_that_needs_more_memory_than_is_free_is_refused_with_what_it_needs() {
        let told = check_memory(20_000, Some(8_000_000_000))
            .unwrap_err()
            .words();
        assert!(
            told.contains("20000 vehicles needs about 21.0 GB"),
            "{told}"
        );
        assert!(told.contains("8.0 GB are free"), "{told}");
        assert!(told.contains("at most 7629 vehicles"), "{told}");
        assert!(check_memory(6, Some(8_000_000_000)).is_ok());
        assert!(check_memory(20_000, None).is_ok());
    }
}
