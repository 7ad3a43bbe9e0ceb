//! What differs between the firmwares that the stand-in emulates: the numbers of its modes, its type and its name.
//! Inside, modes have ArduPlane's numbers.

use crate::flight::{LAND, MODES};
use mav_bridge::arducopter;
use mav_bridge::arduplane::{FBWA, GUIDED, LOITER, RTL};
use mav_bridge::dialect::MavType;

/// A firmware.
#[derive(Debug, PartialEq)]
pub(crate) struct Firmware {
    /// Type of vehicle in the heartbeat.
    pub vehicle: MavType,
    /// Name and version as its banner has them.
    pub banner: &'static str,
    /// The modes that it has, with their names.
    pub modes: &'static [(u32, &'static str)],
    /// Numbers of modes on the wire and inside, where they differ.
    numbers: &'static [(u32, u32)],
}

/// ArduPlane.
static PLANE: Firmware = Firmware::plane(&MODES);

/// Number of ArduPlane's mode STABILIZE, flown by hand.
const BY_HAND: u32 = 2;

/// ArduCopter on a quadrotor. Missions are not emulated, and so neither is AUTO.
static COPTER: Firmware = Firmware::copter(
    &[
        (arducopter::STABILIZE, "Stabilize"),
        (arducopter::ALT_HOLD, "AltHold"),
        (arducopter::GUIDED, "Guided"),
        (arducopter::LOITER, "Loiter"),
        (arducopter::RTL, "RTL"),
        (arducopter::LAND, "Land"),
    ],
    &[
        (arducopter::STABILIZE, BY_HAND),
        (arducopter::ALT_HOLD, FBWA),
        (arducopter::GUIDED, GUIDED),
        (arducopter::LOITER, LOITER),
        (arducopter::RTL, RTL),
        (arducopter::LAND, LAND),
    ],
);

impl Firmware {
    /// ArduPlane with these of its modes.
    pub const fn plane(modes: &'static [(u32, &'static str)]) -> Self {
        Self {
            vehicle: MavType::MAV_TYPE_FIXED_WING,
            banner: "ArduPlane V4.8.0-dev (stand-in)",
            modes,
            numbers: &[],
        }
    }

    /// ArduCopter on a quadrotor with these of its modes; `numbers` maps them to the stand-in's own modes.
    pub const fn copter(
        modes: &'static [(u32, &'static str)],
        numbers: &'static [(u32, u32)],
    ) -> Self {
        Self {
            vehicle: MavType::MAV_TYPE_QUADROTOR,
            banner: "ArduCopter V4.8.0-dev (stand-in)",
            modes,
            numbers,
        }
    }

    /// The firmware of an aircraft: ArduCopter if it hovers, else ArduPlane.
    pub fn of(hovers: bool) -> &'static Self {
        if hovers { &COPTER } else { &PLANE }
    }

    /// The mode that a number on the wire means; none where it has no such mode.
    pub fn inside(&self, on_wire: u32) -> Option<u32> {
        if self.numbers.is_empty() {
            return Some(on_wire);
        }
        let known = self.numbers.iter().find(|(wire, _)| *wire == on_wire);
        known.map(|(_, inside)| *inside)
    }

    /// The number of a mode on the wire.
    pub fn on_wire(&self, inside: u32) -> u32 {
        let known = self.numbers.iter().find(|(_, mode)| *mode == inside);
        known.map_or(inside, |(wire, _)| *wire)
    }

    /// The name of a mode.
    pub fn mode_name(&self, inside: u32) -> &'static str {
        let number = self.on_wire(inside);
        let known = self.modes.iter().find(|(mode, _)| *mode == number);
        known.map_or("unknown", |(_, name)| name)
    }
}
