//! The air of a site and the ground under it: standard atmosphere, wind profile,
//! turbulence, terrain, and the local frame in which all of them are expressed.
//!
//! Pure: no clock, file, socket, environment or global random number. Time, seeds and
//! file contents come in as arguments.
//!
//! Frames used throughout the workspace:
//! - *geodetic*: WGS84 latitude and longitude in degrees, altitude in metres above mean sea level;
//! - *ENU*: metres east, north and up of the site's origin ([`geo::LocalFrame`]);
//! - *NED*: metres north, east and down, for aircraft.
//!
//! Wind is *from* a direction for people ([`wind::from_deg`]) and a vector *towards* inside.

pub mod area;
pub mod dryden;
pub mod geo;
pub mod isa;
pub mod terrain;
pub mod wind;

/// Standard acceleration of gravity, m/s² (ISO 80000-3).
pub const STANDARD_GRAVITY_M_S2: f64 = 9.806_65;

/// What this crate refuses, with what would be right.
#[derive(Debug, Clone, thiserror::Error, PartialEq)]
pub enum AirError {
    /// A quantity is outside the range in which the model holds.
    #[error("{what} is {value}; expected {expected}")]
    OutOfRange {
        /// The quantity, with its unit.
        what: &'static str,
        /// The value that came in.
        value: f64,
        /// What would be right.
        expected: &'static str,
    },
    /// A terrain tile could not be read.
    #[error("terrain tile: {0}")]
    Terrain(String),
}

/// Returns `value` if it is finite and inside `[low, high]`, else says what was expected.
pub(crate) fn in_range(
    what: &'static str,
    value: f64,
    low: f64,
    high: f64,
    expected: &'static str,
) -> Result<f64, AirError> {
    if value.is_finite() && value >= low && value <= high {
        Ok(value)
    } else {
        Err(AirError::OutOfRange {
            what,
            value,
            expected,
        })
    }
}
