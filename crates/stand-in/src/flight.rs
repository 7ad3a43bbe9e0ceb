//! The stand-in's flight: modes as ArduPlane has them, flown by Plumage's flight dynamics.

use crate::config::StandInConfig;
use crate::estimator::Estimator;
use crate::parameters::{AutopilotParameters, RTL_ALTITUDE, WP_LOITER_RAD};
use crate::reality::Reality;
use air::geo::Enu;
use fdm::autopilot::{Autopilot, Demand, Path, Sensed, Sticks};
use fdm::{Aircraft, FdmError, FlightPhase, FlightSim, FlightState, SurfaceCommand};
use mav_bridge::arduplane::{AUTO, CIRCLE, FBWA, GUIDED, LOITER, MANUAL, RTL, TAKEOFF, TKOFF_ALT};
use rand::rngs::ChaCha8Rng;

/// Period of what changes slowly: mean wind, air, errors of the estimate, s.
const SLOW_S: f64 = 0.1;
/// Longest step of the autopilot, s.
const LOOP_S: f64 = 0.02;
/// Longest time flown in one call, s: after a longer pause the rest is left out.
const LONGEST_PAUSE_S: f64 = 10.0;
/// Height below TKOFF_ALT at which the climb of mode TAKEOFF is done, m.
const CLIMB_DONE_M: f64 = 5.0;

/// Where it took off and comes home to.
#[derive(Debug, Clone, Copy)]
pub(crate) struct HomePosition {
    pub at: Enu,
    pub ground_amsl_m: f64,
    pub heading_deg: f64,
}

impl HomePosition {
    pub(crate) fn of(config: &StandInConfig) -> Self {
        Self {
            at: config.frame.to_enu(config.home),
            ground_amsl_m: config.home_amsl_m,
            heading_deg: config.launch_heading_deg,
        }
    }
}

/// The vehicle in flight.
#[derive(Debug, Clone)]
pub(crate) struct FlightController {
    sim: FlightSim,
    autopilot: Autopilot,
    estimator: Estimator,
    sensed: Sensed,
    home: HomePosition,
    slow_s: f64,
    mode: u32,
    armed: bool,
    sticks: Sticks,
    /// Where GUIDED, LOITER and CIRCLE fly.
    target: Demand,
    /// True airspeed commanded, m/s.
    airspeed_m_s: f64,
    cruise_m_s: f64,
    climbing: bool,
}

impl FlightController {
    pub(crate) fn new(
        aircraft: &Aircraft,
        home: HomePosition,
        rng: &mut ChaCha8Rng,
    ) -> Result<Self, FdmError> {
        let sim = FlightSim::on_ground(
            aircraft,
            home.at.north_m,
            home.at.east_m,
            home.ground_amsl_m,
            home.heading_deg,
        )?;
        let cruise_m_s = aircraft.limits.airspeed_cruise_m_s;
        let estimator = Estimator::new(rng);
        let sensed = estimator.sensed(&sim.state(), 1.2);
        Ok(Self {
            autopilot: Autopilot::new(aircraft),
            estimator,
            sensed,
            home,
            slow_s: SLOW_S,
            mode: MANUAL,
            armed: false,
            sticks: CENTRED,
            target: Demand {
                path: Path::Heading {
                    deg: home.heading_deg,
                },
                alt_amsl_m: home.ground_amsl_m,
                airspeed_m_s: cruise_m_s,
            },
            airspeed_m_s: cruise_m_s,
            cruise_m_s,
            climbing: false,
            sim,
        })
    }

    pub(crate) fn state(&self) -> FlightState {
        self.sim.state()
    }

    /// The state as its autopilot estimates it.
    pub(crate) fn sensed(&self) -> &Sensed {
        &self.sensed
    }

    /// The wind as its autopilot estimates it, north and east, towards, m/s.
    pub(crate) fn wind_m_s(&self) -> Option<[f64; 2]> {
        self.estimator.wind_m_s()
    }

    pub(crate) fn mode(&self) -> u32 {
        self.mode
    }

    pub(crate) fn armed(&self) -> bool {
        self.armed
    }

    pub(crate) fn flying(&self) -> bool {
        self.state().phase == FlightPhase::Flying
    }

    pub(crate) fn home(&self) -> HomePosition {
        self.home
    }

    pub(crate) fn set_armed(&mut self, armed: bool) {
        self.armed = armed;
        if !armed {
            self.autopilot.reset();
        }
    }

    pub(crate) fn set_sticks(&mut self, sticks: Sticks) {
        self.sticks = sticks;
    }

    /// Enters a mode; false if it has no such mode.
    pub(crate) fn set_mode(&mut self, mode: u32, parameters: &AutopilotParameters) -> bool {
        let known = matches!(mode, RTL | TAKEOFF | GUIDED | LOITER | CIRCLE) || is_manual(mode);
        if known && mode != self.mode {
            self.mode = mode;
            self.airspeed_m_s = self.cruise_m_s;
            self.climbing = mode == TAKEOFF;
            self.loiter_here(parameters);
        }
        known
    }

    /// Flies the landing sequence at home.
    pub(crate) fn land(&mut self) {
        self.mode = AUTO;
        self.airspeed_m_s = self.cruise_m_s;
    }

