//! Places in space.

use air::geo::Enu;

/// A place in space: horizontal metres of the local frame and a height.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Position {
    /// Metres east and north of the site's origin.
    pub at: Enu,
    /// Height, m, above any one datum that all positions of a search share.
    pub height_m: f64,
}

impl Position {
    /// The place `east_m`, `north_m` of the origin at `height_m`.
    pub fn new(east_m: f64, north_m: f64, height_m: f64) -> Self {
        Self {
            at: Enu { east_m, north_m },
            height_m,
        }
    }

    pub(crate) fn coordinates(self) -> [f64; 3] {
        [self.at.east_m, self.at.north_m, self.height_m]
    }

    pub(crate) fn from_coordinates(c: [f64; 3]) -> Self {
        Self::new(c[0], c[1], c[2])
    }

    pub(crate) fn is_finite(self) -> bool {
        self.coordinates().iter().all(|c| c.is_finite())
    }
}
