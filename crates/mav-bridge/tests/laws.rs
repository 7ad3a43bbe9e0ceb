//! Laws that hold for any bytes on the link and any order of events.

use mav_bridge::arduplane::{AUTO, FBWA, GUIDED, LOITER, MANUAL, RTL, TAKEOFF};
use mav_bridge::dialect::{
    ATTITUDE_DATA, GLOBAL_POSITION_INT_DATA, HEARTBEAT_DATA, MavAutopilot, MavModeFlag, MavResult,
    MavSeverity, MavState, MavType, NAMED_VALUE_FLOAT_DATA, POSITION_TARGET_GLOBAL_INT_DATA,
    STATUSTEXT_DATA, VFR_HUD_DATA,
};
use mav_bridge::wire::{CommandAck, FrameDecoder, FrameEncoder};
use mav_bridge::{AttitudeTarget, Bridge, BridgeConfig, BridgeOutput};
use proptest::prelude::*;
use protocol::SimTime;
use protocol::control_level::{ControlEvent, Danger};
use protocol::message::{ControlLevel, PathKind, Setpoint};

fn s(seconds: f64) -> SimTime {
    SimTime::from_s(seconds)
}

/// `count` different frames of telemetry.
fn telemetry(count: usize) -> Vec<Vec<u8>> {
    let mut encoder = FrameEncoder::new(1, 1);
    (0..count)
        .map(|k| match k % 3 {
            0 => encoder.encode(
                &GLOBAL_POSITION_INT_DATA {
                    time_boot_ms: k as u32,
                    lat: 434_000_000 + k as i32,
                    // Start bytes inside a payload.
                    lon: i32::from_le_bytes([0xFD, 0xFD, 0x09, 0xF0]),
                    ..GLOBAL_POSITION_INT_DATA::default()
                },
                None,
                s(0.0),
            ),
            1 => encoder.encode(
                &ATTITUDE_DATA {
                    roll: k as f32,
                    ..ATTITUDE_DATA::default()
                },
                None,
                s(0.0),
            ),
            _ => encoder.encode(
                &NAMED_VALUE_FLOAT_DATA {
                    value: 449.0,
                    name: "CO2".into(),
                    ..NAMED_VALUE_FLOAT_DATA::default()
                },
                None,
                s(0.0),
            ),
        })
        .collect()
}

/// All frames that a decoder finds in pieces of a stream, and after the stream has gone silent.
fn decode<'a>(pieces: impl Iterator<Item = &'a [u8]>) -> Vec<Vec<u8>> {
    let mut decoder = FrameDecoder::new();
    let mut found = Vec::new();
    for piece in pieces {
        decoder.push(piece);
        found.extend(std::iter::from_fn(|| decoder.next_frame(s(0.0))));
    }
    for later in 1..300 {
        found.extend(std::iter::from_fn(|| {
            decoder.next_frame(s(f64::from(later)))
        }));
    }
    found.into_iter().map(|f| f.into_bytes()).collect()
}

/// Whether all of `wanted` are in `found`, in order.
fn contains_in_order(found: &[Vec<u8>], wanted: &[Vec<u8>]) -> bool {
    let mut rest = found.iter();
    wanted.iter().all(|w| rest.any(|f| f == w))
}

/// Garbage rich in start bytes.
fn garbage() -> impl Strategy<Value = Vec<u8>> {
    let byte = prop_oneof![any::<u8>(), Just(0xFD), Just(0), Just(0xFE)];
    prop::collection::vec(byte, 0..60)
}

