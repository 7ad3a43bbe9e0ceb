//! METAR and SPECI, the reports of aerodromes (ICAO Annex 3, appendix 3; WMO-No. 306, FM 15): of each the
//! time, the surface wind (the mean of ten minutes at 10 m), the temperature and the QNH.
//!
//! A parser of our own: of the many groups four are needed, and the text around reports, such as the dates
//! of NOAA's files, is no part of the code form.

use super::report::{
    ReportedPressure, ReportedWind, TimeScale, WeatherError, WeatherReport, WeatherReports,
};
use formats::calendar::{DAY_S, date, days};

/// Height of the wind above ground, m (ICAO Annex 3, 4.1.1.1).
const WIND_HEIGHT_AGL_M: f64 = 10.0;
/// Metres per second in a knot, and in a km/h.
const KNOT_M_S: f64 = 1852.0 / 3600.0;
const KM_H_M_S: f64 = 1.0 / 3.6;
/// Hectopascals in an inch of mercury.
const INCH_HG_HPA: f64 = 33.8639;
/// A wind reported as calm is below 1 kt: half of that.
const CALM_M_S: f64 = 0.5 * KNOT_M_S;
/// The day near which reports of no known month are: what is between them counts, not when they are.
const SOME_DAY_S: f64 = 15.0 * DAY_S;
/// Groups after which a report tells of other times, or in words.
const ENDS: [&str; 5] = ["RMK", "BECMG", "TEMPO", "NOSIG", "TAF"];
/// Words between `TAF` and the aerodrome: amended, corrected, cancelled.
const FORECAST_KINDS: [&str; 3] = ["AMD", "COR", "CNL"];

/// Reads all reports of a text; words around them are passed over.
pub(super) fn parse(text: &str, near_unix_s: Option<f64>) -> Result<WeatherReports, WeatherError> {
    let groups: Vec<&str> = text
        .split([' ', '\t', '\r', '\n', '='])
        .filter(|g| !g.is_empty())
        .collect();
    let starts: Vec<usize> = (0..groups.len())
        .filter(|&k| time(groups[k]).is_some())
        .collect();
    let mut near_s = near_unix_s.unwrap_or(SOME_DAY_S);
    let mut reports = Vec::new();
    let mut station = None;
    let mut why = WeatherError::new(
        "the text",
        "no report",
        "CSV with time_s, wind_speed_m_s, wind_from_deg, a METAR such as LEST 271230Z 24015KT 18/09 Q1013, \
         or the JSON of Open-Meteo",
    );
    for (n, &start) in starts.iter().enumerate() {
        let end = starts.get(n + 1).copied().unwrap_or(groups.len());
        let own = &groups[start + 1..end];
        if is_forecast(&groups[..start], own) {
            continue;
        }
        let own: Vec<&str> = own
            .iter()
            .copied()
            .take_while(|g| !ENDS.contains(g))
            .collect();
        let Some(time_s) = time(groups[start]).and_then(|t| t.nearest(near_s)) else {
            why = WeatherError::new(
                groups[start],
                "no such day",
                "day, hour and minute such as 271230Z",
            );
            continue;
        };
        let Some(wind) = own.iter().find_map(|g| wind(g)) else {
            why = WeatherError::new(
                groups[start],
                "no wind",
                "a group such as 24015G25KT, 24008MPS, VRB03KT or 00000KT",
            );
            continue;
        };
        if let Some(own) = start
            .checked_sub(1)
            .map(|k| groups[k])
            .filter(|g| is_station(g))
        {
            if station.is_some_and(|first| first != own) {
                return Err(WeatherError::new(
                    format!("{own} {}", groups[start]),
                    format!("another aerodrome than {}", station.unwrap_or_default()),
                    "reports of one aerodrome",
                ));
            }
            station = Some(own);
        }
        near_s = time_s;
        reports.push(WeatherReport {
            time_s,
            wind,
            temperature_c: own.iter().find_map(|g| temperature_c(g)),
            pressure: own
                .iter()
                .find_map(|g| qnh_hpa(g))
                .map(ReportedPressure::SeaLevel),
            stability: None,
        });
    }
    let as_of_s = reports
        .iter()
        .map(|r| r.time_s)
        .reduce(f64::max)
        .ok_or(why)?;
    Ok(WeatherReports {
        scale: TimeScale::Unix,
        place: None,
        as_of_s,
        reports,
    })
}

/// Whether the report is a forecast of an aerodrome (TAF): `TAF` stands before it, also with AMD or COR, or behind its
/// time the period that it is for, `2712/2812` (ICAO Annex 3, appendix 5; WMO-No. 306, FM 51).
fn is_forecast(before: &[&str], own: &[&str]) -> bool {
    let mut before = before
        .iter()
        .rev()
        .skip_while(|g| is_station(g) || FORECAST_KINDS.contains(g));
    let is_period = |group: &&str| {
        let parts = group.split_once('/');
        parts.is_some_and(|(from, to)| [from, to].iter().all(|p| p.len() == 4 && all_digits(p)))
    };
    before.next() == Some(&"TAF") || own.first().is_some_and(is_period)
}

