//! What is told of a report, message by message.
#![allow(deprecated, reason = "ground stations still send the older forms")]

use super::Speaker;
use crate::report::Report;
use mav_bridge::dialect::{
    AHRS_DATA, AHRS2_DATA, ATTITUDE_DATA, ATTITUDE_QUATERNION_DATA, AUTOPILOT_VERSION_DATA,
    AVAILABLE_MODES_DATA, BATTERY_STATUS_DATA, CURRENT_MODE_DATA, EKF_STATUS_REPORT_DATA,
    EXTENDED_SYS_STATE_DATA, FENCE_STATUS_DATA, GLOBAL_POSITION_INT_DATA, GPS_GLOBAL_ORIGIN_DATA,
    GPS_RAW_INT_DATA, HEARTBEAT_DATA, HOME_POSITION_DATA, HYGROMETER_SENSOR_DATA,
    LOCAL_POSITION_NED_DATA, MEMINFO_DATA, MISSION_CURRENT_DATA, MavModeProperty,
    NAV_CONTROLLER_OUTPUT_DATA, POSITION_TARGET_GLOBAL_INT_DATA, POWER_STATUS_DATA,
    PROTOCOL_VERSION_DATA, RAW_IMU_DATA, RC_CHANNELS_DATA, SERVO_OUTPUT_RAW_DATA, SYS_STATUS_DATA,
    SYSTEM_TIME_DATA, VFR_HUD_DATA, VIBRATION_DATA, WIND_DATA,
};
use mav_bridge::wire::MessageData as _;

impl Speaker {
    /// Sends the message of this number as `report` has it; none for a number that is told by the owner.
    pub(crate) fn tell(&mut self, message_id: u32, which: u32, report: &Report) {
        let now = report.now;
        match message_id {
            HEARTBEAT_DATA::ID => self.send(&report.heartbeat(), now),
            GLOBAL_POSITION_INT_DATA::ID => self.send(&report.position(), now),
            ATTITUDE_DATA::ID => self.send(&report.attitude(), now),
            VFR_HUD_DATA::ID => self.send(&report.hud(), now),
            WIND_DATA::ID => {
                if let Some(wind) = report.wind() {
                    self.send(&wind, now);
                }
            }
            HYGROMETER_SENSOR_DATA::ID => self.send(&report.hygrometer(), now),
            EXTENDED_SYS_STATE_DATA::ID => self.send(&report.landed(), now),
            SYS_STATUS_DATA::ID => self.send(&report.status(), now),
            BATTERY_STATUS_DATA::ID => self.send(&report.battery(), now),
            LOCAL_POSITION_NED_DATA::ID => self.send(&report.local_position(), now),
            ATTITUDE_QUATERNION_DATA::ID => self.send(&report.quaternion(), now),
            GPS_RAW_INT_DATA::ID => self.send(&report.satellites(), now),
            HOME_POSITION_DATA::ID => self.send(&report.home(), now),
            GPS_GLOBAL_ORIGIN_DATA::ID => self.send(&report.origin(), now),
            AUTOPILOT_VERSION_DATA::ID => self.send(&report.version(), now),
            AVAILABLE_MODES_DATA::ID => self.tell_modes(which, report),
            CURRENT_MODE_DATA::ID => self.send(&report.current_mode(), now),
            PROTOCOL_VERSION_DATA::ID => self.send(&report.protocol_version(), now),
            MISSION_CURRENT_DATA::ID => self.send(&report.mission_current, now),
            _ => self.tell_inside(message_id, report),
        }
    }

    /// Sends a message that tells of its inside.
    fn tell_inside(&mut self, message_id: u32, report: &Report) {
        let now = report.now;
        match message_id {
            SYSTEM_TIME_DATA::ID => self.send(&report.system_time(), now),
            RC_CHANNELS_DATA::ID => self.send(&report.rc_channels(), now),
            SERVO_OUTPUT_RAW_DATA::ID => self.send(&report.servos(), now),
            RAW_IMU_DATA::ID => self.send(&report.raw_imu(), now),
            NAV_CONTROLLER_OUTPUT_DATA::ID => self.send(&report.navigation(), now),
            POSITION_TARGET_GLOBAL_INT_DATA::ID => {
                if let Some(target) = report.position_target() {
                    self.send(&target, now);
                }
            }
            FENCE_STATUS_DATA::ID => {
                if let Some(status) = &report.fence_status {
                    self.send(status, now);
                }
            }
            POWER_STATUS_DATA::ID => self.send(&report.power(), now),
            MEMINFO_DATA::ID => self.send(&report.memory(), now),
            EKF_STATUS_REPORT_DATA::ID => self.send(&report.filter_status(), now),
            VIBRATION_DATA::ID => self.send(&report.vibration(), now),
            AHRS_DATA::ID => self.send(&report.attitude_filter(), now),
            AHRS2_DATA::ID => self.send(&report.second_attitude(), now),
            _ => {}
        }
    }

    /// Tells one of the modes that it has, counted from 1; with 0 all of them.
    fn tell_modes(&mut self, wanted: u32, report: &Report) {
        for (index, &(custom_mode, name)) in (1..).zip(self.firmware.modes) {
            if wanted != 0 && wanted != index {
                continue;
            }
            let mode = AVAILABLE_MODES_DATA {
                custom_mode,
                properties: MavModeProperty::empty(),
                number_modes: self.firmware.modes.len() as u8,
                mode_index: index as u8,
                mode_name: name.into(),
                ..AVAILABLE_MODES_DATA::default()
            };
            self.send(&mode, report.now);
        }
    }
}
