//! Beam search over sets of mechanisms that explain the readings better than the base model with its discrepancy.
//!
//! At a fit, each mechanism adds columns to the linearised problem, which gives its evidence for every probable size of
//! the discrepancy. The search fits the most promising sets and extends each of them again.

use crate::InferError;
use crate::closest_model::ClosestModel;
use crate::contact::Contact;
use crate::discrepancy::Sizes;
use crate::evidence::{Evidence, Reduced};
use crate::fit::{Fit, Point, Problem};
use crate::fluctuation::FluctuationLaw;
use crate::noise::Noise;
use crate::parallel_map::parallel_map;
use crate::policy::Policy;
use crate::posterior::{Posterior, REFITS, Weighed};
use crate::rows::{AxisTurn, ForwardModel, PlumePlace, Prediction, Rows};

/// Start of the search for a mechanism, in the coordinates of its unknowns.
#[derive(Debug, Clone, PartialEq)]
pub struct Start {
    /// Neutral values; infinite for a limit, which is neutral at infinity.
    pub nothing: Vec<f64>,
    /// End points of the directions of search from the neutral values.
    pub ends: Vec<Vec<f64>>,
    /// Prior standard deviation along each direction, as a part of its length.
    pub amplitude_sd: Vec<f64>,
    /// Whether only the positive sense of the directions is physical.
    pub one_sided: bool,
    /// Logarithm of this start's share of the mechanism's prior, where starts exclude each other.
    pub ln_share: f64,
    /// Log prior probability of the mechanism relative to the others of the catalogue.
    pub ln_prior: f64,
}

/// A model that mechanisms can extend.
pub trait Catalogue: ForwardModel + Clone + Send {
    /// A mechanism with a start of its search.
    type Hypothesis: Clone + Send + Sync;

    /// The start of its search.
    fn start(tried: &Self::Hypothesis) -> &Start;

    /// Whether two are starts of the same mechanism.
    fn same_cause(a: &Self::Hypothesis, b: &Self::Hypothesis) -> bool;

    /// The model with the unknowns of a mechanism appended.
    #[must_use]
    fn with(&self, tried: &Self::Hypothesis) -> Self;

    /// Predicted readings with a further mechanism whose unknowns have the values `end`.
    ///
    /// # Errors
    /// Values that the model refuses.
    fn predict_with(
        &self,
        at: &[f64],
        turns: &[AxisTurn],
        tried: &Self::Hypothesis,
        end: &[f64],
    ) -> Result<Prediction, InferError>;

    /// Other values of all unknowns that may explain the readings as well as `at`, such as two sources with exchanged
    /// places: a local search finds only one of these optima.
    ///
    /// # Errors
    /// Values that the model refuses.
    fn exchanged(&self, _at: &[f64]) -> Result<Vec<Vec<f64>>, InferError> {
        Ok(Vec::new())
    }
}

/// The inputs that all sets of mechanisms share.
#[derive(Debug, Clone, Copy)]
pub struct Question<'a> {
    /// The readings.
    pub rows: &'a Rows,
    /// The rules.
    pub policy: &'a Policy,
    /// Standard deviation of the sensor's own noise.
    pub sensor_sd: f64,
    /// Places at which a prediction is needed.
    pub asked: &'a [PlumePlace],
}

/// A fitted set of mechanisms.
#[derive(Debug, Clone)]
pub struct FittedSet<M: Catalogue> {
    /// The mechanisms; none for the base.
    pub mechanisms: Vec<M::Hypothesis>,
    /// The model with their unknowns appended.
    pub model: M,
    pub(crate) weighed: Weighed,
    pub(crate) ln_prior: f64,
}

impl<M: Catalogue> FittedSet<M> {
    /// Logarithm of evidence and prior, nats, up to a constant of the readings.
    pub fn ln_score(&self) -> f64 {
        self.weighed.ln_evidence + self.ln_prior
    }

    /// Logarithm of the evidence alone.
    pub fn ln_evidence(&self) -> f64 {
        self.weighed.ln_evidence
    }

    /// Values of all unknowns.
    pub fn at(&self) -> &[f64] {
        &self.weighed.fit.point.at
    }

