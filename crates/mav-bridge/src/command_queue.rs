//! Commands on their way to the vehicle: one of a kind at a time, sent again until answered.
//!
//! An acknowledgement names only the kind of command, so a second command of a kind waits for
//! the answer to the first; a newer one of the same purpose replaces the one that waits.

use crate::dialect::{
    COMMAND_INT_DATA, COMMAND_LONG_DATA, MavCmd, MavFrame, MavParamType, MavResult,
    PARAM_REQUEST_READ_DATA, PARAM_SET_DATA,
};
use crate::profile::Profile;
use protocol::SimTime;
use std::collections::VecDeque;

/// One command.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum VehicleCommand {
    Arm,
    Mode {
        mode: u32,
        /// How often it may be sent.
        attempts: u32,
    },
    LandStart,
    /// A multirotor's, in the mode for places.
    TakeOff {
        above_home_m: f32,
    },
    Reposition {
        lat_1e7: i32,
        lon_1e7: i32,
        alt_amsl_m: f32,
        radius_m: f32,
        /// Where a place carries it.
        equivalent_airspeed_m_s: Option<f32>,
    },
    Speed {
        equivalent_airspeed_m_s: f32,
    },
    Interval {
        message_id: u32,
        hz: f64,
    },
    Parameter(&'static str),
    SetParameter {
        name: &'static str,
        value: f64,
    },
}

/// The MAVLink message of a command.
pub(crate) enum CommandMessage {
    Long(COMMAND_LONG_DATA),
    Int(COMMAND_INT_DATA),
    Read(PARAM_REQUEST_READ_DATA),
    Set(PARAM_SET_DATA),
}

impl VehicleCommand {
    /// The kind that acknowledgements name; none for parameters.
    fn kind(&self) -> Option<MavCmd> {
        Some(match self {
            Self::Arm => MavCmd::MAV_CMD_COMPONENT_ARM_DISARM,
            Self::Mode { .. } => MavCmd::MAV_CMD_DO_SET_MODE,
            Self::LandStart => MavCmd::MAV_CMD_DO_LAND_START,
            Self::TakeOff { .. } => MavCmd::MAV_CMD_NAV_TAKEOFF,
            Self::Reposition { .. } => MavCmd::MAV_CMD_DO_REPOSITION,
            Self::Speed { .. } => MavCmd::MAV_CMD_DO_CHANGE_SPEED,
            Self::Interval { .. } => MavCmd::MAV_CMD_SET_MESSAGE_INTERVAL,
            Self::Parameter(_) | Self::SetParameter { .. } => return None,
        })
    }

    /// Whether it steers the vehicle, so that it must not be sent once a pilot flies.
    pub(crate) fn steers(&self) -> bool {
        !matches!(
            self,
            Self::Interval { .. } | Self::Parameter(_) | Self::SetParameter { .. }
        )
    }

    /// Whether `other` is an older command of the same purpose.
    fn replaces(&self, other: &Self) -> bool {
        match (self, other) {
            (Self::Interval { message_id: a, .. }, Self::Interval { message_id: b, .. }) => a == b,
            (Self::Parameter(a), Self::Parameter(b)) => a == b,
            _ => self.kind().is_some() && self.kind() == other.kind() && self.steers(),
        }
    }

    fn attempts(&self, otherwise: u32) -> u32 {
        match self {
            Self::Mode { attempts, .. } => *attempts,
            _ => otherwise,
        }
    }

    /// Its name, for people.
    pub(crate) fn name(&self, profile: &Profile) -> String {
        match self {
            Self::Arm => "arming".into(),
            Self::Mode { mode, .. } => format!("mode {}", profile.modes.name(*mode)),
            Self::LandStart => "the landing sequence".into(),
            Self::TakeOff { .. } => "the take-off (NAV_TAKEOFF)".into(),
            Self::Reposition { .. } => "a setpoint (DO_REPOSITION)".into(),
            Self::Speed { .. } => "an airspeed (DO_CHANGE_SPEED)".into(),
            Self::Interval { message_id, .. } => format!("the rate of message {message_id}"),
            Self::Parameter(name) => format!("parameter {name}"),
            Self::SetParameter { name, value } => format!("parameter {name} = {value}"),
        }
    }

