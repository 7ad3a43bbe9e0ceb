//! Sources that are areas: landfills, lagoons, pastures, ground that breathes.
//!
//! The plume of an area is the integral of the point source's over it (US EPA-454/B-95-003b, ISC3, volume II,
//! section 1.2.3; Turner 1970). Here the area is cut into about a hundred cells, and each emits its share from
//! its middle, spread over its own variance across the wind, so that neighbours meet without a gap. All that
//! holds for a stack's plume, mechanisms and puffs and vector instructions, therefore holds for each cell.
//!
//! At 25 m above the source and higher, where an aircraft may be, areas of a few hundred metres are right to 1 %
//! wherever there is a tenth of the greatest excess, and to 0.2 % of that elsewhere
//! (`tests/oracle/area_source.py`). Nearer the ground than a cell is wide, and above the area itself, the
//! cells show.

use crate::{PlumeError, in_range};

/// About how many cells an area is cut into: with fewer the error at 25 m exceeds 1 %.
const CELLS: f64 = 100.0;
/// Looks a side of a cell at whether it is inside the shape.
const LOOKS: usize = 8;
/// Longest and shortest side, m.
const MOST_M: f64 = 20_000.0;
const LEAST_M: f64 = 0.1;
/// An area longer than this many widths is a line, whose cells would all lie in a row.
const MOST_RATIO: f64 = 100.0;

/// Outline of an area.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Outline {
    /// Four corners.
    #[default]
    Rectangle,
    /// Length and width are its axes.
    Ellipse,
}

/// Ground that emits the same everywhere, centred on the source's place.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AreaSpec {
    /// Its form.
    pub outline: Outline,
    /// Along `axis_deg`, m.
    pub length_m: f64,
    /// Across it, m.
    pub width_m: f64,
    /// Direction of its length, degrees from north, clockwise.
    pub axis_deg: f64,
}

/// A part of an area.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Cell {
    /// Its middle from that of the area, m.
    pub(crate) east_m: f64,
    pub(crate) north_m: f64,
    /// Part of the whole emission.
    pub(crate) share: f64,
}

impl AreaSpec {
    /// Refuses what is no area; `name` is the source's.
    ///
    /// # Errors
    /// A side out of range, or a shape so thin that it is a line.
    pub(crate) fn validate(&self, name: &str) -> Result<(), PlumeError> {
        let of = |what: &str| format!("{what} of source \"{name}\"");
        in_range(&of("length_m"), self.length_m, LEAST_M, MOST_M)?;
        let (low_m, high_m) = (self.length_m / MOST_RATIO, self.length_m * MOST_RATIO);
        in_range(
            &of("width_m"),
            self.width_m,
            low_m.max(LEAST_M),
            high_m.min(MOST_M),
        )?;
        in_range(&of("axis_deg"), self.axis_deg, -360.0, 720.0)?;
        Ok(())
    }

    /// Cells along the length and the width: nearly square.
    fn counts(&self) -> (usize, usize) {
        let side_m = (self.length_m * self.width_m / CELLS).sqrt();
        let count = |m: f64| (m / side_m).round().max(1.0) as usize;
        (count(self.length_m), count(self.width_m))
    }

    /// Variance of a cell in any horizontal direction, m²: the mean of those along its sides.
    pub(crate) fn cell_variance_m2(&self) -> f64 {
        let (along, across) = self.counts();
        ((self.length_m / along as f64).powi(2) + (self.width_m / across as f64).powi(2)) / 24.0
    }

    /// Variance of the whole area in a horizontal direction, m², the mean over directions.
    pub(crate) fn variance_m2(&self) -> f64 {
        let of_sides = self.length_m.powi(2) + self.width_m.powi(2);
        match self.outline {
            Outline::Rectangle => of_sides / 24.0,
            Outline::Ellipse => of_sides / 32.0,
        }
    }

    /// The cells, each at the middle of what of it is inside the outline.
    pub(crate) fn cells(&self) -> Vec<Cell> {
        let (along, across) = self.counts();
        let each = (0..along).flat_map(|i| (0..across).map(move |j| (i, j)));
        let found: Vec<(f64, f64, f64)> = each
            .filter_map(|(i, j)| self.part_inside(i, j, (along, across)))
            .collect();
        let whole: f64 = found.iter().map(|cell| cell.2).sum();
        let (sin, cos) = self.axis_deg.to_radians().sin_cos();
        let cell = |(a_m, b_m, weight): (f64, f64, f64)| Cell {
            east_m: a_m * sin + b_m * cos,
            north_m: a_m * cos - b_m * sin,
            share: weight / whole,
        };
        found.into_iter().map(cell).collect()
    }

    /// Middle along length and width, m, and weight of what of a cell is inside; none where nothing is.
    fn part_inside(&self, i: usize, j: usize, counts: (usize, usize)) -> Option<(f64, f64, f64)> {
        let place = |k: usize, look: usize, count: usize| {
            ((k * LOOKS + look) as f64 + 0.5) / (count * LOOKS) as f64 - 0.5
        };
        let (mut a, mut b, mut inside) = (0.0, 0.0, 0.0);
        for (la, lb) in (0..LOOKS).flat_map(|la| (0..LOOKS).map(move |lb| (la, lb))) {
            let (pa, pb) = (place(i, la, counts.0), place(j, lb, counts.1));
            if self.outline == Outline::Rectangle || pa * pa + pb * pb <= 0.25 {
                a += pa;
                b += pb;
                inside += 1.0;
            }
        }
        (inside > 0.0).then(|| {
            (
                a / inside * self.length_m,
                b / inside * self.width_m,
                inside,
            )
        })
    }
}

#[cfg(test)]
#[path = "area_tests.rs"]
mod tests;
