//! Frames as the messages that they carry.

use mav_bridge::dialect::MavMessage;
use mav_bridge::wire::FrameDecoder;
use protocol::SimTime;

/// The message of each frame.
pub fn messages(frames: &[Vec<u8>]) -> Vec<MavMessage> {
    let mut decoder = FrameDecoder::new();
    frames.iter().for_each(|f| decoder.push(f));
    let found = std::iter::from_fn(|| decoder.next_frame(SimTime::ZERO));
    found.filter_map(|f| f.message()).collect()
}
