//! Mixing: how elevator, aileron and rudder are shared out to the surfaces of a layout, and back.

use crate::aircraft::Layout;
use crate::dynamics::{Controls, Dynamics};
use crate::servo::Servo;
use crate::state::SurfaceCommand;

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
