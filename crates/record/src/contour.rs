//! Lines of one concentration on a level grid.
//!
//! Marching squares; where a cell's corners cross over, its middle says which belong together.

use crate::antimeridian::Corner;
use std::collections::BTreeMap;

/// A line on which a plume has one excess over its background.
#[derive(Debug, Clone, PartialEq)]
pub struct PlumeLine {
    /// Mole fraction above background, ppm.
    pub excess_ppm: f64,
    /// Where it runs; a closed line has its first corner at the end once more.
    pub corners: Vec<Corner>,
}

/// Values on a grid with even steps.
#[derive(Debug, Clone, PartialEq)]
pub struct Grid {
    /// Number of points in a row.
    pub columns: usize,
    /// Row by row.
    pub values: Vec<f64>,
}

/// A place on the grid: columns and rows from its first point on.
pub type At = [f64; 2];

/// An edge between two neighbouring points: the first one's number, and whether the other stands beside it.
type Edge = (usize, bool);

impl Grid {
    fn at(&self, column: usize, row: usize) -> f64 {
        self.values[row * self.columns + column]
    }

    /// Where the value on an edge is `level`.
    fn crossing(&self, (point, beside): Edge, level: f64) -> At {
        let next = point + if beside { 1 } else { self.columns };
        let (a, b) = (self.values[point], self.values[next]);
        let share = (level - a) / (b - a);
        let (column, row) = ((point % self.columns) as f64, (point / self.columns) as f64);
        if beside {
            [column + share, row]
        } else {
            [column, row + share]
        }
    }

    /// The edges that the line crosses in a cell, two by two.
    fn in_cell(&self, column: usize, row: usize, level: f64) -> Vec<[Edge; 2]> {
        let point = row * self.columns + column;
        // Counted round the cell: below, right, above, left.
        let edges = [
            (point, true),
            (point + 1, false),
            (point + self.columns, true),
            (point, false),
        ];
        let corners = [
            self.at(column, row),
            self.at(column + 1, row),
            self.at(column + 1, row + 1),
            self.at(column, row + 1),
        ];
        if corners.iter().any(|c| !c.is_finite()) {
            return Vec::new();
        }
        let above = corners.map(|c| c >= level);
        let crossed: Vec<Edge> = (0..4)
            .filter(|&k| above[k] != above[(k + 1) % 4])
            .map(|k| edges[k])
            .collect();
        match crossed[..] {
            [a, b] => vec![[a, b]],
            [a, b, c, d] => {
                let middle = corners.iter().sum::<f64>() / 4.0 >= level;
                // The corners on the other side than the middle are cut off.
                if middle == above[0] {
                    vec![[a, b], [c, d]]
                } else {
                    vec![[d, a], [b, c]]
                }
            }
            _ => Vec::new(),
        }
    }

    /// The lines at `level`. A closed line has its first place at the end once more.
    pub fn lines(&self, level: f64) -> Vec<Vec<At>> {
        let rows = self.values.len().checked_div(self.columns).unwrap_or(0);
        let mut next: BTreeMap<Edge, Vec<Edge>> = BTreeMap::new();
        for row in 1..rows {
            for column in 1..self.columns {
                for [a, b] in self.in_cell(column - 1, row - 1, level) {
                    next.entry(a).or_default().push(b);
                    next.entry(b).or_default().push(a);
                }
            }
        }
        let mut lines = Vec::new();
        // Open lines from one of their ends, then what is closed.
        let ends: Vec<Edge> = next
            .iter()
            .filter(|(_, n)| n.len() == 1)
            .map(|(e, _)| *e)
            .collect();
        let all: Vec<Edge> = next.keys().copied().collect();
        for edge in ends.into_iter().chain(all) {
            let way = walk(&mut next, edge);
            if way.len() > 1 {
                lines.push(way.into_iter().map(|e| self.crossing(e, level)).collect());
            }
        }
        lines
    }
}

/// The edges one after the other from `edge` on; what was walked is taken out.
fn walk(next: &mut BTreeMap<Edge, Vec<Edge>>, edge: Edge) -> Vec<Edge> {
    let mut way = vec![edge];
    let mut at = edge;
    while let Some(to) = next.get_mut(&at).and_then(Vec::pop) {
        if let Some(back) = next.get_mut(&to)
            && let Some(k) = back.iter().position(|e| *e == at)
        {
            back.swap_remove(k);
        }
        way.push(to);
        at = to;
    }
    way
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn grid(columns: usize, rows: usize, value: impl Fn(f64, f64) -> f64) -> Grid {
        let values = (0..rows).flat_map(|r| (0..columns).map(move |c| (c as f64, r as f64)));
        Grid {
            columns,
            values: values.map(|(c, r)| value(c, r)).collect(),
        }
    }

    #[test]
    fn of_a_cone_the_line_is_a_circle() {
        let cone = grid(41, 31, |x, y| -(x - 20.0).hypot(y - 15.0));
        let lines = cone.lines(-10.0);
        assert_eq!(lines.len(), 1);
        let circle = &lines[0];
        assert_eq!(circle.first(), circle.last());
        for [x, y] in circle {
            // A cell's straight edges are off by less than its diagonal squared over 8 radii.
            assert!(((x - 20.0).hypot(y - 15.0) - 10.0).abs() < 0.05, "{x} {y}");
        }
        let shoelace: f64 = circle
            .windows(2)
            .map(|w| w[0][0] * w[1][1] - w[1][0] * w[0][1])
            .sum::<f64>()
            / 2.0;
        assert!((shoelace.abs() - 314.16).abs() < 3.0, "{shoelace}");
    }

    proptest! {
        #[test]
        fn lines_end_on_the_border_or_nowhere(values in prop::collection::vec(0.0..1.0f64, 9 * 7)) {
            let grid = Grid { columns: 9, values };
            let lines = grid.lines(0.5);
            let mut crossed = 0;
            for line in &lines {
                let (first, last) = (line[0], line[line.len() - 1]);
                let on_border = |[x, y]: At| x == 0.0 || y == 0.0 || x == 8.0 || y == 6.0;
                prop_assert!(first == last || on_border(first) && on_border(last));
                crossed += line.len() - usize::from(first == last);
                for pair in line.windows(2) {
                    prop_assert!((pair[0][0] - pair[1][0]).abs() <= 1.0 && (pair[0][1] - pair[1][1]).abs() <= 1.0);
                }
            }
            // Each edge with ends on both sides is crossed once.
            let sides = |a: f64, b: f64| usize::from((a >= 0.5) != (b >= 0.5));
            let beside: usize = (0..7).flat_map(|r| (1..9).map(move |c| (c, r)))
                .map(|(c, r)| sides(grid.at(c - 1, r), grid.at(c, r))).sum();
            let below: usize = (1..7).flat_map(|r| (0..9).map(move |c| (c, r)))
                .map(|(c, r)| sides(grid.at(c, r - 1), grid.at(c, r))).sum();
            prop_assert_eq!(crossed, beside + below);
        }
    }
}
