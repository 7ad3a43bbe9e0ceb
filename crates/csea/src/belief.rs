//! What is believed of the plume that is searched for, and how readings change it.
//!
//! The belief is a set of weighted plumes (a particle filter; Gordon, Salmond and Smith 1993,
//! doi 10.1049/ip-f-2.1993.0015): each has a direction, a height, a strength and two spreads of its own, and lies in
//! a meander of its own (an Ornstein–Uhlenbeck process about its direction). A reading weighs them by how well they
//! predict it. Where few of them hold all weight they are drawn anew, moved a little towards their mean and scattered,
//! which keeps mean and covariance (Liu and West 2001).
//!
//! All plumes are the scenario's, seen from elsewhere: a turn of the wind is a turn of the place about the source, another
//! height and spread a shift and a stretch of it. So all of them are worked out by one model, many at a time.

use air::geo::{Enu, Position};
use infer::Estimate;
use plume::{DispersionModel, DispersionSpec, Place, PlaceColumns};
use rand::RngExt;
use rand::rngs::ChaCha8Rng;
use rand_distr::StandardNormal;

use crate::archive::Sample;
use crate::domain::Domain;
use crate::error::CseaError;

/// Plumes in the belief: with nothing known of the direction, some twenty within a standard deviation of the width of
/// one a kilometre from its source (class D), at each of a few heights.
const PLUMES: usize = 3000;
/// Plumes are drawn anew when so few of them, in parts, would hold as much (Liu and Chen 1998).
const FEW: f64 = 0.4;
/// How much of the spread a drawing scatters anew: 1 − a² with a = .99 (Liu and West 2001).
const SCATTER: f64 = 0.14;
/// A reading in a plume is off its mean by this part of it, one standard deviation, for which passes of real plumes differ
/// by a factor of two.
const FLUCTUATION: f64 = 0.5;
/// Readings nearer in time than this tell the same eddies, s: each counts for less by as much.
const SAME_EDDY_S: f64 = 3.0;
/// A direction of which nothing is known: one standard deviation of 360° alike is 104°.
const ALL_ROUND_DEG: f64 = 100.0;
/// Steps at which the nearest allowed place on an axis is looked for, m.
const AXIS_STEP_M: f64 = 25.0;

/// What is known of the plume before the search.
#[derive(Debug, Clone)]
pub struct PlumePrior {
    /// The plume as it is supposed to be; of its sources the first counts.
    pub base: DispersionSpec,
    /// Direction towards which its axis runs, degrees; with 100° or more nothing is known of it.
    pub axis_deg: Estimate,
    /// Height of the axis, m above mean sea level.
    pub height_amsl_m: Estimate,
    /// Standard deviation of ln of the strength.
    pub ln_strength_sd: f64,
    /// Standard deviation of ln of the spread across, and in height.
    pub ln_spread_sd: f64,
    /// Background, ppm.
    pub background_ppm: Estimate,
    /// Noise of a reading, one standard deviation, ppm.
    pub noise_ppm: f64,
    /// Meander of the axis: one standard deviation, degrees, and how long it lasts, s.
    pub meander: (f64, f64),
}

/// A plume that may be.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PlumeGuess {
    /// How far its axis is turned from the base's, degrees clockwise, in the mean.
    pub turn_deg: f64,
    /// How far its axis is above the base's, m.
    pub lift_m: f64,
    /// ln of its strength over the base's.
    pub ln_strength: f64,
    /// ln of its spread across over the base's.
    pub ln_across: f64,
    /// ln of its spread in height over the base's.
    pub ln_up: f64,
    /// How far its axis now lies beside its mean, degrees clockwise.
    pub meander_deg: f64,
}

impl PlumeGuess {
    const FIXED: usize = 5;

    fn fixed(&self) -> [f64; Self::FIXED] {
        [
            self.turn_deg,
            self.lift_m,
            self.ln_strength,
            self.ln_across,
            self.ln_up,
        ]
    }

    fn with_fixed(self, f: [f64; Self::FIXED]) -> Self {
        Self {
            turn_deg: f[0],
            lift_m: f[1],
            ln_strength: f[2],
            ln_across: f[3],
            ln_up: f[4],
            ..self
        }
    }
}

