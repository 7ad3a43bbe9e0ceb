//! Missions, fences and rally points: carried over, refused, flown.

use crate::ground_station::station::{
    FENCE, Item, MISSION, RALLY, SYSTEM, Station, deed, item, numbered, place,
};
use air::geo::{Enu, Geodetic};
use mav_bridge::arduplane::{AUTO, GUIDED, LOITER, RTL, TAKEOFF};
use mav_bridge::dialect::{
    MISSION_CLEAR_ALL_DATA, MISSION_COUNT_DATA, MISSION_REQUEST_INT_DATA, MISSION_SET_CURRENT_DATA,
    MISSION_WRITE_PARTIAL_LIST_DATA, MavCmd, MavFrame, MavMessage, MavMissionResult,
    MavMissionType, MavResult, MavSysStatusSensor, MissionState,
};
use mav_bridge::wire::FrameEncoder;
use protocol::SimTime;
use rand::rngs::ChaCha8Rng;
use rand::{RngExt, SeedableRng};

const ACCEPTED: MavMissionResult = MavMissionResult::MAV_MISSION_ACCEPTED;
const WAYPOINT: MavCmd = MavCmd::MAV_CMD_NAV_WAYPOINT;
const INSIDE: MavCmd = MavCmd::MAV_CMD_NAV_FENCE_POLYGON_VERTEX_INCLUSION;

fn square(half_m: f64) -> Vec<Item> {
    let corner = |(n, e)| item(INSIDE, [4.0, 0.0, 0.0, 0.0], (n * half_m, e * half_m, 0.0));
    let corners = [(1.0, 1.0), (1.0, -1.0), (-1.0, -1.0), (-1.0, 1.0)];
    numbered(corners.map(corner).to_vec())
}

fn tour() -> Vec<Item> {
    let nothing = [0.0; 4];
    numbered(vec![
        item(WAYPOINT, nothing, (0.0, 0.0, 0.0)),
        item(MavCmd::MAV_CMD_NAV_TAKEOFF, nothing, (0.0, 0.0, 60.0)),
        item(WAYPOINT, nothing, (600.0, 0.0, 100.0)),
        deed(MavCmd::MAV_CMD_DO_CHANGE_SPEED, [0.0, 20.0, -1.0, 0.0]),
        item(WAYPOINT, nothing, (600.0, 700.0, 120.0)),
        deed(MavCmd::MAV_CMD_DO_JUMP, [2.0, 1.0, 0.0, 0.0]),
        item(
            MavCmd::MAV_CMD_NAV_LOITER_TURNS,
            [1.0, 0.0, 90.0, 0.0],
            (0.0, 900.0, 100.0),
        ),
        item(MavCmd::MAV_CMD_DO_LAND_START, nothing, (0.0, 0.0, 0.0)),
        item(WAYPOINT, nothing, (-300.0, 600.0, 60.0)),
        item(MavCmd::MAV_CMD_NAV_LAND, nothing, (0.0, 0.0, 0.0)),
    ])
}

/// The two lists say the same, but for what the protocol adds.
fn assert_same(sent: &[Item], back: &[Item]) {
    assert_eq!(sent.len(), back.len());
    for (a, b) in sent.iter().zip(back) {
        let said = |i: &Item| {
            let p = [i.param1, i.param2, i.param3, i.param4];
            (i.seq, i.command, i.x, i.y, i.z, p)
        };
        assert_eq!(said(a), said(b));
        assert_eq!((b.target_system, b.target_component), (255, 190));
    }
}

/// As ArduPlane keeps them.
#[test]
fn a_command_without_a_place_comes_back_without_one() {
    let mut station = Station::new();
    let speed = MavCmd::MAV_CMD_DO_CHANGE_SPEED;
    let mut items = tour();
    items[3] = Item {
        seq: 3,
        ..item(speed, [0.0, 20.0, -1.0, 0.0], (600.0, 0.0, 100.0))
    };
    assert_eq!(station.upload(MISSION, &items).0, ACCEPTED);
    let back = station.download(MISSION);
    assert_eq!((back[3].command, back[3].param2), (speed, 20.0));
    assert_eq!((back[3].x, back[3].y, back[3].z), (0, 0, 0.0));
}

