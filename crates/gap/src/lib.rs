//! The reality gap: given measured data, what the simulation gets wrong, what causes it, how to
//! extend the model, and what that gains; or that the data do not tell.
//!
//! - [`plume`]: concentrations along tracks against the plume model;
//! - [`tracer`]: fixed samplers over many trials of a tracer experiment;
//! - [`verdict`]: the answer, as `gap.json` has it;
//! - [`applied`]: an extension found before, on other data.
//!
//! Pure: no clock, file, socket, environment or global random number; seeds are arguments, and
//! results do not depend on the number of threads.
//!
//! # Example
//!
//! An aircraft weaves across a plume with a sensor that lags by eight seconds, and the scenario knows
//! nothing of the lag:
//!
//! ```
//! use gap::plume::{Options, Setup, analyse};
//! use plume::{Mechanism, Place, Sensor};
//! use rand::{SeedableRng, rngs::ChaCha8Rng};
//! use scenario::Scenario;
//! use scenario::observations::{ObservationRow, Observations};
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let scenario = Scenario::parse("site.toml", r#"
//! [site]
//! lat_deg = 43.4417
//! lon_deg = -7.8631
//! ground_amsl_m = 340.0
//! [weather]
//! wind_speed_m_s = 7.0
//! wind_height_agl_m = 300.0
//! wind_from_deg = 270.0
//! [[source]]
//! lat_deg = 43.4417
//! lon_deg = -7.8631
//! stack_height_m = 200.0
//! effective_height_m = 300.0
//! emission_kg_s = 120.0
//! [sensor]
//! noise_sd_ppm = 1.0
//! "#)?;
//! let setup = Setup::new(&scenario)?;
//!
//! // Data of a known truth: the scenario's plume, seen through the slow sensor.
//! let model = scenario.dispersion_model()?;
//! let lag = Mechanism::new("sensor-lag", &[("time_constant_s", 8.0)])?;
//! let mut sensor = Sensor::new(&model.spec().sensor, &[lag], "uav");
//! let mut rng = ChaCha8Rng::seed_from_u64(1);
//! let rows = (0..600).map(|second| {
//!     let time_s = f64::from(second);
//!     let north_m = 400.0 * (time_s / 25.0).sin();
//!     let place = Place { east_m: 1500.0, north_m, height_agl_m: 300.0 };
//!     let at = setup.frame.to_geodetic(air::geo::Enu { east_m: 1500.0, north_m });
//!     ObservationRow {
//!         time_s,
//!         platform: 0,
//!         lat_deg: at.lat_deg,
//!         lon_deg: at.lon_deg,
//!         alt_amsl_m: 640.0,
//!         co2_ppm: Some(sensor.read(model.mean_ppm(&place, time_s), 1.0, &mut rng)),
//!         ..ObservationRow::default()
//!     }
//! });
//! let observations = Observations {
//!     rows: rows.collect(),
//!     platforms: vec!["uav".to_owned()],
//!     ..Observations::default()
//! };
//!
//! let analysis = analyse(&setup, &observations, &Options::live(), &mut |_| {})?;
//! let cause = &analysis.json.causes[0];
//! assert_eq!(cause.mechanisms[0], "sensor-lag");
//! let found = &cause.parameters[0];
//! assert!((found.value - 8.0).abs() < 4.0 * found.sd, "{found:?}");
//! # Ok(())
//! # }
//! ```
//!
//! `analysis.extension` holds the same as mechanisms of the plume model, which
//! [`scenario::Scenario::extend`] adds to the scenario: what was found is then simulated.

pub mod applied;
pub mod flight;
pub mod plume;
mod statistics;
pub mod tracer;
pub mod verdict;

/// What this crate refuses: what, where, and what would be right.
#[derive(Debug, thiserror::Error)]
pub enum GapError {
    /// The data cannot be analysed at all.
    #[error("{what}: {problem}; expected {expected}")]
    Data {
        /// What was looked at.
        what: String,
        /// What is wrong with it.
        problem: String,
        /// What would be right.
        expected: String,
    },
    /// The observations are not those of one record.
    #[error(transparent)]
    Observations(#[from] scenario::observations::ObservationError),
    /// The plume model refused a value.
    #[error(transparent)]
    Plume(#[from] ::plume::PlumeError),
    /// The inference refused a model or its readings.
    #[error(transparent)]
    Infer(#[from] infer::InferError),
    /// The site or its air refused a value.
    #[error(transparent)]
    Air(#[from] air::AirError),
}

impl From<formats::delimited::TableError> for GapError {
    fn from(error: formats::delimited::TableError) -> Self {
        Self::Data {
            what: error.place(),
            problem: error.problem,
            expected: error.expected,
        }
    }
}
