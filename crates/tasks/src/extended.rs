//! The scenario with what was found about it.

use ::gap::plume::Analysis;
use plume::{Mechanism, MechanismId};
use scenario::Scenario;
use scenario::uncertain::Uncertain;

/// `scenario` with what `analysis` found. Turns of the wind, and its speed, were found against the
/// logged wind where there is one, so that takes the place of the scenario's own; the scenario's
/// `series` stays only where it was itself the log (`by_series`). The reality stays as it was.
pub fn extended(scenario: &Scenario, analysis: &Analysis, by_series: bool) -> Scenario {
    let mut out = scenario.clone();
    if let Some((from_deg, speed_m_s)) = analysis.logged_wind.filter(|_| !by_series) {
        out.set(Uncertain::WindFrom, from_deg);
        out.set(Uncertain::WindSpeed, speed_m_s);
        out.weather.series = None;
    }
    for (key, value, sd) in &analysis.base {
        let Some(parameter) = Uncertain::ALL
            .into_iter()
            .find(|u| u.key(scenario.gas()) == *key)
        else {
            continue;
        };
        let series_deg = analysis.logged_wind.filter(|_| by_series).map(|w| w.0);
        if let Some(whole) = mechanism_for_all_sources(scenario, parameter, *value, series_deg) {
            out.extend(&[whole]);
            continue;
        }
        let value = match parameter {
            Uncertain::WindSpeed => {
                out.weather.wind_speed_m_s * value
                    / scenario.weather.wind_speed_m_s.max(f64::MIN_POSITIVE)
            }
            Uncertain::SensorGain => {
                // The slope that was fitted takes what was added before it along.
                let slope = value / scenario.sensor().gain;
                out.sensor_mut().offset_ppm *= slope;
                out.sensor_mut().drift_ppm_per_h *= slope;
                *value
            }
            _ => *value,
        };
        out.set_with_sd(parameter, value, *sd);
    }
    out.extend(&analysis.extension);
    out.with_reality_of(scenario)
}

/// The mechanism that does to the whole scenario what `parameter` at `value` was found to do, where
/// its key would do it to the first source only, or nothing beside a series, which blows from
/// `series_deg` in the mean.
fn mechanism_for_all_sources(
    scenario: &Scenario,
    parameter: Uncertain,
    value: f64,
    series_deg: Option<f64>,
) -> Option<Mechanism> {
    let stated = scenario.value(parameter)?;
    let (factor, difference) = (value / stated, value - stated);
    let several = scenario.sources.len() > 1;
    let (id, found) = match parameter {
        Uncertain::WindFrom => (MechanismId::WindDirectionOffset, value - series_deg?),
        Uncertain::WindSpeed if series_deg.is_some() => (MechanismId::WindSpeedScale, factor),
        Uncertain::EffectiveHeight if several => (MechanismId::EffectiveHeightOffset, difference),
        Uncertain::Emission | Uncertain::CMax if several => (MechanismId::EmissionScale, factor),
        _ => return None,
    };
    found
        .is_finite()
        .then(|| Mechanism::from_values(id, &[found]))
}

#[cfg(test)]
mod tests {
    use super::*;
    use ::gap::plume::{Options, Setup, analyse};
    use scenario::observations;

    const SCENARIO: &str = "[site]\nlat_deg = 43.0\nlon_deg = -7.0\nground_amsl_m = 0.0\n\
        [weather]\nwind_speed_m_s = 7.0\nwind_from_deg = 240.0\nseries = \"wind.csv\"\n\
        [[source]]\nlat_deg = 43.0\nlon_deg = -7.0\nemission_kg_s = 100.0\neffective_height_m = 200.0\n\
        [sensor]\noffset_ppm = 10.0\n";

    fn scenario(more: &str) -> Scenario {
        Scenario::parse("test.toml", &format!("{SCENARIO}{more}")).unwrap()
    }

    /// What an analysis of one row comes to, with these findings in place of its own.
    fn found(
        scenario: &Scenario,
        logged_wind: Option<(f64, f64)>,
        base: &[(&str, f64, f64)],
    ) -> Analysis {
        let row = "time_s,platform,lat_deg,lon_deg,alt_amsl_m,co2_ppm\n0,a,43.0,-7.0,200,420\n";
        let rows = observations::parse(&[("o.csv", row)], scenario.gas()).unwrap();
        let setup = Setup::new(scenario).unwrap();
        let mut analysis = analyse(&setup, &rows, &Options::default(), &mut |_| ()).unwrap();
        let own = |(key, value, sd): &(&str, f64, f64)| ((*key).to_owned(), *value, *sd);
        analysis.base = base.iter().map(own).collect();
        analysis.logged_wind = logged_wind;
        analysis
    }

    #[test]
    fn the_logged_wind_takes_the_place_of_the_scenarios() {
        let own = scenario("");
        let a = found(
            &own,
            Some((250.0, 9.0)),
            &[("weather.wind_from_deg", 252.0, 0.5)],
        );
        let out = extended(&own, &a, false);
        assert_eq!(out.weather.wind_from_deg, 252.0);
        assert_eq!(out.weather.wind_speed_m_s, 9.0);
        assert!(out.weather.series.is_none() && out.mechanisms.is_empty());
    }

    #[test]
    fn a_series_stays_and_is_turned() {
        let own = scenario("");
        let a = found(
            &own,
            Some((250.0, 9.0)),
            &[("weather.wind_from_deg", 252.0, 0.5)],
        );
        let out = extended(&own, &a, true);
        assert_eq!(out.weather.series.as_deref(), Some("wind.csv"));
        assert_eq!(out.weather.wind_from_deg, 240.0);
        assert_eq!(out.mechanisms[0].id, "wind-direction-offset");
        assert_eq!(
            out.mechanisms[0].parameters["offset_deg"].as_float(),
            Some(2.0)
        );
    }

    #[test]
    fn a_slope_takes_the_offset_along() {
        let own = scenario("");
        let out = extended(
            &own,
            &found(&own, None, &[("sensor.gain", 1.2, 0.1)]),
            false,
        );
        assert_eq!(out.sensor().gain, 1.2);
        assert!((out.sensor().offset_ppm - 12.0).abs() < 1e-12);
    }

    #[test]
    fn what_holds_of_all_sources_is_said_of_all() {
        let own = scenario("[[source]]\nlat_deg = 43.001\nlon_deg = -7.0\nemission_kg_s = 30.0\n");
        let a = found(&own, None, &[("source.emission_kg_s", 150.0, 5.0)]);
        let out = extended(&own, &a, false);
        assert_eq!(out.sources[0].emission_kg_s, Some(100.0));
        assert_eq!(out.mechanisms[0].id, "emission-scale");
        assert_eq!(out.mechanisms[0].parameters["factor"].as_float(), Some(1.5));
    }
}