/// A location indicator, as `LEST`.
fn is_station(group: &str) -> bool {
    group.len() == 4
        && group
            .bytes()
            .all(|b| b.is_ascii_uppercase() || b.is_ascii_digit())
}

/// Day of the month, hour and minute.
struct DayTime {
    day: i64,
    of_day_s: f64,
}

impl DayTime {
    /// The time of this day and hour that is nearest to `near_s`.
    fn nearest(&self, near_s: f64) -> Option<f64> {
        let month = date((near_s / DAY_S).floor() as i64);
        let near = [-1, 0, 1].into_iter().filter_map(|off| {
            let months = month.0 * 12 + month.1 - 1 + off;
            let day = days(months.div_euclid(12), months.rem_euclid(12) + 1, self.day)?;
            Some(day as f64 * DAY_S + self.of_day_s)
        });
        near.min_by(|a, b| (a - near_s).abs().total_cmp(&(b - near_s).abs()))
    }
}

/// `271230Z`.
fn time(group: &str) -> Option<DayTime> {
    let digits = group
        .strip_suffix('Z')
        .filter(|d| d.len() == 6 && all_digits(d))?;
    let number = |k: usize| digits[k..k + 2].parse::<i64>().ok();
    let (day, hour, minute) = (number(0)?, number(2)?, number(4)?);
    let fits = (1..=31).contains(&day) && hour < 24 && minute < 60;
    fits.then_some(DayTime {
        day,
        of_day_s: (hour * 3600 + minute * 60) as f64,
    })
}

/// `24015G25KT`, `24008MPS`, `VRB03KT`, `00000KT`.
fn wind(group: &str) -> Option<ReportedWind> {
    let units = [("KT", KNOT_M_S), ("MPS", 1.0), ("KMH", KM_H_M_S)];
    let (digits, unit_m_s) = units
        .iter()
        .find_map(|(u, m_s)| Some((group.strip_suffix(u)?, m_s)))?;
    let mean = digits.split_once('G').map_or(digits, |(mean, _)| mean);
    let (from, speed) = mean.split_at_checked(3)?;
    if !(2..=3).contains(&speed.len()) || !all_digits(speed) {
        return None;
    }
    let from_deg = match from {
        "VRB" => None,
        digits => Some(digits.parse::<u16>().ok().filter(|d| *d <= 360)?),
    };
    let reported = speed.parse::<f64>().ok()?;
    let calm = reported == 0.0;
    Some(ReportedWind {
        speed_m_s: if calm { CALM_M_S } else { reported * unit_m_s },
        from_deg: from_deg.filter(|_| !calm).map(f64::from),
        height_agl_m: Some(WIND_HEIGHT_AGL_M),
    })
}

/// `18/09`, `M02/M05`, `18///`.
fn temperature_c(group: &str) -> Option<f64> {
    let (air, dew_point) = group.split_once('/')?;
    let value = |text: &str| {
        let (sign, digits) = text.strip_prefix('M').map_or((1.0, text), |d| (-1.0, d));
        let digits = Some(digits).filter(|d| d.len() == 2 && all_digits(d))?;
        Some(sign * digits.parse::<f64>().ok()?)
    };
    let known = dew_point.is_empty() || dew_point == "//" || value(dew_point).is_some();
    value(air).filter(|_| known)
}

/// `Q1013`, `A2992`.
fn qnh_hpa(group: &str) -> Option<f64> {
    let (unit, digits) = group.split_at_checked(1)?;
    let number = Some(digits).filter(|d| d.len() == 4 && all_digits(d))?;
    let number = number.parse::<f64>().ok()?;
    match unit {
        "Q" => Some(number),
        "A" => Some(number / 100.0 * INCH_HG_HPA),
        _ => None,
    }
}

fn all_digits(text: &str) -> bool {
    text.bytes().all(|b| b.is_ascii_digit())
}

#[cfg(test)]
mod tests {
    use super::*;
    use formats::calendar::iso_8601;

    /// 12:00 on 22 November 2026.
    fn near() -> Option<f64> {
        iso_8601("2026-11-22T12:00")
    }

    fn only(text: &str) -> WeatherReport {
        let read = parse(text, near()).unwrap();
        assert_eq!(read.reports.len(), 1, "{text}");
        read.reports[0]
    }

