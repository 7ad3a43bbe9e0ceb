//! A background that varies: all sensors deviate together, smoothly in time or in height.
//!
//! The slow noise of each sensor explains such deviations at a price: independent sensors rarely drift alike, and a
//! sensor rarely drifts alike each time it returns to a height. The gain of the log evidence is that price.

use crate::InferError;
use crate::discrepancy::{BasisFunctions, extent};
use crate::evidence::{Evidence, Reduced};
use crate::mechanism_search::{Catalogue, FittedSet, Question, ln_sum};

/// Standard deviations of the variation that are tried, multiples of the sensor's own noise: what averaging over a few
/// readings shows, and as much as a plume far away.
const SIZES: [f64; 3] = [0.5, 2.0, 8.0];
/// The background bends over this time, s: as long as a cloud of cleaner air takes to pass a vehicle in light wind.
const WIDTH_S: f64 = 20.0;
/// Most basis functions in time: keeps the cost linear in a record's length.
const MOST_IN_TIME: usize = 80;
/// The background bends over a quarter of the heights flown: a layer is seen, a straight line too.
const PARTS_OF_HEIGHT: f64 = 4.0;
/// Below this range the heights are one, m: a sensor on a mast.
const LEAST_HEIGHTS_M: f64 = 10.0;

/// The coordinate along which the background varies.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Along {
    /// In time, over half a minute or more.
    Time,
    /// With height above ground.
    Height,
}

impl Question<'_> {
    /// Gain of the log evidence of a set, nats, by a background that varies along the coordinate that gains most.
    pub(crate) fn background_gain<M: Catalogue>(
        &self,
        set: &FittedSet<M>,
    ) -> Result<(f64, Along), InferError> {
        let policy = self.policy;
        let times = extent(self.rows.time_s().iter().copied());
        let time = BasisFunctions::over(times.0, times.1, WIDTH_S, MOST_IN_TIME);
        let heights_m: Vec<f64> = (0..self.rows.len())
            .map(|row| set.model.height_agl_m(row))
            .collect();
        let (low_m, high_m) = extent(heights_m.iter().copied());
        let width_m = (high_m - low_m) / PARTS_OF_HEIGHT;
        let (mut columns, mut along) = (Vec::new(), Vec::new());
        // One sensor alone cannot tell air that varies from a zero that wanders.
        if self.rows.series().filter(|s| !s.is_empty()).count() > 1 {
            columns = time.columns(self.rows.time_s());
            along.push((Along::Time, 0..columns.len()));
        }
        if high_m - low_m > LEAST_HEIGHTS_M {
            let height = BasisFunctions::over(
                low_m,
                high_m,
                width_m,
                policy.discrepancy_most_basis_functions,
            );
            let first = columns.len();
            columns.extend(height.columns(&heights_m));
            along.push((Along::Height, first..columns.len()));
        }
        if along.is_empty() {
            return Ok((0.0, Along::Time));
        }
        let problem = self.beside(set, &set.model);
        let found = set.fit();
        // What varies for all sensors was taken for slow noise of each.
        let mut quiet = found.clone();
        quiet.noise.slow = found.noise.slow.min(problem.prior_noise().slow);
        let mut without = f64::NEG_INFINITY;
        let mut best = vec![f64::NEG_INFINITY; along.len()];
        for fit in [found, &quiet] {
            let (known, products) = problem.products(fit, &columns, &[self.rows.whole()])?;
            let reduced = Evidence::new(&products[0], &known).under(&set.likeliest_sizes());
            let Some(reduced) = reduced else { continue };
            let ln_noise = problem.ln_noise_prior(&fit.noise);
            without = without.max(reduced.ln_evidence() + ln_noise);
            for (best, (_, columns)) in best.iter_mut().zip(&along) {
                let own = reduced.only(&columns.clone().collect::<Vec<_>>());
                let with = SIZES.map(|size| ln_evidence_with(&own, size * self.sensor_sd));
                let mean = ln_sum(with.into_iter()) - (SIZES.len() as f64).ln();
                *best = best.max(mean + ln_noise);
            }
        }
        let gains = best
            .iter()
            .zip(&along)
            .map(|(ln, (along, _))| (ln - without, *along));
        let best = gains
            .filter(|g| g.0.is_finite())
            .max_by(|a, b| a.0.total_cmp(&b.0));
        Ok(best.unwrap_or((0.0, Along::Time)))
    }
}

/// Log evidence where all columns have weights of this standard deviation, nats.
fn ln_evidence_with(problem: &Reduced, sd: f64) -> f64 {
    let with = problem.without(problem.columns() - 1, |_| (sd.powi(-2), 0.0));
    with.map_or(f64::NEG_INFINITY, |w| w.ln_evidence())
}
