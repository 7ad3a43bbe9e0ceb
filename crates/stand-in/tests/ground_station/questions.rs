//! Questions and commands: nothing is met with silence that ArduPlane answers.

use crate::ground_station::station::{SYSTEM, Station, long, place};
use mav_bridge::arduplane::{AUTO, CIRCLE, GUIDED, LOITER, MANUAL, RTL, TAKEOFF};
use mav_bridge::dialect::{
    AVAILABLE_MODES_DATA, COMMAND_INT_DATA, CURRENT_MODE_DATA, EKF_STATUS_REPORT_DATA,
    FILE_TRANSFER_PROTOCOL_DATA, LOG_REQUEST_LIST_DATA, MEMINFO_DATA, MISSION_CURRENT_DATA, MavCmd,
    MavDataStream, MavFrame, MavMessage, MavProtocolCapability, MavResult,
    NAV_CONTROLLER_OUTPUT_DATA, PARAM_REQUEST_LIST_DATA, PARAM_SET_DATA, PING_DATA,
    PROTOCOL_VERSION_DATA, RAW_IMU_DATA, RC_CHANNELS_DATA, REQUEST_DATA_STREAM_DATA,
    SERVO_OUTPUT_RAW_DATA, SET_MODE_DATA, SYSTEM_TIME_DATA, TIMESYNC_DATA, VIBRATION_DATA,
};
use mav_bridge::wire::{FrameEncoder, MessageData as _};
use protocol::SimTime;

const ACCEPTED: MavResult = MavResult::MAV_RESULT_ACCEPTED;
const DENIED: MavResult = MavResult::MAV_RESULT_DENIED;
const FAILED: MavResult = MavResult::MAV_RESULT_FAILED;

/// No command is met with silence; its number stands in the answer, known or not. A message asked
/// for comes after the answer.
#[test]
fn every_command_is_answered() {
    for (command, param1, result) in [
        (MavCmd::MAV_CMD_NAV_RETURN_TO_LAUNCH, 0.0, ACCEPTED),
        (MavCmd::MAV_CMD_NAV_LOITER_UNLIM, 0.0, ACCEPTED),
        // A quadplane's, and this is none.
        (MavCmd::MAV_CMD_NAV_TAKEOFF, 0.0, FAILED),
        (
            MavCmd::MAV_CMD_DO_DIGICAM_CONTROL,
            0.0,
            MavResult::MAV_RESULT_UNSUPPORTED,
        ),
        (MavCmd::MAV_CMD_REQUEST_MESSAGE, 148.0, ACCEPTED),
        (MavCmd::MAV_CMD_REQUEST_MESSAGE, 9999.0, FAILED),
    ] {
        let heard = Station::new().ask(&long(command, &[param1]));
        let ack = heard.iter().position(
            |m| matches!(m, MavMessage::COMMAND_ACK(a) if a.command == command && a.result == result),
        );
        assert!(ack.is_some(), "{command:?}: {heard:?}");
        let version = heard
            .iter()
            .position(|m| matches!(m, MavMessage::AUTOPILOT_VERSION(_)));
        assert_eq!(version.is_some(), param1 == 148.0);
        assert!(version.is_none_or(|at| at > ack.unwrap()));
    }
    let mut frame = FrameEncoder::new(255, 190).encode(
        &long(MavCmd::MAV_CMD_NAV_TAKEOFF, &[]),
        None,
        SimTime::ZERO,
    );
    // The same command with a number that no dialect has, 40404.
    let number = 10 + 28;
    frame[number..number + 2].copy_from_slice(&40_404_u16.to_le_bytes());
    let end = frame.len() - 2;
    let sum = mavlink::calculate_crc(&frame[1..end], 152);
    frame[end..].copy_from_slice(&sum.to_le_bytes());
    let said = Station::new()
        .vehicle
        .step(SimTime::from_ns(3_000_000_000), &[frame]);
    let answer: &[u8] = said
        .iter()
        .find(|f| f[7] == 77)
        .map_or(&[], |f| &f[10..10 + usize::from(f[1])]);
    // 40404 and UNSUPPORTED (3).
    assert_eq!(answer, [0xd4, 0x9d, 3]);
}

