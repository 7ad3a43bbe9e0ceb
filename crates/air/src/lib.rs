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
//!
//! # Example
//!
//! Where a place lies, which way the air goes there, and how dense it is:
//!
//! ```
//! use air::geo::{Geodetic, LocalFrame};
//! use air::isa::Atmosphere;
//! use air::wind::WindProfile;
//!
//! # fn main() -> Result<(), air::AirError> {
//! let frame = LocalFrame::new(43.4417, -7.8631, 340.0)?;
//! let at = frame.to_enu(Geodetic::new(43.4517, -7.8631));
//! assert!((at.north_m - 1111.0).abs() < 1.0 && at.east_m.abs() < 0.01);
//!
//! // 7 m/s from the west-south-west at 486 m above ground, less below.
//! let wind = WindProfile::new(7.0, 486.0, 240.0, 0.15)?;
//! assert!(wind.speed_at_m_s(100.0) < 7.0);
//! let towards = wind.at(486.0);
//! assert!(towards.east_m_s > 0.0 && towards.north_m_s > 0.0);
//!
//! // The standard atmosphere at 826 m above mean sea level.
//! let density_kg_m3 = Atmosphere::standard().at(826.0).density_kg_m3();
//! assert!((density_kg_m3 - 1.131).abs() < 0.001);
//! # Ok(())
//! # }
//! ```
//!
//! [`wind::WindSeries`] is a wind that changes in time, [`eddies`] what makes it meander over minutes,
//! [`dryden`] the gusts on top of both, [`terrain`] the ground from an SRTM tile, [`utm`] places by easting and northing, and [`area`] what lies inside a fence.

pub mod area;
pub mod ascii_grid;
pub mod dryden;
pub mod eddies;
pub mod geo;
pub mod isa;
pub mod terrain;
pub mod utm;
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
