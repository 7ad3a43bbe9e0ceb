//! A vehicle of the team as a ground station sees it.

use crate::ground_station::station::{X8, long, scenario};
use mav_bridge::arduplane::{FBWA, GUIDED, LOITER, MANUAL, RTL};
use mav_bridge::dialect::{
    AVAILABLE_MODES_DATA, COMMAND_INT_DATA, COMMAND_LONG_DATA, MANUAL_CONTROL_DATA,
    MISSION_COUNT_DATA, MISSION_REQUEST_LIST_DATA, MavCmd, MavFrame, MavMessage, MavMissionResult,
    MavResult,
};
use mav_bridge::wire::{FrameDecoder, FrameEncoder, MessageData};
use protocol::SimTime;
use protocol::message::{
    Control, ControlLevel, ControlWish, Destination, Estimate, Mode, Model, Peak, PeakStatus,
    State, VehicleKind,
};
use stand_in::{TeamVehicle, TeamWish};

const SYSTEM: u8 = 3;
const ACCEPTED: MavResult = MavResult::MAV_RESULT_ACCEPTED;
const FAILED: MavResult = MavResult::MAV_RESULT_FAILED;

struct Watched {
    vehicle: TeamVehicle,
    encoder: FrameEncoder,
    time_s: f64,
}

fn state(kind: VehicleKind) -> State {
    State {
        kind,
        lat_deg: 43.44,
        lon_deg: -7.85,
        alt_amsl_m: 800.0,
        vel_ned_m_s: [12.0, -9.0, 1.0],
        roll_deg: -20.0,
        pitch_deg: 3.0,
        heading_deg: 320.0,
        airspeed_m_s: 18.0,
        throttle: 0.4,
        airborne: true,
    }
}

impl Watched {
    fn new(kind: VehicleKind) -> Self {
        Self::flies(kind, "x8.toml", X8)
    }

    fn flies(kind: VehicleKind, file: &str, aircraft: &str) -> Self {
        let aircraft = fdm::Airframe::from_toml(file, aircraft).unwrap();
        let mut vehicle = TeamVehicle::new(&scenario(), 2, &aircraft, 340.0).unwrap();
        assert!(
            vehicle.step(SimTime::ZERO, &[]).is_empty(),
            "nothing is known yet"
        );
        vehicle.state(&state(kind));
        Self {
            vehicle,
            encoder: FrameEncoder::new(255, 190),
            time_s: 10.0,
        }
    }

    /// What it says within a second of a message.
    fn ask<D: MessageData>(&mut self, message: &D) -> Vec<MavMessage> {
        let frame = self.encoder.encode(message, None, SimTime::ZERO);
        let mut decoder = FrameDecoder::new();
        let mut heard = Vec::new();
        for tick in 0..50 {
            let now = SimTime::from_ns(((self.time_s + f64::from(tick) * 0.02) * 1e9) as i64);
            let frames = if tick == 0 {
                vec![frame.clone()]
            } else {
                Vec::new()
            };
            for bytes in self.vehicle.step(now, &frames) {
                decoder.push(&bytes);
            }
            while let Some(frame) = decoder.next_frame(now) {
                assert_eq!(frame.system_id(), SYSTEM);
                heard.extend(frame.message());
            }
        }
        self.time_s += 1.0;
        heard
    }

    fn command(&mut self, command: MavCmd, p: &[f32]) -> MavResult {
        let heard = self.ask(&COMMAND_LONG_DATA {
            target_system: SYSTEM,
            ..long(command, p)
        });
        let answer = heard.iter().find_map(|m| match m {
            MavMessage::COMMAND_ACK(m) if m.command == command => Some(m.result),
            _ => None,
        });
        answer.expect("an answer")
    }

    fn mode(&mut self, mode: u32) -> MavResult {
        self.command(MavCmd::MAV_CMD_DO_SET_MODE, &[1.0, mode as f32])
    }

    fn wishes(&mut self) -> Vec<ControlWish> {
        let wishes = self.vehicle.take_wishes().into_iter();
        let control = |wish| match wish {
            TeamWish::Control(control) => control.wish,
            TeamWish::SendTo(place) => panic!("{place:?}"),
        };
        wishes.map(control).collect()
    }

