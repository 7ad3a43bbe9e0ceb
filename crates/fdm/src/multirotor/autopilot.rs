//! The outer loops of a multirotor: from a path, an altitude and a speed to a thrust vector.

use super::inner_loops::ThrustDemand;
use super::reference::{Pace, Reference};
use super::wind::DragWind;
use super::{Multirotor, MultirotorSim};
use crate::autopilot::{AutopilotStatus, Demand, HeldAttitude, Path, Sensed, Sticks};
use air::STANDARD_GRAVITY_M_S2 as GRAVITY;

/// Height above its start at which a take-off has left the ground behind, m.
const TAKEN_OFF_M: f64 = 5.0;
/// A landing goes down this slowly from this far above the ground, m/s and m.
const FINAL_M_S: f64 = 0.5;
const FINAL_FROM_M: f64 = 6.0;
/// Distance from the point of touch-down within which a landing goes down, m.
const ABOVE_POINT_M: f64 = 1.0;
/// A path is done when its end is this near, m, …
const DONE_M: f64 = 1.0;
/// … and the nose turns into the direction of a flight that is longer than this, m.
const TURN_NOSE_M: f64 = 5.0;
/// Largest velocity by which an error of position is worked off, m/s.
const CORRECTION_M_S: f64 = 3.0;
/// Largest specific force of the integral against wind, m/s².
const INTEGRAL_M_S2: f64 = 6.0;
/// Smallest and largest vertical thrust over weight.
const VERTICAL_THRUST: (f64, f64) = (0.3, 1.6);
/// How fast an orbit is joined, 1/s.
const JOIN_ORBIT_RAD_S: f64 = 0.5;
/// Half width of the throttle stick's range in which the height is held.
const STICK_DEADBAND: f64 = 0.1;

/// The autopilot of one multirotor: its outer loops. The inner loops are in [`MultirotorSim`], which runs them at 400 Hz.
#[derive(Debug, Clone, PartialEq)]
pub struct MultirotorAutopilot {
    aircraft: Multirotor,
    reference: Option<Reference>,
    demand: Option<Demand>,
    yaw_rad: f64,
    /// Integral of the velocity error, m/s².
    integral: [f64; 3],
    wind: DragWind,
    take_off_from_m: Option<f64>,
    /// The height that the throttle stick holds in its middle, m.
    stick_height_m: Option<f64>,
    status: AutopilotStatus,
}

impl MultirotorAutopilot {
    /// An autopilot with the gains of the aircraft's file.
    pub fn new(aircraft: &Multirotor) -> Self {
        Self {
            aircraft: aircraft.clone(),
            reference: None,
            demand: None,
            yaw_rad: 0.0,
            integral: [0.0; 3],
            wind: DragWind::default(),
            take_off_from_m: None,
            stick_height_m: None,
            status: AutopilotStatus::default(),
        }
    }

    /// What the autopilot is doing.
    pub fn status(&self) -> AutopilotStatus {
        self.status
    }

    /// Forgets integrals, estimates and path progress, as before a new flight.
    pub fn reset(&mut self) {
        *self = Self::new(&self.aircraft.clone());
    }

    /// Reads what the sensors of `sim` feel, for the estimate of the wind.
    fn feel(&mut self, dt_s: f64, sim: &MultirotorSim, sensed: &Sensed) {
        if sensed.on_ground {
            return;
        }
        self.wind
            .update(dt_s, sim, sensed.density_kg_m3, &sensed.vel_ned_m_s);
        self.status.wind_estimate_m_s = self.wind.vector();
    }

    /// The thrust for the next `dt_s` seconds; none: motors off.
    pub fn command(
        &mut self,
        dt_s: f64,
        sim: &MultirotorSim,
        sensed: &Sensed,
        demand: &Demand,
    ) -> Option<ThrustDemand> {
        if !sensed.is_sound(dt_s) {
            return self.hover();
        }
        self.feel(dt_s, sim, sensed);
        self.stick_height_m = None;
        let demand = self.take(demand);
        self.status.path_done = false;
        if sensed.on_ground && !matches!(demand.path, Path::TakeOff { .. }) {
            self.status.path_done = matches!(demand.path, Path::Land { .. });
            self.rest(sensed);
            return None;
        }
        self.advance_reference(dt_s, sensed, &demand);
        Some(self.follow(dt_s, sensed))
    }

