//! Bridge and stand-in in one closed loop, in virtual time.

mod copter;
mod link;
mod pair;
mod shared;

use air::geo::{Enu, Geodetic};
use mav_bridge::arduplane::{FBWA, GUIDED, RTL};
use mav_bridge::{Bridge, BridgeConfig, BridgeOutput, Expectation};
use protocol::control_level::{ControlEvent, Danger};
use protocol::message::{ControlLevel, EventMessage, PathKind, Reading, Setpoint};
use stand_in::Sticks;

use crate::flight::pair::{
    Pair, guided_commands, scenario, setpoint, stand_in_config, steering_commands,
};

/// Sticks that hold a gentle right turn.
const TURN: Sticks = Sticks {
    roll: 0.4,
    pitch: 0.0,
    throttle: 0.6,
};

#[test]
fn takes_off_and_obeys_setpoints() {
    let mut pair = Pair::new(1);
    pair.take_off();
    pair.setpoint = Some(setpoint(PathKind::GoTo, -800.0, 1800.0, 700.0));
    pair.run(180.0);
    assert_eq!(pair.bridge.level(), ControlLevel::Automatic);
    let off = (pair.distance_m() - 100.0).abs();
    assert!(off < 40.0, "orbits {off} m off its circle");
    let truth = pair.vehicle.truth();
    assert!((truth.alt_amsl_m - 700.0).abs() < 15.0, "{truth:?}");
    // What the team hears is what happens, to the errors of satellite navigation.
    let state = pair.state.clone().unwrap();
    assert!(state.airborne);
    assert!((state.alt_amsl_m - truth.alt_amsl_m).abs() < 6.0);
    assert!((state.roll_deg - truth.roll_rad.to_degrees()).abs() < 5.0);
    // GUIDED was asked for once.
    assert_eq!(guided_commands(&pair.sent), 1);
}

#[test]
fn airspeed_is_true_airspeed_on_both_sides() {
    let mut config = stand_in_config();
    config.turbulence_intensity = 0.0;
    let mut pair = Pair::with(config, 2);
    pair.take_off();
    for speed in [16.0, 20.0] {
        let mut fast = setpoint(PathKind::GoTo, -3000.0, 4000.0, 650.0);
        fast.airspeed_m_s = speed;
        pair.setpoint = Some(fast);
        pair.run(60.0);
        let (mut heard, mut flown) = (0.0, 0.0);
        for _ in 0..500 {
            pair.step();
            heard += pair.state.as_ref().unwrap().airspeed_m_s / 500.0;
            flown += pair.vehicle.truth().airspeed_m_s / 500.0;
        }
        assert!((flown - speed).abs() < 0.3, "flown {flown}, asked {speed}");
        assert!((heard - flown).abs() < 0.15, "heard {heard}, flown {flown}");
    }
}

#[test]
fn readings_come_at_10_hz_with_place_and_wind() {
    let mut pair = Pair::new(3);
    pair.take_off();
    pair.readings.clear();
    pair.run(60.0);
    assert!((595..=605).contains(&pair.readings.len()));
    let last = pair.readings.last().unwrap();
    let truth = pair.vehicle.truth();
    let at = scenario().frame().unwrap().to_enu(air::geo::Geodetic {
        lat_deg: last.lat_deg,
        lon_deg: last.lon_deg,
    });
    let off = at.distance_m(Enu {
        east_m: truth.east_m,
        north_m: truth.north_m,
    });
    assert!(off < 6.0, "reading placed {off} m away");
    // The reality's wind, 252 degrees, not the scenario's 240; its height law is the same.
    let mean = |f: fn(&Reading) -> f64| {
        pair.readings.iter().map(f).sum::<f64>() / pair.readings.len() as f64
    };
    let from = mean(|r| r.wind_from_deg.unwrap());
    assert!((from - 252.0).abs() < 10.0, "wind from {from}");
    let height = truth.alt_amsl_m - 340.0;
    let expected = 8.0 * (height / 486.0_f64).powf(0.15);
    let speed = mean(|r| r.wind_speed_m_s.unwrap());
    assert!((speed - expected).abs() < 1.5, "wind {speed}, {expected}");
    assert!((mean(|r| r.co2_ppm) - 446.0).abs() < 3.0);
    assert!(last.temperature_c.is_some() && last.pressure_hpa.is_some());
}