    /// The message to a system and its component; `sent` is how often it was sent before.
    pub(crate) fn message(
        &self,
        (system, component): (u8, u8),
        sent: u32,
        profile: &Profile,
    ) -> CommandMessage {
        let long = |p: [f32; 3]| {
            CommandMessage::Long(COMMAND_LONG_DATA {
                param1: p[0],
                param2: p[1],
                param3: p[2],
                command: self.kind().unwrap_or_default(),
                target_system: system,
                target_component: component,
                confirmation: sent.min(255) as u8,
                ..COMMAND_LONG_DATA::default()
            })
        };
        match *self {
            Self::Arm => long([1.0, 0.0, 0.0]),
            // param1: MAV_MODE_FLAG_CUSTOM_MODE_ENABLED.
            Self::Mode { mode, .. } => {
                let [main, sub] = profile.modes.parameters(mode);
                long([1.0, main, sub])
            }
            Self::LandStart => long([0.0; 3]),
            Self::TakeOff { above_home_m } => CommandMessage::Long(COMMAND_LONG_DATA {
                param7: above_home_m,
                command: MavCmd::MAV_CMD_NAV_TAKEOFF,
                target_system: system,
                target_component: component,
                confirmation: sent.min(255) as u8,
                ..COMMAND_LONG_DATA::default()
            }),
            // param1: 0 is airspeed, 1 speed over ground; param3: throttle unchanged.
            Self::Speed {
                equivalent_airspeed_m_s,
            } => {
                let kind = f32::from(u8::from(profile.commands.ground_speed));
                long([kind, equivalent_airspeed_m_s, -1.0])
            }
            Self::Interval { message_id, hz } => {
                long([message_id as f32, (1e6 / hz).round() as f32, 0.0])
            }
            Self::Reposition {
                lat_1e7,
                lon_1e7,
                alt_amsl_m,
                radius_m,
                equivalent_airspeed_m_s,
            } => CommandMessage::Int(COMMAND_INT_DATA {
                param1: equivalent_airspeed_m_s.unwrap_or(-1.0), // below 0: as it is
                param2: 0.0, // never 1: that would change the mode, against a pilot too
                param3: radius_m,
                param4: profile.commands.reposition_4,
                x: lat_1e7,
                y: lon_1e7,
                z: alt_amsl_m,
                command: MavCmd::MAV_CMD_DO_REPOSITION,
                target_system: system,
                target_component: component,
                frame: MavFrame::MAV_FRAME_GLOBAL,
                ..COMMAND_INT_DATA::default()
            }),
            // ArduPilot knows the types of its parameters and takes any; all that are set are whole numbers.
            Self::SetParameter { name, value } => {
                let as_bytes = profile.commands.parameters_as_bytes;
                let (param_value, param_type) = if as_bytes {
                    let bits = (value as i32).cast_unsigned();
                    (f32::from_bits(bits), MavParamType::MAV_PARAM_TYPE_INT32)
                } else {
                    (value as f32, MavParamType::MAV_PARAM_TYPE_REAL32)
                };
                CommandMessage::Set(PARAM_SET_DATA {
                    param_value,
                    target_system: system,
                    target_component: component,
                    param_id: name.into(),
                    param_type,
                })
            }
            Self::Parameter(name) => CommandMessage::Read(PARAM_REQUEST_READ_DATA {
                param_index: -1,
                target_system: system,
                target_component: component,
                param_id: name.into(),
            }),
        }
    }
}

#[derive(Debug, Clone)]
struct Pending {
    command: VehicleCommand,
    sent_at: SimTime,
    sent: u32,
}

/// Outcome of a command.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum CommandOutcome {
    Accepted(VehicleCommand),
    Refused(VehicleCommand, MavResult),
    Unanswered(VehicleCommand),
}

/// The commands that wait and those that have no answer yet.
#[derive(Debug, Clone, Default)]
pub(crate) struct CommandQueue {
    waiting: VecDeque<VehicleCommand>,
    pending: Vec<Pending>,
}

impl CommandQueue {
    /// Queues `command`; an older one of the same purpose that still waits is dropped.
    pub(crate) fn push(&mut self, command: VehicleCommand) {
        self.waiting.retain(|old| !command.replaces(old));
        self.waiting.push_back(command);
    }

    /// Drops all steering commands, because control has changed.
    pub(crate) fn drop_steering(&mut self) {
        self.waiting.retain(|c| !c.steers());
        self.pending.retain(|p| !p.command.steers());
    }

