//! What all innovations say of all columns: the normal equations, block by block of time.

use nalgebra::{DMatrix, DVector};

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
            rows: Vec::new(),
            innovations: Vec::new(),
        }
    }

    /// Says that what follows is of a sample of `log` at `time_s`.
    pub fn begin_sample(&mut self, log: usize, time_s: f64) {
        let is_open =
            |b: &&mut Block| b.log == log && time_s >= b.from_s && time_s < b.from_s + self.block_s;
        if let Some(block) = self.blocks.last_mut().filter(is_open) {
            block.to_s = time_s;
            return;
        }
        self.close();
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

    /// One innovation (in standard deviations) with its derivatives.
    pub fn add_row(&mut self, row: &[f64], innovation: f64) {
        self.rows.extend_from_slice(row);
        self.innovations.push(innovation);
    }

    /// Adds what was gathered to the block that it belongs to.
    fn close(&mut self) {
        let n = self.innovations.len();
        if let Some(block) = self.blocks.last_mut().filter(|_| n > 0) {
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
        self.close();
        self.blocks
    }
}
