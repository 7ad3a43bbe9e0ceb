//! A vehicle that answers as PX4's source says: modes in two parts, Hold by itself after the take-off, places with
//! their airspeed, parameters as bytes.

use crate::frames::messages;
use air::geo::Geodetic;
use mav_bridge::dialect::*;
use mav_bridge::px4::{HOLD, MANUAL, OFFBOARD, POSITION, PX4, RETURN, TAKEOFF};
use mav_bridge::wire::{FrameEncoder, MessageData};
use mav_bridge::{AttitudeTarget, Bridge, BridgeConfig, BridgeOutput, Expectation};
use protocol::SimTime;
use protocol::message::{ControlLevel, PathKind, Setpoint, Severity};

/// What an outer loop that never rests asks for.
const LEVEL: AttitudeTarget = AttitudeTarget {
    roll_rad: 0.1,
    pitch_rad: 0.05,
    yaw_rad: 1.0,
    throttle: 0.5,
};

/// PX4's side of a link.
struct Px4 {
    mode: u32,
    armed: bool,
    height_m: f32,
    failsafe: bool,
    /// Where it circles: place and airspeed of the last DO_REPOSITION that Hold has taken.
    place: Option<(i32, i32, f32)>,
    parameters: Vec<(&'static str, MavParamType, f32)>,
    time_s: f64,
    /// Since when attitudes come without a gap, and when the last one came.
    attitudes: Option<(f64, f64)>,
}

/// A whole number as PX4 writes it: its bytes in the place of a float.
fn whole(number: i32) -> (MavParamType, f32) {
    (
        MavParamType::MAV_PARAM_TYPE_INT32,
        f32::from_bits(number.cast_unsigned()),
    )
}

impl Px4 {
    fn on_ground() -> Self {
        let int = |name, number| {
            let (kind, value) = whole(number);
            (name, kind, value)
        };
        let real = |name, value| (name, MavParamType::MAV_PARAM_TYPE_REAL32, value);
        Self {
            mode: MANUAL,
            armed: false,
            height_m: 0.0,
            failsafe: false,
            place: None,
            time_s: 0.0,
            attitudes: None,
            parameters: vec![
                int("NAV_DLL_ACT", 2),
                int("COM_OBL_RC_ACT", 3),
                int("GF_ACTION", 3),
                int("RTL_TYPE", 1),
                real("MIS_TAKEOFF_ALT", 50.0),
                real("RTL_RETURN_ALT", 400.0),
                real("FW_AIRSPD_MIN", 12.0),
                real("FW_AIRSPD_MAX", 25.0),
            ],
        }
    }

    /// A tenth of a second.
    fn fly(&mut self) {
        self.time_s += 0.1;
        // COM_OF_LOSS_T, and COM_OBL_RC_ACT = 3.
        if self.mode == OFFBOARD && self.time_s - self.attitudes.unwrap().1 > 1.0 {
            (self.mode, self.failsafe) = (RETURN, true);
        }
        if self.mode == TAKEOFF && self.armed {
            self.height_m += 0.5;
            if self.height_m >= 50.0 {
                self.mode = HOLD;
            }
        }
    }

