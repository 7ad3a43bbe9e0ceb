//! Step responses: one demand is changed, and what the aircraft does is written down.

use serde::Serialize;

use super::flights::{START_AMSL_M, TICK_S, begin, course_rad, distance_m, tick_of, with_gains};
use crate::aircraft::{Aircraft, ControlGains};
use crate::autopilot::{Autopilot, Demand, Path, Sensed, Sticks};
use crate::error::FdmError;
use crate::flight::FlightSim;
use crate::state::{AirAround, FlightState};
use std::sync::Arc;

/// Time to settle before the step, s.
const BEFORE_S: f64 = 30.0;
/// Step of the bank, degrees.
const BANK_DEG: f64 = 20.0;
/// Change of an orbit's radius, m.
const RADIUS_M: f64 = 30.0;
/// Settling that is tolerable, s, for each step.
const SETTLING_S: [(&str, f64); 5] = [
    ("roll", 2.0),
    ("course", 5.0),
    ("height", 10.0),
    ("airspeed", 10.0),
    ("orbit", 8.0),
];
/// Overshoot that is tolerable, as a share of the step.
const OVERSHOOT: f64 = 0.1;

/// Mean cost of step responses: the squares of settling time and overshoot, each over what is
/// tolerable. What does not settle counts as if it did at the end of its series.
pub(super) fn cost(steps: &[StepResponse]) -> f64 {
    let one = |step: &StepResponse| {
        let end_s = step.series.last().map_or(0.0, |p| p.0);
        let tolerable = SETTLING_S.iter().find(|(what, _)| *what == step.what);
        let tolerable_s = tolerable.map_or(end_s, |(_, s)| *s);
        (step.settling_s.min(end_s) / tolerable_s).powi(2) + (step.overshoot / OVERSHOOT).powi(2)
    };
    steps.iter().map(one).sum::<f64>() / steps.len().max(1) as f64
}

/// A demand stepped, and what the aircraft did.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct StepResponse {
    /// What was stepped: `roll`, `course`, `height`, `airspeed` or `orbit`.
    pub what: String,
    /// The unit of size and series.
    pub unit: String,
    /// Size of the step.
    pub size: f64,
    /// (Time, s; value relative to its start).
    pub series: Vec<(f64, f64)>,
    /// From a tenth to nine tenths of the step, s; infinite where not reached.
    pub rise_s: f64,
    /// Beyond the step, as a share of it.
    pub overshoot: f64,
    /// Time after which it stays within a twentieth of the step, s.
    pub settling_s: f64,
}

/// A demand to be stepped.
struct DemandStep {
    what: &'static str,
    unit: &'static str,
    size: f64,
    wind_ned_m_s: [f64; 3],
    run_s: f64,
    /// Ticks between two points of the series.
    every: u32,
    demand: fn(&Aircraft, bool) -> Demand,
    value: fn(&Aircraft, &FlightState) -> f64,
}

fn demand(aircraft: &Aircraft, path: Path) -> Demand {
    Demand {
        path,
        alt_amsl_m: START_AMSL_M,
        airspeed_m_s: aircraft.limits.airspeed_cruise_m_s,
    }
}

fn northward(aircraft: &Aircraft) -> Demand {
    demand(aircraft, Path::Course { deg: 0.0 })
}

/// A circle to the right of the start, wider before the step.
fn circle(aircraft: &Aircraft, stepped: bool) -> Path {
    let wide = aircraft.control.loiter_radius_m + RADIUS_M;
    Path::Orbit {
        north_m: 0.0,
        east_m: wide,
        radius_m: if stepped { wide - RADIUS_M } else { wide },
        clockwise: true,
    }
}

fn steps(aircraft: &Aircraft) -> [DemandStep; 4] {
    let still = DemandStep {
        what: "course",
        unit: "degrees",
        size: 60.0,
        wind_ned_m_s: [0.0, 5.0, 0.0],
        run_s: 30.0,
        every: 5,
        demand: |a, on| {
            demand(
                a,
                Path::Course {
                    deg: if on { 60.0 } else { 0.0 },
                },
            )
        },
        value: |_, s| course_rad(s).to_degrees(),
    };
    [
        DemandStep {
            what: "height",
            unit: "m",
            size: 10.0,
            wind_ned_m_s: [0.0; 3],
            demand: |a, on| Demand {
                alt_amsl_m: START_AMSL_M + if on { 10.0 } else { 0.0 },
                ..northward(a)
            },
            value: |_, s| s.alt_amsl_m,
            ..still
        },
        DemandStep {
            what: "airspeed",
            unit: "m/s",
            size: 0.1 * aircraft.limits.airspeed_cruise_m_s,
            wind_ned_m_s: [0.0; 3],
            demand: |a, on| Demand {
                airspeed_m_s: a.limits.airspeed_cruise_m_s * if on { 1.1 } else { 1.0 },
                ..northward(a)
            },
            value: |_, s| s.airspeed_m_s,
            ..still
        },
        DemandStep {
            what: "orbit",
            unit: "m",
            size: RADIUS_M,
            demand: |a, on| demand(a, circle(a, on)),
            value: |a, s| -distance_m(s, &circle(a, false)),
            ..still
        },
        still,
    ]
}

