//! How fast simulated time passes against the wall clock.

use std::str::FromStr;
use std::time::{Duration, Instant};

/// Simulated seconds a wall second; infinite for as fast as the processor allows.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Speed(pub f64);

impl FromStr for Speed {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text {
            "max" => Ok(Self(f64::INFINITY)),
            "real" => Ok(Self(1.0)),
            factor => match factor.parse::<f64>() {
                Ok(f) if f.is_finite() && f > 0.0 => Ok(Self(f)),
                _ => Err("expected real, max or a positive factor, such as 10".to_owned()),
            },
        }
    }
}

/// Holds a run to its speed.
#[derive(Debug)]
pub struct Pace {
    speed: Speed,
    since: Instant,
    since_sim_s: f64,
}

impl Pace {
    /// A pace that starts at simulated time `sim_s`.
    pub fn new(speed: Speed, sim_s: f64) -> Self {
        Self {
            speed,
            since: Instant::now(),
            since_sim_s: sim_s,
        }
    }

    /// The speed asked for.
    pub fn speed(&self) -> Speed {
        self.speed
    }

    /// How long to wait until `sim_s` is due.
    pub fn wait(&self, sim_s: f64) -> Duration {
        if self.speed.0.is_infinite() {
            return Duration::ZERO;
        }
        let due_s = (sim_s - self.since_sim_s) / self.speed.0;
        Duration::from_secs_f64(due_s.max(0.0)).saturating_sub(self.since.elapsed())
    }
}

/// Wall time over which the speed that was reached is measured, s: a figure that a person can read.
const REACHED_OVER_S: f64 = 1.5;

/// The speed that a run reaches.
#[derive(Debug)]
pub struct Reached {
    since: Instant,
    since_sim_s: f64,
    factor: f64,
}

impl Reached {
    /// Begins to measure at simulated time 0.
    pub fn new() -> Self {
        Self {
            since: Instant::now(),
            since_sim_s: 0.0,
            factor: f64::NAN,
        }
    }

    /// Simulated over wall time of late, at `sim_s`; not a number at first.
    pub fn factor(&mut self, sim_s: f64) -> f64 {
        let over_s = self.since.elapsed().as_secs_f64();
        if over_s > REACHED_OVER_S {
            *self = Self {
                since: Instant::now(),
                since_sim_s: sim_s,
                factor: (sim_s - self.since_sim_s) / over_s,
            };
        }
        self.factor
    }
}

impl Default for Reached {
    fn default() -> Self {
        Self::new()
    }
}
