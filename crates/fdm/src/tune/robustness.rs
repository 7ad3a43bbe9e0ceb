//! The gains on aircraft that differ from their description.

use serde::Serialize;

use super::{Required, WeatherCase, flights, margins};
use crate::aircraft::{Aircraft, ControlGains};
use crate::error::FdmError;
use crate::mechanism::Mechanism;
use std::sync::Arc;

/// A change of the aircraft, and how a set of gains fares with it.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct RobustnessCase {
    /// What was changed.
    pub change: String,
    /// Mean cost of the flights in all weather with the change; infinite where there is no trim.
    pub cost: f64,
    /// Whether it flew all weather without stall, overspeed or leaving the model.
    pub flown: bool,
    /// Least gain margin of the inner loops at cruise, dB; negative infinity where there is no
    /// trim.
    pub gain_margin_db: f64,
    /// Least phase margin of the inner loops at cruise, degrees.
    pub phase_margin_deg: f64,
}

/// Name, mechanism and values of each change. Mass and centre of gravity are shares, of the
/// aircraft's mass and chord.
const CHANGES: [(&str, &str, &[f64]); 11] = [
    (
        "controls 30 % weaker",
        "control-effectiveness",
        &[0.7, 0.7, 0.7],
    ),
    (
        "controls 30 % stronger",
        "control-effectiveness",
        &[1.3, 1.3, 1.3],
    ),
    ("25 % heavier", "mass-change", &[0.25]),
    (
        "centre of gravity 3 % of the chord aft",
        "cg-shift",
        &[-0.03],
    ),
    (
        "centre of gravity 3 % of the chord ahead",
        "cg-shift",
        &[0.03],
    ),
    ("servos delayed by 40 ms", "actuator-delay", &[0.04]),
    ("servos 50 ms slower", "actuator-lag", &[0.05]),
    ("a quarter of the thrust lost", "thrust-loss", &[0.25]),
    ("half the roll damping", "roll-damping", &[0.5]),
    ("half the pitch damping", "pitch-damping", &[0.5]),
    (
        "elevator 3 and aileron 2 degrees off",
        "surface-trim-offset",
        &[3.0, 2.0],
    ),
];

/// The aircraft with each change on top of its own mechanisms.
fn changed(aircraft: &Arc<Aircraft>) -> Result<Vec<(&'static str, Arc<Aircraft>)>, FdmError> {
    CHANGES
        .iter()
        .map(|(change, id, values)| {
            let unit = match *id {
                "mass-change" => aircraft.body.mass_kg,
                "cg-shift" => aircraft.wing.chord_m,
                _ => 1.0,
            };
            let values: Vec<f64> = values.iter().map(|value| value * unit).collect();
            let mut other = Aircraft::clone(aircraft);
            other.mechanism.push(Mechanism::with_values(id, &values)?);
            Ok((*change, Arc::new(other)))
        })
        .collect()
}

/// Flies the gains with every change.
pub(super) fn judged(
    aircraft: &Arc<Aircraft>,
    gains: &ControlGains,
    weather: &[WeatherCase],
) -> Result<Vec<RobustnessCase>, FdmError> {
    let mut out = Vec::with_capacity(CHANGES.len());
    for (change, other) in changed(aircraft)? {
        // An aircraft that cannot even be trimmed with the change has not flown.
        let flown = flights::fly_all(&other, gains, weather);
        let (cost, all_flown) = flown.map_or((f64::INFINITY, false), |f| {
            (flights::cost(&f), f.iter().all(|f| f.flown))
        });
        let least = least_margins(&other, gains);
        out.push(RobustnessCase {
            change: change.to_owned(),
            cost,
            flown: all_flown,
            gain_margin_db: least.gain_db,
            phase_margin_deg: least.phase_deg,
        });
    }
    Ok(out)
}

/// The least margins of the inner loops at cruise; negative infinity where there is no trim.
fn least_margins(aircraft: &Arc<Aircraft>, gains: &ControlGains) -> Required {
    let cruise = aircraft.limits.airspeed_cruise_m_s;
    let none = Required {
        gain_db: f64::NEG_INFINITY,
        phase_deg: f64::NEG_INFINITY,
    };
    margins::inner_loops(aircraft, gains, cruise).map_or(none, |[roll, pitch]| Required {
        gain_db: roll.gain_margin_db.min(pitch.gain_margin_db),
        phase_deg: roll.phase_margin_deg.min(pitch.phase_margin_deg),
    })
}

/// Whether, with every change, the gains keep half the margins required, or those that `like` has
/// where these are less, and fly wherever `like` flies.
pub(super) fn as_robust_as(
    like: &[RobustnessCase],
    required: &Required,
    aircraft: &Arc<Aircraft>,
    gains: &ControlGains,
    weather: &[WeatherCase],
) -> Result<bool, FdmError> {
    let changed = changed(aircraft)?;
    let keeps_margins = changed.iter().zip(like).all(|((_, other), case)| {
        let least = least_margins(other, gains);
        least.gain_db >= case.gain_margin_db.min(0.5 * required.gain_db)
            && least.phase_deg >= case.phase_margin_deg.min(0.5 * required.phase_deg)
    });
    Ok(keeps_margins
        && changed.iter().zip(like).all(|((_, other), case)| {
            !case.flown
                || flights::fly_all(other, gains, weather)
                    .is_ok_and(|flights| flights.iter().all(|f| f.flown))
        }))
}
