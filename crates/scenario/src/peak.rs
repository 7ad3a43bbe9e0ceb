//! The highest place of a model that may be flown to.

use crate::airspace::Airspace;
use air::geo::{Enu, Position};
use plume::{DispersionModel, Place};

/// Distances beyond the keep-out of the rings of the grid, m.
const BEYOND_M: [f64; 11] = [
    0.0, 25.0, 75.0, 150.0, 300.0, 500.0, 800.0, 1200.0, 1800.0, 2600.0, 4000.0,
];
/// Distances from its source of the places on a plume's axis from which the search begins, m.
const AXIS_M: [f64; 8] = [20.0, 100.0, 300.0, 600.0, 1000.0, 1500.0, 2500.0, 4000.0];
/// Directions of the grid.
const DIRECTIONS: usize = 360;
/// Heights of the grid.
const HEIGHTS: usize = 25;
/// Nearest distance to a stack that is looked at where there is no keep-out, m.
const NEAREST_M: f64 = 20.0;
/// The refinement begins at steps of this, m …
const FIRST_STEP_M: f64 = 40.0;
/// … and ends at steps of this, m.
const FINEST_M: f64 = 0.1;

/// A place and the mean mole fraction there.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FieldMaximum {
    /// Where; height above mean sea level.
    pub position: Position,
    /// How much, background included, ppm.
    pub co2_ppm: f64,
}

/// The place of greatest mole fraction `ppm` inside the fence and height band and outside every keep-out, by
/// `margin_m` from both; `None` where the airspace has no such place. `axes` are places on the axes of the
/// field's plumes, from which the search begins beside its grid: a plume thinner than the grid would be missed.
///
/// A grid of rings around each stack finds the basin (1° apart, which is less than σy of any class), a pattern
/// search (Hooke and Jeeves 1961) around the circle, along the radius and in height refines to 0.1 m.
pub fn highest(
    ppm: &dyn Fn(&Place) -> f64,
    axes: &[Place],
    airspace: &Airspace,
    margin_m: f64,
) -> Option<FieldMaximum> {
    let search = Search {
        ppm,
        airspace,
        margin_m,
    };
    let stacks = airspace.stacks().iter();
    let best = |points: Vec<GridPoint>| {
        points
            .into_iter()
            .reduce(|best, p| if p.co2_ppm > best.co2_ppm { p } else { best })
    };
    stacks
        .flat_map(|&stack| [best(search.grid(stack)), best(search.along(stack, axes))])
        .flatten()
        .map(|point| search.refine(point, FINEST_M))
        .max_by(|a, b| a.co2_ppm.total_cmp(&b.co2_ppm))
}

/// The highest place that uphill steps lead to from another, to `finest_m`; that place itself where no
/// set-point may go there.
pub fn climb(
    ppm: &dyn Fn(&Place) -> f64,
    from: Position,
    airspace: &Airspace,
    margin_m: f64,
    finest_m: f64,
) -> FieldMaximum {
    let search = Search {
        ppm,
        airspace,
        margin_m,
    };
    let stack = airspace.stacks().first().copied().unwrap_or_default();
    let start = GridPoint {
        stack,
        bearing_deg: stack.bearing_deg(from.at),
        radius_m: stack.distance_m(from.at),
        height_m: from.height_m,
        co2_ppm: f64::NEG_INFINITY,
    };
    let nowhere = FieldMaximum {
        position: from,
        co2_ppm: f64::NEG_INFINITY,
    };
    search
        .valued(start)
        .map_or(nowhere, |start| search.refine(start, finest_m))
}

/// The same of a model's mean field at a time.
pub fn highest_of(
    model: &DispersionModel,
    airspace: &Airspace,
    margin_m: f64,
    time_s: f64,
) -> Option<FieldMaximum> {
    let axes: Vec<Place> = AXIS_M
        .into_iter()
        .flat_map(|distance_m| model.on_axes(distance_m, time_s))
        .collect();
    highest(&|p| model.mean_ppm(p, time_s), &axes, airspace, margin_m)
}

/// A field, and where set-points may go in it.
struct Search<'a> {
    ppm: &'a dyn Fn(&Place) -> f64,
    airspace: &'a Airspace,
    margin_m: f64,
}

