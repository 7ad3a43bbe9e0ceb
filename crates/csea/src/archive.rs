//! All samples so far, with a spatial index.
//!
//! The index is a k-d tree of the crate `kiddo`. Samples come in one by one along flight paths:
//! a k-d tree that grows by insertion degenerates on such data, so the archive keeps a few
//! immutable trees of geometrically growing size (the logarithmic method of Bentley and Saxe,
//! 1980, doi 10.1016/0196-6774(80)90015-2, with ratio 8) and a short unindexed tail. A sample is
//! re-indexed a handful of times in its life, whatever the shape of the data.

use std::collections::BTreeMap;
use std::num::NonZero;
use std::ops::Range;

use kiddo::{ImmutableKdTree, SquaredEuclidean};

use crate::error::{CseaError, setting};
use air::geo::Position;

/// Samples that may wait unindexed.
const TAIL: usize = 64;
/// How much larger each tree is than the one below it.
const RATIO: usize = 8;

/// A value sensed at a place.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sample {
    /// Where.
    pub position: Position,
    /// What, in the field's unit (ppm in Plumage).
    pub value: f64,
}

/// How samples are kept.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ArchiveOptions {
    /// Edge of the cells in which samples are merged, m; `None` keeps every sample. With cells
    /// the archive is bounded by the volume flown through, not by the time flown.
    pub cell_m: Option<f64>,
    /// Metres of horizontal distance that one metre of height is worth: plumes are flat.
    pub height_weight: f64,
    /// Samples after which a cell forgets: its mean moves by at least one part in `memory`, so
    /// that it follows a field that changes slowly.
    pub memory: f64,
}

impl Default for ArchiveOptions {
    fn default() -> Self {
        Self {
            cell_m: Some(20.0),
            height_weight: 2.0,
            memory: 20.0,
        }
    }
}

/// One of the nearest samples.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Neighbour {
    /// Its place in [`Archive::samples`].
    pub index: usize,
    /// Its squared distance with height weighted, m².
    pub distance_sq_m2: f64,
}

/// Weights of the samples near a place in the estimate there.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SmoothingKernel {
    /// Standard deviation of the Gaussian weight, m.
    pub length_m: f64,
    /// Samples asked at most, the nearest ones.
    pub neighbours: usize,
}

/// The estimate of the field at a place.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FieldEstimate {
    /// Weighted mean of the neighbours' values; the archive's mean where nothing is near.
    pub value: f64,
    /// Sum of the neighbours' weights, each 0…1: how much has been sensed here.
    pub support: f64,
}

/// The samples of a search.
#[derive(Debug)]
pub struct Archive {
    options: ArchiveOptions,
    samples: Vec<Sample>,
    counts: Vec<u32>,
    /// Places in `samples` by cell.
    cells: BTreeMap<[i64; 3], u32>,
    /// Trees over consecutive ranges of `samples`, the largest and oldest first.
    trees: Vec<(Range<usize>, ImmutableKdTree<f64, 3>)>,
    /// Indexed coordinates, height weighted; fixed once a sample is in.
    indexed: Vec<[f64; 3]>,
    moments: Moments,
}

/// Running mean and spread of all values that ever came in (Welford 1962).
#[derive(Debug, Clone, Copy, Default)]
struct Moments {
    count: f64,
    mean: f64,
    squares: f64,
}

impl Archive {
    /// An empty archive.
    ///
    /// # Errors
    /// A cell edge outside 0.1…10 000 m, a height weight outside 0.01…100, a memory below 1.
    pub fn new(options: ArchiveOptions) -> Result<Self, CseaError> {
        if let Some(cell_m) = options.cell_m {
            setting("cell_m", cell_m, 0.1, 1e4, "0.1 to 10000 m")?;
        }
        setting(
            "height_weight",
            options.height_weight,
            0.01,
            100.0,
            "0.01 to 100",
        )?;
        setting("memory", options.memory, 1.0, 1e9, "at least 1 sample")?;
        Ok(Self {
            options,
            samples: Vec::new(),
            counts: Vec::new(),
            cells: BTreeMap::new(),
            trees: Vec::new(),
            indexed: Vec::new(),
            moments: Moments::default(),
        })
    }

