//! Derivatives of the filter's state by all columns, carried through the flight side by side.
//!
//! With the gains held, a column's derivative depends on the past alone; so each sample is first
//! taken by the filter, and then by every column with the filter's gains.

use multiversion::multiversion;

use super::channel::{CHANNELS, at};
use super::filter::{Columns, Seen, Taken};
use super::motion::{FORCE, SPIN, STATES, towards};
use super::rival::Target;
use super::transition::{Matrix, Transition, plus_product};

/// Columns that are worked on side by side: few enough that their states stay at hand.
const WIDTH: usize = 56;

/// Columns side by side, row after row: derivatives of the state, what they change in the readings,
/// and in the acceleration and angular acceleration.
struct Panel {
    state: Vec<f64>,
    read: Vec<f64>,
    slope: Vec<f64>,
}

/// The entries of a row of a matrix that are not nil, each with its column's place.
type Row = Vec<(usize, f64)>;

/// The derivatives.
pub struct Sensitivity<'a, 'b> {
    columns: &'a Columns<'b>,
    panels: Vec<Panel>,
    /// Derivatives of this sample's innovations, channel after channel.
    rows: Vec<f64>,
}

impl<'a, 'b> Sensitivity<'a, 'b> {
    /// Nil, for these columns.
    pub fn new(columns: &'a Columns<'b>) -> Self {
        let nil = |rows: usize| vec![0.0; rows * WIDTH];
        let panel = |_| Panel {
            state: nil(STATES),
            read: nil(CHANNELS),
            slope: nil(6),
        };
        Self {
            columns,
            panels: (0..columns.count.div_ceil(WIDTH)).map(panel).collect(),
            rows: Vec::new(),
        }
    }

    /// Where column `j` stands.
    fn at(&mut self, j: usize) -> (&mut Panel, usize) {
        (&mut self.panels[j / WIDTH], j % WIDTH)
    }

    /// Sets what the columns change in the readings at a fixed state.
    pub fn look(&mut self, seen: &Seen<'_>) {
        for change in changes(self.columns, seen) {
            let (panel, l) = self.at(change.column);
            for (row, value) in panel.read.chunks_exact_mut(WIDTH).zip(change.read) {
                row[l] = value;
            }
        }
    }

    /// Moves the derivatives by the readings that the filter took, in their order, and calls
    /// `each` with those of every innovation, in the filter's standard deviations.
    pub fn take(&mut self, taken: &[Taken], mut each: impl FnMut(&[f64], &Taken)) {
        let width = self.panels.len() * WIDTH;
        self.rows.resize(taken.len() * width, 0.0);
        for (p, panel) in self.panels.iter_mut().enumerate() {
            let rows = self.rows.chunks_exact_mut(width);
            take(
                &mut panel.state,
                &panel.read,
                taken,
                rows.map(|r| &mut r[p * WIDTH..][..WIDTH]),
                WIDTH,
            );
        }
        let count = self.columns.count;
        for (row, taken) in self.rows.chunks(width).zip(taken) {
            each(&row[..count], taken);
        }
    }

    /// Moves the derivatives through `step`, with slopes as `seen`.
    pub fn predict(&mut self, seen: &Seen<'_>, step: &Transition) {
        let axes = fdm::dynamics::rotation(&seen.mean.body.attitude);
        for change in changes(self.columns, seen) {
            let (panel, l) = self.at(change.column);
            let slopes = [towards(&axes, &change.force), change.spin];
            for (row, value) in panel
                .slope
                .chunks_exact_mut(WIDTH)
                .zip(slopes.as_flattened())
            {
                row[l] = *value;
            }
        }
        let keep = rows(&step.keep, 0..STATES);
        let add = rows(&step.add, (0..3).chain(6..9));
        for panel in &mut self.panels {
            let before = std::mem::replace(&mut panel.state, vec![0.0; STATES * WIDTH]);
            for (k, after) in panel.state.chunks_exact_mut(WIDTH).enumerate() {
                add_rows(after, &before, &keep[k]);
                add_rows(after, &panel.slope, &add[k]);
            }
        }
    }
}

