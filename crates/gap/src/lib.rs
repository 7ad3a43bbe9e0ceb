//! The reality gap: given measured data, what the simulation gets wrong, what causes it, how to
//! extend the model, and what that gains; or that the data do not tell.
//!
//! - [`plume`]: concentrations along tracks against the plume model;
//! - [`tracer`]: fixed samplers over many trials of a tracer experiment;
//! - [`verdict`]: the answer, as `gap.json` has it.
//!
//! Pure: no clock, file, socket, environment or global random number; seeds are arguments, and
//! results do not depend on the number of threads.

pub mod flight;
pub mod plume;
pub mod tracer;
pub mod verdict;

/// What this crate refuses: what, where, and what would be right.
#[derive(Debug, thiserror::Error)]
pub enum GapError {
    /// The data cannot be analysed at all.
    #[error("{what}: {problem}; expected {expected}")]
    Data {
        /// What was looked at.
        what: String,
        /// What is wrong with it.
        problem: String,
        /// What would be right.
        expected: String,
    },
    /// The plume model refused a value.
    #[error(transparent)]
    Plume(#[from] ::plume::PlumeError),
    /// The site or its air refused a value.
    #[error(transparent)]
    Air(#[from] air::AirError),
}
