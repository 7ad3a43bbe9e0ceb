//! Hidden cases: data whose cause is known, made by nothing that looks for it.
//!
//! A [`Case`] is what a finder gets (a scenario as TOML, observations as CSV) and what it must
//! not see ([`Truth`]). Scene, weather, tracks, noise and strength come from the case's seed.
//! The gas comes from a plain Gaussian plume or from puffs carried by a gusty, meandering
//! wind (`physics`); spread, geometry and air are this crate's own (`law`, `scene`), and
//! a test keeps its dependency tree free of the crates that are put to the test.
//!
//! Every case has a control ([`Case::control`]): the same scene, noise and weather without the
//! hidden effects. What the effects cost a model is the score of the control minus that of the
//! case.
//!
//! ```
//! use gap_truth::{Case, CaseSpec};
//!
//! let case = Case::make(&CaseSpec::none(7));
//! assert!(case.truth.effects.is_empty());
//! // Nothing is hidden, so the control reads the same.
//! assert_eq!(case.observations, case.control);
//! ```
//!
//! Pure: no clock, file, socket, environment or global random number.

pub mod case;
mod effect;
pub mod flight;
pub mod further;
mod instrument;
mod law;
pub mod mutation;
mod physics;
mod random;
mod scene;
mod strength;
mod tracks;
mod wind;

pub use case::{Case, CaseSpec, HiddenEffect, TrueEffect, TruePlumeChange, Truth};
pub use effect::{CATALOGUE, OUTSIDE, PlumeEffect};
pub use further::FurtherFlight;
pub use instrument::{Damage, NoiseForm};
pub use physics::Forward;
