//! Acceptance of candidate sets: a reported mechanism must be probable and must predict held-out passes, and the set
//! must leave no discrepancy with more evidence.

use crate::InferError;
use crate::background::Along;
use crate::bootstrap::{Bootstrap, Passes, RIVAL_NATS};
use crate::discrepancy::AXIS_DRIFT;
use crate::hold_out::Expected;
use crate::mechanism_search::{Catalogue, FittedSet, Question, base_of, without};
use crate::parallel_map::parallel_map;
use crate::policy::Policy;
use crate::posterior::Posterior;
use crate::probability::Features;
use std::collections::BTreeSet;
use std::ops::Range;

/// A mechanism makes held-out errors significantly worse when they grow in this part of the bootstrap draws: the
/// one-sided 97.5 % level.
const WORSE: f64 = 0.975;
/// At least one error measure on held-out passes must improve in this part of the draws. Evidence also rewards a better
/// error correlation, so evidence alone identifies no cause.
const NO_BETTER: f64 = 0.5;
/// Largest probability of a cause that does not improve held-out passes: such a cause must not extend a scenario.
const MOST_WITHOUT_GAIN: f64 = 0.94;
/// Fluctuation intensity from which its distribution matters: a log-normal factor of this size has a skewness of one.
const STRONG_FLUCTUATION: f64 = 0.3;
/// Number of sets to judge, the most probable over bootstrap draws of the passes,
const SETS_JUDGED: usize = 8;
/// ... among those with at least this probability.
const LEAST_SHARE: f64 = 0.02;

/// A cause: a credible set of mechanisms that the readings cannot distinguish.
#[derive(Debug, Clone)]
pub struct Cause<T> {
    /// Mechanisms with their probabilities, the most probable first; the first belongs to the accepted set.
    pub mechanisms: Vec<(T, f64)>,
    /// Probability that one of them is at work.
    pub probability: f64,
    /// The same by evidence alone.
    pub by_evidence: f64,
    /// Further inputs of the probability.
    pub features: Features,
    /// Gain of the log evidence over the set without it, nats.
    pub gain: f64,
    /// Distance to the most probable mechanism outside the set, nats.
    pub nats_to_next: f64,
    /// Gain of the log score on held-out passes, nats, and its one-sided 80 % lower bound.
    pub hold_out: (f64, f64),
    /// Part of the draws in which RMSE, NMSE and mean absolute error on held-out passes grow with this cause; zero for a
    /// cause that is rejected anyway.
    pub worse: [f64; 3],
}

impl<T> Cause<T> {
    /// The same with other mechanisms.
    pub fn named_by<U>(&self, label: impl Fn(&T) -> U) -> Cause<U> {
        Cause {
            mechanisms: self
                .mechanisms
                .iter()
                .map(|(n, p)| (label(n), *p))
                .collect(),
            probability: self.probability,
            by_evidence: self.by_evidence,
            features: self.features,
            gain: self.gain,
            nats_to_next: self.nats_to_next,
            hold_out: self.hold_out,
            worse: self.worse,
        }
    }

    /// Whether it is sure enough to extend a scenario.
    pub fn is_sure(&self, policy: &Policy) -> bool {
        self.probability >= policy.named
    }
}

/// The assumption of the base model that an unexplained deviation violates.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum RestKind {
    /// The sizes of the noise: white, slow, fluctuation, fast wander of the axis.
    Noise,
    /// A steady axis.
    AxisMotion,
    /// The form of the mean plume.
    Discrepancy,
    /// A background that is constant in time and with height.
    Background(Along),
    /// Nothing: a mechanism explains much, but fails a check.
    None,
}

/// Deviation of the readings from a set of mechanisms in ordinary air.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Rest {
    /// Log evidence of discrepancy, axis drift and noise above the tolerated sizes, nats.
    pub nats: f64,
    /// The largest contribution.
    pub kind: RestKind,
}

