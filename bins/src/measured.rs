//! Measured observations from files: CSV, or recordings wherever CSV is taken.

use crate::Failure;
use anyhow::Context as _;
use scenario::observations::{self, Observations};
use std::path::{Path, PathBuf};

/// Readings of a recording are taken at most this often, s: closer ones say little more.
const RECORDING_INTERVAL_S: f64 = 1.0;

/// Reads all `files` as one set of observations.
///
/// # Errors
/// A file that cannot be read or holds no observations, with line and column.
pub fn load(files: &[PathBuf]) -> Result<Observations, Failure> {
    let mut texts = Vec::with_capacity(files.len());
    let mut notices = Vec::new();
    for file in files {
        let (text, more) = text_of(file)?;
        texts.push((file.display().to_string(), text));
        notices.extend(more);
    }
    let named: Vec<(&str, &str)> = texts
        .iter()
        .map(|(n, t)| (n.as_str(), t.as_str()))
        .collect();
    let mut all = observations::parse(&named).map_err(Failure::input)?;
    all.notices.extend(notices);
    Ok(all)
}

fn text_of(file: &Path) -> Result<(String, Vec<String>), Failure> {
    if file.extension().is_some_and(|e| e == "mcap") {
        let recording = record::read_mcap(file).map_err(Failure::input)?;
        let rows = record::observations::of_recording(&recording, RECORDING_INTERVAL_S)
            .map_err(Failure::input)?;
        return Ok((rows.to_csv(), rows.notices));
    }
    let text = std::fs::read_to_string(file)
        .with_context(|| format!("{}: cannot read the observations", file.display()))
        .map_err(Failure::Input)?;
    Ok((text, Vec::new()))
}

/// Tells what was noticed in the data, on standard error.
pub fn tell(notices: &[String]) {
    for notice in notices {
        eprintln!("note: {notice}");
    }
}
