//! Where the team may fly: geofence, height band, which may follow the terrain, and a keep-out cylinder around
//! every stack.
//!
//! A setpoint is safe when it lies inside all of them by a margin that leaves room for the turn
//! and the orbit around it, and when the straight leg to it is safe too.

use crate::Scenario;
use crate::ground::Ground;
use crate::world::WorldError;
use air::area::{distance_to_segment_m, edges, is_inside};
use air::geo::{Enu, Geodetic, LocalFrame, Position};
use air::terrain::Terrain;
use std::sync::Arc;

/// Set-points keep this far from every edge of the fence and from every keep-out, m: room for a turn and
/// for the orbit around the set-point.
pub const SETPOINT_MARGIN_M: f64 = 120.0;
/// Corners of the polygon of via-points around a keep-out circle.
const CIRCLE_CORNERS: usize = 16;
/// How much farther than the margin via-points lie, so that legs between them are not on the
/// very edge, m.
const SLACK_M: f64 = 1.0;
/// A way over terrain is looked at in steps of this, m.
const LOOK_M: f64 = 60.0;
/// Shortest level part of a way over terrain, m: setpoints count as reached 120 m before them (`sc`).
const LEAST_PART_M: f64 = 240.0;
/// Climb over the way made, which every vehicle is able to: 2 m/s at 28 m/s over ground.
const CLIMB_GRADIENT: f64 = 0.07;
/// A vehicle this far below where it has to be climbs where it is before it goes on, m.
const TOO_LOW_M: f64 = 12.0;

