//! What goes wrong between a bridge and real vehicles, and what the bridge makes of it.

use crate::frames::messages;
use mav_bridge::arduplane::{AUTO, FBWA, GUIDED, MANUAL, RTL, TAKEOFF};
use mav_bridge::dialect::{
    ATTITUDE_DATA, BATTERY_STATUS_DATA, FENCE_STATUS_DATA, GLOBAL_POSITION_INT_DATA,
    HEARTBEAT_DATA, MavAutopilot, MavBatteryFunction, MavMessage, MavModeFlag, MavResult,
    MavSeverity, MavState, MavSysStatusSensor, MavType, NAMED_VALUE_FLOAT_DATA, PARAM_VALUE_DATA,
    POSITION_TARGET_GLOBAL_INT_DATA, STATUSTEXT_DATA, SYS_STATUS_DATA, VFR_HUD_DATA,
};
use mav_bridge::signing::{Signing, SigningConfig};
use mav_bridge::wire::{CommandAck, FrameDecoder, FrameEncoder, MessageData, RawFrame};
use mav_bridge::{Bridge, BridgeConfig, BridgeOutput, GasClock, GasInput};
use protocol::SimTime;
use protocol::control_level::Danger;
use protocol::message::{ControlLevel, PathKind, Reading, Setpoint};

const REPOSITION: u16 = 192;
const SET_MODE: u16 = 176;
const CHANGE_SPEED: u16 = 178;
const ARM: u16 = 400;

/// A bridge and whatever is on its link.
struct Bench {
    bridge: Bridge,
    time_s: f64,
    out: BridgeOutput,
}

impl Bench {
    fn new(config: BridgeConfig) -> Self {
        Self {
            bridge: Bridge::new(config).unwrap(),
            time_s: 0.0,
            out: BridgeOutput::default(),
        }
    }

    /// One that knows its vehicle, system 1.
    fn of_1() -> Self {
        Self::new(BridgeConfig {
            vehicle_system_id: Some(1),
            may_arm: true,
            ..BridgeConfig::default()
        })
    }

    fn now(&self) -> SimTime {
        SimTime::from_s(self.time_s)
    }

    /// The bridge hears `message` of `from`.
    fn hear<D: MessageData>(&mut self, from: &mut FrameEncoder, message: &D) {
        let frame = from.encode(message, None, self.now());
        let now = self.now();
        self.bridge.receive(&frame, now, &mut self.out);
    }

    /// Time passes in ticks; every second `each` happens.
    fn run(&mut self, seconds: f64, mut each: impl FnMut(&mut Self)) {
        let ticks = (seconds * 10.0).round() as u32;
        for k in 0..ticks {
            if k % 10 == 0 {
                each(self);
            }
            self.time_s += 0.1;
            let now = self.now();
            self.bridge.tick(now, &mut self.out);
        }
    }

    fn setpoint(&mut self, setpoint: &Setpoint) {
        let now = self.now();
        self.bridge.setpoint(setpoint, now, &mut self.out);
    }

    fn said(&self, code: &str) -> Vec<&str> {
        let events = self.out.events.iter();
        events
            .filter(|e| e.code == code)
            .map(|e| e.text.as_str())
            .collect()
    }

    /// Commands sent: target system and number.
    fn commands(&self) -> Vec<(u8, u16)> {
        let mut decoder = FrameDecoder::new();
        for frame in &self.out.frames_to_vehicle {
            decoder.push(frame);
        }
        let frames = std::iter::from_fn(|| decoder.next_frame(SimTime::ZERO));
        let numbers: Vec<_> = frames
            .filter_map(|f: RawFrame| f.command_number())
            .collect();
        numbers.into_iter().filter(|(_, n)| *n != 511).collect()
    }

    /// In GUIDED at 650 m, having taken a setpoint.
    fn in_guided(from: &mut FrameEncoder) -> Self {
        let mut bench = Self::of_1();
        bench.run(2.0, |b| flying(b, from, GUIDED, MavState::MAV_STATE_ACTIVE));
        bench.setpoint(&go_to(0.0));
        bench.run(1.0, |b| flying(b, from, GUIDED, MavState::MAV_STATE_ACTIVE));
        assert_eq!(bench.bridge.level(), ControlLevel::Automatic);
        answer(&mut bench, from, REPOSITION);
        bench
    }
}

fn answer(bench: &mut Bench, from: &mut FrameEncoder, command: u16) {
    let result = MavResult::MAV_RESULT_ACCEPTED;
    bench.hear(from, &CommandAck { command, result });
}

fn heartbeat(mode: u32, status: MavState) -> HEARTBEAT_DATA {
    let armed = status != MavState::MAV_STATE_STANDBY;
    let mut base_mode = MavModeFlag::MAV_MODE_FLAG_CUSTOM_MODE_ENABLED;
    base_mode.set(MavModeFlag::MAV_MODE_FLAG_SAFETY_ARMED, armed);
    HEARTBEAT_DATA {
        custom_mode: mode,
        mavtype: MavType::MAV_TYPE_FIXED_WING,
        autopilot: MavAutopilot::MAV_AUTOPILOT_ARDUPILOTMEGA,
        base_mode,
        system_status: status,
        mavlink_version: 3,
    }
}

