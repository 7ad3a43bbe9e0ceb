//! ArduCopter: flight modes, what its commands mean, and the parameters that the bridge requests. Numbers and names by
//! its source, version 4.8 (`mode.h`, `Parameters.cpp`, `GCS_MAVLink_Copter.cpp`, `events.cpp`).

use crate::ardupilot::{
    CAUSES, FENCE_ACTION, FENCE_ON_BOARD, MAV_GCS_SYSID, MESSAGES, SYSID_MYGCS,
};
use crate::dialect::{CopterMode, MavAutopilot};
use crate::profile::{
    Commands, MULTIROTORS,
    Meaning::{Doubtful, Right},
    Modes, Parameters, Profile, Rule,
};

/// Flight mode STABILIZE: sticks alone.
pub const STABILIZE: u32 = CopterMode::COPTER_MODE_STABILIZE as u32;
/// Flight mode ALT_HOLD: sticks with the height held.
pub const ALT_HOLD: u32 = CopterMode::COPTER_MODE_ALT_HOLD as u32;
/// Flight mode AUTO: flies its mission.
pub const AUTO: u32 = CopterMode::COPTER_MODE_AUTO as u32;
/// Flight mode GUIDED: flies to the ground station's targets.
pub const GUIDED: u32 = CopterMode::COPTER_MODE_GUIDED as u32;
/// Flight mode LOITER: sticks with the position held.
pub const LOITER: u32 = CopterMode::COPTER_MODE_LOITER as u32;
/// Flight mode RTL: returns home and lands.
pub const RTL: u32 = CopterMode::COPTER_MODE_RTL as u32;
/// Flight mode LAND: where it is.
pub const LAND: u32 = CopterMode::COPTER_MODE_LAND as u32;
/// Flight mode BRAKE: stops.
pub const BRAKE: u32 = CopterMode::COPTER_MODE_BRAKE as u32;
/// Flight mode SMART_RTL: returns along the way it came.
pub const SMART_RTL: u32 = CopterMode::COPTER_MODE_SMART_RTL as u32;
/// Flight mode AUTO_RTL: the landing of its mission.
pub const AUTO_RTL: u32 = 27;
/// Flight mode INITIALISING, which its heartbeat never shows.
const NO_MODE: u32 = 254;

/// Parameter: failsafe on loss of the ground station's heartbeat (0 off, 1 RTL).
pub const FS_GCS_ENABLE: &str = "FS_GCS_ENABLE";
/// Parameter: silence of the ground station that counts, s.
pub const FS_GCS_TIMEOUT: &str = "FS_GCS_TIMEOUT";
/// Parameter: failsafe on loss of the remote control.
pub const FS_THR_ENABLE: &str = "FS_THR_ENABLE";
/// Parameter: action at a low battery.
pub const BATT_FS_LOW_ACT: &str = "BATT_FS_LOW_ACT";
/// Parameter: drag of the rotors, from which ArduCopter estimates the wind. With 0 it estimates none and sends zeros.
pub const EK3_DRAG_MCOEF: &str = "EK3_DRAG_MCOEF";
/// Parameter: altitude above home at which RTL flies, m, since ArduCopter 4.8.
pub const RTL_ALT_M: &str = "RTL_ALT_M";
/// Parameter: the same before that, cm.
pub const RTL_ALT: &str = "RTL_ALT";