proptest! {
    #[test]
    fn no_frame_is_lost_among_garbage(
        gaps in prop::collection::vec(garbage(), 12),
        piece in 1usize..400,
    ) {
        let frames = telemetry(12);
        let stream: Vec<u8> = gaps
            .iter()
            .zip(&frames)
            .flat_map(|(gap, frame)| gap.iter().chain(frame).copied())
            .collect();
        let found = decode(stream.chunks(piece));
        prop_assert!(contains_in_order(&found, &frames));
    }

    #[test]
    fn a_flipped_bit_costs_one_frame(hit in 0usize..12, bit in 0usize..8 * 21, piece in 1usize..400) {
        let mut frames = telemetry(12);
        let spoilt = frames[hit].clone();
        let at = (bit / 8) % spoilt.len();
        frames[hit][at] ^= 1 << (bit % 8);
        let stream = frames.concat();
        let found = decode(stream.chunks(piece));
        frames.remove(hit);
        prop_assert_eq!(found, frames);
    }

    #[test]
    fn a_truncated_frame_costs_itself_only(hit in 0usize..12, keep in 0usize..21, piece in 1usize..400) {
        let mut frames = telemetry(12);
        let keep = keep % frames[hit].len();
        frames[hit].truncate(keep);
        let stream = frames.concat();
        frames.remove(hit);
        prop_assert_eq!(decode(stream.chunks(piece)), frames);
    }

    #[test]
    fn any_bytes_do_no_harm(pieces in prop::collection::vec(garbage(), 1..20)) {
        let mut bridge = Bridge::new(BridgeConfig::default()).unwrap();
        let mut out = BridgeOutput::default();
        for (k, piece) in pieces.iter().enumerate() {
            bridge.receive(piece, s(k as f64 * 0.1), &mut out);
            bridge.tick(s(k as f64 * 0.1), &mut out);
        }
        let statistics = bridge.statistics();
        prop_assert!(statistics.skipped_bytes <= statistics.bytes);
        prop_assert!(out.state.is_none() && out.readings.is_empty());
    }

    #[test]
    fn any_numbers_make_a_sound_state_or_none(
        lat in any::<i32>(), lon in any::<i32>(), alt in any::<i32>(),
        floats in prop::array::uniform4(any::<u32>().prop_map(f32::from_bits)),
    ) {
        let mut encoder = FrameEncoder::new(1, 1);
        let mut bridge = Bridge::new(BridgeConfig::default()).unwrap();
        let mut out = BridgeOutput::default();
        let [roll, yaw, airspeed, value] = floats;
        let frames = [
            heartbeat(&mut encoder, GUIDED, MavState::MAV_STATE_ACTIVE, true),
            encoder.encode(&ATTITUDE_DATA { roll, yaw, ..ATTITUDE_DATA::default() }, None, s(0.0)),
            encoder.encode(&VFR_HUD_DATA { airspeed, ..VFR_HUD_DATA::default() }, None, s(0.0)),
            encoder.encode(
                &GLOBAL_POSITION_INT_DATA { lat, lon, alt, ..GLOBAL_POSITION_INT_DATA::default() },
                None,
                s(0.0),
            ),
            encoder.encode(
                &NAMED_VALUE_FLOAT_DATA { value, name: "CO2".into(), ..NAMED_VALUE_FLOAT_DATA::default() },
                None,
                s(0.0),
            ),
        ];
        bridge.receive(&frames.concat(), s(0.0), &mut out);
        if let Some(state) = out.state {
            let numbers = [
                state.lat_deg, state.lon_deg, state.alt_amsl_m, state.roll_deg,
                state.heading_deg, state.airspeed_m_s,
            ];
            prop_assert!(numbers.iter().all(|n| n.is_finite()), "{state:?}");
            prop_assert!(state.lat_deg.abs() <= 90.0 && state.lon_deg.abs() <= 180.0);
        }
        for reading in out.readings {
            prop_assert!((0.0..=1e6).contains(&reading.co2_ppm));
        }
    }

}

proptest! {
    #[test]
    fn nothing_overrides_the_pilot(
        attitude_targets in any::<bool>(),
        events in prop::collection::vec(happening(), 1..60),
    ) {
        let mut world = World::new(attitude_targets);
        for happening in events {
            world.happen(happening)?;
        }
    }
}

/// A bridge, the vehicle's side of its link, and who has taken over since the last hand-back.
struct World {
    bridge: Bridge,
    encoder: FrameEncoder,
    time_s: f64,
    /// Start of the vehicle's clock, s.
    boot_s: f64,
    last: (u32, MavState, bool),
    pilot: bool,
    /// A pilot's mode was shown in the air since the last hand-back, whatever the bridge makes of it.
    taken: bool,
    /// The mode shown last.
    beaten: Option<u32>,
    failsafe: bool,
    /// When the vehicle has last told of a failsafe.
    told_at_s: f64,
}

