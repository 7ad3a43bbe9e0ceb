//! The gate: what raw data show before any model is fitted. Stretches with a flaw are masked.

use std::ops::Range;

use ::plume::field::DispersionSpec;

use super::data::{Data, Setup};
use crate::verdict::{DataQuality, Flaw};

/// Rows farther than this from the first source cannot belong to the scenario, m.
const FARTHEST_M: f64 = 40_000.0;
/// An aircraft whose rows lie this far below the site's ground in the middle logs another height, m.
const UNDERGROUND_M: f64 = 50.0;
/// Speeds over ground that none has, in the middle of its track, m/s; the slow one counts where the
/// track is long, m: what stands may stand.
const TOO_FAST_M_S: f64 = 340.0;
const TOO_SLOW_M_S: f64 = 0.3;
const LONG_TRACK_M: f64 = 1000.0;
/// A reading this many times too large or too small is in another unit.
const UNIT_FACTOR: f64 = 20.0;
/// A value that comes back this often, and is so many times farther from the middle than all other
/// readings, is a code for no reading.
const CODE_TIMES: usize = 3;
const CODE_FAR: f64 = 4.0;
/// A run of equal readings is frozen when chance makes one this rarely.
const FROZEN_CHANCE: f64 = 1e-5;
/// Longest run of equal readings that a coarse resolution makes usual.
const LONGEST_USUAL_RUN: usize = 20;
/// How many time constants a sensor remembers the air before a track: e⁻⁵ of it is left.
const REMEMBERED: f64 = 5.0;
/// Longest step between rows over which the air is known well enough, s, and over how many usual
/// steps of a record it is, whose sensor then met about as much in between.
const LONGEST_STEP_S: f64 = 4.0;
const USUAL_STEPS: f64 = 1.5;
/// Part of the readings beyond which it is said that they are left out for that.
const MANY_PART: f64 = 0.2;
/// Fewest levels below a ceiling that holds many readings, and what part of them is many.
const LEAST_LEVELS: usize = 6;
const HELD_PART: f64 = 0.25;
/// Fewest visits to a ceiling that tell it from a sensor that stands still.
const FEWEST_VISITS: usize = 2;
/// Shortest run of equal readings that counts.
const FROZEN_ROWS: usize = 8;

/// Looks at every platform, masks what is flawed, and says what it saw.
pub(crate) fn gate(data: &mut Data, setup: &Setup) -> Vec<DataQuality> {
    let base = &setup.base;
    let found = on_every_platform(data, |eye| {
        eye.places(base);
        eye.heights();
        eye.speeds();
        eye.codes();
        eye.units(base);
        // A ceiling is met again and again; what stands still does so once, wherever it is.
        let ceiling = eye.clipped(FEWEST_VISITS);
        eye.frozen(base.sensor.noise_sd_ppm > 0.0);
        if !ceiling {
            eye.clipped(1);
        }
        eye.gaps();
    });
    forget_unknown_air(data, setup.time_constant_s());
    found
}

/// Masks all rows of all platforms, and says why of each.
pub(super) fn mask_all(data: &mut Data, message: &str) -> Vec<DataQuality> {
    on_every_platform(data, |eye| eye.mask_all(message.to_owned()))
}