/// In every mode the answers are those of ArduPlane 4.8: see `handle_command_int_packet` of its
/// GCS_MAVLink_Plane.cpp.
#[test]
fn it_refuses_what_arduplane_refuses() {
    let mut station = Station::new();
    station.mode(TAKEOFF);
    let arm = MavCmd::MAV_CMD_COMPONENT_ARM_DISARM;
    assert_eq!(station.command(arm, &[1.0]), ACCEPTED);
    station.run(20.0);
    let speed = MavCmd::MAV_CMD_DO_CHANGE_SPEED;
    let (x, y) = place(300.0, 400.0);
    let relative = MavFrame::MAV_FRAME_GLOBAL_RELATIVE_ALT;
    let there = COMMAND_INT_DATA {
        command: MavCmd::MAV_CMD_DO_REPOSITION,
        param1: -1.0,
        x,
        y,
        z: 90.0,
        frame: relative,
        target_system: SYSTEM,
        ..COMMAND_INT_DATA::default()
    };
    for mode in [LOITER, CIRCLE, RTL, TAKEOFF, MANUAL] {
        station.mode(mode);
        assert_eq!(station.command(speed, &[0.0, 17.0]), FAILED, "mode {mode}");
        assert_eq!(station.command_int(&there), FAILED, "mode {mode}");
        assert_eq!(station.vehicle.custom_mode(), mode);
    }
    station.mode(LOITER);
    let nowhere = COMMAND_INT_DATA {
        x: 0,
        y: 0,
        ..there.clone()
    };
    let at_home_height = COMMAND_INT_DATA {
        z: 0.0,
        ..there.clone()
    };
    let into_the_ground = COMMAND_INT_DATA {
        z: 100.0,
        frame: MavFrame::MAV_FRAME_GLOBAL,
        ..there.clone()
    };
    let off_earth = COMMAND_INT_DATA {
        x: 950_000_000,
        ..there.clone()
    };
    let in_no_frame = COMMAND_INT_DATA {
        frame: MavFrame::MAV_FRAME_BODY_FRD,
        ..there.clone()
    };
    // The flag that changes the mode helps a bad place as little.
    for flag in [0.0, 1.0] {
        for wrong in [
            &nowhere,
            &at_home_height,
            &into_the_ground,
            &off_earth,
            &in_no_frame,
        ] {
            let wrong = COMMAND_INT_DATA {
                param2: flag,
                ..wrong.clone()
            };
            assert_eq!(station.command_int(&wrong), DENIED, "{wrong:?}");
        }
        assert_eq!(station.vehicle.custom_mode(), LOITER);
    }
    let with_flag = COMMAND_INT_DATA {
        param2: 1.0,
        ..there.clone()
    };
    assert_eq!(station.command_int(&with_flag), ACCEPTED);
    assert_eq!(station.vehicle.custom_mode(), GUIDED);
    for (command, p, result) in [
        (speed, [0.0, 17.0, 0.0], ACCEPTED),
        (speed, [0.0, 60.0, 0.0], FAILED),
        (speed, [1.0, 14.0, 0.0], ACCEPTED),
        (speed, [2.0, 14.0, 0.0], FAILED),
        (
            MavCmd::MAV_CMD_DO_REPOSITION,
            [-1.0, 0.0, 0.0],
            MavResult::MAV_RESULT_UNSUPPORTED,
        ),
        (
            MavCmd::MAV_CMD_GUIDED_CHANGE_HEADING,
            [1.0, 400.0, 0.0],
            DENIED,
        ),
        (
            MavCmd::MAV_CMD_GUIDED_CHANGE_HEADING,
            [1.0, 90.0, 0.0],
            ACCEPTED,
        ),
        (MavCmd::MAV_CMD_MISSION_START, [1.0, 0.0, 0.0], DENIED),
        (MavCmd::MAV_CMD_DO_SET_MODE, [0.0, 15.0, 0.0], DENIED),
        (MavCmd::MAV_CMD_DO_SET_MODE, [1.0, 23.0, 0.0], FAILED),
        (
            MavCmd::MAV_CMD_PREFLIGHT_CALIBRATION,
            [1.0, 0.0, 0.0],
            FAILED,
        ),
        (
            MavCmd::MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN,
            [1.0, 0.0, 0.0],
            FAILED,
        ),
        (MavCmd::MAV_CMD_DO_GO_AROUND, [0.0; 3], FAILED),
        (MavCmd::MAV_CMD_DO_RETURN_PATH_START, [0.0; 3], FAILED),
        (arm, [0.0, 0.0, 0.0], FAILED),
        (MavCmd::MAV_CMD_DO_LAND_START, [0.0; 3], ACCEPTED),
    ] {
        assert_eq!(station.command(command, &p), result, "{command:?} {p:?}");
    }
    assert_eq!(station.vehicle.custom_mode(), AUTO);
}

