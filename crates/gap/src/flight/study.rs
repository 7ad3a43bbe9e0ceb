//! One question put to the data: linearise, search, go there, linearise again.

use std::sync::Arc;

use fdm::Aircraft;
use fdm::dynamics::rotation;
use fdm::mechanism::CATALOGUE;
use nalgebra::{Cholesky, DMatrix, DVector};

use super::channel::{CHANNELS, at};
use super::equation_error::{self, EquationError};
use super::evidence::{Candidate, Kind, Model, Word, beyond_chance, dispersion, sum, with_priors};
use super::filter::{Aside, Columns, Keep, Pass, run};
use super::gate::{Gated, Segment};
use super::motion::{World, through_air, towards};
use super::noise::{self, Noise};
use super::normal::{Block, Normal};
use super::parameters::{Effect, Parameter, all, unknown};
use super::rival::{Nameless, Terms};
use crate::GapError;
use crate::verdict::Measured;

/// Log prior of a mechanism's being at work: what keeps false alarms below a hundredth with the
/// length of the catalogue.
const MECHANISM_LOG_PRIOR: f64 = -5.5;
/// Log prior of a nameless term: a name is to be preferred where both do.
const RIVAL_LOG_PRIOR: f64 = -8.0;
/// Log prior of a mechanism's beginning in flight rather than being there from the beginning: the one as probable as the other.
const LATE_LOG_PRIOR: f64 = -std::f64::consts::LN_2;
/// What an onset costs before it is known how well the data tell it: as if to a hundredth of the flight.
const ONSET_LOG_PRICE: f64 = -4.6;
/// Prior standard deviations beyond which a size is not that of a mechanism: three, less what the
/// tolerance adds.
const PLAUSIBLE_SD: f64 = 2.9;
/// A fault is larger than what differs between an aircraft and its file, by this factor: a surface may
/// come off.
const FAULT_FACTOR: f64 = 3.0;
/// Blocks that a flight is cut into at least; they are not shorter than [`BLOCK_S`].
const BLOCKS: f64 = 40.0;
/// Shortest block, s.
const BLOCK_S: f64 = 5.0;
/// Most linearisations on one way.
const ROUNDS: usize = 3;
/// Most ways gone.
const RIVALS: usize = 3;
/// Part of its gain by which a rival may seem worse than the best and still be looked at.
const RIVAL_PART: f64 = 0.5;
/// Parts of a step that are tried, and what one may lose, nats: chance does as much.
pub const STEP: (i32, f64) = (3, 1.0);

/// Most steps of a fit of the noise from nothing, from what it was nearby, and from what a share of
/// the data told.
const NOISE_STEPS: [usize; 3] = [12, 4, 2];
/// Most stretches that the search looks at, and samples of each: at 50 Hz a minute and a half, by
/// which effects that are worth a name show many times over, in pieces long against the gusts.
const SEARCH_STRETCHES: [usize; 2] = [5, 900];

/// Gain of a step, nats, after which the base has settled.
const SETTLED_NATS: f64 = 5.0;

/// When something set in.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Onset {
    /// In which log.
    pub log: usize,
    /// Time, s.
    pub at_s: f64,
}

/// The data and all that may be asked of them. Columns are those of the parameters, of nameless terms, and of what
/// the mechanisms' parameters, which come first, change by at the onset.
#[derive(Clone)]
pub struct Study<'a> {
    /// The aircraft of the file.
    pub aircraft: &'a Aircraft,
    /// What passed the gate.
    pub gated: &'a Gated,
    /// Parameters of mechanisms, tolerances and winds.
    pub parameters: Vec<Parameter>,
    /// Nameless terms.
    pub terms: Arc<Terms>,
    /// Mechanisms, nameless terms, and mechanisms that begin at the onset.
    pub candidates: Vec<Candidate>,
    /// When those that begin in flight do.
    pub onset: Option<Onset>,
    /// The same with what it may be off by, once the data have told it.
    pub onset_s: Option<Measured>,
    /// How many times the data are what is looked at.
    stand_for: f64,
}

