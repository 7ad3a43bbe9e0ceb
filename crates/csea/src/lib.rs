//! Where to look next: search strategies for samplers that cannot be anywhere at will.
//!
//! A team of moving samplers looks for the highest value of a field. What it senses on its way
//! goes to an [`Archive`]; a [`SearchStrategy`] turns the archive into [`PromisingPoint`]s inside a
//! [`Domain`]; each sampler flies to one of those that lie ahead of it ([`choose_within_cone`])
//! until the next step. Plumage's own strategy is the constrained-sampling evolutionary
//! algorithm [`CsEa`] (Varela et al. 2014, doi 10.1016/j.neucom.2013.03.060). [`ByPosterior`] flies by a
//! [`Belief`] of the plume; [`Infotaxis`] and [`PatternFlight`] are rivals behind the same trait, [`ParticleSwarm`],
//! [`Ascent`] and [`RandomPoints`] baselines to compare with; all are chosen by name with [`strategy_by_name`].
//! [`Outside`] follows an external program.
//!
//! ```
//! use csea::{Archive, ArchiveOptions, CsEa, CsEaOptions, Domain, Position, Sample, SearchStrategy};
//! use rand::{SeedableRng, rngs::ChaCha8Rng};
//!
//! let (low, high) = (Position::new(0.0, 0.0, 400.0), Position::new(1000.0, 1000.0, 500.0));
//! let domain = Domain::of_box(low, high)?;
//! let mut archive = Archive::new(ArchiveOptions::default())?;
//! let position = Position::new(700.0, 200.0, 450.0);
//! archive.push(Sample { position, value: 620.0 })?;
//! let mut strategy = CsEa::new(domain.clone(), CsEaOptions::default())?;
//! let points = strategy.step(&archive, &mut ChaCha8Rng::seed_from_u64(1));
//! assert_eq!(points.len(), 100);
//! assert!(points.iter().all(|p| domain.contains(p.position)));
//! # Ok::<(), csea::CseaError>(())
//! ```
//!
//! Pure: no clock, file, socket, environment or global random number. Random numbers come from
//! a generator that the caller passes in, so that a seed repeats a search bit for bit.

mod archive;
mod baselines;
mod belief;
mod by_name;
mod cone;
mod cs_ea;
mod differential_evolution;
mod domain;
mod error;
mod infotaxis;
mod legs;
mod outside;
mod particle_swarm;
mod posterior;
mod strategy;

pub use air::geo::Position;
pub use archive::{Archive, ArchiveOptions, FieldEstimate, Neighbour, Sample, SmoothingKernel};
pub use baselines::{Ascent, RandomPoints};
pub use belief::{Belief, PlumeGuess, PlumePrior};
pub use by_name::{BASELINES, STRATEGIES, strategy_by_name};
pub use cone::choose_within_cone;
pub use cs_ea::{CsEa, CsEaOptions};
pub use differential_evolution::DifferentialEvolution;
pub use domain::Domain;
pub use error::CseaError;
pub use infer::Estimate;
pub use infotaxis::Infotaxis;
pub use legs::PatternFlight;
pub use outside::{OUTSIDE, Outside};
pub use particle_swarm::ParticleSwarm;
pub use posterior::ByPosterior;
pub use strategy::{PromisingPoint, Sampler, SearchStrategy};
