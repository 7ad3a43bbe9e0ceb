//! An aircraft from and to the text of its TOML file.

use crate::aircraft::Aircraft;
use crate::error::FdmError;
use crate::extended::ExtendedAircraft;
use std::sync::Arc;

impl Aircraft {
    /// Reads and checks an aircraft file. `file_name` is for messages only.
    ///
    /// # Errors
    /// [`FdmError::Syntax`] for text that is not such a file (unknown or missing key, wrong type),
    /// [`FdmError::Refused`] for a number no aircraft of this model can have, both with the line.
    pub fn from_toml(file_name: &str, text: &str) -> Result<Self, FdmError> {
        let table: Option<toml::Table> = toml::from_str(text).ok();
        if table.is_some_and(|table| table.contains_key("type")) {
            return Err(FdmError::NotOfMultirotors {
                aircraft: file_name.to_owned(),
                what: "this analysis".to_owned(),
            });
        }
        let aircraft: Arc<Self> = toml::from_str(text)
            .map(Arc::new)
            .map_err(|error| FdmError::syntax(file_name, text, &error))?;
        aircraft
            .check()
            .and_then(|()| ExtendedAircraft::of(&aircraft))
            .map_err(|error| error.located_in(file_name, text))?;
        Ok(Arc::unwrap_or_clone(aircraft))
    }

    /// The aircraft as a TOML file.
    ///
    /// # Errors
    /// [`FdmError::Unwritable`] when a value has no TOML form (none of a checked aircraft's).
    pub fn to_toml(&self) -> Result<String, FdmError> {
        toml::to_string(self).map_err(|error| FdmError::Unwritable(error.to_string()))
    }
}