/// The numbers of the messages that QGroundControl, MAVProxy and MAVSDK show.
#[test]
fn the_usual_streams_come_by_themselves_and_by_group() {
    let mut station = Station::new();
    let usual = [
        SYSTEM_TIME_DATA::ID,
        RC_CHANNELS_DATA::ID,
        NAV_CONTROLLER_OUTPUT_DATA::ID,
        MISSION_CURRENT_DATA::ID,
        SERVO_OUTPUT_RAW_DATA::ID,
        VIBRATION_DATA::ID,
        EKF_STATUS_REPORT_DATA::ID,
        RAW_IMU_DATA::ID,
        MEMINFO_DATA::ID,
    ];
    use mav_bridge::dialect::MavMessage as M;
    let number = |m: &M| mavlink::Message::message_id(m);
    station.run(1.5);
    for id in usual {
        assert!(
            station.heard.iter().any(|m| number(m) == id),
            "message {id}"
        );
    }
    // Four a second of one group, the others as they were.
    station.send(&REQUEST_DATA_STREAM_DATA {
        req_message_rate: 4,
        target_system: SYSTEM,
        target_component: 1,
        req_stream_id: MavDataStream::MAV_DATA_STREAM_RC_CHANNELS,
        start_stop: 1,
    });
    station.step();
    station.heard.clear();
    station.run(5.0);
    let count = |id| station.heard.iter().filter(|m| number(m) == id).count();
    assert!((19..=21).contains(&count(RC_CHANNELS_DATA::ID)));
    assert!((19..=21).contains(&count(SERVO_OUTPUT_RAW_DATA::ID)));
    assert!((4..=6).contains(&count(RAW_IMU_DATA::ID)));
}

/// A clock is answered with its own time and ours; a ping is not, as by ArduPlane 4.8.
#[test]
fn clocks_are_answered_and_pings_are_not() {
    let mut station = Station::new();
    let heard = station.ask(&TIMESYNC_DATA {
        ts1: 123_456,
        target_system: SYSTEM,
        ..TIMESYNC_DATA::default()
    });
    let synchronised = heard.iter().any(
        |m| matches!(m, MavMessage::TIMESYNC(m) if m.ts1 == 123_456 && m.tc1 >= 3_000_000_000),
    );
    assert!(synchronised);
    let heard = station.ask(&PING_DATA {
        seq: 7,
        ..PING_DATA::default()
    });
    assert!(!heard.iter().any(|m| matches!(m, MavMessage::PING(_))));
}

/// SET_MODE is obeyed without an acknowledgement, as by ArduPlane 4.8: it is no command.
#[test]
fn the_message_that_sets_a_mode_is_obeyed_in_silence() {
    let mut station = Station::new();
    let heard = station.ask(&SET_MODE_DATA {
        target_system: SYSTEM,
        custom_mode: LOITER,
        ..SET_MODE_DATA::default()
    });
    assert_eq!(station.vehicle.custom_mode(), LOITER);
    assert!(
        !heard
            .iter()
            .any(|m| matches!(m, MavMessage::COMMAND_ACK(_)))
    );
}