/// What a vehicle at 43.44 N, 7.86 W says every second.
fn flying(bench: &mut Bench, from: &mut FrameEncoder, mode: u32, status: MavState) {
    let boot_ms = (bench.time_s * 1e3) as u32 + 60_000;
    bench.hear(from, &position(boot_ms, 43.44));
    let hud = VFR_HUD_DATA {
        airspeed: 18.0,
        groundspeed: 18.0,
        ..VFR_HUD_DATA::default()
    };
    bench.hear(from, &hud);
    bench.hear(from, &ATTITUDE_DATA::default());
    bench.hear(from, &heartbeat(mode, status));
}

fn position(time_boot_ms: u32, lat_deg: f64) -> GLOBAL_POSITION_INT_DATA {
    GLOBAL_POSITION_INT_DATA {
        time_boot_ms,
        lat: (lat_deg * 1e7) as i32,
        lon: -78_600_000,
        alt: 650_000,
        relative_alt: 310_000,
        vx: 2000, // 20 m/s north
        ..GLOBAL_POSITION_INT_DATA::default()
    }
}

fn go_to(north_m: f64) -> Setpoint {
    Setpoint {
        path: PathKind::GoTo,
        lat_deg: 43.45 + north_m / 111_195.0,
        lon_deg: -7.86,
        alt_amsl_m: 700.0,
        airspeed_m_s: 18.0,
        orbit_radius_m: 80.0,
    }
}

fn gas(name: &str, time_boot_ms: u32, value: f32) -> NAMED_VALUE_FLOAT_DATA {
    NAMED_VALUE_FLOAT_DATA {
        time_boot_ms,
        value,
        name: name.into(),
    }
}

fn says(text: &str) -> STATUSTEXT_DATA {
    STATUSTEXT_DATA {
        severity: MavSeverity::MAV_SEVERITY_WARNING,
        text: text.into(),
        ..STATUSTEXT_DATA::default()
    }
}

#[test]
fn of_two_vehicles_neither_is_commanded_until_one_is_asked_for() {
    for order in [[1u8, 2], [2, 1]] {
        let mut bench = Bench::new(BridgeConfig::default());
        let mut vehicles = order.map(|id| FrameEncoder::new(id, 1));
        for second in 0..20 {
            bench.setpoint(&go_to(f64::from(second)));
            bench.run(1.0, |b| {
                for vehicle in &mut vehicles {
                    flying(b, vehicle, GUIDED, MavState::MAV_STATE_ACTIVE);
                }
            });
        }
        assert_eq!(bench.commands(), []);
        let told = bench.said("two-vehicles");
        assert_eq!(told.len(), 1);
        assert!(told[0].contains(&format!("systems {} and {}", order[0], order[1])));
        assert!(told[0].contains("expected system_id"));
        assert!(bench.said("link-lost").is_empty());
    }
}

#[test]
fn one_of_two_is_told_apart_and_the_other_is_never_commanded() {
    for asked in [1u8, 2] {
        let config = BridgeConfig {
            vehicle_system_id: Some(asked),
            ..BridgeConfig::default()
        };
        let mut bench = Bench::new(config);
        let mut vehicles = [1u8, 2].map(|id| FrameEncoder::new(id, 1));
        bench.run(5.0, |b| {
            for (k, vehicle) in vehicles.iter_mut().enumerate() {
                flying(b, vehicle, GUIDED, MavState::MAV_STATE_ACTIVE);
                let boot_ms = (b.time_s * 1e3) as u32 + 60_001;
                b.hear(vehicle, &position(boot_ms, 43.0 + k as f64));
                b.hear(vehicle, &gas("CO2", boot_ms, 400.0 + k as f32));
            }
            b.setpoint(&go_to(b.time_s));
        });
        let to: Vec<u8> = bench.commands().iter().map(|c| c.0).collect();
        assert!(!to.is_empty() && to.iter().all(|&to| to == asked), "{to:?}");
        let own = f64::from(asked - 1);
        assert_eq!(bench.out.state.as_ref().unwrap().lat_deg, 43.0 + own);
        let read = |r: &Reading| r.co2_ppm == 400.0 + own;
        assert!(bench.out.readings.len() == 5 && bench.out.readings.iter().all(read));
        // Once its heartbeat has told that the other is a vehicle, the record has its own frames alone.
        assert!(
            bench.out.frames_from_vehicle[12..]
                .iter()
                .all(|f| f[5] == asked)
        );
    }
}

#[test]
fn a_vehicle_alone_is_commanded_when_it_was_listened_for_another() {
    let mut bench = Bench::new(BridgeConfig::default());
    let mut vehicle = FrameEncoder::new(7, 1);
    bench.run(2.0, |b| {
        flying(b, &mut vehicle, GUIDED, MavState::MAV_STATE_ACTIVE);
        b.setpoint(&go_to(0.0));
    });
    assert_eq!(bench.commands(), []);
    bench.run(3.0, |b| {
        flying(b, &mut vehicle, GUIDED, MavState::MAV_STATE_ACTIVE);
        b.setpoint(&go_to(0.0));
    });
    assert!(bench.commands().contains(&(7, REPOSITION)));
    // One that comes later, in flight, changes nothing.
    let mut other = FrameEncoder::new(8, 1);
    bench.hear(&mut other, &heartbeat(GUIDED, MavState::MAV_STATE_ACTIVE));
    assert_eq!(bench.bridge.level(), ControlLevel::Automatic);
    assert!(bench.said("another-vehicle")[0].contains("system 8"));
}

