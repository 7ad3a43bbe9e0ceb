//! Search by what is believed of the plume: each sampler flies to where the team learns most in a second.
//!
//! At each step some plumes drawn from the [`Belief`] stand for it. Candidates of a sampler are the peaks of some of
//! them (Thompson sampling; Thompson 1933). A flight tells these plumes apart by where along it each would be met first and
//! how strongly; what it tells is the entropy of that partition, beyond what the flights already chosen for the rest of
//! the team tell (greedy choice, which for entropies is within 1 − 1/e of the best; Krause, Singh and Guestrin 2008). The sampler
//! takes the candidate that promises most a flown second, to find the peak included. So a team that knows nothing spreads out to
//! sweep all directions, and one that knows much flies straight.

use air::geo::{Position, wrap_signed_deg};
use rand::RngExt;
use rand::rngs::ChaCha8Rng;
use std::collections::BTreeMap;

use crate::archive::{Archive, Sample};
use crate::belief::{Belief, PlumeGuess, PlumePrior};
use crate::domain::Domain;
use crate::error::CseaError;
use crate::strategy::{PromisingPoint, Sampler, SearchStrategy};

/// Plumes that stand for the belief: entropies up to ln 64 = 4.2 nats are told.
const DRAWN: usize = 64;
/// Candidates of each sampler.
const CANDIDATES: usize = 8;
/// Places looked at along a flight, and how far apart they are at most, m: a plume's width a kilometre from its source.
const LOOKS: usize = 16;
const LOOK_M: f64 = 90.0;
/// A plume is met where it is this many standard deviations of the noise.
const MET_SD: f64 = 4.0;
/// Levels at which the strongest meeting is told apart, each four times the one before.
const LEVELS: f64 = 4.0;
/// To find the peak is worth as much as to tell all plumes that stand for the belief apart, nats.
const FOUND_NATS: f64 = 4.2;
/// The peak is found within this distance, m.
const FOUND_M: f64 = 100.0;
/// Readings are taken in averaged over this time, s.
const TAKEN_S: f64 = 1.0;
/// What a new order costs, s: short flights are not preferred for being short.
const ORDER_S: f64 = 8.0;

/// The strategy.
#[derive(Debug)]
pub struct ByPosterior {
    domain: Domain,
    belief: Belief,
    count: usize,
    points: Vec<PromisingPoint>,
    /// Plumes that stand for the belief until the next step, and their peaks.
    drawn: Vec<PlumeGuess>,
    peaks: Vec<Option<Position>>,
    /// What the flights ordered since the last step will tell of them, by sampler.
    flown_classes: BTreeMap<usize, Vec<u64>>,
    /// Of each sampler what it read in the present second.
    reading: Vec<Reading>,
}

/// Readings of one sampler within [`TAKEN_S`].
#[derive(Debug, Clone, Copy, Default)]
struct Reading {
    since_s: f64,
    count: f64,
    place: [f64; 3],
    ppm: f64,
}

impl ByPosterior {
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
            domain,
            belief: Belief::new(prior, rng)?,
            count,
            points: Vec::new(),
            drawn: Vec::new(),
            peaks: Vec::new(),
            flown_classes: BTreeMap::new(),
            reading: Vec::new(),
        })
    }

    /// What is believed now.
    pub fn belief(&self) -> &Belief {
        &self.belief
    }
}

/// Places along a straight flight towards `to`, its end the last; no farther than is looked ahead.
pub(crate) fn flight(from: Position, to: Position) -> Vec<Position> {
    let way_m = from.at.distance_m(to.at);
    let looked_m = way_m.min(LOOKS as f64 * LOOK_M);
    let count = ((looked_m / LOOK_M).ceil() as usize).clamp(1, LOOKS);
    let at = |k: usize| {
        let part = (k + 1) as f64 / count as f64 * looked_m / way_m.max(1e-9);
        let c = [0, 1, 2].map(|i| {
            let (a, b) = (from.coordinates()[i], to.coordinates()[i]);
            a + part * (b - a)
        });
        Position::from_coordinates(c)
    };
    (0..count).map(at).collect()
}

/// Entropy of a partition of equally likely cases into these classes, nats.
pub(crate) fn entropy(classes: &[u64]) -> f64 {
    let mut counts: BTreeMap<u64, f64> = BTreeMap::new();
    for class in classes {
        *counts.entry(*class).or_default() += 1.0;
    }
    let n = classes.len() as f64;
    counts.values().map(|c| -c / n * (c / n).ln()).sum()
}

impl ByPosterior {
    /// How a flight through `places` would tell each plume: where it is strongest there, and how strong; 0 where it is
    /// not met.
    pub(crate) fn predicted_classes(
        &mut self,
        drawn: &[PlumeGuess],
        places: &[Position],
    ) -> Vec<u64> {
        let least_ppm = MET_SD * self.belief.noise_ppm();
        let excess = self.belief.excess_ppm(drawn, places);
        let of = |row: &[f64]| {
            let best = (0..row.len()).max_by(|a, b| row[*a].total_cmp(&row[*b]));
            let Some(best) = best.filter(|k| row[*k] > least_ppm) else {
                return 0;
            };
            let level = ((row[best] / least_ppm).log2() / 2.0).min(LEVELS - 1.0);
            1 + best as u64 * LEVELS as u64 + level as u64
        };
        excess.chunks(places.len()).map(of).collect()
    }

