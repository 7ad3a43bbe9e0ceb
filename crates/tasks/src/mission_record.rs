//! What a recording says of its run.

use crate::TaskError;
use mission::Setup;
use protocol::key::Name;
use record::RunInfo;
use std::collections::BTreeMap;

/// What the recording of a run says of it.
///
/// # Errors
/// A mission's name that cannot be part of a key.
pub fn run_info(setup: &Setup) -> Result<RunInfo, TaskError> {
    Ok(RunInfo {
        mission: Name::new(&setup.scenario.mission.name)?,
        scenario_toml: setup.scenario.to_toml(),
        gas: setup.scenario.gas(),
        files: BTreeMap::clone(&setup.files),
        start_unix_ns: setup.scenario.mission.start_unix_ns(),
        state_hz: setup.scenario.record.state_hz,
        seed: setup.scenario.mission.seed,
        versions: BTreeMap::from([("plumage".to_owned(), env!("CARGO_PKG_VERSION").to_owned())]),
    })
}
