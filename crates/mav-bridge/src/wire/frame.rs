//! One frame, and where its fields stand.

use crate::dialect::{
    COMMAND_INT_DATA, COMMAND_LONG_DATA, HEARTBEAT_DATA, MavCmd, MavMessage,
    PARAM_REQUEST_READ_DATA,
};
use mavlink::{MavlinkVersion, Message as _, MessageData as _};

/// Bytes before the payload.
pub(super) const HEADER_LEN: usize = 10;
/// Incompatibility flag of a frame that carries a signature.
pub(super) const FLAG_SIGNED: u8 = 1;
/// Where the number of a command stands in the payloads of COMMAND_LONG and COMMAND_INT, before
/// the target system: after seven fields of four bytes.
const COMMAND_AT: usize = 28;

/// One frame as on the wire, with a valid checksum.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct RawFrame {
    pub(super) bytes: Vec<u8>,
}

impl RawFrame {
    /// The bytes from `FD` to checksum or signature.
    pub fn bytes(&self) -> &[u8] {
        &self.bytes
    }

    /// The bytes, taken.
    pub fn into_bytes(self) -> Vec<u8> {
        self.bytes
    }

    /// System that sent it.
    pub fn system_id(&self) -> u8 {
        self.bytes[5]
    }

    /// Component that sent it.
    pub fn component_id(&self) -> u8 {
        self.bytes[6]
    }

    /// Number of the frame among those of its sender, modulo 256.
    pub fn sequence(&self) -> u8 {
        self.bytes[4]
    }

    /// Number of the message.
    pub fn message_id(&self) -> u32 {
        message_id(&self.bytes)
    }

    /// Whether it carries a signature.
    pub fn is_signed(&self) -> bool {
        self.bytes[2] & FLAG_SIGNED != 0
    }

    /// The payload; zeros at its end are not sent.
    pub fn payload(&self) -> &[u8] {
        &self.bytes[HEADER_LEN..HEADER_LEN + usize::from(self.bytes[1])]
    }

    /// The message, if the dialect knows it and its enumerations hold known values.
    pub fn message(&self) -> Option<MavMessage> {
        MavMessage::parse(MavlinkVersion::V2, self.message_id(), self.payload()).ok()
    }

    /// Target system and number of a command (COMMAND_LONG, COMMAND_INT), also of one that the
    /// dialect does not know.
    pub fn command_number(&self) -> Option<(u8, u16)> {
        if ![COMMAND_LONG_DATA::ID, COMMAND_INT_DATA::ID].contains(&self.message_id()) {
            return None;
        }
        // Zeros at the end of a payload are not sent.
        let byte = |at: usize| self.payload().get(at).copied().unwrap_or(0);
        let [low, high, target] = [0, 1, 2].map(|k| byte(COMMAND_AT + k));
        Some((target, u16::from_le_bytes([low, high])))
    }
}

/// Whether a frame for a vehicle that is on several links goes over all of them, and does no harm there if it
/// comes late: the ground station's heartbeat, and what asks for messages, which come over the link that they
/// were asked on. Any other goes over one link: a mode that comes late over a slow one would undo what a pilot has
/// chosen in between.
pub fn goes_over_all_links(frame: &[u8]) -> bool {
    let frame = RawFrame {
        bytes: frame.to_vec(),
    };
    if frame.bytes.len() < HEADER_LEN {
        return false;
    }
    let asks = MavCmd::MAV_CMD_SET_MESSAGE_INTERVAL as u16;
    [HEARTBEAT_DATA::ID, PARAM_REQUEST_READ_DATA::ID].contains(&frame.message_id())
        || frame
            .command_number()
            .is_some_and(|(_, number)| number == asks)
}

/// Number of the message in a frame that has a whole header.
pub(super) fn message_id(frame: &[u8]) -> u32 {
    u32::from_le_bytes([frame[7], frame[8], frame[9], 0])
}
