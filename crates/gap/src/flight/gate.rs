//! The gate on raw data: which parts fly, what is frozen, clipped, missing, far off or in a wrong
//! unit. What does not pass is masked, and said.

use air::isa::Atmosphere;
use fdm::{Aircraft, SurfaceCommand};

use super::channel::{ALL, CHANNELS};
use super::log::FlightLog;
use super::{derived, units};
use crate::GapError;
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
        let segments = one(index, log, aircraft, &mut gated);
        gated.segments.extend(segments);
    }
    let flown: f64 = gated.segments.iter().map(duration).sum();
    if flown < SHORTEST_S {
        return Err(GapError::Data {
            what: logs
                .iter()
                .map(|l| l.name.as_str())
                .collect::<Vec<_>>()
                .join(", "),
            problem: format!(
                "no part of at least {SHORTEST_S} s flies faster than {:.1} m/s without a gap",
                FLYING_PART * aircraft.limits.airspeed_min_m_s
            ),
            expected: "a flight of the aircraft in the file, airspeed in m/s".into(),
        });
    }
    enough_rows(logs, &gated)?;
    for (k, channel) in ALL.iter().enumerate() {
        gated.present[k] = gated
            .segments
            .iter()
            .any(|s| s.measured.iter().any(|m| m[k].is_finite()));
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

fn enough_rows(logs: &[FlightLog], gated: &Gated) -> Result<(), GapError> {
    let rows: usize = gated.segments.iter().map(Segment::len).sum();
    if rows >= FEWEST_ROWS {
        return Ok(());
    }
    let names: Vec<&str> = logs.iter().map(|l| l.name.as_str()).collect();
    Err(GapError::Data {
        what: names.join(", "),
        problem: format!("only {rows} rows are in flight"),
        expected: format!("at least {FEWEST_ROWS} rows in flight"),
    })
}

/// Usual time between rows, s.
fn interval_s(log: &FlightLog) -> f64 {
    median(log.time_s().windows(2).map(|w| w[1] - w[0]).collect())
}

fn duration(segment: &Segment) -> f64 {
    segment.time_s.last().unwrap_or(&0.0) - segment.time_s.first().unwrap_or(&0.0)
}

fn one(index: usize, log: &FlightLog, aircraft: &Aircraft, gated: &mut Gated) -> Vec<Segment> {
    let time = log.time_s();
    let interval = interval_s(log);
    let parts = flying_parts(log, aircraft, interval, &mut gated.data_quality);
    let mut channels: Vec<Vec<f64>> = Vec::new();
    for channel in &ALL {
        let mut values = log
            .column(channel.column)
            .map_or_else(|| vec![f64::NAN; time.len()], <[f64]>::to_vec);
        let mut check = Check {
            log,
            label: channel.label,
            column: channel.column,
            usual_noise: channel.usual_noise,
            parts: &parts,
            flaws: &mut gated.data_quality,
            notices: &mut gated.notices,
        };
        check.mask(&mut values, interval);
        channels.push(values.iter().map(|v| v * channel.si).collect());
    }
    let suspected = units::suspected(log, &parts, &channels);
    let derived = derived::found(&parts, &channels);
    for (k, message) in suspected.into_iter().chain(derived) {
        channels[k].fill(f64::NAN);
        gated.data_quality.push(DataQuality {
            platform: log.name.clone(),
            kind: Flaw::Unit,
            from_s: time[0],
            to_s: time[time.len() - 1],
            message,
        });
    }
    let command = commands(log, aircraft, gated);
    let wind = logged_wind(log);
    gated.has_wind &= wind.is_some();
    let density = density(log);
    parts
        .iter()
        .map(|&(from, to)| Segment {
            log: index,
            time_s: time[from..to].to_vec(),
            measured: (from..to)
                .map(|i| std::array::from_fn(|k| channels[k][i]))
                .collect(),
            command: command[from..to].to_vec(),
            density: density[from..to].to_vec(),
            wind_ned: wind.as_ref().map(|w| w[from..to].to_vec()),
        })
        .collect()
}

/// Ranges of rows that fly without a gap in time.
fn flying_parts(
    log: &FlightLog,
    aircraft: &Aircraft,
    interval: f64,
    flaws: &mut Vec<DataQuality>,
) -> Vec<(usize, usize)> {
    let time = log.time_s();
    let slowest = FLYING_PART * aircraft.limits.airspeed_min_m_s;
    let airspeed = log.column("airspeed_m_s").unwrap_or(&[]);
    let longest_step = (5.0 * interval).max(0.3);
    let mut fast = 0.0;
    let mut parts = Vec::new();
    let mut start: Option<usize> = None;
    for i in 0..time.len() {
        // A second's mean, so that a gust does not cut the flight.
        let value = airspeed.get(i).copied().unwrap_or(f64::NAN);
        if value.is_finite() {
            let weight = (interval / 1.0).min(1.0);
            fast += weight * (value - fast);
        }
        let jump = i > 0 && time[i] - time[i - 1] > longest_step;
        if jump && fast > slowest {
            flaws.push(DataQuality {
                platform: log.name.clone(),
                kind: Flaw::Gap,
                from_s: time[i - 1],
                to_s: time[i],
                message: "no rows".into(),
            });
        }
        if (fast <= slowest || jump) && start.is_some() {
            parts.extend(start.take().map(|s| (s, i)));
        }
        if fast > slowest && start.is_none() {
            start = Some(i);
        }
    }
    parts.extend(start.map(|s| (s, time.len())));
    parts
        .into_iter()
        .filter_map(|(from, to)| {
            let inside = |t: f64| t >= time[from] + ENDS_S && t <= time[to - 1] - ENDS_S;
            let first = (from..to).find(|&i| inside(time[i]))?;
            let last = (from..to).rev().find(|&i| inside(time[i]))?;
            (time[last] - time[first] >= SHORTEST_S).then_some((first, last + 1))
        })
        .collect()
}

/// Looks at one channel and masks what is not to be used.
struct Check<'a> {
    log: &'a FlightLog,
    label: &'static str,
    column: &'static str,
    usual_noise: f64,
    parts: &'a [(usize, usize)],
    flaws: &'a mut Vec<DataQuality>,
    notices: &'a mut Vec<String>,
}

