//! What the stand-in says: its streams, at the rates it was asked for.

use crate::StandIn;
use crate::flying::is_manual;
use crate::parameters::Parameters;
use crate::reality::HUMIDITY_PCT;
use air::geo::{Enu, wrap_deg};
use air::isa::{Atmosphere, ZERO_CELSIUS_K};
use air::wind::from_deg;
use mav_bridge::arduplane::{AUTO, GUIDED};
use mav_bridge::dialect::{
    ATTITUDE_DATA, EXTENDED_SYS_STATE_DATA, GLOBAL_POSITION_INT_DATA, HEARTBEAT_DATA,
    HYGROMETER_SENSOR_DATA, MavAutopilot, MavLandedState, MavModeFlag, MavParamType, MavSeverity,
    MavState, MavSysStatusSensor, MavType, NAMED_VALUE_FLOAT_DATA, PARAM_VALUE_DATA,
    SCALED_PRESSURE_DATA, STATUSTEXT_DATA, SYS_STATUS_DATA, VFR_HUD_DATA, WIND_DATA,
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

/// One message and when it is next due.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Stream {
    pub message_id: u32,
    /// 0: not sent.
    pub interval_ns: i64,
    pub due_ns: i64,
}

/// The streams before anybody asks for other rates. The order is that within one tick: a gas
/// reading follows the position at which it was taken.
pub(crate) fn default_streams() -> Vec<Stream> {
    [
        (HEARTBEAT_DATA::ID, 1.0),
        (GLOBAL_POSITION_INT_DATA::ID, 4.0),
        (ATTITUDE_DATA::ID, 4.0),
        (VFR_HUD_DATA::ID, 4.0),
        (NAMED_VALUE_FLOAT_DATA::ID, 10.0),
        (WIND_DATA::ID, 1.0),
        (SCALED_PRESSURE_DATA::ID, 1.0),
        (HYGROMETER_SENSOR_DATA::ID, 1.0),
        (EXTENDED_SYS_STATE_DATA::ID, 1.0),
        (SYS_STATUS_DATA::ID, 1.0),
    ]
    .map(|(message_id, hz): (u32, f64)| Stream {
        message_id,
        interval_ns: (1e9 / hz) as i64,
        due_ns: 0,
    })
    .to_vec()
}

impl StandIn {
    pub(crate) fn send<D: MessageData>(&mut self, message: &D, now: SimTime) {
        let frame = self.encoder.encode(message, self.signing.as_mut(), now);
        self.out.push(frame);
    }

