//! Scores of predicted against measured concentrations (Chang & Hanna 2004, "Air quality model
//! performance evaluation", Meteorol. Atmos. Phys. 87, 167–196), with bootstrap intervals.

use rand::{Rng, RngExt};

use crate::PlumeError;

/// The five scores. Perfect: FAC2 1, FB 0, NMSE 0, MG 1, VG 1.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Scores {
    /// Part of predictions within a factor of two.
    pub fac2: f64,
    /// Fractional bias 2 (mean measured − mean predicted)/(sum of the means): positive when the
    /// model is too low.
    pub fb: f64,
    /// Normalised mean square error.
    pub nmse: f64,
    /// Geometric mean bias exp(mean ln measured − mean ln predicted): above 1 when too low.
    pub mg: f64,
    /// Geometric variance exp(mean (ln measured − ln predicted)²).
    pub vg: f64,
}

/// A score with its 95 % bootstrap interval.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct WithInterval {
    /// All data.
    pub value: Scores,
    /// 2.5 % quantile of each score.
    pub low: Scores,
    /// 97.5 % quantile of each score.
    pub high: Scores,
}

/// A pair (measured, predicted).
pub type Pair = (f64, f64);

/// Correlation of pairs (Pearson); none where either side does not vary.
pub fn correlation(pairs: impl Iterator<Item = Pair> + Clone) -> Option<f64> {
    let n = pairs.clone().count() as f64;
    let sums = pairs
        .clone()
        .fold((0.0, 0.0), |sum, p| (sum.0 + p.0, sum.1 + p.1));
    let (mean_a, mean_b) = (sums.0 / n, sums.1 / n);
    let [both, aa, bb] = pairs.fold([0.0; 3], |[ab, aa, bb], (a, b)| {
        let (a, b) = (a - mean_a, b - mean_b);
        [ab + a * b, aa + a * a, bb + b * b]
    });
    let size = (aa * bb).sqrt();
    (size > 0.0).then(|| both / size)
}

/// Sums that give the scores; those of groups add up.
#[derive(Debug, Clone, Copy, Default)]
struct Sums {
    n: f64,
    measured: f64,
    predicted: f64,
    square: f64,
    within: f64,
    log: f64,
    log_square: f64,
}

impl Sums {
    fn add_pair(&mut self, (measured, predicted): Pair, floor: f64) {
        self.n += 1.0;
        self.measured += measured;
        self.predicted += predicted;
        self.square += (measured - predicted).powi(2);
        let (m, p) = (measured.max(floor), predicted.max(floor));
        let ratio = p / m;
        self.within += f64::from(u8::from((0.5..=2.0).contains(&ratio)));
        let log = (m / p).ln();
        self.log += log;
        self.log_square += log * log;
    }

    fn add(&mut self, other: &Sums) {
        self.n += other.n;
        self.measured += other.measured;
        self.predicted += other.predicted;
        self.square += other.square;
        self.within += other.within;
        self.log += other.log;
        self.log_square += other.log_square;
    }

    fn scores(&self) -> Scores {
        Scores {
            fac2: self.within / self.n,
            fb: 2.0 * (self.measured - self.predicted) / (self.measured + self.predicted),
            nmse: self.square * self.n / (self.measured * self.predicted),
            mg: (self.log / self.n).exp(),
            vg: (self.log_square / self.n).exp(),
        }
    }
}

/// The scores of `pairs`; values under `floor` (the detection limit, positive) count as the
/// floor in ratios and logarithms.
///
/// # Errors
/// No pairs, a floor not positive, or a value that is not finite.
pub fn scores(pairs: &[Pair], floor: f64) -> Result<Scores, PlumeError> {
    Ok(grouped(&[pairs], floor)?.1.scores())
}

fn grouped(groups: &[&[Pair]], floor: f64) -> Result<(Vec<Sums>, Sums), PlumeError> {
    let wrong = |problem: &str| PlumeError::Shape {
        what: "scores",
        problem: problem.to_string(),
    };
    if floor.is_nan() || floor <= 0.0 {
        return Err(wrong("the floor must be positive"));
    }
    let mut total = Sums::default();
    let mut each = Vec::with_capacity(groups.len());
    for group in groups {
        let mut sums = Sums::default();
        for &pair in *group {
            if !pair.0.is_finite() || !pair.1.is_finite() {
                return Err(wrong("a pair is not finite"));
            }
            sums.add_pair(pair, floor);
        }
        total.add(&sums);
        each.push(sums);
    }
    if total.n == 0.0 {
        return Err(wrong("no pairs"));
    }
    Ok((each, total))
}

