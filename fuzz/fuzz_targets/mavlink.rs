//! Bytes of a MAVLink link into the bridge: no panic, the same frames wherever the stream is cut, and
//! nothing goes out that is not a frame.
//!
//! An input whose first byte is odd is read as payloads and made into frames here.

#![no_main]

mod frames;

use frames::{decoded, frames};
use libfuzzer_sys::fuzz_target;
use mav_bridge::{Bridge, BridgeConfig, BridgeOutput};
use protocol::SimTime;

/// What ArduPlane sends, and ground stations.
const NUMBERS: [u32; 26] = [
    0, 1, 4, 11, 22, 24, 29, 30, 33, 39, 42, 62, 73, 74, 75, 76, 77, 148, 168, 245, 251, 253,
    12920, 147, 32, 242,
];

fuzz_target!(|data: &[u8]| {
    let Some((kind, data)) = data.split_first() else {
        return;
    };
    let stream = if kind % 2 == 1 {
        // System 1: an autopilot.
        frames(&NUMBERS, 1, data)
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
