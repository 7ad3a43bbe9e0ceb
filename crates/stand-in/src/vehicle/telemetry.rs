//! What the stand-in sends: its streams, at the rates it was asked for, and what each message
//! carries.
#![allow(deprecated, reason = "ground stations still send the older forms")]

use super::StandIn;
use crate::flight::is_manual;
use crate::parameters::AutopilotParameters;
use crate::reality::HUMIDITY_PCT;
use air::geo::{Enu, wrap_deg};
use air::isa::ZERO_CELSIUS_K;
use air::wind::from_deg;
use mav_bridge::arduplane::MANUAL;
use mav_bridge::dialect::{
    AHRS_DATA, AHRS2_DATA, ATTITUDE_DATA, ATTITUDE_QUATERNION_DATA, AUTOPILOT_VERSION_DATA,
    AVAILABLE_MODES_DATA, BATTERY_STATUS_DATA, CURRENT_MODE_DATA, EKF_STATUS_REPORT_DATA,
    EXTENDED_SYS_STATE_DATA, FENCE_STATUS_DATA, GLOBAL_POSITION_INT_DATA, GPS_GLOBAL_ORIGIN_DATA,
    GPS_RAW_INT_DATA, GpsFixType, HEARTBEAT_DATA, HOME_POSITION_DATA, HYGROMETER_SENSOR_DATA,
    LOCAL_POSITION_NED_DATA, MEMINFO_DATA, MISSION_CURRENT_DATA, MavAutopilot, MavBatteryFault,
    MavDataStream, MavLandedState, MavModeFlag, MavProtocolCapability, MavSeverity, MavState,
    MavSysStatusSensor, MavSysStatusSensorExtended, MavType, NAMED_VALUE_FLOAT_DATA,
    NAV_CONTROLLER_OUTPUT_DATA, PARAM_VALUE_DATA, POSITION_TARGET_GLOBAL_INT_DATA,
    POWER_STATUS_DATA, PROTOCOL_VERSION_DATA, RAW_IMU_DATA, RC_CHANNELS_DATA, SCALED_PRESSURE_DATA,
    SERVO_OUTPUT_RAW_DATA, STATUSTEXT_DATA, SYS_STATUS_DATA, SYSTEM_TIME_DATA, VFR_HUD_DATA,
    VIBRATION_DATA, WIND_DATA,
};
use mav_bridge::wire::MessageData;
use protocol::SimTime;
use rand_distr::{Distribution, StandardNormal};

/// An autopilot's barometer is warmer than the air by this much, °C.
const CASE_WARMTH_C: f64 = 12.0;
/// Noise of the barometer, hPa.
const PRESSURE_SD_HPA: f64 = 0.05;
/// Flight time of a full battery at cruise, s.
const BATTERY_S: f64 = 5400.0;
/// Dilution of precision under an open sky, times 100.
const HDOP_1E2: u16 = 80;
const SATELLITES: u8 = 14;
/// Major, minor and patch number of the ArduPlane that it emulates; the last byte marks that it is
/// no release.
const EMULATED_VERSION: [u8; 4] = [4, 8, 0, 0];

impl StandIn {
    pub(crate) fn send<D: MessageData>(&mut self, message: &D, now: SimTime) {
        let frame = self.encoder.encode(message, self.signing.as_mut(), now);
        self.out.push(frame);
    }

    /// Sends the streams that are due.
    pub(crate) fn send_due(&mut self, now: SimTime) {
        for k in 0..self.streams.len() {
            let stream = self.streams[k];
            if stream.interval_ns <= 0 || now.ns() < stream.due_ns {
                continue;
            }
            let next = stream.due_ns + stream.interval_ns;
            // After a pause the missed ones are left out.
            self.streams[k].due_ns = if next > now.ns() {
                next
            } else {
                now.ns() + stream.interval_ns
            };
            self.send_stream(stream.message_id, now);
        }
        for (message_id, which) in std::mem::take(&mut self.requested) {
            if message_id == AVAILABLE_MODES_DATA::ID {
                self.send_modes(which, now);
            } else {
                self.send_stream(message_id, now);
            }
        }
    }