    fn flown_by(&mut self, level: ControlLevel) {
        self.vehicle.mode(&Mode {
            level,
            reason: String::new(),
            setpoints_obeyed: level == ControlLevel::Automatic,
        });
    }
}

/// Another vehicle's frames are not answered; what is told is what the bus says.
#[test]
fn it_tells_what_the_bus_says_of_it() {
    let mut watched = Watched::new(VehicleKind::Simulated);
    let heard = watched.ask(&COMMAND_LONG_DATA {
        target_system: SYSTEM + 1,
        ..long(MavCmd::MAV_CMD_REQUEST_MESSAGE, &[148.0])
    });
    assert!(
        !heard
            .iter()
            .any(|m| matches!(m, MavMessage::COMMAND_ACK(_)))
    );
    let position = heard.iter().find_map(|m| match m {
        MavMessage::GLOBAL_POSITION_INT(m) => Some(m.clone()),
        _ => None,
    });
    let position = position.unwrap();
    assert!((position.lat - 434_400_000).abs() <= 1 && (position.lon + 78_500_000).abs() <= 1);
    assert_eq!((position.alt, position.relative_alt), (800_000, 460_000));
    assert_eq!((position.vx, position.vy, position.vz), (1200, -900, 100));
    assert_eq!(position.hdg, 32_000);
    // 18 m/s through air of the standard atmosphere at 800 m, in equivalent airspeed:
    // sqrt(1.1337 / 1.225) of it, within what a warmer day changes.
    let eas = heard.iter().find_map(|m| match m {
        MavMessage::VFR_HUD(m) => Some(m.airspeed),
        _ => None,
    });
    assert!((eas.unwrap() - 17.3).abs() < 0.3);
}

/// The model of a team whose peak has this status.
fn model(status: PeakStatus) -> Model {
    let known = |value: f64| Estimate { value, sd: 1.0 };
    Model {
        background_ppm: known(446.0),
        effective_height_agl_m: known(540.0),
        axis_deg: known(72.25),
        c_max_ppm: known(500.0),
        c_max_distance_m: known(2400.0),
        sigma_y_scale: known(1.0),
        sigma_z_scale: known(1.0),
        wind_speed_m_s: 7.0,
        observations: 100,
        mechanisms: Vec::new(),
        peak: Some(Peak {
            lat_deg: 43.45,
            lon_deg: -7.84,
            alt_amsl_m: 880.0,
            co2_ppm: 2841.4,
            sd_ppm: 526.2,
            time_s: 0.0,
            status,
        }),
        flux: Vec::new(),
    }
}

#[test]
fn the_plumes_axis_and_each_conclusion_are_told() {
    let mut watched = Watched::new(VehicleKind::Simulated);
    let mut told = Vec::new();
    let mut axis = None;
    for status in [
        PeakStatus::Doubtful,
        PeakStatus::Supported,
        PeakStatus::Supported,
        PeakStatus::Doubtful,
        PeakStatus::Confirmed,
    ] {
        watched.vehicle.model(&model(status));
        for message in watched.ask(&MANUAL_CONTROL_DATA::default()) {
            match message {
                MavMessage::STATUSTEXT(m) => told.push(m.text.to_str().unwrap().to_owned()),
                MavMessage::NAMED_VALUE_FLOAT(m) if m.name.to_str() == Ok("PLUMEAXIS") => {
                    axis = Some(m.value);
                }
                _ => {}
            }
        }
    }
    assert_eq!(axis, Some(72.25));
    let peak = "CO2 peak 2841 +- 526 ppm:";
    let words = ["supported", "doubtful", "confirmed"].map(|word| format!("{peak} {word}"));
    assert_eq!(told, words);
}

