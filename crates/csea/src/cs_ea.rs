//! The constrained-sampling evolutionary algorithm.
//!
//! Varela, Caamaño, Orjales, Deibe, López-Peña and Duro (2014), doi 10.1016/j.neucom.2013.03.060:
//! an evolutionary algorithm whose candidates cannot be evaluated at will. Each step makes a new
//! population of promising points from the old one and everything that has been sensed so far.
//! Basis here: DE/rand/1/bin with F = 0.9, CR = 0.1, NP = 100.
//!
//! The source's full text is not public; where its abstract is silent, this is chosen:
//! - *Fitness of a candidate* is what the samples near it say ([`Archive::estimate`]) plus a
//!   bonus for what is unseen: `estimate + curiosity · spread · √(1 / (1 + support))`. Without the
//!   bonus the population settles on the best sample of the first minutes; with it a place that
//!   has been visited often must be good to stay promising.
//! - *Old members are judged anew* at each step, since samples have been added.
//! - *A share of immigrants* replaces the least promising members at each step: differences in a
//!   population that has settled are small, and it could not leave again.

use rand::rngs::ChaCha8Rng;

use crate::archive::{Archive, Kernel, Neighbour};
use crate::differential::Differential;
use crate::domain::Domain;
use crate::{CseaError, Position, PromisingPoint, SearchStrategy, setting};

/// Settings of [`CsEa`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CsEaOptions {
    /// Members of the population NP, 4…10 000.
    pub population: usize,
    /// Differential weight F, 0…2.
    pub differential_weight: f64,
    /// Crossover rate CR, 0…1.
    pub crossover: f64,
    /// How samples speak for a place near them.
    pub kernel: Kernel,
    /// Weight of what is unseen, in standard deviations of the samples' values, 0…10.
    pub curiosity: f64,
    /// Share of the population replaced by random places at each step, 0…0.5.
    pub immigrants: f64,
}

impl Default for CsEaOptions {
    fn default() -> Self {
        Self {
            population: 100,
            differential_weight: 0.9,
            crossover: 0.1,
            kernel: Kernel {
                length_m: 100.0,
                neighbours: 8,
            },
            curiosity: 1.0,
            immigrants: 0.05,
        }
    }
}

/// CS-EA over DE/rand/1/bin.
#[derive(Debug)]
pub struct CsEa {
    domain: Domain,
    options: CsEaOptions,
    differential: Differential,
    members: Vec<Position>,
    points: Vec<PromisingPoint>,
    scratch: Vec<Neighbour>,
}

impl CsEa {
    /// A search over `domain`; its first population is drawn at the first step.
    ///
    /// # Errors
    /// A setting outside its range.
    pub fn new(domain: Domain, options: CsEaOptions) -> Result<Self, CseaError> {
        let (np, kernel) = (options.population, options.kernel);
        setting("population", np as f64, 4.0, 1e4, "4 to 10000 members")?;
        setting(
            "kernel_length_m",
            kernel.length_m,
            0.1,
            1e5,
            "0.1 to 100000 m",
        )?;
        setting(
            "neighbours",
            kernel.neighbours as f64,
            1.0,
            1e3,
            "1 to 1000",
        )?;
        setting("curiosity", options.curiosity, 0.0, 10.0, "0 to 10")?;
        setting("immigrants", options.immigrants, 0.0, 0.5, "0 to 0.5")?;
        Ok(Self {
            domain,
            options,
            differential: Differential::new(options.differential_weight, options.crossover)?,
            members: Vec::new(),
            points: Vec::new(),
            scratch: Vec::new(),
        })
    }

    fn fitness(&mut self, archive: &Archive, position: Position) -> f64 {
        let kernel = self.options.kernel;
        let estimate = archive.estimate(position, kernel, 1.0, &mut self.scratch);
        let unseen = (1.0 / (1.0 + estimate.support)).sqrt();
        estimate.value + self.options.curiosity * archive.spread() * unseen
    }

    /// The `immigrants` least promising members become places drawn at random.
    fn immigrate(&mut self, archive: &Archive, rng: &mut ChaCha8Rng) {
        let count = (self.options.immigrants * self.points.len() as f64).round() as usize;
        let mut order: Vec<usize> = (0..self.points.len()).collect();
        order.sort_by(|&a, &b| self.points[a].fitness.total_cmp(&self.points[b].fitness));
        for &index in order.iter().take(count) {
            let position = self.domain.draw(rng);
            let fitness = self.fitness(archive, position);
            self.points[index] = PromisingPoint { position, fitness };
        }
    }
}

impl SearchStrategy for CsEa {
    fn name(&self) -> &'static str {
        "cs-ea"
    }

    fn step(&mut self, archive: &Archive, rng: &mut ChaCha8Rng) -> &[PromisingPoint] {
        if self.points.is_empty() {
            for _ in 0..self.options.population {
                let position = self.domain.draw(rng);
                let fitness = self.fitness(archive, position);
                self.points.push(PromisingPoint { position, fitness });
            }
            return &self.points;
        }
        self.members.clear();
        self.members.extend(self.points.iter().map(|p| p.position));
        for target in 0..self.members.len() {
            let position = self
                .differential
                .trial(&self.members, target, &self.domain, rng);
            let trial = self.fitness(archive, position);
            let own = self.fitness(archive, self.members[target]);
            self.points[target] = if trial >= own {
                PromisingPoint {
                    position,
                    fitness: trial,
                }
            } else {
                PromisingPoint {
                    position: self.members[target],
                    fitness: own,
                }
            };
        }
        self.immigrate(archive, rng);
        &self.points
    }

    fn population(&self) -> &[PromisingPoint] {
        &self.points
    }
}
