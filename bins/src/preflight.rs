//! The check before take-off, as a program shows it.

use crate::Failure;
use mission::Setup;

/// Checks a mission before take-off: warnings go to standard error.
///
/// # Errors
/// What refuses the mission, all of it.
pub fn check(setup: &Setup) -> Result<(), Failure> {
    for warning in tasks::preflight::check(setup).map_err(Failure::input)? {
        eprintln!("warning: before take-off: {warning}");
    }
    Ok(())
}
