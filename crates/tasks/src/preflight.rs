//! The check before take-off, in words.

use crate::TaskError;
use mission::Setup;
use mission::preflight::{self, Verdict};

/// Checks a mission before take-off: what is doubtful about it.
///
/// # Errors
/// What refuses the mission, all of it.
pub fn check(setup: &Setup) -> Result<Vec<String>, TaskError> {
    let findings = preflight::check(setup)?;
    let (refused, warned): (Vec<_>, Vec<_>) = findings
        .into_iter()
        .partition(|f| f.verdict == Verdict::Refused);
    let words = |found: Vec<preflight::Finding>| -> Vec<String> {
        let words = found.into_iter();
        words.map(|f| format!("{}: {}", f.about, f.words)).collect()
    };
    if refused.is_empty() {
        return Ok(words(warned));
    }
    Err(TaskError::Refused(words(refused).join("; ")))
}
