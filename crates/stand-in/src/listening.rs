//! What the stand-in makes of what it hears: commands, parameters, the ground station's
//! heartbeat; answers as ArduPlane gives them.

use crate::StandIn;
use crate::flying::is_manual;
use crate::parameters::{AIRSPEED_MAX, AIRSPEED_MIN, FS_LONG_TIMEOUT, SYSID_MYGCS, WP_LOITER_RAD};
use air::geo::Geodetic;
use fdm::autopilot::Sticks;
use mav_bridge::arduplane::{FS_GCS_ENABL, FS_LONG_ACTN, GUIDED, RTL, mode_name};
use mav_bridge::dialect::{
    COMMAND_ACK_DATA, COMMAND_INT_DATA, COMMAND_LONG_DATA, MISSION_COUNT_DATA, MavCmd, MavFrame,
    MavMessage, MavResult, MavSeverity, SET_POSITION_TARGET_GLOBAL_INT_DATA,
};
use mav_bridge::wire::RawFrame;
use protocol::SimTime;

use MavResult::{
    MAV_RESULT_ACCEPTED as ACCEPTED, MAV_RESULT_COMMAND_INT_ONLY as COMMAND_INT_ONLY,
    MAV_RESULT_COMMAND_UNSUPPORTED_MAV_FRAME as UNSUPPORTED_FRAME, MAV_RESULT_DENIED as DENIED,
    MAV_RESULT_FAILED as FAILED, MAV_RESULT_UNSUPPORTED as UNSUPPORTED,
};

/// Time after start-up before which it does not arm, s: its filter settles.
const READY_AFTER_S: f64 = 2.0;
/// ArduPlane's word to disarm in flight all the same.
const FORCE: f32 = 21196.0;
/// Bit of SET_POSITION_TARGET's mask: ignore z.
const IGNORE_Z: u16 = 4;

impl StandIn {
    /// Takes in what came over the link.
    pub(crate) fn listen(&mut self, frames_in: &[Vec<u8>], now: SimTime) {
        for bytes in frames_in {
            self.decoder.push(bytes);
        }
        while let Some(frame) = self.decoder.next_frame(now) {
            let trusted = match &mut self.signing {
                Some(signing) => signing.accepts(&frame, now),
                None => true,
            };
            if trusted && let Some(message) = frame.message() {
                self.hear(&frame, message, now);
            }
        }
    }

    fn for_me(&self, target: u8) -> bool {
        target == 0 || target == self.system_id
    }

    fn hear(&mut self, frame: &RawFrame, message: MavMessage, now: SimTime) {
        match message {
            MavMessage::HEARTBEAT(_)
                if f64::from(frame.system_id()) == self.parameters.get(SYSID_MYGCS) =>
            {
                self.ground_heard_at = Some(now);
            }
            MavMessage::COMMAND_LONG(m) if self.for_me(m.target_system) => {
                let result = self.command_long(&m, now);
                self.acknowledge(m.command, result, now);
            }
            MavMessage::COMMAND_INT(m) if self.for_me(m.target_system) => {
                let result = self.command_int(&m);
                self.acknowledge(m.command, result, now);
            }
            MavMessage::SET_POSITION_TARGET_GLOBAL_INT(m) if self.for_me(m.target_system) => {
                self.altitude_target(&m);
            }
            MavMessage::MANUAL_CONTROL(m) if self.for_me(m.target) => {
                let share = |v: i16| f64::from(v) / 1000.0;
                self.flight.set_sticks(Sticks {
                    roll: share(m.y),
                    pitch: -share(m.x),
                    throttle: share(m.z),
                });
            }
            MavMessage::PARAM_REQUEST_READ(m) if self.for_me(m.target_system) => {
                let index = match usize::try_from(m.param_index) {
                    Ok(index) => Some(index),
                    Err(_) => self
                        .parameters
                        .find(m.param_id.to_str().unwrap_or_default())
                        .map(|(index, _)| index),
                };
                // ArduPlane does not answer for a name it has not.
                if let Some(index) = index {
                    self.send_parameter(index, now);
                }
            }
            MavMessage::PARAM_REQUEST_LIST(m) if self.for_me(m.target_system) => {
                for index in 0..self.parameters.all().len() {
                    self.send_parameter(index, now);
                }
            }
            MavMessage::PARAM_SET(m) if self.for_me(m.target_system) => {
                let name = m.param_id.to_str().unwrap_or_default().to_owned();
                self.parameters.set(&name, m.param_value);
                if let Some((index, _)) = self.parameters.find(&name) {
                    self.send_parameter(index, now);
                }
            }
            MavMessage::MISSION_REQUEST_LIST(m) if self.for_me(m.target_system) => {
                let none = MISSION_COUNT_DATA {
                    target_system: frame.system_id(),
                    target_component: frame.component_id(),
                    ..MISSION_COUNT_DATA::default()
                };
                self.send(&none, now);
            }
            _ => {}
        }
    }

