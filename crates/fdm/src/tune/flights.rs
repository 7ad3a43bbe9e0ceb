//! The flights on which gains are judged.

use air::dryden::{Dryden, Turbulence};
use air::geo::wrap_signed_rad;
use rand::SeedableRng;
use rand::rngs::ChaCha8Rng;
use serde::Serialize;

use super::WeatherCase;
use crate::aircraft::{Aircraft, ControlGains};
use crate::autopilot::{Autopilot, Demand, Path, Sensed};
use crate::error::FdmError;
use crate::flight::FlightSim;
use crate::state::{AirAround, FlightState};
use std::sync::Arc;

/// Time between two changes of demand, s.
const STAGE_S: f64 = 18.0;
/// Stages before the orbit.
const STAGES: usize = 5;
/// Period of the controller, s.
pub(super) const TICK_S: f64 = 0.02;
/// Length of the flight in each weather, s.
const FLIGHT_S: f64 = 130.0;
/// Time after a change of demand during which an error does not count, s.
const GRACE_S: f64 = 6.0;
/// The same for the orbit, which is joined from outside, s.
const ORBIT_GRACE_S: f64 = 10.0;
/// How far outside the circle the orbit begins, m.
const ORBIT_FROM_M: f64 = 30.0;
/// Altitude at the start, m above mean sea level.
pub(super) const START_AMSL_M: f64 = 400.0;
/// Errors that cost as much as one another: height m, airspeed m/s, course rad, orbit m, bank
/// rad, surface rate rad/s.
const SCALE: [f64; 6] = [2.0, 1.0, 0.1, 5.0, 0.1, 0.6];
/// Cost of a flight that left the envelope.
const NOT_FLOWN: f64 = 100.0;
/// Longest time beyond the stall angle or the speed limit: gusts alone may lead there for an
/// instant. A hundredth of the flight, s.
const OUTSIDE_S: f64 = 0.01 * FLIGHT_S;

/// How a flight in one weather went.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Evaluation {
    /// The weather.
    pub weather: WeatherCase,
    /// Root mean square of the height error, m (after each change has had its time).
    pub height_rms_m: f64,
    /// Of the airspeed error, m/s.
    pub airspeed_rms_m_s: f64,
    /// Of the error of the course over ground, rad.
    pub course_rms_rad: f64,
    /// Of the distance from the circle of an orbit, m.
    pub orbit_rms_m: f64,
    /// Of the difference between commanded and flown bank, rad.
    pub bank_rms_rad: f64,
    /// Of the motion of the surfaces, rad/s.
    pub surface_rate_rms_rad_s: f64,
    /// Time beyond the stall angle or the speed limit, s.
    pub outside_s: f64,
    /// Whether it stayed in the air and inside the model, and beyond the stall angle or the speed
    /// limit for less than a hundredth of the flight.
    pub flown: bool,
    /// Everything as one number: the sum of squares of the errors over what is tolerable.
    pub cost: f64,
}

/// Mean cost of several flights.
pub(super) fn cost(flights: &[Evaluation]) -> f64 {
    flights.iter().map(|f| f.cost).sum::<f64>() / flights.len().max(1) as f64
}

/// Flies the programme in every weather.
pub(super) fn fly_all(
    aircraft: &Arc<Aircraft>,
    gains: &ControlGains,
    weather: &[WeatherCase],
) -> Result<Vec<Evaluation>, FdmError> {
    weather.iter().map(|w| fly(aircraft, gains, w)).collect()
}

/// What is asked in the stages before the orbit: course (deg), height above the start (m),
/// airspeed over cruise.
const PROGRAMME: [(f64, f64, f64); STAGES] = [
    (0.0, 0.0, 1.0),
    (90.0, 0.0, 1.0),
    (90.0, 15.0, 1.0),
    (20.0, 15.0, 1.12),
    (20.0, 0.0, 0.95),
];

/// What is asked at a time. The orbit's circle lies to the right of where it begins.
fn demand_at(
    time_s: f64,
    state: &FlightState,
    gains: &ControlGains,
    before: &Path,
) -> (Path, f64, f64) {
    let stage = (time_s / STAGE_S) as usize;
    if let Some((deg, height_m, speed)) = PROGRAMME.get(stage) {
        return (Path::Course { deg: *deg }, *height_m, *speed);
    }
    let path = match before {
        Path::Orbit { .. } => *before,
        _ => {
            let radius_m = gains.loiter_radius_m;
            let (sin, cos) = course_rad(state).sin_cos();
            let away = radius_m + ORBIT_FROM_M;
            Path::Orbit {
                north_m: state.north_m - away * sin,
                east_m: state.east_m + away * cos,
                radius_m,
                clockwise: true,
            }
        }
    };
    (path, 0.0, 1.0)
}

/// Course over ground, rad.
pub(super) fn course_rad(state: &FlightState) -> f64 {
    state.vel_ned_m_s[1].atan2(state.vel_ned_m_s[0])
}

