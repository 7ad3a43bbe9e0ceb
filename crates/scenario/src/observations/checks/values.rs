//! Cells that hold what cannot be, or a code for none: -999, 9999, 99.9 and their like.

use plume::{DispersionSpec, Unit};

use super::super::Observations;
use super::range::{
    A_DIRECTION, A_HUMIDITY, A_LATITUDE, A_LONGITUDE, A_PRESSURE, A_READING, A_SPEED, A_SPREAD,
    A_TEMPERATURE, AN_ALTITUDE, AN_AVERAGING, Range,
};
use super::{Flaw, ObservationRow, OfPlatform, middle, quantile};

/// A value so many times farther from the middle than all others on its side stands apart.
const CODE_FAR: f64 = 4.0;
/// A value that is no usual code is one only if it comes back this often.
const CODE_TIMES: usize = 3;
/// Nines that make a number a usual code: in the air's columns with a size that these have,
/// in one reading, and in several.
const LEAST_CODE: f64 = 99.0;
const NINES: usize = 2;
const NINES_OF_ONE: usize = 4;
const NINES_OF_LONE: usize = 3;
/// Readings below zero, and below the lower quartile, by so many standard deviations of noise are
/// none: further than noise with heavy tails reaches.
pub(super) const BELOW_ZERO_SD: f64 = 8.0;
/// Median of |a - b| of two normal numbers, standard deviations.
const MEDIAN_STEP_SD: f64 = 0.954;
/// Part of a column beyond which what cannot be is rather another unit.
const MOST: f64 = 0.5;

/// A column as far as its values alone tell.
struct Column {
    /// Empty for the readings, whose name says their gas.
    name: &'static str,
    range: Range,
    get: fn(&ObservationRow) -> Option<f64>,
    /// Makes the cell missing; none where a row without it is no row.
    clear: Option<fn(&mut ObservationRow)>,
    /// Which codes the range leaves open.
    codes: Codes,
    /// What else the column may hold where most of it cannot be.
    other: &'static str,
}

/// Which values within a column's range may be codes.
#[derive(Clone, Copy, PartialEq)]
enum Codes {
    /// Nines that stand apart, or where there is nothing else.
    OfAir,
    /// Many nines that stand apart: passes at 600 m and 990 m are no code.
    OfHeight,
    /// As readings have them.
    OfReading,
    /// None: each may be a value.
    None,
}

fn without_line(row: &mut ObservationRow) {
    row.co2_ppm = None;
    row.line_end = None;
}

