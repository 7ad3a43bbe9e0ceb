//! Numbers and names of ArduPlane: flight modes and the parameters this bridge asks for.

use crate::dialect::PlaneMode;

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
/// Parameter: what the long failsafe does (0 goes on, 1 RTL).
pub const FS_LONG_ACTN: &str = "FS_LONG_ACTN";
/// Parameter: altitude above home to which mode TAKEOFF climbs, m.
pub const TKOFF_ALT: &str = "TKOFF_ALT";

/// Parameter: system id of the ground station whose heartbeat counts, since ArduPlane 4.7.
pub const MAV_GCS_SYSID: &str = "MAV_GCS_SYSID";
/// Parameter: the same before that.
pub const SYSID_MYGCS: &str = "SYSID_MYGCS";

/// Parameter: whether the fence on board is kept (0 off).
pub const FENCE_ENABLE: &str = "FENCE_ENABLE";
/// Parameter: what the vehicle does outside it: 0 tells, 1 flies home.
pub const FENCE_ACTION: &str = "FENCE_ACTION";
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

/// A flight mode with its number, for people.
pub fn mode_name(custom_mode: u32) -> String {
    let name = match custom_mode {
        MANUAL => "MANUAL",
        CIRCLE => "CIRCLE",
        2 => "STABILIZE",
        3 => "TRAINING",
        4 => "ACRO",
        FBWA => "FBWA",
        6 => "FBWB",
        7 => "CRUISE",
        8 => "AUTOTUNE",
        AUTO => "AUTO",
        RTL => "RTL",
        LOITER => "LOITER",
        TAKEOFF => "TAKEOFF",
        14 => "AVOID_ADSB",
        GUIDED => "GUIDED",
        INITIALISING => "INITIALISING",
        24 => "THERMAL",
        AUTOLAND => "AUTOLAND",
        _ => return format!("mode {custom_mode}"),
    };
    format!("{name} ({custom_mode})")
}
