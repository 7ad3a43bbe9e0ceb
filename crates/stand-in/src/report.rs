//! What a vehicle knows of itself at one instant, and the messages that an ArduPlane makes of it.
#![allow(deprecated, reason = "ground stations still send the older forms")]

mod inside;

use crate::firmware::Firmware;
use crate::flight::{Guidance, is_manual};
use crate::home_position::HomePosition;
use crate::mission_run::Place;
use crate::reality::HUMIDITY_PCT;
use air::geo::{Enu, LocalFrame, wrap_deg};
use air::isa::{Air, ZERO_CELSIUS_K};
use air::wind::from_deg;
use fdm::FlightState;
use fdm::autopilot::{Sensed, Sticks};
use mav_bridge::arduplane::MANUAL;
use mav_bridge::dialect::{
    ATTITUDE_DATA, ATTITUDE_QUATERNION_DATA, AUTOPILOT_VERSION_DATA, BATTERY_STATUS_DATA,
    EXTENDED_SYS_STATE_DATA, FENCE_STATUS_DATA, GLOBAL_POSITION_INT_DATA, GPS_GLOBAL_ORIGIN_DATA,
    GPS_RAW_INT_DATA, GpsFixType, HEARTBEAT_DATA, HOME_POSITION_DATA, HYGROMETER_SENSOR_DATA,
    LOCAL_POSITION_NED_DATA, MISSION_CURRENT_DATA, MavAutopilot, MavBatteryFault, MavLandedState,
    MavModeFlag, MavProtocolCapability, MavState, MavSysStatusSensor, MavSysStatusSensorExtended,
    SCALED_PRESSURE_DATA, SYS_STATUS_DATA, VFR_HUD_DATA, WIND_DATA,
};
use protocol::SimTime;

/// An autopilot's barometer is warmer than the air by this much, °C.
const CASE_WARMTH_C: f64 = 12.0;
/// Dilution of precision under an open sky, times 100.
const HDOP_1E2: u16 = 80;
const SATELLITES: u8 = 14;
/// Major, minor and patch number of the ArduPlane that it emulates; the last byte marks that it is
/// no release.
const EMULATED_VERSION: [u8; 4] = [4, 8, 0, 0];
/// What a vehicle knows of itself at one instant.
#[derive(Debug, Clone)]
pub(crate) struct Report {
    pub now: SimTime,
    pub system_id: u8,
    pub frame: LocalFrame,
    /// The flight mode, by ArduPlane's number.
    pub mode: u32,
    /// The firmware that reports it.
    pub firmware: &'static Firmware,
    pub armed: bool,
    pub flying: bool,
    /// On its way down to a landing.
    pub landing: bool,
    pub failsafe: bool,
    pub sensed: Sensed,
    pub state: FlightState,
    /// Where it says that it is: place and altitude above mean sea level, m.
    pub reported: (Enu, f64),
    pub here: Place,
    pub home: HomePosition,
    /// Origin of its filter.
    pub origin: HomePosition,
    /// Wind towards, north and east, m/s; none where it is not known.
    pub wind_m_s: Option<[f64; 2]>,
    /// Equivalent over true airspeed.
    pub eas_over_tas: f64,
    pub air: Air,
    pub sticks: Sticks,
    pub guidance: Guidance,
    /// Voltage of the battery, mV, and what is left in it, per cent.
    pub charge: (u16, i8),
    pub fence_present: bool,
    pub fence_on: bool,
    pub fence_breached: bool,
    /// As ArduPlane, nothing is told of a fence that is not watched.
    pub fence_status: Option<FENCE_STATUS_DATA>,
    pub mission_current: MISSION_CURRENT_DATA,
}

impl Report {
    pub(crate) fn degrees_1e7(&self, at: Enu) -> (i32, i32) {
        let at = self.frame.to_geodetic(at);
        let whole = |deg: f64| (deg * 1e7).round() as i32;
        (whole(at.lat_deg), whole(at.lon_deg))
    }

