//! The check before take-off, in words.

use crate::TaskError;
use mission::Setup;
use mission::preflight::{self, Verdict};

/// Findings of one kind that are listed; a team of hundreds may have one for each vehicle.
const LISTED: usize = 20;

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
        let more = found.len().saturating_sub(LISTED);
        let listed = found.into_iter().take(LISTED);
        let listed = listed.map(|f| format!("{}: {}", f.about, f.words));
        let more = (more > 0).then(|| format!("and {more} more"));
        listed.chain(more).collect()
    };
    if refused.is_empty() {
        return Ok(words(warned));
    }
    Err(TaskError::Refused(words(refused).join("; ")))
}