    /// The most probable sizes of discrepancy and axis drift.
    pub fn likeliest_sizes(&self) -> Sizes {
        self.weighed.likeliest_sizes()
    }

    /// The fit.
    pub fn fit(&self) -> &Fit {
        &self.weighed.fit
    }

    /// Whether it has the same mechanisms as another set, in any order.
    pub fn is_same_set(&self, mechanisms: &[M::Hypothesis]) -> bool {
        self.mechanisms.len() == mechanisms.len() && mechanisms.iter().all(|n| self.has(n))
    }

    /// Whether a cause is among its mechanisms.
    pub fn has(&self, tried: &M::Hypothesis) -> bool {
        self.mechanisms.iter().any(|n| M::same_cause(n, tried))
    }
}

/// Index of the base, the set without mechanisms, which every search contains.
pub(crate) fn base_of<M: Catalogue>(found: &[FittedSet<M>]) -> usize {
    let base = found.iter().position(|f| f.mechanisms.is_empty());
    base.unwrap_or(0)
}

/// Index of the most probable set that contains only mechanisms of `set` other than the `k`-th.
pub fn without<M: Catalogue>(found: &[FittedSet<M>], set: &FittedSet<M>, k: usize) -> usize {
    let is_other = |n: &M::Hypothesis| {
        let mut mechanisms = set.mechanisms.iter().enumerate();
        mechanisms.any(|(j, o)| j != k && M::same_cause(n, o))
    };
    let within = |f: &FittedSet<M>| f.mechanisms.iter().all(is_other);
    found.iter().position(within).unwrap_or(0)
}

/// A mechanism in the linearised problem at a fit.
#[derive(Debug, Clone, PartialEq)]
pub struct Screened {
    /// Index of the hypothesis.
    pub tried: usize,
    /// Gain of the log evidence, nats.
    pub gain: f64,
    /// The most probable amplitude along each of its directions.
    pub amplitudes: Vec<f64>,
    /// Information on the amplitude along its first direction: inverse variance.
    pub information: f64,
}

