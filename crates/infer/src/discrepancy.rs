//! Model discrepancy: the real plume is the model's times exp(g), with g smooth in the logarithm of the distance, in
//! height above and distance across the axis, and in the time of emission (after Kennedy and O'Hagan 2001, but
//! multiplicative, because a plume's error is relative).
//!
//! The axis may also drift: turn to the sides and up and down by angles that are smooth in time, as the same eddies
//! carry the plume both ways.
//!
//! g and the axis drift are sums of Gaussian basis functions on a regular grid of each coordinate with independent
//! normal weights: Gaussian processes with a squared-exponential covariance, whose size is one
//! number for each coordinate. Far from all readings g keeps its size: the model may be as wrong there as elsewhere.

use crate::policy::Policy;
use crate::rows::{AxisTurn, PlumePlace};

/// Coordinates: distance, height, width and time of the discrepancy, and the drift of the axis to the sides and upwards.
pub const COORDINATES: usize = 6;
/// The last three of them.
const TIME: usize = 3;
/// See above.
pub const AXIS_DRIFT: usize = 4;
/// See above.
pub const UPWARD_DRIFT: usize = 5;
/// Upper limit of |g|, a factor of seven, so that no step of a search overflows.
const MOST_EXPONENT: f64 = 2.0;

/// Effect of a discrepancy on a plume.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Growth {
    /// exp(g).
    pub factor: f64,
    /// Derivative of the factor with respect to the weighted sum of basis functions.
    pub slope: f64,
}

impl Growth {
    pub const NONE: Self = Self {
        factor: 1.0,
        slope: 1.0,
    };

    /// The same of a plume that is `factor` times as strong.
    pub fn times(self, factor: f64) -> Self {
        Self {
            factor: self.factor * factor,
            slope: self.slope * factor,
        }
    }

    /// The effect of a weighted sum of basis functions. The sum saturates smoothly: at a hard limit the derivative would
    /// vanish and mislead a search.
    fn of(sum: f64) -> Self {
        let part = (sum / MOST_EXPONENT).tanh();
        let factor = (MOST_EXPONENT * part).exp();
        Self {
            factor,
            slope: factor * (1.0 - part * part),
        }
    }
}

/// Size along each coordinate: standard deviation of g's part, and of the axis drift in degrees.
pub type Sizes = [f64; COORDINATES];

/// Smallest size of a discrepancy or axis drift: negligible, with a finite precision.
const LEAST_SIZE: f64 = 1e-4;

/// Precision of weights of a size.
pub(crate) fn precision_of(size: f64) -> f64 {
    size.max(LEAST_SIZE).powi(-2)
}

/// Basis functions along one coordinate.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct BasisFunctions {
    first: f64,
    spacing: f64,
    width: f64,
    count: usize,
    /// Makes the sum of squares one.
    scale: f64,
}

impl BasisFunctions {
    /// Basis functions over `[low, high]` and one width beyond.
    pub fn over(low: f64, high: f64, width: f64, most: usize) -> Self {
        let span = (high - low).max(0.0) + 2.0 * width;
        // As close as the least number needs for a smooth sum, but no more than `most`.
        let width = width.max(span / (most as f64 * SPACING_OVER_WIDTH));
        let spacing = SPACING_OVER_WIDTH * width;
        let count = (span / spacing).ceil() as usize + 1;
        let middle = 0.5 * (low + high);
        let mut basis_functions = Self {
            first: middle - 0.5 * spacing * (count - 1) as f64,
            spacing,
            width,
            count,
            scale: 1.0,
        };
        let mut at_middle = vec![0.0; count];
        basis_functions.fill(middle, &mut at_middle);
        basis_functions.scale = 1.0 / at_middle.iter().map(|b| b * b).sum::<f64>().sqrt();
        basis_functions
    }

