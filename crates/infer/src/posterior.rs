//! What is believed after the readings: fits under several sizes of the discrepancy and several
//! noises, each with the weight that its evidence gives it.

use crate::InferError;
use crate::discrepancy::{Basis, COORDINATES, Growth, Sizes};
use crate::evidence::{Evidence, Known, Layout, Products};
use crate::fit::{AxisDrift, Fit, Point, Problem};
use crate::noise::Noise;
use crate::parallel_map::parallel_map;
use crate::rows::{AxisTurn, ForwardModel, PlumePlace};
use nalgebra::{Cholesky, DMatrix, DVector, Dyn};
use std::sync::Arc;

/// Most rounds of sizes of the discrepancy.
const MOST_ROUNDS: usize = 4;
/// Sizes whose evidence is less by this have no neighbours that count, nats.
const NEAR_NATS: f64 = 6.0;
/// Size of the discrepancy that half of the first fits are given: middling, so that it is found
/// where it is and does nothing where it is not.
const FIRST_SIZE: f64 = 0.3;
/// Fluctuation and wander to the sides, and up and down, that the first fits are given, as multiples of what is most probable
/// beforehand: a plume that lies nearly still, one that wanders, and one whose strength flickers.
const FIRST_NOISES: [(f64, f64, f64); 3] = [(0.5, 0.1, 0.3), (1.0, 3.0, 3.0), (3.0, 0.3, 1.0)];
/// Differences for derivatives: part of a standard deviation, and degrees of the axis.
const DIFFERENCE_SD: f64 = 0.05;
const DIFFERENCE_DEG: f64 = 0.05;
/// How far the mean of a plume's logarithm may be from that at the fit's point: beyond a factor of e the linear problem there
/// is not to be believed.
const FARTHEST_LN: f64 = 1.0;
/// The way of a search in its longest steps: a settled fit promises less, and one that promises more has lost the plume.
const WAY_OF_A_SEARCH: f64 = 10.0;
/// How often the noise of a fit on more readings is made most probable.
pub(crate) const REFITS: usize = 5;
/// The search for the noise compares the evidence of values that differ by these factors: the first finds about where it is
/// largest, the second the place. Most rounds of each.
const COARSE_FACTOR: f64 = 2.0;
const POLISH_FACTOR: f64 = 1.5;
const POLISHED: usize = 4;
/// First fits whose noise is fitted, and those of them that are followed to their end.
const REFINED: usize = 4;
const FOLLOWED: usize = 2;

/// A number and how far it may be off.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Estimate {
    /// Mean of the posterior.
    pub value: f64,
    /// One standard deviation.
    pub sd: f64,
}

/// A normal part of the posterior.
#[derive(Debug, Clone)]
struct Part {
    weight: f64,
    sizes: Sizes,
    /// Mean, from the fit's point, column by column.
    step: DVector<f64>,
    precision: Cholesky<f64, Dyn>,
}

/// The posterior of a model's unknowns and of its discrepancy.
#[derive(Debug, Clone)]
pub struct Posterior {
    fit: Fit,
    /// The likeliest first.
    parts: Vec<Part>,
    scatter: Scatter,
    layout: Layout,
    /// Weights of discrepancy and axis drift in the mean over the parts.
    mean_weights: Vec<f64>,
    unknowns: usize,
    ln_evidence: f64,
}

/// A fit with what the linear problem there says of sizes of the discrepancy.
#[derive(Debug, Clone)]
pub(crate) struct Weighed {
    pub fit: Fit,
    pub ln_evidence: f64,
    /// Log evidence of the fit's own sizes alone.
    ln_own: f64,
    /// Logarithms of the shares of sizes, the largest first. Where a discrepancy or an axis drift was fitted,
    /// the linear problem does not say how well none would do.
    pub sizes: Vec<(f64, Sizes)>,
    /// Sizes that look best from there, and the log evidence that they promise.
    promising: (f64, Sizes),
    known: Known,
    products: Products,
    /// Of the problem that it was found in.
    pub turning: Arc<AxisDrift>,
}