    /// Commander and navigator: result of a command.
    fn obey(&mut self, command: MavCmd, p: [f32; 4], place: (i32, i32)) -> MavResult {
        match command {
            MavCmd::MAV_CMD_DO_SET_MODE => {
                let to = ((p[1] as u32) << 16) | ((p[2] as u32) << 24);
                // "Takeoff denied! Please disarm and retry".
                if to == TAKEOFF && self.armed {
                    return MavResult::MAV_RESULT_TEMPORARILY_REJECTED;
                }
                // Offboard wants a second of set-points at 2 Hz or more before it.
                let there = |(since, last): (f64, f64)| {
                    self.time_s - since >= 1.0 && self.time_s - last <= 0.5
                };
                if to == OFFBOARD && !self.attitudes.is_some_and(there) {
                    return MavResult::MAV_RESULT_TEMPORARILY_REJECTED;
                }
                self.mode = to;
                MavResult::MAV_RESULT_ACCEPTED
            }
            MavCmd::MAV_CMD_COMPONENT_ARM_DISARM => {
                self.armed = p[0] == 1.0;
                MavResult::MAV_RESULT_ACCEPTED
            }
            MavCmd::MAV_CMD_DO_REPOSITION => {
                assert_eq!(p[1], 0.0, "it would change the mode");
                assert!(p[3].is_nan(), "a yaw");
                // The commander accepts it in any mode; Hold alone takes it.
                if self.mode == HOLD && self.armed {
                    self.place = Some((place.0, place.1, p[0]));
                }
                MavResult::MAV_RESULT_ACCEPTED
            }
            MavCmd::MAV_CMD_SET_MESSAGE_INTERVAL => MavResult::MAV_RESULT_ACCEPTED,
            other => panic!("{other:?} is nothing that is sent to a PX4"),
        }
    }

    fn take_attitude(&mut self, m: &SET_ATTITUDE_TARGET_DATA) {
        assert_eq!(
            m.type_mask.bits(),
            0x07,
            "rates are ignored, attitude and thrust are not"
        );
        let now = self.time_s;
        let since = self.attitudes.filter(|(_, last)| now - last <= 0.5);
        self.attitudes = Some((since.map_or(now, |(since, _)| since), now));
    }
}

struct Bench {
    px4: Px4,
    bridge: Bridge,
    encoder: FrameEncoder,
    time_s: f64,
    setpoint: Setpoint,
    out: BridgeOutput,
    sent: Vec<MavMessage>,
    /// No outer loop runs.
    silent: bool,
}

impl Bench {
    fn new(config: BridgeConfig) -> Self {
        Self {
            px4: Px4::on_ground(),
            bridge: Bridge::new(config).unwrap(),
            encoder: FrameEncoder::new(1, 1),
            time_s: 0.0,
            setpoint: setpoint(PathKind::TakeOff),
            out: BridgeOutput::default(),
            sent: Vec::new(),
            silent: false,
        }
    }

    fn hear<D: MessageData>(&mut self, message: &D) {
        let now = SimTime::from_s(self.time_s);
        let frame = self.encoder.encode(message, None, now);
        self.bridge.receive(&frame, now, &mut self.out);
    }

    fn tell(&mut self) {
        let (up, armed) = (self.px4.height_m > 2.0, self.px4.armed);
        let mut base_mode = MavModeFlag::MAV_MODE_FLAG_CUSTOM_MODE_ENABLED;
        if armed {
            base_mode |= MavModeFlag::MAV_MODE_FLAG_SAFETY_ARMED;
        }
        let system_status = match (self.px4.failsafe, armed) {
            (true, _) => MavState::MAV_STATE_CRITICAL,
            (_, true) => MavState::MAV_STATE_ACTIVE,
            _ => MavState::MAV_STATE_STANDBY,
        };
        self.hear(&HEARTBEAT_DATA {
            custom_mode: self.px4.mode,
            mavtype: MavType::MAV_TYPE_FIXED_WING,
            autopilot: MavAutopilot::MAV_AUTOPILOT_PX4,
            base_mode,
            system_status,
            mavlink_version: 3,
        });
        let landed_state = if up {
            MavLandedState::MAV_LANDED_STATE_IN_AIR
        } else {
            MavLandedState::MAV_LANDED_STATE_ON_GROUND
        };
        self.hear(&EXTENDED_SYS_STATE_DATA {
            landed_state,
            ..EXTENDED_SYS_STATE_DATA::default()
        });
        let arming = MavSysStatusSensor::MAV_SYS_STATUS_PREARM_CHECK;
        self.hear(&SYS_STATUS_DATA {
            onboard_control_sensors_enabled: arming,
            onboard_control_sensors_health: arming,
            battery_remaining: 98,
            ..SYS_STATUS_DATA::default()
        });
        self.hear(&GPS_RAW_INT_DATA {
            fix_type: GpsFixType::GPS_FIX_TYPE_3D_FIX,
            satellites_visible: 14,
            ..GPS_RAW_INT_DATA::default()
        });
        self.hear(&ESTIMATOR_STATUS_DATA {
            flags: EstimatorStatusFlags::from_bits_truncate(831),
            ..ESTIMATOR_STATUS_DATA::default()
        });
        self.hear(&HOME_POSITION_DATA {
            latitude: 434_417_000,
            longitude: -78_631_000,
            altitude: 341_000,
            ..HOME_POSITION_DATA::default()
        });
        // Wind towards north-east: from south-west.
        self.hear(&WIND_COV_DATA {
            wind_x: 3.0,
            wind_y: 3.0,
            ..WIND_COV_DATA::default()
        });
    }