    /// The best of some flights of a sampler beside those that the others fly, and what it tells of the plumes drawn.
    fn best_flight(
        &mut self,
        sampler: &Sampler,
        rng: &mut ChaCha8Rng,
    ) -> Option<(Position, Vec<u64>)> {
        let drawn = std::mem::take(&mut self.drawn);
        let known: Vec<Position> = self.peaks.iter().flatten().copied().collect();
        let mut classes = vec![0; drawn.len()];
        for (_, predicted) in self
            .flown_classes
            .iter()
            .filter(|(id, _)| **id != sampler.id)
        {
            join(&mut classes, predicted);
        }
        let before = entropy(&classes);
        let mut best: Option<(f64, Position, Vec<u64>)> = None;
        for _ in 0..CANDIDATES.min(known.len()) {
            let target = known[rng.random_range(0..known.len())];
            let places = flight(sampler.position, target);
            let predicted = self.predicted_classes(&drawn, &places);
            let mut both = classes.clone();
            join(&mut both, &predicted);
            let end = places.last().copied().unwrap_or(target);
            let near = |p: &&Option<Position>| p.is_some_and(|p| p.distance_m(end) < FOUND_M);
            let found = self.peaks.iter().filter(near).count() as f64 / self.peaks.len() as f64;
            let nats = entropy(&both) - before + FOUND_NATS * found;
            let score = nats / (ORDER_S + sampler.time_to_s(end));
            if best.as_ref().is_none_or(|b| score > b.0) {
                best = Some((score, target, predicted));
            }
        }
        self.drawn = drawn;
        best.map(|(_, target, predicted)| (target, predicted))
    }
}

/// Makes of a partition that by another one as well, by the mixing of splitmix64 (Steele, Lea and Flood 2014).
fn join(classes: &mut [u64], other: &[u64]) {
    for (class, part) in classes.iter_mut().zip(other) {
        let mut z = class
            .wrapping_mul(0x9E37_79B9_7F4A_7C15)
            .wrapping_add(*part);
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        *class = z ^ (z >> 27);
    }
}

impl SearchStrategy for ByPosterior {
    fn sense(&mut self, time_s: f64, sampler: usize, sample: &Sample, rng: &mut ChaCha8Rng) {
        if self.reading.len() <= sampler {
            self.reading.resize(sampler + 1, Reading::default());
        }
        let reading = &mut self.reading[sampler];
        if reading.count > 0.0 && time_s - reading.since_s >= TAKEN_S {
            let every_s = time_s - reading.since_s;
            let done = std::mem::take(reading);
            let sample = Sample {
                position: Position::from_coordinates(done.place.map(|c| c / done.count)),
                value: done.ppm / done.count,
            };
            self.belief.advance(time_s, rng);
            self.belief.take(&sample, every_s, rng);
        }
        let reading = &mut self.reading[sampler];
        if reading.count == 0.0 {
            reading.since_s = time_s;
        }
        reading.count += 1.0;
        reading.ppm += sample.value;
        for (sum, c) in reading.place.iter_mut().zip(sample.position.coordinates()) {
            *sum += c;
        }
    }

    fn step(&mut self, _archive: &Archive, rng: &mut ChaCha8Rng) -> &[PromisingPoint] {
        self.drawn = self.belief.draw(DRAWN, rng);
        let peak = |g| self.belief.peak(g, &self.domain);
        self.peaks = self.drawn.iter().map(peak).collect();
        self.flown_classes.clear();
        let drawn = self.belief.draw(self.count, rng);
        self.points.clear();
        for guess in drawn {
            let position = self
                .belief
                .peak(&guess, &self.domain)
                .unwrap_or_else(|| self.domain.draw(rng));
            let fitness = self.belief.excess_ppm(&[guess], &[position])[0];
            self.points.push(PromisingPoint { position, fitness });
        }
        &self.points
    }

    fn population(&self) -> &[PromisingPoint] {
        &self.points
    }

    fn direct(&mut self, sampler: &Sampler, _cone_deg: f64, rng: &mut ChaCha8Rng) -> Position {
        match self.best_flight(sampler, rng) {
            Some((target, predicted)) => {
                self.flown_classes.insert(sampler.id, predicted);
                target
            }
            None => self.domain.draw(rng),
        }
    }
}

impl Sampler {
    /// How long it flies to a place: turned towards it, straight on, and up or down as fast as it may, s.
    pub fn time_to_s(&self, to: Position) -> f64 {
        let way_m = self.position.at.distance_m(to.at);
        let bearing_deg = self.position.at.bearing_deg(to.at);
        let turn_rad = wrap_signed_deg(bearing_deg - self.heading_deg)
            .abs()
            .to_radians();
        let level_s = (way_m + turn_rad * self.turn_radius_m) / self.speed_m_s;
        let climb_s = (to.height_m - self.position.height_m).abs() / self.climb_m_s;
        level_s.max(climb_s)
    }
}
