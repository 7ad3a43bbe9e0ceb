//! Lateral guidance: from a path over the ground to a bank angle, with the wind taken into
//! account.
//!
//! Orbits are flown by the vector field of Nelson, Barber, McLain & Beard (2007): the course is
//! the tangent, turned inwards or outwards by the arctangent of the distance error; the bank of
//! the steady circle is added.

use air::STANDARD_GRAVITY_M_S2;

use super::sensed::Sensed;
use crate::aircraft::ControlGains;
use crate::scalar::angle;

/// A point counts as reached within this many loiter radii.
pub(super) const CIRCLE_FROM: f64 = 1.1;
/// Time constant of the wind estimate, s.
const WIND_TIME_S: f64 = 5.0;
/// Distance ahead at which a line is joined, in seconds of flight.
const LINE_LOOK_AHEAD_S: f64 = 3.0;

/// Wind from the difference of velocity over ground and through the air.
#[derive(Debug, Clone, PartialEq, Default)]
pub(super) struct WindEstimate {
    vector: Option<[f64; 2]>,
}

impl WindEstimate {
    /// North and east components, m/s.
    pub fn vector(&self) -> [f64; 2] {
        self.vector.unwrap_or([0.0; 2])
    }

    pub fn update(&mut self, dt: f64, sensed: &Sensed) {
        let (sin, cos) = sensed.yaw_rad.sin_cos();
        let climb = sensed.vel_ned_m_s[2];
        // True airspeed points along the path through the air; what is left of it beside the climb
        // is its horizontal part, taken along the nose since sideslip is small.
        let level = (sensed.airspeed_m_s * sensed.airspeed_m_s - climb * climb)
            .max(0.0)
            .sqrt();
        let now = [
            sensed.vel_ned_m_s[0] - level * cos,
            sensed.vel_ned_m_s[1] - level * sin,
        ];
        let share = (dt / WIND_TIME_S).min(1.0);
        self.vector = Some(match self.vector {
            None => now,
            Some(old) => [
                old[0] + share * (now[0] - old[0]),
                old[1] + share * (now[1] - old[1]),
            ],
        });
    }
}

/// Guidance at one instant.
pub(super) struct Steering<'a> {
    pub gains: &'a ControlGains,
    /// Wind, north and east components, m/s.
    pub wind: [f64; 2],
    pub sensed: &'a Sensed,
}

impl Steering<'_> {
    /// Distance to a point over ground, m.
    pub fn distance_m(&self, north_m: f64, east_m: f64) -> f64 {
        let [n, e] = self.from(north_m, east_m);
        (n * n + e * e).sqrt()
    }

    /// Position relative to a point.
    fn from(&self, north_m: f64, east_m: f64) -> [f64; 2] {
        [self.sensed.north_m - north_m, self.sensed.east_m - east_m]
    }

    /// Whether the shorter turn around a point is to the right.
    pub fn turns_right_around(&self, north_m: f64, east_m: f64) -> bool {
        let [n, e] = self.from(north_m, east_m);
        let [vn, ve, _] = self.sensed.vel_ned_m_s;
        n * ve - e * vn >= 0.0
    }

    /// Bank towards a true heading.
    pub fn heading(&self, heading_rad: f64) -> f64 {
        self.bank(heading_rad, 0.0)
    }

    /// Bank towards a course over ground: the nose leads into the wind.
    pub fn course(&self, course_rad: f64) -> f64 {
        self.bank(self.heading_for(course_rad), 0.0)
    }

    /// Bank towards a point.
    pub fn go_to(&self, north_m: f64, east_m: f64) -> f64 {
        let [n, e] = self.from(north_m, east_m);
        self.course(angle(-e, -n))
    }

    /// Bank along the line through a point with a course.
    pub fn line(&self, north_m: f64, east_m: f64, course_rad: f64) -> f64 {
        let [n, e] = self.from(north_m, east_m);
        let (sin, cos) = course_rad.sin_cos();
        let right = e * cos - n * sin;
        let ahead = LINE_LOOK_AHEAD_S * self.sensed.airspeed_m_s.max(1.0);
        self.course(course_rad - angle(right, ahead))
    }

    /// Bank around a point.
    pub fn orbit(&self, north_m: f64, east_m: f64, radius_m: f64, clockwise: bool) -> f64 {
        let [n, e] = self.from(north_m, east_m);
        let distance = (n * n + e * e).sqrt();
        let sense = if clockwise { 1.0 } else { -1.0 };
        let off = (distance - radius_m) / radius_m;
        // Far outside the course points at the circle, on it along the tangent; the gain sets how
        // sharply it turns from one to the other.
        let inwards = angle(self.gains.orbit_gain * off, 1.0);
        let course = angle(e, n) + sense * (std::f64::consts::FRAC_PI_2 + inwards);
        let heading = self.heading_for(course);
        let [vn, ve, _] = self.sensed.vel_ned_m_s;
        // Steady circle: ground speed gives the curvature, lift acts across the heading.
        let crab = (course - heading).cos().max(0.3);
        let curvature = (vn * vn + ve * ve) / (radius_m * STANDARD_GRAVITY_M_S2 * crab);
        // The bank of the steady circle is right on the circle only; it fades out away from it,
        // where the course error leads.
        let near = (1.0 - 2.0 * off.abs()).max(0.0);
        self.bank(heading, sense * near * curvature)
    }

    /// Heading at which the wind carries the aircraft along a course; where the wind is stronger
    /// than the aircraft, the heading that loses least.
    fn heading_for(&self, course_rad: f64) -> f64 {
        let (sin, cos) = course_rad.sin_cos();
        let across = self.wind[1] * cos - self.wind[0] * sin;
        // A wind stronger than the airspeed has no such heading: bounded, the aircraft at least
        // loses least.
        let crab = (across / self.sensed.airspeed_m_s.max(1.0)).clamp(-0.9, 0.9);
        course_rad - angle(crab, (1.0 - crab * crab).sqrt())
    }

    /// Bank that turns the nose to a heading, on top of a steady turn of tan(bank) `steady`.
    fn bank(&self, heading_rad: f64, steady: f64) -> f64 {
        let (sin, cos) = (heading_rad - self.sensed.yaw_rad).sin_cos();
        let error = angle(sin, cos);
        let turn = self.gains.heading_bandwidth_rad_s * error;
        // A coordinated turn: tan(bank) = V ω / g.
        let tangent = self.sensed.airspeed_m_s * turn / STANDARD_GRAVITY_M_S2 + steady;
        angle(tangent, 1.0)
    }
}
