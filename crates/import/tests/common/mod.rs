//! Logs in memory, imported as files are.

#![allow(
    clippy::unwrap_used,
    dead_code,
    reason = "a test may fail by a panic, and not every test needs all of it"
)]

use import::ImportError;
use import::map::{LogMap, Map};
use import::run::{Report, Request, run};
use std::io::{self, Cursor, Read};

/// What `logs` (names and bytes) give by the mapping file `map`: text and report. Sorted if they have to be.
pub fn import(logs: &[(&str, &[u8])], map: &str) -> Result<(String, Report), ImportError> {
    let map = Map::parse("m.toml", map)?;
    let names: Vec<String> = logs.iter().map(|(name, _)| (*name).to_owned()).collect();
    let bytes: Vec<Vec<u8>> = logs.iter().map(|(_, bytes)| bytes.to_vec()).collect();
    let open = |index: usize| -> io::Result<Box<dyn Read>> {
        Ok(Box::new(Cursor::new(bytes[index].clone())))
    };
    let stated = LogMap::default();
    let request = |sorts| Request {
        names: &names,
        open: &open,
        map: &map,
        stated: &stated,
        offset_s: None,
        sorts,
    };
    let mut out = Vec::new();
    let report = match run(&request(false), &mut out) {
        Err(ImportError::Disorder { .. }) => {
            out.clear();
            run(&request(true), &mut out)?
        }
        other => other?,
    };
    Ok((String::from_utf8(out).unwrap(), report))
}

/// What one log of text gives without a mapping file.
pub fn text(log: &str) -> (String, Report) {
    import(&[("a.csv", log.as_bytes())], "").unwrap()
}

/// Why a log is refused.
pub fn refused(log: &str, map: &str) -> String {
    import(&[("a.csv", log.as_bytes())], map)
        .unwrap_err()
        .to_string()
}
