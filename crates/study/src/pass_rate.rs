//! The rate of a source by what passes at several heights and distances carry through each metre of height.
//!
//! The passes themselves show the plume's height and vertical spread, which are common to all of them; its axis wanders up
//! and down meanwhile (`wander.rs`). Passes at several distances join, each in the spread of its own.

use crate::grid::{Summed, interval, normal_grid};
use crate::vertical::MeanPlume;
use crate::wander::{Crossing, Wander};
use crate::Interval;
use air::wind::WindVector;
use plume::curtain::{CleanAir, Pass, Sample, Site, covering, passes};

/// Fewest passes: the scatter of two says nothing of turbulence.
pub(crate) const LEAST_PASSES: usize = 3;
/// The plume is met where a pass carries this many standard deviations of the sensor's noise, as at a sensor at rest.
const MET_SD: f64 = 5.0;
/// Steps of the grid of ln rate: reach about the strongest pass, and number.
const RATE_REACH_LN: f64 = 4.0;
const RATE_STEPS: usize = 81;
/// Steps of the grids of σz and height in a mission, which asks again with each correction: nine are within 2 % of thirteen.
const MISSION_STEPS: usize = 9;

/// The plume of a mission as it is known beside what its passes carry.
#[derive(Clone, Copy)]
pub struct PassPlume<'a> {
    /// Height of its axis above ground, m.
    pub axis_agl_m: f64,
    /// One standard deviation of that before the passes, m.
    pub axis_sd_m: f64,
    /// σz at a distance from the source, m.
    pub sigma_z_m: &'a dyn Fn(f64) -> f64,
    /// One standard deviation of its logarithm before the passes.
    pub sigma_z_ln_sd: f64,
    /// Whether the ground reflects it.
    pub reflects: bool,
}

/// What is known of what passes are weighed by.
#[derive(Debug, Clone, Copy)]
pub struct Weighing {
    /// White noise of the samples, ppm.
    pub noise_sd_ppm: f64,
    /// One standard deviation of the background that was subtracted from all of them, ppm.
    pub background_sd_ppm: f64,
    /// One standard deviation of ln of the wind speed.
    pub wind_ln_sd: f64,
}

/// What all sources upwind emit, kg/s, by the passes among `samples`, which stand platform by platform in order of time
/// with the background subtracted; `wind` is that of a height above ground, m. Of no rate more is known beforehand than of
/// any other. None where fewer than three passes cross the whole plume.
pub fn rate_by_passes(
    samples: &[Sample],
    site: &Site,
    plume: PassPlume<'_>,
    wind: &dyn Fn(f64) -> WindVector,
    weighing: Weighing,
) -> Option<Interval> {
    let (all, _) = passes(samples, site, CleanAir::Subtracted, wind);
    let used = covering(all.iter().collect());
    let is_met = used.iter().any(|p| is_met(p, weighing.noise_sd_ppm));
    if used.len() < LEAST_PASSES || !is_met {
        return None;
    }
    let mut seen: Vec<(Crossing, f64)> = used.iter().map(|p| crossing(p, weighing)).collect();
    seen.sort_by(|a, b| a.0.time_s.total_cmp(&b.0.time_s));
    let at = |distance_m: f64, [sigma_z_off, height_off]: [f64; 2]| MeanPlume {
        axis_agl_m: plume.axis_agl_m + plume.axis_sd_m * height_off,
        sigma_z_m: (plume.sigma_z_m)(distance_m) * (plume.sigma_z_ln_sd * sigma_z_off).exp(),
        reflects: plume.reflects,
    };
    let grids = [normal_grid(MISSION_STEPS), normal_grid(MISSION_STEPS)];
    let posterior = Posterior::of(&seen, &at, grids);
    let sum = |of: fn(&Pass) -> f64| used.iter().map(|p| of(p)).sum::<f64>();
    let by_background = sum(|p| p.background_kg_s_m_ppm) / sum(|p| p.kg_s_m);
    let background_ln_sd = by_background * weighing.background_sd_ppm;
    let extra_sd = weighing.wind_ln_sd.hypot(background_ln_sd);
    let rate = interval(posterior.ln_rate, extra_sd);
    (rate.low95 > 0.0 && rate.high95.is_finite()).then_some(rate)
}