impl<M: ForwardModel> Problem<'_, M> {
    /// The posterior from the model's own starts.
    ///
    /// # Errors
    /// Values that the model refuses.
    pub fn posterior(&self) -> Result<Posterior, InferError> {
        self.concluded(self.weighed()?)
    }

    /// The posterior from the most promising start alone, with the noise fitted once and no search
    /// over its sizes: enough to see whether the readings locate the plume.
    ///
    /// # Errors
    /// Values that the model refuses.
    pub fn quick_posterior(&self) -> Result<Posterior, InferError> {
        self.concluded(self.quick()?)
    }

    pub(crate) fn quick(&self) -> Result<Weighed, InferError> {
        self.quick_from(&self.search()?)
    }

    fn quick_from(&self, start: &Point) -> Result<Weighed, InferError> {
        let point = self.rough_fit(start, 0.0)?;
        let basis = self.basis(&point)?;
        let sizes = self.policy.nearest_sizes(0.0, 0.0);
        let first = self.fit(&point, &basis, self.usual_noise(), sizes)?;
        self.around(self.refit_noise(&first)?)
    }

    /// The posterior from where a fit of some of the same readings came to, with the noise so well found that standard
    /// deviations do not depend on where it came from.
    ///
    /// # Errors
    /// Values that the model refuses.
    pub fn refined_posterior(&self, before: &Fit) -> Result<Posterior, InferError> {
        self.concluded(self.refined(before)?)
    }

    pub(crate) fn refined(&self, before: &Fit) -> Result<Weighed, InferError> {
        let best = self.polished(self.carried(before)?, POLISH_FACTOR)?;
        // What began with a discrepancy or an axis drift may be better without.
        let calm = self.quiet_noise();
        let none = self.policy.nearest_sizes(0.0, 0.0);
        let fit = &best.fit;
        let calm = self.settled(&fit.point, &fit.basis, (calm, none), REFITS)?;
        // Noise that is not polished yet may cost it as much as sizes that do not count.
        if calm.ln_evidence < best.ln_evidence - NEAR_NATS {
            return Ok(best);
        }
        let calm = self.polished(calm, POLISH_FACTOR)?;
        Ok(if calm.ln_evidence > best.ln_evidence {
            calm
        } else {
            best
        })
    }

    fn carried(&self, before: &Fit) -> Result<Weighed, InferError> {
        // Basis functions lie over the places and times of the readings. The weights of the discrepancy are found in
        // a step or two.
        let before = self.with_own_axis_drift(before);
        let axis_drift = before.point.weights[before.basis.of_discrepancy()..].to_vec();
        let point = Point {
            at: before.point.at,
            weights: axis_drift,
        };
        let basis = self.basis(&point)?;
        // With its noise and discrepancy a wrong valley explains itself: without them more readings may
        // lead out of it.
        let bare = Point {
            at: point.at.clone(),
            weights: vec![0.0; self.turning.axis_drift.len()],
        };
        let mut both = parallel_map(&[true, false], |is_carried| {
            if *is_carried {
                self.settled(&point, &basis, (before.noise, before.sizes), REFITS)
            } else {
                self.quick_from(&bare)
            }
        })
        .into_iter();
        let mut next = || both.next().unwrap_or(Err(InferError::NoPosterior));
        let (carried, anew) = (next()?, next()?);
        if anew.ln_evidence < carried.ln_evidence {
            return Ok(carried);
        }
        let fit = &anew.fit;
        self.settled(&fit.point, &fit.basis, (fit.noise, fit.sizes), REFITS)
    }

    /// The fit with the noise that has the largest evidence, looked for in steps of a factor. The likelihood at one point
    /// alone prefers noises that are too small, as the point was fitted too.
    pub(crate) fn polished(&self, mut best: Weighed, factor: f64) -> Result<Weighed, InferError> {
        for _ in 0..POLISHED {
            let noise = self.noise_by_evidence(&best, factor)?;
            let fit = &best.fit;
            let next = self.settle_sizes(self.fit(&fit.point, &fit.basis, noise, fit.sizes)?)?;
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

    /// Noise whose sizes and memory have the largest evidence at one point, each by a parabola through three values.
    fn noise_by_evidence(&self, of: &Weighed, factor: f64) -> Result<Noise, InferError> {
        let sizes = of.likeliest_sizes();
        let evidence = |noise: &Noise| -> Result<f64, InferError> {
            let mut fit = of.fit.clone();
            fit.noise = *noise;
            let (known, products) = self.products(&fit, &[], &[self.rows.whole()])?;
            Ok(Evidence::new(&products[0], &known).ln(&sizes) + self.ln_noise_prior(noise))
        };
        let mut noise = of.fit.noise;
        for part in BY_EVIDENCE {
            let scaled = |mut noise: Noise, by: f64| {
                *part(&mut noise) *= by;
                noise
            };
            let tried = [1.0, factor, 1.0 / factor].map(|by| scaled(noise, by));
            let found: Result<Vec<f64>, _> = parallel_map(&tried, evidence).into_iter().collect();
            let found = found?;
            let (more, less) = (found[1] - found[0], found[2] - found[0]);
            let bend = more + less;
            let way = if bend < 0.0 {
                (0.5 * (less - more) / bend).clamp(-1.0, 1.0)
            } else {
                (more - less).signum()
            };
            noise = scaled(noise, factor.powf(way));
        }
        Ok(noise)
    }

    /// The fit from a point under noise and sizes, its noise made most probable at most so many times.
    pub(crate) fn settled(
        &self,
        point: &Point,
        basis: &Basis,
        (noise, sizes): (Noise, Sizes),
        times: usize,
    ) -> Result<Weighed, InferError> {
        let mut best = self.settle_sizes(self.fit(point, basis, noise, sizes)?)?;
        for _ in 0..times {
            // The likelihood at a point prefers noises that are too small: the evidence decides.
            let next = self.settle_sizes(self.refit_noise(&best.fit)?)?;
            if next.ln_evidence < best.ln_evidence + self.policy.settled_nats {
                break;
            }
            best = next;
        }
        Ok(best)
    }

    /// The fit with the largest evidence from the model's own starts.
    pub(crate) fn weighed(&self) -> Result<Weighed, InferError> {
        let mut found = self.first_fits()?;
        sort(&mut found);
        found.truncate(FOLLOWED);
        let followed = parallel_map(&found, |first| {
            let fit = self.refit_noise(&self.refit_noise(&first.fit)?)?;
            self.polished(self.settle_sizes(fit)?, COARSE_FACTOR)
        });
        let mut found = followed.into_iter().collect::<Result<Vec<_>, _>>()?;
        sort(&mut found);
        found.into_iter().next().ok_or(InferError::NoPosterior)
    }

    /// Noises of the first fits.
    pub(crate) fn first_noises(&self) -> impl Iterator<Item = Noise> {
        let usual = self.usual_noise();
        FIRST_NOISES
            .into_iter()
            .map(move |(fluctuation, wander, wander_of_height)| Noise {
                fluctuation: usual.fluctuation * fluctuation,
                wander_deg: usual.wander_deg * wander,
                wander_sigma_z: usual.wander_sigma_z * wander_of_height,
                ..usual
            })
    }

    /// Posteriors from several starts, noises and sizes of the discrepancy: the likelihood has
    /// several valleys where a plume wanders.
    fn first_fits(&self) -> Result<Vec<Weighed>, InferError> {
        let still = self.rough_fit(&self.search()?, 0.0)?;
        let (swung, axis_drift_deg) = self.swung(&still)?;
        let mut points = vec![(still, 0.0)];
        let least_deg = self.policy.axis_drift_sizes_deg[0];
        if axis_drift_deg > 0.5 * least_deg {
            let axis_drift_deg = axis_drift_deg.max(least_deg);
            points.push((self.rough_fit(&swung, axis_drift_deg)?, axis_drift_deg));
        }
        let mut firsts = Vec::new();
        for (point, axis_drift_deg) in &points {
            let basis = self.basis(point)?;
            for form in [0.0, FIRST_SIZE] {
                let sizes = self.policy.nearest_sizes(form, *axis_drift_deg);
                for noise in self.first_noises() {
                    firsts.push((point, basis.clone(), noise, sizes));
                }
            }
        }
        let found = parallel_map(&firsts, |(point, basis, noise, sizes)| {
            self.around(self.fit(point, basis, *noise, *sizes)?)
        });
        let mut found = found.into_iter().collect::<Result<Vec<_>, _>>()?;
        found.sort_by(|a, b| b.promising.0.total_cmp(&a.promising.0));
        found.truncate(REFINED);
        let refined = parallel_map(&found, |f| {
            let fit = self.refit_noise(&f.fit)?;
            self.settle_sizes(fit)
        });
        refined.into_iter().collect()
    }

    /// The fit under the same noise whose point has the sizes of the discrepancy that are likeliest
    /// there: what a linear problem says of sizes far from those of its point is not to be believed, and where a fit
    /// with them does not keep what they promised, none counts that promises more than the point's own.
    pub(crate) fn settle_sizes(&self, fit: Fit) -> Result<Weighed, InferError> {
        let mut best = self.around(fit)?;
        for _ in 0..MOST_ROUNDS {
            let sizes = best.promising.1;
            if sizes == best.fit.sizes {
                return Ok(best);
            }
            let fit = &best.fit;
            let next = self.around(self.fit(&fit.point, &fit.basis, fit.noise, sizes)?)?;
            if next.ln_own < best.ln_own {
                break;
            }
            best = next;
        }
        best.drop_promises();
        Ok(best)
    }

    /// The sizes of the discrepancy and their evidence by the linear problem at a fit's point.
    pub(crate) fn around(&self, fit: Fit) -> Result<Weighed, InferError> {
        let (known, mut products) = self.products(&fit, &[], &[self.rows.whole()])?;
        let products = products.remove(0);
        let mut evidence = Evidence::new(&products, &known);
        let mut scored = |sizes: Sizes| (evidence.ln(&sizes) + self.policy.ln_sizes(&sizes), sizes);
        // What differs from the likeliest sizes on more than two coordinates weighs nothing.
        let mut likeliest = scored(fit.sizes);
        let of_point = likeliest.0;
        let mut sizes: Vec<(f64, Sizes)>;
        loop {
            sizes = self
                .policy
                .neighbours(likeliest.1)
                .map(&mut scored)
                .collect();
            match sizes.iter().max_by(|a, b| a.0.total_cmp(&b.0)) {
                Some(best) if best.0 > likeliest.0 => likeliest = *best,
                _ => break,
            }
        }
        let near: Vec<Sizes> = sizes
            .iter()
            .filter(|p| likeliest.0 - p.0 < NEAR_NATS)
            .map(|p| p.1)
            .collect();
        sizes.push(likeliest);
        let far = near.into_iter().flat_map(|s| self.policy.neighbours(s));
        let own = self.policy.neighbours(fit.sizes);
        for other in far.chain(own).chain([fit.sizes]) {
            if !sizes.iter().any(|s| s.1 == other) {
                sizes.push(scored(other));
            }
        }
        sizes.sort_by(|a, b| b.0.total_cmp(&a.0));
        let ln_noise = self.ln_noise_prior(&fit.noise);
        let promising = (sizes[0].0 + ln_noise, sizes[0].1);
        let has = fit.basis.weighted(&fit.point.weights);
        sizes.retain(|s| has.all_may_be(&s.1, self.policy));
        let top = sizes.first().map_or(f64::NEG_INFINITY, |s| s.0);
        if !top.is_finite() {
            return Err(InferError::NoPosterior);
        }
        let total = sizes.iter().map(|p| (p.0 - top).exp()).sum::<f64>().ln();
        sizes.retain(|p| p.0 - top > self.policy.least_weight.ln());
        for share in &mut sizes {
            share.0 -= top + total;
        }
        Ok(Weighed {
            ln_evidence: top + total + ln_noise,
            ln_own: of_point + ln_noise,
            sizes,
            promising,
            fit,
            known,
            products,
            turning: self.turning.clone(),
        })
    }

    /// Means and covariances around a fit.
    pub(crate) fn concluded(&self, found: Weighed) -> Result<Posterior, InferError> {
        let layout = found.known.layout.clone();
        let part = |&(ln, sizes): &(f64, Sizes)| {
            let coordinates = found.fit.basis.coordinates();
            let (mut step, precision) = found.known.solved(&found.products, &sizes, coordinates)?;
            // A fit that did not settle promises what a linear problem cannot keep.
            step.unscale_mut(self.excess_of_unknowns(&found.known, &step));
            Some(Part {
                weight: ln.exp(),
                sizes,
                step,
                precision,
            })
        };
        let mut parts: Vec<Part> = found.sizes.iter().filter_map(part).collect();
        let kept: f64 = parts.iter().map(|p| p.weight).sum();
        parts.iter_mut().for_each(|p| p.weight /= kept);
        if parts.is_empty() {
            return Err(InferError::NoPosterior);
        }
        let scatter = self.scatter(&found, &parts[0])?;
        let step = mean_step(&parts, layout.tried);
        let places = layout.weights.iter().zip(&found.fit.point.weights);
        Ok(Posterior {
            mean_weights: places.map(|(place, w)| w + step[*place]).collect(),
            scatter,
            ln_evidence: found.ln_evidence,
            unknowns: self.unknowns(),
            parts,
            layout,
            fit: found.fit,
        })
    }
}

impl<M: ForwardModel> Problem<'_, M> {
    /// Factor by which the unknowns' part of a step exceeds the way of a whole search; at least one.
    fn excess_of_unknowns(&self, known: &Known, step: &DVector<f64>) -> f64 {
        let unknowns = step.iter().skip(known.layout.unknowns);
        let in_sd = unknowns
            .zip(&known.precision)
            .map(|(s, p)| s.abs() * p.sqrt());
        in_sd
            .map(|sd| sd / (WAY_OF_A_SEARCH * self.policy.longest_step_sd))
            .fold(1.0, f64::max)
    }

    fn scatter(&self, found: &Weighed, likeliest: &Part) -> Result<Scatter, InferError> {
        let (known, by_pass) = self.by_pass(&found.fit)?;
        let (n, columns) = (known.layout.tried, known.layout.columns);
        let pull = |products: &Products| -> DVector<f64> {
            let all = products.matrix(columns);
            let misfit = all.view((0, columns - 1), (n, 1)).column(0).into_owned();
            misfit - all.view((0, 0), (n, n)) * &likeliest.step
        };
        let coordinates = found.fit.basis.coordinates();
        Ok(Scatter {
            pulls: by_pass.iter().map(pull).collect(),
            precision: known.precision_under(&likeliest.sizes, coordinates),
        })
    }
}

