//! What is in the air and what a sensor reads of it.
//!
//! The base is the Gaussian plume with Briggs' (1973) spread; every departure from it is a
//! *mechanism* ([`mechanism`]) with an id, parameters and a sign convention, so that a finding
//! about measured data is at once an extension of the simulator. The same [`field::DispersionModel`]
//! serves the simulation (one point at a time) and the analysis of data (a whole
//! [`track::Track`] at a time); [`batch`] evaluates it at many places for maps.
//!
//! Pure: no clock, file, socket, environment or global random number. Time and random
//! generators are arguments; results are repeatable bit for bit.
//!
//! Units are SI inside; concentrations that people read are mole fractions in ppm.

pub mod effects;
pub mod field;
mod lag;
pub mod mechanism;
pub mod rise;
mod sample_points;
pub mod score;
pub mod sensor;
pub mod sigma;
pub mod stability;
pub mod track;
pub mod units;

pub use field::batch::{self, PlaceColumns};
pub use field::puffs::{self, WindHistory};
pub use field::{DispersionModel, DispersionSpec, Place, SourceSpec, Strength};
pub use mechanism::{Mechanism, MechanismId};
pub use sensor::{Sensor, SensorSpec};
pub use units::Gas;

/// What this crate refuses: what, where, and what would be right.
#[derive(Debug, thiserror::Error, PartialEq)]
pub enum PlumeError {
    /// A quantity is outside the range in which the model holds.
    #[error("{what} is {value}; expected {expected}")]
    OutOfRange {
        /// The quantity, with its unit.
        what: String,
        /// The value that came in.
        value: f64,
        /// What would be right.
        expected: String,
    },
    /// A model has no source.
    #[error("the world has no source; expected at least one")]
    NoSource,
    /// A mechanism id is not in the catalogue.
    #[error("mechanism id \"{id}\" is not in the catalogue; expected one of: {known}")]
    UnknownMechanism {
        /// The id that came in.
        id: String,
        /// All ids of the catalogue, separated by commas.
        known: String,
    },
    /// A mechanism has no parameter of this name.
    #[error("mechanism \"{id}\" has no parameter \"{name}\"; expected: {known}")]
    UnknownParameter {
        /// The mechanism.
        id: &'static str,
        /// The name that came in.
        name: String,
        /// The names it has, separated by commas.
        known: String,
    },
    /// A mechanism lacks a parameter that has no default.
    #[error("mechanism \"{id}\" needs the parameter \"{name}\" ({unit})")]
    MissingParameter {
        /// The mechanism.
        id: &'static str,
        /// The parameter.
        name: &'static str,
        /// Its unit.
        unit: &'static str,
    },
    /// Columns or rows that belong together differ in number or order.
    #[error("{what}: {problem}")]
    Shape {
        /// What was being built.
        what: &'static str,
        /// What is wrong with it.
        problem: String,
    },
}

/// Returns `value` if it is finite and inside `[low, high]`, else says what was expected.
pub(crate) fn in_range(what: &str, value: f64, low: f64, high: f64) -> Result<f64, PlumeError> {
    if value.is_finite() && value >= low && value <= high {
        return Ok(value);
    }
    Err(PlumeError::OutOfRange {
        what: what.to_string(),
        value,
        expected: format!("{low} to {high}"),
    })
}