impl<'a> Question<'a> {
    pub(crate) fn problem<'m, M: ForwardModel>(&self, model: &'m M) -> Problem<'m, M>
    where
        'a: 'm,
    {
        Problem::new(model, self.rows, self.policy, self.sensor_sd, self.asked)
    }

    /// The problem of a set's model, or of one with other mechanisms.
    pub(crate) fn beside<'m, M: Catalogue>(
        &self,
        found: &FittedSet<M>,
        model: &'m M,
    ) -> Problem<'m, M>
    where
        'a: 'm,
    {
        Problem {
            model,
            rows: self.rows,
            policy: self.policy,
            sensor_sd: self.sensor_sd,
            asked: self.asked,
            turning: found.weighed.turning.clone(),
            fluctuation: FluctuationLaw::Normal,
        }
    }

    /// Log evidence of a model without discrepancy after a quick fit, to choose between winds.
    ///
    /// # Errors
    /// Values that the model refuses.
    pub fn quick<M: ForwardModel>(&self, model: &M) -> Result<f64, InferError> {
        Ok(self.problem(model).quick()?.ln_evidence)
    }

    /// The base: the model itself with its discrepancy.
    ///
    /// # Errors
    /// Values that the model refuses.
    pub fn base<M: Catalogue>(&self, model: &M) -> Result<FittedSet<M>, InferError> {
        Ok(FittedSet {
            mechanisms: Vec::new(),
            weighed: self.problem(model).weighed()?,
            model: model.clone(),
            ln_prior: 0.0,
        })
    }

    /// Fits a set from an earlier fit to part of the readings; `model` has the unknowns of its mechanisms appended.
    ///
    /// # Errors
    /// Values that the model refuses.
    pub fn set_from<M: Catalogue>(
        &self,
        model: &M,
        mechanisms: Vec<M::Hypothesis>,
        before: &Fit,
    ) -> Result<FittedSet<M>, InferError> {
        Ok(FittedSet {
            weighed: self.problem(model).refined(before)?,
            model: model.clone(),
            ln_prior: mechanisms.iter().map(|n| self.ln_prior::<M>(n)).sum(),
            mechanisms,
        })
    }

    /// Log prior probability of a mechanism in the physical sense of its directions.
    fn ln_prior<M: Catalogue>(&self, mechanism: &M::Hypothesis) -> f64 {
        let start = M::start(mechanism);
        let sides = if start.one_sided {
            std::f64::consts::LN_2
        } else {
            0.0
        };
        start.ln_prior + sides + self.policy.ln_name
    }

    /// Fits a set whose only mechanism `model` already contains, from that model's own starts.
    ///
    /// # Errors
    /// Values that the model refuses.
    pub fn named<M: Catalogue>(
        &self,
        model: &M,
        mechanism: &M::Hypothesis,
    ) -> Result<FittedSet<M>, InferError> {
        Ok(FittedSet {
            mechanisms: vec![mechanism.clone()],
            weighed: self.problem(model).weighed()?,
            model: model.clone(),
            ln_prior: self.ln_prior::<M>(mechanism),
        })
    }

    /// Whether and where the readings meet the plume of the unknowns `at`.
    ///
    /// # Errors
    /// Values that the model refuses.
    pub fn contact<M: ForwardModel>(
        &self,
        model: &M,
        at: &[f64],
    ) -> Result<Option<Contact>, InferError> {
        self.problem(model).contact(at, self.policy.passes)
    }

    /// The same set with discrepancy, axis drift and noise limited to the tolerated sizes.
    ///
    /// # Errors
    /// Values that the model refuses.
    pub fn plain<M: Catalogue>(&self, of: &FittedSet<M>) -> Result<FittedSet<M>, InferError> {
        self.restricted(
            of,
            &self.policy.tolerated_sizes(&of.likeliest_sizes()),
            false,
        )
    }

    /// The same set with log-normal fluctuation of at most the tolerated size, starting from the fit of a normal one.
    pub(crate) fn log_normal<M: Catalogue>(
        &self,
        plain: &FittedSet<M>,
    ) -> Result<FittedSet<M>, InferError> {
        let problem = Problem {
            fluctuation: FluctuationLaw::LogNormal,
            ..self.beside(plain, &plain.model)
        };
        let sizes = plain.fit().sizes;
        let fit = plain.fit();
        let first = problem.fit(&fit.point, &fit.basis, fit.noise, sizes)?;
        let best = self.refitted(&problem, first, &sizes, |fit| {
            problem.refit_noise_tolerated(fit)
        })?;
        Ok(FittedSet {
            weighed: best,
            ..plain.clone()
        })
    }

    /// A fit whose noise is made most probable again until the evidence of these sizes gains nothing.
    fn refitted<M: ForwardModel>(
        &self,
        problem: &Problem<'_, M>,
        fit: Fit,
        sizes: &Sizes,
        refit: impl Fn(&Fit) -> Result<Fit, InferError>,
    ) -> Result<Weighed, InferError> {
        let weighed_at = |fit: Fit| -> Result<Weighed, InferError> {
            let mut weighed = problem.around(fit)?;
            weighed.ln_evidence = weighed.only(sizes, self.policy, problem);
            Ok(weighed)
        };
        let mut best = weighed_at(fit)?;
        for _ in 0..RESTRICTED_REFITS {
            let next = weighed_at(refit(&best.fit)?)?;
            let gain = next.ln_evidence - best.ln_evidence;
            if gain > 0.0 {
                best = next;
            }
            if gain < self.policy.settled_nats {
                break;
            }
        }
        Ok(best)
    }

    /// The same set with these sizes of discrepancy and axis drift, and with noise limited to the tolerated sizes unless
    /// it `is_noisy`.
    pub(crate) fn restricted<M: Catalogue>(
        &self,
        of: &FittedSet<M>,
        sizes: &Sizes,
        is_noisy: bool,
    ) -> Result<FittedSet<M>, InferError> {
        let problem = self.beside(of, &of.model);
        let fit = of.fit();
        let noise = if is_noisy {
            fit.noise
        } else {
            problem.tolerated(&fit.noise)
        };
        if noise == fit.noise && of.weighed.sizes.first().is_some_and(|s| s.1 == *sizes) {
            let mut same = of.clone();
            same.weighed.ln_evidence = same.weighed.only(sizes, self.policy, &problem);
            return Ok(same);
        }
        // What a discrepancy explained is left to the noise: it may have to be much larger.
        let mut starts = vec![noise];
        if !is_noisy {
            starts.extend(problem.first_noises().skip(1).map(|first| Noise {
                fluctuation: first.fluctuation,
                wander_deg: first.wander_deg,
                wander_sigma_z: first.wander_sigma_z,
                ..noise
            }));
        }
        let settled = parallel_map(&starts, |noise| {
            let fit = problem.fit(&fit.point, &fit.basis, *noise, *sizes)?;
            self.refitted(&problem, fit, sizes, |fit| {
                if is_noisy {
                    problem.refit_noise(fit)
                } else {
                    problem.refit_noise_tolerated(fit)
                }
            })
        });
        let settled = settled.into_iter().collect::<Result<Vec<_>, _>>()?;
        let best = settled
            .into_iter()
            .max_by(|a, b| a.ln_evidence.total_cmp(&b.ln_evidence));
        Ok(FittedSet {
            weighed: best.ok_or(InferError::NoPosterior)?,
            mechanisms: of.mechanisms.clone(),
            model: of.model.clone(),
            ln_prior: of.ln_prior,
        })
    }

    /// Means and covariances of a set's unknowns.
    ///
    /// # Errors
    /// A problem that has no posterior.
    pub fn posterior<M: Catalogue>(&self, of: &FittedSet<M>) -> Result<Posterior, InferError> {
        self.beside(of, &of.model).concluded(of.weighed.clone())
    }

    /// The unknowns of the model without discrepancy that is closest to a set's posterior.
    ///
    /// # Errors
    /// A problem that has no posterior.
    pub fn nearest<M: Catalogue>(
        &self,
        of: &FittedSet<M>,
        believed: &Posterior,
    ) -> Result<ClosestModel, InferError> {
        self.beside(of, &of.model).nearest(believed)
    }

    /// Turn of the axis at every row in a set.
    pub fn turns<M: Catalogue>(&self, of: &FittedSet<M>) -> Vec<AxisTurn> {
        self.beside(of, &of.model).turns(&of.fit().point)
    }

    /// Whitens a column under a set's noise, so that the misfit is a sum of squares.
    pub fn whitened<M: Catalogue>(&self, of: &FittedSet<M>, column: &[f64]) -> Vec<f64> {
        let mut out = column.to_vec();
        self.beside(of, &of.model).whiten(of.fit(), &mut out);
        out
    }

    /// Screens every hypothesis of `tried` as an extension of a set, in the same order.
    ///
    /// # Errors
    /// Values that the model refuses.
    pub fn screen<M: Catalogue>(
        &self,
        found: &FittedSet<M>,
        tried: &[M::Hypothesis],
    ) -> Result<Vec<Screened>, InferError> {
        let problem = self.beside(found, &found.model);
        let fit = &found.weighed.fit;
        let turns = problem.turns(&fit.point);
        let here = found.model.predict(&fit.point.at, &turns)?;
        let factors = problem.factors(fit)?;
        let ends = |tried| M::start(tried).ends.iter().map(move |end| (tried, end));
        let directions: Vec<(&M::Hypothesis, &Vec<f64>)> = tried.iter().flat_map(ends).collect();
        let column = |(tried, end): &(&M::Hypothesis, &Vec<f64>)| -> Result<Vec<f64>, InferError> {
            let there = found
                .model
                .predict_with(&fit.point.at, &turns, tried, end)?;
            let change = |i: usize| {
                there.reading[i] - here.reading[i]
                    + (there.plume[i] - here.plume[i]) * (factors[i] - 1.0)
            };
            Ok((0..self.rows.len()).map(change).collect())
        };
        let columns = parallel_map(&directions, column);
        let columns = columns.into_iter().collect::<Result<Vec<_>, _>>()?;
        let all = [self.rows.whole()];
        let (known, products) = problem.products(fit, &columns, &all)?;
        let mut evidence = Evidence::new(&products[0], &known);
        let mut problems: Vec<(f64, Reduced)> = Vec::new();
        let plain = self.policy.nearest_sizes(0.0, 0.0);
        let counting = found.weighed.sizes.iter().map(|s| s.1);
        let counting: Vec<Sizes> = counting.take(SIZES_SCREENED).chain([plain]).collect();
        for (k, sizes) in counting.iter().enumerate() {
            if counting[..k].contains(sizes) {
                continue;
            }
            if let Some(reduced) = evidence.under(sizes) {
                problems.push((self.policy.ln_sizes(sizes), reduced));
            }
        }
        let without = ln_sum(problems.iter().map(|(ln, p)| ln + p.ln_evidence()));
        let mut first = 0;
        let mut out = Vec::new();
        for (k, tried) in tried.iter().enumerate() {
            let start = M::start(tried);
            let own: Vec<usize> = (first..first + start.ends.len()).collect();
            first += start.ends.len();
            let with: Vec<(f64, Hypothesis)> = problems
                .iter()
                .filter_map(|(ln, p)| Some((*ln, Hypothesis::of(&p.only(&own), start)?)))
                .collect();
            let total = ln_sum(with.iter().map(|(ln, t)| ln + t.ln_evidence));
            let best = with
                .into_iter()
                .max_by(|a, b| (a.0 + a.1.ln_evidence).total_cmp(&(b.0 + b.1.ln_evidence)));
            let (amplitudes, information) = best.map_or_else(
                || (vec![0.0; own.len()], 0.0),
                |b| (b.1.amplitudes, b.1.information),
            );
            out.push(Screened {
                tried: k,
                gain: if total.is_finite() {
                    total - without
                } else {
                    f64::NEG_INFINITY
                },
                amplitudes,
                information,
            });
        }
        Ok(out)
    }

    /// Fits a set with one more mechanism.
    ///
    /// # Errors
    /// Values that the model refuses.
    pub fn extended<M: Catalogue>(
        &self,
        found: &FittedSet<M>,
        tried: &M::Hypothesis,
        amplitudes: &[f64],
    ) -> Result<FittedSet<M>, InferError> {
        let model = found.model.with(tried);
        let problem = self.beside(found, &model);
        let fit = &found.weighed.fit;
        let start = M::start(tried);
        let mut point = fit.point.clone();
        point.at.extend(start.at(amplitudes));
        let mut best = self.settled(&problem, &point, fit, 2)?;
        // One more unknown makes no model worse: if the start was misleading, the parent's fit with a nearly neutral
        // mechanism counts.
        if best.ln_evidence < found.weighed.ln_evidence
            && start.nothing.iter().all(|n| n.is_finite())
        {
            let mut at = fit.point.clone();
            at.at.extend(start.at(&vec![0.01; start.ends.len()]));
            let other = self.settled(&problem, &at, fit, 1)?;
            if other.ln_evidence > best.ln_evidence {
                best = other;
            }
        }
        let best = self.or_exchanged(&problem, fit, best)?;
        Ok(self.found_with(found, tried, model.clone(), best))
    }

    /// A fit, or a better one from the exchanged values of its last mechanism.
    fn or_exchanged<M: Catalogue>(
        &self,
        problem: &Problem<'_, M>,
        before: &Fit,
        mut best: Weighed,
    ) -> Result<Weighed, InferError> {
        for at in problem.model.exchanged(&best.fit.point.at)? {
            let other = self.fitted_anew(problem, before, at)?;
            if other.ln_evidence > best.ln_evidence {
                best = other;
            }
        }
        Ok(best)
    }

    /// A fit from other unknowns, without the axis drift and discrepancy of `fit` and with little noise: these have
    /// absorbed the misfit of the earlier unknowns.
    fn fitted_anew<M: ForwardModel>(
        &self,
        problem: &Problem<'_, M>,
        fit: &Fit,
        at: Vec<f64>,
    ) -> Result<Weighed, InferError> {
        let point = Point {
            weights: vec![0.0; fit.point.weights.len()],
            at,
        };
        let sizes = self.policy.nearest_sizes(0.0, 0.0);
        let first = problem.fit(&point, &fit.basis, problem.quiet_noise(), sizes)?;
        self.settled(problem, &first.point, &first, 2)
    }

    /// The same without discrepancy, and with noise limited to the tolerated sizes.
    pub(crate) fn extended_plainly<M: Catalogue>(
        &self,
        found: &FittedSet<M>,
        tried: &M::Hypothesis,
        amplitudes: &[f64],
    ) -> Result<FittedSet<M>, InferError> {
        let model = found.model.with(tried);
        let fit = &found.weighed.fit;
        let mut point = fit.point.clone();
        point.at.extend(M::start(tried).at(amplitudes));
        let weighed = {
            let problem = self.beside(found, &model);
            let first = problem.fit(&point, &fit.basis, fit.noise, fit.sizes)?;
            let mut weighed = problem.around(problem.refit_noise_tolerated(&first)?)?;
            weighed.ln_evidence = weighed.only(&fit.sizes, self.policy, &problem);
            weighed
        };
        Ok(self.found_with(found, tried, model.clone(), weighed))
    }

    fn found_with<M: Catalogue>(
        &self,
        found: &FittedSet<M>,
        tried: &M::Hypothesis,
        model: M,
        best: Weighed,
    ) -> FittedSet<M> {
        let mut mechanisms = found.mechanisms.clone();
        mechanisms.push(tried.clone());
        FittedSet {
            mechanisms,
            weighed: best,
            model,
            ln_prior: found.ln_prior + self.ln_prior::<M>(tried),
        }
    }

    /// A fit from a point near another fit, with its noise maximised so many times.
    fn settled<M: ForwardModel>(
        &self,
        problem: &Problem<'_, M>,
        point: &Point,
        from: &Fit,
        times: usize,
    ) -> Result<Weighed, InferError> {
        problem.settled(point, &from.basis, (from.noise, from.sizes), times)
    }

    /// Fits sets of the hypotheses `tried` by a beam search; returns them with the base, the most probable first. Sets that
    /// another search found are `named`.
    ///
    /// # Errors
    /// Values that the model refuses.
    pub fn search<M: Catalogue>(
        &self,
        base: FittedSet<M>,
        named: Vec<FittedSet<M>>,
        tried: &[M::Hypothesis],
    ) -> Result<Vec<FittedSet<M>>, InferError> {
        let policy = self.policy;
        let (base, beside, next) = self.first_level(base, &named, tried)?;
        let mut found = vec![base];
        found.extend(named);
        found.extend(beside.iter().cloned());
        let tried = kept(tried, &next, policy.beam_causes);
        let mut level = beside;
        for depth in 1..policy.most_names {
            let top = found
                .iter()
                .map(FittedSet::ln_score)
                .fold(f64::NEG_INFINITY, f64::max);
            level.sort_by(|a, b| b.ln_score().total_cmp(&a.ln_score()));
            level.truncate(policy.beam_width);
            level.retain(|d| d.ln_score() > top - policy.beam_nats);
            let next = self.promising(&level, &tried, None)?;
            let most = (policy.beam_fits / (depth + 1)).max(1);
            level = self.fitted(&level, &tried, &next, top - policy.beam_nats, [most, most])?;
            found.extend(level.iter().cloned());
        }
        found.sort_by(|a, b| b.ln_score().total_cmp(&a.ln_score()));
        Ok(found)
    }
}

