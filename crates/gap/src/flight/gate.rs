//! The gate on raw data: which parts fly, what is frozen, clipped, missing, far off or in a wrong
//! unit. What does not pass is masked, and said.

use std::ops::Range;
use std::sync::Arc;

use air::isa::Atmosphere;
use fdm::dynamics::Dynamics;
use fdm::{Aircraft, SurfaceCommand};

use super::channel::{ALL, CHANNELS, Channel};
use super::log::FlightLog;
use super::suspect;
use crate::GapError;
use crate::statistics::median;
use crate::verdict::{DataQuality, Flaw};

/// Part of the slowest airspeed above which the aircraft counts as flying.
const FLYING_PART: f64 = 0.9;
/// Time cut off at both ends of a flying part, s: launch and flare are not the model's.
const ENDS_S: f64 = 1.5;
/// Shortest flying part that is used, s.
const SHORTEST_S: f64 = 8.0;
/// Longest mean time between rows, s. What a surface does between two rows is not logged, and a
/// small aircraft answers it within a tenth of a second (roll) to a few tenths (pitch).
const SPARSEST_S: f64 = 0.11;
/// Longest time between rows by which delays can be told, s: the tenths of a second that they last,
/// and the parabola of 0.2 s that accelerations are told by, need five rows.
const DELAYS_S: f64 = 0.055;
/// Fewest rows that fly: three for each coefficient of an aircraft.
const FEWEST_ROWS: usize = 80;
/// Fewest readings of a channel that is looked at.
const FEWEST_READINGS: usize = 10;
/// Fewest times in a row, and part of all readings, that a limited channel is at its limit.
const FEWEST_CLIPPED: usize = 8;
const CLIPPED_PART: f64 = 0.005;
/// Part of repeated values above which a channel counts as sampled and held.
const HELD_PART: f64 = 0.5;
/// Shortest stretch of an unchanged value that counts as frozen, s.
const FROZEN_S: f64 = 2.0;
/// Robust standard deviations off its neighbours at which a single value is an outlier.
const OUTLIER: f64 = 12.0;

/// An uninterrupted part of a flight.
#[derive(Debug, Clone, PartialEq)]
pub struct Segment {
    /// Which log it is of.
    pub log: usize,
    /// Times, s.
    pub time_s: Vec<f64>,
    /// What the sensors read, SI; NaN where missing or masked.
    pub measured: Vec<[f64; CHANNELS]>,
    /// What the surfaces and the motor were told.
    pub command: Vec<SurfaceCommand>,
    /// Air density, kg/m³.
    pub density: Vec<f64>,
    /// Logged wind, NED towards, m/s.
    pub wind_ned: Option<Vec<[f64; 3]>>,
}

impl Segment {
    /// Number of samples.
    pub fn len(&self) -> usize {
        self.time_s.len()
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.time_s.is_empty()
    }

    /// How long it is, s.
    pub fn duration_s(&self) -> f64 {
        self.time_s.last().unwrap_or(&0.0) - self.time_s.first().unwrap_or(&0.0)
    }

    /// Some of its samples.
    pub fn cut(&self, of: Range<usize>) -> Self {
        Self {
            log: self.log,
            time_s: self.time_s[of.clone()].to_vec(),
            measured: self.measured[of.clone()].to_vec(),
            command: self.command[of.clone()].to_vec(),
            density: self.density[of.clone()].to_vec(),
            wind_ned: self.wind_ned.as_ref().map(|w| w[of].to_vec()),
        }
    }
}

/// What passed the gate.
#[derive(Debug, Clone, PartialEq)]
pub struct Gated {
    /// Parts that fly, in order.
    pub segments: Vec<Segment>,
    /// Flaws.
    pub data_quality: Vec<DataQuality>,
    /// What a user should know.
    pub notices: Vec<String>,
    /// Channels that hold anything.
    pub present: [bool; CHANNELS],
    /// Whether a throttle was logged.
    pub has_throttle: bool,
    /// Whether a rudder command was logged.
    pub has_rudder: bool,
    /// Whether a wind was logged.
    pub has_wind: bool,
    /// Whether rows are close enough to tell delays and lags of surfaces.
    pub tells_delays: bool,
}