    /// Sends a group of streams at another rate; 0 stops them. Faster than 50 Hz is not to be had.
    pub(crate) fn change_group(&mut self, group: MavDataStream, hz: u16, now: SimTime) {
        for stream in &mut self.streams {
            if stream.group.is_some()
                && (group == MavDataStream::MAV_DATA_STREAM_ALL || stream.group == Some(group))
            {
                stream.interval_ns = match hz.min(50) {
                    0 => 0,
                    hz => 1_000_000_000 / i64::from(hz),
                };
                stream.due_ns = now.ns();
            }
        }
    }

    fn send_stream(&mut self, message_id: u32, now: SimTime) {
        match message_id {
            HEARTBEAT_DATA::ID => self.send(&self.heartbeat(), now),
            GLOBAL_POSITION_INT_DATA::ID => self.send(&self.position(now), now),
            ATTITUDE_DATA::ID => self.send(&self.attitude(now), now),
            VFR_HUD_DATA::ID => self.send(&self.hud(), now),
            NAMED_VALUE_FLOAT_DATA::ID => {
                let gas = self.gas(now);
                self.send(&gas, now);
            }
            WIND_DATA::ID => {
                if let Some(wind) = self.wind() {
                    self.send(&wind, now);
                }
            }
            SCALED_PRESSURE_DATA::ID => {
                let pressure = self.pressure(now);
                self.send(&pressure, now);
            }
            HYGROMETER_SENSOR_DATA::ID => self.send(&self.hygrometer(), now),
            EXTENDED_SYS_STATE_DATA::ID => self.send(&self.landed(), now),
            SYS_STATUS_DATA::ID => self.send(&self.status(), now),
            BATTERY_STATUS_DATA::ID => self.send(&self.battery(), now),
            LOCAL_POSITION_NED_DATA::ID => self.send(&self.local_position(now), now),
            ATTITUDE_QUATERNION_DATA::ID => self.send(&self.quaternion(now), now),
            GPS_RAW_INT_DATA::ID => self.send(&self.satellites(now), now),
            HOME_POSITION_DATA::ID => self.send(&self.home(), now),
            GPS_GLOBAL_ORIGIN_DATA::ID => self.send(&self.origin(), now),
            AUTOPILOT_VERSION_DATA::ID => self.send(&self.version(), now),
            AVAILABLE_MODES_DATA::ID => self.send_modes(0, now),
            CURRENT_MODE_DATA::ID => self.send(&self.current_mode(), now),
            PROTOCOL_VERSION_DATA::ID => self.send(&self.protocol_version(), now),
            MISSION_CURRENT_DATA::ID => self.send(&self.mission_current(), now),
            _ => self.send_status(message_id, now),
        }
    }

    /// Sends a message that tells of its inside.
    fn send_status(&mut self, message_id: u32, now: SimTime) {
        match message_id {
            SYSTEM_TIME_DATA::ID => self.send(&self.system_time(now), now),
            RC_CHANNELS_DATA::ID => self.send(&self.rc_channels(now), now),
            SERVO_OUTPUT_RAW_DATA::ID => self.send(&self.servos(now), now),
            RAW_IMU_DATA::ID => self.send(&self.raw_imu(now), now),
            NAV_CONTROLLER_OUTPUT_DATA::ID => self.send(&self.navigation(), now),
            POSITION_TARGET_GLOBAL_INT_DATA::ID => {
                if let Some(target) = self.position_target(now) {
                    self.send(&target, now);
                }
            }
            FENCE_STATUS_DATA::ID => {
                if let Some(status) = self.fence_status() {
                    self.send(&status, now);
                }
            }
            POWER_STATUS_DATA::ID => self.send(&self.power(), now),
            MEMINFO_DATA::ID => self.send(&self.memory(), now),
            EKF_STATUS_REPORT_DATA::ID => self.send(&self.filter_status(), now),
            VIBRATION_DATA::ID => self.send(&self.vibration(now), now),
            AHRS_DATA::ID => self.send(&self.attitude_filter(), now),
            AHRS2_DATA::ID => self.send(&self.second_attitude(now), now),
            _ => {}
        }
    }

