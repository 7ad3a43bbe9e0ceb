//! The way to one item, and when it is done.

use super::surroundings::{Place, Surroundings};
use crate::item_list::Item;
use crate::parameters::{AutopilotParameters, WP_LOITER_RAD, WP_RADIUS};
use air::geo::{Enu, wrap_signed_deg};
use fdm::autopilot::Path;
use mav_bridge::dialect::MavCmd;

/// An altitude counts as reached within this, m.
pub(super) const ALTITUDE_BAND_M: f64 = 5.0;
/// A circle counts as reached within this share of its radius.
const ON_CIRCLE: f64 = 0.3;
/// A circle is left when the course points to the next item within this, degrees; by as much more
/// as it goes round beyond what was asked.
const LINED_UP_DEG: f64 = 10.0;
/// Distance over ground speed at which ArduPlane's path controller turns by default (period 17 s,
/// damping .75), s.
const TURN_AHEAD_S: f64 = 4.06;
/// Turn after the last item, of which no other follows, degrees.
const LAST_TURN_DEG: f64 = 90.0;
/// Distance ahead on a leg that is aimed at, m.
const AIM_AHEAD_M: f64 = 60.0;
/// Shortest way from a waypoint to a landing that gives it a course, m; else it lands into the wind.
const LANDING_LEG_M: f64 = 100.0;

/// The way to one item.
#[derive(Debug, Clone)]
pub(super) struct Leg {
    from: Enu,
    /// Whether it began at a waypoint and not where the vehicle happened to be.
    from_waypoint: bool,
    pub to: Place,
    /// Course with which it began, degrees.
    pub began_course_deg: f64,
    /// Radius of its circle, m, positive clockwise.
    radius_m: f64,
    /// Turn at its end, degrees.
    turn_deg: f64,
    /// Where the item after it is.
    next: Option<Enu>,
    /// Bearing from the circle's centre, and how far it has gone round, degrees.
    bearing_deg: Option<f64>,
    turned_deg: f64,
    /// When the circle was reached, s.
    circles_since_s: Option<f64>,
}

impl Leg {
    pub(super) fn new(
        item: &Item,
        next: Option<&Item>,
        came_from: Option<Enu>,
        around: &Surroundings,
    ) -> Self {
        let from = came_from.unwrap_or(around.here().at);
        let mut to = around.place(item);
        if item.command == MavCmd::MAV_CMD_NAV_TAKEOFF {
            // Straight ahead, wherever its place may be.
            to.at = from;
        }
        let next = next
            .filter(|next| (next.x, next.y) != (0, 0))
            .map(|next| around.place(next).at);
        let beyond_m = f64::from(item.param3);
        if item.command == MavCmd::MAV_CMD_NAV_WAYPOINT && beyond_m > 0.0 {
            to.at = to.at.displaced(from.bearing_deg(to.at), beyond_m);
        }
        let turn_deg = next.map_or(LAST_TURN_DEG, |next| {
            apart_deg(from.bearing_deg(to.at), to.at.bearing_deg(next))
        });
        Self {
            from,
            from_waypoint: came_from.is_some(),
            to,
            began_course_deg: around.course_deg(),
            radius_m: loiter_radius_m(item, around.parameters),
            turn_deg,
            next,
            bearing_deg: None,
            turned_deg: 0.0,
            circles_since_s: None,
        }
    }

    /// Distance along the leg, m, and across it, positive to the right.
    fn along_across_m(&self, at: Enu) -> (f64, f64) {
        let (sin, cos) = self.from.bearing_deg(self.to.at).to_radians().sin_cos();
        let (north, east) = (at.north_m - self.from.north_m, at.east_m - self.from.east_m);
        (north * cos + east * sin, east * cos - north * sin)
    }

    pub(super) fn across_m(&self, at: Enu) -> f64 {
        self.along_across_m(at).1
    }

    /// What is said once a waypoint is reached or passed; none before.
    pub(super) fn waypoint(
        &self,
        index: usize,
        item: &Item,
        around: &Surroundings,
    ) -> Option<String> {
        let here = around.here().at;
        let distance_m = here.distance_m(self.to.at);
        let [north, east, _] = around.sensed.vel_ned_m_s;
        let turn_m = (TURN_AHEAD_S * north.hypot(east)).min(around.parameters.get(WP_RADIUS));
        let accepted_m = match (item.param2 > 0.0, item.param3 > 0.0) {
            (true, _) => f64::from(item.param2),
            (_, true) => 0.0,
            // A straight passage is flown up to the point, a sharp turn begins before it.
            _ => turn_m * (self.turn_deg / LAST_TURN_DEG).min(1.0),
        };
        let (along_m, _) = self.along_across_m(here);
        let verb = if distance_m <= accepted_m {
            "Reached"
        } else if along_m >= self.from.distance_m(self.to.at) {
            "Passed"
        } else {
            return None;
        };
        Some(format!("{verb} waypoint #{index} dist {distance_m:.0}m"))
    }

