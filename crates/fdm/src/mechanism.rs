//! Named extensions of an aircraft: what may differ between the aircraft of the file and the one
//! that flies, with the sizes that physics allows.
//!
//! The same list serves the simulation (a `[[mechanism]]` of an aircraft file or scenario changes
//! the aircraft that flies) and the search for the cause of a gap (each mechanism is a
//! hypothesis with a prior). What each does to an aircraft stands in [`crate::extended`].

mod catalogue;

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use crate::error::{FdmError, refuse};

pub use catalogue::{ActsOn, CATALOGUE, MechanismSpec, ParameterSpec, spec};

/// One mechanism with its parameters, as in a `[[mechanism]]` table; parameters left out are
/// neutral.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Mechanism {
    /// Name in [`CATALOGUE`].
    pub id: String,
    /// Parameters by name.
    #[serde(flatten)]
    pub parameters: BTreeMap<String, f64>,
}

impl Mechanism {
    /// A mechanism with all parameters in the catalogue's order.
    ///
    /// # Errors
    /// [`FdmError::UnknownMechanism`], or [`FdmError::Refused`] for a value out of range.
    pub fn with_values(id: &str, values: &[f64]) -> Result<Self, FdmError> {
        let spec = spec(id).ok_or_else(|| unknown(id))?;
        let parameters = spec
            .parameters
            .iter()
            .zip(values)
            .map(|(parameter, value)| (parameter.name.to_owned(), *value))
            .collect();
        let mechanism = Self {
            id: id.to_owned(),
            parameters,
        };
        mechanism.values()?;
        Ok(mechanism)
    }

    /// The parameters in the catalogue's order (at most three), checked.
    ///
    /// # Errors
    /// [`FdmError::UnknownMechanism`] for an id or parameter that is not in the catalogue,
    /// [`FdmError::Refused`] for a value out of range.
    pub fn values(&self) -> Result<[f64; 3], FdmError> {
        let spec = spec(&self.id).ok_or_else(|| unknown(&self.id))?;
        if let Some(unknown_name) = self
            .parameters
            .keys()
            .find(|name| spec.parameters.iter().all(|p| p.name != name.as_str()))
        {
            return Err(unknown(&format!("{}.{unknown_name}", self.id)));
        }
        let mut values = [0.0; 3];
        for (value, parameter) in values.iter_mut().zip(spec.parameters) {
            let given = self.parameters.get(parameter.name).copied();
            *value = given.unwrap_or(parameter.neutral);
            if !(*value >= parameter.low && *value <= parameter.high) {
                return Err(refuse(
                    &format!("{}.{}", self.id, parameter.name),
                    *value,
                    format!("{} to {} {}", parameter.low, parameter.high, parameter.unit),
                ));
            }
        }
        Ok(values)
    }
}

fn unknown(id: &str) -> FdmError {
    FdmError::UnknownMechanism {
        id: id.to_owned(),
        known: CATALOGUE
            .iter()
            .map(|spec| spec.id)
            .collect::<Vec<_>>()
            .join(", "),
    }
}
