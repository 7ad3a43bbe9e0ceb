//! Charge of the vehicle's batteries. Those that keep it in the air bring it home when they are low; a
//! payload's is only reported.

use crate::dialect::{BATTERY_STATUS_DATA, MavBatteryFunction};
use std::collections::BTreeMap;
use std::fmt;

/// Charge at which a battery is low, per cent.
const LOW_PCT: u8 = 20;
/// Two messages about one battery differ by this at most, per cent: they are whole numbers, sent within a second.
const ROUNDING_PCT: u8 = 1;

/// One battery, by the last message about it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Battery {
    /// Its id and function by BATTERY_STATUS; none: only SYS_STATUS has reported it.
    id: Option<(u8, MavBatteryFunction)>,
    /// Charge left, per cent.
    pub left_pct: u8,
}

impl Battery {
    /// Whether the vehicle flies by it: an autopilot that does not state a function means its main battery.
    pub(super) fn is_for_flight(&self) -> bool {
        use MavBatteryFunction as Function;
        self.id.is_none_or(|(_, function)| {
            matches!(
                function,
                Function::MAV_BATTERY_FUNCTION_UNKNOWN
                    | Function::MAV_BATTERY_FUNCTION_ALL
                    | Function::MAV_BATTERY_FUNCTION_PROPULSION
            )
        })
    }

    pub(super) fn is_low(&self) -> bool {
        self.left_pct <= LOW_PCT
    }
}

impl fmt::Display for Battery {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.id {
            None => write!(f, "the battery of SYS_STATUS"),
            Some((id, function)) => {
                let function = format!("{function:?}");
                let function = function.trim_start_matches("MAV_BATTERY_FUNCTION_");
                write!(f, "battery {id} (function {function})")
            }
        }
    }
}

/// The charge of one battery; none if unknown, which the vehicle reports as −1.
fn charge_pct(remaining: i8) -> Option<u8> {
    u8::try_from(remaining).ok()
}

/// All batteries that the vehicle has reported.
#[derive(Debug, Clone, Default)]
pub(super) struct Batteries {
    /// By SYS_STATUS, which has one battery without an id.
    unnamed_pct: Option<u8>,
    /// By BATTERY_STATUS, one message for each id.
    by_id: BTreeMap<u8, Battery>,
}

impl Batteries {
    /// Receives the charge of SYS_STATUS.
    pub(super) fn take_unnamed(&mut self, remaining: i8) {
        self.unnamed_pct = charge_pct(remaining);
    }

    /// Receives BATTERY_STATUS; returns its battery if the charge is known.
    pub(super) fn take(&mut self, status: &BATTERY_STATUS_DATA) -> Option<Battery> {
        let Some(left_pct) = charge_pct(status.battery_remaining) else {
            self.by_id.remove(&status.id);
            return None;
        };
        let battery = Battery {
            id: Some((status.id, status.battery_function)),
            left_pct,
        };
        self.by_id.insert(status.id, battery);
        Some(battery)
    }

    /// The lowest charge of the flight batteries; none if unknown.
    pub(super) fn lowest_for_flight(&self) -> Option<Battery> {
        let flight = self.by_id.values().filter(|b| b.is_for_flight());
        let named = flight.min_by_key(|b| b.left_pct).copied();
        let unnamed = self
            .unnamed_pct
            .map(|left_pct| Battery { id: None, left_pct });
        match (named, unnamed) {
            // SYS_STATUS repeats one of them, and the named one says which.
            (Some(named), Some(unnamed))
                if named.left_pct <= unnamed.left_pct.saturating_add(ROUNDING_PCT) =>
            {
                Some(Battery {
                    left_pct: named.left_pct.min(unnamed.left_pct),
                    ..named
                })
            }
            (named, unnamed) => unnamed.or(named),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use MavBatteryFunction as Function;

    fn status(id: u8, battery_function: Function, battery_remaining: i8) -> BATTERY_STATUS_DATA {
        BATTERY_STATUS_DATA {
            id,
            battery_function,
            battery_remaining,
            ..BATTERY_STATUS_DATA::default()
        }
    }

    #[test]
    fn the_lowest_of_those_that_it_flies_by_counts() {
        let mut batteries = Batteries::default();
        assert_eq!(batteries.lowest_for_flight(), None);
        batteries.take(&status(3, Function::MAV_BATTERY_FUNCTION_PAYLOAD, 5));
        batteries.take(&status(4, Function::MAV_BATTERY_FUNCTION_AVIONICS, 0));
        assert_eq!(batteries.lowest_for_flight(), None);
        batteries.take_unnamed(80);
        let told = |b: &Batteries| {
            let lowest = b.lowest_for_flight().unwrap();
            (lowest.to_string(), lowest.left_pct)
        };
        assert_eq!(
            told(&batteries),
            ("the battery of SYS_STATUS".to_owned(), 80)
        );
        for (id, function, left, name) in [
            (
                0,
                Function::MAV_BATTERY_FUNCTION_UNKNOWN,
                81,
                "battery 0 (function UNKNOWN)",
            ),
            (
                1,
                Function::MAV_BATTERY_FUNCTION_ALL,
                40,
                "battery 1 (function ALL)",
            ),
            (
                2,
                Function::MAV_BATTERY_FUNCTION_PROPULSION,
                12,
                "battery 2 (function PROPULSION)",
            ),
        ] {
            assert!(
                batteries
                    .take(&status(id, function, left))
                    .unwrap()
                    .is_for_flight()
            );
            assert_eq!(told(&batteries), (name.to_owned(), (left as u8).min(80)));
        }
        // One that the vehicle no longer knows does not count, and none that has no name is hidden by another.
        batteries.take(&status(2, Function::MAV_BATTERY_FUNCTION_PROPULSION, -1));
        batteries.take_unnamed(20);
        assert_eq!(
            told(&batteries),
            ("the battery of SYS_STATUS".to_owned(), 20)
        );
    }
}
