//! What a mission is: the scenario a user writes in TOML, checked once, and the measured
//! observations that go with it.
//!
//! Pure: file contents come in as text. A [`Scenario`] is made by [`Scenario::parse`], which
//! checks every value and names the line of what is wrong and what would be right.
//!
//! - [`tables`]: the TOML tables, one struct each, with units and defaults;
//! - [`check`]: what is refused;
//! - [`reality`]: the stand-ins' own world, as differences from the scenario's;
//! - [`realities`]: other ones, by name;
//! - [`world`]: the plume model that a scenario describes;
//! - [`uncertain`]: the priors of the parameters that the scenario marks as uncertain;
//! - [`contradiction`]: values of a scenario that readings contradict;
//! - [`observations`]: measured rows;
//! - [`weather`]: reported weather;
//! - [`random`]: the streams of random numbers of a run.
//!
//! # Example
//!
//! The smallest scenario has a site and a source; all else has defaults.
//!
//! ```
//! use scenario::Scenario;
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let text = r#"
//! [site]
//! lat_deg = 43.4417
//! lon_deg = -7.8631
//! ground_amsl_m = 340.0
//!
//! [[source]]
//! lat_deg = 43.4417
//! lon_deg = -7.8631
//! stack_height_m = 356.0
//! effective_height_m = 486.0
//! emission_kg_s = 352.0
//!
//! [[mechanism]]
//! id = "mixing-lid"
//! height_m = 700.0
//! "#;
//! let scenario = Scenario::parse("own.toml", text)?;
//! assert!(!scenario.vehicles.is_empty());
//! let model = scenario.dispersion_model()?;
//! assert_eq!(model.spec().mechanisms[0].parameter("height_m"), Some(700.0));
//!
//! // What is wrong is named with its line and with what would be right.
//! let wrong = text.replace("lat_deg = 43.4417", "lat_deg = 434.417");
//! let refused = Scenario::parse("own.toml", &wrong).unwrap_err().to_string();
//! assert!(refused.starts_with("own.toml:3:"), "{refused}");
//!
//! // Measured rows come as CSV; an empty cell is a missing value.
//! let csv = "time_s,platform,lat_deg,lon_deg,alt_amsl_m,co2_ppm\n\
//!            0.0,uav,43.45,-7.85,820,455.5\n\
//!            1.0,uav,43.45,-7.85,821,\n";
//! let observations = scenario::observations::parse(&[("flight.csv", csv)], scenario.gas())?;
//! assert_eq!((observations.rows.len(), observations.readings()), (2, 1));
//! # Ok(())
//! # }
//! ```

pub mod airspace;
pub mod bounds;
pub mod check;
pub mod contradiction;
pub mod emission;
mod gases;
mod ground;
pub mod observations;
pub mod pattern;
pub mod peak;
pub mod random;
pub mod realities;
pub mod reality;
pub mod tables;
pub mod uncertain;
pub mod weather;
pub mod world;

pub use tables::Scenario;

/// Why a scenario was refused.
#[derive(Debug, Clone, thiserror::Error, PartialEq)]
pub enum ScenarioError {
    /// The text is not TOML, or has keys or types that a scenario does not.
    #[error("{file}:{line}:{column}: {why}")]
    Syntax {
        /// File the text came from.
        file: String,
        /// Line, from 1.
        line: usize,
        /// Column, from 1.
        column: usize,
        /// What is wrong and what was expected.
        why: String,
    },
    /// A value cannot be.
    #[error("{file}:{line}:{column}: {key} = {found}: expected {expected}")]
    Value {
        /// File the text came from.
        file: String,
        /// Line, from 1; 0 where the key is not in the text.
        line: usize,
        /// Column, from 1.
        column: usize,
        /// Dotted key.
        key: String,
        /// The value found.
        found: String,
        /// What would be right.
        expected: String,
    },
    /// Realities that cannot hold together.
    #[error("reality '{names}': {one} and {other} exclude each other; expected one of them, once")]
    Realities {
        /// As they were asked for.
        names: String,
        /// One.
        one: &'static str,
        /// The other.
        other: &'static str,
    },
    /// An unknown reality.
    #[error("reality '{name}': unknown; expected one of {known}, or several joined by +")]
    Reality {
        /// The name.
        name: String,
        /// The names there are.
        known: String,
    },
}

/// One-based line and column of a byte offset in `text`.
pub(crate) fn line_and_column(text: &str, offset: usize) -> (usize, usize) {
    let before = &text[..offset.min(text.len())];
    let line = before.matches('\n').count() + 1;
    let column = before.rsplit('\n').next().map_or(0, |l| l.chars().count()) + 1;
    (line, column)
}
