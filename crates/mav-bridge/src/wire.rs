//! MAVLink 2 frames on a byte stream: found again after garbage, checked, counted, written.
//!
//! Layout of a frame (mavlink.io, "Packet Serialization"): `FD`, payload length, incompatibility
//! flags, compatibility flags, sequence, system, component, message id (3 bytes, little endian),
//! payload with trailing zeros cut, checksum (CRC-16/MCRF4XX over all after `FD` and one byte
//! that depends on the message), and 13 bytes of signature if the first incompatibility flag is set.

use crate::dialect::{
    COMMAND_ACK_DATA, COMMAND_INT_DATA, COMMAND_LONG_DATA, MavMessage, MavResult,
};
use crate::signing::Signing;
pub use mavlink::MessageData;
use mavlink::error::ParserError;
use mavlink::{MAV_STX_V2, MAVLinkV2MessageRaw, MavHeader, MavlinkVersion, Message as _};
use protocol::SimTime;

const HEADER_LEN: usize = 10;
const CHECKSUM_LEN: usize = 2;
const SIGNATURE_LEN: usize = 13;
const FLAG_SIGNED: u8 = 1;
/// Where the number of a command stands in the payloads of COMMAND_LONG and COMMAND_INT, before
/// the target system: after seven fields of four bytes.
const COMMAND_AT: usize = 28;
/// How long the head of a frame may wait for its rest: 280 bytes take 50 ms at 57,600 baud.
const LONGEST_FRAME_S: f64 = 0.5;

/// One frame as on the wire, with a valid checksum.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct RawFrame {
    bytes: Vec<u8>,
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

    fn payload(&self) -> &[u8] {
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

/// COMMAND_ACK for a command by its number, so that a command which the dialect does not know can
/// be answered, too.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CommandAnswer {
    /// Number of the command.
    pub command: u16,
    /// The answer.
    pub result: MavResult,
}

impl MessageData for CommandAnswer {
    type Message = MavMessage;
    const ID: u32 = COMMAND_ACK_DATA::ID;
    const NAME: &'static str = COMMAND_ACK_DATA::NAME;
    const EXTRA_CRC: u8 = COMMAND_ACK_DATA::EXTRA_CRC;
    const ENCODED_LEN: usize = COMMAND_ACK_DATA::ENCODED_LEN;

    fn ser(&self, version: MavlinkVersion, payload: &mut [u8]) -> usize {
        let known = COMMAND_ACK_DATA {
            result: self.result,
            ..COMMAND_ACK_DATA::default()
        };
        known.ser(version, payload);
        payload[..2].copy_from_slice(&self.command.to_le_bytes());
        // The result that stands last may be zero, as may the number; a payload keeps a byte.
        let used = payload[..Self::ENCODED_LEN].iter().rposition(|&b| b != 0);
        used.map_or(1, |last| last + 1)
    }

    fn deser(version: MavlinkVersion, payload: &[u8]) -> Result<Self, ParserError> {
        COMMAND_ACK_DATA::deser(version, payload).map(|known| Self {
            command: known.command as u16,
            result: known.result,
        })
    }
}

fn message_id(frame: &[u8]) -> u32 {
    u32::from_le_bytes([frame[7], frame[8], frame[9], 0])
}

/// What has gone over a link so far.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct LinkStatistics {
    /// Bytes received.
    pub bytes: u64,
    /// Frames with a valid checksum.
    pub frames: u64,
    /// Things that began like a frame but were none: wrong checksum, unknown flags, cut short.
    pub bad_frames: u64,
    /// Bytes that belonged to no frame.
    pub skipped_bytes: u64,
    /// Frames missing in the vehicle's own count.
    pub lost_frames: u64,
    /// Frames whose message the dialect does not know or whose values it cannot read.
    pub unreadable_frames: u64,
    /// Frames refused because of a missing or wrong signature.
    pub refused_frames: u64,
}

/// Finds frames in a stream that may be cut anywhere and carry garbage anywhere. A candidate
/// that proves false is searched again from its second byte, so no frame behind it is lost.
#[derive(Debug, Clone, Default)]
pub struct FrameDecoder {
    buffer: Vec<u8>,
    start: usize,
    waiting_since: Option<SimTime>,
    statistics: LinkStatistics,
}

/// What stands at the front of the buffer.
enum Candidate {
    Frame(usize),
    False,
    Incomplete,
}

