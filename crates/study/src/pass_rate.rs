//! The rate of a source by what passes at several heights and distances carry through each metre of height.
//!
//! The passes themselves show the plume's height and vertical spread, which are common to all of them; its axis wanders up
//! and down meanwhile (`wander.rs`). Passes at several distances join, each in the spread of its own.

use crate::Interval;
use crate::grid::{Summed, around, interval, mean, normal_grid, variance};
use crate::vertical::MeanPlume;
use crate::wander::{Crossing, PlumeParts, Wander};
use air::wind::WindVector;
use plume::curtain::{CleanAir, Pass, Sample, Site, covering, passes};

/// Fewest passes: the scatter of two says nothing of turbulence.
pub(crate) const LEAST_PASSES: usize = 3;
/// The plume is met where a pass carries this many standard deviations of the sensor's noise, as at a sensor at rest.
const MET_SD: f64 = 5.0;
/// Steps of the grid of ln rate: reach about the strongest pass, and number.
const RATE_REACH_LN: f64 = 4.0;
const RATE_STEPS: usize = 81;
/// Distance from a source at which a plume begins, m.
const LEAST_DISTANCE_M: f64 = 5.0;
/// Steps of the grids of σz and height in a mission, which asks again with each correction: nine are within 2 % of thirteen.
const MISSION_STEPS: usize = 9;

/// The plume of one source of a mission.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SourcePlume {
    /// Share of the source in what all emit.
    pub share: f64,
    /// Height of its axis above ground, m.
    pub axis_agl_m: f64,
    /// How far it is downwind of the source from which passes count their distance, m.
    pub downwind_m: f64,
}

/// The plumes of a mission as they are known beside what its passes carry.
#[derive(Clone, Copy)]
pub struct PassPlume<'a> {
    /// Those of all sources, which are off in height and spread alike.
    pub sources: &'a [SourcePlume],
    /// One standard deviation of their heights before the passes, m.
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
}

/// Rate and vertical spread of a mission's plume, as its passes determine them.
#[derive(Debug, Clone, PartialEq)]
pub struct PassRate {
    /// ln of the rate, kg/s, with weights.
    ln_kg_s: Vec<(f64, f64)>,
    /// Standard deviation of ln rate due to the background.
    background_ln_sd: f64,
    /// Means of ln rate (kg/s) and of ln of the ratio of σz to its prior value.
    pub mean: [f64; 2],
    /// Covariance of both.
    pub covariance: [[f64; 2]; 2],
}

impl PassRate {
    /// The rate, kg/s, in a wind that is `faster` times as fast; `wind_ln_sd` is the standard deviation of ln of its speed.
    pub fn kg_s(&self, faster: f64, wind_ln_sd: f64) -> Interval {
        let values = self.ln_kg_s.iter();
        let in_wind = values.map(|(ln, weight)| (ln + faster.ln(), *weight));
        interval(in_wind.collect(), wind_ln_sd.hypot(self.background_ln_sd))
    }
}

/// Estimates the emission of all sources upwind from the passes among `samples`. The samples are sorted by platform and time,
/// with the background subtracted; `wind` gives the wind at a height above ground, m. No rate is more probable than another
/// beforehand. None where fewer than three passes cross the whole plume.
pub fn rate_by_passes(
    samples: &[Sample],
    site: &Site,
    plume: PassPlume<'_>,
    wind: &dyn Fn(f64) -> WindVector,
    weighing: Weighing,
) -> Option<PassRate> {
    let (all, _) = passes(samples, site, CleanAir::Subtracted, wind);
    let used = covering(all.iter().collect());
    let is_met = used.iter().any(|p| is_met(p, weighing.noise_sd_ppm));
    if used.len() < LEAST_PASSES || !is_met {
        return None;
    }
    let mut seen: Vec<(Crossing, f64)> = used.iter().map(|p| crossing(p, weighing)).collect();
    seen.sort_by(|a, b| a.0.time_s.total_cmp(&b.0.time_s));
    let at = |distance_m: f64, [sigma_z_off, height_off]: [f64; 2]| -> PlumeParts {
        let of = |source: &SourcePlume| {
            let own_m = (distance_m - source.downwind_m).max(LEAST_DISTANCE_M);
            let part = MeanPlume {
                axis_agl_m: source.axis_agl_m + plume.axis_sd_m * height_off,
                sigma_z_m: (plume.sigma_z_m)(own_m) * (plume.sigma_z_ln_sd * sigma_z_off).exp(),
                reflects: plume.reflects,
            };
            (source.share, part)
        };
        plume.sources.iter().map(of).collect()
    };
    let grids = [normal_grid(MISSION_STEPS), normal_grid(MISSION_STEPS)];
    let posterior = Posterior::of(&seen, &at, grids);
    let sum = |of: fn(&Pass) -> f64| used.iter().map(|p| of(p)).sum::<f64>();
    let by_background = sum(|p| p.background_kg_s_m_ppm) / sum(|p| p.kg_s_m);
    let background_ln_sd = by_background * weighing.background_sd_ppm;
    let rate = PassRate::of(posterior, plume.sigma_z_ln_sd, background_ln_sd);
    let all = rate.kg_s(1.0, 0.0);
    (all.low95 > 0.0 && all.high95.is_finite()).then_some(rate)
}

