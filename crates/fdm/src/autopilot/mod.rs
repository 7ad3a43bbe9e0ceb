//! The autopilot: what an aircraft is told (a path, an altitude, an airspeed) becomes surface
//! angles and throttle.
//!
//! Outer loops: guidance gives a bank angle from the path, total-energy control
//! gives throttle and pitch from altitude and airspeed. Inner loops: roll and pitch
//! with rate damping. Gains are bandwidths and times; the aircraft's own
//! coefficients turn them into surface angles, so that one set fits aircraft of different size.

mod attitude;
mod energy;
mod gains;
mod guidance;
mod inner_gains;
mod landing;
mod plant;

pub use gains::ControlGains;
pub(crate) use inner_gains::{InnerGains, inner_gains};

use crate::aircraft::Aircraft;
use crate::flight::{FlightState, Phase, SurfaceCommand};
use attitude::{PitchLoop, RollLoop};
use energy::{EnergyDemand, EnergyLoop};
use guidance::{Steering, WindEstimate};
use landing::{Landing, LandingOrder};
use plant::Plant;

/// Height above the launch point up to which take-off climbs straight ahead, m.
const TAKE_OFF_STRAIGHT_M: f64 = 20.0;
/// Pitch of the climb straight ahead, rad.
const TAKE_OFF_PITCH_RAD: f64 = 0.22;

/// What the autopilot knows, as its sensors tell.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sensed {
    /// Metres north of the site's origin.
    pub north_m: f64,
    /// Metres east of the site's origin.
    pub east_m: f64,
    /// Altitude above mean sea level, m.
    pub alt_amsl_m: f64,
    /// Velocity over ground, NED, m/s.
    pub vel_ned_m_s: [f64; 3],
    /// Roll angle, rad.
    pub roll_rad: f64,
    /// Pitch angle, rad.
    pub pitch_rad: f64,
    /// Yaw angle, rad.
    pub yaw_rad: f64,
    /// Angular rate in body axes, rad/s.
    pub rate_rad_s: [f64; 3],
    /// True airspeed, m/s.
    pub airspeed_m_s: f64,
    /// Air density, kg/m³.
    pub density_kg_m3: f64,
    /// Whether the aircraft stands or slides on the ground or its launcher.
    pub on_ground: bool,
}

impl Sensed {
    /// What faultless sensors would tell of a state.
    pub fn perfect(state: &FlightState, density_kg_m3: f64) -> Self {
        Self {
            north_m: state.north_m,
            east_m: state.east_m,
            alt_amsl_m: state.alt_amsl_m,
            vel_ned_m_s: state.vel_ned_m_s,
            roll_rad: state.roll_rad,
            pitch_rad: state.pitch_rad,
            yaw_rad: state.yaw_rad,
            rate_rad_s: state.rate_rad_s,
            airspeed_m_s: state.airspeed_m_s,
            density_kg_m3,
            on_ground: state.phase != Phase::Flying,
        }
    }

    fn is_finite(&self) -> bool {
        let scalars = [
            self.north_m,
            self.east_m,
            self.alt_amsl_m,
            self.roll_rad,
            self.pitch_rad,
            self.yaw_rad,
            self.airspeed_m_s,
            self.density_kg_m3,
        ];
        scalars
            .iter()
            .chain(&self.vel_ned_m_s)
            .chain(&self.rate_rad_s)
            .all(|value| value.is_finite())
    }
}

/// Where to fly over the ground.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Path {
    /// To a point, then around it at the loiter radius.
    GoTo {
        /// Metres north of the site's origin.
        north_m: f64,
        /// Metres east of the site's origin.
        east_m: f64,
    },
    /// Around a point.
    Orbit {
        /// Centre, metres north of the site's origin.
        north_m: f64,
        /// Centre, metres east of the site's origin.
        east_m: f64,
        /// Radius, m; one tighter than the aircraft can fly is flown as tight as the bank limit allows.
        radius_m: f64,
        /// Clockwise as seen from above.
        clockwise: bool,
    },
    /// With the nose to a true heading, drifting with the wind.
    Heading {
        /// True heading, degrees.
        deg: f64,
    },
    /// Over ground along a true course.
    Course {
        /// True course over ground, degrees.
        deg: f64,
    },
    /// From the launcher: straight ahead at full power, then on to the altitude demanded.
    TakeOff {
        /// True heading of the launch, degrees.
        heading_deg: f64,
    },
    /// Approach and land at a point.
    Land {
        /// Touch-down point, metres north of the site's origin.
        north_m: f64,
        /// Touch-down point, metres east of the site's origin.
        east_m: f64,
        /// Ground there, m above mean sea level.
        ground_amsl_m: f64,
        /// Course of the final approach, degrees; none: into the wind as estimated.
        course_deg: Option<f64>,
    },
}

/// What the autopilot shall do. Values that are not finite keep those before.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Demand {
    /// Where to fly over the ground.
    pub path: Path,
    /// At which altitude above mean sea level, m (not used by [`Path::Land`]).
    pub alt_amsl_m: f64,
    /// At which true airspeed, m/s; kept between the aircraft's limits.
    pub airspeed_m_s: f64,
}

/// A pilot's sticks with the autopilot's stabilisation (fly by wire).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sticks {
    /// Bank, −1 (left) to 1 (right) of the bank limit.
    pub roll: f64,
    /// Pitch, −1 (down) to 1 (up) of the pitch limits.
    pub pitch: f64,
    /// Throttle, 0 to 1.
    pub throttle: f64,
}

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
    pub fn new(aircraft: &Aircraft) -> Self {
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
        if !(sensed.is_finite() && dt_s.is_finite() && dt_s > 0.0) {
            return self.last;
        }
        let demand = self.take(demand);
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
                let order = LandingOrder {
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

    /// Stabilised flight by a pilot's sticks: roll and pitch angles, throttle by hand.
    pub fn fly_by_wire(&mut self, dt_s: f64, sensed: &Sensed, sticks: &Sticks) -> SurfaceCommand {
        if !(sensed.is_finite() && dt_s.is_finite() && dt_s > 0.0) {
            return self.last;
        }
        let share = |value: f64| {
            if value.is_finite() {
                value.clamp(-1.0, 1.0)
            } else {
                0.0
            }
        };
        let pitch_stick = share(sticks.pitch);
        let limit = if pitch_stick >= 0.0 {
            self.gains.pitch_max_deg
        } else {
            -self.gains.pitch_min_deg
        };
        let bank = share(sticks.roll) * self.gains.bank_max_deg.to_radians();
        self.energy.follow(sensed);
        self.wind.update(dt_s, sensed);
        self.demand = None;
        let throttle = share(sticks.throttle).max(0.0);
        let pitch = pitch_stick * limit.to_radians();
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
        let keep = |new: f64, old: f64| if new.is_finite() { new } else { old };
        let path = if guidance::is_finite(&demand.path) {
            demand.path
        } else {
            before.path
        };
        let taken = Demand {
            path,
            alt_amsl_m: keep(demand.alt_amsl_m, before.alt_amsl_m),
            airspeed_m_s: keep(demand.airspeed_m_s, before.airspeed_m_s),
        };
        if self.demand.is_none_or(|old| old.path != path) {
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
            rudder_rad: attitude::yaw_damper(sensed, &self.plant, &air, &self.gains),
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
        order: &LandingOrder,
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
            landing::Step::Approach { bank, energy } => self.fly(dt_s, sensed, bank, &energy),
            landing::Step::Flare { bank, pitch } => {
                self.energy.follow(sensed);
                self.stabilise(dt_s, sensed, bank, pitch, 0.0)
            }
        }
    }
}
