//! Finding the autopilot's gains in simulation, and judging them: step responses, stability
//! margins of the inner loops, and what happens when the aircraft is not as described.
//!
//! To re-tune from a measured flight, give the aircraft the mechanisms that the flight showed:
//! the extended aircraft flies, while the autopilot still counts with the base.

use rand::rngs::ChaCha8Rng;
use rand::{RngExt, SeedableRng};
use rand_distr::{Distribution, StandardNormal};
use serde::Serialize;

use crate::FdmError;
use crate::aircraft::Aircraft;
use crate::autopilot::ControlGains;
use crate::mechanism::Mechanism;

mod flights;
mod margins;

pub use flights::{Evaluation, StepResponse};
pub use margins::LoopMargin;

/// First spread of the search, as a share of each gain (log scale).
const FIRST_SPREAD: f64 = 0.35;
/// Spread at which the search ends.
const LAST_SPREAD: f64 = 0.05;
/// Chance that a gain is varied in a trial.
const VARIED_SHARE: f64 = 0.5;
/// Least gain margin (as a factor), phase margin (degrees) accepted by the search: the usual
/// 6 dB and 45° of MIL-F-9490D.
const LEAST_MARGIN: (f64, f64) = (2.0, 45.0);

/// Weather to fly in.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Weather {
    /// What the report calls it.
    pub name: String,
    /// Wind speed, m/s.
    pub wind_m_s: f64,
    /// Turbulence as a share of MIL-F-8785C's for that wind.
    pub turbulence: f64,
    /// Air density, kg/m³.
    pub density_kg_m3: f64,
}

/// What to search and with how much effort.
#[derive(Debug, Clone, PartialEq)]
pub struct TuneOrder {
    /// Seed of the search and of the gusts.
    pub seed: u64,
    /// Candidates tried, each flown in every weather.
    pub candidates: usize,
    /// Weather cases.
    pub weather: Vec<Weather>,
}

impl Default for TuneOrder {
    /// 200 candidates in calm, moderate and strong wind.
    fn default() -> Self {
        let case = |name: &str, wind_m_s, turbulence, density_kg_m3| Weather {
            name: name.to_owned(),
            wind_m_s,
            turbulence,
            density_kg_m3,
        };
        Self {
            seed: 1,
            candidates: 200,
            weather: vec![
                case("calm, sea level", 0.0, 0.0, 1.225),
                case("5 m/s, gusts", 5.0, 1.0, 1.18),
                case("9 m/s, strong gusts, 1500 m", 9.0, 1.3, 1.06),
            ],
        }
    }
}

/// A change of the aircraft, and how the tuned gains fare with it.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct RobustnessCase {
    /// What was changed.
    pub change: String,
    /// Cost with the change over cost without.
    pub cost_ratio: f64,
    /// Whether it flew all weather without stall, overspeed or leaving the model.
    pub flown: bool,
}

/// What a tuning found; everything a report draws.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct TuneReport {
    /// Name of the aircraft.
    pub aircraft: String,
    /// Gains of the file.
    pub before: ControlGains,
    /// Gains found.
    pub after: ControlGains,
    /// Flights with the gains of the file, one per weather.
    pub flights_before: Vec<Evaluation>,
    /// Flights with the gains found.
    pub flights_after: Vec<Evaluation>,
    /// Best cost after each candidate.
    pub history: Vec<f64>,
    /// Step responses in calm air with the gains found.
    pub steps: Vec<StepResponse>,
    /// Stability margins of the inner loops at several airspeeds with the gains found.
    pub margins: Vec<LoopMargin>,
    /// The gains found on aircraft that differ from the description.
    pub robustness: Vec<RobustnessCase>,
}

impl TuneReport {
    /// The gains found as the `[control]` table of an aircraft file.
    ///
    /// # Errors
    /// [`FdmError::Unwritable`] when a gain has no TOML form (none of a checked set).
    pub fn control_toml(&self) -> Result<String, FdmError> {
        let table = toml::to_string(&self.after)
            .map_err(|error| FdmError::Unwritable(error.to_string()))?;
        Ok(format!("[control]\n{table}"))
    }
}

