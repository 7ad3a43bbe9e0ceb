//! An entry of the catalogue: what is known of a mechanism, in one place.

use crate::effects::{DispersionEffects, SensorEffects};

/// The family a mechanism belongs to.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Family {
    /// Wind and transport.
    Wind,
    /// Spread of the plume.
    Spread,
    /// Source and sink.
    Source,
    /// Background.
    Background,
    /// Sensor, its clock and its logged place: may differ between platforms.
    Sensor,
}

impl Family {
    /// Its name in tables.
    pub fn as_str(self) -> &'static str {
        match self {
            Family::Wind => "wind and transport",
            Family::Spread => "spread",
            Family::Source => "source and sink",
            Family::Background => "background",
            Family::Sensor => "sensor",
        }
    }
}

/// The coordinate in which a parameter's prior is normal.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Coordinate {
    /// The parameter itself.
    Linear,
    /// Its natural logarithm: for factors, whose neutral value is 1.
    Log,
}

/// One parameter of a mechanism.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ParameterSpec {
    /// Name in files, with its unit at the end where it has one.
    pub name: &'static str,
    /// Unit for people; "1" for a pure number.
    pub unit: &'static str,
    /// Value at which it does nothing (infinite for limits).
    pub neutral: f64,
    /// Where the physical prior is centred: the neutral value, but for limits.
    pub prior_centre: f64,
    /// One standard deviation of the physical prior, in the parameter's [`Coordinate`].
    pub prior_sd: f64,
    /// Lowest value allowed.
    pub low: f64,
    /// Highest value allowed.
    pub high: f64,
    /// Coordinate of the prior.
    pub coordinate: Coordinate,
    /// Value when a file leaves it out; `None` when it must be given.
    pub default: Option<f64>,
}

impl ParameterSpec {
    /// A value in the parameter's coordinate.
    pub fn to_coordinate(&self, value: f64) -> f64 {
        match self.coordinate {
            Coordinate::Linear => value,
            Coordinate::Log => value.ln(),
        }
    }

    /// The value at `at` in the parameter's coordinate.
    pub fn from_coordinate(&self, at: f64) -> f64 {
        match self.coordinate {
            Coordinate::Linear => at,
            Coordinate::Log => at.exp(),
        }
    }

    /// Standard deviation of `value`, to first order, where its coordinate has `sd`.
    pub fn sd_of(&self, value: f64, sd: f64) -> f64 {
        match self.coordinate {
            Coordinate::Linear => sd,
            Coordinate::Log => value * sd,
        }
    }
}

/// How a mechanism enters the equations, given its parameters in the catalogue's order.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Action {
    /// In the dispersion model: on all platforms alike.
    OnDispersion(fn(&mut DispersionEffects, &[f64])),
    /// In the sensor of each platform it applies to.
    OnSensor(fn(&mut SensorEffects, &[f64])),
}

/// Steps from the neutral value that a search of data starts with. One small step is enough for
/// what is nearly linear; what is not is tried along its range.
#[derive(Debug, Clone, Copy)]
pub enum Steps {
    /// Values of the first parameter.
    Line(&'static [f64]),
    /// The same step of the first two parameters, each for itself.
    Plane(f64),
    /// Heights above the plume's axis, as its spread is.
    HeightsAboveAxis,
    /// Places on a grid around the first source.
    PlacesAroundSource,
    /// Parts of the range of what is read.
    PartsOfRange,
    /// This value of the first parameter, about zero and about the background.
    AboutBackground(f64),
    /// This value of the first parameter, about the standard pressure and about that met.
    AboutPressureMet(f64),
}

/// What is known of a mechanism.
#[derive(Debug, Clone, Copy)]
pub struct MechanismSpec {
    /// The id in files.
    pub name: &'static str,
    /// The family.
    pub family: Family,
    /// Its parameters; those with a default are settings that are not fitted.
    pub parameters: &'static [ParameterSpec],
    /// What a positive value means.
    pub sign: &'static str,
    /// What it does.
    pub(crate) action: Action,
    /// Where a search starts.
    pub steps: Steps,
    /// What decides whether it is at work, without a flight.
    pub check: Option<&'static str>,
}

/// A fitted parameter whose neutral value is zero.
pub(super) const fn offset(
    name: &'static str,
    unit: &'static str,
    prior_sd: f64,
    low: f64,
    high: f64,
) -> ParameterSpec {
    ParameterSpec {
        name,
        unit,
        neutral: 0.0,
        prior_centre: 0.0,
        prior_sd,
        low,
        high,
        coordinate: Coordinate::Linear,
        default: None,
    }
}

/// A fitted factor.
pub(super) const fn factor(
    name: &'static str,
    prior_sd: f64,
    low: f64,
    high: f64,
) -> ParameterSpec {
    ParameterSpec {
        neutral: 1.0,
        prior_centre: 1.0,
        coordinate: Coordinate::Log,
        ..offset(name, "1", prior_sd, low, high)
    }
}

/// A fitted limit, which does nothing when infinite.
pub(super) const fn limit(
    name: &'static str,
    unit: &'static str,
    centre: f64,
    low: f64,
    high: f64,
) -> ParameterSpec {
    ParameterSpec {
        neutral: f64::INFINITY,
        prior_centre: centre,
        coordinate: Coordinate::Log,
        ..offset(name, unit, 1.0, low, high)
    }
}

/// A setting that is not fitted.
pub(super) const fn setting(
    name: &'static str,
    unit: &'static str,
    default: f64,
    low: f64,
    high: f64,
) -> ParameterSpec {
    ParameterSpec {
        neutral: default,
        prior_centre: default,
        default: Some(default),
        ..offset(name, unit, 1.0, low, high)
    }
}
