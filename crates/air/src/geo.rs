//! The local frame: WGS84 latitude and longitude to metres east and north of the site's origin.
//!
//! East and north are those of the tangent plane that touches the WGS84 ellipsoid at the
//! origin, for the point's foot on the ellipsoid (height zero). Heights are kept apart, above
//! mean sea level: the plane's own "up" would sink 0.8 m at 3 km, which a height above ground
//! must not. The geoid's undulation is taken as constant over the site.

use std::f64::consts::{PI, TAU};

/// Semi-major axis of the WGS84 ellipsoid, m.
pub(crate) const SEMI_MAJOR_M: f64 = 6_378_137.0;
/// Flattening of the WGS84 ellipsoid.
pub(crate) const FLATTENING: f64 = 1.0 / 298.257_223_563;
/// First eccentricity squared of the WGS84 ellipsoid.
const ECCENTRICITY_SQ: f64 = FLATTENING * (2.0 - FLATTENING);

/// A place on the ellipsoid.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Geodetic {
    /// Latitude, degrees, north positive.
    pub lat_deg: f64,
    /// Longitude, degrees, east positive.
    pub lon_deg: f64,
}

impl Geodetic {
    /// The place at a latitude and a longitude, degrees.
    pub const fn new(lat_deg: f64, lon_deg: f64) -> Self {
        Self { lat_deg, lon_deg }
    }
}

/// A place in the horizontal plane of a [`LocalFrame`].
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Enu {
    /// Metres east of the origin.
    pub east_m: f64,
    /// Metres north of the origin.
    pub north_m: f64,
}

impl Enu {
    /// The place so far east and north of the origin, m.
    pub const fn new(east_m: f64, north_m: f64) -> Self {
        Self { east_m, north_m }
    }

    /// Horizontal distance to `other`, m.
    pub fn distance_m(self, other: Enu) -> f64 {
        (self.east_m - other.east_m).hypot(self.north_m - other.north_m)
    }

    /// Bearing of `other` from here, degrees clockwise from north in `[0, 360)`.
    pub fn bearing_deg(self, other: Enu) -> f64 {
        wrap_deg(
            (other.east_m - self.east_m)
                .atan2(other.north_m - self.north_m)
                .to_degrees(),
        )
    }

    /// The place `distance_m` away along `bearing_deg`.
    pub fn displaced(self, bearing_deg: f64, distance_m: f64) -> Enu {
        let (sin, cos) = bearing_deg.to_radians().sin_cos();
        Enu {
            east_m: self.east_m + distance_m * sin,
            north_m: self.north_m + distance_m * cos,
        }
    }
}

/// The tangent plane at a site's origin, with the height of its ground.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LocalFrame {
    origin: Geodetic,
    /// Height of the ground at the origin above mean sea level, m.
    pub ground_amsl_m: f64,
    sin_lat: f64,
    cos_lat: f64,
    prime_vertical_m: f64,
    meridional_m: f64,
}

impl LocalFrame {
    /// A frame with its origin at `lat_deg`, `lon_deg`; `ground_amsl_m` is the ground there.
    ///
    /// # Errors
    /// Latitude outside ±89°, longitude outside ±180° or a height outside −500…9000 m.
    pub fn new(lat_deg: f64, lon_deg: f64, ground_amsl_m: f64) -> Result<Self, crate::AirError> {
        crate::in_range("latitude, degrees", lat_deg, -89.0, 89.0, "-89 to 89")?;
        crate::in_range("longitude, degrees", lon_deg, -180.0, 180.0, "-180 to 180")?;
        crate::in_range(
            "ground_amsl_m",
            ground_amsl_m,
            -500.0,
            9000.0,
            "-500 to 9000 m",
        )?;
        let (sin_lat, cos_lat) = lat_deg.to_radians().sin_cos();
        let w_sq = 1.0 - ECCENTRICITY_SQ * sin_lat * sin_lat;
        Ok(Self {
            origin: Geodetic { lat_deg, lon_deg },
            ground_amsl_m,
            sin_lat,
            cos_lat,
            prime_vertical_m: SEMI_MAJOR_M / w_sq.sqrt(),
            meridional_m: SEMI_MAJOR_M * (1.0 - ECCENTRICITY_SQ) / (w_sq * w_sq.sqrt()),
        })
    }

    /// The origin of the frame.
    pub fn origin(&self) -> Geodetic {
        self.origin
    }

    /// Metres east and north of the origin, exact for the point's foot on the ellipsoid.
    pub fn to_enu(&self, at: Geodetic) -> Enu {
        let (sin, cos) = at.lat_deg.to_radians().sin_cos();
        let d_lon = wrap_signed_deg(at.lon_deg - self.origin.lon_deg).to_radians();
        let radius = SEMI_MAJOR_M / (1.0 - ECCENTRICITY_SQ * sin * sin).sqrt();
        let (sin_d, cos_d) = d_lon.sin_cos();
        // ECEF differences turned into the origin's east and north axes.
        let along_x = radius * cos * cos_d - self.prime_vertical_m * self.cos_lat;
        let along_z =
            (1.0 - ECCENTRICITY_SQ) * (radius * sin - self.prime_vertical_m * self.sin_lat);
        Enu {
            east_m: radius * cos * sin_d,
            north_m: -self.sin_lat * along_x + self.cos_lat * along_z,
        }
    }

