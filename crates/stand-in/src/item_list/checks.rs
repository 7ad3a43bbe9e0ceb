//! Which items are taken, and in what form they are kept.
#![allow(deprecated, reason = "ground stations still send the older forms")]

use mav_bridge::dialect::{
    MISSION_ITEM_DATA, MISSION_ITEM_INT_DATA as Item, MavCmd, MavFrame, MavMissionResult,
    MavMissionType,
};

pub(crate) use MavMissionResult::MAV_MISSION_UNSUPPORTED as UNSUPPORTED;
use MavMissionResult::{
    MAV_MISSION_ERROR as ERROR, MAV_MISSION_INVALID_PARAM1 as PARAM1,
    MAV_MISSION_INVALID_PARAM2 as PARAM2, MAV_MISSION_INVALID_PARAM3 as PARAM3,
    MAV_MISSION_INVALID_PARAM4 as PARAM4, MAV_MISSION_INVALID_PARAM5_X as PARAM5,
    MAV_MISSION_INVALID_PARAM6_Y as PARAM6, MAV_MISSION_INVALID_PARAM7 as PARAM7,
    MAV_MISSION_UNSUPPORTED_FRAME as UNSUPPORTED_FRAME,
};

/// Last of the numbers that MAVLink gives to commands which navigate.
const LAST_NAVIGATION: u32 = 95;
/// Highest altitude that ArduPlane's storage holds, m.
const HIGHEST_M: f32 = 83_000.0;

/// The commands that ArduPlane takes into a mission, those that it later passes over (a camera, a
/// relay) included; without a place first, then those with one.
const WITHOUT_PLACE: [u32; 44] = [
    20, 83, 93, 112, 114, 115, 176, 177, 178, 181, 182, 183, 184, 188, 194, 197, 202, 203, 205,
    206, 207, 208, 210, 211, 212, 213, 215, 218, 222, 223, 530, 531, 532, 534, 600, 601, 1000,
    2000, 2001, 2500, 2501, 3000, 42_600, 42_702,
];
const WITH_PLACE: [u32; 18] = [
    16, 17, 18, 19, 21, 22, 30, 31, 82, 84, 85, 92, 94, 179, 189, 191, 195, 201,
];

/// Commands without a place whose last three numbers ArduPlane keeps: the gimbal's flags, and a script's arguments.
const KEEPS_LAST_NUMBERS: [u32; 2] = [1000, 42_702];

/// Whether a command is one to be flown, not one on the way.
pub(crate) fn navigates(command: MavCmd) -> bool {
    // NAV_SET_YAW_SPEED and NAV_SCRIPT_TIME stand outside the range of the others.
    command as u32 <= LAST_NAVIGATION || [213, 42_702].contains(&(command as u32))
}

/// The item in the form in which it is kept, or why it is not taken. `last` is the number of the
/// last item of the upload.
pub(super) fn stored(
    kind: MavMissionType,
    item: Item,
    last: u16,
) -> Result<Item, MavMissionResult> {
    match kind {
        MavMissionType::MAV_MISSION_TYPE_MISSION => mission(item, last),
        MavMissionType::MAV_MISSION_TYPE_FENCE => fence(item),
        _ => rally(item),
    }
}

fn mission(item: Item, last: u16) -> Result<Item, MavMissionResult> {
    check_parameters(&item)?;
    let number = item.command as u32;
    let has_place = WITH_PLACE.contains(&number);
    if !has_place && !WITHOUT_PLACE.contains(&number) {
        return Err(UNSUPPORTED);
    }
    let target = item.param1;
    let is_jump = item.command == MavCmd::MAV_CMD_DO_JUMP;
    if is_jump && !(1.0..=f32::from(last)).contains(&target) {
        return Err(ERROR);
    }
    // What ArduPlane does not keep comes back as 0.
    let kept = |p: f32| if p.is_nan() { 0.0 } else { p };
    let frame = if has_place {
        check_place(&item)?;
        match absolute_relative_or_terrain(item.frame) {
            Some(frame) => frame,
            None if item.frame == MavFrame::MAV_FRAME_MISSION => MavFrame::MAV_FRAME_GLOBAL,
            None => return Err(UNSUPPORTED_FRAME),
        }
    } else {
        MavFrame::MAV_FRAME_GLOBAL
    };
    let keeps_last = has_place || KEEPS_LAST_NUMBERS.contains(&number);
    let (x, y, z) = if keeps_last {
        (item.x, item.y, item.z)
    } else {
        (0, 0, 0.0)
    };
    Ok(Item {
        frame,
        x,
        y,
        z,
        param1: kept(item.param1),
        param2: kept(item.param2),
        param3: kept(item.param3),
        param4: kept(item.param4),
        current: 0,
        autocontinue: 1,
        ..item
    })
}

