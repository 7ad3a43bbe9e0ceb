//! Vehicles keep apart in height or in distance.
//!
//! Each vehicle's *corridor* is the straight leg from where it is to its setpoint, over the
//! heights between the two, and the orbit at its end. Two corridors are apart when everywhere
//! either the horizontal distance or the difference in height suffices, whatever the times at
//! which they are flown. A corridor shrinks as it is flown, so a pair that was apart stays so.

use csea::Position;

use air::area::distance_to_segment_m;
use scenario::airspace::distance_between_segments_m;

/// What two vehicles keep between them.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Separation {
    /// This horizontal distance, m, or else …
    pub distance_m: f64,
    /// … this difference in height, m.
    pub height_m: f64,
}

/// Where one vehicle may be until it reaches its setpoint, and around it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Corridor {
    /// Where it is.
    pub from: Position,
    /// Its setpoint.
    pub to: Position,
    /// Radius of its orbit, m.
    pub orbit_m: f64,
}

impl Corridor {
    fn heights_m(&self) -> (f64, f64) {
        let (a, b) = (self.from.height_m, self.to.height_m);
        (a.min(b), a.max(b))
    }
}

impl Separation {
    /// Whether two places are apart.
    pub fn holds(&self, a: Position, b: Position) -> bool {
        a.at.distance_m(b.at) >= self.distance_m || (a.height_m - b.height_m).abs() >= self.height_m
    }

    /// Whether two corridors are apart.
    pub fn apart(&self, a: &Corridor, b: &Corridor) -> bool {
        let ((a_low, a_high), (b_low, b_high)) = (a.heights_m(), b.heights_m());
        let gap_m = (a_low - b_high).max(b_low - a_high);
        if gap_m >= self.height_m {
            return true;
        }
        // Leg to leg, each orbit to the other's leg, orbit to orbit: together all places where the
        // two can be.
        let clear = |room_m: f64, actual_m: f64| actual_m >= self.distance_m + room_m;
        clear(
            0.0,
            distance_between_segments_m(a.from.at, a.to.at, b.from.at, b.to.at),
        ) && clear(
            a.orbit_m,
            distance_to_segment_m(a.to.at, b.from.at, b.to.at),
        ) && clear(
            b.orbit_m,
            distance_to_segment_m(b.to.at, a.from.at, a.to.at),
        ) && clear(a.orbit_m + b.orbit_m, a.to.at.distance_m(b.to.at))
    }
}
