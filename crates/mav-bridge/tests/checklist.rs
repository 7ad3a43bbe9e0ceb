//! What is looked at before anything is commanded.

use crate::frames::messages;
use air::geo::Geodetic;
use mav_bridge::dialect::{
    EKF_STATUS_REPORT_DATA, EkfStatusFlags, GPS_RAW_INT_DATA, GpsFixType, HEARTBEAT_DATA,
    HOME_POSITION_DATA, MavAutopilot, MavMessage, MavModeFlag, MavState, MavSysStatusSensor,
    MavType, PARAM_VALUE_DATA, SYS_STATUS_DATA,
};
use mav_bridge::wire::{FrameEncoder, MessageData};
use mav_bridge::{Bridge, BridgeConfig, BridgeOutput, Expectation};
use protocol::SimTime;
use protocol::message::{PathKind, Setpoint, Severity};

/// What a vehicle on the ground tells.
#[derive(Clone)]
struct Ground {
    gps: GPS_RAW_INT_DATA,
    ekf: EKF_STATUS_REPORT_DATA,
    status: SYS_STATUS_DATA,
    home: HOME_POSITION_DATA,
    parameters: Vec<(&'static str, f32)>,
}

fn ready() -> Ground {
    let arming = MavSysStatusSensor::MAV_SYS_STATUS_PREARM_CHECK;
    Ground {
        gps: GPS_RAW_INT_DATA {
            fix_type: GpsFixType::GPS_FIX_TYPE_3D_FIX,
            satellites_visible: 14,
            ..GPS_RAW_INT_DATA::default()
        },
        ekf: EKF_STATUS_REPORT_DATA {
            // 831: all but "above ground" and "constant position", as a SITL tells in flight.
            flags: EkfStatusFlags::from_bits_truncate(831),
            ..EKF_STATUS_REPORT_DATA::default()
        },
        status: SYS_STATUS_DATA {
            onboard_control_sensors_enabled: arming,
            onboard_control_sensors_health: arming,
            battery_remaining: 98,
            ..SYS_STATUS_DATA::default()
        },
        home: HOME_POSITION_DATA {
            latitude: 434_417_000,
            longitude: -78_631_000,
            altitude: 341_000,
            ..HOME_POSITION_DATA::default()
        },
        parameters: vec![
            ("FS_GCS_ENABL", 1.0),
            ("FS_LONG_ACTN", 1.0),
            ("MAV_GCS_SYSID", 255.0),
            ("FENCE_ENABLE", 1.0),
            ("FENCE_ACTION", 1.0),
            ("RTL_ALTITUDE", 400.0),
            ("RTL_AUTOLAND", 1.0),
            ("AIRSPEED_MIN", 12.0),
            ("AIRSPEED_MAX", 25.0),
            ("TKOFF_ALT", 50.0),
        ],
    }
}

fn expectation() -> Expectation {
    Expectation {
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
    }
}

fn config() -> BridgeConfig {
    BridgeConfig {
        vehicle_system_id: Some(1),
        may_arm: true,
        expectation: Some(expectation()),
        ..BridgeConfig::default()
    }
}

/// Lets a vehicle that tells `ground` answer to a bridge for `seconds`, while a take-off is asked for.
struct Bench {
    bridge: Bridge,
    kind: MavType,
    vehicle: FrameEncoder,
    time_s: f64,
    out: BridgeOutput,
}

impl Bench {
    fn new(config: BridgeConfig) -> Self {
        Self {
            bridge: Bridge::new(config).unwrap(),
            kind: MavType::MAV_TYPE_FIXED_WING,
            vehicle: FrameEncoder::new(1, 1),
            time_s: 0.0,
            out: BridgeOutput::default(),
        }
    }

    fn hear<D: MessageData>(&mut self, message: &D) {
        let now = SimTime::from_s(self.time_s);
        let frame = self.vehicle.encode(message, None, now);
        self.bridge.receive(&frame, now, &mut self.out);
    }