/// By how much passes pull elsewhere than all of them together, each its own way. Noise that is common to
/// all platforms, or lasts longer than it is taken to, makes this more than independent readings would
/// (White 1982).
#[derive(Debug, Clone)]
struct Scatter {
    pulls: Vec<DVector<f64>>,
    /// What is known beforehand of every column, which does not scatter.
    precision: Vec<f64>,
}

impl Scatter {
    /// Factor on the standard deviation of a linear function, for which the posterior's covariance
    /// gives the column `worth`: at least one.
    fn widening(&self, function: &DVector<f64>, worth: &DVector<f64>) -> f64 {
        let count = self.pulls.len() as f64;
        let pulled: f64 = self.pulls.iter().map(|g| g.dot(worth).powi(2)).sum();
        let known = self.precision.iter().zip(worth.iter());
        let prior: f64 = known.map(|(p, h)| p * h * h).sum();
        let variance = function.dot(worth);
        let scattered = pulled * count / (count - 1.0) / (variance - prior);
        widened(variance, self.prior_variance(function), scattered)
    }

    /// Variance of a linear function before any reading.
    fn prior_variance(&self, function: &DVector<f64>) -> f64 {
        let each = function.iter().zip(&self.precision);
        each.filter(|(f, _)| **f != 0.0)
            .map(|(f, p)| f * f / p)
            .sum()
    }
}

