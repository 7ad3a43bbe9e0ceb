//! Small dense matrices of the filter: the exponential of a step, and what it does to a covariance.
//!
//! Everything is column by column; entries that are nil are skipped, since most are.

use multiversion::multiversion;

use super::motion::STATES;

/// `a + b c`, by one instruction where the machine has it.
macro_rules! plus_product {
    ($a:expr, $b:expr, $c:expr) => {
        if multiversion::target::target_cfg_f!(target_feature = "fma") {
            f64::mul_add($b, $c, $a)
        } else {
            $a + $b * $c
        }
    };
}
pub(super) use plus_product;

/// A vector of error states.
pub type Error = [f64; STATES];
/// A matrix of error states, column by column.
pub type Matrix = [Error; STATES];

/// What one step does: errors move by `keep`, and a slope that is constant through the step adds
/// `add` times it.
#[derive(Debug, Clone)]
pub struct Transition {
    /// Exponential of slope times step.
    pub keep: Matrix,
    /// Integral of the exponential over the step, s.
    pub add: Matrix,
}

impl Transition {
    /// Over `dt_s` with slopes `a` (1/s), in `parts` parts each short against every time constant: Taylor's series to the
    /// fourth order, as exact as the Runge-Kutta step that it goes with, and squared from part to part.
    pub fn of(a: &Matrix, dt_s: f64, parts: usize) -> Self {
        let halvings = parts.next_power_of_two().trailing_zeros();
        let h = dt_s / f64::from(1u32 << halvings);
        let mut add = [[0.0; STATES]; STATES];
        for part in [0.0, h / 4.0, h / 3.0, h / 2.0] {
            add = one_and(a, &add, part);
        }
        let mut keep = one_and(a, &add, h);
        add = add.map(|column| column.map(|v| h * v));
        for _ in 0..halvings {
            add = plus(&of_all(&keep, &add), &add);
            keep = of_all(&keep, &keep);
        }
        Self { keep, add }
    }
}

/// One and `part` of the product of two matrices.
fn one_and(a: &Matrix, b: &Matrix, part: f64) -> Matrix {
    let mut out = of_all(a, b).map(|column| column.map(|v| part * v));
    for k in 0..STATES {
        out[k][k] += 1.0;
    }
    out
}

fn plus(a: &Matrix, b: &Matrix) -> Matrix {
    std::array::from_fn(|c| std::array::from_fn(|r| a[c][r] + b[c][r]))
}

/// Values that one register holds.
const LANES: usize = 8;

/// Matrix (column by column) times vector.
pub fn times(m: &Matrix, v: &Error) -> Error {
    let mut out = [0.0; STATES];
    product(std::slice::from_mut(&mut out), m, std::slice::from_ref(v));
    out
}

/// Writes the product of `m` and each column of `v`. Entries that are nil are skipped, since many are.
#[multiversion(targets("x86_64+avx512f+avx512dq+avx512vl+fma", "x86_64+avx2+fma"))]
fn product(to: &mut [Error], m: &Matrix, v: &[Error]) {
    for (to, v) in to.iter_mut().zip(v) {
        let mut sum = [[0.0; LANES]; STATES / LANES];
        for (column, weight) in m.iter().zip(v) {
            if *weight != 0.0 {
                for (sum, column) in sum.iter_mut().zip(column.as_chunks::<LANES>().0) {
                    for l in 0..LANES {
                        sum[l] = plus_product!(sum[l], *weight, column[l]);
                    }
                }
            }
        }
        to.copy_from_slice(sum.as_flattened());
    }
}

fn of_all(m: &Matrix, v: &Matrix) -> Matrix {
    let mut out = [[0.0; STATES]; STATES];
    product(&mut out, m, v);
    out
}

fn transposed(m: &Matrix) -> Matrix {
    std::array::from_fn(|c| std::array::from_fn(|r| m[r][c]))
}

/// `f` transposed, `m` and `f`, one after the other.
pub fn between(m: &Matrix, f: &Matrix) -> Matrix {
    of_all(&transposed(&of_all(m, f)), f)
}

/// `m` transposed times `v`.
pub fn across(m: &Matrix, v: &Error) -> Error {
    m.map(|column| column.iter().zip(v).map(|(a, b)| a * b).sum())
}

/// The covariance `p` after a step that keeps `f` and adds the variances `process`.
pub fn propagate(p: &mut Matrix, f: &Matrix, process: &Error) {
    let turned = transposed(&of_all(f, p));
    // F P F' is F (F P)', symmetric but for rounding.
    let whole = of_all(f, &turned);
    for c in 0..STATES {
        for r in 0..c {
            let mean = 0.5 * (whole[c][r] + whole[r][c]);
            (p[c][r], p[r][c]) = (mean, mean);
        }
        p[c][c] = whole[c][c].max(0.0) + process[c];
    }
}

/// Takes `gain` times its transpose over `variance` off the covariance `p`.
pub fn take_off(p: &mut Matrix, gain: &Error, variance: f64) {
    let part = gain.map(|g| -g / variance);
    product_of_vectors(p.as_flattened_mut(), gain, &part);
}

#[multiversion(targets("x86_64+avx512f+avx512dq+avx512vl+fma", "x86_64+avx2+fma"))]
fn product_of_vectors(to: &mut [f64], a: &[f64], b: &[f64]) {
    for (to, b) in to.chunks_exact_mut(a.len()).zip(b) {
        for (to, a) in to.iter_mut().zip(a) {
            *to = plus_product!(*to, *b, *a);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Closed forms: a decay, and a decay that drives an integral.
    #[test]
    fn a_decay_and_its_integral() {
        let mut a = [[0.0; STATES]; STATES];
        // x' = -x / .4, y' = x.
        a[0][0] = -1.0 / 0.4;
        a[0][1] = 1.0;
        // What the fifth order would add is (h / .4)^5 / 120, for each part.
        for (dt, parts) in [(0.02, 1), (0.38, 16)] {
            let step = Transition::of(&a, dt, parts as usize);
            let keep = (-dt / 0.4_f64).exp();
            let bound = f64::from(parts) * (dt / f64::from(parts) / 0.4).powi(5) / 120.0 + 1e-12;
            let near = |a: f64, b: f64| assert!((a - b).abs() < bound, "{a} {b}");
            near(step.keep[0][0], keep);
            near(step.keep[0][1], 0.4 * (1.0 - keep));
            near(step.add[0][0], 0.4 * (1.0 - keep));
            near(step.add[1][1], dt);
            near(step.keep[5][5], 1.0);
        }
    }
}