#[test]
fn modes_are_levels_of_control_and_wishes_for_them() {
    let mut watched = Watched::new(VehicleKind::Simulated);
    for (level, mode) in [
        (ControlLevel::Automatic, GUIDED),
        (ControlLevel::Pilot, FBWA),
        (ControlLevel::Guardian, RTL),
    ] {
        watched.flown_by(level);
        let heard = watched.ask(&MANUAL_CONTROL_DATA::default());
        let shown = |m: &MavMessage| matches!(m, MavMessage::HEARTBEAT(m) if m.custom_mode == mode);
        assert!(heard.iter().any(shown), "{level:?}");
    }
    for (mode, wish) in [
        (MANUAL, ControlWish::TakeOver),
        (FBWA, ControlWish::TakeOver),
        (GUIDED, ControlWish::HandBack),
        (RTL, ControlWish::Home),
    ] {
        assert_eq!(watched.mode(mode), ACCEPTED);
        assert_eq!(watched.wishes(), [wish]);
    }
    assert_eq!(watched.mode(LOITER), FAILED);
    for command in [
        MavCmd::MAV_CMD_COMPONENT_ARM_DISARM,
        MavCmd::MAV_CMD_DO_CHANGE_SPEED,
        MavCmd::MAV_CMD_MISSION_START,
    ] {
        assert_eq!(watched.command(command, &[1.0]), FAILED);
    }
    assert_eq!(watched.wishes(), []);
    // Every mode that is told can be chosen.
    let heard = watched.ask(&COMMAND_LONG_DATA {
        target_system: SYSTEM,
        ..long(
            MavCmd::MAV_CMD_REQUEST_MESSAGE,
            &[AVAILABLE_MODES_DATA::ID as f32],
        )
    });
    for message in heard {
        if let MavMessage::AVAILABLE_MODES(m) = message {
            assert_eq!(watched.mode(m.custom_mode), ACCEPTED, "{}", m.custom_mode);
        }
    }
}

/// A quadrotor is an ArduCopter with the numbers of its modes (`ArduCopter/mode.h`): STABILIZE 0, ALT_HOLD 2, GUIDED 4,
/// RTL 6; MAV_TYPE_QUADROTOR is 2 (`common.xml`).
#[test]
fn a_quadrotor_is_an_arducopter() {
    let quad = include_str!("../../../../aircraft/quad.toml");
    let mut watched = Watched::flies(VehicleKind::Simulated, "quad.toml", quad);
    for (level, mode) in [
        (ControlLevel::Automatic, 4),
        (ControlLevel::Pilot, 2),
        (ControlLevel::Guardian, 6),
    ] {
        watched.flown_by(level);
        let heard = watched.ask(&MANUAL_CONTROL_DATA::default());
        let shown = |m: &MavMessage| match m {
            MavMessage::HEARTBEAT(m) => m.custom_mode == mode && m.mavtype as u8 == 2,
            _ => false,
        };
        assert!(heard.iter().any(shown), "{level:?}");
    }
    for (mode, wish) in [
        (0, ControlWish::TakeOver),
        (2, ControlWish::TakeOver),
        (4, ControlWish::HandBack),
        (6, ControlWish::Home),
    ] {
        assert_eq!(watched.mode(mode), ACCEPTED);
        assert_eq!(watched.wishes(), [wish]);
    }
    // Numbers of ArduPlane's modes are those of other modes, or of none.
    for mode in [FBWA, RTL, GUIDED] {
        assert_eq!(watched.mode(mode), FAILED, "{mode}");
    }
    let heard = watched.ask(&COMMAND_LONG_DATA {
        target_system: SYSTEM,
        ..long(MavCmd::MAV_CMD_COMPONENT_ARM_DISARM, &[1.0])
    });
    let says = |m: &MavMessage| match m {
        MavMessage::STATUSTEXT(m) => m.text.to_str().unwrap().contains("take over by AltHold"),
        _ => false,
    };
    assert!(heard.iter().any(says));
}

