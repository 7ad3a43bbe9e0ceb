//! Readings in another unit, that stand still, that stop at a limit, or that are missing.

use formats::number::significant;
use plume::{DispersionSpec, Unit};

use super::super::Observations;
use super::values::BELOW_ZERO_SD;
use super::{Ceiling, Flaw, OfPlatform, middle};

/// A reading this many times too large or too small is in another unit.
const UNIT_FACTOR: f64 = 20.0;
/// A run of equal readings is frozen when chance makes one this rarely.
const FROZEN_CHANCE: f64 = 1e-5;
/// Longest run of equal readings that a coarse resolution makes usual.
const LONGEST_USUAL_RUN: usize = 20;
/// Part of readings beyond which repeating the one before is taken for no more usual.
const MOST_REPEATS: f64 = 0.98;
/// A noise below this part of a grid's step is not seen on it.
const UNSEEN_PART: f64 = 0.25;
/// Shortest run of equal readings that counts.
const FROZEN_ROWS: usize = 8;
/// Fewest readings at the highest value, and in so many visits, that make it a limit: two tell it
/// from a sensor that stands still.
const HELD_ROWS: usize = 6;
const FEWEST_VISITS: usize = 2;
/// Fewest levels below a ceiling that holds many readings, and what part of them is many.
const LEAST_LEVELS: usize = 6;
const HELD_PART: f64 = 0.25;
/// So many usual steps without a reading, and at least so many seconds, are a gap.
const GAP_STEPS: f64 = 8.0;
const SHORTEST_GAP_S: f64 = 5.0;

impl OfPlatform<'_> {
    /// Leaves out and says readings that tell nothing; `raw` is what was there before any check.
    pub(super) fn readings(&mut self, base: &DispersionSpec, raw: &Observations) {
        self.units(base, raw);
        // A ceiling is met again and again; what stands still does so once, wherever it is.
        let ceiling = self.clipped(FEWEST_VISITS, raw);
        self.frozen(base.sensor.noise_sd_ppm, raw);
        if !ceiling {
            self.clipped(1, raw);
        }
        self.gaps(raw);
    }

    fn units(&mut self, base: &DispersionSpec, raw: &Observations) {
        let background_ppm = base.background_ppm;
        // A background that noise hides says nothing of the unit.
        if background_ppm <= BELOW_ZERO_SD * base.sensor.noise_sd_ppm {
            return;
        }
        let (rows, mut readings) = self.read();
        // The lower quartile is clean air or nearly so.
        let Some(low) = super::quantile(&mut readings, 0.25) else {
            return;
        };
        let ratio = low / background_ppm;
        if (1.0 / UNIT_FACTOR..=UNIT_FACTOR).contains(&ratio) {
            return;
        }
        let message = format!(
            "readings of about {} against a background of {}, {} times as much; check the unit of {} \
             ({}%, fraction?)",
            significant(raw.unit.of_ppm(low)),
            raw.said(background_ppm),
            significant(ratio),
            raw.gas.column(raw.unit),
            if raw.unit == Unit::Ppm {
                "ppb, "
            } else {
                "ppm, "
            }
        );
        self.say(Flaw::Unit, &rows, message);
        self.drop_readings(&rows);
    }

    /// Runs of equal readings too long for the readings' resolution, which the longest of them blur: it is asked again
    /// without these.
    fn frozen(&mut self, stated_sd_ppm: f64, raw: &Observations) {
        while self.longest_frozen(stated_sd_ppm, raw) {}
    }

    /// Whether there were any.
    fn longest_frozen(&mut self, stated_sd_ppm: f64, raw: &Observations) -> bool {
        let (rows, readings) = self.read();
        let mut runs: Vec<(usize, usize)> = Vec::new();
        for run in readings.chunk_by(|a, b| a == b) {
            let start = runs.last().map_or(0, |(start, length)| start + length);
            runs.push((start, run.len()));
        }
        let noisy = stated_sd_ppm > 0.0;
        let steps = readings.windows(2).map(|w| (w[1] - w[0]).abs());
        let grid = steps.filter(|s| *s > 0.0).fold(f64::INFINITY, f64::min);
        let by_chance = |part: f64| longest_by_chance(part, readings.len());
        let usual = if noisy && grid.is_finite() && stated_sd_ppm < UNSEEN_PART * grid {
            by_chance(MOST_REPEATS)
        } else {
            by_chance(repeat_part(&runs, noisy))
        };
        let long = |length: usize| {
            length >= usual
                && length >= by_chance(quiet_repeat_part(&runs, &readings, length, grid))
        };
        let floor = detection_floor(&runs, &readings);
        let stuck = |r: &(usize, usize)| floor != Some(readings[r.0]) && long(r.1);
        let frozen: Vec<(usize, usize)> = runs.iter().copied().filter(stuck).collect();
        for &(start, length) in &frozen {
            let value = readings[start];
            let run = &rows[start..start + length];
            let message = format!("{length} readings in a row of {}", raw.said(value));
            self.say(Flaw::Frozen, run, message);
            // The first of them was still measured.
            self.drop_readings(&run[1..]);
        }
        !frozen.is_empty()
    }

    /// Many readings at the very top of the range, in at least so many visits. Whether it is so.
    fn clipped(&mut self, least_visits: usize, raw: &Observations) -> bool {
        let (rows, readings) = self.read();
        let Some(top) = limit(&readings, least_visits) else {
            return false;
        };
        let held = rows.iter().zip(&readings).filter(|r| *r.1 == top);
        let held: Vec<usize> = held.map(|r| *r.0).collect();
        let message = format!(
            "{} readings at exactly {}, the highest of all",
            held.len(),
            raw.said(top)
        );
        self.log.ceilings.push(Ceiling {
            platform: self.platform,
            limit_ppm: top,
            held_s: held.iter().map(|i| self.log.rows[*i].time_s).collect(),
        });
        self.say(Flaw::Clipped, &held, message);
        self.drop_readings(&held);
        true
    }

    /// Long times without a reading. Those that were left out were there.
    fn gaps(&mut self, raw: &Observations) {
        let there = |i: &usize| raw.rows[*i].co2_ppm.is_some();
        let present: Vec<usize> = self.at.iter().copied().filter(there).collect();
        let step_s = |w: &[usize]| raw.rows[w[1]].time_s - raw.rows[w[0]].time_s;
        let mut steps_s: Vec<f64> = present.windows(2).map(step_s).collect();
        let Some(usual_s) = middle(&mut steps_s) else {
            return;
        };
        let long_s = (GAP_STEPS * usual_s).max(SHORTEST_GAP_S);
        for pair in present.windows(2).filter(|w| step_s(w) > long_s) {
            self.say(
                Flaw::Gap,
                pair,
                format!("no reading for {:.0} s", step_s(pair)),
            );
        }
    }
}