fn fly(
    aircraft: &Arc<Aircraft>,
    gains: &ControlGains,
    weather: &WeatherCase,
) -> Result<Evaluation, FdmError> {
    let cruise = aircraft.limits.airspeed_cruise_m_s;
    let (mut sim, mut pilot) = begin(aircraft, gains)?;
    let mut rng = ChaCha8Rng::seed_from_u64(weather.gust_seed);
    let mut gust = Dryden::new();
    let turbulence = Turbulence::mil_f_8785c(100.0, weather.wind_m_s, weather.turbulence);
    let mean = weather.wind_ned_m_s();
    let mut tally = ErrorSums::default();
    let (mut outside_s, mut flown) = (0.0, true);
    let mut state = sim.state();
    let mut path = Path::Course { deg: 0.0 };
    for tick in 0..(FLIGHT_S / TICK_S) as u32 {
        let time_s = f64::from(tick) * TICK_S;
        let felt = gust.step(TICK_S, state.airspeed_m_s, &turbulence, &mut rng);
        let air = AirAround {
            wind_ned_m_s: [mean[0] + felt[0], mean[1] + felt[1], mean[2] + felt[2]],
            density_kg_m3: weather.density_kg_m3,
        };
        let (next, height_m, speed) = demand_at(time_s, &state, gains, &path);
        path = next;
        let demand = Demand {
            path,
            alt_amsl_m: START_AMSL_M + height_m,
            airspeed_m_s: cruise * speed,
        };
        let before = state;
        state = tick_of(&mut sim, &mut pilot, &air, &demand);
        flown &= !state.flags.outside_model && state.alt_amsl_m > START_AMSL_M - 100.0;
        if state.flags.stalled || state.flags.overspeed {
            outside_s += TICK_S;
        }
        let bank_error = state.roll_rad - pilot.status().bank_command_rad;
        tally.add(time_s, [&before, &state], &demand, bank_error);
    }
    Ok(tally.evaluation(weather, flown && outside_s <= OUTSIDE_S, outside_s))
}

/// Sums of squares of the errors, in the order of [`SCALE`], and how many each has.
#[derive(Debug, Default)]
struct ErrorSums {
    squares: [f64; 6],
    count: [f64; 6],
}

impl ErrorSums {
    /// Bank and surface motion count always; the others once a change had its time.
    fn add(&mut self, time_s: f64, [before, now]: [&FlightState; 2], demand: &Demand, bank: f64) {
        let moved =
            (now.elevator_rad - before.elevator_rad).hypot(now.aileron_rad - before.aileron_rad);
        self.count_in(4, bank);
        self.count_in(5, moved / TICK_S);
        let in_orbit_s = time_s - STAGES as f64 * STAGE_S;
        let settled = if in_orbit_s < 0.0 {
            time_s % STAGE_S >= GRACE_S
        } else {
            in_orbit_s >= ORBIT_GRACE_S
        };
        if !settled {
            return;
        }
        self.count_in(0, now.alt_amsl_m - demand.alt_amsl_m);
        self.count_in(1, now.airspeed_m_s - demand.airspeed_m_s);
        match demand.path {
            Path::Course { deg } => {
                self.count_in(2, wrap_signed_rad(course_rad(now) - deg.to_radians()))
            }
            Path::Orbit { radius_m, .. } => {
                self.count_in(3, distance_m(now, &demand.path) - radius_m)
            }
            _ => {}
        }
    }

    fn count_in(&mut self, which: usize, error: f64) {
        self.squares[which] += error * error;
        self.count[which] += 1.0;
    }

    fn evaluation(&self, weather: &WeatherCase, flown: bool, outside_s: f64) -> Evaluation {
        let rms = |k: usize| (self.squares[k] / self.count[k].max(1.0)).sqrt();
        let squares: f64 = SCALE
            .iter()
            .enumerate()
            .map(|(k, scale)| (rms(k) / scale).powi(2))
            .sum();
        Evaluation {
            weather: weather.clone(),
            height_rms_m: rms(0),
            airspeed_rms_m_s: rms(1),
            course_rms_rad: rms(2),
            orbit_rms_m: rms(3),
            bank_rms_rad: rms(4),
            surface_rate_rms_rad_s: rms(5),
            outside_s,
            flown,
            cost: squares + if flown { 0.0 } else { NOT_FLOWN },
        }
    }
}

/// Distance from an orbit's centre, m; 0 for another path.
pub(super) fn distance_m(state: &FlightState, path: &Path) -> f64 {
    match *path {
        Path::Orbit {
            north_m, east_m, ..
        } => (state.north_m - north_m).hypot(state.east_m - east_m),
        _ => 0.0,
    }
}

/// The aircraft in cruise, with an autopilot that counts with its base.
pub(super) fn begin(
    aircraft: &Arc<Aircraft>,
    gains: &ControlGains,
) -> Result<(FlightSim, Autopilot), FdmError> {
    let cruise = aircraft.limits.airspeed_cruise_m_s;
    let sim = FlightSim::airborne(aircraft, 0.0, 0.0, START_AMSL_M, 0.0, cruise)?;
    Ok((sim, Autopilot::new(&with_gains(aircraft, gains))))
}

/// The aircraft with these gains in place of its own.
pub(super) fn with_gains(aircraft: &Aircraft, gains: &ControlGains) -> Arc<Aircraft> {
    let mut aircraft = aircraft.clone();
    aircraft.control = *gains;
    Arc::new(aircraft)
}

/// One tick of the controller and the aircraft.
pub(super) fn tick_of(
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
