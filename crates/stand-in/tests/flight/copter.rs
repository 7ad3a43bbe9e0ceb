//! A quadrotor: the bridge tells ArduCopter by its heartbeat, and the stand-in emulates it.

use crate::flight::pair::{Pair, decode, scenario, setpoint};
use air::geo::Enu;
use mav_bridge::arducopter::{GUIDED, LAND, LOITER, RTL};
use protocol::message::{ControlLevel, EventMessage, PathKind, Setpoint};
use stand_in::{StandInConfig, Sticks};

const QUAD: &str = include_str!("../../../../aircraft/quad.toml");
const LEVEL: Sticks = Sticks {
    roll: 0.0,
    pitch: 0.0,
    throttle: 0.5,
};

fn pair(seed: u64) -> Pair {
    let aircraft = fdm::Airframe::from_toml("quad.toml", QUAD).unwrap();
    let config = StandInConfig::from_scenario(&scenario(), 5, aircraft).unwrap();
    Pair::with(config, seed)
}

fn home() -> Enu {
    scenario()
        .frame()
        .unwrap()
        .to_enu(scenario().home(5).unwrap())
}

/// A setpoint north and east of home, above its ground.
fn near_home(path: PathKind, north_m: f64, east_m: f64, above_m: f64) -> Setpoint {
    let home = home();
    Setpoint {
        airspeed_m_s: 5.0,
        ..setpoint(
            path,
            home.north_m + north_m,
            home.east_m + east_m,
            340.0 + above_m,
        )
    }
}

/// In GUIDED above home.
fn airborne(seed: u64) -> Pair {
    let mut pair = pair(seed);
    pair.setpoint = Some(near_home(PathKind::TakeOff, 0.0, 0.0, 50.0));
    for _ in 0..90 {
        pair.run(1.0);
        if pair.said("guided") > 0 {
            return pair;
        }
    }
    panic!("no GUIDED within 90 s: {:#?}", pair.events);
}

fn commands(pair: &Pair, command: u16) -> usize {
    let sent = pair.sent.iter().map(|f| decode(f));
    sent.filter(|d| matches!(d.0, 75 | 76) && d.1 == command)
        .count()
}

#[test]
fn takes_off_flies_to_places_stops_there_and_lands_at_home() {
    let mut pair = airborne(1);
    assert!(
        pair.events
            .iter()
            .any(|e| e.text.contains("ArduCopter found")),
        "{:#?}",
        pair.events
    );
    // NAV_TAKEOFF (22) once, and no mode but GUIDED.
    assert_eq!(commands(&pair, 22), 1);
    assert_eq!(pair.vehicle.custom_mode(), GUIDED);
    pair.run(15.0);
    let truth = pair.vehicle.truth();
    assert!((truth.alt_amsl_m - 390.0).abs() < 1.5, "{truth:?}");
    for (north_m, east_m, above_m) in [(60.0, 20.0, 60.0), (60.0, -40.0, 40.0)] {
        let speeds = commands(&pair, 178);
        pair.setpoint = Some(near_home(PathKind::GoTo, north_m, east_m, above_m));
        pair.run(40.0);
        // DO_CHANGE_SPEED (178) comes with each place: another station may have changed it, and a vehicle that stops does
        // not show by its speed.
        assert_eq!(commands(&pair, 178), speeds + 1);
        let truth = pair.vehicle.truth();
        let [north, east, down] = truth.vel_ned_m_s;
        assert!(pair.distance_m() < 1.0, "{} m off", pair.distance_m());
        assert!(
            (truth.alt_amsl_m - 340.0 - above_m).abs() < 1.0,
            "{truth:?}"
        );
        assert!(north.hypot(east).hypot(down) < 0.7, "{truth:?}");
        assert_eq!(pair.bridge.level(), ControlLevel::Automatic);
    }
    pair.setpoint = Some(near_home(PathKind::Land, 0.0, 0.0, 0.0));
    pair.run(2.0);
    assert_eq!(pair.vehicle.custom_mode(), RTL);
    pair.run(160.0);
    let truth = pair.vehicle.truth();
    let off = Enu::new(truth.east_m, truth.north_m).distance_m(home());
    assert!(!pair.vehicle.is_armed() && off < 2.0, "{off} m, {truth:?}");
    assert_eq!(pair.said("landed"), 1, "{:#?}", pair.events);
    // The team's setpoint is still the landing, which nobody need hear of.
    let ignored = |e: &&EventMessage| e.code == "setpoint-ignored" && e.text.contains("ground");
    assert_eq!(pair.events.iter().find(ignored), None);
}

#[test]
fn a_pilot_takes_over_and_hands_back() {
    let mut pair = airborne(2);
    pair.run(5.0);
    assert!(pair.vehicle.pilot(LOITER, LEVEL));
    pair.run(2.0);
    assert_eq!(pair.bridge.level(), ControlLevel::Pilot);
    assert_eq!(pair.said("pilot-takeover"), 1);
    pair.hand_back();
    pair.run(3.0);
    assert_eq!(pair.bridge.level(), ControlLevel::Automatic);
    assert_eq!(pair.vehicle.custom_mode(), GUIDED);
}

#[test]
fn a_lost_link_brings_it_home_by_its_own_failsafe_which_is_named() {
    let mut pair = airborne(3);
    pair.setpoint = Some(near_home(PathKind::GoTo, 80.0, 0.0, 50.0));
    pair.run(25.0);
    pair.up = |_, _| Vec::new();
    pair.run(8.0);
    assert_eq!(pair.vehicle.custom_mode(), RTL);
    let guardian = pair.events.iter().find(|e| e.code == "guardian");
    let words = &guardian.expect("the failsafe is reported").text;
    assert!(words.contains("RTL (6)"), "{words}");
}

#[test]
fn it_lands_where_it_is_in_land() {
    let mut pair = airborne(4);
    pair.run(20.0);
    let before = pair.vehicle.truth();
    assert!(pair.vehicle.pilot(LAND, LEVEL));
    pair.run(90.0);
    let truth = pair.vehicle.truth();
    let off = (truth.north_m - before.north_m).hypot(truth.east_m - before.east_m);
    assert!(!pair.vehicle.is_armed() && off < 2.0, "{off} m");
}