#[test]
fn a_gas_sensor_of_its_own_with_its_own_names() {
    let config = BridgeConfig {
        vehicle_system_id: Some(1),
        gas_inputs: vec![GasInput {
            name: "GASRAW".to_owned(),
            component_id: Some(25),
            scale: 0.1,
            offset_ppm: -2.0,
            clock: GasClock::Arrival,
        }],
        ..BridgeConfig::default()
    };
    let mut bench = Bench::new(config);
    let mut autopilot = FrameEncoder::new(1, 1);
    let mut sensor = FrameEncoder::new(1, 25);
    let mut gimbal = FrameEncoder::new(1, 154);
    flying(
        &mut bench,
        &mut autopilot,
        GUIDED,
        MavState::MAV_STATE_ACTIVE,
    );
    bench.hear(&mut gimbal, &position(70_000, 10.0));
    // Its clock counts for nothing: it says the same time over and over.
    for value in [4500.0, 4600.0] {
        bench.hear(&mut sensor, &gas("GASRAW", 5, value));
    }
    bench.hear(&mut autopilot, &gas("GASRAW", 5, 1.0));
    bench.hear(&mut sensor, &gas("CO2", 5, 1.0));
    let read: Vec<f64> = bench.out.readings.iter().map(|r| r.co2_ppm).collect();
    assert_eq!(read, [448.0, 458.0]);
    assert_eq!(
        bench.out.readings[0].lat_deg, 43.44,
        "not where the gimbal says"
    );
}

#[test]
fn another_ground_station_with_the_same_id_is_told_of() {
    let mut bench = Bench::of_1();
    let station = HEARTBEAT_DATA {
        mavtype: MavType::MAV_TYPE_GCS,
        autopilot: MavAutopilot::MAV_AUTOPILOT_INVALID,
        ..heartbeat(0, MavState::MAV_STATE_ACTIVE)
    };
    let mut other = FrameEncoder::new(252, 190);
    let mut same = FrameEncoder::new(255, 190);
    bench.run(3.0, |b| b.hear(&mut other, &station));
    assert_eq!(bench.said("same-ground-station-id").len(), 0);
    bench.run(3.0, |b| b.hear(&mut same, &station));
    let told = bench.said("same-ground-station-id");
    assert!(
        told.len() == 1 && told[0].contains("gcs_system_id"),
        "{told:?}"
    );
}

fn status(unhealthy: MavSysStatusSensor) -> SYS_STATUS_DATA {
    let all = MavSysStatusSensor::MAV_SYS_STATUS_GEOFENCE
        | MavSysStatusSensor::MAV_SYS_STATUS_SENSOR_BATTERY
        | MavSysStatusSensor::MAV_SYS_STATUS_SENSOR_RC_RECEIVER;
    SYS_STATUS_DATA {
        onboard_control_sensors_enabled: all,
        onboard_control_sensors_health: all - unhealthy,
        battery_remaining: 80,
        ..SYS_STATUS_DATA::default()
    }
}

/// Texts as ArduPlane 4.8 writes them (AP_Vehicle, ArduPlane/events.cpp, AC_Fence).
#[test]
fn the_vehicles_own_failsafes_are_called_by_their_names() {
    let active = MavState::MAV_STATE_ACTIVE;
    let critical = MavState::MAV_STATE_CRITICAL;
    let cases = [
        ("Polygon fence breached", active, Danger::Fence),
        (
            "RC Long Failsafe On: switched to RTL",
            critical,
            Danger::Remote,
        ),
        (
            "Battery 1 is low 14.01V used 330 mAh",
            critical,
            Danger::Battery,
        ),
        ("GCS Failsafe On: switched to RTL", critical, Danger::Bridge),
        ("Something else", critical, Danger::Failsafe),
    ];
    for (text, state, danger) in cases {
        let mut vehicle = FrameEncoder::new(1, 1);
        let mut bench = Bench::in_guided(&mut vehicle);
        bench.hear(&mut vehicle, &says(text));
        flying(&mut bench, &mut vehicle, RTL, state);
        assert_eq!(bench.bridge.level(), ControlLevel::Guardian, "{text}");
        // One that does not tell its cause is waited for.
        bench.run(2.5, |b| flying(b, &mut vehicle, RTL, state));
        let told = bench.said("guardian");
        assert!(told[0].contains(danger.description()), "{text}: {told:?}");
        assert_eq!(bench.said("pilot-takeover").len(), 0);
    }
}

/// ArduPlane's heartbeat may show the mode before its text tells why.
#[test]
fn a_cause_that_is_told_a_moment_later_is_waited_for() {
    let critical = MavState::MAV_STATE_CRITICAL;
    let mut vehicle = FrameEncoder::new(1, 1);
    let mut bench = Bench::in_guided(&mut vehicle);
    bench.run(1.0, |b| flying(b, &mut vehicle, RTL, critical));
    assert_eq!(bench.bridge.level(), ControlLevel::Guardian);
    assert_eq!(bench.said("guardian").len(), 0);
    bench.hear(&mut vehicle, &says("Battery 1 is low 14.01V used 330 mAh"));
    bench.run(5.0, |b| flying(b, &mut vehicle, RTL, critical));
    let told = bench.said("guardian");
    assert_eq!(told.len(), 1, "{told:?}");
    assert!(told[0].contains("battery low"), "{told:?}");
    let dangers: Vec<Danger> = bench.bridge.control().dangers().collect();
    assert_eq!(dangers, [Danger::Battery]);
}

