//! Commands on their way to the servos.

use crate::state::SurfaceCommand;

/// Longest delay line, in calls of [`super::FlightSim::step`].
const LONGEST: usize = 64;

/// The last commands of one vehicle.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct DelayLine {
    ring: [SurfaceCommand; LONGEST],
    next: usize,
}

impl DelayLine {
    /// A line on which `command` has been for long.
    pub fn filled(command: &SurfaceCommand) -> Self {
        Self {
            ring: [*command; LONGEST],
            next: 0,
        }
    }

    /// How many calls of `dt_s` come nearest to a delay.
    pub fn calls(delay_s: f64, dt_s: f64) -> usize {
        ((delay_s / dt_s).round() as usize).min(LONGEST - 1)
    }

    /// Takes in a command and gives the one of so many calls ago; the launcher's release is not
    /// delayed.
    pub fn pass(&mut self, command: &SurfaceCommand, calls: usize) -> SurfaceCommand {
        if calls == 0 {
            return *command;
        }
        self.ring[self.next] = *command;
        let out = self.ring[(self.next + LONGEST - calls.min(LONGEST - 1)) % LONGEST];
        self.next = (self.next + 1) % LONGEST;
        SurfaceCommand {
            launch: command.launch,
            ..out
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_command_comes_out_after_its_delay_but_a_launch_at_once() {
        let mut line = DelayLine::filled(&SurfaceCommand::default());
        let calls = DelayLine::calls(0.08, 0.02);
        assert_eq!(calls, 4);
        for call in 0..200_i32 {
            let command = SurfaceCommand {
                elevator_rad: f64::from(call),
                launch: call == 10,
                ..SurfaceCommand::default()
            };
            let out = line.pass(&command, calls);
            assert_eq!(out.elevator_rad, f64::from((call - 4).max(0)));
            assert_eq!(out.launch, call == 10);
        }
    }
}