/// The data seen from one point.
#[derive(Debug, Clone)]
pub struct Linear {
    /// Where: departures of the parameters.
    pub theta: Vec<f64>,
    /// The noise there.
    pub noise: Noise,
    /// Normal equations by blocks, the score as at zero.
    pub blocks: Vec<Block>,
    /// Log score there, nats.
    pub log_score: f64,
    /// How much more the score varies from block to block than the information says.
    pub dispersion: f64,
    /// What they say, weakened by so much of the dispersion as chance does not add.
    pub word: Word,
    /// Best models.
    pub models: Vec<Model>,
    /// Log posterior of the best model on the scale of `log_score`: what views from different
    /// points are compared by.
    pub log_posterior: f64,
}

impl Linear {
    /// The same with the prior of the noise, for views with different ones.
    pub fn with_noise_prior(&self) -> f64 {
        self.log_posterior + self.noise.log_prior()
    }
}

impl<'a> Study<'a> {
    /// Prepares the question.
    pub fn new(aircraft: &'a Aircraft, gated: &'a Gated, logs: usize) -> Self {
        let parameters = all(aircraft, gated, logs);
        let mut study = Self::of(aircraft, gated, parameters, Terms::of(aircraft, gated));
        study.candidates = study.candidates();
        study
    }

    /// The same of an aircraft without published coefficients: all of them are free, and nothing else is asked for.
    pub fn of_unknown(aircraft: &'a Aircraft, gated: &'a Gated, logs: usize) -> Self {
        let mut terms = Terms::of(aircraft, gated);
        terms.groups.clear();
        Self::of(aircraft, gated, unknown(aircraft, gated, logs), terms)
    }

    fn of(
        aircraft: &'a Aircraft,
        gated: &'a Gated,
        parameters: Vec<Parameter>,
        terms: Terms,
    ) -> Self {
        Self {
            aircraft,
            gated,
            parameters,
            terms: Arc::new(terms),
            candidates: Vec::new(),
            onset: None,
            onset_s: None,
            stand_for: 1.0,
        }
    }

    /// The data seen from the file's aircraft, with the noise that they have there.
    pub fn seen_from_start(&self) -> Linear {
        let start = self.start();
        let noise = self.noise(&start, Noise::usual(), NOISE_STEPS[0]);
        self.linearise(start, noise)
    }

    /// The data seen from `theta`, with the noise that they have there, near `noise`.
    pub fn seen_with_own_noise(&self, theta: Vec<f64>, noise: Noise) -> Linear {
        let noise = self.noise(&theta, noise, NOISE_STEPS[1]);
        self.linearise(theta, noise)
    }

    /// What may be at work, from what the parameters are.
    fn candidates(&self) -> Vec<Candidate> {
        let mechanisms = CATALOGUE.iter().enumerate().filter_map(|(m, spec)| {
            let is_of =
                |j: &usize| matches!(self.parameters[*j].effect, Effect::Mechanism(k, _) if k == m);
            let columns: Vec<usize> = (0..self.parameters.len()).filter(is_of).collect();
            (!columns.is_empty()).then(|| Candidate {
                name: spec.id.to_owned(),
                kind: Kind::Mechanism,
                prior_sd: columns
                    .iter()
                    .filter_map(|&j| self.parameters[j].prior_sd)
                    .collect(),
                columns,
                one_sided: spec.parameters[0].low >= spec.parameters[0].neutral,
                plausible_sd: PLAUSIBLE_SD,
                log_prior: MECHANISM_LOG_PRIOR,
            })
        });
        let mechanisms: Vec<Candidate> = mechanisms.collect();
        let mut at = self.parameters.len();
        let nameless = self.terms.groups.iter().enumerate().map(|(k, group)| {
            at += group.columns;
            Candidate {
                name: group.words(),
                kind: Kind::Nameless(k),
                columns: (at - group.columns..at).collect(),
                prior_sd: vec![1.0; group.columns],
                one_sided: false,
                plausible_sd: f64::INFINITY,
                log_prior: RIVAL_LOG_PRIOR,
            }
        });
        let nameless: Vec<Candidate> = nameless.collect();
        let late = mechanisms
            .iter()
            .filter(|_| self.onset.is_some())
            .map(|c| Candidate {
                kind: Kind::Late,
                columns: c.columns.iter().map(|j| self.first_late() + j).collect(),
                prior_sd: c.prior_sd.iter().map(|sd| FAULT_FACTOR * sd).collect(),
                log_prior: MECHANISM_LOG_PRIOR + LATE_LOG_PRIOR + ONSET_LOG_PRICE,
                ..c.clone()
            });
        let late: Vec<Candidate> = late.collect();
        [mechanisms, nameless, late].concat()
    }

