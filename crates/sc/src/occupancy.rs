//! Where all vehicles may be during one decision, by boxes around it: of a large team most are too far from a corridor to
//! be compared with it exactly.

use air::geo::Enu;
use csea::Position;

use crate::separation::{Corridor, Separation};

/// A box of places, m: east, north and height.
#[derive(Debug, Clone, Copy)]
struct Bounds {
    low: [f64; 3],
    high: [f64; 3],
}

impl Bounds {
    const NOWHERE: Self = Self {
        low: [f64::INFINITY; 3],
        high: [f64::NEG_INFINITY; 3],
    };

    /// Around a corridor, with its turns and its orbit.
    fn of(corridor: &Corridor) -> Self {
        let aside_m = corridor.aside_m.max(corridor.orbit_m);
        let margins_m = [aside_m, aside_m, 0.0];
        let [from, to] = [corridor.from, corridor.to].map(coordinates_m);
        Self {
            low: std::array::from_fn(|k| from[k].min(to[k]) - margins_m[k]),
            high: std::array::from_fn(|k| from[k].max(to[k]) + margins_m[k]),
        }
    }

    fn joined(self, other: Self) -> Self {
        Self {
            low: std::array::from_fn(|k| self.low[k].min(other.low[k])),
            high: std::array::from_fn(|k| self.high[k].max(other.high[k])),
        }
    }

    /// Grown by the separation, and a millimetre for what rounding may do to the exact distances.
    fn grown(self, separation: &Separation) -> Self {
        let (distance_m, height_m) = (separation.distance_m + 1e-3, separation.height_m + 1e-3);
        let by_m = [distance_m, distance_m, height_m];
        Self {
            low: std::array::from_fn(|k| self.low[k] - by_m[k]),
            high: std::array::from_fn(|k| self.high[k] + by_m[k]),
        }
    }

    fn meets(&self, other: &Self) -> bool {
        (0..3).all(|k| self.low[k] <= other.high[k] && other.low[k] <= self.high[k])
    }
}

fn coordinates_m(position: Position) -> [f64; 3] {
    [position.at.east_m, position.at.north_m, position.height_m]
}

/// All heights over what may be within the separation of corridors around some places.
pub(crate) struct Column(Bounds);

impl Column {
    /// For corridors within `margin_m` of the box around `places`.
    pub(crate) fn around(places: &[Enu], margin_m: f64, separation: &Separation) -> Self {
        let column = |at: &Enu| Bounds {
            low: [
                at.east_m - margin_m,
                at.north_m - margin_m,
                f64::NEG_INFINITY,
            ],
            high: [at.east_m + margin_m, at.north_m + margin_m, f64::INFINITY],
        };
        let hull = places.iter().map(column);
        Self(hull.fold(Bounds::NOWHERE, Bounds::joined).grown(separation))
    }

    /// Whether a corridor may be within the separation of one of those in the column.
    pub(crate) fn holds(&self, corridor: &Corridor) -> bool {
        self.0.meets(&Bounds::of(corridor))
    }
}

/// What one vehicle occupies.
#[derive(Debug, Clone, Default)]
pub(crate) struct Occupied {
    /// Its corridors until the end of its leg.
    pub corridors: Vec<Corridor>,
    /// The circle at the end of its way, where that is not the end of its leg.
    pub end: Option<Corridor>,
}

/// What all vehicles occupy.
#[derive(Debug, Clone)]
pub(crate) struct Occupancy {
    bounds: Vec<Bounds>,
    occupied: Vec<Occupied>,
}

impl Occupancy {
    pub(crate) fn new(vehicles: impl Iterator<Item = Occupied>) -> Self {
        let occupied: Vec<Occupied> = vehicles.collect();
        let bounds = occupied.iter().map(bounds_of).collect();
        Self { bounds, occupied }
    }

    /// A vehicle has other orders.
    pub(crate) fn update(&mut self, index: usize, occupied: Occupied) {
        self.bounds[index] = bounds_of(&occupied);
        self.occupied[index] = occupied;
    }

    /// The vehicles that a column may hold.
    pub(crate) fn within(&self, column: &Column) -> Vec<usize> {
        let bounds = self.bounds.iter().enumerate();
        bounds
            .filter(|(_, bounds)| column.0.meets(bounds))
            .map(|(index, _)| index)
            .collect()
    }

    /// Whether all vehicles that may be within the separation of a corridor pass a test, among those at `among` if
    /// given: all others are apart from it.
    pub(crate) fn all_near(
        &self,
        corridor: &Corridor,
        separation: &Separation,
        among: Option<&[usize]>,
        test: impl Fn(usize, &Occupied) -> bool,
    ) -> bool {
        let around = Bounds::of(corridor).grown(separation);
        let passes =
            |index: usize| !around.meets(&self.bounds[index]) || test(index, &self.occupied[index]);
        match among {
            Some(among) => among.iter().all(|&index| passes(index)),
            None => (0..self.bounds.len()).all(passes),
        }
    }
}

fn bounds_of(occupied: &Occupied) -> Bounds {
    let corridors = occupied.corridors.iter().chain(&occupied.end);
    corridors
        .map(Bounds::of)
        .fold(Bounds::NOWHERE, Bounds::joined)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn corridor() -> impl Strategy<Value = Corridor> {
        let place = || (-900.0..900.0f64, -900.0..900.0f64, 300.0..500.0f64);
        let position = |(e, n, h)| Position::new(e, n, h);
        (place(), place(), 0.0..360.0f64, any::<bool>()).prop_map(move |(a, b, deg, turns)| {
            let (from, to) = (position(a), position(b));
            if turns {
                Corridor::turning(from, deg, to, 105.0)
            } else {
                Corridor::straight(from, to, 105.0)
            }
        })
    }

    proptest! {
        /// What is not near is apart, so that a look at those near alone finds the same as one at all.
        #[test]
        fn what_is_not_near_is_apart(own in corridor(), others in prop::collection::vec((corridor(), any::<bool>()), 1..20)) {
            let separation = Separation { distance_m: 175.0, height_m: 36.0 };
            let occupied = |(corridor, is_end): &(Corridor, bool)| Occupied {
                corridors: if *is_end { Vec::new() } else { vec![*corridor] },
                end: is_end.then_some(*corridor),
            };
            let occupancy = Occupancy::new(others.iter().map(occupied));
            let near = std::cell::RefCell::new(Vec::new());
            let note = |k: usize, _: &Occupied| {
                near.borrow_mut().push(k);
                true
            };
            prop_assert!(occupancy.all_near(&own, &separation, None, note));
            let places = [own.from.at, own.to.at];
            let column = Column::around(&places, own.orbit_m, &separation);
            let within = occupancy.within(&column);
            for (k, (other, _)) in others.iter().enumerate() {
                prop_assert!(near.borrow().contains(&k) || separation.apart(&own, other));
                prop_assert!(within.contains(&k) || separation.apart(&own, other));
                prop_assert_eq!(within.contains(&k), column.holds(other));
            }
        }
    }
}
