//! Baselines to compare CS-EA with: what a team could do without it.

use rand::RngExt;
use rand::rngs::ChaCha8Rng;
use rand_distr::StandardNormal;

use crate::archive::{Archive, Neighbour};
use crate::domain::Domain;
use crate::error::{CseaError, setting};
use crate::strategy::{PromisingPoint, SearchStrategy};
use air::geo::Position;

/// Random search, a baseline: places drawn evenly from the domain, whatever has been sensed.
#[derive(Debug)]
pub struct RandomPoints {
    domain: Domain,
    count: usize,
    points: Vec<PromisingPoint>,
}

impl RandomPoints {
    /// `count` new places at each step, 1…10 000.
    ///
    /// # Errors
    /// A count outside its range.
    pub fn new(domain: Domain, count: usize) -> Result<Self, CseaError> {
        setting("population", count as f64, 1.0, 1e4, "1 to 10000 members")?;
        Ok(Self {
            domain,
            count,
            points: Vec::new(),
        })
    }
}

impl SearchStrategy for RandomPoints {
    fn step(&mut self, _archive: &Archive, rng: &mut ChaCha8Rng) -> &[PromisingPoint] {
        let Self {
            domain,
            count,
            points,
        } = self;
        points.clear();
        points.extend((0..*count).map(|_| PromisingPoint {
            position: domain.draw(rng),
            fitness: 0.0,
        }));
        points
    }

    fn population(&self) -> &[PromisingPoint] {
        &self.points
    }
}

/// Steepest ascent, a baseline: places up the gradient that the samples around the best one show.
#[derive(Debug)]
pub struct Ascent {
    domain: Domain,
    count: usize,
    length_m: f64,
    scratch: Vec<Neighbour>,
    points: Vec<PromisingPoint>,
}

impl Ascent {
    /// `count` places at each step, scattered by `length_m` around one step of `length_m` up the
    /// gradient; places drawn at random while nothing has been sensed.
    ///
    /// # Errors
    /// A count outside 1…10 000 or a length outside 0.1…100 000 m.
    pub fn new(domain: Domain, count: usize, length_m: f64) -> Result<Self, CseaError> {
        setting("population", count as f64, 1.0, 1e4, "1 to 10000 members")?;
        setting("kernel_length_m", length_m, 0.1, 1e5, "0.1 to 100000 m")?;
        Ok(Self {
            domain,
            count,
            length_m,
            scratch: Vec::new(),
            points: Vec::new(),
        })
    }

    /// Direction of the covariance of value and place among the samples around `centre`: up the
    /// gradient, scaled by how far the samples reach along each axis.
    fn gradient(&mut self, archive: &Archive, centre: Position) -> [f64; 3] {
        archive.nearest(centre, 64, 3.0 * self.length_m, &mut self.scratch);
        let near = || self.scratch.iter().map(|n| archive.samples()[n.index]);
        let mean = near().map(|s| s.value).sum::<f64>() / self.scratch.len().max(1) as f64;
        let mut slope = [0.0; 3];
        for sample in near() {
            let (at, from) = (sample.position.coordinates(), centre.coordinates());
            for axis in 0..3 {
                slope[axis] += (sample.value - mean) * (at[axis] - from[axis]);
            }
        }
        let size = slope.iter().map(|s| s * s).sum::<f64>().sqrt();
        slope.map(|s| if size > 0.0 { s / size } else { 0.0 })
    }
}

impl SearchStrategy for Ascent {
    fn step(&mut self, archive: &Archive, rng: &mut ChaCha8Rng) -> &[PromisingPoint] {
        let best = archive.best();
        let gradient = best.map(|b| self.gradient(archive, b.position));
        self.points.clear();
        for _ in 0..self.count {
            let position = match (best, gradient) {
                (Some(best), Some(gradient)) => {
                    let from = best.position.coordinates();
                    let aim = [0, 1, 2].map(|axis| {
                        let scatter: f64 = rng.sample(StandardNormal);
                        from[axis] + self.length_m * (gradient[axis] + scatter)
                    });
                    let from = if self.domain.contains(best.position) {
                        best.position
                    } else {
                        self.domain.draw(rng)
                    };
                    self.domain
                        .repair(Position::from_coordinates(aim), from, rng)
                }
                _ => self.domain.draw(rng),
            };
            let fitness = best.map_or(0.0, |b| b.value);
            self.points.push(PromisingPoint { position, fitness });
        }
        &self.points
    }

    fn population(&self) -> &[PromisingPoint] {
        &self.points
    }
}
