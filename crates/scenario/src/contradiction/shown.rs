//! What the readings of a mission show without a fit: clean air, noise, wind, and where the plume was read.

use super::Known;
use air::geo::{Enu, Geodetic, wrap_signed_deg};
use air::wind::WindVector;
use std::collections::BTreeMap;

/// Readings on which a statement rests at least: a minute at 1 Hz.
pub(super) const LEAST_READINGS: u64 = 60;
/// Readings of the plume from which its place follows at least.
const LEAST_IN_PLUME: u64 = 10;
/// Part of the readings that has to lie above the stated background: the rest may be faults of the sensor.
const NEARLY_ALL: f64 = 0.99;
/// Part of the readings that has to lie below the stated background. Air is cleaner than the background nowhere, and a sensor
/// that fails for a while reads less than half of a mission's readings wrongly.
const MOST: f64 = 0.5;
/// Steps of ln in which differences of readings are counted.
const STEPS_PER_LN: f64 = 10.0;
/// The lower quartile of the absolute difference of two readings of clean air over their noise: .4506 (.3186 of a half-normal
/// variable, times the square root of two). Three quarters of the readings may be of the plume.
const QUARTILE_OF_DIFFERENCE: f64 = 0.4506;

/// A reading of a real vehicle.
#[derive(Debug, Clone, Copy)]
pub struct Read<'a> {
    /// Who read it.
    pub vehicle: &'a str,
    /// Mole fraction, ppm.
    pub ppm: f64,
    /// Where.
    pub at: Geodetic,
    /// Height there, m above mean sea level.
    pub alt_amsl_m: f64,
    /// Wind there: speed in m/s, and the direction from which it blows in degrees.
    pub wind: Option<(f64, f64)>,
}

/// Sums over readings, in bounded memory.
#[derive(Debug, Clone, Default)]
pub(super) struct Shown {
    readings: u64,
    above: u64,
    below: u64,
    /// Lowest reading above the stated background and highest below it, ppm.
    lowest_ppm: f64,
    highest_ppm: f64,
    /// Sums of the excess of readings that stand out, ppm, and of their places weighted by it.
    excess_ppm: f64,
    place_ppm: [f64; 3],
    winds: u64,
    wind: (f64, f64),
    /// Last reading of each vehicle, and how often the next differed by so much, ppm in steps of its logarithm.
    last_ppm: BTreeMap<String, f64>,
    differences: BTreeMap<i32, u64>,
}

impl Shown {
    /// Takes a reading at `place`; clean air reads within `clean` by the scenario.
    pub fn read(&mut self, read: &Read<'_>, place: (Enu, f64), clean: Known) {
        if read.ppm.is_finite() {
            self.readings += 1;
            let excess_ppm = read.ppm - clean.value;
            if excess_ppm > clean.sd {
                self.lowest_ppm = match self.above {
                    0 => read.ppm,
                    _ => self.lowest_ppm.min(read.ppm),
                };
                self.above += 1;
                self.excess_ppm += excess_ppm;
                let (at, height_agl_m) = place;
                for (sum, part) in
                    self.place_ppm
                        .iter_mut()
                        .zip([at.east_m, at.north_m, height_agl_m])
                {
                    *sum += part * excess_ppm;
                }
            } else if excess_ppm < -clean.sd {
                self.highest_ppm = match self.below {
                    0 => read.ppm,
                    _ => self.highest_ppm.max(read.ppm),
                };
                self.below += 1;
            }
            self.differ(read);
        }
    }

    /// Takes a wind, carried to the height of the scenario's.
    pub fn blow(&mut self, wind: WindVector) {
        self.winds += 1;
        self.wind.0 += wind.east_m_s;
        self.wind.1 += wind.north_m_s;
    }

    fn differ(&mut self, read: &Read<'_>) {
        let last = match self.last_ppm.get_mut(read.vehicle) {
            Some(last) => std::mem::replace(last, read.ppm),
            None => {
                self.last_ppm.insert(read.vehicle.to_owned(), read.ppm);
                return;
            }
        };
        let difference_ppm = (read.ppm - last).abs();
        // A value that is repeated is often the same reading.
        if difference_ppm > 0.0 {
            let step = (STEPS_PER_LN * difference_ppm.ln()).round() as i32;
            *self.differences.entry(step).or_default() += 1;
        }
    }

    /// The background that readings show by themselves, ppm, where it is not the stated one.
    pub fn background_ppm(&self) -> Option<f64> {
        let part = |count: u64| count as f64 / self.readings as f64;
        match () {
            () if self.readings < LEAST_READINGS => None,
            () if part(self.above) > NEARLY_ALL => Some(self.lowest_ppm),
            () if part(self.below) > MOST => Some(self.highest_ppm),
            () => None,
        }
    }

    /// White noise of the readings, one standard deviation, ppm.
    pub fn noise_ppm(&self) -> Option<f64> {
        let count: u64 = self.differences.values().sum();
        let mut left = (count >= LEAST_READINGS).then_some(count / 4)?;
        let quartile = self.differences.iter().find(|(_, n)| {
            let is_there = left < **n;
            left = left.saturating_sub(**n);
            is_there
        })?;
        Some((f64::from(*quartile.0) / STEPS_PER_LN).exp() / QUARTILE_OF_DIFFERENCE)
    }

    /// The mean of the winds.
    pub fn wind(&self) -> Option<WindVector> {
        let n = self.winds as f64;
        (self.winds >= LEAST_READINGS).then(|| WindVector {
            east_m_s: self.wind.0 / n,
            north_m_s: self.wind.1 / n,
        })
    }

    /// Where the plume was read in the mean, with the height above ground, m.
    pub fn plume(&self) -> Option<(Enu, f64)> {
        let is_shown = self.above >= LEAST_IN_PLUME && self.background_ppm().is_none();
        let [east_m, north_m, height_m] = self.place_ppm.map(|sum| sum / self.excess_ppm);
        is_shown.then(|| (Enu::new(east_m, north_m), height_m))
    }
}

/// Where a source has to be, if its plume is read at `plume` and `wind` carried it, as near to `source` as possible, and how
/// far the direction to the plume is off the wind, degrees.
pub(super) fn upwind(source: Enu, plume: Enu, wind: WindVector) -> (Enu, f64) {
    let (to, from_deg) = (source.bearing_deg(plume), wind.from_deg());
    let off_deg = wrap_signed_deg(to - from_deg - 180.0);
    let away_m = source.distance_m(plume) * off_deg.to_radians().cos().max(0.0);
    (plume.displaced(from_deg, away_m), off_deg.abs())
}