/// The accepted set and its alternatives.
#[derive(Debug, Clone)]
pub struct Judgement<M: Catalogue> {
    /// The accepted set; the base if no mechanism is accepted.
    pub set: FittedSet<M>,
    /// Its mechanisms, each with those that the readings cannot distinguish from it.
    pub causes: Vec<Cause<M::Hypothesis>>,
    /// Rejected mechanisms of the most probable sets, the strongest first.
    pub dropped: Vec<Cause<M::Hypothesis>>,
    /// Whether the evidence for a rejected mechanism is so large that the set does not explain the readings.
    pub is_doubted: bool,
    /// The deviation that the set leaves unexplained.
    pub rest: Rest,
    /// Candidates for an unexplained deviation, with probabilities over bootstrap draws.
    pub candidates: Vec<(FittedSet<M>, f64)>,
    /// The passes used for hold-out scores and the bootstrap.
    pub passes: Vec<Vec<Range<usize>>>,
    /// The causes of every judged set, in order.
    pub considered: Vec<Vec<Cause<M::Hypothesis>>>,
}

impl Question<'_> {
    /// Divides the record into passes at the excess over a fitted set.
    ///
    /// # Errors
    /// Values that the model refuses.
    pub fn passes<M: Catalogue>(
        &self,
        of: &FittedSet<M>,
    ) -> Result<Vec<Vec<Range<usize>>>, InferError> {
        self.beside(of, &of.model).passes(of.fit())
    }

    /// Judges the sets of a search, ordered by probability and including the base; `seed` drives the bootstrap.
    ///
    /// # Errors
    /// Values that the model refuses.
    pub fn judge<M: Catalogue>(
        &self,
        found: &[FittedSet<M>],
        tried: &[M::Hypothesis],
        seed: u64,
    ) -> Result<Judgement<M>, InferError> {
        let passes = Passes::drawn(self.passes(&found[0])?, seed);
        let standing = self.standing(found, &passes)?;
        let (set, dropped) = (found[standing.set].clone(), standing.dropped);
        let speaks_for = |c: &Cause<M::Hypothesis>| {
            c.gain > self.policy.rest_alone_nats && c.probability > self.policy.doubted
        };
        let is_doubted = dropped.iter().any(speaks_for);
        let rest = self.rest(&set, &passes.rows)?;
        let candidates = if rest.nats > self.policy.rest_nats || is_doubted {
            let plain = self.plain_extensions(&set, tried)?;
            self.candidates(&plain, &passes)?
        } else {
            Vec::new()
        };
        Ok(Judgement {
            set,
            causes: standing.causes,
            dropped,
            is_doubted,
            rest,
            candidates,
            passes: passes.rows,
            considered: standing.considered,
        })
    }

    /// Judges the most probable sets down to the base. From each it removes the weakest rejected mechanism until all are
    /// accepted. The answer is the largest remaining set, and the most probable of several.
    fn standing<M: Catalogue>(
        &self,
        found: &[FittedSet<M>],
        passes: &Passes,
    ) -> Result<Standing<M>, InferError> {
        let mut drawn = Bootstrap::new(self, found, passes, Bootstrap::near(found))?;
        let mut judged = BTreeSet::new();
        let mut out = Standing {
            set: base_of(found),
            causes: Vec::new(),
            dropped: Vec::new(),
            considered: Vec::new(),
        };
        for mut set in drawn.likeliest(SETS_JUDGED, LEAST_SHARE) {
            if found[set].mechanisms.is_empty() {
                break;
            }
            // What was judged before has been taken apart before.
            while !found[set].mechanisms.is_empty() && judged.insert(set) {
                let causes = self.causes(&mut drawn, set)?;
                out.considered.push(causes.clone());
                let failed = (0..causes.len()).filter(|&k| !self.stands(&causes[k]));
                let weakest =
                    failed.min_by(|a, b| causes[*a].probability.total_cmp(&causes[*b].probability));
                let Some(k) = weakest else {
                    if causes.len() > out.causes.len() {
                        (out.set, out.causes) = (set, causes);
                    }
                    break;
                };
                let cause = &causes[k];
                if cause.by_evidence > 0.5 && cause.features.departs_sd > self.policy.departs_sd {
                    out.dropped.push(cause.clone());
                }
                set = without(found, &found[set], k);
            }
        }
        out.forget_what_is_stated();
        Ok(out)
    }

    /// The largest deviation that a set leaves: of the plume, or of a background that varies.
    fn rest<M: Catalogue>(
        &self,
        set: &FittedSet<M>,
        passes: &[Vec<Range<usize>>],
    ) -> Result<Rest, InferError> {
        let rest = self.rest_of_plume(set, passes)?;
        let (nats, along) = self.background_gain(set)?;
        // No hold-out score: the background of other passes says nothing of that of one.
        if nats > self.policy.rest_alone_nats.max(rest.nats) {
            let kind = RestKind::Background(along);
            return Ok(Rest { nats, kind });
        }
        Ok(rest)
    }

    /// Log evidence of discrepancy, axis drift and noise above the tolerated sizes; zero if it is small and held-out
    /// passes do not improve.
    fn rest_of_plume<M: Catalogue>(
        &self,
        set: &FittedSet<M>,
        passes: &[Vec<Range<usize>>],
    ) -> Result<Rest, InferError> {
        let plain = self.plain(set)?;
        let nats = set.ln_score() - plain.ln_score();
        let none = Rest {
            nats: 0.0,
            kind: RestKind::None,
        };
        if nats <= self.policy.rest_nats {
            return Ok(Rest {
                nats: nats.max(0.0),
                ..none
            });
        }
        // Strong fluctuation is log-normal, so a puff of several times the mean is no discrepancy.
        let fluctuating = self.log_normal(&plain)?;
        let nats = nats.min(set.ln_score() - fluctuating.ln_score());
        if nats <= self.policy.rest_nats {
            return Ok(none);
        }
        let is_shown =
            nats > self.policy.rest_alone_nats || self.passes_gain(set, &plain, passes)?;
        if !is_shown {
            return Ok(none);
        }
        let kind = self.rest_kind(set)?;
        Ok(Rest { nats, kind })
    }

    /// The freedom that alone recovers most of the evidence above ordinary air.
    fn rest_kind<M: Catalogue>(&self, set: &FittedSet<M>) -> Result<RestKind, InferError> {
        let found = set.likeliest_sizes();
        let ordinary = self.policy.tolerated_sizes(&found);
        let mut swinging = ordinary;
        swinging[AXIS_DRIFT..].copy_from_slice(&found[AXIS_DRIFT..]);
        let mut formed = found;
        formed[AXIS_DRIFT..].copy_from_slice(&ordinary[AXIS_DRIFT..]);
        let freedoms = [
            (RestKind::Noise, ordinary, true),
            (RestKind::AxisMotion, swinging, false),
            (RestKind::Discrepancy, formed, false),
        ];
        let fitted = parallel_map(&freedoms, |(kind, sizes, is_noisy)| {
            let restricted = self.restricted(set, sizes, *is_noisy)?;
            Ok((restricted.ln_score(), *kind))
        });
        let fitted = fitted.into_iter().collect::<Result<Vec<_>, InferError>>()?;
        let best = fitted.into_iter().max_by(|a, b| a.0.total_cmp(&b.0));
        Ok(best.map_or(RestKind::None, |b| b.1))
    }

    /// Whether a set predicts held-out passes better than another.
    fn passes_gain<M: Catalogue>(
        &self,
        set: &FittedSet<M>,
        plain: &FittedSet<M>,
        passes: &[Vec<Range<usize>>],
    ) -> Result<bool, InferError> {
        let (with, without) = (self.by_pass(set, passes)?, self.by_pass(plain, passes)?);
        let with = with.hold_out();
        let gains: Vec<f64> = with
            .iter()
            .zip(without.hold_out())
            .map(|(a, b)| a - b)
            .collect();
        Ok(sum_and_low(&gains).1 > 0.0)
    }

    /// Whether to accept a cause.
    fn stands<T>(&self, cause: &Cause<T>) -> bool {
        cause.probability >= self.policy.stated
            && cause.mechanisms.len() <= self.policy.most_candidates
            && cause.worse.iter().all(|w| *w < WORSE)
            && cause.worse.iter().any(|w| *w <= NO_BETTER)
    }

    /// The causes of a set with their probabilities.
    fn causes<M: Catalogue>(
        &self,
        drawn: &mut Bootstrap<'_, M>,
        set: usize,
    ) -> Result<Vec<Cause<M::Hypothesis>>, InferError> {
        let of = &drawn.found[set];
        if of.mechanisms.is_empty() {
            return Ok(Vec::new());
        }
        let bare = (0..of.mechanisms.len()).map(|k| without(drawn.found, of, k));
        drawn.weigh(self, bare.chain([set]).collect())?;
        let departures = departures(of, &self.posterior(of)?);
        let cause = |(k, departure)| self.cause(drawn, (set, k), departure);
        departures.into_iter().enumerate().map(cause).collect()
    }

    fn cause<M: Catalogue>(
        &self,
        drawn: &Bootstrap<'_, M>,
        (set, k): (usize, usize),
        Departure {
            departs_sd,
            widening,
        }: Departure,
    ) -> Result<Cause<M::Hypothesis>, InferError> {
        let found = drawn.found;
        let (index, own) = (set, &found[set]);
        let bare = without(found, own, k);
        let without = &found[bare];
        let top = own.ln_score();
        let ln = |f: &FittedSet<M>| f.ln_score() - top;
        // Readings that scatter together tell less than as many independent ones (Ribatet and others 2012).
        let gain = top - without.ln_score() - (own.ln_prior - without.ln_prior);
        let scattered = gain.max(0.0) * (1.0 - widening.powi(-2));
        let too_much = scattered.max(self.due_to_fluctuation(own, without)?);
        let gain = gain - too_much;
        let rivals = rivals(found, own, k);
        let all: f64 = rivals.iter().map(|r| ln(&found[r.1]).exp()).sum();
        let by_evidence = all / (all + (ln(without) + too_much).exp());
        let (near, mut beyond): (Vec<_>, Vec<_>) = rivals.into_iter().partition(|r| {
            r.1 == index || (drawn.get(r.1).is_some() && ln(&found[r.1]) > -RIVAL_NATS)
        });
        let share = drawn.shares(&near.iter().map(|r| r.1).collect::<Vec<_>>());
        let mut order: Vec<usize> = (1..near.len()).collect();
        order.sort_by(|a, b| share[*b].total_cmp(&share[*a]));
        let mut mechanisms = vec![(near[0].0.clone(), share[0])];
        let mut held = share[0];
        for r in order {
            if held < self.policy.named {
                held += share[r];
                mechanisms.push((near[r].0.clone(), share[r]));
            } else {
                beyond.push(near[r]);
            }
        }
        let nearest = beyond.iter().map(|r| ln(&found[r.1]).abs());
        let nats_to_next = nearest.fold(-ln(without) - too_much, f64::min);
        let (with, less) = match (drawn.get(index), drawn.get(bare)) {
            (Some(with), Some(less)) => (with, less),
            _ => return Err(InferError::NoPosterior),
        };
        let gains = with.hold_out.iter().zip(&less.hold_out);
        let gains: Vec<f64> = gains.map(|(a, b)| a - b).collect();
        let features = Features {
            // A limit does nothing at infinity: its evidence tells how far it departs (Wilks 1938).
            departs_sd: if departs_sd.is_finite() {
                departs_sd
            } else {
                (2.0 * gain.max(0.0)).sqrt()
            },
            widening,
            others: own.mechanisms.len() - 1,
        };
        let hold_out = sum_and_low(&gains);
        let most = if hold_out.1 > 0.0 {
            1.0
        } else {
            MOST_WITHOUT_GAIN
        };
        let calibrated = self.policy.cause_map.probability(&features);
        let probability = calibrated.min(by_evidence).min(most);
        mechanisms.iter_mut().for_each(|n| n.1 *= probability);
        let mut cause = Cause {
            mechanisms,
            probability,
            by_evidence,
            features,
            gain,
            nats_to_next,
            hold_out,
            worse: [0.0; 3],
        };
        if self.stands(&cause) {
            let [before, after] = self.compared(without, own, &drawn.passes.rows)?;
            cause.worse = self.worse(&before, &after, drawn.passes);
        }
        Ok(cause)
    }

    /// Part of a mechanism's gain that log-normal fluctuation explains as well, nats: to a normal distribution a puff of
    /// several times the mean looks like a cause.
    fn due_to_fluctuation<M: Catalogue>(
        &self,
        set: &FittedSet<M>,
        without: &FittedSet<M>,
    ) -> Result<f64, InferError> {
        let is_strong = |f: &FittedSet<M>| f.fit().noise.fluctuation > STRONG_FLUCTUATION;
        if set.ln_score() <= without.ln_score() || !(is_strong(set) || is_strong(without)) {
            return Ok(0.0);
        }
        let by_either = |found: &FittedSet<M>| -> Result<f64, InferError> {
            let fluctuating = self.log_normal(&self.plain(found)?)?;
            Ok(found.ln_score().max(fluctuating.ln_score()))
        };
        let gain = by_either(set)? - by_either(without)?;
        Ok((set.ln_score() - without.ln_score() - gain).max(0.0))
    }

    /// Part of the draws in which errors on held-out passes are larger after than before.
    fn worse(&self, before: &Expected, after: &Expected, passes: &Passes) -> [f64; 3] {
        let errors = |expected: &Expected| -> Vec<Errors> {
            let of = |pass: &Vec<Range<usize>>| Errors::of(self.rows, before, expected, pass);
            passes.rows.iter().map(of).collect()
        };
        let (old, new) = (errors(before), errors(after));
        let mut worse = [0.0; 3];
        for times in &passes.draws {
            let (a, b) = (Errors::sum(&old, times), Errors::sum(&new, times));
            worse[0] += f64::from(u8::from(b.square > a.square));
            worse[1] += f64::from(u8::from(b.normalised() > a.normalised()));
            worse[2] += f64::from(u8::from(b.absolute > a.absolute));
        }
        worse.map(|w| w / passes.draws.len() as f64)
    }

    /// The best sets without discrepancy, each with the part of the draws in which it is the most probable: at most the
    /// policy's number, and no more than needed for nearly all of the probability.
    fn candidates<M: Catalogue>(
        &self,
        plain: &[FittedSet<M>],
        passes: &Passes,
    ) -> Result<Vec<(FittedSet<M>, f64)>, InferError> {
        if plain.is_empty() {
            return Ok(Vec::new());
        }
        let all: Vec<usize> = (0..plain.len()).collect();
        let share = Bootstrap::new(self, plain, passes, all.clone())?.shares(&all);
        let mut order: Vec<usize> = (0..plain.len()).collect();
        order.sort_by(|a, b| share[*b].total_cmp(&share[*a]));
        let mut out = Vec::new();
        let mut held = 0.0;
        for k in order.into_iter().take(self.policy.most_candidates) {
            if held > self.policy.named {
                break;
            }
            held += share[k];
            out.push((plain[k].clone(), share[k]));
        }
        Ok(out)
    }

    /// Extensions of a set without discrepancy by the most promising of `tried`.
    ///
    /// # Errors
    /// Values that the model refuses.
    pub fn plain_extensions<M: Catalogue>(
        &self,
        of: &FittedSet<M>,
        tried: &[M::Hypothesis],
    ) -> Result<Vec<FittedSet<M>>, InferError> {
        let plain = self.plain(of)?;
        let mut screened = self.screen(&plain, tried)?;
        screened.sort_by(|a, b| b.gain.total_cmp(&a.gain));
        let mut chosen: Vec<(&M::Hypothesis, &[f64])> = Vec::new();
        for s in screened.iter().take_while(|s| s.gain >= 0.0) {
            let mechanism = &tried[s.tried];
            if !chosen.iter().any(|c| M::same_cause(c.0, mechanism)) && !of.has(mechanism) {
                chosen.push((mechanism, &s.amplitudes));
            }
        }
        chosen.truncate(self.policy.beam_fits);
        let fitted = |(mechanism, amplitudes): &(&M::Hypothesis, &[f64])| {
            self.extended_plainly(&plain, mechanism, amplitudes)
        };
        parallel_map(&chosen, fitted).into_iter().collect()
    }
}

