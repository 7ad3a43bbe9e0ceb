//! The largest value of a smooth function of few numbers: BFGS with differences for derivatives
//! (Nocedal and Wright 2006, chapter 6).

/// Step of the differences: numbers are natural logarithms.
const DIFFERENCE: f64 = 0.02;
/// Longest step in any number: a factor e.
const LONGEST: f64 = 1.0;
/// Halvings of a step that does not gain.
const HALVINGS: usize = 4;
/// A step that gains less ends the search.
const SETTLED: f64 = 0.02;

/// The point of the largest `value` from `start`, in at most `most_steps` steps; `curvature` is a
/// first guess of minus the second derivatives.
pub(crate) fn maximise<const N: usize>(
    start: [f64; N],
    curvature: [f64; N],
    most_steps: usize,
    value: impl Fn(&[f64; N]) -> f64,
) -> [f64; N] {
    let slope_at = |at: &[f64; N], here: f64| -> [f64; N] {
        std::array::from_fn(|k| {
            let mut aside = *at;
            aside[k] += DIFFERENCE;
            (value(&aside) - here) / DIFFERENCE
        })
    };
    let mut at = start;
    let mut here = value(&at);
    let mut slope = slope_at(&at, here);
    let mut inverse: [[f64; N]; N] = std::array::from_fn(|k| {
        std::array::from_fn(|j| if k == j { 1.0 / curvature[k] } else { 0.0 })
    });
    for _ in 0..most_steps {
        let mut step: [f64; N] = std::array::from_fn(|k| dot(&inverse[k], &slope));
        let longest = step.iter().fold(0.0f64, |m, s| m.max(s.abs()));
        if longest > LONGEST {
            step = step.map(|s| s * LONGEST / longest);
        }
        let mut gained = None;
        for _ in 0..HALVINGS {
            let there: [f64; N] = std::array::from_fn(|k| at[k] + step[k]);
            let reached = value(&there);
            if reached > here {
                gained = Some((there, reached));
                break;
            }
            step = step.map(|s| 0.3 * s);
        }
        let Some((there, reached)) = gained else {
            break;
        };
        let next = slope_at(&there, reached);
        let bend: [f64; N] = std::array::from_fn(|k| slope[k] - next[k]);
        update(&mut inverse, &step, &bend);
        let gain = reached - here;
        (at, here, slope) = (there, reached, next);
        if gain < SETTLED {
            break;
        }
    }
    at
}

fn dot<const N: usize>(a: &[f64; N], b: &[f64; N]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// The BFGS update of the inverse curvature.
fn update<const N: usize>(inverse: &mut [[f64; N]; N], step: &[f64; N], bend: &[f64; N]) {
    let along = dot(step, bend);
    if along <= 1e-10 {
        return;
    }
    let moved: [f64; N] = std::array::from_fn(|k| dot(&inverse[k], bend));
    let bent = dot(bend, &moved);
    for k in 0..N {
        for j in 0..N {
            inverse[k][j] += (1.0 + bent / along) * step[k] * step[j] / along
                - (moved[k] * step[j] + step[k] * moved[j]) / along;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    // 2x + y/2 = 2 and x/2 + 2y = -4 where both slopes are nothing: x = 1.6, y = -2.4.
    #[test]
    fn climbs_a_hill_whose_axes_are_not_the_coordinates() {
        let value = |x: &[f64; 2]| -(x[0] - 1.0).powi(2) - (x[1] + 2.0).powi(2) - 0.5 * x[0] * x[1];
        let top = maximise([-3.0, 4.0], [1.0, 5.0], 100, value);
        assert!(
            (top[0] - 1.6).abs() < 0.1 && (top[1] + 2.4).abs() < 0.1,
            "{top:?}"
        );
    }
}