/// The bridge's process stands still for 6 s: of what the vehicle sends much is lost, its text on the failsafe too.
#[test]
fn a_way_home_after_a_silence_of_the_bridge_is_the_vehicles_failsafe() {
    let active = MavState::MAV_STATE_ACTIVE;
    for (stopped_s, then_s, level) in [
        (6.0, 0.0, ControlLevel::Guardian),
        (6.0, 2.0, ControlLevel::Guardian),
        (6.0, 10.0, ControlLevel::Pilot),
        (0.0, 0.0, ControlLevel::Pilot),
    ] {
        let mut vehicle = FrameEncoder::new(1, 1);
        let mut bench = Bench::in_guided(&mut vehicle);
        bench.time_s += stopped_s;
        bench.run(then_s, |b| flying(b, &mut vehicle, GUIDED, active));
        flying(&mut bench, &mut vehicle, AUTO, active);
        bench.run(3.0, |b| flying(b, &mut vehicle, AUTO, active));
        assert_eq!(bench.bridge.level(), level, "{stopped_s} {then_s}");
        let told = bench.said("guardian");
        if level == ControlLevel::Guardian {
            assert!(told[0].contains(Danger::Bridge.description()), "{told:?}");
            assert!(bench.said("pilot-takeover").is_empty());
        } else {
            assert!(told.is_empty(), "{told:?}");
        }
    }
}

#[test]
fn another_stations_speed_does_not_stay() {
    let mut vehicle = FrameEncoder::new(1, 1);
    let mut bench = Bench::in_guided(&mut vehicle);
    answer(&mut bench, &mut vehicle, CHANGE_SPEED);
    let mut flies = |bench: &mut Bench, airspeed: f32| {
        bench.out.clear();
        bench.run(60.0, |b| {
            let boot_ms = (b.time_s * 1e3) as u32 + 60_000;
            b.hear(&mut vehicle, &position(boot_ms, 43.44));
            let hud = VFR_HUD_DATA {
                airspeed,
                groundspeed: airspeed,
                ..VFR_HUD_DATA::default()
            };
            b.hear(&mut vehicle, &hud);
            b.hear(&mut vehicle, &heartbeat(GUIDED, MavState::MAV_STATE_ACTIVE));
            answer(b, &mut vehicle, CHANGE_SPEED);
        });
        let sent = bench.commands().contains(&(1, CHANGE_SPEED));
        (sent, bench.said("other-airspeed").len())
    };
    // Its own, 18 m/s at 700 m.
    assert_eq!(flies(&mut bench, 17.5), (false, 0));
    assert_eq!(flies(&mut bench, 24.0), (true, 1));
    assert_eq!(flies(&mut bench, 17.5), (false, 0));
}

#[test]
fn only_parameters_that_it_asked_for_are_told_when_they_change() {
    let mut vehicle = FrameEncoder::new(1, 1);
    let mut bench = Bench::in_guided(&mut vehicle);
    for value in [1.0f32, 2.0, 3.0] {
        for name in ["STAT_RUNTIME", "BARO1_GND_PRESS", "FS_LONG_ACTN"] {
            let parameter = PARAM_VALUE_DATA {
                param_id: name.into(),
                param_value: value,
                ..PARAM_VALUE_DATA::default()
            };
            bench.hear(&mut vehicle, &parameter);
        }
    }
    let told = bench.said("parameter-changed");
    assert_eq!(told.len(), 2, "{told:?}");
    assert!(told.iter().all(|text| text.contains("FS_LONG_ACTN")));
}

#[test]
fn a_landing_sequence_that_keeps_it_from_arming_is_told_with_its_cure() {
    let mut vehicle = FrameEncoder::new(1, 1);
    let mut bench = Bench::of_1();
    let ground = heartbeat(GUIDED, MavState::MAV_STATE_STANDBY);
    let ground = HEARTBEAT_DATA {
        base_mode: MavModeFlag::MAV_MODE_FLAG_CUSTOM_MODE_ENABLED,
        custom_mode: TAKEOFF,
        ..ground
    };
    bench.run(3.0, |b| b.hear(&mut vehicle, &ground));
    let up = Setpoint {
        path: PathKind::TakeOff,
        ..go_to(0.0)
    };
    bench.setpoint(&up);
    bench.run(2.0, |b| b.hear(&mut vehicle, &ground));
    bench.hear(&mut vehicle, &says("Arm: In landing sequence"));
    let refused = CommandAck {
        command: ARM,
        result: MavResult::MAV_RESULT_FAILED,
    };
    bench.hear(&mut vehicle, &refused);
    let told = bench.said("arming-failed");
    assert!(told[0].contains("DO_SET_MISSION_CURRENT 0"), "{told:?}");
}

