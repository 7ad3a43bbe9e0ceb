//! Many flying vehicles of one type side by side: structure of arrays in blocks of [`LANES`],
//! the same equations as [`FlightSim`], vector registers where the processor has them.
//!
//! A vehicle flies bit for bit as it would alone ([`FlightSim`] is the reference). Only flight is
//! batched: vehicles on the ground or on the launcher are stepped one by one, and enter with
//! [`Fleet::load`] once they fly.

use multiversion::multiversion;

use crate::FdmError;
use crate::aircraft::Aircraft;
use crate::dynamics::{AirState, Body, Dynamics};
use crate::flight::{
    AirAround, DelayLine, FlightSim, HIGHEST_RATE_RAD_S, SurfaceCommand, sanitised,
};
use crate::mechanism::Extended;
use crate::scalar::bounded;
use crate::servo::{LagStep, Servo};

/// How many vehicles a block holds: the doubles of an AVX-512 register.
pub const LANES: usize = 8;

/// Vehicles of one type in flight.
#[derive(Debug, Clone)]
pub struct Fleet {
    dynamics: Dynamics,
    count: usize,
    blocks: Vec<Block>,
    /// What each vehicle was told last.
    told: Vec<SurfaceCommand>,
    /// Commands on their way, one line a vehicle; none where the servos answer without delay.
    delay: Vec<DelayLine>,
    half_step: Option<(f64, LagStep)>,
}

/// [`LANES`] vehicles, component by component.
#[derive(Debug, Clone)]
#[repr(align(64))]
struct Block {
    pos_ned: [[f64; LANES]; 3],
    vel_ned: [[f64; LANES]; 3],
    attitude: [[f64; LANES]; 4],
    rate: [[f64; LANES]; 3],
    servo_angle: [[f64; LANES]; 3],
    servo_rate: [[f64; LANES]; 3],
    servo_command: [[f64; LANES]; 3],
    motor: [f64; LANES],
    throttle: [f64; LANES],
    wind_ned: [[f64; LANES]; 3],
    density: [f64; LANES],
    specific_force: [[f64; LANES]; 3],
}

/// One vehicle's motion.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Motion {
    /// Metres north, east and down (negative altitude above mean sea level).
    pub pos_ned_m: [f64; 3],
    /// Velocity over ground, NED, m/s.
    pub vel_ned_m_s: [f64; 3],
    /// Attitude quaternion (w, x, y, z), body to NED.
    pub attitude: [f64; 4],
    /// Angular rate in body axes, rad/s.
    pub rate_rad_s: [f64; 3],
    /// Angles of the three servos (left and right elevon and none, or elevator, aileron and
    /// rudder), rad.
    pub servo_rad: [f64; 3],
    /// Their rates, rad/s.
    pub servo_rate_rad_s: [f64; 3],
    /// Motor state, 0 to 1.
    pub motor: f64,
    /// Specific force, body axes, m/s².
    pub specific_force_m_s2: [f64; 3],
}

impl Fleet {
    /// `count` copies of one vehicle.
    ///
    /// # Errors
    /// A mechanism of the aircraft's list that is unknown or out of range.
    pub fn new(aircraft: &Aircraft, count: usize, like: &FlightSim) -> Result<Self, FdmError> {
        let dynamics = Dynamics::new(&Extended::of(aircraft)?.aircraft);
        let empty = Block {
            pos_ned: [[0.0; LANES]; 3],
            vel_ned: [[0.0; LANES]; 3],
            attitude: [[0.0; LANES]; 4],
            rate: [[0.0; LANES]; 3],
            servo_angle: [[0.0; LANES]; 3],
            servo_rate: [[0.0; LANES]; 3],
            servo_command: [[0.0; LANES]; 3],
            motor: [0.0; LANES],
            throttle: [0.0; LANES],
            wind_ned: [[0.0; LANES]; 3],
            density: [AirAround::STANDARD_CALM.density_kg_m3; LANES],
            specific_force: [[0.0; LANES]; 3],
        };
        let (told, line) = like.orders();
        let delayed = dynamics.aircraft.surfaces.delay_s > 0.0;
        let mut fleet = Self {
            dynamics,
            count,
            blocks: vec![empty; count.div_ceil(LANES)],
            told: vec![told; count],
            delay: vec![line.clone(); if delayed { count } else { 0 }],
            half_step: None,
        };
        for index in 0..fleet.blocks.len() * LANES {
            fleet.put(index, &like.motion());
        }
        Ok(fleet)
    }

