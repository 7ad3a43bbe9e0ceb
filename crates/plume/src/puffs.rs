//! The plume in air that moves: puffs that the wind of their way has carried.
//!
//! The plume of a steady wind is its mean over a time in which the wind meanders. Here the two parts of its
//! spread are kept apart (Gifford 1959): the *meander*, which displaces each puff by the way that the
//! eddies took since it was emitted, and the *relative* spread of the puff about its own centre,
//! σ_r² = σ² − σ_m², with σ_m² the eddies' variance of place at the puff's age (Taylor 1921). Over many
//! meanders the two together give σ again: the mean of this plume is that of the steady model.
//!
//! The concentration at a place is the sum over puffs emitted at ages τ_j, one relative spread apart,
//!
//! c = Σ Q Δτ_j / (2π σ_ry² · √(2π) σ_rz) exp(−r_j²/2σ_ry²) V_j(z),
//!
//! with r_j the horizontal distance from the puff's centre and V the vertical shape of the steady model with
//! its images. A wind of long ago has carried the far puffs, and that of a moment ago the near ones: a
//! plume in a turning wind is bent. Everything else, losses, trends, further sources, is as in the
//! steady model. Inside the puffs the concentration fluctuates, by a factor with mean 1 that moves with
//! the air.
//!
//! A source given by its c_MAX emits what makes that concentration in the scenario's wind; in a faster one
//! the plume is thinner.

use super::{
    DispersionModel, HOUR_S, LEAST_TRANSPORT_M_S, MAX_EXPONENT, Place, Plume, SourceTerm, cos_sin,
};
use air::eddies::{Eddies, EddySpec, LONGEST_WAY_S};
use air::wind::{Way, WindSeries};
use rand::rngs::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use std::f64::consts::TAU;

/// Nearest and farthest puff, m on its way: a receptor nearer than the first is in the source.
const FIRST_M: f64 = 2.0;
const LAST_M: f64 = 30_000.0;
/// Way from puff to puff over their relative spread. The sum differs from the integral by
/// 2 exp(−2π²/h²): 5e-9 at 1 (Poisson's sum of a Gaussian).
const SPACING_SIGMAS: f64 = 1.0;
/// Part of the variance that a puff has about its own centre at least: that of the largest share of meander.
const LEAST_RELATIVE: f64 = 0.05;
/// Waves whose sum is the fluctuation: its distribution is then normal within a percent.
const WAVES: usize = 24;
/// Fluctuations change across the plume over this part of its relative spread (Wilson 1995: eddies that
/// mix a plume are of its own size and below).
const WAVE_SIGMAS: f64 = 0.7;

/// How unsteady the air is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct UnsteadySpec {
    /// Part of the plume's variance that is meander, where it has most; 0 to 0.95.
    pub meander_share: f64,
    /// Lagrangian time scale of the horizontal eddies, s; the vertical ones have half of it.
    pub lagrangian_time_s: f64,
    /// Standard deviation of the concentration in the plume over its mean.
    pub fluctuation_intensity: f64,
    /// Time over which the fluctuation changes in air that passes by, s.
    pub fluctuation_time_s: f64,
}

impl Default for UnsteadySpec {
    /// Half of the variance near a source is meander, so that passes differ by a factor of two; its time scale
    /// leaves most of it within ten minutes, for which the classes' spread was measured (Gifford 1959;
    /// Hanna 1982: T_L of some 0.15 h/σ_v, 60 s for h of 250 m and σ_v of 0.6 m/s); in a plume's core the
    /// intensity is some 0.3 to 0.5 (Fackrell and Robins 1982).
    fn default() -> Self {
        Self {
            meander_share: 0.5,
            lagrangian_time_s: 60.0,
            fluctuation_intensity: 0.3,
            fluctuation_time_s: 5.0,
        }
    }
}

/// Air that meanders, and in which concentrations fluctuate.
#[derive(Debug)]
pub struct UnsteadyAir {
    eddies: Eddies,
    fluctuation: Fluctuation,
}

impl UnsteadyAir {
    /// The unsteady air around the plume of `model`. Of one model and one pair of generators it is always
    /// the same.
    pub fn new(
        model: &DispersionModel,
        spec: UnsteadySpec,
        eddies: ChaCha8Rng,
        mut fluctuation: ChaCha8Rng,
    ) -> Self {
        Self {
            eddies: Eddies::new(eddies_of(model, spec), eddies),
            fluctuation: Fluctuation::new(spec, &mut fluctuation),
        }
    }