    /// The first column of what changes at the onset.
    pub fn first_late(&self) -> usize {
        self.parameters.len() + self.terms.count()
    }

    /// Number of parameters of mechanisms.
    pub fn of_mechanisms(&self) -> usize {
        self.parameters
            .iter()
            .filter(|p| p.prior_sd.is_some())
            .count()
    }

    /// Number of columns.
    pub fn width(&self) -> usize {
        self.first_late() + self.onset.map_or(0, |_| self.of_mechanisms())
    }

    /// The same question with mechanisms that begin at `onset` besides, in place of those of another
    /// onset.
    pub fn with_onset(&self, onset: Onset) -> Self {
        let mut with = self.clone();
        with.onset = Some(onset);
        if self.onset.is_none() {
            with.candidates = with.candidates();
        }
        with
    }

    /// Says when the onset is and what that costs: the logarithm of the part of the flight that it is
    /// known to be in.
    pub fn pay(&mut self, onset_s: Measured, log_price: f64) {
        self.onset_s = Some(onset_s);
        for late in self.candidates.iter_mut().filter(|c| c.kind == Kind::Late) {
            late.log_prior = MECHANISM_LOG_PRIOR + LATE_LOG_PRIOR + log_price;
        }
    }

    /// Whether something of `set` begins at the onset.
    pub fn has_late(&self, set: &[usize]) -> bool {
        set.iter().any(|k| self.candidates[*k].kind == Kind::Late)
    }

    /// First and last time of a log at which something may set in with `side_s` flown before and after, s.
    pub fn onsets_s(&self, log: usize, side_s: f64) -> [f64; 2] {
        let of_log = self.gated.segments.iter().filter(|s| s.log == log);
        let times = || of_log.clone().flat_map(|s| s.time_s.iter().copied());
        let from_s = times().fold(f64::INFINITY, f64::min) + side_s;
        let to_s = times().fold(f64::NEG_INFINITY, f64::max) - side_s;
        [from_s, to_s.max(from_s)]
    }

    /// How long was flown, s.
    pub fn flown_s(&self) -> f64 {
        self.gated.segments.iter().map(Segment::duration_s).sum()
    }

    /// The world of `segment` at `theta`.
    pub fn world(&self, segment: &Segment, theta: &[f64]) -> World {
        self.world_like(segment, theta, None)
    }

    /// The same; `like` lends its surfaces.
    fn world_like(&self, segment: &Segment, theta: &[f64], like: Option<&World>) -> World {
        let flown = |theta: &[f64], like| {
            let terms = &theta[self.parameters.len()..self.first_late()];
            let nameless = Nameless::new(&self.terms, terms);
            World::new(
                self.aircraft,
                &self.parameters,
                theta,
                nameless,
                segment,
                like,
            )
        };
        let early = flown(theta, like);
        let late = &theta[self.first_late()..];
        let sets_in = |p: &Parameter, v: f64| v != 0.0 && p.servo;
        let is_late = |o: &Onset| o.log == segment.log && late.iter().any(|v| *v != 0.0);
        let Some(onset) = self.onset.filter(is_late) else {
            return early;
        };
        let from = segment.time_s.partition_point(|t| *t < onset.at_s);
        if from >= segment.len() {
            return early;
        }
        // Surfaces move as before unless what moves them sets in.
        let like = if self
            .parameters
            .iter()
            .zip(late)
            .any(|(p, v)| sets_in(p, *v))
        {
            like.map(World::last)
        } else {
            Some(&early)
        };
        let mut after = theta.to_vec();
        for (value, late) in after.iter_mut().zip(late) {
            *value += late;
        }
        let later = flown(&after, like);
        early.until(from, later)
    }

    /// The base at zero, but for the winds, which the data tell.
    pub fn start(&self) -> Vec<f64> {
        let mut theta = vec![0.0; self.width()];
        for (value, parameter) in theta.iter_mut().zip(&self.parameters) {
            if let Effect::Wind(log, axis) = parameter.effect
                && !self.gated.has_wind
            {
                *value = mean_wind(&self.gated.segments, log)[axis];
            }
        }
        theta
    }

