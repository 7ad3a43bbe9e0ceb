//! What the simulation gets wrong about readings, and the scenario with that mended.

use crate::TaskError;
use crate::extended::extended;
use ::gap::applied::Earlier;
use ::gap::plume::{Analysis, Options, Progress, Setup, analyse, apply};
use scenario::Scenario;
use scenario::observations::Observations;

/// What is asked of readings.
#[derive(Debug, Clone, Copy)]
pub struct Question<'a> {
    /// The scenario that describes the site and the base model, with its files.
    pub setup: &'a mission::Setup,
    /// The readings, with the wind.
    pub observations: &'a Observations,
    /// Whether their wind is the scenario's series ([`crate::measured::fill_wind`]).
    pub by_series: bool,
    /// A finding of other readings, which is scored on these; nothing is fitted then.
    pub earlier: Option<&'a Earlier>,
    /// Seed of the bootstrap.
    pub seed: u64,
}

/// Analyses readings against the plume of a scenario. Gives also the scenario with what was found.
///
/// # Errors
/// A scenario that describes no world, or readings of which nothing can be told.
pub fn of_plume(
    question: &Question<'_>,
    progress: &mut dyn FnMut(Progress),
) -> Result<(Analysis, Scenario), TaskError> {
    let (setup, observations) = (question.setup, question.observations);
    let mut base = Setup::new(&setup.scenario)?;
    base.classes.clone_from(&setup.classes);
    let options = Options {
        seed: question.seed,
        ..Options::default()
    };
    let analysis = match question.earlier {
        Some(earlier) => apply(&base, observations, earlier, &options, progress)?,
        None => analyse(&base, observations, &options, progress)?,
    };
    let mended = extended(&setup.scenario, &analysis, question.by_series);
    Ok((analysis, mended))
}