#[test]
fn pilot_takes_over_and_hands_back() {
    let mut pair = Pair::new(4);
    pair.take_off();
    pair.run(10.0);
    assert!(pair.vehicle.pilot(FBWA, TURN));
    pair.run(2.0);
    assert_eq!(pair.bridge.level(), ControlLevel::Pilot);
    assert_eq!(pair.said("pilot-takeover"), 1);
    // New setpoints are withheld and reported; nothing that steers goes out.
    pair.sent.clear();
    pair.events.clear();
    for k in 0..5 {
        pair.setpoint = Some(setpoint(
            PathKind::GoTo,
            -900.0,
            f64::from(k) * 100.0,
            650.0,
        ));
        pair.run(4.0);
    }
    assert_eq!(pair.said("setpoint-ignored"), 5);
    assert_eq!(steering_commands(&pair.sent), 0);
    // Explicit hand-back: GUIDED is asked for once, setpoints go through again.
    let north_m = pair.vehicle.truth().north_m;
    pair.setpoint = Some(setpoint(PathKind::GoTo, north_m, 1500.0, 650.0));
    pair.hand_back();
    pair.run(120.0);
    assert_eq!(pair.bridge.level(), ControlLevel::Automatic);
    assert_eq!(guided_commands(&pair.sent), 1);
    assert!((pair.distance_m() - 100.0).abs() < 40.0);
}

#[test]
fn lost_link_brings_it_home() {
    let mut pair = Pair::new(5);
    pair.take_off();
    pair.setpoint = Some(setpoint(PathKind::GoTo, -500.0, 2500.0, 700.0));
    pair.run(40.0);
    // Both directions go silent.
    pair.up = |_, _| Vec::new();
    pair.down = |_, _| Vec::new();
    pair.run(200.0);
    assert_eq!(pair.bridge.level(), ControlLevel::Guardian);
    assert_eq!(pair.said("link-lost"), 1);
    let truth = pair.vehicle.truth();
    let home = scenario().home(5).unwrap();
    let home = scenario().frame().unwrap().to_enu(home);
    let at = Enu {
        east_m: truth.east_m,
        north_m: truth.north_m,
    };
    assert!(at.distance_m(home) < 250.0, "{} m", at.distance_m(home));
    assert!((truth.alt_amsl_m - 440.0).abs() < 20.0);
    // The link comes back: it stays with the Guardian until handed back.
    pair.up = |_, frames| frames;
    pair.down = |_, frames| frames;
    pair.sent.clear();
    pair.run(20.0);
    assert_eq!(pair.bridge.level(), ControlLevel::Guardian);
    assert_eq!(pair.said("link-restored"), 1);
    assert_eq!(steering_commands(&pair.sent), 0);
    pair.hand_back();
    pair.run(150.0);
    assert_eq!(pair.bridge.level(), ControlLevel::Automatic);
    assert!((pair.distance_m() - 100.0).abs() < 40.0);
}

#[test]
fn after_a_short_silence_it_comes_home_until_handed_back() {
    let mut pair = Pair::new(6);
    pair.take_off();
    pair.run(20.0);
    pair.down = |_, _| Vec::new();
    pair.run(7.0);
    assert_eq!(pair.bridge.level(), ControlLevel::Guardian);
    // Too short for the vehicle's own failsafe: the bridge sends it home when it hears it again.
    pair.down = |_, frames| frames;
    pair.sent.clear();
    pair.run(10.0);
    assert_eq!(pair.bridge.level(), ControlLevel::Guardian);
    assert_eq!(pair.bridge.control().dangers().count(), 0);
    assert_eq!(pair.vehicle.custom_mode(), RTL);
    assert_eq!(steering_commands(&pair.sent), 1);
    pair.hand_back();
    pair.run(5.0);
    assert_eq!(pair.bridge.level(), ControlLevel::Automatic);
    assert_eq!(pair.vehicle.custom_mode(), GUIDED);
}

/// Tells the bridge what the rest of the team saw happen.
fn tell(pair: &mut Pair, event: ControlEvent) {
    let mut out = BridgeOutput::default();
    pair.bridge.handle(event, &mut out);
    pair.events.extend(out.events);
}