#[test]
fn each_list_comes_back_as_it_was_sent_and_leaves_the_others_alone() {
    let mut station = Station::new();
    let mission = tour();
    let fence = square(3000.0);
    let rally_point = MavCmd::MAV_CMD_NAV_RALLY_POINT;
    let rally = numbered(vec![item(rally_point, [0.0; 4], (400.0, 300.0, 90.0))]);
    for (kind, items) in [(MISSION, &mission), (FENCE, &fence), (RALLY, &rally)] {
        let (ended, asked) = station.upload(kind, items);
        assert_eq!(ended, ACCEPTED);
        let each: Vec<u16> = (0..items.len() as u16).collect();
        assert_eq!(asked, each);
    }
    let back = station.download(MISSION);
    // Item 0 is home, whatever was sent as such: 340 m above the sea.
    assert_eq!((back[0].x, back[0].y), place(0.0, 0.0));
    assert_eq!(back[0].frame, MavFrame::MAV_FRAME_GLOBAL);
    assert!((back[0].z - 340.0).abs() < 1.0, "{}", back[0].z);
    assert_same(&mission[1..], &back[1..]);
    assert_same(&fence, &station.download(FENCE));
    assert_same(&rally, &station.download(RALLY));
    // A clearing of one leaves the others; of all, none.
    for (kind, left) in [
        (FENCE, [mission.len(), 0, 1]),
        (MavMissionType::MAV_MISSION_TYPE_ALL, [0, 0, 0]),
    ] {
        let heard = station.ask(&MISSION_CLEAR_ALL_DATA {
            target_system: SYSTEM,
            target_component: 1,
            mission_type: kind,
        });
        assert_eq!(ended(&heard), Some((ACCEPTED, kind)));
        let counts = [MISSION, FENCE, RALLY].map(|kind| station.download(kind).len());
        assert_eq!(counts, left);
    }
}

#[test]
fn random_missions_come_back() {
    let mut rng = ChaCha8Rng::seed_from_u64(5);
    let mut station = Station::new();
    let commands = [
        WAYPOINT,
        MavCmd::MAV_CMD_NAV_LOITER_UNLIM,
        MavCmd::MAV_CMD_NAV_LOITER_TURNS,
        MavCmd::MAV_CMD_NAV_LOITER_TIME,
        MavCmd::MAV_CMD_NAV_TAKEOFF,
        MavCmd::MAV_CMD_NAV_LOITER_TO_ALT,
        MavCmd::MAV_CMD_DO_JUMP,
        MavCmd::MAV_CMD_DO_CHANGE_SPEED,
        MavCmd::MAV_CMD_DO_SET_SERVO,
        MavCmd::MAV_CMD_DO_SET_CAM_TRIGG_DIST,
    ];
    for _ in 0..40 {
        let length = rng.random_range(1..40);
        let items = (0..length).map(|_| {
            let at = (
                rng.random_range(-5e4..5e4),
                rng.random_range(-5e4..5e4),
                rng.random_range(-500.0..8e4),
            );
            let target = rng.random_range(1..=length.max(2) - 1) as f32;
            let p = [target, rng.random_range(-9.0..9.0), 5.0, 0.0];
            let command = commands[rng.random_range(0..commands.len())];
            let sent = item(command, p, at);
            // Those from 112 on need no place, and keep none.
            match command as u32 {
                0..112 => sent,
                _ => Item {
                    x: 0,
                    y: 0,
                    z: 0.0,
                    ..sent
                },
            }
        });
        let items = numbered(items.collect());
        let is_short = length == 1 && items[0].command == MavCmd::MAV_CMD_DO_JUMP;
        let (result, _) = station.upload(MISSION, &items);
        if is_short {
            continue;
        }
        assert_eq!(result, ACCEPTED, "{items:?}");
        assert_same(&items[1..], &station.download(MISSION)[1..]);
    }
}

/// How the last exchange ended.
fn ended(heard: &[MavMessage]) -> Option<(MavMissionResult, MavMissionType)> {
    heard.iter().rev().find_map(|m| match m {
        MavMessage::MISSION_ACK(m) => Some((m.mavtype, m.mission_type)),
        _ => None,
    })
}