impl Gated {
    /// Number of samples.
    pub fn rows(&self) -> usize {
        self.segments.iter().map(Segment::len).sum()
    }

    /// At most so many stretches of so many samples, evenly through the data; all data where they are fewer.
    pub fn thinned(&self, [most, samples]: [usize; 2]) -> Self {
        let total = self.rows();
        let stretch = |k: usize| {
            // Middle of the k-th of so many equal parts.
            let mut middle = (2 * k + 1) * total / (2 * most);
            let s = self.segments.iter().find(|s| {
                let holds = middle < s.len();
                middle -= if holds { 0 } else { s.len() };
                holds
            })?;
            let length = samples.min(s.len());
            let from = middle.saturating_sub(length / 2).min(s.len() - length);
            Some(s.cut(from..from + length))
        };
        let mut thin = self.clone();
        if total > most * samples {
            thin.segments = (0..most).filter_map(stretch).collect();
        }
        thin
    }
}

/// Passes `logs` of `aircraft` through the gate.
///
/// # Errors
/// [`GapError::Data`] when no log has a flying part of some seconds, or rows are too far apart to
/// follow an aircraft by.
pub fn pass(logs: &[FlightLog], aircraft: &Aircraft) -> Result<Gated, GapError> {
    let mut gated = Gated {
        segments: Vec::new(),
        data_quality: Vec::new(),
        notices: Vec::new(),
        present: [false; CHANNELS],
        has_throttle: true,
        has_rudder: aircraft.has_rudder(),
        has_wind: true,
        tells_delays: true,
    };
    for (index, log) in logs.iter().enumerate() {
        gated.notices.extend(log.notices.iter().cloned());
        dense_enough(log, &mut gated)?;
        let segments = segments(index, log, aircraft, &mut gated);
        gated.segments.extend(segments);
    }
    enough_flown(logs, aircraft, &gated)?;
    for (k, channel) in ALL.iter().enumerate() {
        let mut readings = gated.segments.iter().flat_map(|s| &s.measured);
        gated.present[k] = readings.any(|m| m[k].is_finite());
        if !gated.present[k] {
            gated
                .notices
                .push(format!("{} is not available", channel.label));
        }
    }
    Ok(gated)
}

/// Whether the rows of `log` are close enough to follow an aircraft by, and to tell delays.
fn dense_enough(log: &FlightLog, gated: &mut Gated) -> Result<(), GapError> {
    let interval = interval_s(log);
    if interval > SPARSEST_S {
        return Err(GapError::Data {
            what: format!("{}: column time_s", log.name),
            problem: format!(
                "rows are {interval:.2} s apart ({:.1} a second): the motion of the surfaces between them is \
                 unknown, and the aircraft responds faster",
                1.0 / interval
            ),
            expected: format!(
                "rows at most {SPARSEST_S:.2} s apart; for delays and lags at most {DELAYS_S:.3} s \
                 (20 a second), usual are 50 a second"
            ),
        });
    }
    if interval > DELAYS_S {
        gated.tells_delays = false;
        gated.notices.push(format!(
            "{}: rows are {interval:.2} s apart: delays, lags and angular accelerations are not analysed, which \
             needs 20 rows per second",
            log.name
        ));
    }
    Ok(())
}

/// Whether what flies is long enough.
fn enough_flown(logs: &[FlightLog], aircraft: &Aircraft, gated: &Gated) -> Result<(), GapError> {
    let flown_s: f64 = gated.segments.iter().map(Segment::duration_s).sum();
    let rows = gated.rows();
    let (problem, expected) = if flown_s < SHORTEST_S {
        let slowest = FLYING_PART * aircraft.limits.airspeed_min_m_s;
        (
            format!(
                "no part of at least {SHORTEST_S} s flies faster than {slowest:.1} m/s without a gap"
            ),
            "a flight of the aircraft in the file, airspeed in m/s".to_owned(),
        )
    } else if rows < FEWEST_ROWS {
        (
            format!("only {rows} rows are in flight"),
            format!("at least {FEWEST_ROWS} rows in flight"),
        )
    } else {
        return Ok(());
    };
    let names: Vec<&str> = logs.iter().map(|l| l.name.as_str()).collect();
    Err(GapError::Data {
        what: names.join(", "),
        problem,
        expected,
    })
}