    /// The same with bank and pitch that are held in place of the outer loops', and a throttle that commands a climb.
    pub fn command_held(
        &mut self,
        dt_s: f64,
        sim: &MultirotorSim,
        sensed: &Sensed,
        demand: &Demand,
        held: &HeldAttitude,
    ) -> Option<ThrustDemand> {
        let (Some(bank), Some(pitch)) = (held.bank_rad, held.pitch_rad) else {
            return self.command(dt_s, sim, sensed, demand);
        };
        let most = self.aircraft.limits.tilt_max_deg.to_radians();
        let sticks = Sticks {
            roll: bank / most,
            pitch: pitch / most,
            throttle: held.throttle.unwrap_or(0.5),
        };
        self.fly_by_wire(dt_s, sim, sensed, &sticks)
    }

    /// Flight by a pilot's sticks: bank and pitch angles, and a climb by the throttle, whose middle holds the height.
    pub fn fly_by_wire(
        &mut self,
        dt_s: f64,
        sim: &MultirotorSim,
        sensed: &Sensed,
        sticks: &Sticks,
    ) -> Option<ThrustDemand> {
        if !sensed.is_sound(dt_s) {
            return self.hover();
        }
        self.feel(dt_s, sim, sensed);
        let sticks = sticks.limited();
        let stick = sticks.throttle - 0.5;
        let wants_up = stick > STICK_DEADBAND;
        self.reference = None;
        self.demand = None;
        if sensed.on_ground && !wants_up {
            self.rest(sensed);
            return None;
        }
        let limits = self.aircraft.limits;
        let over = (stick.abs() - STICK_DEADBAND).max(0.0) / (0.5 - STICK_DEADBAND);
        let climb = if stick > 0.0 {
            over * limits.climb_max_m_s
        } else {
            -over * limits.descent_max_m_s
        };
        let height = if over > 0.0 {
            self.stick_height_m = None;
            sensed.alt_amsl_m
        } else {
            *self.stick_height_m.get_or_insert(sensed.alt_amsl_m)
        };
        let gains = self.aircraft.control;
        let wanted_down = -climb - gains.height_rad_s * (height - sensed.alt_amsl_m);
        let error = wanted_down - sensed.vel_ned_m_s[2];
        self.integral = [0.0, 0.0, self.integral[2]];
        if !sensed.on_ground {
            self.integrate(2, dt_s, gains.climb_rad_s, error);
        }
        let down = gains.climb_rad_s * error + self.integral[2];
        let upward =
            (GRAVITY - down).clamp(VERTICAL_THRUST.0 * GRAVITY, VERTICAL_THRUST.1 * GRAVITY);
        let most = limits.tilt_max_deg.to_radians();
        // A nose that is up flies backwards.
        let forward = -upward * (sticks.pitch * most).tan();
        let right = upward * (sticks.roll * most).tan();
        let (sin, cos) = self.yaw_rad.sin_cos();
        self.status.bank_command_rad = sticks.roll * most;
        self.status.pitch_command_rad = sticks.pitch * most;
        Some(ThrustDemand {
            specific_force_ned_m_s2: [
                forward * cos - right * sin,
                forward * sin + right * cos,
                -upward,
            ],
            yaw_rad: self.yaw_rad,
        })
    }

    /// On the ground with motors off.
    fn rest(&mut self, sensed: &Sensed) {
        self.integral = [0.0; 3];
        self.reference = None;
        self.yaw_rad = sensed.yaw_rad;
    }

    /// Level with the thrust of the weight: for a tick without sensors.
    fn hover(&self) -> Option<ThrustDemand> {
        Some(ThrustDemand {
            specific_force_ned_m_s2: [0.0, 0.0, -GRAVITY],
            yaw_rad: self.yaw_rad,
        })
    }

