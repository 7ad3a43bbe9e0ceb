//! Frames found in a stream of bytes.

use super::frame::{FLAG_SIGNED, HEADER_LEN, RawFrame, message_id};
use crate::dialect::MavMessage;
use mavlink::{MAV_STX_V2, Message as _};
use protocol::SimTime;

const CHECKSUM_LEN: usize = 2;
const SIGNATURE_LEN: usize = 13;
/// How long the head of a frame may wait for its rest: 280 bytes take 50 ms at 57,600 baud.
const LONGEST_FRAME_S: f64 = 0.5;

/// Counters of a link.
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
    /// Messages that another link had brought already.
    pub duplicate_frames: u64,
}

impl LinkStatistics {
    /// Losses since `before`, as text; none without losses.
    pub fn since(&self, before: &Self) -> Option<String> {
        let frames = self.frames - before.frames;
        let counts = [
            (self.lost_frames - before.lost_frames, "lost"),
            (self.bad_frames - before.bad_frames, "corrupt"),
            (
                self.unreadable_frames - before.unreadable_frames,
                "unreadable",
            ),
            (
                self.refused_frames - before.refused_frames,
                "rejected for their signature",
            ),
        ];
        let words: Vec<String> = counts
            .iter()
            .filter(|(n, _)| *n > 0)
            .map(|(n, what)| format!("{n} {what}"))
            .collect();
        (!words.is_empty()).then(|| format!("{frames} frames received, {}", words.join(", ")))
    }
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

/// Content at the front of the buffer.
enum FrameCheck {
    Frame(usize),
    False,
    Incomplete,
}

impl FrameDecoder {
    /// An empty decoder.
    pub fn new() -> Self {
        Self::default()
    }

    /// Receives bytes: a datagram, or a part of a stream.
    pub fn push(&mut self, bytes: &[u8]) {
        // What was consumed goes at the next input, once, rather than at each frame.
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
            match check_frame(&self.buffer[self.start..]) {
                FrameCheck::Frame(length) => {
                    let bytes = self.buffer[self.start..self.start + length].to_vec();
                    self.start += length;
                    self.waiting_since = None;
                    self.statistics.frames += 1;
                    return Some(RawFrame { bytes });
                }
                FrameCheck::False => self.reject(),
                FrameCheck::Incomplete => {
                    // A start byte in garbage can promise a frame that never comes and hold back
                    // those behind it.
                    let since = *self.waiting_since.get_or_insert(now);
                    if now.since_s(since) <= LONGEST_FRAME_S {
                        return None;
                    }
                    self.reject();
                }
            }
        }
    }

    /// What has been met so far (lost, unreadable, refused and duplicate frames are not this one's to know).
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

/// Examines the bytes from a start byte on.
fn check_frame(bytes: &[u8]) -> FrameCheck {
    if bytes.len() < 3 {
        return FrameCheck::Incomplete;
    }
    let flags = bytes[2];
    if flags & !FLAG_SIGNED != 0 {
        return FrameCheck::False;
    }
    let payload_end = HEADER_LEN + usize::from(bytes[1]);
    let signature = if flags & FLAG_SIGNED != 0 {
        SIGNATURE_LEN
    } else {
        0
    };
    let length = payload_end + CHECKSUM_LEN + signature;
    if bytes.len() < length {
        return FrameCheck::Incomplete;
    }
    // Of a message that the dialect does not know, the byte that its checksum ends with is unknown:
    // what seems to be one is chance, and would swallow the frames behind it.
    let id = message_id(bytes);
    if MavMessage::default_message_from_id(id).is_none() {
        return FrameCheck::False;
    }
    let extra = MavMessage::extra_crc(id);
    let expected = u16::from_le_bytes([bytes[payload_end], bytes[payload_end + 1]]);
    if mavlink::calculate_crc(&bytes[1..payload_end], extra) == expected {
        FrameCheck::Frame(length)
    } else {
        FrameCheck::False
    }
}
