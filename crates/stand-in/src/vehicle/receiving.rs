//! What the stand-in does with the messages that come in: commands, parameters, the ground station's
//! heartbeat; answers as ArduPlane gives them.
#![allow(deprecated, reason = "ground stations still send the older forms")]

use super::StandIn;
use crate::flight::is_manual;
use crate::parameters::{FS_LONG_TIMEOUT, SYSID_MYGCS};
use fdm::autopilot::Sticks;
use mav_bridge::arduplane::{FS_GCS_ENABL, FS_LONG_ACTN, GUIDED, RTL, mode_name};
use mav_bridge::dialect::{
    MISSION_ACK_DATA, MISSION_COUNT_DATA, MavMessage, MavMissionResult, MavSeverity, SET_MODE_DATA,
    SET_POSITION_TARGET_GLOBAL_INT_DATA,
};
use mav_bridge::wire::{MessageData as _, RawFrame};
use protocol::SimTime;

/// Bit of SET_POSITION_TARGET's mask: ignore z.
const IGNORE_Z: u16 = 4;
const EMPTY: MavMissionResult = MavMissionResult::MAV_MISSION_ACCEPTED;
const NO_SUCH_ITEM: MavMissionResult = MavMissionResult::MAV_MISSION_INVALID_SEQUENCE;
const NO_MISSIONS: MavMissionResult = MavMissionResult::MAV_MISSION_UNSUPPORTED;

impl StandIn {
    /// Takes in what came over the link.
    pub(crate) fn receive(&mut self, frames_in: &[Vec<u8>], now: SimTime) {
        for bytes in frames_in {
            self.decoder.push(bytes);
        }
        while let Some(frame) = self.decoder.next_frame(now) {
            let trusted = match &mut self.signing {
                Some(signing) => signing.accepts(&frame, now),
                None => true,
            };
            if !trusted {
                continue;
            }
            if let Some(message) = frame.message() {
                self.handle_message(&frame, message, now);
            } else if let Some((target, command)) = frame.command_number()
                && self.is_addressed(target)
            {
                self.reject_unknown_command(command, now);
            }
        }
    }

    fn is_addressed(&self, target: u8) -> bool {
        target == 0 || target == self.system_id
    }

    fn handle_message(&mut self, frame: &RawFrame, message: MavMessage, now: SimTime) {
        match message {
            MavMessage::HEARTBEAT(_)
                if f64::from(frame.system_id()) == self.parameters.get(SYSID_MYGCS) =>
            {
                self.gcs_heartbeat_at = Some(now);
            }
            MavMessage::COMMAND_LONG(m) if self.is_addressed(m.target_system) => {
                self.command_long(&m, now);
            }
            MavMessage::COMMAND_INT(m) if self.is_addressed(m.target_system) => {
                self.command_int(&m, now);
            }
            MavMessage::SET_POSITION_TARGET_GLOBAL_INT(m) if self.is_addressed(m.target_system) => {
                self.altitude_target(&m);
            }
            MavMessage::MANUAL_CONTROL(m) if self.is_addressed(m.target) => {
                let share = |v: i16| f64::from(v) / 1000.0;
                self.flight.set_sticks(Sticks {
                    roll: share(m.y),
                    pitch: -share(m.x),
                    throttle: share(m.z),
                });
            }
            MavMessage::PARAM_REQUEST_READ(m) if self.is_addressed(m.target_system) => {
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
            MavMessage::PARAM_REQUEST_LIST(m) if self.is_addressed(m.target_system) => {
                for index in 0..self.parameters.all().len() {
                    self.send_parameter(index, now);
                }
            }
            MavMessage::PARAM_SET(m) if self.is_addressed(m.target_system) => {
                let name = m.param_id.to_str().unwrap_or_default().to_owned();
                self.parameters.set(&name, m.param_value);
                if let Some((index, _)) = self.parameters.find(&name) {
                    self.send_parameter(index, now);
                }
            }
            MavMessage::SET_MODE(m) if self.is_addressed(m.target_system) => {
                let result = self.change_mode(m.custom_mode);
                // ArduPlane acknowledges this message as if its number were a command's.
                self.acknowledge(SET_MODE_DATA::ID as u16, result, now);
            }
            MavMessage::REQUEST_DATA_STREAM(m) if self.is_addressed(m.target_system) => {
                let hz = u16::from(m.start_stop != 0) * m.req_message_rate;
                self.change_group(m.req_stream_id, hz, now);
            }
            message => self.answer_mission_protocol(frame, &message, now),
        }
    }

    /// There is no mission on board and none is taken; a ground station that asks gets that answer,
    /// since without one it would go on asking.
    fn answer_mission_protocol(&mut self, frame: &RawFrame, message: &MavMessage, now: SimTime) {
        let (target_system, target_component) = (frame.system_id(), frame.component_id());
        let result = match message {
            MavMessage::MISSION_REQUEST_LIST(m) if self.is_addressed(m.target_system) => {
                let none = MISSION_COUNT_DATA {
                    target_system,
                    target_component,
                    count: 0,
                };
                return self.send(&none, now);
            }
            MavMessage::MISSION_CLEAR_ALL(m) if self.is_addressed(m.target_system) => EMPTY,
            // An upload of nothing is another way to clear.
            MavMessage::MISSION_COUNT(m) if self.is_addressed(m.target_system) && m.count == 0 => {
                EMPTY
            }
            MavMessage::MISSION_REQUEST(m) if self.is_addressed(m.target_system) => NO_SUCH_ITEM,
            MavMessage::MISSION_REQUEST_INT(m) if self.is_addressed(m.target_system) => {
                NO_SUCH_ITEM
            }
            MavMessage::MISSION_SET_CURRENT(m) if self.is_addressed(m.target_system) => {
                NO_SUCH_ITEM
            }
            MavMessage::MISSION_COUNT(m) if self.is_addressed(m.target_system) => NO_MISSIONS,
            MavMessage::MISSION_WRITE_PARTIAL_LIST(m) if self.is_addressed(m.target_system) => {
                NO_MISSIONS
            }
            MavMessage::MISSION_ITEM(m) if self.is_addressed(m.target_system) => NO_MISSIONS,
            MavMessage::MISSION_ITEM_INT(m) if self.is_addressed(m.target_system) => NO_MISSIONS,
            _ => return,
        };
        let answer = MISSION_ACK_DATA {
            target_system,
            target_component,
            mavtype: result,
        };
        self.send(&answer, now);
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
    pub(crate) fn check_gcs_failsafe(&mut self, now: SimTime) {
        let Some(heartbeat_at) = self.gcs_heartbeat_at else {
            return;
        };
        let silent = now.since_s(heartbeat_at) > self.parameters.get(FS_LONG_TIMEOUT);
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
        let enabled = self.parameters.get(FS_GCS_ENABL) > 0.0;
        if self.failsafe || !enabled || !self.flight.flying() {
            return;
        }
        self.failsafe = true;
        let comes_home = self.parameters.get(FS_LONG_ACTN) == 1.0 && !is_manual(self.flight.mode());
        if comes_home {
            self.flight.set_mode(RTL, &self.parameters);
        }
        let text = format!("GCS Failsafe On: {}", mode_name(self.flight.mode()));
        self.send_text(MavSeverity::MAV_SEVERITY_WARNING, &text, now);
    }
}
