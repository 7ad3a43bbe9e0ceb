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
    /// Over `dt_s` with slopes `a` (1/s), in `parts` parts each short against every time constant;
    /// what slopes add stays nil unless it is asked for.
    pub fn of(a: &Matrix, dt_s: f64, parts: usize, adds: bool) -> Self {
        let halvings = parts.next_power_of_two().trailing_zeros();
        exponential(a, dt_s, halvings, adds)
    }
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

/// Taylor's series to the fourth order, as exact as the Runge-Kutta step that it goes with, squared
/// so many times.
fn exponential(a: &Matrix, dt_s: f64, halvings: u32, adds: bool) -> Transition {
    let h = dt_s / f64::from(1u32 << halvings);
    let square = of_all(a, a);
    // Both are a beginning and the square times an end.
    let series = |of: [f64; 4]| {
        let mix = |of: [f64; 2], of_one: f64| {
            let mut m: Matrix = *a;
            for (m, s) in m.as_flattened_mut().iter_mut().zip(square.as_flattened()) {
                *m = of[0] * *m + of[1] * s;
            }
            for k in 0..STATES {
                m[k][k] += of_one;
            }
            m
        };
        let mut whole = of_all(&square, &mix([of[2], of[3]], of[1]));
        let begin = mix([of[0], 0.0], 0.0);
        for (w, b) in whole
            .as_flattened_mut()
            .iter_mut()
            .zip(begin.as_flattened())
        {
            *w += b;
        }
        whole
    };
    let mut keep = series([h, h * h / 2.0, h.powi(3) / 6.0, h.powi(4) / 24.0]);
    let mut add = [[0.0; STATES]; STATES];
    if adds {
        add = series([h * h / 2.0, h.powi(3) / 6.0, h.powi(4) / 24.0, 0.0]);
    }
    let one = if adds { h } else { 0.0 };
    for k in 0..STATES {
        keep[k][k] += 1.0;
        add[k][k] += one;
    }
    for _ in 0..halvings {
        if adds {
            let more = of_all(&keep, &add);
            for (add, more) in add.as_flattened_mut().iter_mut().zip(more.as_flattened()) {
                *add += more;
            }
        }
        keep = of_all(&keep, &keep);
    }
    Transition { keep, add }
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
            let step = Transition::of(&a, dt, parts as usize, true);
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