impl FrameDecoder {
    /// An empty decoder.
    pub fn new() -> Self {
        Self::default()
    }

    /// Takes bytes in: a datagram, or a piece of a stream.
    pub fn push(&mut self, bytes: &[u8]) {
        self.buffer.drain(..self.start);
        self.start = 0;
        self.buffer.extend_from_slice(bytes);
        self.statistics.bytes += bytes.len() as u64;
    }

    /// The next frame, if a whole one is there. The head of a frame that has waited for its
    /// rest too long at `now` is given up.
    pub fn next_frame(&mut self, now: SimTime) -> Option<RawFrame> {
        loop {
            let rest = &self.buffer[self.start..];
            let Some(skip) = rest.iter().position(|&b| b == MAV_STX_V2) else {
                self.skip(rest.len());
                self.waiting_since = None;
                return None;
            };
            self.skip(skip);
            match candidate(&self.buffer[self.start..]) {
                Candidate::Frame(length) => {
                    let bytes = self.buffer[self.start..self.start + length].to_vec();
                    self.start += length;
                    self.waiting_since = None;
                    self.statistics.frames += 1;
                    return Some(RawFrame { bytes });
                }
                Candidate::False => self.reject(),
                Candidate::Incomplete => {
                    let since = *self.waiting_since.get_or_insert(now);
                    if now.since_s(since) <= LONGEST_FRAME_S {
                        return None;
                    }
                    self.reject();
                }
            }
        }
    }

    /// What has been met so far (lost, unreadable and refused frames are not this one's to know).
    pub fn statistics(&self) -> LinkStatistics {
        self.statistics
    }

    fn skip(&mut self, bytes: usize) {
        self.start += bytes;
        self.statistics.skipped_bytes += bytes as u64;
    }

    fn reject(&mut self) {
        self.skip(1);
        self.waiting_since = None;
        self.statistics.bad_frames += 1;
    }
}

fn candidate(bytes: &[u8]) -> Candidate {
    if bytes.len() < 3 {
        return Candidate::Incomplete;
    }
    let flags = bytes[2];
    if flags & !FLAG_SIGNED != 0 {
        return Candidate::False;
    }
    let payload_end = HEADER_LEN + usize::from(bytes[1]);
    let signature = if flags & FLAG_SIGNED != 0 {
        SIGNATURE_LEN
    } else {
        0
    };
    let length = payload_end + CHECKSUM_LEN + signature;
    if bytes.len() < length {
        return Candidate::Incomplete;
    }
    // Of a message that the dialect does not know, the byte that its checksum ends with is unknown:
    // what seems to be one is chance, and would swallow the frames behind it.
    let id = message_id(bytes);
    if MavMessage::default_message_from_id(id).is_none() {
        return Candidate::False;
    }
    let extra = MavMessage::extra_crc(id);
    let expected = u16::from_le_bytes([bytes[payload_end], bytes[payload_end + 1]]);
    if mavlink::calculate_crc(&bytes[1..payload_end], extra) == expected {
        Candidate::Frame(length)
    } else {
        Candidate::False
    }
}

/// Writes frames of one sender.
#[derive(Debug, Clone)]
pub struct FrameEncoder {
    system_id: u8,
    component_id: u8,
    sequence: u8,
}

impl FrameEncoder {
    /// An encoder for the component `component_id` of the system `system_id`.
    pub fn new(system_id: u8, component_id: u8) -> Self {
        Self {
            system_id,
            component_id,
            sequence: 0,
        }
    }

    /// The frame of `message`, signed if there is a `signing`.
    pub fn encode<D: MessageData>(
        &mut self,
        message: &D,
        signing: Option<&mut Signing>,
        now: SimTime,
    ) -> Vec<u8> {
        let header = MavHeader {
            system_id: u32::from(self.system_id),
            component_id: self.component_id,
            sequence: self.sequence,
        };
        self.sequence = self.sequence.wrapping_add(1);
        let mut raw = MAVLinkV2MessageRaw::new();
        if let Some(signing) = signing {
            *raw.incompatibility_flags_mut() = FLAG_SIGNED;
            raw.serialize_message_data(header, message);
            signing.sign(&mut raw, now);
        } else {
            raw.serialize_message_data(header, message);
        }
        raw.raw_bytes().to_vec()
    }
}