    fn loiter_here(&mut self, parameters: &AutopilotParameters) {
        let here = self.sensed;
        self.set_orbit(
            Enu {
                east_m: here.east_m,
                north_m: here.north_m,
            },
            parameters.get(WP_LOITER_RAD),
            true,
        );
        self.target.alt_amsl_m = here.alt_amsl_m;
    }

    /// Gives GUIDED its place.
    pub(crate) fn set_orbit(&mut self, at: Enu, radius_m: f64, clockwise: bool) {
        self.target.path = Path::Orbit {
            north_m: at.north_m,
            east_m: at.east_m,
            radius_m,
            clockwise,
        };
    }

    /// Gives GUIDED its altitude.
    pub(crate) fn set_altitude(&mut self, alt_amsl_m: f64) {
        self.target.alt_amsl_m = alt_amsl_m;
    }

    /// Gives the automatic modes their true airspeed, until the mode changes.
    pub(crate) fn set_airspeed(&mut self, airspeed_m_s: f64) {
        self.airspeed_m_s = airspeed_m_s;
    }

    /// Flies for `dt_s` up to `time_s`.
    pub(crate) fn advance(
        &mut self,
        dt_s: f64,
        time_s: f64,
        reality: &mut Reality,
        parameters: &AutopilotParameters,
        rng: &mut ChaCha8Rng,
    ) {
        let span_s = dt_s.clamp(0.0, LONGEST_PAUSE_S);
        // A pause of rounding errors is no step.
        // The autopilot's loops are tuned for 50 Hz: a longer tick is flown in several steps.
        let steps = (span_s / LOOP_S - 1e-6).ceil().max(0.0);
        for _ in 0..steps as usize {
            self.step(span_s / steps, time_s, reality, parameters, rng);
        }
    }

    fn step(
        &mut self,
        dt_s: f64,
        time_s: f64,
        reality: &mut Reality,
        parameters: &AutopilotParameters,
        rng: &mut ChaCha8Rng,
    ) {
        let state = self.sim.state();
        self.slow_s += dt_s;
        if self.slow_s >= SLOW_S - 1e-9 {
            reality.update_mean_air(&state, time_s);
            self.sim.set_ground_amsl_m(reality.ground_amsl_m(&state));
            let wind = reality.around().wind_ned_m_s;
            let flying = state.phase == FlightPhase::Flying;
            self.estimator.step(self.slow_s, wind, flying, rng);
            self.slow_s = 0.0;
        }
        let around = reality.step_gusts(dt_s, state.airspeed_m_s, rng);
        self.sensed = self
            .estimator
            .sensed(&self.sim.sensed(), around.density_kg_m3);
        let command = self.command(dt_s, parameters);
        self.sim.step(dt_s, &around, &command);
        if self.mode == AUTO && self.armed && self.sim.state().phase == FlightPhase::OnGround {
            self.set_armed(false);
        }
    }

    fn command(&mut self, dt_s: f64, parameters: &AutopilotParameters) -> SurfaceCommand {
        if !self.armed {
            return SurfaceCommand::default();
        }
        if is_manual(self.mode) {
            return self.autopilot.fly_by_wire(dt_s, &self.sensed, &self.sticks);
        }
        let demand = self.demand(parameters);
        self.autopilot.command(dt_s, &self.sensed, &demand)
    }

    fn demand(&mut self, parameters: &AutopilotParameters) -> Demand {
        let home = self.home;
        let circle_home = Path::Orbit {
            north_m: home.at.north_m,
            east_m: home.at.east_m,
            radius_m: parameters.get(WP_LOITER_RAD),
            clockwise: true,
        };
        let (path, alt_amsl_m) = match self.mode {
            TAKEOFF => {
                let up_m = home.ground_amsl_m + parameters.get(TKOFF_ALT);
                self.climbing &= self.sensed.alt_amsl_m < up_m - CLIMB_DONE_M;
                let ahead = Path::TakeOff {
                    heading_deg: home.heading_deg,
                };
                let path = if self.climbing { ahead } else { circle_home };
                (path, up_m)
            }
            RTL => (
                circle_home,
                home.ground_amsl_m + parameters.get(RTL_ALTITUDE),
            ),
            AUTO => {
                let land = Path::Land {
                    north_m: home.at.north_m,
                    east_m: home.at.east_m,
                    ground_amsl_m: home.ground_amsl_m,
                    course_deg: None,
                };
                (land, self.sensed.alt_amsl_m)
            }
            _ => (self.target.path, self.target.alt_amsl_m),
        };
        Demand {
            path,
            alt_amsl_m,
            airspeed_m_s: self.airspeed_m_s,
        }
    }
}

/// Sticks let go: level flight at a little more than half power.
const CENTRED: Sticks = Sticks {
    roll: 0.0,
    pitch: 0.0,
    throttle: 0.55,
};

/// Modes in which a pilot's sticks fly; all of them with stabilisation here.
pub(crate) fn is_manual(mode: u32) -> bool {
    // STABILIZE, FBWB and CRUISE beside the named ones.
    matches!(mode, MANUAL | FBWA | 2 | 6 | 7)
}