/// The columns of a row.
const COLUMNS: [Column; 14] = [
    Column {
        name: "lat_deg",
        range: A_LATITUDE,
        get: |r| Some(r.lat_deg),
        clear: None,
        codes: Codes::None,
        other: "degrees times 1e7, or radians?",
    },
    Column {
        name: "lon_deg",
        range: A_LONGITUDE,
        get: |r| Some(r.lon_deg),
        clear: None,
        codes: Codes::None,
        other: "degrees times 1e7, or radians?",
    },
    Column {
        name: "alt_amsl_m",
        range: AN_ALTITUDE,
        get: |r| Some(r.alt_amsl_m),
        clear: None,
        codes: Codes::OfHeight,
        other: "mm, or feet?",
    },
    Column {
        name: "",
        range: A_READING,
        get: |r| r.co2_ppm,
        clear: Some(|r| r.co2_ppm = None),
        codes: Codes::OfReading,
        other: "",
    },
    Column {
        name: "wind_speed_m_s",
        range: A_SPEED,
        get: |r| r.wind_speed_m_s,
        clear: Some(|r| r.wind_speed_m_s = None),
        codes: Codes::OfAir,
        other: "cm/s?",
    },
    Column {
        name: "wind_from_deg",
        range: A_DIRECTION,
        get: |r| r.wind_from_deg,
        clear: Some(|r| r.wind_from_deg = None),
        codes: Codes::None,
        other: "tenths of a degree?",
    },
    Column {
        name: "temperature_c",
        range: A_TEMPERATURE,
        get: |r| r.temperature_c,
        clear: Some(|r| r.temperature_c = None),
        codes: Codes::OfAir,
        other: "K?",
    },
    Column {
        name: "relative_humidity_pct",
        range: A_HUMIDITY,
        get: |r| r.relative_humidity_pct,
        clear: Some(|r| r.relative_humidity_pct = None),
        codes: Codes::None,
        other: "another measure of humidity?",
    },
    Column {
        name: "pressure_hpa",
        range: A_PRESSURE,
        get: |r| r.pressure_hpa,
        clear: Some(|r| r.pressure_hpa = None),
        codes: Codes::None,
        other: "Pa?",
    },
    Column {
        name: "sd_ppm",
        range: A_SPREAD,
        get: |r| r.sd_ppm,
        clear: Some(|r| r.sd_ppm = None),
        codes: Codes::None,
        other: "",
    },
    // A reading of which nobody knows over what it is the mean says nothing.
    Column {
        name: "averaging_s",
        range: AN_AVERAGING,
        get: |r| r.averaging_s,
        clear: Some(|r| {
            r.co2_ppm = None;
            r.averaging_s = None;
        }),
        codes: Codes::None,
        other: "ms?",
    },
    Column {
        name: "lat2_deg",
        range: A_LATITUDE,
        get: |r| r.line_end.map(|e| e.lat_deg),
        clear: Some(without_line),
        codes: Codes::None,
        other: "degrees times 1e7, or radians?",
    },
    Column {
        name: "lon2_deg",
        range: A_LONGITUDE,
        get: |r| r.line_end.map(|e| e.lon_deg),
        clear: Some(without_line),
        codes: Codes::None,
        other: "degrees times 1e7, or radians?",
    },
    Column {
        name: "alt2_amsl_m",
        range: AN_ALTITUDE,
        get: |r| r.line_end.map(|e| e.alt_amsl_m),
        clear: Some(without_line),
        codes: Codes::None,
        other: "mm, or feet?",
    },
];

/// How messages name a column and its values: as the file has them.
struct Labels {
    name: &'static str,
    unit: Unit,
}

impl Labels {
    fn of(column: &Column, raw: &Observations) -> Self {
        if column.name.is_empty() {
            return Self {
                name: raw.gas.column(raw.unit),
                unit: raw.unit,
            };
        }
        Self {
            name: column.name,
            unit: Unit::Ppm,
        }
    }

    fn value(&self, value: f64) -> String {
        self.unit.text(value)
    }
}