    /// The barometer, whose noise is `noise_hpa`.
    pub(crate) fn pressure(&self, noise_hpa: f64) -> SCALED_PRESSURE_DATA {
        let v = self.sensed.airspeed_m_s;
        SCALED_PRESSURE_DATA {
            time_boot_ms: boot_ms(self.now.s()),
            press_abs: (self.air.pressure_pa / 100.0 + noise_hpa) as f32,
            press_diff: (0.5 * self.air.density_kg_m3() * v * v / 100.0) as f32,
            temperature: centi_celsius(self.air.temperature_k + CASE_WARMTH_C),
            ..SCALED_PRESSURE_DATA::default()
        }
    }

    pub(crate) fn heartbeat(&self) -> HEARTBEAT_DATA {
        let mode = self.mode;
        // Sticks are mixed in in every mode, as is ArduPlane's default.
        let mut base_mode = MavModeFlag::MAV_MODE_FLAG_CUSTOM_MODE_ENABLED
            | MavModeFlag::MAV_MODE_FLAG_MANUAL_INPUT_ENABLED;
        if mode != MANUAL {
            base_mode |= MavModeFlag::MAV_MODE_FLAG_STABILIZE_ENABLED;
        }
        if !is_manual(mode) {
            base_mode |= MavModeFlag::MAV_MODE_FLAG_GUIDED_ENABLED;
        }
        if self.armed {
            base_mode |= MavModeFlag::MAV_MODE_FLAG_SAFETY_ARMED;
        }
        let system_status = if self.failsafe {
            MavState::MAV_STATE_CRITICAL
        } else if self.flying {
            MavState::MAV_STATE_ACTIVE
        } else {
            MavState::MAV_STATE_STANDBY
        };
        HEARTBEAT_DATA {
            custom_mode: self.firmware.on_wire(mode),
            mavtype: self.firmware.vehicle,
            autopilot: MavAutopilot::MAV_AUTOPILOT_ARDUPILOTMEGA,
            base_mode,
            system_status,
            mavlink_version: 3,
        }
    }

    pub(crate) fn position(&self) -> GLOBAL_POSITION_INT_DATA {
        let sensed = self.sensed;
        let (at, alt_amsl_m) = self.reported;
        let (lat, lon) = self.degrees_1e7(at);
        let [vx, vy, vz] = sensed.vel_ned_m_s.map(|v| (v * 100.0).round() as i16);
        GLOBAL_POSITION_INT_DATA {
            time_boot_ms: boot_ms(self.now.s()),
            lat,
            lon,
            alt: millimetres(alt_amsl_m),
            relative_alt: millimetres(alt_amsl_m - self.home.ground_amsl_m),
            vx,
            vy,
            vz,
            hdg: (wrap_deg(sensed.yaw_rad.to_degrees()) * 100.0) as u16,
        }
    }

    /// Relative to the filter's origin.
    pub(crate) fn local_position(&self) -> LOCAL_POSITION_NED_DATA {
        let (at, alt_amsl_m) = self.reported;
        let origin = self.origin;
        let [vx, vy, vz] = self.sensed.vel_ned_m_s.map(|v| v as f32);
        LOCAL_POSITION_NED_DATA {
            time_boot_ms: boot_ms(self.now.s()),
            x: (at.north_m - origin.at.north_m) as f32,
            y: (at.east_m - origin.at.east_m) as f32,
            z: (origin.ground_amsl_m - alt_amsl_m) as f32,
            vx,
            vy,
            vz,
        }
    }