#[test]
fn a_refused_upload_leaves_what_was_on_board() {
    let mut station = Station::new();
    let old = tour();
    assert_eq!(station.upload(MISSION, &old).0, ACCEPTED);
    assert_eq!(station.upload(FENCE, &square(2000.0)).0, ACCEPTED);
    let good = || item(WAYPOINT, [0.0; 4], (100.0, 100.0, 100.0));
    let wrong = |change: fn(&mut Item)| {
        let mut item = good();
        change(&mut item);
        numbered(vec![good(), good(), item])
    };
    for (items, result) in [
        (
            wrong(|i| i.command = MavCmd::MAV_CMD_NAV_RALLY_POINT),
            MavMissionResult::MAV_MISSION_UNSUPPORTED,
        ),
        (
            wrong(|i| i.frame = MavFrame::MAV_FRAME_BODY_FRD),
            MavMissionResult::MAV_MISSION_UNSUPPORTED_FRAME,
        ),
        (
            wrong(|i| i.x = 910_000_000),
            MavMissionResult::MAV_MISSION_INVALID_PARAM5_X,
        ),
        (
            wrong(|i| i.y = -1_810_000_000),
            MavMissionResult::MAV_MISSION_INVALID_PARAM6_Y,
        ),
        (
            wrong(|i| i.z = f32::NAN),
            MavMissionResult::MAV_MISSION_INVALID_PARAM7,
        ),
        (
            wrong(|i| i.param2 = f32::INFINITY),
            MavMissionResult::MAV_MISSION_INVALID_PARAM2,
        ),
        (
            wrong(|i| {
                i.command = MavCmd::MAV_CMD_DO_JUMP;
                i.param1 = 3.0;
            }),
            MavMissionResult::MAV_MISSION_ERROR,
        ),
        (
            numbered(vec![good(); 725]),
            MavMissionResult::MAV_MISSION_NO_SPACE,
        ),
    ] {
        assert_eq!(station.upload(MISSION, &items).0, result);
        assert_same(&old[1..], &station.download(MISSION)[1..]);
    }
    // Two corners make no polygon.
    let thin = numbered(vec![item(INSIDE, [2.0, 0.0, 0.0, 0.0], (0.0, 0.0, 0.0)); 2]);
    let error = MavMissionResult::MAV_MISSION_ERROR;
    assert_eq!(station.upload(FENCE, &thin).0, error);
    assert_eq!(station.download(FENCE).len(), 4);
}

/// An item beyond the end is refused with the true length, as ArduPlane 4.7.0-dev in software did
/// (`MissionItemProtocol_Waypoints::get_item`).
#[test]
fn an_item_beyond_the_end_is_refused_with_the_length() {
    let mut station = Station::new();
    let length = station.download(MISSION).len();
    let heard = station.ask(&MISSION_REQUEST_INT_DATA {
        target_system: SYSTEM,
        target_component: 1,
        seq: 99,
        mission_type: MISSION,
    });
    let count = heard.iter().find_map(|m| match m {
        MavMessage::MISSION_COUNT(m) => Some(usize::from(m.count)),
        _ => None,
    });
    assert_eq!(count, Some(length));
    let beyond = MavMissionResult::MAV_MISSION_INVALID_SEQUENCE;
    assert_eq!(ended(&heard), Some((beyond, MISSION)));
}

/// A command with a number that no dialect has, 40404, is refused by its answer, not by silence.
#[test]
fn an_item_with_an_unknown_command_is_refused() {
    let mut station = Station::new();
    station.send(&MISSION_COUNT_DATA {
        count: 1,
        target_system: SYSTEM,
        target_component: 1,
        ..MISSION_COUNT_DATA::default()
    });
    station.step();
    let known = item(WAYPOINT, [0.0; 4], (0.0, 0.0, 50.0));
    let mut frame = FrameEncoder::new(255, 190).encode(&known, None, SimTime::ZERO);
    frame[10 + 30..10 + 32].copy_from_slice(&40_404_u16.to_le_bytes());
    let end = frame.len() - 2;
    // The extra byte of MISSION_ITEM_INT is 38 (mavlink.io, common.xml by the rule of its page).
    let sum = mavlink::calculate_crc(&frame[1..end], 38);
    frame[end..].copy_from_slice(&sum.to_le_bytes());
    station.send_bytes(frame);
    station.run(0.5);
    let unsupported = MavMissionResult::MAV_MISSION_UNSUPPORTED;
    assert_eq!(ended(&station.heard), Some((unsupported, MISSION)));
}

