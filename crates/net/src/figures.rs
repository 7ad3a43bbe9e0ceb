//! Counters of a session, for metrics.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

/// Counts since a session was opened.
#[derive(Debug, Clone, Default)]
pub struct Figures(Arc<Counts>);

#[derive(Debug, Default)]
struct Counts {
    heard: AtomicU64,
    refused: AtomicU64,
    said: AtomicU64,
    lost: AtomicU64,
}

impl Figures {
    /// Accepted messages.
    pub fn heard(&self) -> u64 {
        self.0.heard.load(Ordering::Relaxed)
    }

    /// Rejected messages.
    pub fn refused(&self) -> u64 {
        self.0.refused.load(Ordering::Relaxed)
    }

    /// Published messages.
    pub fn said(&self) -> u64 {
        self.0.said.load(Ordering::Relaxed)
    }

    /// Connections that broke or were closed by peers.
    pub fn lost(&self) -> u64 {
        self.0.lost.load(Ordering::Relaxed)
    }

    pub(crate) fn received(&self, taken: bool) {
        let count = if taken {
            &self.0.heard
        } else {
            &self.0.refused
        };
        count.fetch_add(1, Ordering::Relaxed);
    }

    pub(crate) fn one_said(&self) {
        self.0.said.fetch_add(1, Ordering::Relaxed);
    }

    pub(crate) fn one_lost(&self) {
        self.0.lost.fetch_add(1, Ordering::Relaxed);
    }
}
