//! What a sensor at rest reads by wind direction.

use crate::clean_air::Excess;
use crate::stations::Reading;
use std::collections::BTreeSet;

/// Width of a direction sector, degrees, as in OTM 33A.
pub(crate) const SECTOR_DEG: f64 = 10.0;
/// Sectors to both sides of the direction of the source, degrees: a plume that is farther off is another's.
pub(crate) const REACH_DEG: f64 = 60.0;
/// Readings within this time meet the same eddies, s: near the ground their time scale is tens of seconds.
pub(crate) const EDDY_S: f64 = 60.0;
/// The plume is met where the highest sector exceeds the lowest by this many standard deviations of the sensor's noise.
const MET_SD: f64 = 5.0;

impl Reading {
    /// Number of the time of [`EDDY_S`] that it falls into.
    pub fn eddy(&self) -> i64 {
        (self.time_s / EDDY_S).floor() as i64
    }
}

/// Readings in one wind direction.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sector {
    /// Its middle, degrees clockwise from the direction that leads from the source to the sensor.
    pub off_deg: f64,
    /// Mean of excess times wind speed, ppm m/s.
    pub mean_ppm_m_s: f64,
    /// Standard deviation of that mean by the sensor's noise, ppm m/s.
    pub noise_ppm_m_s: f64,
    /// Number of readings.
    pub readings: usize,
    /// Number of eddies that the readings met.
    pub eddies: usize,
}

/// The sectors that hold at least `fewest` readings.
pub(crate) fn sectors(excess: &Excess, fewest: usize) -> Vec<Sector> {
    let count = (2.0 * REACH_DEG / SECTOR_DEG).round() as usize;
    let mut out = Vec::new();
    for k in 0..count {
        let low_deg = -REACH_DEG + k as f64 * SECTOR_DEG;
        let within: Vec<_> = excess
            .readings
            .iter()
            .filter(|r| (low_deg..low_deg + SECTOR_DEG).contains(&r.off_deg))
            .collect();
        if within.len() < fewest {
            continue;
        }
        let n = within.len() as f64;
        let eddies: BTreeSet<i64> = within.iter().map(|r| r.eddy()).collect();
        let speed_m_s = within.iter().map(|r| r.speed_m_s).sum::<f64>() / n;
        out.push(Sector {
            off_deg: low_deg + 0.5 * SECTOR_DEG,
            mean_ppm_m_s: within.iter().map(|r| r.ppm * r.speed_m_s).sum::<f64>() / n,
            noise_ppm_m_s: excess.noise_sd_ppm * speed_m_s / n.sqrt(),
            readings: within.len(),
            eddies: eddies.len(),
        });
    }
    out
}

/// Whether the readings depend on the direction of the wind by more than noise.
pub(crate) fn stands_out(sectors: &[Sector]) -> bool {
    let by_mean = |a: &&Sector, b: &&Sector| a.mean_ppm_m_s.total_cmp(&b.mean_ppm_m_s);
    let (lowest, highest) = (
        sectors.iter().min_by(by_mean),
        sectors.iter().max_by(by_mean),
    );
    let (Some(low), Some(high)) = (lowest, highest) else {
        return false;
    };
    let noise = low.noise_ppm_m_s.hypot(high.noise_ppm_m_s);
    high.mean_ppm_m_s > 0.0 && high.mean_ppm_m_s - low.mean_ppm_m_s > MET_SD * noise
}

/// Whether the readings are lowest while the wind blows from the source to the sensor, within so many degrees, and higher
/// on both sides by more than noise: no plume of this source does so.
pub(crate) fn dips(sectors: &[Sector], within_deg: f64) -> bool {
    let lowest = (0..sectors.len()).min_by(|a, b| {
        sectors[*a]
            .mean_ppm_m_s
            .total_cmp(&sectors[*b].mean_ppm_m_s)
    });
    let Some(k) = lowest.filter(|k| sectors[*k].off_deg.abs() <= within_deg) else {
        return false;
    };
    let higher = |s: &Sector| {
        let noise = s.noise_ppm_m_s.hypot(sectors[k].noise_ppm_m_s);
        s.mean_ppm_m_s - sectors[k].mean_ppm_m_s > MET_SD * noise
    };
    sectors[..k].iter().any(higher) && sectors[k + 1..].iter().any(higher)
}

/// The highest mean, ppm m/s; zero where none is positive.
pub(crate) fn highest(sectors: &[Sector]) -> f64 {
    sectors.iter().map(|s| s.mean_ppm_m_s).fold(0.0, f64::max)
}

/// Whether the highest sector is at the edge of the wind directions.
pub(crate) fn peaks_at_edge(sectors: &[Sector]) -> bool {
    let highest = sectors
        .iter()
        .enumerate()
        .max_by(|a, b| a.1.mean_ppm_m_s.total_cmp(&b.1.mean_ppm_m_s));
    highest.is_some_and(|(k, _)| k == 0 || k + 1 == sectors.len())
}

/// By how much of itself the area of the profile changes with the background, 1/ppm.
pub(crate) fn background_lever(sectors: &[Sector], speed_m_s: f64, floor: f64) -> f64 {
    let area: f64 = sectors.iter().map(|s| s.mean_ppm_m_s).sum();
    let in_plume = sectors
        .iter()
        .filter(|s| s.mean_ppm_m_s > floor * highest(sectors))
        .count();
    if area > 0.0 {
        in_plume as f64 * speed_m_s / area
    } else {
        0.0
    }
}
