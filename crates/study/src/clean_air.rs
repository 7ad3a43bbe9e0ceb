//! What a sensor at rest reads above clean air.

use crate::median;
use crate::sectors::REACH_DEG;
use crate::stations::{Reading, Station};
use std::collections::BTreeMap;

/// The lowest part of the readings is clean air, as in OTM 33A.
const CLEAN_PART: f64 = 0.05;
/// Its edges as they may be chosen otherwise. Of normal noise they, and the part itself, lie so many standard deviations
/// below the mean.
const CLEAN_EDGES: [f64; 2] = [0.02, 0.10];
const CLEAN_EDGES_BELOW_SD: [f64; 2] = [2.054, 1.282];
const CLEAN_PART_BELOW_SD: f64 = 1.645;
/// The lowest of all, into which a plume reaches least.
const LOWEST_PART: f64 = 0.01;
const LOWEST_BELOW_SD: f64 = 2.326;
/// Fewest readings of a sensor beside the plume by which its zero is known: its median is then known to a half of the
/// noise.
const FEWEST_ASIDE: usize = 10;
/// A sensor's noise is that of its readings. Of few digits they may scatter by nothing: then it is this part of what the
/// scenario states.
const LEAST_NOISE_PART: f64 = 0.01;
/// Standard deviation of normal noise per median absolute deviation.
const SD_PER_MAD: f64 = 1.4826;

/// Readings above clean air.
#[derive(Debug, Clone)]
pub(crate) struct Excess {
    /// The readings, of which `ppm` is the excess.
    pub readings: Vec<Reading>,
    /// Standard deviation of the clean level, ppm.
    pub background_sd_ppm: f64,
    /// Standard deviation of one reading in clean air, ppm.
    pub noise_sd_ppm: f64,
}

impl Excess {
    /// That of a single sensor: its lowest readings are clean air. `stated_sd_ppm` is the noise of the sensor.
    pub fn above_lowest(readings: &[Reading], stated_sd_ppm: f64) -> Self {
        let mut sorted: Vec<f64> = readings.iter().map(|r| r.ppm).collect();
        sorted.sort_by(f64::total_cmp);
        let [low, high] = CLEAN_EDGES.map(|part| quantile(&sorted, part));
        // The edges of normal noise; where a plume reaches into the clean part it is wider, and the lowest readings count.
        let edges_sd_ppm = (high - low) / (CLEAN_EDGES_BELOW_SD[0] - CLEAN_EDGES_BELOW_SD[1]);
        let clean_ppm = quantile(&sorted, CLEAN_PART);
        let lowest_sd_ppm =
            (clean_ppm - quantile(&sorted, LOWEST_PART)) / (LOWEST_BELOW_SD - CLEAN_PART_BELOW_SD);
        let level_ppm = clean_ppm + CLEAN_PART_BELOW_SD * edges_sd_ppm.min(lowest_sd_ppm);
        Self {
            readings: readings
                .iter()
                .map(|r| Reading {
                    ppm: r.ppm - level_ppm,
                    ..*r
                })
                .collect(),
            background_sd_ppm: 0.5 * (high - low),
            noise_sd_ppm: edges_sd_ppm.max(LEAST_NOISE_PART * stated_sd_ppm),
        }
    }
}

/// The excess at each station of a network. Each sensor has a zero of its own, the median of what it reads while the wind
/// blows past it; the stations beside the plume show how the background changes in time.
pub(crate) fn of_network(stations: &[Station], stated_sd_ppm: f64) -> Vec<Excess> {
    let zeros: Vec<Option<f64>> = stations
        .iter()
        .map(|s| median_of_enough(aside(s)))
        .collect();
    let drift = drift(stations, &zeros);
    let of = |(station, zero): (&Station, &Option<f64>)| {
        let Some(zero) = zero else {
            return Excess::above_lowest(&station.readings, stated_sd_ppm);
        };
        let readings: Vec<Reading> = station
            .readings
            .iter()
            .map(|r| Reading {
                ppm: r.ppm - zero - drift.get(&r.eddy()).copied().unwrap_or(0.0),
                ..*r
            })
            .collect();
        let off = readings
            .iter()
            .filter(|r| r.off_deg.abs() > REACH_DEG)
            .map(|r| r.ppm.abs());
        let noise_sd_ppm = median_of_enough(off.collect()).map_or(stated_sd_ppm, |mad| {
            (SD_PER_MAD * mad).max(LEAST_NOISE_PART * stated_sd_ppm)
        });
        Excess {
            readings,
            // Clean air differs from hour to hour by as much as it scatters.
            background_sd_ppm: noise_sd_ppm / (FEWEST_ASIDE as f64).sqrt(),
            noise_sd_ppm,
        }
    };
    stations.iter().zip(&zeros).map(of).collect()
}

/// What a station reads while the wind blows past it, ppm.
fn aside(station: &Station) -> Vec<f64> {
    let past = |r: &&Reading| r.off_deg.abs() > REACH_DEG;
    station
        .readings
        .iter()
        .filter(past)
        .map(|r| r.ppm)
        .collect()
}

/// How far the background is off its median in each block of time, ppm.
fn drift(stations: &[Station], zeros: &[Option<f64>]) -> BTreeMap<i64, f64> {
    let mut by_block: BTreeMap<i64, Vec<f64>> = BTreeMap::new();
    for (station, zero) in stations.iter().zip(zeros) {
        let Some(zero) = zero else { continue };
        let past = station
            .readings
            .iter()
            .filter(|r| r.off_deg.abs() > REACH_DEG);
        for r in past {
            by_block.entry(r.eddy()).or_default().push(r.ppm - zero);
        }
    }
    by_block
        .into_iter()
        // One station alone may meet gas of its own.
        .filter(|(_, off)| off.len() >= 2)
        .filter_map(|(block, off)| Some((block, median(off)?)))
        .collect()
}

/// The median of enough values.
fn median_of_enough(values: Vec<f64>) -> Option<f64> {
    Some(values)
        .filter(|v| v.len() >= FEWEST_ASIDE)
        .and_then(median)
}

/// The value below which `part` of sorted values lie.
fn quantile(sorted: &[f64], part: f64) -> f64 {
    sorted[((sorted.len() - 1) as f64 * part).round() as usize]
}
