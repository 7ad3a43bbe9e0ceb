//! Hidden cases: data whose cause is known, made by nothing that looks for it.
//!
//! A [`Case`] is what a finder gets (a scenario as TOML, observations as CSV) and what it must
//! not see ([`Truth`]). Scene, weather, tracks, noise and strength come from the case's seed.
//! The gas comes from a plain Gaussian plume or from puffs carried by a gusty, meandering
//! wind (`physics`); spread, geometry and air are this crate's own (`law`, `scene`), and
//! a test keeps its dependency tree free of the crates that are put to the test.
//!
//! A second generator ([`puffs`]) has other physics, other tracks and other sensors, so that what is learned on one can
//! be tested on the other.
//!
//! How visible an effect is follows from the noise that made the case ([`visibility`]): D, in nats.
//!
//! ```
//! use gap_truth::{Case, CaseSpec};
//!
//! let case = Case::make(&CaseSpec::none(7));
//! assert!(case.truth.effects.is_empty());
//! assert_eq!(case, Case::make(&CaseSpec::none(7)));
//! ```
//!
//! Pure: no clock, file, socket, environment or global random number.

pub mod case;
mod effect;
mod effect_list;
pub mod flight;
pub mod further;
mod instrument;
mod law;
mod linear;
pub mod mutation;
mod physics;
pub mod puffs;
mod random;
mod scene;
mod strength;
mod tracks;
pub mod visibility;
mod whitening;
mod wind;

pub use case::{Case, CaseSpec, HiddenEffect, TrueEffect, Truth};
pub use effect::{CATALOGUE, OUTSIDE, PlumeEffect};
pub use further::FurtherFlight;
pub use instrument::{Damage, NoiseForm};
pub use physics::Forward;
