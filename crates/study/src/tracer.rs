//! The rate of a gas by its ratio to another that is released beside the source at a known rate.
//!
//! Both gases meet the same air, so that their plumes have one shape: the ratio of their excesses is that of the emissions,
//! whatever wind and turbulence (Lamb et al. 1995, doi 10.1021/es00002a007).
//!
//! The ratio is the slope of the gas on the tracer over time. Noise of the tracer makes a regression too flat, and noise
//! that both gases share, of a common cell or of water vapour, turns it towards its own ratio. So the slope is that of one
//! half of the readings on the other half, taken in turn: the plume is in both, the noise of a reading in one
//! (instrumental variables; Durbin 1954, Rev. Int. Stat. Inst. 22:23).

use crate::{Interval, Share, StudyError, Term, budget, gain_ln_sd};
use plume::{DispersionSpec, Gas};
use scenario::Scenario;
use scenario::observations::{Observations, checks};
use std::collections::{BTreeMap, BTreeSet};

/// Readings are averaged over this time, s: analysers answer within seconds of each other.
const AVERAGED_S: f64 = 10.0;
/// Blocks of this time are independent, s.
const BLOCK_S: f64 = 60.0;
/// Fewest blocks.
const LEAST_BLOCKS: usize = 5;
/// Both gases are taken against their means of this time, s, or of so many readings: clean air and the zeros of analysers
/// drift over hours.
const DRIFT_S: f64 = 900.0;
const DRIFT_READINGS: f64 = 20.0;
/// Least correlation of both gases: below it the plumes are not one, and more than half of the variance is another
/// source's.
const LEAST_CORRELATION: f64 = 0.7;
/// Standard deviation of ln of the metered release.
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

/// The rate of the gas of `observations`, where the gas of `tracer`, read beside it, is released at `tracer_kg_s` in the
/// world of `scenario`.
///
/// # Errors
/// [`StudyError::Refused`] where the gases do not vary together; a scenario that describes no world.
pub fn estimate(
    scenario: &Scenario,
    observations: &Observations,
    (tracer, tracer_kg_s): (&Observations, f64),
) -> Result<TracerFlux, StudyError> {
    let spec = scenario.dispersion_spec()?;
    let frame = scenario.frame()?;
    let gas = checks::check(observations, &spec, &frame).observations;
    // The scenario's background is that of the gas.
    let of_tracer = DispersionSpec {
        background_ppm: 0.0,
        ..spec
    };
    let tracer = checks::check(tracer, &of_tracer, &frame).observations;
    let pairs = pairs(&gas, &tracer);
    let blocks: BTreeSet<i64> = pairs.iter().map(|p| p.block).collect();
    if blocks.len() < LEAST_BLOCKS {
        return Err(StudyError::Refused(format!(
            "{} minutes in which both gases are read; expected {LEAST_BLOCKS}",
            blocks.len()
        )));
    }
    let whole = Sums::of(pairs.iter());
    let correlation = whole.correlation();
    let slope = whole.slope();
    // A gas that does not vary has no correlation.
    let vary_together = correlation >= LEAST_CORRELATION && slope.ln > f64::NEG_INFINITY;
    if !vary_together {
        return Err(StudyError::Refused(format!(
            "{} and the tracer {} do not vary together (correlation {correlation:.2}; expected {LEAST_CORRELATION})",
            gas.gas.formula(),
            tracer.gas.formula()
        )));
    }
    // Delete-one jackknife over blocks (Efron & Stein 1981).
    let without = |block: &i64| {
        Sums::of(pairs.iter().filter(|p| p.block != *block))
            .slope()
            .ln
    };
    let slopes: Vec<f64> = blocks.iter().map(without).collect();
    let n = slopes.len() as f64;
    let mean = slopes.iter().sum::<f64>() / n;
    let jackknife = (n - 1.0) / n * slopes.iter().map(|s| (s - mean).powi(2)).sum::<f64>();
    let terms = [
        (Term::Turbulence, jackknife),
        (
            Term::Sensor,
            2.0 * gain_ln_sd(scenario).powi(2) + RELEASE_LN_SD.powi(2) + slope.noise_variance,
        ),
        (Term::Representativeness, PLACE_LN_SD.powi(2)),
    ];
    let ln_sd = terms.iter().map(|t| t.1).sum::<f64>().sqrt();
    let mass = |gas: Gas| gas.molar_mass_kg_mol();
    let kg_s = tracer_kg_s * slope.ln.exp() * mass(gas.gas) / mass(tracer.gas);
    Ok(TracerFlux {
        kg_s: Interval::of_ln_normal(kg_s, ln_sd),
        budget: budget(&terms),
        correlation,
        blocks: blocks.len(),
    })
}

/// Tracer and gas at one time, each off its mean of [`DRIFT_S`], ppm.
#[derive(Debug, Clone, Copy)]
struct Pair {
    block: i64,
    all: [f64; 2],
    /// The same of every other reading, and of those between; none where either was read once.
    halves: Option<[[f64; 2]; 2]>,
}

/// Readings of one gas in a time.
#[derive(Debug, Clone, Copy, Default)]
struct Bin {
    sums: [f64; 2],
    counts: [f64; 2],
}