/// Factor on a standard deviation where readings scatter `scattered` times as much, as a variance, as they are taken to: they
/// tell less by that, and what is known beforehand stays. So nothing becomes less certain than it was beforehand.
pub(crate) fn widened(variance: f64, prior: f64, scattered: f64) -> f64 {
    let told = 1.0 / variance - 1.0 / prior;
    if !(told > 0.0 && scattered > 1.0 && scattered.is_finite()) {
        return 1.0;
    }
    (1.0 / (variance * (1.0 / prior + told / scattered))).sqrt()
}

impl Weighed {
    /// The sizes of the discrepancy that are most probable.
    pub fn likeliest_sizes(&self) -> Sizes {
        self.sizes.first().map_or([0.0; COORDINATES], |s| s.1)
    }

    /// Leaves out sizes that promise more than those of the fit's point.
    fn drop_promises(&mut self) {
        let own = self.fit.sizes;
        self.promising = (self.ln_own, own);
        let Some(kept) = self.sizes.iter().find(|s| s.1 == own).map(|s| s.0) else {
            self.sizes = vec![(0.0, own)];
            self.ln_evidence = self.ln_own;
            return;
        };
        self.sizes.retain(|s| s.0 <= kept);
        let total = kept
            + self
                .sizes
                .iter()
                .map(|s| (s.0 - kept).exp())
                .sum::<f64>()
                .ln();
        self.ln_evidence += total;
        self.sizes.iter_mut().for_each(|s| s.0 -= total);
    }