    fn heartbeat(&self) -> HEARTBEAT_DATA {
        let mode = self.flight.mode();
        // Sticks are mixed in in every mode, as is ArduPlane's default.
        let mut base_mode = MavModeFlag::MAV_MODE_FLAG_CUSTOM_MODE_ENABLED
            | MavModeFlag::MAV_MODE_FLAG_MANUAL_INPUT_ENABLED;
        if mode != MANUAL {
            base_mode |= MavModeFlag::MAV_MODE_FLAG_STABILIZE_ENABLED;
        }
        if !is_manual(mode) {
            base_mode |= MavModeFlag::MAV_MODE_FLAG_GUIDED_ENABLED;
        }
        if self.flight.armed() {
            base_mode |= MavModeFlag::MAV_MODE_FLAG_SAFETY_ARMED;
        }
        let system_status = if self.failsafe {
            MavState::MAV_STATE_CRITICAL
        } else if self.flight.flying() {
            MavState::MAV_STATE_ACTIVE
        } else {
            MavState::MAV_STATE_STANDBY
        };
        HEARTBEAT_DATA {
            custom_mode: mode,
            mavtype: MavType::MAV_TYPE_FIXED_WING,
            autopilot: MavAutopilot::MAV_AUTOPILOT_ARDUPILOTMEGA,
            base_mode,
            system_status,
            mavlink_version: 3,
        }
    }

    /// The position that it reports: place and altitude above mean sea level, m.
    pub(super) fn reported_position(&self, now: SimTime) -> (Enu, f64) {
        let sensed = self.flight.sensed();
        let ground_amsl_m = self.reality.model.spec().ground_amsl_m;
        let reported_position = plume::Place {
            east_m: sensed.east_m,
            north_m: sensed.north_m,
            height_agl_m: sensed.alt_amsl_m - ground_amsl_m,
        };
        let (logged, _) = self.reality.logged(&reported_position, now.s());
        let at = Enu {
            east_m: logged.east_m,
            north_m: logged.north_m,
        };
        (at, ground_amsl_m + logged.height_agl_m)
    }

    fn position(&self, now: SimTime) -> GLOBAL_POSITION_INT_DATA {
        let sensed = self.flight.sensed();
        let (at, alt_amsl_m) = self.reported_position(now);
        let (lat, lon) = self.degrees_1e7(at);
        let [vx, vy, vz] = sensed.vel_ned_m_s.map(|v| (v * 100.0).round() as i16);
        GLOBAL_POSITION_INT_DATA {
            time_boot_ms: boot_ms(now.s()),
            lat,
            lon,
            alt: millimetres(alt_amsl_m),
            relative_alt: millimetres(alt_amsl_m - self.flight.home().ground_amsl_m),
            vx,
            vy,
            vz,
            hdg: (wrap_deg(sensed.yaw_rad.to_degrees()) * 100.0) as u16,
        }
    }

    /// Relative to the filter's origin.
    fn local_position(&self, now: SimTime) -> LOCAL_POSITION_NED_DATA {
        let (at, alt_amsl_m) = self.reported_position(now);
        let origin = self.origin;
        let [vx, vy, vz] = self.flight.sensed().vel_ned_m_s.map(|v| v as f32);
        LOCAL_POSITION_NED_DATA {
            time_boot_ms: boot_ms(now.s()),
            x: (at.north_m - origin.at.north_m) as f32,
            y: (at.east_m - origin.at.east_m) as f32,
            z: (origin.ground_amsl_m - alt_amsl_m) as f32,
            vx,
            vy,
            vz,
        }
    }

