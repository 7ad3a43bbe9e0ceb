//! Angles in cells, codes for missing values, and rounding.

use formats::delimited::number;

/// What stands for no value in a cell of numbers.
const NONE: [&str; 16] = [
    "", "nan", "na", "n/a", "null", "none", "-", "--", "---", "mm", "nil", "#n/a", "*", "invalid",
    "no data", "nodata",
];

/// Whether a cell says that there is no value.
pub fn is_none(cell: &[u8]) -> bool {
    cell.len() <= 7 && NONE.iter().any(|n| cell.eq_ignore_ascii_case(n.as_bytes()))
}

/// Degrees, minutes and seconds with a letter for the side, as `43°26'30.1"N`, `43 26 30.1 N`,
/// `W 7° 51.786'`; also plain degrees.
pub fn degrees_minutes_seconds(cell: &[u8], decimal_comma: bool) -> Option<f64> {
    let text = String::from_utf8_lossy(cell);
    let mut parts: Vec<f64> = Vec::new();
    let mut sign = 1.0;
    let mut digits = String::new();
    for c in text.chars().chain([' ']) {
        match c {
            '0'..='9' | '.' => digits.push(c),
            ',' if decimal_comma => digits.push('.'),
            _ => {
                if !digits.is_empty() {
                    parts.push(digits.parse().ok()?);
                    digits.clear();
                }
                match c {
                    'S' | 's' | 'W' | 'w' | '-' => sign = -1.0,
                    'N' | 'n' | 'E' | 'e' | '+' | '°' | 'º' | '˚' | '\'' | '′' | '’' | '"'
                    | '″' | '”' | ':' | ' ' | 'd' | '\u{fffd}' => {}
                    _ => return None,
                }
            }
        }
    }
    let (degrees, minutes, seconds) = match parts[..] {
        [d] => (d, 0.0, 0.0),
        [d, m] => (d, m, 0.0),
        [d, m, s] => (d, m, s),
        _ => return None,
    };
    let fits = degrees <= 360.0 && minutes < 60.0 && seconds < 60.0;
    fits.then_some(sign * (degrees + minutes / 60.0 + seconds / 3600.0))
}

/// Degrees times hundred plus minutes (`4326.502`, `00751.786`), with a letter for the side in the cell or none.
pub fn nmea(cell: &[u8], decimal_comma: bool) -> Option<f64> {
    let side = |b: &u8| b"NSEWnsew".contains(b);
    let negative = cell.iter().any(|b| b"SWsw".contains(b));
    let digits: Vec<u8> = cell
        .iter()
        .copied()
        .filter(|b| !side(b) && *b != b' ')
        .collect();
    let value = number(&digits, decimal_comma)?;
    let degrees = (value.abs() / 100.0).trunc();
    let minutes = value.abs() - 100.0 * degrees;
    let angle = degrees + minutes / 60.0;
    let sign = if negative {
        -value.signum()
    } else {
        value.signum()
    };
    (minutes < 60.0).then_some(sign * angle)
}

/// `value` rounded to `decimals`: what a conversion adds beyond them is no measurement.
pub fn rounded(value: f64, decimals: u8) -> f64 {
    let scale = 10_f64.powi(i32::from(decimals));
    let scaled = value * scale;
    // Beyond this a double has no decimals to round.
    if scaled.abs() < 9e15 {
        scaled.round() / scale
    } else {
        value
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn close(a: Option<f64>, b: f64) -> bool {
        a.is_some_and(|a| (a - b).abs() < 1e-9)
    }

    // 43°26'30.12" = 43 + 26/60 + 30.12/3600, by hand.
    #[test]
    fn angles_are_read_as_people_write_them() {
        let lat = 43.441_7;
        for text in [
            "43°26'30.12\"N",
            "43 26 30.12 N",
            "N43:26:30.12",
            "43° 26.502' N",
            "43.4417",
        ] {
            assert!(
                close(degrees_minutes_seconds(text.as_bytes(), false), lat),
                "{text}"
            );
        }
        let west = degrees_minutes_seconds("7°51'47,16\"W".as_bytes(), true);
        assert!(close(west, -(7.0 + 51.0 / 60.0 + 47.16 / 3600.0)));
        assert_eq!(degrees_minutes_seconds(b"43 61 0", false), None);
        assert_eq!(degrees_minutes_seconds(b"north", false), None);
    }

    // NMEA 0183 example sentence $GPGGA,123519,4807.038,N,01131.000,E: 48°07.038' N, 11°31.000' E.
    #[test]
    fn nmea_is_degrees_and_minutes() {
        assert!(close(nmea(b"4807.038", false), 48.1173));
        assert!(close(nmea(b"01131.000E", false), 11.0 + 31.0 / 60.0));
        assert!(close(nmea(b"01131.000 W", false), -(11.0 + 31.0 / 60.0)));
        assert_eq!(nmea(b"4867.038", false), None);
    }

    #[test]
    fn codes_for_none_and_rounding() {
        assert!(is_none(b"NaN") && is_none(b"") && is_none(b"N/A") && !is_none(b"0"));
        assert_eq!(rounded(30.480_000_000_000_004, 4), 30.48);
    }
}
