//! Where to look next: search strategies for samplers that cannot be anywhere at will.
//!
//! A team of moving samplers looks for the highest value of a field. What it senses on its way
//! goes to an [`Archive`]; a [`SearchStrategy`] turns the archive into [`PromisingPoint`]s; each
//! sampler flies to one of those that lie ahead of it ([`choose_within_cone`]) until the next
//! step. The strategy of the house is the constrained-sampling evolutionary algorithm
//! [`CsEa`] (Varela et al. 2014, doi 10.1016/j.neucom.2013.03.060); [`RandomPoints`], [`Sweep`]
//! and [`Ascent`] are rivals behind the same trait, chosen by name with [`strategy_by_name`].
//!
//! Pure: no clock, file, socket, environment or global random number. Random numbers come from
//! a generator that the caller passes in, so that a seed repeats a search bit for bit.

mod archive;
mod cone;
mod cs_ea;
mod differential;
mod domain;
mod rivals;

pub use archive::{Archive, ArchiveOptions, Estimate, Kernel, Neighbour, Sample};
pub use cone::choose_within_cone;
pub use cs_ea::{CsEa, CsEaOptions};
pub use differential::Differential;
pub use domain::Domain;
pub use rivals::{Ascent, RandomPoints, Sweep};

use air::geo::Enu;
use rand::rngs::ChaCha8Rng;

/// A place in space: horizontal metres of the local frame and a height.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Position {
    /// Metres east and north of the site's origin.
    pub at: Enu,
    /// Height, m, above any one datum that all positions of a search share.
    pub height_m: f64,
}

impl Position {
    /// The place `east_m`, `north_m` of the origin at `height_m`.
    pub fn new(east_m: f64, north_m: f64, height_m: f64) -> Self {
        Self {
            at: Enu { east_m, north_m },
            height_m,
        }
    }

    pub(crate) fn coordinates(self) -> [f64; 3] {
        [self.at.east_m, self.at.north_m, self.height_m]
    }

    pub(crate) fn from_coordinates(c: [f64; 3]) -> Self {
        Self::new(c[0], c[1], c[2])
    }

    pub(crate) fn is_finite(self) -> bool {
        self.coordinates().iter().all(|c| c.is_finite())
    }
}

/// A place that is worth a flight.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PromisingPoint {
    /// Where it is.
    pub position: Position,
    /// How promising: greater is better; in the unit of the samples' values, with whatever
    /// bonus the strategy gives to what has not been seen yet.
    pub fitness: f64,
}

/// A way to turn what has been sensed into places worth a flight.
pub trait SearchStrategy: Send {
    /// The name by which a scenario chooses the strategy.
    fn name(&self) -> &'static str;

    /// Makes the next population of promising points from the last one and all samples so far.
    /// Every point lies inside the strategy's [`Domain`]. The slice is never empty.
    fn step(&mut self, archive: &Archive, rng: &mut ChaCha8Rng) -> &[PromisingPoint];

    /// The population of the last step; empty before the first.
    fn population(&self) -> &[PromisingPoint];
}

/// What this crate refuses, with what would be right.
#[derive(Debug, thiserror::Error, PartialEq)]
pub enum CseaError {
    /// A setting is outside the range in which the method holds.
    #[error("search.{what} is {value}; expected {expected}")]
    Setting {
        /// The setting.
        what: &'static str,
        /// What came in.
        value: f64,
        /// What would be right.
        expected: &'static str,
    },
    /// No strategy has this name.
    #[error("search.strategy is \"{0}\"; expected one of {names}", names = STRATEGIES.join(", "))]
    Strategy(String),
    /// The search box is empty or no feasible place was found in it.
    #[error("search domain: {0}")]
    Domain(String),
    /// A sample that is not finite.
    #[error("sample is not finite; expected finite metres and a finite value")]
    NotFinite,
}

pub(crate) fn setting(
    what: &'static str,
    value: f64,
    low: f64,
    high: f64,
    expected: &'static str,
) -> Result<f64, CseaError> {
    if value.is_finite() && (low..=high).contains(&value) {
        Ok(value)
    } else {
        Err(CseaError::Setting {
            what,
            value,
            expected,
        })
    }
}

/// Names that [`strategy_by_name`] knows.
pub const STRATEGIES: [&str; 4] = ["cs-ea", "random", "sweep", "ascent"];

/// The strategy of that name over `domain`. `options` holds the settings of CS-EA; the rivals
/// take its population and kernel length (lines of the sweep lie a kernel's reach apart, three
/// lengths), so that all are compared at equal size.
///
/// # Errors
/// An unknown name, or options outside their ranges.
pub fn strategy_by_name(
    name: &str,
    domain: Domain,
    options: CsEaOptions,
) -> Result<Box<dyn SearchStrategy>, CseaError> {
    match name {
        "cs-ea" => Ok(Box::new(CsEa::new(domain, options)?)),
        "random" => Ok(Box::new(RandomPoints::new(domain, options.population)?)),
        "sweep" => Ok(Box::new(Sweep::new(domain, 3.0 * options.kernel.length_m)?)),
        "ascent" => Ok(Box::new(Ascent::new(
            domain,
            options.population,
            options.kernel.length_m,
        )?)),
        other => Err(CseaError::Strategy(other.to_string())),
    }
}