#[test]
fn a_danger_that_the_team_sees_sends_it_home() {
    let mut pair = Pair::new(16);
    pair.take_off();
    pair.run(20.0);
    tell(&mut pair, ControlEvent::Begins(Danger::SquadronController));
    pair.run(3.0);
    assert_eq!(pair.vehicle.custom_mode(), RTL);
    assert_eq!(pair.said("guardian"), 1);
    // While it lasts nobody can have the vehicle back but its pilot.
    pair.hand_back();
    assert_eq!(pair.said("hand-back-refused"), 1);
    pair.vehicle.pilot(FBWA, TURN);
    pair.run(2.0);
    assert_eq!(pair.bridge.level(), ControlLevel::Pilot);
    // He hands it to the Guardian.
    pair.hand_back();
    pair.run(3.0);
    assert_eq!(pair.bridge.level(), ControlLevel::Guardian);
    assert_eq!(pair.vehicle.custom_mode(), RTL);
    tell(&mut pair, ControlEvent::Ends(Danger::SquadronController));
    pair.run(3.0);
    assert_eq!(pair.bridge.level(), ControlLevel::Guardian);
    pair.hand_back();
    pair.run(3.0);
    assert_eq!(pair.bridge.level(), ControlLevel::Automatic);
    assert_eq!(pair.vehicle.custom_mode(), GUIDED);
}

#[test]
fn a_danger_during_take_off_lets_it_climb_first() {
    let mut pair = Pair::new(17);
    pair.setpoint = Some(setpoint(PathKind::TakeOff, -1000.0, 500.0, 650.0));
    while !pair.state.as_ref().is_some_and(|s| s.airborne) {
        pair.run(0.2);
    }
    tell(&mut pair, ControlEvent::Begins(Danger::World));
    let mut lowest_m = f64::INFINITY;
    for _ in 0..60 {
        pair.run(1.0);
        if pair.vehicle.custom_mode() == RTL {
            lowest_m = lowest_m.min(pair.vehicle.truth().alt_amsl_m - 340.0);
        }
    }
    assert_eq!(pair.vehicle.custom_mode(), RTL);
    assert!(lowest_m > 30.0, "sent home at {lowest_m} m");
}

#[test]
fn a_bridge_that_dies_leaves_it_to_its_failsafe_and_a_new_one_asks_first() {
    let mut pair = Pair::new(18);
    pair.take_off();
    pair.run(30.0);
    let config = BridgeConfig {
        atmosphere: scenario().atmosphere().unwrap(),
        may_arm: true,
        ..BridgeConfig::default()
    };
    // The old one's process is gone: nothing goes up any more.
    pair.bridge = Bridge::new(config).unwrap();
    pair.up = |_, _| Vec::new();
    pair.run(100.0);
    assert_eq!(pair.vehicle.custom_mode(), RTL);
    // A new one finds it in the air in a mode that it did not ask for.
    pair.up = |_, frames| frames;
    pair.run(5.0);
    assert_ne!(pair.bridge.level(), ControlLevel::Automatic);
    assert_eq!(pair.vehicle.custom_mode(), RTL);
    pair.hand_back();
    pair.run(5.0);
    assert_eq!(pair.bridge.level(), ControlLevel::Automatic);
    assert_eq!(pair.vehicle.custom_mode(), GUIDED);
}

#[test]
fn lands_at_home() {
    let mut pair = Pair::new(7);
    pair.take_off();
    pair.run(30.0);
    let home = scenario().home(5).unwrap();
    pair.setpoint = Some(Setpoint {
        path: PathKind::Land,
        lat_deg: home.lat_deg,
        lon_deg: home.lon_deg,
        alt_amsl_m: 340.0,
        airspeed_m_s: 16.0,
        orbit_radius_m: 0.0,
    });
    pair.run(400.0);
    assert!(!pair.state.as_ref().unwrap().airborne, "{:?}", pair.state);
    assert_eq!(pair.said("landed"), 1, "{:#?}", pair.events);
    assert!(pair.distance_m() < 60.0, "{} m", pair.distance_m());
}

#[test]
fn without_a_landing_sequence_it_returns_and_circles() {
    let mut config = stand_in_config();
    config.has_landing_sequence = false;
    let mut pair = Pair::with(config, 8);
    pair.take_off();
    let mut land = setpoint(PathKind::Land, 0.0, 0.0, 340.0);
    land.airspeed_m_s = 16.0;
    pair.setpoint = Some(land);
    pair.run(60.0);
    assert_eq!(pair.said("no-landing-sequence"), 1);
    assert_eq!(pair.bridge.level(), ControlLevel::Automatic);
    assert!(pair.state.as_ref().unwrap().airborne);
    // A pilot who then switches to another mode takes it over all the same.
    pair.vehicle.pilot(FBWA, TURN);
    pair.run(2.0);
    assert_eq!(pair.bridge.level(), ControlLevel::Pilot);
}

