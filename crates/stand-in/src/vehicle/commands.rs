//! The commands that the stand-in knows, and its answers to them as ArduPlane gives them: every
//! command is answered, those it does not know too.
#![allow(deprecated, reason = "ground stations still send the older forms")]

use super::StandIn;
use crate::flight::is_manual;
use crate::parameters::{AIRSPEED_MAX, AIRSPEED_MIN, WP_LOITER_RAD};
use air::geo::Geodetic;
use mav_bridge::arduplane::{GUIDED, LOITER, RTL};
use mav_bridge::dialect::{
    AUTOPILOT_VERSION_DATA, COMMAND_INT_DATA, COMMAND_LONG_DATA, GPS_GLOBAL_ORIGIN_DATA,
    HOME_POSITION_DATA, MESSAGE_INTERVAL_DATA, MavCmd, MavFrame, MavResult, MavSeverity,
};
use mav_bridge::wire::{CommandAck, MessageData as _};
use protocol::SimTime;

use MavResult::{
    MAV_RESULT_ACCEPTED as ACCEPTED, MAV_RESULT_COMMAND_INT_ONLY as COMMAND_INT_ONLY,
    MAV_RESULT_COMMAND_UNSUPPORTED_MAV_FRAME as UNSUPPORTED_FRAME, MAV_RESULT_DENIED as DENIED,
    MAV_RESULT_FAILED as FAILED, MAV_RESULT_UNSUPPORTED as UNSUPPORTED,
};

/// Time after start-up before which it does not arm, s: its filter settles.
const READY_AFTER_S: f64 = 2.0;
/// ArduPlane's magic number (param2) that disarms even in flight.
const FORCE: f32 = 21196.0;

impl StandIn {
    /// Answers to a command by its number, which the dialect may not know.
    pub(crate) fn acknowledge(&mut self, command: u16, result: MavResult, now: SimTime) {
        self.send(&CommandAck { command, result }, now);
    }

    /// As ArduPlane answers a number that it does not know.
    pub(crate) fn reject_unknown_command(&mut self, command: u16, now: SimTime) {
        self.acknowledge(command, UNSUPPORTED, now);
    }

    pub(crate) fn command_long(&mut self, m: &COMMAND_LONG_DATA, now: SimTime) {
        let result = match m.command {
            // A place in whole numbers is exact; one in floats is not.
            MavCmd::MAV_CMD_DO_REPOSITION => COMMAND_INT_ONLY,
            _ => self.command(m.command, [m.param1, m.param2], now),
        };
        self.acknowledge(m.command as u16, result, now);
    }

    pub(crate) fn command_int(&mut self, m: &COMMAND_INT_DATA, now: SimTime) {
        let result = match m.command {
            MavCmd::MAV_CMD_DO_REPOSITION => self.reposition(m),
            _ => self.command(m.command, [m.param1, m.param2], now),
        };
        self.acknowledge(m.command as u16, result, now);
    }

    /// Commands without a place, of either form.
    fn command(&mut self, command: MavCmd, [p1, p2]: [f32; 2], now: SimTime) -> MavResult {
        match command {
            MavCmd::MAV_CMD_DO_SET_MODE if p1 as u8 & 1 == 0 => DENIED,
            MavCmd::MAV_CMD_DO_SET_MODE => self.change_mode(p2 as u32),
            MavCmd::MAV_CMD_NAV_RETURN_TO_LAUNCH => self.change_mode(RTL),
            MavCmd::MAV_CMD_NAV_LOITER_UNLIM => self.change_mode(LOITER),
            MavCmd::MAV_CMD_COMPONENT_ARM_DISARM => self.arm(p1 == 1.0, p2, now),
            MavCmd::MAV_CMD_DO_CHANGE_SPEED => self.change_speed(p1, p2),
            MavCmd::MAV_CMD_DO_LAND_START if !self.has_landing_sequence => FAILED,
            MavCmd::MAV_CMD_DO_LAND_START => {
                self.flight.land();
                ACCEPTED
            }
            MavCmd::MAV_CMD_SET_MESSAGE_INTERVAL => self.change_rate(p1, p2, now),
            MavCmd::MAV_CMD_GET_MESSAGE_INTERVAL => self.send_interval(p1, now),
            MavCmd::MAV_CMD_REQUEST_MESSAGE => self.request_once(p1 as u32),
            MavCmd::MAV_CMD_REQUEST_AUTOPILOT_CAPABILITIES => {
                self.request_once(AUTOPILOT_VERSION_DATA::ID)
            }
            MavCmd::MAV_CMD_GET_HOME_POSITION => {
                self.request_once(GPS_GLOBAL_ORIGIN_DATA::ID);
                self.request_once(HOME_POSITION_DATA::ID)
            }
            _ => UNSUPPORTED,
        }
    }

