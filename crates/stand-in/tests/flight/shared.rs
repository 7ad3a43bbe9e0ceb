//! More than one vehicle, or more than one ground station, on a link.

use mav_bridge::dialect::{COMMAND_INT_DATA, MavCmd, MavFrame};
use mav_bridge::wire::FrameEncoder;
use mav_bridge::{Bridge, BridgeConfig, BridgeOutput};
use protocol::SimTime;
use protocol::message::{ControlLevel, PathKind};
use rand::SeedableRng;
use rand::rngs::ChaCha8Rng;
use stand_in::StandIn;

use crate::flight::pair::{Pair, TICK_NS, scenario, setpoint, stand_in_config, steering_commands};

/// Two bridges and two vehicles behind a router that sends every frame to everybody, for `seconds`; what each of
/// the bridges sent and said.
fn behind_a_router(
    asked: [Option<u8>; 2],
    first: usize,
    seconds: u64,
) -> ([BridgeOutput; 2], [StandIn; 2]) {
    let mut vehicles = [6u8, 7].map(|system_id| {
        let mut config = stand_in_config();
        config.system_id = system_id;
        StandIn::new(config, ChaCha8Rng::seed_from_u64(u64::from(system_id))).unwrap()
    });
    let mut bridges = asked.map(|vehicle_system_id| {
        let config = BridgeConfig {
            vehicle_system_id,
            may_arm: true,
            atmosphere: scenario().atmosphere().unwrap(),
            ..BridgeConfig::default()
        };
        Bridge::new(config).unwrap()
    });
    let mut said = [BridgeOutput::default(), BridgeOutput::default()];
    let mut to_vehicles: Vec<Vec<u8>> = Vec::new();
    for tick in 0..50 * seconds {
        let now = SimTime::of_tick(tick, TICK_NS);
        let mut heard = Vec::new();
        for k in [first, 1 - first] {
            heard.extend(vehicles[k].step(now, &to_vehicles));
        }
        to_vehicles.clear();
        for (k, bridge) in bridges.iter_mut().enumerate() {
            let out = &mut said[k];
            let before = out.frames_to_vehicle.len();
            for bytes in &heard {
                bridge.receive(bytes, now, out);
            }
            let take_off = setpoint(PathKind::TakeOff, -1000.0, 500.0 * k as f64, 650.0);
            bridge.setpoint(&take_off, now, out);
            bridge.tick(now, out);
            to_vehicles.extend(out.frames_to_vehicle[before..].iter().cloned());
        }
    }
    (said, vehicles)
}

/// Target systems of the commands among frames.
fn targets(frames: &[Vec<u8>]) -> Vec<u8> {
    let commands = frames.iter().filter(|f| matches!(f[7], 75 | 76));
    let mut targets: Vec<u8> = commands.map(|f| f[40]).collect();
    targets.sort_unstable();
    targets.dedup();
    targets
}

#[test]
fn two_vehicles_behind_one_router_are_told_apart_in_either_order() {
    for first in 0..2 {
        let (said, vehicles) = behind_a_router([Some(6), Some(7)], first, 60);
        for (k, own) in [6, 7].into_iter().enumerate() {
            assert_eq!(targets(&said[k].frames_to_vehicle), [own]);
            assert!(vehicles[k].is_armed());
            assert!(vehicles[k].truth().alt_amsl_m > 380.0);
        }
    }
}

#[test]
fn where_nobody_says_which_is_which_neither_takes_off() {
    for first in 0..2 {
        let (said, vehicles) = behind_a_router([None, None], first, 20);
        for k in 0..2 {
            assert_eq!(steering_commands(&said[k].frames_to_vehicle), 0);
            assert!(said[k].events.iter().any(|e| e.code == "two-vehicles"));
            assert!(!vehicles[k].is_armed());
        }
    }
}

#[test]
fn another_ground_station_that_sends_it_elsewhere_has_it() {
    let mut pair = Pair::new(22);
    pair.take_off();
    pair.setpoint = Some(setpoint(PathKind::GoTo, -800.0, 1500.0, 650.0));
    pair.run(20.0);
    assert_eq!(pair.said("other-ground-station"), 0);
    let elsewhere = setpoint(PathKind::GoTo, -2000.0, -1500.0, 650.0);
    let command = COMMAND_INT_DATA {
        param1: -1.0,
        x: (elsewhere.lat_deg * 1e7) as i32,
        y: (elsewhere.lon_deg * 1e7) as i32,
        z: 650.0,
        command: MavCmd::MAV_CMD_DO_REPOSITION,
        target_system: 6,
        target_component: 1,
        frame: MavFrame::MAV_FRAME_GLOBAL,
        ..COMMAND_INT_DATA::default()
    };
    let mut station = FrameEncoder::new(252, 190);
    pair.to_vehicle
        .push(station.encode(&command, None, pair.now()));
    pair.run(8.0);
    assert_eq!(pair.said("other-ground-station"), 1, "{:#?}", pair.events);
    assert_eq!(pair.bridge.level(), ControlLevel::Pilot);
    pair.sent.clear();
    pair.run(20.0);
    assert_eq!(steering_commands(&pair.sent), 0);
    pair.hand_back();
    pair.run(5.0);
    assert_eq!(pair.bridge.level(), ControlLevel::Automatic);
    assert!(steering_commands(&pair.sent) > 0);
}
