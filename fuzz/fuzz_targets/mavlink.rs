//! Bytes of a MAVLink link into the bridge: no panic, the same frames wherever the stream is cut, and
//! nothing goes out that is not a frame.
//!
//! Of random bytes hardly any has a right checksum. So an input whose first byte is odd is read as
//! payloads, each behind its message's number and length, and made into frames here.

#![no_main]

use libfuzzer_sys::fuzz_target;
use mav_bridge::dialect::MavMessage;
use mav_bridge::wire::FrameDecoder;
use mav_bridge::{Bridge, BridgeConfig, BridgeOutput};
use mavlink::{Message as _, calculate_crc};
use protocol::SimTime;

/// What ArduPlane sends, and ground stations.
const NUMBERS: [u32; 26] = [
    0, 1, 4, 11, 22, 24, 29, 30, 33, 39, 42, 62, 73, 74, 75, 76, 77, 148, 168, 245, 251, 253,
    12920, 147, 32, 242,
];

fn frames(mut data: &[u8]) -> Vec<u8> {
    let mut stream = Vec::new();
    let mut sequence = 0_u8;
    while let [number, length, rest @ ..] = data {
        let id = NUMBERS[usize::from(*number) % NUMBERS.len()];
        let (payload, rest) = rest.split_at(usize::from(*length).min(rest.len()));
        data = rest;
        let [low, middle, high, _] = id.to_le_bytes();
        // System 1, component 1: an autopilot.
        let head = [payload.len() as u8, 0, 0, sequence, 1, 1, low, middle, high];
        let body = [&head[..], payload].concat();
        let checksum = calculate_crc(&body, MavMessage::extra_crc(id));
        stream.push(0xFD);
        stream.extend_from_slice(&body);
        stream.extend_from_slice(&checksum.to_le_bytes());
        sequence = sequence.wrapping_add(1);
    }
    stream
}

fn decoded(pieces: impl Iterator<Item = Vec<u8>>) -> Vec<Vec<u8>> {
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

fuzz_target!(|data: &[u8]| {
    let Some((kind, data)) = data.split_first() else {
        return;
    };
    let stream = if kind % 2 == 1 {
        frames(data)
    } else {
        data.to_vec()
    };

    let whole = decoded(std::iter::once(stream.clone()));
    let cut = decoded(stream.chunks(1 + usize::from(kind / 2)).map(<[u8]>::to_vec));
    assert_eq!(whole, cut, "frames differ by where the stream is cut");

    let Ok(mut bridge) = Bridge::new(BridgeConfig::default()) else {
        return;
    };
    let mut out = BridgeOutput::default();
    for (tick, piece) in stream.chunks(64).enumerate() {
        let now = SimTime::from_s(0.02 * tick as f64);
        bridge.receive(piece, now, &mut out);
        bridge.tick(now, &mut out);
        bridge.hand_back(&mut out);
    }
    let sent = out.frames_to_vehicle.len();
    assert_eq!(decoded(out.frames_to_vehicle.into_iter()).len(), sent);
});
