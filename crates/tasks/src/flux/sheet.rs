//! What a person fills into the sheet of a measurement.

use crate::TaskError;
use serde::Deserialize;

/// The names and numbers of a sheet (TOML), all of which may be left out: an empty line is printed then.
#[derive(Debug, Clone, Default, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Sheet {
    /// Name of the site.
    pub site: String,
    /// Who operates the site.
    pub operator: String,
    /// Identifier of the site, such as its permit.
    pub site_id: String,
    /// Who measured.
    pub measured_by: String,
    /// Date and time of the measurement, with time zone.
    pub time: String,
    /// Analyser: maker, model and serial number.
    pub instrument: String,
    /// Date of the last calibration of the analyser, and the gas used.
    pub calibration: String,
    /// Anemometer: maker, model and serial number.
    pub anemometer: String,
    /// Vehicle or mast that carried the instrument.
    pub platform: String,
    /// State of the site: in operation, shut down, flaring.
    pub operation: String,
    /// Remarks.
    pub remarks: String,
    /// Who signs.
    pub signed_by: String,
}

impl Sheet {
    /// Reads a sheet.
    ///
    /// # Errors
    /// A text that is no sheet, with the line and what is expected.
    pub fn parse(file: &str, text: &str) -> Result<Self, TaskError> {
        toml::from_str(text).map_err(|e| TaskError::Argument(format!("{file}: {e}")))
    }

    /// Label and text of each field, in the order of the sheet.
    pub fn fields(&self) -> [(&'static str, &str); 12] {
        [
            ("Site", &self.site),
            ("Operator", &self.operator),
            ("Site identifier", &self.site_id),
            ("Measured by", &self.measured_by),
            ("Date and time", &self.time),
            ("Analyser", &self.instrument),
            ("Calibration", &self.calibration),
            ("Anemometer", &self.anemometer),
            ("Platform", &self.platform),
            ("State of operation", &self.operation),
            ("Remarks", &self.remarks),
            ("Signed by", &self.signed_by),
        ]
    }
}
