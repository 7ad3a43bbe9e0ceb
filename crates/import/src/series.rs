//! Values over time, as logs hold them that have several rates.

use crate::quantity::{Dimension, Quantity};

/// Between values further apart than this, and than three usual steps, nothing is interpolated, s.
const LONGEST_GAP_S: f64 = 10.0;
/// The same in usual steps.
const LONGEST_GAP_STEPS: f64 = 3.0;

/// Values over time.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Series {
    /// Its name in the log, such as `GPS.Alt`.
    pub name: String,
    /// Its unit as the log has it; empty where it says none.
    pub unit: String,
    /// Times, s.
    pub time_s: Vec<f64>,
    /// A value for each.
    pub values: Vec<f64>,
}

impl Series {
    /// An empty series.
    pub fn new(name: impl Into<String>) -> Self {
        Self {
            name: name.into(),
            ..Self::default()
        }
    }

    /// Adds a value; one that is not finite is none.
    pub fn push(&mut self, time_s: f64, value: f64) {
        if value.is_finite() && time_s.is_finite() {
            self.time_s.push(time_s);
            self.values.push(value);
        }
    }

    /// Puts values in order of time, and of those of one time leaves the last.
    pub fn sort(&mut self) {
        if !self.time_s.is_sorted_by(|a, b| a < b) {
            let mut pairs: Vec<(f64, f64)> = self
                .time_s
                .iter()
                .copied()
                .zip(self.values.iter().copied())
                .collect();
            pairs.sort_by(|a, b| a.0.total_cmp(&b.0));
            pairs.dedup_by(|later, kept| {
                let same = later.0 == kept.0;
                if same {
                    kept.1 = later.1;
                }
                same
            });
            (self.time_s, self.values) = pairs.into_iter().unzip();
        }
    }

    /// The usual time between values, s; none of fewer than two.
    pub fn step_s(&self) -> Option<f64> {
        let mut steps: Vec<f64> = self.time_s.windows(2).map(|w| w[1] - w[0]).collect();
        steps.sort_by(f64::total_cmp);
        steps.get(steps.len() / 2).copied()
    }

    /// A reader of this series at times that grow.
    pub fn reader(&self, quantity: &Quantity) -> SeriesReader<'_> {
        let step_s = self.step_s().unwrap_or(0.0);
        SeriesReader {
            series: self,
            at: 0,
            longest_s: LONGEST_GAP_S.max(LONGEST_GAP_STEPS * step_s),
            turns: quantity.dimension == Dimension::Angle || quantity.name == "lon_deg",
            from_0: quantity.name == "wind_from_deg",
        }
    }
}

/// Reads a series between its values.
#[derive(Debug, Clone)]
pub struct SeriesReader<'a> {
    series: &'a Series,
    at: usize,
    longest_s: f64,
    /// Whether the values are angles, of which 359 and 1 are near.
    turns: bool,
    from_0: bool,
}

impl SeriesReader<'_> {
    /// The value at `time_s`, on the straight line between those around it; NaN where there are none, or far ones.
    pub fn at(&mut self, time_s: f64) -> f64 {
        let times = &self.series.time_s;
        if self.at > 0 && times[self.at] > time_s {
            self.at = times.partition_point(|t| *t <= time_s).saturating_sub(1);
        }
        while self.at + 1 < times.len() && times[self.at + 1] <= time_s {
            self.at += 1;
        }
        let Some(before_s) = times.get(self.at).copied() else {
            return f64::NAN;
        };
        let before = self.series.values[self.at];
        if before_s == time_s {
            return before;
        }
        let Some(after_s) = times
            .get(self.at + 1)
            .copied()
            .filter(|_| before_s < time_s)
        else {
            return f64::NAN;
        };
        if after_s - before_s > self.longest_s {
            return f64::NAN;
        }
        let share = (time_s - before_s) / (after_s - before_s);
        let step = self.series.values[self.at + 1] - before;
        if !self.turns {
            return before + share * step;
        }
        let angle = before + share * air::geo::wrap_signed_deg(step);
        if self.from_0 {
            air::geo::wrap_deg(angle)
        } else {
            air::geo::wrap_signed_deg(angle)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn series(points: &[(f64, f64)]) -> Series {
        let mut series = Series::new("x");
        for (time, value) in points {
            series.push(*time, *value);
        }
        series.sort();
        series
    }

    #[test]
    fn values_lie_on_the_line_between_neighbours_and_nowhere_else() {
        let alt = Quantity::named("alt_amsl_m").unwrap();
        let series = series(&[
            (2.0, 20.0),
            (0.0, 0.0),
            (1.0, 10.0),
            (60.0, 0.0),
            (1.0, 12.0),
        ]);
        let mut reader = series.reader(alt);
        assert_eq!(
            [0.0, 0.5, 1.0, 1.5].map(|t| reader.at(t)),
            [0.0, 6.0, 12.0, 16.0]
        );
        assert!(reader.at(30.0).is_nan() && reader.at(61.0).is_nan() && reader.at(-1.0).is_nan());
        assert_eq!(reader.at(0.5), 6.0);
    }

    #[test]
    fn angles_go_the_short_way_round() {
        let series = series(&[(0.0, 350.0), (1.0, 10.0), (2.0, 350.0)]);
        let mut wind = series.reader(Quantity::named("wind_from_deg").unwrap());
        assert_eq!(wind.at(0.75), 5.0);
        assert_eq!(wind.at(1.75), 355.0);
        let mut yaw = series.reader(Quantity::named("yaw_deg").unwrap());
        assert_eq!(yaw.at(1.75), -5.0);
    }
}
