//! Scenarios and the files they name, from disk, as a program wants them.

use crate::Failure;
use mission::Setup;
use plume::Gas;
use record::Recording;
use std::path::Path;
pub use tasks::scenario_files::{find, keep_files, read};
use tasks::{TaskError, scenario_files};

/// As [`scenario_files::load`].
///
/// # Errors
/// What is wrong in which file, and what was expected.
pub fn load(path: &Path) -> Result<Setup, Failure> {
    scenario_files::load(path).map_err(Failure::input)
}

/// The same, with another seed and another length where given: `--seed`, `--duration`.
///
/// # Errors
/// As [`load`]; also a length that no mission has.
pub fn load_changed(
    path: &Path,
    seed: Option<u64>,
    duration_s: Option<f64>,
) -> Result<Setup, Failure> {
    scenario_files::changed(load(path)?, seed, duration_s).map_err(option)
}

/// The same read for `gas`, where one is asked for: `--gas`.
///
/// # Errors
/// A gas that no source of the scenario emits.
pub fn for_gas(setup: Setup, gas: Option<Gas>) -> Result<Setup, Failure> {
    scenario_files::for_gas(setup, gas).map_err(option)
}

/// The scenario of a recording, as [`scenario_files::load_recorded`].
///
/// # Errors
/// As [`load`].
pub fn load_recorded(recording: &Recording) -> Result<Setup, Failure> {
    scenario_files::load_recorded(recording).map_err(Failure::input)
}

/// An argument that is an option on the command line is named as such.
pub(crate) fn option(error: TaskError) -> Failure {
    match error {
        TaskError::Argument(said) => Failure::usage(format!("--{said}")),
        other => Failure::input(other),
    }
}