    /// Deviation of the wind from the slow one at a time and height, east, north and up, m/s.
    pub fn wind_m_s(&mut self, time_s: f64, height_agl_m: f64) -> [f64; 3] {
        self.eddies.wind_m_s(time_s, height_agl_m)
    }
}

/// Eddies that make the share of the spread that is asked for where it is largest on the way, and nowhere
/// more.
fn eddies_of(model: &DispersionModel, spec: UnsteadySpec) -> EddySpec {
    let horizontal_s = spec.lagrangian_time_s;
    let unit = EddySpec {
        sigma_m_s: [1.0; 3],
        time_scale_s: [horizontal_s, horizontal_s, 0.5 * horizontal_s],
        height_agl_m: model.spec.sources[0].effective_height_agl_m,
    };
    let (mut y, mut z) = (f64::INFINITY, f64::INFINITY);
    for (x_m, age_s) in model.ages() {
        let (sigma_y, sigma_z) = model.sigmas_m(x_m);
        let [variance_y, _, variance_z] = unit.way_variance_m2(age_s);
        y = y.min(sigma_y * sigma_y / variance_y);
        z = z.min(sigma_z * sigma_z / variance_z);
    }
    let sd = |most: f64| (spec.meander_share * most).sqrt();
    EddySpec {
        sigma_m_s: [sd(y), sd(y), sd(z)],
        ..unit
    }
}

/// Fluctuation of the concentration in a plume: log-normal, of mean 1, and frozen in the air as
/// a function of when the air passed the source and where in the puff it is.
#[derive(Debug, Clone)]
struct Fluctuation {
    /// Angular frequency of emission, wave numbers across and up in relative spreads, and phase.
    waves: Vec<[f64; 4]>,
    /// Standard deviation of the logarithm.
    ln_sd: f64,
}

impl Fluctuation {
    fn new(spec: UnsteadySpec, rng: &mut ChaCha8Rng) -> Self {
        let mut normal = || -> f64 { StandardNormal.sample(rng) };
        let waves = (0..WAVES).map(|k| {
            [
                normal() / spec.fluctuation_time_s,
                normal() / WAVE_SIGMAS,
                normal() / WAVE_SIGMAS,
                // Phases evenly round the circle: the sum over waves then has no mean of its own.
                TAU * k as f64 / WAVES as f64,
            ]
        });
        Self {
            waves: waves.collect(),
            ln_sd: spec.fluctuation_intensity.powi(2).ln_1p().sqrt(),
        }
    }

    fn factor(&self, emitted_s: f64, across_sigmas: f64, above_sigmas: f64) -> f64 {
        if self.ln_sd == 0.0 {
            return 1.0;
        }
        let sum: f64 = self
            .waves
            .iter()
            .map(|[t, y, z, phase]| {
                (t * emitted_s + y * across_sigmas + z * above_sigmas + phase).cos()
            })
            .sum();
        let normal = sum * (2.0 / WAVES as f64).sqrt();
        (self.ln_sd * normal - 0.5 * self.ln_sd * self.ln_sd).exp()
    }
}

/// One puff.
#[derive(Debug, Clone, Copy)]
struct Puff {
    /// Way of the slow wind and of the eddies from the source, m east and north.
    east_m: f64,
    north_m: f64,
    /// Height of its centre, m.
    height_m: f64,
    sigma_y_m: f64,
    sigma_z_m: f64,
    /// What multiplies exp(−r²/2σ²) V(z): in mol/m³ or ppm as the source has it.
    strength: f64,
    age_s: f64,
    /// How far it is from its source, at least [`FIRST_M`], m.
    far_m: f64,
}

/// What a place has of the puffs of one source: the sum, and sums weighted by it of age and of place in the puff
/// in relative spreads.
#[derive(Debug, Default)]
struct PuffSums {
    total: f64,
    age_s: f64,
    across: f64,
    above: f64,
}

/// The plumes of a model at one moment.
#[derive(Debug, Clone)]
pub struct Puffs {
    time_s: f64,
    /// Of each plume, in the model's order.
    of_plume: Vec<Vec<Puff>>,
    fluctuation: Option<Fluctuation>,
}

