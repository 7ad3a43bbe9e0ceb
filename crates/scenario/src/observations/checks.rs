//! What raw logs show before any model is fitted: values that cannot be and codes for none, places
//! where nothing was, readings that stand still or stop at a limit, units that look wrong.
//!
//! Who infers something from [`Observations`] does so from those that [`check`] gives, in which
//! what is flawed is missing: a value without its cell, a place without its row. No tolerance is in
//! ppm; all follow the readings' own spread, the scenario's background and its sensor's noise.

use air::geo::LocalFrame;
use plume::DispersionSpec;

use super::{DataQuality, ExtraColumn, Flaw, ObservationRow, Observations};

mod places;
mod range;
mod readings;
mod values;
mod wind;

/// A limit that readings of a platform stopped at. They are left out.
#[derive(Debug, Clone, PartialEq)]
pub struct Ceiling {
    /// Index into [`Observations::platforms`].
    pub platform: usize,
    /// The limit, ppm.
    pub limit_ppm: f64,
    /// Times of the readings held there, s.
    pub held_s: Vec<f64>,
}

/// Observations after all checks.
#[derive(Debug, Clone, PartialEq)]
pub struct Checked {
    /// What is left: nothing that a check found flawed.
    pub observations: Observations,
    /// What was found, platform by platform.
    pub flaws: Vec<DataQuality>,
    /// Limits of sensors.
    pub ceilings: Vec<Ceiling>,
}

/// Checks raw observations against themselves and against the world of a scenario: its `base` in
/// its local `frame`.
pub fn check(observations: &Observations, base: &DispersionSpec, frame: &LocalFrame) -> Checked {
    let mut log = Log {
        rows: observations.rows.clone(),
        kept: vec![true; observations.rows.len()],
        flaws: Vec::new(),
        ceilings: Vec::new(),
    };
    let mut platforms = vec![Vec::new(); observations.platforms.len()];
    for (i, row) in observations.rows.iter().enumerate() {
        if let Some(at) = platforms.get_mut(row.platform) {
            at.push(i);
        }
    }
    for (platform, mut at) in platforms.into_iter().enumerate() {
        at.sort_by(|a, b| log.rows[*a].time_s.total_cmp(&log.rows[*b].time_s));
        let mut own = OfPlatform {
            log: &mut log,
            name: &observations.platforms[platform],
            platform,
            at,
        };
        own.values(base, observations);
        own.places(base, frame);
        own.readings(base, observations);
    }
    let observations = log.left_of(observations);
    let mut flaws = log.flaws;
    flaws.extend(wind::blows_the_other_way(&observations, base, frame));
    Checked {
        observations,
        flaws,
        ceilings: log.ceilings,
    }
}

/// Observations being checked.
struct Log {
    rows: Vec<ObservationRow>,
    /// Rows that are left.
    kept: Vec<bool>,
    flaws: Vec<DataQuality>,
    ceilings: Vec<Ceiling>,
}

impl Log {
    /// The rows that are left, with the cells that are left.
    fn left_of(&self, observations: &Observations) -> Observations {
        let left = |i: &usize| self.kept[*i];
        let extra = observations.extra.iter().map(|column| ExtraColumn {
            name: column.name.clone(),
            cells: (0..column.cells.len())
                .filter(|i| self.kept.get(*i).is_none_or(|kept| *kept))
                .map(|i| column.cells[i].clone())
                .collect(),
        });
        Observations {
            gas: observations.gas,
            unit: observations.unit,
            rows: (0..self.rows.len())
                .filter(left)
                .map(|i| self.rows[i])
                .collect(),
            platforms: observations.platforms.clone(),
            notices: observations.notices.clone(),
            extra: extra.collect(),
        }
    }
}

/// The rows of one platform.
struct OfPlatform<'a> {
    log: &'a mut Log,
    name: &'a str,
    platform: usize,
    /// Its rows that are left, in order of time.
    at: Vec<usize>,
}

impl OfPlatform<'_> {
    /// Says a flaw from the first to the last of `rows`; nothing where there are none.
    fn say(&mut self, kind: Flaw, rows: &[usize], message: String) {
        let (Some(&first), Some(&last)) = (rows.first(), rows.last()) else {
            return;
        };
        self.log.flaws.push(DataQuality {
            platform: self.name.to_owned(),
            kind,
            from_s: self.log.rows[first].time_s,
            to_s: self.log.rows[last].time_s,
            message,
        });
    }

    /// Leaves out whole rows: nobody knows where they were.
    fn drop_rows(&mut self, rows: &[usize]) {
        for i in rows {
            self.log.kept[*i] = false;
        }
        let kept = &self.log.kept;
        self.at.retain(|i| kept[*i]);
    }

    /// Leaves out the readings of rows; wind and air there still count.
    fn drop_readings(&mut self, rows: &[usize]) {
        for i in rows {
            self.log.rows[*i].co2_ppm = None;
        }
    }

    /// Rows that have a reading, and the readings, ppm.
    fn read(&self) -> (Vec<usize>, Vec<f64>) {
        let read = |i: &usize| self.log.rows[*i].co2_ppm.map(|c| (*i, c));
        self.at.iter().filter_map(read).unzip()
    }
}

/// The value that a `part` of `values` does not exceed; sorts them.
fn quantile(values: &mut [f64], part: f64) -> Option<f64> {
    values.sort_by(f64::total_cmp);
    let last = values.len().checked_sub(1)?;
    let at = (part * values.len() as f64) as usize;
    values.get(at.min(last)).copied()
}

/// The middle one of `values`; sorts them.
fn middle(values: &mut [f64]) -> Option<f64> {
    quantile(values, 0.5)
}

#[cfg(test)]
mod tests;
