//! The crosswind profile of a plume at a sensor at rest: a Gaussian in wind direction.

use crate::sectors::{SECTOR_DEG, Sector};
use crate::stations::Sight;
use plume::DispersionSpec;
use plume::sigma::sigma_y_m;

/// Standard deviation of one eddy's mean of a sector, as a part of its long-term mean: crossings of a plume within a
/// hundred metres differ by a factor of two.
const EDDY_SCATTER: f64 = 1.0;
/// Standard deviation of a sector's mean about a Gaussian profile, as a part of it: what no time averages out.
const PROFILE_SCATTER: f64 = 0.4;
/// The same as a part of the highest sector: large eddies carry gas far aside, where a Gaussian has none.
pub(crate) const PROFILE_FLOOR: f64 = 0.1;
/// Standard deviation of the direction from source to sensor in the wind vane's frame, degrees: an anemometer set up by
/// compass.
pub(crate) const DIRECTION_SD_DEG: f64 = 10.0;
/// Standard deviation of the wind's crosswind speed that meanders at any stability, m/s (Hanna 1983, J. Climate Appl.
/// Meteor. 22:1424).
const MEANDER_M_S: f64 = 0.5;
/// Standard deviation of ln width of the profile beforehand.
const WIDTH_LN_SD: f64 = 0.5;

/// A Gaussian crosswind profile.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Shape {
    direction_rad: f64,
    width_rad: f64,
    distance_m: f64,
}

impl Shape {
    /// The profile at a sensor in a wind of `speed_m_s`, with direction and ln width off by so many standard deviations.
    pub fn new(
        spec: &DispersionSpec,
        (sight, speed_m_s): (Sight, f64),
        [direction, width]: [f64; 2],
    ) -> Self {
        let expected = width_rad(spec, sight.distance_m, speed_m_s);
        Self {
            direction_rad: (sight.turn_deg + DIRECTION_SD_DEG * direction).to_radians(),
            width_rad: (expected * (WIDTH_LN_SD * width).exp())
                .hypot(SECTOR_DEG.to_radians() / 12f64.sqrt()),
            distance_m: sight.distance_m,
        }
    }

    /// The profile as expected, without the width of a sector.
    pub fn expected(spec: &DispersionSpec, distance_m: f64, speed_m_s: f64) -> Self {
        Self {
            direction_rad: 0.0,
            width_rad: width_rad(spec, distance_m, speed_m_s),
            distance_m,
        }
    }

    /// Expected mean of a sector for an area of 1 ppm m²/s, 1/m.
    pub fn at(&self, sector: &Sector) -> f64 {
        let off = (sector.off_deg.to_radians() - self.direction_rad) / self.width_rad;
        (-0.5 * off * off).exp() / (std::f64::consts::TAU.sqrt() * self.width_rad * self.distance_m)
    }

    /// ln likelihood of the sectors of one sensor, for each expected mean a normal quantity whose standard deviation is
    /// in part proportional to it.
    pub fn ln_likelihood(&self, sectors: &[Sector], area: f64, floor: f64) -> f64 {
        let of = |sector: &Sector| {
            let expected = area * self.at(sector);
            let variance = expected.powi(2) * scatter_sq(sector) + fixed_sq(sector, floor);
            -0.5 * ((sector.mean_ppm_m_s - expected).powi(2) / variance + variance.ln())
        };
        sectors.iter().map(of).sum()
    }

    /// ln quasi-likelihood of the same means and variances (Wedderburn 1974, Biometrika 61:439). Its estimating equation
    /// is linear in the readings, so that a variance that grows with the model moves no estimate: many sensors would add
    /// up what one of them hardly shows.
    pub fn ln_quasi_likelihood(&self, sectors: &[Sector], area: f64, floor: f64) -> f64 {
        let of = |sector: &Sector| {
            let expected = area * self.at(sector);
            let (part, fixed) = (scatter_sq(sector).sqrt(), fixed_sq(sector, floor).sqrt());
            let ratio = part * expected / fixed;
            sector.mean_ppm_m_s / (part * fixed) * ratio.atan()
                - (ratio * ratio).ln_1p() / (2.0 * part * part)
        };
        sectors.iter().map(of).sum()
    }
}

fn scatter_sq(sector: &Sector) -> f64 {
    EDDY_SCATTER.powi(2) / sector.eddies as f64 + PROFILE_SCATTER.powi(2)
}

fn fixed_sq(sector: &Sector, floor: f64) -> f64 {
    sector.noise_ppm_m_s.powi(2) + floor * floor
}

/// Width of the crosswind profile beforehand, radians of wind direction.
fn width_rad(spec: &DispersionSpec, distance_m: f64, speed_m_s: f64) -> f64 {
    let spread =
        sigma_y_m(distance_m, spec.stability, spec.setting) * spec.sigma_y_scale / distance_m;
    spread.hypot(MEANDER_M_S / speed_m_s.max(MEANDER_M_S))
}

/// The area that the sectors span, ppm m²/s: the moment estimate.
pub(crate) fn moment(sectors: &[Sector], distance_m: f64) -> f64 {
    let of = |s: &Sector| s.mean_ppm_m_s.max(0.0) * SECTOR_DEG.to_radians() * distance_m;
    sectors.iter().map(of).sum()
}