/// Most times that the noise of a restricted set is made most probable: that of a log-normal fluctuation depends on itself.
const RESTRICTED_REFITS: usize = 10;
/// Number of restarts after a mechanism led to a better base.
const NEW_BASES: usize = 2;
/// Gain of the log evidence that makes a base a better one, nats.
const BETTER_BASE_NATS: f64 = 2.0;

/// The starts of the most promising causes.
fn kept<T: Clone>(tried: &[T], next: &[Next], most: usize) -> Vec<T> {
    let mut order: Vec<usize> = Vec::new();
    for n in next {
        if !order.contains(&n.screened.tried) && order.len() < most {
            order.push(n.screened.tried);
        }
    }
    order.into_iter().map(|k| tried[k].clone()).collect()
}

/// A candidate for the next fit.
#[derive(Debug, Clone)]
struct Next {
    ln_score: f64,
    parent: usize,
    screened: Screened,
}

impl Question<'_> {
    /// The base with little noise and no axis drift, which may have absorbed the effect of a mechanism.
    pub fn quiet<M: Catalogue>(&self, base: &FittedSet<M>) -> Result<FittedSet<M>, InferError> {
        let problem = self.beside(base, &base.model);
        let sizes = self.policy.nearest_sizes(0.0, 0.0);
        let fit = base.fit();
        let noise = problem.quiet_noise();
        let mut quiet = base.clone();
        quiet.weighed = problem.around(problem.fit(&fit.point, &fit.basis, noise, sizes)?)?;
        Ok(quiet)
    }

    /// The base, the sets with one mechanism, and their predicted gains. If one of these leads to a better fit that its
    /// mechanism does not explain, the search restarts from that base.
    #[allow(clippy::type_complexity, reason = "three things that belong together")]
    fn first_level<M: Catalogue>(
        &self,
        mut base: FittedSet<M>,
        named: &[FittedSet<M>],
        tried: &[M::Hypothesis],
    ) -> Result<(FittedSet<M>, Vec<FittedSet<M>>, Vec<Next>), InferError> {
        let most = self.policy.beam_fits;
        for left in (0..=NEW_BASES).rev() {
            let quiet = self.quiet(&base)?;
            // A base that began with an axis drift may be better without.
            let problem = self.beside(&base, &base.model);
            let calm = self.settled(&problem, &quiet.fit().point, quiet.fit(), REFITS)?;
            if calm.ln_evidence > base.ln_evidence() {
                base.weighed = calm;
            }
            let mut level = vec![base.clone(), quiet];
            level.extend(named.iter().cloned());
            let top = level
                .iter()
                .map(FittedSet::ln_score)
                .fold(f64::NEG_INFINITY, f64::max);
            let next = self.promising(&level, tried, Some(base.ln_score()))?;
            let least = top - self.policy.beam_nats;
            let beside = self.fitted(&level, tried, &next, least, [most, most / 2])?;
            let alone = beside.iter().filter(|f| f.mechanisms.len() == 1);
            let best = alone.max_by(|a, b| a.ln_evidence().total_cmp(&b.ln_evidence()));
            let better = match best.filter(|_| left > 0) {
                Some(best) => self.followed(&base, best)?,
                None => None,
            };
            match better {
                Some(better) => base = better,
                None => return Ok((base, beside, next)),
            }
        }
        Err(InferError::NoPosterior)
    }

    /// The base fitted from the point of a set with a mechanism, if that fit is better.
    fn followed<M: Catalogue>(
        &self,
        base: &FittedSet<M>,
        set: &FittedSet<M>,
    ) -> Result<Option<FittedSet<M>>, InferError> {
        if set.ln_evidence() < base.ln_evidence() + BETTER_BASE_NATS {
            return Ok(None);
        }
        let problem = self.beside(base, &base.model);
        let mut point = set.fit().point.clone();
        point.at.truncate(base.at().len());
        let weighed = self.settled(&problem, &point, set.fit(), 1)?;
        let better = weighed.ln_evidence > base.ln_evidence() + BETTER_BASE_NATS;
        Ok(better.then(|| FittedSet {
            weighed,
            ..base.clone()
        }))
    }

    /// Predicted gains of each of `tried` added to each set of a level, the best first. A base with little noise,
    /// `quiet`, counts as its own fit does.
    fn promising<M: Catalogue>(
        &self,
        level: &[FittedSet<M>],
        tried: &[M::Hypothesis],
        quiet: Option<f64>,
    ) -> Result<Vec<Next>, InferError> {
        let mut next = Vec::new();
        for (parent, found) in level.iter().enumerate() {
            let own = found.ln_score();
            let from = if found.mechanisms.is_empty() {
                quiet.unwrap_or(own)
            } else {
                own
            };
            for screened in self.screen(found, tried)? {
                let mechanism = &tried[screened.tried];
                let start = M::start(mechanism);
                let prior = start.ln_prior + start.ln_share + self.policy.ln_name;
                let ln_score = from + screened.gain + prior;
                if ln_score.is_finite() && !found.has(mechanism) {
                    next.push(Next {
                        ln_score,
                        parent,
                        screened,
                    });
                }
            }
        }
        next.sort_by(|a, b| b.ln_score.total_cmp(&a.ln_score));
        Ok(next)
    }

    /// Fits the most promising sets with a predicted gain of at least `least`: at most so many in all, and of one parent.
    fn fitted<M: Catalogue>(
        &self,
        level: &[FittedSet<M>],
        tried: &[M::Hypothesis],
        next: &[Next],
        least: f64,
        [most, most_of_parent]: [usize; 2],
    ) -> Result<Vec<FittedSet<M>>, InferError> {
        let mut chosen: Vec<&Next> = Vec::new();
        let mut of_parent = vec![0; level.len()];
        let parts = |n: &Next| (&level[n.parent], &tried[n.screened.tried]);
        let is_same_set = |a: &Next, b: &Next| {
            let ((a, last), (b, other)) = (parts(a), parts(b));
            let has = |n| a.has(n) || M::same_cause(last, n);
            a.mechanisms.len() == b.mechanisms.len() && b.mechanisms.iter().chain([other]).all(has)
        };
        for n in next.iter().take_while(|n| n.ln_score > least) {
            if of_parent[n.parent] < most_of_parent && !chosen.iter().any(|c| is_same_set(c, n)) {
                of_parent[n.parent] += 1;
                chosen.push(n);
            }
            if chosen.len() >= most {
                break;
            }
        }
        let fitted = |n: &&Next| {
            let (parent, mechanism) = parts(n);
            self.extended(parent, mechanism, &n.screened.amplitudes)
        };
        parallel_map(&chosen, fitted).into_iter().collect()
    }
}