impl Bin {
    fn push(&mut self, ppm: f64) {
        let half = usize::from(self.counts[0] > self.counts[1]);
        self.sums[half] += ppm;
        self.counts[half] += 1.0;
    }

    fn mean(&self) -> f64 {
        (self.sums[0] + self.sums[1]) / (self.counts[0] + self.counts[1])
    }

    fn halves(&self) -> Option<[f64; 2]> {
        (self.counts[1] > 0.0).then(|| [0, 1].map(|k| self.sums[k] / self.counts[k]))
    }
}

/// Platform and time of a bin, tracer and gas.
type Both<'a> = (&'a (usize, i64), &'a Bin, &'a Bin);

/// Both gases of one platform at all times at which both were read.
fn pairs(gas: &Observations, tracer: &Observations) -> Vec<Pair> {
    let (gas, tracer) = (bins(gas), bins(tracer));
    let mut by_window: BTreeMap<(usize, i64), Vec<InWindow>> = BTreeMap::new();
    let both: Vec<Both<'_>> = gas
        .iter()
        .filter_map(|(at, own)| Some((at, tracer.get(at)?, own)))
        .collect();
    let window_s = DRIFT_S.max(DRIFT_READINGS * interval_s(&both));
    for (&(platform, bin), tracer, own) in both {
        let window = (bin as f64 * AVERAGED_S / window_s).floor() as i64;
        let slot = by_window.entry((platform, window)).or_default();
        slot.push((bin, *tracer, *own));
    }
    by_window
        .into_values()
        .flat_map(|w| off_means(&w))
        .collect()
}

fn bins(observations: &Observations) -> BTreeMap<(usize, i64), Bin> {
    let mut bins: BTreeMap<(usize, i64), Bin> = BTreeMap::new();
    for row in &observations.rows {
        if let Some(ppm) = row.co2_ppm {
            let bin = (row.time_s / AVERAGED_S).floor() as i64;
            bins.entry((row.platform, bin)).or_default().push(ppm);
        }
    }
    bins
}

/// Median time from one pair of a platform to the next, s.
fn interval_s(both: &[Both<'_>]) -> f64 {
    let mut gaps: Vec<i64> = both
        .windows(2)
        .filter(|w| w[0].0.0 == w[1].0.0)
        .map(|w| w[1].0.1 - w[0].0.1)
        .collect();
    gaps.sort_unstable();
    gaps.get(gaps.len() / 2)
        .map_or(0.0, |g| *g as f64 * AVERAGED_S)
}

/// Time of a bin, tracer and gas.
type InWindow = (i64, Bin, Bin);

fn off_means(window: &[InWindow]) -> Vec<Pair> {
    let n = window.len() as f64;
    let mean = |of: fn(&InWindow) -> f64| window.iter().map(of).sum::<f64>() / n;
    let means = [mean(|w| w.1.mean()), mean(|w| w.2.mean())];
    let off = |ppm: [f64; 2]| [ppm[0] - means[0], ppm[1] - means[1]];
    window
        .iter()
        .map(|(bin, tracer, gas)| Pair {
            block: (*bin as f64 * AVERAGED_S / BLOCK_S).floor() as i64,
            all: off([tracer.mean(), gas.mean()]),
            halves: tracer
                .halves()
                .zip(gas.halves())
                .map(|(t, g)| [0, 1].map(|k| off([t[k], g[k]]))),
        })
        .collect()
}

/// Sums of squares and products of tracer and gas.
#[derive(Debug, Clone, Copy, Default)]
struct Sums {
    tracer_sq: f64,
    product: f64,
    gas_sq: f64,
    /// Products of one half of the readings with the other.
    across_tracer: f64,
    across: f64,
    with_halves: usize,
    count: usize,
}

/// ln of the slope of the gas on the tracer.
#[derive(Debug, Clone, Copy)]
struct Slope {
    ln: f64,
    /// Variance by noise whose size is not known.
    noise_variance: f64,
}

impl Sums {
    fn of<'a>(pairs: impl Iterator<Item = &'a Pair>) -> Self {
        let mut out = Self::default();
        for pair in pairs {
            let [tracer, gas] = pair.all;
            out.tracer_sq += tracer * tracer;
            out.product += tracer * gas;
            out.gas_sq += gas * gas;
            out.count += 1;
            if let Some([[t0, g0], [t1, g1]]) = pair.halves {
                out.across_tracer += 2.0 * t0 * t1;
                out.across += t0 * g1 + t1 * g0;
                out.with_halves += 1;
            }
        }
        out
    }

    fn correlation(&self) -> f64 {
        self.product / (self.tracer_sq * self.gas_sq).sqrt()
    }

    fn slope(&self) -> Slope {
        if 2 * self.with_halves > self.count {
            return Slope {
                ln: (self.across / self.across_tracer).ln(),
                noise_variance: 0.0,
            };
        }
        // Single readings: the slope lies between that of the gas on the tracer, if all noise is the gas's, and that of the
        // tracer on the gas. In ln it is uniform between them.
        let apart = -2.0 * self.correlation().ln();
        Slope {
            ln: (self.product / self.tracer_sq).ln() + 0.5 * apart,
            noise_variance: apart.powi(2) / 12.0,
        }
    }
}
