//! The digest of a run: SHA-256 over the canonical envelopes under `va/`, `ws/` and `sc/`,
//! ordered by time, sender (UTF-8) and sequence, without clock, presence and raw MAVLink.

use crate::envelope::Envelope;
use crate::key::Topic;
use sha2::{Digest as _, Sha256};

/// Accumulates a run's digest. Envelopes must come in their order ([`Envelope::order`]).
#[derive(Debug, Clone, Default)]
pub struct Digest {
    hash: Sha256,
}

impl Digest {
    /// An empty digest.
    pub fn new() -> Self {
        Self::default()
    }

    /// Takes in the next envelope, if messages on its topic count.
    pub fn add(&mut self, topic: &Topic, envelope: &Envelope) {
        if topic.is_in_digest() {
            self.hash.update(envelope.to_bytes());
        }
    }

    /// The digest so far, 64 hexadecimal digits.
    pub fn hex(&self) -> String {
        hex(&self.hash.clone().finalize())
    }
}

/// The SHA-256 of `bytes`, 64 hexadecimal digits.
pub fn sha256_hex(bytes: &[u8]) -> String {
    hex(&Sha256::digest(bytes))
}

/// Bytes in hexadecimal digits, two of each.
pub fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|b| format!("{b:02x}")).collect()
}