impl OfPlatform<'_> {
    /// Leaves out and says what no cell of its column can hold.
    pub(super) fn values(&mut self, base: &DispersionSpec, raw: &Observations) {
        let least_ppm = self.least_reading_ppm(base.sensor.noise_sd_ppm);
        for column in &COLUMNS {
            let range = match column.codes {
                Codes::OfReading => column.range.from(least_ppm),
                _ => column.range,
            };
            let labels = Labels::of(column, raw);
            self.impossible(column, range, &labels);
            self.codes(column, &labels);
        }
        self.half_winds(raw);
    }

    /// A direction whose speed was left out is no wind, unless it has none anywhere: a vane without an
    /// anemometer.
    fn half_winds(&mut self, raw: &Observations) {
        let speed = |row: &ObservationRow| row.wind_speed_m_s.is_some();
        if !self.at.iter().any(|i| speed(&self.log.rows[*i])) {
            return;
        }
        for i in &self.at {
            let row = &mut self.log.rows[*i];
            if speed(&raw.rows[*i]) && !speed(row) {
                row.wind_from_deg = None;
            }
        }
    }

    /// Rows that have a value in `column`, and the values.
    fn cells(&self, column: &Column) -> (Vec<usize>, Vec<f64>) {
        let cell = |i: &usize| (column.get)(&self.log.rows[*i]).map(|v| (*i, v));
        self.at.iter().filter_map(cell).unzip()
    }

    fn clear(&mut self, column: &Column, rows: &[usize]) {
        match column.clear {
            Some(clear) => rows.iter().for_each(|i| clear(&mut self.log.rows[*i])),
            None => self.drop_rows(rows),
        }
    }

    /// What lies outside a column's `range`: usual codes one by one, and the rest together.
    fn impossible(&mut self, column: &Column, range: Range, labels: &Labels) {
        let (rows, values) = self.cells(column);
        let outside = |v: f64| !(range.low..=range.high).contains(&v);
        let mut bad: Vec<(usize, f64)> = rows.into_iter().zip(values.iter().copied()).collect();
        bad.retain(|(_, v)| outside(*v));
        if bad.is_empty() {
            return;
        }
        let mut codes: Vec<f64> = bad
            .iter()
            .map(|b| b.1)
            .filter(|v| nines(*v) >= NINES)
            .collect();
        codes.sort_by(f64::total_cmp);
        codes.dedup();
        for code in codes {
            let own = bad.iter().filter(|b| b.1 == code).map(|b| b.0).collect();
            self.leave_out_code(column, code, own, labels);
        }
        bad.retain(|b| nines(b.1) < NINES);
        let own: Vec<usize> = bad.iter().map(|b| b.0).collect();
        let low = bad.iter().map(|b| b.1).fold(f64::INFINITY, f64::min);
        let high = bad.iter().map(|b| b.1).fold(f64::NEG_INFINITY, f64::max);
        let seen = if low == high {
            labels.value(low)
        } else {
            format!("{} to {}", labels.value(low), labels.value(high))
        };
        let most = own.len() as f64 > MOST * values.len() as f64 && !column.other.is_empty();
        let (kind, asked) = if most {
            (
                Flaw::Unit,
                format!("; check whether it is in another unit: {}", column.other),
            )
        } else {
            (Flaw::Outlier, String::new())
        };
        let expected = range.expected.trim_end_matches(", or an empty cell");
        let message = format!(
            "{} values of {seen} in column {} are ignored: expected {expected}{asked}",
            own.len(),
            labels.name
        );
        self.say(kind, &own, message);
        self.clear(column, &own);
    }

    fn leave_out_code(&mut self, column: &Column, code: f64, rows: Vec<usize>, labels: &Labels) {
        let message = format!(
            "{} values of {} in column {} are ignored: a code for missing values",
            rows.len(),
            labels.value(code),
            labels.name
        );
        self.say(Flaw::Outlier, &rows, message);
        self.clear(column, &rows);
    }

    /// Codes that the column's range leaves open: its lowest or highest value, if it stands apart.
    fn codes(&mut self, column: &Column, labels: &Labels) {
        if column.codes == Codes::None {
            return;
        }
        // Each pass takes one code, of which there are few.
        while let Some(code) = self.one_code(column) {
            let (rows, values) = self.cells(column);
            let own = rows.into_iter().zip(values).filter(|c| c.1 == code);
            let own: Vec<usize> = own.map(|c| c.0).collect();
            self.leave_out_code(column, code, own, labels);
        }
    }

    fn one_code(&self, column: &Column) -> Option<f64> {
        let (_, values) = self.cells(column);
        let mut sorted = values.clone();
        let centre = middle(&mut sorted)?;
        let (low, high) = (sorted[0], sorted[sorted.len() - 1]);
        if low == high {
            let whole = column.codes == Codes::OfAir && usual(low);
            return whole.then_some(low);
        }
        [low, high].into_iter().find(|code| {
            let own = sorted.iter().filter(|v| *v == code).count();
            let side = (code - centre).signum();
            let reach = sorted
                .iter()
                .filter(|v| *v != code)
                .map(|v| side * (v - centre))
                .fold(0.0, f64::max);
            let apart = Apart {
                own,
                far: (code - centre).abs() / CODE_FAR,
                reach,
                centre,
            };
            match column.codes {
                Codes::OfAir => usual(*code) && apart.far > reach,
                Codes::OfHeight => nines(*code) >= NINES_OF_ONE && apart.far > reach,
                Codes::OfReading => {
                    let apart = apart.by_more_than(grid_ppm(&sorted));
                    apart.is_code_of_reading(*code) || lone_nines(&values, *code, own, centre)
                }
                Codes::None => false,
            }
        })
    }

    /// The reading below which none can be, ppm: noise does not reach so far below zero.
    fn least_reading_ppm(&self, stated_sd_ppm: f64) -> f64 {
        let (_, mut readings) = self.read();
        let mut steps: Vec<f64> = readings.windows(2).map(|w| (w[1] - w[0]).abs()).collect();
        let seen_sd_ppm = middle(&mut steps).unwrap_or(0.0) / MEDIAN_STEP_SD;
        // On a coarse grid half of the steps may be nil.
        let grid_ppm = steps.iter().copied().find(|s| *s > 0.0).unwrap_or(0.0);
        let sd_ppm = stated_sd_ppm.max(seen_sd_ppm).max(grid_ppm);
        let lower = quantile(&mut readings, 0.25).unwrap_or(0.0);
        lower.min(0.0) - BELOW_ZERO_SD * sd_ppm
    }
}