    /// The values of each basis function at all places.
    pub fn columns(&self, at: &[f64]) -> Vec<Vec<f64>> {
        let mut out = vec![vec![0.0; at.len()]; self.count];
        let mut values = vec![0.0; self.count];
        for (row, at) in at.iter().enumerate() {
            self.fill(*at, &mut values);
            for (column, value) in out.iter_mut().zip(&values) {
                column[row] = *value;
            }
        }
        out
    }

    fn fill(&self, at: f64, out: &mut [f64]) {
        out.fill(0.0);
        let place = (at - self.first) / self.spacing;
        let reach = FARTHEST_WIDTHS / SPACING_OVER_WIDTH;
        // A cast of what is below zero or not a number is zero.
        let from = (place - reach).ceil() as usize;
        let to = ((place + reach).floor() + 1.0) as usize;
        // From one basis function to the next the exponential changes by a factor that itself changes by a constant one.
        let d = SPACING_OVER_WIDTH * (place - from as f64);
        let mut basis_function = self.scale * (-0.5 * d * d).exp();
        let mut factor = (SPACING_OVER_WIDTH * (d - 0.5 * SPACING_OVER_WIDTH)).exp();
        let to = to.min(out.len());
        for out in out.iter_mut().take(to).skip(from) {
            *out = basis_function;
            basis_function *= factor;
            factor *= NEXT_FACTOR;
        }
    }
}

/// A basis function is nothing farther away than this many of its widths: less than a hundred-thousandth.
const FARTHEST_WIDTHS: f64 = 5.0;

/// Steps of a mean over an axis drift's basis function, in widths, and the most of them: an axis drift from before the record
/// has no basis functions.
const STEP_OVER_WIDTH: f64 = 0.5;
const MOST_STEPS: usize = 40;

/// Distance of neighbouring basis functions over their width: at .75 the sum of their squares ripples by
/// less than a thousandth.
const SPACING_OVER_WIDTH: f64 = 0.75;

/// exp(−.75²): by what the factor from one basis function to the next changes.
const NEXT_FACTOR: f64 = 0.569_782_824_730_923;

/// The basis functions of all coordinates.
#[derive(Debug, Clone, PartialEq)]
pub struct Basis {
    basis_functions: [BasisFunctions; COORDINATES],
}

impl Basis {
    /// Basis functions for a discrepancy over all of `places`, and for an axis drift over `time_s` from `axis_drift_from_s` on.
    pub fn over(
        places: impl Iterator<Item = PlumePlace> + Clone,
        time_s: &[f64],
        axis_drift_from_s: f64,
        policy: &Policy,
    ) -> Self {
        let reach = policy.discrepancy_reach_sigmas;
        let range = |of: fn(&PlumePlace) -> f64, within: f64| {
            let inside = |p| of(&p).clamp(-within, within);
            extent(places.clone().map(inside))
        };
        let times = extent(time_s.iter().copied());
        let emitted = extent(places.clone().map(|p| p.emitted_s));
        let most = policy.discrepancy_most_basis_functions;
        let basis_functions =
            |(low, high): (f64, f64), width: f64| BasisFunctions::over(low, high, width, most);
        let in_time = |(low, high): (f64, f64), width_s: f64| {
            BasisFunctions::over(low, high, width_s, policy.most_basis_functions_in_time)
        };
        let axis_drift = in_time(
            (times.0.min(axis_drift_from_s), times.1),
            policy.axis_drift_width_s,
        );
        Self {
            basis_functions: [
                basis_functions(
                    range(|p| p.ln_distance, f64::MAX),
                    policy.discrepancy_width_ln_distance,
                ),
                basis_functions(
                    range(|p| p.above_sigmas, reach),
                    policy.discrepancy_width_sigmas,
                ),
                basis_functions(
                    range(|p| p.across_sigmas, reach),
                    policy.discrepancy_width_sigmas,
                ),
                in_time(emitted, policy.discrepancy_width_s),
                axis_drift.clone(),
                axis_drift,
            ],
        }
    }