/// Sticks fly who has been taken over, and nobody else.
#[test]
fn sticks_are_heard_after_a_takeover_alone() {
    let mut watched = Watched::new(VehicleKind::Simulated);
    let sticks = MANUAL_CONTROL_DATA {
        target: SYSTEM,
        y: 500,
        z: 600,
        ..MANUAL_CONTROL_DATA::default()
    };
    watched.ask(&sticks);
    assert_eq!(watched.wishes(), []);
    watched.flown_by(ControlLevel::Pilot);
    watched.ask(&sticks);
    let TeamWish::Control(control) = watched.vehicle.take_wishes()[0] else {
        panic!("no control");
    };
    let flown = control.sticks.unwrap();
    assert_eq!((flown.roll, flown.pitch, flown.throttle), (0.5, 0.0, 0.6));
    // A real one has a remote control of its own.
    let mut real = Watched::new(VehicleKind::Real);
    assert_eq!(real.mode(FBWA), FAILED);
    assert_eq!(real.mode(RTL), ACCEPTED);
    assert_eq!(real.wishes(), [ControlWish::Home]);
}

/// A place takes it over and sends it there; one at 0, 0, on the ground or where the vehicle does not go, outside its
/// fence (43.480° north) and its height band (460 to 1,240 m AMSL, over ground at 340 m), does neither.
#[test]
fn it_is_sent_to_a_place() {
    let mut watched = Watched::new(VehicleKind::Simulated);
    let there = COMMAND_INT_DATA {
        command: MavCmd::MAV_CMD_DO_REPOSITION,
        x: 434_500_000,
        y: -78_400_000,
        z: 150.0,
        frame: MavFrame::MAV_FRAME_GLOBAL_RELATIVE_ALT,
        target_system: SYSTEM,
        ..COMMAND_INT_DATA::default()
    };
    let result = |heard: &[MavMessage]| {
        let answers = heard.iter().find_map(|m| match m {
            MavMessage::COMMAND_ACK(m) => Some(m.result),
            _ => None,
        });
        answers.unwrap()
    };
    for (x, y, z) in [
        (0, 0, 150.0),
        (there.x, there.y, 0.0),
        (910_000_000, there.y, 150.0),
        (434_900_000, there.y, 150.0),
        (there.x, there.y, 80.0),
        (there.x, there.y, 940.0),
    ] {
        let wrong = COMMAND_INT_DATA {
            x,
            y,
            z,
            ..there.clone()
        };
        assert_eq!(result(&watched.ask(&wrong)), MavResult::MAV_RESULT_DENIED);
    }
    assert_eq!(watched.wishes(), []);
    assert_eq!(result(&watched.ask(&there)), ACCEPTED);
    let place = Destination {
        lat_deg: 43.45,
        lon_deg: -7.84,
        alt_amsl_m: 490.0,
    };
    let taken_over = TeamWish::Control(Control {
        wish: ControlWish::TakeOver,
        sticks: None,
    });
    assert_eq!(
        watched.vehicle.take_wishes(),
        [taken_over, TeamWish::SendTo(place)]
    );
    watched.flown_by(ControlLevel::Pilot);
    let heard = watched.ask(&there);
    let shown = |m: &MavMessage| matches!(m, MavMessage::HEARTBEAT(m) if m.custom_mode == LOITER);
    assert!(heard.iter().any(shown));
    // Already taken over, it is only sent.
    assert_eq!(watched.vehicle.take_wishes(), [TeamWish::SendTo(place)]);
    let mut real = Watched::new(VehicleKind::Real);
    assert_eq!(result(&real.ask(&there)), FAILED);
}

#[test]
fn it_takes_no_mission() {
    let mut watched = Watched::new(VehicleKind::Simulated);
    let heard = watched.ask(&MISSION_REQUEST_LIST_DATA {
        target_system: SYSTEM,
        ..MISSION_REQUEST_LIST_DATA::default()
    });
    assert!(
        heard
            .iter()
            .any(|m| matches!(m, MavMessage::MISSION_COUNT(m) if m.count == 0))
    );
    let heard = watched.ask(&MISSION_COUNT_DATA {
        count: 4,
        target_system: SYSTEM,
        ..MISSION_COUNT_DATA::default()
    });
    let denied = MavMissionResult::MAV_MISSION_DENIED;
    assert!(
        heard
            .iter()
            .any(|m| matches!(m, MavMessage::MISSION_ACK(m) if m.mavtype == denied))
    );
}