/// The gains that the search varies; limits and approach stay as the user set them.
fn varied(gains: &mut ControlGains) -> [&mut f64; 12] {
    [
        &mut gains.roll_bandwidth_rad_s,
        &mut gains.roll_damping_rad_s,
        &mut gains.roll_integral_rad_s,
        &mut gains.pitch_bandwidth_rad_s,
        &mut gains.pitch_damping_rad_s,
        &mut gains.pitch_integral_rad_s,
        &mut gains.heading_bandwidth_rad_s,
        &mut gains.orbit_gain,
        &mut gains.height_time_s,
        &mut gains.airspeed_time_s,
        &mut gains.energy_damping,
        &mut gains.energy_integral_s,
    ]
}

/// Searches gains by a shrinking random search from those of the file, keeping every candidate's
/// gusts the same so that only gains make the difference; candidates with less than 6 dB or 45°
/// of margin are not flown.
///
/// # Errors
/// The aircraft's own faults, and [`FdmError::NoTrim`] when it cannot fly at its cruise speed.
pub fn tune(aircraft: &Aircraft, order: &TuneOrder) -> Result<TuneReport, FdmError> {
    aircraft.check()?;
    let before = aircraft.control;
    let flights_before = flights::fly_all(aircraft, &before, order)?;
    let mut best = (before, flights::cost(&flights_before));
    if !has_margins(aircraft, &before)? {
        best.1 = f64::INFINITY;
    }
    let mut rng = ChaCha8Rng::seed_from_u64(order.seed);
    let mut history = Vec::with_capacity(order.candidates);
    for trial in 0..order.candidates {
        let progress = trial as f64 / order.candidates.max(1) as f64;
        let spread = FIRST_SPREAD * (LAST_SPREAD / FIRST_SPREAD).powf(progress);
        let mut gains = best.0;
        for gain in varied(&mut gains) {
            let step: f64 = StandardNormal.sample(&mut rng);
            if rng.random::<f64>() < VARIED_SHARE {
                *gain *= (spread * step).exp();
            }
        }
        if gains.check().is_ok() && has_margins(aircraft, &gains)? {
            let cost = flights::cost(&flights::fly_all(aircraft, &gains, order)?);
            if cost < best.1 {
                best = (gains, cost);
            }
        }
        history.push(best.1);
    }
    judge(aircraft, order, best.0, flights_before, history)
}

/// Whether the inner loops at cruise keep the least margins.
fn has_margins(aircraft: &Aircraft, gains: &ControlGains) -> Result<bool, FdmError> {
    let speed = aircraft.limits.airspeed_cruise_m_s;
    let margins = margins::inner_loops(aircraft, gains, speed)?;
    Ok(margins.iter().all(|m| {
        m.stable && m.gain_margin >= LEAST_MARGIN.0 && m.phase_margin_deg >= LEAST_MARGIN.1
    }))
}

/// Everything about a set of gains.
fn judge(
    aircraft: &Aircraft,
    order: &TuneOrder,
    after: ControlGains,
    flights_before: Vec<Evaluation>,
    history: Vec<f64>,
) -> Result<TuneReport, FdmError> {
    let limits = &aircraft.limits;
    let flights_after = flights::fly_all(aircraft, &after, order)?;
    let mut loop_margins = Vec::new();
    let slow =
        limits.airspeed_min_m_s + 0.25 * (limits.airspeed_cruise_m_s - limits.airspeed_min_m_s);
    let fast =
        limits.airspeed_cruise_m_s + 0.5 * (limits.airspeed_max_m_s - limits.airspeed_cruise_m_s);
    for speed in [slow, limits.airspeed_cruise_m_s, fast] {
        loop_margins.extend(margins::inner_loops(aircraft, &after, speed)?);
    }
    Ok(TuneReport {
        aircraft: aircraft.name.clone(),
        before: aircraft.control,
        after,
        steps: flights::step_responses(aircraft, &after)?,
        margins: loop_margins,
        robustness: robustness(aircraft, order, &after, flights::cost(&flights_after))?,
        flights_before,
        flights_after,
        history,
    })
}

