//! Strategies by the names that scenarios give them.

use crate::baselines::{Ascent, RandomPoints};
use crate::belief::PlumePrior;
use crate::cs_ea::{CsEa, CsEaOptions};
use crate::domain::Domain;
use crate::error::CseaError;
use crate::infotaxis::Infotaxis;
use crate::legs::PatternFlight;
use crate::outside::{OUTSIDE, Outside};
use crate::particle_swarm::ParticleSwarm;
use crate::posterior::ByPosterior;
use crate::strategy::SearchStrategy;
use rand::rngs::ChaCha8Rng;

/// Names of strategies of its own that [`strategy_by_name`] knows; `sweep` is another one of `lawnmower`.
pub const STRATEGIES: [&str; 8] = [
    "posterior",
    "lawnmower",
    "arcs",
    "infotaxis",
    "particle-swarm",
    "cs-ea",
    "ascent",
    "random",
];

/// Those of [`STRATEGIES`] that are baselines, kept for comparison: in `docs/search.md` particle swarm finds the peak in 0
/// to 2 of 20 runs, ascent in 0 to 5.
pub const BASELINES: [&str; 3] = ["particle-swarm", "ascent", "random"];

/// The strategy of that name over `domain`. `options` holds the settings of CS-EA; others take its population and kernel
/// length. `prior` is what is known of the plume: the pattern flights take source, direction and height from it, `posterior` and
/// `infotaxis` begin their belief with it.
///
/// # Errors
/// An unknown name, options outside their ranges, or a prior that describes no plume.
pub fn strategy_by_name(
    name: &str,
    domain: Domain,
    options: CsEaOptions,
    prior: &PlumePrior,
    rng: &mut ChaCha8Rng,
) -> Result<Box<dyn SearchStrategy>, CseaError> {
    let count = options.population;
    Ok(match name {
        "posterior" => Box::new(ByPosterior::new(domain, prior.clone(), count, rng)?),
        "lawnmower" | "sweep" => Box::new(PatternFlight::lawnmower(&domain, prior)),
        "arcs" => Box::new(PatternFlight::arcs(&domain, prior)),
        "infotaxis" => Box::new(Infotaxis::new(domain, prior.clone(), count, rng)?),
        "particle-swarm" => Box::new(ParticleSwarm::new(domain)),
        "cs-ea" => Box::new(CsEa::new(domain, options)?),
        "ascent" => Box::new(Ascent::new(domain, count, options.kernel.length_m)?),
        "random" => Box::new(RandomPoints::new(domain, count)?),
        OUTSIDE => Box::new(Outside::new(&domain)),
        other => {
            return Err(CseaError::UnknownStrategy {
                name: other.to_owned(),
                known: format!(
                    "{}, {OUTSIDE} (baselines: {})",
                    STRATEGIES.join(", "),
                    BASELINES.join(", ")
                ),
            });
        }
    })
}
