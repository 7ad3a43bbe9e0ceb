//! Evidence of a linear problem for any sizes of the discrepancy and any mechanisms, from the products of its whitened
//! columns. Unknowns are integrated out in turn, those with the least variable priors first, so that partial results can
//! be reused.

use crate::discrepancy::{COORDINATES, Sizes, precision_of};
use nalgebra::{Cholesky, DMatrix, DMatrixView, DMatrixViewMut, DVector, Dyn};
use std::collections::BTreeMap;

/// Coordinates in the order in which their weights are integrated out: axis drift and time have the
/// most weights.
const ORDER: [usize; COORDINATES] = [5, 4, 3, 2, 1, 0];
/// Columns whose products are taken at once.
const BLOCK: usize = 32;
/// Number of coordinates after which the partial result is cached.
const KEPT: usize = 2;

/// Order of the columns of a problem: weights of the coordinates in `ORDER`, unknowns, columns of tried mechanisms, misfit.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Layout {
    counts: [usize; COORDINATES],
    /// The column of each weight, in the order of the basis.
    pub weights: Vec<usize>,
    /// The first unknown's column.
    pub unknowns: usize,
    /// The first tried column.
    pub tried: usize,
    /// All columns; the last is the misfit.
    pub columns: usize,
}

impl Layout {
    /// The layout for weights of these coordinates, in the order of the basis.
    pub fn new(coordinates: &[usize], unknowns: usize, tried: usize) -> Self {
        let mut counts = [0; COORDINATES];
        for c in coordinates {
            counts[*c] += 1;
        }
        let mut next = [0; COORDINATES];
        let mut first = 0;
        for c in ORDER {
            next[c] = first;
            first += counts[c];
        }
        let place = |c: &usize| {
            next[*c] += 1;
            next[*c] - 1
        };
        Self {
            weights: coordinates.iter().map(place).collect(),
            counts,
            unknowns: first,
            tried: first + unknowns,
            columns: first + unknowns + tried + 1,
        }
    }
}

/// Products of whitened columns.
#[derive(Debug, Clone)]
pub(crate) struct Products {
    /// Row after row, symmetric.
    pub values: Vec<f64>,
    pub ln_normalisation: f64,
}

impl Products {
    /// Products of the columns of `matrix`, which stands row after row.
    pub fn of(matrix: &[f64], columns: usize, ln_normalisation: f64) -> Self {
        let mut out = Self::zero(columns);
        out.ln_normalisation = ln_normalisation;
        out.add_rows(matrix, columns);
        out.mirror(columns);
        out
    }

    /// Adds the products of further rows. They are symmetric: only what lies on one side of the diagonal is
    /// added, block by block; [`Products::mirror`] ends it.
    pub fn add_rows(&mut self, matrix: &[f64], columns: usize) {
        let rows = matrix.len() / columns;
        let whitened = DMatrixView::from_slice(matrix, columns, rows);
        let (down, right) = (Dyn(columns), Dyn(1));
        let turned: DMatrixView<'_, f64, Dyn, Dyn> =
            DMatrixView::from_slice_with_strides_generic(matrix, Dyn(rows), down, down, right);
        let mut sum = DMatrixViewMut::from_slice(&mut self.values, columns, columns);
        for first in (0..columns).step_by(BLOCK) {
            let (count, left) = (BLOCK.min(columns - first), columns - first);
            let mut part = sum.view_mut((first, first), (left, count));
            let (a, b) = (whitened.rows(first, left), turned.columns(first, count));
            part.gemm(1.0, &a, &b, 1.0);
        }
    }

    /// Makes both sides of the diagonal the same.
    pub fn mirror(&mut self, columns: usize) {
        for k in 0..columns {
            for j in k + 1..columns {
                self.values[j * columns + k] = self.values[k * columns + j];
            }
        }
    }

