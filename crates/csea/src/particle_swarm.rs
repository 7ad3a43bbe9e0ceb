//! Particle swarm, a baseline: each sampler is a particle that is drawn to the best place of its own and to that of all.
//!
//! Kennedy and Eberhart (1995), doi 10.1109/ICNN.1995.488968, with the constriction of Clerc and Kennedy (2002),
//! doi 10.1109/4235.985692. A sampler flies on along its particle's velocity until the next step.

use air::geo::Position;
use rand::RngExt;
use rand::rngs::ChaCha8Rng;

use crate::archive::{Archive, Sample};
use crate::domain::Domain;
use crate::strategy::{PromisingPoint, Sampler, SearchStrategy};

/// Constriction and acceleration (Clerc and Kennedy 2002: φ = 4.1).
const CONSTRICTION: f64 = 0.7298;
const ACCELERATION: f64 = 2.05;
/// A particle moves at most by this part of the box in a step, on each axis.
const MOST_PART: f64 = 0.25;

/// The swarm.
#[derive(Debug)]
pub struct ParticleSwarm {
    domain: Domain,
    best: Vec<Option<Sample>>,
    velocity: Vec<[f64; 3]>,
    points: Vec<PromisingPoint>,
}

impl ParticleSwarm {
    /// A swarm over `domain`, a particle for each of the team that directs it.
    pub fn new(domain: Domain) -> Self {
        Self {
            domain,
            best: Vec::new(),
            velocity: Vec::new(),
            points: Vec::new(),
        }
    }

    fn best_of_all(&self) -> Option<Sample> {
        let all = self.best.iter().flatten().copied();
        all.reduce(|best, s| if s.value > best.value { s } else { best })
    }

    fn moved(&mut self, k: usize, from: Position, rng: &mut ChaCha8Rng) -> Position {
        let here = from.coordinates();
        let (low, high) = (
            self.domain.low().coordinates(),
            self.domain.high().coordinates(),
        );
        let (own, all) = (self.best[k], self.best_of_all());
        for axis in 0..3 {
            let mut pull = |best: Option<Sample>| {
                let part: f64 = rng.random();
                best.map_or(0.0, |b| {
                    ACCELERATION * part * (b.position.coordinates()[axis] - here[axis])
                })
            };
            let pulled = self.velocity[k][axis] + pull(own) + pull(all);
            let most = MOST_PART * (high[axis] - low[axis]);
            self.velocity[k][axis] = (CONSTRICTION * pulled).clamp(-most, most);
        }
        let wanted = [0, 1, 2].map(|axis| here[axis] + self.velocity[k][axis]);
        let inside = if self.domain.contains(from) {
            from
        } else {
            self.domain.draw(rng)
        };
        self.domain
            .repair(Position::from_coordinates(wanted), inside, rng)
    }
}

impl SearchStrategy for ParticleSwarm {
    fn sense(&mut self, _time_s: f64, sampler: usize, sample: &Sample, _rng: &mut ChaCha8Rng) {
        if self.best.len() <= sampler {
            self.best.resize(sampler + 1, None);
        }
        if self.best[sampler].is_none_or(|best| sample.value > best.value) {
            self.best[sampler] = Some(*sample);
        }
    }

    fn step(&mut self, archive: &Archive, rng: &mut ChaCha8Rng) -> &[PromisingPoint] {
        if self.points.is_empty() {
            let (position, fitness) = (self.domain.draw(rng), archive.mean());
            self.points.push(PromisingPoint { position, fitness });
        }
        &self.points
    }

    fn population(&self) -> &[PromisingPoint] {
        &self.points
    }

    fn direct(&mut self, sampler: &Sampler, _cone_deg: f64, rng: &mut ChaCha8Rng) -> Position {
        let count = self.best.len().max(sampler.id + 1);
        self.best.resize(count, None);
        let (low, high) = (
            self.domain.low().coordinates(),
            self.domain.high().coordinates(),
        );
        while self.velocity.len() < count {
            let mut part = |axis: usize| {
                let drawn: f64 = rng.random();
                MOST_PART * (2.0 * drawn - 1.0) * (high[axis] - low[axis])
            };
            let velocity = [part(0), part(1), part(2)];
            self.velocity.push(velocity);
        }
        let position = self.moved(sampler.id, sampler.position, rng);
        let fitness = self.best[sampler.id].map_or(0.0, |b| b.value);
        let point = PromisingPoint { position, fitness };
        if self.points.len() <= sampler.id {
            self.points.resize(sampler.id + 1, point);
        }
        self.points[sampler.id] = point;
        position
    }
}
