//! Infotaxis: each sampler makes the move after which least is expected to be left to find out.
//!
//! Vergassola, Villermaux and Shraiman (2007), doi 10.1038/nature05464, in the form that knows of space (Loisy and Eloy 2022,
//! doi 10.1098/rspa.2022.0118, equation 3.6): of the moves that are open, the one with the least
//! expected log₂(D + 2^(H − 1) − ½), where H is the entropy that is left, bits, and D the mean distance to where the peak may be, in
//! moves. The belief is that of [`crate::ByPosterior`]; each sampler decides for itself, as in the source.

use air::geo::Position;
use rand::rngs::ChaCha8Rng;

use crate::archive::{Archive, Sample};
use crate::belief::PlumePrior;
use crate::domain::Domain;
use crate::error::CseaError;
use crate::posterior::{ByPosterior, entropy, flight};
use crate::strategy::{PromisingPoint, Sampler, SearchStrategy};

/// Directions of a move, from the heading, degrees.
const TURNS_DEG: [f64; 9] = [0.0, 20.0, -20.0, 45.0, -45.0, 90.0, -90.0, 135.0, -135.0];
/// A move lasts this long, s.
const MOVE_S: f64 = 15.0;
/// Plumes that stand for the belief.
const DRAWN: usize = 64;

/// The strategy.
#[derive(Debug)]
pub struct Infotaxis {
    domain: Domain,
    inner: ByPosterior,
}

impl Infotaxis {
    /// A search over `domain` for a plume of which `prior` is known. `count` promising points are made at each step.
    ///
    /// # Errors
    /// A prior that describes no plume.
    pub fn new(
        domain: Domain,
        prior: PlumePrior,
        count: usize,
        rng: &mut ChaCha8Rng,
    ) -> Result<Self, CseaError> {
        Ok(Self {
            inner: ByPosterior::new(domain.clone(), prior, count, rng)?,
            domain,
        })
    }

    fn moves(&self, sampler: &Sampler) -> Vec<Position> {
        let (low, high) = (self.domain.low().height_m, self.domain.high().height_m);
        let way_m = MOVE_S * sampler.speed_m_s;
        let up_m = MOVE_S * sampler.climb_m_s;
        let level = TURNS_DEG.iter().flat_map(|turn| {
            let at = sampler
                .position
                .at
                .displaced(sampler.heading_deg + turn, way_m);
            [0.0, up_m, -up_m].map(|up| Position {
                at,
                height_m: (sampler.position.height_m + up).clamp(low, high),
            })
        });
        level.filter(|p| self.domain.contains(*p)).collect()
    }
}

impl SearchStrategy for Infotaxis {
    fn sense(&mut self, time_s: f64, sampler: usize, sample: &Sample, rng: &mut ChaCha8Rng) {
        self.inner.sense(time_s, sampler, sample, rng);
    }

    fn step(&mut self, archive: &Archive, rng: &mut ChaCha8Rng) -> &[PromisingPoint] {
        self.inner.step(archive, rng)
    }

    fn population(&self) -> &[PromisingPoint] {
        self.inner.population()
    }

    fn direct(&mut self, sampler: &Sampler, _cone_deg: f64, rng: &mut ChaCha8Rng) -> Position {
        let drawn = self.inner.belief().draw(DRAWN, rng);
        let peak = |g| self.inner.belief().peak(g, &self.domain);
        let peaks: Vec<Position> = drawn.iter().filter_map(peak).collect();
        let way_m = MOVE_S * sampler.speed_m_s;
        let mut best: Option<(f64, Position)> = None;
        for to in self.moves(sampler) {
            let predicted = self
                .inner
                .predicted_classes(&drawn, &flight(sampler.position, to));
            let left_bits = ((DRAWN as f64).ln() - entropy(&predicted)) / std::f64::consts::LN_2;
            let far_m =
                peaks.iter().map(|p| p.distance_m(to)).sum::<f64>() / peaks.len().max(1) as f64;
            let cost = (far_m / way_m + (left_bits - 1.0).exp2() - 0.5)
                .max(f64::MIN_POSITIVE)
                .log2();
            if best.is_none_or(|b| cost < b.0) {
                best = Some((cost, to));
            }
        }
        // Outside the domain there is no move: back into it.
        best.map_or_else(|| self.domain.inside(), |b| b.1)
    }
}
