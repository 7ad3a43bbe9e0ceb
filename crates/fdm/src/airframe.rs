//! An aircraft file of either kind.

use crate::aircraft::{Aircraft, Battery};
use crate::error::FdmError;
use crate::mechanism::Mechanism;
use crate::multirotor::{Multirotor, Navigation};
use std::sync::Arc;

/// What an aircraft file describes: a fixed wing, or with `type = "multirotor"` a multirotor.
#[derive(Debug, Clone, PartialEq)]
pub enum Airframe {
    /// An aircraft that a wing carries.
    FixedWing(Arc<Aircraft>),
    /// An aircraft that four rotors carry.
    Multirotor(Box<Multirotor>),
}

/// Speeds of an aircraft, m/s: true airspeed of a fixed wing, speed over ground of a multirotor, which can stop.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SpeedRange {
    /// Slowest.
    pub min_m_s: f64,
    /// Where none is commanded.
    pub cruise_m_s: f64,
    /// Fastest.
    pub max_m_s: f64,
}

impl Airframe {
    /// Reads and checks an aircraft file. `file_name` is for messages only.
    ///
    /// # Errors
    /// As [`Aircraft::from_toml`].
    pub fn from_toml(file_name: &str, text: &str) -> Result<Self, FdmError> {
        // A text that is no TOML is reported by the reader of a fixed wing.
        let table: Option<toml::Table> = toml::from_str(text).ok();
        if table.is_none_or(|table| !table.contains_key("type")) {
            return Ok(Self::FixedWing(Arc::new(Aircraft::from_toml(
                file_name, text,
            )?)));
        }
        let multirotor: Multirotor =
            toml::from_str(text).map_err(|error| FdmError::syntax(file_name, text, &error))?;
        multirotor
            .check()
            .map_err(|error| error.located_in(file_name, text))?;
        Ok(Self::Multirotor(Box::new(multirotor)))
    }

    /// The aircraft as a TOML file.
    ///
    /// # Errors
    /// As [`Aircraft::to_toml`].
    pub fn to_toml(&self) -> Result<String, FdmError> {
        match self {
            Self::FixedWing(aircraft) => aircraft.to_toml(),
            Self::Multirotor(multirotor) => {
                toml::to_string(multirotor).map_err(|error| FdmError::Unwritable(error.to_string()))
            }
        }
    }

    /// Its usual name.
    pub fn name(&self) -> &str {
        match self {
            Self::FixedWing(aircraft) => &aircraft.name,
            Self::Multirotor(multirotor) => &multirotor.name,
        }
    }

    /// Whether it can stand still in the air.
    pub fn hovers(&self) -> bool {
        matches!(self, Self::Multirotor(_))
    }

    /// The fixed wing, if it is one.
    pub fn fixed_wing(&self) -> Option<&Arc<Aircraft>> {
        match self {
            Self::FixedWing(aircraft) => Some(aircraft),
            Self::Multirotor(_) => None,
        }
    }

    /// Its speeds.
    pub fn speeds(&self) -> SpeedRange {
        match self {
            Self::FixedWing(aircraft) => SpeedRange {
                min_m_s: aircraft.limits.airspeed_min_m_s,
                cruise_m_s: aircraft.limits.airspeed_cruise_m_s,
                max_m_s: aircraft.limits.airspeed_max_m_s,
            },
            Self::Multirotor(multirotor) => SpeedRange {
                min_m_s: 0.0,
                cruise_m_s: multirotor.limits.speed_cruise_m_s,
                max_m_s: multirotor.limits.speed_max_m_s,
            },
        }
    }

    /// Its battery, if the file describes one.
    pub fn battery(&self) -> Option<Battery> {
        match self {
            Self::FixedWing(aircraft) => aircraft.battery,
            Self::Multirotor(multirotor) => multirotor.battery,
        }
    }

    /// Height of its centre of gravity above the ground at rest, m.
    pub fn rest_height_m(&self) -> f64 {
        match self {
            Self::FixedWing(aircraft) => aircraft.ground.rest_height_m,
            Self::Multirotor(multirotor) => multirotor.rest_height_m,
        }
    }

    /// Its width, m: the span of its wing, or from tip to tip of its rotors.
    pub fn width_m(&self) -> f64 {
        match self {
            Self::FixedWing(aircraft) => aircraft.wing.span_m,
            Self::Multirotor(multirotor) => {
                2.0 * multirotor.rotors.right_m + multirotor.rotors.diameter_m
            }
        }
    }

    /// Radius of the circle in which it waits, m; 0 for one that stands still.
    pub fn loiter_radius_m(&self) -> f64 {
        match self {
            Self::FixedWing(aircraft) => aircraft.control.loiter_radius_m,
            Self::Multirotor(_) => 0.0,
        }
    }

    /// Errors of its position estimate.
    pub fn navigation(&self) -> Navigation {
        match self {
            Self::FixedWing(_) => Navigation::default(),
            Self::Multirotor(multirotor) => multirotor.navigation,
        }
    }

    /// The same with mechanisms by which the aircraft that flies differs.
    ///
    /// # Errors
    /// [`FdmError::NotOfMultirotors`]: the mechanisms of flight are those of fixed wings.
    pub fn extended(mut self, mechanisms: Vec<Mechanism>) -> Result<Self, FdmError> {
        let Some(first) = mechanisms.first() else {
            return Ok(self);
        };
        match &mut self {
            Self::FixedWing(aircraft) => {
                Arc::make_mut(aircraft).mechanism.extend(mechanisms);
                Ok(self)
            }
            Self::Multirotor(multirotor) => Err(FdmError::NotOfMultirotors {
                aircraft: multirotor.name.clone(),
                what: format!("mechanism \"{}\"", first.id),
            }),
        }
    }
}