    fn satellites(&self, now: SimTime) -> GPS_RAW_INT_DATA {
        let (at, alt_amsl_m) = self.reported_position(now);
        let (lat, lon) = self.degrees_1e7(at);
        let [north, east, _] = self.flight.sensed().vel_ned_m_s;
        GPS_RAW_INT_DATA {
            time_usec: u64::from(boot_ms(now.s())) * 1000,
            lat,
            lon,
            alt: millimetres(alt_amsl_m),
            eph: HDOP_1E2,
            epv: HDOP_1E2,
            vel: (north.hypot(east) * 100.0).round() as u16,
            cog: (wrap_deg(east.atan2(north).to_degrees()) * 100.0) as u16,
            fix_type: GpsFixType::GPS_FIX_TYPE_3D_FIX,
            satellites_visible: SATELLITES,
            ..GPS_RAW_INT_DATA::default()
        }
    }

    pub(super) fn degrees_1e7(&self, at: Enu) -> (i32, i32) {
        let at = self.reality.frame.to_geodetic(at);
        let whole = |deg: f64| (deg * 1e7).round() as i32;
        (whole(at.lat_deg), whole(at.lon_deg))
    }

    pub(super) fn home(&self) -> HOME_POSITION_DATA {
        let home = self.flight.home();
        let (latitude, longitude) = self.degrees_1e7(home.at);
        HOME_POSITION_DATA {
            latitude,
            longitude,
            altitude: millimetres(home.ground_amsl_m),
            q: [1.0, 0.0, 0.0, 0.0],
            ..HOME_POSITION_DATA::default()
        }
    }

    fn origin(&self) -> GPS_GLOBAL_ORIGIN_DATA {
        let (latitude, longitude) = self.degrees_1e7(self.origin.at);
        GPS_GLOBAL_ORIGIN_DATA {
            latitude,
            longitude,
            altitude: millimetres(self.origin.ground_amsl_m),
            ..GPS_GLOBAL_ORIGIN_DATA::default()
        }
    }

    fn version(&self) -> AUTOPILOT_VERSION_DATA {
        AUTOPILOT_VERSION_DATA {
            capabilities: MavProtocolCapability::MAV_PROTOCOL_CAPABILITY_MISSION_FLOAT
                | MavProtocolCapability::MAV_PROTOCOL_CAPABILITY_PARAM_FLOAT
                | MavProtocolCapability::MAV_PROTOCOL_CAPABILITY_PARAM_ENCODE_C_CAST
                | MavProtocolCapability::MAV_PROTOCOL_CAPABILITY_MISSION_INT
                | MavProtocolCapability::MAV_PROTOCOL_CAPABILITY_MISSION_FENCE
                | MavProtocolCapability::MAV_PROTOCOL_CAPABILITY_MISSION_RALLY
                | MavProtocolCapability::MAV_PROTOCOL_CAPABILITY_COMMAND_INT
                | MavProtocolCapability::MAV_PROTOCOL_CAPABILITY_SET_POSITION_TARGET_GLOBAL_INT
                | MavProtocolCapability::MAV_PROTOCOL_CAPABILITY_MAVLINK2,
            uid: u64::from(self.system_id),
            flight_sw_version: u32::from_be_bytes(EMULATED_VERSION),
            ..AUTOPILOT_VERSION_DATA::default()
        }
    }

    fn attitude(&self, now: SimTime) -> ATTITUDE_DATA {
        let sensed = self.flight.sensed();
        let [p, q, r] = sensed.rate_rad_s.map(|rate| rate as f32);
        ATTITUDE_DATA {
            time_boot_ms: boot_ms(now.s()),
            roll: sensed.roll_rad as f32,
            pitch: sensed.pitch_rad as f32,
            yaw: sensed.yaw_rad as f32,
            rollspeed: p,
            pitchspeed: q,
            yawspeed: r,
        }
    }