    /// Log evidence where these sizes alone are possible, nats; they become the only ones.
    pub fn only<M: ForwardModel>(
        &mut self,
        sizes: &Sizes,
        policy: &crate::Policy,
        problem: &Problem<'_, M>,
    ) -> f64 {
        self.sizes = vec![(0.0, *sizes)];
        let ln = Evidence::new(&self.products, &self.known).ln(sizes);
        let ln = ln + policy.ln_sizes(sizes) + problem.ln_noise_prior(&self.fit.noise);
        self.promising = (ln, *sizes);
        ln
    }
}

/// The likeliest first.
fn sort(found: &mut [Weighed]) {
    found.sort_by(|a, b| b.ln_evidence.total_cmp(&a.ln_evidence));
}

/// What of the noise is looked for by its evidence.
const BY_EVIDENCE: [fn(&mut Noise) -> &mut f64; 4] = [
    |noise| &mut noise.fluctuation,
    |noise| &mut noise.wander_deg,
    |noise| &mut noise.wander_sigma_z,
    |noise| &mut noise.wander_s,
];

fn mean_step(parts: &[Part], tried: usize) -> DVector<f64> {
    let none = DVector::zeros(tried);
    parts.iter().fold(none, |sum, p| sum + p.weight * &p.step)
}

impl Posterior {
    /// The fit around which it was made.
    pub fn fit(&self) -> &Fit {
        &self.fit
    }

