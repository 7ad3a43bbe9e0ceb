//! Vehicles keep apart in height or in distance.
//!
//! Each vehicle's *corridor* is the leg from where it is to its setpoint, over the heights between
//! the two, with the turn towards it, and the orbit at its end. Two corridors are apart when
//! everywhere either the horizontal distance or the difference in height suffices, whatever the
//! times at which they are flown. A corridor shrinks as it is flown, so a pair that was apart stays
//! so.

use air::geo::{Enu, wrap_signed_deg};
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

/// A vehicle that has to turn by less than this flies straight on, degrees: it comes no farther off
/// its leg than the tolerance within which vehicles are planned apart.
const STRAIGHT_DEG: f64 = 20.0;

/// Where one vehicle may be until it reaches its setpoint, and around it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Corridor {
    /// Where it is, or, where it has to turn first, the centre of its turn.
    pub from: Position,
    /// Its setpoint.
    pub to: Position,
    /// How far it may be off the line between the two, m: the radius of its turn.
    pub aside_m: f64,
    /// Radius of its orbit, m.
    pub orbit_m: f64,
}

impl Corridor {
    /// The corridor of a vehicle that flies straight from `from` to `to`, and circles there.
    pub fn straight(from: Position, to: Position, orbit_m: f64) -> Self {
        Self {
            from,
            to,
            aside_m: 0.0,
            orbit_m,
        }
    }

    /// The corridor of a vehicle at `from` on the course `course_deg`, which turns towards `to` in
    /// a circle no wider than its orbit there. The turn, the tangent to the setpoint and every
    /// narrower turn lie between the circle and the setpoint.
    pub fn turning(from: Position, course_deg: f64, to: Position, orbit_m: f64) -> Self {
        let off_deg = wrap_signed_deg(from.at.bearing_deg(to.at) - course_deg);
        if off_deg.abs() < STRAIGHT_DEG {
            return Self::straight(from, to, orbit_m);
        }
        let centre = from
            .at
            .displaced(course_deg + 90.0 * off_deg.signum(), orbit_m);
        Self {
            from: Position { at: centre, ..from },
            to,
            aside_m: orbit_m,
            orbit_m,
        }
    }

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
        let legs_m = distance_between_segments_m(a.from.at, a.to.at, b.from.at, b.to.at);
        let orbit_to_leg_m =
            |at: Enu, leg: &Corridor| distance_to_segment_m(at, leg.from.at, leg.to.at);
        let clear = |room_m: f64, actual_m: f64| actual_m >= self.distance_m + room_m;
        clear(a.aside_m + b.aside_m, legs_m)
            && clear(a.orbit_m + b.aside_m, orbit_to_leg_m(a.to.at, b))
            && clear(b.orbit_m + a.aside_m, orbit_to_leg_m(b.to.at, a))
            && clear(a.orbit_m + b.orbit_m, a.to.at.distance_m(b.to.at))
    }
}