/// The result of judging all sets.
struct Standing<M: Catalogue> {
    /// Index of the accepted set.
    set: usize,
    causes: Vec<Cause<M::Hypothesis>>,
    dropped: Vec<Cause<M::Hypothesis>>,
    considered: Vec<Vec<Cause<M::Hypothesis>>>,
}

impl<M: Catalogue> Standing<M> {
    /// Keeps rejected mechanisms that no accepted cause contains, each once, the most probable first.
    fn forget_what_is_stated(&mut self) {
        let causes = &self.causes;
        let is_stated = |mechanism: &M::Hypothesis| {
            let mut mechanisms = causes.iter().flat_map(|c| &c.mechanisms);
            mechanisms.any(|n| M::same_cause(&n.0, mechanism))
        };
        self.dropped.retain(|d| !is_stated(&d.mechanisms[0].0));
        self.dropped
            .sort_by(|a, b| b.probability.total_cmp(&a.probability));
        self.dropped
            .dedup_by(|a, b| M::same_cause(&a.mechanisms[0].0, &b.mechanisms[0].0));
    }
}

/// Distance of a mechanism's parameters from their neutral values.
struct Departure {
    /// Standard deviations.
    departs_sd: f64,
    /// Factor by which the scatter between passes widens these.
    widening: f64,
}

