//! Simulated time.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

const NS_PER_S: f64 = 1e9;

/// Simulated time: nanoseconds since the mission's start.
#[derive(
    Debug,
    Clone,
    Copy,
    PartialEq,
    Eq,
    PartialOrd,
    Ord,
    Hash,
    Default,
    Serialize,
    Deserialize,
    JsonSchema,
)]
#[serde(transparent)]
pub struct SimTime(i64);

impl SimTime {
    /// The mission's start.
    pub const ZERO: Self = Self(0);

    /// From nanoseconds since the mission's start.
    pub const fn from_ns(ns: i64) -> Self {
        Self(ns)
    }

    /// From seconds since the mission's start, rounded to the nanosecond.
    pub fn from_s(s: f64) -> Self {
        Self((s * NS_PER_S).round() as i64)
    }

    /// Nanoseconds since the mission's start.
    pub const fn ns(self) -> i64 {
        self.0
    }

    /// Seconds since the mission's start.
    pub fn s(self) -> f64 {
        self.0 as f64 / NS_PER_S
    }

    /// The start of tick `n` of ticks `tick_ns` long.
    pub const fn of_tick(n: u64, tick_ns: i64) -> Self {
        Self(n as i64 * tick_ns)
    }

    /// This, `ns` later; at the end of what can be counted no later than that.
    #[must_use]
    pub const fn later(self, ns: i64) -> Self {
        Self(self.0.saturating_add(ns))
    }

    /// Seconds from `earlier` to this.
    pub fn since_s(self, earlier: Self) -> f64 {
        (self.0 - earlier.0) as f64 / NS_PER_S
    }
}

/// Time between two ticks above which the process counts as paused, ns, as on a host that stalls.
const PAUSE_NS: i64 = 1_500_000_000;

/// Finds the pauses of whoever ticks. While a host stalls it hears nobody, so that the silence of
/// others is to be counted without its own pauses.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Pauses {
    last: Option<SimTime>,
}

impl Pauses {
    /// Takes in a tick at `now`: how long the pause before it was, ns; 0 if there was none.
    pub fn tick(&mut self, now: SimTime) -> i64 {
        let last = self.last.replace(now).unwrap_or(now);
        let pause_ns = now.ns().saturating_sub(last.ns());
        if pause_ns > PAUSE_NS { pause_ns } else { 0 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_tick_is_no_pause_and_a_stall_is_one() {
        let mut pauses = Pauses::default();
        let found = [0.0, 0.02, 1.02, 7.02, 7.04].map(|s| pauses.tick(SimTime::from_s(s)));
        assert_eq!(found, [0, 0, 0, 6_000_000_000, 0]);
    }

    #[test]
    fn ticks_do_not_drift() {
        // 50 Hz for ten hours: summing .02 s would be off by microseconds.
        assert_eq!(SimTime::of_tick(1_800_000, 20_000_000).s(), 36_000.0);
        assert_eq!(SimTime::from_s(0.02).ns(), 20_000_000);
    }
}