/// The mission's fence, as the bridge is told of it.
fn expectation() -> Expectation {
    let scenario = scenario();
    let corner = |at: &[f64; 2]| Geodetic {
        lat_deg: at[0],
        lon_deg: at[1],
    };
    Expectation {
        home: scenario.home(5).unwrap(),
        home_amsl_m: scenario.site.ground_amsl_m,
        airspeed_m_s: 18.0,
        least_over_ground_m_s: 3.0,
        wind_m_s: 8.0,
        stack_top_amsl_m: 696.0,
        fence: scenario.fence.polygon.iter().map(corner).collect(),
    }
}

#[test]
fn the_fence_on_board_is_read_and_put_there_where_that_is_asked_for() {
    let told = |pair: &Pair| -> Vec<String> {
        let lines = pair.events.iter().filter(|e| e.code == "checklist");
        let about = |text: &&str| text.contains("corners of the fence");
        let lines = lines.map(|e| e.text.as_str()).filter(about);
        lines.map(str::to_owned).collect()
    };
    let mut pair = Pair::new(11);
    let config = |set_fence: bool, fence: Vec<Geodetic>| BridgeConfig {
        vehicle_system_id: Some(pair.vehicle.system_id()),
        set_fence,
        expectation: Some(Expectation {
            fence,
            ..expectation()
        }),
        ..BridgeConfig::default()
    };
    let wanted = expectation().fence;
    let mut other = wanted.clone();
    // 0.001 degrees of latitude are 111 m.
    other[2].lat_deg += 0.001;
    other.rotate_left(1);
    other.reverse();
    let bridges = [
        (
            config(false, wanted.clone()),
            "(doubtful): no fence on board, but the mission's has 4",
        ),
        (
            config(true, wanted.clone()),
            "(ok): the mission's 4 corners are on board",
        ),
        (
            config(false, wanted[..3].to_vec()),
            "(doubtful): another fence is on board: 4 corners, the mission's has 3",
        ),
        (
            config(false, other),
            "(doubtful): another fence is on board: a corner is 111 m from",
        ),
    ];
    // One bridge after the other, as on four days; a link that loses every fifth datagram each way.
    let lossy: pair::Link = |tick, frames| {
        let kept = frames.into_iter().enumerate();
        kept.filter(|(k, _)| !(tick / 50 + tick + *k as u64).is_multiple_of(5))
            .map(|(_, f)| f)
            .collect()
    };
    (pair.up, pair.down) = (lossy, lossy);
    for (config, words) in bridges {
        pair.bridge = Bridge::new(config).unwrap();
        pair.events.clear();
        pair.run(40.0);
        let lines = told(&pair);
        assert!(
            lines.len() == 1 && lines[0].contains(words),
            "{words}: {lines:?}\n{:#?}",
            pair.events
        );
    }
    assert!(!pair.vehicle.is_armed());
}

/// A radio with store and forward, or a satellite: half a second each way, more than the time to wait for an answer.
#[test]
fn a_vehicle_half_a_second_away_is_identified_checked_and_takes_off() {
    let mut pair = Pair::new(3);
    pair.delay = 25;
    pair.bridge = Bridge::new(BridgeConfig {
        vehicle_system_id: Some(pair.vehicle.system_id()),
        expectation: Some(expectation()),
        may_arm: true,
        ..BridgeConfig::default()
    })
    .unwrap();
    let mut ready_s = 0.0;
    while !pair.bridge.follows_setpoints() && ready_s < 60.0 {
        pair.run(0.1);
        ready_s += 0.1;
    }
    // The parameters, one round trip, and the fence, which is not on board, another.
    assert!(ready_s < 15.0, "{ready_s} s: {:#?}", pair.events);
    assert_eq!(pair.said("connected"), 1);
    let untold = |e: &&EventMessage| e.code == "checklist" && e.text.contains("does not report");
    let untold: Vec<_> = pair.events.iter().filter(untold).collect();
    assert!(untold.is_empty(), "{untold:#?}");
    pair.take_off();
    pair.run(20.0);
    assert_eq!(pair.bridge.level(), ControlLevel::Automatic);
    assert_eq!(pair.said("link-lost"), 0);
}