    fn run(&mut self, seconds: f64, ground: &mut Ground) {
        for k in 0..(seconds * 10.0) as u32 {
            if k % 10 == 0 {
                self.hear(&HEARTBEAT_DATA {
                    custom_mode: 0,
                    mavtype: self.kind,
                    autopilot: MavAutopilot::MAV_AUTOPILOT_ARDUPILOTMEGA,
                    base_mode: MavModeFlag::MAV_MODE_FLAG_CUSTOM_MODE_ENABLED,
                    system_status: MavState::MAV_STATE_STANDBY,
                    mavlink_version: 3,
                });
                self.hear(&ground.gps);
                self.hear(&ground.ekf);
                self.hear(&ground.status);
                self.hear(&ground.home);
            }
            self.time_s += 0.1;
            let now = SimTime::from_s(self.time_s);
            let home = expectation().home;
            let take_off = Setpoint {
                path: PathKind::TakeOff,
                lat_deg: home.lat_deg,
                lon_deg: home.lon_deg,
                alt_amsl_m: 700.0,
                airspeed_m_s: 18.0,
                orbit_radius_m: 80.0,
            };
            self.bridge.setpoint(&take_off, now, &mut self.out);
            let sent_before = self.out.frames_to_vehicle.len();
            self.bridge.tick(now, &mut self.out);
            let sent = messages(&self.out.frames_to_vehicle[sent_before..]);
            for message in sent {
                self.answer(&message, ground);
            }
        }
    }

    /// Answers what a vehicle answers about its parameters.
    fn answer(&mut self, message: &MavMessage, ground: &mut Ground) {
        let name = match message {
            MavMessage::PARAM_REQUEST_READ(m) => m.param_id.to_str().unwrap().to_owned(),
            MavMessage::PARAM_SET(m) => {
                let name = m.param_id.to_str().unwrap().to_owned();
                let known = ground.parameters.iter_mut().find(|(n, _)| *n == name);
                known.unwrap().1 = m.param_value;
                name
            }
            _ => return,
        };
        let known = ground.parameters.iter().find(|(n, _)| *n == name).copied();
        if let Some((name, param_value)) = known {
            self.hear(&PARAM_VALUE_DATA {
                param_value,
                param_id: name.into(),
                ..PARAM_VALUE_DATA::default()
            });
        }
    }

    /// Points of the list that are not right, by what they are about.
    fn wrong(&self) -> Vec<&str> {
        let list = self.out.events.iter().filter(|e| e.code == "checklist");
        list.filter(|e| e.severity != Severity::Info)
            .filter_map(|e| e.text.strip_prefix("before take-off: ")?.split_once(" ("))
            .filter(|(_, rest)| !rest.starts_with("points"))
            .map(|(about, _)| about)
            .collect()
    }

    fn sent(&self) -> Vec<MavMessage> {
        messages(&self.out.frames_to_vehicle)
    }