#[test]
fn a_fence_on_board_is_told_by_its_health_or_its_status_alone() {
    let fence = MavSysStatusSensor::MAV_SYS_STATUS_GEOFENCE;
    for by_health in [true, false] {
        let mut vehicle = FrameEncoder::new(1, 1);
        let mut bench = Bench::in_guided(&mut vehicle);
        let report = |b: &mut Bench, vehicle: &mut FrameEncoder, broken: bool| {
            if by_health {
                let bad = if broken {
                    fence
                } else {
                    MavSysStatusSensor::empty()
                };
                b.hear(vehicle, &status(bad));
            } else {
                let breach_status = u8::from(broken);
                b.hear(
                    vehicle,
                    &FENCE_STATUS_DATA {
                        breach_status,
                        ..FENCE_STATUS_DATA::default()
                    },
                );
            }
        };
        report(&mut bench, &mut vehicle, false);
        flying(&mut bench, &mut vehicle, GUIDED, MavState::MAV_STATE_ACTIVE);
        // The mode may be seen before the reason.
        flying(&mut bench, &mut vehicle, RTL, MavState::MAV_STATE_ACTIVE);
        assert_eq!(bench.bridge.level(), ControlLevel::Pilot);
        report(&mut bench, &mut vehicle, true);
        flying(&mut bench, &mut vehicle, RTL, MavState::MAV_STATE_ACTIVE);
        assert_eq!(bench.bridge.level(), ControlLevel::Guardian);
        assert!(bench.bridge.control().has(Danger::Fence));
        bench.bridge.hand_back(&mut bench.out);
        assert_eq!(bench.said("hand-back-refused").len(), 1);
        report(&mut bench, &mut vehicle, false);
        flying(&mut bench, &mut vehicle, RTL, MavState::MAV_STATE_ACTIVE);
        assert!(!bench.bridge.control().has(Danger::Fence));
        bench.bridge.hand_back(&mut bench.out);
        assert!(bench.bridge.hand_back_pending());
    }
}

/// ArduPlane keeps the bit of a fence on board present while the fence is off; a vehicle may also leave it out.
#[test]
fn a_fence_switched_off_while_broken_does_not_hold_the_vehicle() {
    let fence = MavSysStatusSensor::MAV_SYS_STATUS_GEOFENCE;
    for (present, by_text) in [(true, false), (false, false), (true, true)] {
        let mut vehicle = FrameEncoder::new(1, 1);
        let mut bench = Bench::in_guided(&mut vehicle);
        bench.hear(&mut vehicle, &status(MavSysStatusSensor::empty()));
        let breach = FENCE_STATUS_DATA {
            breach_status: 1,
            ..FENCE_STATUS_DATA::default()
        };
        if by_text {
            bench.hear(&mut vehicle, &says("Polygon fence breached"));
        } else {
            bench.hear(&mut vehicle, &status(fence));
        }
        flying(&mut bench, &mut vehicle, RTL, MavState::MAV_STATE_ACTIVE);
        assert!(bench.bridge.control().has(Danger::Fence));
        bench.bridge.hand_back(&mut bench.out);
        assert_eq!(bench.said("hand-back-refused").len(), 1);
        let on = status(MavSysStatusSensor::empty());
        let off = SYS_STATUS_DATA {
            onboard_control_sensors_present: if present {
                fence
            } else {
                MavSysStatusSensor::empty()
            },
            onboard_control_sensors_enabled: on.onboard_control_sensors_enabled - fence,
            ..on
        };
        bench.hear(&mut vehicle, &off);
        // What is still said of it comes from a fence that acts no more.
        bench.hear(&mut vehicle, &breach);
        flying(&mut bench, &mut vehicle, RTL, MavState::MAV_STATE_ACTIVE);
        assert!(!bench.bridge.control().has(Danger::Fence));
        bench.bridge.hand_back(&mut bench.out);
        assert!(bench.bridge.hand_back_pending());
    }
}

/// MAVLink's BATTERY_STATUS, one for each battery (mavlink/mavlink issue 1182).
#[test]
fn only_a_low_battery_that_it_flies_by_brings_it_home() {
    use MavBatteryFunction as Function;
    let battery = |id, battery_function, battery_remaining| BATTERY_STATUS_DATA {
        id,
        battery_function,
        battery_remaining,
        ..BATTERY_STATUS_DATA::default()
    };
    for (id, function, name, home) in [
        (1, Function::MAV_BATTERY_FUNCTION_PAYLOAD, "PAYLOAD", false),
        (
            1,
            Function::MAV_BATTERY_FUNCTION_AVIONICS,
            "AVIONICS",
            false,
        ),
        (0, Function::MAV_BATTERY_FUNCTION_UNKNOWN, "UNKNOWN", true),
        (0, Function::MAV_BATTERY_FUNCTION_ALL, "ALL", true),
        (
            2,
            Function::MAV_BATTERY_FUNCTION_PROPULSION,
            "PROPULSION",
            true,
        ),
    ] {
        let mut vehicle = FrameEncoder::new(1, 1);
        let mut bench = Bench::in_guided(&mut vehicle);
        bench.hear(&mut vehicle, &status(MavSysStatusSensor::empty()));
        bench.hear(&mut vehicle, &battery(id, function, 12));
        bench.hear(&mut vehicle, &battery(id, function, 11));
        let words = format!("battery {id} (function {name}) at 12 %");
        let code = if home {
            "battery-low"
        } else {
            "other-battery-low"
        };
        let told = bench.said(code);
        assert!(told.len() == 1 && told[0].contains(&words), "{told:?}");
        let level = if home {
            ControlLevel::Guardian
        } else {
            ControlLevel::Automatic
        };
        assert_eq!(bench.bridge.level(), level, "{name}");
    }
}

