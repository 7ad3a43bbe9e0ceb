//! Frames written.

use super::frame::FLAG_SIGNED;
use super::signing::Signing;
use mavlink::{MAVLinkV2MessageRaw, MavHeader, MessageData};
use protocol::SimTime;

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
