//! How an ArduPlane speaks, whatever flies it: frames, streams and their rates, parameters, and the
//! answers to those who look around.
#![allow(deprecated, reason = "ground stations still send the older forms")]

mod files;
mod telling;

use crate::firmware::Firmware;
use crate::parameters::AutopilotParameters;
use crate::streams::Stream;
use mav_bridge::dialect::{
    AUTOPILOT_VERSION_DATA, COMMAND_INT_DATA, FILE_TRANSFER_PROTOCOL_DATA, GPS_GLOBAL_ORIGIN_DATA,
    HOME_POSITION_DATA, LOG_ENTRY_DATA, MESSAGE_INTERVAL_DATA, MavCmd, MavDataStream, MavMessage,
    MavResult, MavSeverity, PARAM_REQUEST_READ_DATA, PARAM_SET_DATA, PARAM_VALUE_DATA,
    PROTOCOL_VERSION_DATA, STATUSTEXT_DATA, TIMESYNC_DATA,
};
use mav_bridge::signing::Signing;
use mav_bridge::wire::{CommandAck, FrameDecoder, FrameEncoder, MessageData, RawFrame};
use protocol::SimTime;

use MavResult::{
    MAV_RESULT_ACCEPTED as ACCEPTED, MAV_RESULT_DENIED as DENIED, MAV_RESULT_FAILED as FAILED,
};

/// Component id of an autopilot.
const AUTOPILOT: u8 = 1;

/// One voice on a link.
#[derive(Debug)]
pub(crate) struct Speaker {
    pub system_id: u8,
    pub parameters: AutopilotParameters,
    decoder: FrameDecoder,
    encoder: FrameEncoder,
    signing: Option<Signing>,
    streams: Vec<Stream>,
    firmware: &'static Firmware,
    /// Messages asked for once, each with what is asked of it.
    requested: Vec<(u32, u32)>,
    out: Vec<Vec<u8>>,
}

impl Speaker {
    pub(crate) fn new(
        system_id: u8,
        parameters: AutopilotParameters,
        streams: Vec<Stream>,
        firmware: &'static Firmware,
        signing: Option<Signing>,
    ) -> Self {
        Self {
            parameters: parameters.of_system(system_id),
            decoder: FrameDecoder::new(),
            encoder: FrameEncoder::new(system_id, AUTOPILOT),
            system_id,
            signing,
            streams,
            firmware,
            requested: Vec::new(),
            out: Vec::new(),
        }
    }

    /// The frames that came over the link and are to be trusted.
    pub(crate) fn hear(&mut self, frames_in: &[Vec<u8>], now: SimTime) -> Vec<RawFrame> {
        for bytes in frames_in {
            self.decoder.push(bytes);
        }
        let mut heard = Vec::new();
        while let Some(frame) = self.decoder.next_frame(now) {
            let trusted = match &mut self.signing {
                Some(signing) => signing.accepts(&frame, now),
                None => true,
            };
            if trusted {
                heard.push(frame);
            }
        }
        heard
    }

    pub(crate) fn is_addressed(&self, target: u8) -> bool {
        target == 0 || target == self.system_id
    }

    /// What was said since the last call.
    pub(crate) fn take_frames(&mut self) -> Vec<Vec<u8>> {
        std::mem::take(&mut self.out)
    }

