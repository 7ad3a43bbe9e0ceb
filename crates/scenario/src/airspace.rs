//! Where the team may fly: geofence, height band and a keep-out cylinder around every stack.
//!
//! A setpoint is safe when it lies inside all of them by a margin that leaves room for the turn
//! and the orbit around it, and when the straight leg to it is safe too.

use crate::Scenario;
use crate::world::WorldError;
use air::area::{distance_to_segment_m, edges, is_inside};
use air::geo::{Enu, Geodetic, LocalFrame, Position};

/// Set-points keep this far from every edge of the fence and from every keep-out, m: room for a turn and
/// for the orbit around the set-point.
pub const SETPOINT_MARGIN_M: f64 = 120.0;
/// Corners of the polygon of via-points around a keep-out circle.
const CIRCLE_CORNERS: usize = 16;
/// How much farther than the margin via-points lie, so that legs between them are not on the
/// very edge, m.
const SLACK_M: f64 = 1.0;

/// Where the team may fly. Heights are metres above mean sea level.
#[derive(Debug, Clone)]
pub struct Airspace {
    frame: LocalFrame,
    polygon: Vec<Enu>,
    floor_amsl_m: f64,
    ceiling_amsl_m: f64,
    stacks: Vec<Enu>,
    keep_out_m: f64,
}

impl Airspace {
    /// The airspace of a scenario.
    ///
    /// # Errors
    /// A fence that leaves nothing outside the keep-out, or a site outside the frame's validity.
    pub fn of(scenario: &Scenario) -> Result<Self, WorldError> {
        let frame = scenario.frame()?;
        let fence = &scenario.fence;
        let stack = |s: &crate::tables::SourceTable| {
            frame.to_enu(Geodetic {
                lat_deg: s.lat_deg,
                lon_deg: s.lon_deg,
            })
        };
        let ground = scenario.site.ground_amsl_m;
        Ok(Self {
            frame,
            polygon: scenario.fence_polygon()?,
            floor_amsl_m: ground + fence.floor_agl_m,
            ceiling_amsl_m: ground + fence.ceiling_agl_m,
            stacks: scenario.sources.iter().map(stack).collect(),
            keep_out_m: fence.keep_out_radius_m,
        })
    }

    /// The local frame.
    pub fn frame(&self) -> &LocalFrame {
        &self.frame
    }

    /// Corners of the fence.
    pub fn polygon(&self) -> &[Enu] {
        &self.polygon
    }

    /// The stacks.
    pub fn stacks(&self) -> &[Enu] {
        &self.stacks
    }

    /// Radius around every stack that no leg may enter, m.
    pub fn keep_out_m(&self) -> f64 {
        self.keep_out_m
    }

    /// Lowest and highest height of a setpoint, m above mean sea level.
    pub fn height_band_amsl_m(&self) -> (f64, f64) {
        (self.floor_amsl_m, self.ceiling_amsl_m)
    }

    /// Corners of the box around the fence and the height band.
    pub fn bounds(&self) -> (Position, Position) {
        let fold = |f: fn(f64, f64) -> f64, start: f64| {
            let each = |c: fn(&Enu) -> f64| self.polygon.iter().map(c).fold(start, f);
            (each(|e| e.east_m), each(|e| e.north_m))
        };
        let (low, high) = (
            fold(f64::min, f64::INFINITY),
            fold(f64::max, f64::NEG_INFINITY),
        );
        (
            Position::new(low.0, low.1, self.floor_amsl_m),
            Position::new(high.0, high.1, self.ceiling_amsl_m),
        )
    }

    /// `height_amsl_m` brought into the band.
    pub fn clamp_height_m(&self, height_amsl_m: f64) -> f64 {
        height_amsl_m.clamp(self.floor_amsl_m, self.ceiling_amsl_m)
    }