/// The departure of each mechanism of a set.
fn departures<M: Catalogue>(set: &FittedSet<M>, posterior: &Posterior) -> Vec<Departure> {
    let (mean, covariance) = (posterior.mean(), posterior.covariance());
    let unknowns = |n: &M::Hypothesis| M::start(n).nothing.len();
    let mut next = mean.len() - set.mechanisms.iter().map(unknowns).sum::<usize>();
    let of = |mechanism: &M::Hypothesis| {
        let mut departure = Departure {
            departs_sd: 0.0,
            widening: 1.0,
        };
        let start = M::start(mechanism);
        for (k, nothing) in start.nothing.iter().enumerate() {
            // What alone changes nothing, as the place of a source that emits nothing, is no departure.
            if start.ends.iter().any(|end| end[k] != *nothing) {
                let departs_sd = (mean[next] - nothing).abs() / covariance[(next, next)].sqrt();
                departure.departs_sd = departure.departs_sd.max(departs_sd);
                departure.widening = departure.widening.max(posterior.widening_of(next));
            }
            next += 1;
        }
        departure
    };
    set.mechanisms.iter().map(of).collect()
}

/// Sets that replace the `k`-th mechanism of a set by another, its own first: the most probable set of each.
fn rivals<'f, M: Catalogue>(
    found: &'f [FittedSet<M>],
    set: &FittedSet<M>,
    k: usize,
) -> Vec<(&'f M::Hypothesis, usize)> {
    let other = |n: &M::Hypothesis| {
        let mut others = set.mechanisms.iter().enumerate().filter(|(j, _)| *j != k);
        others.any(|(_, o)| M::same_cause(o, n))
    };
    let mut rivals: Vec<(&M::Hypothesis, usize)> = Vec::new();
    for (index, f) in found.iter().enumerate() {
        let mut own = f.mechanisms.iter().filter(|n| !other(n));
        let (Some(own), None) = (own.next(), own.next()) else {
            continue;
        };
        if f.mechanisms.len() == set.mechanisms.len()
            && rivals.iter().all(|r| !M::same_cause(r.0, own))
        {
            rivals.push((own, index));
        }
    }
    // The set's own mechanism comes first, even if another is as probable.
    rivals.sort_by_key(|r| !M::same_cause(r.0, &set.mechanisms[k]));
    rivals
}