    /// Takes over a demand; values that are not finite keep those before.
    fn take(&mut self, demand: &Demand) -> Demand {
        let before = self.demand.unwrap_or(Demand {
            path: Path::Heading { deg: 0.0 },
            alt_amsl_m: 0.0,
            airspeed_m_s: self.aircraft.limits.speed_cruise_m_s,
        });
        let taken = demand.or(&before);
        if self.demand.is_none_or(|old| old.path != taken.path) {
            self.take_off_from_m = None;
        }
        self.demand = Some(taken);
        taken
    }

    fn pace(&self, demand: &Demand) -> Pace {
        let limits = &self.aircraft.limits;
        Pace {
            speed_m_s: demand.airspeed_m_s.clamp(0.1, limits.speed_max_m_s),
            climb_m_s: limits.climb_max_m_s,
            descent_m_s: limits.descent_max_m_s,
            acceleration_m_s2: self.aircraft.control.acceleration_m_s2,
        }
    }

    /// Moves the point that is followed along the path.
    fn advance_reference(&mut self, dt_s: f64, sensed: &Sensed, demand: &Demand) {
        let here = position(sensed);
        let mut reference = self
            .reference
            .unwrap_or(Reference::at(here, sensed.vel_ned_m_s));
        let pace = self.pace(demand);
        let lag_m = distance(&reference.pos, &here);
        let down_m = -demand.alt_amsl_m;
        match demand.path {
            Path::GoTo { north_m, east_m } => {
                let place = [north_m, east_m, down_m];
                self.turn_nose(&reference.pos, &place);
                reference.go_to(dt_s, &place, &pace, lag_m);
                self.status.path_done = distance(&here, &place) < DONE_M;
            }
            Path::Orbit {
                north_m,
                east_m,
                radius_m,
                clockwise,
            } => {
                let off = [reference.pos[0] - north_m, reference.pos[1] - east_m];
                let from_centre = off[0].hypot(off[1]);
                // From its centre, an orbit is joined in the north.
                let outward = if from_centre > 0.1 {
                    off.map(|d| d / from_centre)
                } else {
                    [1.0, 0.0]
                };
                let sense = if clockwise { 1.0 } else { -1.0 };
                let join = (JOIN_ORBIT_RAD_S * (radius_m - from_centre))
                    .clamp(-pace.speed_m_s, pace.speed_m_s);
                // Half the acceleration is for the bend: a tight one is flown more slowly.
                let most = (0.5 * pace.acceleration_m_s2 * radius_m)
                    .sqrt()
                    .min(pace.speed_m_s);
                let along = (most * most - join * join).max(0.0).sqrt() * sense;
                let level = [
                    join * outward[0] - along * outward[1],
                    join * outward[1] + along * outward[0],
                ];
                reference.move_on(dt_s, level, down_m, &pace, lag_m);
                self.status.path_done = (from_centre - radius_m).abs() < DONE_M;
            }
            Path::Course { deg } | Path::Heading { deg } => {
                let course = deg.to_radians();
                self.yaw_rad = course;
                let level = [pace.speed_m_s * course.cos(), pace.speed_m_s * course.sin()];
                reference.move_on(dt_s, level, down_m, &pace, lag_m);
            }
            Path::TakeOff { .. } => {
                let start = *self.take_off_from_m.get_or_insert(sensed.alt_amsl_m);
                let place = [reference.pos[0], reference.pos[1], down_m];
                reference.go_to(dt_s, &place, &pace, lag_m);
                self.status.path_done =
                    !sensed.on_ground && sensed.alt_amsl_m - start >= TAKEN_OFF_M;
            }
            Path::Land {
                north_m,
                east_m,
                ground_amsl_m,
                ..
            } => {
                let above = [north_m, east_m, reference.pos[2]];
                if (here[0] - north_m).hypot(here[1] - east_m) > ABOVE_POINT_M {
                    reference.go_to(dt_s, &above, &pace, lag_m);
                } else {
                    let height_m = sensed.alt_amsl_m - ground_amsl_m;
                    // As fast as it can still brake before the final descent.
                    let braking =
                        (pace.acceleration_m_s2 * (height_m - FINAL_FROM_M).max(0.0)).sqrt();
                    let sink = braking.clamp(FINAL_M_S, pace.descent_m_s.max(FINAL_M_S));
                    reference.sink(dt_s, sink, &pace);
                }
            }
        }
        self.reference = Some(reference);
    }

