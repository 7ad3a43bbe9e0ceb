//! Setpoints are safe for any fence, keep-out, team and wind.

use crate::common::{self, Miniature, as_pontes, assert_apart, assert_safe};
use air::geo::Enu;
use csea::Position;
use proptest::prelude::*;
use sc::Separation;
use sc::route_graph::RouteGraph;
use sc::separation::Corridor;
use scenario::Scenario;
use scenario::airspace::Airspace;

/// A fence around the site whose corners lie in order around it at random distances: often not
/// convex.
fn fence() -> impl Strategy<Value = Vec<[f64; 2]>> {
    proptest::collection::vec(2200.0..5000.0f64, 4..9).prop_map(|radii| {
        let frame = as_pontes(0).frame().unwrap();
        let count = radii.len() as f64;
        let corner = |(k, r): (usize, &f64)| {
            let at = Enu::default().displaced(360.0 * k as f64 / count, *r);
            let there = frame.to_geodetic(at);
            [there.lat_deg, there.lon_deg]
        };
        radii.iter().enumerate().map(corner).collect()
    })
}

fn scenario() -> impl Strategy<Value = Scenario> {
    let numbers = (
        0.0f64..900.0,
        0.0f64..360.0,
        60.0f64..400.0,
        200.0f64..500.0,
    );
    (fence(), numbers, 1usize..7, 0u64..1000).prop_map(
        |(polygon, (keep_out_m, from_deg, floor_m, band_m), count, seed)| {
            let mut s = as_pontes(1);
            s.fence.polygon = polygon;
            s.fence.keep_out_radius_m = keep_out_m;
            s.fence.floor_agl_m = floor_m;
            s.fence.ceiling_agl_m = floor_m + band_m;
            s.weather.wind_from_deg = from_deg;
            s.vehicles.drain(..6 - count);
            s.mission.seed = seed;
            s.mission.duration_s = 1500.0;
            s
        },
    )
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]

    #[test]
    fn ways_stay_inside_and_off_the_stacks(
        s in scenario(), from in (-4000.0..4000.0f64, -4000.0..4000.0f64),
        to in (-4000.0..4000.0f64, -4000.0..4000.0f64), margin_m in 1.0f64..150.0,
    ) {
        let airspace = Airspace::of(&s).unwrap();
        let (from, to) = (common::enu(from.0, from.1), common::enu(to.0, to.1));
        let way = RouteGraph::of(&airspace, margin_m).route(&airspace, from, to);
        if airspace.clearance_m(to) < margin_m {
            prop_assert!(way.is_none(), "a way to where nobody may be");
        } else if let Some(way) = way {
            prop_assert_eq!(*way.last().unwrap(), to);
            let mut at = from;
            for (k, &next) in way.iter().enumerate() {
                prop_assert!(airspace.clearance_m(next) >= margin_m - 1e-6);
                // The first leg holds what is left of the margin at its start; from outside, it
                // is the way in.
                let here_m = airspace.clearance_m(at);
                let held_m = if k == 0 { margin_m.min(here_m) } else { margin_m };
                if here_m >= 0.0 {
                    prop_assert!(airspace.leg_is_clear(at, next, held_m - 1e-5), "leg {k}");
                }
                at = next;
            }
        }
    }

    #[test]
    fn corridors_that_are_apart_hold_no_two_places_that_are_not(
        ends in proptest::collection::vec((-800.0..800.0f64, -800.0..800.0f64, 0.0..120.0f64), 4),
        parts in proptest::collection::vec((0.0..1.0f64, 0.0..1.0f64), 20),
    ) {
        let separation = Separation { distance_m: 150.0, height_m: 30.0 };
        let p: Vec<Position> = ends.iter().map(|e| Position::new(e.0, e.1, e.2)).collect();
        let corridor = |from, to| Corridor::straight(from, to, 0.0);
        let (a, b) = (corridor(p[0], p[1]), corridor(p[2], p[3]));
        prop_assert_eq!(separation.apart(&a, &b), separation.apart(&b, &a));
        let along = |c: &Corridor, t: f64| Position::new(
            c.from.at.east_m + t * (c.to.at.east_m - c.from.at.east_m),
            c.from.at.north_m + t * (c.to.at.north_m - c.from.at.north_m),
            c.from.height_m + t * (c.to.height_m - c.from.height_m),
        );
        if separation.apart(&a, &b) {
            for (s, t) in parts {
                let near = Separation { distance_m: 150.0 - 1e-6, height_m: 30.0 - 1e-6 };
                prop_assert!(near.holds(along(&a, s), along(&b, t)));
            }
        }
    }
}

/// That a mission keeps its distances, unless its fence leaves nowhere to fly, which is tested
/// elsewhere.
fn is_safe(scenario: Scenario) -> Result<(), TestCaseError> {
    prop_assume!(sc::SquadronController::new(&scenario).is_ok());
    let mut mini = Miniature::new(scenario);
    mini.run();
    assert_safe(&mini);
    assert_apart(&mini);
    Ok(())
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(3))]

    #[test]
    fn no_setpoint_of_a_mission_is_unsafe(s in scenario()) {
        is_safe(s)?;
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(12))]

    #[test]
    #[ignore = "second tier: a dozen missions"]
    fn no_setpoint_of_any_mission_is_unsafe(s in scenario()) {
        is_safe(s)?;
    }
}