/// Sums over rows.
#[derive(Default)]
struct Errors {
    square: f64,
    absolute: f64,
    read: f64,
    expected: f64,
}

impl Errors {
    fn of(rows: &crate::Rows, rest: &Expected, expected: &Expected, pass: &[Range<usize>]) -> Self {
        let mut sum = Self::default();
        for i in pass.iter().cloned().flatten().filter(|&i| rows.is_used(i)) {
            let clean = rest.reading[i] - rest.plume[i];
            let error = rows.measured()[i] - expected.reading[i];
            sum.square += error * error;
            sum.absolute += error.abs();
            sum.read += rows.measured()[i] - clean;
            sum.expected += expected.reading[i] - clean;
        }
        sum
    }

    fn sum(of: &[Self], times: &[f64]) -> Self {
        of.iter()
            .zip(times)
            .fold(Self::default(), |s, (o, times)| Self {
                square: s.square + times * o.square,
                absolute: s.absolute + times * o.absolute,
                read: s.read + times * o.read,
                expected: s.expected + times * o.expected,
            })
    }

    /// Normalised mean square error, up to the number of rows.
    fn normalised(&self) -> f64 {
        let product = self.read * self.expected;
        if product > 0.0 {
            self.square / product
        } else {
            f64::INFINITY
        }
    }
}

/// Sum over passes, and its one-sided 80 % lower bound from their scatter.
fn sum_and_low(gains: &[f64]) -> (f64, f64) {
    let n = gains.len() as f64;
    let sum: f64 = gains.iter().sum();
    let square: f64 = gains.iter().map(|g| (g - sum / n).powi(2)).sum();
    let sd = (square * n / (n - 1.0).max(1.0)).sqrt();
    (sum, sum - 0.84 * sd)
}