/// ArduCopter.
pub const ARDUCOPTER: Profile = Profile {
    name: "ArduCopter",
    heartbeat: MavAutopilot::MAV_AUTOPILOT_ARDUPILOTMEGA,
    types: MULTIROTORS,
    multirotor: None,
    modes: Modes {
        starting: NO_MODE,
        take_off: GUIDED,
        after_take_off: None,
        places: GUIDED,
        places_is_pilots: false,
        attitudes: GUIDED,
        attitudes_first: false,
        home: RTL,
        // RTL ends with a landing at home.
        landing: None,
        homeward: &[RTL, LAND, SMART_RTL, AUTO_RTL],
        names: &[
            (STABILIZE, "STABILIZE"),
            (1, "ACRO"),
            (ALT_HOLD, "ALT_HOLD"),
            (AUTO, "AUTO"),
            (GUIDED, "GUIDED"),
            (LOITER, "LOITER"),
            (RTL, "RTL"),
            (7, "CIRCLE"),
            (LAND, "LAND"),
            (11, "DRIFT"),
            (13, "SPORT"),
            (14, "FLIP"),
            (15, "AUTOTUNE"),
            (16, "POSHOLD"),
            (BRAKE, "BRAKE"),
            (18, "THROW"),
            (19, "AVOID_ADSB"),
            (20, "GUIDED_NOGPS"),
            (SMART_RTL, "SMART_RTL"),
            (22, "FLOWHOLD"),
            (23, "FOLLOW"),
            (24, "ZIGZAG"),
            (25, "SYSTEMID"),
            (26, "AUTOROTATE"),
            (AUTO_RTL, "AUTO_RTL"),
        ],
        in_parts: false,
    },
    commands: Commands {
        speed_with_place: false,
        // A yaw; not a number leaves it to the vehicle.
        reposition_4: f32::NAN,
        // The rates are ignored.
        attitude_mask: 0x07,
        parameters_as_bytes: false,
        take_off_by_command: true,
        ground_speed: true,
        active_flies: true,
    },
    parameters: Parameters {
        take_off_altitude: "",
        airspeed_min: &[],
        airspeed_max: &[],
        home_altitude: &[(RTL_ALT_M, 1.0), (RTL_ALT, 0.01)],
        station: &[MAV_GCS_SYSID, SYSID_MYGCS],
        rules: &[
            Rule {
                about: "link failsafe",
                name: FS_GCS_ENABLE,
                meanings: &[
                    (
                        0,
                        Doubtful("on loss of this link the vehicle continues; expected 1"),
                    ),
                    (1, Right("a lost link triggers RTL")),
                    (3, Right("a lost link triggers SmartRTL or RTL")),
                    (
                        5,
                        Doubtful("on loss of this link it lands where it is; expected 1"),
                    ),
                ],
                otherwise: Right("a lost link triggers the failsafe"),
                set_to: Some(1.0),
                link_failsafe: true,
            },
            Rule {
                about: "remote-control failsafe",
                name: FS_THR_ENABLE,
                meanings: &[
                    (
                        0,
                        Doubtful("on loss of the remote control the vehicle continues; expected 1"),
                    ),
                    (
                        3,
                        Doubtful("on loss of the remote control it lands where it is; expected 1"),
                    ),
                ],
                otherwise: Right("a lost remote control triggers the failsafe"),
                set_to: None,
                link_failsafe: false,
            },
            Rule {
                about: "battery failsafe",
                name: BATT_FS_LOW_ACT,
                meanings: &[
                    (
                        0,
                        Doubtful("at a low battery the vehicle only warns; expected 2"),
                    ),
                    (
                        1,
                        Doubtful("at a low battery it lands where it is; expected 2"),
                    ),
                    (2, Right("at a low battery it returns home")),
                ],
                otherwise: Right("a low battery triggers the failsafe"),
                set_to: None,
                link_failsafe: false,
            },
            Rule {
                about: "wind estimate",
                name: EK3_DRAG_MCOEF,
                meanings: &[(
                    0,
                    Doubtful(
                        "it estimates no wind, so the mission uses the scenario's; expected the EK3_DRAG_ parameters \
                         of its airframe",
                    ),
                )],
                otherwise: Right("it estimates the wind"),
                set_to: None,
                link_failsafe: false,
            },
            FENCE_ON_BOARD,
            Rule {
                about: "fence action",
                name: FENCE_ACTION,
                meanings: &[
                    (
                        0,
                        Doubtful("it only reports a breach of its fence; expected 1"),
                    ),
                    (
                        2,
                        Doubtful("outside its fence it lands where it is; expected 1"),
                    ),
                ],
                otherwise: Right("outside its fence it returns home"),
                set_to: None,
                link_failsafe: false,
            },
        ],
    },
    causes: CAUSES,
    messages: MESSAGES,
    caution: "",
};
