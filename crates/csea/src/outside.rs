//! Search directed by an external program: each vehicle flies to the target last requested for it.

use air::geo::Position;
use rand::rngs::ChaCha8Rng;

use crate::archive::Archive;
use crate::domain::Domain;
use crate::strategy::{PromisingPoint, Sampler, SearchStrategy};

/// The name of the strategy that follows an external program.
pub const OUTSIDE: &str = "outside";

/// Follows wishes. One of whom nothing was wished yet stays where it is.
#[derive(Debug)]
pub struct Outside {
    /// By the team's numbers.
    wished: Vec<Option<Position>>,
    /// Somewhere to look, as long as nothing was wished.
    nowhere: PromisingPoint,
    points: Vec<PromisingPoint>,
}

impl Outside {
    /// A strategy over `domain` that waits for wishes.
    pub fn new(domain: &Domain) -> Self {
        let nowhere = PromisingPoint {
            position: domain.inside(),
            fitness: 0.0,
        };
        Self {
            wished: Vec::new(),
            nowhere,
            points: Vec::new(),
        }
    }
}

impl SearchStrategy for Outside {
    fn wish(&mut self, sampler: usize, place: Position) {
        if self.wished.len() <= sampler {
            self.wished.resize(sampler + 1, None);
        }
        self.wished[sampler] = Some(place);
    }

    fn step(&mut self, _archive: &Archive, _rng: &mut ChaCha8Rng) -> &[PromisingPoint] {
        let wished = self.wished.iter().flatten();
        self.points = wished
            .map(|position| PromisingPoint {
                position: *position,
                fitness: 0.0,
            })
            .collect();
        if self.points.is_empty() {
            self.points.push(self.nowhere);
        }
        &self.points
    }

    fn population(&self) -> &[PromisingPoint] {
        &self.points
    }

    fn direct(&mut self, sampler: &Sampler, _cone_deg: f64, _rng: &mut ChaCha8Rng) -> Position {
        let wished = self.wished.get(sampler.id).copied().flatten();
        wished.unwrap_or(sampler.position)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use air::geo::Enu;
    use rand::SeedableRng as _;

    #[test]
    fn each_looks_where_it_was_last_wished_to() {
        let at = |east_m: f64, height_m: f64| Position {
            at: Enu::new(east_m, 0.0),
            height_m,
        };
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        let domain = Domain::new(at(-100.0, 0.0), at(100.0, 50.0), |_| true, &mut rng);
        let mut outside = Outside::new(&domain.unwrap());
        let here = at(7.0, 20.0);
        let sampler = |id| Sampler {
            id,
            position: here,
            heading_deg: 0.0,
            speed_m_s: 18.0,
            turn_radius_m: 60.0,
            climb_m_s: 3.0,
        };
        assert_eq!(outside.direct(&sampler(2), 45.0, &mut rng), here);
        outside.wish(2, at(50.0, 30.0));
        outside.wish(2, at(60.0, 30.0));
        assert_eq!(outside.direct(&sampler(2), 45.0, &mut rng), at(60.0, 30.0));
        assert_eq!(outside.direct(&sampler(0), 45.0, &mut rng), here);
    }
}