#[test]
fn a_silent_uploader_is_asked_again_and_then_given_up() {
    let mut station = Station::new();
    let old = tour();
    assert_eq!(station.upload(MISSION, &old).0, ACCEPTED);
    station.heard.clear();
    station.send(&MISSION_COUNT_DATA {
        count: 4,
        target_system: SYSTEM,
        target_component: 1,
        ..MISSION_COUNT_DATA::default()
    });
    station.run(5.0);
    let asked = |heard: &[MavMessage]| {
        let asks = |m: &&MavMessage| matches!(m, MavMessage::MISSION_REQUEST(m) if m.seq == 0);
        heard.iter().filter(asks).count()
    };
    // At once, and then every second or so.
    assert!((4..=6).contains(&asked(&station.heard)));
    // Nobody may read while somebody writes.
    let heard = station.ask(&MISSION_REQUEST_INT_DATA {
        seq: 1,
        target_system: SYSTEM,
        target_component: 1,
        mission_type: MISSION,
    });
    let denied = MavMissionResult::MAV_MISSION_DENIED;
    assert_eq!(ended(&heard), Some((denied, MISSION)));
    station.run(5.0);
    let cancelled = MavMissionResult::MAV_MISSION_OPERATION_CANCELLED;
    assert_eq!(ended(&station.heard), Some((cancelled, MISSION)));
    assert_same(&old[1..], &station.download(MISSION)[1..]);
}

#[test]
fn a_part_of_a_mission_is_written_over() {
    let mut station = Station::new();
    let mut items = tour();
    assert_eq!(station.upload(MISSION, &items).0, ACCEPTED);
    let partial = |start_index, end_index| MISSION_WRITE_PARTIAL_LIST_DATA {
        start_index,
        end_index,
        target_system: SYSTEM,
        target_component: 1,
        mission_type: MISSION,
    };
    items[2].z = 140.0;
    items[3].param2 = 17.0;
    station.send(&partial(2, 3));
    station.step();
    for k in [2, 3] {
        station.send(&items[k].clone());
        station.step();
    }
    assert_eq!(ended(&station.heard), Some((ACCEPTED, MISSION)));
    assert_same(&items[1..], &station.download(MISSION)[1..]);
    let heard = station.ask(&partial(3, 12));
    let error = MavMissionResult::MAV_MISSION_ERROR;
    assert_eq!(ended(&heard), Some((error, MISSION)));
}

/// Where it really is, from its home.
fn from_home(station: &Station) -> Enu {
    let truth = station.vehicle.truth();
    let scenario = crate::ground_station::station::scenario();
    let frame = scenario.frame().unwrap();
    let home = frame.to_enu(scenario.home(5).unwrap());
    Enu {
        east_m: truth.east_m - home.east_m,
        north_m: truth.north_m - home.north_m,
    }
}

/// Distance from an item of a mission, m.
fn distance_m(station: &Station, item: &Item) -> f64 {
    let scenario = crate::ground_station::station::scenario();
    let frame = scenario.frame().unwrap();
    let truth = station.vehicle.truth();
    let at = Enu {
        east_m: truth.east_m,
        north_m: truth.north_m,
    };
    at.distance_m(frame.to_enu(Geodetic {
        lat_deg: f64::from(item.x) / 1e7,
        lon_deg: f64::from(item.y) / 1e7,
    }))
}