/// Usual time between rows, s.
fn interval_s(log: &FlightLog) -> f64 {
    let steps = log.time_s().windows(2).map(|w| w[1] - w[0]);
    median(steps.collect()).unwrap_or(f64::NAN)
}

/// The parts of a log that fly, with what may be used of them.
fn segments(index: usize, log: &FlightLog, aircraft: &Aircraft, gated: &mut Gated) -> Vec<Segment> {
    let interval = interval_s(log);
    let parts = flying_parts(log, aircraft, interval, gated);
    let checked = |channel: &Channel| {
        let mut check = Check {
            log,
            channel,
            parts: &parts,
            values: log
                .column(channel.column)
                .map_or_else(|| vec![f64::NAN; log.len()], <[f64]>::to_vec),
            gated: &mut *gated,
        };
        check.mask(interval);
        check.values.iter().map(|v| v * channel.si).collect()
    };
    let mut channels: Vec<Vec<f64>> = ALL.iter().map(checked).collect();
    for (k, message) in suspect::suspected(log.time_s(), &parts, &channels) {
        channels[k].fill(f64::NAN);
        flaw(log, gated, Flaw::Unit, 0..log.len(), message);
    }
    let command = commands(log, aircraft, gated);
    let wind = logged_wind(log);
    gated.has_wind &= wind.is_some();
    let whole = Segment {
        log: index,
        time_s: log.time_s().to_vec(),
        measured: (0..log.len())
            .map(|i| std::array::from_fn(|k| channels[k][i]))
            .collect(),
        command,
        density: density(log),
        wind_ned: wind,
    };
    parts
        .iter()
        .map(|&(from, to)| whole.cut(from..to))
        .collect()
}

/// Reports a flaw of some rows.
fn flaw(log: &FlightLog, gated: &mut Gated, kind: Flaw, rows: Range<usize>, message: String) {
    gated.data_quality.push(DataQuality {
        platform: log.name.clone(),
        kind,
        from_s: log.time_s()[rows.start],
        to_s: log.time_s()[rows.end - 1],
        message,
    });
}

/// Ranges of rows that fly without a gap in time.
fn flying_parts(
    log: &FlightLog,
    aircraft: &Aircraft,
    interval: f64,
    gated: &mut Gated,
) -> Vec<(usize, usize)> {
    let time = log.time_s();
    let slowest = FLYING_PART * aircraft.limits.airspeed_min_m_s;
    let airspeed = log.column("airspeed_m_s").unwrap_or(&[]);
    let longest_step = (5.0 * interval).max(0.3);
    // A second's mean, so that a gust does not cut the flight.
    let weight = interval.min(1.0);
    let smoothed = airspeed.iter().scan(0.0, |mean, value| {
        *mean += if value.is_finite() {
            weight * (value - *mean)
        } else {
            0.0
        };
        Some(*mean)
    });
    let flies: Vec<bool> = smoothed.map(|mean| mean > slowest).collect();
    let jumps = |i: usize| time[i] - time[i - 1] > longest_step;
    for i in (1..flies.len()).filter(|&i| flies[i] && jumps(i)) {
        flaw(log, gated, Flaw::Gap, i - 1..i + 1, "no rows".into());
    }
    let rows: Vec<usize> = (0..flies.len()).collect();
    let part = |run: &[usize]| {
        let (begin, end) = (time[run[0]] + ENDS_S, time[run[run.len() - 1]] - ENDS_S);
        let inside = |i: &&usize| (begin..=end).contains(&time[**i]);
        let (first, last) = (*run.iter().find(inside)?, *run.iter().rfind(inside)?);
        (flies[first] && time[last] - time[first] >= SHORTEST_S).then_some((first, last + 1))
    };
    let runs = rows.chunk_by(|a, b| flies[*a] == flies[*b] && !jumps(*b));
    runs.filter_map(part).collect()
}

