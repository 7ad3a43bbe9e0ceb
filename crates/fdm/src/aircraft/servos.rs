//! Which outputs of an autopilot move the surfaces and the motor.

use serde::{Deserialize, Serialize};

use super::{Layout, Surfaces};
use crate::error::{FdmError, refuse};
use crate::state::SurfaceCommand;

/// Outputs of an autopilot, counted from 1, and their pulse widths: the settings `SERVOn_FUNCTION`, `SERVOn_MIN`,
/// `SERVOn_TRIM` and `SERVOn_MAX` of an ArduPlane that flies the model. A long pulse of an aileron rolls right, of an
/// elevator lifts the nose, of an elevon moves its trailing edge up and of a rudder turns the nose right.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Servos {
    /// The aileron's output, or the left elevon's.
    pub aileron: usize,
    /// The elevator's output, or the right elevon's.
    pub elevator: usize,
    /// The motor's output.
    pub throttle: usize,
    /// The rudder's output; not used with elevons.
    pub rudder: usize,
    /// Pulse at one end of the travel, and of a motor that stands still, µs.
    pub min_us: u16,
    /// Pulse of a surface in the middle, µs.
    pub trim_us: u16,
    /// Pulse at the other end, and of full throttle, µs.
    pub max_us: u16,
}

impl Default for Servos {
    /// ArduPlane's order of outputs, and the widest usual pulses.
    fn default() -> Self {
        Self {
            aileron: 1,
            elevator: 2,
            throttle: 3,
            rudder: 4,
            min_us: 1000,
            trim_us: 1500,
            max_us: 2000,
        }
    }
}

/// Outputs that an autopilot may have.
pub(crate) const OUTPUTS: usize = 32;

impl Servos {
    pub(super) fn check(&self) -> Result<(), FdmError> {
        let outputs = [
            ("servos.aileron", self.aileron),
            ("servos.elevator", self.elevator),
            ("servos.throttle", self.throttle),
            ("servos.rudder", self.rudder),
        ];
        for (key, output) in outputs {
            if !(1..=OUTPUTS).contains(&output) {
                return Err(refuse(key, output as f64, "an output, 1 to 32"));
            }
        }
        if !(self.min_us < self.trim_us && self.trim_us < self.max_us) {
            let expected = format!(
                "between servos.min_us = {} and servos.max_us = {}",
                self.min_us, self.max_us
            );
            return Err(refuse("servos.trim_us", f64::from(self.trim_us), expected));
        }
        Ok(())
    }

    /// What pulses of the outputs 1, 2 … ask of the aircraft. An output that is not there or has no pulse (0) leaves
    /// its surface in the middle and its motor still.
    pub fn command(&self, pulses_us: &[u16], surfaces: &Surfaces) -> SurfaceCommand {
        let pulse = |output: usize| pulses_us.get(output - 1).copied().filter(|&us| us > 0);
        let part = |output: usize| pulse(output).map_or(0.0, |us| self.part(us));
        let (down, up) = (surfaces.max_deg.to_radians(), surfaces.min_deg.to_radians());
        // Trailing edge down is positive; a long pulse moves it up.
        let raised = |part: f64| if part > 0.0 { part * up } else { -part * down };
        // Ailerons and rudder have the same travel both ways.
        let throw = down.min(-up);
        let (first, second) = (part(self.aileron), part(self.elevator));
        let (elevator_rad, aileron_rad, rudder_rad) = match surfaces.layout {
            Layout::Elevons => {
                let [left, right] = [first, second].map(raised);
                (0.5 * (left + right), 0.5 * (left - right), 0.0)
            }
            Layout::Conventional => (raised(second), first * throw, -part(self.rudder) * throw),
        };
        let (low, high) = (f64::from(self.min_us), f64::from(self.max_us));
        let throttle = pulse(self.throttle).map_or(0.0, |us| (f64::from(us) - low) / (high - low));
        SurfaceCommand {
            elevator_rad,
            aileron_rad,
            rudder_rad,
            throttle: throttle.clamp(0.0, 1.0),
            ..SurfaceCommand::default()
        }
    }

