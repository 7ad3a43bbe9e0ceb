//! Dates and times of day in UTC as seconds since 1970.

pub(super) use crate::calendar::{DAY_S, days};

/// Year and month of a day counted from 1970-01-01.
pub(super) fn month_of(days_since_1970: i64) -> (i64, i64) {
    let z = days_since_1970 + 719_468;
    let (era, of_era) = (z.div_euclid(146_097), z.rem_euclid(146_097));
    let year = (of_era - of_era / 1460 + of_era / 36_524 - of_era / 146_096) / 365;
    let of_year = of_era - (365 * year + year / 4 - year / 100);
    let m = (5 * of_year + 2) / 153;
    let month = if m < 10 { m + 3 } else { m - 9 };
    (year + era * 400 + i64::from(month <= 2), month)
}

/// `2026-11-27T12:30`, with seconds and `Z` or without, as seconds since 1970.
pub(super) fn iso_8601(text: &str) -> Option<f64> {
    let text = text.strip_suffix('Z').unwrap_or(text);
    let (date, time) = text.split_once(['T', ' '])?;
    let numbers = |text: &str, apart: char| -> Option<Vec<i64>> {
        text.split(apart).map(|n| n.parse().ok()).collect()
    };
    let [year, month, day] = numbers(date, '-')?[..] else {
        return None;
    };
    let (hour, minute, second) = match numbers(time, ':')?[..] {
        [hour, minute] => (hour, minute, 0),
        [hour, minute, second] => (hour, minute, second),
        _ => return None,
    };
    let in_day = (0..24).contains(&hour) && (0..60).contains(&minute) && (0..61).contains(&second);
    let days = days(year, month, day).filter(|_| in_day)?;
    Some(days as f64 * DAY_S + (hour * 3600 + minute * 60 + second) as f64)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_are_those_of_other_clocks() {
        // date -u -d 2026-11-27T12:30Z +%s, and so on.
        for (text, unix_s) in [
            ("2026-11-27T12:30", 1_795_782_600.0),
            ("2024-02-29T00:00:01Z", 1_709_164_801.0),
            ("1970-01-01 00:00", 0.0),
        ] {
            assert_eq!(iso_8601(text), Some(unix_s), "{text}");
        }
        for wrong in ["2026-02-29T00:00", "2026-11-27", "2026-11-27T25:00", "now"] {
            assert_eq!(iso_8601(wrong), None, "{wrong}");
        }
        for day in [-1, 0, 59, 60, 11_016, 20_000, 20_784] {
            let (year, month) = month_of(day);
            let first = days(year, month, 1).unwrap();
            assert!((0..31).contains(&(day - first)), "{day}: {year}-{month}");
        }
    }
}
