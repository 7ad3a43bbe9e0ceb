//! What is said on the bus of a mission, for programs that only listen.

use net::Net;
use protocol::Envelope;
use protocol::bus::Publication;
use protocol::text::printable;
use std::collections::BTreeSet;
use std::time::{SystemTime, UNIX_EPOCH};

/// Number of different rejections that are reported: a sender may produce any number.
const MOST_TOLD: usize = 100;

/// Takes in what is said, and tells on standard error what cannot be read, once each.
#[derive(Debug, Default)]
pub struct Listener {
    refused: BTreeSet<String>,
}

impl Listener {
    /// What was said since the last call, in the order in which it came.
    pub fn heard(&mut self, net: &mut Net) -> Vec<Publication> {
        let mut heard = Vec::new();
        while let Some(received) = net.try_receive() {
            match received {
                Ok(said) => heard.push(said),
                Err(error) => self.tell(error.to_string()),
            }
        }
        heard
    }

    fn tell(&mut self, error: String) {
        if self.refused.len() < MOST_TOLD && !self.refused.contains(&error) {
            eprintln!("warning: {}", printable(&error));
            self.refused.insert(error);
        }
    }
}

/// When the mission began by this clock, if somebody says now what `envelope` says, ns since 1970.
pub fn begun(envelope: &Envelope) -> i64 {
    let now = SystemTime::now()
        .duration_since(UNIX_EPOCH)
        .unwrap_or_default();
    i64::try_from(now.as_nanos()).unwrap_or(0) - envelope.time.ns()
}
