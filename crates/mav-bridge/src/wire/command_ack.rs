//! Acknowledgements of commands that the dialect may not know.

use crate::dialect::{COMMAND_ACK_DATA, MavMessage, MavResult};
use mavlink::error::ParserError;
use mavlink::{MavlinkVersion, MessageData};

/// COMMAND_ACK for a command by its number, so that a command which the dialect does not know can
/// be answered, too.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CommandAck {
    /// Number of the command.
    pub command: u16,
    /// The answer.
    pub result: MavResult,
}

impl MessageData for CommandAck {
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
