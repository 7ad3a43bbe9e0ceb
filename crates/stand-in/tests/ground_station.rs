//! What a ground station asks, and what the stand-in answers.
#![allow(clippy::unwrap_used)]

use mav_bridge::dialect::{
    COMMAND_LONG_DATA, MISSION_COUNT_DATA, MISSION_REQUEST_LIST_DATA, MavCmd, MavMessage,
    MavMissionResult, MavResult,
};
use mav_bridge::wire::{FrameDecoder, FrameEncoder, MessageData};
use protocol::SimTime;
use rand::SeedableRng;
use rand::rngs::ChaCha8Rng;
use scenario::Scenario;
use stand_in::{StandIn, StandInConfig};

const TICK_NS: i64 = 20_000_000;
const X8: &str = include_str!("../../../aircraft/x8.toml");
const AS_PONTES: &str = include_str!("../../../scenarios/as-pontes.toml");

fn vehicle() -> StandIn {
    let scenario = Scenario::parse("as-pontes.toml", AS_PONTES).unwrap();
    let aircraft = fdm::Aircraft::from_toml("x8.toml", X8).unwrap();
    let config = StandInConfig::from_scenario(&scenario, 5, aircraft).unwrap();
    StandIn::new(config, ChaCha8Rng::seed_from_u64(21)).unwrap()
}

/// What the stand-in says to `message` within a second.
fn answers<D: MessageData>(vehicle: &mut StandIn, message: &D) -> Vec<MavMessage> {
    let frame = FrameEncoder::new(255, 190).encode(message, None, SimTime::ZERO);
    let mut decoder = FrameDecoder::new();
    let mut heard = Vec::new();
    for tick in 0..50 {
        let now = SimTime::of_tick(tick, TICK_NS);
        let up = if tick == 0 {
            vec![frame.clone()]
        } else {
            Vec::new()
        };
        for bytes in vehicle.step(now, &up) {
            decoder.push(&bytes);
        }
        while let Some(frame) = decoder.next_frame(now) {
            heard.extend(frame.message());
        }
    }
    heard
}

/// No command is met with silence; its number stands in the answer, known or not. A message asked
/// for comes after the answer.
#[test]
fn every_command_is_answered() {
    let long = |command, param1| COMMAND_LONG_DATA {
        command,
        param1,
        target_system: 6,
        ..COMMAND_LONG_DATA::default()
    };
    let accepted = MavResult::MAV_RESULT_ACCEPTED;
    for (command, param1, result) in [
        (MavCmd::MAV_CMD_NAV_RETURN_TO_LAUNCH, 0.0, accepted),
        (MavCmd::MAV_CMD_NAV_LOITER_UNLIM, 0.0, accepted),
        (
            MavCmd::MAV_CMD_NAV_TAKEOFF,
            0.0,
            MavResult::MAV_RESULT_UNSUPPORTED,
        ),
        (MavCmd::MAV_CMD_REQUEST_MESSAGE, 148.0, accepted),
        (
            MavCmd::MAV_CMD_REQUEST_MESSAGE,
            9999.0,
            MavResult::MAV_RESULT_FAILED,
        ),
    ] {
        let heard = answers(&mut vehicle(), &long(command, param1));
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
        &long(MavCmd::MAV_CMD_NAV_TAKEOFF, 0.0),
        None,
        SimTime::ZERO,
    );
    // The same command with a number that no dialect has, 40404.
    let number = 10 + 28;
    frame[number..number + 2].copy_from_slice(&40_404_u16.to_le_bytes());
    let end = frame.len() - 2;
    let sum = mavlink::calculate_crc(&frame[1..end], 152);
    frame[end..].copy_from_slice(&sum.to_le_bytes());
    let said = vehicle().step(SimTime::ZERO, &[frame]);
    let answer: &[u8] = said
        .iter()
        .find(|f| f[7] == 77)
        .map_or(&[], |f| &f[10..10 + usize::from(f[1])]);
    // 40404 and UNSUPPORTED (3).
    assert_eq!(answer, [0xd4, 0x9d, 3]);
}

/// Nobody waits in vain for a mission: none is there, none is taken.
#[test]
fn asked_for_missions_it_says_that_there_are_none() {
    let (target_system, target_component) = (6, 1);
    let list = MISSION_REQUEST_LIST_DATA {
        target_system,
        target_component,
    };
    let heard = answers(&mut vehicle(), &list);
    assert!(
        heard
            .iter()
            .any(|m| matches!(m, MavMessage::MISSION_COUNT(c)
        if c.count == 0 && (c.target_system, c.target_component) == (255, 190)))
    );
    let upload = MISSION_COUNT_DATA {
        count: 3,
        target_system,
        target_component,
    };
    let heard = answers(&mut vehicle(), &upload);
    let refused = MavMissionResult::MAV_MISSION_UNSUPPORTED;
    assert!(
        heard
            .iter()
            .any(|m| matches!(m, MavMessage::MISSION_ACK(a) if a.mavtype == refused))
    );
}
