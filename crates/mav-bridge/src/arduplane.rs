//! ArduPlane: flight modes and the parameters that the bridge requests.

use crate::arducopter::ARDUCOPTER;
use crate::ardupilot::{
    CAUSES, FENCE_ACTION, FENCE_ON_BOARD, MAV_GCS_SYSID, MESSAGES, SYSID_MYGCS,
};
use crate::dialect::{MavAutopilot, PlaneMode};
use crate::profile::{
    Commands, FIXED_WINGS,
    Meaning::{Doubtful, Right},
    Modes, Parameters, Profile, Rule,
};

/// Flight mode MANUAL.
pub const MANUAL: u32 = PlaneMode::PLANE_MODE_MANUAL as u32;
/// Flight mode CIRCLE, that of a short failsafe.
pub const CIRCLE: u32 = PlaneMode::PLANE_MODE_CIRCLE as u32;
/// Flight mode fly-by-wire A.
pub const FBWA: u32 = PlaneMode::PLANE_MODE_FLY_BY_WIRE_A as u32;
/// Flight mode AUTO: flies its mission, or its landing sequence.
pub const AUTO: u32 = PlaneMode::PLANE_MODE_AUTO as u32;
/// Flight mode RTL: returns home and circles.
pub const RTL: u32 = PlaneMode::PLANE_MODE_RTL as u32;
/// Flight mode LOITER.
pub const LOITER: u32 = PlaneMode::PLANE_MODE_LOITER as u32;
/// Flight mode TAKEOFF.
pub const TAKEOFF: u32 = PlaneMode::PLANE_MODE_TAKEOFF as u32;
/// Flight mode GUIDED: flies to the ground station's targets.
pub const GUIDED: u32 = PlaneMode::PLANE_MODE_GUIDED as u32;
/// Flight mode AUTOLAND: lands by itself where it took off.
pub const AUTOLAND: u32 = 26;
/// Flight mode INITIALISING: still starting up.
pub const INITIALISING: u32 = PlaneMode::PLANE_MODE_INITIALIZING as u32;

/// Parameter: failsafe on loss of the ground station's heartbeat (0 off).
pub const FS_GCS_ENABL: &str = "FS_GCS_ENABL";
/// Parameter: action of the long failsafe (0 continue, 1 RTL).
pub const FS_LONG_ACTN: &str = "FS_LONG_ACTN";
/// Parameter: altitude above home to which mode TAKEOFF climbs, m.
pub const TKOFF_ALT: &str = "TKOFF_ALT";

/// Parameter: altitude above home at which RTL flies, m; below 0 the one where it is.
pub const RTL_ALTITUDE: &str = "RTL_ALTITUDE";
/// Parameter: the same before ArduPlane 4.5, cm.
pub const ALT_HOLD_RTL: &str = "ALT_HOLD_RTL";
/// Parameter: whether a landing sequence is used: 0 no, and no arming with one on board; 1 and 2 after RTL;
/// 3 for DO_LAND_START alone.
pub const RTL_AUTOLAND: &str = "RTL_AUTOLAND";
/// Parameter: lowest equivalent airspeed of the automatic modes, m/s.
pub const AIRSPEED_MIN: &str = "AIRSPEED_MIN";
/// Parameter: highest equivalent airspeed of the automatic modes, m/s.
pub const AIRSPEED_MAX: &str = "AIRSPEED_MAX";
/// Parameter: AIRSPEED_MIN before ArduPlane 4.5.
pub const ARSPD_FBW_MIN: &str = "ARSPD_FBW_MIN";
/// Parameter: AIRSPEED_MAX before ArduPlane 4.5.
pub const ARSPD_FBW_MAX: &str = "ARSPD_FBW_MAX";