    /// What accelerations say without a filter, where rows are close enough to tell it.
    pub fn equation_error(&self) -> EquationError {
        let start = self.start();
        let all = &self.gated.segments;
        let segments = if self.gated.tells_delays {
            &all[..]
        } else {
            &[]
        };
        let worlds: Vec<World> = segments.iter().map(|s| self.world(s, &start)).collect();
        equation_error::analyse(segments, &worlds, self.aircraft)
    }

    /// Fits the noise at `theta`.
    pub fn noise(&self, theta: &[f64], from: Noise, steps: usize) -> Noise {
        let flown = |s: &'a Segment| (s, self.world(s, theta));
        let flown: Vec<_> = self.gated.segments.iter().map(flown).collect();
        noise::fit(&flown, from, steps)
    }

    /// Passes over all segments at `theta`, with what was predicted.
    pub fn passes(&self, theta: &[f64], noise: &Noise) -> Vec<Pass> {
        let segments = self.gated.segments.iter();
        let pass = |s| run(s, &self.world(s, theta), noise, Keep::States, None);
        segments.map(pass).collect()
    }

    /// Log score of all data at `theta`.
    pub fn log_score(&self, theta: &[f64], noise: &Noise) -> f64 {
        let segments = self.gated.segments.iter();
        let score = |s| run(s, &self.world(s, theta), noise, Keep::Nothing, None).log_score;
        segments.map(score).sum::<f64>() * self.stand_for
    }

