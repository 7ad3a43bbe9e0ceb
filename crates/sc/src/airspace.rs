//! Where the team may fly: geofence, height band and a keep-out cylinder around every stack.
//!
//! A setpoint is safe when it lies inside all of them by a margin that leaves room for the turn
//! and the orbit around it, and when the straight leg to it is safe too; [`RouteGraph::route`] goes
//! around what stands in the way.

use air::area::{distance_to_segment_m, edges, is_inside};
use air::geo::{Enu, Geodetic, LocalFrame};
use csea::Position;
use scenario::Scenario;

use crate::error::ScError;

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
    pub fn of(scenario: &Scenario) -> Result<Self, ScError> {
        let frame = scenario.frame()?;
        let fence = &scenario.fence;
        let stack = |s: &scenario::tables::Source| {
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
    fn via_points(&self, margin_m: f64) -> Vec<Enu> {
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

/// Ways through an airspace: via-points and which of the legs between them are clear, worked
/// out once.
#[derive(Debug, Clone)]
pub struct RouteGraph {
    margin_m: f64,
    nodes: Vec<Enu>,
    /// Row by row, whether the leg between two nodes is clear.
    clear: Vec<bool>,
}

impl RouteGraph {
    /// Ways that keep `margin_m` of clearance.
    pub fn of(airspace: &Airspace, margin_m: f64) -> Self {
        let nodes = airspace.via_points(margin_m);
        let legs = nodes
            .iter()
            .flat_map(|a| nodes.iter().map(move |b| (*a, *b)));
        let clear = legs
            .map(|(a, b)| airspace.leg_is_clear(a, b, margin_m))
            .collect();
        Self {
            margin_m,
            nodes,
            clear,
        }
    }

    /// A short way from `from` to `to`: the via-points and `to` itself, every leg clear by the
    /// margin (or, on the first leg, by what is left of it at `from`). From a place that is not
    /// allowed, the first via-point is the way out. `None` when `to` does not keep the margin or
    /// nothing leads there.
    pub fn route(&self, airspace: &Airspace, from: Enu, to: Enu) -> Option<Vec<Enu>> {
        if airspace.clearance_m(to) < self.margin_m {
            return None;
        }
        let left_m = airspace.clearance_m(from);
        if left_m < 0.0 {
            let out = airspace.nearest_allowed(from, self.margin_m)?;
            let mut route = vec![out];
            route.extend(self.route(airspace, out, to)?);
            return Some(route);
        }
        // From inside the margin the first leg cannot keep it; it must not come nearer than it is.
        let first_m = self.margin_m.min(left_m - 1e-6).max(0.0);
        if airspace.leg_is_clear(from, to, first_m) {
            return Some(vec![to]);
        }
        let reach = |end: Enu, margin_m: f64| -> Vec<bool> {
            let leg = |node: &Enu| airspace.leg_is_clear(end, *node, margin_m);
            self.nodes.iter().map(leg).collect()
        };
        self.shortest(from, to, &reach(from, first_m), &reach(to, self.margin_m))
    }

    /// Dijkstra (1959) over the via-points, from those in sight of the start to one in sight of
    /// the goal.
    fn shortest(&self, from: Enu, to: Enu, starts: &[bool], ends: &[bool]) -> Option<Vec<Enu>> {
        let count = self.nodes.len();
        let mut before = vec![None; count];
        let mut done = vec![false; count];
        let mut length: Vec<f64> = (0..count)
            .map(|i| {
                if starts[i] {
                    from.distance_m(self.nodes[i])
                } else {
                    f64::INFINITY
                }
            })
            .collect();
        let mut best: Option<(f64, usize)> = None;
        while let Some(next) = (0..count)
            .filter(|&i| !done[i] && length[i].is_finite())
            .min_by(|&a, &b| length[a].total_cmp(&length[b]))
        {
            done[next] = true;
            let whole = length[next] + self.nodes[next].distance_m(to);
            if ends[next] && best.is_none_or(|(shortest, _)| whole < shortest) {
                best = Some((whole, next));
            }
            for other in 0..count {
                let through = length[next] + self.nodes[next].distance_m(self.nodes[other]);
                if self.clear[next * count + other] && !done[other] && through < length[other] {
                    length[other] = through;
                    before[other] = Some(next);
                }
            }
        }
        let mut path = vec![to];
        let mut at = Some(best?.1);
        while let Some(node) = at {
            path.push(self.nodes[node]);
            at = before[node];
        }
        path.reverse();
        Some(path)
    }
}

/// Distance between the segments `a`…`b` and `c`…`d`, m; 0 where they cross.
pub(crate) fn distance_between_segments_m(a: Enu, b: Enu, c: Enu, d: Enu) -> f64 {
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
