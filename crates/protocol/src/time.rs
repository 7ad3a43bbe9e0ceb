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

    /// Seconds from `earlier` to this.
    pub fn since_s(self, earlier: Self) -> f64 {
        (self.0 - earlier.0) as f64 / NS_PER_S
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ticks_do_not_drift() {
        // 50 Hz for ten hours: summing .02 s would be off by microseconds.
        assert_eq!(SimTime::of_tick(1_800_000, 20_000_000).s(), 36_000.0);
        assert_eq!(SimTime::from_s(0.02).ns(), 20_000_000);
    }
}
