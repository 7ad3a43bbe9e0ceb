//! The messages that are sent by themselves, and how often.
#![allow(deprecated, reason = "ground stations still send the older forms")]

use mav_bridge::dialect::{
    AHRS_DATA, AHRS2_DATA, ATTITUDE_DATA, ATTITUDE_QUATERNION_DATA, AUTOPILOT_VERSION_DATA,
    AVAILABLE_MODES_DATA, BATTERY_STATUS_DATA, CURRENT_MODE_DATA, EKF_STATUS_REPORT_DATA,
    EXTENDED_SYS_STATE_DATA, FENCE_STATUS_DATA, GLOBAL_POSITION_INT_DATA, GPS_GLOBAL_ORIGIN_DATA,
    GPS_RAW_INT_DATA, HEARTBEAT_DATA, HOME_POSITION_DATA, HYGROMETER_SENSOR_DATA,
    LOCAL_POSITION_NED_DATA, MEMINFO_DATA, MISSION_CURRENT_DATA, MavDataStream,
    NAMED_VALUE_FLOAT_DATA, NAV_CONTROLLER_OUTPUT_DATA, POSITION_TARGET_GLOBAL_INT_DATA,
    POWER_STATUS_DATA, PROTOCOL_VERSION_DATA, RAW_IMU_DATA, RC_CHANNELS_DATA, SCALED_PRESSURE_DATA,
    SERVO_OUTPUT_RAW_DATA, SYS_STATUS_DATA, SYSTEM_TIME_DATA, VFR_HUD_DATA, VIBRATION_DATA,
    WIND_DATA,
};
use mav_bridge::wire::MessageData as _;

/// One message and when it is next due.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Stream {
    pub message_id: u32,
    /// 0: not sent.
    pub interval_ns: i64,
    pub due_ns: i64,
    /// The group that REQUEST_DATA_STREAM knows it by.
    pub group: Option<MavDataStream>,
}

use MavDataStream::{
    MAV_DATA_STREAM_EXTENDED_STATUS as STATUS, MAV_DATA_STREAM_EXTRA1 as EXTRA1,
    MAV_DATA_STREAM_EXTRA2 as EXTRA2, MAV_DATA_STREAM_EXTRA3 as EXTRA3,
    MAV_DATA_STREAM_POSITION as POSITION, MAV_DATA_STREAM_RAW_SENSORS as SENSORS,
    MAV_DATA_STREAM_RC_CHANNELS as CHANNELS,
};

/// The streams of a vehicle of which there is only what the bus tells.
pub(crate) fn team_streams() -> Vec<Stream> {
    // Of its inside, sensors, servos and filter, the bus tells nothing.
    let inside = [
        SCALED_PRESSURE_DATA::ID,
        HYGROMETER_SENSOR_DATA::ID,
        RC_CHANNELS_DATA::ID,
        SERVO_OUTPUT_RAW_DATA::ID,
        RAW_IMU_DATA::ID,
        NAV_CONTROLLER_OUTPUT_DATA::ID,
        POSITION_TARGET_GLOBAL_INT_DATA::ID,
        FENCE_STATUS_DATA::ID,
        POWER_STATUS_DATA::ID,
        MEMINFO_DATA::ID,
        EKF_STATUS_REPORT_DATA::ID,
        VIBRATION_DATA::ID,
        AHRS_DATA::ID,
        AHRS2_DATA::ID,
    ];
    let mut streams = default_streams();
    streams.retain(|stream| !inside.contains(&stream.message_id));
    streams
}

/// The streams before anybody asks for other rates; those of 0 Hz are sent on request only. The
/// order is that within one tick: a gas reading follows the position at which it was taken.
pub(crate) fn default_streams() -> Vec<Stream> {
    [
        (HEARTBEAT_DATA::ID, 1.0, None),
        (GLOBAL_POSITION_INT_DATA::ID, 4.0, Some(POSITION)),
        (LOCAL_POSITION_NED_DATA::ID, 1.0, Some(POSITION)),
        (ATTITUDE_DATA::ID, 4.0, Some(EXTRA1)),
        (ATTITUDE_QUATERNION_DATA::ID, 0.0, None),
        (VFR_HUD_DATA::ID, 4.0, Some(EXTRA2)),
        (NAMED_VALUE_FLOAT_DATA::ID, 10.0, None),
        (WIND_DATA::ID, 1.0, Some(EXTRA3)),
        (SCALED_PRESSURE_DATA::ID, 1.0, Some(SENSORS)),
        (HYGROMETER_SENSOR_DATA::ID, 1.0, Some(EXTRA3)),
        (GPS_RAW_INT_DATA::ID, 1.0, Some(STATUS)),
        (EXTENDED_SYS_STATE_DATA::ID, 1.0, None),
        (SYS_STATUS_DATA::ID, 1.0, Some(STATUS)),
        (BATTERY_STATUS_DATA::ID, 1.0, Some(EXTRA3)),
        (SYSTEM_TIME_DATA::ID, 1.0, Some(EXTRA3)),
        (RC_CHANNELS_DATA::ID, 1.0, Some(CHANNELS)),
        (SERVO_OUTPUT_RAW_DATA::ID, 1.0, Some(CHANNELS)),
        (RAW_IMU_DATA::ID, 1.0, Some(SENSORS)),
        (NAV_CONTROLLER_OUTPUT_DATA::ID, 1.0, Some(STATUS)),
        (MISSION_CURRENT_DATA::ID, 1.0, Some(STATUS)),
        (POSITION_TARGET_GLOBAL_INT_DATA::ID, 1.0, Some(STATUS)),
        (FENCE_STATUS_DATA::ID, 1.0, Some(STATUS)),
        (POWER_STATUS_DATA::ID, 1.0, Some(STATUS)),
        (MEMINFO_DATA::ID, 1.0, Some(STATUS)),
        (EKF_STATUS_REPORT_DATA::ID, 1.0, Some(EXTRA3)),
        (VIBRATION_DATA::ID, 1.0, Some(EXTRA3)),
        (AHRS_DATA::ID, 1.0, Some(EXTRA3)),
        (AHRS2_DATA::ID, 1.0, Some(EXTRA1)),
        (HOME_POSITION_DATA::ID, 0.2, None),
        (AVAILABLE_MODES_DATA::ID, 0.0, None),
        (CURRENT_MODE_DATA::ID, 0.0, None),
        (PROTOCOL_VERSION_DATA::ID, 0.0, None),
        (GPS_GLOBAL_ORIGIN_DATA::ID, 0.0, None),
        (AUTOPILOT_VERSION_DATA::ID, 0.0, None),
    ]
    .map(|(message_id, hz, group): (u32, f64, _)| Stream {
        message_id,
        interval_ns: if hz > 0.0 { (1e9 / hz) as i64 } else { 0 },
        due_ns: 0,
        group,
    })
    .to_vec()
}
