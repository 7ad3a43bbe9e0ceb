//! Vehicles that start in flight: where and how they fly, and that they land at their homes.

use air::geo::Geodetic;
use mission::{Run, Setup};
use protocol::Topic;
use protocol::message::{Message, Phase, State};
use scenario::tables::{AirborneTable, VehicleKind};
use std::collections::BTreeMap;

const AS_PONTES: &str = include_str!("../../../scenarios/as-pontes.toml");
/// In the reference mission's fence, 1.6 km south-west of the stack.
const START: AirborneTable = AirborneTable {
    lat_deg: 43.4300,
    lon_deg: -7.8750,
    alt_amsl_m: 800.0,
    heading_deg: 300.0,
};

/// The reference mission with two vehicles in the air and one on the ground, all simulated.
fn setup(duration_s: f64) -> Setup {
    let read = |_: &str| Err("no such file".to_owned());
    let mut setup = Setup::load("as-pontes.toml", AS_PONTES, &read).unwrap();
    setup.scenario.vehicles.truncate(3);
    setup.scenario.mission.duration_s = duration_s;
    setup.scenario.vehicles[0].airborne = Some(START);
    setup.scenario.vehicles[1].airborne = Some(AirborneTable {
        lon_deg: -7.8900,
        ..START
    });
    setup
}

#[test]
fn a_start_in_flight_is_trimmed_in_the_wind_at_the_given_place() {
    let setup = setup(600.0);
    let frame = setup.frame().unwrap();
    let mut run = Run::new(&setup).unwrap();
    let mut states: Vec<State> = Vec::new();
    // Until the first decision of the squadron controller nobody commands it.
    while run.now().s() < 1.0 {
        for (topic, envelope) in run.step() {
            if let (Topic::State(id), Message::State(state)) = (topic, &envelope.message)
                && id.as_str() == "1"
            {
                states.push(state.clone());
            }
        }
    }
    let at = |lat_deg: f64, lon_deg: f64| frame.to_enu(Geodetic { lat_deg, lon_deg });
    let first = &states[0];
    let off_m = at(first.lat_deg, first.lon_deg).distance_m(at(START.lat_deg, START.lon_deg));
    // The first state is that after the first tick: 0.02 s at 25 m/s at the most.
    assert!(first.airborne && off_m < 0.5, "{off_m} m: {first:?}");
    assert!((first.alt_amsl_m - START.alt_amsl_m).abs() < 0.1);
    assert!((first.heading_deg - START.heading_deg).abs() < 0.5);
    assert!((first.airspeed_m_s - 18.0).abs() < 0.1, "{first:?}");
    // The wind of the scenario is 7 m/s from 240 degrees at 486 m above ground, and follows a power law with the
    // exponent 0.15: at 460 m it moves the air by 6.94 m/s towards 60 degrees.
    let wind_m_s = 7.0 * (460.0_f64 / 486.0).powf(0.15);
    let component = |wind_part: f64, nose_part: f64| wind_m_s * wind_part + 18.0 * nose_part;
    let (wind_east, wind_north) = 60f64.to_radians().sin_cos();
    let (nose_east, nose_north) = 300f64.to_radians().sin_cos();
    let [north, east, _] = first.vel_ned_m_s;
    assert!((north - component(wind_north, nose_north)).abs() < 0.2);
    assert!((east - component(wind_east, nose_east)).abs() < 0.2);
    // No transient: neither its height nor its airspeed leaves what gusts of 0.7 m/s explain.
    for state in &states {
        assert!(
            (state.alt_amsl_m - START.alt_amsl_m).abs() < 3.0,
            "{state:?}"
        );
        assert!((state.airspeed_m_s - 18.0).abs() < 2.5, "{state:?}");
    }
}

#[test]
fn vehicles_that_start_in_flight_search_at_once_and_land_at_home() {
    let mut setup = setup(1200.0);
    setup.scenario.vehicles.truncate(2);
    let frame = setup.frame().unwrap();
    let mut run = Run::new(&setup).unwrap();
    let mut last: BTreeMap<String, State> = BTreeMap::new();
    let mut searches_at_s = None;
    while !run.ended() {
        let now_s = run.now().s();
        for (topic, envelope) in run.step() {
            match (topic, &envelope.message) {
                (Topic::State(id), Message::State(state)) => {
                    last.insert(id.to_string(), state.clone());
                }
                (_, Message::Plan(plan)) if plan.phase == Phase::Search => {
                    searches_at_s.get_or_insert(now_s);
                }
                _ => {}
            }
        }
    }
    // Nobody takes off, so the take-off ends with the decision after the first.
    assert!(searches_at_s.is_some_and(|s| s <= 3.0), "{searches_at_s:?}");
    for (index, (id, state)) in last.iter().enumerate() {
        let at = frame.to_enu(Geodetic::new(state.lat_deg, state.lon_deg));
        let home = frame.to_enu(setup.scenario.home(index).unwrap());
        // A landing ends within half of what homes are apart.
        assert!(!state.airborne, "{id}: {state:?}");
        assert!(at.distance_m(home) < 15.0, "{id}: {state:?}");
    }
}

#[test]
fn a_stand_in_and_a_real_aircraft_start_on_the_ground() {
    let stand_ins = setup(600.0).with_stand_ins(2).unwrap();
    let vehicles = &stand_ins.scenario.vehicles;
    assert!(vehicles[0].airborne.is_some() && vehicles[1].airborne.is_none());
    let real = setup(600.0).with_real(0, "udpin:127.0.0.1:14550".to_owned());
    assert_eq!(real.scenario.vehicles[0].kind, VehicleKind::Mavlink);
    assert!(real.scenario.vehicles[0].airborne.is_none());
}
