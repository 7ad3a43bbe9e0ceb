//! Channels that others determine: computed on board or afterwards, not measured. Beside those that
//! they come from they tell nothing, and a fit would take the agreement for a sensor without noise.

use super::channel::{ALL, CHANNELS, at};

/// Part of a channel's own spread within which it must agree with others to be taken for derived
/// from them: measured by sensors of their own, two channels differ by the noise of both, which is
/// a hundredth of the motion at the very least; numbers in a file are rounded to a thousandth.
const DERIVED_PART: f64 = 2e-3;
/// Fewest rows by which that is told.
const LEAST_ROWS: usize = 20;

/// Channels that are derived, each with what it agrees with.
pub fn found(parts: &[(usize, usize)], channels: &[Vec<f64>]) -> Vec<(usize, String)> {
    let rows: Vec<usize> = parts.iter().flat_map(|&(a, b)| a..b).collect();
    let mut out = Vec::new();
    if let Some(words) = ground_speed(&rows, channels) {
        out.push((at::AIRSPEED, words));
    }
    for c in 1..CHANNELS {
        let copied = |of: &usize| copies(&rows, &channels[*of], &channels[c]);
        if let Some(of) = (0..c).find(copied) {
            let words = format!(
                "{} is {} in another form, computed and not measured",
                ALL[c].label, ALL[of].label
            );
            out.push((c, words));
        }
    }
    out
}

/// That airspeed is the speed over ground.
fn ground_speed(rows: &[usize], channels: &[Vec<f64>]) -> Option<String> {
    let over_ground = |i: usize, axes: usize| {
        let squares = (0..axes).map(|k| channels[at::VELOCITY + k][i].powi(2));
        squares.sum::<f64>().sqrt()
    };
    [2, 3].into_iter().find_map(|axes| {
        let pairs = || {
            let each = rows.iter();
            each.map(|&i| (over_ground(i, axes), channels[at::AIRSPEED][i]))
        };
        let agrees = agreement(pairs(), |ground| ground)?;
        agrees.then(|| {
            "airspeed equals the speed over ground, so it is computed, not measured, and contains no wind"
                .to_owned()
        })
    })
}

/// Whether `b` is a straight function of `a`.
fn copies(rows: &[usize], a: &[f64], b: &[f64]) -> bool {
    let pairs = || rows.iter().map(|&i| (a[i], b[i]));
    let (mut n, mut sums) = (0.0, [0.0; 4]);
    for (a, b) in pairs().filter(|(a, b)| a.is_finite() && b.is_finite()) {
        n += 1.0;
        for (sum, value) in sums.iter_mut().zip([a, b, a * a, a * b]) {
            *sum += value;
        }
    }
    let [a, b, aa, ab] = sums.map(|s| s / n);
    let spread = aa - a * a;
    if spread.is_nan() || spread <= 1e-12 * aa {
        return false;
    }
    let slope = (ab - a * b) / spread;
    agreement(pairs(), |x| b + slope * (x - a)) == Some(true)
}

/// Whether what `told` makes of each pair's first is its second; none of too few pairs, or where
/// the second stands still.
fn agreement(pairs: impl Iterator<Item = (f64, f64)>, told: impl Fn(f64) -> f64) -> Option<bool> {
    let known: Vec<(f64, f64)> = pairs
        .filter(|(a, b)| a.is_finite() && b.is_finite())
        .collect();
    if known.len() < LEAST_ROWS {
        return None;
    }
    let n = known.len() as f64;
    let mean = known.iter().map(|p| p.1).sum::<f64>() / n;
    let spread = known.iter().map(|p| (p.1 - mean).powi(2)).sum::<f64>();
    let off = known
        .iter()
        .map(|&(a, b)| (b - told(a)).powi(2))
        .sum::<f64>();
    (spread > 0.0).then(|| off < DERIVED_PART.powi(2) * spread)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Channels of so many rows, each with a motion of its own.
    fn channels(rows: usize) -> Vec<Vec<f64>> {
        let of = |c: usize| {
            (0..rows)
                .map(|i| 15.0 + (0.1 * (i as f64) * (1.0 + 0.37 * c as f64)).sin())
                .collect()
        };
        (0..CHANNELS).map(of).collect()
    }

    #[test]
    fn what_moves_by_itself_is_measured() {
        assert_eq!(found(&[(0, 400)], &channels(400)), []);
        // Nothing at all is known of a few rows, or of columns that stand still.
        assert_eq!(found(&[(0, 5)], &channels(5)), []);
        assert_eq!(found(&[(0, 400)], &vec![vec![3.0; 400]; CHANNELS]), []);
    }

    #[test]
    fn ground_speed_and_copies_are_said() {
        let mut all = channels(400);
        for i in 0..400 {
            all[at::AIRSPEED][i] = (0..3)
                .map(|k| all[at::VELOCITY + k][i].powi(2))
                .sum::<f64>()
                .sqrt();
            all[at::BETA][i] = 0.3 - 2.0 * all[at::ALPHA][i];
        }
        let told = found(&[(0, 400)], &all);
        let places: Vec<usize> = told.iter().map(|t| t.0).collect();
        assert_eq!(places, [at::AIRSPEED, at::BETA], "{told:?}");
    }
}
