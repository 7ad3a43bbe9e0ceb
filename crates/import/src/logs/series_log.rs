//! A log as series, and what its readers share.

use crate::height::Datum;
use crate::map::{ColumnMap, LogMap, Names};
use crate::quantity::{OBSERVATION, Quantity};
use crate::recognise::Header;
use crate::series::Series;
use std::collections::{BTreeMap, BTreeSet};

/// A log as series.
#[derive(Debug, Clone, Default)]
pub struct SeriesLog {
    /// What kind of log it is, in words.
    pub kind: &'static str,
    /// Its series.
    pub series: Vec<Series>,
    /// Whether times count from 1970; else from the start of what logged.
    pub is_absolute: bool,
    /// What was found, in words.
    pub notices: Vec<String>,
    /// Name of the platform, where the log has several.
    pub platform: Option<String>,
    /// What this log shows of its columns, beside what is [known](super::Format::known) of its format.
    pub known: LogMap,
}

/// A column that is one of the series `from`, the first that is there; with an empty unit where the log says it.
pub(crate) fn known_column(from: Vec<String>, unit: &str, datum: Option<Datum>) -> ColumnMap {
    ColumnMap {
        from: Some(Names::Many(from)),
        unit: Some(unit.to_owned()).filter(|u| !u.is_empty()),
        datum,
        ..ColumnMap::default()
    }
}

/// What is known of a column: its name, the series that may be it (parted by blanks, the first that is there), and
/// their unit (empty where the log says it).
pub type Known = (&'static str, &'static str, &'static str);

/// Which series of a log are kept.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Wanted(BTreeSet<String>);

impl Wanted {
    /// Those that `map` names.
    pub fn of(map: &LogMap) -> Self {
        let named = map.column.values().filter_map(|c| c.from.as_ref());
        Self(named.flat_map(|n| n.all()).cloned().collect())
    }

    /// Whether the series `name` is kept: those that are named, and gases.
    pub fn keeps(&self, name: &str) -> bool {
        self.0.contains(name) || is_gas(name)
    }
}

/// Whether the field of a series is called like a gas.
pub fn is_gas(name: &str) -> bool {
    let field = Header::new(name.rsplit('.').next().unwrap_or(name));
    let gases = OBSERVATION.iter().filter(|q| q.is_gas());
    gases
        .into_iter()
        .any(|q: &Quantity| field.quantity(q).is_some())
}

/// Series by their names, while a log is read.
#[derive(Debug, Default)]
pub struct Collected(BTreeMap<String, Series>);

impl Collected {
    /// Adds a value to the series `name`.
    pub fn push(&mut self, name: &str, time_s: f64, value: f64) {
        if let Some(series) = self.0.get_mut(name) {
            series.push(time_s, value);
            return;
        }
        let mut series = Series::new(name);
        series.push(time_s, value);
        self.0.insert(name.to_owned(), series);
    }

    /// States the unit of the series `name`.
    pub fn unit(&mut self, name: &str, unit: &str) {
        if let Some(series) = self.0.get_mut(name) {
            unit.clone_into(&mut series.unit);
        }
    }

    /// The log of an autopilot of this `kind`: its times in UTC, as `clock` words it, where fixes say what UTC is ahead of
    /// them, s, and since its start where there was no fix.
    pub fn of_autopilot(
        self,
        kind: &'static str,
        mut ahead_s: Vec<f64>,
        mut notices: Vec<String>,
        clock: &str,
    ) -> SeriesLog {
        // The median: a few wrong fixes do not move it.
        ahead_s.sort_by(f64::total_cmp);
        let ahead_s = ahead_s.get(ahead_s.len() / 2).copied();
        notices.push(match ahead_s {
            Some(_) => clock.to_owned(),
            None => {
                "assumed: times count from the start of the autopilot, since no GPS fix gives the time"
                    .to_owned()
            }
        });
        SeriesLog {
            kind,
            series: self.finish(ahead_s.unwrap_or(0.0)),
            is_absolute: ahead_s.is_some(),
            notices,
            ..SeriesLog::default()
        }
    }

    /// All series, their times moved by `shift_s` and in order.
    pub fn finish(self, shift_s: f64) -> Vec<Series> {
        let mut all: Vec<Series> = self.0.into_values().collect();
        for series in &mut all {
            for time_s in &mut series.time_s {
                *time_s += shift_s;
            }
            series.sort();
        }
        all.retain(|s| !s.time_s.is_empty());
        all
    }
}

/// Adds the speed and direction of a wind that blows *towards* `north` and `east`, m/s.
pub fn push_wind(series: &mut Collected, topic: &str, time_s: f64, north: f64, east: f64) {
    series.push(&format!("{topic}.wind_speed"), time_s, north.hypot(east));
    series.push(
        &format!("{topic}.wind_from"),
        time_s,
        air::wind::from_deg(east, north),
    );
}
