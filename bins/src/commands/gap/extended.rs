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
    let own_deg = scenario.weather.wind_from_deg;
    let mut from_deg = own_deg;
    if let Some((logged_deg, speed_m_s)) = analysis.logged_wind.filter(|_| !by_series) {
        from_deg = logged_deg;
        out.set(Uncertain::WindFrom, from_deg);
        out.set(Uncertain::WindSpeed, speed_m_s);
        out.weather.series = None;
    }
    for (key, value, sd) in &analysis.base {
        let Some(parameter) = Uncertain::ALL.into_iter().find(|u| u.key() == key) else {
            continue;
        };
        if let Some(whole) = of_the_whole(scenario, parameter, *value, by_series) {
            out.extend(&[whole]);
            continue;
        }
        let value = match parameter {
            Uncertain::WindFrom => from_deg + value - own_deg,
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
/// its key would do it to the first source only, or nothing beside a series.
fn of_the_whole(
    scenario: &Scenario,
    parameter: Uncertain,
    value: f64,
    by_series: bool,
) -> Option<Mechanism> {
    let stated = scenario.value(parameter)?;
    let (factor, difference) = (value / stated, value - stated);
    let several = scenario.sources.len() > 1;
    let (id, found) = match parameter {
        Uncertain::WindFrom if by_series => (MechanismId::WindDirectionOffset, difference),
        Uncertain::WindSpeed if by_series => (MechanismId::WindSpeedScale, factor),
        Uncertain::EffectiveHeight if several => (MechanismId::EffectiveHeightOffset, difference),
        Uncertain::Emission | Uncertain::CMax if several => (MechanismId::EmissionScale, factor),
        _ => return None,
    };
    found
        .is_finite()
        .then(|| Mechanism::from_values(id, &[found]))
}
