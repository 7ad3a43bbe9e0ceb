//! Ranges of the numbers that come in from outside.

use crate::error::{FdmError, refuse};

/// Refuses what is not a finite number above zero.
pub(crate) fn positive(key: &str, value: f64) -> Result<(), FdmError> {
    if value.is_finite() && value > 0.0 {
        Ok(())
    } else {
        Err(refuse(key, value, "a number above 0"))
    }
}

/// Refuses what is not a finite number below zero.
pub(crate) fn negative(key: &str, value: f64, why: &str) -> Result<(), FdmError> {
    if value.is_finite() && value < 0.0 {
        Ok(())
    } else {
        Err(refuse(key, value, format!("a number below 0 ({why})")))
    }
}

/// Refuses what is not finite and inside `[low, high]`.
pub(crate) fn within(key: &str, value: f64, low: f64, high: f64) -> Result<(), FdmError> {
    if value.is_finite() && value >= low && value <= high {
        Ok(())
    } else {
        Err(refuse(key, value, format!("{low} to {high}")))
    }
}
