//! Weather as CSV: `time_s` (since the mission's start) or `time_utc`, `wind_speed_m_s`, `wind_from_deg`, and
//! optionally `wind_height_agl_m`, `temperature_c`, `pressure_hpa` (at the ground), and of the stability one of `stability`
//! (A to F), `obukhov_length_m`, `sigma_theta_deg`, in that order of preference. The header's order is free,
//! other columns are passed over, and what is optional may be empty.

use super::{
    ReportedPressure, ReportedWind, TimeScale, WeatherError, WeatherReport, WeatherReports,
};
use crate::calendar::iso_8601;
use csv::StringRecord;
use plume::stability::Stability;

const EXPECTED: &str = "time_s (or time_utc), wind_speed_m_s, wind_from_deg";

/// Roughness of the ground by which an Obukhov length tells a class, m: open country with hedges.
const ROUGHNESS_M: f64 = 0.1;

pub(super) fn parse(text: &str) -> Result<WeatherReports, WeatherError> {
    let mut reader = csv::ReaderBuilder::new()
        .trim(csv::Trim::All)
        .from_reader(text.as_bytes());
    let refuse = |e: &csv::Error| {
        let line = e.position().map_or(1, csv::Position::line);
        WeatherError::new(
            format!("line {line}"),
            e.to_string(),
            "as many cells as the header has",
        )
    };
    let header = reader.headers().map_err(|e| refuse(&e))?.clone();
    let table = Table { header: &header };
    let scale = if table.has("time_utc") {
        TimeScale::Unix
    } else {
        TimeScale::Mission
    };
    if scale == TimeScale::Mission {
        table.need("time_s")?;
    }
    table.need("wind_speed_m_s")?;
    table.need("wind_from_deg")?;
    let mut reports = Vec::new();
    for record in reader.records() {
        let record = record.map_err(|e| refuse(&e))?;
        reports.push(table.report(&record, scale)?);
    }
    let times = reports.iter().map(|r| r.time_s);
    let as_of_s = times
        .reduce(f64::max)
        .ok_or_else(|| WeatherError::new("line 2", "no rows below the header", "at least one"))?;
    Ok(WeatherReports {
        place: None,
        scale,
        as_of_s,
        reports,
    })
}

struct Table<'a> {
    header: &'a StringRecord,
}