    /// Basis functions for an axis drift alone.
    pub(crate) fn of_axis_drift(time_s: &[f64], from_s: f64, policy: &Policy) -> Self {
        let mut out = Self::over(std::iter::empty(), time_s, from_s, policy);
        for basis_functions in &mut out.basis_functions[..AXIS_DRIFT] {
            basis_functions.count = 0;
        }
        out
    }

    /// Number of weights.
    pub fn len(&self) -> usize {
        self.basis_functions.iter().map(|b| b.count).sum()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Number of weights of the discrepancy, which stand first; those of the axis drift follow.
    pub fn of_discrepancy(&self) -> usize {
        self.len() - 2 * self.functions_per_direction()
    }

    /// Width of the basis functions of the axis drift, s.
    pub(crate) fn axis_drift_width_s(&self) -> f64 {
        self.basis_functions[AXIS_DRIFT].width
    }

    /// Number of basis functions of the axis drift in each of its directions: to the sides, and up and down.
    pub(crate) fn functions_per_direction(&self) -> usize {
        self.basis_functions[AXIS_DRIFT].count
    }

    /// The coordinate that each weight belongs to.
    pub fn coordinates(&self) -> impl Iterator<Item = usize> + '_ {
        let of = |(k, b): (usize, &BasisFunctions)| std::iter::repeat_n(k, b.count);
        self.basis_functions.iter().enumerate().flat_map(of)
    }

    /// The weights that may differ from zero under `sizes`.
    pub(crate) fn active(&self, sizes: &Sizes, policy: &Policy) -> Active {
        self.those(|c| sizes[c] > least(c, policy))
    }

    /// The weights of all coordinates that have one that differs from zero.
    pub(crate) fn weighted(&self, weights: &[f64]) -> Active {
        let mut has = [false; COORDINATES];
        for (c, weight) in self.coordinates().zip(weights) {
            has[c] |= *weight != 0.0;
        }
        self.those(|c| has[c])
    }

    fn those(&self, kept: impl Fn(usize) -> bool) -> Active {
        let kept: [bool; COORDINATES] = std::array::from_fn(kept);
        let all = self.coordinates().enumerate();
        Active {
            kept,
            weights: all.filter(|(_, c)| kept[*c]).collect(),
        }
    }

    /// The values at a place of the active basis functions of the discrepancy; none where the place is not in
    /// the plume.
    pub(crate) fn fill_discrepancy(&self, active: &Active, place: &PlumePlace, out: &mut [f64]) {
        if !place.ln_distance.is_finite() {
            out.fill(0.0);
            return;
        }
        let at = [
            place.ln_distance,
            place.above_sigmas,
            place.across_sigmas,
            place.emitted_s,
        ];
        let mut rest = out;
        for (c, (basis_functions, at)) in self.basis_functions.iter().zip(at).enumerate() {
            if active.kept[c] {
                let (part, behind) = rest.split_at_mut(basis_functions.count);
                basis_functions.fill(at, part);
                rest = behind;
            }
        }
    }

    /// The values of all basis functions at a place; the axis has its mean height there.
    pub(crate) fn fill(&self, place: &PlumePlace, out: &mut [f64]) {
        let (form, axis_drift) = out.split_at_mut(self.of_discrepancy());
        self.fill_discrepancy(&Active::all(self), place, form);
        let (sideways, upward) = axis_drift.split_at_mut(self.functions_per_direction());
        self.fill_axis_drift(place.time_s, sideways);
        upward.fill(0.0);
    }

    /// The values of the axis drift's basis functions at a time.
    pub(crate) fn fill_axis_drift(&self, time_s: f64, out: &mut [f64]) {
        self.basis_functions[AXIS_DRIFT].fill(time_s, out);
    }

