//! The scenario with what was found about it.

use gap::plume::Analysis;
use plume::{Mechanism, MechanismId};
use scenario::Scenario;
use scenario::uncertain::Uncertain;

/// `scenario` with what `analysis` found. Turns of the wind, and its speed, were found against the
/// logged wind where there is one, so that takes the place of the scenario's own; the scenario's
/// `series` stays only where it was itself the log (`by_series`).
pub(super) fn extended(scenario: &Scenario, analysis: &Analysis, by_series: bool) -> Scenario {
    let mut out = scenario.clone();
    if let Some((from_deg, speed_m_s)) = analysis.logged_wind.filter(|_| !by_series) {
        out.set(Uncertain::WindFrom, from_deg);
        out.set(Uncertain::WindSpeed, speed_m_s);
        out.weather.series = None;
    }
    for (key, value, sd) in &analysis.base {
        let Some(parameter) = Uncertain::ALL.into_iter().find(|u| u.key() == key) else {
            continue;
        };
        let series_deg = analysis.logged_wind.filter(|_| by_series).map(|w| w.0);
        if let Some(whole) = of_the_whole(scenario, parameter, *value, series_deg) {
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
                let slope = value / scenario.sensor.gain;
                out.sensor.offset_ppm *= slope;
                out.sensor.drift_ppm_per_h *= slope;
                *value
            }
            _ => *value,
        };
        out.set_with_sd(parameter, value, *sd);
    }
    out.extend(&analysis.extension);
    out
}

/// The mechanism that does to the whole scenario what `parameter` at `value` was found to do, where
/// its key would do it to the first source only, or nothing beside a series, which blows from
/// `series_deg` in the mean.
fn of_the_whole(
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