    /// Number of vehicles.
    pub fn len(&self) -> usize {
        self.count
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.count == 0
    }

    /// Takes over a vehicle's motion and the commands on their way to its servos. An index beyond
    /// the fleet does nothing.
    pub fn load(&mut self, index: usize, sim: &FlightSim) {
        if index >= self.count {
            return;
        }
        self.put(index, &sim.motion());
        let (told, line) = sim.orders();
        self.told[index] = told;
        if let Some(own) = self.delay.get_mut(index) {
            own.clone_from(line);
        }
    }

    /// A vehicle's motion.
    pub fn motion(&self, index: usize) -> Option<Motion> {
        (index < self.count).then(|| {
            let (block, lane) = (&self.blocks[index / LANES], index % LANES);
            let at = |values: &[f64; LANES]| values[lane];
            Motion {
                pos_ned_m: block.pos_ned.each_ref().map(at),
                vel_ned_m_s: block.vel_ned.each_ref().map(at),
                attitude: block.attitude.each_ref().map(at),
                rate_rad_s: block.rate.each_ref().map(at),
                servo_rad: block.servo_angle.each_ref().map(at),
                servo_rate_rad_s: block.servo_rate.each_ref().map(at),
                motor: block.motor[lane],
                specific_force_m_s2: block.specific_force.each_ref().map(at),
            }
        })
    }

    /// Sets what one vehicle is told; values that are not finite keep the last.
    pub fn set_command(&mut self, index: usize, command: &SurfaceCommand) {
        if let Some(told) = self.told.get_mut(index) {
            *told = sanitised(command, told);
            // With a delay the line decides, at the next step, what the servos hear.
            if self.delay.is_empty() {
                let heard = *told;
                self.tell_servos(index, &heard);
            }
        }
    }

    fn tell_servos(&mut self, index: usize, command: &SurfaceCommand) {
        let (block, lane) = (&mut self.blocks[index / LANES], index % LANES);
        let angles = self.dynamics.servo_angles(command);
        for (slot, angle) in block.servo_command.iter_mut().zip(angles) {
            slot[lane] = angle;
        }
        block.throttle[lane] = command.throttle;
    }

    /// Sets the air around one vehicle; values that are not finite keep the last.
    pub fn set_air(&mut self, index: usize, air: &AirAround) {
        if index >= self.count {
            return;
        }
        let (block, lane) = (&mut self.blocks[index / LANES], index % LANES);
        for (slot, value) in block.wind_ned.iter_mut().zip(air.wind_ned_m_s) {
            if value.is_finite() {
                slot[lane] = value;
            }
        }
        if air.density_kg_m3.is_finite() && air.density_kg_m3 > 0.0 {
            block.density[lane] = air.density_kg_m3;
        }
    }

    /// Advances every vehicle by `dt_s`, cut as in [`FlightSim::step`].
    pub fn step(&mut self, dt_s: f64) {
        if !(dt_s.is_finite() && dt_s > 0.0) {
            return;
        }
        let calls = DelayLine::calls(self.dynamics.aircraft.surfaces.delay_s, dt_s);
        for index in 0..self.delay.len() {
            let heard = self.delay[index].pass(&self.told[index], calls);
            self.tell_servos(index, &heard);
        }
        let count = self.dynamics.steps_in(dt_s);
        let dt = dt_s / count;
        let lag = match self.half_step {
            Some((kept, lag)) if kept == dt => lag,
            _ => {
                let a = &self.dynamics.aircraft;
                let lag = LagStep::new(&a.surfaces, a.propulsion.lag_s, 0.5 * dt);
                self.half_step = Some((dt, lag));
                lag
            }
        };
        step_blocks(&self.dynamics, &mut self.blocks, &lag, dt, count as usize);
    }