fn on_every_platform(data: &mut Data, look: impl Fn(&mut Eye<'_>)) -> Vec<DataQuality> {
    let mut found = Vec::new();
    for platform in 0..data.ranges().len() {
        let range = data.ranges()[platform].clone();
        if range.is_empty() {
            continue;
        }
        let name = data.track.platforms()[platform].clone();
        look(&mut Eye {
            data,
            name,
            range,
            found: &mut found,
        });
    }
    found
}

/// Leaves out the readings in which a slow sensor still remembers air of which nothing is known:
/// at the start of a track and after a gap.
fn forget_unknown_air(data: &mut Data, time_constant_s: f64) {
    let wait_s = REMEMBERED * time_constant_s;
    if wait_s <= 0.0 {
        return;
    }
    let times = data.track.time_s().to_vec();
    let before = data.used_count();
    for range in data.ranges().to_vec() {
        let usual_s = usual_step(&times[range.clone()]).unwrap_or(0.0);
        let longest_s = LONGEST_STEP_S.max(USUAL_STEPS * usual_s);
        let mut since = f64::NEG_INFINITY;
        let mut before = f64::NEG_INFINITY;
        for i in range {
            if times[i] - before > longest_s {
                since = times[i];
            }
            before = times[i];
            if times[i] - since < wait_s {
                data.used[i] = false;
            }
        }
    }
    let left_out = before - data.used_count();
    if left_out as f64 > MANY_PART * before as f64 {
        data.notices.push(format!(
            "{left_out} of {before} readings are left out: for {wait_s:.0} s after the start of a \
             track or a gap a sensor with a time constant of {time_constant_s} s shows air that \
             nobody knows"
        ));
    }
}

/// The step that half of the steps between `times` do not exceed.
fn usual_step(times: &[f64]) -> Option<f64> {
    let mut steps: Vec<f64> = times.windows(2).map(|w| w[1] - w[0]).collect();
    middle(&mut steps)
}

struct Eye<'a> {
    data: &'a mut Data,
    name: String,
    range: Range<usize>,
    found: &'a mut Vec<DataQuality>,
}

