//! What this crate refuses, and the ranges of settings.

/// What this crate refuses, with what would be right.
#[derive(Debug, thiserror::Error, PartialEq)]
pub enum CseaError {
    /// A setting is outside the range in which the method holds.
    #[error("search.{what} is {value}; expected {expected}")]
    Setting {
        /// The setting.
        what: &'static str,
        /// What came in.
        value: f64,
        /// What would be right.
        expected: &'static str,
    },
    /// No strategy has this name.
    #[error("search.strategy is \"{name}\"; expected one of {known}")]
    UnknownStrategy {
        /// The name that came in.
        name: String,
        /// Every name that would be right.
        known: String,
    },
    /// The search box is empty or no feasible place was found in it.
    #[error("search domain: {0}")]
    Domain(String),
    /// The plume that is supposed to be is none.
    #[error("the plume model of the search: {0}")]
    Plume(String),
    /// A sample that is not finite.
    #[error("sample is not finite; expected finite metres and a finite value")]
    NotFinite,
}

/// The value of a setting that lies in its range.
pub(crate) fn setting(
    what: &'static str,
    value: f64,
    low: f64,
    high: f64,
    expected: &'static str,
) -> Result<f64, CseaError> {
    if value.is_finite() && (low..=high).contains(&value) {
        Ok(value)
    } else {
        Err(CseaError::Setting {
            what,
            value,
            expected,
        })
    }
}