    fn put(&mut self, index: usize, motion: &Motion) {
        let (block, lane) = (&mut self.blocks[index / LANES], index % LANES);
        for k in 0..3 {
            block.pos_ned[k][lane] = motion.pos_ned_m[k];
            block.vel_ned[k][lane] = motion.vel_ned_m_s[k];
            block.rate[k][lane] = motion.rate_rad_s[k];
            block.servo_angle[k][lane] = motion.servo_rad[k];
            block.servo_rate[k][lane] = motion.servo_rate_rad_s[k];
            block.specific_force[k][lane] = motion.specific_force_m_s2[k];
            block.servo_command[k][lane] = motion.servo_rad[k];
        }
        for k in 0..4 {
            block.attitude[k][lane] = motion.attitude[k];
        }
        block.motor[lane] = motion.motor;
        block.throttle[lane] = motion.motor;
    }
}

/// Advances all blocks by `count` steps of `dt`.
///
/// The equations are free of branches and calls, so that the compiler turns the loop over a
/// block's lanes into vector instructions.
#[multiversion(targets("x86_64+avx512f+avx512dq+avx512vl", "x86_64+avx+avx2"))]
fn step_blocks(dynamics: &Dynamics, blocks: &mut [Block], lag: &LagStep, dt: f64, count: usize) {
    for block in blocks {
        for _ in 0..count {
            for lane in 0..LANES {
                step_lane(dynamics, block, lane, lag, dt);
            }
        }
    }
}

#[inline(always)]
fn step_lane(dynamics: &Dynamics, block: &mut Block, lane: usize, lag: &LagStep, dt: f64) {
    let at = |values: &[[f64; LANES]; 3]| [values[0][lane], values[1][lane], values[2][lane]];
    let old = Body {
        pos_ned: at(&block.pos_ned),
        vel_ned: at(&block.vel_ned),
        attitude: [
            block.attitude[0][lane],
            block.attitude[1][lane],
            block.attitude[2][lane],
            block.attitude[3][lane],
        ],
        rate: at(&block.rate),
    };
    let air = AirState {
        wind_ned: at(&block.wind_ned),
        density: block.density[lane],
    };
    let mut servos = [Servo::default(); 3];
    for (k, servo) in servos.iter_mut().enumerate() {
        servo.angle = block.servo_angle[k][lane];
        servo.rate = block.servo_rate[k][lane];
    }
    let mut motor = block.motor[lane];
    let command = at(&block.servo_command);
    let throttle = block.throttle[lane];

    let start = dynamics.controls(&servos, motor);
    lag.drive(&mut servos, &mut motor, &command, throttle);
    let middle = dynamics.controls(&servos, motor);
    lag.drive(&mut servos, &mut motor, &command, throttle);
    let end = dynamics.controls(&servos, motor);
    let (new, force) = dynamics.rk4(&old, &[start, middle, end], &air, dt);
    let (new, force) = accept(&old, &new, &force, &at(&block.specific_force));

    for k in 0..3 {
        block.pos_ned[k][lane] = new.pos_ned[k];
        block.vel_ned[k][lane] = new.vel_ned[k];
        block.rate[k][lane] = new.rate[k];
        block.specific_force[k][lane] = force[k];
        block.servo_angle[k][lane] = servos[k].angle;
        block.servo_rate[k][lane] = servos[k].rate;
    }
    for k in 0..4 {
        block.attitude[k][lane] = new.attitude[k];
    }
    block.motor[lane] = motor;
}

