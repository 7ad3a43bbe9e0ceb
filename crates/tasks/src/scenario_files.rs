//! Scenarios and the files they name, from disk.

use crate::{TaskError, measured};
use mission::Setup;
use plume::Gas;
use record::Recording;
use scenario::Scenario;
use std::path::{Path, PathBuf};

/// Reads the scenario at `path` with all the files it names. Those are looked for beside the
/// scenario, in the folder above it and in the working folder.
///
/// # Errors
/// What is wrong in which file, and what was expected.
pub fn load(path: &Path) -> Result<Setup, TaskError> {
    let text = measured::read(path, "scenario")?;
    let folder = path.parent().unwrap_or(Path::new(""));
    from_text(&path.display().to_string(), &text, folder)
}

/// The same of the text of a scenario that is called `name` in messages and would lie in `folder`.
///
/// # Errors
/// As [`load`].
pub fn from_text(name: &str, text: &str, folder: &Path) -> Result<Setup, TaskError> {
    let named = |file: &str| read(file, folder);
    Ok(Setup::load(name, text, &named)?)
}

/// The same, with another seed and another length where given.
///
/// # Errors
/// A length that no mission has.
pub fn changed(
    mut setup: Setup,
    seed: Option<u64>,
    duration_s: Option<f64>,
) -> Result<Setup, TaskError> {
    let mission = &mut setup.scenario.mission;
    mission.seed = seed.unwrap_or(mission.seed);
    mission.duration_s = duration_s.unwrap_or(mission.duration_s);
    if !(1.0..=1e6).contains(&mission.duration_s) {
        let given = mission.duration_s;
        return Err(TaskError::Argument(format!(
            "duration {given}: expected 1 to 1000000 simulated seconds"
        )));
    }
    Ok(setup)
}

/// The same read for `gas`, where one is asked for.
///
/// # Errors
/// A gas that no source of the scenario emits.
pub fn for_gas(setup: Setup, gas: Option<Gas>) -> Result<Setup, TaskError> {
    let Some(gas) = gas else { return Ok(setup) };
    let scenario = setup.scenario.of_gas(gas);
    let scenario =
        scenario.map_err(|why| TaskError::Argument(format!("gas {}: {why}", gas.as_str())))?;
    Ok(Setup { scenario, ..setup })
}

/// The folder that holds `folder`; of the working folder, whose path is empty, the one above it.
fn above(folder: &Path) -> &Path {
    folder.parent().unwrap_or(Path::new(".."))
}

/// Where a file that a scenario in `folder` names may be.
fn places(file: &str, folder: &Path) -> [PathBuf; 3] {
    // The shipped scenarios name `aircraft/x8.toml`, which is beside their folder, not in it.
    let above = above(folder);
    [folder, above, Path::new("")].map(|f| f.join(file))
}

/// Where a file that a scenario in `folder` names is, if it is anywhere.
pub fn find(file: &str, folder: &Path) -> Option<PathBuf> {
    places(file, folder).into_iter().find(|p| p.is_file())
}

/// What the file holds that a scenario in `folder` names.
///
/// # Errors
/// In words, where it is not or cannot be read.
pub fn read(file: &str, folder: &Path) -> Result<Vec<u8>, String> {
    let Some(found) = find(file, folder) else {
        let tried = places(file, folder).map(|p| p.display().to_string());
        return Err(format!("no such file; looked for {}", tried.join(", ")));
    };
    std::fs::read(&found).map_err(|e| format!("cannot read {}: {e}", found.display()))
}

/// The scenario of a recording with the files that it holds; those that it lacks, as keys, are looked for beside it.
///
/// # Errors
/// As [`load`].
pub fn load_recorded(recording: &Recording) -> Result<Setup, TaskError> {
    let (path, info) = (recording.path(), &recording.info);
    let folder = path.parent().unwrap_or(Path::new(""));
    let kept = |file: &str| match info.files.get(file) {
        Some(bytes) => Ok(bytes.clone()),
        None => read(file, folder),
    };
    let name = format!("scenario in {}", path.display());
    Ok(Setup::load(&name, &info.scenario_toml, &kept)?)
}

/// Lets a scenario that was made from the one at `path` name the same files from wherever it is
/// written: those that were found beside that one or above it get their whole path.
pub fn keep_files(scenario: &mut Scenario, path: &Path) {
    let folder = path.parent().unwrap_or(Path::new(""));
    let above = above(folder);
    let keep = |file: &mut String| {
        let found = [folder, above].map(|f| f.join(&*file));
        let found = found.iter().find(|p| p.is_file());
        // What the working folder holds is found from there by its own name.
        if Path::new(&*file).is_file() {
            return;
        }
        if let Some(whole) = found.and_then(|p| p.canonicalize().ok()) {
            *file = whole.display().to_string();
        }
    };
    let vehicles = scenario.vehicles.iter_mut();
    let named = vehicles.flat_map(|v| std::iter::once(&mut v.aircraft).chain(&mut v.signing_key));
    let of_site = scenario.site.terrain.iter_mut();
    named
        .chain(of_site)
        .chain(&mut scenario.weather.series)
        .for_each(keep);
}
