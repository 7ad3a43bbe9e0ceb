//! Reported weather at the times of observations.
//!
//! In a mission a text of weather counts from the mission's start. Observations count from 1970 where they were imported
//! so, or from a time that only `mission.start` states; the text counts from 1970 where its times are UTC.

use super::report::{TimeScale, WeatherError, WeatherReports};
use air::wind::WindProfile;

/// Times from here on count from 1970, s: the year 1973, and three years after any start.
const SINCE_1970_S: f64 = 1e8;
/// A text that ends so much before the last observation, or begins so much after the first, is worth a notice, s: reports
/// of aerodromes and models come every half-hour or hour.
const UNCOVERED_S: f64 = 3600.0;

/// The times of observations.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ObservedTimes {
    /// First and last time, s.
    pub span_s: (f64, f64),
    /// UTC of time 0, s since 1970, where they do not count from 1970 and it is stated.
    pub start_unix_s: Option<f64>,
}

impl ObservedTimes {
    fn since_1970(&self) -> bool {
        self.span_s.0 >= SINCE_1970_S
    }

    /// The text's own weather, whose times count from 1970 if `in_utc`, is moved by so much, s; none where the two cannot
    /// be compared.
    fn shift_s(&self, in_utc: bool) -> Option<f64> {
        match (in_utc, self.since_1970()) {
            (true, true) | (false, false) => Some(0.0),
            (true, false) => self.start_unix_s.map(|s| -s),
            (false, true) => self.start_unix_s,
        }
    }
}

impl WeatherReports {
    /// The reports of a text at the times of observations, and a notice where these reach beyond them. None where the two
    /// cannot be compared and need not, because the wind does not change.
    ///
    /// # Errors
    /// As [`WeatherReports::parse`]; a wind that changes at times that cannot be compared with those of the observations, or
    /// that share none with them.
    pub fn at_times(
        text: &str,
        profile: &WindProfile,
        times: ObservedTimes,
    ) -> Result<Option<(Self, Option<String>)>, WeatherError> {
        let (from_s, to_s) = times.span_s;
        let zero_s = if times.since_1970() {
            Some(0.0)
        } else {
            times.start_unix_s
        };
        let near_unix_s = zero_s.map(|zero_s| zero_s + 0.5 * (from_s + to_s));
        let mut read = Self::parse(text, profile.reference_height_agl_m(), near_unix_s)?;
        let in_utc = read.scale == TimeScale::Unix || read.first_s() >= SINCE_1970_S;
        let series = read.series(profile, None)?;
        let changes = series.rows().windows(2).any(|pair| pair[0].1 != pair[1].1);
        let Some(shift_s) = times.shift_s(in_utc) else {
            return if changes {
                Err(incomparable(in_utc))
            } else {
                Ok(None)
            };
        };
        read.scale = TimeScale::Mission;
        read.reports.iter_mut().for_each(|r| r.time_s += shift_s);
        let (first_s, last_s) = (read.first_s(), read.last_s());
        if changes && (last_s < from_s || first_s > to_s) {
            return Err(WeatherError::new(
                format!("{first_s:.0} to {last_s:.0} s"),
                "weather of another time",
                format!("weather of the time of the observations, {from_s:.0} to {to_s:.0} s"),
            ));
        }
        let beyond = changes && (from_s + UNCOVERED_S < first_s || last_s + UNCOVERED_S < to_s);
        let notice = beyond.then(|| {
            format!(
                "the reported weather is of {first_s:.0} to {last_s:.0} s, the observations of {from_s:.0} to \
                 {to_s:.0} s; before and after it its first and last wind hold"
            )
        });
        Ok(Some((read, notice)))
    }

    fn first_s(&self) -> f64 {
        self.reports.first().map_or(0.0, |r| r.time_s)
    }

    fn last_s(&self) -> f64 {
        self.reports.last().map_or(0.0, |r| r.time_s)
    }
}

