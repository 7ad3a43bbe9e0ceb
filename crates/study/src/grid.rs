//! Quantities with weights on a grid.

use crate::Interval;

/// Grids of normal quantities reach so many standard deviations.
const GRID_SD: f64 = 2.5;

/// `steps` values at equal distances from `reach` below `middle` to as much above it.
pub(crate) fn around(middle: f64, reach: f64, steps: usize) -> Vec<f64> {
    let at = |k: usize| middle + reach * (2.0 * k as f64 / (steps - 1) as f64 - 1.0);
    (0..steps).map(at).collect()
}

/// `steps` values of a standard normal quantity with their weights, which sum to one.
pub(crate) fn normal_grid(steps: usize) -> Vec<(f64, f64)> {
    let bell = |z: f64| (-0.5 * z.powi(2)).exp();
    let values = around(0.0, GRID_SD, steps);
    let all: f64 = values.iter().map(|z| bell(*z)).sum();
    values.into_iter().map(|z| (z, bell(z) / all)).collect()
}

/// Mean of weighted values.
pub(crate) fn mean(values: &[(f64, f64)]) -> f64 {
    let all: f64 = values.iter().map(|v| v.1).sum();
    values.iter().map(|(x, w)| x * w).sum::<f64>() / all
}

/// Variance of weighted values.
pub(crate) fn variance(values: &[(f64, f64)]) -> f64 {
    let all: f64 = values.iter().map(|v| v.1).sum();
    let mean = mean(values);
    values
        .iter()
        .map(|(x, w)| w * (x - mean).powi(2))
        .sum::<f64>()
        / all
}

/// Variance of the means of groups of (group, sum, weight).
fn explained(parts: &[(f64, f64, f64)]) -> f64 {
    let mut groups: Vec<(f64, f64, f64)> = Vec::new();
    for &(key, sum, weight) in parts {
        match groups.iter_mut().find(|g| g.0 == key) {
            Some(group) => (group.1, group.2) = (group.1 + sum, group.2 + weight),
            None => groups.push((key, sum, weight)),
        }
    }
    let means: Vec<(f64, f64)> = groups
        .iter()
        .filter(|g| g.2 > 0.0)
        .map(|g| (g.1 / g.2, g.2))
        .collect();
    variance(&means)
}

/// A quantity on a grid, summed over cells of N other unknowns.
pub(crate) struct Summed<const N: usize> {
    /// Values with their weights.
    pub values: Vec<(f64, f64)>,
    /// Variance of the values that each unknown explains.
    pub explained: [f64; N],
    /// Covariance of the values with each unknown.
    pub covariance: [f64; N],
    /// The unknowns of each cell with its weight.
    pub cells: Vec<([f64; N], f64)>,
}

impl<const N: usize> Summed<N> {
    /// Sums over cells, each with the logarithms of the weights of all `values` in it.
    pub fn of(values: &[f64], cells: &[([f64; N], Vec<f64>)]) -> Self {
        let ln = cells.iter().flat_map(|(_, ln)| ln);
        let top = ln.fold(f64::NEG_INFINITY, |a, b| a.max(*b));
        let mut summed: Vec<(f64, f64)> = values.iter().map(|v| (*v, 0.0)).collect();
        let mut parts: [Vec<(f64, f64, f64)>; N] = std::array::from_fn(|_| Vec::new());
        let mut weights = Vec::with_capacity(cells.len());
        let mut all = 0.0;
        for (at, ln) in cells {
            let (mut weight, mut sum) = (0.0, 0.0);
            for (slot, l) in summed.iter_mut().zip(ln) {
                let w = (l - top).exp();
                slot.1 += w;
                weight += w;
                sum += w * slot.0;
            }
            for (parts, unknown) in parts.iter_mut().zip(at) {
                parts.push((*unknown, sum, weight));
            }
            weights.push((*at, weight));
            all += weight;
        }
        let middle = mean(&summed);
        let covariance = |parts: &Vec<(f64, f64, f64)>| {
            let of = |(unknown, sum, weight): &(f64, f64, f64)| unknown * (sum - middle * weight);
            parts.iter().map(of).sum::<f64>() / all
        };
        Self {
            values: summed,
            covariance: std::array::from_fn(|k| covariance(&parts[k])),
            explained: parts.map(|p| explained(&p)),
            cells: weights,
        }
    }

    /// One unknown, times `scale`, with its weights.
    pub fn unknown(&self, k: usize, scale: f64) -> Vec<(f64, f64)> {
        self.cells
            .iter()
            .map(|(at, w)| (scale * at[k], *w))
            .collect()
    }

    /// Variance of the values that no unknown explains.
    pub fn rest_variance(&self) -> f64 {
        (variance(&self.values) - self.explained.iter().sum::<f64>()).max(0.0)
    }
}

/// The value below which `part` of the weight of values on a grid lies.
pub(crate) fn weighted_quantile(mut values: Vec<(f64, f64)>, part: f64) -> f64 {
    values.sort_by(|a, b| a.0.total_cmp(&b.0));
    let all: f64 = values.iter().map(|r| r.1).sum();
    below(&values, part * all)
}

/// The value below which sorted values have this weight.
fn below(sorted: &[(f64, f64)], wanted: f64) -> f64 {
    let (mut below, mut before) = (0.0, sorted[0].0);
    for &(value, weight) in sorted {
        let next = below + weight;
        if next >= wanted {
            // Between the steps of the grid.
            return before + (wanted - below) / weight * (value - before);
        }
        (below, before) = (next, value);
    }
    f64::NAN
}

/// The interval of a quantity whose logarithm has these values and weights, wider about its mean by an independent normal
/// quantity of standard deviation `extra_sd`.
pub(crate) fn interval(mut ln_values: Vec<(f64, f64)>, extra_sd: f64) -> Interval {
    let mean = mean(&ln_values);
    let factor = (1.0 + extra_sd * extra_sd / variance(&ln_values)).sqrt();
    for value in &mut ln_values {
        value.0 = mean + factor * (value.0 - mean);
    }
    ln_values.sort_by(|a, b| a.0.total_cmp(&b.0));
    let all: f64 = ln_values.iter().map(|r| r.1).sum();
    let at = |part: f64| below(&ln_values, part * all).exp();
    // One standard deviation of a normal quantity to both sides.
    const ONE_SD: [f64; 2] = [0.158_655, 0.841_345];
    Interval {
        value: at(0.5),
        sd: 0.5 * (at(ONE_SD[1]) - at(ONE_SD[0])),
        low95: at(0.025),
        high95: at(0.975),
    }
}
