//! PX4 as a fixed wing: what its source says, version 1.14 and its neighbours (`px4_custom_mode.h`,
//! `Commander.cpp`, `navigator_main.cpp`, `loiter.cpp`, `commander_params.c`, `mavlink_parameters.cpp`). Nobody has
//! flown a real one by it yet.

use crate::dialect::{ESTIMATOR_STATUS_DATA, MavAutopilot, WIND_COV_DATA};
use crate::profile::{
    Commands, FIXED_WINGS, MULTIROTORS,
    Meaning::{Doubtful, Right},
    Modes, Parameters, Profile, Rule, Saying,
};
use mavlink::MessageData;
use protocol::control_level::Danger;

/// A mode by its main mode and, of AUTO, its sub mode.
const fn mode(main: u32, sub: u32) -> u32 {
    (main << 16) | (sub << 24)
}

/// Flight mode Manual: sticks alone.
pub const MANUAL: u32 = mode(1, 0);
/// Flight mode Position: sticks with course and height held.
pub const POSITION: u32 = mode(3, 0);
/// Flight mode Takeoff.
pub const TAKEOFF: u32 = mode(4, 2);
/// Flight mode Hold: circles, and flies to the places of DO_REPOSITION.
pub const HOLD: u32 = mode(4, 3);
/// Flight mode Mission.
pub const MISSION: u32 = mode(4, 4);
/// Flight mode Return.
pub const RETURN: u32 = mode(4, 5);
/// Flight mode Land: where it is.
pub const LAND: u32 = mode(4, 6);
/// Flight mode Offboard: obeys a stream of set-points.
pub const OFFBOARD: u32 = mode(6, 0);

/// PX4, multirotor: the same modes and failsafes, and speeds over ground.
pub const PX4_MULTIROTOR: Profile = Profile {
    name: "PX4 (multirotor)",
    types: MULTIROTORS,
    multirotor: None,
    commands: Commands {
        ground_speed: true,
        ..FIXED_WING.commands
    },
    parameters: Parameters {
        airspeed_min: &[],
        airspeed_max: &[],
        ..FIXED_WING.parameters
    },
    ..FIXED_WING
};

/// PX4, fixed wing; a multirotor is told by its heartbeat.
pub const PX4: Profile = Profile {
    multirotor: Some(&PX4_MULTIROTOR),
    ..FIXED_WING
};

const FIXED_WING: Profile = Profile {
    name: "PX4",
    heartbeat: MavAutopilot::MAV_AUTOPILOT_PX4,
    types: FIXED_WINGS,
    multirotor: None,
    modes: Modes {
        starting: 0,
        take_off: TAKEOFF,
        after_take_off: Some(HOLD),
        places: HOLD,
        places_is_pilots: true,
        attitudes: OFFBOARD,
        attitudes_first: true,
        home: RETURN,
        landing: None,
        homeward: &[RETURN, LAND, MISSION, mode(4, 9)],
        names: &[
            (MANUAL, "Manual"),
            (mode(2, 0), "Altitude"),
            (POSITION, "Position"),
            (mode(4, 1), "Ready"),
            (TAKEOFF, "Takeoff"),
            (HOLD, "Hold"),
            (MISSION, "Mission"),
            (RETURN, "Return"),
            (LAND, "Land"),
            (mode(4, 8), "Follow me"),
            (mode(4, 9), "Precision land"),
            (mode(5, 0), "Acro"),
            (OFFBOARD, "Offboard"),
            (mode(7, 0), "Stabilized"),
            (mode(10, 0), "Termination"),
        ],
        in_parts: true,
    },
    commands: Commands {
        // Its cruising speed is that of a place: each DO_REPOSITION, and Hold when it is entered, sets it anew.
        speed_with_place: true,
        // A yaw; not a number leaves it to the vehicle.
        reposition_4: f32::NAN,
        // The rates are ignored.
        attitude_mask: 0x07,
        parameters_as_bytes: true,
        take_off_by_command: false,
        ground_speed: false,
        active_flies: false,
    },
    parameters: Parameters {
        take_off_altitude: "MIS_TAKEOFF_ALT",
        airspeed_min: &["FW_AIRSPD_MIN"],
        airspeed_max: &["FW_AIRSPD_MAX"],
        home_altitude: &[("RTL_RETURN_ALT", 1.0)],
        station: &[],
        rules: &[
            Rule {
                about: "link failsafe",
                name: "NAV_DLL_ACT",
                meanings: &[
                    (
                        0,
                        Doubtful("on loss of this link the vehicle continues; expected 2"),
                    ),
                    (
                        1,
                        Doubtful("on loss of this link it circles where it is; expected 2"),
                    ),
                    (2, Right("it returns home")),
                    (
                        3,
                        Doubtful("on loss of this link it lands where it is; expected 2"),
                    ),
                ],
                otherwise: Doubtful("on loss of this link it terminates the flight; expected 2"),
                set_to: Some(2.0),
                link_failsafe: true,
            },
            Rule {
                about: "failsafe of set-points",
                name: "COM_OBL_RC_ACT",
                meanings: &[
                    (3, Right("without attitude targets it returns home")),
                    (5, Right("without attitude targets it circles where it is")),
                ],
                otherwise: Doubtful(
                    "without attitude targets it waits for sticks, lands where it is or terminates the flight; \
                     expected 3",
                ),
                set_to: Some(3.0),
                link_failsafe: true,
            },
            Rule {
                about: "fence on board",
                name: "GF_ACTION",
                meanings: &[
                    (
                        0,
                        Doubtful(
                            "only the bridge enforces the mission's fence, and only while the link works",
                        ),
                    ),
                    (
                        1,
                        Doubtful("it only reports a breach of its fence; expected 3"),
                    ),
                    (
                        2,
                        Right(
                            "outside its fence it circles; the fence on board must equal the mission's fence",
                        ),
                    ),
                    (
                        3,
                        Right(
                            "outside its fence it returns home; the fence on board must equal the mission's \
                               fence",
                        ),
                    ),
                    (
                        5,
                        Doubtful("outside its fence it lands where it is; expected 3"),
                    ),
                ],
                otherwise: Doubtful("outside its fence it terminates the flight; expected 3"),
                set_to: None,
                link_failsafe: false,
            },
            Rule {
                about: "landing",
                name: "RTL_TYPE",
                meanings: &[
                    (
                        1,
                        Right("it lands by the mission landing on board, if one is there"),
                    ),
                    (
                        3,
                        Right("it lands at the nearest landing on board or at home"),
                    ),
                ],
                otherwise: Doubtful(
                    "it returns home and circles there or lands as RTL_LAND_DELAY says; expected 1 and a mission \
                     with a landing, or a pilot for the landing",
                ),
                set_to: None,
                link_failsafe: false,
            },
        ],
    },
    causes: &[
        Saying {
            all: &["geofence"],
            any: &[],
            danger: Danger::Fence,
        },
        Saying {
            all: &["lost"],
            any: &[
                "data link",
                "gcs connection",
                "ground control station",
                "ground station",
            ],
            danger: Danger::Bridge,
        },
        Saying {
            all: &["lost"],
            any: &["manual control", "rc signal"],
            danger: Danger::Remote,
        },
        Saying {
            all: &["battery"],
            any: &["low", "critical", "emergency"],
            danger: Danger::Battery,
        },
    ],
    messages: &[(WIND_COV_DATA::ID, 2.0), (ESTIMATOR_STATUS_DATA::ID, 1.0)],
    caution: "a pilot takes over with any mode but Hold, which the bridge uses too",
};