impl World {
    fn new(attitude_targets: bool) -> Self {
        let config = BridgeConfig {
            attitude_targets,
            may_arm: true,
            vehicle_system_id: Some(1),
            ..BridgeConfig::default()
        };
        Self {
            bridge: Bridge::new(config).unwrap(),
            encoder: FrameEncoder::new(1, 1),
            time_s: 0.0,
            boot_s: -100.0,
            last: (MANUAL, MavState::MAV_STATE_STANDBY, false),
            pilot: false,
            taken: false,
            beaten: None,
            failsafe: false,
            told_at_s: f64::NEG_INFINITY,
        }
    }

    fn happen(&mut self, happening: Happening) -> Result<(), TestCaseError> {
        let mut out = BridgeOutput::default();
        let now = s(self.time_s);
        match happening {
            Happening::Heartbeat(mode, status, armed) => {
                self.last = (mode, status, armed);
                self.beat(&mut out);
            }
            Happening::Setpoint(path, north) => {
                self.bridge.setpoint(&setpoint(path, north), now, &mut out);
            }
            Happening::Danger(event) => self.bridge.handle(event, &mut out),
            Happening::HandBack => {
                self.bridge.hand_back(&mut out);
                (self.pilot, self.taken) = (false, false);
            }
            // Time that the vehicle is heard in, or is not.
            Happening::Wait(seconds, heard) => {
                for k in 0..(seconds * 5.0) as u32 {
                    self.time_s += 0.2;
                    if heard && k % 5 == 0 {
                        self.beat(&mut out);
                    }
                    self.check(&mut out)?;
                }
            }
            // The bridge's host stalls.
            Happening::Stall(seconds) => self.time_s += seconds,
            Happening::Restart => {
                self.boot_s = self.time_s;
                self.last = (MANUAL, MavState::MAV_STATE_STANDBY, false);
                self.position(43.44, &mut out);
                self.beat(&mut out);
            }
            Happening::Position(lat_deg) => self.position(lat_deg, &mut out),
            Happening::Target(lat_deg) => {
                let target = POSITION_TARGET_GLOBAL_INT_DATA {
                    lat_int: (lat_deg * 1e7) as i32,
                    lon_int: -78_600_000,
                    ..POSITION_TARGET_GLOBAL_INT_DATA::default()
                };
                let frame = self.encoder.encode(&target, None, now);
                self.bridge.receive(&frame, now, &mut out);
            }
            Happening::Says(said) => {
                if said.contains("On") || said.contains("breached") {
                    self.told_at_s = self.time_s;
                }
                let text = STATUSTEXT_DATA {
                    severity: MavSeverity::MAV_SEVERITY_WARNING,
                    text: said.into(),
                    ..STATUSTEXT_DATA::default()
                };
                let frame = self.encoder.encode(&text, None, now);
                self.bridge.receive(&frame, now, &mut out);
            }
            Happening::Answer(command, result) => {
                let ack = CommandAck { command, result };
                let frame = self.encoder.encode(&ack, None, now);
                self.bridge.receive(&frame, now, &mut out);
            }
        }
        self.time_s += 0.02;
        self.check(&mut out)
    }

    fn beat(&mut self, out: &mut BridgeOutput) {
        let (mode, status, armed) = self.last;
        // The bridge asks for none of these: in the air somebody else has chosen it.
        let others = matches!(mode, MANUAL | FBWA | LOITER) && status == MavState::MAV_STATE_ACTIVE;
        self.taken |= others && self.beaten.is_some_and(|before| before != mode);
        self.beaten = Some(mode);
        self.failsafe = status == MavState::MAV_STATE_CRITICAL && matches!(mode, AUTO | RTL);
        let frame = heartbeat(&mut self.encoder, mode, status, armed);
        self.bridge.receive(&frame, s(self.time_s), out);
    }

    fn position(&mut self, lat_deg: f64, out: &mut BridgeOutput) {
        let position = GLOBAL_POSITION_INT_DATA {
            time_boot_ms: ((self.time_s - self.boot_s) * 1e3) as u32,
            lat: (lat_deg * 1e7) as i32,
            lon: -78_600_000,
            alt: 700_000,
            relative_alt: 360_000,
            ..GLOBAL_POSITION_INT_DATA::default()
        };
        let frame = self.encoder.encode(&position, None, s(self.time_s));
        self.bridge.receive(&frame, s(self.time_s), out);
    }

