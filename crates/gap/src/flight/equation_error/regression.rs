//! Linear regression of which blocks of rows can be left out.

use nalgebra::{DMatrix, DVector};

/// Largest variance inflation of a column. Beyond it the other columns determine the column, except for the rounding of the
/// file.
const MOST_INFLATION: f64 = 1e4;
/// Least part of its square that a response must vary by: less is rounding.
const LEAST_SPREAD: f64 = 1e-9;
/// Part of a column's square below which it stands still.
const STANDS_STILL: f64 = 1e-12;
/// What is added to the diagonal of products, relative to it, so that columns that stand still can be solved for.
const RIDGE: f64 = 1e-9;

/// Weighted products of the columns of a regression, the constant first and the response last, block by block.
#[derive(Default)]
pub(super) struct Regression {
    blocks: Vec<DMatrix<f64>>,
    block: usize,
    /// Number of rows.
    pub rows: usize,
}

impl Regression {
    /// Adds a row of `block`, unless something of it is unknown.
    pub fn add(&mut self, block: usize, weight: f64, x: &[f64], y: f64) {
        let row = DVector::from_iterator(x.len() + 1, x.iter().copied().chain([y]));
        if !row.iter().all(|v| v.is_finite()) {
            return;
        }
        if self.block != block || self.blocks.is_empty() {
            self.blocks.push(DMatrix::zeros(row.len(), row.len()));
            self.block = block;
        }
        if let Some(last) = self.blocks.last_mut() {
            last.ger(weight, &row, &row, 1.0);
        }
        self.rows += 1;
    }

    /// Products over all blocks.
    pub fn all(&self) -> DMatrix<f64> {
        self.blocks.iter().sum()
    }

    /// Products without each block in turn, each with those of the block.
    pub fn without_each(&self) -> impl Iterator<Item = (DMatrix<f64>, &DMatrix<f64>)> {
        let all = self.all();
        self.blocks.iter().map(move |block| (&all - block, block))
    }

    /// Squares left on each block by a fit to the others, over all.
    pub fn held_out(&self) -> f64 {
        let each = self.without_each();
        each.map(|(others, block)| left(block, &solve(&others)))
            .sum()
    }

    /// Squares left by a fit to all, and then by one to all but each block.
    pub fn left_without_each(&self) -> Vec<f64> {
        let others = self.without_each().map(|(others, _)| others);
        let fitted = |of: DMatrix<f64>| left(&of, &solve(&of));
        [self.all()].into_iter().chain(others).map(fitted).collect()
    }

    /// Variance inflation of each column but the constant by its correlation with the others; NaN where it stands still.
    pub fn inflation(&self) -> Vec<f64> {
        let all = self.all();
        let n = all.nrows() - 1;
        let inverse = factors(&all).try_inverse();
        let of = |k: usize| {
            let spread = spread(&all, k);
            let moves = spread > STANDS_STILL * all[(k, k)];
            let inverse = inverse.as_ref().filter(|_| moves);
            inverse.map_or(f64::NAN, |i| spread * i[(k, k)])
        };
        (1..n).map(of).collect()
    }

    /// Whether there is something to explain and one of the last `surfaces` columns moves apart from all else, by
    /// `least` of standard deviation: one that stands still, or that the others determine, tells nothing.
    pub fn is_excited(&self, surfaces: usize, least: f64) -> bool {
        if self.blocks.is_empty() {
            return false;
        }
        let (all, inflation) = (self.all(), self.inflation());
        let y = all.nrows() - 1;
        let moves = |k: usize| {
            spread(&all, k) > least.powi(2) * all[(0, 0)] && inflation[k - 1] < MOST_INFLATION
        };
        spread(&all, y) > LEAST_SPREAD * all[(y, y)] && (y - surfaces..y).any(moves)
    }
}

/// Squares of a column about its mean.
fn spread(products: &DMatrix<f64>, k: usize) -> f64 {
    products[(k, k)] - products[(0, k)].powi(2) / products[(0, 0)]
}

/// The products of the columns without the response.
fn factors(products: &DMatrix<f64>) -> DMatrix<f64> {
    let n = products.nrows() - 1;
    let mut a = products.view((0, 0), (n, n)).into_owned();
    for k in 0..n {
        a[(k, k)] = a[(k, k)] * (1.0 + RIDGE) + f64::MIN_POSITIVE;
    }
    a
}

/// The most probable factor of each column.
pub(super) fn solve(products: &DMatrix<f64>) -> DVector<f64> {
    let n = products.nrows() - 1;
    let b = products.view((0, n), (n, 1)).column(0).into_owned();
    let solved = factors(products).cholesky().map(|c| c.solve(&b));
    solved.unwrap_or_else(|| DVector::zeros(n))
}

/// Squares that factors leave.
fn left(products: &DMatrix<f64>, factors: &DVector<f64>) -> f64 {
    let misfit = factors.map(|v| -v).push(1.0);
    misfit.dot(&(products * &misfit))
}
