//! The readings to be explained, and what a model must tell of them.

use crate::InferError;
use std::cmp::Ordering;
use std::ops::Range;

/// Readings of one or several sensors, sensor by sensor, each in order of time.
#[derive(Debug, Clone, Default)]
pub struct Rows {
    series: Vec<Range<usize>>,
    time_s: Vec<f64>,
    measured: Vec<f64>,
    stated_sd: Vec<f64>,
    used: Vec<bool>,
    /// Time of which each reading is the mean, s; empty where all are of a moment.
    averaging_s: Vec<f64>,
}

impl Rows {
    /// Rows from the columns of a table. `stated_sd` is the white noise that the file states, not a
    /// number where it does not; `used` is false where a reading is to say nothing.
    ///
    /// # Errors
    /// Columns of different lengths, series that do not follow one another, times that do not grow,
    /// or a used reading that is not finite.
    pub fn new(
        series: Vec<Range<usize>>,
        time_s: Vec<f64>,
        measured: Vec<f64>,
        stated_sd: Vec<f64>,
        used: Vec<bool>,
    ) -> Result<Self, InferError> {
        let n = time_s.len();
        if [measured.len(), stated_sd.len(), used.len()] != [n; 3] {
            return Err(InferError::Rows("columns of different lengths".into()));
        }
        let mut next = 0;
        for range in &series {
            if range.start != next || range.end < range.start || range.end > n {
                return Err(InferError::Rows(format!(
                    "series {range:?} does not begin at row {next}"
                )));
            }
            next = range.end;
            let times = &time_s[range.clone()];
            if let Some(k) = (1..times.len())
                .find(|&k| times[k].partial_cmp(&times[k - 1]) != Some(Ordering::Greater))
            {
                return Err(InferError::Rows(format!(
                    "row {} at {} s must come after the row before",
                    range.start + k,
                    times[k]
                )));
            }
        }
        if next != n {
            return Err(InferError::Rows(format!(
                "{} rows belong to no series",
                n - next
            )));
        }
        if let Some(k) = (0..n).find(|&k| used[k] && !measured[k].is_finite()) {
            return Err(InferError::Rows(format!(
                "row {k} is used, but its reading is {}",
                measured[k]
            )));
        }
        Ok(Self {
            series,
            time_s,
            measured,
            stated_sd,
            used,
            averaging_s: Vec::new(),
        })
    }

    /// The same rows whose readings are means over these times, s, of which `time_s` is the middle.
    ///
    /// # Errors
    /// Another number of times than of rows, or one that is negative or not finite.
    pub fn averaged_over(mut self, averaging_s: Vec<f64>) -> Result<Self, InferError> {
        if averaging_s.len() != self.len() {
            return Err(InferError::Rows("columns of different lengths".into()));
        }
        if let Some(k) = averaging_s.iter().position(|t| !t.is_finite() || *t < 0.0) {
            let problem = format!("row {k} is a mean over {} s", averaging_s[k]);
            return Err(InferError::Rows(problem));
        }
        if averaging_s.iter().any(|t| *t > 0.0) {
            self.averaging_s = averaging_s;
        }
        Ok(self)
    }

    /// Time of which the reading of a row is the mean, s; 0 where it is of a moment.
    pub fn averaging_s(&self, row: usize) -> f64 {
        self.averaging_s.get(row).copied().unwrap_or(0.0)
    }

    /// Number of rows, used or not.
    pub fn len(&self) -> usize {
        self.time_s.len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.time_s.is_empty()
    }

    /// All rows as one stretch.
    pub(crate) fn whole(&self) -> Vec<Range<usize>> {
        std::iter::once(0..self.len()).collect()
    }

