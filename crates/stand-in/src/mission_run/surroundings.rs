//! What a mission is flown in: the vehicle's state, its home and the ground below.

use crate::home_position::HomePosition;
use crate::item_list::Item;
use crate::parameters::AutopilotParameters;
use crate::reality::Reality;
use air::geo::Enu;
use fdm::autopilot::Sensed;

/// A place in the site's plane with its altitude.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Place {
    pub at: Enu,
    pub alt_amsl_m: f64,
}

/// What surrounds a mission that is flown.
pub(crate) struct Surroundings<'a> {
    pub items: &'a [Item],
    pub sensed: &'a Sensed,
    pub home: HomePosition,
    pub parameters: &'a AutopilotParameters,
    pub reality: &'a Reality,
    pub time_s: f64,
}

impl Surroundings<'_> {
    pub(crate) fn here(&self) -> Place {
        Place {
            at: Enu::new(self.sensed.east_m, self.sensed.north_m),
            alt_amsl_m: self.sensed.alt_amsl_m,
        }
    }

    /// Course over ground, degrees.
    pub(crate) fn course_deg(&self) -> f64 {
        let [north, east, _] = self.sensed.vel_ned_m_s;
        if self.sensed.on_ground {
            self.sensed.yaw_rad.to_degrees()
        } else {
            east.atan2(north).to_degrees()
        }
    }

    /// Where an item is; one without a place is where the vehicle is, and one without an altitude
    /// as high.
    pub(crate) fn place(&self, item: &Item) -> Place {
        let here = self.here();
        let nowhere = (item.x, item.y) == (0, 0);
        let at = if nowhere {
            here.at
        } else {
            crate::fence::local((item.x, item.y), &self.reality.frame)
        };
        let ground_amsl_m = |at| self.reality.ground_at_amsl_m(at);
        let alt_amsl_m = if nowhere && item.z == 0.0 {
            here.alt_amsl_m
        } else {
            altitude_amsl_m(item.frame as u8, item.z, self.home, || ground_amsl_m(at))
                .unwrap_or(here.alt_amsl_m)
        };
        Place { at, alt_amsl_m }
    }
}

/// Altitude above mean sea level of one given in a frame of MAVLink; none for a frame without
/// altitude.
pub(crate) fn altitude_amsl_m(
    frame: u8,
    z_m: f32,
    home: HomePosition,
    ground_amsl_m: impl Fn() -> f64,
) -> Option<f64> {
    let z_m = f64::from(z_m);
    match frame {
        // GLOBAL and GLOBAL_INT
        0 | 5 => Some(z_m),
        // GLOBAL_RELATIVE_ALT and its INT form
        3 | 6 => Some(z_m + home.ground_amsl_m),
        // GLOBAL_TERRAIN_ALT and its INT form
        10 | 11 => Some(z_m + ground_amsl_m()),
        _ => None,
    }
}
