//! Areas on the local plane: polygons of corners, and how far from a segment a place is.

use crate::geo::Enu;

/// The edges of a polygon, each from one corner to the next.
pub fn edges(polygon: &[Enu]) -> impl Iterator<Item = (Enu, Enu)> + '_ {
    (0..polygon.len()).map(|i| (polygon[i], polygon[(i + 1) % polygon.len()]))
}

/// Whether `at` is inside the polygon: a ray towards east crosses its boundary an odd number of
/// times (even-odd rule).
pub fn is_inside(polygon: &[Enu], at: Enu) -> bool {
    edges(polygon).fold(false, |inside, (a, b)| {
        let spans = (a.north_m > at.north_m) != (b.north_m > at.north_m);
        let part = (at.north_m - a.north_m) / (b.north_m - a.north_m);
        inside ^ (spans && at.east_m < a.east_m + part * (b.east_m - a.east_m))
    })
}

/// Horizontal distance of `at` from the nearest edge of the polygon, m; negative outside it.
pub fn clearance_m(polygon: &[Enu], at: Enu) -> f64 {
    let to_edge = edges(polygon)
        .map(|(a, b)| distance_to_segment_m(at, a, b))
        .fold(f64::INFINITY, f64::min);
    if is_inside(polygon, at) {
        to_edge
    } else {
        -to_edge
    }
}

/// Distance of `at` from the segment `a`…`b`, m.
pub fn distance_to_segment_m(at: Enu, a: Enu, b: Enu) -> f64 {
    let (de, dn) = (b.east_m - a.east_m, b.north_m - a.north_m);
    let length_sq = de * de + dn * dn;
    if length_sq == 0.0 {
        return at.distance_m(a);
    }
    let along = (at.east_m - a.east_m) * de + (at.north_m - a.north_m) * dn;
    let part = (along / length_sq).clamp(0.0, 1.0);
    at.distance_m(Enu::new(a.east_m + part * de, a.north_m + part * dn))
}

#[cfg(test)]
mod tests {
    use super::*;

    const fn at(east_m: f64, north_m: f64) -> Enu {
        Enu::new(east_m, north_m)
    }

    /// An L: the square of 0 to 4 without its north-east quarter.
    const L: [Enu; 6] = [
        at(0.0, 0.0),
        at(4.0, 0.0),
        at(4.0, 2.0),
        at(2.0, 2.0),
        at(2.0, 4.0),
        at(0.0, 4.0),
    ];

    #[test]
    fn the_notch_of_an_l_is_outside() {
        assert!(is_inside(&L, at(1.0, 3.5)) && is_inside(&L, at(3.5, 1.0)));
        assert!(!is_inside(&L, at(3.0, 3.0)) && !is_inside(&L, at(-1.0, 1.0)));
    }

    #[test]
    fn clearance_is_signed_and_that_of_the_nearest_edge() {
        assert_eq!(clearance_m(&L, at(1.0, 1.5)), 1.0);
        assert_eq!(clearance_m(&L, at(3.0, 3.0)), -1.0);
        assert_eq!(clearance_m(&L, at(7.0, -4.0)), -5.0);
    }
}