    /// Turns the nose into the direction of a long flight.
    fn turn_nose(&mut self, from: &[f64; 3], to: &[f64; 3]) {
        let (north, east) = (to[0] - from[0], to[1] - from[1]);
        if north.hypot(east) > TURN_NOSE_M {
            self.yaw_rad = east.atan2(north);
        }
    }

    /// Adds an error of velocity, m/s, to the integral of an axis.
    fn integrate(&mut self, axis: usize, dt_s: f64, gain: f64, error: f64) {
        let slope = gain * self.aircraft.control.velocity_integral_rad_s * error;
        let added = self.integral[axis] + slope * dt_s;
        self.integral[axis] = added.clamp(-INTEGRAL_M_S2, INTEGRAL_M_S2);
    }

    /// Position and velocity loops around the reference.
    fn follow(&mut self, dt_s: f64, sensed: &Sensed) -> ThrustDemand {
        let here = position(sensed);
        let Some(reference) = self.reference else {
            return ThrustDemand {
                specific_force_ned_m_s2: [0.0, 0.0, -GRAVITY],
                yaw_rad: self.yaw_rad,
            };
        };
        let gains = self.aircraft.control;
        let position_gain = [
            gains.position_rad_s,
            gains.position_rad_s,
            gains.height_rad_s,
        ];
        let velocity_gain = [
            gains.velocity_rad_s,
            gains.velocity_rad_s,
            gains.climb_rad_s,
        ];
        let correction: [f64; 3] =
            std::array::from_fn(|k| position_gain[k] * (reference.pos[k] - here[k]));
        let size = correction[0].hypot(correction[1]);
        let scale = if size > CORRECTION_M_S {
            CORRECTION_M_S / size
        } else {
            1.0
        };
        let error: [f64; 3] = std::array::from_fn(|k| {
            let scaled = if k < 2 {
                scale * correction[k]
            } else {
                correction[k].clamp(-CORRECTION_M_S, CORRECTION_M_S)
            };
            reference.vel[k] + scaled - sensed.vel_ned_m_s[k]
        });
        let wanted: [f64; 3] = std::array::from_fn(|k| {
            reference.acc[k] + velocity_gain[k] * error[k] + self.integral[k]
        });
        let upward =
            (GRAVITY - wanted[2]).clamp(VERTICAL_THRUST.0 * GRAVITY, VERTICAL_THRUST.1 * GRAVITY);
        let most = upward * self.aircraft.limits.tilt_max_deg.to_radians().tan();
        let level = wanted[0].hypot(wanted[1]);
        let tilt = if level > most { most / level } else { 1.0 };
        // An integral that nobody can obey must not grow.
        let free = tilt >= 1.0 && !sensed.on_ground;
        for k in 0..3 {
            if free {
                self.integrate(k, dt_s, velocity_gain[k], error[k]);
            }
        }
        let force = [tilt * wanted[0], tilt * wanted[1], -upward];
        let (sin, cos) = sensed.yaw_rad.sin_cos();
        self.status.pitch_command_rad = -(force[0] * cos + force[1] * sin).atan2(upward);
        self.status.bank_command_rad = (force[1] * cos - force[0] * sin).atan2(upward);
        ThrustDemand {
            specific_force_ned_m_s2: force,
            yaw_rad: self.yaw_rad,
        }
    }
}

fn position(sensed: &Sensed) -> [f64; 3] {
    [sensed.north_m, sensed.east_m, -sensed.alt_amsl_m]
}

fn distance(a: &[f64; 3], b: &[f64; 3]) -> f64 {
    let square = |k: usize| (a[k] - b[k]) * (a[k] - b[k]);
    (square(0) + square(1) + square(2)).sqrt()
}
