//! The ground under a fence, for an airspace that follows it.

use air::geo::{Enu, LocalFrame};
use air::terrain::Terrain;

/// Step of the grid, m: SRTM has a post every 30 or 90 m.
const STEP_M: f64 = 40.0;
/// Steps a side at most; a larger fence has longer ones.
const MOST_STEPS: f64 = 500.0;

/// Heights of the ground in cells over a box.
#[derive(Debug, Clone)]
pub(crate) struct Ground {
    low: Enu,
    step_m: f64,
    columns: usize,
    rows: usize,
    /// Row by row from the south: at the middle of each cell, and the highest within a radius of any place in it,
    /// m above mean sea level.
    heights_amsl_m: Vec<(f64, f64)>,
}

impl Ground {
    /// The ground of `terrain` from `low` to `high` and by `radius_m` beyond.
    pub(crate) fn new(
        terrain: &Terrain,
        frame: &LocalFrame,
        low: Enu,
        high: Enu,
        radius_m: f64,
    ) -> Self {
        let (east_m, north_m) = (high.east_m - low.east_m, high.north_m - low.north_m);
        let step_m = STEP_M.max((east_m.max(north_m) + 2.0 * radius_m) / MOST_STEPS);
        let low = Enu {
            east_m: low.east_m - radius_m,
            north_m: low.north_m - radius_m,
        };
        let count = |span_m: f64| ((span_m + 2.0 * radius_m) / step_m).ceil().max(1.0) as usize;
        let (columns, rows) = (count(east_m), count(north_m));
        let middle = |row: usize, column: usize| Enu {
            east_m: low.east_m + (column as f64 + 0.5) * step_m,
            north_m: low.north_m + (row as f64 + 0.5) * step_m,
        };
        let ground =
            |k: usize| terrain.ground_amsl_m(frame.to_geodetic(middle(k / columns, k % columns)));
        let at: Vec<f64> = (0..rows * columns).map(ground).collect();
        // A place is at most half a diagonal from its cell's middle, and so is the highest ground from a middle.
        let reach = ((radius_m + std::f64::consts::SQRT_2 * step_m) / step_m).ceil() as isize;
        let near = |i: isize, j: isize| ((i * i + j * j) as f64) <= (reach * reach) as f64;
        let highest = |k: usize| {
            let (row, column) = ((k / columns) as isize, (k % columns) as isize);
            let mut highest_m = at[k];
            for i in -reach..=reach {
                for j in (-reach..=reach).filter(|&j| near(i, j)) {
                    let (r, c) = (row + i, column + j);
                    if (0..rows as isize).contains(&r) && (0..columns as isize).contains(&c) {
                        highest_m = highest_m.max(at[r as usize * columns + c as usize]);
                    }
                }
            }
            (at[k], highest_m)
        };
        Self {
            heights_amsl_m: (0..at.len()).map(highest).collect(),
            low,
            step_m,
            columns,
            rows,
        }
    }

    /// Height of the ground near a place, and the highest within the radius, m above mean sea level; outside the
    /// box those at its edge.
    pub(crate) fn at_amsl_m(&self, at: Enu) -> (f64, f64) {
        let cell = |m: f64, count: usize| ((m / self.step_m).max(0.0) as usize).min(count - 1);
        let row = cell(at.north_m - self.low.north_m, self.rows);
        let column = cell(at.east_m - self.low.east_m, self.columns);
        self.heights_amsl_m[row * self.columns + column]
    }

    /// Lowest and highest ground, m above mean sea level.
    pub(crate) fn range_amsl_m(&self) -> (f64, f64) {
        let fold =
            |f: fn(f64, f64) -> f64, start| self.heights_amsl_m.iter().map(|h| h.0).fold(start, f);
        (
            fold(f64::min, f64::INFINITY),
            fold(f64::max, f64::NEG_INFINITY),
        )
    }
}
