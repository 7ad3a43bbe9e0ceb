//! What every search strategy offers.

use rand::rngs::ChaCha8Rng;

use crate::archive::{Archive, Sample};
use crate::cone::choose_within_cone;
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

/// One of the team, as it flies now.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sampler {
    /// Its number in the team, from 0: that under which its readings are taken in.
    pub id: usize,
    /// Where it is.
    pub position: Position,
    /// Where it flies to, degrees clockwise from north.
    pub heading_deg: f64,
    /// Speed over ground, m/s.
    pub speed_m_s: f64,
    /// Radius of its turns, m.
    pub turn_radius_m: f64,
    /// How fast it climbs and descends, m/s.
    pub climb_m_s: f64,
}

/// A way to turn what has been sensed into places worth a flight.
pub trait SearchStrategy: Send {
    /// Takes in what the `sampler`-th of the team has read at a time: for strategies that learn more of it than the
    /// archive keeps.
    fn sense(&mut self, _time_s: f64, _sampler: usize, _sample: &Sample, _rng: &mut ChaCha8Rng) {}

    /// Makes the next population of promising points from the last one and all samples so far.
    /// Every point lies inside the strategy's [`crate::Domain`]. The slice is never empty.
    fn step(&mut self, archive: &Archive, rng: &mut ChaCha8Rng) -> &[PromisingPoint];

    /// Receives an external program's target for a vehicle; only the strategy [`crate::Outside`] uses it.
    fn wish(&mut self, _sampler: usize, _place: Position) {}

    /// The population of the last step; empty before the first.
    fn population(&self) -> &[PromisingPoint];

    /// Where one of the team flies to until the next step: unless the strategy knows better, to a promising point that lies
    /// ahead of it ([`choose_within_cone`]). Asked for the same one again, where it cannot be sent there, the strategy may choose
    /// another place.
    fn direct(&mut self, sampler: &Sampler, cone_deg: f64, rng: &mut ChaCha8Rng) -> Position {
        let (here, heading_deg) = (sampler.position, sampler.heading_deg);
        let chosen = choose_within_cone(self.population(), here, heading_deg, cone_deg, rng);
        chosen.map_or(here, |p| p.position)
    }
}