impl Eye<'_> {
    fn used(&self) -> Vec<usize> {
        self.range.clone().filter(|i| self.data.used[*i]).collect()
    }

    fn say(&mut self, kind: Flaw, first: usize, last: usize, message: String) {
        let times = self.data.track.time_s();
        self.found.push(DataQuality {
            platform: self.name.clone(),
            kind,
            from_s: times[first],
            to_s: times[last],
            message,
        });
    }

    fn places(&mut self, base: &DispersionSpec) {
        let source = base.sources[0].place;
        let far: Vec<usize> = self
            .range
            .clone()
            .filter(|i| {
                let p = self.data.track.place(*i);
                let away = (p.east_m - source.east_m).hypot(p.north_m - source.north_m);
                away > FARTHEST_M || !(-500.0..=20_000.0).contains(&p.height_agl_m)
            })
            .collect();
        let (Some(&first), Some(&last)) = (far.first(), far.last()) else {
            return;
        };
        for i in &far {
            self.data.used[*i] = false;
        }
        let message = format!(
            "{} rows lie over {:.0} km from the source (or far from its height): are lat_deg and \
             lon_deg swapped, or is this another site?",
            far.len(),
            FARTHEST_M / 1000.0
        );
        self.say(Flaw::Unit, first, last, message);
    }

    /// Masks all rows and says why.
    fn mask_all(&mut self, message: String) {
        let (first, last) = (self.range.start, self.range.end - 1);
        self.data.used[self.range.clone()].fill(false);
        self.say(Flaw::Unit, first, last, message);
    }

    /// Heights below the ground.
    fn heights(&mut self) {
        let track = &self.data.track;
        let rows = self.range.clone();
        let mut heights: Vec<f64> = rows.map(|i| track.place(i).height_agl_m).collect();
        let height_m = middle(&mut heights).unwrap_or(0.0);
        if height_m < -UNDERGROUND_M {
            self.mask_all(format!(
                "half of the rows lie {:.0} m and more below the site's ground: is alt_amsl_m in \
                 another unit (km?), or a height above ground?",
                -height_m
            ));
        }
    }

    /// Times in which nothing flies so fast or so slowly.
    fn speeds(&mut self) {
        let track = &self.data.track;
        let times = track.time_s();
        let (mut speeds, mut length_m) = (Vec::new(), 0.0);
        for i in self.range.clone().skip(1) {
            let (a, b) = (track.place(i - 1), track.place(i));
            let way_m = (b.east_m - a.east_m).hypot(b.north_m - a.north_m);
            length_m += way_m;
            speeds.push(way_m / (times[i] - times[i - 1]));
        }
        let speed_m_s = middle(&mut speeds);
        let wrong = match speed_m_s {
            Some(v) if v > TOO_FAST_M_S => "(minutes or hours?)",
            Some(v) if v < TOO_SLOW_M_S && length_m > LONG_TRACK_M => "(ms or ns?)",
            _ => return,
        };
        self.mask_all(format!(
            "the track goes at {:.3} m/s in the middle: is time_s in another unit {wrong}",
            speed_m_s.unwrap_or_default()
        ));
    }

    /// Values such as 65535 or -9999 that stand for no reading.
    fn codes(&mut self) {
        let used = self.used();
        let y = &self.data.reading_ppm;
        let mut sorted: Vec<f64> = used.iter().map(|i| y[*i]).collect();
        sorted.sort_by(f64::total_cmp);
        let (Some(&low), Some(&high)) = (sorted.first(), sorted.last()) else {
            return;
        };
        let centre = sorted[sorted.len() / 2];
        for code in [low, high] {
            let others = sorted.iter().filter(|v| **v != code);
            let farthest = others.fold(0.0f64, |far, v| far.max((v - centre).abs()));
            let at: Vec<usize> = used
                .iter()
                .copied()
                .filter(|i| self.data.reading_ppm[*i] == code)
                .collect();
            let far = (code - centre).abs() > CODE_FAR * farthest.max(centre.abs());
            if at.len() < CODE_TIMES || !far {
                continue;
            }
            for i in &at {
                self.data.used[*i] = false;
            }
            let message = format!("{} readings of {code}, a code for none", at.len());
            self.say(Flaw::Outlier, at[0], at[at.len() - 1], message);
        }
    }

    fn units(&mut self, base: &DispersionSpec) {
        let used = self.used();
        let mut values: Vec<f64> = used.iter().map(|i| self.data.reading_ppm[*i]).collect();
        values.sort_by(f64::total_cmp);
        // The lower quartile is clean air or nearly so.
        let Some(low) = values.get(values.len() / 4) else {
            return;
        };
        let (Some(&first), Some(&last)) = (used.first(), used.last()) else {
            return;
        };
        let ratio = low / base.background_ppm;
        if base.background_ppm > 0.0 && !(1.0 / UNIT_FACTOR..=UNIT_FACTOR).contains(&ratio) {
            for i in used {
                self.data.used[i] = false;
            }
            let message = format!(
                "readings of about {low:.4} against a background of {:.0} ppm, {ratio:.3} times as \
                 much: is co2_ppm in another unit (ppb, %, fraction)?",
                base.background_ppm
            );
            self.say(Flaw::Unit, first, last, message);
        }
    }

    /// Runs of equal readings too long for the readings' resolution.
    fn frozen(&mut self, noisy: bool) {
        let used = self.used();
        let y = &self.data.reading_ppm;
        let mut runs: Vec<(usize, usize)> = Vec::new();
        let mut start = 0;
        for k in 1..=used.len() {
            if k == used.len() || y[used[k]] != y[used[start]] {
                runs.push((start, k - start));
                start = k;
            }
        }
        // Chance of a repeat, from runs that are not themselves suspect.
        let mut lengths: Vec<usize> = runs.iter().map(|r| r.1).collect();
        lengths.sort_unstable();
        let typical = lengths
            .get(lengths.len() * 9 / 10)
            .copied()
            .unwrap_or(1)
            .max(2);
        // A sensor that is stated to be noisy does not repeat itself for long.
        let typical = if noisy {
            typical.min(LONGEST_USUAL_RUN)
        } else {
            typical
        };
        let short = runs.iter().filter(|r| r.1 <= 4 * typical);
        let (repeats, pairs) = short.fold((1.0, 3.0), |s: (f64, f64), r| {
            (s.0 + (r.1 - 1) as f64, s.1 + r.1 as f64)
        });
        let repeat = (repeats / pairs).min(0.98);
        let limit = (FROZEN_CHANCE / used.len().max(1) as f64).ln() / repeat.ln();
        let limit = (limit.ceil() as usize).max(FROZEN_ROWS);
        for (start, length) in runs {
            if length < limit {
                continue;
            }
            let (first, last) = (used[start], used[start + length - 1]);
            // The first of them was still measured.
            for i in &used[start + 1..start + length] {
                self.data.used[*i] = false;
            }
            let value = self.data.reading_ppm[first];
            self.say(
                Flaw::Frozen,
                first,
                last,
                format!("{length} readings in a row of {value} ppm"),
            );
        }
    }

    /// Many readings at the very top of the range, in at least so many visits. Whether it is so.
    fn clipped(&mut self, least_visits: usize) -> bool {
        let used = self.used();
        let y = &self.data.reading_ppm;
        let mut sorted: Vec<f64> = used.iter().map(|i| y[*i]).collect();
        sorted.sort_by(f64::total_cmp);
        let (Some(&top), Some(&middle)) = (sorted.last(), sorted.get(sorted.len() / 2)) else {
            return false;
        };
        let at_top = sorted.iter().rev().take_while(|v| **v == top).count();
        let below = &sorted[..sorted.len() - at_top];
        let near = top - 0.05 * (top - middle);
        let next = below.last().copied().unwrap_or(top);
        let step = top - next;
        // Readings on a coarse grid share values: the top must hold far more than what lies
        // just below it.
        let neighbours = below
            .iter()
            .rev()
            .take_while(|v| **v >= near.min(top - 3.0 * step))
            .count();
        let mut levels = below.to_vec();
        levels.dedup();
        // Where many readings are held, what is left below must still vary as a noise does.
        let wide = if HELD_PART * sorted.len() as f64 <= at_top as f64 {
            levels.len() >= LEAST_LEVELS
        } else {
            top - middle > 4.0 * spread(&sorted[..sorted.len() / 2])
        };
        let held: Vec<bool> = used.iter().map(|i| y[*i] == top).collect();
        let visits = held.chunk_by(|a, b| a == b).filter(|run| run[0]).count();
        if at_top < 6 || at_top < 2 * neighbours || !wide || visits < least_visits {
            return false;
        }
        let hits: Vec<usize> = used.into_iter().filter(|i| y[*i] == top).collect();
        for i in &hits {
            self.data.used[*i] = false;
        }
        let message = format!("{at_top} readings at exactly {top} ppm, the highest of all");
        self.data.ceiling_ppm.push((self.range.clone(), top));
        self.say(Flaw::Clipped, hits[0], hits[hits.len() - 1], message);
        true
    }

    fn gaps(&mut self) {
        let times = self.data.track.time_s();
        let present: Vec<usize> = self
            .range
            .clone()
            .filter(|i| self.data.reading_ppm[*i].is_finite())
            .collect();
        let present_s: Vec<f64> = present.iter().map(|i| times[*i]).collect();
        let Some(usual) = usual_step(&present_s) else {
            return;
        };
        let long: Vec<(usize, usize, f64)> = present
            .windows(2)
            .map(|w| (w[0], w[1], times[w[1]] - times[w[0]]))
            .filter(|g| g.2 > (8.0 * usual).max(5.0))
            .collect();
        for (a, b, length) in long {
            self.say(Flaw::Gap, a, b, format!("no reading for {length:.0} s"));
        }
    }
}