/// How far a value lies apart from the others of its column.
struct Apart {
    /// How often it is there.
    own: usize,
    /// Its distance from the middle over [`CODE_FAR`].
    far: f64,
    /// The farthest of the others on its side of the middle.
    reach: f64,
    centre: f64,
}

impl Apart {
    /// The same where the others reach at least so far.
    fn by_more_than(self, least: f64) -> Self {
        let reach = self.reach.max(least);
        Self { reach, ..self }
    }

    fn is_code_of_reading(&self, code: f64) -> bool {
        let often = self.own >= CODE_TIMES;
        let least_nines = if often { NINES } else { NINES_OF_ONE };
        if nines(code) >= least_nines && self.far > self.reach {
            return true;
        }
        // Any other value has to be far for a plume too; but none takes air below zero.
        let nothing = code <= 0.0 && self.centre > 0.0;
        let reach = if nothing {
            self.reach
        } else {
            self.reach.max(self.centre.abs())
        };
        often && self.far > reach
    }
}

/// The smallest difference of readings in order of size: on a coarse grid the next one is not apart.
fn grid_ppm(sorted: &[f64]) -> f64 {
    let steps = sorted.windows(2).map(|w| w[1] - w[0]);
    steps.filter(|s| *s > 0.0).fold(f64::INFINITY, f64::min)
}

/// Whether `code` is nines that come back, each time far from the readings before and after: a plume has
/// flanks.
fn lone_nines(readings: &[f64], code: f64, own: usize, centre: f64) -> bool {
    if own < CODE_TIMES || nines(code) < NINES_OF_LONE {
        return false;
    }
    let beside = |v: f64| v != code && (v - code).abs() < 0.5 * (code - centre).abs();
    let flank = |w: &[f64]| (w[0] == code && beside(w[1])) || (w[1] == code && beside(w[0]));
    !readings.windows(2).any(flank)
}

fn usual(value: f64) -> bool {
    value.abs() >= LEAST_CODE && nines(value) >= NINES
}

/// How many nines a number is written with, if with nothing else: 3 for -999, 99.9 and 99900.
fn nines(value: f64) -> usize {
    let text = format!("{:e}", value.abs());
    let digits = text
        .split('e')
        .next()
        .unwrap_or("")
        .bytes()
        .filter(|b| *b != b'.');
    let mut count = 0;
    for digit in digits {
        if digit != b'9' {
            return 0;
        }
        count += 1;
    }
    count
}