    /// The inverse of [`LocalFrame::to_enu`], to better than a tenth of a millimetre within 100 km.
    pub fn to_geodetic(&self, at: Enu) -> Geodetic {
        // Newton's method with the radii of curvature at the origin as the derivative: over a site they
        // change by less than a hundredth, so that each turn gains two digits or more.
        let mut guess = self.origin;
        for _ in 0..6 {
            let miss = self.to_enu(guess);
            let cos = guess.lat_deg.to_radians().cos();
            guess.lat_deg += ((at.north_m - miss.north_m) / self.meridional_m).to_degrees();
            guess.lon_deg +=
                ((at.east_m - miss.east_m) / (self.prime_vertical_m * cos)).to_degrees();
        }
        guess.lon_deg = wrap_signed_deg(guess.lon_deg);
        guess
    }
}

/// An angle in degrees brought into `[0, 360)`.
pub fn wrap_deg(angle_deg: f64) -> f64 {
    // A tiny negative angle is rounded up to 360 itself by the remainder.
    let wrapped = angle_deg.rem_euclid(360.0);
    if wrapped >= 360.0 { 0.0 } else { wrapped }
}

/// An angle in degrees brought into `(-180, 180]`.
pub fn wrap_signed_deg(angle_deg: f64) -> f64 {
    let wrapped = wrap_deg(angle_deg);
    if wrapped > 180.0 {
        wrapped - 360.0
    } else {
        wrapped
    }
}

/// An angle in radians brought into `[-π, π)`.
pub fn wrap_signed_rad(angle_rad: f64) -> f64 {
    (angle_rad + PI).rem_euclid(TAU) - PI
}

/// A place in space: horizontal metres of the local frame and a height.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Position {
    /// Metres east and north of the site's origin.
    pub at: Enu,
    /// Height, m, above any one datum that all positions of a use share.
    pub height_m: f64,
}

impl Position {
    /// Straight distance to `other`, m.
    pub fn distance_m(self, other: Self) -> f64 {
        self.at
            .distance_m(other.at)
            .hypot(self.height_m - other.height_m)
    }

    /// The place `east_m`, `north_m` of the origin at `height_m`.
    pub fn new(east_m: f64, north_m: f64, height_m: f64) -> Self {
        Self {
            at: Enu { east_m, north_m },
            height_m,
        }
    }

    /// East, north and height, m.
    pub fn coordinates(self) -> [f64; 3] {
        [self.at.east_m, self.at.north_m, self.height_m]
    }

    /// Of the same three.
    pub fn from_coordinates(c: [f64; 3]) -> Self {
        Self::new(c[0], c[1], c[2])
    }

    /// Whether no coordinate is infinite or not a number.
    pub fn is_finite(self) -> bool {
        self.coordinates().iter().all(|c| c.is_finite())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    // Oracle: pymap3d 3.1 `geodetic2enu(lat, lon, 0, 43.4417, -7.8631, 0)`, formula of ECEF
    // differences; the values below from a numpy script of the same textbook equations
    // (Hofmann-Wellenhof, GNSS, 2008, eq. 8.38): see tests/oracle/geodesy.py.
    #[test]
    fn agrees_with_textbook_ecef() {
        let frame = LocalFrame::new(43.4417, -7.8631, 340.0).unwrap();
        for (lat, lon, east, north) in ORACLE {
            let enu = frame.to_enu(Geodetic {
                lat_deg: lat,
                lon_deg: lon,
            });
            assert!((enu.east_m - east).abs() < 1e-3, "{enu:?}");
            assert!((enu.north_m - north).abs() < 1e-3, "{enu:?}");
        }
    }
    const ORACLE: [(f64, f64, f64, f64); 3] = include!("../../../tests/oracle/geodesy.in");

    proptest::proptest! {
        #[test]
        fn round_trip(lat in -70.0f64..70.0, lon in -180.0f64..180.0,
                      east in -5e4f64..5e4, north in -5e4f64..5e4) {
            let frame = LocalFrame::new(lat, lon, 0.0).unwrap();
            let there = Enu { east_m: east, north_m: north };
            let back = frame.to_enu(frame.to_geodetic(there));
            proptest::prop_assert!(back.distance_m(there) < 1e-4, "{back:?}");
        }
        #[test]
        fn bearing_and_displacement_agree(bearing in 0.0f64..360.0, d in 1.0f64..1e4) {
            let to = Enu::default().displaced(bearing, d);
            proptest::prop_assert!((Enu::default().distance_m(to) - d).abs() < 1e-8 * d);
            let miss = wrap_signed_deg(Enu::default().bearing_deg(to) - bearing);
            proptest::prop_assert!(miss.abs() < 1e-8);
        }
    }
}