/// Arms it in AUTO and flies until `done` or for so long; the numbers of the items as they were
/// reached, and the greatest distance from a waypoint when it was.
fn fly(
    station: &mut Station,
    items: &[Item],
    seconds: f64,
    done: fn(&Station) -> bool,
) -> (Vec<u16>, f64) {
    let start = MavCmd::MAV_CMD_MISSION_START;
    let accepted = MavResult::MAV_RESULT_ACCEPTED;
    assert_eq!(station.command(start, &[]), accepted);
    assert_eq!(station.vehicle.custom_mode(), AUTO);
    let arm = MavCmd::MAV_CMD_COMPONENT_ARM_DISARM;
    let (mut reached, mut farthest_m) = (Vec::new(), 0.0_f64);
    station.send(&crate::ground_station::station::long(arm, &[1.0]));
    for _ in 0..(seconds * 50.0) as u64 {
        station.heard.clear();
        station.step();
        for message in &station.heard {
            if let MavMessage::MISSION_ITEM_REACHED(m) = message {
                let item = &items[usize::from(m.seq)];
                if item.command == WAYPOINT {
                    farthest_m = farthest_m.max(distance_m(station, item));
                }
                reached.push(m.seq);
            }
        }
        if done(station) {
            break;
        }
    }
    (reached, farthest_m)
}

#[test]
fn a_mission_is_flown_from_take_off_to_touch_down() {
    let mut station = Station::new();
    let items = tour();
    assert_eq!(station.upload(MISSION, &items).0, ACCEPTED);
    let is_down = |s: &Station| !s.vehicle.is_armed() && s.vehicle.custom_mode() == AUTO;
    // Armed in the first tick, it is down only after its flight.
    let (reached, farthest_m) = fly(&mut station, &items, 900.0, |s| {
        s.vehicle.truth().alt_amsl_m > 390.0
    });
    assert!(reached.is_empty() || reached == [1], "{reached:?}");
    let mut order = reached;
    let mut current = Vec::new();
    let mut farthest_m = farthest_m;
    let mut speeds = Vec::new();
    for _ in 0..900 * 50 {
        station.heard.clear();
        station.step();
        for message in &station.heard {
            match message {
                MavMessage::MISSION_ITEM_REACHED(m) => {
                    let item = &items[usize::from(m.seq)];
                    if item.command == WAYPOINT {
                        farthest_m = farthest_m.max(distance_m(&station, item));
                    }
                    order.push(m.seq);
                }
                MavMessage::MISSION_CURRENT(m) => {
                    assert_eq!(usize::from(m.total), items.len() - 1);
                    current.push((m.seq, m.mission_state));
                }
                MavMessage::NAV_CONTROLLER_OUTPUT(_) if order.last() == Some(&3) => {
                    speeds.push(station.vehicle.truth().airspeed_m_s);
                }
                _ => {}
            }
        }
        if is_down(&station) {
            break;
        }
    }
    // Take-off, the two waypoints with the speed between them, once more by the jump, the circle, and
    // the way to the landing.
    assert_eq!(order, [1, 2, 3, 4, 2, 3, 4, 6, 7, 8]);
    // As far off as ArduPlane's own turn ahead of a waypoint: 4.06 s at ground speed.
    assert!(farthest_m < 110.0, "{farthest_m} m off");
    let active = MissionState::MISSION_STATE_ACTIVE;
    assert!(current.contains(&(9, active)), "{current:?}");
    assert!(is_down(&station), "{:?}", station.vehicle.truth());
    let down = from_home(&station);
    assert!(down.north_m.hypot(down.east_m) < 60.0, "{down:?}");
    // 20 m/s of equivalent airspeed are 20.4 in the air above As Pontes.
    let last = speeds.last().unwrap();
    assert!((last - 20.4).abs() < 1.0, "{speeds:?}");
}

