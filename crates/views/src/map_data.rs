//! What a page asks for to draw its map and its section: the plume and the ground on grids.

use crate::figure::Rounded;
use crate::site::{Area, Grid, MapPoint, SiteMap};
use air::geo::Enu;
use protocol::message::Model;
use serde::Deserialize;
use serde_json::{Value, json};

/// Most columns of a grid in a request: finer lines cannot be seen.
const MOST_COLUMNS: usize = 200;
/// Least and greatest width of the map that is drawn, m.
const WIDTHS_M: (f64, f64) = (20.0, 400_000.0);
/// Rows of a section.
const SECTION_ROWS: usize = 60;

/// A part of the map, m east and north of the site's origin, and how finely it shall be drawn.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize)]
pub(crate) struct MapView {
    west: f64,
    south: f64,
    east: f64,
    north: f64,
    columns: usize,
}

impl MapView {
    /// Its area and columns, if a map can be drawn of it.
    fn area(&self) -> Option<(Area, usize)> {
        let [width, height] = [self.east - self.west, self.north - self.south];
        let drawn = |m: &f64| (WIDTHS_M.0..=WIDTHS_M.1).contains(m);
        let place = |east_m, north_m| Enu { east_m, north_m };
        let ends = [self.west, self.south].iter().all(|m| m.is_finite());
        (ends && drawn(&width) && drawn(&height)).then(|| {
            let area = Area {
                low: place(self.west, self.south),
                high: place(self.east, self.north),
            };
            (area, self.columns.clamp(2, MOST_COLUMNS))
        })
    }
}

/// The plume at the height of its axis, where it is strongest, ppm above background; none for an empty area.
pub(crate) fn plume(site: &SiteMap, model: &Model, view: MapView) -> Option<Value> {
    let (area, columns) = view.area()?;
    let alt = site.axis_amsl_m(model);
    let grid = Grid::fill(area, columns, alt, |points| (site.field)(model, points));
    Some(json!({
        "grid": grid_json(&grid),
        "agl": alt - site.frame.ground_amsl_m,
        "values": excess(site, model, &grid.ppm),
    }))
}

/// Height of the ground, m above mean sea level, null where unknown; none for an empty area.
pub(crate) fn ground(site: &SiteMap, view: MapView) -> Option<Value> {
    let (area, columns) = view.area()?;
    let height = |points: &[MapPoint]| points.iter().map(|p| known(site, p.at)).collect();
    let grid = Grid::fill(area, columns, 0.0, height);
    Some(json!({
        "grid": grid_json(&grid),
        "values": grid.ppm.iter().map(|&m| Rounded::new(m, 1.0)).collect::<Vec<_>>(),
    }))
}

/// The upright plane through the first source along the plume's axis, that much of it.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize)]
pub(crate) struct SectionView {
    /// From and to so far from the source, m downwind.
    from: f64,
    to: f64,
    /// Lowest and highest altitude, m above mean sea level.
    low: f64,
    high: f64,
    columns: usize,
}

impl SectionView {
    fn is_drawn(&self) -> bool {
        let [width, height] = [self.to - self.from, self.high - self.low];
        let ends = [self.from, self.low].iter().all(|m| m.is_finite());
        let drawn = |m: f64| (WIDTHS_M.0..=WIDTHS_M.1).contains(&m);
        ends && drawn(width) && drawn(height)
    }
}

/// Plume and ground in the section; none for an empty section. Without a model, the ground alone
/// towards the north.
pub(crate) fn section(site: &SiteMap, model: Option<&Model>, view: SectionView) -> Option<Value> {
    if !view.is_drawn() {
        return None;
    }
    let columns = view.columns.clamp(2, MOST_COLUMNS);
    let source = site.stacks.first();
    let origin = source.map_or(Enu::default(), |s| site.enu(s.lat_deg, s.lon_deg));
    let axis_deg = model.map_or(0.0, |m| m.axis_deg.value);
    let step = |low: f64, high: f64, n: usize| (high - low) / (n - 1) as f64;
    let [across, up] = [
        step(view.from, view.to, columns),
        step(view.low, view.high, SECTION_ROWS),
    ];
    let places: Vec<Enu> = (0..columns)
        .map(|i| origin.displaced(axis_deg, view.from + across * i as f64))
        .collect();
    let ground = places.iter().map(|&at| Rounded::new(known(site, at), 1.0));
    let values = model.map(|model| {
        let rows = (0..SECTION_ROWS).map(|row| view.low + up * row as f64);
        let points: Vec<MapPoint> = rows
            .flat_map(|alt_amsl_m| places.iter().map(move |&at| MapPoint { at, alt_amsl_m }))
            .collect();
        excess(site, model, &(site.field)(model, &points))
    });
    Some(json!({
        "axis_deg": axis_deg,
        "e": origin.east_m, "n": origin.north_m,
        "from": view.from, "low": view.low, "across": across, "up": up,
        "columns": columns, "rows": SECTION_ROWS,
        "ground": ground.collect::<Vec<_>>(),
        "values": values,
    }))
}

/// The ground as far as it is known, m above mean sea level; elsewhere not a number, which is null in JSON.
fn known(site: &SiteMap, at: Enu) -> f64 {
    (site.known_ground_amsl_m)(at).unwrap_or(f64::NAN)
}

/// ppm above the model's background.
fn excess(site: &SiteMap, model: &Model, ppm: &[f64]) -> Vec<Rounded> {
    let per_ppm = 10.0 * site.shown.steps_per_ppm();
    let excess = ppm.iter().map(|p| p - model.background_ppm.value);
    excess.map(|ppm| Rounded::new(ppm, per_ppm)).collect()
}

fn grid_json(grid: &Grid) -> Value {
    let step = |axis: &[f64]| axis.get(1).zip(axis.first()).map(|(b, a)| b - a);
    json!({
        "e": grid.east_m.first(),
        "n": grid.north_m.first(),
        "step": step(&grid.east_m),
        "columns": grid.east_m.len(),
        "rows": grid.north_m.len(),
    })
}