    /// As a matrix.
    pub fn matrix(&self, columns: usize) -> DMatrixView<'_, f64> {
        DMatrixView::from_slice(&self.values, columns, columns)
    }

    /// Nothing.
    pub fn zero(columns: usize) -> Self {
        Self {
            values: vec![0.0; columns * columns],
            ln_normalisation: 0.0,
        }
    }

    /// Adds `times` the products of other rows.
    pub fn add(&mut self, other: &Self, times: f64) {
        for (own, other) in self.values.iter_mut().zip(&other.values) {
            *own += times * other;
        }
        self.ln_normalisation += times * other.ln_normalisation;
    }
}

/// Priors of the columns: precisions, and offsets of the point from the prior means.
#[derive(Debug, Clone)]
pub(crate) struct Known {
    pub layout: Layout,
    /// Precisions of the unknowns.
    pub precision: Vec<f64>,
    /// Offsets of all columns from their prior means; zero for tried ones.
    pub offset: Vec<f64>,
}

impl Known {
    /// Precisions of all columns but the tried ones and the misfit under `sizes`, where weights belong to
    /// `coordinates`.
    pub fn precision_under(
        &self,
        sizes: &Sizes,
        coordinates: impl Iterator<Item = usize>,
    ) -> Vec<f64> {
        let mut out = vec![0.0; self.layout.tried];
        for (place, c) in self.layout.weights.iter().zip(coordinates) {
            out[*place] = precision_of(sizes[c]);
        }
        out[self.layout.unknowns..].copy_from_slice(&self.precision);
        out
    }

    /// Posterior precision of the unknowns alone, from `products` and priors.
    pub fn of_unknowns(&self, products: &Products) -> Option<Cholesky<f64, Dyn>> {
        let (first, n) = (self.layout.unknowns, self.precision.len());
        let products = products.matrix(self.layout.columns);
        let mut information = products.view((first, first), (n, n)).into_owned();
        for (k, precision) in self.precision.iter().enumerate() {
            information[(k, k)] += precision;
        }
        Cholesky::new(information)
    }

    /// The most probable step from the point under `sizes`, column by column, and the precision there.
    pub fn solved(
        &self,
        products: &Products,
        sizes: &Sizes,
        coordinates: impl Iterator<Item = usize>,
    ) -> Option<(DVector<f64>, Cholesky<f64, Dyn>)> {
        let (n, columns) = (self.layout.tried, self.layout.columns);
        let products = products.matrix(columns);
        let precision = self.precision_under(sizes, coordinates);
        let mut information = products.view((0, 0), (n, n)).into_owned();
        let mut pull = products
            .view((0, columns - 1), (n, 1))
            .column(0)
            .into_owned();
        for k in 0..n {
            information[(k, k)] += precision[k];
            pull[k] -= precision[k] * self.offset[k];
        }
        let cholesky = Cholesky::new(information)?;
        Some((cholesky.solve(&pull), cholesky))
    }
}

/// A problem with its first unknowns integrated out.
#[derive(Debug, Clone)]
pub(crate) struct Reduced {
    n: usize,
    values: Vec<f64>,
    ln: f64,
}

impl Reduced {
    /// The problem without its first `count` columns, of which `prior` gives precision and offset.
    pub fn without(&self, count: usize, prior: impl Fn(usize) -> (f64, f64)) -> Option<Self> {
        let n = self.n;
        let mut a = self.values.clone();
        let last = n - 1;
        let mut ln = self.ln;
        for k in 0..count {
            let (precision, offset) = prior(k);
            a[k * n + k] += precision;
            a[k * n + last] -= precision * offset;
            a[last * n + last] += precision * offset * offset;
            ln += 0.5 * precision.ln();
        }
        for k in 0..count {
            let (above, below) = a.split_at_mut((k + 1) * n);
            let pivot_row = &above[k * n..];
            let pivot = pivot_row[k];
            if pivot <= 0.0 || !pivot.is_finite() {
                return None;
            }
            ln -= 0.5 * pivot.ln();
            for (i, row) in (k + 1..n).zip(below.chunks_exact_mut(n)) {
                let factor = pivot_row[i] / pivot;
                if factor != 0.0 {
                    for (value, p) in row[i..].iter_mut().zip(&pivot_row[i..]) {
                        *value -= factor * p;
                    }
                }
            }
        }
        let m = n - count;
        let mut values = Vec::with_capacity(m * m);
        for i in count..n {
            values.extend_from_slice(&a[i * n + count..(i + 1) * n]);
        }
        Some(Self { n: m, values, ln })
    }