/// Flies the gains on aircraft that differ from the description.
fn robustness(
    aircraft: &Aircraft,
    order: &TuneOrder,
    gains: &ControlGains,
    nominal: f64,
) -> Result<Vec<RobustnessCase>, FdmError> {
    let weight = 0.25 * aircraft.body.mass_kg;
    let chord = aircraft.wing.chord_m;
    let cases: [(&str, &str, &[f64]); 9] = [
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
        ("25 % heavier", "mass-change", &[weight]),
        (
            "centre of gravity 3 % of the chord aft",
            "cg-shift",
            &[-0.03 * chord],
        ),
        ("servos 60 ms late", "actuator-delay", &[0.06]),
        ("servos 50 ms slower", "actuator-lag", &[0.05]),
        ("a quarter of the thrust lost", "thrust-loss", &[0.25]),
        ("half the roll damping", "roll-damping", &[0.5]),
        (
            "elevator 3 and aileron 2 degrees off",
            "surface-trim-offset",
            &[3.0, 2.0],
        ),
    ];
    let mut out = Vec::with_capacity(cases.len());
    for (change, id, values) in cases {
        let mut other = aircraft.clone();
        other.mechanism.push(Mechanism::with_values(id, values)?);
        // An aircraft that cannot even be trimmed with the change has not flown.
        let flown = flights::fly_all(&other, gains, order);
        out.push(match flown {
            Ok(flights) => RobustnessCase {
                change: change.to_owned(),
                cost_ratio: flights::cost(&flights) / nominal,
                flown: flights.iter().all(|f| f.flown),
            },
            Err(_) => RobustnessCase {
                change: change.to_owned(),
                cost_ratio: f64::INFINITY,
                flown: false,
            },
        });
    }
    Ok(out)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn quick() -> TuneOrder {
        TuneOrder {
            candidates: 25,
            ..TuneOrder::default()
        }
    }

    #[test]
    fn slack_gains_are_mended_and_the_result_is_repeatable() {
        let mut aircraft =
            Aircraft::from_toml("x8", include_str!("../../../aircraft/x8.toml")).unwrap();
        aircraft.control.roll_bandwidth_rad_s = 1.0;
        aircraft.control.pitch_bandwidth_rad_s = 0.8;
        aircraft.control.height_time_s = 15.0;
        let report = tune(&aircraft, &quick()).unwrap();
        let (before, after) = (
            flights::cost(&report.flights_before),
            flights::cost(&report.flights_after),
        );
        println!("cost {before:.3} -> {after:.3}");
        for margin in &report.margins {
            println!("{margin:?}");
        }
        for case in &report.robustness {
            println!("{case:?}");
        }
        for step in &report.steps {
            println!(
                "{} rise {:.2} overshoot {:.1} % settle {:.2}",
                step.what,
                step.rise_s,
                100.0 * step.overshoot,
                step.settling_s
            );
        }
        assert!(after < 0.8 * before);
        assert!(report.flights_after.iter().all(|f| f.flown));
        assert!(report.history.windows(2).all(|w| w[1] <= w[0]));
        assert_eq!(report, tune(&aircraft, &quick()).unwrap());
        // The table it writes is one that the aircraft file takes.
        let text = format!(
            "{}\n{}",
            include_str!("../../../aircraft/x8.toml"),
            report.control_toml().unwrap()
        );
        let again = Aircraft::from_toml("tuned", &text).unwrap();
        assert_eq!(again.control, report.after);
    }

    #[test]
    fn the_aircraft_of_the_house_fly_with_margin() {
        for text in [
            include_str!("../../../aircraft/x8.toml"),
            include_str!("../../../aircraft/ultrastick-25e.toml"),
        ] {
            let aircraft = Aircraft::from_toml("aircraft", text).unwrap();
            assert!(
                has_margins(&aircraft, &aircraft.control).unwrap(),
                "{}",
                aircraft.name
            );
            for flight in flights::fly_all(&aircraft, &aircraft.control, &quick()).unwrap() {
                println!("{} {flight:?}", aircraft.name);
                assert!(flight.flown, "{}: {flight:?}", aircraft.name);
            }
        }
    }
}