/// Looks at one channel and masks what is not to be used.
struct Check<'a> {
    log: &'a FlightLog,
    channel: &'a Channel,
    parts: &'a [(usize, usize)],
    values: Vec<f64>,
    gated: &'a mut Gated,
}

impl Check<'_> {
    fn flaw(&mut self, kind: Flaw, rows: Range<usize>, message: &str) {
        let message = format!("{}: {message}", self.channel.label);
        flaw(self.log, self.gated, kind, rows, message);
    }

    /// Rows that fly, but for the first `lead` and the last `tail` of each part.
    fn rows(&self, lead: usize, tail: usize) -> impl Iterator<Item = usize> {
        self.parts
            .iter()
            .flat_map(move |&(a, b)| a + lead..b - tail)
    }

    fn mask(&mut self, interval: f64) {
        let known = self
            .rows(1, 0)
            .filter(|&i| self.values[i].is_finite())
            .count();
        if known < FEWEST_READINGS {
            return;
        }
        let repeats = self
            .rows(1, 0)
            .filter(|&i| self.values[i] == self.values[i - 1]);
        let held = repeats.count() as f64 / known as f64;
        let update_s = interval / (1.0 - held).max(1e-3);
        self.frozen(update_s);
        if held <= HELD_PART {
            self.clipped();
            self.outliers();
            return;
        }
        for i in (1..self.values.len()).rev() {
            if self.values[i] == self.values[i - 1] {
                self.values[i] = f64::NAN;
            }
        }
        if held < 1.0 - 1e-3 {
            let (name, column) = (&self.log.name, self.channel.column);
            self.gated.notices.push(format!(
                "{name}: {column} is sampled every {update_s:.2} s and held; only new values count"
            ));
        }
    }

    /// Runs of one value that are too long for its usual rate of change.
    fn frozen(&mut self, update_s: f64) {
        let time = self.log.time_s();
        let longest = FROZEN_S.max(8.0 * update_s);
        for &(from, to) in self.parts {
            let mut end = from;
            let runs = self.values[from..to].chunk_by(|a, b| a == b);
            let runs: Vec<Range<usize>> = runs
                .map(|run| {
                    end += run.len();
                    end - run.len()..end
                })
                .collect();
            for run in runs {
                let seconds = time[run.end - 1] - time[run.start];
                if seconds > longest {
                    self.values[run.clone()].fill(f64::NAN);
                    self.flaw(
                        Flaw::Frozen,
                        run,
                        &format!("stands still for {seconds:.1} s"),
                    );
                }
            }
        }
    }

    /// A highest or lowest value that comes again and again, several times in a row.
    fn clipped(&mut self) {
        let inside: Vec<f64> = self
            .rows(0, 0)
            .map(|i| self.values[i])
            .filter(|v| v.is_finite())
            .collect();
        let high = inside.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let low = inside.iter().copied().fold(f64::INFINITY, f64::min);
        for limit in [low, high] {
            let stays = |i: &usize| self.values[i - 2..=*i].iter().all(|v| *v == limit);
            let hits: Vec<usize> = self.rows(2, 0).filter(stays).collect();
            if hits.len() < FEWEST_CLIPPED
                || (hits.len() as f64) < CLIPPED_PART * inside.len() as f64
            {
                continue;
            }
            let share = 100.0 * hits.len() as f64 / inside.len() as f64;
            let rows = hits[0] - 2..hits[hits.len() - 1] + 1;
            self.flaw(
                Flaw::Clipped,
                rows,
                &format!("is limited at {limit} for {share:.1} % of the time"),
            );
            for v in self.values.iter_mut().filter(|v| **v == limit) {
                *v = f64::NAN;
            }
        }
    }

    /// Single values far off both neighbours.
    fn outliers(&mut self) {
        let values = &self.values;
        let off = |i: usize| {
            let (a, b, c) = (values[i - 1], values[i], values[i + 1]);
            (b - (a + b + c - a.min(b).min(c) - a.max(b).max(c))).abs()
        };
        // Against the usual change from row to row, and against the usual noise: a fast and
        // quiet sensor has no outliers in a sharp turn.
        let changes = self.rows(1, 0).map(|i| (values[i] - values[i - 1]).abs());
        let usual = median(changes.filter(|d| *d > 0.0).collect());
        let scale = usual.map_or(0.0, |d| 1.5 * d).max(self.channel.usual_noise);
        let far: Vec<usize> = self
            .rows(1, 1)
            .filter(|&i| off(i) > OUTLIER * scale)
            .collect();
        for &i in &far {
            self.values[i] = f64::NAN;
        }
        if let (Some(first), Some(last)) = (far.first(), far.last()) {
            let message = format!("{} single values far from their neighbours", far.len());
            self.flaw(Flaw::Outlier, *first..last + 1, &message);
        }
    }
}

