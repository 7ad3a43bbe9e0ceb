//! What is wrong with raw data, as `gap.json` and `calibration.json` say it.

use serde::Serialize;

/// What is wrong with raw data.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Flaw {
    /// The reading stands still.
    Frozen,
    /// The reading hits a ceiling.
    Clipped,
    /// Readings are missing.
    Gap,
    /// Values that cannot be, or single ones far off.
    Outlier,
    /// A unit, the order of coordinates, or the sense of a direction looks wrong.
    Unit,
}

/// A stretch of raw data with a flaw; what is flawed is left out and does not alone make a verdict.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct DataQuality {
    /// Platform.
    pub platform: String,
    /// The flaw.
    pub kind: Flaw,
    /// From, s.
    pub from_s: f64,
    /// To, s.
    pub to_s: f64,
    /// What was seen, in words.
    pub message: String,
}
