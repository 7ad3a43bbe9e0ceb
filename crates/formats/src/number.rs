//! Numbers as text, with the digits that count.

/// Smaller numbers are written with a power of ten.
const LEAST_PLAIN: f64 = 1e-6;
/// So are larger ones.
const MOST_PLAIN: f64 = 1e9;

/// A value and its standard deviation, both to the second significant digit of the latter.
///
/// A value that is known exactly, or of which nothing is known, has three significant digits.
///
/// ```
/// use formats::number::plus_minus;
///
/// assert_eq!(plus_minus(2778.4, 526.0), "2780 ± 530");
/// assert_eq!(plus_minus(72.318, 0.4213), "72.32 ± 0.42");
/// assert_eq!(plus_minus(170.0, 0.0), "170 ± 0");
/// ```
pub fn plus_minus(value: f64, sd: f64) -> String {
    let [value, sd] = value_and_sd(value, sd);
    format!("{value} ± {sd}")
}

/// The two numbers of [`plus_minus`], for columns of a table.
pub fn value_and_sd(value: f64, sd: f64) -> [String; 2] {
    if sd == 0.0 {
        return [significant(value), "0".to_owned()];
    }
    if !(value.is_finite() && sd.is_finite()) {
        return [significant(value), significant(sd)];
    }
    let unit = last_digit(sd, 2);
    // What is far below its standard deviation is written with the power of ten of that.
    let size = value.abs().max(sd.abs());
    if !(LEAST_PLAIN..MOST_PLAIN).contains(&size) {
        let power = exponent(size);
        let scaled = |v: f64| format!("{}e{power}", to_place(v / 10f64.powi(power), unit - power));
        return [value, sd].map(scaled);
    }
    [value, sd].map(|v| to_place(v, unit))
}

/// A number to three significant digits; a dash for what is none.
///
/// ```
/// use formats::number::significant;
///
/// assert_eq!([0.0, 0.012_345, 12_345.0].map(significant), ["0", "0.0123", "12345"]);
/// assert_eq!([1.23e-9, f64::NAN].map(significant), ["1.23e-9", "–"]);
/// ```
pub fn significant(value: f64) -> String {
    match value.abs() {
        _ if !value.is_finite() => fixed(value, 0),
        0.0 => "0".to_owned(),
        size if !(LEAST_PLAIN..MOST_PLAIN).contains(&size) => format!("{value:.2e}"),
        // No digit before the point is hidden by zeros.
        _ => to_place(value, last_digit(value, 3).min(0)),
    }
}

/// The power of ten of the last of `digits` significant digits.
fn last_digit(value: f64, digits: i32) -> i32 {
    // Rounded first: 0.0996 has the two digits 0.10.
    let places = usize::try_from(digits - 1).unwrap_or_default();
    let rounded = format!("{:.places$e}", value.abs());
    let power = rounded.split_once('e').and_then(|(_, p)| p.parse().ok());
    power.unwrap_or(0) + 1 - digits
}

fn exponent(value: f64) -> i32 {
    last_digit(value, 1)
}

/// A number rounded to the digit of a power of ten.
fn to_place(value: f64, power: i32) -> String {
    let unit = 10f64.powi(power.max(0));
    let places = usize::try_from(-power).unwrap_or_default();
    // `round` of a fraction would lose it; below the point the format rounds.
    let rounded = if power < 0 {
        value
    } else {
        (value / unit).round() * unit
    };
    fixed(rounded, places)
}

/// A number with so many digits after the point; a dash for what is none.
///
/// ```
/// use formats::number::fixed;
///
/// assert_eq!([2.345, -0.001, f64::NAN].map(|v| fixed(v, 2)), ["2.35", "0.00", "–"]);
/// ```
pub fn fixed(value: f64, places: usize) -> String {
    if !value.is_finite() {
        return "–".to_owned();
    }
    let text = format!("{value:.places$}");
    // What rounds to nothing has no sign.
    let is_zero = text.bytes().all(|b| matches!(b, b'-' | b'0' | b'.'));
    match text.strip_prefix('-') {
        Some(rest) if is_zero => rest.to_owned(),
        _ => text,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_value_ends_where_its_standard_deviation_does() {
        // Rounded by hand.
        for (value, sd, text) in [
            (546.31, 18.249, "546 ± 18"),
            (1.2345, 0.099_6, "1.23 ± 0.10"),
            (999.6, 9.96, "1000 ± 10"),
            (0.003_2, 0.000_15, "0.00320 ± 0.00015"),
            (-0.04, 0.9, "-0.04 ± 0.90"),
            (-0.001, 0.9, "0.00 ± 0.90"),
            (17.0, 1234.0, "0 ± 1200"),
            (3.2e-8, 1.14e-9, "3.20e-8 ± 0.11e-8"),
            (f64::NAN, 2.0, "– ± 2.00"),
            (12.0, f64::INFINITY, "12.0 ± –"),
        ] {
            assert_eq!(plus_minus(value, sd), text);
        }
    }
}