    /// Sends the streams that are due.
    pub(crate) fn talk(&mut self, now: SimTime) {
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
            _ => {}
        }
    }

    fn heartbeat(&self) -> HEARTBEAT_DATA {
        let mode = self.flight.mode();
        let mut base_mode = MavModeFlag::MAV_MODE_FLAG_CUSTOM_MODE_ENABLED
            | MavModeFlag::MAV_MODE_FLAG_STABILIZE_ENABLED;
        if is_manual(mode) {
            base_mode |= MavModeFlag::MAV_MODE_FLAG_MANUAL_INPUT_ENABLED;
        }
        if mode == GUIDED || mode == AUTO {
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

    fn position(&self, now: SimTime) -> GLOBAL_POSITION_INT_DATA {
        let sensed = self.flight.sensed();
        let ground_amsl_m = self.reality.world.spec().ground_amsl_m;
        let believed = plume::Place {
            east_m: sensed.east_m,
            north_m: sensed.north_m,
            height_agl_m: sensed.alt_amsl_m - ground_amsl_m,
        };
        let (logged, _) = self.reality.logged(&believed, now.s());
        let at = self.reality.frame.to_geodetic(Enu {
            east_m: logged.east_m,
            north_m: logged.north_m,
        });
        let alt_amsl_m = ground_amsl_m + logged.height_agl_m;
        let [vx, vy, vz] = sensed.vel_ned_m_s.map(|v| (v * 100.0).round() as i16);
        GLOBAL_POSITION_INT_DATA {
            time_boot_ms: boot_ms(now.s()),
            lat: (at.lat_deg * 1e7).round() as i32,
            lon: (at.lon_deg * 1e7).round() as i32,
            alt: (alt_amsl_m * 1000.0).round() as i32,
            relative_alt: ((alt_amsl_m - self.flight.home().ground_amsl_m) * 1000.0).round() as i32,
            vx,
            vy,
            vz,
            hdg: (wrap_deg(sensed.yaw_rad.to_degrees()) * 100.0) as u16,
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

    fn hud(&self) -> VFR_HUD_DATA {
        let sensed = self.flight.sensed();
        let [north, east, down] = sensed.vel_ned_m_s;
        VFR_HUD_DATA {
            airspeed: (sensed.airspeed_m_s * self.eas_over_tas()) as f32,
            groundspeed: north.hypot(east) as f32,
            alt: sensed.alt_amsl_m as f32,
            climb: -down as f32,
            heading: wrap_deg(sensed.yaw_rad.to_degrees()) as i16,
            throttle: (self.flight.state().throttle * 100.0).round() as u16,
        }
    }

    /// Equivalent over true airspeed in the stand-in's own air.
    pub(crate) fn eas_over_tas(&self) -> f64 {
        let sea_level = Atmosphere::standard().at(0.0).density_kg_m3();
        (self.reality.air().density_kg_m3() / sea_level).sqrt()
    }

    fn gas(&mut self, now: SimTime) -> NAMED_VALUE_FLOAT_DATA {
        let dt_s = self.smelt_at.map_or(0.0, |at| now.since_s(at));
        self.smelt_at = Some(now);
        let state = self.flight.state();
        let ppm = self.reality.smell(&state, now.s(), dt_s, &mut self.rng);
        let (_, time_s) = self.reality.logged(&plume::Place::default(), now.s());
        NAMED_VALUE_FLOAT_DATA {
            time_boot_ms: boot_ms(time_s),
            value: ppm as f32,
            name: "CO2".into(),
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
            landed_state: if self.flight.flying() {
                MavLandedState::MAV_LANDED_STATE_IN_AIR
            } else {
                MavLandedState::MAV_LANDED_STATE_ON_GROUND
            },
            ..EXTENDED_SYS_STATE_DATA::default()
        }
    }

    fn status(&self) -> SYS_STATUS_DATA {
        let left = (1.0 - self.armed_s / BATTERY_S).clamp(0.0, 1.0);
        let sensors = MavSysStatusSensor::MAV_SYS_STATUS_SENSOR_3D_GYRO
            | MavSysStatusSensor::MAV_SYS_STATUS_SENSOR_3D_ACCEL
            | MavSysStatusSensor::MAV_SYS_STATUS_SENSOR_ABSOLUTE_PRESSURE
            | MavSysStatusSensor::MAV_SYS_STATUS_SENSOR_DIFFERENTIAL_PRESSURE
            | MavSysStatusSensor::MAV_SYS_STATUS_SENSOR_GPS;
        SYS_STATUS_DATA {
            onboard_control_sensors_present: sensors,
            onboard_control_sensors_enabled: sensors,
            onboard_control_sensors_health: sensors,
            load: 300,
            // Four lithium cells between 3.5 and 4.2 V.
            voltage_battery: (14_000.0 + 2_800.0 * left) as u16,
            current_battery: -1,
            battery_remaining: (100.0 * left) as i8,
            ..SYS_STATUS_DATA::default()
        }
    }

    /// Says something to the people on the ground.
    pub(crate) fn say(&mut self, severity: MavSeverity, text: &str, now: SimTime) {
        let text = STATUSTEXT_DATA {
            severity,
            text: text.into(),
        };
        self.send(&text, now);
    }

    /// Sends the parameter at `index`.
    pub(crate) fn send_parameter(&mut self, index: usize, now: SimTime) {
        let all = Parameters::all(&self.parameters);
        let count = all.len() as u16;
        let Some(&(name, value)) = all.get(index) else {
            return;
        };
        let value = PARAM_VALUE_DATA {
            param_value: value,
            param_count: count,
            param_index: index as u16,
            param_id: name.into(),
            param_type: MavParamType::MAV_PARAM_TYPE_REAL32,
        };
        self.send(&value, now);
    }
}

fn boot_ms(time_s: f64) -> u32 {
    (time_s * 1000.0).round().max(0.0) as u32
}

fn centi_celsius(temperature_k: f64) -> i16 {
    ((temperature_k - ZERO_CELSIUS_K) * 100.0).round() as i16
}
