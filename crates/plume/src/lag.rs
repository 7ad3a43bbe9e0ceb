//! The answer of a sensor with a first-order lag: a step at a time, and along rows between which
//! its input is curved.

/// Longest step over which the input is taken as curved, s: beyond it the neighbours say nothing of
/// what lay between, and a parabola through them may go far astray.
pub(crate) const MAX_CURVED_STEP_S: f64 = 6.0;

/// Steps that differ by less are one, s.
const SAME_STEP_S: f64 = 1e-6;
/// Steps of different lengths whose coefficients are kept.
const STEPS_KEPT: usize = 8;

/// Replaces `values` at `times` by what a sensor with a time constant shows of them, settled on the
/// first: dy/dt = (u - y)/τ.
pub(crate) fn apply(times: &[f64], time_constant_s: f64, values: &mut [f64]) {
    if values.len() < 2 {
        return;
    }
    let input = values.to_vec();
    let mut state = values[0];
    // Rows mostly keep few steps: their coefficients are worked out once.
    let mut steps: Vec<LagStep> = Vec::new();
    let mut which = 0;
    let mut slope_before = slope(times, &input, 0);
    for k in 1..values.len() {
        let dt_s = times[k] - times[k - 1];
        let alike = |s: &LagStep| (s.dt_s - dt_s).abs() < SAME_STEP_S;
        if !steps.get(which).is_some_and(alike) {
            which = steps.iter().position(alike).unwrap_or_else(|| {
                if steps.len() == STEPS_KEPT {
                    steps.clear();
                }
                steps.push(LagStep::new(dt_s, time_constant_s));
                steps.len() - 1
            });
        }
        let step = &steps[which];
        let slope_now = slope(times, &input, k);
        state = step.decay * state + step.before * input[k - 1] + step.now * input[k];
        if dt_s <= MAX_CURVED_STEP_S {
            state += step.slope_before * slope_before + step.slope_now * slope_now;
        }
        slope_before = slope_now;
        values[k] = state;
    }
}

/// One exact step of a first-order lag over `dt_s` while the input goes straight from
/// `before` to `now`: dy/dt = (u - y)/τ.
#[inline]
pub fn lag_step(output: f64, before: f64, now: f64, dt_s: f64, time_constant_s: f64) -> f64 {
    if time_constant_s <= 0.0 {
        return now;
    }
    let k = dt_s / time_constant_s;
    if k <= 0.0 {
        return output;
    }
    let decay = (-k).exp();
    // Mean weight of the ramp: 1 - (1 - e^-k)/k, by series where k is small and the difference would
    // cancel.
    let ramp = if k < 1e-4 {
        k * (0.5 - k / 6.0)
    } else {
        1.0 + (-k).exp_m1() / k
    };
    decay * output + (1.0 - decay) * before + ramp * (now - before)
}

/// Slope at row `k` of a parabola through it and its neighbours, per second.
fn slope(times: &[f64], values: &[f64], k: usize) -> f64 {
    let chord = |k: usize| (values[k] - values[k - 1]) / (times[k] - times[k - 1]);
    let last = values.len() - 1;
    // Over an interval the two end slopes of a parabola have the chord's as their mean.
    match k {
        _ if last < 2 => return chord(1),
        0 => return 2.0 * chord(1) - slope(times, values, 1),
        _ if k == last => return 2.0 * chord(last) - slope(times, values, last - 1),
        _ => {}
    }
    let (before, after) = (times[k] - times[k - 1], times[k + 1] - times[k]);
    if before > MAX_CURVED_STEP_S || after > MAX_CURVED_STEP_S {
        return chord(k);
    }
    let (rise, next) = (values[k] - values[k - 1], values[k + 1] - values[k]);
    (rise * after / before + next * before / after) / (before + after)
}

/// One step of a first-order lag while the input follows the cubic of Hermite through two rows
/// with given slopes, as weights of what it starts from: a straight line between rows a second
/// apart would cut the peaks off a narrow plume.
struct LagStep {
    dt_s: f64,
    decay: f64,
    before: f64,
    now: f64,
    slope_before: f64,
    slope_now: f64,
}