impl DispersionModel {
    /// Ways from the source of this model's puffs, m, and how long the scenario's wind takes for them, s:
    /// a relative spread apart where half of the variance is meander.
    fn ages(&self) -> impl Iterator<Item = (f64, f64)> {
        let speed_m_s =
            (self.scenario_wind.speed_m_s * self.effects.speed_factor).max(LEAST_TRANSPORT_M_S);
        let mut x_m = FIRST_M;
        std::iter::from_fn(move || {
            let at = (x_m, x_m / speed_m_s);
            x_m += SPACING_SIGMAS * self.sigmas_m(x_m).0 * std::f64::consts::FRAC_1_SQRT_2;
            (at.0 < LAST_M && at.1 < LONGEST_WAY_S).then_some(at)
        })
    }

    /// The plumes at `time_s`, carried by the slow wind `slow` at the height of the scenario's wind, turned
    /// clockwise by `turn_deg`, and by unsteady air where there is any.
    pub fn puffs(
        &self,
        slow: &WindSeries,
        turn_deg: f64,
        mut unsteady: Option<&mut UnsteadyAir>,
        time_s: f64,
    ) -> Puffs {
        let drift_deg = self.effects.direction_drift_deg_h * time_s / HOUR_S;
        let turn = cos_sin(turn_deg + self.effects.direction_offset_deg + drift_deg);
        let reference_m_s = self.spec.wind.reference_speed_m_s();
        let to_plume = if reference_m_s > 0.0 {
            self.scenario_wind.speed_m_s / reference_m_s
        } else {
            1.0
        };
        let here = slow.way(time_s);
        let eddies_here = unsteady.as_mut().map(|air| air.eddies.way_m(time_s));
        let ways: Vec<(f64, Way, [f64; 3], [f64; 3])> = self
            .ages()
            .map(|(_, age_s)| {
                let then = slow.way(time_s - age_s);
                let factor = to_plume * self.effects.speed_factor;
                let way = Way {
                    east_m: (here.east_m - then.east_m) * factor,
                    north_m: (here.north_m - then.north_m) * factor,
                    length_m: (here.length_m - then.length_m) * factor,
                };
                let (eddies_m, variance_m2) = match unsteady.as_mut().zip(eddies_here) {
                    None => ([0.0; 3], [0.0; 3]),
                    Some((air, to)) => {
                        let from = air.eddies.way_m(time_s - age_s);
                        (
                            std::array::from_fn(|k| to[k] - from[k]),
                            air.eddies.spec().way_variance_m2(age_s),
                        )
                    }
                };
                (age_s, way.turned(turn), eddies_m, variance_m2)
            })
            .collect();
        Puffs {
            time_s,
            of_plume: self
                .plumes
                .iter()
                .map(|plume| self.puffs_of(plume, &ways, time_s))
                .collect(),
            fluctuation: unsteady.map(|air| air.fluctuation.clone()),
        }
    }

    fn puffs_of(
        &self,
        plume: &Plume,
        ways: &[(f64, Way, [f64; 3], [f64; 3])],
        time_s: f64,
    ) -> Vec<Puff> {
        let lid_m = self.reflection.lid_m;
        let start_var_m2 = self.cells[plume.cells.start].start_var_m2;
        let duration = |k: usize| {
            let before = if k == 0 { 0.0 } else { ways[k - 1].0 };
            let after = ways.get(k + 1).map_or(ways[k].0, |w| w.0);
            0.5 * (after - before)
        };
        let reference_m_s =
            self.scenario_wind.speed_m_s.max(LEAST_TRANSPORT_M_S) * self.effects.speed_factor;
        let puff = |(k, &(age_s, way, eddies_m, variance_m2)): (usize, &(f64, Way, _, _))| {
            let [east_m, north_m, up_m]: [f64; 3] = eddies_m;
            let [variance_y, _, variance_z]: [f64; 3] = variance_m2;
            let ratio = plume.speed_ratio;
            let x_m = (way.length_m * ratio).max(FIRST_M);
            let (y, z) = self.sigmas_m(x_m);
            // Where the spread of the moment is less than the eddies', as with a source's own mechanisms, the
            // puff keeps a part of it.
            let relative_m2 = |sigma: f64, meander: f64| {
                (sigma * sigma - meander).max(LEAST_RELATIVE * sigma * sigma)
            };
            // Each cell of an area has this row of puffs, round as the cell is.
            let sigma_y_m = (relative_m2(y, variance_y) + start_var_m2).sqrt();
            let sigma_z_m = relative_m2(z, variance_z).sqrt();
            let mut height_m = plume.height_m + up_m;
            // The lid sends a puff that reaches it back.
            if plume.height_m < lid_m && height_m > lid_m {
                height_m = 2.0 * lid_m - height_m;
            }
            let (source, per_s) = match plume.source_term {
                SourceTerm::MolarRate(q) => (q, 1.0),
                SourceTerm::AxisConcentration(c) => (c, reference_m_s * ratio),
            };
            let left = self.surviving_fraction(plume, x_m, x_m / age_s);
            let (east_m, north_m) = (way.east_m * ratio + east_m, way.north_m * ratio + north_m);
            Puff {
                east_m,
                north_m,
                far_m: east_m.hypot(north_m).max(FIRST_M),
                height_m,
                sigma_y_m,
                sigma_z_m,
                strength: source
                    * per_s
                    * duration(k)
                    * left
                    * self.emission_growth(plume, time_s - age_s)
                    / (TAU.sqrt() * sigma_y_m * sigma_y_m * sigma_z_m),
                age_s,
            }
        };
        ways.iter().enumerate().map(puff).collect()
    }

