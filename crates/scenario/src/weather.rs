//! Reported weather from CSV, METAR, or the JSON of Open-Meteo. The content of a text tells its format.

mod csv_table;
mod metar;
mod observed;
mod open_meteo;
mod report;

pub use observed::ObservedTimes;
pub use report::{
    FARTHEST_M, ReportedPressure, ReportedWind, TimeScale, WeatherError, WeatherReport,
    WeatherReports,
};

impl WeatherReports {
    /// Reads a text. A METAR says only the day of its month; it is that which is nearest to `near_unix_s`,
    /// where that is given. `height_agl_m` is where the wind is wanted: of several heights the nearest is
    /// taken, by their ratio.
    ///
    /// # Errors
    /// What is wrong, where, and what was expected.
    pub fn parse(
        text: &str,
        height_agl_m: f64,
        near_unix_s: Option<f64>,
    ) -> Result<Self, WeatherError> {
        let text = text.strip_prefix('\u{feff}').unwrap_or(text);
        let first = text.trim_start().lines().next().unwrap_or_default();
        let mut read = if first.starts_with('{') {
            open_meteo::parse(text, height_agl_m)?
        } else if first.contains(',') {
            csv_table::parse(text)?
        } else {
            metar::parse(text, near_unix_s)?
        };
        if read.scale == TimeScale::Unix {
            // Files gather reports in any order, and more than once.
            read.reports.sort_by(|a, b| a.time_s.total_cmp(&b.time_s));
            read.reports
                .dedup_by(|later, kept| later.time_s == kept.time_s);
        }
        Ok(read)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_text_is_read_by_what_is_in_it() {
        let read = |text| WeatherReports::parse(text, 10.0, None);
        assert_eq!(
            read("time_s,wind_speed_m_s,wind_from_deg\n0,5,270\n")
                .unwrap()
                .scale,
            TimeScale::Mission
        );
        assert_eq!(
            read("METAR LEST 271230Z 24015KT 9999 18/09 Q1013\n")
                .unwrap()
                .scale,
            TimeScale::Unix
        );
        for (text, words) in [
            ("", "no report"),
            ("<html>not found</html>", "no report"),
            ("{\"error\":true,\"reason\":\"bad key\"}", "bad key"),
        ] {
            let why = read(text).unwrap_err().to_string();
            assert!(why.contains(words), "{why}");
        }
    }
}
