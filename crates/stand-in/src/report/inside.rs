//! Messages of what goes on inside: sensors, servos, filter, navigation, modes.
#![allow(deprecated, reason = "ground stations still send the older forms")]

use super::{Report, boot_ms, millimetres};
use air::geo::{wrap_deg, wrap_signed_deg};
use mav_bridge::dialect::{
    AHRS_DATA, AHRS2_DATA, CURRENT_MODE_DATA, EKF_STATUS_REPORT_DATA, EkfStatusFlags, MEMINFO_DATA,
    MavFrame, MavPowerStatus, NAV_CONTROLLER_OUTPUT_DATA, POSITION_TARGET_GLOBAL_INT_DATA,
    POWER_STATUS_DATA, PROTOCOL_VERSION_DATA, PositionTargetTypemask, RAW_IMU_DATA,
    RC_CHANNELS_DATA, SERVO_OUTPUT_RAW_DATA, SYSTEM_TIME_DATA, VIBRATION_DATA,
};
use protocol::SimTime;

/// Middle and half range of a servo's or stick's pulse, µs.
const PULSE_US: (f64, f64) = (1500.0, 500.0);
/// Deflection of an elevon at the end of its pulse, rad.
const ELEVON_END_RAD: f64 = 0.61;
/// Unit of the accelerometers: a thousandth of standard gravity, m/s².
const MILLI_G_M_S2: f64 = air::STANDARD_GRAVITY_M_S2 / 1000.0;
/// Magnetic field towards north and down in Galicia, mGauss; its declination is left out.
const FIELD_MGAUSS: [f64; 3] = [240.0, 0.0, 380.0];
/// Highest bytes of free memory that the message can tell.
const FREE_MEMORY: u16 = u16::MAX;
/// Versions of MAVLink that are spoken, times 100: the second alone.
const MAVLINK_2: u16 = 200;

fn pulse_us(share: f64) -> u16 {
    (PULSE_US.0 + PULSE_US.1 * share.clamp(-1.0, 1.0)).round() as u16
}

/// Throttle, 0 to 1, as a pulse, µs.
fn throttle_us(throttle: f64) -> u16 {
    pulse_us(2.0 * throttle - 1.0)
}

fn boot_us(now: SimTime) -> u64 {
    u64::from(boot_ms(now.s())) * 1000
}

impl Report {
    /// No receiver tells it the date: the time since it was switched on alone.
    pub(crate) fn system_time(&self) -> SYSTEM_TIME_DATA {
        SYSTEM_TIME_DATA {
            time_unix_usec: 0,
            time_boot_ms: boot_ms(self.now.s()),
        }
    }

    pub(crate) fn rc_channels(&self) -> RC_CHANNELS_DATA {
        let sticks = self.sticks;
        let unused = u16::MAX;
        RC_CHANNELS_DATA {
            time_boot_ms: boot_ms(self.now.s()),
            chan1_raw: pulse_us(sticks.roll),
            chan2_raw: pulse_us(sticks.pitch),
            chan3_raw: throttle_us(sticks.throttle),
            chan4_raw: pulse_us(0.0),
            chan5_raw: pulse_us(0.0),
            chan6_raw: pulse_us(0.0),
            chan7_raw: pulse_us(0.0),
            chan8_raw: pulse_us(0.0),
            chan9_raw: unused,
            chan10_raw: unused,
            chan11_raw: unused,
            chan12_raw: unused,
            chan13_raw: unused,
            chan14_raw: unused,
            chan15_raw: unused,
            chan16_raw: unused,
            chan17_raw: unused,
            chan18_raw: unused,
            chancount: 8,
            rssi: u8::MAX,
        }
    }

    /// Elevons left and right on outputs 1 and 2, the motor on 3.
    pub(crate) fn servos(&self) -> SERVO_OUTPUT_RAW_DATA {
        let state = self.state;
        let elevon = |rad: f64| pulse_us(rad / ELEVON_END_RAD);
        SERVO_OUTPUT_RAW_DATA {
            time_usec: boot_us(self.now) as u32,
            servo1_raw: elevon(state.elevator_rad + state.aileron_rad),
            servo2_raw: elevon(state.elevator_rad - state.aileron_rad),
            servo3_raw: throttle_us(state.throttle),
            ..SERVO_OUTPUT_RAW_DATA::default()
        }
    }

    pub(crate) fn navigation(&self) -> NAV_CONTROLLER_OUTPUT_DATA {
        let guidance = self.guidance;
        let here = self.here;
        let target = guidance.target.unwrap_or(here);
        let bearing_deg = here.at.bearing_deg(target.at);
        let tas_m_s = self.sensed.airspeed_m_s;
        let whole = |deg: f64| wrap_signed_deg(deg).round() as i16;
        NAV_CONTROLLER_OUTPUT_DATA {
            nav_roll: guidance.bank_rad.to_degrees() as f32,
            nav_pitch: guidance.pitch_rad.to_degrees() as f32,
            alt_error: (target.alt_amsl_m - here.alt_amsl_m) as f32,
            aspd_error: ((guidance.airspeed_m_s - tas_m_s) * self.eas_over_tas) as f32,
            xtrack_error: guidance.across_m as f32,
            nav_bearing: whole(bearing_deg),
            target_bearing: whole(bearing_deg),
            wp_dist: here.at.distance_m(target.at).min(f64::from(u16::MAX)) as u16,
        }
    }