impl Check<'_> {
    fn flaw(&mut self, kind: Flaw, from: usize, to: usize, message: String) {
        let time = self.log.time_s();
        self.flaws.push(DataQuality {
            platform: self.log.name.clone(),
            kind,
            from_s: time[from],
            to_s: time[to.min(time.len() - 1)],
            message: format!("{}: {message}", self.label),
        });
    }

    fn mask(&mut self, values: &mut [f64], interval: f64) {
        let inside: Vec<usize> = self.parts.iter().flat_map(|&(a, b)| a + 1..b).collect();
        let known = inside.iter().filter(|&&i| values[i].is_finite()).count();
        if known < 10 {
            return;
        }
        let repeats = |i: &&usize| values[**i] == values[**i - 1];
        let held = inside.iter().filter(repeats).count() as f64 / known as f64;
        let update_s = interval / (1.0 - held).max(1e-3);
        self.frozen(values, update_s);
        if held > HELD_PART {
            let before: Vec<f64> = values.to_vec();
            for i in 1..values.len() {
                if before[i] == before[i - 1] {
                    values[i] = f64::NAN;
                }
            }
            if held < 1.0 - 1e-3 {
                self.notices.push(format!(
                    "{}: {} is sampled every {update_s:.2} s and held; only new values count",
                    self.log.name, self.column
                ));
            }
        } else {
            self.clipped(values);
            self.outliers(values);
        }
    }

    /// Runs of one value that are too long for its usual rate of change.
    fn frozen(&mut self, values: &mut [f64], update_s: f64) {
        let time = self.log.time_s();
        let longest = FROZEN_S.max(8.0 * update_s);
        let parts = self.parts;
        for &(from, to) in parts {
            let mut start = from;
            for i in from + 1..=to {
                if i < to && (values[i] == values[start] || values[start].is_nan()) {
                    if values[start].is_nan() {
                        start = i;
                    }
                    continue;
                }
                if time[i - 1] - time[start] > longest {
                    let seconds = time[i - 1] - time[start];
                    self.flaw(
                        Flaw::Frozen,
                        start,
                        i - 1,
                        format!("stands still for {seconds:.1} s"),
                    );
                    values[start..i].fill(f64::NAN);
                }
                start = i;
            }
        }
    }

    /// A highest or lowest value that comes again and again, several times in a row.
    fn clipped(&mut self, values: &mut [f64]) {
        let finite = |v: &&f64| v.is_finite();
        let inside = || {
            self.parts
                .iter()
                .flat_map(|&(a, b)| &values[a..b])
                .filter(finite)
        };
        let high = inside().fold(f64::NEG_INFINITY, |a, &b| a.max(b));
        let low = inside().fold(f64::INFINITY, |a, &b| a.min(b));
        let count = inside().count();
        for limit in [low, high] {
            let hits: Vec<usize> = self
                .parts
                .iter()
                .flat_map(|&(a, b)| a + 2..b)
                .filter(|&i| (i - 2..=i).all(|k| values[k] == limit))
                .collect();
            if hits.len() < 8 || hits.len() * 200 < count {
                continue;
            }
            let (first, last) = (hits[0] - 2, hits[hits.len() - 1]);
            let share = 100.0 * hits.len() as f64 / count as f64;
            self.flaw(
                Flaw::Clipped,
                first,
                last,
                format!("is limited at {limit} for {share:.1} % of the time"),
            );
            for v in values.iter_mut().filter(|v| **v == limit) {
                *v = f64::NAN;
            }
        }
    }

    /// Single values far off both neighbours.
    fn outliers(&mut self, values: &mut [f64]) {
        let mut off = Vec::new();
        for &(from, to) in self.parts {
            for i in from + 1..to - 1 {
                let (a, b, c) = (values[i - 1], values[i], values[i + 1]);
                off.push((i, b - (a + b + c - a.min(b).min(c) - a.max(b).max(c))));
            }
        }
        // Against the usual change from row to row, and against the usual noise: a fast and
        // quiet sensor has no outliers in a sharp turn.
        let changes = self
            .parts
            .iter()
            .flat_map(|&(a, b)| a + 1..b)
            .map(|i| (values[i] - values[i - 1]).abs())
            .filter(|d| *d > 0.0)
            .collect();
        let scale = (1.5 * median(changes)).max(self.usual_noise);
        let far: Vec<usize> = off
            .iter()
            .filter(|o| o.1.abs() > OUTLIER * scale)
            .map(|o| o.0)
            .collect();
        if far.is_empty() || scale.is_nan() {
            return;
        }
        let message = format!("{} single values far from their neighbours", far.len());
        self.flaw(Flaw::Outlier, far[0], far[far.len() - 1], message);
        for i in far {
            values[i] = f64::NAN;
        }
    }
}

