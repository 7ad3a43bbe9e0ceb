//! The outer loop of a real aircraft: the guidance and total energy control of simulated vehicles, fed with its
//! telemetry. Its own autopilot holds the commanded bank, pitch and throttle.

use crate::error::VaError;
use crate::simulated::path_of;
use air::geo::{Enu, Geodetic, LocalFrame};
use air::isa::Atmosphere;
use fdm::autopilot::{AttitudeDemand, Autopilot, Demand, Path, Sensed};
use fdm::{Airframe, FdmError};
use protocol::SimTime;
use protocol::message::{Setpoint, State};
use scenario::Scenario;

/// Gap between two states after which the loops restart, s: their integrators are out of date.
const PAUSE_S: f64 = 1.0;

/// The outer loop of one real vehicle.
#[derive(Debug, Clone)]
pub struct OuterLoop {
    frame: LocalFrame,
    atmosphere: Atmosphere,
    autopilot: Autopilot,
    cruise_m_s: f64,
    last: Option<SimTime>,
    /// The circle that it flies without a setpoint.
    waits_at: Option<Demand>,
}

impl OuterLoop {
    /// The outer loop of an aircraft of that type in the air of the scenario.
    ///
    /// # Errors
    /// A scenario that describes no air, or a multirotor, whose attitudes only its own autopilot commands.
    pub fn new(scenario: &Scenario, airframe: &Airframe) -> Result<Self, VaError> {
        let aircraft = airframe.fixed_wing().ok_or(FdmError::NotOfMultirotors {
            aircraft: airframe.name().to_owned(),
            what: "outer_loop = \"plumage\"".to_owned(),
        })?;
        Ok(Self {
            frame: scenario.frame()?,
            atmosphere: scenario.atmosphere()?,
            autopilot: Autopilot::new(aircraft),
            cruise_m_s: scenario.search.airspeed_m_s,
            last: None,
            waits_at: None,
        })
    }

    /// Resets the loops, because the vehicle is not steered now.
    pub fn rest(&mut self) {
        if self.last.take().is_some() {
            self.autopilot.reset();
            self.waits_at = None;
        }
    }

    /// The attitude and throttle to hold until the next `state`, on the way to `setpoint`, or in a circle without one.
    /// None on the ground.
    pub fn step(
        &mut self,
        state: &State,
        setpoint: Option<&Setpoint>,
        now: SimTime,
    ) -> Option<AttitudeDemand> {
        if self.last.is_some_and(|at| now.since_s(at) > PAUSE_S) {
            self.rest();
        }
        let sensed = self.sensed(state);
        let dt_s = self.last.map_or(0.0, |at| now.since_s(at));
        self.last = Some(now);
        if dt_s <= 0.0 {
            return None; // the first state has nothing before it
        }
        let demand = match setpoint {
            Some(setpoint) => {
                self.waits_at = None;
                Demand {
                    path: path_of(setpoint, &self.frame),
                    alt_amsl_m: setpoint.alt_amsl_m,
                    airspeed_m_s: setpoint.airspeed_m_s,
                }
            }
            None => *self.waits_at.get_or_insert(Demand {
                path: Path::GoTo {
                    north_m: sensed.north_m,
                    east_m: sensed.east_m,
                },
                alt_amsl_m: sensed.alt_amsl_m,
                airspeed_m_s: self.cruise_m_s,
            }),
        };
        self.autopilot.outer_loops(dt_s, &sensed, &demand)
    }

    fn sensed(&self, state: &State) -> Sensed {
        let Enu { east_m, north_m } = self
            .frame
            .to_enu(Geodetic::new(state.lat_deg, state.lon_deg));
        Sensed {
            north_m,
            east_m,
            alt_amsl_m: state.alt_amsl_m,
            vel_ned_m_s: state.vel_ned_m_s,
            roll_rad: state.roll_deg.to_radians(),
            pitch_rad: state.pitch_deg.to_radians(),
            yaw_rad: state.heading_deg.to_radians(),
            // The inner loops alone go by them.
            rate_rad_s: [0.0; 3],
            airspeed_m_s: state.airspeed_m_s,
            density_kg_m3: self.atmosphere.at(state.alt_amsl_m).density_kg_m3(),
            on_ground: !state.airborne,
        }
    }
}