    /// Where it flies to; none where it flies to no place.
    pub(crate) fn position_target(&self) -> Option<POSITION_TARGET_GLOBAL_INT_DATA> {
        let target = self.guidance.target?;
        let (lat_int, lon_int) = self.degrees_1e7(target.at);
        let place = PositionTargetTypemask::POSITION_TARGET_TYPEMASK_X_IGNORE
            | PositionTargetTypemask::POSITION_TARGET_TYPEMASK_Y_IGNORE
            | PositionTargetTypemask::POSITION_TARGET_TYPEMASK_Z_IGNORE
            | PositionTargetTypemask::POSITION_TARGET_TYPEMASK_FORCE_SET;
        Some(POSITION_TARGET_GLOBAL_INT_DATA {
            time_boot_ms: boot_ms(self.now.s()),
            lat_int,
            lon_int,
            alt: target.alt_amsl_m as f32,
            type_mask: PositionTargetTypemask::all() - place,
            coordinate_frame: MavFrame::MAV_FRAME_GLOBAL,
            ..POSITION_TARGET_GLOBAL_INT_DATA::default()
        })
    }

    /// An airframe without vibration, whose accelerometers never reach their end.
    pub(crate) fn vibration(&self) -> VIBRATION_DATA {
        VIBRATION_DATA {
            time_usec: boot_us(self.now),
            ..VIBRATION_DATA::default()
        }
    }

    /// A filter that is content with its sensors, above the ground or on it.
    pub(crate) fn filter_status(&self) -> EKF_STATUS_REPORT_DATA {
        let content = 0.05;
        EKF_STATUS_REPORT_DATA {
            velocity_variance: content,
            pos_horiz_variance: content,
            pos_vert_variance: content,
            compass_variance: content,
            flags: EkfStatusFlags::EKF_ATTITUDE
                | EkfStatusFlags::EKF_VELOCITY_HORIZ
                | EkfStatusFlags::EKF_VELOCITY_VERT
                | EkfStatusFlags::EKF_POS_HORIZ_REL
                | EkfStatusFlags::EKF_POS_HORIZ_ABS
                | EkfStatusFlags::EKF_POS_VERT_ABS
                | EkfStatusFlags::EKF_PRED_POS_HORIZ_REL
                | EkfStatusFlags::EKF_PRED_POS_HORIZ_ABS,
            ..EKF_STATUS_REPORT_DATA::default()
        }
    }

    pub(crate) fn raw_imu(&self) -> RAW_IMU_DATA {
        let state = self.state;
        let acc = state.specific_force_m_s2.map(|f| (f / MILLI_G_M_S2) as i16);
        let gyro = state.rate_rad_s.map(|rate| (rate * 1000.0) as i16);
        let mag = in_body(state.attitude, FIELD_MGAUSS).map(|field| field as i16);
        RAW_IMU_DATA {
            time_usec: boot_us(self.now),
            xacc: acc[0],
            yacc: acc[1],
            zacc: acc[2],
            xgyro: gyro[0],
            ygyro: gyro[1],
            zgyro: gyro[2],
            xmag: mag[0],
            ymag: mag[1],
            zmag: mag[2],
            ..RAW_IMU_DATA::default()
        }
    }

    pub(crate) fn power(&self) -> POWER_STATUS_DATA {
        POWER_STATUS_DATA {
            Vcc: 5000,
            Vservo: 5000,
            flags: MavPowerStatus::MAV_POWER_STATUS_BRICK_VALID
                | MavPowerStatus::MAV_POWER_STATUS_SERVO_VALID,
        }
    }

    pub(crate) fn memory(&self) -> MEMINFO_DATA {
        MEMINFO_DATA {
            freemem: FREE_MEMORY,
            freemem32: u32::from(FREE_MEMORY),
            ..MEMINFO_DATA::default()
        }
    }

    /// A filter whose gyroscopes have no bias.
    pub(crate) fn attitude_filter(&self) -> AHRS_DATA {
        AHRS_DATA::default()
    }

    pub(crate) fn second_attitude(&self) -> AHRS2_DATA {
        let sensed = self.sensed;
        let (at, alt_amsl_m) = self.reported;
        let (lat, lng) = self.degrees_1e7(at);
        AHRS2_DATA {
            roll: sensed.roll_rad as f32,
            pitch: sensed.pitch_rad as f32,
            yaw: wrap_deg(sensed.yaw_rad.to_degrees()).to_radians() as f32,
            altitude: (f64::from(millimetres(alt_amsl_m)) / 1000.0) as f32,
            lat,
            lng,
        }
    }

    pub(crate) fn protocol_version(&self) -> PROTOCOL_VERSION_DATA {
        PROTOCOL_VERSION_DATA {
            version: MAVLINK_2,
            min_version: MAVLINK_2,
            max_version: MAVLINK_2,
            ..PROTOCOL_VERSION_DATA::default()
        }
    }

    pub(crate) fn current_mode(&self) -> CURRENT_MODE_DATA {
        let mode = self.firmware.on_wire(self.mode);
        CURRENT_MODE_DATA {
            custom_mode: mode,
            intended_custom_mode: mode,
            ..CURRENT_MODE_DATA::default()
        }
    }
}

/// A vector of north, east and down in body axes, by the attitude quaternion (body to NED).
fn in_body([w, x, y, z]: [f64; 4], [n, e, d]: [f64; 3]) -> [f64; 3] {
    [
        (1.0 - 2.0 * (y * y + z * z)) * n + 2.0 * (x * y + w * z) * e + 2.0 * (x * z - w * y) * d,
        2.0 * (x * y - w * z) * n + (1.0 - 2.0 * (x * x + z * z)) * e + 2.0 * (y * z + w * x) * d,
        2.0 * (x * z + w * y) * n + 2.0 * (y * z - w * x) * e + (1.0 - 2.0 * (x * x + y * y)) * d,
    ]
}