    /// Whether mode TAKEOFF was asked for.
    fn takes_off(&self) -> bool {
        self.sent()
            .iter()
            .any(|m| matches!(m, MavMessage::COMMAND_LONG(c) if c.command as u16 == 176))
    }
}

#[test]
fn a_vehicle_that_is_ready_takes_off_at_once() {
    let mut bench = Bench::new(config());
    bench.run(2.0, &mut ready());
    assert!(bench.wrong().is_empty(), "{:#?}", bench.out.events);
    let list = bench.out.events.iter().filter(|e| e.code == "checklist");
    assert_eq!(list.count(), 17, "sixteen points and the whole");
    assert!(bench.takes_off());
    let written = |m: &MavMessage| matches!(m, MavMessage::PARAM_SET(_));
    assert!(!bench.sent().iter().any(written));
}

#[test]
fn each_point_is_told_when_it_is_wrong() {
    type Change = fn(&mut Ground);
    let cases: [(&str, Change); 14] = [
        ("gps", |g| g.gps.satellites_visible = 5),
        ("battery", |g| g.status.battery_remaining = 40),
        ("battery", |g| g.status.battery_remaining = -1),
        ("arming", |g| {
            g.status.onboard_control_sensors_health = MavSysStatusSensor::empty()
        }),
        // 100 m further east: 0.00124 degrees at 43.44 N.
        ("home", |g| g.home.longitude += 12_400),
        ("ground", |g| g.home.altitude += 52_000),
        ("airspeed", |g| g.parameters[8].1 = 17.0),
        ("link failsafe", |g| g.parameters[0].1 = 0.0),
        ("failsafe's action", |g| g.parameters[1].1 = 0.0),
        ("ground station", |g| g.parameters[2].1 = 252.0),
        ("fence on board", |g| g.parameters[3].1 = 0.0),
        ("outside its fence", |g| g.parameters[4].1 = 0.0),
        // The stack ends 355 m above home.
        ("way home", |g| g.parameters[5].1 = 100.0),
        ("landing", |g| g.parameters[6].1 = 0.0),
    ];
    for (about, change) in cases {
        let mut ground = ready();
        change(&mut ground);
        let mut bench = Bench::new(config());
        bench.run(2.0, &mut ground);
        assert_eq!(bench.wrong(), [about], "{:#?}", bench.out.events);
        assert!(bench.takes_off(), "{about} is doubtful, not refused");
    }
}

#[test]
fn older_names_of_parameters_count_as_the_new_ones() {
    let mut ground = ready();
    for (old, new, value) in [
        ("SYSID_MYGCS", "MAV_GCS_SYSID", 255.0),
        ("ALT_HOLD_RTL", "RTL_ALTITUDE", 40_000.0), // cm
        ("ARSPD_FBW_MIN", "AIRSPEED_MIN", 12.0),
        ("ARSPD_FBW_MAX", "AIRSPEED_MAX", 25.0),
    ] {
        let known = ground.parameters.iter_mut().find(|(n, _)| *n == new);
        *known.unwrap() = (old, value);
    }
    let mut bench = Bench::new(config());
    bench.run(2.0, &mut ground);
    assert!(bench.wrong().is_empty(), "{:#?}", bench.out.events);
}

#[test]
fn no_take_off_while_something_is_refused() {
    type Change = fn(&mut Ground);
    let cases: [(&str, Change); 4] = [
        ("gps", |g| g.gps.fix_type = GpsFixType::GPS_FIX_TYPE_2D_FIX),
        ("ekf", |g| g.ekf.flags = EkfStatusFlags::EKF_ATTITUDE),
        ("battery", |g| g.status.battery_remaining = 15),
        // A kilometre north.
        ("home", |g| g.home.latitude += 90_000),
    ];
    for (about, change) in cases {
        let mut ground = ready();
        change(&mut ground);
        let mut bench = Bench::new(config());
        bench.run(12.0, &mut ground);
        assert!(!bench.takes_off(), "{about}");
        let refused = bench
            .out
            .events
            .iter()
            .filter(|e| e.code == "take-off-refused");
        let refused: Vec<_> = refused.collect();
        assert!(
            refused.len() == 1 && refused[0].text.contains(about),
            "{refused:?}"
        );
        // It is looked at again.
        bench.run(8.0, &mut ready());
        assert!(bench.takes_off(), "{about}");
    }
}

#[test]
fn what_a_vehicle_does_not_tell_is_doubtful_and_keeps_nobody() {
    let mut ground = ready();
    ground.parameters.retain(|(n, _)| *n == "FS_GCS_ENABL");
    let mut bench = Bench::new(config());
    bench.run(3.0, &mut ground);
    assert!(!bench.takes_off() && !bench.bridge.follows_setpoints());
    bench.run(4.0, &mut ground);
    assert!(bench.takes_off());
    assert_eq!(
        bench.wrong(),
        [
            "airspeed",
            "ground station",
            "way home",
            "failsafe's action",
            "fence on board",
            "outside its fence",
            "landing"
        ]
    );
    let failed = |e: &&protocol::message::EventMessage| e.code == "parameter-failed";
    assert_eq!(bench.out.events.iter().filter(failed).count(), 0);
}

#[test]
fn parameters_are_set_only_where_that_is_asked_for() {
    let mut ground = ready();
    (ground.parameters[0].1, ground.parameters[2].1) = (0.0, 1.0);
    let mut bench = Bench::new(BridgeConfig {
        system_id: 250,
        set_parameters: true,
        ..config()
    });
    bench.run(4.0, &mut ground);
    assert_eq!(
        (ground.parameters[0].1, ground.parameters[2].1),
        (1.0, 250.0)
    );
    let changed = bench
        .out
        .events
        .iter()
        .filter(|e| e.code == "parameter-changed");
    let changed: Vec<&str> = changed.map(|e| e.text.as_str()).collect();
    assert_eq!(
        changed,
        [
            "parameter FS_GCS_ENABL changed from 0 to 1",
            "parameter MAV_GCS_SYSID changed from 1 to 250"
        ]
    );
}

#[test]
fn a_dry_run_shows_every_frame_and_sends_questions_and_rates_alone() {
    let mut ground = ready();
    ground.parameters[0].1 = 0.0;
    let mut bench = Bench::new(BridgeConfig {
        dry_run: true,
        set_parameters: true,
        ..config()
    });
    bench.run(8.0, &mut ground);
    // Message 511 is SET_MESSAGE_INTERVAL: a vehicle whose streams are off (MAVn_* of ArduPilot) tells nothing without.
    let rate = |m: &MavMessage| matches!(m, MavMessage::COMMAND_LONG(c) if c.command as u16 == 511);
    let question = |m: &MavMessage| matches!(m, MavMessage::PARAM_REQUEST_READ(_));
    let sent = bench.sent();
    assert!(sent.iter().any(question) && sent.iter().any(rate));
    assert!(sent.iter().all(|m| question(m) || rate(m)));
    assert_eq!(ground.parameters[0].1, 0.0);
    // The frames told of are whole ones.
    let shown = bench.out.events.iter().filter(|e| e.code == "would-send");
    let frames: Vec<Vec<u8>> = shown
        .map(|e| {
            let hex = e.text.rsplit(' ').next().unwrap();
            let pairs = hex.as_bytes().chunks(2);
            let byte = |p: &[u8]| u8::from_str_radix(std::str::from_utf8(p).unwrap(), 16).unwrap();
            pairs.map(byte).collect()
        })
        .collect();
    let told = messages(&frames);
    assert_eq!(told.len(), frames.len());
    let count = |is: fn(&MavMessage) -> bool| told.iter().filter(|m| is(m)).count();
    assert_eq!(count(|m| matches!(m, MavMessage::HEARTBEAT(_))), 1);
    assert_eq!(count(|m| matches!(m, MavMessage::PARAM_SET(_))), 1);
    let mode = |m: &MavMessage| matches!(m, MavMessage::COMMAND_LONG(c) if c.command as u16 == 176);
    assert_eq!(count(mode), 1, "TAKEOFF");
    assert_eq!(count(rate), 0, "sent, not shown");
}

/// A quadrotor flies its speed over ground in any wind that its aircraft bears.
#[test]
fn the_wind_of_a_quadrotor_is_told_beside_its_airspeed() {
    let mut bench = Bench::new(BridgeConfig {
        expectation: Some(Expectation {
            airspeed_m_s: 6.0,
            wind_m_s: 5.7,
            ..expectation()
        }),
        ..config()
    });
    bench.kind = MavType::MAV_TYPE_QUADROTOR;
    bench.run(6.0, &mut ready());
    let wind = bench
        .out
        .events
        .iter()
        .find(|e| e.text.contains("wind (ok)"));
    let text = wind.map(|e| e.text.as_str()).unwrap_or_default();
    assert!(
        text.contains("at 6.0 m/s over ground up to 11.7 m/s through the air"),
        "{text}"
    );
}

#[test]
fn how_the_vehicle_is_is_told_as_it_tells() {
    let mut ground = ready();
    ground.status.battery_remaining = 40;
    ground.status.voltage_battery = 11_100;
    ground.home.longitude += 12_400;
    let mut bench = Bench::new(config());
    let silent = bench.bridge.health(SimTime::ZERO);
    assert_eq!((silent.system_id, silent.battery_percent), (Some(1), None));
    assert_eq!((silent.checked, silent.silent_s), (Some(false), None));
    bench.run(2.0, &mut ground);
    let health = bench.bridge.health(SimTime::from_s(bench.time_s + 3.0));
    assert_eq!((health.system_id, health.component_id), (Some(1), Some(1)));
    assert_eq!(health.flight_mode.as_deref(), Some("MANUAL (0)"));
    assert_eq!((health.armed, health.satellites), (Some(false), Some(14)));
    assert_eq!(
        (health.battery_percent, health.battery_v),
        (Some(40), Some(11.1))
    );
    // The last heartbeat is of a second before the end.
    assert!((health.silent_s.unwrap() - 4.0).abs() < 0.15);
    assert_eq!((health.lost_frames, health.refused_frames), (0, 0));
    let findings: Vec<(&str, bool)> = health
        .findings
        .iter()
        .map(|f| (f.about.as_str(), f.refused))
        .collect();
    assert_eq!(findings, [("battery", false), ("home", false)]);

    // What the vehicle does not know is not known.
    ground.status.battery_remaining = -1;
    ground.status.voltage_battery = u16::MAX;
    ground.gps.satellites_visible = u8::MAX;
    bench.run(2.0, &mut ground);
    let health = bench.bridge.health(SimTime::from_s(bench.time_s));
    assert_eq!((health.battery_percent, health.battery_v), (None, None));
    assert_eq!(health.satellites, None);
}