    /// Takes one sample in: into its cell, or as a new one.
    ///
    /// # Errors
    /// A position or value that is not finite; the archive is then unchanged.
    pub fn push(&mut self, sample: Sample) -> Result<(), CseaError> {
        if !sample.position.is_finite() || !sample.value.is_finite() {
            return Err(CseaError::NotFinite);
        }
        self.moments.add(sample.value);
        let Some(cell_m) = self.options.cell_m else {
            self.append(sample, self.weighted(sample.position));
            return Ok(());
        };
        let cell = sample
            .position
            .coordinates()
            .map(|c| (c / cell_m).floor() as i64);
        if let Some(&index) = self.cells.get(&cell) {
            self.merge(index as usize, sample);
        } else {
            self.cells.insert(cell, self.samples.len() as u32);
            let centre = Position::from_coordinates(cell.map(|c| (c as f64 + 0.5) * cell_m));
            // Indexed by the cell's centre, so that the index need not change as the mean place
            // moves.
            self.append(sample, self.weighted(centre));
        }
        Ok(())
    }

    /// Samples kept (cells, when samples are merged).
    pub fn len(&self) -> usize {
        self.samples.len()
    }

    /// Whether nothing has been sensed yet.
    pub fn is_empty(&self) -> bool {
        self.samples.is_empty()
    }

    /// The samples kept; with cells, mean place and mean value of each.
    pub fn samples(&self) -> &[Sample] {
        &self.samples
    }

    /// The sample of greatest value, the earliest of equals; `None` when empty.
    pub fn best(&self) -> Option<Sample> {
        self.samples
            .iter()
            .copied()
            .reduce(|best, s| if s.value > best.value { s } else { best })
    }

    /// Places of the at most `count` samples of greatest value, greatest first.
    pub fn highest(&self, count: usize) -> Vec<Position> {
        let mut top: Vec<&Sample> = Vec::with_capacity(count + 1);
        for sample in &self.samples {
            if top.len() < count || top.last().is_some_and(|last| sample.value > last.value) {
                let at = top.partition_point(|t| t.value >= sample.value);
                top.insert(at, sample);
                top.truncate(count);
            }
        }
        top.iter().map(|s| s.position).collect()
    }

    /// Mean of all values that came in; 0 when empty.
    pub fn mean(&self) -> f64 {
        self.moments.mean
    }

    /// Standard deviation of all values that came in; 0 for fewer than two.
    pub fn spread(&self) -> f64 {
        if self.moments.count < 2.0 {
            0.0
        } else {
            (self.moments.squares / self.moments.count).sqrt()
        }
    }

    /// The at most `count` samples nearest to `position`, nearest first, no farther than
    /// `radius_m` (height weighted). `found` is cleared first.
    pub fn nearest(
        &self,
        position: Position,
        count: usize,
        radius_m: f64,
        found: &mut Vec<Neighbour>,
    ) {
        found.clear();
        let Some(count) = NonZero::new(count) else {
            return;
        };
        let query = self.weighted(position);
        let mut limit = radius_m * radius_m;
        let keep = |found: &mut Vec<Neighbour>, next: Neighbour, limit: &mut f64| {
            let at = found.partition_point(|n| n.distance_sq_m2 <= next.distance_sq_m2);
            found.insert(at, next);
            found.truncate(count.get());
            // Once enough are found, the farthest of them bounds what the older trees need to look
            // at.
            if found.len() == count.get() {
                *limit = limit.min(found[count.get() - 1].distance_sq_m2);
            }
        };
        let tail = self.trees.last().map_or(0, |(range, _)| range.end);
        for index in tail..self.indexed.len() {
            let distance_sq_m2 = distance_sq(self.indexed[index], query);
            if distance_sq_m2 <= limit {
                let next = Neighbour {
                    index,
                    distance_sq_m2,
                };
                keep(found, next, &mut limit);
            }
        }
        for (range, tree) in self.trees.iter().rev() {
            let near = tree
                .query(&query)
                .nearest_n::<SquaredEuclidean<f64>>(count)
                .within(limit)
                .execute();
            for item in near {
                let next = Neighbour {
                    index: range.start + item.item as usize,
                    distance_sq_m2: item.distance,
                };
                keep(found, next, &mut limit);
            }
        }
    }