impl PassRate {
    fn of(posterior: Posterior, sigma_z_ln_sd: f64, background_ln_sd: f64) -> Self {
        let [off, off_variance, with_rate] = posterior.sigma_z_off;
        let rate_variance = variance(&posterior.ln_rate) + background_ln_sd.powi(2);
        let with_rate = sigma_z_ln_sd * with_rate;
        Self {
            mean: [mean(&posterior.ln_rate), sigma_z_ln_sd * off],
            covariance: [
                [rate_variance, with_rate],
                [with_rate, sigma_z_ln_sd.powi(2) * off_variance],
            ],
            ln_kg_s: posterior.ln_rate,
            background_ln_sd,
        }
    }
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
    /// Deviation of ln σz from its prior, in prior standard deviations: mean, variance, and covariance with ln rate.
    pub sigma_z_off: [f64; 3],
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
        plume: &dyn Fn(f64, [f64; 2]) -> PlumeParts,
        grids: [Vec<(f64, f64)>; 2],
    ) -> Self {
        let (crossings, distances): (Vec<Crossing>, Vec<f64>) = crossings.iter().copied().unzip();
        let wander = Wander::new(&crossings);
        let plumes = |off: [f64; 2]| -> Vec<PlumeParts> {
            distances.iter().map(|d| plume(*d, off)).collect()
        };
        let middle = middle_ln(&crossings, &plumes([0.0; 2]));
        let rates = around(middle, RATE_REACH_LN, RATE_STEPS);
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
        let off = summed.unknown(0, 1.0);
        Self {
            sigma_z_off: [mean(&off), variance(&off), summed.covariance[0]],
            turbulence_variance: summed.rest_variance(),
            ln_rate: summed.values,
            sigma_z_variance,
            height_variance,
        }
    }
}

/// ln rate by the strongest pass, if it crossed the axis.
fn middle_ln(crossings: &[Crossing], plumes: &[PlumeParts]) -> f64 {
    let of = |(crossing, plume): (&Crossing, &PlumeParts)| {
        let carried = crossing.kg_s_m.max(crossing.noise_kg_s_m);
        let on_axis = |(share, part): &(f64, MeanPlume)| share * part.density_1_m(part.axis_agl_m);
        carried / plume.iter().map(on_axis).fold(f64::MIN_POSITIVE, f64::max)
    };
    crossings
        .iter()
        .zip(plumes)
        .map(of)
        .fold(f64::MIN_POSITIVE, f64::max)
        .ln()
}

#[cfg(test)]
mod tests {
    use super::*;
    use air::geo::Enu;
    use air::isa::Atmosphere;
    use plume::{Gas, Place};

    const Q_KG_S: f64 = 500.0;
    const WIND_M_S: f64 = 8.0;
    const AXIS_AGL_M: f64 = 540.0;
    const SIGMA_Z_PER_M: f64 = 0.05;

    fn site() -> Site {
        Site {
            source: Enu::default(),
            ground_amsl_m: 340.0,
            gas: Gas::Co2,
            atmosphere: Atmosphere::standard(),
        }
    }

    fn wind(_height_agl_m: f64) -> WindVector {
        WindVector::from_speed_and_direction(WIND_M_S, 270.0)
    }

