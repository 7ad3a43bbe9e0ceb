//! The Guardian's way home: to the take-off point around the stacks' keep-outs, and there in a
//! circle, of a multirotor at rest, at a height that no other vehicle of the team uses.

use crate::error::VaError;
use air::geo::{Enu, Geodetic, wrap_signed_deg};
use fdm::autopilot::Path;
use scenario::Scenario;

/// Radius of the circle at home, m.
const CIRCLE_M: f64 = 120.0;
/// Clearance from a keep-out on the way, m: room for a turn.
const MARGIN_M: f64 = 120.0;
/// Least height above the ground, m, where the ground rises above its layer.
const ABOVE_GROUND_M: f64 = 100.0;
/// The same of a multirotor, and its clearance from a keep-out, m.
const HOVERING_ABOVE_GROUND_M: f64 = 20.0;
const HOVERING_MARGIN_M: f64 = 10.0;

/// The way home of one vehicle.
#[derive(Debug, Clone)]
pub(crate) struct Guardian {
    home: Enu,
    layer_amsl_m: f64,
    stacks: Vec<Enu>,
    avoid_m: f64,
    hovers: bool,
}

impl Guardian {
    /// The way home of the vehicle at `index` of the team, with its own layer `layer_amsl_m`; it can stop in the air or
    /// not.
    pub(crate) fn new(
        scenario: &Scenario,
        index: usize,
        layer_amsl_m: f64,
        hovers: bool,
    ) -> Result<Self, VaError> {
        let frame = scenario.frame()?;
        let home = frame.to_enu(scenario.home(index)?);
        let (margin_m, circle_m) = if hovers {
            (HOVERING_MARGIN_M, 0.0)
        } else {
            (MARGIN_M, CIRCLE_M)
        };
        let avoid_m = scenario.fence.keep_out_radius_m + margin_m;
        Ok(Self {
            home,
            layer_amsl_m,
            // A keep-out that contains home cannot be avoided.
            stacks: scenario
                .sources
                .iter()
                .map(|s| frame.to_enu(Geodetic::new(s.lat_deg, s.lon_deg)))
                .filter(|s| s.distance_m(home) > avoid_m + circle_m)
                .collect(),
            avoid_m,
            hovers,
        })
    }

    /// The take-off point.
    pub(crate) fn home(&self) -> Enu {
        self.home
    }

    /// The height to fly at over ground of `ground_amsl_m`, m above mean sea level.
    pub(crate) fn alt_amsl_m(&self, ground_amsl_m: f64) -> f64 {
        let above_m = if self.hovers {
            HOVERING_ABOVE_GROUND_M
        } else {
            ABOVE_GROUND_M
        };
        self.layer_amsl_m.max(ground_amsl_m + above_m)
    }

    /// The path home from `at`: straight, or along the edge of a keep-out that is in the way.
    pub(crate) fn path(&self, at: Enu) -> Path {
        let in_the_way =
            |stack: &&Enu| air::area::distance_to_segment_m(**stack, at, self.home) < self.avoid_m;
        let nearest = self
            .stacks
            .iter()
            .filter(in_the_way)
            .min_by(|a, b| a.distance_m(at).total_cmp(&b.distance_m(at)));
        let Some(&stack) = nearest else {
            if self.hovers {
                return Path::GoTo {
                    north_m: self.home.north_m,
                    east_m: self.home.east_m,
                };
            }
            return Path::Orbit {
                north_m: self.home.north_m,
                east_m: self.home.east_m,
                radius_m: CIRCLE_M,
                clockwise: true,
            };
        };
        let towards_deg = at.bearing_deg(stack);
        let home_deg = wrap_signed_deg(at.bearing_deg(self.home) - towards_deg);
        // Around on the side of home: the shorter way.
        let side = if home_deg < 0.0 { -1.0 } else { 1.0 };
        let distance_m = at.distance_m(stack);
        let off_deg = if distance_m > self.avoid_m {
            (self.avoid_m / distance_m).asin().to_degrees()
        } else {
            // Inside: the more outwards the deeper.
            90.0 + 90.0 * (1.0 - distance_m / self.avoid_m)
        };
        Path::Course {
            deg: air::geo::wrap_deg(towards_deg + side * off_deg),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const AS_PONTES: &str = include_str!("../../../scenarios/as-pontes.toml");

    fn guardian(index: usize) -> Guardian {
        let scenario = Scenario::parse("s", AS_PONTES).unwrap();
        Guardian::new(&scenario, index, scenario.layers_amsl_m()[index], false).unwrap()
    }

    #[test]
    fn every_vehicle_has_a_height_of_its_own() {
        let mut layers: Vec<f64> = (0..6).map(|k| guardian(k).layer_amsl_m).collect();
        layers.sort_by(f64::total_cmp);
        assert!(layers.windows(2).all(|w| w[1] - w[0] >= 30.0), "{layers:?}");
        assert_eq!(guardian(0).alt_amsl_m(800.0), 900.0);
    }

    proptest! {
        /// A point that follows the path in steps of 20 m comes home, and from outside never
        /// enters the keep-out of 1000 m.
        #[test]
        fn the_way_home_goes_around_the_stack(bearing in 0.0..360.0f64, distance in 50.0..5000.0f64) {
            let guardian = guardian(0);
            let stack = guardian.stacks[0];
            let mut at = stack.displaced(bearing, distance);
            let mut nearest_m = f64::INFINITY;
            for _ in 0..1000 {
                let course = match guardian.path(at) {
                    Path::Course { deg } => deg,
                    _ => at.bearing_deg(guardian.home),
                };
                at = at.displaced(course, 20.0);
                nearest_m = nearest_m.min(at.distance_m(stack));
                if at.distance_m(guardian.home) < CIRCLE_M {
                    break;
                }
            }
            prop_assert!(at.distance_m(guardian.home) < CIRCLE_M, "{at:?}");
            if distance > guardian.avoid_m {
                prop_assert!(nearest_m > 1000.0, "{nearest_m}");
            }
        }
    }
}