/// Steps of bank, course, height, airspeed and orbit radius; course and orbit in 5 m/s of wind,
/// the others in calm air.
pub(super) fn responses(
    aircraft: &Arc<Aircraft>,
    gains: &ControlGains,
) -> Result<Vec<StepResponse>, FdmError> {
    let mut out = vec![roll(aircraft, gains)?];
    let tuned = with_gains(aircraft, gains);
    for step in steps(&tuned) {
        let (mut sim, mut pilot) = begin(&tuned, gains)?;
        let air = AirAround {
            wind_ned_m_s: step.wind_ned_m_s,
            ..AirAround::STANDARD_CALM
        };
        let before = (step.demand)(&tuned, false);
        for _ in 0..ticks(BEFORE_S) {
            tick_of(&mut sim, &mut pilot, &air, &before);
        }
        let start = (step.value)(&tuned, &sim.state());
        let demand = (step.demand)(&tuned, true);
        let mut series = vec![(0.0, 0.0)];
        for tick in 1..=ticks(step.run_s) {
            let state = tick_of(&mut sim, &mut pilot, &air, &demand);
            if tick.is_multiple_of(step.every) {
                series.push((
                    f64::from(tick) * TICK_S,
                    (step.value)(&tuned, &state) - start,
                ));
            }
        }
        out.push(described(step.what, step.unit, step.size, series));
    }
    Ok(out)
}

fn ticks(time_s: f64) -> u32 {
    (time_s / TICK_S).round() as u32
}

/// The inner loops alone: a stick that asks for a bank.
fn roll(aircraft: &Arc<Aircraft>, gains: &ControlGains) -> Result<StepResponse, FdmError> {
    let (mut sim, mut pilot) = begin(aircraft, gains)?;
    let trim = sim.state();
    let sticks = Sticks {
        roll: 0.0,
        pitch: trim.pitch_rad.to_degrees() / gains.pitch_max_deg,
        throttle: trim.throttle,
    };
    for _ in 0..ticks(4.0) {
        by_wire(&mut sim, &mut pilot, &sticks);
    }
    let start = sim.state().roll_rad;
    let banked = Sticks {
        roll: BANK_DEG / gains.bank_max_deg,
        ..sticks
    };
    let mut series = vec![(0.0, 0.0)];
    for tick in 1..=ticks(4.0) {
        let state = by_wire(&mut sim, &mut pilot, &banked);
        series.push((
            f64::from(tick) * TICK_S,
            (state.roll_rad - start).to_degrees(),
        ));
    }
    let size = BANK_DEG.min(gains.bank_max_deg);
    Ok(described("roll", "degrees", size, series))
}

fn by_wire(sim: &mut FlightSim, pilot: &mut Autopilot, sticks: &Sticks) -> FlightState {
    let air = AirAround::STANDARD_CALM;
    let sensed = Sensed::perfect(&sim.sensed(), air.density_kg_m3);
    let command = pilot.fly_by_wire(TICK_S, &sensed, sticks);
    sim.step(TICK_S, &air, &command);
    sim.state()
}

fn described(what: &str, unit: &str, size: f64, series: Vec<(f64, f64)>) -> StepResponse {
    let first = |share: f64| {
        series
            .iter()
            .find(|(_, value)| value / size >= share)
            .map_or(f64::INFINITY, |(time, _)| *time)
    };
    let (ten, ninety) = (first(0.1), first(0.9));
    let last_outside = series
        .iter()
        .rposition(|(_, value)| (value / size - 1.0).abs() > 0.05);
    let settling = last_outside.map_or(0.0, |k| series.get(k + 1).map_or(f64::INFINITY, |s| s.0));
    let highest = series
        .iter()
        .map(|(_, value)| value / size)
        .fold(0.0, f64::max);
    StepResponse {
        what: what.to_owned(),
        unit: unit.to_owned(),
        size,
        rise_s: if ninety.is_finite() {
            ninety - ten
        } else {
            f64::INFINITY
        },
        overshoot: (highest - 1.0).max(0.0),
        settling_s: settling,
        series,
    }
}
