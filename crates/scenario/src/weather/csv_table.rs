//! Weather as CSV: `time_s` (since the mission's start) or `time_utc`, `wind_speed_m_s`, `wind_from_deg`, and
//! optionally `wind_height_agl_m`, `temperature_c`, `pressure_hpa` (at the ground), and of the stability one of `stability`
//! (A to F), `obukhov_length_m`, `sigma_theta_deg`, in that order of preference. The header's order is free,
//! other columns are ignored. Cells of optional columns may be empty or hold a [code](MISSING) for a missing value.

use super::report::{
    ReportedPressure, ReportedWind, TimeScale, WeatherError, WeatherReport, WeatherReports,
};
use formats::calendar::iso_8601;
use formats::delimited::{Column, Row, Table, TableError};
use plume::stability::Stability;

/// Roughness of the ground by which an Obukhov length tells a class, m: open country with hedges.
const ROUGHNESS_M: f64 = 0.1;

/// Numbers that stand for a missing value: EddyPro -9999, AERMET -99999, Campbell Scientific's loggers 6999 and 7999,
/// buoys of the NDBC 99, 999 and 9999. In a column whose range they are in (999 hPa) they are values. An Obukhov length
/// may be of any size; there those of three digits and more are codes.
const MISSING: [f64; 10] = [
    99.0, 99.9, 999.0, 999.9, 6999.0, 7999.0, 9999.0, 9999.9, 99_999.0, 999_999.0,
];
const LEAST_CODE_OF_LENGTH: f64 = 999.0;
/// Beyond this a number is a model's fill value (-3.4e38, 9.97e36, 1e20), whatever it should measure.
const FILL: f64 = 1e7;

const COLUMNS: [Column; 10] = [
    Column::optional("time_s"),
    Column::optional("time_utc"),
    Column::required("wind_speed_m_s").of((0.0, 80.0, "")),
    Column::required("wind_from_deg").of((-720.0, 720.0, "")),
    Column::optional("wind_height_agl_m").of((0.1, 5000.0, "")),
    Column::optional("temperature_c").of((-80.0, 60.0, "")),
    Column::optional("pressure_hpa").of((300.0, 1100.0, "")),
    Column::optional("stability"),
    Column::optional("obukhov_length_m"),
    Column::optional("sigma_theta_deg").of((0.0, 180.0, "")),
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
            height_agl_m: known(row, HEIGHT)?,
        },
        temperature_c: known(row, TEMPERATURE)?,
        pressure: known(row, PRESSURE)?.map(ReportedPressure::Ground),
        stability: stability(row)?,
    })
}

/// The number of an optional column; none where the cell is empty or holds a code for a missing value.
fn known(row: &Row<'_>, column: usize) -> Result<Option<f64>, TableError> {
    let (low, high) = COLUMNS[column].range;
    let may_be_code = |size: f64| match column {
        OBUKHOV => size >= LEAST_CODE_OF_LENGTH,
        _ => true,
    };
    let is_code = |value: f64| {
        let has_no_range = [OBUKHOV, STABILITY].contains(&column);
        let beyond = has_no_range || !(low..=high).contains(&value);
        let size = value.abs();
        beyond && (size >= FILL || (MISSING.contains(&size) && may_be_code(size)))
    };
    match row.text(column).parse::<f64>() {
        Ok(value) if is_code(value) => Ok(None),
        _ => row.number(column),
    }
}

fn stability(row: &Row<'_>) -> Result<Option<Stability>, TableError> {
    let letter = row.text(STABILITY);
    if !letter.is_empty() && known(row, STABILITY) != Ok(None) {
        let class = Stability::from_letter(letter);
        let wrong = || row.wrong(STABILITY, "a letter from A to F");
        return class.map(Some).ok_or_else(wrong);
    }
    if let Some(length_m) = known(row, OBUKHOV)? {
        return Ok(Some(Stability::from_obukhov(length_m, ROUGHNESS_M)));
    }
    Ok(known(row, SIGMA)?.map(Stability::from_sigma_theta))
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

    // EddyPro's full output, AERMET's surface file, a Campbell Scientific logger, NDBC's buoys, NetCDF's default fill.
    #[test]
    fn a_code_for_a_missing_value_is_no_length_and_no_state_of_the_air() {
        for code in [
            "",
            "nan",
            "-9999",
            "-9999.0",
            "-99999.0",
            "7999",
            "999",
            "9.96921e36",
            "-3.4e38",
        ] {
            let text = format!(
                "time_s,wind_speed_m_s,wind_from_deg,obukhov_length_m,temperature_c,wind_height_agl_m\n\
                 0,5,270,15,12,10\n1,5,270,{code},{code},10\n"
            );
            let read = parse(&text).unwrap();
            let classes: Vec<f64> = read.classes(None).iter().map(|(t, _)| *t).collect();
            assert_eq!(classes, [0.0], "{code}");
            assert_eq!(read.reports[1].temperature_c, None, "{code}");
        }
        // 999 hPa are a pressure, and a wind that is a code is refused with its place.
        let head = "time_s,wind_speed_m_s,wind_from_deg,pressure_hpa\n";
        let read = parse(&format!("{head}0,5,270,999\n1,5,270,-9999\n")).unwrap();
        assert_eq!(
            read.reports[0].pressure,
            Some(ReportedPressure::Ground(999.0))
        );
        assert_eq!(read.reports[1].pressure, None);
        for row in ["-9999,270", "5,-9999", "5,999", "99,270"] {
            let why = parse(&format!("{head}0,{row},\n")).unwrap_err().to_string();
            assert!(why.contains("line 2, column wind_"), "{why}");
        }
        let letters = "time_s,wind_speed_m_s,wind_from_deg,stability\n0,5,270,D\n1,5,270,-9999\n";
        assert_eq!(parse(letters).unwrap().classes(None).len(), 1);
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
