//! Scenarios and the files they name, from disk, as a program wants them.

use crate::{Failure, ranges};
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

/// Options that replace values of a mission's scenario.
#[derive(Debug, Clone, clap::Args)]
#[command(next_help_heading = "Mission")]
pub struct MissionOptions {
    /// Seed of all random numbers, 0 to 2^63 - 1; all processes of a mission need the same one [default: the scenario's]
    #[arg(long, value_name = "N", value_parser = ranges::seed)]
    pub seed: Option<u64>,
    /// Length and gas
    #[command(flatten)]
    pub length_and_gas: LengthAndGas,
}

/// The same without the seed, for many missions of one scenario.
#[derive(Debug, Clone, clap::Args)]
#[command(next_help_heading = "Mission")]
pub struct LengthAndGas {
    /// Length of a mission, 1 to 1000000 simulated s [default: the scenario's]
    #[arg(long, value_name = "S", value_parser = ranges::duration_s)]
    pub duration: Option<f64>,
    /// Gas that the sensors measure: co2, ch4, n2o and so on, or one that the scenario defines [default:
    /// that of the first source]
    #[arg(long, value_name = "GAS")]
    pub gas: Option<Gas>,
}

impl MissionOptions {
    /// Loads a scenario and replaces the given values.
    ///
    /// # Errors
    /// As [`LengthAndGas::setup`].
    pub fn setup(&self, scenario: &Path) -> Result<Setup, Failure> {
        self.length_and_gas.setup(scenario, self.seed)
    }
}

impl LengthAndGas {
    /// Loads a scenario and replaces the given values and the `seed`.
    ///
    /// # Errors
    /// As [`load`]; also a length outside the scenario's range, or a gas that no source emits.
    pub fn setup(&self, scenario: &Path, seed: Option<u64>) -> Result<Setup, Failure> {
        let setup = scenario_files::changed(load(scenario)?, seed, self.duration);
        for_gas(setup.map_err(option)?, self.gas)
    }
}

/// Sets the gas that the sensors of a mission measure, if one is given: `--gas`.
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