    fn columns<'b>(&'b self, segment: &Segment, theta: &[f64], base: &World) -> Columns<'b> {
        let late = (self.first_late()..self.width()).zip(&self.parameters);
        let each: Vec<(usize, &Parameter)> =
            self.parameters.iter().enumerate().chain(late).collect();
        let aside = |(column, parameter): &(usize, &Parameter)| {
            let mut aside = theta.to_vec();
            aside[*column] += parameter.step;
            let like = (!parameter.servo).then_some(base);
            Aside {
                column: *column,
                world: self.world_like(segment, &aside, like),
                step: parameter.step,
            }
        };
        Columns {
            count: self.width(),
            worlds: infer::parallel_map(&each, aside),
            terms: &self.terms,
            first_term: self.parameters.len(),
        }
    }

    /// The normal equations at `theta` in blocks of `block_s`, their score as at zero, and the log score.
    pub fn blocks(&self, theta: &[f64], noise: &Noise, block_s: f64) -> (Vec<Block>, f64) {
        let mut normal = Normal::new(self.width(), block_s);
        let mut log_score = 0.0;
        for segment in &self.gated.segments {
            let world = self.world(segment, theta);
            let columns = self.columns(segment, theta, &world);
            let with = Some((&columns, &mut normal));
            log_score += run(segment, &world, noise, Keep::Nothing, with).log_score;
        }
        let mut blocks = normal.finish();
        let here = DVector::from_column_slice(theta);
        for block in &mut blocks {
            // As if linearised at zero: the score there is that here plus information times way.
            let moved = &block.a * &here;
            block.squares += here.dot(&moved) + 2.0 * here.dot(&block.b);
            block.b += moved;
        }
        (blocks, log_score)
    }

    /// The data seen from `theta` with `noise`.
    pub fn linearise(&self, theta: Vec<f64>, noise: Noise) -> Linear {
        let block_s = (self.flown_s() / BLOCKS).max(BLOCK_S);
        let (mut blocks, log_score) = self.blocks(&theta, &noise, block_s);
        let log_score = log_score * self.stand_for;
        let here = DVector::from_column_slice(&theta);
        let (a, b) = sum(&blocks);
        let fitted = self.posterior(&a, &b, &[]).0;
        let own = (0..self.parameters.len()).chain(self.first_late()..self.width());
        let dispersion = dispersion(&blocks, &fitted, own);
        for block in &mut blocks {
            block.a *= self.stand_for;
            block.b *= self.stand_for;
            block.squares *= self.stand_for;
        }
        let (a, b) = (a * self.stand_for, b * self.stand_for);
        let spread = beyond_chance(dispersion, blocks.len());
        let word = Word::new(&a, &b, &self.tolerances(), spread);
        let models = word.search(&self.candidates);
        // From the score here to that seen at zero, from where evidence counts.
        let way = (here.dot(&b) - 0.5 * here.dot(&(&a * &here))) / spread;
        let log_posterior = log_score - way + word.base_log_evidence + models[0].log_posterior;
        Linear {
            theta,
            noise,
            blocks,
            log_score,
            dispersion,
            word,
            models,
            log_posterior,
        }
    }

    /// Tolerances of the parameters.
    pub fn tolerances(&self) -> Vec<f64> {
        self.parameters.iter().map(|p| p.tolerance).collect()
    }

    /// The most probable values of all columns when `set` is at work, and their covariance; nil for
    /// nameless terms and onsets that are not.
    pub fn posterior(
        &self,
        a: &DMatrix<f64>,
        b: &DVector<f64>,
        set: &[usize],
    ) -> (DVector<f64>, DMatrix<f64>) {
        let n = self.width();
        let mut sds = self.tolerances();
        sds.resize(n, 0.0);
        for candidate in set.iter().map(|&k| &self.candidates[k]) {
            for (&j, sd) in candidate.columns.iter().zip(&candidate.prior_sd) {
                sds[j] = f64::hypot(sds[j], *sd);
            }
        }
        let free: Vec<usize> = (0..n).filter(|&j| sds[j] > 0.0).collect();
        let own: Vec<f64> = free.iter().map(|&j| sds[j]).collect();
        let precision = with_priors(a.select_rows(&free).select_columns(&free), &own);
        let mut covariance = DMatrix::zeros(n, n);
        if let Some(inverse) = Cholesky::new(precision).map(|c| c.inverse()) {
            for (i, &j) in free.iter().enumerate() {
                for (k, &l) in free.iter().enumerate() {
                    covariance[(j, l)] = inverse[(i, k)];
                }
            }
        }
        (&covariance * b, covariance)
    }

    /// The best point of `set` as seen from `linear`, inside the catalogue's ranges.
    pub fn theta_of(&self, linear: &Linear, set: &[usize]) -> Vec<f64> {
        let (a, b) = sum(&linear.blocks);
        let mut values = self.posterior(&a, &b, set).0;
        for (j, p) in self.parameters.iter().enumerate() {
            if let Effect::Mechanism(m, k) = p.effect {
                let spec = &CATALOGUE[m].parameters[k];
                let [low, high] = [spec.low, spec.high].map(|end| end - spec.neutral);
                values[j] = values[j].clamp(low, high);
                let before = values[j];
                if let Some(late) = values.get_mut(self.first_late() + j) {
                    *late = late.clamp(low - before, high - before);
                }
            }
        }
        values.as_slice().to_vec()
    }

    /// Looks at the base first, then goes where the best model leads and looks again, until it
    /// stays. Returns the first and the last view. Of a long flight a share is looked at on the
    /// way, and all of it at the end.
    ///
    /// # Errors
    /// [`GapError::Data`] when the filter leaves the finite numbers at the base.
    pub fn look(&self, progress: &mut dyn FnMut(f64)) -> Result<(Linear, Linear), GapError> {
        let thin = self.gated.thinned(SEARCH_STRETCHES);
        let share = Study {
            gated: &thin,
            stand_for: self.gated.rows() as f64 / thin.rows() as f64,
            ..self.clone()
        };
        let start = share.seen_from_start();
        progress(0.25);
        let first = share.settled(start);
        if !first.log_score.is_finite() {
            return Err(GapError::Data {
                what: "flight".into(),
                problem: "the flight model cannot follow the measured motion".into(),
                expected: "the aircraft of the file in normal flight".into(),
            });
        }
        progress(0.33);
        let ways = infer::parallel_map(&rivals(&first), |set| share.descend(&first, set));
        let best = ways.into_iter().reduce(|best, way| {
            if way.log_posterior > best.log_posterior {
                way
            } else {
                best
            }
        });
        let last = share.refitted(best.unwrap_or_else(|| first.clone()));
        progress(0.75);
        if share.stand_for <= 1.0 {
            return Ok((first, last));
        }
        let noise = self.noise(&last.theta, last.noise.clone(), NOISE_STEPS[2]);
        progress(0.9);
        Ok((first, self.linearise(last.theta, noise)))
    }

    /// The base where it fits best, with the noise that it has there.
    pub fn settled(&self, mut base: Linear) -> Linear {
        for _ in 0..ROUNDS {
            let theta = self.step_towards(&base, &[], STEP);
            let next = self.seen_with_own_noise(theta, base.noise.clone());
            let gained = next.log_posterior - base.log_posterior;
            if gained > 0.0 {
                base = next;
            }
            if gained.is_nan() || gained < SETTLED_NATS {
                break;
            }
        }
        base
    }

    /// Goes where `set` leads from `from` and looks again, until what is best there stays.
    fn descend(&self, from: &Linear, set: &[usize]) -> Linear {
        let (mut best, mut now) = (set.to_vec(), from.clone());
        for _ in 0..ROUNDS {
            let theta = self.step_towards(&now, &best, STEP);
            let next = self.linearise(theta, now.noise.clone());
            let stays = next.models[0].set == best;
            if next.log_score.is_finite() {
                best.clone_from(&next.models[0].set);
                now = next;
            }
            if stays {
                break;
            }
        }
        now
    }

    /// The same point with the noise fitted there, where that is better.
    pub fn refitted(&self, from: Linear) -> Linear {
        let fitted = self.seen_with_own_noise(from.theta.clone(), from.noise.clone());
        if fitted.log_posterior > from.log_posterior {
            fitted
        } else {
            from
        }
    }

    /// The way, half of it and so on, to the best point of `set`: the first of so many parts that loses less than so many
    /// nats; the point itself where none does.
    pub fn step_towards(&self, now: &Linear, set: &[usize], (tries, loss): (i32, f64)) -> Vec<f64> {
        let target = self.theta_of(now, set);
        let on_the_way = |k: i32| {
            let way = now.theta.iter().zip(&target);
            way.map(|(from, to)| from + 0.5_f64.powi(k) * (to - from))
                .collect()
        };
        let scores = |theta: &Vec<f64>| {
            let score = self.log_score(theta, &now.noise);
            score.is_finite() && score > now.log_score - loss
        };
        let kept = (0..tries).map(on_the_way).find(scores);
        kept.unwrap_or_else(|| now.theta.clone())
    }
}