    /// Passes at (distance, height) through the plume c = Q / (2π u σy σz) exp(−y²/2σy² − z²/2σz²), whose flux is Q, with
    /// σy = 0.09 x and σz = 0.05 x, 80 s apart.
    fn flown(passes: &[(f64, f64)], kg_s: f64) -> Vec<Sample> {
        let mut samples = Vec::new();
        for (pass, &(east_m, height_agl_m)) in passes.iter().enumerate() {
            let (sigma_y, sigma_z) = (0.09 * east_m, SIGMA_Z_PER_M * east_m);
            let air = site().atmosphere.at(340.0 + height_agl_m);
            for k in 0..=60 {
                let north_m = sigma_y * (f64::from(k) / 10.0 - 3.0);
                let off =
                    (north_m / sigma_y).powi(2) + ((height_agl_m - AXIS_AGL_M) / sigma_z).powi(2);
                let kg_m3 = kg_s / (std::f64::consts::TAU * WIND_M_S * sigma_y * sigma_z)
                    * (-0.5 * off).exp();
                samples.push(Sample {
                    platform: 0,
                    time_s: 80.0 * pass as f64 + f64::from(k),
                    place: Place {
                        east_m,
                        north_m: if pass % 2 == 0 { north_m } else { -north_m },
                        height_agl_m,
                    },
                    ppm: Gas::Co2.ppm(kg_m3, air),
                });
            }
        }
        samples
    }

    /// Heights about an axis that is supposed 40 m too low, at two distances.
    const PASSES: [(f64, f64); 10] = [
        (1100.0, 500.0),
        (1100.0, 560.0),
        (1100.0, 440.0),
        (1100.0, 600.0),
        (2000.0, 540.0),
        (2000.0, 640.0),
        (2000.0, 440.0),
        (1100.0, 530.0),
        (1100.0, 570.0),
        (1100.0, 480.0),
    ];

    /// One source, of whose plume the axis is supposed here.
    fn source(axis_agl_m: f64) -> SourcePlume {
        SourcePlume {
            share: 1.0,
            axis_agl_m,
            downwind_m: 0.0,
        }
    }

    /// What is supposed of plume and background beside the sources.
    struct Supposed {
        axis_sd_m: f64,
        /// σz over the true one.
        sigma_z_factor: f64,
        sigma_z_ln_sd: f64,
        background_sd_ppm: f64,
    }

    impl Supposed {
        /// An uncertain axis, with the true σz and background.
        const AXIS_UNCERTAIN: Self = Self {
            axis_sd_m: 50.0,
            sigma_z_factor: 1.0,
            sigma_z_ln_sd: 0.3,
            background_sd_ppm: 0.0,
        };
        const AXIS_KNOWN: Self = Self {
            axis_sd_m: 1.0,
            ..Self::AXIS_UNCERTAIN
        };

        fn rate(&self, samples: &[Sample], sources: &[SourcePlume]) -> Option<PassRate> {
            let plume = PassPlume {
                sources,
                axis_sd_m: self.axis_sd_m,
                sigma_z_m: &|distance_m| self.sigma_z_factor * SIGMA_Z_PER_M * distance_m,
                sigma_z_ln_sd: self.sigma_z_ln_sd,
                reflects: false,
            };
            let weighing = Weighing {
                noise_sd_ppm: 3.0,
                background_sd_ppm: self.background_sd_ppm,
            };
            rate_by_passes(samples, &site(), plume, &wind, weighing)
        }
    }

    fn weighed(samples: &[Sample], background_sd_ppm: f64) -> Option<Interval> {
        let supposed = Supposed {
            sigma_z_factor: 1.25,
            background_sd_ppm,
            ..Supposed::AXIS_UNCERTAIN
        };
        let rate = supposed.rate(samples, &[source(500.0)]);
        rate.map(|r| r.kg_s(1.0, 0.03))
    }

    /// The passes find height and spread, though both are supposed wrong by nearly a standard deviation.
    #[test]
    fn passes_at_several_distances_give_the_rate() {
        let rate = weighed(&flown(&PASSES, Q_KG_S), 0.0).unwrap();
        assert!((rate.value / Q_KG_S - 1.0).abs() < 0.1, "{rate:?}");
        assert!(rate.low95 < Q_KG_S && Q_KG_S < rate.high95, "{rate:?}");
        assert!((0.05..0.25).contains(&rate.ln_sd()), "{rate:?}");
    }

