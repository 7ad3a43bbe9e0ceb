//! From what a height is counted, and how it becomes one above mean sea level.

use air::isa::Atmosphere;
use serde::{Deserialize, Serialize};

/// Temperature at mean sea level of the standard atmosphere, °C (ISO 2533).
const STANDARD_TEMPERATURE_C: f64 = 15.0;

/// From what a column's heights are counted.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Datum {
    /// Mean sea level.
    Amsl,
    /// The WGS84 ellipsoid; needs `undulation_m`.
    Ellipsoid,
    /// The place of take-off; needs `base_amsl_m`.
    Home,
    /// The ground; needs `base_amsl_m`, its one height.
    Ground,
    /// Altitude in the standard atmosphere (1013.25 hPa at 0 m); needs `qnh_hpa`.
    PressureAltitude,
    /// The pressure itself, hPa; needs `qnh_hpa`.
    Pressure,
}

/// What is stated of a log's heights.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct StatedHeights {
    /// Height of the geoid (mean sea level) above the ellipsoid, m.
    pub undulation_m: Option<f64>,
    /// Altimeter setting: pressure reduced to mean sea level, hPa.
    pub qnh_hpa: Option<f64>,
    /// Altitude of what heights are counted from, m above mean sea level.
    pub base_amsl_m: Option<f64>,
}

/// How a value becomes a height above mean sea level.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Reduction {
    /// By adding this, m.
    Add(f64),
    /// Of a pressure altitude, in the standard atmosphere of this QNH, hPa.
    PressureAltitude(f64),
    /// Of a pressure in hPa, in the standard atmosphere of this QNH, hPa.
    Pressure(f64),
}

impl Datum {
    /// How heights from this datum are reduced with what is `stated`.
    ///
    /// # Errors
    /// The name of what would have to be stated, and what it is.
    pub fn reduction(
        self,
        stated: &StatedHeights,
    ) -> Result<Reduction, (&'static str, &'static str)> {
        let base = (
            "base_amsl_m",
            "the altitude that they count from, m above mean sea level",
        );
        let qnh = ("qnh_hpa", "the altimeter setting of that time, hPa");
        match self {
            Self::Amsl => Ok(Reduction::Add(0.0)),
            Self::Ellipsoid => stated.undulation_m.map(|u| Reduction::Add(-u)).ok_or((
                "undulation_m",
                "the geoid's height above the ellipsoid there, m (EGM96 or EGM2008)",
            )),
            Self::Home | Self::Ground => stated.base_amsl_m.map(Reduction::Add).ok_or(base),
            Self::PressureAltitude => stated.qnh_hpa.map(Reduction::PressureAltitude).ok_or(qnh),
            Self::Pressure => stated.qnh_hpa.map(Reduction::Pressure).ok_or(qnh),
        }
    }

    /// What it is, in words.
    pub fn words(self) -> &'static str {
        match self {
            Self::Amsl => "above mean sea level",
            Self::Ellipsoid => "above the WGS84 ellipsoid",
            Self::Home => "above the take-off point",
            Self::Ground => "above ground",
            Self::PressureAltitude => "of the standard atmosphere (pressure altitude)",
            Self::Pressure => "as pressure",
        }
    }
}

impl Reduction {
    /// The height above mean sea level of `value`, m. Not finite where the QNH is none (300 to 1100 hPa).
    pub fn amsl_m(self, value: f64) -> f64 {
        let of_pressure = |qnh_hpa: f64, pressure_pa: f64| {
            Atmosphere::through(0.0, STANDARD_TEMPERATURE_C, qnh_hpa)
                .map_or(f64::NAN, |air| air.altitude_of_amsl_m(pressure_pa))
        };
        match self {
            Self::Add(base_m) => value + base_m,
            Self::PressureAltitude(qnh_hpa) => {
                of_pressure(qnh_hpa, Atmosphere::standard().at(value).pressure_pa)
            }
            Self::Pressure(qnh_hpa) => of_pressure(qnh_hpa, value * 100.0),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_not_stated_is_asked_for() {
        let nothing = StatedHeights::default();
        assert_eq!(
            Datum::Ellipsoid.reduction(&nothing).unwrap_err().0,
            "undulation_m"
        );
        assert_eq!(
            Datum::Home.reduction(&nothing).unwrap_err().0,
            "base_amsl_m"
        );
        assert_eq!(
            Datum::PressureAltitude.reduction(&nothing).unwrap_err().0,
            "qnh_hpa"
        );
        assert!(Datum::Amsl.reduction(&nothing).is_ok());
    }

    #[test]
    fn heights_are_reduced_to_mean_sea_level() {
        let stated = StatedHeights {
            undulation_m: Some(54.5),
            qnh_hpa: Some(1003.25),
            base_amsl_m: Some(340.0),
        };
        let amsl = |datum: Datum, value| datum.reduction(&stated).unwrap().amsl_m(value);
        assert_eq!(amsl(Datum::Ellipsoid, 554.5), 500.0);
        assert_eq!(amsl(Datum::Home, 60.0), 400.0);
        // The barometric formula in ISO 2533 with 1003.25 hPa and 288.15 K at 0 m:
        // python3 -c "print(288.15/.0065*(1-(898.746/1003.25)**(.0065*287.05287/9.80665)))" = 918.15
        assert!((amsl(Datum::Pressure, 898.746) - 918.15).abs() < 0.02);
        // 898.746 hPa is 1000 m in the standard atmosphere (ISO 2533, table).
        assert!((amsl(Datum::PressureAltitude, 1000.0) - 918.15).abs() < 0.06);
    }
}
