//! Probabilities of sets of mechanisms averaged over bootstrap draws of the passes, so that a few passes alone cannot
//! decide (bagged posteriors: Huggins and Miller 2023).

use crate::InferError;
use crate::hold_out::ByPass;
use crate::mechanism_search::{Catalogue, FittedSet, Question, base_of, without};
use crate::parallel_map::parallel_map;
use rand::rngs::ChaCha8Rng;
use rand::{RngExt, SeedableRng};
use std::collections::BTreeMap;
use std::ops::Range;

/// Number of bootstrap draws.
const DRAWS: usize = 40;
/// Largest number of sets to evaluate, besides those without one of their mechanisms.
const MOST_SETS: usize = 12;
/// A set whose log evidence is lower by this, nats, is no rival in any draw: one in 3,000.
pub(crate) const RIVAL_NATS: f64 = 8.0;

/// The passes of a record with their weights in every draw.
pub(crate) struct Passes {
    /// Rows of each pass.
    pub rows: Vec<Vec<Range<usize>>>,
    /// Weight of each, draw by draw.
    pub draws: Vec<Vec<f64>>,
}

impl Passes {
    /// Draws with replacement, each of as many passes as the record has.
    pub fn drawn(rows: Vec<Vec<Range<usize>>>, seed: u64) -> Self {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let mut draw = || {
            let mut times = vec![0.0; rows.len()];
            for _ in 0..rows.len() {
                times[rng.random_range(0..rows.len())] += 1.0;
            }
            times
        };
        let draws = (0..DRAWS).map(|_| draw()).collect();
        Self { rows, draws }
    }
}

/// A set's log evidences, nats.
pub(crate) struct BootstrappedSet {
    /// In each draw.
    pub ln: Vec<f64>,
    /// Log predictive density of each pass given the others.
    pub hold_out: Vec<f64>,
}

impl BootstrappedSet {
    fn of(by_pass: &ByPass, passes: &Passes) -> Self {
        Self {
            ln: passes.draws.iter().map(|t| by_pass.ln(t)).collect(),
            hold_out: by_pass.hold_out(),
        }
    }
}

/// The sets of a search, the most probable first, with the bootstrap evidences of those that matter.
pub(crate) struct Bootstrap<'f, M: Catalogue> {
    pub found: &'f [FittedSet<M>],
    pub passes: &'f Passes,
    sets: BTreeMap<usize, BootstrappedSet>,
}

impl<'f, M: Catalogue> Bootstrap<'f, M> {
    /// Evaluates `which` of the sets over the draws.
    pub fn new(
        question: &Question<'_>,
        found: &'f [FittedSet<M>],
        passes: &'f Passes,
        which: Vec<usize>,
    ) -> Result<Self, InferError> {
        let mut drawn = Self {
            found,
            passes,
            sets: BTreeMap::new(),
        };
        drawn.weigh(question, which)?;
        Ok(drawn)
    }

    /// The most probable sets, those without one of their mechanisms, and the base.
    pub fn near(found: &[FittedSet<M>]) -> Vec<usize> {
        let least = found[0].ln_score() - RIVAL_NATS;
        let near = found.iter().take_while(|f| f.ln_score() > least).count();
        let likeliest = 0..near.clamp(1, MOST_SETS);
        let mut which: Vec<usize> = likeliest.clone().collect();
        for set in &found[likeliest] {
            which.extend((0..set.mechanisms.len()).map(|k| without(found, set, k)));
        }
        which.push(base_of(found));
        which
    }

    /// Evaluates further sets over the draws.
    pub fn weigh(
        &mut self,
        question: &Question<'_>,
        mut which: Vec<usize>,
    ) -> Result<(), InferError> {
        which.retain(|set| !self.sets.contains_key(set));
        which.sort_unstable();
        which.dedup();
        let weighed = parallel_map(&which, |set| {
            let by_pass = question.by_pass(&self.found[*set], &self.passes.rows)?;
            Ok((*set, BootstrappedSet::of(&by_pass, self.passes)))
        });
        for set in weighed {
            let (set, weighed) = set?;
            self.sets.insert(set, weighed);
        }
        Ok(())
    }

    /// The evidences of a set, if evaluated.
    pub fn get(&self, set: usize) -> Option<&BootstrappedSet> {
        self.sets.get(&set)
    }

    /// The most probable evaluated sets: at most `most`, each with at least the probability `least`.
    pub fn likeliest(&self, most: usize, least: f64) -> Vec<usize> {
        let weighed: Vec<usize> = self.sets.keys().copied().collect();
        let mut order: Vec<(usize, f64)> = weighed
            .iter()
            .copied()
            .zip(self.shares(&weighed))
            .filter(|s| s.1 > least)
            .collect();
        order.sort_by(|a, b| b.1.total_cmp(&a.1));
        order.truncate(most);
        order.into_iter().map(|s| s.0).collect()
    }

    /// Probability of each of some sets among them, averaged over the draws.
    pub fn shares(&self, of: &[usize]) -> Vec<f64> {
        let ln: Vec<&BootstrappedSet> = of.iter().filter_map(|s| self.sets.get(s)).collect();
        let mut share = vec![0.0; ln.len()];
        for draw in 0..self.passes.draws.len() {
            let top = ln
                .iter()
                .map(|s| s.ln[draw])
                .fold(f64::NEG_INFINITY, f64::max);
            let all: f64 = ln.iter().map(|s| (s.ln[draw] - top).exp()).sum();
            for (share, set) in share.iter_mut().zip(&ln) {
                *share += (set.ln[draw] - top).exp() / all / self.passes.draws.len() as f64;
            }
        }
        share
    }
}