    /// Rows of each sensor.
    pub fn series(&self) -> impl DoubleEndedIterator<Item = Range<usize>> + '_ {
        self.series.iter().cloned()
    }

    /// Times, s.
    pub fn time_s(&self) -> &[f64] {
        &self.time_s
    }

    /// Readings.
    pub fn measured(&self) -> &[f64] {
        &self.measured
    }

    /// Whether the reading of a row counts.
    pub fn is_used(&self, row: usize) -> bool {
        self.used[row]
    }

    /// Rows whose reading counts.
    pub fn used_count(&self) -> usize {
        self.used.iter().filter(|u| **u).count()
    }

    /// White noise of a row where it is stated.
    pub fn stated_sd(&self, row: usize) -> Option<f64> {
        Some(self.stated_sd[row]).filter(|sd| sd.is_finite())
    }
}

/// An unknown of a model, in a coordinate in which what is known of it beforehand is normal.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Prior {
    /// Mean.
    pub mean: f64,
    /// Standard deviation.
    pub sd: f64,
}

/// What a model expects the sensors to read.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Prediction {
    /// The reading of each row.
    pub reading: Vec<f64>,
    /// What of it is due to the plume.
    pub plume: Vec<f64>,
}

/// Where a place lies in a plume: the coordinates in which a model's discrepancy is smooth.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct PlumePlace {
    /// Natural logarithm of the distance downwind, m.
    pub ln_distance: f64,
    /// Height above the axis over σz.
    pub above_sigmas: f64,
    /// Distance across the axis over σy.
    pub across_sigmas: f64,
    /// Time, s.
    pub time_s: f64,
    /// Time at which the air there left the source, s.
    pub emitted_s: f64,
    /// σz there, m.
    pub sigma_z_m: f64,
}

/// A turn of a plume's axis about its source.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct AxisTurn {
    /// To the side, degrees clockwise seen from above.
    pub clockwise_deg: f64,
    /// Upwards, degrees; nothing in a model whose axis has no height.
    pub upward_deg: f64,
}

impl AxisTurn {
    /// None.
    pub const NONE: Self = Self {
        clockwise_deg: 0.0,
        upward_deg: 0.0,
    };

    /// To the side alone.
    pub fn clockwise(deg: f64) -> Self {
        Self {
            clockwise_deg: deg,
            upward_deg: 0.0,
        }
    }
}

/// A model of readings with unknowns.
pub trait ForwardModel: Sync {
    /// What is known of each unknown beforehand.
    fn priors(&self) -> &[Prior];

    /// The unknown that is the natural logarithm of the plume's strength, where there is one.
    fn ln_strength(&self) -> Option<usize>;

    /// Points from which a search starts; the mean of the priors is always tried.
    fn starts(&self) -> Vec<Vec<f64>>;

    /// Readings expected of the unknowns `at`, the axis of each row turned by `turns`.
    ///
    /// # Errors
    /// Values that the model refuses.
    fn predict(&self, at: &[f64], turns: &[AxisTurn]) -> Result<Prediction, InferError>;

    /// How long the air of a row has been under way since the source let it go, s: its axis has turned as
    /// the wind did on the average over that time. Zero where the whole plume turns at once.
    fn under_way_s(&self, _row: usize) -> f64 {
        0.0
    }

    /// Response time of each row's sensor, s: the time constant of its lag, under the unknowns `at`. Empty where all
    /// show the air at once.
    ///
    /// # Errors
    /// Values that the model refuses.
    fn response_s(&self, _at: &[f64]) -> Result<Vec<f64>, InferError> {
        Ok(Vec::new())
    }

    /// Height of the sensor at a row, m above ground; the same at all rows where heights are not known.
    fn height_agl_m(&self, _row: usize) -> f64 {
        0.0
    }

    /// The rows that an unknown moves, where they are not all of them: those of one sensor.
    fn rows_of(&self, _unknown: usize) -> Option<Range<usize>> {
        None
    }

    /// Standard deviation of what a sensor's readings may be off all along, in the unit of the readings:
    /// background and zero.
    fn level_sd(&self) -> f64 {
        f64::INFINITY
    }

    /// Where each row lies in the plume of the unknowns `at`.
    ///
    /// # Errors
    /// Values that the model refuses.
    fn places(&self, at: &[f64]) -> Result<Vec<PlumePlace>, InferError>;
}