/// ArduPlane.
pub const ARDUPLANE: Profile = Profile {
    name: "ArduPlane",
    heartbeat: MavAutopilot::MAV_AUTOPILOT_ARDUPILOTMEGA,
    types: FIXED_WINGS,
    multirotor: Some(&ARDUCOPTER),
    modes: Modes {
        starting: INITIALISING,
        take_off: TAKEOFF,
        after_take_off: None,
        places: GUIDED,
        places_is_pilots: false,
        attitudes: GUIDED,
        attitudes_first: false,
        home: RTL,
        landing: Some(AUTO),
        homeward: &[CIRCLE, AUTO, RTL, AUTOLAND],
        names: &[
            (MANUAL, "MANUAL"),
            (CIRCLE, "CIRCLE"),
            (2, "STABILIZE"),
            (3, "TRAINING"),
            (4, "ACRO"),
            (FBWA, "FBWA"),
            (6, "FBWB"),
            (7, "CRUISE"),
            (8, "AUTOTUNE"),
            (AUTO, "AUTO"),
            (RTL, "RTL"),
            (LOITER, "LOITER"),
            (TAKEOFF, "TAKEOFF"),
            (14, "AVOID_ADSB"),
            (GUIDED, "GUIDED"),
            (INITIALISING, "INITIALISING"),
            (24, "THERMAL"),
            (AUTOLAND, "AUTOLAND"),
        ],
        in_parts: false,
    },
    commands: Commands {
        speed_with_place: false,
        // The way round: clockwise.
        reposition_4: 0.0,
        // Bits set are ignored. By its source (`handle_set_attitude_target`) roll and pitch are taken where their rates
        // are not ignored, and a yaw that is taken is a rudder's deflection: so the attitude's own bit is set, and
        // that of the yaw rate.
        attitude_mask: 0x84,
        parameters_as_bytes: false,
        take_off_by_command: false,
        ground_speed: false,
        active_flies: true,
    },
    parameters: Parameters {
        take_off_altitude: TKOFF_ALT,
        airspeed_min: &[AIRSPEED_MIN, ARSPD_FBW_MIN],
        airspeed_max: &[AIRSPEED_MAX, ARSPD_FBW_MAX],
        home_altitude: &[(RTL_ALTITUDE, 1.0), (ALT_HOLD_RTL, 0.01)],
        station: &[MAV_GCS_SYSID, SYSID_MYGCS],
        rules: &[
            Rule {
                about: "link failsafe",
                name: FS_GCS_ENABL,
                meanings: &[
                    (
                        0,
                        Doubtful("on loss of this link the vehicle continues; expected 1"),
                    ),
                    (
                        3,
                        Doubtful("the link failsafe works only in AUTO, not in GUIDED; expected 1"),
                    ),
                ],
                otherwise: Right("a lost link triggers the failsafe"),
                set_to: Some(1.0),
                link_failsafe: true,
            },
            Rule {
                about: "failsafe's action",
                name: FS_LONG_ACTN,
                meanings: &[
                    (
                        0,
                        Doubtful("on loss of this link it continues in GUIDED; expected 1"),
                    ),
                    (1, Right("it returns home")),
                    (
                        2,
                        Doubtful("on loss of this link it glides down; expected 1"),
                    ),
                    (
                        3,
                        Doubtful("on loss of this link it opens its parachute; expected 1"),
                    ),
                ],
                otherwise: Doubtful(
                    "on loss of this link it does not simply return home; expected 1",
                ),
                set_to: Some(1.0),
                link_failsafe: true,
            },
            FENCE_ON_BOARD,
            Rule {
                about: "outside its fence",
                name: FENCE_ACTION,
                meanings: &[(
                    0,
                    Doubtful("it only reports a breach of its fence; expected 1"),
                )],
                otherwise: Right("it reacts to a breach"),
                set_to: None,
                link_failsafe: false,
            },
            Rule {
                about: "landing",
                name: RTL_AUTOLAND,
                meanings: &[(
                    0,
                    Doubtful(
                        "it does not land by itself, and rejects arming with a DO_LAND_START on board; expected \
                         1 or 2 and a landing sequence, or a pilot for the landing",
                    ),
                )],
                otherwise: Right("it lands by a landing sequence, if one is on board"),
                set_to: None,
                link_failsafe: false,
            },
        ],
    },
    causes: CAUSES,
    messages: MESSAGES,
    caution: "",
};

/// A flight mode with its number, for people.
pub fn mode_name(custom_mode: u32) -> String {
    ARDUPLANE.modes.name(custom_mode)
}
