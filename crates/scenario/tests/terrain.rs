//! An airspace that follows the terrain, and ways through it.

use air::geo::{Enu, Geodetic, Position};
use air::terrain::Terrain;
use proptest::prelude::*;
use scenario::Scenario;
use scenario::airspace::Airspace;
use std::sync::LazyLock;

const MOUNTAINS: &str = include_str!("../../../scenarios/mountains.toml");
const GROUND: &[u8] = include_bytes!("../../../scenarios/mountains.asc");
/// What a vehicle climbs in 100 m of way, m, and sinks.
const CLIMB: f64 = 7.0;
const SINK: f64 = 20.0;

static OVER_MOUNTAINS: LazyLock<(Airspace, Terrain, Scenario)> = LazyLock::new(|| {
    let scenario = Scenario::parse("m.toml", MOUNTAINS).unwrap();
    let site = Geodetic {
        lat_deg: scenario.site.lat_deg,
        lon_deg: scenario.site.lon_deg,
    };
    let terrain = Terrain::read("m.asc", GROUND, site, 600.0).unwrap();
    let airspace = Airspace::of(&scenario).unwrap().over(&terrain);
    (airspace, terrain, scenario)
});

/// Flies a leg of a way: to its height at once, and on only from high enough.
fn lowest_over_ground_m(
    airspace: &Airspace,
    terrain: &Terrain,
    from: Position,
    leg: &[Position],
) -> f64 {
    let (mut here, mut lowest_m) = (from, f64::INFINITY);
    for part in leg {
        let steps = (here.at.distance_m(part.at) / 10.0).ceil().max(1.0);
        let start = here.at;
        for k in 1..=steps as usize {
            let share = k as f64 / steps;
            here.at = Enu {
                east_m: start.east_m + share * (part.at.east_m - start.east_m),
                north_m: start.north_m + share * (part.at.north_m - start.north_m),
            };
            let off_m = part.height_m - here.height_m;
            here.height_m += off_m.clamp(-SINK / 10.0, CLIMB / 10.0);
            let ground_m = terrain.ground_amsl_m(airspace.frame().to_geodetic(here.at));
            lowest_m = lowest_m.min(here.height_m - ground_m);
        }
        if !airspace.is_high_enough(here.height_m, *part) {
            here.height_m = part.height_m;
        }
    }
    lowest_m
}

proptest! {
    #[test]
    fn a_way_keeps_above_the_floor(
        from in (-3000.0..3500.0f64, -2500.0..3500.0f64, 0.0..1.0f64),
        to in (-3000.0..3500.0f64, -2500.0..3500.0f64, 0.0..1.0f64),
    ) {
        let (airspace, terrain, scenario) = &*OVER_MOUNTAINS;
        let place = |(east_m, north_m, share): (f64, f64, f64)| {
            let at = Enu { east_m, north_m };
            let (floor_m, ceiling_m) = airspace.heights_at_amsl_m(at);
            Position { at, height_m: floor_m + share * (ceiling_m - floor_m) }
        };
        let (from, to) = (place(from), place(to));
        let legs = airspace.way(from, &[to.at], to.height_m);
        prop_assert_eq!(legs.len(), 1);
        prop_assert_eq!(legs[0].last().copied(), Some(to));
        // A vehicle may go on from 12 m too low; the floor counts from the highest ground within 120 m.
        let lowest_m = lowest_over_ground_m(airspace, terrain, from, &legs[0]);
        prop_assert!(lowest_m >= scenario.fence.floor_agl_m - 12.0, "{}", lowest_m);
    }
}

#[test]
fn floor_and_ceiling_count_from_the_ground_below() {
    let (airspace, terrain, scenario) = &*OVER_MOUNTAINS;
    // On the slope north-west of the valley.
    let at = Enu {
        east_m: -1100.0,
        north_m: 1900.0,
    };
    let ground_m = terrain.ground_amsl_m(airspace.frame().to_geodetic(at));
    assert!(ground_m > 700.0, "{ground_m}");
    let (floor_m, ceiling_m) = airspace.heights_at_amsl_m(at);
    // The highest ground within 120 m and a cell is not more than a slope of 0.3 over 200 m higher.
    let above_m = floor_m - ground_m - scenario.fence.floor_agl_m;
    assert!((0.0..60.0).contains(&above_m), "{above_m}");
    assert!((ceiling_m - ground_m - scenario.fence.ceiling_agl_m).abs() < 15.0);
    let place = |height_m| Position { at, height_m };
    assert!(airspace.contains(place(floor_m + 1.0), 0.0));
    assert!(!airspace.contains(place(floor_m - 1.0), 0.0));
    assert!(!airspace.contains(place(ceiling_m + 1.0), 0.0));
}

#[test]
fn flat_ground_has_no_parts_and_follows_terrain_needs_one() {
    let flat = MOUNTAINS.replace("follows_terrain = true\n", "");
    let scenario = Scenario::parse("m.toml", &flat).unwrap();
    let airspace = Airspace::of(&scenario).unwrap();
    let from = Position::new(0.0, 1000.0, 800.0);
    let corners = [
        Enu {
            east_m: 1500.0,
            north_m: 1500.0,
        },
        Enu {
            east_m: 2500.0,
            north_m: 0.0,
        },
    ];
    let legs = airspace.way(from, &corners, 900.0);
    let expected: Vec<Vec<Position>> = corners
        .iter()
        .map(|&at| {
            vec![Position {
                at,
                height_m: 900.0,
            }]
        })
        .collect();
    assert_eq!(legs, expected);
    let nothing = MOUNTAINS.replace("terrain = \"mountains.asc\"", "# terrain");
    let refused = Scenario::parse("m.toml", &nothing).unwrap_err().to_string();
    assert!(
        refused.contains("follows_terrain") && refused.contains("site.terrain"),
        "{refused}"
    );
}
