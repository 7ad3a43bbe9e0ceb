//! The rate of a gas by its ratio to another that is released beside the source at a known rate.
//!
//! Both gases meet the same air, so that their plumes have one shape: the ratio of their excesses is that of the emissions,
//! whatever wind and turbulence (Lamb et al. 1995, doi 10.1021/es00002a007).

use crate::{Interval, Share, StudyError, Term, budget};
use plume::Gas;
use scenario::observations::Observations;
use std::collections::BTreeMap;

/// Readings are averaged over this time, s: analysers answer within seconds of each other.
const AVERAGED_S: f64 = 10.0;
/// Blocks of this time are independent, s.
const BLOCK_S: f64 = 60.0;
/// Fewest blocks.
const LEAST_BLOCKS: usize = 5;
/// Least correlation of both gases: below it the plumes are not one, and more than half of the variance is another
/// source's.
const LEAST_CORRELATION: f64 = 0.7;
/// Standard deviation of ln of each gas's gain, and of the metered release.
const GAIN_LN_SD: f64 = 0.02;
const RELEASE_LN_SD: f64 = 0.02;
/// Standard deviation of ln ratio by the distance between release and source.
const PLACE_LN_SD: f64 = 0.05;

/// The rate, and what it rests on.
#[derive(Debug, Clone, PartialEq)]
pub struct TracerFlux {
    /// The rate of the gas, kg/s.
    pub kg_s: Interval,
    /// Shares of the variance of ln rate.
    pub budget: Vec<Share>,
    /// Correlation of both gases.
    pub correlation: f64,
    /// Number of blocks of time.
    pub blocks: usize,
}

/// The rate of the gas of `observations`, where the gas of `tracer`, read beside it, is released at `tracer_kg_s`.
///
/// # Errors
/// [`StudyError::Refused`] where the gases do not vary together.
pub fn estimate(
    observations: &Observations,
    (tracer, tracer_kg_s): (&Observations, f64),
) -> Result<TracerFlux, StudyError> {
    let pairs = pairs(observations, tracer);
    let blocks: Vec<i64> = {
        let all: std::collections::BTreeSet<i64> = pairs.iter().map(|p| p.0).collect();
        all.into_iter().collect()
    };
    if blocks.len() < LEAST_BLOCKS {
        return Err(StudyError::Refused(format!(
            "{} minutes in which both gases are read; expected {LEAST_BLOCKS}",
            blocks.len()
        )));
    }
    let (slope, correlation) = regression(pairs.iter().map(|p| (p.1, p.2)));
    if correlation < LEAST_CORRELATION || slope <= 0.0 {
        return Err(StudyError::Refused(format!(
            "{} and the tracer {} do not vary together (correlation {correlation:.2}; expected {LEAST_CORRELATION})",
            observations.gas.formula(),
            tracer.gas.formula()
        )));
    }
    // Delete-one jackknife over blocks (Efron & Stein 1981).
    let without = |block: &i64| {
        let rest = pairs.iter().filter(|p| p.0 != *block);
        regression(rest.map(|p| (p.1, p.2))).0
    };
    let slopes: Vec<f64> = blocks.iter().map(without).collect();
    let n = slopes.len() as f64;
    let mean = slopes.iter().sum::<f64>() / n;
    let jackknife = (n - 1.0) / n * slopes.iter().map(|s| (s - mean).powi(2)).sum::<f64>();
    let terms = [
        (Term::Turbulence, jackknife / slope.powi(2)),
        (
            Term::Sensor,
            2.0 * GAIN_LN_SD.powi(2) + RELEASE_LN_SD.powi(2),
        ),
        (Term::Representativeness, PLACE_LN_SD.powi(2)),
    ];
    let ln_sd = terms.iter().map(|t| t.1).sum::<f64>().sqrt();
    let mass = |gas: Gas| gas.molar_mass_kg_mol();
    let kg_s = tracer_kg_s * slope * mass(observations.gas) / mass(tracer.gas);
    Ok(TracerFlux {
        kg_s: Interval::of_ln_normal(kg_s, ln_sd),
        budget: budget(&terms),
        correlation,
        blocks: blocks.len(),
    })
}

/// Block of time, tracer and gas, ppm, averaged.
fn pairs(gas: &Observations, tracer: &Observations) -> Vec<(i64, f64, f64)> {
    type Bin = (usize, i64);
    let averages = |observations: &Observations| {
        let mut sums: BTreeMap<Bin, (f64, f64)> = BTreeMap::new();
        for row in &observations.rows {
            if let Some(ppm) = row.co2_ppm {
                let bin = (row.time_s / AVERAGED_S).floor() as i64;
                let slot = sums.entry((row.platform, bin)).or_default();
                *slot = (slot.0 + ppm, slot.1 + 1.0);
            }
        }
        sums
    };
    let (gas, tracer) = (averages(gas), averages(tracer));
    let in_block = |bin: i64| (bin as f64 * AVERAGED_S / BLOCK_S).floor() as i64;
    gas.iter()
        .filter_map(|(bin, (sum, n))| {
            let (tracer_sum, tracer_n) = tracer.get(bin)?;
            Some((in_block(bin.1), tracer_sum / tracer_n, sum / n))
        })
        .collect()
}

/// Slope of the second on the first, and their correlation.
fn regression(pairs: impl Iterator<Item = (f64, f64)>) -> (f64, f64) {
    let (mut n, mut x, mut y, mut xx, mut xy, mut yy) = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0);
    for (a, b) in pairs {
        n += 1.0;
        x += a;
        y += b;
        xx += a * a;
        xy += a * b;
        yy += b * b;
    }
    let (vx, vy, covariance) = (xx - x * x / n, yy - y * y / n, xy - x * y / n);
    (covariance / vx, covariance / (vx * vy).sqrt())
}
