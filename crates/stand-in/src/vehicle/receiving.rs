//! What the stand-in does with the messages that come in: commands, parameters, the ground station's
//! heartbeat; answers as ArduPlane gives them.
#![allow(deprecated, reason = "ground stations still send the older forms")]

use super::StandIn;
use crate::flight::is_manual;
use crate::mission_run::Place;
use crate::parameters::MAV_GCS_SYSID;
use mav_bridge::arduplane::{GUIDED, RTL, mode_name};
use mav_bridge::dialect::{
    AttitudeTargetTypemask, HOME_POSITION_DATA, MavFrame, MavMessage, MavSeverity,
    RC_CHANNELS_OVERRIDE_DATA, SET_ATTITUDE_TARGET_DATA, SET_HOME_POSITION_DATA,
    SET_POSITION_TARGET_GLOBAL_INT_DATA, SET_POSITION_TARGET_LOCAL_NED_DATA,
};
use mav_bridge::wire::{MessageData as _, RawFrame};
use protocol::SimTime;

/// Bits of SET_POSITION_TARGET's mask: ignore z, the position, the velocity.
const IGNORE_Z: u16 = 4;
const IGNORE_POSITION: u16 = 7;
const IGNORE_VELOCITY: u16 = 56;

/// Silence that is told as over when the failsafe is off, s: that of its default.
const FAILSAFE_OFF_S: f64 = 5.0;

impl StandIn {
    /// Takes in what came over the link.
    pub(crate) fn receive(&mut self, frames_in: &[Vec<u8>], now: SimTime) {
        for frame in self.speaker.hear(frames_in, now) {
            if let Some(message) = frame.message() {
                self.handle_message(&frame, message, now);
            } else if let Some((target, command)) = frame.command_number()
                && self.is_addressed(target)
            {
                self.reject_unknown_command(command, now);
            } else {
                self.refuse_unknown_item(&frame, now);
            }
        }
    }

    pub(super) fn is_addressed(&self, target: u8) -> bool {
        self.speaker.is_addressed(target)
    }

    /// Whether the frame is of the ground station that it listens to.
    fn is_its_ground_station(&self, frame: &RawFrame) -> bool {
        f64::from(frame.system_id()) == self.speaker.parameters.get(MAV_GCS_SYSID)
    }

    fn handle_message(&mut self, frame: &RawFrame, message: MavMessage, now: SimTime) {
        match message {
            MavMessage::HEARTBEAT(_) if self.is_its_ground_station(frame) => {
                self.gcs_heartbeat_at = Some(now);
            }
            MavMessage::COMMAND_LONG(m) if self.is_addressed(m.target_system) => {
                self.command_long(&m, now);
            }
            MavMessage::COMMAND_INT(m) if self.is_addressed(m.target_system) => {
                self.command_int(&m, now);
            }
            MavMessage::SET_POSITION_TARGET_GLOBAL_INT(m) if self.is_addressed(m.target_system) => {
                if self.flight.hovers() {
                    self.position_target(&m);
                } else {
                    self.altitude_target(&m);
                }
            }
            MavMessage::SET_ATTITUDE_TARGET(m) if self.is_addressed(m.target_system) => {
                self.hold_attitude(&m, now);
            }
            // Sticks are for one vehicle, and of the ground station that it listens to.
            MavMessage::MANUAL_CONTROL(m)
                if m.target == self.speaker.system_id && self.is_its_ground_station(frame) =>
            {
                let share = |v: i16| f64::from(v) / 1000.0;
                self.move_sticks(Some(share(m.y)), Some(-share(m.x)), Some(share(m.z)));
            }
            MavMessage::RC_CHANNELS_OVERRIDE(m)
                if self.is_addressed(m.target_system) && self.is_its_ground_station(frame) =>
            {
                self.override_sticks(&m);
            }
            MavMessage::SET_POSITION_TARGET_LOCAL_NED(m) if self.is_addressed(m.target_system) => {
                self.altitude_step(&m);
            }
            MavMessage::SET_MODE(m) if self.is_addressed(m.target_system) => {
                // Obeyed without an answer, which is the heartbeat's mode.
                self.change_mode_to(m.custom_mode);
            }
            MavMessage::SET_HOME_POSITION(m) if self.is_addressed(m.target_system) => {
                self.set_home_position(&m);
            }
            message => {
                if !self.speaker.answer(frame, &message, now) {
                    self.mission_message(frame, &message, now);
                }
            }
        }
    }

    fn set_home_position(&mut self, m: &SET_HOME_POSITION_DATA) {
        if (m.latitude, m.longitude) == (0, 0) {
            return;
        }
        self.flight.set_home(Place {
            at: crate::fence::local((m.latitude, m.longitude), &self.reality.frame),
            alt_amsl_m: f64::from(m.altitude) / 1000.0,
        });
        self.speaker.request_once(HOME_POSITION_DATA::ID, 0);
    }

    /// Sticks of the ground station that may fly by them, in pulses; 0 gives one back to the radio
    /// and the highest number leaves it.
    fn override_sticks(&mut self, m: &RC_CHANNELS_OVERRIDE_DATA) {
        let share = |pulse_us: u16| {
            (pulse_us != 0 && pulse_us != u16::MAX)
                .then(|| ((f64::from(pulse_us) - 1500.0) / 500.0).clamp(-1.0, 1.0))
        };
        let throttle = share(m.chan3_raw).map(|half| (half + 1.0) / 2.0);
        self.move_sticks(share(m.chan1_raw), share(m.chan2_raw), throttle);
    }

