//! Teams of many sizes are down at the mission's end, and keep their distances on the way.

use air::geo::{Enu, Geodetic};
use mission::{Run, Setup};
use protocol::Topic;
use protocol::message::{Control, ControlWish, Message, Phase, State};
use scenario::tables::{VehicleKind, VehicleTable};
use std::collections::{BTreeMap, BTreeSet};

const AS_PONTES: &str = include_str!("../../../scenarios/as-pontes.toml");
/// Time between two looks at the distances, s.
const LOOK_S: f64 = 0.5;
/// Vehicles come no nearer to each other than the separation in height, m.
const NEAREST_M: f64 = 30.0;

fn no_files(_: &str) -> Result<Vec<u8>, String> {
    Err("no such file".to_owned())
}

/// The reference mission with `count` vehicles, the last a stand-in; all homes those that a scenario
/// does not give, or the first six the reference's own.
fn team_of(count: usize, own_homes: bool) -> Setup {
    let mut setup = Setup::load("as-pontes.toml", AS_PONTES, &no_files).unwrap();
    let own = &setup.scenario.vehicles;
    let vehicle = |k: usize| VehicleTable {
        id: format!("{:03}", k + 1),
        kind: if k + 1 == count {
            VehicleKind::StandIn
        } else {
            VehicleKind::Simulated
        },
        home: own.get(k).and_then(|v| v.home).filter(|_| own_homes),
        ..own[0].clone()
    };
    setup.scenario.vehicles = (0..count).map(vehicle).collect();
    setup.scenario.mission.seed = count as u64;
    setup
}

/// What a mission shows.
struct Flown {
    airborne: Vec<String>,
    flew: BTreeSet<String>,
    nearest_m: f64,
    phase: Phase,
    /// When the last vehicle was in the air, s.
    last_up_s: f64,
}

/// Flies a mission; the operator calls all home at `home_s`.
fn fly(setup: &Setup, home_s: f64) -> Flown {
    let frame = setup.frame().unwrap();
    let mut run = Run::new(setup).unwrap();
    let mut states: BTreeMap<String, State> = BTreeMap::new();
    let (mut flew, mut nearest_m) = (BTreeSet::new(), f64::INFINITY);
    let (mut phase, mut next_s, mut called) = (Phase::TakeOff, 0.0, false);
    let mut last_up_s = 0.0;
    while !run.ended() {
        let now_s = run.now().s();
        if now_s >= home_s && !called {
            called = true;
            for vehicle in &setup.scenario.vehicles {
                let wish = ControlWish::Home;
                let control = Control { wish, sticks: None };
                run.operate(&vehicle.id, control).unwrap();
            }
        }
        for (topic, envelope) in run.step() {
            match (topic, &envelope.message) {
                (Topic::State(id), Message::State(state)) => {
                    states.insert(id.to_string(), state.clone());
                }
                (_, Message::Plan(plan)) => phase = plan.phase,
                _ => {}
            }
        }
        if now_s < next_s {
            continue;
        }
        next_s = now_s + LOOK_S;
        let up: Vec<(Enu, f64)> = states
            .iter()
            .filter(|(_, s)| s.airborne)
            .map(|(id, s)| {
                flew.insert(id.clone());
                let (lat_deg, lon_deg) = (s.lat_deg, s.lon_deg);
                (frame.to_enu(Geodetic { lat_deg, lon_deg }), s.alt_amsl_m)
            })
            .collect();
        if !up.is_empty() {
            last_up_s = now_s;
        }
        for (k, a) in up.iter().enumerate() {
            for b in &up[..k] {
                nearest_m = nearest_m.min(a.0.distance_m(b.0).hypot(a.1 - b.1));
            }
        }
    }
    let airborne = states.iter().filter(|(_, s)| s.airborne);
    Flown {
        airborne: airborne.map(|(id, _)| id.clone()).collect(),
        flew,
        nearest_m,
        phase,
        last_up_s,
    }
}

fn lands(count: usize, own_homes: bool) -> Flown {
    let flown = fly(&team_of(count, own_homes), f64::INFINITY);
    assert!(
        flown.airborne.is_empty(),
        "team of {count}: {:?} in the air at the end",
        flown.airborne
    );
    assert!(
        flown.nearest_m >= NEAREST_M,
        "team of {count}: {:.1} m apart",
        flown.nearest_m
    );
    flown
}

#[test]
fn one_alone_and_six_from_one_home_are_down_in_time_and_all_have_flown() {
    for count in [1, 6] {
        assert_eq!(lands(count, false).flew.len(), count);
    }
}

#[test]
fn six_from_homes_of_their_own_are_down_in_time_and_all_have_flown() {
    assert_eq!(lands(6, true).flew.len(), 6);
}

#[test]
#[ignore = "second tier: thirty missions"]
fn teams_of_one_to_thirty_are_down_in_time_and_keep_apart() {
    for count in 1..=30 {
        let flew = lands(count, count % 2 == 0).flew.len();
        // A larger team has no time to land one after the other: who could not land in time does
        // not take off.
        assert!(flew >= count.min(10), "{flew} of {count} flew");
    }
}

#[test]
#[ignore = "second tier: a mission of a hundred vehicles"]
fn a_hundred_vehicles_keep_apart_in_turns_too() {
    lands(100, false);
}

#[test]
fn a_team_lands_on_ground_that_is_higher_than_the_site() {
    let text = AS_PONTES.replace(
        "ground_amsl_m = 340.0",
        "ground_amsl_m = 340.0\nterrain = \"N43W008.hgt\"",
    );
    // A plateau 60 m above what the scenario says.
    let read = |file: &str| match file {
        "N43W008.hgt" => Ok((0..1201 * 1201)
            .flat_map(|_| 400i16.to_be_bytes())
            .collect()),
        other => no_files(other),
    };
    let mut setup = Setup::load("high.toml", &text, &read).unwrap();
    setup.scenario.vehicles.drain(..3);
    setup.scenario.mission.duration_s = 1500.0;
    let flown = fly(&setup, 200.0);
    assert!(flown.airborne.is_empty(), "{:?}", flown.airborne);
    // One after the other, not one after the other's standstill: 100 s apart.
    assert!(flown.last_up_s < 1100.0, "{:.0} s", flown.last_up_s);
}

#[test]
fn one_word_of_the_operator_brings_all_home() {
    let setup = team_of(3, true);
    let flown = fly(&setup, 300.0);
    assert_eq!((flown.phase, flown.flew.len()), (Phase::Home, 3));
    assert!(flown.airborne.is_empty(), "{:?}", flown.airborne);
    assert!(flown.last_up_s < 1200.0, "{:.0} s", flown.last_up_s);
}

#[test]
fn a_mission_has_the_same_digest_twice() {
    let mut setup = team_of(4, true);
    setup.scenario.mission.duration_s = 700.0;
    let digest = || {
        let mut run = Run::new(&setup).unwrap();
        while !run.ended() {
            run.step();
        }
        run.digest()
    };
    assert_eq!(digest(), digest());
}