/// Times of which one side is UTC and the other counts from a time that nothing states.
fn incomparable(weather_in_utc: bool) -> WeatherError {
    let (at, found) = if weather_in_utc {
        (
            "times",
            "the weather is in UTC, and the observations count from a time that is not stated",
        )
    } else {
        (
            "time_s",
            "the observations are in UTC, and the weather counts from a time that is not stated",
        )
    };
    let expected = "start in [mission]: the UTC time of time_s = 0";
    WeatherError::new(at, found, expected)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// 2024-05-01T10:00:00Z: date -u -d 2024-05-01T10:00:00Z +%s
    const MAY_S: f64 = 1_714_557_600.0;

    const UTC: &str = "time_utc,wind_speed_m_s,wind_from_deg\n\
        2024-05-01T10:00:00Z,7,230\n2024-05-01T11:00:00Z,7,270\n";
    const SINCE_1970: &str =
        "time_s,wind_speed_m_s,wind_from_deg\n1714557600,7,230\n1714561200,7,270\n";
    const SINCE_START: &str = "time_s,wind_speed_m_s,wind_from_deg\n0,7,230\n3600,7,270\n";
    const METAR: &str = "METAR LEST 011000Z 23014KT\nMETAR LEST 011100Z 27014KT\n";

    /// The wind's direction in the middle of the observations, none where it stays as it is, and the notice.
    fn at(
        start_unix_s: Option<f64>,
        text: &str,
        span_s: (f64, f64),
    ) -> Result<(Option<f64>, Option<String>), String> {
        let profile = WindProfile::new(5.0, 10.0, 270.0, 0.15).unwrap();
        let times = ObservedTimes {
            span_s,
            start_unix_s,
        };
        let read = WeatherReports::at_times(text, &profile, times).map_err(|e| e.to_string())?;
        let Some((read, notice)) = read else {
            return Ok((None, None));
        };
        let series = read.series(&profile, None).unwrap();
        let from_deg = series.at(0.5 * (span_s.0 + span_s.1)).from_deg();
        Ok((Some(from_deg), notice))
    }

    // In the middle of the hour in which it turns from 230 to 270 degrees the wind is from 250, whatever times count from.
    #[test]
    fn weather_and_rows_meet_wherever_their_times_count_from() {
        let in_utc = (MAY_S, MAY_S + 3600.0);
        for weather in [UTC, SINCE_1970, METAR] {
            let (from_deg, notice) = at(None, weather, in_utc).unwrap();
            assert!(
                (from_deg.unwrap() - 250.0).abs() < 0.01,
                "{weather}: {from_deg:?}"
            );
            assert_eq!(notice, None);
        }
        for weather in [UTC, SINCE_1970, METAR, SINCE_START] {
            for span_s in [(0.0, 3600.0), in_utc] {
                let (from_deg, _) = at(Some(MAY_S), weather, span_s).unwrap();
                assert!(
                    (from_deg.unwrap() - 250.0).abs() < 0.01,
                    "{weather} {span_s:?}"
                );
            }
        }
        let (from_deg, _) = at(None, SINCE_START, (0.0, 3600.0)).unwrap();
        assert!((from_deg.unwrap() - 250.0).abs() < 0.01);
    }

    #[test]
    fn times_that_cannot_be_compared_or_share_nothing_are_refused() {
        for (weather, span_s) in [
            (UTC, (0.0, 3600.0)),
            (METAR, (0.0, 3600.0)),
            (SINCE_1970, (0.0, 3600.0)),
            (SINCE_START, (MAY_S, MAY_S + 3600.0)),
        ] {
            let why = at(None, weather, span_s).unwrap_err();
            assert!(why.contains("expected start in [mission]"), "{why}");
        }
        let later = (MAY_S + 7200.0, MAY_S + 9000.0);
        let why = at(None, UTC, later).unwrap_err();
        assert!(
            why.contains("weather of the time of the observations"),
            "{why}"
        );
        // A wind that does not change holds at any time; rows far beyond the text are told.
        let constant = "METAR LEST 011000Z 23014KT\n";
        assert_eq!(at(None, constant, (0.0, 60.0)), Ok((None, None)));
        let (_, notice) = at(None, UTC, (MAY_S, MAY_S + 9000.0)).unwrap();
        assert!(notice.unwrap().contains("first and last wind hold"));
    }
}