    /// The means of the axis drift's basis functions over the time `under_way_s` that ends at a time: the turn of an axis
    /// that the air has followed since then.
    pub(crate) fn fill_axis_drift_since(&self, time_s: f64, under_way_s: f64, out: &mut [f64]) {
        let steps =
            (under_way_s / (STEP_OVER_WIDTH * self.basis_functions[AXIS_DRIFT].width)).ceil();
        let steps = (steps as usize).clamp(1, MOST_STEPS);
        let mut there = vec![0.0; out.len()];
        out.fill(0.0);
        for k in 0..steps {
            let ago_s = under_way_s * (k as f64 + 0.5) / steps as f64;
            self.fill_axis_drift(time_s - ago_s, &mut there);
            for (out, there) in out.iter_mut().zip(&there) {
                *out += there / steps as f64;
            }
        }
    }

    /// Turn of an axis that the air has followed for the time `under_way_s` that ends at a time.
    pub(crate) fn turn_since(&self, time_s: f64, under_way_s: f64, weights: &[f64]) -> AxisTurn {
        let mut values = vec![0.0; self.functions_per_direction()];
        self.fill_axis_drift_since(time_s, under_way_s, &mut values);
        Self::turn(&values, &weights[self.of_discrepancy()..])
    }

    /// Turn of the axis by these values of the drift's basis functions and its weights.
    pub(crate) fn turn(values: &[f64], weights: &[f64]) -> AxisTurn {
        let (sideways, upward) = weights.split_at(values.len());
        AxisTurn {
            clockwise_deg: dot(values, sideways),
            upward_deg: dot(values, upward),
        }
    }

    /// These basis functions of the discrepancy with those of another basis for the axis drift.
    pub(crate) fn with_axis_drift_of(&self, other: &Self) -> Self {
        let mut out = self.clone();
        out.basis_functions[AXIS_DRIFT..].clone_from_slice(&other.basis_functions[AXIS_DRIFT..]);
        out
    }

    /// Effect of a discrepancy with these values and weights of the basis functions; further values are ignored.
    pub(crate) fn growth(values: &[f64], weights: &[f64]) -> Growth {
        Growth::of(dot(values, weights))
    }

    /// Turn of the axis at a time, degrees clockwise.
    pub(crate) fn turn_deg(&self, time_s: f64, weights: &[f64]) -> f64 {
        self.turn_since(time_s, 0.0, weights).clockwise_deg
    }
}

/// The size of a coordinate without discrepancy or drift.
fn least(coordinate: usize, policy: &Policy) -> f64 {
    if coordinate < AXIS_DRIFT {
        policy.discrepancy_least
    } else {
        0.0
    }
}

/// Weights that may differ from zero.
#[derive(Debug, Clone)]
pub(crate) struct Active {
    kept: [bool; COORDINATES],
    /// Each with its coordinate.
    weights: Vec<(usize, usize)>,
}

impl Active {
    /// All weights of a basis.
    pub fn all(basis: &Basis) -> Self {
        basis.those(|_| true)
    }

    /// Those of the discrepancy, which stand first.
    pub fn of_discrepancy(&self) -> usize {
        self.coordinates().filter(|c| *c < AXIS_DRIFT).count()
    }

    pub fn weights(&self) -> impl Iterator<Item = usize> + '_ {
        self.weights.iter().map(|w| w.0)
    }

    pub fn coordinates(&self) -> impl Iterator<Item = usize> + '_ {
        self.weights.iter().map(|w| w.1)
    }

    /// Whether `sizes` let all of them differ from zero.
    pub fn all_may_be(&self, sizes: &Sizes, policy: &Policy) -> bool {
        (0..COORDINATES).all(|c| !self.kept[c] || sizes[c] > least(c, policy))
    }

    pub fn has(&self, weight: usize) -> bool {
        self.weights.iter().any(|w| w.0 == weight)
    }
}

