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