#[test]
fn a_mission_that_ends_in_the_air_goes_home_and_goes_on_where_it_is_told() {
    let mut station = Station::new();
    let nothing = [0.0; 4];
    let items = numbered(vec![
        item(WAYPOINT, nothing, (0.0, 0.0, 0.0)),
        item(MavCmd::MAV_CMD_NAV_TAKEOFF, nothing, (0.0, 0.0, 50.0)),
        item(WAYPOINT, nothing, (400.0, 0.0, 80.0)),
        // For a camera that is not there.
        deed(MavCmd::MAV_CMD_DO_SET_CAM_TRIGG_DIST, [50.0, 0.0, 0.0, 0.0]),
        item(
            MavCmd::MAV_CMD_NAV_LOITER_TIME,
            [5.0, 0.0, 0.0, 0.0],
            (500.0, 300.0, 80.0),
        ),
    ]);
    assert_eq!(station.upload(MISSION, &items).0, ACCEPTED);
    let (reached, _) = fly(&mut station, &items, 400.0, |s| {
        s.vehicle.custom_mode() == RTL
    });
    assert_eq!(reached, [1, 2, 3, 4]);
    assert_eq!(station.vehicle.custom_mode(), RTL);
    // Sent back to its second item it flies that one, and no other.
    let set = MISSION_SET_CURRENT_DATA {
        seq: 2,
        target_system: SYSTEM,
        target_component: 1,
    };
    let heard = station.ask(&set);
    let told = |m: &MavMessage| matches!(m, MavMessage::MISSION_CURRENT(m) if m.seq == 2);
    assert!(heard.iter().any(told));
    station.mode(AUTO);
    // What is flown is not cleared.
    let heard = station.ask(&MISSION_CLEAR_ALL_DATA {
        target_system: SYSTEM,
        target_component: 1,
        mission_type: MISSION,
    });
    let error = MavMissionResult::MAV_MISSION_ERROR;
    assert_eq!(ended(&heard), Some((error, MISSION)));
    station.run(60.0);
    assert!(distance_m(&station, &items[2]) < 1200.0);
    station.mode(LOITER);
    let by_command = MavCmd::MAV_CMD_DO_SET_MISSION_CURRENT;
    assert_eq!(
        station.command(by_command, &[4.0]),
        MavResult::MAV_RESULT_ACCEPTED
    );
    assert_eq!(
        station.command(by_command, &[9.0]),
        MavResult::MAV_RESULT_DENIED
    );
}

#[test]
fn outside_its_fence_it_comes_home() {
    let mut station = Station::new();
    let health = |station: &mut Station| {
        station.heard.clear();
        station.run(1.1);
        let bits = station.heard.iter().rev().find_map(|m| match m {
            MavMessage::SYS_STATUS(m) => Some(m.onboard_control_sensors_health),
            _ => None,
        });
        bits.unwrap()
            .contains(MavSysStatusSensor::MAV_SYS_STATUS_GEOFENCE)
    };
    assert!(health(&mut station), "no fence is no breach");
    let enable = MavCmd::MAV_CMD_DO_FENCE_ENABLE;
    assert_eq!(
        station.command(enable, &[1.0]),
        MavResult::MAV_RESULT_FAILED
    );
    assert_eq!(station.upload(FENCE, &square(500.0)).0, ACCEPTED);
    assert_eq!(
        station.command(enable, &[1.0]),
        MavResult::MAV_RESULT_ACCEPTED
    );
    station.mode(TAKEOFF);
    let arm = MavCmd::MAV_CMD_COMPONENT_ARM_DISARM;
    assert_eq!(station.command(arm, &[1.0]), MavResult::MAV_RESULT_ACCEPTED);
    station.run(30.0);
    station.mode(GUIDED);
    let (x, y) = place(0.0, 450.0);
    let mut order = mav_bridge::dialect::COMMAND_INT_DATA {
        command: MavCmd::MAV_CMD_DO_REPOSITION,
        param1: -1.0,
        x,
        y,
        z: 80.0,
        frame: MavFrame::MAV_FRAME_GLOBAL_RELATIVE_ALT,
        target_system: SYSTEM,
        ..Default::default()
    };
    assert_eq!(station.command_int(&order), MavResult::MAV_RESULT_ACCEPTED);
    // Beyond it nothing is taken.
    (order.x, order.y) = place(0.0, 600.0);
    assert_eq!(station.command_int(&order), MavResult::MAV_RESULT_DENIED);
    for _ in 0..100 {
        station.run(1.0);
        if station.vehicle.custom_mode() == RTL {
            break;
        }
    }
    assert_eq!(station.vehicle.custom_mode(), RTL);
    assert!(from_home(&station).east_m > 490.0);
    assert!(!health(&mut station));
    station.run(120.0);
    assert!(health(&mut station));
}