    /// ArduPlane takes a step up or down from this message, and nothing else.
    fn altitude_step(&mut self, m: &SET_POSITION_TARGET_LOCAL_NED_DATA) {
        let by_steps = m.coordinate_frame == MavFrame::MAV_FRAME_LOCAL_OFFSET_NED;
        let target = self.flight.guidance().target;
        if let Some(target) = target
            && by_steps
            && self.flight.mode() == GUIDED
            && m.z.is_finite()
        {
            self.flight.set_altitude(target.alt_amsl_m - f64::from(m.z));
        }
    }

    /// ArduCopter takes a position, or a velocity where the position is ignored.
    fn position_target(&mut self, m: &SET_POSITION_TARGET_GLOBAL_INT_DATA) {
        if self.flight.mode() != GUIDED {
            return;
        }
        let mask = m.type_mask.bits();
        if mask & IGNORE_POSITION == 0 {
            let wanted = self.altitude_here_m(m.coordinate_frame, m.alt);
            if let Some(alt_amsl_m) = wanted {
                let at = crate::fence::local((m.lat_int, m.lon_int), &self.reality.frame);
                self.fly_around(at, 0.0, true);
                self.flight.set_altitude(alt_amsl_m);
            }
        } else if mask & IGNORE_VELOCITY == 0 {
            let (north, east) = (f64::from(m.vx), f64::from(m.vy));
            let deg = east.atan2(north).to_degrees().rem_euclid(360.0);
            self.flight.set_direction(deg, true);
            self.flight.set_ground_speed(north.hypot(east));
        }
    }

    /// ArduPlane takes no more than the altitude from this message.
    fn altitude_target(&mut self, m: &SET_POSITION_TARGET_GLOBAL_INT_DATA) {
        let wanted = self.altitude_here_m(m.coordinate_frame, m.alt);
        if let Some(alt_amsl_m) = wanted
            && self.flight.mode() == GUIDED
            && m.type_mask.bits() & IGNORE_Z == 0
        {
            self.flight.set_altitude(alt_amsl_m);
        }
    }

    /// ArduPlane takes roll where the attitude or the roll rate is not ignored, pitch likewise; a yaw would be a rudder's
    /// deflection, and there is no rudder here.
    fn hold_attitude(&mut self, m: &SET_ATTITUDE_TARGET_DATA, now: SimTime) {
        type Mask = AttitudeTargetTypemask;
        if self.flight.mode() != GUIDED {
            return;
        }
        let taken = |ignored: Mask| !m.type_mask.contains(ignored);
        let attitude = taken(Mask::ATTITUDE_TARGET_TYPEMASK_ATTITUDE_IGNORE);
        let roll = attitude || taken(Mask::ATTITUDE_TARGET_TYPEMASK_BODY_ROLL_RATE_IGNORE);
        let pitch = attitude || taken(Mask::ATTITUDE_TARGET_TYPEMASK_BODY_PITCH_RATE_IGNORE);
        let throttle = taken(Mask::ATTITUDE_TARGET_TYPEMASK_THROTTLE_IGNORE);
        let [w, x, y, z] = m.q.map(f64::from);
        let roll_rad = (2.0 * (w * x + y * z)).atan2(1.0 - 2.0 * (x * x + y * y));
        let pitch_rad = (2.0 * (w * y - z * x)).clamp(-1.0, 1.0).asin();
        let held = [
            roll.then_some(roll_rad),
            pitch.then_some(pitch_rad),
            throttle.then_some(f64::from(m.thrust)),
        ];
        let sound = held.map(|value| value.filter(|v| v.is_finite()));
        self.flight.hold(sound, now.s());
    }

    /// Its mode, for people.
    fn mode_name(&self) -> String {
        if self.flight.hovers() {
            return self.firmware.mode_name(self.flight.mode()).to_owned();
        }
        mode_name(self.flight.mode())
    }

    /// The failsafe on loss of the ground station: home, and circle there. A pilot's modes are
    /// left alone, for the pilot's own radio works.
    pub(crate) fn check_gcs_failsafe(&mut self, now: SimTime) {
        let pause_ns = self.pauses.tick(now);
        let Some(heartbeat_at) = self.gcs_heartbeat_at else {
            return;
        };
        let heartbeat_at = heartbeat_at.later(pause_ns).min(now);
        self.gcs_heartbeat_at = Some(heartbeat_at);
        let limit_s = self.speaker.parameters.gcs_failsafe_s();
        let silent = now.since_s(heartbeat_at) > limit_s.unwrap_or(FAILSAFE_OFF_S);
        if !silent {
            if std::mem::replace(&mut self.failsafe, false) {
                self.send_text(
                    MavSeverity::MAV_SEVERITY_NOTICE,
                    "GCS Failsafe cleared",
                    now,
                );
            }
            return;
        }
        if self.failsafe || limit_s.is_none() || !self.flight.flying() {
            return;
        }
        self.failsafe = true;
        let comes_home =
            self.speaker.parameters.gcs_failsafe_returns() && !is_manual(self.flight.mode());
        if comes_home {
            self.flight.set_mode(RTL, &self.speaker.parameters);
        }
        let text = format!("GCS Failsafe On: {}", self.mode_name());
        self.send_text(MavSeverity::MAV_SEVERITY_WARNING, &text, now);
    }
}