/// Whether a pass meets a plume, in readings with this white noise, ppm.
pub(crate) fn is_met(pass: &Pass, noise_sd_ppm: f64) -> bool {
    pass.kg_s_m > MET_SD * pass.noise_kg_s_m_ppm * noise_sd_ppm
}

fn crossing(pass: &Pass, weighing: Weighing) -> (Crossing, f64) {
    let crossing = Crossing {
        time_s: f64::midpoint(pass.time_s[0], pass.time_s[1]),
        height_agl_m: pass.height_agl_m,
        kg_s_m: pass.kg_s_m,
        noise_kg_s_m: pass.noise_kg_s_m_ppm * weighing.noise_sd_ppm,
    };
    (crossing, pass.distance_m)
}

/// The posterior of ln rate, kg/s, of a source at one place.
pub(crate) struct Posterior {
    /// ln rate with its weight.
    pub ln_rate: Vec<(f64, f64)>,
    /// Variances of ln rate by σz, by the height of the source, and by the rest.
    pub sigma_z_variance: f64,
    pub height_variance: f64,
    pub turbulence_variance: f64,
}

impl Posterior {
    /// That of `crossings` in order of time, each with its distance from the source, m; `plume` is the mean plume at a
    /// distance with σz and height off by so many standard deviations, which lie on `grids` with their weights.
    pub fn of(
        crossings: &[(Crossing, f64)],
        plume: &dyn Fn(f64, [f64; 2]) -> MeanPlume,
        grids: [Vec<(f64, f64)>; 2],
    ) -> Self {
        let (crossings, distances): (Vec<Crossing>, Vec<f64>) = crossings.iter().copied().unzip();
        let wander = Wander::new(&crossings);
        let plumes =
            |off: [f64; 2]| -> Vec<MeanPlume> { distances.iter().map(|d| plume(*d, off)).collect() };
        let middle = middle_ln(&crossings, &plumes([0.0; 2]));
        let rates: Vec<f64> = (0..RATE_STEPS)
            .map(|k| middle + RATE_REACH_LN * (2.0 * k as f64 / (RATE_STEPS - 1) as f64 - 1.0))
            .collect();
        let kg_s: Vec<f64> = rates.iter().map(|r| r.exp()).collect();
        let [sigmas, heights] = grids;
        let mut cells = Vec::new();
        for &(sigma_z, by_sigma_z) in &sigmas {
            for &(height, by_height) in &heights {
                let beforehand = (by_sigma_z * by_height).ln();
                let ln = wander.ln_likelihood(&plumes([sigma_z, height]), &kg_s);
                let ln: Vec<f64> = ln.into_iter().map(|l| l + beforehand).collect();
                cells.push(([sigma_z, height], ln));
            }
        }
        let summed = Summed::of(&rates, &cells);
        let [sigma_z_variance, height_variance] = summed.explained;
        Self {
            turbulence_variance: summed.rest_variance(),
            ln_rate: summed.values,
            sigma_z_variance,
            height_variance,
        }
    }
}

/// ln rate by the strongest pass, if it crossed the axis.
fn middle_ln(crossings: &[Crossing], plumes: &[MeanPlume]) -> f64 {
    let of = |(crossing, plume): (&Crossing, &MeanPlume)| {
        let carried = crossing.kg_s_m.max(crossing.noise_kg_s_m);
        carried / plume.density_1_m(plume.axis_agl_m)
    };
    crossings
        .iter()
        .zip(plumes)
        .map(of)
        .fold(f64::MIN_POSITIVE, f64::max)
        .ln()
}
