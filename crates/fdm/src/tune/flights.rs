//! The flights on which gains are judged.

use air::dryden::{Dryden, Turbulence};
use rand::SeedableRng;
use rand::rngs::ChaCha8Rng;
use serde::Serialize;

use super::{TuneOrder, Weather};
use crate::FdmError;
use crate::aircraft::Aircraft;
use crate::autopilot::{Autopilot, ControlGains, Demand, Path, Sensed};
use crate::flight::{AirAround, FlightSim, FlightState};

const TICK_S: f64 = 0.02;
/// Length of the flight in each weather, s.
const FLIGHT_S: f64 = 90.0;
/// Time after a change of demand during which an error does not count, s.
const GRACE_S: f64 = 12.0;
/// Errors that cost as much as one another: height m, airspeed m/s, heading rad, bank rad,
/// surface rate rad/s.
const SCALE: [f64; 5] = [2.0, 1.0, 0.1, 0.05, 0.6];
/// Cost of a flight that left the envelope.
const NOT_FLOWN: f64 = 100.0;

/// How a flight in one weather went.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Evaluation {
    /// The weather.
    pub weather: String,
    /// Root mean square of the height error, m (after each change has had its time).
    pub height_rms_m: f64,
    /// Of the airspeed error, m/s.
    pub airspeed_rms_m_s: f64,
    /// Of the heading error, rad.
    pub heading_rms_rad: f64,
    /// Of the difference between commanded and flown bank, rad.
    pub bank_rms_rad: f64,
    /// Of the motion of the surfaces, rad/s.
    pub surface_rate_rms_rad_s: f64,
    /// Whether it stayed in the air, inside the model and below the speed limit, without stall
    /// longer than a tenth of a second.
    pub flown: bool,
    /// Everything as one number: the sum of squares of the errors over what is tolerable.
    pub cost: f64,
}

/// A demand stepped in calm air, and what the aircraft did.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct StepResponse {
    /// What was stepped, with its unit.
    pub what: String,
    /// Size of the step in that unit.
    pub size: f64,
    /// (Time, s; value relative to its start) every 0.1 s.
    pub series: Vec<(f64, f64)>,
    /// From a tenth to nine tenths of the step, s; infinite where not reached.
    pub rise_s: f64,
    /// Beyond the step, as a share of it.
    pub overshoot: f64,
    /// Time after which it stays within a twentieth of the step, s.
    pub settling_s: f64,
}

/// Mean cost of several flights.
pub(super) fn cost(flights: &[Evaluation]) -> f64 {
    flights.iter().map(|f| f.cost).sum::<f64>() / flights.len().max(1) as f64
}

/// Flies the programme in every weather.
pub(super) fn fly_all(
    aircraft: &Aircraft,
    gains: &ControlGains,
    order: &TuneOrder,
) -> Result<Vec<Evaluation>, FdmError> {
    order
        .weather
        .iter()
        .zip(0..)
        .map(|(weather, number)| fly(aircraft, gains, weather, order.seed.wrapping_add(number)))
        .collect()
}

/// What is asked at a time: heading (deg), height above the start (m), airspeed over cruise.
fn programme(time_s: f64) -> (f64, f64, f64) {
    match time_s {
        t if t < 18.0 => (0.0, 0.0, 1.0),
        t if t < 36.0 => (90.0, 0.0, 1.0),
        t if t < 54.0 => (90.0, 15.0, 1.0),
        t if t < 72.0 => (20.0, 15.0, 1.12),
        _ => (20.0, 0.0, 0.95),
    }
}

fn fly(
    aircraft: &Aircraft,
    gains: &ControlGains,
    weather: &Weather,
    seed: u64,
) -> Result<Evaluation, FdmError> {
    let cruise = aircraft.limits.airspeed_cruise_m_s;
    let (mut sim, mut pilot) = begin(aircraft, gains)?;
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut gust = Dryden::new();
    let turbulence = Turbulence::mil_f_8785c(100.0, weather.wind_m_s, weather.turbulence);
    let mut sums = [0.0; 5];
    let (mut counted, mut stalled, mut flown) = (0.0, 0.0, true);
    let mut state = sim.state();
    let ticks = (FLIGHT_S / TICK_S) as u32;
    for tick in 0..ticks {
        let time = f64::from(tick) * TICK_S;
        let (heading_deg, height_m, speed) = programme(time);
        let felt = gust.step(TICK_S, state.airspeed_m_s, &turbulence, &mut rng);
        let air = AirAround {
            wind_ned_m_s: [felt[0], weather.wind_m_s + felt[1], felt[2]],
            density_kg_m3: weather.density_kg_m3,
        };
        let demand = Demand {
            path: Path::Heading { deg: heading_deg },
            alt_amsl_m: 400.0 + height_m,
            airspeed_m_s: cruise * speed,
        };
        let before = state;
        state = tick_of(&mut sim, &mut pilot, &air, &demand);
        flown &= !state.flags.outside_model && state.alt_amsl_m > 300.0;
        if state.flags.stalled {
            stalled += TICK_S;
        }
        let moved = (state.elevator_rad - before.elevator_rad)
            .hypot(state.aileron_rad - before.aileron_rad)
            / TICK_S;
        add_squares(
            &mut sums,
            &mut counted,
            settled(time),
            [
                state.alt_amsl_m - demand.alt_amsl_m,
                state.airspeed_m_s - demand.airspeed_m_s,
                wrapped(state.yaw_rad - heading_deg.to_radians()),
                state.roll_rad - pilot.status().bank_command_rad,
                moved,
            ],
        );
    }
    flown &= stalled <= 0.1;
    Ok(evaluated(weather, &sums, counted, f64::from(ticks), flown))
}

