//! What the commands do, without their options, bars and pages, so that the programs and the Python package do the
//! same and say the same.
//!
//! - [`scenario_files`]: a scenario with the files it names, from disk;
//! - [`measured`]: observations, flights and aircraft, from disk or from text;
//! - [`preflight`]: the check before take-off, in words;
//! - [`gap`]: what the simulation gets wrong about readings, and the scenario with that mended;
//! - [`calibration`]: a scenario corrected by readings;
//! - [`campaign`]: many missions of one scenario;
//! - [`mission_record`]: what a recording says of its run;
//! - [`mission_key`]: the key of a mission, by which its processes know each other's word;
//! - [`loopback`]: whether an address is on this host alone;
//! - [`words`]: an error for people.
//!
//! Files are this crate's business, and for a key one environment variable and the system's random numbers; it knows no clock, no socket
//! and no terminal.

pub mod calibration;
pub mod campaign;
mod extended;
pub mod flights;
pub mod flux;
pub mod gap;
pub mod loopback;
pub mod measured;
pub mod mission_key;
pub mod mission_record;
pub mod preflight;
pub mod scenario_files;
pub mod words;

/// Why a task was not done.
#[derive(Debug, thiserror::Error)]
pub enum TaskError {
    /// A file that cannot be read.
    #[error("{file}: cannot read the {what}")]
    Read {
        /// The file.
        file: String,
        /// What it should hold.
        what: &'static str,
        /// What the system said.
        source: std::io::Error,
    },
    /// A file that is no text.
    #[error("{file}: line {line}: not UTF-8 text; expected the {what} as text in UTF-8")]
    NotText {
        /// The file.
        file: String,
        /// What it should hold.
        what: &'static str,
        /// The line, from 1.
        line: usize,
    },
    /// An invalid argument.
    #[error("{0}")]
    Argument(String),
    /// A table that cannot be written.
    #[error("cannot write the table: {0}")]
    Table(String),
    /// A file or folder of keys that cannot be made.
    #[error("cannot create {} for the mission key", path.display())]
    MakeKey {
        /// Which.
        path: std::path::PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// A system without random numbers.
    #[error("the system provides no random numbers: {0}")]
    Random(String),
    /// What speaks against taking off.
    #[error("rejected before take-off: {0}")]
    Refused(String),
    /// A mission that cannot be flown.
    #[error(transparent)]
    Mission(#[from] mission::MissionError),
    /// A scenario that describes no world.
    #[error(transparent)]
    World(#[from] scenario::world::WorldError),
    /// Observations that cannot be read.
    #[error(transparent)]
    Observations(#[from] scenario::observations::ObservationError),
    /// An aircraft that the simulator refuses.
    #[error(transparent)]
    Aircraft(#[from] fdm::FdmError),
    /// An analysis that cannot be made of these data.
    #[error(transparent)]
    Gap(#[from] ::gap::GapError),
    /// A calibration that cannot be made of these data.
    #[error(transparent)]
    Calibration(#[from] ws::WsError),
    /// A recording that cannot be read.
    #[error(transparent)]
    Record(#[from] record::RecordError),
    /// A name that cannot be part of a key.
    #[error(transparent)]
    Name(#[from] protocol::ProtocolError),
}