impl Table<'_> {
    fn has(&self, name: &str) -> bool {
        self.header.iter().any(|h| h == name)
    }

    fn need(&self, name: &str) -> Result<(), WeatherError> {
        if self.has(name) {
            return Ok(());
        }
        Err(WeatherError::new(
            "header",
            format!("no column {name}"),
            EXPECTED,
        ))
    }

    fn cell<'r>(&self, record: &'r StringRecord, name: &str) -> &'r str {
        let at = self.header.iter().position(|h| h == name);
        at.and_then(|k| record.get(k)).unwrap_or_default()
    }

    fn wrong(record: &StringRecord, name: &str, found: &str, expected: &str) -> WeatherError {
        let line = record.position().map_or(0, csv::Position::line);
        WeatherError::new(
            format!("line {line}, column {name}"),
            format!("'{found}'"),
            expected,
        )
    }

    fn number(&self, record: &StringRecord, name: &str) -> Result<f64, WeatherError> {
        let cell = self.cell(record, name);
        let number = cell.parse::<f64>().ok().filter(|n| n.is_finite());
        number.ok_or_else(|| Self::wrong(record, name, cell, "a number"))
    }

    fn optional(&self, record: &StringRecord, name: &str) -> Result<Option<f64>, WeatherError> {
        if self.cell(record, name).is_empty() {
            return Ok(None);
        }
        self.number(record, name).map(Some)
    }

    fn report(
        &self,
        record: &StringRecord,
        scale: TimeScale,
    ) -> Result<WeatherReport, WeatherError> {
        let time_s = match scale {
            TimeScale::Mission => self.number(record, "time_s")?,
            TimeScale::Unix => {
                let cell = self.cell(record, "time_utc");
                iso_8601(cell).ok_or_else(|| {
                    Self::wrong(
                        record,
                        "time_utc",
                        cell,
                        "a time such as 2026-11-27T12:30:00Z",
                    )
                })?
            }
        };
        Ok(WeatherReport {
            time_s,
            wind: ReportedWind {
                speed_m_s: self.number(record, "wind_speed_m_s")?,
                from_deg: Some(self.number(record, "wind_from_deg")?),
                height_agl_m: self.optional(record, "wind_height_agl_m")?,
            },
            temperature_c: self.optional(record, "temperature_c")?,
            pressure: self
                .optional(record, "pressure_hpa")?
                .map(ReportedPressure::Ground),
            stability: self.stability(record)?,
        })
    }

    fn stability(&self, record: &StringRecord) -> Result<Option<Stability>, WeatherError> {
        let letter = self.cell(record, "stability");
        if !letter.is_empty() {
            let class = Stability::from_letter(letter);
            let refused = || Self::wrong(record, "stability", letter, "a letter from A to F");
            return class.map(Some).ok_or_else(refused);
        }
        if let Some(length_m) = self.optional(record, "obukhov_length_m")? {
            return Ok(Some(Stability::from_obukhov(length_m, ROUGHNESS_M)));
        }
        let sigma_deg = self.optional(record, "sigma_theta_deg")?;
        Ok(sigma_deg.map(Stability::from_sigma_theta))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_are_found_by_their_names() {
        let text = "station,wind_from_deg,time_utc,wind_speed_m_s,wind_height_agl_m,temperature_c,pressure_hpa\n\
            mast,240,2026-11-27T12:30Z,5.5,30,11,976\nmast,250,2026-11-27T12:40Z,6,,,\n";
        let read = parse(text).unwrap();
        assert_eq!(
            (read.scale, read.as_of_s),
            (TimeScale::Unix, 1_795_783_200.0)
        );
        let [first, second] = read.reports[..] else {
            panic!("{read:?}")
        };
        assert_eq!(first.wind.height_agl_m, Some(30.0));
        assert_eq!(first.pressure, Some(ReportedPressure::Ground(976.0)));
        assert_eq!(
            (second.wind.height_agl_m, second.temperature_c),
            (None, None)
        );
    }

    // Golder (1972), figure 5, at a roughness of .1 m: 1/L = -.067 is B, .067 F; US EPA (2000), table 6-8a: 8° are D.
    #[test]
    fn stability_is_a_letter_a_length_or_a_scatter() {
        let text = "time_s,wind_speed_m_s,wind_from_deg,sigma_theta_deg,obukhov_length_m,stability\n\
            0,5,270,8,-15,E\n1,5,270,8,-15,\n2,5,270,8,15,\n3,5,270,8,,\n4,5,270,,,\n";
        let classes = parse(text).unwrap().classes(None);
        let letters: Vec<(f64, char)> = classes.iter().map(|(t, c)| (*t, c.letter())).collect();
        assert_eq!(letters, [(0.0, 'E'), (1.0, 'B'), (2.0, 'F'), (3.0, 'D')]);
        let refused =
            parse("time_s,wind_speed_m_s,wind_from_deg,stability\n0,5,270,G\n").unwrap_err();
        assert!(
            refused
                .to_string()
                .contains("line 2, column stability: 'G'")
        );
    }

    #[test]
    fn what_is_wrong_is_told_with_its_place() {
        for (text, words) in [
            (
                "time_s,wind_speed_m_s\n0,5\n",
                "header: no column wind_from_deg; expected time_s",
            ),
            (
                "time_s,wind_speed_m_s,wind_from_deg\n0,5,270\n1,fast,270\n",
                "line 3, column wind_speed_m_s: 'fast'",
            ),
            ("time_s,wind_speed_m_s,wind_from_deg\n", "no rows"),
            (
                "time_utc,wind_speed_m_s,wind_from_deg\nnoon,5,270\n",
                "line 2, column time_utc: 'noon'",
            ),
            ("time_s,wind_speed_m_s,wind_from_deg\n0,5\n", "line 2"),
        ] {
            let why = parse(text).unwrap_err().to_string();
            assert!(why.contains(words), "{why}");
        }
    }
}
