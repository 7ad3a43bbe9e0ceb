//! What a vehicle shares with a batch of its kind.

use super::{DelayLine, FlightSim, SurfaceCommand};
use crate::aircraft::Layout;
use crate::dynamics::{Controls, Dynamics};
use crate::fleet::Motion;
use crate::servo::Servo;

impl Dynamics {
    /// Angles of the three servos for a command, rad.
    pub fn servo_angles(&self, command: &SurfaceCommand) -> [f64; 3] {
        let s = &self.aircraft.surfaces;
        let elevator = command.elevator_rad + s.elevator_offset_deg.to_radians();
        let aileron = command.aileron_rad + s.aileron_offset_deg.to_radians();
        let rudder = command.rudder_rad + s.rudder_offset_deg.to_radians();
        match s.layout {
            Layout::Elevons => [elevator + aileron, elevator - aileron, 0.0],
            Layout::Conventional => [elevator, aileron, rudder],
        }
    }

    /// What the servos and the motor do to the aircraft.
    #[inline(always)]
    pub fn controls(&self, servos: &[Servo; 3], motor: f64) -> Controls {
        let [a, b, c] = [servos[0].angle, servos[1].angle, servos[2].angle];
        let (elevator, aileron, rudder) = match self.aircraft.surfaces.layout {
            Layout::Elevons => (0.5 * (a + b), 0.5 * (a - b), 0.0),
            Layout::Conventional => (a, b, c),
        };
        Controls {
            elevator,
            aileron,
            rudder,
            throttle: motor,
        }
    }
}

impl FlightSim {
    /// Position, velocity, attitude, servos and motor now.
    pub fn motion(&self) -> Motion {
        Motion {
            pos_ned_m: self.body.pos_ned,
            vel_ned_m_s: self.body.vel_ned,
            attitude: self.body.attitude,
            rate_rad_s: self.body.rate,
            servo_rad: self.servos.map(|servo| servo.angle),
            servo_rate_rad_s: self.servos.map(|servo| servo.rate),
            motor: self.motor,
            specific_force_m_s2: self.specific_force,
        }
    }

    /// What it was told last, and what is on its way to the servos.
    pub(crate) fn orders(&self) -> (SurfaceCommand, &DelayLine) {
        (self.last, &self.delay)
    }

    /// Takes over a motion, as from a batch.
    pub fn set_from(&mut self, motion: &Motion) {
        self.body.pos_ned = motion.pos_ned_m;
        self.set_motion(motion.vel_ned_m_s, motion.attitude, motion.rate_rad_s);
        for k in 0..3 {
            self.servos[k].angle = motion.servo_rad[k];
            self.servos[k].rate = motion.servo_rate_rad_s[k];
        }
        self.motor = motion.motor;
        self.specific_force = motion.specific_force_m_s2;
    }
}