/// The sets from which the search goes on: the best as seen from the base, and where its effect is
/// so large that this view may bend, its best rivals.
fn rivals(first: &Linear) -> Vec<Vec<usize>> {
    let best = &first.models[0];
    let near = best.log_posterior - RIVAL_PART * best.log_score;
    let may_be = |m: &&Model| !m.set.is_empty() && m.set.len() <= best.set.len();
    let rivals = first.models.iter().filter(may_be);
    let rivals = rivals.take_while(|m| m.log_posterior >= near);
    rivals.take(RIVALS).map(|m| m.set.clone()).collect()
}

/// Mean wind of a log: velocity over ground minus that through the air, towards north and east.
fn mean_wind(segments: &[Segment], log: usize) -> [f64; 2] {
    let (mut sum, mut count) = ([0.0; 2], 0.0);
    for segment in segments.iter().filter(|s| s.log == log) {
        let mut last = [f64::NAN; CHANNELS];
        for m in &segment.measured {
            // Sampled and held channels keep their last value for this.
            for (last, now) in last.iter_mut().zip(m).filter(|(_, now)| now.is_finite()) {
                *last = *now;
            }
            let or = |k: usize, usual: f64| if last[k].is_nan() { usual } else { last[k] };
            let attitude = fdm::quaternion(last[at::ROLL], last[at::ROLL + 1], last[at::ROLL + 2]);
            let air = through_air(last[at::AIRSPEED], or(at::ALPHA, 0.05), or(at::BETA, 0.0));
            let air = towards(&rotation(&attitude), &air);
            let wind = [0, 1].map(|k| m[at::VELOCITY + k] - air[k]);
            if wind.iter().all(|w| w.is_finite()) {
                sum = [sum[0] + wind[0], sum[1] + wind[1]];
                count += 1.0;
            }
        }
    }
    sum.map(|s| s / f64::max(count, 1.0))
}