    /// Goes round; whether the circle has been reached.
    fn circles(&mut self, around: &Surroundings) -> bool {
        let here = around.here().at;
        let off_m = (here.distance_m(self.to.at) - self.radius_m.abs()).abs();
        if self.circles_since_s.is_none() {
            if off_m > ON_CIRCLE * self.radius_m.abs() {
                return false;
            }
            self.circles_since_s = Some(around.time_s);
        }
        let bearing_deg = self.to.at.bearing_deg(here);
        let before_deg = self.bearing_deg.replace(bearing_deg).unwrap_or(bearing_deg);
        self.turned_deg +=
            wrap_signed_deg(bearing_deg - before_deg) * 1_f64.copysign(self.radius_m);
        true
    }

    /// Whether the course leads to the next item, so that the circle may be left; what it went
    /// round more than `asked_deg` makes it less particular.
    fn is_lined_up(&self, asked_deg: f64, around: &Surroundings) -> bool {
        let Some(next) = self.next else {
            return true;
        };
        let here = around.here().at;
        if next.distance_m(self.to.at) < self.radius_m.abs() {
            return true;
        }
        let more = ((self.turned_deg - asked_deg) / 360.0).floor().max(0.0);
        apart_deg(around.course_deg(), here.bearing_deg(next)) < LINED_UP_DEG * (1.0 + more)
    }

    pub(super) fn has_turned(&mut self, turns: f64, around: &Surroundings) -> bool {
        let asked_deg = turns * 360.0;
        self.circles(around)
            && self.turned_deg > asked_deg.max(1.0)
            && self.is_lined_up(asked_deg, around)
    }

    pub(super) fn has_waited(&mut self, seconds: f64, around: &Surroundings) -> bool {
        if !self.circles(around) {
            return false;
        }
        let since_s = self.circles_since_s.unwrap_or(around.time_s);
        around.time_s - since_s > seconds && self.is_lined_up(self.turned_deg, around)
    }

    pub(super) fn is_at_altitude(&mut self, around: &Surroundings) -> bool {
        let off_m = (around.sensed.alt_amsl_m - self.to.alt_amsl_m).abs();
        self.circles(around)
            && off_m <= ALTITUDE_BAND_M
            && self.is_lined_up(self.turned_deg, around)
    }

    /// Along the straight line of the leg.
    pub(super) fn straight(&self, around: &Surroundings) -> Path {
        let here = around.here().at;
        let length_m = self.from.distance_m(self.to.at);
        let (along_m, _) = self.along_across_m(here);
        let course_deg = self.from.bearing_deg(self.to.at);
        let aim_m = (along_m + AIM_AHEAD_M).min(length_m);
        let aim = self.from.displaced(course_deg, aim_m.max(0.0));
        Path::Course {
            deg: here.bearing_deg(aim),
        }
    }

    pub(super) fn circle(&self) -> Path {
        Path::Orbit {
            north_m: self.to.at.north_m,
            east_m: self.to.at.east_m,
            radius_m: self.radius_m.abs().max(1.0),
            clockwise: self.radius_m >= 0.0,
        }
    }

    /// The landing: along the leg, if it is long enough to tell a course. Its altitude is that of the
    /// touch-down.
    pub(super) fn landing(&self) -> Path {
        let is_long = self.from.distance_m(self.to.at) >= LANDING_LEG_M;
        Path::Land {
            north_m: self.to.at.north_m,
            east_m: self.to.at.east_m,
            ground_amsl_m: self.to.alt_amsl_m,
            course_deg: (is_long && self.from_waypoint).then(|| self.from.bearing_deg(self.to.at)),
        }
    }
}

/// Radius of the circle of an item, m, positive clockwise.
fn loiter_radius_m(item: &Item, parameters: &AutopilotParameters) -> f64 {
    let usual_m = parameters.get(WP_LOITER_RAD);
    let asked_m = f64::from(match item.command {
        MavCmd::MAV_CMD_NAV_LOITER_TO_ALT => item.param2,
        _ => item.param3,
    });
    // Of a circle for some time ArduPlane keeps the sense alone.
    let has_radius = item.command != MavCmd::MAV_CMD_NAV_LOITER_TIME && asked_m.abs() >= 1.0;
    if has_radius {
        asked_m
    } else if asked_m < 0.0 {
        -usual_m.abs()
    } else {
        usual_m
    }
}

/// Degrees between two courses, without sign.
fn apart_deg(a: f64, b: f64) -> f64 {
    wrap_signed_deg(a - b).abs()
}
