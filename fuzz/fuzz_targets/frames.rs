//! Frames of MAVLink in and out of what is fuzzed.

use mav_bridge::dialect::MavMessage;
use mav_bridge::wire::FrameDecoder;
use mavlink::{Message as _, calculate_crc};
use protocol::SimTime;

/// Payloads, each behind its message's place in `numbers` and its length, as frames of system `of`: of random bytes
/// hardly any has a right checksum.
pub fn frames(numbers: &[u32], of: u8, mut data: &[u8]) -> Vec<u8> {
    let mut stream = Vec::new();
    let mut sequence = 0_u8;
    while let [number, length, rest @ ..] = data {
        let id = numbers[usize::from(*number) % numbers.len()];
        let (payload, rest) = rest.split_at(usize::from(*length).min(rest.len()));
        data = rest;
        let [low, middle, high, _] = id.to_le_bytes();
        let head = [payload.len() as u8, 0, 0, sequence, of, 1, low, middle, high];
        let body = [&head[..], payload].concat();
        let checksum = calculate_crc(&body, MavMessage::extra_crc(id));
        stream.push(0xFD);
        stream.extend_from_slice(&body);
        stream.extend_from_slice(&checksum.to_le_bytes());
        sequence = sequence.wrapping_add(1);
    }
    stream
}

/// The frames in a stream that comes in pieces.
pub fn decoded(pieces: impl Iterator<Item = Vec<u8>>) -> Vec<Vec<u8>> {
    let mut decoder = FrameDecoder::new();
    let mut found = Vec::new();
    for piece in pieces {
        decoder.push(&piece);
        while let Some(frame) = decoder.next_frame(SimTime::ZERO) {
            found.push(frame.into_bytes());
        }
    }
    found
}
