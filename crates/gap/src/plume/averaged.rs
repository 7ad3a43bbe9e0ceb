//! Readings averaged over one second: faster ones repeat what the air is like, and cost time.

use air::wind::WindVector;
use scenario::observations::{ObservationRow, Observations};
use std::borrow::Cow;

/// Readings are averaged over this time, s.
const ROW_S: f64 = 1.0;

/// Averages rows as they come, each platform in order of time. Rows that are means already stay as they are, and rows
/// without a reading are averaged apart from those with one.
#[derive(Debug, Clone, Default)]
pub struct Averaging {
    /// Two for each platform: rows without and with a reading.
    open: Vec<Vec<ObservationRow>>,
}

impl Averaging {
    /// Takes a row; gives those that are complete.
    pub fn take(&mut self, row: &ObservationRow, out: &mut Vec<ObservationRow>) {
        let slot = 2 * row.platform + usize::from(row.co2_ppm.is_some());
        if self.open.len() <= slot {
            self.open.resize(slot + 1, Vec::new());
        }
        let open = &mut self.open[slot];
        let is_a_mean = row.averaging_s.is_some() || row.line_end.is_some();
        let second = |r: &ObservationRow| (r.time_s / ROW_S).floor();
        let another = open
            .first()
            .is_some_and(|first| is_a_mean || second(first) != second(row));
        if another {
            out.extend(mean(open));
            open.clear();
        }
        if is_a_mean {
            out.push(*row);
        } else {
            open.push(*row);
        }
    }

    /// Gives the rows that are not complete: no more will come.
    pub fn finish(&mut self, out: &mut Vec<ObservationRow>) {
        for open in &mut self.open {
            out.extend(mean(open));
            open.clear();
        }
    }
}

/// Observations with at most one row each second of each platform. Rows of one platform must be in order of time; of
/// others they change nothing.
pub fn averaged(observations: &Observations) -> Cow<'_, Observations> {
    let mut averaging = Averaging::default();
    let mut rows = Vec::with_capacity(observations.rows.len());
    for row in &observations.rows {
        averaging.take(row, &mut rows);
    }
    averaging.finish(&mut rows);
    if rows.len() == observations.rows.len() {
        return Cow::Borrowed(observations);
    }
    Cow::Owned(Observations {
        rows,
        // One cell a row of the raw observations.
        extra: Vec::new(),
        ..observations.clone()
    })
}

/// The mean of rows of one platform; none of none.
fn mean(rows: &[ObservationRow]) -> Option<ObservationRow> {
    let first = rows.first()?;
    if rows.len() == 1 {
        return Some(*first);
    }
    let known = |of: &dyn Fn(&ObservationRow) -> Option<f64>| {
        let values: Vec<f64> = rows.iter().filter_map(of).collect();
        let count = values.len() as f64;
        (count > 0.0).then(|| values.iter().sum::<f64>() / count)
    };
    let all = |of: fn(&ObservationRow) -> f64| rows.iter().map(of).sum::<f64>() / rows.len() as f64;
    let unit = |r: &ObservationRow| {
        let speed = r.wind_speed_m_s.unwrap_or(1.0);
        Some(WindVector::from_speed_and_direction(
            speed,
            r.wind_from_deg?,
        ))
    };
    let east = known(&|r| Some(unit(r)?.east_m_s));
    let north = known(&|r| Some(unit(r)?.north_m_s));
    let towards = east.zip(north).map(|(east_m_s, north_m_s)| WindVector {
        east_m_s,
        north_m_s,
    });
    let count = rows.len() as f64;
    let time_s = all(|r| r.time_s);
    let variance_s2 = rows
        .iter()
        .map(|r| (r.time_s - time_s).powi(2))
        .sum::<f64>()
        / count;
    Some(ObservationRow {
        time_s,
        platform: first.platform,
        lat_deg: all(|r| r.lat_deg),
        lon_deg: all(|r| r.lon_deg),
        alt_amsl_m: all(|r| r.alt_amsl_m),
        co2_ppm: known(&|r| r.co2_ppm),
        wind_speed_m_s: known(&|r| r.wind_speed_m_s),
        wind_from_deg: towards.map(WindVector::from_deg),
        temperature_c: known(&|r| r.temperature_c),
        relative_humidity_pct: known(&|r| r.relative_humidity_pct),
        pressure_hpa: known(&|r| r.pressure_hpa),
        // White noise of independent readings.
        sd_ppm: known(&|r| r.sd_ppm).map(|sd| sd / count.sqrt()),
        averaging_s: None,
        line_end: None,
        spread_s: variance_s2.sqrt(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn row(platform: usize, time_s: f64, ppm: Option<f64>, from_deg: f64) -> ObservationRow {
        ObservationRow {
            platform,
            time_s,
            co2_ppm: ppm,
            wind_speed_m_s: Some(4.0),
            wind_from_deg: Some(from_deg),
            sd_ppm: Some(3.0),
            ..ObservationRow::default()
        }
    }

    fn of(rows: Vec<ObservationRow>) -> Observations {
        Observations {
            rows,
            ..Observations::default()
        }
    }

    #[test]
    fn the_rows_of_a_second_become_one() {
        let raw = of(vec![
            row(0, 1.1, Some(400.0), 350.0),
            row(1, 1.2, Some(500.0), 90.0),
            row(0, 1.4, Some(404.0), 10.0),
            row(0, 1.5, None, 180.0),
            row(0, 1.7, Some(402.0), 30.0),
            row(0, 2.1, Some(410.0), 90.0),
        ]);
        let found = averaged(&raw);
        let of_first = |r: &&ObservationRow| r.platform == 0 && r.time_s < 2.0;
        let read = found.rows.iter().filter(of_first);
        let means: Vec<&ObservationRow> = read.filter(|r| r.co2_ppm.is_some()).collect();
        let mean = means[0];
        assert_eq!(means.len(), 1);
        assert_eq!(found.rows.len(), 4);
        assert!((mean.time_s - 1.4).abs() < 1e-12 && mean.co2_ppm == Some(402.0));
        // The mean of the vectors from 350°, 10° and 30° of one length is from 10°.
        assert!((mean.wind_from_deg.unwrap() - 10.0).abs() < 1e-9);
        assert!((mean.sd_ppm.unwrap() - 3f64.sqrt()).abs() < 1e-12);
    }

    #[test]
    fn slow_rows_and_means_stay_as_they_are() {
        let mut minute = row(0, 60.2, Some(401.0), 20.0);
        minute.averaging_s = Some(60.0);
        let raw = of(vec![row(0, 60.0, Some(400.0), 10.0), minute]);
        assert!(matches!(averaged(&raw), Cow::Borrowed(_)));
    }
}