/// Commands row by row; a missing cell keeps the last.
fn commands(log: &FlightLog, aircraft: &Aircraft, gated: &mut Gated) -> Vec<SurfaceCommand> {
    let held = |name: &str| {
        log.column(name).map(|values| {
            let mut last = values
                .iter()
                .copied()
                .find(|v| v.is_finite())
                .unwrap_or(0.0);
            let keep = |v: &f64| {
                if v.is_finite() {
                    last = *v;
                }
                last
            };
            values.iter().map(keep).collect::<Vec<f64>>()
        })
    };
    let none = vec![0.0; log.len()];
    let (left, right, elevator);
    if let (Some(l), Some(r)) = (held("elevon_left_deg"), held("elevon_right_deg")) {
        elevator = l.iter().zip(&r).map(|(l, r)| 0.5 * (l + r)).collect();
        (left, right) = (l, r);
    } else {
        elevator = held("elevator_deg").unwrap_or_else(|| none.clone());
        left = held("aileron_left_deg").unwrap_or_else(|| none.clone());
        right = held("aileron_right_deg").unwrap_or_else(|| none.clone());
    }
    let rudder = held("rudder_deg");
    let throttle = held("throttle");
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
    let dynamics = fdm::dynamics::Dynamics::new(aircraft);
    let cruise = aircraft.limits.airspeed_cruise_m_s;
    let level = fdm::trim::level(&dynamics, cruise, 1.225).map_or(0.5, |t| t.throttle);
    (0..log.len())
        .map(|i| SurfaceCommand {
            elevator_rad: elevator[i].to_radians(),
            aileron_rad: (0.5 * (left[i] - right[i])).to_radians(),
            rudder_rad: rudder.as_ref().map_or(0.0, |r| r[i].to_radians()),
            throttle: throttle.as_ref().map_or(level, |t| t[i]),
            launch: false,
        })
        .collect()
}

/// Density of the standard atmosphere at the logged altitude, else at sea level.
fn density(log: &FlightLog) -> Vec<f64> {
    let standard = Atmosphere::standard();
    let heights = log.column("alt_amsl_m");
    let mut last = 0.0;
    (0..log.len())
        .map(|i| {
            if let Some(height) = heights.map(|h| h[i]).filter(|h| h.is_finite()) {
                last = height;
            }
            standard.at(last).density_kg_m3()
        })
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

/// The middle value; NaN of none.
pub fn median(mut values: Vec<f64>) -> f64 {
    values.retain(|v| !v.is_nan());
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(f64::NAN)
}