    /// Drops the modes that are asked for: the vehicle has gone on to another.
    pub(crate) fn drop_modes(&mut self) {
        let mode = |c: &VehicleCommand| matches!(c, VehicleCommand::Mode { .. });
        self.waiting.retain(|c| !mode(c));
        self.pending.retain(|p| !mode(&p.command));
    }

    /// Drops everything.
    pub(crate) fn clear(&mut self) {
        self.waiting.clear();
        self.pending.clear();
    }

    /// What is to be sent at `now` (with how often it was sent before) and what is given up.
    /// A mode is asked for again only if `heartbeat_at` is later than the last time it was sent:
    /// the caller has then seen that the vehicle is still in the old one.
    pub(crate) fn due(
        &mut self,
        now: SimTime,
        timeout_s: f64,
        attempts: u32,
        heartbeat_at: Option<SimTime>,
    ) -> (Vec<(VehicleCommand, u32)>, Vec<CommandOutcome>) {
        let (mut send, mut lost) = (Vec::new(), Vec::new());
        let waiting = &self.waiting;
        self.pending.retain_mut(|p| {
            if now.since_s(p.sent_at) < timeout_s {
                return true;
            }
            // A newer command waits: repeating the old one would only delay it.
            if waiting.iter().any(|newer| newer.replaces(&p.command)) {
                return false;
            }
            if p.sent >= p.command.attempts(attempts) {
                lost.push(CommandOutcome::Unanswered(p.command.clone()));
                return false;
            }
            // Repeated blindly, a mode request could undo what a pilot has chosen in between.
            if matches!(p.command, VehicleCommand::Mode { .. }) && heartbeat_at <= Some(p.sent_at) {
                return true;
            }
            send.push((p.command.clone(), p.sent));
            p.sent += 1;
            p.sent_at = now;
            true
        });
        let mut kept = VecDeque::new();
        for command in std::mem::take(&mut self.waiting) {
            // An acknowledgement names only the kind: two of a kind on the way could not be told
            // apart.
            let busy = |p: &Pending| match command.kind() {
                None => p.command == command,
                kind => p.command.kind() == kind,
            };
            if self.pending.iter().any(busy) {
                kept.push_back(command);
            } else {
                send.push((command.clone(), 0));
                self.pending.push(Pending {
                    command,
                    sent_at: now,
                    sent: 1,
                });
            }
        }
        self.waiting = kept;
        (send, lost)
    }

    /// Receives an acknowledgement.
    pub(crate) fn acknowledge(
        &mut self,
        kind: MavCmd,
        result: MavResult,
        now: SimTime,
    ) -> Option<CommandOutcome> {
        let at = self
            .pending
            .iter()
            .position(|p| p.command.kind() == Some(kind))?;
        match result {
            MavResult::MAV_RESULT_ACCEPTED => {
                Some(CommandOutcome::Accepted(self.pending.remove(at).command))
            }
            MavResult::MAV_RESULT_IN_PROGRESS => {
                self.pending[at].sent_at = now;
                None
            }
            // Sent again after the time-out, as if unanswered.
            MavResult::MAV_RESULT_TEMPORARILY_REJECTED => None,
            refused => Some(CommandOutcome::Refused(
                self.pending.remove(at).command,
                refused,
            )),
        }
    }

    /// Whether a place is on its way to the vehicle.
    pub(crate) fn repositions(&self) -> bool {
        let place = |c: &VehicleCommand| matches!(c, VehicleCommand::Reposition { .. });
        self.waiting.iter().any(place) || self.pending.iter().any(|p| place(&p.command))
    }

    /// The vehicle shows `mode`: that is an answer, too.
    pub(crate) fn mode_seen(&mut self, shown: u32) {
        self.pending
            .retain(|p| !matches!(p.command, VehicleCommand::Mode { mode, .. } if mode == shown));
    }

    /// Receives the value of a parameter.
    pub(crate) fn parameter_seen(&mut self, seen: &str, is: f64) {
        self.pending.retain(|p| match p.command {
            VehicleCommand::Parameter(name) => name != seen,
            VehicleCommand::SetParameter { name, value } => (name, value) != (seen, is),
            _ => true,
        });
    }

    /// Forgets a command that was not sent after all.
    pub(crate) fn forget(&mut self, command: &VehicleCommand) {
        self.pending.retain(|p| p.command != *command);
    }
}