impl Policy {
    /// The sizes that a coordinate of the discrepancy or the axis drift to the sides may have, with the logarithms of their
    /// probabilities beforehand.
    fn choices(&self, coordinate: usize) -> impl Iterator<Item = (f64, f64)> + '_ {
        let sizes: &[f64] = if coordinate == AXIS_DRIFT {
            &self.axis_drift_sizes_deg
        } else {
            &self.discrepancy_sizes
        };
        let ln_of_each = ((1.0 - self.discrepancy_none) / sizes.len() as f64).ln();
        let none = (least(coordinate, self), self.discrepancy_none.ln());
        std::iter::once(none).chain(sizes.iter().map(move |size| (*size, ln_of_each)))
    }

    /// Logarithm of the probability of sizes beforehand. The eddies that move an axis up and down move it to the sides as
    /// well: an axis drifts upwards only if it drifts to the sides, and then in every second case.
    pub(crate) fn ln_sizes(&self, sizes: &Sizes) -> f64 {
        let of = |(k, size): (usize, &f64)| {
            let chosen = self.choices(k).find(|c| c.0 == *size);
            chosen.map_or(f64::NEG_INFINITY, |c| c.1)
        };
        let independent: f64 = sizes[..=AXIS_DRIFT].iter().enumerate().map(of).sum();
        let most = self.upward_beside(sizes[AXIS_DRIFT]);
        let is_possible = [0.0, most].contains(&sizes[UPWARD_DRIFT]);
        independent
            + match (is_possible, most > 0.0) {
                (false, _) => f64::NEG_INFINITY,
                (true, true) => -std::f64::consts::LN_2,
                (true, false) => 0.0,
            }
    }

    /// Sizes of a discrepancy on every coordinate and an axis drift in both directions, as near as the choices come.
    pub(crate) fn nearest_sizes(&self, form: f64, axis_drift_deg: f64) -> Sizes {
        let mut out: Sizes = std::array::from_fn(|k| {
            let wanted = if k == AXIS_DRIFT {
                axis_drift_deg
            } else {
                form
            };
            let off = |c: &(f64, f64)| (c.0 - wanted).abs();
            self.choices(k)
                .min_by(|a, b| off(a).total_cmp(&off(b)))
                .map_or(0.0, |c| c.0)
        });
        out[UPWARD_DRIFT] = self.upward_beside(out[AXIS_DRIFT]);
        out
    }

    /// Limits sizes to the tolerated ones: no discrepancy except a slow change of strength, such as that of the wind speed,
    /// and an axis drift of about the tolerated wander.
    pub(crate) fn tolerated_sizes(&self, sizes: &Sizes) -> Sizes {
        let axis_drift_deg = self.nearest_axis_drift_deg(self.noise_tolerated.wander_deg);
        std::array::from_fn(|k| match k {
            AXIS_DRIFT => sizes[k].min(axis_drift_deg),
            UPWARD_DRIFT => sizes[k].min(self.upward_beside(axis_drift_deg)),
            TIME => sizes[k].min(self.discrepancy_sizes[0]),
            _ => self.discrepancy_least,
        })
    }

    /// The size of the upward drift that an axis may have beside a drift to the sides of this size.
    fn upward_beside(&self, sideways_deg: f64) -> f64 {
        self.upward_over_sideways * sideways_deg.min(self.axis_drift_sizes_deg[1])
    }

    /// The size of an axis drift, other than none, that is nearest to `deg` by its factor.
    fn nearest_axis_drift_deg(&self, deg: f64) -> f64 {
        let off = |size: &f64| (size / deg).ln().abs();
        let sizes = self.axis_drift_sizes_deg.iter();
        let nearest = sizes.min_by(|a, b| off(a).total_cmp(&off(b)));
        nearest.copied().unwrap_or(0.0)
    }

    /// All possible sizes that differ from `sizes` on one coordinate; an upward drift follows the drift to the sides.
    pub(crate) fn neighbours(&self, sizes: Sizes) -> impl Iterator<Item = Sizes> + '_ {
        let has_upward = sizes[UPWARD_DRIFT] > 0.0;
        let independent = (0..=AXIS_DRIFT).flat_map(move |k| {
            let other = self.choices(k).filter(move |c| c.0 != sizes[k]);
            other.map(move |c| {
                let mut next = sizes;
                next[k] = c.0;
                if has_upward {
                    next[UPWARD_DRIFT] = self.upward_beside(next[AXIS_DRIFT]);
                }
                next
            })
        });
        let most = self.upward_beside(sizes[AXIS_DRIFT]);
        independent.chain((most > 0.0).then(|| {
            let mut next = sizes;
            next[UPWARD_DRIFT] = if has_upward { 0.0 } else { most };
            next
        }))
    }
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// Least and largest of the finite values; zero where there is none.
pub(crate) fn extent(values: impl Iterator<Item = f64>) -> (f64, f64) {
    let (low, high) = values
        .filter(|v| v.is_finite())
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| {
            (l.min(v), h.max(v))
        });
    if low > high { (0.0, 0.0) } else { (low, high) }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn place(ln_distance: f64, across_sigmas: f64) -> PlumePlace {
        PlumePlace {
            ln_distance,
            across_sigmas,
            ..PlumePlace::default()
        }
    }

    /// The variance of g and of the axis's turn to the sides is the square of its size wherever something was read or asked.
    /// A place that is asked is taken with the axis at its mean height.
    #[test]
    fn the_error_of_form_has_the_same_size_everywhere() {
        let places = [place(6.9, -2.0), place(8.1, 3.0)];
        let basis = Basis::over(places.into_iter(), &[0.0, 900.0], 0.0, &Policy::default());
        let coordinates: Vec<usize> = basis.coordinates().collect();
        let mut basis_functions = vec![0.0; basis.len()];
        for step in 0..=60 {
            let ln_distance = 6.9 + 0.02 * f64::from(step);
            basis.fill(&place(ln_distance, 0.0), &mut basis_functions);
            for coordinate in 0..UPWARD_DRIFT {
                let of = |(b, c): (&f64, &usize)| if *c == coordinate { b * b } else { 0.0 };
                let variance: f64 = basis_functions.iter().zip(&coordinates).map(of).sum();
                assert!(
                    (variance - 1.0).abs() < 0.02,
                    "{coordinate} at {ln_distance}: {variance}"
                );
            }
        }
    }

    #[test]
    fn outside_the_plume_only_the_axis_swings() {
        let places = [place(6.9, 0.0), place(8.1, 0.0)];
        let basis = Basis::over(places.into_iter(), &[0.0, 900.0], 0.0, &Policy::default());
        let mut basis_functions = vec![0.0; basis.len()];
        basis.fill(&place(f64::NAN, 0.0), &mut basis_functions);
        assert!(
            basis_functions[..basis.of_discrepancy()]
                .iter()
                .all(|b| *b == 0.0)
        );
        assert!(
            basis_functions[basis.of_discrepancy()..]
                .iter()
                .any(|b| *b > 0.1)
        );
        assert_eq!(
            Basis::growth(
                &basis_functions[..basis.of_discrepancy()],
                &vec![1.0; basis.of_discrepancy()]
            )
            .factor,
            1.0
        );
    }

    #[test]
    fn a_long_record_has_no_more_bumps_than_allowed() {
        let policy = Policy::default();
        let basis = Basis::over(std::iter::empty(), &[0.0, 1e6], 0.0, &policy);
        let time = basis.coordinates().filter(|c| *c == TIME).count();
        let axis_drift = basis.coordinates().filter(|c| *c == AXIS_DRIFT).count();
        assert!(
            time <= policy.discrepancy_most_basis_functions + 2,
            "{time}"
        );
        assert!(
            axis_drift <= policy.most_basis_functions_in_time + 2,
            "{axis_drift}"
        );
    }
}
