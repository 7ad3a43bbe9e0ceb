//! An aircraft in flight together with its autopilot, of either kind: what a simulated vehicle is made of.

use crate::aircraft::Surfaces;
use crate::airframe::Airframe;
use crate::autopilot::{Autopilot, AutopilotStatus, Demand, HeldAttitude, Sensed, Sticks};
use crate::error::FdmError;
use crate::flight::FlightSim;
use crate::multirotor::{MultirotorAutopilot, MultirotorSim};
use crate::state::{AirAround, FlightState, SurfaceCommand};

/// A vehicle and its autopilot.
#[derive(Debug, Clone, PartialEq)]
pub struct PilotedFlight {
    craft: Craft,
}

#[derive(Debug, Clone, PartialEq)]
enum Craft {
    FixedWing(Box<(FlightSim, Autopilot)>),
    Multirotor(Box<(MultirotorSim, MultirotorAutopilot)>),
}

impl PilotedFlight {
    /// A vehicle on its launcher or on the ground.
    ///
    /// # Errors
    /// An aircraft that cannot fly.
    pub fn on_ground(
        airframe: &Airframe,
        north_m: f64,
        east_m: f64,
        ground_amsl_m: f64,
        heading_deg: f64,
    ) -> Result<Self, FdmError> {
        let craft = match airframe {
            Airframe::FixedWing(aircraft) => Craft::FixedWing(Box::new((
                FlightSim::on_ground(aircraft, north_m, east_m, ground_amsl_m, heading_deg)?,
                Autopilot::new(aircraft),
            ))),
            Airframe::Multirotor(aircraft) => Craft::Multirotor(Box::new((
                MultirotorSim::on_ground(aircraft, north_m, east_m, ground_amsl_m, heading_deg)?,
                MultirotorAutopilot::new(aircraft),
            ))),
        };
        Ok(Self { craft })
    }

    /// A vehicle in steady flight at `position`, m north and east of the origin and above mean sea level: a fixed wing
    /// at an airspeed in the wind, a multirotor in hover.
    ///
    /// # Errors
    /// An aircraft that cannot fly, or not at that airspeed.
    pub fn airborne(
        airframe: &Airframe,
        position: [f64; 3],
        heading_deg: f64,
        airspeed_m_s: f64,
        wind_ned_m_s: [f64; 3],
    ) -> Result<Self, FdmError> {
        let [north_m, east_m, alt_amsl_m] = position;
        let craft = match airframe {
            Airframe::FixedWing(aircraft) => {
                let limits = aircraft.limits;
                let airspeed_m_s =
                    airspeed_m_s.clamp(limits.airspeed_min_m_s, limits.airspeed_max_m_s);
                let mut sim = FlightSim::airborne(
                    aircraft,
                    north_m,
                    east_m,
                    alt_amsl_m,
                    heading_deg,
                    airspeed_m_s,
                )?;
                sim.drift_with(wind_ned_m_s);
                Craft::FixedWing(Box::new((sim, Autopilot::new(aircraft))))
            }
            Airframe::Multirotor(aircraft) => Craft::Multirotor(Box::new((
                MultirotorSim::airborne(aircraft, north_m, east_m, alt_amsl_m, heading_deg)?,
                MultirotorAutopilot::new(aircraft),
            ))),
        };
        Ok(Self { craft })
    }

    /// The state now.
    pub fn state(&self) -> FlightState {
        match &self.craft {
            Craft::FixedWing(craft) => craft.0.state(),
            Craft::Multirotor(craft) => craft.0.state(),
        }
    }

    /// The state as the vehicle's own sensors measure it, with the errors of its mechanisms.
    pub fn sensed(&self) -> FlightState {
        match &self.craft {
            Craft::FixedWing(craft) => craft.0.sensed(),
            Craft::Multirotor(craft) => craft.0.state(),
        }
    }

    /// Height of the ground under it, m above mean sea level.
    pub fn set_ground_amsl_m(&mut self, ground_amsl_m: f64) {
        match &mut self.craft {
            Craft::FixedWing(craft) => craft.0.set_ground_amsl_m(ground_amsl_m),
            Craft::Multirotor(craft) => craft.0.set_ground_amsl_m(ground_amsl_m),
        }
    }

