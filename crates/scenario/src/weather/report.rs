//! Weather as reported, whatever the format, and the mission's weather by it.

use air::AirError;
use air::geo::{Enu, Geodetic, LocalFrame};
use air::isa::Atmosphere;
use air::wind::{WindProfile, WindSeries};
use plume::stability::Stability;

/// Standard temperature at mean sea level, by which a QNH is reduced, °C (ICAO Doc 7488).
const QNH_TEMPERATURE_C: f64 = 15.0;

/// Weather of a place farther than this from the site is not its own, m: two cells of the coarsest global model that
/// Open-Meteo serves (0.25°).
pub const FARTHEST_M: f64 = 55_000.0;

/// Why a text is no weather, without the name of its file.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum WeatherError {
    /// Something is not as it should be.
    #[error("{at}: {found}; expected {expected}")]
    Text {
        /// Where: a line, a column, a key.
        at: String,
        /// What is there.
        found: String,
        /// What would be right.
        expected: String,
    },
    /// Reports that make no wind over time.
    #[error(transparent)]
    Air(#[from] AirError),
}

impl WeatherError {
    pub(super) fn new(
        at: impl Into<String>,
        found: impl Into<String>,
        expected: impl Into<String>,
    ) -> Self {
        Self::Text {
            at: at.into(),
            found: found.into(),
            expected: expected.into(),
        }
    }
}

/// What the times of reports count from.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum TimeScale {
    /// The mission's start.
    Mission,
    /// 1970-01-01 00:00 UTC.
    Unix,
}

/// A wind as reported.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ReportedWind {
    /// Mean speed, m/s.
    pub speed_m_s: f64,
    /// Direction from which it blows, degrees from true north; none of a wind that varies, or of a calm.
    pub from_deg: Option<f64>,
    /// Height above ground, m; that of the scenario's wind where none is reported.
    pub height_agl_m: Option<f64>,
}

/// A pressure as reported, hPa.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum ReportedPressure {
    /// At the ground of the site.
    Ground(f64),
    /// Reduced to mean sea level in the standard atmosphere (QNH).
    SeaLevel(f64),
}

/// The weather of one time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct WeatherReport {
    /// Time, s.
    pub time_s: f64,
    /// Wind.
    pub wind: ReportedWind,
    /// Air temperature near the ground, °C.
    pub temperature_c: Option<f64>,
    /// Pressure.
    pub pressure: Option<ReportedPressure>,
    /// Stability class.
    pub stability: Option<Stability>,
}

/// All reports of a text, in order of time; at least one.
#[derive(Debug, Clone, PartialEq)]
pub struct WeatherReports {
    /// What the times count from.
    pub scale: TimeScale,
    /// Where it is the weather of, if it says so.
    pub place: Option<Geodetic>,
    /// The time for which the text was made, s: its last observation, or the moment of a forecast.
    pub as_of_s: f64,
    /// The reports.
    pub reports: Vec<WeatherReport>,
}

impl WeatherReports {
    /// Refuses the weather of another place than the site of `frame`.
    ///
    /// # Errors
    /// A place farther than [`FARTHEST_M`] from it.
    pub fn check_place(&self, frame: &LocalFrame) -> Result<(), WeatherError> {
        let Some(place) = self.place else {
            return Ok(());
        };
        let off_m = frame.to_enu(place).distance_m(Enu::default());
        if off_m <= FARTHEST_M {
            return Ok(());
        }
        let site = frame.origin();
        Err(WeatherError::new(
            format!("latitude {}, longitude {}", place.lat_deg, place.lon_deg),
            format!("{:.0} km from the site", off_m / 1000.0),
            format!(
                "{:.3}, {:.3}, or a place near it",
                site.lat_deg, site.lon_deg
            ),
        ))
    }

    /// Mission time of a report's `time_s` in a mission that began at `start_unix_s`; where that is not
    /// given, the text was made for the mission's start.
    fn mission_s(&self, time_s: f64, start_unix_s: Option<f64>) -> f64 {
        match self.scale {
            TimeScale::Mission => time_s,
            TimeScale::Unix => time_s - start_unix_s.unwrap_or(self.as_of_s),
        }
    }

    /// The wind over the mission's time at the reference height of `profile`, by its law. A wind without
    /// direction has that of the report before, the first one that of `profile`.
    ///
    /// # Errors
    /// Times that do not increase, or speeds that no wind has.
    pub fn series(
        &self,
        profile: &WindProfile,
        start_unix_s: Option<f64>,
    ) -> Result<WindSeries, WeatherError> {
        let mut from_deg = profile.from_deg();
        let mut rows = Vec::with_capacity(self.reports.len());
        for report in &self.reports {
            let wind = &report.wind;
            from_deg = wind.from_deg.unwrap_or(from_deg);
            let reference_m = profile.reference_height_agl_m();
            let height_m = wind.height_agl_m.unwrap_or(reference_m);
            let law = WindProfile::new(wind.speed_m_s, height_m, from_deg, profile.exponent())?;
            let speed_m_s = if height_m == reference_m {
                wind.speed_m_s
            } else {
                law.speed_at_m_s(reference_m)
            };
            rows.push((
                self.mission_s(report.time_s, start_unix_s),
                speed_m_s,
                from_deg,
            ));
        }
        Ok(WindSeries::new(&rows)?)
    }