    fn acknowledge(&mut self, command: MavCmd, result: MavResult, now: SimTime) {
        self.send(&COMMAND_ACK_DATA { command, result }, now);
    }

    fn change_mode(&mut self, mode: u32) -> MavResult {
        if self.flight.enter(mode, &self.parameters) {
            ACCEPTED
        } else {
            FAILED
        }
    }

    fn command_long(&mut self, m: &COMMAND_LONG_DATA, now: SimTime) -> MavResult {
        match m.command {
            MavCmd::MAV_CMD_DO_SET_MODE if m.param1 as u8 & 1 == 0 => DENIED,
            MavCmd::MAV_CMD_DO_SET_MODE => self.change_mode(m.param2 as u32),
            MavCmd::MAV_CMD_COMPONENT_ARM_DISARM => self.arm(m.param1 == 1.0, m.param2, now),
            MavCmd::MAV_CMD_DO_CHANGE_SPEED => self.change_speed(m.param1, m.param2),
            MavCmd::MAV_CMD_SET_MESSAGE_INTERVAL => self.change_rate(m.param1, m.param2, now),
            MavCmd::MAV_CMD_DO_LAND_START if !self.has_landing_sequence => FAILED,
            MavCmd::MAV_CMD_DO_LAND_START => {
                self.flight.land();
                ACCEPTED
            }
            MavCmd::MAV_CMD_DO_REPOSITION => COMMAND_INT_ONLY,
            _ => UNSUPPORTED,
        }
    }

    fn command_int(&mut self, m: &COMMAND_INT_DATA) -> MavResult {
        match m.command {
            MavCmd::MAV_CMD_DO_REPOSITION => self.reposition(m),
            _ => UNSUPPORTED,
        }
    }

    fn arm(&mut self, arm: bool, word: f32, now: SimTime) -> MavResult {
        if arm && now.s() < READY_AFTER_S {
            self.say(
                MavSeverity::MAV_SEVERITY_CRITICAL,
                "Arm: AHRS not ready",
                now,
            );
            return FAILED;
        }
        if !arm && self.flight.flying() && word != FORCE {
            return FAILED;
        }
        self.flight.set_armed(arm);
        let text = if arm {
            "Throttle armed"
        } else {
            "Throttle disarmed"
        };
        self.say(MavSeverity::MAV_SEVERITY_INFO, text, now);
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

    fn altitude_amsl_m(&self, frame: MavFrame, z_m: f32) -> Option<f64> {
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
        self.flight.circle(place, radius_m, clockwise);
        self.flight.set_altitude(alt_amsl_m);
        ACCEPTED
    }

    /// ArduPlane takes no more than the altitude from this message.
    fn altitude_target(&mut self, m: &SET_POSITION_TARGET_GLOBAL_INT_DATA) {
        let wanted = self
            .altitude_amsl_m(m.coordinate_frame, m.alt)
            .filter(|alt| alt.is_finite());
        if let Some(alt_amsl_m) = wanted
            && self.flight.mode() == GUIDED
            && m.type_mask.bits() & IGNORE_Z == 0
        {
            self.flight.set_altitude(alt_amsl_m);
        }
    }

    /// The failsafe on loss of the ground station: home, and circle there. A pilot's modes are
    /// left alone, for the pilot's own radio works.
    pub(crate) fn guard(&mut self, now: SimTime) {
        let Some(heard_at) = self.ground_heard_at else {
            return;
        };
        let silent = now.since_s(heard_at) > self.parameters.get(FS_LONG_TIMEOUT);
        if !silent {
            if std::mem::replace(&mut self.failsafe, false) {
                self.say(
                    MavSeverity::MAV_SEVERITY_NOTICE,
                    "GCS Failsafe cleared",
                    now,
                );
            }
            return;
        }
        let enabled = self.parameters.get(FS_GCS_ENABL) > 0.0;
        if self.failsafe || !enabled || !self.flight.flying() {
            return;
        }
        self.failsafe = true;
        let comes_home = self.parameters.get(FS_LONG_ACTN) == 1.0 && !is_manual(self.flight.mode());
        if comes_home {
            self.flight.enter(RTL, &self.parameters);
        }
        let text = format!("GCS Failsafe On: {}", mode_name(self.flight.mode()));
        self.say(MavSeverity::MAV_SEVERITY_WARNING, &text, now);
    }
}
