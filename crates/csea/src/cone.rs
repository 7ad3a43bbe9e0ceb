//! Which promising point a sampler takes: one that lies ahead of it.

use air::geo::wrap_signed_deg;
use rand::RngExt;
use rand::rngs::ChaCha8Rng;

use crate::strategy::PromisingPoint;
use air::geo::Position;

/// A random one of `points` whose bearing from `position` is within `cone_deg` (half angle,
/// 0…180) of `heading_deg` (degrees clockwise from north): a fast sampler that cannot turn on
/// the spot takes what lies ahead (Varela et al. 2014 use 45°).
///
/// Each point of the cone is equally likely. When none lies inside, the one with the least
/// angle off the heading is taken, the nearer of equals: the sampler turns no more than it
/// must. A point exactly overhead or below counts as ahead. `None` only for no points.
pub fn choose_within_cone(
    points: &[PromisingPoint],
    position: Position,
    heading_deg: f64,
    cone_deg: f64,
    rng: &mut ChaCha8Rng,
) -> Option<PromisingPoint> {
    let off_heading = |point: &PromisingPoint| {
        if point.position.at == position.at {
            return 0.0;
        }
        let bearing_deg = position.at.bearing_deg(point.position.at);
        wrap_signed_deg(bearing_deg - heading_deg).abs()
    };
    let ahead = points.iter().filter(|p| off_heading(p) <= cone_deg).count();
    if ahead > 0 {
        let pick = rng.random_range(0..ahead);
        return points
            .iter()
            .filter(|p| off_heading(p) <= cone_deg)
            .nth(pick)
            .copied();
    }
    points
        .iter()
        .min_by(|a, b| {
            let distance = |p: &PromisingPoint| p.position.at.distance_m(position.at);
            off_heading(a)
                .total_cmp(&off_heading(b))
                .then(distance(a).total_cmp(&distance(b)))
        })
        .copied()
}