/// Root mean squares and cost from the sums of squares: the first three counted `counted` times,
/// the others `total` times.
fn evaluated(
    weather: &Weather,
    sums: &[f64; 5],
    counted: f64,
    total: f64,
    flown: bool,
) -> Evaluation {
    let counted: f64 = f64::max(counted, 1.0);
    let rms = |k: usize| (sums[k] / if k < 3 { counted } else { total }).sqrt();
    let squares: f64 = (0..5).map(|k| (rms(k) / SCALE[k]).powi(2)).sum();
    Evaluation {
        weather: weather.name.clone(),
        height_rms_m: rms(0),
        airspeed_rms_m_s: rms(1),
        heading_rms_rad: rms(2),
        bank_rms_rad: rms(3),
        surface_rate_rms_rad_s: rms(4),
        flown,
        cost: squares + if flown { 0.0 } else { NOT_FLOWN },
    }
}

/// Bank and surface motion count always; height, speed and heading once a change had its time.
fn add_squares(sums: &mut [f64; 5], counted: &mut f64, settled: bool, errors: [f64; 5]) {
    if settled {
        *counted += 1.0;
    }
    for (k, error) in errors.into_iter().enumerate() {
        if settled || k >= 3 {
            sums[k] += error * error;
        }
    }
}

/// Whether the last change of the programme is long enough ago.
fn settled(time_s: f64) -> bool {
    time_s % 18.0 >= GRACE_S
}

fn wrapped(angle: f64) -> f64 {
    let turn = std::f64::consts::TAU;
    (angle + 0.5 * turn).rem_euclid(turn) - 0.5 * turn
}

/// The aircraft in cruise at 400 m, with an autopilot that counts with its base.
fn begin(aircraft: &Aircraft, gains: &ControlGains) -> Result<(FlightSim, Autopilot), FdmError> {
    let cruise = aircraft.limits.airspeed_cruise_m_s;
    let sim = FlightSim::airborne(aircraft, 0.0, 0.0, 400.0, 0.0, cruise)?;
    let mut base = aircraft.clone();
    base.control = *gains;
    Ok((sim, Autopilot::new(&base)))
}

fn tick_of(
    sim: &mut FlightSim,
    pilot: &mut Autopilot,
    air: &AirAround,
    demand: &Demand,
) -> FlightState {
    let sensed = Sensed::perfect(&sim.sensed(), air.density_kg_m3);
    let command = pilot.command(TICK_S, &sensed, demand);
    sim.step(TICK_S, air, &command);
    sim.state()
}

/// Steps of heading, height and airspeed in calm air.
pub(super) fn step_responses(
    aircraft: &Aircraft,
    gains: &ControlGains,
) -> Result<Vec<StepResponse>, FdmError> {
    type Value = fn(&FlightState) -> f64;
    let cruise = aircraft.limits.airspeed_cruise_m_s;
    let heading: Value = |s| s.yaw_rad.to_degrees();
    let cases: [(&str, f64, Value); 3] = [
        ("heading, degrees", 60.0, heading),
        ("height, m", 10.0, |s| s.alt_amsl_m - 400.0),
        ("airspeed, m/s", 0.1 * cruise, |s| s.airspeed_m_s),
    ];
    let mut out = Vec::with_capacity(cases.len());
    for (k, (what, size, value)) in cases.into_iter().enumerate() {
        let (mut sim, mut pilot) = begin(aircraft, gains)?;
        let step = |of: usize| if of == k { size } else { 0.0 };
        let demand = |on: f64| Demand {
            path: Path::Heading { deg: on * step(0) },
            alt_amsl_m: 400.0 + on * step(1),
            airspeed_m_s: cruise + on * step(2),
        };
        for _ in 0..500 {
            tick_of(
                &mut sim,
                &mut pilot,
                &AirAround::STANDARD_CALM,
                &demand(0.0),
            );
        }
        let start = value(&sim.state());
        let mut series = vec![(0.0, 0.0)];
        for tick in 1..=1500_u32 {
            let state = tick_of(
                &mut sim,
                &mut pilot,
                &AirAround::STANDARD_CALM,
                &demand(1.0),
            );
            if tick.is_multiple_of(5) {
                series.push((f64::from(tick) * TICK_S, value(&state) - start));
            }
        }
        out.push(described(what, size, series));
    }
    Ok(out)
}

fn described(what: &str, size: f64, series: Vec<(f64, f64)>) -> StepResponse {
    let first = |share: f64| {
        series
            .iter()
            .find(|(_, value)| value / size >= share)
            .map_or(f64::INFINITY, |(time, _)| *time)
    };
    let settling = series
        .iter()
        .rev()
        .find(|(_, value)| (value / size - 1.0).abs() > 0.05)
        .map_or(0.0, |(time, _)| *time);
    let highest = series
        .iter()
        .map(|(_, value)| value / size)
        .fold(0.0, f64::max);
    StepResponse {
        what: what.to_owned(),
        size,
        rise_s: first(0.9) - first(0.1),
        overshoot: (highest - 1.0).max(0.0),
        settling_s: settling,
        series,
    }
}
