//! The world simulator: wind, air and plume around the simulated vehicles, and the correction
//! of its own model by what the real ones measure.
//!
//! Pure: no clock, socket, file, environment or global random number.
//!
//! - [`agent`]: the state machine on the bus;
//! - [`calibration`]: base level, plume height, axis, strength and spread from readings, with
//!   uncertainties; used in flight by the agent and off-line on files;
//! - `live_gap`: what real readings tell of the model, at moments of the mission and at its end;
//! - [`model`]: the corrected model as others read it off the bus;
//! - [`wind`]: the wind that the world follows.
//!
//! # Example
//!
//! Readings of a plume that is turned by 10° and stronger by half than the scenario has it correct the
//! model:
//!
//! ```
//! use plume::{Place, Strength, DispersionModel, DispersionSpec};
//! use scenario::Scenario;
//! use ws::Calibrator;
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let text = r#"
//! [site]
//! lat_deg = 43.4417
//! lon_deg = -7.8631
//! ground_amsl_m = 340.0
//! [weather]
//! wind_from_deg = 270.0
//! [[source]]
//! lat_deg = 43.4417
//! lon_deg = -7.8631
//! stack_height_m = 356.0
//! effective_height_m = 486.0
//! c_max_ppm = 400.0
//! c_max_distance_m = 2000.0
//! [uncertain]
//! "weather.wind_from_deg" = 12.0
//! "source.c_max_ppm" = 120.0
//! "#;
//! let scenario = Scenario::parse("site.toml", text)?;
//! let reality = text
//!     .replace("wind_from_deg = 270.0", "wind_from_deg = 280.0")
//!     .replace("c_max_ppm = 400.0", "c_max_ppm = 600.0");
//! let model = Scenario::parse("reality.toml", &reality)?.dispersion_model()?;
//!
//! let mut calibrator = Calibrator::new(&scenario, &["1".to_owned()], None)?;
//! for second in 0..300 {
//!     // To and fro across the wind, 1800 m downwind.
//!     let time_s = f64::from(second);
//!     let place = Place {
//!         east_m: 1800.0,
//!         north_m: -300.0 + 600.0 * (time_s / 40.0).sin(),
//!         height_agl_m: 486.0,
//!     };
//!     calibrator.observe(0, time_s, place, None, model.mean_ppm(&place, time_s));
//! }
//! calibrator.finish();
//! calibrator.update()?;
//! let found = calibrator.calibrated();
//! assert!((found.axis_deg.value - 100.0).abs() < 1.0, "{:?}", found.axis_deg);
//! assert!((found.c_max_ppm.value - 600.0).abs() < 30.0, "{:?}", found.c_max_ppm);
//! # Ok(())
//! # }
//! ```

pub mod agent;
pub mod calibration;
mod live_gap;
pub mod model;
pub mod wind;

pub use agent::{WorldSimulator, WorldSimulatorConfig};
pub use calibration::{Calibrator, READ_SD};

/// Why the world simulator refuses to work.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum WsError {
    /// The scenario describes no world.
    #[error(transparent)]
    World(#[from] scenario::world::WorldError),
    /// A name that cannot be part of a key.
    #[error(transparent)]
    Name(#[from] protocol::ProtocolError),
    /// The observations are not those of one record.
    #[error(transparent)]
    Observations(#[from] scenario::observations::ObservationError),
    /// No reading passed the checks of raw observations.
    #[error(
        "none of {readings} readings is usable: {flaws}; expected readings of the scenario's site and gas, in \
         the units of their columns"
    )]
    NothingLeft {
        /// How many readings there were.
        readings: usize,
        /// What was wrong with them.
        flaws: String,
    },
    /// The readings do not tell.
    #[error(transparent)]
    Infer(#[from] infer::InferError),
    /// The plume model refused a corrected value.
    #[error("plume model: {0}")]
    Plume(String),
}

impl From<gap::GapError> for WsError {
    fn from(error: gap::GapError) -> Self {
        Self::Plume(error.to_string())
    }
}

impl From<plume::PlumeError> for WsError {
    fn from(error: plume::PlumeError) -> Self {
        Self::Plume(error.to_string())
    }
}