    /// Centres of the puffs of all plumes.
    pub fn puff_centres(&self, puffs: &Puffs) -> Vec<Place> {
        let plumes = self.plumes.iter().zip(&puffs.of_plume);
        let centres = plumes.flat_map(|(plume, of_plume)| {
            of_plume.iter().map(|puff| Place {
                east_m: plume.east_m + puff.east_m,
                north_m: plume.north_m + puff.north_m,
                height_agl_m: puff.height_m,
            })
        });
        centres.collect()
    }

    /// Mole fraction at a place among `puffs` of this model, ppm.
    pub fn ppm_among(&self, puffs: &Puffs, place: &Place) -> f64 {
        let (mut molar, mut direct) = (0.0, 0.0);
        for (plume, of_plume) in self.plumes.iter().zip(&puffs.of_plume) {
            let sum = self.sum(plume, of_plume, puffs, place);
            match plume.source_term {
                SourceTerm::MolarRate(_) => molar += sum,
                SourceTerm::AxisConcentration(_) => direct += sum,
            }
        }
        self.with_background((molar, direct), place, puffs.time_s)
    }

    fn sum(&self, plume: &Plume, of_plume: &[Puff], puffs: &Puffs, place: &Place) -> f64 {
        let mut sums = PuffSums::default();
        for cell in &self.cells[plume.cells.clone()] {
            self.add_row(cell, of_plume, place, &mut sums);
        }
        match &puffs.fluctuation {
            Some(fluctuation) if sums.total > 0.0 => {
                let emitted_s = puffs.time_s - sums.age_s / sums.total;
                let (across, above) = (sums.across / sums.total, sums.above / sums.total);
                sums.total * fluctuation.factor(emitted_s, across, above)
            }
            _ => sums.total,
        }
    }

    /// Adds what a cell's share of its source's row of puffs makes at a place.
    fn add_row(&self, cell: &Plume, row: &[Puff], place: &Place, sums: &mut PuffSums) {
        let (mut east_m, mut north_m) = (place.east_m - cell.east_m, place.north_m - cell.north_m);
        if self.effects.veer_deg_100m != 0.0 {
            // The wind at this height turns the plume; here the place is turned back instead.
            let up_m = place.height_agl_m - cell.height_m;
            let (cos, sin) = cos_sin(-self.effects.veer_deg_100m * up_m / 100.0);
            (east_m, north_m) = (east_m * cos + north_m * sin, north_m * cos - east_m * sin);
        }
        for puff in row {
            let (de, dn) = (east_m - puff.east_m, north_m - puff.north_m);
            let horizontal = 0.5 * (de * de + dn * dn) / (puff.sigma_y_m * puff.sigma_y_m);
            if horizontal > MAX_EXPONENT {
                continue;
            }
            let shape = self.reflection.profile(
                place.height_agl_m,
                puff.height_m,
                puff.sigma_z_m,
                horizontal,
            );
            let part = cell.share * puff.strength * shape;
            sums.total += part;
            sums.age_s += part * puff.age_s;
            sums.across +=
                part * (de * puff.north_m - dn * puff.east_m) / (puff.sigma_y_m * puff.far_m);
            sums.above += part * (place.height_agl_m - puff.height_m) / puff.sigma_z_m;
        }
    }
}

#[cfg(test)]
#[path = "puffs_tests.rs"]
mod tests;
