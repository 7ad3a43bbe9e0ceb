//! When time 0 is.
//!
//! Trends and drifts count from time 0, which a mission has at its start. A log may count from
//! midnight or from 1970 instead; a drift of the wind by a degree an hour would then be one of ten
//! or of half a million degrees all along. Such a record is counted from its first row.

use std::borrow::Cow;

use super::{ObservationError, Observations};

/// A record that begins so much after time 0, or before it, counts from elsewhere, s.
const NEAR_S: f64 = 3600.0;
/// A record longer than this is none of one occasion, s: 400 days, more than a year of a network.
const LONGEST_S: f64 = 400.0 * 86_400.0;

impl Observations {
    /// These observations counted from their own beginning where time 0 is not near it, with a notice,
    /// and that beginning in their own time, s; zero where they stay as they are.
    ///
    /// # Errors
    /// Times that are 400 days and more apart.
    pub fn counted_from_near_zero(&self) -> Result<(Cow<'_, Self>, f64), ObservationError> {
        let times = || self.rows.iter().map(|r| r.time_s);
        let first_s = times().fold(f64::INFINITY, f64::min);
        let last_s = times().fold(f64::NEG_INFINITY, f64::max);
        if last_s - first_s > LONGEST_S {
            return Err(ObservationError::TimeSpan {
                from_s: first_s.to_string(),
                to_s: last_s.to_string(),
            });
        }
        if !first_s.is_finite() || (0.0..NEAR_S).contains(&first_s) {
            return Ok((Cow::Borrowed(self), 0.0));
        }
        let mut own = self.clone();
        own.rows.iter_mut().for_each(|r| r.time_s -= first_s);
        own.notices.push(format!(
            "time_s begins at {first_s:.0} s; trends and drifts count from there"
        ));
        Ok((Cow::Owned(own), first_s))
    }
}
