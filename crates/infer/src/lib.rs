//! One inference for all models: unknowns and how far they may be off, under noise whose parts
//! and sizes the readings themselves tell, and under a model that is wrong in form.
//!
//! A reading is taken as
//!
//! > y = rest(θ) + plume(θ, turned by v) exp(g) + fluctuation + slow wander + white noise,
//!
//! where θ are the model's unknowns, v is the turn of the plume's axis in time, and g is a
//! smooth discrepancy along distance, height, width and time. In a model that is right g is
//! found to be nothing, and nothing changes; in one that is wrong the standard deviations grow,
//! most where nobody has read (Kennedy and O'Hagan 2001; Brynjarsdóttir and O'Hagan 2014).
//!
//! [`ForwardModel`] is what a model must tell; [`Problem`] puts it beside [`Rows`] of readings;
//! [`Problem::posterior`] answers.
//!
//! ```
//! use infer::{
//!     AxisTurn, ForwardModel, InferError, PlumePlace, Policy, Prediction, Prior, Problem, Rows,
//! };
//!
//! /// A plume that is crossed: a bell of unknown height on an unknown background.
//! struct Crossing([Prior; 2]);
//!
//! impl ForwardModel for Crossing {
//!     fn priors(&self) -> &[Prior] {
//!         &self.0
//!     }
//!     fn ln_strength(&self) -> Option<usize> {
//!         Some(1)
//!     }
//!     fn starts(&self) -> Vec<Vec<f64>> {
//!         Vec::new()
//!     }
//!     fn predict(&self, at: &[f64], turns: &[AxisTurn]) -> Result<Prediction, InferError> {
//!         let bell = |(k, turn): (usize, &AxisTurn)| {
//!             let across = (k as f64 - 50.0) / 8.0 - 0.2 * turn.clockwise_deg;
//!             at[1].exp() * (-0.5 * across * across).exp()
//!         };
//!         let plume: Vec<f64> = turns.iter().enumerate().map(bell).collect();
//!         let reading = plume.iter().map(|p| at[0] + p).collect();
//!         Ok(Prediction { reading, plume })
//!     }
//!     fn places(&self, _: &[f64]) -> Result<Vec<PlumePlace>, InferError> {
//!         let place = |k: usize| PlumePlace {
//!             ln_distance: 7.0,
//!             across_sigmas: (k as f64 - 50.0) / 8.0,
//!             time_s: k as f64,
//!             emitted_s: k as f64,
//!             ..PlumePlace::default()
//!         };
//!         Ok((0..100).map(place).collect())
//!     }
//! }
//!
//! let model = Crossing([
//!     Prior { mean: 400.0, sd: 20.0 },
//!     Prior { mean: 3.0, sd: 2.0 },
//! ]);
//! // 120 above 410, with a pattern of ±1 as noise.
//! let truth = model.predict(&[410.0, 120f64.ln()], &[AxisTurn::NONE; 100])?;
//! let noisy = |(k, r): (usize, &f64)| r + f64::from(u8::from(k * k % 7 < 3)) * 2.0 - 1.0;
//! let measured = truth.reading.iter().enumerate().map(noisy).collect();
//! let times = (0..100).map(f64::from).collect();
//! let rows = Rows::new(Vec::from([0..100]), times, measured, vec![f64::NAN; 100], vec![true; 100])?;
//! let policy = Policy::default();
//! let found = Problem::new(&model, &rows, &policy, 1.0, &[]).posterior()?;
//! assert!((found.mean()[0] - 410.0).abs() < 2.0);
//! assert!((found.mean()[1].exp() - 120.0).abs() < 6.0);
//! # Ok::<(), InferError>(())
//! ```
//!
//! Pure: no clock, file, socket, environment or random number.

mod background;
mod bootstrap;
mod closest_model;
mod contact;
mod discrepancy;
mod evidence;
mod fit;
mod fluctuation;
mod hold_out;
mod judge;
mod learned_noise;
mod maximise;
mod mechanism_search;
mod noise;
mod parallel_map;
mod passes;
mod policy;
mod posterior;
mod predicted_readings;
mod probability;
mod rows;
mod slopes;
mod start;

pub use background::Along;
pub use closest_model::ClosestModel;
pub use contact::Contact;
pub use discrepancy::{AXIS_DRIFT, Basis, COORDINATES, Sizes, UPWARD_DRIFT};
pub use fit::{Fit, Point, Problem};
pub use hold_out::Expected;
pub use judge::{Cause, Judgement, Rest, RestKind};
pub use learned_noise::LearnedNoise;
pub use mechanism_search::{Catalogue, FittedSet, Question, Screened, Start, without};
pub use noise::Noise;
pub use parallel_map::parallel_map;
pub use policy::{NAMED, Policy};
pub use posterior::{Estimate, Posterior};
pub use predicted_readings::{NormalPosterior, PredictedReadings};
pub use probability::{CauseMap, Features};
pub use rows::{AxisTurn, ForwardModel, PlumePlace, Prediction, Prior, Rows};

/// What this crate refuses.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum InferError {
    /// Rows that do not belong together.
    #[error("readings: {0}")]
    Rows(String),
    /// The model refuses values.
    #[error("model: {0}")]
    Model(String),
    /// No normal approximation of the posterior exists: the readings and priors say too little.
    #[error("no posterior: the readings do not determine parameters that have no prior")]
    NoPosterior,
}
