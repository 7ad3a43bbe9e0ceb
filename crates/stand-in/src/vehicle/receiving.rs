//! What the stand-in does with the messages that come in: commands, parameters, the ground station's
//! heartbeat; answers as ArduPlane gives them.
#![allow(deprecated, reason = "ground stations still send the older forms")]

use super::StandIn;
use crate::flight::is_manual;
use crate::mission_run::Place;
use crate::parameters::{AutopilotParameters, FS_LONG_TIMEOUT, MAV_GCS_SYSID};
use mav_bridge::arduplane::{FS_GCS_ENABL, FS_LONG_ACTN, GUIDED, RTL, mode_name};
use mav_bridge::dialect::{
    AUTOPILOT_VERSION_DATA, FILE_TRANSFER_PROTOCOL_DATA, HOME_POSITION_DATA, LOG_ENTRY_DATA,
    MavFrame, MavMessage, MavSeverity, PARAM_REQUEST_READ_DATA, PARAM_SET_DATA, PING_DATA,
    RC_CHANNELS_OVERRIDE_DATA, SET_HOME_POSITION_DATA, SET_MODE_DATA,
    SET_POSITION_TARGET_GLOBAL_INT_DATA, SET_POSITION_TARGET_LOCAL_NED_DATA, TIMESYNC_DATA,
};
use mav_bridge::wire::{MessageData as _, RawFrame};
use protocol::SimTime;

/// Bit of SET_POSITION_TARGET's mask: ignore z.
const IGNORE_Z: u16 = 4;

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
            } else {
                self.refuse_unknown_item(&frame, now);
            }
        }
    }

    pub(super) fn is_addressed(&self, target: u8) -> bool {
        target == 0 || target == self.system_id
    }

    fn handle_message(&mut self, frame: &RawFrame, message: MavMessage, now: SimTime) {
        match message {
            MavMessage::HEARTBEAT(_)
                if f64::from(frame.system_id()) == self.parameters.get(MAV_GCS_SYSID) =>
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
                self.move_sticks(Some(share(m.y)), Some(-share(m.x)), Some(share(m.z)));
            }
            MavMessage::RC_CHANNELS_OVERRIDE(m)
                if self.is_addressed(m.target_system)
                    && f64::from(frame.system_id()) == self.parameters.get(MAV_GCS_SYSID) =>
            {
                self.override_sticks(&m);
            }
            MavMessage::SET_POSITION_TARGET_LOCAL_NED(m) if self.is_addressed(m.target_system) => {
                self.altitude_step(&m);
            }
            MavMessage::PARAM_REQUEST_READ(m) if self.is_addressed(m.target_system) => {
                self.read_parameter(&m, now);
            }
            MavMessage::PARAM_REQUEST_LIST(m) if self.is_addressed(m.target_system) => {
                for index in 0..self.parameters.all().len() {
                    self.send_parameter(index, now);
                }
            }
            MavMessage::PARAM_SET(m) if self.is_addressed(m.target_system) => {
                self.set_parameter(&m, now);
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
            message => self.handle_more(frame, message, now),
        }
    }

    /// Messages that a ground station sends to look around.
    fn handle_more(&mut self, frame: &RawFrame, message: MavMessage, now: SimTime) {
        let (target_system, target_component) = (frame.system_id(), frame.component_id());
        match message {
            MavMessage::AUTOPILOT_VERSION_REQUEST(m) if self.is_addressed(m.target_system) => {
                self.request_once(AUTOPILOT_VERSION_DATA::ID, 0);
            }
            MavMessage::SET_HOME_POSITION(m) if self.is_addressed(m.target_system) => {
                self.set_home_position(&m);
            }
            // Who asks with a time of his own already answers us.
            MavMessage::TIMESYNC(m) if m.tc1 == 0 && self.is_addressed(m.target_system) => {
                let answer = TIMESYNC_DATA {
                    tc1: now.ns(),
                    ts1: m.ts1,
                    target_system,
                    target_component,
                };
                self.send(&answer, now);
            }
            MavMessage::PING(m) if (m.target_system, m.target_component) == (0, 0) => {
                let answer = PING_DATA {
                    target_system,
                    target_component,
                    ..m
                };
                self.send(&answer, now);
            }
            MavMessage::FILE_TRANSFER_PROTOCOL(m) if self.is_addressed(m.target_system) => {
                if let Some(payload) = file_answer(&m.payload) {
                    let answer = FILE_TRANSFER_PROTOCOL_DATA {
                        target_network: 0,
                        target_system,
                        target_component,
                        payload,
                    };
                    self.send(&answer, now);
                }
            }
            // No log is on board: an entry without a number says so.
            MavMessage::LOG_REQUEST_LIST(m) if self.is_addressed(m.target_system) => {
                self.send(&LOG_ENTRY_DATA::default(), now);
            }
            message => self.mission_message(frame, &message, now),
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
        self.request_once(HOME_POSITION_DATA::ID, 0);
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

    /// ArduPlane does not answer for a name that it has not.
    fn read_parameter(&mut self, m: &PARAM_REQUEST_READ_DATA, now: SimTime) {
        let index = match usize::try_from(m.param_index) {
            Ok(index) => Some(index),
            Err(_) => self
                .parameters
                .find(m.param_id.to_str().unwrap_or_default())
                .map(|(index, _)| index),
        };
        if let Some(index) = index {
            self.send_parameter(index, now);
        }
    }

    /// The answer is the value that holds now, whether it could be set or not.
    fn set_parameter(&mut self, m: &PARAM_SET_DATA, now: SimTime) {
        let name = m.param_id.to_str().unwrap_or_default().to_owned();
        if AutopilotParameters::is_open(&name) {
            self.parameters.set(&name, m.param_value);
        }
        if let Some((index, _)) = self.parameters.find(&name) {
            self.send_parameter(index, now);
        }
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

/// Codes of MAVLink's file protocol: to end a session or all of them, yes, no, and why not.
const END_SESSION: u8 = 1;
const END_ALL_SESSIONS: u8 = 2;
const ACK: u8 = 128;
const NAK: u8 = 129;
const FILE_NOT_FOUND: u8 = 10;

/// The answer to a request of the file protocol: there are no files, so that ending a session is all
/// that succeeds. None to what is itself an answer.
fn file_answer(request: &[u8; 251]) -> Option<[u8; 251]> {
    let mut answer = [0; 251];
    let sequence = u16::from_le_bytes([request[0], request[1]]).wrapping_add(1);
    answer[..2].copy_from_slice(&sequence.to_le_bytes());
    answer[2] = request[2];
    let opcode = request[3];
    answer[5] = opcode;
    match opcode {
        ACK | NAK => return None,
        0 | END_SESSION | END_ALL_SESSIONS => answer[3] = ACK,
        _ => {
            answer[3] = NAK;
            // One byte of data: why.
            answer[4] = 1;
            answer[12] = FILE_NOT_FOUND;
        }
    }
    Some(answer)
}
