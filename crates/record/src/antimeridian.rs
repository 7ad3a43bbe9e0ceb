//! Lines and areas cut where longitude jumps from 180° to -180°: maps would draw the long way round.

/// Where longitude jumps, degrees.
const ANTIMERIDIAN_DEG: f64 = 180.0;
const TURN_DEG: f64 = 360.0;

/// A corner of a line or an area: longitude and latitude in degrees (WGS84), altitude in m.
pub type Corner = [f64; 3];

/// What stands in a line that may be cut.
pub trait OnLine: Clone {
    /// Its longitude, degrees.
    fn lon_deg(&self) -> f64;

    /// What stands at a `share` of the way to `next`, 0 to 1, its longitude said to be `lon_deg`.
    fn between(&self, next: &Self, share: f64, lon_deg: f64) -> Self;
}

impl OnLine for Corner {
    fn lon_deg(&self) -> f64 {
        self[0]
    }

    fn between(&self, next: &Self, share: f64, lon_deg: f64) -> Self {
        let along = |k: usize| self[k] + share * (next[k] - self[k]);
        [lon_deg, along(1), along(2)]
    }
}

/// The line in pieces, none of which crosses the antimeridian; where it is cut both pieces end on it.
pub fn pieces<P: OnLine>(line: &[P]) -> Vec<Vec<P>> {
    let mut pieces = Vec::new();
    let mut piece: Vec<P> = Vec::new();
    for point in line {
        if let Some(last) = piece.last()
            && let Some((share, end_deg)) = crossing(last.lon_deg(), point.lon_deg())
        {
            let (end, begin) = (
                last.between(point, share, end_deg),
                last.between(point, share, -end_deg),
            );
            piece.push(end);
            pieces.push(std::mem::replace(&mut piece, vec![begin]));
        }
        piece.push(point.clone());
    }
    if !piece.is_empty() {
        pieces.push(piece);
    }
    pieces
}

/// Where the short way between two longitudes crosses the antimeridian, if it does: the share of the way, and
/// the longitude at its end of the first piece.
fn crossing(from_deg: f64, to_deg: f64) -> Option<(f64, f64)> {
    let step_deg = to_deg - from_deg;
    if step_deg.abs() <= ANTIMERIDIAN_DEG {
        return None;
    }
    let end_deg = ANTIMERIDIAN_DEG.copysign(from_deg);
    let way_deg = step_deg - TURN_DEG.copysign(step_deg);
    Some((((end_deg - from_deg) / way_deg).clamp(0.0, 1.0), end_deg))
}

/// The area in parts, none of which crosses the antimeridian. Rings are not closed: their first corner does not
/// stand at the end once more.
pub fn areas(ring: &[Corner]) -> Vec<Vec<Corner>> {
    let mut unbroken: Vec<Corner> = Vec::with_capacity(ring.len());
    for &[lon_deg, lat_deg, alt_m] in ring {
        let near_deg = unbroken.last().map_or(lon_deg, |last| last[0]);
        let turns = ((near_deg - lon_deg) / TURN_DEG).round();
        unbroken.push([lon_deg + TURN_DEG * turns, lat_deg, alt_m]);
    }
    let parts = [-TURN_DEG, 0.0, TURN_DEG].map(|west_deg| {
        let kept = clipped(&unbroken, |lon_deg| lon_deg - west_deg + ANTIMERIDIAN_DEG);
        let kept = clipped(&kept, |lon_deg| ANTIMERIDIAN_DEG + west_deg - lon_deg);
        let moved = kept
            .into_iter()
            .map(|[lon, lat, alt]| [lon - west_deg, lat, alt]);
        moved.collect::<Vec<Corner>>()
    });
    // What only touches the antimeridian has no area there.
    let has_area = |part: &Vec<Corner>| part.iter().any(|c| c[0].abs() < ANTIMERIDIAN_DEG);
    parts.into_iter().filter(has_area).collect()
}