    fn quaternion(&self, now: SimTime) -> ATTITUDE_QUATERNION_DATA {
        let sensed = self.flight.sensed();
        let attitude = fdm::quaternion(sensed.roll_rad, sensed.pitch_rad, sensed.yaw_rad);
        let [q1, q2, q3, q4] = attitude.map(|part| part as f32);
        let [rollspeed, pitchspeed, yawspeed] = sensed.rate_rad_s.map(|rate| rate as f32);
        ATTITUDE_QUATERNION_DATA {
            time_boot_ms: boot_ms(now.s()),
            q1,
            q2,
            q3,
            q4,
            rollspeed,
            pitchspeed,
            yawspeed,
            ..ATTITUDE_QUATERNION_DATA::default()
        }
    }

    fn hud(&self) -> VFR_HUD_DATA {
        let sensed = self.flight.sensed();
        let [north, east, down] = sensed.vel_ned_m_s;
        VFR_HUD_DATA {
            airspeed: (sensed.airspeed_m_s * self.reality.eas_over_tas()) as f32,
            groundspeed: north.hypot(east) as f32,
            alt: sensed.alt_amsl_m as f32,
            climb: -down as f32,
            heading: wrap_deg(sensed.yaw_rad.to_degrees()) as i16,
            throttle: (self.flight.state().throttle * 100.0).round() as u16,
        }
    }

    fn gas(&mut self, now: SimTime) -> NAMED_VALUE_FLOAT_DATA {
        let dt_s = self.gas_sampled_at.map_or(0.0, |at| now.since_s(at));
        self.gas_sampled_at = Some(now);
        let state = self.flight.state();
        let ppm = self.reality.read_gas(&state, now.s(), dt_s, &mut self.rng);
        let (_, time_s) = self.reality.logged(&plume::Place::default(), now.s());
        NAMED_VALUE_FLOAT_DATA {
            time_boot_ms: boot_ms(time_s),
            value: ppm as f32,
            name: self.reality.gas().formula().into(),
        }
    }

    fn wind(&self) -> Option<WIND_DATA> {
        let [north, east] = self.flight.wind_m_s()?;
        Some(WIND_DATA {
            direction: from_deg(east, north) as f32,
            speed: north.hypot(east) as f32,
            speed_z: 0.0,
        })
    }

    fn pressure(&mut self, now: SimTime) -> SCALED_PRESSURE_DATA {
        let air = self.reality.air();
        let white: f64 = StandardNormal.sample(&mut self.rng);
        let v = self.flight.sensed().airspeed_m_s;
        SCALED_PRESSURE_DATA {
            time_boot_ms: boot_ms(now.s()),
            press_abs: (air.pressure_pa / 100.0 + PRESSURE_SD_HPA * white) as f32,
            press_diff: (0.5 * air.density_kg_m3() * v * v / 100.0) as f32,
            temperature: centi_celsius(air.temperature_k + CASE_WARMTH_C),
            ..SCALED_PRESSURE_DATA::default()
        }
    }

    fn hygrometer(&self) -> HYGROMETER_SENSOR_DATA {
        HYGROMETER_SENSOR_DATA {
            temperature: centi_celsius(self.reality.air().temperature_k),
            humidity: (HUMIDITY_PCT * 100.0) as u16,
            id: 0,
        }
    }

    fn landed(&self) -> EXTENDED_SYS_STATE_DATA {
        EXTENDED_SYS_STATE_DATA {
            landed_state: self.landed_state(),
            ..EXTENDED_SYS_STATE_DATA::default()
        }
    }

    fn landed_state(&self) -> MavLandedState {
        let mission = self.flight.mission();
        if !self.flight.flying() {
            MavLandedState::MAV_LANDED_STATE_ON_GROUND
        } else if mission.is_landing(self.lists[0].items()) {
            MavLandedState::MAV_LANDED_STATE_LANDING
        } else {
            MavLandedState::MAV_LANDED_STATE_IN_AIR
        }
    }

