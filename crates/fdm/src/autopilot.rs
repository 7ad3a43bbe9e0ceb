//! The autopilot: a demand (a path, an altitude, an airspeed) becomes surface
//! angles and throttle.
//!
//! Outer loops: guidance gives a bank angle from the path, total-energy control
//! gives throttle and pitch from altitude and airspeed. Inner loops: roll and pitch
//! with rate damping. Gains are bandwidths and times; the aircraft's own
//! coefficients turn them into surface angles, so that one set fits aircraft of different size.

mod demand;
mod energy;
mod guidance;
mod inner_gains;
mod inner_loops;
mod landing;
mod plant;
mod sensed;

pub use demand::{Demand, Path, Sticks};
pub(crate) use inner_gains::{InnerGains, inner_gains};
pub use sensed::Sensed;

use crate::aircraft::{Aircraft, ControlGains};
use crate::state::SurfaceCommand;
use energy::{EnergyDemand, EnergyLoop};
use guidance::{Steering, WindEstimate};
use inner_loops::{PitchLoop, RollLoop};
use landing::{Landing, LandingCommand, LandingSite};
use plant::Plant;
use std::sync::Arc;

/// Height above the launch point up to which take-off climbs straight ahead, m.
const TAKE_OFF_STRAIGHT_M: f64 = 20.0;
/// Pitch of the climb straight ahead, rad.
const TAKE_OFF_PITCH_RAD: f64 = 0.22;

/// What the autopilot is doing, for displays and mission logic.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct AutopilotStatus {
    /// Bank angle asked of the roll loop, rad.
    pub bank_command_rad: f64,
    /// Pitch angle asked of the pitch loop, rad.
    pub pitch_command_rad: f64,
    /// Wind as estimated from airspeed, heading and velocity: north and east components, m/s.
    pub wind_estimate_m_s: [f64; 2],
    /// A [`Path::GoTo`] has come to its point and circles; a take-off has left the ground
    /// behind; a landing has come to rest.
    pub path_done: bool,
    /// Airspeed protection holds the nose down or the throttle against the demand.
    pub protecting: bool,
}

/// What the outer loops ask of inner loops that fly elsewhere.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AttitudeDemand {
    /// Bank angle, rad.
    pub bank_rad: f64,
    /// Pitch angle, rad.
    pub pitch_rad: f64,
    /// Throttle, 0 to 1.
    pub throttle: f64,
}

/// Setpoints that replace those of the outer loops; the others remain theirs.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct HeldAttitude {
    /// Bank angle, rad.
    pub bank_rad: Option<f64>,
    /// Pitch angle, rad.
    pub pitch_rad: Option<f64>,
    /// Throttle, 0 to 1.
    pub throttle: Option<f64>,
}

/// The autopilot of one aircraft: gains, and the memory of its loops.
#[derive(Debug, Clone, PartialEq)]
pub struct Autopilot {
    plant: Plant,
    gains: ControlGains,
    roll: RollLoop,
    pitch: PitchLoop,
    energy: EnergyLoop,
    wind: WindEstimate,
    demand: Option<Demand>,
    /// Turning sense once a go-to circles its point.
    circling: Option<bool>,
    take_off_from_m: Option<f64>,
    landing: Option<Landing>,
    last: SurfaceCommand,
    status: AutopilotStatus,
}

impl Autopilot {
    /// An autopilot with the gains of the aircraft's file.
    pub fn new(aircraft: &Arc<Aircraft>) -> Self {
        Self {
            plant: Plant::new(aircraft),
            gains: aircraft.control,
            roll: RollLoop::default(),
            pitch: PitchLoop::default(),
            energy: EnergyLoop::default(),
            wind: WindEstimate::default(),
            demand: None,
            circling: None,
            take_off_from_m: None,
            landing: None,
            last: SurfaceCommand::default(),
            status: AutopilotStatus::default(),
        }
    }