/// The lowest reading, if readings rest there again and again: what a sensor says below its limit of
/// detection.
fn detection_floor(runs: &[(usize, usize)], readings: &[f64]) -> Option<f64> {
    let lowest = readings.iter().copied().min_by(f64::total_cmp)?;
    let rests = |r: &&(usize, usize)| readings[r.0] == lowest && r.1 >= FROZEN_ROWS;
    (runs.iter().filter(rests).count() >= FEWEST_VISITS).then_some(lowest)
}

/// The shortest run of equal readings that chance does not make where such a part of them repeats the one
/// before.
fn longest_by_chance(repeat: f64, readings: usize) -> usize {
    let limit = (FROZEN_CHANCE / readings.max(1) as f64).ln() / repeat.ln();
    (limit.ceil() as usize).max(FROZEN_ROWS)
}

/// The part of readings that repeat the one before, by the `runs` (start and length) of equal ones that are
/// not themselves suspect. A `noisy` sensor does not repeat itself for long.
fn repeat_part(runs: &[(usize, usize)], noisy: bool) -> f64 {
    let mut lengths: Vec<usize> = runs.iter().map(|r| r.1).collect();
    lengths.sort_unstable();
    let most = lengths.get(lengths.len() * 9 / 10).copied().unwrap_or(1);
    let typical = most.max(2);
    let typical = if noisy {
        typical.min(LONGEST_USUAL_RUN)
    } else {
        typical
    };
    let short = runs.iter().filter(|r| r.1 <= 4 * typical);
    let (repeats, pairs) = short.fold((1.0, 3.0), |s: (f64, f64), r| {
        (s.0 + (r.1 - 1) as f64, s.1 + r.1 as f64)
    });
    part(repeats, pairs)
}

/// The part of readings that repeat the one before among those that differ from it by one step of their
/// grid at most, by runs shorter than three quarters of `length`: in quiet air a sensor whose noise is below
/// its grid repeats itself more than in a plume.
fn quiet_repeat_part(runs: &[(usize, usize)], readings: &[f64], length: usize, grid: f64) -> f64 {
    let short = |r: &&(usize, usize)| 4 * r.1 <= 3 * length;
    let (mut repeats, mut pairs) = (1.0, 3.0);
    for &(start, length) in runs.iter().filter(short) {
        let to_next = readings
            .get(start + length)
            .map(|next| (next - readings[start]).abs());
        repeats += (length - 1) as f64;
        pairs += (length - 1) as f64 + f64::from(u8::from(to_next.is_some_and(|s| s < 1.5 * grid)));
    }
    part(repeats, pairs)
}

fn part(repeats: f64, pairs: f64) -> f64 {
    (repeats / pairs).min(MOST_REPEATS)
}

/// The highest reading, if it is a limit that readings stop at.
fn limit(readings: &[f64], least_visits: usize) -> Option<f64> {
    let mut sorted = readings.to_vec();
    let middle = middle(&mut sorted)?;
    let top = sorted[sorted.len() - 1];
    let at_top = sorted.iter().rev().take_while(|v| **v == top).count();
    let below = &sorted[..sorted.len() - at_top];
    let near = top - 0.05 * (top - middle);
    let step = top - below.last().copied().unwrap_or(top);
    // Readings on a coarse grid share values: the top must hold far more than what lies
    // just below it.
    let least = near.min(top - 3.0 * step);
    let neighbours = below.iter().rev().take_while(|v| **v >= least).count();
    let mut levels = below.to_vec();
    levels.dedup();
    // Where many readings are held, what is left below must still vary as a noise does.
    let wide = if HELD_PART * sorted.len() as f64 <= at_top as f64 {
        levels.len() >= LEAST_LEVELS
    } else {
        top - middle > 4.0 * spread(&sorted[..sorted.len() / 2])
    };
    let held: Vec<bool> = readings.iter().map(|c| *c == top).collect();
    let visits = held.chunk_by(|a, b| a == b).filter(|run| run[0]).count();
    let is = at_top >= HELD_ROWS && at_top >= 2 * neighbours && wide && visits >= least_visits;
    is.then_some(top)
}

fn spread(sorted: &[f64]) -> f64 {
    match (sorted.first(), sorted.last()) {
        (Some(a), Some(b)) => (b - a) / 4.0,
        _ => 0.0,
    }
}