/// Number of sizes of the discrepancy for screening: the most probable few hold nearly all of the probability.
const SIZES_SCREENED: usize = 6;
/// Largest amplitude along a direction, in prior standard deviations.
const FARTHEST_SD: f64 = 2.0;

impl Start {
    /// Values of the unknowns after `amplitudes` of the directions.
    pub fn at(&self, amplitudes: &[f64]) -> Vec<f64> {
        let of = |k: usize| {
            let nothing = self.nothing[k];
            if !nothing.is_finite() {
                return self.ends[0][k];
            }
            let way = |(end, a): (&Vec<f64>, &f64)| a * (end[k] - nothing);
            nothing + self.ends.iter().zip(amplitudes).map(way).sum::<f64>()
        };
        (0..self.nothing.len()).map(of).collect()
    }
}

/// A hypothesis in a linear problem.
struct Hypothesis {
    ln_evidence: f64,
    amplitudes: Vec<f64>,
    information: f64,
}

impl Hypothesis {
    /// From the problem of its own columns.
    fn of(problem: &Reduced, start: &Start) -> Option<Self> {
        let information = problem.value(0, 0);
        if information <= 0.0 {
            return None;
        }
        let prior = |k: usize| (start.amplitude_sd[k].powi(-2), 0.0);
        let with = problem.without(problem.columns() - 1, prior)?;
        let mut amplitudes = problem.solution(&start.amplitude_sd)?;
        let mut ln_evidence = with.ln_evidence();
        if start.one_sided && amplitudes[0] <= 0.0 {
            // Half of the prior, and less of the likelihood: no more than nothing.
            ln_evidence = f64::NEG_INFINITY;
        }
        for (a, sd) in amplitudes.iter_mut().zip(&start.amplitude_sd) {
            *a = a.clamp(-FARTHEST_SD * sd, FARTHEST_SD * sd);
        }
        Some(Self {
            ln_evidence,
            amplitudes,
            information,
        })
    }
}

pub(crate) fn ln_sum(values: impl Iterator<Item = f64> + Clone) -> f64 {
    let top = values.clone().fold(f64::NEG_INFINITY, f64::max);
    if !top.is_finite() {
        return top;
    }
    top + values.map(|v| (v - top).exp()).sum::<f64>().ln()
}