    /// Horizontal distance to the nearest edge of the fence or of a keep-out, m; negative by how
    /// far `at` is outside the fence or inside a keep-out.
    pub fn clearance_m(&self, at: Enu) -> f64 {
        let fence = air::area::clearance_m(&self.polygon, at);
        let stacks = self.stacks.iter();
        stacks
            .map(|stack| stack.distance_m(at) - self.keep_out_m)
            .fold(fence, f64::min)
    }

    /// Whether `position` is inside fence and height band and outside every keep-out, by at
    /// least `margin_m` horizontally.
    pub fn contains(&self, position: Position, margin_m: f64) -> bool {
        (self.floor_amsl_m..=self.ceiling_amsl_m).contains(&position.height_m)
            && self.clearance_m(position.at) >= margin_m
    }

    /// Whether the straight leg keeps `margin_m` of clearance all the way.
    pub fn leg_is_clear(&self, from: Enu, to: Enu, margin_m: f64) -> bool {
        let inside_fence = is_inside(&self.polygon, from)
            && is_inside(&self.polygon, to)
            && edges(&self.polygon)
                .all(|(a, b)| distance_between_segments_m(from, to, a, b) >= margin_m);
        let off_stacks = self
            .stacks
            .iter()
            .all(|&s| distance_to_segment_m(s, from, to) >= self.keep_out_m + margin_m);
        inside_fence && off_stacks
    }

    /// Corners around every keep-out, and inside every corner of the fence, that keep `margin_m`.
    pub fn via_points(&self, margin_m: f64) -> Vec<Enu> {
        // A polygon around the circle: its corners lie farther out, so that its edges keep the
        // margin.
        let radius_m = (self.keep_out_m + margin_m + SLACK_M)
            / (std::f64::consts::PI / CIRCLE_CORNERS as f64).cos();
        let around = self.stacks.iter().flat_map(|stack| {
            (0..CIRCLE_CORNERS)
                .map(move |k| stack.displaced(360.0 / CIRCLE_CORNERS as f64 * k as f64, radius_m))
        });
        let corners = self.polygon.iter().flat_map(|corner| {
            (0..8).map(move |k| corner.displaced(45.0 * f64::from(k), 1.5 * margin_m + SLACK_M))
        });
        around
            .chain(corners)
            .filter(|&p| self.clearance_m(p) >= margin_m)
            .collect()
    }

    /// The allowed place nearest to `at`, found by rings of growing radius and then by halving.
    pub fn nearest_allowed(&self, at: Enu, margin_m: f64) -> Option<Enu> {
        if self.clearance_m(at) >= margin_m {
            return Some(at);
        }
        let mut radius_m = 10.0;
        while radius_m < 1e5 {
            let ring = (0..72).map(|k| at.displaced(5.0 * f64::from(k), radius_m));
            let best = ring
                .filter(|&p| self.clearance_m(p) >= margin_m)
                .max_by(|a, b| self.clearance_m(*a).total_cmp(&self.clearance_m(*b)));
            if best.is_some() {
                return best;
            }
            radius_m *= 1.1;
        }
        None
    }
}

/// Distance between the segments `a`…`b` and `c`…`d`, m; 0 where they cross.
pub fn distance_between_segments_m(a: Enu, b: Enu, c: Enu, d: Enu) -> f64 {
    let side = |p: Enu, q: Enu, r: Enu| {
        (q.east_m - p.east_m) * (r.north_m - p.north_m)
            - (q.north_m - p.north_m) * (r.east_m - p.east_m)
    };
    let crosses = side(a, b, c) * side(a, b, d) < 0.0 && side(c, d, a) * side(c, d, b) < 0.0;
    if crosses {
        return 0.0;
    }
    [
        distance_to_segment_m(a, c, d),
        distance_to_segment_m(b, c, d),
        distance_to_segment_m(c, a, b),
        distance_to_segment_m(d, a, b),
    ]
    .into_iter()
    .fold(f64::INFINITY, f64::min)
}