impl LagStep {
    fn new(dt_s: f64, time_constant_s: f64) -> Self {
        // The cubic is the straight line, which lag_step has exactly, and the rest of the
        // Hermite polynomials: t(1-t)((1-2t)(u0-u1) + dt((1-t) m0 - t m1)) on 0 to 1.
        let weight = |f: &dyn Fn(f64) -> f64| step_response(dt_s / time_constant_s, f);
        let bend = weight(&|t| t * (1.0 - t) * (1.0 - 2.0 * t));
        Self {
            dt_s,
            decay: lag_step(1.0, 0.0, 0.0, dt_s, time_constant_s),
            before: lag_step(0.0, 1.0, 0.0, dt_s, time_constant_s) + bend,
            now: lag_step(0.0, 0.0, 1.0, dt_s, time_constant_s) - bend,
            slope_before: dt_s * weight(&|t| t * (1.0 - t) * (1.0 - t)),
            slope_now: -dt_s * weight(&|t| t * t * (1.0 - t)),
        }
    }
}

/// Response at the end of a unit step to an input `f` of the part of the step gone, by a lag from
/// rest whose time constant is 1/`rate` steps: k∫exp(-k(1-t)) f(t) dt, by Gauss–Legendre
/// quadrature (five nodes, Abramowitz and Stegun 1964, table 25.4) over what the lag remembers. The
/// closed form loses all its digits where the step is short beside the time constant.
fn step_response(rate: f64, f: &dyn Fn(f64) -> f64) -> f64 {
    const NODES: [(f64, f64); 5] = [
        (0.046_910_077_030_668, 0.118_463_442_528_095),
        (0.230_765_344_947_158, 0.239_314_335_249_683),
        (0.5, 0.284_444_444_444_444),
        (0.769_234_655_052_842, 0.239_314_335_249_683),
        (0.953_089_922_969_332, 0.118_463_442_528_095),
    ];
    const PIECES: usize = 8;
    if rate.is_nan() || rate <= 0.0 {
        return 0.0;
    }
    // exp(-40) of what was met before is left: below the rounding of the sum.
    let reach = (40.0 / rate).min(1.0);
    let piece = reach / PIECES as f64;
    let mut sum = 0.0;
    for k in 0..PIECES {
        for (node, weight) in NODES {
            let back = (k as f64 + node) * piece;
            sum += weight * piece * rate * (-rate * back).exp() * f(1.0 - back);
        }
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::*;

    // Exact answer to a ramp u = t from rest: y = t - tau (1 - exp(-t/tau)).
    #[test]
    fn lag_is_exact_on_a_ramp_whatever_the_step() {
        let tau = 2.5;
        for steps in [1usize, 7, 1000] {
            let dt = 10.0 / steps as f64;
            let mut y = 0.0;
            for i in 0..steps {
                y = lag_step(y, i as f64 * dt, (i + 1) as f64 * dt, dt, tau);
            }
            let exact = 10.0 - tau * (1.0 - (-10.0f64 / tau).exp());
            assert!((y - exact).abs() < 1e-9, "{steps} {y} {exact}");
        }
        assert_eq!(lag_step(1.0, 0.0, 5.0, 1.0, 0.0), 5.0);
        assert_eq!(lag_step(1.0, 0.0, 5.0, 0.0, 2.0), 1.0);
    }

    // A crossing in which the plume lasts a few rows: against steps of a millisecond.
    #[test]
    fn peaks_between_rows_are_kept() {
        let crossing = |t: f64| (-0.5 * ((t - 30.0) / 1.7).powi(2)).exp();
        let times: Vec<f64> = (0..300).map(f64::from).collect();
        for tau in [0.05, 1.5, 6.0] {
            let mut ours: Vec<f64> = times.iter().map(|t| crossing(*t)).collect();
            apply(&times, tau, &mut ours);
            let (mut state, mut t) = (crossing(times[0]), times[0]);
            for (time, ours) in times.iter().zip(&ours) {
                while t < *time - 5e-4 {
                    state = lag_step(state, crossing(t), crossing(t + 1e-3), 1e-3, tau);
                    t += 1e-3;
                }
                // A straight line between rows is off by 0.025.
                assert!(
                    (state - ours).abs() < 0.006,
                    "{tau} s at {time} s: {ours}, {state}"
                );
            }
        }
    }

    #[test]
    fn a_step_of_another_length_changes_nothing_but_the_places() {
        let ramp = |t: &f64| 2.0 * t;
        let times: Vec<f64> = [0.0, 1.0, 1.25, 1.5, 2.0, 3.0, 3.5, 4.0, 5.0].to_vec();
        let mut uneven: Vec<f64> = times.iter().map(ramp).collect();
        apply(&times, 2.0, &mut uneven);
        // y = 2 (t - tau (1 - exp(-t/tau))), see above.
        for (t, y) in times.iter().zip(uneven) {
            let exact = 2.0 * (t - 2.0 * (1.0 - (-t / 2.0f64).exp()));
            assert!((y - exact).abs() < 1e-9, "{t}: {y} {exact}");
        }
    }
}