#[test]
fn a_text_of_the_vehicle_is_shown_and_not_obeyed_and_a_flood_of_it_is_counted() {
    let mut vehicle = FrameEncoder::new(1, 1);
    let mut bench = Bench::in_guided(&mut vehicle);
    let raw = "\u{1b}]0;owned\u{7}\u{1b}[2J\u{202e}ok";
    for _ in 0..500 {
        bench.hear(&mut vehicle, &says(raw));
    }
    bench.run(11.0, |_| {});
    let shown = r"\u{1b}]0;owned\u{7}\u{1b}[2J\u{202e}ok";
    assert_eq!(
        bench.said("vehicle-says"),
        [shown, &format!("{shown} (499 more times in 10 s)")]
    );
}

/// The vehicle's failsafe listens for one ground station, by MAV_GCS_SYSID; another one does not calm it.
#[test]
fn a_vehicle_that_is_let_go_gets_the_heartbeat_alone_until_the_station_that_it_misses_is_there() {
    let mut vehicle = FrameEncoder::new(1, 1);
    let mut bench = Bench::in_guided(&mut vehicle);
    bench.setpoint(&go_to(500.0));
    bench.out.clear();
    for k in 0..50 {
        bench.time_s += 0.1;
        if k % 10 == 0 {
            flying(&mut bench, &mut vehicle, FBWA, MavState::MAV_STATE_ACTIVE);
        }
        let now = bench.now();
        bench.bridge.keep_alive(now, &mut bench.out);
    }
    let sent = messages(&bench.out.frames_to_vehicle);
    let heartbeats = sent
        .iter()
        .filter(|m| matches!(m, MavMessage::HEARTBEAT(_)));
    assert_eq!((heartbeats.count(), sent.len()), (5, 5));
    let station = HEARTBEAT_DATA {
        mavtype: MavType::MAV_TYPE_GCS,
        autopilot: MavAutopilot::MAV_AUTOPILOT_INVALID,
        ..heartbeat(0, MavState::MAV_STATE_ACTIVE)
    };
    for (id, calms) in [(254, false), (255, true)] {
        bench.hear(&mut FrameEncoder::new(id, 190), &station);
        let now = bench.now();
        assert_eq!(bench.bridge.other_station(now), calms.then_some(id));
    }
    bench.time_s += 5.0;
    assert_eq!(bench.bridge.other_station(bench.now()), None);
}

#[test]
fn a_receiver_that_nobody_has_explains_nothing() {
    let rc = MavSysStatusSensor::MAV_SYS_STATUS_SENSOR_RC_RECEIVER;
    let mut vehicle = FrameEncoder::new(1, 1);
    let mut bench = Bench::in_guided(&mut vehicle);
    for _ in 0..3 {
        bench.hear(&mut vehicle, &status(rc));
    }
    flying(&mut bench, &mut vehicle, RTL, MavState::MAV_STATE_ACTIVE);
    assert_eq!(bench.bridge.level(), ControlLevel::Pilot);
}

/// A battery failsafe lasts to the end of the flight; who flies by his sticks has it all the same.
#[test]
fn a_pilot_is_no_failsafe_while_one_lasts() {
    let mut vehicle = FrameEncoder::new(1, 1);
    let mut bench = Bench::in_guided(&mut vehicle);
    bench.out.clear();
    bench.run(5.0, |b| {
        flying(b, &mut vehicle, FBWA, MavState::MAV_STATE_CRITICAL)
    });
    assert_eq!(bench.bridge.level(), ControlLevel::Pilot);
    assert_eq!(bench.commands(), []);
}

#[test]
fn a_host_that_stalls_hears_before_it_judges() {
    let mut vehicle = FrameEncoder::new(1, 1);
    let mut bench = Bench::in_guided(&mut vehicle);
    bench.out.clear();
    bench.time_s += 20.0;
    // The first tick after waking: what has arrived is not read yet.
    bench.run(1.0, |_| {});
    assert_eq!(bench.said("link-lost").len(), 0);
    bench.run(3.0, |b| {
        flying(b, &mut vehicle, GUIDED, MavState::MAV_STATE_ACTIVE)
    });
    assert_eq!(bench.bridge.level(), ControlLevel::Automatic);
    assert!(!bench.commands().iter().any(|c| c.1 == SET_MODE));
    // A silence that it was awake for counts as ever.
    bench.run(6.5, |_| {});
    assert_eq!(bench.said("link-lost").len(), 1);
}

#[test]
fn a_vehicle_that_signs_is_not_called_silent() {
    let mut bench = Bench::of_1();
    let mut vehicle = FrameEncoder::new(1, 1);
    let mut signing = Signing::new(SigningConfig {
        key: [1; 32],
        link_id: 0,
        epoch_10us: 1,
    });
    bench.run(8.0, |b| {
        let beat = heartbeat(GUIDED, MavState::MAV_STATE_ACTIVE);
        let frame = vehicle.encode(&beat, Some(&mut signing), b.now());
        let now = b.now();
        b.bridge.receive(&frame, now, &mut b.out);
        b.setpoint(&go_to(0.0));
    });
    assert!(bench.said("key-missing")[0].contains("signing_key"));
    let failed = bench.said("setpoint-failed");
    assert!(failed[0].contains("signs its frames"), "{failed:?}");
}

