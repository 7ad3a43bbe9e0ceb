//! What is in the air and what a sensor reads of it.
//!
//! The base is the Gaussian plume with Briggs' (1973) spread; every departure from it is a
//! *mechanism* ([`mechanism`]) with an id, parameters and a sign convention, so that a finding
//! about measured data is at once an extension of the simulator. The same [`field::DispersionModel`]
//! serves the simulation (one point at a time) and the analysis of data (a whole
//! [`track::Track`] at a time); [`batch`] evaluates it at many places for maps.
//!
//! Pure: no clock, file, socket, environment or global random number. Time and random
//! generators are arguments; results are repeatable bit for bit.
//!
//! Units are SI inside; concentrations that people read are mole fractions in ppm.
//!
//! # Example
//!
//! Four coal units of 350 MW emit some 352 kg/s of CO2. In a neutral wind of 7 m/s, what is met on
//! the plume's axis 2400 m downwind, and what does a slow sensor make of it?
//!
//! ```
//! use air::geo::Enu;
//! use air::isa::Atmosphere;
//! use air::wind::{WindProfile, towards_deg};
//! use plume::sigma::Setting;
//! use plume::stability::Stability;
//! use plume::{
//!     Gas, Mechanism, Place, Sensor, SensorSpec, SourceSpec, Strength, DispersionModel, DispersionSpec,
//! };
//! use rand::{SeedableRng, rngs::ChaCha8Rng};
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let spec = DispersionSpec {
//!     ground_amsl_m: 340.0,
//!     atmosphere: Atmosphere::through(826.0, 15.0, 920.0)?,
//!     wind: WindProfile::new(7.0, 486.0, 240.0, 0.15)?,
//!     stability: Stability::D,
//!     setting: Setting::Rural,
//!     ground_reflection: false,
//!     mixing_height_m: None,
//!     lid_edge_m: 0.0,
//!     background_ppm: 449.0,
//!     sources: vec![SourceSpec {
//!         name: "stack".to_owned(),
//!         gas: Gas::Co2,
//!         place: Enu::default(),
//!         area: None,
//!         stack_height_m: 356.0,
//!         effective_height_agl_m: 486.0,
//!         strength: Strength::EmissionKgS(352.0),
//!         schedule: None,
//!     }],
//!     sigma_y_scale: 1.0,
//!     sigma_z_scale: 1.0,
//!     mechanisms: Vec::new(),
//!     sensor: SensorSpec { time_constant_s: 20.0, ..SensorSpec::default() },
//! };
//! let model = DispersionModel::new(spec.clone())?;
//! let axis = Enu::default().displaced(towards_deg(240.0), 2400.0);
//! let place = Place { east_m: axis.east_m, north_m: axis.north_m, height_agl_m: 486.0 };
//! let excess_ppm = model.mean_ppm(&place, 0.0) - 449.0;
//! assert!((excess_ppm - 410.0).abs() < 10.0, "{excess_ppm}");
//!
//! // A mechanism from the catalogue extends the model: twice as wide, half as much on the axis.
//! let wide = Mechanism::new("sigma-y-scale", &[("factor", 2.0)])?;
//! let wider = DispersionModel::new(DispersionSpec { mechanisms: vec![wide], ..spec })?;
//! let wider_ppm = wider.mean_ppm(&place, 0.0) - 449.0;
//! assert!((wider_ppm - 0.5 * excess_ppm).abs() < 1e-9);
//!
//! // A sensor that comes from clean air needs three time constants to read 95 % of it.
//! let mut rng = ChaCha8Rng::seed_from_u64(1);
//! let mut sensor = Sensor::new(&model.spec().sensor, &[], "1");
//! sensor.read(449.0, 1.0, &mut rng);
//! let read: Vec<f64> = (0..60)
//!     .map(|_| sensor.read(449.0 + excess_ppm, 1.0, &mut rng))
//!     .collect();
//! assert!(read[0] < 449.0 + 0.1 * excess_ppm);
//! assert!((read[59] - (449.0 + 0.95 * excess_ppm)).abs() < 0.01 * excess_ppm);
//! # Ok(())
//! # }
//! ```

mod area;
pub mod curtain;
pub mod effects;
pub mod field;
mod lag;
mod means;
pub mod mechanism;
pub mod rise;
mod row;
mod sample_points;
pub mod schedule;
pub mod score;
pub mod sensor;
pub mod sigma;
pub mod stability;
pub mod track;
pub mod units;

pub use area::{AreaSpec, Outline};
pub use field::batch::{self, PlaceColumns};
pub use field::puffs::{self, Puffs, UnsteadyAir, UnsteadySpec};
pub use field::{DispersionModel, DispersionSpec, InPlume, Place, SourceSpec, Strength};
pub use lag::lag_step;
pub use means::Span;
pub use mechanism::{Mechanism, MechanismId};
pub use schedule::Schedule;
pub use sensor::{Sensor, SensorSpec};
pub use units::{Gas, Unit};

/// What this crate refuses: what, where, and what would be right.
#[derive(Debug, thiserror::Error, PartialEq)]
pub enum PlumeError {
    /// A quantity is outside the range in which the model holds.
    #[error("{what} is {value}; expected {expected}")]
    OutOfRange {
        /// The quantity, with its unit.
        what: String,
        /// The value that came in.
        value: f64,
        /// What would be right.
        expected: String,
    },
    /// A model has no source.
    #[error("the world has no source; expected at least one")]
    NoSource,
    /// A mechanism id is not in the catalogue.
    #[error("mechanism id \"{id}\" is not in the catalogue; expected one of: {known}")]
    UnknownMechanism {
        /// The id that came in.
        id: String,
        /// All ids of the catalogue, separated by commas.
        known: String,
    },
    /// A mechanism has no parameter of this name.
    #[error("mechanism \"{id}\" has no parameter \"{name}\"; expected: {known}")]
    UnknownParameter {
        /// The mechanism.
        id: &'static str,
        /// The name that came in.
        name: String,
        /// The names it has, separated by commas.
        known: String,
    },
    /// A mechanism lacks a parameter that has no default.
    #[error("mechanism \"{id}\" needs the parameter \"{name}\" ({unit})")]
    MissingParameter {
        /// The mechanism.
        id: &'static str,
        /// The parameter.
        name: &'static str,
        /// Its unit.
        unit: &'static str,
    },
    /// Columns or rows that belong together differ in number or order.
    #[error("{what}: {problem}")]
    Shape {
        /// What was being built.
        what: &'static str,
        /// What is wrong with it.
        problem: String,
    },
}

/// Returns `value` if it is finite and inside `[low, high]`, else says what was expected.
pub(crate) fn in_range(what: &str, value: f64, low: f64, high: f64) -> Result<f64, PlumeError> {
    if value.is_finite() && value >= low && value <= high {
        return Ok(value);
    }
    Err(PlumeError::OutOfRange {
        what: what.to_string(),
        value,
        expected: format!("{low} to {high}"),
    })
}
