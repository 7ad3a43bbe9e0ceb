//! The approaches of all vehicles, and which of them are in each other's way. Every decision needs them, and they change
//! with the estimate of the wind only.

use air::geo::Enu;
use scenario::airspace::distance_between_segments_m;

/// How approaches lie, whatever the wind.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct ApproachGeometry {
    /// Centre of the circle from home, m downwind and to the left of the approach.
    pub circle_m: (f64, f64),
    /// Approaches closer than this are in each other's way, m.
    pub apart_m: f64,
}

/// The approach of each vehicle of a team, from the circle beside it to home.
#[derive(Debug, Clone)]
pub(super) struct Approaches {
    geometry: ApproachGeometry,
    downwind_deg: f64,
    homes: Vec<Enu>,
    circles: Vec<Enu>,
    /// For each vehicle the others whose approach is in the way of its own.
    neighbours: Vec<Vec<u32>>,
}

impl Approaches {
    /// The approaches to `homes` against a wind that blows towards `downwind_deg`.
    pub(super) fn new(homes: Vec<Enu>, geometry: ApproachGeometry, downwind_deg: f64) -> Self {
        let (downwind_m, left_m) = geometry.circle_m;
        // The approach is against the wind: its left is to the right of where the wind goes.
        let circle = |home: &Enu| {
            home.displaced(downwind_deg, downwind_m)
                .displaced(downwind_deg + 90.0, left_m)
        };
        let mut approaches = Self {
            geometry,
            downwind_deg,
            circles: homes.iter().map(circle).collect(),
            neighbours: vec![Vec::new(); homes.len()],
            homes,
        };
        approaches.find_neighbours();
        approaches
    }

    /// Takes in another estimate of the wind.
    pub(super) fn turn_to(&mut self, downwind_deg: f64) {
        if downwind_deg != self.downwind_deg {
            let homes = std::mem::take(&mut self.homes);
            *self = Self::new(homes, self.geometry, downwind_deg);
        }
    }

    fn find_neighbours(&mut self) {
        let (downwind_m, left_m) = self.geometry.circle_m;
        // All approaches are equal and parallel: those of homes farther apart than this do not meet.
        let reach_m = downwind_m + left_m + self.geometry.apart_m;
        let mut from_west: Vec<u32> = (0..self.homes.len() as u32).collect();
        let east_m = |k: u32| self.homes[k as usize].east_m;
        from_west.sort_by(|&a, &b| east_m(a).total_cmp(&east_m(b)));
        let mut pairs = Vec::new();
        for (k, &a) in from_west.iter().enumerate() {
            let within = |b: &&u32| east_m(**b) - east_m(a) <= reach_m;
            let near = from_west[k + 1..].iter().take_while(within);
            pairs.extend(
                near.map(|&b| (a, b))
                    .filter(|&(a, b)| self.meet(a as usize, b as usize)),
            );
        }
        for (a, b) in pairs {
            self.neighbours[a as usize].push(b);
            self.neighbours[b as usize].push(a);
        }
    }

    /// Whether the landings of two vehicles are in each other's way.
    pub(super) fn meet(&self, a: usize, b: usize) -> bool {
        let (from_a, from_b) = (self.circles[a], self.circles[b]);
        distance_between_segments_m(self.homes[a], from_a, self.homes[b], from_b)
            < self.geometry.apart_m
    }

    /// Centre of the circle beside a vehicle's approach.
    pub(super) fn circle(&self, index: usize) -> Enu {
        self.circles[index]
    }

    /// The others whose landings are in the way of that of the vehicle at `index`.
    pub(super) fn neighbours(&self, index: usize) -> impl Iterator<Item = usize> {
        self.neighbours[index].iter().map(|&other| other as usize)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const GEOMETRY: ApproachGeometry = ApproachGeometry {
        circle_m: (772.0, 100.0),
        apart_m: 490.0,
    };

    proptest! {
        #[test]
        fn neighbours_are_all_pairs_that_meet(
            places in prop::collection::vec((-4000.0..4000.0f64, -4000.0..4000.0f64), 1..40),
            winds_deg in (0.0..360.0f64, 0.0..360.0f64),
        ) {
            let homes: Vec<Enu> = places.iter().map(|&(east, north)| Enu::new(east, north)).collect();
            let mut approaches = Approaches::new(homes, GEOMETRY, winds_deg.0);
            approaches.turn_to(winds_deg.1);
            for a in 0..places.len() {
                let mut found: Vec<usize> = approaches.neighbours(a).collect();
                found.sort_unstable();
                let all = (0..places.len()).filter(|&b| b != a && approaches.meet(a, b));
                prop_assert_eq!(found, all.collect::<Vec<_>>());
            }
        }
    }
}
