//! Differential evolution, scheme rand/1/bin (Storn and Price 1997,
//! doi 10.1023/A:1008202821328).

use rand::RngExt;
use rand::rngs::ChaCha8Rng;

use crate::domain::Domain;
use crate::error::{CseaError, setting};
use air::geo::Position;

/// Weights of DE/rand/1/bin.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DifferentialEvolution {
    weight: f64,
    crossover: f64,
}

impl DifferentialEvolution {
    /// Differential weight F, 0…2, and crossover rate CR, 0…1 (the seed paper: 0.9 and 0.1).
    ///
    /// # Errors
    /// A weight or rate outside its range.
    pub fn new(weight: f64, crossover: f64) -> Result<Self, CseaError> {
        Ok(Self {
            weight: setting("differential_weight", weight, 0.0, 2.0, "0 to 2")?,
            crossover: setting("crossover", crossover, 0.0, 1.0, "0 to 1")?,
        })
    }

    /// The trial of member `target`: v = a + F (b − c) of three other members drawn at random,
    /// crossed with the target coordinate by coordinate (one coordinate always from v), brought
    /// into `domain`.
    ///
    /// With fewer than four members nothing can be combined: the trial is a place drawn at random.
    pub fn trial(
        &self,
        members: &[Position],
        target: usize,
        domain: &Domain,
        rng: &mut ChaCha8Rng,
    ) -> Position {
        let Some(own) = members.get(target).filter(|_| members.len() >= 4) else {
            return domain.draw(rng);
        };
        let [a, b, c] = three_others(members.len(), target, rng).map(|i| members[i].coordinates());
        let mut trial = own.coordinates();
        // At least one coordinate crosses, else a trial could equal its target.
        let always = rng.random_range(0..3);
        for axis in 0..3 {
            let cross: f64 = rng.random();
            if axis == always || cross < self.crossover {
                trial[axis] = a[axis] + self.weight * (b[axis] - c[axis]);
            }
        }
        domain.repair(Position::from_coordinates(trial), *own, rng)
    }
}

/// Three different numbers below `count`, none of them `except`.
fn three_others(count: usize, except: usize, rng: &mut ChaCha8Rng) -> [usize; 3] {
    let mut taken = [except; 4];
    for filled in 1..4 {
        loop {
            let drawn = rng.random_range(0..count);
            if !taken[..filled].contains(&drawn) {
                taken[filled] = drawn;
                break;
            }
        }
    }
    [taken[1], taken[2], taken[3]]
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;

    #[test]
    fn trial_is_a_plus_f_b_minus_c_when_all_coordinates_cross() {
        // Four members: with target 0 the others are 1, 2, 3 in some order, so v is one of six.
        let members = [
            Position::new(0.0, 0.0, 0.0),
            Position::new(10.0, 0.0, 1.0),
            Position::new(0.0, 10.0, 2.0),
            Position::new(5.0, 5.0, 4.0),
        ];
        let domain = Domain::of_box(
            Position::new(-1e3, -1e3, -1e3),
            Position::new(1e3, 1e3, 1e3),
        )
        .unwrap();
        let de = DifferentialEvolution::new(0.9, 1.0).unwrap();
        let orders = [
            [1, 2, 3],
            [1, 3, 2],
            [2, 1, 3],
            [2, 3, 1],
            [3, 1, 2],
            [3, 2, 1],
        ];
        let expected = orders.map(|o: [usize; 3]| {
            let [a, b, c] = o.map(|i| members[i].coordinates());
            [0, 1, 2].map(|k| a[k] + 0.9 * (b[k] - c[k]))
        });
        let mut seen = [false; 6];
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        for _ in 0..200 {
            let v = de.trial(&members, 0, &domain, &mut rng).coordinates();
            let which = expected
                .iter()
                .position(|e| (0..3).all(|k| (e[k] - v[k]).abs() < 1e-12));
            seen[which.expect("not of the form a + F (b - c)")] = true;
        }
        assert_eq!(seen, [true; 6]);
    }

    #[test]
    fn without_crossover_exactly_one_coordinate_changes() {
        let mut rng = ChaCha8Rng::seed_from_u64(2);
        let domain =
            Domain::of_box(Position::new(0.0, 0.0, 0.0), Position::new(1.0, 1.0, 1.0)).unwrap();
        let members: Vec<_> = (0..20).map(|_| domain.draw(&mut rng)).collect();
        let de = DifferentialEvolution::new(0.9, 0.0).unwrap();
        for target in 0..20 {
            let trial = de.trial(&members, target, &domain, &mut rng).coordinates();
            let own = members[target].coordinates();
            assert_eq!((0..3).filter(|&k| trial[k] != own[k]).count(), 1);
        }
    }
}