    /// Replaces motion and attitude, as [`FlightSim::set_motion`].
    pub fn set_motion(&mut self, vel_ned_m_s: [f64; 3], attitude: [f64; 4], rate_rad_s: [f64; 3]) {
        match &mut self.craft {
            Craft::FixedWing(craft) => craft.0.set_motion(vel_ned_m_s, attitude, rate_rad_s),
            Craft::Multirotor(craft) => craft.0.set_motion(vel_ned_m_s, attitude, rate_rad_s),
        }
    }

    /// Whether it can stand still in the air.
    pub fn hovers(&self) -> bool {
        matches!(self.craft, Craft::Multirotor(_))
    }

    /// Its control surfaces; none of a multirotor.
    pub fn surfaces(&self) -> Option<&Surfaces> {
        match &self.craft {
            Craft::FixedWing(craft) => Some(&craft.0.aircraft().surfaces),
            Craft::Multirotor(_) => None,
        }
    }

    /// What the autopilot is doing.
    pub fn status(&self) -> AutopilotStatus {
        match &self.craft {
            Craft::FixedWing(craft) => craft.1.status(),
            Craft::Multirotor(craft) => craft.1.status(),
        }
    }

    /// Forgets what the autopilot gathered, as before a new flight.
    pub fn reset(&mut self) {
        match &mut self.craft {
            Craft::FixedWing(craft) => craft.1.reset(),
            Craft::Multirotor(craft) => craft.1.reset(),
        }
    }

    /// Flies to a demand for `dt_s`.
    pub fn fly(&mut self, dt_s: f64, air: &AirAround, sensed: &Sensed, demand: &Demand) {
        self.fly_held(dt_s, air, sensed, demand, None);
    }

    /// The same with attitude and throttle `held` in place of the outer loops'.
    pub fn fly_held(
        &mut self,
        dt_s: f64,
        air: &AirAround,
        sensed: &Sensed,
        demand: &Demand,
        held: Option<&HeldAttitude>,
    ) {
        match &mut self.craft {
            Craft::FixedWing(craft) => {
                let (sim, autopilot) = craft.as_mut();
                let command = match held {
                    Some(held) => autopilot.command_held(dt_s, sensed, demand, held),
                    None => autopilot.command(dt_s, sensed, demand),
                };
                sim.step(dt_s, air, &command);
            }
            Craft::Multirotor(craft) => {
                let (sim, autopilot) = craft.as_mut();
                let thrust = match held {
                    Some(held) => autopilot.command_held(dt_s, sim, sensed, demand, held),
                    None => autopilot.command(dt_s, sim, sensed, demand),
                };
                sim.step(dt_s, air, thrust.as_ref());
            }
        }
    }

    /// Flies by a pilot's sticks for `dt_s`.
    pub fn fly_by_wire(&mut self, dt_s: f64, air: &AirAround, sensed: &Sensed, sticks: &Sticks) {
        match &mut self.craft {
            Craft::FixedWing(craft) => {
                let (sim, autopilot) = craft.as_mut();
                let command = autopilot.fly_by_wire(dt_s, sensed, sticks);
                sim.step(dt_s, air, &command);
            }
            Craft::Multirotor(craft) => {
                let (sim, autopilot) = craft.as_mut();
                let thrust = autopilot.fly_by_wire(dt_s, sim, sensed, sticks);
                sim.step(dt_s, air, thrust.as_ref());
            }
        }
    }

    /// Lets `dt_s` pass with the motor off and the surfaces in the middle: disarmed.
    pub fn rest(&mut self, dt_s: f64, air: &AirAround) {
        match &mut self.craft {
            Craft::FixedWing(craft) => craft.0.step(dt_s, air, &SurfaceCommand::default()),
            Craft::Multirotor(craft) => craft.0.step(dt_s, air, None),
        }
    }

    /// Electrical power in a state of flight at a density, W; 0 without a battery.
    pub fn power_w(&self, state: &FlightState, density_kg_m3: f64) -> f64 {
        match &self.craft {
            Craft::FixedWing(craft) => {
                let aircraft = craft.0.aircraft();
                aircraft.battery.map_or(0.0, |battery| {
                    battery.power_w(
                        &aircraft.propulsion,
                        state.airspeed_m_s,
                        state.throttle,
                        density_kg_m3,
                    )
                })
            }
            Craft::Multirotor(craft) => craft.0.power_w(),
        }
    }
}
