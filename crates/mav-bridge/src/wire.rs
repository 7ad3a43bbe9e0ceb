//! MAVLink 2 frames on a byte stream: found again after garbage, checked, counted, written.
//!
//! Layout of a frame (mavlink.io, "Packet Serialization"): `FD`, payload length, incompatibility
//! flags, compatibility flags, sequence, system, component, message id (3 bytes, little endian),
//! payload with trailing zeros cut, checksum (CRC-16/MCRF4XX over all after `FD` and one byte
//! that depends on the message), and 13 bytes of signature if the first incompatibility flag is set.

mod command_ack;
mod decoder;
mod encoder;
mod frame;
pub mod signing;

pub use command_ack::CommandAck;
pub use decoder::{FrameDecoder, LinkStatistics};
pub use encoder::FrameEncoder;
pub use frame::{RawFrame, goes_over_all_links};
pub use mavlink::MessageData;
