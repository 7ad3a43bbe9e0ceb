//! Emission rates from measured concentrations.
//!
//! [`flux::estimate`] tries every method whose conditions the observations meet; the estimate of [`plume::curtain`] needs
//! no model of the plume's spread.
//! [`point`] estimates the rate of one source from one sensor at rest with a wind logged beside it: a car parked
//! downwind, a mast, a hovering drone. Each estimate carries a 95 % interval, the terms that make it wide, and the part of
//! the record that it used; where a method's conditions are not met it is refused with the reason.
//!
//! Pure: no clock, file, socket, environment or random number.

pub mod flux;
pub mod point;

/// A positive quantity with its 95 % interval.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct Interval {
    /// Median.
    pub value: f64,
    /// Half of the width of the central 68 % interval.
    pub sd: f64,
    /// 2.5 % quantile.
    pub low95: f64,
    /// 97.5 % quantile.
    pub high95: f64,
}

impl Interval {
    /// That of a quantity whose logarithm is normal about ln `value`.
    pub fn of_ln_normal(value: f64, ln_sd: f64) -> Self {
        // Two-sided 95 % of a normal quantity.
        const SD_95: f64 = 1.959_964;
        let at = |sds: f64| value * (sds * ln_sd).exp();
        Self {
            value,
            sd: 0.5 * (at(1.0) - at(-1.0)),
            low95: at(-SD_95),
            high95: at(SD_95),
        }
    }
}

/// What makes an interval wide.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Term {
    /// The speed of the wind.
    WindSpeed,
    /// The direction of the wind, and where the source stands.
    WindDirection,
    /// The spread of the plume.
    Dispersion,
    /// The height of source and sensor.
    Height,
    /// The mole fraction of clean air.
    Background,
    /// The gain of the sensor.
    Sensor,
    /// Turbulence: the record holds few independent passes of the plume.
    Turbulence,
    /// What was measured differs from what is asked for.
    Representativeness,
}

/// The share of one term in the variance of ln rate.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct Share {
    /// The term.
    pub term: Term,
    /// Its share, 0 to 1.
    pub share: f64,
}

/// Why a method gives no rate.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum StudyError {
    /// The observations do not meet the method's conditions.
    #[error("{0}")]
    Refused(String),
    /// The scenario describes no world.
    #[error(transparent)]
    World(#[from] scenario::world::WorldError),
}