/// Where the team may fly. Heights are metres above mean sea level.
#[derive(Debug, Clone)]
pub struct Airspace {
    frame: LocalFrame,
    polygon: Vec<Enu>,
    /// Over the site's ground, or over the lowest and the highest of terrain.
    floor_amsl_m: f64,
    ceiling_amsl_m: f64,
    floor_agl_m: f64,
    ceiling_agl_m: f64,
    follows_terrain: bool,
    /// Where the height band follows the terrain.
    ground: Option<Arc<Ground>>,
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
            floor_agl_m: fence.floor_agl_m,
            ceiling_agl_m: fence.ceiling_agl_m,
            follows_terrain: fence.follows_terrain,
            ground: None,
            stacks: scenario.sources.iter().map(stack).collect(),
            keep_out_m: fence.keep_out_radius_m,
        })
    }

    /// The same airspace over terrain: where the fence follows it, the height band does so from now on.
    #[must_use]
    pub fn over(mut self, terrain: &Terrain) -> Self {
        if !self.follows_terrain {
            return self;
        }
        let (low, high) = self.bounds();
        let ground = Ground::new(terrain, &self.frame, low.at, high.at, SETPOINT_MARGIN_M);
        let (lowest_m, highest_m) = ground.range_amsl_m();
        self.floor_amsl_m = lowest_m + self.floor_agl_m;
        self.ceiling_amsl_m = highest_m + self.ceiling_agl_m;
        self.ground = Some(Arc::new(ground));
        self
    }

    /// Whether floor and ceiling follow the terrain.
    pub fn follows_terrain(&self) -> bool {
        self.ground.is_some()
    }

    /// Lowest and highest height of a setpoint at a place, m above mean sea level. Where they follow the terrain
    /// the floor counts from the highest ground within [`SETPOINT_MARGIN_M`], and goes before the ceiling.
    pub fn heights_at_amsl_m(&self, at: Enu) -> (f64, f64) {
        let Some(ground) = &self.ground else {
            return (self.floor_amsl_m, self.ceiling_amsl_m);
        };
        let (here_m, highest_m) = ground.at_amsl_m(at);
        let floor_m = highest_m + self.floor_agl_m;
        (floor_m, floor_m.max(here_m + self.ceiling_agl_m))
    }

    /// `height_amsl_m` brought between floor and ceiling at a place.
    pub fn clamp_at_m(&self, at: Enu, height_amsl_m: f64) -> f64 {
        let (floor_m, ceiling_m) = self.heights_at_amsl_m(at);
        height_amsl_m.clamp(floor_m, ceiling_m)
    }

    /// Whether who is ordered to `to` and is at a height there may go on to the next part of a way: over terrain
    /// only from high enough.
    pub fn is_high_enough(&self, height_amsl_m: f64, to: Position) -> bool {
        self.ground.is_none() || height_amsl_m > to.height_m - TOO_LOW_M
    }

    /// The setpoints of a way from `from` along `corners` to its end at `height_amsl_m`, leg by leg: each corner at
    /// that height, and over terrain level parts that keep between floor and ceiling all along, each begun so
    /// early that a vehicle that climbs 7 m in 100 is never below the floor. Who is too low climbs first where
    /// it is.
    pub fn way(&self, from: Position, corners: &[Enu], height_amsl_m: f64) -> Vec<Vec<Position>> {
        let level = |at: &Enu| Position {
            at: *at,
            height_m: height_amsl_m,
        };
        if self.ground.is_none() {
            return corners.iter().map(|at| vec![level(at)]).collect();
        }
        let looks = self.looks(from.at, corners);
        let mut legs = Vec::new();
        let mut leg = Vec::new();
        if from.height_m < looks[0].floor_m - TOO_LOW_M {
            leg.push(Position {
                at: from.at,
                height_m: looks[0].floor_m,
            });
        }
        let mut part = Part::default();
        for (before, look) in looks.iter().zip(&looks[1..]) {
            let longer = part.with(before).with(look);
            let fits = longer.floor_m <= longer.ceiling_m;
            if !fits && part.length_m >= LEAST_PART_M {
                leg.push(part.end(before.at, height_amsl_m));
                part = Part::default().with(before).with(look);
            } else {
                part = longer;
            }
            part.length_m += before.at.distance_m(look.at);
            if look.is_corner {
                leg.push(part.end(look.at, height_amsl_m));
                legs.push(std::mem::take(&mut leg));
                part = Part::default();
            }
        }
        // At the end it comes to the height that is wanted there.
        if let (Some(last), Some(end)) = (legs.last_mut(), corners.last()) {
            let arrives = last.last().is_some_and(|p| p.height_m == height_amsl_m);
            last.extend((!arrives).then(|| level(end)));
        }
        legs
    }

    /// Places along a way with what is asked of the height at each.
    fn looks(&self, from: Enu, corners: &[Enu]) -> Vec<Look> {
        let look = |at: Enu, is_corner: bool| {
            let (floor_m, ceiling_m) = self.heights_at_amsl_m(at);
            Look {
                at,
                floor_m,
                ceiling_m,
                is_corner,
            }
        };
        let mut looks = vec![look(from, false)];
        let mut start = from;
        for &corner in corners {
            let count = (start.distance_m(corner) / LOOK_M).ceil().max(1.0);
            for k in 1..count as usize {
                let share = k as f64 / count;
                let at = Enu {
                    east_m: start.east_m + share * (corner.east_m - start.east_m),
                    north_m: start.north_m + share * (corner.north_m - start.north_m),
                };
                looks.push(look(at, false));
            }
            looks.push(look(corner, true));
            start = corner;
        }
        // Looking ahead: high enough here to be high enough there.
        for k in (1..looks.len()).rev() {
            let climb_m = CLIMB_GRADIENT * looks[k - 1].at.distance_m(looks[k].at);
            let floor_m = looks[k - 1].floor_m.max(looks[k].floor_m - climb_m);
            looks[k - 1].floor_m = floor_m;
            looks[k - 1].ceiling_m = looks[k - 1].ceiling_m.max(floor_m);
        }
        looks
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

    /// Lowest and highest height of a setpoint anywhere, m above mean sea level.
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

    /// `height_amsl_m` brought into the band of all places.
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
        let (floor_m, ceiling_m) = self.heights_at_amsl_m(position.at);
        (floor_m..=ceiling_m).contains(&position.height_m)
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

/// A place on a way over terrain.
#[derive(Debug, Clone, Copy)]
struct Look {
    at: Enu,
    floor_m: f64,
    ceiling_m: f64,
    is_corner: bool,
}

/// A level part of a way, with what its places ask of its height.
#[derive(Debug, Clone, Copy)]
struct Part {
    length_m: f64,
    floor_m: f64,
    ceiling_m: f64,
}

impl Default for Part {
    fn default() -> Self {
        Self {
            length_m: 0.0,
            floor_m: f64::NEG_INFINITY,
            ceiling_m: f64::INFINITY,
        }
    }
}

impl Part {
    fn with(mut self, look: &Look) -> Self {
        self.floor_m = self.floor_m.max(look.floor_m);
        self.ceiling_m = self.ceiling_m.min(look.ceiling_m);
        self
    }

    /// Its end, as near to the height that is wanted as floor and then ceiling allow.
    fn end(&self, at: Enu, wanted_m: f64) -> Position {
        Position {
            at,
            height_m: wanted_m.min(self.ceiling_m).max(self.floor_m),
        }
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