/// How a plume lies: a place in it is one of the base's.
struct Seen {
    /// Sine and cosine of the direction of its axis.
    towards: (f64, f64),
    /// Spread of the base over its own, across and up.
    across: f64,
    up: f64,
    axis_amsl_m: f64,
}

/// The belief.
#[derive(Debug, Clone)]
pub struct Belief {
    prior: PlumePrior,
    /// The base without its background, turned so that its axis runs as the prior has it.
    model: DispersionModel,
    /// Sine and cosine of the direction of its axis.
    towards: (f64, f64),
    guesses: Vec<PlumeGuess>,
    ln_weights: Vec<f64>,
    time_s: f64,
    columns: [Vec<f64>; 3],
    excess_ppm: Vec<f64>,
}

impl Belief {
    /// What is believed before the first reading.
    ///
    /// # Errors
    /// A base that is no plume.
    pub fn new(prior: PlumePrior, rng: &mut ChaCha8Rng) -> Result<Self, CseaError> {
        let mut base = prior.base.clone();
        base.sources.truncate(1);
        base.background_ppm = 0.0;
        base.mechanisms.clear();
        base.ground_reflection = false;
        base.mixing_height_m = None;
        let off_deg = prior.axis_deg.value - air::wind::towards_deg(base.wind.from_deg());
        base.wind = base.wind.turned(off_deg);
        let source = &mut base.sources[0];
        source.effective_height_agl_m = (prior.height_amsl_m.value - base.ground_amsl_m).max(1.0);
        source.area = None;
        let model = DispersionModel::new(base).map_err(|e| CseaError::Plume(e.to_string()))?;
        let guesses = (0..PLUMES).map(|k| drawn(&prior, k, rng)).collect();
        Ok(Self {
            model,
            towards: prior.axis_deg.value.to_radians().sin_cos(),
            guesses,
            ln_weights: vec![0.0; PLUMES],
            time_s: 0.0,
            columns: Default::default(),
            excess_ppm: Vec::new(),
            prior,
        })
    }

    /// Noise of a reading, ppm.
    pub fn noise_ppm(&self) -> f64 {
        self.prior.noise_ppm
    }

    /// Lets time pass: axes meander.
    pub fn advance(&mut self, time_s: f64, rng: &mut ChaCha8Rng) {
        let (sd_deg, lasts_s) = self.prior.meander;
        let passed_s = (time_s - self.time_s).max(0.0);
        self.time_s = self.time_s.max(time_s);
        if passed_s == 0.0 || sd_deg == 0.0 {
            return;
        }
        let kept = (-passed_s / lasts_s.max(f64::MIN_POSITIVE)).exp();
        let fresh_deg = sd_deg * (1.0 - kept * kept).sqrt();
        for guess in &mut self.guesses {
            let draw: f64 = rng.sample(StandardNormal);
            guess.meander_deg = kept * guess.meander_deg + fresh_deg * draw;
        }
    }

    /// Takes in a reading, of which there is one every `every_s` by its sampler.
    pub fn take(&mut self, sample: &Sample, every_s: f64, rng: &mut ChaCha8Rng) {
        self.fill_excess(&[sample.position]);
        let read_ppm = sample.value - self.prior.background_ppm.value;
        let counts = (every_s / SAME_EDDY_S).min(1.0);
        let still = self.prior.noise_ppm.hypot(self.prior.background_ppm.sd);
        for (ln_weight, excess_ppm) in self.ln_weights.iter_mut().zip(&self.excess_ppm) {
            let sd = still.hypot(FLUCTUATION * excess_ppm.max(read_ppm));
            let off = (read_ppm - excess_ppm) / sd;
            *ln_weight -= counts * (0.5 * off * off + sd.ln());
        }
        if self.effective_part() < FEW {
            self.draw_anew(rng);
        }
    }

    /// Weights of all plumes; their sum is one.
    pub fn weights(&self) -> Vec<f64> {
        let top = self
            .ln_weights
            .iter()
            .copied()
            .fold(f64::NEG_INFINITY, f64::max);
        let mut weights: Vec<f64> = self.ln_weights.iter().map(|w| (w - top).exp()).collect();
        let sum: f64 = weights.iter().sum();
        weights.iter_mut().for_each(|w| *w /= sum);
        weights
    }