    /// A lower source 400 m downwind emits a quarter of all: one plume alone, of the upper one, finds another rate.
    #[test]
    fn plumes_of_two_heights_join() {
        let mut both = flown(&PASSES, 0.75 * Q_KG_S);
        let low: Vec<(f64, f64)> = PASSES.iter().map(|p| (p.0 - 400.0, p.1 + 200.0)).collect();
        for (sample, other) in both.iter_mut().zip(flown(&low, 0.25 * Q_KG_S)) {
            sample.ppm += other.ppm;
        }
        let plume = |sources: &[SourcePlume]| {
            let rate = Supposed::AXIS_UNCERTAIN.rate(&both, sources);
            rate.unwrap().kg_s(1.0, 0.03)
        };
        let upper = SourcePlume {
            share: 0.75,
            ..source(520.0)
        };
        let lower = SourcePlume {
            share: 0.25,
            downwind_m: 400.0,
            ..source(320.0)
        };
        let rate = plume(&[upper, lower]);
        assert!((rate.value / Q_KG_S - 1.0).abs() < 0.1, "{rate:?}");
        let alone = plume(&[source(520.0)]);
        assert!(alone.value < 0.85 * Q_KG_S, "{alone:?}");
    }

    /// Each pass at the axis carries Q times a log-normal factor with a mean of one. The factors are the quantiles at
    /// (k + 1/2)/12 for ln sd 0.6 (SciPy, exp(0.6 norm.ppf(p) - 0.18)), in mixed order. Their median is 16 % below the mean.
    #[test]
    fn the_rate_is_the_mean_of_passes_that_scatter() {
        let factors = [
            0.601, 1.360, 0.296, 1.011, 0.889, 2.361, 0.419, 0.784, 0.513, 1.666, 0.690, 1.161,
        ];
        let mut samples = Vec::new();
        for (k, factor) in factors.into_iter().enumerate() {
            let mut pass = flown(&[(1100.0, AXIS_AGL_M)], factor * Q_KG_S);
            pass.iter_mut().for_each(|s| s.time_s += 400.0 * k as f64);
            samples.extend(pass);
        }
        let supposed = Supposed {
            sigma_z_ln_sd: 0.01,
            ..Supposed::AXIS_KNOWN
        };
        let rate = supposed.rate(&samples, &[source(AXIS_AGL_M)]);
        let rate = rate.unwrap().kg_s(1.0, 0.0);
        assert!((rate.value / Q_KG_S - 1.0).abs() < 0.1, "{rate:?}");
    }

    /// Passes across the axis determine Q/σz better than Q, so the errors of both are correlated.
    #[test]
    fn rate_and_spread_err_together() {
        let samples = flown(&[(1100.0, AXIS_AGL_M); 8], Q_KG_S);
        let found = Supposed::AXIS_KNOWN.rate(&samples, &[source(AXIS_AGL_M)]);
        let found = found.unwrap();
        let [[rate, both], [_, spread]] = found.covariance;
        assert!(both > 0.0 && both * both < rate * spread, "{found:?}");
        assert!(rate + spread - 2.0 * both < rate, "{found:?}");
    }

    #[test]
    fn the_rate_scales_with_what_passes_carry() {
        let [one, three] = [1.0, 3.0].map(|f| weighed(&flown(&PASSES, f * Q_KG_S), 0.0).unwrap());
        assert!((three.value / one.value / 3.0 - 1.0).abs() < 0.01);
    }

    #[test]
    fn a_background_that_is_hardly_known_widens_the_interval() {
        let [known, unknown] = [0.0, 40.0].map(|sd| weighed(&flown(&PASSES, Q_KG_S), sd).unwrap());
        assert!(unknown.ln_sd() > 1.05 * known.ln_sd(), "{unknown:?}");
    }

    #[test]
    fn two_passes_and_clean_air_give_no_rate() {
        assert_eq!(weighed(&flown(&PASSES[..2], Q_KG_S), 0.0), None);
        assert_eq!(weighed(&flown(&PASSES, 0.0), 0.0), None);
    }
}