    /// Natural logarithm of the evidence, nats, up to a constant of the readings.
    pub fn ln_evidence(&self) -> f64 {
        self.ln_evidence
    }

    /// The sizes of the discrepancy that are most probable.
    pub fn likeliest_sizes(&self) -> Sizes {
        let most = self
            .parts
            .iter()
            .max_by(|a, b| a.weight.total_cmp(&b.weight));
        most.map_or([0.0; COORDINATES], |p| p.sizes)
    }

    /// Mean of the unknowns.
    pub fn mean(&self) -> DVector<f64> {
        let own = self
            .step()
            .rows(self.layout.unknowns, self.unknowns)
            .into_owned();
        own + DVector::from_column_slice(&self.fit.point.at)
    }

    /// Covariance of the unknowns.
    pub fn covariance(&self) -> DMatrix<f64> {
        let mut own = DMatrix::zeros(self.unknowns, self.layout.tried);
        for k in 0..self.unknowns {
            own[(k, self.layout.unknowns + k)] = 1.0;
        }
        self.covariance_of(&own)
    }

    /// Mean of the steps from the fit's point.
    pub(crate) fn step(&self) -> DVector<f64> {
        mean_step(&self.parts, self.layout.tried)
    }

    /// Covariance of linear functions, row by row, of all columns.
    pub(crate) fn covariance_of(&self, functions: &DMatrix<f64>) -> DMatrix<f64> {
        let n = functions.nrows();
        let mean = functions * self.step();
        let mut out = DMatrix::zeros(n, n);
        for part in &self.parts {
            let off = functions * &part.step - &mean;
            let solved = part.precision.solve(&functions.transpose());
            out += part.weight * (functions * solved + &off * off.transpose());
        }
        for k in 0..n {
            let widening = self.widening(&functions.row(k).transpose());
            out.row_mut(k).scale_mut(widening);
            out.column_mut(k).scale_mut(widening);
        }
        out
    }