    /// What the autopilot is doing.
    pub fn status(&self) -> AutopilotStatus {
        self.status
    }

    /// Forgets integrals, estimates and path progress, as before a new flight.
    pub fn reset(&mut self) {
        self.roll = RollLoop::default();
        self.pitch = PitchLoop::default();
        self.energy = EnergyLoop::default();
        self.wind = WindEstimate::default();
        self.demand = None;
        self.circling = None;
        self.take_off_from_m = None;
        self.landing = None;
        self.status = AutopilotStatus::default();
    }

    /// The command for the next `dt_s` seconds. Sensor values that are not finite repeat the last
    /// command.
    pub fn command(&mut self, dt_s: f64, sensed: &Sensed, demand: &Demand) -> SurfaceCommand {
        if !sensed.is_sound(dt_s) {
            return self.last;
        }
        let demand = self.take(demand);
        // Standing on the launcher, airspeed and velocity carry no information on the wind.
        if !sensed.on_ground {
            self.wind.update(dt_s, sensed);
        }
        self.status.wind_estimate_m_s = self.wind.vector();
        self.status.path_done = false;
        let command = match demand.path {
            Path::TakeOff { heading_deg } => self.take_off(dt_s, sensed, &demand, heading_deg),
            Path::Land {
                north_m,
                east_m,
                ground_amsl_m,
                course_deg,
            } => {
                let order = LandingSite {
                    north_m,
                    east_m,
                    ground_amsl_m,
                    course_deg,
                };
                self.land(dt_s, sensed, &demand, &order)
            }
            _ if sensed.on_ground => self.idle(),
            _ => {
                let bank = self.bank_for(sensed, &demand);
                self.fly(dt_s, sensed, bank, &EnergyDemand::of(&demand))
            }
        };
        self.last = command;
        command
    }

    /// The outer loops alone, for an aircraft whose inner loops fly elsewhere: guidance and total energy as in
    /// [`Autopilot::command`], the bank limited as there. None on the ground, for take-off and landing, which need more
    /// than these three, and for sensor values that are not finite. Rates of rotation are not used.
    pub fn outer_loops(
        &mut self,
        dt_s: f64,
        sensed: &Sensed,
        demand: &Demand,
    ) -> Option<AttitudeDemand> {
        let wanted = self.wanted_attitude(dt_s, sensed, demand, &HeldAttitude::default())?;
        let air = self.plant.at(sensed);
        let (plant, gains) = (&self.plant, &self.gains);
        let bank_rad = self
            .roll
            .command(dt_s, sensed, wanted.bank_rad, plant, &air, gains);
        self.status.bank_command_rad = bank_rad;
        self.status.pitch_command_rad = wanted.pitch_rad;
        Some(AttitudeDemand { bank_rad, ..wanted })
    }

    /// What guidance and total energy want in flight, and what is held in its place.
    fn wanted_attitude(
        &mut self,
        dt_s: f64,
        sensed: &Sensed,
        demand: &Demand,
        held: &HeldAttitude,
    ) -> Option<AttitudeDemand> {
        let leaves_ground = matches!(demand.path, Path::TakeOff { .. } | Path::Land { .. });
        if !sensed.is_sound(dt_s) || sensed.on_ground || leaves_ground {
            return None;
        }
        let demand = self.take(demand);
        self.wind.update(dt_s, sensed);
        self.status.wind_estimate_m_s = self.wind.vector();
        self.status.path_done = false;
        let own_bank_rad = self.bank_for(sensed, &demand);
        let bank_rad = held.bank_rad.unwrap_or(own_bank_rad);
        if let (Some(pitch_rad), Some(throttle)) = (held.pitch_rad, held.throttle) {
            // A loop that nobody obeys must not gather errors; its memory runs along.
            self.energy.follow(sensed);
            return Some(AttitudeDemand {
                bank_rad,
                pitch_rad,
                throttle,
            });
        }
        let demand = EnergyDemand::of(&demand);
        let (plant, gains) = (&self.plant, &self.gains);
        let own = self.energy.step(dt_s, sensed, &demand, plant, gains);
        self.status.protecting = own.protecting;
        Some(AttitudeDemand {
            bank_rad,
            pitch_rad: held.pitch_rad.unwrap_or(own.pitch_rad),
            throttle: held.throttle.unwrap_or(own.throttle),
        })
    }