    fn run(&mut self, seconds: f64) {
        for k in 0..(seconds * 10.0).round() as u32 {
            self.px4.fly();
            if k % 10 == 0 {
                self.tell();
            }
            let relative_alt = (self.px4.height_m * 1e3) as i32;
            self.hear(&GLOBAL_POSITION_INT_DATA {
                time_boot_ms: (self.time_s * 1e3) as u32,
                lat: 434_417_000,
                lon: -78_631_000,
                alt: 341_000 + relative_alt,
                relative_alt,
                ..GLOBAL_POSITION_INT_DATA::default()
            });
            self.time_s += 0.1;
            let now = SimTime::from_s(self.time_s);
            self.bridge.setpoint(&self.setpoint, now, &mut self.out);
            if !self.silent {
                self.bridge.attitude(&LEVEL, now, &mut self.out);
            }
            self.bridge.tick(now, &mut self.out);
            let frames = std::mem::take(&mut self.out.frames_to_vehicle);
            for message in messages(&frames) {
                self.answer(&message);
                self.sent.push(message);
            }
        }
    }

    fn answer(&mut self, message: &MavMessage) {
        let (command, result) = match message {
            MavMessage::COMMAND_LONG(c) => {
                let p = [c.param1, c.param2, c.param3, c.param4];
                (c.command, self.px4.obey(c.command, p, (0, 0)))
            }
            MavMessage::COMMAND_INT(c) => {
                let p = [c.param1, c.param2, c.param3, c.param4];
                (c.command, self.px4.obey(c.command, p, (c.x, c.y)))
            }
            MavMessage::SET_ATTITUDE_TARGET(m) => return self.px4.take_attitude(m),
            MavMessage::PARAM_REQUEST_READ(m) => {
                return self.tell_parameter(m.param_id.to_str().unwrap());
            }
            MavMessage::PARAM_SET(m) => {
                let name = m.param_id.to_str().unwrap();
                let known = self
                    .px4
                    .parameters
                    .iter_mut()
                    .find(|p| p.0 == name)
                    .unwrap();
                assert_eq!(m.param_type, known.1, "PX4 refuses another type");
                known.2 = m.param_value;
                return self.tell_parameter(name);
            }
            _ => return,
        };
        self.hear(&COMMAND_ACK_DATA {
            command,
            result,
            ..COMMAND_ACK_DATA::default()
        });
    }

    fn tell_parameter(&mut self, name: &str) {
        let known = self.px4.parameters.iter().find(|p| p.0 == name).copied();
        if let Some((name, param_type, param_value)) = known {
            self.hear(&PARAM_VALUE_DATA {
                param_value,
                param_id: name.into(),
                param_type,
                ..PARAM_VALUE_DATA::default()
            });
        }
    }

    fn said(&self, code: &str) -> Vec<&str> {
        let events = self.out.events.iter().filter(|e| e.code == code);
        events.map(|e| e.text.as_str()).collect()
    }

