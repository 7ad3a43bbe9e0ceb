//! The links over which one vehicle is heard, each with frames found in its own stream of bytes.

use crate::wire::{FrameDecoder, LinkStatistics, RawFrame};
use protocol::SimTime;

/// A link is heard if something came within this time, s: heartbeats come once a second.
const HEARD_S: f64 = 2.5;
/// Weight of a frame in the share of frames lost.
const WEIGHT: f64 = 0.02;
/// Another link is taken for commands when its share of frames lost is smaller by this.
const BETTER: f64 = 0.05;

/// One link.
#[derive(Debug, Clone, Default)]
pub(super) struct Path {
    pub decoder: FrameDecoder,
    last_sequence: Option<u8>,
    lost_frames: u64,
    /// Share of the last frames that were lost.
    loss: f64,
    heard_at: Option<SimTime>,
}

impl Path {
    fn is_heard(&self, now: SimTime) -> bool {
        self.heard_at.is_some_and(|at| now.since_s(at) <= HEARD_S)
    }

    /// Takes in the number of a frame of the vehicle's autopilot.
    fn count(&mut self, sequence: u8, now: SimTime) {
        self.heard_at = Some(now);
        let last = self.last_sequence.replace(sequence);
        let gap = last.map_or(0, |last| sequence.wrapping_sub(last).wrapping_sub(1));
        // A gap of more than half the range is a restart or a frame that came late.
        let gap = if gap < 128 { gap } else { 0 };
        self.lost_frames += u64::from(gap);
        for _ in 0..gap {
            self.loss += WEIGHT * (1.0 - self.loss);
        }
        self.loss -= WEIGHT * self.loss;
    }
}

/// All links of one vehicle; the first is there from the start.
#[derive(Debug, Clone)]
pub(super) struct Paths {
    all: Vec<Path>,
    best: usize,
    /// What others have found to be no frame.
    no_frames: LinkStatistics,
}

impl Default for Paths {
    fn default() -> Self {
        Self {
            all: vec![Path::default()],
            best: 0,
            no_frames: LinkStatistics::default(),
        }
    }
}

impl Paths {
    /// Takes in bytes of the link `link`.
    pub(super) fn push(&mut self, link: usize, bytes: &[u8]) {
        if link >= self.all.len() {
            self.all.resize_with(link + 1, Path::default);
        }
        self.all[link].decoder.push(bytes);
    }

    /// The next frame of any link, with the link.
    pub(super) fn next_frame(&mut self, now: SimTime) -> Option<(usize, RawFrame)> {
        let mut links = self.all.iter_mut().enumerate();
        links.find_map(|(k, path)| Some((k, path.decoder.next_frame(now)?)))
    }

    /// Takes in the number of a frame of the vehicle's autopilot.
    pub(super) fn count(&mut self, link: usize, sequence: u8, now: SimTime) {
        self.all[link].count(sequence, now);
    }

    /// Takes in what others have found to be no frame so far.
    pub(super) fn no_frames(&mut self, so_far: LinkStatistics) {
        self.no_frames = so_far;
    }

    /// Whether there are several.
    pub(super) fn are_several(&self) -> bool {
        self.all.len() > 1
    }

    /// The link that commands go over at `now`: of those that are heard the one that loses least, else the one
    /// heard last.
    pub(super) fn best(&mut self, now: SimTime) -> usize {
        let heard = |k: &usize| self.all[*k].is_heard(now);
        let least = (0..self.all.len())
            .filter(heard)
            .min_by(|&a, &b| self.all[a].loss.total_cmp(&self.all[b].loss));
        self.best = match least {
            Some(other) if !heard(&self.best) => other,
            Some(other) if self.all[other].loss + BETTER < self.all[self.best].loss => other,
            Some(_) => self.best,
            None => (0..self.all.len())
                .max_by_key(|&k| self.all[k].heard_at)
                .unwrap_or(self.best),
        };
        self.best
    }

    /// What has gone over all of them.
    pub(super) fn statistics(&self) -> LinkStatistics {
        let mut sum = self.no_frames;
        for path in &self.all {
            let one = path.decoder.statistics();
            sum.bytes += one.bytes;
            sum.frames += one.frames;
            sum.bad_frames += one.bad_frames;
            sum.skipped_bytes += one.skipped_bytes;
            sum.lost_frames += path.lost_frames;
        }
        sum
    }
}