    /// `count` plumes drawn by their weights, in order of direction; they stand for the belief as equals.
    pub fn draw(&self, count: usize, rng: &mut ChaCha8Rng) -> Vec<PlumeGuess> {
        let mut drawn: Vec<PlumeGuess> = systematic(&self.weights(), count, rng)
            .map(|k| self.guesses[k])
            .collect();
        drawn.sort_by(|a, b| a.turn_deg.total_cmp(&b.turn_deg));
        drawn
    }

    /// What each of `guesses` has above the background at each of `places` now, ppm: one row after the other of all
    /// places.
    pub fn excess_ppm(&mut self, guesses: &[PlumeGuess], places: &[Position]) -> &[f64] {
        self.columns.iter_mut().for_each(Vec::clear);
        for guess in guesses {
            let seen = self.seen_by(guess);
            for place in places {
                self.push(&seen, *place);
            }
        }
        self.evaluate();
        let rows = self.excess_ppm.chunks_mut(places.len().max(1));
        for (guess, row) in guesses.iter().zip(rows) {
            let factor = guess.ln_strength.exp();
            row.iter_mut().for_each(|ppm| *ppm *= factor);
        }
        &self.excess_ppm
    }

    /// Where in `domain` a plume is strongest in the mean: the nearest place on its axis; none where its axis does not
    /// meet it.
    pub fn peak(&self, guess: &PlumeGuess, domain: &Domain) -> Option<Position> {
        let (low, high) = (domain.low(), domain.high());
        let lift = self.prior.height_amsl_m.value + guess.lift_m;
        let height_m = lift.clamp(low.height_m, high.height_m);
        let source = self.source();
        let bearing_deg = self.prior.axis_deg.value + guess.turn_deg;
        let steps = (domain.reach_m(source) / AXIS_STEP_M) as usize;
        let place = |k: usize| Position {
            at: source.displaced(bearing_deg, AXIS_STEP_M * k as f64),
            height_m,
        };
        (1..=steps).map(place).find(|p| domain.contains(*p))
    }

    /// Mean and standard deviation of the direction in which the axis runs, degrees, on the circle.
    pub fn axis_deg(&self) -> Estimate {
        let (mut sin, mut cos) = (0.0, 0.0);
        for (guess, weight) in self.guesses.iter().zip(self.weights()) {
            let (s, c) = guess.turn_deg.to_radians().sin_cos();
            (sin, cos) = (sin + weight * s, cos + weight * c);
        }
        let length = sin.hypot(cos).min(1.0);
        Estimate {
            value: air::geo::wrap_deg(self.prior.axis_deg.value + sin.atan2(cos).to_degrees()),
            // Mardia and Jupp (2000), equation 2.3.14.
            sd: (-2.0 * length.ln()).sqrt().to_degrees(),
        }
    }

    fn source(&self) -> Enu {
        self.model.spec().sources[0].place
    }

    fn fill_excess(&mut self, places: &[Position]) {
        let guesses = std::mem::take(&mut self.guesses);
        self.excess_ppm(&guesses, places);
        self.guesses = guesses;
    }

    /// How a guess sees places.
    fn seen_by(&self, guess: &PlumeGuess) -> Seen {
        let bearing_deg = self.prior.axis_deg.value + guess.turn_deg + guess.meander_deg;
        Seen {
            towards: bearing_deg.to_radians().sin_cos(),
            across: (-guess.ln_across).exp(),
            up: (-guess.ln_up).exp(),
            axis_amsl_m: self.prior.height_amsl_m.value + guess.lift_m,
        }
    }

    /// A place as the base's plume has it where a guess has this one.
    fn push(&mut self, seen: &Seen, place: Position) {
        let (source, (sin, cos)) = (self.source(), seen.towards);
        let (east, north) = (
            place.at.east_m - source.east_m,
            place.at.north_m - source.north_m,
        );
        let along_m = east * sin + north * cos;
        let across_m = (east * cos - north * sin) * seen.across;
        let above_m = (place.height_m - seen.axis_amsl_m) * seen.up;
        let (sin, cos) = self.towards;
        self.columns[0].push(source.east_m + along_m * sin + across_m * cos);
        self.columns[1].push(source.north_m + along_m * cos - across_m * sin);
        let axis_agl_m = self.model.spec().sources[0].effective_height_agl_m;
        self.columns[2].push(axis_agl_m + above_m);
    }