    fn check(&mut self, out: &mut BridgeOutput) -> Result<(), TestCaseError> {
        // An outer loop that never rests: the bridge alone says when it counts.
        let attitude = AttitudeTarget {
            roll_rad: 0.3,
            pitch_rad: 0.05,
            yaw_rad: 1.0,
            throttle: 0.5,
        };
        let now = s(self.time_s);
        self.bridge.attitude(&attitude, now, out);
        self.bridge.tick(now, out);
        self.bridge.attitude(&attitude, now, out);
        if self.pilot {
            // Only the vehicle's own failsafe takes it from a pilot whose remote is silent.
            let told = self.time_s - self.told_at_s < 5.0;
            let own = self.failsafe || (told && matches!(self.last.0, AUTO | RTL));
            let lost = own && self.bridge.level() == ControlLevel::Guardian;
            prop_assert!(
                lost || self.bridge.level() == ControlLevel::Pilot,
                "taken from the pilot"
            );
            for frame in &out.frames_to_vehicle {
                prop_assert!(!steers(frame), "sent to a pilot's aircraft: {:02x?}", frame);
            }
        }
        for frame in &out.frames_to_vehicle {
            prop_assert!(!changes_mode_by_reposition(frame));
            prop_assert!(
                !self.taken || !steers(frame),
                "sent after a takeover: {:02x?}",
                frame
            );
        }
        out.clear();
        self.pilot = self.bridge.level() == ControlLevel::Pilot && !self.bridge.hand_back_pending();
        Ok(())
    }
}

