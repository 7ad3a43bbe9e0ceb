//! What stays of a mission: its recording, tracks and summary, written to files and read back.
//!
//! Files are this crate's business; it knows no socket and no async runtime.
//!
//! - [`recorder`]: every message on the bus into an MCAP file that a killed program leaves
//!   readable;
//! - [`recording`]: such a file read back, also one cut short, with the run's digest;
//! - [`observations`]: what real vehicles read, as rows for calibration and gap analysis;
//! - [`kml`], [`kmz`]: a mission for map viewers, with [`contour`] lines of the plume, cut at the [`antimeridian`];
//! - [`tracks`]: tracks coloured by reading for KML, the report and the page;
//! - [`summary`]: `summary.json`, and the same in words;
//! - [`campaign`]: many missions, kept as they are flown, and what they show beside each other;
//! - [`export`]: what was flown, in formats of other people's tools;
//! - [`flight_plan`]: plans for aircraft that Plumage does not command;
//! - [`gaps`]: which messages did not come;
//! - [`files`]: output folders, and files renamed into place.
//!
//! # Example
//!
//! ```
//! use protocol::key::Name;
//! use protocol::message::{Message, Severity};
//! use protocol::{AgentId, Envelope, SimTime, Topic};
//! use record::{Recorder, RunInfo, read_mcap};
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let path = std::env::temp_dir().join(format!("plumage-doc-{}.mcap", std::process::id()));
//! let info = RunInfo {
//!     mission: Name::new("try")?,
//!     scenario_toml: String::new(),
//!     gas: plume::Gas::Co2,
//!     files: Default::default(),
//!     start_unix_ns: None,
//!     state_hz: None,
//!     seed: 1,
//!     versions: Default::default(),
//! };
//! let mut recorder = Recorder::create(&path, &info)?;
//! let topic = Topic::Event(AgentId::sc());
//! let envelope = Envelope {
//!     sender: AgentId::sc(),
//!     sequence: 1,
//!     time: SimTime::from_s(0.5),
//!     message: Message::event(Severity::Info, "hello", "anybody there?"),
//! };
//! recorder.record(&topic, &envelope)?;
//! recorder.finish(None)?;
//!
//! let recording = read_mcap(&path)?;
//! assert_eq!(recording.info, info);
//! let messages: Vec<_> = recording.in_order()?.collect::<Result<_, _>>()?;
//! assert_eq!(messages, [(topic, envelope)]);
//! # std::fs::remove_file(path)?;
//! # Ok(())
//! # }
//! ```

pub mod antimeridian;
mod appended;
pub mod campaign;
pub mod colour;
pub mod contour;
pub mod export;
pub mod files;
pub mod flight_plan;
pub mod gaps;
pub mod intervals;
pub mod kml;
pub mod kmz;
pub mod observations;
pub mod recorder;
pub mod recording;
pub mod summary;
pub mod text;
pub mod tracks;

pub use recorder::{Recorder, RecordingTotals, RunInfo, ThreadedRecorder};
pub use recording::{Recording, read_mcap};

use std::path::PathBuf;

/// Why something could not be recorded or read back.
#[derive(Debug, thiserror::Error)]
pub enum RecordError {
    /// A file or folder could not be made, read or written.
    #[error("{path}: cannot {what}: {source}")]
    File {
        /// The file or folder.
        path: PathBuf,
        /// What was tried.
        what: &'static str,
        /// What the system said.
        source: std::io::Error,
    },
    /// An output exists that would be overwritten.
    #[error("{path}: {what}; expected an empty or new folder, or --force to overwrite")]
    Exists {
        /// The file or folder.
        path: PathBuf,
        /// What is there.
        what: &'static str,
    },
    /// A folder that cannot take the missions of a campaign, or holds none.
    #[error(
        "{path}: {why}; expected a folder of the same campaign, an empty or a new one, or --force"
    )]
    Campaign {
        /// The folder or a file in it.
        path: PathBuf,
        /// What is there.
        why: String,
    },
    /// The file is no recording of a mission.
    #[error("{path}: {why}; expected an MCAP recording written by Plumage")]
    NotARecording {
        /// The file.
        path: PathBuf,
        /// What was met.
        why: String,
    },
    /// A message in a recording cannot be read.
    #[error("{path}: message {index} on {key}: {why}")]
    Message {
        /// The file.
        path: PathBuf,
        /// Number of the message in the file, from 1.
        index: u64,
        /// Its channel.
        key: String,
        /// What was met.
        why: String,
    },
    /// Not all messages were recorded, and the run left no digest.
    #[error(
        "{path}: no digest; states are recorded at {state_hz} Hz only (record.state_hz), and the run has left none at the \
         end of the file"
    )]
    NoDigest {
        /// The file.
        path: PathBuf,
        /// Rate of the recorded states, Hz.
        state_hz: f64,
    },
    /// The MCAP writer failed.
    #[error("{path}: cannot record: {source}")]
    Mcap {
        /// The file.
        path: PathBuf,
        /// What it said.
        source: mcap::McapError,
    },
    /// The recorder's thread is gone.
    #[error("{path}: the recorder stopped early")]
    Stopped {
        /// The file.
        path: PathBuf,
    },
    /// The recording holds nothing that a real vehicle has read.
    #[error(
        "{path}: no reading of a real vehicle; expected at least one va/<id>/reading of kind real"
    )]
    NothingReal {
        /// The file.
        path: PathBuf,
    },
    /// The recording holds nothing that anybody has read.
    #[error("{path}: no reading; expected at least one va/<id>/reading")]
    NothingRead {
        /// The file.
        path: PathBuf,
    },
    /// What was flown could not be written in another format.
    #[error("cannot export: {0}")]
    Export(String),
    /// KML could not be written.
    #[error("KML: {0}")]
    Kml(String),
    /// A flight plan that its format cannot hold.
    #[error("{0}")]
    Plan(String),
}