/// A column in which a missing cell keeps the last value, and the first the next.
fn held(log: &FlightLog, name: &str) -> Option<Vec<f64>> {
    let values = log.column(name)?;
    let mut last = values
        .iter()
        .copied()
        .find(|v| v.is_finite())
        .unwrap_or(0.0);
    let keep = |v: &f64| {
        last = if v.is_finite() { *v } else { last };
        last
    };
    Some(values.iter().map(keep).collect())
}

/// Commands row by row.
fn commands(log: &FlightLog, aircraft: &Aircraft, gated: &mut Gated) -> Vec<SurfaceCommand> {
    let or_none = |name: &str| held(log, name).unwrap_or_else(|| vec![0.0; log.len()]);
    let elevons = held(log, "elevon_left_deg").zip(held(log, "elevon_right_deg"));
    let (left, right, elevator) = match elevons {
        Some((l, r)) => {
            let elevator = l.iter().zip(&r).map(|(l, r)| 0.5 * (l + r)).collect();
            (l, r, elevator)
        }
        None => (
            or_none("aileron_left_deg"),
            or_none("aileron_right_deg"),
            or_none("elevator_deg"),
        ),
    };
    let (rudder, throttle) = (held(log, "rudder_deg"), held(log, "throttle"));
    if rudder.is_none() && aircraft.has_rudder() {
        gated.has_rudder = false;
        let notice = format!("{}: no rudder_deg; the rudder is assumed neutral", log.name);
        gated.notices.push(notice);
    }
    if throttle.is_none() {
        gated.has_throttle = false;
        gated.notices.push(format!(
            "{}: no throttle; that of level flight is assumed, and thrust and drag are not analysed",
            log.name
        ));
    }
    let cruise = aircraft.limits.airspeed_cruise_m_s;
    let level = fdm::trim::level(&Dynamics::new(&Arc::new(aircraft.clone())), cruise, 1.225)
        .map_or(0.5, |t| t.throttle);
    let command = |i: usize| SurfaceCommand {
        elevator_rad: elevator[i].to_radians(),
        aileron_rad: (0.5 * (left[i] - right[i])).to_radians(),
        rudder_rad: rudder.as_ref().map_or(0.0, |r| r[i].to_radians()),
        throttle: throttle.as_ref().map_or(level, |t| t[i]),
        launch: false,
    };
    (0..log.len()).map(command).collect()
}

/// Density of the standard atmosphere at the logged altitude, else at sea level.
fn density(log: &FlightLog) -> Vec<f64> {
    let standard = Atmosphere::standard();
    let heights = held(log, "alt_amsl_m").unwrap_or_else(|| vec![0.0; log.len()]);
    heights
        .into_iter()
        .map(|height| standard.at(height).density_kg_m3())
        .collect()
}

fn logged_wind(log: &FlightLog) -> Option<Vec<[f64; 3]>> {
    let (speed, from) = (log.column("wind_speed_m_s")?, log.column("wind_from_deg")?);
    let mut last = [0.0; 3];
    let mut towards = |(speed, from): (&f64, &f64)| {
        if speed.is_finite() && from.is_finite() {
            let (sin, cos) = from.to_radians().sin_cos();
            last = [-speed * cos, -speed * sin, 0.0];
        }
        last
    };
    Some(speed.iter().zip(from).map(&mut towards).collect())
}
