//! MAVLink 2 message signing (mavlink.io, "Message Signing"): the first 48 bits of
//! SHA-256 over a shared key and the frame, with a time that only rises.

use super::frame::RawFrame;
use mavlink::MAVLinkV2MessageRaw;
use protocol::SimTime;
use std::collections::BTreeMap;

/// Nanoseconds in a unit of the signature's time, 10 µs.
const UNIT_NS: i64 = 10_000;
/// A stream not received before may lag by this much: one minute.
const NEW_STREAM_LAG: u64 = 60 * 100_000;

/// A shared key and where its clock stands.
#[derive(Clone, PartialEq, Eq)]
pub struct SigningConfig {
    /// The 32 bytes shared with the vehicle.
    pub key: [u8; 32],
    /// Number of this link among those to the vehicle.
    pub link_id: u8,
    /// Time at the mission's start in units of 10 µs since 2015-01-01 00:00 UTC. It must be
    /// later than that of every frame signed before with this key.
    pub epoch_10us: u64,
}

impl std::fmt::Debug for SigningConfig {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "SigningConfig {{ link_id: {}, .. }}", self.link_id)
    }
}

/// Signs outgoing frames and verifies incoming ones.
#[derive(Debug, Clone)]
pub struct Signing {
    config: SigningConfig,
    last: u64,
    streams: BTreeMap<(u8, u8, u8), u64>,
}

impl Signing {
    /// Signing by `config`.
    pub fn new(config: SigningConfig) -> Self {
        Self {
            last: config.epoch_10us,
            config,
            streams: BTreeMap::new(),
        }
    }

    /// Fills in the signature of a frame that has its flag set.
    pub(super) fn sign(&mut self, raw: &mut MAVLinkV2MessageRaw, now: SimTime) {
        // Strictly rising even when two frames share a tick, else the vehicle would refuse the
        // second as a replay.
        self.last = self.time(now).max(self.last + 1);
        *raw.signature_link_id_mut() = self.config.link_id;
        raw.signature_timestamp_bytes_mut()
            .copy_from_slice(&self.last.to_le_bytes()[..6]);
        let mut signature = [0; 6];
        raw.calculate_signature(&self.config.key, &mut signature);
        raw.signature_value_mut().copy_from_slice(&signature);
    }

    /// Whether `frame` is signed with the key and newer than all before it of its stream.
    pub fn accepts(&mut self, frame: &RawFrame, now: SimTime) -> bool {
        if !frame.is_signed() {
            return false;
        }
        let mut raw = MAVLinkV2MessageRaw::new();
        raw.as_mut_slice()[..frame.bytes().len()].copy_from_slice(frame.bytes());
        let time = raw.signature_timestamp();
        let stream = (
            raw.signature_link_id(),
            frame.system_id(),
            frame.component_id(),
        );
        // Each sender and link counts for itself; one not received before may lag a little, but an old
        // recording is refused.
        let newer = match self.streams.get(&stream) {
            Some(&last) => time > last,
            None => time + NEW_STREAM_LAG >= self.time(now).max(self.last),
        };
        let mut signature = [0; 6];
        raw.calculate_signature(&self.config.key, &mut signature);
        // A frame that is refused must not move the clock: a forged one could otherwise lock the
        // true sender out.
        if !newer || raw.signature_value() != signature {
            return false;
        }
        self.streams.insert(stream, time);
        self.last = self.last.max(time);
        true
    }

    fn time(&self, now: SimTime) -> u64 {
        self.config
            .epoch_10us
            .saturating_add_signed(now.ns() / UNIT_NS)
    }
}