    pub(crate) fn satellites(&self) -> GPS_RAW_INT_DATA {
        let (at, alt_amsl_m) = self.reported;
        let (lat, lon) = self.degrees_1e7(at);
        let [north, east, _] = self.sensed.vel_ned_m_s;
        GPS_RAW_INT_DATA {
            time_usec: u64::from(boot_ms(self.now.s())) * 1000,
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

    pub(crate) fn home(&self) -> HOME_POSITION_DATA {
        let home = self.home;
        let (latitude, longitude) = self.degrees_1e7(home.at);
        HOME_POSITION_DATA {
            latitude,
            longitude,
            altitude: millimetres(home.ground_amsl_m),
            q: [1.0, 0.0, 0.0, 0.0],
            ..HOME_POSITION_DATA::default()
        }
    }

    pub(crate) fn origin(&self) -> GPS_GLOBAL_ORIGIN_DATA {
        let (latitude, longitude) = self.degrees_1e7(self.origin.at);
        GPS_GLOBAL_ORIGIN_DATA {
            latitude,
            longitude,
            altitude: millimetres(self.origin.ground_amsl_m),
            ..GPS_GLOBAL_ORIGIN_DATA::default()
        }
    }

    pub(crate) fn version(&self) -> AUTOPILOT_VERSION_DATA {
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

    pub(crate) fn attitude(&self) -> ATTITUDE_DATA {
        let sensed = self.sensed;
        let [p, q, r] = sensed.rate_rad_s.map(|rate| rate as f32);
        ATTITUDE_DATA {
            time_boot_ms: boot_ms(self.now.s()),
            roll: sensed.roll_rad as f32,
            pitch: sensed.pitch_rad as f32,
            yaw: sensed.yaw_rad as f32,
            rollspeed: p,
            pitchspeed: q,
            yawspeed: r,
        }
    }

    pub(crate) fn quaternion(&self) -> ATTITUDE_QUATERNION_DATA {
        let sensed = self.sensed;
        let attitude = fdm::quaternion(sensed.roll_rad, sensed.pitch_rad, sensed.yaw_rad);
        let [q1, q2, q3, q4] = attitude.map(|part| part as f32);
        let [rollspeed, pitchspeed, yawspeed] = sensed.rate_rad_s.map(|rate| rate as f32);
        ATTITUDE_QUATERNION_DATA {
            time_boot_ms: boot_ms(self.now.s()),
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

    pub(crate) fn hud(&self) -> VFR_HUD_DATA {
        let sensed = self.sensed;
        let [north, east, down] = sensed.vel_ned_m_s;
        VFR_HUD_DATA {
            airspeed: (sensed.airspeed_m_s * self.eas_over_tas) as f32,
            groundspeed: north.hypot(east) as f32,
            alt: sensed.alt_amsl_m as f32,
            climb: -down as f32,
            heading: wrap_deg(sensed.yaw_rad.to_degrees()) as i16,
            throttle: (self.state.throttle * 100.0).round() as u16,
        }
    }

    pub(crate) fn wind(&self) -> Option<WIND_DATA> {
        let [north, east] = self.wind_m_s?;
        Some(WIND_DATA {
            direction: from_deg(east, north) as f32,
            speed: north.hypot(east) as f32,
            speed_z: 0.0,
        })
    }

    pub(crate) fn hygrometer(&self) -> HYGROMETER_SENSOR_DATA {
        HYGROMETER_SENSOR_DATA {
            temperature: centi_celsius(self.air.temperature_k),
            humidity: (HUMIDITY_PCT * 100.0) as u16,
            id: 0,
        }
    }

    pub(crate) fn landed(&self) -> EXTENDED_SYS_STATE_DATA {
        EXTENDED_SYS_STATE_DATA {
            landed_state: self.landed_state(),
            ..EXTENDED_SYS_STATE_DATA::default()
        }
    }

    fn landed_state(&self) -> MavLandedState {
        match (self.flying, self.landing) {
            (false, _) => MavLandedState::MAV_LANDED_STATE_ON_GROUND,
            (true, true) => MavLandedState::MAV_LANDED_STATE_LANDING,
            (true, false) => MavLandedState::MAV_LANDED_STATE_IN_AIR,
        }
    }

    pub(crate) fn status(&self) -> SYS_STATUS_DATA {
        let (battery_mv, left_pct) = self.charge;
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
            onboard_control_sensors_present: sensors | fence_if(self.fence_present),
            onboard_control_sensors_enabled: sensors | fence_if(self.fence_on),
            onboard_control_sensors_health: sensors | fence_if(!self.fence_breached),
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

    pub(crate) fn battery(&self) -> BATTERY_STATUS_DATA {
        let (battery_mv, left_pct) = self.charge;
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
}

pub(crate) fn boot_ms(time_s: f64) -> u32 {
    (time_s * 1000.0).round().max(0.0) as u32
}

pub(crate) fn millimetres(m: f64) -> i32 {
    (m * 1000.0).round() as i32
}

fn centi_celsius(temperature_k: f64) -> i16 {
    ((temperature_k - ZERO_CELSIUS_K) * 100.0).round() as i16
}