    fn status(&self) -> SYS_STATUS_DATA {
        let (battery_mv, left_pct) = self.charge();
        let sensors = MavSysStatusSensor::MAV_SYS_STATUS_SENSOR_3D_GYRO
            | MavSysStatusSensor::MAV_SYS_STATUS_SENSOR_3D_ACCEL
            | MavSysStatusSensor::MAV_SYS_STATUS_SENSOR_3D_MAG
            | MavSysStatusSensor::MAV_SYS_STATUS_SENSOR_ABSOLUTE_PRESSURE
            | MavSysStatusSensor::MAV_SYS_STATUS_SENSOR_DIFFERENTIAL_PRESSURE
            | MavSysStatusSensor::MAV_SYS_STATUS_SENSOR_GPS
            | MavSysStatusSensor::MAV_SYS_STATUS_SENSOR_RC_RECEIVER
            | MavSysStatusSensor::MAV_SYS_STATUS_SENSOR_BATTERY
            | MavSysStatusSensor::MAV_SYS_STATUS_AHRS
            | MavSysStatusSensor::MAV_SYS_STATUS_PREARM_CHECK;
        // A fence that is not there counts as healthy: without this bit a ground station shows a
        // breach.
        let fence = MavSysStatusSensor::MAV_SYS_STATUS_GEOFENCE;
        let fence_if = |holds: bool| {
            if holds {
                fence
            } else {
                MavSysStatusSensor::empty()
            }
        };
        SYS_STATUS_DATA {
            onboard_control_sensors_present: sensors | fence_if(!self.fence.is_empty()),
            onboard_control_sensors_enabled: sensors | fence_if(self.fence_is_on()),
            onboard_control_sensors_health: sensors | fence_if(!self.is_outside_fence()),
            load: 300,
            voltage_battery: battery_mv,
            current_battery: -1,
            battery_remaining: left_pct,
            // The dialect's default is the first bit of a set, not the empty one.
            onboard_control_sensors_present_extended: MavSysStatusSensorExtended::empty(),
            onboard_control_sensors_enabled_extended: MavSysStatusSensorExtended::empty(),
            onboard_control_sensors_health_extended: MavSysStatusSensorExtended::empty(),
            ..SYS_STATUS_DATA::default()
        }
    }

    fn battery(&self) -> BATTERY_STATUS_DATA {
        let (battery_mv, left_pct) = self.charge();
        let mut voltages = [u16::MAX; 10];
        voltages[0] = battery_mv;
        BATTERY_STATUS_DATA {
            voltages,
            current_consumed: -1,
            energy_consumed: -1,
            temperature: i16::MAX,
            current_battery: -1,
            battery_remaining: left_pct,
            fault_bitmask: MavBatteryFault::empty(),
            ..BATTERY_STATUS_DATA::default()
        }
    }

    /// Voltage of the battery, mV, and what is left in it, per cent.
    fn charge(&self) -> (u16, i8) {
        let left = (1.0 - self.armed_s / BATTERY_S).clamp(0.0, 1.0);
        // Four lithium cells between 3.5 and 4.2 V.
        ((14_000.0 + 2_800.0 * left) as u16, (100.0 * left) as i8)
    }

    /// Says something to the people on the ground.
    pub(crate) fn send_text(&mut self, severity: MavSeverity, text: &str, now: SimTime) {
        let text = STATUSTEXT_DATA {
            severity,
            text: text.into(),
            ..STATUSTEXT_DATA::default()
        };
        self.send(&text, now);
    }

    /// Sends the parameter at `index`.
    pub(crate) fn send_parameter(&mut self, index: usize, now: SimTime) {
        let all = AutopilotParameters::all(&self.parameters);
        let count = all.len() as u16;
        let Some(&(name, value)) = all.get(index) else {
            return;
        };
        let value = PARAM_VALUE_DATA {
            param_value: value,
            param_count: count,
            param_index: index as u16,
            param_id: name.into(),
            param_type: AutopilotParameters::kind(name),
        };
        self.send(&value, now);
    }
}

pub(super) fn boot_ms(time_s: f64) -> u32 {
    (time_s * 1000.0).round().max(0.0) as u32
}

pub(super) fn millimetres(m: f64) -> i32 {
    (m * 1000.0).round() as i32
}

fn centi_celsius(temperature_k: f64) -> i16 {
    ((temperature_k - ZERO_CELSIUS_K) * 100.0).round() as i16
}