/// Files are refused, not passed over: MAVLink's file protocol, opcodes 128 (yes) and 129 (no).
#[test]
fn files_and_logs_are_refused_in_words() {
    let mut station = Station::new();
    for (opcode, answer, why) in [(4, 129, 10), (3, 129, 10), (2, 128, 0), (1, 128, 0)] {
        let mut payload = [0; 251];
        payload[0] = 41;
        payload[3] = opcode;
        let heard = station.ask(&FILE_TRANSFER_PROTOCOL_DATA {
            target_network: 0,
            target_system: SYSTEM,
            target_component: 1,
            payload,
        });
        let said = heard.iter().find_map(|m| match m {
            MavMessage::FILE_TRANSFER_PROTOCOL(m) => Some(m.payload),
            _ => None,
        });
        let said = said.unwrap();
        assert_eq!(
            (said[0], said[3], said[5], said[12]),
            (42, answer, opcode, why)
        );
    }
    let heard = station.ask(&LOG_REQUEST_LIST_DATA {
        target_system: SYSTEM,
        ..LOG_REQUEST_LIST_DATA::default()
    });
    assert!(
        heard
            .iter()
            .any(|m| matches!(m, MavMessage::LOG_ENTRY(m) if m.num_logs == 0))
    );
}

/// What a ground station asks when it connects: what it may ask for, its modes, its parameters.
#[test]
fn a_ground_station_connects() {
    let mut station = Station::new();
    let request = MavCmd::MAV_CMD_REQUEST_MESSAGE;
    let heard = station.ask(&long(request, &[148.0]));
    let capabilities = heard.iter().find_map(|m| match m {
        MavMessage::AUTOPILOT_VERSION(m) => Some(m.capabilities),
        _ => None,
    });
    let capabilities = capabilities.unwrap();
    for has in [
        MavProtocolCapability::MAV_PROTOCOL_CAPABILITY_MISSION_INT,
        MavProtocolCapability::MAV_PROTOCOL_CAPABILITY_MISSION_FENCE,
        MavProtocolCapability::MAV_PROTOCOL_CAPABILITY_MISSION_RALLY,
    ] {
        assert!(capabilities.contains(has));
    }
    let ftp = MavProtocolCapability::MAV_PROTOCOL_CAPABILITY_FTP;
    assert!(!capabilities.contains(ftp));
    // Every mode that is told can be entered.
    let heard = station.ask(&long(request, &[AVAILABLE_MODES_DATA::ID as f32, 0.0]));
    let modes: Vec<_> = heard
        .iter()
        .filter_map(|m| match m {
            MavMessage::AVAILABLE_MODES(m) => Some(m.clone()),
            _ => None,
        })
        .collect();
    assert_eq!(modes.len(), usize::from(modes[0].number_modes));
    for (index, mode) in (1..).zip(&modes) {
        assert_eq!(mode.mode_index, index);
        station.mode(mode.custom_mode);
        let heard = station.ask(&long(request, &[CURRENT_MODE_DATA::ID as f32]));
        let told = |m: &MavMessage| matches!(m, MavMessage::CURRENT_MODE(m) if m.custom_mode == mode.custom_mode);
        assert!(heard.iter().any(told));
    }
    let heard = station.ask(&long(request, &[PROTOCOL_VERSION_DATA::ID as f32]));
    assert!(
        heard
            .iter()
            .any(|m| matches!(m, MavMessage::PROTOCOL_VERSION(m) if m.version == 200))
    );
    // COMPONENT_METADATA and COMPONENT_INFORMATION, which ArduPlane has not.
    for absent in [397.0, 395.0] {
        assert_eq!(station.command(request, &[absent]), FAILED);
    }
    let heard = station.ask(&PARAM_REQUEST_LIST_DATA {
        target_system: SYSTEM,
        target_component: 1,
    });
    let indices: Vec<_> = heard
        .iter()
        .filter_map(|m| match m {
            MavMessage::PARAM_VALUE(m) => Some((m.param_index, m.param_count)),
            _ => None,
        })
        .collect();
    let count = indices.len() as u16;
    assert!(
        indices
            .iter()
            .zip(0..)
            .all(|(&told, index)| told == (index, count))
    );
    // A value that is not to be set stays, and is told.
    for (name, sent, kept) in [("WP_RADIUS", 60.0, 60.0), ("MAV_SYSID", 9.0, 6.0)] {
        let heard = station.ask(&PARAM_SET_DATA {
            param_value: sent,
            target_system: SYSTEM,
            target_component: 1,
            param_id: name.into(),
            ..PARAM_SET_DATA::default()
        });
        let told =
            |m: &MavMessage| matches!(m, MavMessage::PARAM_VALUE(m) if m.param_value == kept);
        assert!(heard.iter().any(told), "{name}");
    }
}