#[test]
fn warns_of_a_failsafe_that_is_off() {
    let mut config = stand_in_config();
    assert!(config.parameters.set("FS_GCS_ENABL", 0.0));
    let mut pair = Pair::with(config, 9);
    pair.run(5.0);
    let warnings: Vec<_> = pair
        .events
        .iter()
        .filter(|e| e.code == "failsafe-off")
        .collect();
    assert_eq!(warnings.len(), 1);
    assert!(warnings[0].text.contains("FS_GCS_ENABL"));
}

#[test]
fn its_own_failsafe_is_the_guardian() {
    let mut pair = Pair::new(10);
    pair.take_off();
    // The vehicle no longer hears the bridge, but the bridge hears the vehicle.
    pair.up = |_, _| Vec::new();
    pair.run(10.0);
    assert_eq!(pair.bridge.level(), ControlLevel::Guardian);
    assert_eq!(pair.said("guardian"), 1);
    assert_eq!(pair.said("link-lost"), 0);
    assert!(pair.bridge.control().has(Danger::Bridge));
}

#[test]
fn a_pause_of_the_host_of_both_is_no_loss_of_the_ground_station() {
    let mut pair = Pair::new(22);
    pair.take_off();
    pair.run(20.0);
    // Longer than the failsafe of 5 s, for bridge and stand-in alike.
    pair.tick += 8 * 50;
    pair.run(10.0);
    assert_eq!(pair.vehicle.custom_mode(), GUIDED);
    assert_eq!(pair.bridge.level(), ControlLevel::Automatic);
    assert_eq!(pair.said("guardian"), 0, "{:#?}", pair.events);
}

#[test]
fn it_stands_and_lands_on_its_terrain() {
    // A plateau of 520 m all over the tile, where the site itself is at 340 m.
    let bytes: Vec<u8> = (0..1201 * 1201)
        .flat_map(|_| 520i16.to_be_bytes())
        .collect();
    let site = air::geo::Geodetic {
        lat_deg: 43.4417,
        lon_deg: -7.8631,
    };
    let terrain = air::terrain::Terrain::from_hgt("N43W008.hgt", &bytes, site, 340.0).unwrap();
    let mut pair = Pair::with(stand_in_config().over(terrain), 19);
    pair.run(1.0);
    assert!((pair.vehicle.truth().alt_amsl_m - 520.0).abs() < 1.0);
    pair.take_off();
    pair.run(30.0);
    let home = scenario().home(5).unwrap();
    let mut land = setpoint(PathKind::Land, 0.0, 0.0, 520.0);
    (land.lat_deg, land.lon_deg) = (home.lat_deg, home.lon_deg);
    pair.setpoint = Some(land);
    pair.run(400.0);
    assert!(!pair.state.as_ref().unwrap().airborne, "{:?}", pair.state);
    assert!((pair.vehicle.truth().alt_amsl_m - 520.0).abs() < 1.0);
}

#[test]
fn home_mode_by_the_pilot_is_the_pilots() {
    let mut pair = Pair::new(15);
    pair.take_off();
    assert!(pair.vehicle.pilot(RTL, TURN));
    pair.run(2.0);
    assert_eq!(pair.bridge.level(), ControlLevel::Pilot);
}

fn mission_over(pair: &mut Pair) {
    let mut out = BridgeOutput::default();
    pair.bridge.mission_over(&mut out);
    pair.events.extend(out.events);
    pair.setpoint = None;
}

#[test]
fn when_the_mission_is_over_it_lands_first() {
    let mut pair = Pair::new(20);
    pair.take_off();
    pair.setpoint = Some(setpoint(PathKind::GoTo, -800.0, 1500.0, 650.0));
    pair.run(60.0);
    mission_over(&mut pair);
    assert!(pair.bridge.is_up());
    for _ in 0..600 {
        pair.run(1.0);
        mission_over(&mut pair);
        if !pair.bridge.is_up() {
            break;
        }
    }
    assert!(!pair.bridge.is_up() && !pair.vehicle.is_armed());
    assert_eq!((pair.said("mission-over"), pair.said("landed")), (1, 1));
}

#[test]
fn when_the_mission_is_over_a_pilot_keeps_it() {
    let mut pair = Pair::new(21);
    pair.take_off();
    pair.run(5.0);
    pair.vehicle.pilot(FBWA, TURN);
    pair.run(2.0);
    pair.sent.clear();
    mission_over(&mut pair);
    pair.run(10.0);
    assert!(pair.bridge.is_up());
    assert_eq!(steering_commands(&pair.sent), 0);
}