    /// Modes, places and arming that were sent since `from`.
    fn steered(&self, from: usize) -> usize {
        let steers = |m: &&MavMessage| match m {
            MavMessage::COMMAND_LONG(c) => c.command != MavCmd::MAV_CMD_SET_MESSAGE_INTERVAL,
            MavMessage::COMMAND_INT(_) | MavMessage::SET_ATTITUDE_TARGET(_) => true,
            _ => false,
        };
        self.sent[from..].iter().filter(steers).count()
    }
}

fn setpoint(path: PathKind) -> Setpoint {
    Setpoint {
        path,
        lat_deg: 43.45,
        lon_deg: -7.86,
        alt_amsl_m: 700.0,
        airspeed_m_s: 18.0,
        orbit_radius_m: 80.0,
    }
}

fn config() -> BridgeConfig {
    BridgeConfig {
        profile: &PX4,
        vehicle_system_id: Some(1),
        may_arm: true,
        expectation: Some(Expectation {
            home: Geodetic {
                lat_deg: 43.4417,
                lon_deg: -7.8631,
            },
            home_amsl_m: 340.0,
            airspeed_m_s: 18.0,
            least_over_ground_m_s: 3.0,
            wind_m_s: 9.0,
            stack_top_amsl_m: 696.0,
            fence: Vec::new(),
        }),
        ..BridgeConfig::default()
    }
}

#[test]
fn it_takes_off_flies_to_places_and_comes_home() {
    let mut bench = Bench::new(config());
    bench.run(25.0);
    let wrong = |e: &&protocol::message::EventMessage| {
        e.severity != Severity::Info && e.code == "checklist"
    };
    assert_eq!(
        bench.out.events.iter().filter(wrong).count(),
        0,
        "{:#?}",
        bench.out.events
    );
    assert_eq!(
        (bench.px4.mode, bench.px4.armed),
        (HOLD, true),
        "{:#?}",
        bench.out.events
    );
    assert!(bench.said("connected")[0].contains("any mode but Hold"));
    assert_eq!(
        bench.said("guided"),
        ["in Hold: the bridge sends setpoints"]
    );
    bench.setpoint = setpoint(PathKind::GoTo);
    bench.run(2.0);
    let (lat, lon, airspeed_m_s) = bench.px4.place.unwrap();
    assert_eq!((lat, lon), (434_500_000, -78_600_000));
    // Equivalent airspeed in the standard atmosphere at 700 m: 18 √(ρ/ρ₀) = 18 · √(1.1447/1.225).
    assert!((airspeed_m_s - 17.40).abs() < 0.02, "{airspeed_m_s}");
    let state = bench.out.state.as_ref();
    assert!(state.is_none(), "no attitude was sent");
    bench.setpoint = setpoint(PathKind::Land);
    bench.run(2.0);
    assert_eq!(bench.px4.mode, RETURN);
    bench.px4.height_m = 0.0;
    bench.px4.armed = false;
    bench.run(2.0);
    assert_eq!(bench.said("landed").len(), 1);
}

#[test]
fn a_pilot_has_it_until_it_is_handed_back_and_what_is_found_in_hold_is_his() {
    let mut bench = Bench::new(config());
    bench.run(25.0);
    bench.setpoint = setpoint(PathKind::GoTo);
    bench.px4.mode = POSITION;
    bench.run(1.0);
    assert_eq!(bench.bridge.level(), ControlLevel::Pilot);
    let from = bench.sent.len();
    // Whatever he does with it, Hold too.
    bench.px4.mode = HOLD;
    bench.run(5.0);
    bench.px4.mode = MANUAL;
    bench.run(5.0);
    assert_eq!(
        (bench.steered(from), bench.bridge.level()),
        (0, ControlLevel::Pilot)
    );
    bench.bridge.hand_back(&mut bench.out);
    bench.run(3.0);
    assert_eq!(
        (bench.px4.mode, bench.bridge.level()),
        (HOLD, ControlLevel::Automatic)
    );
    assert!(bench.steered(from) > 0);

    let mut found = Bench::new(config());
    (found.px4.mode, found.px4.armed, found.px4.height_m) = (HOLD, true, 300.0);
    found.setpoint = setpoint(PathKind::GoTo);
    found.run(10.0);
    assert_eq!(
        (found.steered(0), found.bridge.level()),
        (0, ControlLevel::Pilot)
    );
}

#[test]
fn its_failsafe_is_told_by_its_own_words() {
    for (words, code) in [
        (
            "Connection to ground control station lost",
            "receives nothing from its bridge",
        ),
        ("Manual control lost", "remote control"),
        ("Geofence violation", "fence"),
    ] {
        let mut bench = Bench::new(config());
        bench.run(25.0);
        bench.hear(&STATUSTEXT_DATA {
            severity: MavSeverity::MAV_SEVERITY_CRITICAL,
            text: words.into(),
            ..STATUSTEXT_DATA::default()
        });
        (bench.px4.mode, bench.px4.failsafe) = (RETURN, true);
        let from = bench.sent.len();
        bench.run(3.0);
        assert_eq!(bench.bridge.level(), ControlLevel::Guardian, "{words}");
        assert!(
            bench.said("guardian")[0].contains(code),
            "{:?}",
            bench.said("guardian")
        );
        assert_eq!(bench.steered(from), 0);
    }
}

#[test]
fn parameters_are_whole_numbers_in_bytes_both_ways() {
    let mut bench = Bench::new(BridgeConfig {
        set_parameters: true,
        ..config()
    });
    let (_, off) = whole(0);
    bench.px4.parameters[0].2 = off;
    bench.run(6.0);
    let doubtful = bench
        .said("checklist")
        .into_iter()
        .any(|t| t.contains("NAV_DLL_ACT is 0: on loss"));
    assert!(doubtful, "{:#?}", bench.said("checklist"));
    assert_eq!(bench.px4.parameters[0].2.to_bits(), 2);
    assert_eq!(
        bench.said("parameter-changed"),
        ["parameter NAV_DLL_ACT changed from 0 to 2"]
    );
}

#[test]
fn attitudes_are_there_before_offboard_and_end_with_it() {
    let mut bench = Bench::new(BridgeConfig {
        attitude_targets: true,
        ..config()
    });
    let attitudes = |bench: &Bench, from: usize| {
        let sent = bench.sent[from..].iter();
        sent.filter(|m| matches!(m, MavMessage::SET_ATTITUDE_TARGET(_)))
            .count()
    };
    bench.run(20.0);
    assert_eq!(bench.px4.mode, OFFBOARD, "{:#?}", bench.out.events);
    assert_eq!(
        bench.said("guided"),
        ["in Offboard: the bridge sends setpoints"]
    );
    bench.setpoint = setpoint(PathKind::GoTo);
    let from = bench.sent.len();
    bench.run(10.0);
    assert_eq!((bench.px4.mode, bench.px4.place), (OFFBOARD, None));
    assert_eq!(attitudes(&bench, from), 100);
    // A pilot has it.
    bench.px4.mode = POSITION;
    bench.run(1.1);
    let from = bench.sent.len();
    bench.run(5.0);
    assert_eq!(bench.steered(from), 0);
    bench.bridge.hand_back(&mut bench.out);
    bench.run(4.0);
    assert_eq!(
        (bench.px4.mode, bench.bridge.level()),
        (OFFBOARD, ControlLevel::Automatic)
    );
    // The outer loop stands still: PX4's own failsafe brings it home, and the bridge sees why.
    bench.silent = true;
    bench.run(4.0);
    assert_eq!(
        (bench.px4.mode, bench.bridge.level()),
        (RETURN, ControlLevel::Guardian)
    );
    assert_eq!(bench.said("attitude-paused").len(), 1);
}