/// The part of an area where `inside` of the longitude is not below 0 (Sutherland & Hodgman 1974).
fn clipped(ring: &[Corner], inside: impl Fn(f64) -> f64) -> Vec<Corner> {
    let mut kept = Vec::new();
    for (k, corner) in ring.iter().enumerate() {
        let next = &ring[(k + 1) % ring.len()];
        let (a, b) = (inside(corner[0]), inside(next[0]));
        if a >= 0.0 {
            kept.push(*corner);
        }
        if (a > 0.0 && b < 0.0) || (a < 0.0 && b > 0.0) {
            let share = a / (a - b);
            kept.push(corner.between(next, share, corner[0] + share * (next[0] - corner[0])));
        }
    }
    kept
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn wrapped(lon_deg: f64) -> f64 {
        (lon_deg + 180.0).rem_euclid(360.0) - 180.0
    }

    proptest! {
        #[test]
        fn pieces_are_short_joined_and_hold_all(
            start in -180.0..180.0f64,
            steps in prop::collection::vec((-5.0..5.0f64, -1.0..1.0f64), 1..60),
        ) {
            let mut at = (start, 10.0);
            let mut line: Vec<Corner> = vec![[wrapped(start), 10.0, 100.0]];
            for (east, north) in steps {
                at = (at.0 + east, at.1 + north);
                line.push([wrapped(at.0), at.1, 100.0 + at.1]);
            }
            let cut = pieces(&line);
            for piece in &cut {
                for pair in piece.windows(2) {
                    prop_assert!((pair[1][0] - pair[0][0]).abs() <= 5.0 + 1e-9, "{pair:?}");
                }
            }
            for pair in cut.windows(2) {
                let (end, begin) = (pair[0][pair[0].len() - 1], pair[1][0]);
                prop_assert!(end[0] == -begin[0] && end[0].abs() == 180.0);
                prop_assert!(end[1..] == begin[1..]);
            }
            let kept: usize = cut.iter().map(Vec::len).sum();
            prop_assert_eq!(kept, line.len() + 2 * (cut.len() - 1));
        }

        /// The area by the shoelace formula is kept, whatever the middle's longitude.
        #[test]
        fn areas_keep_their_size(middle in -180.0..180.0f64, radius in 0.01..3.0f64) {
            let circle: Vec<Corner> = (0..40)
                .map(|k| f64::from(k) * std::f64::consts::TAU / 40.0)
                .map(|a| [wrapped(middle + radius * a.cos()), radius * a.sin(), 0.0])
                .collect();
            let size = |ring: &[Corner]| -> f64 {
                let next = ring.iter().cycle().skip(1);
                ring.iter().zip(next).map(|(a, b)| a[0] * b[1] - b[0] * a[1]).sum::<f64>() / 2.0
            };
            let parts = areas(&circle);
            let total: f64 = parts.iter().map(|p| size(p)).sum();
            let whole = 20.0 * radius * radius * (std::f64::consts::TAU / 40.0).sin();
            prop_assert!((total - whole).abs() < 1e-9 * (1.0 + 360.0 * radius), "{total} of {whole}");
            prop_assert!(parts.iter().flatten().all(|c| c[0].abs() <= 180.0));
            let crosses = 180.0 - middle.abs() < radius;
            prop_assert_eq!(parts.len() > 1, crosses && parts.len() > 1);
            prop_assert!(!crosses || parts.len() == 2 || 180.0 - middle.abs() > 0.95 * radius);
        }
    }

    #[test]
    fn a_line_is_cut_where_it_crosses() {
        let cut = pieces(&[[179.0, 0.0, 10.0], [-179.0, 2.0, 30.0]]);
        assert_eq!(
            cut,
            [
                vec![[179.0, 0.0, 10.0], [180.0, 1.0, 20.0]],
                vec![[-180.0, 1.0, 20.0], [-179.0, 2.0, 30.0]]
            ]
        );
    }
}