    /// Times, s, and the stability classes that are reported to hold from then on.
    pub fn classes(&self, start_unix_s: Option<f64>) -> Vec<(f64, Stability)> {
        let of = |r: &WeatherReport| Some((self.mission_s(r.time_s, start_unix_s), r.stability?));
        self.reports.iter().filter_map(of).collect()
    }

    /// Temperature, °C, and pressure at the ground, hPa, at the mission's start, where they are reported:
    /// by the last report until then, or the first after.
    pub fn air_at_start(
        &self,
        ground_amsl_m: f64,
        start_unix_s: Option<f64>,
    ) -> (Option<f64>, Option<f64>) {
        let begun = |r: &&WeatherReport| self.mission_s(r.time_s, start_unix_s) <= 0.0;
        let at_start = self.reports.iter().take_while(begun).last();
        let Some(report) = at_start.or(self.reports.first()) else {
            return (None, None);
        };
        let pressure_hpa = report.pressure.and_then(|p| match p {
            ReportedPressure::Ground(hpa) => Some(hpa),
            ReportedPressure::SeaLevel(hpa) => {
                let standard = Atmosphere::through(0.0, QNH_TEMPERATURE_C, hpa).ok()?;
                Some(standard.at(ground_amsl_m).pressure_pa / 100.0)
            }
        });
        (report.temperature_c, pressure_hpa)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn profile() -> WindProfile {
        WindProfile::new(5.0, 100.0, 270.0, 0.15).unwrap()
    }

    fn from_wind(wind: ReportedWind, time_s: f64) -> WeatherReport {
        WeatherReport {
            time_s,
            wind,
            temperature_c: None,
            pressure: None,
            stability: None,
        }
    }

    #[test]
    fn a_wind_is_carried_to_the_height_where_it_is_wanted_by_the_power_law() {
        // 6 m/s at 10 m with p = 0.15 is 6 * 10^0.15 = 8.4752 m/s at 100 m.
        let at = |speed_m_s, from_deg, time_s| {
            let wind = ReportedWind {
                speed_m_s,
                from_deg,
                height_agl_m: Some(10.0),
            };
            from_wind(wind, time_s)
        };
        let reports = WeatherReports {
            scale: TimeScale::Unix,
            place: None,
            as_of_s: 5000.0,
            reports: vec![at(6.0, Some(200.0), 4000.0), at(3.0, None, 5000.0)],
        };
        let series = reports.series(&profile(), None).unwrap();
        assert!((series.at(-1000.0).speed_m_s() - 8.4752).abs() < 1e-3);
        assert!((series.at(0.0).speed_m_s() - 4.2376).abs() < 1e-3);
        assert!(
            (series.at(0.0).from_deg() - 200.0).abs() < 1e-9,
            "as before"
        );
        let later = reports.series(&profile(), Some(4500.0)).unwrap();
        assert!((later.at(500.0).speed_m_s() - 4.2376).abs() < 1e-3);
    }

    #[test]
    fn a_qnh_is_brought_down_to_the_ground_in_the_standard_atmosphere() {
        // ICAO Doc 7488: 1013.25 hPa at sea level are 898.75 hPa at 1000 m.
        let calm = ReportedWind {
            speed_m_s: 0.25,
            from_deg: None,
            height_agl_m: None,
        };
        let reports = WeatherReports {
            scale: TimeScale::Mission,
            place: None,
            as_of_s: 0.0,
            reports: vec![WeatherReport {
                pressure: Some(ReportedPressure::SeaLevel(1013.25)),
                temperature_c: Some(18.0),
                ..from_wind(calm, 0.0)
            }],
        };
        let (temperature_c, pressure_hpa) = reports.air_at_start(1000.0, None);
        assert_eq!(temperature_c, Some(18.0));
        assert!(
            (pressure_hpa.unwrap() - 898.75).abs() < 0.02,
            "{pressure_hpa:?}"
        );
    }

    #[test]
    fn weather_of_another_place_is_refused() {
        let at = |lat_deg| WeatherReports {
            scale: TimeScale::Unix,
            place: Some(Geodetic {
                lat_deg,
                lon_deg: -7.86,
            }),
            as_of_s: 0.0,
            reports: Vec::new(),
        };
        let site = LocalFrame::new(43.44, -7.86, 0.0).unwrap();
        assert!(at(43.5).check_place(&site).is_ok());
        // A degree of latitude is 111.1 km there (WGS 84).
        let why = at(44.44).check_place(&site).unwrap_err().to_string();
        assert!(why.contains("111 km from the site"), "{why}");
    }
}
