//! Weather as CSV: `time_s` (since the mission's start) or `time_utc`, `wind_speed_m_s`, `wind_from_deg`, and
//! optionally `wind_height_agl_m`, `temperature_c`, `pressure_hpa` (at the ground), and of the stability one of `stability`
//! (A to F), `obukhov_length_m`, `sigma_theta_deg`, in that order of preference. The header's order is free,
//! other columns are ignored, and cells of optional columns may be empty.

use super::{
    ReportedPressure, ReportedWind, TimeScale, WeatherError, WeatherReport, WeatherReports,
};
use formats::calendar::iso_8601;
use formats::delimited::{Column, Row, Table, TableError};
use plume::stability::Stability;

/// Roughness of the ground by which an Obukhov length tells a class, m: open country with hedges.
const ROUGHNESS_M: f64 = 0.1;

const COLUMNS: [Column; 10] = [
    Column::optional("time_s"),
    Column::optional("time_utc"),
    Column::required("wind_speed_m_s"),
    Column::required("wind_from_deg"),
    Column::optional("wind_height_agl_m"),
    Column::optional("temperature_c"),
    Column::optional("pressure_hpa"),
    Column::optional("stability"),
    Column::optional("obukhov_length_m"),
    Column::optional("sigma_theta_deg"),
];
/// Places of these columns.
const TIME_S: usize = 0;
const TIME_UTC: usize = 1;
const SPEED: usize = 2;
const FROM: usize = 3;
const HEIGHT: usize = 4;
const TEMPERATURE: usize = 5;
const PRESSURE: usize = 6;
const STABILITY: usize = 7;
const OBUKHOV: usize = 8;
const SIGMA: usize = 9;

impl From<TableError> for WeatherError {
    fn from(error: TableError) -> Self {
        Self::new(error.place(), error.problem, error.expected)
    }
}

pub(super) fn parse(text: &str) -> Result<WeatherReports, WeatherError> {
    let mut table = Table::open("", text, &COLUMNS, false)?;
    let scale = match (table.header.has(TIME_UTC), table.header.has(TIME_S)) {
        (true, _) => TimeScale::Unix,
        (false, true) => TimeScale::Mission,
        (false, false) => {
            let expected = "time_s (or time_utc), wind_speed_m_s, wind_from_deg";
            return Err(table.header.error("time_s", "missing", expected).into());
        }
    };
    let mut reports = Vec::new();
    while let Some(row) = table.next_row()? {
        reports.push(report(&row, scale)?);
    }
    let times = reports.iter().map(|r| r.time_s);
    Ok(WeatherReports {
        place: None,
        scale,
        as_of_s: times.reduce(f64::max).ok_or_else(|| table.no_rows())?,
        reports,
    })
}

fn report(row: &Row<'_>, scale: TimeScale) -> Result<WeatherReport, TableError> {
    let utc = || iso_8601(row.text(TIME_UTC));
    let time_s = match scale {
        TimeScale::Mission => row.needed(TIME_S)?,
        TimeScale::Unix => {
            utc().ok_or_else(|| row.wrong(TIME_UTC, "a time such as 2026-11-27T12:30:00Z"))?
        }
    };
    Ok(WeatherReport {
        time_s,
        wind: ReportedWind {
            speed_m_s: row.needed(SPEED)?,
            from_deg: Some(row.needed(FROM)?),
            height_agl_m: row.number(HEIGHT)?,
        },
        temperature_c: row.number(TEMPERATURE)?,
        pressure: row.number(PRESSURE)?.map(ReportedPressure::Ground),
        stability: stability(row)?,
    })
}

fn stability(row: &Row<'_>) -> Result<Option<Stability>, TableError> {
    let letter = row.text(STABILITY);
    if !letter.is_empty() {
        let class = Stability::from_letter(letter);
        let wrong = || row.wrong(STABILITY, "a letter from A to F");
        return class.map(Some).ok_or_else(wrong);
    }
    if let Some(length_m) = row.number(OBUKHOV)? {
        return Ok(Some(Stability::from_obukhov(length_m, ROUGHNESS_M)));
    }
    Ok(row.number(SIGMA)?.map(Stability::from_sigma_theta))
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
                .contains("line 2, column stability: found \"G\"")
        );
    }

    #[test]
    fn what_is_wrong_is_told_with_its_place() {
        for (text, words) in [
            (
                "time_s,wind_speed_m_s\n0,5\n",
                "line 1, column wind_from_deg: missing; the header has time_s",
            ),
            (
                "time_s,wind_speed_m_s,wind_from_deg\n0,5,270\n1,fast,270\n",
                "line 3, column wind_speed_m_s: found \"fast\"",
            ),
            ("time_s,wind_speed_m_s,wind_from_deg\n", "no rows"),
            (
                "time_utc,wind_speed_m_s,wind_from_deg\nnoon,5,270\n",
                "line 2, column time_utc: found \"noon\"",
            ),
            ("time_s,wind_speed_m_s,wind_from_deg\n0,5\n", "line 2"),
        ] {
            let why = parse(text).unwrap_err().to_string();
            assert!(why.contains(words), "{why}");
        }
    }
}