#[derive(Debug, Clone, Copy)]
enum Happening {
    Heartbeat(u32, MavState, bool),
    Setpoint(PathKind, f64),
    Danger(ControlEvent),
    HandBack,
    Wait(f64, bool),
    Stall(f64),
    Restart,
    Position(f64),
    Target(f64),
    Says(&'static str),
    Answer(u16, MavResult),
}

fn happening() -> impl Strategy<Value = Happening> {
    let mode = prop::sample::select(vec![
        MANUAL, FBWA, AUTO, RTL, LOITER, TAKEOFF, GUIDED, TAKEOFF, GUIDED,
    ]);
    let status = prop::sample::select(vec![
        MavState::MAV_STATE_STANDBY,
        MavState::MAV_STATE_ACTIVE,
        MavState::MAV_STATE_ACTIVE,
        MavState::MAV_STATE_CRITICAL,
    ]);
    let path = prop::sample::select(vec![
        PathKind::GoTo,
        PathKind::Orbit,
        PathKind::TakeOff,
        PathKind::Land,
    ]);
    let says = prop::sample::select(vec![
        "Polygon fence breached",
        "Fence breach cleared",
        "RC Long Failsafe On: switched to RTL",
        "GCS Failsafe On: switched to RTL",
        "GCS Failsafe cleared",
        "Throttle armed",
    ]);
    let result = prop::sample::select(vec![
        MavResult::MAV_RESULT_ACCEPTED,
        MavResult::MAV_RESULT_ACCEPTED,
        MavResult::MAV_RESULT_FAILED,
    ]);
    let command = prop::sample::select(vec![176u16, 178, 189, 192, 400]);
    let danger = (0..Danger::ALL.len(), any::<bool>()).prop_map(|(k, begins)| {
        let danger = Danger::ALL[k];
        Happening::Danger(if begins {
            ControlEvent::Begins(danger)
        } else {
            ControlEvent::Ends(danger)
        })
    });
    prop_oneof![
        8 => (mode, status, any::<bool>()).prop_map(|(m, st, a)| Happening::Heartbeat(m, st, a)),
        6 => (path, 0.0..1000.0).prop_map(|(p, n)| Happening::Setpoint(p, n)),
        2 => Just(Happening::HandBack),
        2 => danger,
        3 => (0.1..8.0, any::<bool>()).prop_map(|(s, heard)| Happening::Wait(s, heard)),
        1 => (2.0..20.0).prop_map(Happening::Stall),
        1 => Just(Happening::Restart),
        1 => (43.43..43.47).prop_map(Happening::Position),
        2 => (43.43..43.47).prop_map(Happening::Target),
        1 => says.prop_map(Happening::Says),
        4 => (command, result).prop_map(|(c, r)| Happening::Answer(c, r)),
    ]
}

fn heartbeat(encoder: &mut FrameEncoder, mode: u32, status: MavState, armed: bool) -> Vec<u8> {
    let mut base_mode = MavModeFlag::MAV_MODE_FLAG_CUSTOM_MODE_ENABLED;
    if armed {
        base_mode |= MavModeFlag::MAV_MODE_FLAG_SAFETY_ARMED;
    }
    let heartbeat = HEARTBEAT_DATA {
        custom_mode: mode,
        mavtype: MavType::MAV_TYPE_FIXED_WING,
        autopilot: MavAutopilot::MAV_AUTOPILOT_ARDUPILOTMEGA,
        base_mode,
        system_status: status,
        mavlink_version: 3,
    };
    encoder.encode(&heartbeat, None, s(0.0))
}

/// A bridge to system 1 and to no other.
fn asked_for_1() -> Bridge {
    let vehicle_system_id = Some(1);
    Bridge::new(BridgeConfig {
        vehicle_system_id,
        ..BridgeConfig::default()
    })
    .unwrap()
}

fn setpoint(path: PathKind, north_m: f64) -> Setpoint {
    Setpoint {
        path,
        lat_deg: 43.44 + north_m / 111_000.0,
        lon_deg: -7.86,
        alt_amsl_m: 700.0,
        airspeed_m_s: 18.0,
        orbit_radius_m: 100.0,
    }
}

/// Message id and command of a COMMAND_INT or COMMAND_LONG.
fn command(frame: &[u8]) -> Option<u16> {
    let id = u32::from_le_bytes([frame[7], frame[8], frame[9], 0]);
    matches!(id, 75 | 76).then(|| u16::from_le_bytes([frame[38], frame[39]]))
}

fn steers(frame: &[u8]) -> bool {
    let attitude = [frame[7], frame[8], frame[9]] == [82, 0, 0];
    attitude || matches!(command(frame), Some(176 | 178 | 189 | 192 | 400))
}

fn changes_mode_by_reposition(frame: &[u8]) -> bool {
    command(frame) == Some(192) && frame[14..18] != [0; 4]
}

#[test]
fn px4_is_told_apart_and_never_commanded() {
    let mut encoder = FrameEncoder::new(1, 1);
    let mut bridge = Bridge::new(BridgeConfig::default()).unwrap();
    let mut out = BridgeOutput::default();
    let px4 = HEARTBEAT_DATA {
        custom_mode: 15,
        mavtype: MavType::MAV_TYPE_FIXED_WING,
        autopilot: MavAutopilot::MAV_AUTOPILOT_PX4,
        system_status: MavState::MAV_STATE_ACTIVE,
        mavlink_version: 3,
        ..HEARTBEAT_DATA::default()
    };
    bridge.receive(&encoder.encode(&px4, None, s(0.0)), s(0.0), &mut out);
    let event = out.events.iter().find(|e| e.code == "other-autopilot");
    assert!(event.unwrap().text.contains("autopilot = \"px4\""));
    bridge.setpoint(&setpoint(PathKind::GoTo, 0.0), s(0.1), &mut out);
    bridge.hand_back(&mut out);
    bridge.tick(s(0.2), &mut out);
    assert!(!out.frames_to_vehicle.iter().any(|f| steers(f)));
    assert!(out.events.iter().any(|e| e.code == "setpoint-ignored"));
}

/// A checksum ends with a byte that only who knows the message knows: with zero in its place, some
/// noise in 65,536 seems to be a frame of a message that there is not.
#[test]
fn a_message_unknown_to_the_dialect_swallows_no_frame() {
    let frames = telemetry(3);
    let inner = frames.concat();
    let mut seeming = vec![0xFD, inner.len() as u8, 0, 0, 0, 1, 1, 0x92, 0xFD, 0xFD];
    seeming.extend(&inner);
    let checksum = mavlink::calculate_crc(&seeming[1..], 0);
    seeming.extend(checksum.to_le_bytes());
    assert_eq!(decode(std::iter::once(&seeming[..])), frames);
}

#[test]
fn noise_without_frames_is_told() {
    let mut bridge = Bridge::new(BridgeConfig::default()).unwrap();
    let mut out = BridgeOutput::default();
    bridge.receive(&[0x55; 3000], s(0.0), &mut out);
    bridge.tick(s(0.0), &mut out);
    bridge.tick(s(1.0), &mut out);
    let told = out
        .events
        .iter()
        .filter(|e| e.code == "no-mavlink2")
        .count();
    assert_eq!(told, 1);
}

#[test]
fn a_setpoint_without_numbers_is_refused() {
    let mut encoder = FrameEncoder::new(1, 1);
    let mut bridge = asked_for_1();
    let mut out = BridgeOutput::default();
    let frame = heartbeat(&mut encoder, GUIDED, MavState::MAV_STATE_ACTIVE, true);
    bridge.receive(&frame, s(0.0), &mut out);
    let mut bad = setpoint(PathKind::GoTo, 0.0);
    bad.alt_amsl_m = f64::NAN;
    bridge.setpoint(&bad, s(0.0), &mut out);
    bridge.tick(s(0.0), &mut out);
    assert!(out.events.iter().any(|e| e.code == "bad-setpoint"));
    assert!(!out.frames_to_vehicle.iter().any(|f| steers(f)));
}

#[test]
fn an_unanswered_command_is_repeated_and_given_up() {
    let mut encoder = FrameEncoder::new(1, 1);
    let mut bridge = asked_for_1();
    let mut out = BridgeOutput::default();
    let mut reposition = 0;
    for tick in 0..500 {
        let now = SimTime::of_tick(tick, 20_000_000);
        if tick % 50 == 0 {
            let frame = heartbeat(&mut encoder, GUIDED, MavState::MAV_STATE_ACTIVE, true);
            bridge.receive(&frame, now, &mut out);
        }
        bridge.setpoint(&setpoint(PathKind::GoTo, 0.0), now, &mut out);
        out.frames_to_vehicle.clear();
        bridge.tick(now, &mut out);
        reposition += out
            .frames_to_vehicle
            .iter()
            .filter(|f| command(f) == Some(192))
            .count();
    }
    // Five times at 1 s each; then a pause of 5 s.
    assert_eq!(reposition, 5);
    let failed = out
        .events
        .iter()
        .filter(|e| e.code == "setpoint-failed")
        .count();
    assert_eq!(failed, 1);
}

#[test]
fn the_gas_that_counts_is_read_in_both_units_and_no_other() {
    let mut encoder = FrameEncoder::new(1, 1);
    let config = BridgeConfig {
        gas: plume::Gas::Ch4,
        ..BridgeConfig::default()
    };
    let mut bridge = Bridge::new(config).unwrap();
    let position = GLOBAL_POSITION_INT_DATA {
        lat: 434_400_000,
        lon: -78_600_000,
        alt: 500_000,
        ..GLOBAL_POSITION_INT_DATA::default()
    };
    let frames = [
        heartbeat(&mut encoder, GUIDED, MavState::MAV_STATE_ACTIVE, true),
        encoder.encode(&position, None, s(0.0)),
    ];
    bridge.receive(&frames.concat(), s(0.0), &mut BridgeOutput::default());
    let mut read = |name: &str, value: f32| {
        let named = NAMED_VALUE_FLOAT_DATA {
            value,
            name: name.into(),
            ..NAMED_VALUE_FLOAT_DATA::default()
        };
        let mut out = BridgeOutput::default();
        bridge.receive(&encoder.encode(&named, None, s(0.0)), s(0.0), &mut out);
        out.readings.first().map(|r| r.co2_ppm)
    };
    assert_eq!(read("CH4", 2.0), Some(2.0));
    assert_eq!(read("CH4_PPB", 1950.0), Some(1.95));
    assert_eq!(
        (read("CO2", 420.0), read("CH4_PPT", 1.0), read("H4", 1.0)),
        (None, None, None)
    );
    // Noise about nothing goes below zero; a code for none does not count.
    assert_eq!((read("CH4", -0.5), read("CH4", -999.0)), (Some(-0.5), None));
}

#[test]
fn nonsense_in_the_configuration_is_refused() {
    for config in [
        BridgeConfig {
            telemetry_hz: f64::NAN,
            ..BridgeConfig::default()
        },
        BridgeConfig {
            link_timeout_s: 0.0,
            ..BridgeConfig::default()
        },
        BridgeConfig {
            attempts: 0,
            ..BridgeConfig::default()
        },
    ] {
        let error = Bridge::new(config).unwrap_err().to_string();
        assert!(error.contains("expected"), "{error}");
    }
}