    /// The same as [`Autopilot::command`], with what is `held` in place of what the outer loops want. On the ground,
    /// in take-off and landing nothing is held.
    pub fn command_held(
        &mut self,
        dt_s: f64,
        sensed: &Sensed,
        demand: &Demand,
        held: &HeldAttitude,
    ) -> SurfaceCommand {
        let Some(wanted) = self.wanted_attitude(dt_s, sensed, demand, held) else {
            return self.command(dt_s, sensed, demand);
        };
        let low = self.gains.pitch_min_deg.to_radians();
        let high = self.gains.pitch_max_deg.to_radians();
        let pitch_rad = wanted.pitch_rad.clamp(low, high);
        let throttle = wanted.throttle.clamp(0.0, 1.0);
        self.last = self.stabilise(dt_s, sensed, wanted.bank_rad, pitch_rad, throttle);
        self.last
    }

    /// Stabilised flight by a pilot's sticks: roll and pitch angles, throttle by hand.
    pub fn fly_by_wire(&mut self, dt_s: f64, sensed: &Sensed, sticks: &Sticks) -> SurfaceCommand {
        if !sensed.is_sound(dt_s) {
            return self.last;
        }
        let sticks = sticks.limited();
        let limit = if sticks.pitch >= 0.0 {
            self.gains.pitch_max_deg
        } else {
            -self.gains.pitch_min_deg
        };
        // Sticks ask for angles, not surfaces: a pilot who lets go flies level.
        let bank = sticks.roll * self.gains.bank_max_deg.to_radians();
        // The outer loop's memory runs along, so that handing back to it gives no jump.
        self.energy.follow(sensed);
        self.wind.update(dt_s, sensed);
        self.demand = None;
        let throttle = sticks.throttle.max(0.0);
        let pitch = sticks.pitch * limit.to_radians();
        self.last = self.stabilise(dt_s, sensed, bank, pitch, throttle);
        self.last
    }

    /// Takes over a demand; a new path starts its own progress.
    fn take(&mut self, demand: &Demand) -> Demand {
        let before = self.demand.unwrap_or(Demand {
            path: Path::Heading { deg: 0.0 },
            alt_amsl_m: 0.0,
            airspeed_m_s: self.plant.cruise_m_s,
        });
        let taken = demand.or(&before);
        // Only another path starts anew: altitude and airspeed may change every tick without losing
        // the progress of a landing or a circle.
        if self.demand.is_none_or(|old| old.path != taken.path) {
            self.circling = None;
            self.take_off_from_m = None;
            self.landing = None;
        }
        self.demand = Some(taken);
        taken
    }

    /// Bank angle that follows a path over the ground.
    fn bank_for(&mut self, sensed: &Sensed, demand: &Demand) -> f64 {
        let steering = Steering {
            gains: &self.gains,
            wind: self.wind.vector(),
            sensed,
        };
        match demand.path {
            Path::GoTo { north_m, east_m } => {
                let radius = self.gains.loiter_radius_m;
                if self.circling.is_none()
                    && steering.distance_m(north_m, east_m) < radius * guidance::CIRCLE_FROM
                {
                    self.circling = Some(steering.turns_right_around(north_m, east_m));
                }
                match self.circling {
                    Some(clockwise) => {
                        self.status.path_done = true;
                        steering.orbit(north_m, east_m, radius, clockwise)
                    }
                    None => steering.go_to(north_m, east_m),
                }
            }
            Path::Orbit {
                north_m,
                east_m,
                radius_m,
                clockwise,
            } => steering.orbit(north_m, east_m, radius_m, clockwise),
            Path::Course { deg } => steering.course(deg.to_radians()),
            Path::Heading { deg } | Path::TakeOff { heading_deg: deg } => {
                steering.heading(deg.to_radians())
            }
            Path::Land { .. } => 0.0,
        }
    }