/// Single readings far from both neighbours among `rows`, whose noise the fit found to be no normal one.
pub(crate) fn spikes(data: &Data, rows: &[usize]) -> Vec<DataQuality> {
    let y = &data.reading_ppm;
    let mut found = Vec::new();
    for &i in rows {
        let range = data.ranges()[data.platform_of(i)].clone();
        if i <= range.start || i + 1 >= range.end {
            continue;
        }
        let (a, b, c) = (y[i - 1], y[i], y[i + 1]);
        let lone = (b - a).abs().min((b - c).abs());
        if lone > 4.0 * (a - c).abs() && (b - a).signum() == (b - c).signum() {
            let time_s = data.track.time_s()[i];
            found.push(DataQuality {
                platform: data.track.platforms()[data.platform_of(i)].clone(),
                kind: Flaw::Outlier,
                from_s: time_s,
                to_s: time_s,
                message: format!("a single reading of {b} ppm"),
            });
        }
    }
    found
}

/// The middle one of `values`.
pub(super) fn middle(values: &mut [f64]) -> Option<f64> {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied()
}

fn spread(sorted: &[f64]) -> f64 {
    match (sorted.first(), sorted.last()) {
        (Some(a), Some(b)) => (b - a) / 4.0,
        _ => 0.0,
    }
}
