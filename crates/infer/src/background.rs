//! A background that varies: all sensors deviate together, smoothly in time or in height.
//!
//! The slow noise of each sensor explains such deviations at a price: independent sensors rarely drift alike, and a
//! sensor rarely drifts alike each time it returns to a height. The gain of the log evidence is that price.

use crate::InferError;
use crate::discrepancy::{BasisFunctions, extent};
use crate::evidence::{Evidence, Reduced};
use crate::mechanism_search::{Catalogue, FittedSet, Question, ln_sum};
use crate::rows::ForwardModel;

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
        let mut columns = Vec::new();
        let coordinates = self.background_coordinates(&set.model).map(|(along, own)| {
            let first = columns.len();
            columns.extend(own);
            (along, (first..columns.len()).collect::<Vec<_>>())
        });
        if columns.is_empty() {
            return Ok((0.0, Along::Time));
        }
        let problem = self.beside(set, &set.model);
        // What varies for all sensors was taken for slow noise of each.
        let mut quiet = set.fit().clone();
        quiet.noise.slow = quiet.noise.slow.min(problem.usual_noise().slow);
        let mut without = f64::NEG_INFINITY;
        let mut best = coordinates.each_ref().map(|_| f64::NEG_INFINITY);
        for fit in [set.fit(), &quiet] {
            let (known, products) = problem.products(fit, &columns, &[self.rows.whole()])?;
            let reduced = Evidence::new(&products[0], &known).under(&set.likeliest_sizes());
            let Some(reduced) = reduced else { continue };
            let ln_noise = problem.ln_noise_prior(&fit.noise);
            without = without.max(reduced.ln_evidence() + ln_noise);
            for (best, (_, own)) in best.iter_mut().zip(&coordinates) {
                let own = reduced.only(own);
                let with = SIZES.map(|size| ln_evidence_with(&own, size * self.sensor_sd));
                let mean = ln_sum(with.into_iter()) - (SIZES.len() as f64).ln();
                *best = best.max(mean + ln_noise);
            }
        }
        let gains = best.iter().zip(&coordinates);
        let gains = gains.filter(|(_, (_, own))| !own.is_empty());
        let gains = gains.map(|(ln, (along, _))| (ln - without, *along));
        let best = gains
            .filter(|g| g.0.is_finite())
            .max_by(|a, b| a.0.total_cmp(&b.0));
        Ok(best.unwrap_or((0.0, Along::Time)))
    }

    /// The basis functions of each coordinate at all rows; none of a coordinate along which the readings show nothing.
    fn background_coordinates(&self, model: &impl ForwardModel) -> [(Along, Vec<Vec<f64>>); 2] {
        // One sensor alone cannot tell air that varies from a zero that wanders.
        let sensors = self.rows.series().filter(|s| !s.is_empty()).count();
        let in_time = if sensors > 1 {
            let (from_s, to_s) = extent(self.rows.time_s().iter().copied());
            BasisFunctions::over(from_s, to_s, WIDTH_S, MOST_IN_TIME).columns(self.rows.time_s())
        } else {
            Vec::new()
        };
        let heights_m: Vec<f64> = (0..self.rows.len())
            .map(|row| model.height_agl_m(row))
            .collect();
        let (low_m, high_m) = extent(heights_m.iter().copied());
        let range_m = high_m - low_m;
        let with_height = if range_m > LEAST_HEIGHTS_M {
            let most = self.policy.discrepancy_most_basis_functions;
            BasisFunctions::over(low_m, high_m, range_m / PARTS_OF_HEIGHT, most).columns(&heights_m)
        } else {
            Vec::new()
        };
        [(Along::Time, in_time), (Along::Height, with_height)]
    }
}

/// Log evidence where all columns have weights of this standard deviation, nats.
fn ln_evidence_with(problem: &Reduced, sd: f64) -> f64 {
    let with = problem.without(problem.columns() - 1, |_| (sd.powi(-2), 0.0));
    with.map_or(f64::NEG_INFINITY, |w| w.ln_evidence())
}