/// The new state where all of it is finite, with rates inside their bound; else the old one.
#[inline(always)]
fn accept(old: &Body, new: &Body, force: &[f64; 3], old_force: &[f64; 3]) -> (Body, [f64; 3]) {
    // A sum of products with 0 is 0 exactly where everything is finite.
    let mut sum = 0.0;
    for k in 0..3 {
        sum += new.pos_ned[k] * 0.0 + new.vel_ned[k] * 0.0 + new.rate[k] * 0.0;
    }
    sum += force[0] * 0.0 + force[1] * 0.0 + force[2] * 0.0;
    for k in 0..4 {
        sum += new.attitude[k] * 0.0;
    }
    let finite = sum == 0.0;
    let keep = |new: f64, old: f64| if finite { new } else { old };
    let mut out = *old;
    for k in 0..3 {
        let rate = bounded(new.rate[k], -HIGHEST_RATE_RAD_S, HIGHEST_RATE_RAD_S);
        out.pos_ned[k] = keep(new.pos_ned[k], old.pos_ned[k]);
        out.vel_ned[k] = keep(new.vel_ned[k], old.vel_ned[k]);
        out.rate[k] = keep(rate, 0.0);
    }
    for k in 0..4 {
        out.attitude[k] = keep(new.attitude[k], old.attitude[k]);
    }
    let out_force = [
        keep(force[0], old_force[0]),
        keep(force[1], old_force[1]),
        keep(force[2], old_force[2]),
    ];
    (out, out_force)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_vehicle_flies_the_same_alone_and_in_a_fleet() {
        let late = "\n[[mechanism]]\nid = \"actuator-delay\"\ndelay_s = 0.07\n";
        for (text, delay) in [
            (include_str!("../../../aircraft/x8.toml"), ""),
            (include_str!("../../../aircraft/ultrastick-25e.toml"), ""),
            (include_str!("../../../aircraft/x8.toml"), late),
            (include_str!("../../../aircraft/ultrastick-25e.toml"), late),
        ] {
            let aircraft = Aircraft::from_toml("aircraft", &format!("{text}{delay}")).unwrap();
            let mut alone: Vec<FlightSim> = (0..11)
                .map(|k| {
                    let speed = 16.0 + 0.3 * f64::from(k);
                    FlightSim::airborne(&aircraft, 0.0, 0.0, 400.0, 33.0 * f64::from(k), speed)
                        .unwrap()
                })
                .collect();
            let mut fleet = Fleet::new(&aircraft, alone.len(), &alone[0]).unwrap();
            for (k, sim) in alone.iter_mut().enumerate() {
                // Commands are on their way when the fleet takes over.
                for way in 0..k {
                    let command = SurfaceCommand {
                        elevator_rad: 0.05 * way as f64,
                        throttle: 0.4,
                        ..SurfaceCommand::default()
                    };
                    sim.step(0.02, &AirAround::STANDARD_CALM, &command);
                }
                fleet.load(k, sim);
            }
            for tick in 0..400 {
                for (k, sim) in alone.iter_mut().enumerate() {
                    let phase = 0.03 * f64::from(tick) + k as f64;
                    let lost = tick % 37 == 5;
                    let command = SurfaceCommand {
                        elevator_rad: if lost {
                            f64::NAN
                        } else {
                            -0.05 + 0.2 * phase.sin()
                        },
                        aileron_rad: 0.3 * (1.7 * phase).sin(),
                        rudder_rad: 0.2 * (2.1 * phase).cos(),
                        throttle: 0.5 + 0.6 * phase.cos(),
                        launch: false,
                    };
                    let air = AirAround {
                        wind_ned_m_s: [3.0 * phase.cos(), 4.0, 0.5 * phase.sin()],
                        density_kg_m3: 1.1 + 0.01 * k as f64,
                    };
                    sim.step(0.02, &air, &command);
                    fleet.set_command(k, &command);
                    fleet.set_air(k, &air);
                }
                fleet.step(0.02);
            }
            for (k, sim) in alone.iter().enumerate() {
                assert_eq!(fleet.motion(k).unwrap(), sim.motion(), "vehicle {k}");
            }
            assert!(fleet.motion(alone.len()).is_none());
        }
    }

    #[test]
    fn a_lane_that_leaves_the_numbers_does_not_harm_its_neighbours() {
        let aircraft =
            Aircraft::from_toml("x8", include_str!("../../../aircraft/x8.toml")).unwrap();
        let sim = FlightSim::airborne(&aircraft, 0.0, 0.0, 400.0, 0.0, 18.0).unwrap();
        let mut fleet = Fleet::new(&aircraft, 3, &sim).unwrap();
        fleet.set_air(
            1,
            &AirAround {
                wind_ned_m_s: [1e200, 0.0, 0.0],
                density_kg_m3: 1e200,
            },
        );
        for _ in 0..100 {
            fleet.step(0.02);
        }
        for k in 0..3 {
            let motion = fleet.motion(k).unwrap();
            assert!(motion.vel_ned_m_s.iter().all(|v| v.is_finite()), "{k}");
        }
        assert_eq!(fleet.motion(0), fleet.motion(2));
        assert!((fleet.motion(0).unwrap().vel_ned_m_s[0] - 18.0).abs() < 0.5);
    }
}
