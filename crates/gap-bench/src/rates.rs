//! Counts as rates with exact intervals.

use statrs::distribution::{Beta, ContinuousCDF};

/// So many of so many.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Rate {
    /// How many did.
    pub hits: usize,
    /// How many could.
    pub of: usize,
}

impl Rate {
    /// Counts one more.
    pub fn add(&mut self, hit: bool) {
        self.hits += usize::from(hit);
        self.of += 1;
    }

    /// The counts of those for which `hit` says yes or no.
    pub fn of<T>(items: impl IntoIterator<Item = T>, hit: impl Fn(T) -> Option<bool>) -> Self {
        let mut rate = Self::default();
        for answer in items.into_iter().filter_map(hit) {
            rate.add(answer);
        }
        rate
    }

    /// The rate; not a number where nothing could.
    pub fn value(self) -> f64 {
        self.hits as f64 / self.of as f64
    }
}

impl std::fmt::Display for Rate {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        if self.of == 0 {
            return f.write_str("–");
        }
        let (low, high) = clopper_pearson(*self);
        let percent = |x: f64| 100.0 * x;
        write!(
            f,
            "{:.1} % ({}/{}; {:.1}–{:.1})",
            percent(self.value()),
            self.hits,
            self.of,
            percent(low),
            percent(high)
        )
    }
}

/// A mean as the tables have it, with so many decimals and its unit; a dash where no case has one.
pub fn mean_or_dash(mean: f64, decimals: usize, unit: &str) -> String {
    if mean.is_nan() {
        return "–".into();
    }
    format!("{mean:.decimals$}{unit}")
}

/// Whether a figure reaches its goal, both as the tables have them: goals such as `≥ 80 %`, `≤ 2.5` and `92–98 %`,
/// figures that begin with their number. None where there is no goal or no figure.
pub fn reaches(goal: &str, figure: &str) -> Option<bool> {
    let number = |text: &str| text.split(' ').next()?.parse::<f64>().ok();
    let figure = number(figure)?;
    if let Some(least) = goal.strip_prefix("≥ ") {
        return Some(figure >= number(least)?);
    }
    if let Some(most) = goal.strip_prefix("≤ ") {
        return Some(figure <= number(most)?);
    }
    let (low, high) = goal.split_once('–')?;
    Some((number(low)?..=number(high)?).contains(&figure))
}

/// The 95 % interval of Clopper & Pearson (1934).
pub fn clopper_pearson(rate: Rate) -> (f64, f64) {
    let (k, n) = (rate.hits as f64, rate.of as f64);
    let quantile = |a: f64, b: f64, p: f64| Beta::new(a, b).map_or(f64::NAN, |d| d.inverse_cdf(p));
    let low = if rate.hits == 0 {
        0.0
    } else {
        quantile(k, n - k + 1.0, 0.025)
    };
    let high = if rate.hits == rate.of {
        1.0
    } else {
        quantile(k + 1.0, n - k, 0.975)
    };
    (low, high)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_mean_of_nothing_is_a_dash() {
        assert_eq!(mean_or_dash(90.46, 1, " %"), "90.5 %");
        assert_eq!(mean_or_dash(f64::NAN, 1, " %"), "–");
        assert_eq!(Rate::default().to_string(), "–");
    }

    #[test]
    fn a_figure_is_held_against_its_goal() {
        let cases = [
            ("≥ 80 %", "80.0 % (4/5; 28.4–99.5)", Some(true)),
            ("≥ 80 %", "42.9 % (6/14; 17.7–71.1)", Some(false)),
            ("≤ 2.5", "2.83", Some(false)),
            ("92–98 %", "92.6 % (25/27; 75.7–99.1)", Some(true)),
            ("92–98 %", "98.1 % (1/2; 0–1)", Some(false)),
            ("≥ 80 %", "–", None),
            ("", "3.0 %", None),
        ];
        for (goal, figure, reached) in cases {
            assert_eq!(reaches(goal, figure), reached, "{goal} {figure}");
        }
    }

    // R: binom.test(x, n)$conf.int: 2 of 200 0.0012, 0.0357; 5 of 500 .0033, .0232; 0 of 20 0, .1684.
    #[test]
    fn intervals_of_a_textbook() {
        for (hits, of, low, high) in [
            (2, 200, 0.001_214, 0.035_650),
            (0, 20, 0.0, 0.168_433),
            (20, 20, 0.831_567, 1.0),
        ] {
            let got = clopper_pearson(Rate { hits, of });
            assert!(
                (got.0 - low).abs() < 1e-4 && (got.1 - high).abs() < 1e-4,
                "{got:?}"
            );
        }
    }
}