    /// By what standard deviations of a linear function of all columns are larger for the scatter from
    /// pass to pass.
    fn widening(&self, function: &DVector<f64>) -> f64 {
        let worth = self.parts[0].precision.solve(function);
        self.scatter.widening(function, &worth)
    }

    /// Variances of linear functions, row by row, of all columns before any reading.
    pub(crate) fn prior_variance(&self, functions: &DMatrix<f64>) -> DVector<f64> {
        let rows = functions.row_iter();
        let of = rows.map(|row| self.scatter.prior_variance(&row.transpose()));
        DVector::from_iterator(functions.nrows(), of)
    }

    /// The same of an unknown.
    pub(crate) fn widening_of(&self, unknown: usize) -> f64 {
        let mut function = DVector::zeros(self.layout.tried);
        function[self.layout.unknowns + unknown] = 1.0;
        self.widening(&function)
    }

    /// Whether an axis drift was fitted.
    pub fn has_axis_drift(&self) -> bool {
        let axis_drift = &self.fit.point.weights[self.fit.basis.of_discrepancy()..];
        axis_drift.iter().any(|weight| *weight != 0.0)
    }

    /// Width of the basis functions of the axis drift, s.
    pub fn axis_drift_width_s(&self) -> f64 {
        self.fit.basis.axis_drift_width_s()
    }

    /// Turn of the axis at a time beside the means of the unknowns: what of a steady turn
    /// the mean lays on the unknown axis it takes from here.
    pub fn turn(&self, time_s: f64) -> AxisTurn {
        self.fit.basis.turn_since(time_s, 0.0, &self.mean_weights)
    }

    /// The same to the side alone.
    pub fn turn_deg(&self, time_s: f64) -> f64 {
        self.turn(time_s).clockwise_deg
    }

    /// Mean turn of the axis at these times, degrees clockwise, with how far it may be off, together with the
    /// unknown that turns the axis for good, if there is one.
    pub fn mean_turn(&self, times_s: &[f64], beside: Option<usize>) -> Estimate {
        let (value, mut function) = self.mean_drift(times_s, 0);
        if let Some(k) = beside {
            function[(0, self.layout.unknowns + k)] = 1.0;
        }
        self.estimate_of(value, &function)
    }

    /// Mean turn of the axis upwards at these times, degrees, with how far it may be off.
    pub fn mean_rise(&self, times_s: &[f64]) -> Estimate {
        let (value, function) = self.mean_drift(times_s, 1);
        self.estimate_of(value, &function)
    }

    /// Mean of the axis drift at these times, degrees, in the direction 0, to the sides, or 1, upwards: its value, and its
    /// coefficients in all columns.
    fn mean_drift(&self, times_s: &[f64], direction: usize) -> (f64, DMatrix<f64>) {
        let n = self.fit.basis.functions_per_direction();
        let first = self.fit.basis.of_discrepancy() + direction * n;
        let mut basis_functions = vec![0.0; n];
        let mut function = DMatrix::zeros(1, self.layout.tried);
        let (count, mut value) = (times_s.len() as f64, 0.0);
        for time_s in times_s {
            self.fit
                .basis
                .fill_axis_drift(*time_s, &mut basis_functions);
            for (k, basis_function) in (first..).zip(&basis_functions) {
                function[(0, self.layout.weights[k])] += basis_function / count;
                value += self.mean_weights[k] * basis_function / count;
            }
        }
        (value, function)
    }

    fn estimate_of(&self, value: f64, function: &DMatrix<f64>) -> Estimate {
        Estimate {
            value,
            sd: self.covariance_of(function)[(0, 0)].max(0.0).sqrt(),
        }
    }

    /// What is to be met at a place at the fit's most probable point; see [`Posterior::at_place`].
    pub fn value_at(
        &self,
        time_s: f64,
        value: impl Fn(&[f64], f64) -> (f64, f64, PlumePlace),
    ) -> f64 {
        let fit = &self.fit;
        let turn_deg = fit.basis.turn_deg(time_s, &fit.point.weights);
        let (rest, plume, place) = value(&fit.point.at, turn_deg);
        rest + plume * self.growth(&place).0.factor
    }