/// What one column changes at an instant: readings at a fixed state, specific force (body axes) and angular acceleration.
struct Change {
    column: usize,
    read: [f64; CHANNELS],
    force: [f64; 3],
    spin: [f64; 3],
}

fn changes<'s>(columns: &'s Columns<'_>, seen: &'s Seen<'_>) -> impl Iterator<Item = Change> {
    let here = seen.world.read(&seen.mean, &seen.felt);
    let of_worlds = columns.worlds.iter().map(move |aside| {
        let there = seen.within(&aside.world);
        let read = there.world.read(&seen.mean, &there.felt);
        let felt = |n: usize| (there.felt[n] - seen.felt[n]) / aside.step;
        Change {
            column: aside.column,
            read: std::array::from_fn(|c| (read[c] - here[c]) / aside.step),
            force: std::array::from_fn(|k| felt(FORCE + k)),
            spin: std::array::from_fn(|k| felt(SPIN + k)),
        }
    });
    let met = seen.meets();
    let terms = columns.terms.at(met).enumerate();
    let of_terms = terms.map(|(k, (target, value))| {
        let mut change = Change {
            column: columns.first_term + k,
            read: [0.0; CHANNELS],
            force: [0.0; 3],
            spin: [0.0; 3],
        };
        match target {
            Target::Spin(axis) | Target::Surface(axis) => change.spin[axis] = value,
            Target::Push(axis) => {
                change.force[axis] = value;
                change.read[at::FORCE + axis] = value;
            }
            Target::Sensor(c) => change.read[c] = value,
        }
        change
    });
    of_worlds.chain(of_terms)
}

/// The rows of some columns of `m`; a column's place is its number among those chosen.
fn rows(m: &Matrix, chosen: impl Iterator<Item = usize> + Clone) -> Vec<Row> {
    let row = |to: usize| {
        let columns = chosen.clone().enumerate();
        let entries = columns.map(|(from, k)| (from, m[k][to]));
        entries.filter(|e| e.1 != 0.0).collect()
    };
    (0..STATES).map(row).collect()
}

/// Adds rows of `from`, each by its weight, to `to`.
#[multiversion(targets("x86_64+avx512f+avx512dq+avx512vl+fma", "x86_64+avx2+fma"))]
fn add_rows(to: &mut [f64], from: &[f64], weights: &Row) {
    let width = to.len();
    for &(k, weight) in weights {
        for (to, from) in to.iter_mut().zip(&from[k * width..]) {
            *to = plus_product!(*to, weight, *from);
        }
    }
}

/// Moves the derivatives `state` by the readings `taken` and writes those of the innovations.
#[multiversion(targets("x86_64+avx512f+avx512dq+avx512vl+fma", "x86_64+avx2+fma"))]
fn take<'r>(
    state: &mut [f64],
    read: &[f64],
    taken: &[Taken],
    rows: impl Iterator<Item = &'r mut [f64]>,
    width: usize,
) {
    let mut of_e = vec![0.0; width];
    for (t, row) in taken.iter().zip(rows) {
        let direct = &read[t.channel * width..][..width];
        for (e, direct) in of_e.iter_mut().zip(direct) {
            *e = -direct;
        }
        for &(k, h) in &t.told {
            for (e, state) in of_e.iter_mut().zip(&state[k * width..]) {
                *e = plus_product!(*e, -h, *state);
            }
        }
        for (row, e) in row.iter_mut().zip(&of_e) {
            *row = e * t.scale;
        }
        for (state, gain) in state.chunks_exact_mut(width).zip(&t.gain) {
            let part = gain / t.used;
            for (state, e) in state.iter_mut().zip(&of_e) {
                *state = plus_product!(*state, part, *e);
            }
        }
    }
}