    /// Columns that are left, the misfit among them.
    pub fn columns(&self) -> usize {
        self.n
    }

    /// The problem of some of the columns that are left, and the misfit.
    pub fn only(&self, columns: &[usize]) -> Self {
        let all: Vec<usize> = columns.iter().copied().chain([self.n - 1]).collect();
        let at = |i: usize, j: usize| self.values[i.min(j) * self.n + i.max(j)];
        let values = all
            .iter()
            .flat_map(|i| all.iter().map(move |j| at(*i, *j)))
            .collect();
        Self {
            n: all.len(),
            values,
            ln: self.ln,
        }
    }

    /// The product of two columns that are left.
    pub fn value(&self, i: usize, j: usize) -> f64 {
        self.values[i.min(j) * self.n + i.max(j)]
    }

    /// The most probable values of the columns that are left, under priors of mean zero.
    pub fn solution(&self, sd: &[f64]) -> Option<Vec<f64>> {
        let n = self.n - 1;
        let mut information = DMatrix::from_fn(n, n, |i, j| self.value(i, j));
        for (k, sd) in sd.iter().enumerate() {
            information[(k, k)] += sd.powi(-2);
        }
        let pull = DVector::from_fn(n, |i, _| self.value(i, n));
        Some(Cholesky::new(information)?.solve(&pull).as_slice().to_vec())
    }

    /// Log evidence where nothing more is unknown, nats.
    pub fn ln_evidence(&self) -> f64 {
        self.ln - 0.5 * self.values[self.n * self.n - 1]
    }
}

/// Problems of several sizes that share partial results.
pub(crate) struct Evidence<'a> {
    known: &'a Known,
    whole: Reduced,
    kept: BTreeMap<[u64; KEPT], Option<Reduced>>,
}

impl<'a> Evidence<'a> {
    /// Evidences of `products`.
    pub fn new(products: &Products, known: &'a Known) -> Self {
        Self {
            whole: Reduced {
                n: known.layout.columns,
                values: products.values.clone(),
                ln: products.ln_normalisation,
            },
            known,
            kept: BTreeMap::new(),
        }
    }

    /// The problem in which all but the tried columns are integrated out, under `sizes`.
    pub fn under(&mut self, sizes: &Sizes) -> Option<Reduced> {
        let counts = &self.known.layout.counts;
        let key: [u64; KEPT] = std::array::from_fn(|k| sizes[ORDER[k]].to_bits());
        let first: usize = ORDER[..KEPT].iter().map(|c| counts[*c]).sum();
        let offset = &self.known.offset;
        let precision = |at: usize| {
            let mut end = 0;
            for c in ORDER {
                end += counts[c];
                if at < end {
                    return precision_of(sizes[c]);
                }
            }
            self.known.precision[at - end]
        };
        let whole = &self.whole;
        let kept = self
            .kept
            .entry(key)
            .or_insert_with(|| whole.without(first, |k| (precision(k), offset[k])));
        let rest = self.known.layout.tried - first;
        kept.as_ref()?
            .without(rest, |k| (precision(first + k), offset[first + k]))
    }

    /// Log evidence under `sizes`, nats; minus infinity where there is none.
    pub fn ln(&mut self, sizes: &Sizes) -> f64 {
        let reduced = self.under(sizes);
        reduced.map_or(f64::NEG_INFINITY, |r| r.ln_evidence())
    }
}
