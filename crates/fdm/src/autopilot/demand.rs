//! What the autopilot shall do.

/// Where to fly over the ground.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Path {
    /// To a point, then around it at the loiter radius.
    GoTo {
        /// Metres north of the site's origin.
        north_m: f64,
        /// Metres east of the site's origin.
        east_m: f64,
    },
    /// Around a point.
    Orbit {
        /// Centre, metres north of the site's origin.
        north_m: f64,
        /// Centre, metres east of the site's origin.
        east_m: f64,
        /// Radius, m; one tighter than the aircraft can fly is flown as tight as the bank limit allows.
        radius_m: f64,
        /// Clockwise as seen from above.
        clockwise: bool,
    },
    /// With the nose to a true heading, drifting with the wind.
    Heading {
        /// True heading, degrees.
        deg: f64,
    },
    /// Over ground along a true course.
    Course {
        /// True course over ground, degrees.
        deg: f64,
    },
    /// From the launcher: straight ahead at full power, then on to the altitude demanded.
    TakeOff {
        /// True heading of the launch, degrees.
        heading_deg: f64,
    },
    /// Approach and land at a point.
    Land {
        /// Touch-down point, metres north of the site's origin.
        north_m: f64,
        /// Touch-down point, metres east of the site's origin.
        east_m: f64,
        /// Ground there, m above mean sea level.
        ground_amsl_m: f64,
        /// Course of the final approach, degrees; none: into the wind as estimated.
        course_deg: Option<f64>,
    },
}

impl Path {
    /// Whether every number of a path is finite (and a radius above 0).
    pub(super) fn is_finite(&self) -> bool {
        match *self {
            Self::GoTo { north_m, east_m } => north_m.is_finite() && east_m.is_finite(),
            Self::Orbit {
                north_m,
                east_m,
                radius_m,
                ..
            } => {
                north_m.is_finite() && east_m.is_finite() && radius_m.is_finite() && radius_m > 0.0
            }
            Self::Heading { deg } | Self::Course { deg } | Self::TakeOff { heading_deg: deg } => {
                deg.is_finite()
            }
            Self::Land {
                north_m,
                east_m,
                ground_amsl_m,
                course_deg,
            } => {
                let place = north_m.is_finite() && east_m.is_finite() && ground_amsl_m.is_finite();
                place && course_deg.is_none_or(f64::is_finite)
            }
        }
    }
}

/// What the autopilot shall do. Values that are not finite keep those before.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Demand {
    /// Where to fly over the ground.
    pub path: Path,
    /// At which altitude above mean sea level, m (not used by [`Path::Land`]).
    pub alt_amsl_m: f64,
    /// At which true airspeed, m/s; kept between the aircraft's limits.
    pub airspeed_m_s: f64,
}

impl Demand {
    /// The same with values of `before` in place of those that are not finite.
    pub(crate) fn or(&self, before: &Self) -> Self {
        let keep = |new: f64, old: f64| if new.is_finite() { new } else { old };
        Self {
            path: if self.path.is_finite() {
                self.path
            } else {
                before.path
            },
            alt_amsl_m: keep(self.alt_amsl_m, before.alt_amsl_m),
            airspeed_m_s: keep(self.airspeed_m_s, before.airspeed_m_s),
        }
    }
}

/// A pilot's sticks with the autopilot's stabilisation (fly by wire).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sticks {
    /// Bank, −1 (left) to 1 (right) of the bank limit.
    pub roll: f64,
    /// Pitch, −1 (down) to 1 (up) of the pitch limits.
    pub pitch: f64,
    /// Throttle, 0 to 1.
    pub throttle: f64,
}

impl Sticks {
    /// The same within −1 to 1; what is not finite is 0.
    pub(crate) fn limited(&self) -> Self {
        let limited = |value: f64| {
            if value.is_finite() {
                value.clamp(-1.0, 1.0)
            } else {
                0.0
            }
        };
        Self {
            roll: limited(self.roll),
            pitch: limited(self.pitch),
            throttle: limited(self.throttle),
        }
    }
}