#[test]
fn a_missing_gas_sensor_is_told_of_with_what_is_there() {
    let mut vehicle = FrameEncoder::new(1, 1);
    let mut bench = Bench::of_1();
    bench.run(9.0, |b| {
        flying(b, &mut vehicle, GUIDED, MavState::MAV_STATE_ACTIVE);
        b.hear(&mut vehicle, &gas("Temp", 1, 20.0));
        b.hear(&mut vehicle, &gas("CO2raw", 1, 20.0));
    });
    assert_eq!(bench.said("no-gas").len(), 0);
    bench.run(5.0, |b| {
        flying(b, &mut vehicle, GUIDED, MavState::MAV_STATE_ACTIVE)
    });
    let told = bench.said("no-gas");
    assert_eq!(told.len(), 1);
    assert!(told[0].contains("CO2 or CO2_PPB") && told[0].ends_with("received: CO2raw, Temp"));
    // It comes, and falls silent again.
    bench.hear(&mut vehicle, &gas("CO2", 2, 420.0));
    bench.run(12.0, |b| {
        flying(b, &mut vehicle, GUIDED, MavState::MAV_STATE_ACTIVE)
    });
    assert_eq!(bench.said("no-gas").len(), 2);
}

#[test]
fn a_vehicle_that_started_anew_rejoins_by_a_take_off() {
    let mut vehicle = FrameEncoder::new(1, 1);
    let mut bench = Bench::in_guided(&mut vehicle);
    // Anew: on the ground, in MANUAL, its clock near zero.
    let mut restarted = |b: &mut Bench, mode: u32, boot_ms: u32| {
        let on_ground = GLOBAL_POSITION_INT_DATA {
            relative_alt: 0,
            ..position(boot_ms, 43.44)
        };
        b.hear(&mut vehicle, &on_ground);
        b.hear(&mut vehicle, &heartbeat(mode, MavState::MAV_STATE_STANDBY));
    };
    restarted(&mut bench, MANUAL, 1000);
    assert_eq!(bench.said("restarted").len(), 1);
    bench.out.clear();
    bench.setpoint(&go_to(1.0));
    bench.run(2.0, |b| restarted(b, MANUAL, 2000));
    assert_eq!(
        bench.commands(),
        [],
        "not before somebody has handed it back"
    );
    bench.bridge.hand_back(&mut bench.out);
    assert_eq!(bench.said("hand-back").len(), 1);
    bench.setpoint(&go_to(2.0));
    bench.run(1.0, |b| restarted(b, MANUAL, 3000));
    assert_eq!(bench.commands(), [(1, SET_MODE)], "TAKEOFF");
    bench.out.clear();
    bench.run(2.0, |b| restarted(b, TAKEOFF, 4000));
    assert!(bench.commands().contains(&(1, 400)), "armed");
}

#[test]
fn a_hand_back_during_take_off_changes_nothing() {
    let mut vehicle = FrameEncoder::new(1, 1);
    let mut bench = Bench::of_1();
    let mut take_off = go_to(0.0);
    take_off.path = PathKind::TakeOff;
    bench.run(2.0, |b| {
        b.hear(
            &mut vehicle,
            &heartbeat(MANUAL, MavState::MAV_STATE_STANDBY),
        );
        b.setpoint(&take_off);
    });
    bench.run(2.0, |b| {
        b.hear(
            &mut vehicle,
            &heartbeat(TAKEOFF, MavState::MAV_STATE_ACTIVE),
        )
    });
    bench.out.clear();
    bench.bridge.hand_back(&mut bench.out);
    bench.run(2.0, |b| {
        b.hear(
            &mut vehicle,
            &heartbeat(TAKEOFF, MavState::MAV_STATE_ACTIVE),
        )
    });
    assert_eq!(bench.commands(), []);
    assert!(bench.said("hand-back")[0].contains("hand-back ignored"));
}

#[test]
fn another_ground_stations_place_is_a_takeover() {
    let mut vehicle = FrameEncoder::new(1, 1);
    let mut bench = Bench::in_guided(&mut vehicle);
    let target = |setpoint: &Setpoint| POSITION_TARGET_GLOBAL_INT_DATA {
        lat_int: (setpoint.lat_deg * 1e7).round() as i32,
        lon_int: -78_600_000,
        ..POSITION_TARGET_GLOBAL_INT_DATA::default()
    };
    bench.out.clear();
    bench.run(5.0, |b| {
        flying(b, &mut vehicle, GUIDED, MavState::MAV_STATE_ACTIVE);
        b.hear(&mut vehicle, &target(&go_to(0.0)));
    });
    assert_eq!(bench.bridge.level(), ControlLevel::Automatic);
    bench.run(4.0, |b| {
        flying(b, &mut vehicle, GUIDED, MavState::MAV_STATE_ACTIVE);
        b.hear(&mut vehicle, &target(&go_to(500.0)));
    });
    assert_eq!(bench.bridge.level(), ControlLevel::Pilot);
    assert_eq!(bench.said("other-ground-station").len(), 1);
    bench.out.clear();
    bench.setpoint(&go_to(50.0));
    bench.run(3.0, |b| {
        flying(b, &mut vehicle, GUIDED, MavState::MAV_STATE_ACTIVE)
    });
    assert_eq!(bench.commands(), []);
    // Handed back it is in GUIDED already.
    bench.bridge.hand_back(&mut bench.out);
    bench.setpoint(&go_to(50.0));
    bench.run(1.0, |b| {
        flying(b, &mut vehicle, GUIDED, MavState::MAV_STATE_ACTIVE)
    });
    assert!(bench.commands().contains(&(1, REPOSITION)));
}

