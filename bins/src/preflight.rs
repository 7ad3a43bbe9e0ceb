//! The check before take-off, as a program shows it.

use crate::Failure;
use mission::Setup;
use mission::preflight::{self, Verdict};

/// Checks a mission before take-off: warnings go to standard error.
///
/// # Errors
/// What refuses the mission, all of it.
pub fn check(setup: &Setup) -> Result<(), Failure> {
    let findings = preflight::check(setup).map_err(Failure::input)?;
    let (refused, warned): (Vec<_>, Vec<_>) = findings
        .into_iter()
        .partition(|f| f.verdict == Verdict::Refused);
    for finding in warned {
        eprintln!(
            "warning: before take-off: {}: {}",
            finding.about, finding.words
        );
    }
    if refused.is_empty() {
        return Ok(());
    }
    let words: Vec<String> = refused
        .into_iter()
        .map(|f| format!("{}: {}", f.about, f.words))
        .collect();
    Err(Failure::usage(format!(
        "refused before take-off: {}",
        words.join("; ")
    )))
}
