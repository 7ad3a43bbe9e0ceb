//! What all innovations say of all columns: the normal equations, block by block of time.

use nalgebra::{DMatrix, DVector};

/// Rows gathered before they are added.
const ROWS: usize = 512;

/// One block of time.
#[derive(Debug, Clone)]
pub struct Block {
    /// Which log.
    pub log: usize,
    /// From, s.
    pub from_s: f64,
    /// To, s.
    pub to_s: f64,
    /// Information.
    pub a: DMatrix<f64>,
    /// Score at the point of linearisation.
    pub b: DVector<f64>,
    /// Sum of squares of the innovations, and their number.
    pub squares: f64,
    /// Number of innovations.
    pub count: usize,
}

/// Gathers rows into blocks.
pub struct Normal {
    columns: usize,
    block_s: f64,
    blocks: Vec<Block>,
    rows: Vec<f64>,
    innovations: Vec<f64>,
}

impl Normal {
    /// Nothing yet, for so many columns and blocks so long.
    pub fn new(columns: usize, block_s: f64) -> Self {
        Self {
            columns,
            block_s,
            blocks: Vec::new(),
            rows: Vec::with_capacity(ROWS * columns),
            innovations: Vec::with_capacity(ROWS),
        }
    }

    /// One innovation (in standard deviations) with its derivatives.
    pub fn add_row(&mut self, row: &[f64], innovation: f64) {
        self.rows.extend_from_slice(row);
        self.innovations.push(innovation);
        if self.innovations.len() >= ROWS {
            self.flush();
        }
    }

    /// Says that a sample of `log` at `time_s` is complete.
    pub fn end_of_sample(&mut self, log: usize, time_s: f64) {
        let open = self.blocks.last().is_some_and(|b| {
            b.log == log && time_s >= b.from_s && time_s < b.from_s + self.block_s
        });
        if open {
            if let Some(block) = self.blocks.last_mut() {
                block.to_s = time_s;
            }
            return;
        }
        // What was gathered belongs to the block before.
        self.flush();
        self.blocks.push(Block {
            log,
            from_s: time_s,
            to_s: time_s,
            a: DMatrix::zeros(self.columns, self.columns),
            b: DVector::zeros(self.columns),
            squares: 0.0,
            count: 0,
        });
    }

    fn flush(&mut self) {
        let n = self.innovations.len();
        if n == 0 {
            return;
        }
        if self.blocks.is_empty() {
            // The first sample opens the first block after its rows.
            return;
        }
        if let Some(block) = self.blocks.last_mut() {
            let g = DMatrix::from_column_slice(self.columns, n, &self.rows);
            let nu = DVector::from_column_slice(&self.innovations);
            block.a.gemm(1.0, &g, &g.transpose(), 1.0);
            block.b.gemv(-1.0, &g, &nu, 1.0);
            block.squares += nu.norm_squared();
            block.count += n;
        }
        self.rows.clear();
        self.innovations.clear();
    }

    /// The blocks.
    pub fn finish(mut self) -> Vec<Block> {
        self.flush();
        self.blocks
    }
}