    /// The estimate at `position`: the mean of the neighbours' values with
    /// weights exp(−d²/2ℓ²) (Nadaraya 1964, Watson 1964) out to 3ℓ, and one more value of
    /// weight `prior_weight` for the archive's mean. `scratch` saves an allocation per call.
    pub fn estimate(
        &self,
        position: Position,
        kernel: SmoothingKernel,
        prior_weight: f64,
        scratch: &mut Vec<Neighbour>,
    ) -> FieldEstimate {
        self.nearest(position, kernel.neighbours, 3.0 * kernel.length_m, scratch);
        // Gaussian weights; beyond three lengths they are below 1.2 % and are left out.
        let precision = 0.5 / (kernel.length_m * kernel.length_m);
        let (mut support, mut sum) = (0.0, 0.0);
        for n in scratch.iter() {
            let weight = (-n.distance_sq_m2 * precision).exp();
            support += weight;
            sum += weight * self.samples[n.index].value;
        }
        let total = support + prior_weight;
        let value = if total > 0.0 {
            (sum + prior_weight * self.mean()) / total
        } else {
            self.mean()
        };
        FieldEstimate { value, support }
    }

    fn weighted(&self, position: Position) -> [f64; 3] {
        let [east, north, height] = position.coordinates();
        [east, north, height * self.options.height_weight]
    }

    fn merge(&mut self, index: usize, sample: Sample) {
        let count = &mut self.counts[index];
        *count = count.saturating_add(1);
        // A plain mean at first, then one that forgets: the field may change slowly.
        let part = (1.0 / f64::from(*count)).max(1.0 / self.options.memory);
        let kept = &mut self.samples[index];
        kept.value += part * (sample.value - kept.value);
        let (old, new) = (kept.position.coordinates(), sample.position.coordinates());
        kept.position =
            Position::from_coordinates([0, 1, 2].map(|i| old[i] + part * (new[i] - old[i])));
    }

    fn append(&mut self, sample: Sample, indexed: [f64; 3]) {
        self.samples.push(sample);
        self.counts.push(1);
        self.indexed.push(indexed);
        let indexed_to = self.trees.last().map_or(0, |(range, _)| range.end);
        if self.indexed.len() - indexed_to >= TAIL {
            self.reindex(indexed_to);
        }
    }

    /// Moves the tail into a tree, together with those smaller trees that have grown to less
    /// than `RATIO` times what comes in.
    fn reindex(&mut self, mut start: usize) {
        let end = self.indexed.len();
        // Trees that are not much larger than the new part go into it, so that sizes stay geometric
        // and each sample is indexed a handful of times.
        while let Some((range, _)) = self.trees.last() {
            if range.len() >= RATIO * (end - start) {
                break;
            }
            start = range.start;
            self.trees.pop();
        }
        // Fails only beyond u32::MAX points; those samples then stay in the unindexed tail.
        if let Ok(tree) = ImmutableKdTree::new_from_slice(&self.indexed[start..end]) {
            self.trees.push((start..end, tree));
        }
    }
}

impl Moments {
    fn add(&mut self, value: f64) {
        self.count += 1.0;
        let off = value - self.mean;
        self.mean += off / self.count;
        self.squares += off * (value - self.mean);
    }
}

fn distance_sq(a: [f64; 3], b: [f64; 3]) -> f64 {
    let d = [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
    d[0] * d[0] + d[1] * d[1] + d[2] * d[2]
}