    fn evaluate(&mut self) {
        let places = PlaceColumns {
            east_m: &self.columns[0],
            north_m: &self.columns[1],
            height_agl_m: &self.columns[2],
        };
        if self
            .model
            .fill_mean_ppm(places, self.time_s, &mut self.excess_ppm)
            .is_err()
        {
            // Columns are as long as each other.
            let at = |k: usize| Place {
                east_m: self.columns[0][k],
                north_m: self.columns[1][k],
                height_agl_m: self.columns[2][k],
            };
            let each = 0..self.columns[0].len();
            self.excess_ppm = each
                .map(|k| self.model.mean_ppm(&at(k), self.time_s))
                .collect();
        }
    }

    fn effective_part(&self) -> f64 {
        let weights = self.weights();
        let squares: f64 = weights.iter().map(|w| w * w).sum();
        1.0 / squares / weights.len() as f64
    }

    fn draw_anew(&mut self, rng: &mut ChaCha8Rng) {
        let weights = self.weights();
        let axis = self.axis_deg();
        let middle_deg = air::geo::wrap_signed_deg(axis.value - self.prior.axis_deg.value);
        // About the mean direction, so that a mean and a spread have a meaning.
        for guess in &mut self.guesses {
            let off = air::geo::wrap_signed_deg(guess.turn_deg - middle_deg);
            guess.turn_deg = middle_deg + off;
        }
        let mut mean = [0.0; PlumeGuess::FIXED];
        let mut variance = [0.0; PlumeGuess::FIXED];
        for (guess, weight) in self.guesses.iter().zip(&weights) {
            for (m, f) in mean.iter_mut().zip(guess.fixed()) {
                *m += weight * f;
            }
        }
        for (guess, weight) in self.guesses.iter().zip(&weights) {
            for ((v, f), m) in variance.iter_mut().zip(guess.fixed()).zip(mean) {
                *v += weight * (f - m) * (f - m);
            }
        }
        let kept = (1.0 - SCATTER * SCATTER).sqrt();
        let drawn: Vec<usize> = systematic(&weights, self.guesses.len(), rng).collect();
        let moved = |k: usize, rng: &mut ChaCha8Rng| {
            let guess = self.guesses[k];
            let mut fixed = guess.fixed();
            for (i, f) in fixed.iter_mut().enumerate() {
                let draw: f64 = rng.sample(StandardNormal);
                *f = mean[i] + kept * (*f - mean[i]) + SCATTER * variance[i].sqrt() * draw;
            }
            guess.with_fixed(fixed)
        };
        self.guesses = drawn.into_iter().map(|k| moved(k, rng)).collect();
        self.ln_weights.iter_mut().for_each(|w| *w = 0.0);
    }
}

/// A plume as the prior has it. Of a direction of which nothing is known, each has its own.
fn drawn(prior: &PlumePrior, k: usize, rng: &mut ChaCha8Rng) -> PlumeGuess {
    let mut normal = |sd: f64| {
        let draw: f64 = rng.sample(StandardNormal);
        sd * draw
    };
    let turn_deg = if prior.axis_deg.sd >= ALL_ROUND_DEG {
        360.0 * (k as f64 + 0.5) / PLUMES as f64 - 180.0
    } else {
        normal(prior.axis_deg.sd)
    };
    PlumeGuess {
        turn_deg,
        lift_m: normal(prior.height_amsl_m.sd),
        ln_strength: normal(prior.ln_strength_sd),
        ln_across: normal(prior.ln_spread_sd),
        ln_up: normal(prior.ln_spread_sd),
        meander_deg: normal(prior.meander.0),
    }
}

/// Indices drawn by `weights` at even steps from one random start (Carpenter, Clifford and Fearnhead 1999).
fn systematic(weights: &[f64], count: usize, rng: &mut ChaCha8Rng) -> impl Iterator<Item = usize> {
    let start: f64 = rng.random();
    let (mut sum, mut index) = (weights.first().copied().unwrap_or(1.0), 0);
    let mut out = Vec::with_capacity(count);
    for n in 0..count {
        let at = (n as f64 + start) / count as f64;
        while at > sum && index + 1 < weights.len() {
            index += 1;
            sum += weights[index];
        }
        out.push(index);
    }
    out.into_iter()
}
