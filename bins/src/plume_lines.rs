//! The plume of a model as lines of one concentration at several heights, for maps and scenes in three dimensions.

use air::geo::{Enu, Geodetic};
use protocol::message::Model;
use record::antimeridian::Corner;
use record::contour::{Grid, PlumeLine};
use record::export::foxglove::{PlumeShape, Slice};
use views::site::{MapPoint, SiteMap};

/// Heights at which lines are drawn: more hide each other.
const HEIGHTS: usize = 5;
/// Points of the grid along each side: 30 m apart in the reference mission's fence.
const SIDE: usize = 200;
/// Steps in which the plume is looked for from the ground to [`HIGHEST`] times its axis' height.
const LOOKS: usize = 60;
/// As far above ground as the plume is looked for, in heights of its axis.
const HIGHEST: f64 = 3.0;
/// Half of the drawn square without a fence, in distances at which the model states its concentration.
const REACH: f64 = 2.5;

/// A square of the map: its low corner and the length of a step, m.
struct Square {
    low: Enu,
    step_m: f64,
}

/// The lines of all levels that are shown, the lowest height first, and the cut through the middle of the plume.
pub fn of(site: &SiteMap, model: &Model) -> PlumeShape {
    let Some(stack) = site.stacks.first() else {
        return PlumeShape::default();
    };
    let source = site
        .frame
        .to_enu(Geodetic::new(stack.lat_deg, stack.lon_deg));
    let levels = site.shown.levels_ppm();
    let square = square(site, source, model);
    let heights = heights(site, source, model, levels[0]);
    let mut shape = PlumeShape::default();
    for (k, alt_amsl_m) in heights.into_iter().enumerate() {
        let grid = grid(site, model, &square, alt_amsl_m);
        let corner = |[column, row]: [f64; 2]| -> Corner {
            let at = site.frame.to_geodetic(Enu::new(
                square.low.east_m + column * square.step_m,
                square.low.north_m + row * square.step_m,
            ));
            [at.lon_deg, at.lat_deg, alt_amsl_m]
        };
        for excess_ppm in levels {
            let of_level = grid.lines(excess_ppm).into_iter().map(|line| PlumeLine {
                excess_ppm,
                corners: line.into_iter().map(corner).collect(),
            });
            shape.lines.extend(of_level);
        }
        if k == HEIGHTS / 2 {
            shape.slice = Some(Slice {
                excess_ppm: grid,
                low: square.low,
                step_m: square.step_m,
                alt_amsl_m,
            });
        }
    }
    shape
}

/// The square around the fence, or around the source where there is none.
fn square(site: &SiteMap, source: Enu, model: &Model) -> Square {
    let reach_m = REACH * model.c_max_distance_m.value.max(1.0);
    let corners = site
        .fence
        .iter()
        .map(|&(lat_deg, lon_deg)| site.frame.to_enu(Geodetic::new(lat_deg, lon_deg)));
    let corners: Vec<Enu> = corners.chain([source]).collect();
    let ends = |of: fn(&Enu) -> f64| {
        let (low, high) = corners
            .iter()
            .map(of)
            .fold((f64::MAX, f64::MIN), |(low, high), m| {
                (low.min(m), high.max(m))
            });
        if high > low {
            (low, high)
        } else {
            (low - reach_m, high + reach_m)
        }
    };
    let (east, north) = (ends(|c| c.east_m), ends(|c| c.north_m));
    let side_m = (east.1 - east.0).max(north.1 - north.0);
    let middle = |(low, high): (f64, f64)| (low + high) / 2.0;
    Square {
        low: Enu::new(middle(east) - side_m / 2.0, middle(north) - side_m / 2.0),
        step_m: side_m / (SIDE - 1) as f64,
    }
}

/// Altitudes spread over where the plume's axis has more than `excess_ppm` at the distance of its stated
/// concentration, m above mean sea level.
fn heights(site: &SiteMap, source: Enu, model: &Model, excess_ppm: f64) -> Vec<f64> {
    let at = source.displaced(model.axis_deg.value, model.c_max_distance_m.value);
    let ground_amsl_m = site.frame.ground_amsl_m;
    let step_m = HIGHEST * model.effective_height_agl_m.value / LOOKS as f64;
    let looks: Vec<MapPoint> = (0..=LOOKS)
        .map(|k| MapPoint {
            at,
            alt_amsl_m: ground_amsl_m + step_m * k as f64,
        })
        .collect();
    let limit_ppm = model.background_ppm.value + excess_ppm;
    let found = (site.field)(model, &looks);
    let inside = looks.iter().zip(found).filter(|(_, ppm)| *ppm >= limit_ppm);
    let inside: Vec<f64> = inside.map(|(look, _)| look.alt_amsl_m).collect();
    let (Some(low), Some(high)) = (inside.first(), inside.last()) else {
        return Vec::new();
    };
    (0..HEIGHTS)
        .map(|k| low + (high - low) * (k as f64 + 0.5) / HEIGHTS as f64)
        .collect()
}

fn grid(site: &SiteMap, model: &Model, square: &Square, alt_amsl_m: f64) -> Grid {
    let points: Vec<MapPoint> = (0..SIDE * SIDE)
        .map(|k| MapPoint {
            at: Enu::new(
                square.low.east_m + square.step_m * (k % SIDE) as f64,
                square.low.north_m + square.step_m * (k / SIDE) as f64,
            ),
            alt_amsl_m,
        })
        .collect();
    let background_ppm = model.background_ppm.value;
    let values = (site.field)(model, &points)
        .into_iter()
        .map(|ppm| ppm - background_ppm);
    Grid {
        columns: SIDE,
        values: values.collect(),
    }
}
