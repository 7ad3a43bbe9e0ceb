//! What ArduPlane and ArduCopter have alike: parameters, the words of their failsafes and the messages that the bridge requests.

use crate::dialect::{EKF_STATUS_REPORT_DATA, FENCE_STATUS_DATA, WIND_DATA};
use crate::profile::{
    Meaning::{Doubtful, Right},
    Rule, Saying,
};
use mavlink::MessageData;
use protocol::control_level::Danger;

/// Parameter: system id of the ground station whose heartbeat counts, since ArduPilot 4.7.
pub const MAV_GCS_SYSID: &str = "MAV_GCS_SYSID";
/// Parameter: the same before that.
pub const SYSID_MYGCS: &str = "SYSID_MYGCS";

/// Parameter: whether the fence on board is kept (0 off).
pub const FENCE_ENABLE: &str = "FENCE_ENABLE";
/// Parameter: action outside the fence: 0 report, 1 fly home.
pub const FENCE_ACTION: &str = "FENCE_ACTION";

/// Whether the fence on board is kept.
pub(crate) const FENCE_ON_BOARD: Rule = Rule {
    about: "fence on board",
    name: FENCE_ENABLE,
    meanings: &[(
        0,
        Doubtful("only the bridge enforces the mission's fence, and only while the link works"),
    )],
    otherwise: Right("the fence on board must equal the mission's fence"),
    set_to: None,
    link_failsafe: false,
};

/// Words in which a failsafe tells its cause.
pub(crate) const CAUSES: &[Saying] = &[
    Saying {
        all: &["fence"],
        any: &["breach", "trigger"],
        danger: Danger::Fence,
    },
    Saying {
        all: &["gcs failsafe"],
        any: &[],
        danger: Danger::Bridge,
    },
    Saying {
        all: &["failsafe"],
        any: &["rc ", "throttle", "radio"],
        danger: Danger::Remote,
    },
    Saying {
        all: &["battery"],
        any: &["is low", "is critical", "failsafe"],
        danger: Danger::Battery,
    },
];

/// Messages that the bridge requests beside those of every autopilot, with their rates, Hz.
pub(crate) const MESSAGES: &[(u32, f64)] = &[
    (WIND_DATA::ID, 2.0),
    (EKF_STATUS_REPORT_DATA::ID, 1.0),
    (FENCE_STATUS_DATA::ID, 1.0),
];
