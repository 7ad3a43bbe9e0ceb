//! Logs as people have them, read from files by a mapping.

use crate::Failure;
use anyhow::Context as _;
use import::map::{LogMap, Map};
use import::run::{Report, Request};
use import::{ImportError, run};
use std::fs::File;
use std::io::{Read, Write};
use std::path::{Path, PathBuf};

/// Reads a mapping file; an empty mapping without one.
///
/// # Errors
/// A file that cannot be read or is no mapping, with its line.
pub fn map(file: Option<&Path>) -> Result<Map, Failure> {
    let Some(file) = file else {
        return Ok(Map::default());
    };
    let text = tasks::measured::read(file, "mapping file").map_err(Failure::input)?;
    Map::parse(&file.display().to_string(), &text).map_err(Failure::input)
}

/// Reads `files` with what is stated in `map` and, before it, in `stated`, and writes Plumage's file into what
/// `out` makes. `offset_s` is added to the times of readings that are joined with a track. Rows that run back in time are sorted, in memory.
///
/// # Errors
/// Logs that cannot be read, with what to state; outputs that cannot be written.
pub fn read<W: Write>(
    files: &[PathBuf],
    map: &Map,
    stated: &LogMap,
    offset_s: Option<f64>,
    mut out: impl FnMut() -> Result<W, Failure>,
) -> Result<(Report, W), Failure> {
    let names: Vec<String> = files.iter().map(|f| f.display().to_string()).collect();
    let open = |index: usize| -> std::io::Result<Box<dyn Read>> {
        Ok(Box::new(File::open(&files[index])?))
    };
    let request = |sorts| Request {
        names: &names,
        open: &open,
        map,
        stated,
        offset_s,
        sorts,
    };
    let mut writer = out()?;
    match run::run(&request(false), &mut writer) {
        Ok(report) => Ok((report, writer)),
        Err(ImportError::Disorder { .. }) => {
            drop(writer);
            let mut writer = out()?;
            let report = run::run(&request(true), &mut writer).map_err(Failure::input)?;
            Ok((report, writer))
        }
        Err(error) => Err(Failure::input(error)),
    }
}

/// What `read` gives of `files` by the mapping file `map`, as CSV text with what was found and assumed.
///
/// # Errors
/// As `read`.
pub fn text(files: &[PathBuf], mapping: &Path) -> Result<(String, Vec<String>), Failure> {
    let map = map(Some(mapping))?;
    let (report, bytes) = read(files, &map, &LogMap::default(), None, || Ok(Vec::new()))?;
    let text = String::from_utf8(bytes).context("the imported rows are not valid UTF-8")?;
    Ok((text, report.notices))
}
