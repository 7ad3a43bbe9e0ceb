//! Strategies by the names that scenarios give them.

use crate::baselines::{Ascent, RandomPoints, Sweep};
use crate::cs_ea::{CsEa, CsEaOptions};
use crate::domain::Domain;
use crate::error::CseaError;
use crate::strategy::SearchStrategy;

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
        other => Err(CseaError::UnknownStrategy {
            name: other.to_owned(),
            known: STRATEGIES.join(", "),
        }),
    }
}
