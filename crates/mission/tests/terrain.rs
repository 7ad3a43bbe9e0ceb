//! Over mountains nobody is nearer to the ground than the floor, and all come down.

use air::geo::{Enu, Geodetic};
use mission::{Run, Setup};
use protocol::Topic;
use protocol::message::Message;
use std::collections::BTreeMap;

const MOUNTAINS: &str = include_str!("../../../scenarios/mountains.toml");
const GROUND: &[u8] = include_bytes!("../../../scenarios/mountains.asc");
/// Take-off, landing and the circle above home end this far from home, m: that of the approach lies 772 m
/// downwind.
const LANDING_M: f64 = 1300.0;

fn read(file: &str) -> Result<Vec<u8>, String> {
    match file {
        "mountains.asc" => Ok(GROUND.to_vec()),
        _ => Err("no such file".to_owned()),
    }
}

fn mountains() -> Setup {
    // Shorter: search and landings are in it all the same.
    let text = MOUNTAINS.replace("duration_s = 2100.0", "duration_s = 1500.0");
    let mut setup = Setup::load("mountains.toml", &text, &read).unwrap();
    setup.scenario.gap.live = false;
    setup
}

#[test]
fn what_counts_from_one_height_is_filled_in() {
    let setup = mountains();
    assert_eq!(setup.scenario.fence.home_ground_amsl_m, Some(600.0));
    // The slopes rise to 950 m, and the ceiling is 500 m over them.
    let top_m = setup.scenario.fence.top_amsl_m.unwrap();
    assert!((1400.0..=1450.0).contains(&top_m), "{top_m}");
}

#[test]
fn nobody_is_below_the_floor_over_ground_and_all_land() {
    let setup = mountains();
    assert_eq!(mission::preflight::check(&setup).unwrap(), []);
    let frame = setup.frame().unwrap();
    let fence = &setup.scenario.fence;
    let home = |id: &str| {
        let index = setup.index_of(id).unwrap();
        frame.to_enu(setup.scenario.home(index).unwrap())
    };
    let homes: BTreeMap<String, Enu> = setup
        .scenario
        .vehicles
        .iter()
        .map(|v| (v.id.clone(), home(&v.id)))
        .collect();
    let mut airborne: BTreeMap<String, bool> = BTreeMap::new();
    let (mut lowest_m, mut highest_m, mut looks) = (f64::INFINITY, f64::NEG_INFINITY, 0);
    let mut run = Run::new(&setup).unwrap();
    while !run.ended() {
        for (topic, envelope) in run.step() {
            let (Topic::State(id), Message::State(state)) = (topic, &envelope.message) else {
                continue;
            };
            airborne.insert(id.to_string(), state.airborne);
            let at = Geodetic {
                lat_deg: state.lat_deg,
                lon_deg: state.lon_deg,
            };
            if frame.to_enu(at).distance_m(homes[id.as_str()]) > LANDING_M {
                let over_ground_m = state.alt_amsl_m - setup.terrain.ground_amsl_m(at);
                lowest_m = lowest_m.min(over_ground_m);
                highest_m = highest_m.max(over_ground_m);
                looks += 1;
            }
        }
    }
    assert!(looks > 10_000, "{looks}");
    assert!(lowest_m >= fence.floor_agl_m, "{lowest_m}");
    // The floor goes before the ceiling, which the guide of heights keeps to some metres.
    assert!(highest_m <= fence.ceiling_agl_m + 30.0, "{highest_m}");
    assert!(airborne.values().all(|up| !up), "{airborne:?}");
}