#[test]
fn a_vehicle_that_flies_away_is_sent_again_and_told_of() {
    let mut vehicle = FrameEncoder::new(1, 1);
    let mut bench = Bench::in_guided(&mut vehicle);
    bench.out.clear();
    // It flies south at 20 m/s, away from its place in the north.
    bench.run(60.0, |b| {
        let boot_ms = (b.time_s * 1e3) as u32 + 60_000;
        b.hear(&mut vehicle, &heartbeat(GUIDED, MavState::MAV_STATE_ACTIVE));
        b.hear(
            &mut vehicle,
            &position(boot_ms, 43.44 - b.time_s * 20.0 / 111_195.0),
        );
    });
    assert_eq!(bench.bridge.level(), ControlLevel::Automatic);
    assert_eq!(bench.said("off-course").len(), 1);
    assert!(bench.commands().contains(&(1, REPOSITION)));
}

#[test]
fn who_only_listens_sends_nothing_at_all() {
    let mut vehicle = FrameEncoder::new(1, 1);
    let mut bench = Bench::new(BridgeConfig {
        listen_only: true,
        ..BridgeConfig::default()
    });
    bench.run(30.0, |b| {
        flying(b, &mut vehicle, GUIDED, MavState::MAV_STATE_ACTIVE);
        b.hear(
            &mut vehicle,
            &gas("CO2", (b.time_s * 1e3) as u32 + 60_000, 420.0),
        );
        b.setpoint(&go_to(b.time_s));
        b.bridge.hand_back(&mut b.out);
    });
    assert!(bench.out.frames_to_vehicle.is_empty());
    // The first ones came before the first heartbeat told whose they are.
    assert!(bench.out.state.is_some() && bench.out.readings.len() == 29);
    assert_eq!(bench.bridge.level(), ControlLevel::Pilot);
}

#[test]
fn what_the_link_loses_is_told_once_a_minute() {
    let mut bench = Bench::of_1();
    let mut vehicle = FrameEncoder::new(1, 1);
    bench.run(61.0, |b| {
        b.hear(&mut vehicle, &heartbeat(GUIDED, MavState::MAV_STATE_ACTIVE));
        // Every second one is lost.
        vehicle.encode(
            &heartbeat(GUIDED, MavState::MAV_STATE_ACTIVE),
            None,
            SimTime::ZERO,
        );
    });
    let told = bench.said("link-losses");
    assert_eq!(told, ["in the last 60 s: 60 frames received, 59 lost"]);
}

#[test]
fn a_reading_that_comes_late_or_again_is_placed_where_it_was_read_and_counts_once() {
    let mut vehicle = FrameEncoder::new(1, 1);
    let mut bench = Bench::of_1();
    // 20 m/s north, a position and a reading each second; that of 3 s is held up, and comes at 8 s.
    let lat = |t: f64| 43.44 + 20.0 * t / 111_195.0;
    bench.run(10.0, |b| {
        let t = b.time_s.round();
        let boot_ms = (t * 1e3) as u32 + 60_000;
        b.hear(&mut vehicle, &heartbeat(GUIDED, MavState::MAV_STATE_ACTIVE));
        b.hear(&mut vehicle, &position(boot_ms, lat(t)));
        if t != 3.0 {
            b.hear(&mut vehicle, &gas("CO2", boot_ms, 400.0 + t as f32));
        }
        if t == 8.0 {
            b.hear(&mut vehicle, &gas("CO2", 63_000, 403.0));
            b.hear(&mut vehicle, &gas("CO2", 63_000, 403.0));
        }
    });
    assert_eq!(bench.out.readings.len(), 10);
    for reading in &bench.out.readings {
        let t = reading.co2_ppm - 400.0;
        assert!((reading.lat_deg - lat(t)).abs() < 1e-6, "{reading:?}");
        let late = (t == 3.0).then(|| SimTime::from_s(3.0).ns());
        let off_ns = reading.time_ns.zip(late).map(|(is, was)| (is - was).abs());
        assert_eq!(reading.time_ns.is_some(), late.is_some());
        // The clocks may drift apart by 1e-4.
        assert!(off_ns.is_none_or(|off| off < 2_000_000), "{off_ns:?}");
    }
}

#[test]
fn no_rate_waits_for_the_answer_to_another() {
    let mut bench = Bench::of_1();
    let mut vehicle = FrameEncoder::new(1, 1);
    let beat = heartbeat(MANUAL, MavState::MAV_STATE_STANDBY);
    bench.run(2.0, |b| b.hear(&mut vehicle, &beat));
    let asked = messages(&bench.out.frames_to_vehicle);
    let rates = asked
        .iter()
        .filter(|m| matches!(m, MavMessage::COMMAND_LONG(c) if c.command as u16 == 511));
    assert_eq!(rates.count(), 14);
}