    #[test]
    fn examples_of_annex_3_and_of_the_federal_handbook_are_read() {
        // ICAO Annex 3, example A3-1, and the SPECI of A3-2.
        let donlon = only(
            "METAR YUDO 221630Z 24004MPS 0600 R12/1000U DZ FG SCT010 OVC020 17/16 Q1018 BECMG TL1700 0800 FG \
             BECMG AT1800 9999 NSW=",
        );
        assert_eq!(donlon.time_s, iso_8601("2026-11-22T16:30").unwrap());
        let wind = ReportedWind {
            speed_m_s: 4.0,
            from_deg: Some(240.0),
            height_agl_m: Some(10.0),
        };
        assert_eq!(donlon.wind, wind);
        assert_eq!(donlon.temperature_c, Some(17.0));
        assert_eq!(donlon.pressure, Some(ReportedPressure::SeaLevel(1018.0)));
        let speci = only(
            "SPECI YUDO 151115Z 05025G37KT 3000 1200NE+TSRA BKN005CB 25/22 Q1008 TEMPO TL1200 0600 BECMG AT1200 \
             8000 NSW NSC=",
        );
        assert_eq!(speci.time_s, iso_8601("2026-11-15T11:15").unwrap());
        assert!(
            (speci.wind.speed_m_s - 12.861).abs() < 1e-3,
            "25 kt are 12.861 m/s"
        );
        // FMH-1 (FCM-H1-2019), chapter 12.
        let abc = only(
            "METAR KABC 121755Z AUTO 21016G24KT 180V240 1SM R11/P6000FT -RA BR BKN015 OVC025 06/04 A2990 \
             RMK AO2 PK WND 20032/25 WSHFT 1715 SLP125 P0003 T00640036 10066 21012 58033 TSNO $",
        );
        assert_eq!(
            (abc.wind.from_deg, abc.temperature_c),
            (Some(210.0), Some(6.0))
        );
        let Some(ReportedPressure::SeaLevel(hpa)) = abc.pressure else {
            panic!()
        };
        assert!(
            (hpa - 1012.53).abs() < 0.01,
            "29.90 inHg are 1012.53 hPa, here {hpa}"
        );
    }

    #[test]
    fn winds_without_direction_and_frost() {
        let calm = only("LEST 220000Z 00000KT CAVOK M02/M05 Q1031");
        assert_eq!((calm.wind.from_deg, calm.wind.speed_m_s), (None, CALM_M_S));
        assert_eq!(calm.temperature_c, Some(-2.0));
        let varies = only("LEST 220000Z VRB03KT 9999 09/// Q////");
        assert_eq!(
            (varies.wind.from_deg, varies.temperature_c),
            (None, Some(9.0))
        );
        assert!((varies.wind.speed_m_s - 1.543).abs() < 1e-3 && varies.pressure.is_none());
        assert_eq!(
            only("LEST 220000Z 240P99KT 27010KMH").wind.from_deg,
            Some(270.0)
        );
    }

    #[test]
    fn files_of_several_reports_turn_the_month() {
        // As NOAA keeps them, a date above each; as the API of aviationweather.gov gives them, the newest first.
        let noaa = "2026/11/30 23:30\nLEST 302330Z 24010KT 9999 12/10 Q1013\n\n\
            2026/12/01 00:00\nLEST 010000Z 25012KT 9999 12/10 Q1013\n";
        let read = parse(noaa, iso_8601("2026-12-01T00:10")).unwrap();
        assert_eq!(read.as_of_s, iso_8601("2026-12-01T00:00").unwrap());
        let apart = |r: &WeatherReports| r.reports[1].time_s - r.reports[0].time_s;
        assert_eq!(apart(&read), 1800.0);
        let newest_first = "METAR LEST 010000Z 25012KT\nMETAR LEST 312330Z 24010KT\n";
        assert_eq!(apart(&parse(newest_first, None).unwrap()), -1800.0);
    }

    // The METAR and TAF of ICAO Annex 3 (examples A3-1 and A5-1, the latter with its present form of period), and a TAF
    // as aviationweather.gov prints it.
    #[test]
    fn a_forecast_is_no_report() {
        let metar = "METAR YUDO 151600Z 24004MPS 0600 17/16 Q1018=\n";
        for taf in [
            "TAF YUDO 151800Z 1600/1618 13005MPS 9000 BKN020 BECMG 1606/1608 SCT015CB BKN020 TEMPO 1608/1612 \
             17006G12MPS 1000 TSRA=",
            "TAF AMD YUDO 151800Z 1600/1618 13018KT=",
            "TAF COR YUDO 151800Z 160018 13018KT=",
            "YUDO 151800Z 1600/1618 13018KT P6SM FM160400 15025KT",
        ] {
            for text in [format!("{metar}{taf}"), format!("{taf}\n{metar}")] {
                let read = only(&text);
                assert_eq!(read.wind.from_deg, Some(240.0), "{text}");
                assert_eq!(read.temperature_c, Some(17.0));
            }
            assert!(
                parse(taf, near())
                    .unwrap_err()
                    .to_string()
                    .contains("no report")
            );
        }
    }

    #[test]
    fn a_report_cut_short_is_none() {
        for (text, words) in [
            ("LEST 271230Z", "271230Z: no wind; expected a group such as"),
            ("LEST 271230Z 2401", "no wind"),
            ("LEST 271230Z ////KT", "no wind"),
            ("LEST 391230Z 24010KT", "no report"),
            ("TAF", "no report"),
            (
                "LEST 271230Z 24010KT\nLECO 271230Z 25010KT",
                "LECO 271230Z: another aerodrome than LEST",
            ),
        ] {
            let why = parse(text, near()).unwrap_err().to_string();
            assert!(why.contains(words), "{text}: {why}");
        }
    }
}
