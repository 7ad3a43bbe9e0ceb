//! Rows of one platform in order of time, at times of their own.
//!
//! Loggers that stamp whole seconds (or minutes) while they read more often give several rows one time. These
//! are spread evenly inside of what the stamp stands for.

use crate::ImportError;
use crate::sink::Sink;
use std::collections::BTreeMap;

/// Steps that clocks have, s, from the coarsest.
const STEPS_S: [f64; 6] = [60.0, 1.0, 0.1, 0.01, 0.001, 1e-6];

/// How the times of a log are stamped.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Stamps {
    /// What a stamp stands for, s.
    pub step_s: f64,
    /// Rows of one platform that usually have one stamp.
    pub usual: usize,
}

impl Stamps {
    /// Times that are left as they are.
    pub const AS_THEY_ARE: Self = Self {
        step_s: 0.0,
        usual: 1,
    };

    /// Assumed where the first rows have no time: the clock of a GPS, in whole seconds.
    pub const WHOLE_SECONDS: Self = Self {
        step_s: 1.0,
        usual: 1,
    };

    /// Of the first times of a log, with the platform of each.
    pub fn of(times: &[(f64, usize)]) -> Self {
        // Doubles of today's date hold a quarter of a microsecond.
        let is_multiple = |t: f64, step: f64| ((t / step).round() * step - t).abs() < 1e-6;
        let is_step = |step: &f64| times.iter().all(|(t, _)| is_multiple(*t, *step));
        let step_s = STEPS_S.into_iter().find(is_step).unwrap_or(1e-6);
        let mut groups: BTreeMap<usize, (f64, Vec<usize>)> = BTreeMap::new();
        for (time, platform) in times {
            let (last, counts) = groups.entry(*platform).or_insert((f64::NAN, Vec::new()));
            match counts.last_mut().filter(|_| *last == *time) {
                Some(count) => *count += 1,
                None => counts.push(1),
            }
            *last = *time;
        }
        // The first and last stamps may have begun or go on beyond what is seen.
        let inner = |counts: &Vec<usize>| {
            counts
                .get(1..counts.len().max(2) - 1)
                .unwrap_or(&[])
                .to_vec()
        };
        let mut counts: Vec<usize> = groups.values().flat_map(|(_, c)| inner(c)).collect();
        counts.sort_unstable();
        let usual = counts.get(counts.len() / 2).copied().unwrap_or(1);
        Self { step_s, usual }
    }
}

/// What was done to times.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Done {
    /// Rows.
    pub rows: usize,
    /// Rows that were moved inside of their stamp.
    pub spread: usize,
}

impl Done {
    /// A notice, if rows were moved.
    pub fn notice(self, stamps: Stamps) -> Option<String> {
        (self.spread > 0 && stamps.step_s > 0.0).then(|| {
            format!(
                "{} of {} rows share a time with rows before them and are spread evenly over {} s, the \
                 resolution of the times",
                self.spread, self.rows, stamps.step_s
            )
        })
    }
}

/// Rows on their way into a sink.
pub struct InOrder<'a> {
    sink: &'a mut dyn Sink,
    file: &'a str,
    stamps: Stamps,
    may_run_back: bool,
    last: Vec<f64>,
    names: Vec<String>,
    /// The stamp of the rows that wait, and these.
    stamp_s: f64,
    platforms: Vec<usize>,
    values: Vec<f64>,
    width: usize,
    stamps_seen: Vec<usize>,
    done: Done,
}

impl<'a> InOrder<'a> {
    /// Rows of `width` values of the log `file`. Rows that run back are refused unless they `may_run_back`, because
    /// whoever takes them sorts them.
    pub fn new(
        sink: &'a mut dyn Sink,
        file: &'a str,
        stamps: Stamps,
        width: usize,
        may_run_back: bool,
    ) -> Self {
        Self {
            sink,
            file,
            stamps,
            may_run_back,
            last: Vec::new(),
            names: Vec::new(),
            stamp_s: f64::NAN,
            platforms: Vec::new(),
            values: Vec::new(),
            width,
            stamps_seen: Vec::new(),
            done: Done::default(),
        }
    }

    /// The platform of this name.
    pub fn platform(&mut self, name: &str) -> usize {
        let known = self.names.iter().position(|n| n == name);
        known.unwrap_or_else(|| {
            self.names.push(name.to_owned());
            self.last.push(f64::NEG_INFINITY);
            self.stamps_seen.push(0);
            self.names.len() - 1
        })
    }

    /// Takes the row in `line` of the log.
    ///
    /// # Errors
    /// A row that runs back, or the sink's.
    pub fn row(
        &mut self,
        time_s: f64,
        platform: usize,
        values: &[f64],
        line: u64,
    ) -> Result<(), ImportError> {
        if time_s < self.last[platform] && !self.may_run_back {
            let file = self.file.to_owned();
            return Err(ImportError::Disorder { file, line });
        }
        if time_s != self.stamp_s {
            self.flush()?;
            self.stamp_s = time_s;
        }
        self.last[platform] = time_s;
        self.platforms.push(platform);
        self.values.extend_from_slice(values);
        Ok(())
    }

