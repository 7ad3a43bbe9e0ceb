//! What every search strategy offers.

use rand::rngs::ChaCha8Rng;

use crate::archive::Archive;
use air::geo::Position;

/// A place that is worth a flight.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PromisingPoint {
    /// Where it is.
    pub position: Position,
    /// How promising: greater is better; in the unit of the samples' values, with whatever
    /// bonus the strategy gives to what has not been explored yet.
    pub fitness: f64,
}

/// A way to turn what has been sensed into places worth a flight.
pub trait SearchStrategy: Send {
    /// The name by which a scenario chooses the strategy.
    fn name(&self) -> &'static str;

    /// Makes the next population of promising points from the last one and all samples so far.
    /// Every point lies inside the strategy's [`crate::Domain`]. The slice is never empty.
    fn step(&mut self, archive: &Archive, rng: &mut ChaCha8Rng) -> &[PromisingPoint];

    /// The population of the last step; empty before the first.
    fn population(&self) -> &[PromisingPoint];
}