    pub(crate) fn send<D: MessageData>(&mut self, message: &D, now: SimTime) {
        let frame = self.encoder.encode(message, self.signing.as_mut(), now);
        self.out.push(frame);
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

    /// Answers to a command by its number, which the dialect may not know.
    pub(crate) fn acknowledge(&mut self, command: u16, result: MavResult, now: SimTime) {
        self.send(&CommandAck { command, result }, now);
    }

    /// The streams of a vehicle that has just been switched on.
    pub(crate) fn restart(&mut self, streams: Vec<Stream>) {
        self.streams = streams;
        self.requested.clear();
    }

    /// Numbers of the messages that are due, each with what is asked of it: streams first, then
    /// what was asked for once.
    pub(crate) fn due(&mut self, now: SimTime) -> Vec<(u32, u32)> {
        let mut due = Vec::new();
        for stream in &mut self.streams {
            if stream.interval_ns <= 0 || now.ns() < stream.due_ns {
                continue;
            }
            // After a pause the missed ones are left out.
            let next = stream.due_ns + stream.interval_ns;
            stream.due_ns = if next > now.ns() {
                next
            } else {
                now.ns() + stream.interval_ns
            };
            due.push((stream.message_id, 0));
        }
        due.append(&mut self.requested);
        due
    }

    /// Has a message sent once, after the answer to the command that asked for it: who waits for
    /// both waits for the answer first.
    pub(crate) fn request_once(&mut self, message_id: u32, which: u32) -> MavResult {
        if !self.streams.iter().any(|s| s.message_id == message_id) {
            return FAILED;
        }
        self.requested.push((message_id, which));
        ACCEPTED
    }

    /// Answers a command that asks for something; none if it is not of that kind.
    pub(crate) fn obey(&mut self, m: &COMMAND_INT_DATA, now: SimTime) -> Option<MavResult> {
        let (p1, p2) = (m.param1, m.param2);
        Some(match m.command {
            MavCmd::MAV_CMD_SET_MESSAGE_INTERVAL => self.change_rate(p1, p2, now),
            MavCmd::MAV_CMD_GET_MESSAGE_INTERVAL => self.send_interval(p1, now),
            MavCmd::MAV_CMD_REQUEST_MESSAGE => self.request_once(p1 as u32, p2 as u32),
            MavCmd::MAV_CMD_REQUEST_AUTOPILOT_CAPABILITIES if p1 != 1.0 => DENIED,
            MavCmd::MAV_CMD_REQUEST_AUTOPILOT_CAPABILITIES => {
                self.request_once(AUTOPILOT_VERSION_DATA::ID, 0)
            }
            MavCmd::MAV_CMD_REQUEST_PROTOCOL_VERSION => {
                self.request_once(PROTOCOL_VERSION_DATA::ID, 0)
            }
            MavCmd::MAV_CMD_GET_HOME_POSITION => {
                self.request_once(GPS_GLOBAL_ORIGIN_DATA::ID, 0);
                self.request_once(HOME_POSITION_DATA::ID, 0)
            }
            MavCmd::MAV_CMD_DO_SEND_BANNER => {
                let info = MavSeverity::MAV_SEVERITY_INFO;
                self.send_text(info, self.firmware.banner, now);
                ACCEPTED
            }
            _ => return None,
        })
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

    /// Sends a group of streams at another rate; 0 stops them. Faster than 50 Hz is not to be had.
    fn change_group(&mut self, group: MavDataStream, hz: u16, now: SimTime) {
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

    /// Answers a message of one who looks around; false if it is not of that kind.
    pub(crate) fn answer(&mut self, frame: &RawFrame, message: &MavMessage, now: SimTime) -> bool {
        let (target_system, target_component) = (frame.system_id(), frame.component_id());
        match message {
            MavMessage::PARAM_REQUEST_READ(m) if self.is_addressed(m.target_system) => {
                self.read_parameter(m, now);
            }
            MavMessage::PARAM_REQUEST_LIST(m) if self.is_addressed(m.target_system) => {
                for index in 0..self.parameters.all().len() {
                    self.send_parameter(index, now);
                }
            }
            MavMessage::PARAM_SET(m) if self.is_addressed(m.target_system) => {
                self.set_parameter(m, now);
            }
            MavMessage::REQUEST_DATA_STREAM(m) if self.is_addressed(m.target_system) => {
                let hz = u16::from(m.start_stop != 0) * m.req_message_rate;
                self.change_group(m.req_stream_id, hz, now);
            }
            MavMessage::AUTOPILOT_VERSION_REQUEST(m) if self.is_addressed(m.target_system) => {
                self.request_once(AUTOPILOT_VERSION_DATA::ID, 0);
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
            MavMessage::FILE_TRANSFER_PROTOCOL(m) if self.is_addressed(m.target_system) => {
                if let Some(payload) = files::answer(&m.payload) {
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
            _ => return false,
        }
        true
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

    /// Sends the parameter at `index`.
    fn send_parameter(&mut self, index: usize, now: SimTime) {
        let all = self.parameters.all();
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