fn check_parameters(item: &Item) -> Result<(), MavMissionResult> {
    // A heading may be left open where one is meant.
    let open_heading = matches!(
        item.command,
        MavCmd::MAV_CMD_NAV_WAYPOINT
            | MavCmd::MAV_CMD_NAV_LAND
            | MavCmd::MAV_CMD_NAV_TAKEOFF
            | MavCmd::MAV_CMD_NAV_VTOL_TAKEOFF
            | MavCmd::MAV_CMD_NAV_VTOL_LAND
    );
    for (value, may_be_open, why) in [
        (item.param1, false, PARAM1),
        (item.param2, false, PARAM2),
        (
            item.param3,
            item.command == MavCmd::MAV_CMD_NAV_VTOL_LAND,
            PARAM3,
        ),
        (item.param4, open_heading, PARAM4),
    ] {
        if value.is_infinite() || (value.is_nan() && !may_be_open) {
            return Err(why);
        }
    }
    Ok(())
}

fn check_place(item: &Item) -> Result<(), MavMissionResult> {
    if item.x.abs() > 900_000_000 {
        return Err(PARAM5);
    }
    if i64::from(item.y).abs() > 1_800_000_000 {
        return Err(PARAM6);
    }
    if item.z.is_nan() || item.z.abs() >= HIGHEST_M {
        return Err(PARAM7);
    }
    Ok(())
}

/// The frame in its older form: ArduPlane tells these; none for a frame that places nothing on
/// Earth.
fn absolute_relative_or_terrain(frame: MavFrame) -> Option<MavFrame> {
    match frame {
        MavFrame::MAV_FRAME_GLOBAL | MavFrame::MAV_FRAME_GLOBAL_INT => {
            Some(MavFrame::MAV_FRAME_GLOBAL)
        }
        MavFrame::MAV_FRAME_GLOBAL_RELATIVE_ALT | MavFrame::MAV_FRAME_GLOBAL_RELATIVE_ALT_INT => {
            Some(MavFrame::MAV_FRAME_GLOBAL_RELATIVE_ALT)
        }
        MavFrame::MAV_FRAME_GLOBAL_TERRAIN_ALT | MavFrame::MAV_FRAME_GLOBAL_TERRAIN_ALT_INT => {
            Some(MavFrame::MAV_FRAME_GLOBAL_TERRAIN_ALT)
        }
        _ => None,
    }
}

fn fence(item: Item) -> Result<Item, MavMissionResult> {
    if absolute_relative_or_terrain(item.frame).is_none() {
        return Err(UNSUPPORTED_FRAME);
    }
    match item.command {
        MavCmd::MAV_CMD_NAV_FENCE_RETURN_POINT
        | MavCmd::MAV_CMD_NAV_FENCE_POLYGON_VERTEX_INCLUSION
        | MavCmd::MAV_CMD_NAV_FENCE_POLYGON_VERTEX_EXCLUSION
        | MavCmd::MAV_CMD_NAV_FENCE_CIRCLE_INCLUSION
        | MavCmd::MAV_CMD_NAV_FENCE_CIRCLE_EXCLUSION => Ok(Item {
            frame: MavFrame::MAV_FRAME_GLOBAL,
            z: 0.0,
            current: 0,
            ..item
        }),
        _ => Err(UNSUPPORTED),
    }
}

fn rally(item: Item) -> Result<Item, MavMissionResult> {
    if item.command != MavCmd::MAV_CMD_NAV_RALLY_POINT {
        return Err(UNSUPPORTED);
    }
    let relative = MavFrame::MAV_FRAME_GLOBAL_RELATIVE_ALT;
    if absolute_relative_or_terrain(item.frame) != Some(relative) {
        return Err(UNSUPPORTED_FRAME);
    }
    check_place(&item)?;
    if !(f32::from(i16::MIN)..=f32::from(i16::MAX)).contains(&item.z) {
        return Err(PARAM7);
    }
    Ok(Item {
        frame: relative,
        // Kept in whole metres.
        z: item.z.trunc(),
        current: 0,
        ..item
    })
}

/// The item of the older message, whose place is in degrees.
///
/// # Errors
/// A place that is none on Earth.
pub(crate) fn whole_degrees(m: &MISSION_ITEM_DATA) -> Result<Item, MavMissionResult> {
    let on_earth = |deg: f32, most: f32, why| {
        if deg.abs() <= most {
            Ok((f64::from(deg) * 1e7).round() as i32)
        } else {
            Err(why)
        }
    };
    Ok(Item {
        param1: m.param1,
        param2: m.param2,
        param3: m.param3,
        param4: m.param4,
        x: on_earth(m.x, 90.0, PARAM5)?,
        y: on_earth(m.y, 180.0, PARAM6)?,
        z: m.z,
        seq: m.seq,
        command: m.command,
        target_system: m.target_system,
        target_component: m.target_component,
        frame: m.frame,
        current: m.current,
        autocontinue: m.autocontinue,
        mission_type: m.mission_type,
    })
}