    fn flush(&mut self) -> Result<(), ImportError> {
        let rows = self.platforms.len();
        if rows == 1 {
            return self.one();
        }
        for row in 0..rows {
            let platform = self.platforms[row];
            let same = |p: &&usize| **p == platform;
            let (count, before) = (
                self.platforms.iter().filter(same).count(),
                self.platforms[..row].iter().filter(same).count(),
            );
            // A stamp of which the log has only the end: its rows are the last of the usual number.
            let usual = self.stamps.usual.max(count);
            let first = if self.stamps_seen[platform] == 0 {
                usual - count
            } else {
                0
            };
            let apart = if count > 1 || first > 0 { usual } else { 1 };
            let share = (first + before) as f64 / apart as f64;
            self.done.spread += usize::from(share > 0.0);
            let time_s = self.stamp_s + share * self.stamps.step_s;
            let values = &self.values[row * self.width..(row + 1) * self.width];
            self.sink.row(time_s, &self.names[platform], values)?;
        }
        for platform in std::mem::take(&mut self.platforms) {
            self.stamps_seen[platform] += 1;
        }
        self.done.rows += rows;
        self.values.clear();
        Ok(())
    }

    /// The way of most rows: the only one of its stamp.
    fn one(&mut self) -> Result<(), ImportError> {
        let platform = self.platforms[0];
        let late = self.stamps_seen[platform] == 0 && self.stamps.usual > 1;
        let share = if late {
            1.0 - 1.0 / self.stamps.usual as f64
        } else {
            0.0
        };
        self.done.spread += usize::from(late);
        let time_s = self.stamp_s + share * self.stamps.step_s;
        self.sink.row(time_s, &self.names[platform], &self.values)?;
        self.stamps_seen[platform] += 1;
        self.done.rows += 1;
        self.platforms.clear();
        self.values.clear();
        Ok(())
    }

    /// Hands on what waits. What was done, and the platforms that have rows.
    ///
    /// # Errors
    /// The sink's.
    pub fn finish(mut self) -> Result<(Done, Vec<String>), ImportError> {
        self.flush()?;
        let names = self.names.into_iter().zip(self.stamps_seen);
        let with_rows = names.filter(|(_, seen)| *seen > 0).map(|(name, _)| name);
        Ok((self.done, with_rows.collect()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sink::Table;

    fn spread(rows: &[(f64, &str)]) -> Vec<f64> {
        let index = |name: &str| usize::from(name != rows[0].1);
        let times: Vec<(f64, usize)> = rows.iter().map(|(t, p)| (*t, index(p))).collect();
        let mut table = Table::new(Vec::new());
        let mut order = InOrder::new(&mut table, "a.csv", Stamps::of(&times), 0, false);
        for (time, name) in rows {
            let platform = order.platform(name);
            order.row(*time, platform, &[], 1).unwrap();
        }
        order.finish().unwrap();
        table.time_s
    }

    #[test]
    fn whole_seconds_are_spread_evenly_and_the_first_is_its_end() {
        // Five rows a second; the log begins with the last two of a second and ends after one of the last.
        let stamps = [
            7.0, 7.0, 8.0, 8.0, 8.0, 8.0, 8.0, 9.0, 9.0, 9.0, 9.0, 9.0, 10.0, 10.0,
        ];
        let rows: Vec<(f64, &str)> = stamps.into_iter().map(|t| (t, "a")).collect();
        let expected: Vec<f64> = (0..14).map(|k| 7.6 + 0.2 * f64::from(k)).collect();
        for (got, expected) in spread(&rows).into_iter().zip(expected) {
            assert!((got - expected).abs() < 1e-9, "{got} {expected}");
        }
    }

    #[test]
    fn two_platforms_of_one_time_are_no_repetition() {
        let rows = [
            (0.0, "a"),
            (0.0, "b"),
            (1.0, "a"),
            (1.0, "b"),
            (2.0, "a"),
            (2.0, "b"),
        ];
        assert_eq!(spread(&rows), [0.0, 0.0, 1.0, 1.0, 2.0, 2.0]);
    }

    #[test]
    fn minutes_and_hundredths_are_steps_too() {
        let minutes = [(0.0, 0), (0.0, 0), (60.0, 0), (60.0, 0), (120.0, 0)];
        assert_eq!(
            Stamps::of(&minutes),
            Stamps {
                step_s: 60.0,
                usual: 2
            }
        );
        let fine = [(0.01, 0), (0.13, 0), (0.25, 0)];
        assert_eq!(
            Stamps::of(&fine),
            Stamps {
                step_s: 0.01,
                usual: 1
            }
        );
    }

    #[test]
    fn rows_that_run_back_are_told_with_their_line() {
        let mut table = Table::new(Vec::new());
        let stamps = Stamps {
            step_s: 1.0,
            usual: 1,
        };
        let mut order = InOrder::new(&mut table, "a.csv", stamps, 0, false);
        let a = order.platform("a");
        order.row(5.0, a, &[], 2).unwrap();
        let error = order.row(4.0, a, &[], 3).unwrap_err();
        assert!(matches!(error, ImportError::Disorder { line: 3, .. }));
    }
}
