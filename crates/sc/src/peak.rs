//! The highest place of a model that may be flown to.

use air::geo::Enu;
use air::wind::{WindProfile, towards_deg};
use csea::Position;
use plume::{DispersionModel, DispersionSpec, Place, PlaceColumns, Strength};
use protocol::message::Model;

use crate::airspace::Airspace;

/// Distances beyond the keep-out of the rings of the grid, m.
const BEYOND_M: [f64; 11] = [
    0.0, 25.0, 75.0, 150.0, 300.0, 500.0, 800.0, 1200.0, 1800.0, 2600.0, 4000.0,
];
/// Directions of the grid.
const DIRECTIONS: usize = 360;
/// Heights of the grid.
const HEIGHTS: usize = 25;
/// Nearest distance to a stack that is looked at where there is no keep-out, m.
const NEAREST_M: f64 = 20.0;
/// The refinement ends at steps of this, m.
const FINEST_M: f64 = 0.1;

/// A place and the mean mole fraction there.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FieldMaximum {
    /// Where; height above mean sea level.
    pub position: Position,
    /// How much, background included, ppm.
    pub co2_ppm: f64,
}

/// The place of greatest mean mole fraction of `model` at `time_s` inside the fence and height
/// band and outside every keep-out; `None` where the airspace has no such place.
///
/// A grid of rings around each stack finds the basin (1° apart, which is less than σy of
/// any class), a pattern search (Hooke and Jeeves 1961) around the circle, along the radius and
/// in height refines to 0.1 m.
pub fn highest(model: &DispersionModel, airspace: &Airspace, time_s: f64) -> Option<FieldMaximum> {
    let points = airspace
        .stacks()
        .iter()
        .filter_map(|&stack| grid_search(model, airspace, stack, time_s));
    points
        .map(|point| refine(model, airspace, point, time_s))
        .max_by(|a, b| a.co2_ppm.total_cmp(&b.co2_ppm))
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

/// Mean mole fraction at a place of an airspace, ppm.
pub fn mean_ppm(
    model: &DispersionModel,
    airspace: &Airspace,
    position: Position,
    time_s: f64,
) -> f64 {
    let place = Place {
        east_m: position.at.east_m,
        north_m: position.at.north_m,
        height_agl_m: position.height_m - airspace.frame().ground_amsl_m,
    };
    model.mean_ppm(&place, time_s)
}

fn grid_search(
    model: &DispersionModel,
    airspace: &Airspace,
    stack: Enu,
    time_s: f64,
) -> Option<GridPoint> {
    let (floor_m, ceiling_m) = airspace.height_band_amsl_m();
    let height = |k: usize| floor_m + (ceiling_m - floor_m) * k as f64 / (HEIGHTS - 1) as f64;
    let nearest_m = airspace.keep_out_m().max(NEAREST_M);
    let mut points = Vec::new();
    for beyond_m in BEYOND_M {
        for k in 0..DIRECTIONS {
            let mut point = GridPoint {
                stack,
                bearing_deg: 360.0 * k as f64 / DIRECTIONS as f64,
                radius_m: nearest_m + beyond_m + 1e-6,
                height_m: floor_m,
                co2_ppm: f64::NEG_INFINITY,
            };
            if airspace.contains(point.position(), 0.0) {
                for level in 0..HEIGHTS {
                    point.height_m = height(level);
                    points.push(point);
                }
            }
        }
    }
    evaluate(model, airspace, &mut points, time_s);
    points
        .into_iter()
        .reduce(|best, l| if l.co2_ppm > best.co2_ppm { l } else { best })
}

fn evaluate(model: &DispersionModel, airspace: &Airspace, points: &mut [GridPoint], time_s: f64) {
    let at: Vec<Position> = points.iter().map(GridPoint::position).collect();
    let ground_m = airspace.frame().ground_amsl_m;
    let column = |f: &dyn Fn(&Position) -> f64| at.iter().map(f).collect::<Vec<f64>>();
    let east_m = column(&|p| p.at.east_m);
    let north_m = column(&|p| p.at.north_m);
    let height_agl_m = column(&|p| p.height_m - ground_m);
    let places = PlaceColumns {
        east_m: &east_m,
        north_m: &north_m,
        height_agl_m: &height_agl_m,
    };
    let mut ppm = Vec::new();
    // Columns of one length are never refused.
    if model.fill_mean_ppm(places, time_s, &mut ppm).is_ok() {
        for (point, co2_ppm) in points.iter_mut().zip(ppm) {
            point.co2_ppm = co2_ppm;
        }
    }
}

fn refine(
    model: &DispersionModel,
    airspace: &Airspace,
    first: GridPoint,
    time_s: f64,
) -> FieldMaximum {
    let mut best = first;
    let mut step_m = 40.0;
    while step_m > FINEST_M {
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
            next.height_m = airspace.clamp_height_m(next.height_m + up);
            next.co2_ppm = mean_ppm(model, airspace, next.position(), time_s);
            if next.co2_ppm > best.co2_ppm && airspace.contains(next.position(), 0.0) {
                best = next;
            }
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

/// The dispersion model of `base` as the world simulator's `model` has corrected it; none where the
/// model cannot be.
pub fn corrected(base: &DispersionSpec, model: &Model) -> Option<DispersionModel> {
    let mut spec = base.clone();
    spec.background_ppm = model.background_ppm.value;
    let first = spec.sources.first_mut()?;
    first.effective_height_agl_m = model.effective_height_agl_m.value;
    first.strength = Strength::CMax {
        excess_ppm: model.c_max_ppm.value,
        distance_m: model.c_max_distance_m.value,
    };
    spec.wind = WindProfile::new(
        model.wind_speed_m_s,
        model.effective_height_agl_m.value.max(1.0),
        towards_deg(model.axis_deg.value),
        spec.wind.exponent(),
    )
    .ok()?;
    spec.sigma_y_scale = model.sigma_y_scale.value;
    spec.sigma_z_scale = model.sigma_z_scale.value;
    for m in &model.mechanisms {
        let parameters: Vec<(&str, f64)> =
            m.parameters.iter().map(|(n, v)| (n.as_str(), *v)).collect();
        if let Ok(mechanism) = plume::Mechanism::new(&m.id, &parameters) {
            spec.mechanisms.push(mechanism);
        }
    }
    DispersionModel::new(spec).ok()
}