/// A place in rings around a stack.
#[derive(Debug, Clone, Copy)]
struct GridPoint {
    stack: Enu,
    bearing_deg: f64,
    radius_m: f64,
    height_m: f64,
    co2_ppm: f64,
}

impl GridPoint {
    fn position(&self) -> Position {
        Position {
            at: self.stack.displaced(self.bearing_deg, self.radius_m),
            height_m: self.height_m,
        }
    }
}

impl Search<'_> {
    /// The point with the field's value there; none where no set-point may go.
    fn valued(&self, mut point: GridPoint) -> Option<GridPoint> {
        let position = point.position();
        if !self.airspace.contains(position, self.margin_m) {
            return None;
        }
        point.co2_ppm = (self.ppm)(&Place {
            east_m: position.at.east_m,
            north_m: position.at.north_m,
            height_agl_m: position.height_m - self.airspace.frame().ground_amsl_m,
        });
        Some(point)
    }

    fn nearest_m(&self) -> f64 {
        (self.airspace.keep_out_m() + self.margin_m).max(NEAREST_M)
    }

    fn grid(&self, stack: Enu) -> Vec<GridPoint> {
        let mut points = Vec::new();
        for beyond_m in BEYOND_M {
            for k in 0..DIRECTIONS {
                let bare = GridPoint {
                    stack,
                    bearing_deg: 360.0 * k as f64 / DIRECTIONS as f64,
                    radius_m: self.nearest_m() + beyond_m + 1e-6,
                    height_m: 0.0,
                    co2_ppm: f64::NEG_INFINITY,
                };
                let at = bare.position().at;
                // Fence and keep-out are the same at all heights.
                if self.airspace.clearance_m(at) < self.margin_m {
                    continue;
                }
                let (floor_m, ceiling_m) = self.airspace.heights_at_amsl_m(at);
                let at_height = |level: usize| GridPoint {
                    height_m: floor_m + (ceiling_m - floor_m) * level as f64 / (HEIGHTS - 1) as f64,
                    ..bare
                };
                points.extend((0..HEIGHTS).filter_map(|level| self.valued(at_height(level))));
            }
        }
        points
    }

    /// Places on axes, as seen from a stack, at their own heights or the nearest of the band.
    fn along(&self, stack: Enu, axes: &[Place]) -> Vec<GridPoint> {
        let of = |place: &Place| {
            let at = Enu {
                east_m: place.east_m,
                north_m: place.north_m,
            };
            let ground_m = self.airspace.frame().ground_amsl_m;
            let point = GridPoint {
                stack,
                bearing_deg: stack.bearing_deg(at),
                // On the edge itself where the axis begins inside the keep-out.
                radius_m: stack.distance_m(at).max(self.nearest_m() + 1e-6),
                height_m: self.airspace.clamp_at_m(at, ground_m + place.height_agl_m),
                co2_ppm: f64::NEG_INFINITY,
            };
            self.valued(point)
        };
        axes.iter().filter_map(of).collect()
    }

    fn refine(&self, first: GridPoint, finest_m: f64) -> FieldMaximum {
        let mut best = first;
        let mut step_m = FIRST_STEP_M;
        while step_m > finest_m {
            let turn_deg = (step_m / best.radius_m).to_degrees();
            let moves = [
                (turn_deg, 0.0, 0.0),
                (-turn_deg, 0.0, 0.0),
                (0.0, step_m, 0.0),
                (0.0, -step_m, 0.0),
                (0.0, 0.0, step_m),
                (0.0, 0.0, -step_m),
            ];
            let before = best.co2_ppm;
            for (turn, out, up) in moves {
                let mut next = best;
                next.bearing_deg += turn;
                next.radius_m = (next.radius_m + out).max(NEAREST_M);
                let at = next.position().at;
                next.height_m = self.airspace.clamp_at_m(at, next.height_m + up);
                best = self
                    .valued(next)
                    .filter(|n| n.co2_ppm > best.co2_ppm)
                    .unwrap_or(best);
            }
            // No neighbour is better: the maximum lies within a step.
            if best.co2_ppm <= before {
                step_m *= 0.5;
            }
        }
        FieldMaximum {
            position: best.position(),
            co2_ppm: best.co2_ppm,
        }
    }
}
