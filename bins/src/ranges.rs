//! Ranges of numeric options: a value outside is rejected while the command line is read, by an error that states
//! the range.

use std::fmt::Display;
use std::ops::RangeInclusive;
use std::str::FromStr;

/// Seeds that a scenario file can hold: TOML has whole numbers of 64 bits with a sign.
const SEEDS: RangeInclusive<u64> = 0..=i64::MAX as u64;

/// Durations of a mission that a scenario can have, simulated s.
const DURATIONS_S: RangeInclusive<f64> = 1.0..=1e6;

/// Heights of the geoid above the ellipsoid on Earth, m (EGM2008: -107 to 86).
pub const UNDULATIONS_M: RangeInclusive<f64> = -110.0..=90.0;

/// Largest team that an option accepts: far more vehicles than one machine simulates.
pub const TEAM: usize = 10_000;

/// Reads a seed.
///
/// # Errors
/// Text that is no whole number, or one outside the range.
pub fn seed(text: &str) -> Result<u64, String> {
    within(text, &SEEDS, "a whole number", "")
}

/// Reads a mission's duration, simulated s.
///
/// # Errors
/// Text that is no number, or one outside the range.
pub fn duration_s(text: &str) -> Result<f64, String> {
    within(text, &DURATIONS_S, "a number", " s")
}

/// Reader of whole numbers in `range`.
pub fn whole(
    range: RangeInclusive<usize>,
) -> impl Fn(&str) -> Result<usize, String> + Clone + Send + Sync {
    move |text| within(text, &range, "a whole number", "")
}

/// Reader of numbers in `range`, which has the `unit`, such as `" m"`.
pub fn real(
    range: RangeInclusive<f64>,
    unit: &'static str,
) -> impl Fn(&str) -> Result<f64, String> + Clone + Send + Sync {
    move |text| within(text, &range, "a number", unit)
}

fn within<T: FromStr + PartialOrd + Display>(
    text: &str,
    range: &RangeInclusive<T>,
    kind: &str,
    unit: &str,
) -> Result<T, String> {
    let number = text.parse().ok().filter(|n| range.contains(n));
    number.ok_or_else(|| {
        format!(
            "expected {kind}, {} to {}{unit}",
            range.start(),
            range.end()
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_outside_a_range_are_rejected_with_the_range() {
        assert_eq!(seed("9223372036854775807"), Ok(9_223_372_036_854_775_807));
        for wrong in ["-1", "x", "", "1.5", "9223372036854775808"] {
            let error = seed(wrong).unwrap_err();
            assert!(error.contains("0 to 9223372036854775807"), "{error}");
        }
        assert_eq!(duration_s("1"), Ok(1.0));
        for wrong in ["-5", "0.9", "NaN", "inf", "1000001"] {
            let error = duration_s(wrong).unwrap_err();
            assert!(error.contains("1 to 1000000 s"), "{error}");
        }
        let candidates = whole(1..=10);
        assert_eq!(candidates("10"), Ok(10));
        assert!(candidates("0").is_err() && candidates("11").is_err());
        let height = real(-110.0..=90.0, " m");
        assert_eq!(height("-20"), Ok(-20.0));
        assert_eq!(
            height("-111").unwrap_err(),
            "expected a number, -110 to 90 m"
        );
    }
}
