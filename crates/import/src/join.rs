//! A log of readings and a log of a track, joined by time.

use crate::in_order::Stamps;
use crate::quantity::{Dimension, Quantity};
use crate::series::Series;
use crate::sink::Table;
use air::isa::Atmosphere;
use plume::score;

/// Offsets between two clocks are sought so far to both sides, s.
const SOUGHT_S: f64 = 300.0;
/// Below this correlation two logs do not tell their offset.
const LEAST_CORRELATION: f64 = 0.9;
/// So much less a correlation has to be this far from its best, s, or it tells no offset.
const TOLD: (f64, f64) = (5.0, 0.01);
/// Both logs have to share so much time, s.
const LEAST_SHARED_S: f64 = 60.0;
/// Points at which two logs are compared at most.
const MOST_POINTS: usize = 6000;

/// What clocks differ by, and how it was told.
#[derive(Debug, Clone, PartialEq)]
pub struct ClockOffset {
    /// What is added to the readings' times, s.
    pub offset_s: f64,
    /// How it was told, in words.
    pub basis: String,
}

/// A table's columns of one platform as series.
pub fn series(table: &Table, platform: usize) -> Vec<(&'static Quantity, Series)> {
    let mut all: Vec<(&'static Quantity, Series)> = table
        .columns
        .iter()
        .map(|q| (*q, Series::new(q.name)))
        .collect();
    for row in (0..table.len()).filter(|r| table.platform[*r] == platform) {
        for ((_, series), value) in all.iter_mut().zip(table.row(row)) {
            series.push(table.time_s[row], *value);
        }
    }
    for (_, series) in &mut all {
        series.sort();
    }
    all.retain(|(_, s)| !s.time_s.is_empty());
    all
}

/// Adds to `readings` the columns of `track` that they lack, at their times moved by `offset_s`. How many rows have
/// all of them.
pub fn fill(readings: &mut Table, track: &[(&'static Quantity, Series)], offset_s: f64) -> usize {
    let is_empty = |k: usize| (0..readings.len()).all(|r| readings.row(r)[k].is_nan());
    let lacks = |q: &Quantity| {
        let there = readings.columns.iter().position(|c| c.name == q.name);
        there.is_none_or(is_empty)
    };
    let added: Vec<&(&'static Quantity, Series)> = track.iter().filter(|(q, _)| lacks(q)).collect();
    let names: Vec<&str> = added.iter().map(|(q, _)| q.name).collect();
    let kept: Vec<usize> = (0..readings.columns.len())
        .filter(|k| !names.contains(&readings.columns[*k].name))
        .collect();
    let mut readers: Vec<_> = added.iter().map(|(q, s)| s.reader(q)).collect();
    let mut values = Vec::with_capacity(readings.len() * (kept.len() + added.len()));
    let mut whole = 0;
    for row in 0..readings.len() {
        readings.time_s[row] += offset_s;
        let old = readings.row(row);
        values.extend(kept.iter().map(|k| old[*k]));
        let mut is_whole = true;
        for (reader, (quantity, _)) in readers.iter_mut().zip(&added) {
            let value = reader.at(readings.time_s[row]);
            is_whole &= value.is_finite();
            values.push(crate::number::rounded(value, quantity.decimals));
        }
        whole += usize::from(is_whole);
    }
    let columns = kept.iter().map(|k| readings.columns[*k]);
    readings.columns = columns.chain(added.iter().map(|(q, _)| *q)).collect();
    readings.values = values;
    whole
}

/// What the clock of `readings` lacks to that of `track`, by what both measure; none where they tell nothing.
pub fn offset(
    readings: &[(&'static Quantity, Series)],
    track: &[(&'static Quantity, Series)],
) -> Option<ClockOffset> {
    let of = |all: &[(&'static Quantity, Series)], name: &str| {
        all.iter()
            .find(|(q, _)| q.name == name)
            .map(|(_, s)| s.clone())
    };
    // The sharpest first: heights are taken at once, thermometers lag.
    let pairs = [
        ("alt_amsl_m", "alt_amsl_m"),
        ("pressure_hpa", "alt_amsl_m"),
        ("alt_amsl_m", "pressure_hpa"),
        ("pressure_hpa", "pressure_hpa"),
        ("temperature_c", "temperature_c"),
    ];
    pairs.into_iter().find_map(|(a, b)| {
        let (mut one, mut other) = (of(readings, a)?, of(track, b)?);
        if a != b {
            as_height(&mut one, a);
            as_height(&mut other, b);
        }
        let (offset_s, correlation) = best(&one, &other)?;
        let what = if a == b { a.to_owned() } else { format!("{a} and {b}") };
        let basis = format!(
            "clock offset of {offset_s} s, at which {what} of both logs agree best (correlation {correlation:.3})"
        );
        Some(ClockOffset { offset_s, basis })
    })
}

/// Pressures become the heights of the standard atmosphere.
fn as_height(series: &mut Series, name: &str) {
    if name == "pressure_hpa" {
        for value in &mut series.values {
            *value = Atmosphere::standard().altitude_of_amsl_m(*value * 100.0);
        }
    }
}

/// The offset at which `one`, moved by it, follows `other` best, and the correlation there.
fn best(one: &Series, other: &Series) -> Option<(f64, f64)> {
    let plain = Quantity {
        name: "",
        dimension: Dimension::Length,
        decimals: 0,
        aliases: "",
    };
    let span = one.time_s.last()? - one.time_s.first()?;
    let step_s = one
        .step_s()?
        .max(other.step_s()?)
        .clamp(0.2, 5.0)
        .max(span / MOST_POINTS as f64);
    let count = (span / step_s) as usize;
    let mut reader = one.reader(&plain);
    let first_s = *one.time_s.first()?;
    let points: Vec<(f64, f64)> = (0..count)
        .map(|k| first_s + k as f64 * step_s)
        .map(|t| (t, reader.at(t)))
        .filter(|(_, v)| v.is_finite())
        .collect();
    let at = |lag: i64| correlation(&points, other, &plain, lag as f64 * step_s, step_s);
    let most = (SOUGHT_S / step_s) as i64;
    let all: Vec<f64> = (-most..=most)
        .map(|lag| at(lag).unwrap_or(f64::NAN))
        .collect();
    let top = (0..all.len())
        .filter(|k| all[*k].is_finite())
        .max_by(|a, b| all[*a].total_cmp(&all[*b]))?;
    let far = (TOLD.0 / step_s).ceil() as usize;
    let (left, right) = (all.get(top.checked_sub(far)?)?, all.get(top + far)?);
    let is_told = all[top] >= LEAST_CORRELATION && all[top] - left.max(*right) >= TOLD.1;
    if !is_told {
        return None;
    }
    // The top of the parabola through three points (finer than the steps of the clocks it is not).
    let (a, b, c) = (all[top - 1], all[top], all[top + 1]);
    let bend = a - 2.0 * b + c;
    let shift = if bend < 0.0 {
        0.5 * (a - c) / bend
    } else {
        0.0
    };
    let offset_s = (top as f64 - most as f64 + shift.clamp(-0.5, 0.5)) * step_s;
    Some((crate::number::rounded(offset_s, 1), all[top]))
}

fn correlation(
    points: &[(f64, f64)],
    other: &Series,
    plain: &Quantity,
    lag_s: f64,
    step_s: f64,
) -> Option<f64> {
    let mut reader = other.reader(plain);
    let both = points.iter().filter_map(|(time_s, x)| {
        let y = reader.at(time_s + lag_s);
        y.is_finite().then_some((*x, y))
    });
    let both: Vec<(f64, f64)> = both.collect();
    let n = both.len() as f64;
    let shares = n * step_s >= LEAST_SHARED_S && n * 2.0 >= points.len() as f64;
    shares
        .then(|| score::correlation(both.iter().copied()))
        .flatten()
}

/// Rows of several tables one after the other, with the columns that any of them has in the order of `columns`.
pub fn appended(tables: &[Table], columns: &[&'static Quantity]) -> Table {
    let has = |q: &&&'static Quantity| {
        tables
            .iter()
            .any(|t| t.columns.iter().any(|c| c.name == q.name))
    };
    let columns: Vec<&'static Quantity> = columns.iter().filter(has).copied().collect();
    let mut all = Table::new(columns.clone());
    for table in tables {
        let places: Vec<Option<usize>> = columns
            .iter()
            .map(|q| table.columns.iter().position(|c| c.name == q.name))
            .collect();
        for row in 0..table.len() {
            let old = table.row(row);
            let values: Vec<f64> = places
                .iter()
                .map(|p| p.map_or(f64::NAN, |p| old[p]))
                .collect();
            all.push(
                table.time_s[row],
                &table.platforms[table.platform[row]],
                &values,
            );
        }
    }
    all
}

/// How the times of a table are stamped.
pub fn stamps(table: &Table) -> Stamps {
    let times: Vec<(f64, usize)> = table
        .time_s
        .iter()
        .copied()
        .zip(table.platform.iter().copied())
        .collect();
    Stamps::of(&times)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A height over time with steps of its own, as a drone climbs and sinks.
    fn height(time_s: f64) -> f64 {
        100.0 + 40.0 * (time_s / 37.0).sin() + 15.0 * (time_s / 11.0).cos()
    }

    fn sampled(
        name: &str,
        step_s: f64,
        value: impl Fn(f64) -> f64,
    ) -> Vec<(&'static Quantity, Series)> {
        let mut series = Series::new(name);
        for k in 0..(900.0 / step_s) as usize {
            let time_s = k as f64 * step_s;
            series.push(time_s, value(time_s));
        }
        vec![(Quantity::named(name).unwrap(), series)]
    }

    #[test]
    fn clocks_are_set_by_what_both_logs_measure() {
        let track = sampled("alt_amsl_m", 1.0, height);
        // The readings' clock is 23.4 s late: what it calls t is t + 23.4 of the track's.
        let pressure = |t: f64| Atmosphere::standard().at(height(t + 23.4)).pressure_pa / 100.0;
        let readings = sampled("pressure_hpa", 0.5, pressure);
        let told = offset(&readings, &track).unwrap();
        assert!((told.offset_s - 23.4).abs() < 0.2, "{told:?}");
        assert!(told.basis.contains("pressure_hpa and alt_amsl_m"));
    }

    #[test]
    fn what_tells_nothing_gives_no_offset() {
        let track = sampled("alt_amsl_m", 1.0, height);
        // A slow drift correlates with anything slow, and a constant with nothing.
        assert_eq!(
            offset(&sampled("alt_amsl_m", 1.0, |t| t / 1e3), &track),
            None
        );
        assert_eq!(offset(&sampled("alt_amsl_m", 1.0, |_| 100.0), &track), None);
        assert_eq!(offset(&sampled("temperature_c", 1.0, height), &track), None);
        let slow = sampled("alt_amsl_m", 1.0, |t| t);
        assert_eq!(offset(&slow, &sampled("alt_amsl_m", 1.0, |t| t)), None);
    }

    #[test]
    fn readings_get_the_tracks_columns_at_their_times() {
        let mut readings = Table::new(vec![Quantity::named("co2_ppm").unwrap()]);
        for time_s in [9.5, 10.5, 1000.0] {
            readings.push(time_s, "a", &[421.0]);
        }
        let track = sampled("alt_amsl_m", 1.0, |t| 10.0 * t);
        assert_eq!(fill(&mut readings, &track, 0.5), 2);
        assert_eq!(readings.row(0), [421.0, 100.0]);
        assert_eq!(readings.row(1), [421.0, 110.0]);
        assert!(readings.row(2)[1].is_nan());
        assert_eq!(readings.time_s, [10.0, 11.0, 1000.5]);
    }
}
