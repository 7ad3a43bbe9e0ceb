//! What a run leaves behind: recording, tracks, summary, report and resolved scenario.

use crate::{Failure, plume_lines, site};
use anyhow::{Context as _, Result};
use mission::{Setup, campaign};
use protocol::Message;
use protocol::bus::Publication;
use protocol::message::Model;
use record::summary::{MissionSummary, Summariser};
use record::tracks::Tracks;
use record::{ThreadedRecorder, files, kml};
use std::path::{Component, Path, PathBuf};
use std::sync::Arc;
use tasks::mission_record;
use views::report::Report;
use views::site::SiteMap;

/// Points of one track in KML.
pub const TRACK_POINTS: usize = 4000;
/// Shortest time between points of a track in KML, s.
pub const TRACK_INTERVAL_S: f64 = 0.5;

/// Collects a run's outputs as its messages come.
pub struct Outputs {
    folder: PathBuf,
    recorder: ThreadedRecorder,
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
            .with_context(|| format!("{}: cannot make the folder", folder.display()))
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
        Ok(Self {
            folder: folder.to_owned(),
            recorder,
            summariser: Summariser::new(campaign::summary_context(setup)?),
            report: Report::new(Arc::clone(&site)),
            tracks: Tracks::new(TRACK_POINTS, TRACK_INTERVAL_S),
            model: None,
            site,
            setup: setup.clone(),
        })
    }

    /// Takes in what was said in a tick.
    ///
    /// # Errors
    /// The recording cannot be written.
    pub fn take(&mut self, said: &[Publication]) -> Result<()> {
        for (topic, envelope) in said {
            self.recorder.record(topic, envelope)?;
            self.summariser.take(topic, envelope);
            self.report.take(topic, envelope);
            self.tracks.take(topic, envelope);
            if let Message::Model(model) = &envelope.message {
                self.model = Some(model.clone());
            }
        }
        Ok(())
    }

    /// Hands to the file what waits, so that a paused run loses nothing.
    ///
    /// # Errors
    /// The recording cannot be written.
    pub fn flush(&mut self) -> Result<()> {
        Ok(self.recorder.flush()?)
    }

    /// The run is in real time: what is said of its repeating is another thing.
    pub fn is_in_real_time(&mut self) {
        self.report.is_in_real_time();
    }

    /// The summary so far.
    pub fn summary(&self, digest: &str, wall_s: f64) -> MissionSummary {
        self.summariser.summary(digest, wall_s)
    }

    /// Ends the recording and writes the other files.
    ///
    /// # Errors
    /// A file cannot be written; those written before stay.
    pub fn finish(self, digest: &str, wall_s: f64) -> Result<MissionSummary> {
        let summary = self.summariser.summary(digest, wall_s);
        let finished = self.recorder.finish(Some(digest))?;
        for (key, count) in finished.not_finite {
            eprintln!(
                "warning: {count} messages on {key} held no finite number and were not recorded"
            );
        }
        let write = |name: &str, text: &str| {
            files::write_whole(&self.folder.join(name), text.as_bytes())
                .context("cannot write the outputs")
        };
        write("summary.json", &summary.to_json())?;
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
        write("tracks.kml", &kml::document(&map)?)?;
        write("report.html", &self.report.html(&summary))?;
        Ok(summary)
    }
}