    /// Outer energy loop and inner loops together.
    fn fly(
        &mut self,
        dt_s: f64,
        sensed: &Sensed,
        bank: f64,
        demand: &EnergyDemand,
    ) -> SurfaceCommand {
        let out = self
            .energy
            .step(dt_s, sensed, demand, &self.plant, &self.gains);
        self.status.protecting = out.protecting;
        self.stabilise(dt_s, sensed, bank, out.pitch_rad, out.throttle)
    }

    /// Inner loops.
    fn stabilise(
        &mut self,
        dt_s: f64,
        sensed: &Sensed,
        bank: f64,
        pitch: f64,
        throttle: f64,
    ) -> SurfaceCommand {
        let air = self.plant.at(sensed);
        let aileron = self
            .roll
            .step(dt_s, sensed, bank, &self.plant, &air, &self.gains);
        let elevator = self
            .pitch
            .step(dt_s, sensed, pitch, &self.plant, &air, &self.gains);
        self.status.bank_command_rad = self.roll.bank_command();
        self.status.pitch_command_rad = pitch;
        SurfaceCommand {
            elevator_rad: elevator,
            aileron_rad: aileron,
            rudder_rad: inner_loops::yaw_damper(sensed, &self.plant, &air, &self.gains),
            throttle,
            launch: false,
        }
    }

    fn idle(&mut self) -> SurfaceCommand {
        self.roll = RollLoop::default();
        self.pitch = PitchLoop::default();
        self.energy = EnergyLoop::default();
        SurfaceCommand::default()
    }

    fn take_off(
        &mut self,
        dt_s: f64,
        sensed: &Sensed,
        demand: &Demand,
        heading_deg: f64,
    ) -> SurfaceCommand {
        // Heights are counted from where the take-off began, for the ground there may lie above or
        // below the site's.
        let start = *self.take_off_from_m.get_or_insert(sensed.alt_amsl_m);
        if sensed.on_ground {
            self.idle();
            let air = self.plant.at(sensed);
            return SurfaceCommand {
                elevator_rad: air.elevator_level,
                throttle: 1.0,
                launch: true,
                ..SurfaceCommand::default()
            };
        }
        // No turn so near the ground, and full power whatever the altitude demanded.
        if sensed.alt_amsl_m - start < TAKE_OFF_STRAIGHT_M {
            self.energy.follow(sensed);
            return self.stabilise(dt_s, sensed, 0.0, TAKE_OFF_PITCH_RAD, 1.0);
        }
        self.status.path_done = true;
        let steering = Steering {
            gains: &self.gains,
            wind: self.wind.vector(),
            sensed,
        };
        let bank = steering.heading(heading_deg.to_radians());
        self.fly(dt_s, sensed, bank, &EnergyDemand::of(demand))
    }

    fn land(
        &mut self,
        dt_s: f64,
        sensed: &Sensed,
        demand: &Demand,
        order: &LandingSite,
    ) -> SurfaceCommand {
        if sensed.on_ground {
            self.status.path_done = true;
            return self.idle();
        }
        let steering = Steering {
            gains: &self.gains,
            wind: self.wind.vector(),
            sensed,
        };
        let landing = self
            .landing
            .get_or_insert_with(|| Landing::begin(order, self.wind.vector()));
        let step = landing.step(&steering, order, demand.airspeed_m_s, &self.plant);
        match step {
            LandingCommand::Approach { bank, energy } => self.fly(dt_s, sensed, bank, &energy),
            LandingCommand::Flare { bank, pitch } => {
                self.energy.follow(sensed);
                self.stabilise(dt_s, sensed, bank, pitch, 0.0)
            }
        }
    }
}