    pub(crate) fn change_mode(&mut self, mode: u32) -> MavResult {
        if self.flight.set_mode(mode, &self.parameters) {
            ACCEPTED
        } else {
            FAILED
        }
    }

    fn arm(&mut self, arm: bool, force: f32, now: SimTime) -> MavResult {
        if arm && now.s() < READY_AFTER_S {
            self.send_text(
                MavSeverity::MAV_SEVERITY_CRITICAL,
                "Arm: AHRS not ready",
                now,
            );
            return FAILED;
        }
        if !arm && self.flight.flying() && force != FORCE {
            return FAILED;
        }
        self.flight.set_armed(arm);
        let text = if arm {
            "Throttle armed"
        } else {
            "Throttle disarmed"
        };
        self.send_text(MavSeverity::MAV_SEVERITY_INFO, text, now);
        ACCEPTED
    }

    /// `kind` 0 is airspeed, which ArduPlane takes as equivalent airspeed.
    fn change_speed(&mut self, kind: f32, speed_m_s: f32) -> MavResult {
        let (low, high) = (
            self.parameters.get(AIRSPEED_MIN),
            self.parameters.get(AIRSPEED_MAX),
        );
        if kind != 0.0 || is_manual(self.flight.mode()) {
            return DENIED;
        }
        if !(low..=high).contains(&f64::from(speed_m_s)) {
            return FAILED;
        }
        let true_m_s = f64::from(speed_m_s) / self.eas_over_tas();
        self.flight.set_airspeed(true_m_s);
        ACCEPTED
    }

    fn change_rate(&mut self, message_id: f32, interval_us: f32, now: SimTime) -> MavResult {
        let Some(stream) = self
            .streams
            .iter_mut()
            .find(|s| s.message_id == message_id as u32)
        else {
            return FAILED;
        };
        stream.interval_ns = match interval_us {
            rate if rate < 0.0 => 0,
            // 0 is the default rate; faster than 50 Hz is not to be had.
            rate if rate < 20_000.0 => 100_000_000,
            rate => (f64::from(rate) * 1000.0) as i64,
        };
        stream.due_ns = now.ns();
        ACCEPTED
    }

    fn send_interval(&mut self, message_id: f32, now: SimTime) -> MavResult {
        let wanted = message_id as u32;
        let Some(stream) = self.streams.iter().find(|s| s.message_id == wanted) else {
            return FAILED;
        };
        let interval_us = match stream.interval_ns / 1000 {
            0 => -1,
            interval_us => i32::try_from(interval_us).unwrap_or(i32::MAX),
        };
        let report = MESSAGE_INTERVAL_DATA {
            interval_us,
            message_id: wanted as u16,
        };
        self.send(&report, now);
        ACCEPTED
    }

    /// Has a message sent once, after the answer to the command that asked for it: who waits for
    /// both waits for the answer first.
    fn request_once(&mut self, message_id: u32) -> MavResult {
        if !self.streams.iter().any(|s| s.message_id == message_id) {
            return FAILED;
        }
        self.requested.push(message_id);
        ACCEPTED
    }

    pub(crate) fn altitude_amsl_m(&self, frame: MavFrame, z_m: f32) -> Option<f64> {
        let z_m = f64::from(z_m);
        match frame as u8 {
            // GLOBAL and GLOBAL_INT
            0 | 5 => Some(z_m),
            // GLOBAL_RELATIVE_ALT and its INT form
            3 | 6 => Some(z_m + self.flight.home().ground_amsl_m),
            _ => None,
        }
    }

    fn reposition(&mut self, m: &COMMAND_INT_DATA) -> MavResult {
        let Some(alt_amsl_m) = self.altitude_amsl_m(m.frame, m.z) else {
            return UNSUPPORTED_FRAME;
        };
        let at = Geodetic {
            lat_deg: f64::from(m.x) / 1e7,
            lon_deg: f64::from(m.y) / 1e7,
        };
        let on_earth = at.lat_deg.abs() <= 90.0 && at.lon_deg.abs() <= 180.0;
        if !on_earth || !alt_amsl_m.is_finite() {
            return DENIED;
        }
        // MAV_DO_REPOSITION_FLAGS_CHANGE_MODE
        if m.param2 as u8 & 1 != 0 {
            self.change_mode(GUIDED);
        }
        if self.flight.mode() != GUIDED {
            return FAILED;
        }
        let radius_m = if m.param3 > 0.0 {
            f64::from(m.param3)
        } else {
            self.parameters.get(WP_LOITER_RAD)
        };
        let clockwise = m.param4.is_nan() || m.param4 == 0.0;
        let place = self.reality.frame.to_enu(at);
        self.flight.set_orbit(place, radius_m, clockwise);
        self.flight.set_altitude(alt_amsl_m);
        ACCEPTED
    }
}