    /// Part of the travel, -1 to 1.
    fn part(&self, us: u16) -> f64 {
        let [us, low, mid, high] = [us, self.min_us, self.trim_us, self.max_us].map(f64::from);
        let span = if us > mid { high - mid } else { mid - low };
        ((us - mid) / span).clamp(-1.0, 1.0)
    }

    /// The settings of an ArduPlane whose outputs these are, a line each as in a parameter file.
    pub fn ardupilot_parameters(&self, layout: Layout) -> Vec<(String, u16)> {
        // Functions of ArduPilot's outputs: 77 and 78 left and right elevon, 4 aileron, 19 elevator, 70 throttle,
        // 21 rudder.
        let mut functions = vec![(self.throttle, 70)];
        functions.extend(match layout {
            Layout::Elevons => vec![(self.aileron, 77), (self.elevator, 78)],
            Layout::Conventional => vec![(self.aileron, 4), (self.elevator, 19), (self.rudder, 21)],
        });
        functions.sort_unstable();
        let settings = |(output, function): (usize, u16)| {
            let trim_us = if function == 70 {
                self.min_us
            } else {
                self.trim_us
            };
            [
                ("FUNCTION", function),
                ("MIN", self.min_us),
                ("TRIM", trim_us),
                ("MAX", self.max_us),
                ("REVERSED", 0),
            ]
            .map(|(what, value)| (format!("SERVO{output}_{what}"), value))
        };
        functions.into_iter().flat_map(settings).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn surfaces(layout: Layout) -> Surfaces {
        Surfaces {
            layout,
            min_deg: -30.0,
            max_deg: 35.0,
            rate_deg_s: 200.0,
            natural_frequency_rad_s: 100.0,
            damping_ratio: 1.0,
            delay_s: 0.0,
            elevator_offset_deg: 0.0,
            aileron_offset_deg: 0.0,
            rudder_offset_deg: 0.0,
        }
    }

    #[test]
    fn elevons_lift_the_nose_together_and_roll_right_with_the_left_one_down() {
        let servos = Servos::default();
        let command =
            |left, right| servos.command(&[left, right, 1000], &surfaces(Layout::Elevons));
        let nose_up = command(2000, 2000);
        assert!((nose_up.elevator_rad.to_degrees() + 30.0).abs() < 1e-9);
        assert!(nose_up.aileron_rad.abs() < 1e-12);
        // ArduPlane's mixer: left = elevator - aileron, right = elevator + aileron.
        let roll_right = command(1250, 1750);
        assert!((roll_right.aileron_rad.to_degrees() - 0.5 * (17.5 + 15.0)).abs() < 1e-9);
    }

    #[test]
    fn a_conventional_aircraft_has_its_three_surfaces_and_its_motor() {
        let servos = Servos::default();
        let c = servos.command(&[1750, 1000, 1500, 2000], &surfaces(Layout::Conventional));
        assert!((c.aileron_rad.to_degrees() - 15.0).abs() < 1e-9);
        assert!((c.elevator_rad.to_degrees() - 35.0).abs() < 1e-9);
        assert!((c.rudder_rad.to_degrees() + 30.0).abs() < 1e-9);
        assert!((c.throttle - 0.5).abs() < 1e-12);
    }

    #[test]
    fn outputs_without_a_pulse_move_nothing() {
        let c = Servos::default().command(&[0, 0, 0, 0], &surfaces(Layout::Conventional));
        assert_eq!(c, SurfaceCommand::default());
        let c = Servos::default().command(&[], &surfaces(Layout::Elevons));
        assert_eq!(c, SurfaceCommand::default());
    }

    #[test]
    fn pulses_that_are_in_no_order_and_outputs_that_are_none_are_refused() {
        let wrong = Servos {
            trim_us: 2100,
            ..Servos::default()
        };
        assert!(wrong.check().is_err());
        let wrong = Servos {
            throttle: 0,
            ..Servos::default()
        };
        assert!(wrong.check().is_err());
    }
}