/// The scores of all `groups` together, with intervals by resampling whole groups (blocks of
/// time, platforms, flights or trials), since readings inside one are not independent.
///
/// # Errors
/// As [`scores`].
pub fn with_interval<R: Rng>(
    groups: &[&[Pair]],
    floor: f64,
    resamples: usize,
    rng: &mut R,
) -> Result<WithInterval, PlumeError> {
    let (each, total) = grouped(groups, floor)?;
    // Sums of whole groups are drawn, not pairs: a resample costs as many additions as there are
    // groups (percentile bootstrap, Efron and Tibshirani 1993, section 13.3).
    let mut drawn: Vec<[f64; 5]> = Vec::with_capacity(resamples);
    for _ in 0..resamples {
        let mut sums = Sums::default();
        for _ in 0..each.len() {
            sums.add(&each[rng.random_range(0..each.len())]);
        }
        if sums.n > 0.0 {
            let s = sums.scores();
            drawn.push([s.fac2, s.fb, s.nmse, s.mg, s.vg]);
        }
    }
    let quantile = |q: f64| {
        let mut out = [f64::NAN; 5];
        for (k, slot) in out.iter_mut().enumerate() {
            let mut column: Vec<f64> = drawn.iter().map(|d| d[k]).collect();
            column.sort_by(f64::total_cmp);
            if let Some(last) = column.len().checked_sub(1) {
                *slot = column[(q * last as f64).round() as usize];
            }
        }
        Scores {
            fac2: out[0],
            fb: out[1],
            nmse: out[2],
            mg: out[3],
            vg: out[4],
        }
    };
    Ok(WithInterval {
        value: total.scores(),
        low: quantile(0.025),
        high: quantile(0.975),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;
    use rand::rngs::ChaCha8Rng;

    const PAIRS: [Pair; 4] = [(1.0, 2.0), (2.0, 2.0), (4.0, 1.0), (8.0, 10.0)];

    #[test]
    fn correlation_is_numpys() {
        // python3: numpy.corrcoef([1, 2, 3, 5], [2, 1, 4, 6])[0, 1]
        let pairs = [(1.0, 2.0), (2.0, 1.0), (3.0, 4.0), (5.0, 6.0)];
        let found = correlation(pairs.into_iter()).unwrap();
        assert!((found - 0.902_243_638_678_106_1).abs() < 1e-12, "{found}");
        let flat = pairs.map(|p| (p.0, 3.0));
        assert_eq!(correlation(flat.into_iter()), None);
    }

    // python3: co=[1,2,4,8]; cp=[2,2,1,10]; FB=2*(15-15)/30=0; NMSE=mean((co-cp)^2)/(3.75^2)
    // = 3.5/14.0625; MG=exp(mean(log(co/cp)))=1.124683; VG=exp(mean(log(co/cp)^2))=1.843745.
    #[test]
    fn by_hand() {
        let s = scores(&PAIRS, 1e-9).unwrap();
        assert_eq!(s.fac2, 0.75);
        assert_eq!(s.fb, 0.0);
        assert!((s.nmse - 3.5 / 14.0625).abs() < 1e-12);
        let logs: Vec<f64> = PAIRS.iter().map(|(m, p)| (m / p).ln()).collect();
        assert!((s.mg - (logs.iter().sum::<f64>() / 4.0).exp()).abs() < 1e-12);
        assert!((s.vg - (logs.iter().map(|l| l * l).sum::<f64>() / 4.0).exp()).abs() < 1e-12);
    }

    // A model low by a factor of two everywhere: FB = 2/3, NMSE 0.5 for equal values, MG 2,
    // VG exp(ln²2) = 1.617 (Chang & Hanna 2004, section 3).
    #[test]
    fn factor_of_two_low() {
        let s = scores(&[(2.0, 1.0), (2.0, 1.0)], 1e-9).unwrap();
        assert!((s.fb - 2.0 / 3.0).abs() < 1e-12);
        assert!((s.nmse - 0.5).abs() < 1e-12);
        assert!((s.mg - 2.0).abs() < 1e-12);
        assert!((s.vg - 1.616_806_7).abs() < 1e-6);
        assert_eq!(s.fac2, 1.0);
    }

    #[test]
    fn interval_holds_the_value_and_repeats() {
        let groups: Vec<&[Pair]> = PAIRS.chunks(1).collect();
        let draw = || with_interval(&groups, 1e-9, 500, &mut ChaCha8Rng::seed_from_u64(3)).unwrap();
        let s = draw();
        assert!(s.low.fac2 <= 0.75 && 0.75 <= s.high.fac2);
        assert!(s.low.fb < 0.0 && s.high.fb > 0.0);
        assert_eq!(s, draw());
    }

    #[test]
    fn refuses_nothing_and_nonsense() {
        assert!(scores(&[], 1.0).is_err());
        assert!(scores(&[(f64::NAN, 1.0)], 1.0).is_err());
        assert!(scores(&PAIRS, 0.0).is_err());
    }
}
