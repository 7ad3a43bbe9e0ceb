//! A background that varies: all sensors deviate together, smoothly in time or in height.
//!
//! The slow noise of each sensor explains such deviations at a price: independent sensors rarely drift alike, and a
//! sensor rarely drifts alike each time it returns to a height. The gain of the log evidence is that price.

use crate::InferError;
use crate::evidence::{Evidence, Reduced};
use crate::form::{Bumps, extent};
use crate::names::{Catalogue, Found, Question, ln_sum};

/// Standard deviations of the variation that are tried, multiples of the sensor's own noise: what averaging over a few
/// readings shows, and as much as a plume far away.
const SIZES: [f64; 3] = [0.5, 2.0, 8.0];
/// The background bends over a quarter of the heights flown: a layer is seen, a straight line too.
const PARTS_OF_HEIGHT: f64 = 4.0;
/// Below this range the heights are one, m: a sensor on a mast.
const LEAST_HEIGHTS_M: f64 = 10.0;

/// The coordinate along which the background varies.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Along {
    /// In time, over a minute or more.
    Time,
    /// With height above ground.
    Height,
}

impl Question<'_> {
    /// Gain of the log evidence of a set, nats, by a background that varies along the coordinate that gains most.
    pub(crate) fn background_gain<M: Catalogue>(
        &self,
        set: &Found<M>,
    ) -> Result<(f64, Along), InferError> {
        let policy = self.policy;
        let times = extent(self.rows.time_s().iter().copied());
        let time = Bumps::over(
            times.0,
            times.1,
            policy.swing_width_s,
            policy.most_bumps_in_time,
        );
        let heights_m: Vec<f64> = (0..self.rows.len())
            .map(|row| set.model.height_agl_m(row))
            .collect();
        let (low_m, high_m) = extent(heights_m.iter().copied());
        let width_m = (high_m - low_m) / PARTS_OF_HEIGHT;
        let mut columns = time.columns(self.rows.time_s());
        let mut along = vec![(Along::Time, 0..columns.len())];
        if high_m - low_m > LEAST_HEIGHTS_M {
            let height = Bumps::over(low_m, high_m, width_m, policy.form_most_bumps);
            let first = columns.len();
            columns.extend(height.columns(&heights_m));
            along.push((Along::Height, first..columns.len()));
        }
        let problem = self.beside(set, &set.model);
        let (known, products) = problem.products(set.fit(), &columns, &[self.rows.whole()])?;
        let reduced = Evidence::new(&products[0], &known).under(&set.likeliest_sizes());
        let Some(reduced) = reduced else {
            return Ok((0.0, Along::Time));
        };
        let gain = |columns: std::ops::Range<usize>| {
            let own = reduced.only(&columns.collect::<Vec<_>>());
            let with = SIZES.map(|size| ln_evidence_with(&own, size * self.sensor_sd));
            ln_sum(with.into_iter()) - (SIZES.len() as f64).ln() - reduced.ln_evidence()
        };
        let gains = along.into_iter().map(|(along, c)| (gain(c), along));
        let best = gains.max_by(|a, b| a.0.total_cmp(&b.0));
        Ok(best.unwrap_or((0.0, Along::Time)))
    }
}

/// Log evidence where all columns have weights of this standard deviation, nats.
fn ln_evidence_with(problem: &Reduced, sd: f64) -> f64 {
    let with = problem.without(problem.columns() - 1, |_| (sd.powi(-2), 0.0));
    with.map_or(f64::NEG_INFINITY, |w| w.ln_evidence())
}