    /// The discrepancy of the fit's point at a place, and the values of the basis functions there.
    fn growth(&self, place: &PlumePlace) -> (Growth, Vec<f64>) {
        let (basis, weights) = (&self.fit.basis, &self.fit.point.weights);
        let form = basis.of_discrepancy();
        let mut basis_functions = vec![0.0; basis.len()];
        basis.fill(place, &mut basis_functions);
        (
            Basis::growth(&basis_functions[..form], &weights[..form]),
            basis_functions,
        )
    }

    /// What is to be met at a place: `value` gives for the unknowns and a turn of the axis in degrees
    /// what is there besides the plume and the plume, both in the unit of the readings, and where in
    /// the plume the place lies. The axis is turned as it was at `time_s`.
    pub fn at_place(
        &self,
        time_s: f64,
        value: impl Fn(&[f64], f64) -> (f64, f64, PlumePlace),
    ) -> Estimate {
        let there = self.near(time_s, value);
        let mean_step = self.step();
        let shift = |slope: &DVector<f64>| slope.dot(&mean_step);
        // A plume is positive, and known to a factor: the median of a logarithm.
        let ln_plume = shift(&there.ln_plume_slope).clamp(-FARTHEST_LN, FARTHEST_LN);
        let plume = there.plume * ln_plume.exp();
        let slope = &there.rest_slope + plume * &there.ln_plume_slope;
        let mean = shift(&slope);
        let variance = |p: &Part| {
            let off = slope.dot(&p.step) - mean;
            p.weight * (p.precision.solve(&slope).dot(&slope) + off * off)
        };
        let variance: f64 = self.parts.iter().map(variance).sum();
        Estimate {
            value: there.rest + shift(&there.rest_slope) + plume,
            sd: variance.max(0.0).sqrt() * self.widening(&slope),
        }
    }

    /// What is to be met at a place, linearised at the fit's point.
    fn near(&self, time_s: f64, value: impl Fn(&[f64], f64) -> (f64, f64, PlumePlace)) -> Near {
        let (fit, basis) = (&self.fit, &self.fit.basis);
        let form = basis.of_discrepancy();
        let met = |at: &[f64], turn_deg: f64| {
            let (rest, plume, place) = value(at, turn_deg);
            (rest, plume * self.growth(&place).0.factor)
        };
        let at = &fit.point.at;
        let turn_deg = basis.turn_deg(time_s, &fit.point.weights);
        let (rest, plume, place) = value(at, turn_deg);
        let (growth, here_bumps) = self.growth(&place);
        let plume = plume * growth.factor;
        let mut near = Near {
            rest,
            plume,
            rest_slope: DVector::zeros(self.layout.tried),
            ln_plume_slope: DVector::zeros(self.layout.tried),
        };
        // Of no plume there is no logarithm.
        let relative = |change: f64| {
            if plume.is_normal() {
                change / plume
            } else {
                0.0
            }
        };
        let sds = self.covariance().diagonal();
        for k in 0..self.unknowns {
            let difference = DIFFERENCE_SD * sds[k].sqrt();
            if difference > 0.0 {
                let mut aside = at.clone();
                aside[k] += difference;
                let (other, grown) = met(&aside, turn_deg);
                near.rest_slope[self.layout.unknowns + k] = (other - rest) / difference;
                near.ln_plume_slope[self.layout.unknowns + k] =
                    relative((grown - plume) / difference);
            }
        }
        let turned = met(at, turn_deg + DIFFERENCE_DEG).1;
        let per_degree = relative((turned - plume) / DIFFERENCE_DEG);
        for (k, (basis_function, place)) in here_bumps.iter().zip(&self.layout.weights).enumerate()
        {
            let each = if k < form {
                growth.slope / growth.factor
            } else {
                per_degree
            };
            near.ln_plume_slope[*place] = each * basis_function;
        }
        near
    }
}

/// What is to be met at a place, and what each column changes of it: of what is there besides the plume, and of the
/// logarithm of the plume.
struct Near {
    rest: f64,
    plume: f64,
    rest_slope: DVector<f64>,
    ln_plume_slope: DVector<f64>,
}
