//! Days of the Gregorian calendar and times of day, in UTC.
//!
//! Four functions of our own: `jiff` without zones would cost a first build 12 s of CPU for them.

/// Seconds of a day.
pub const DAY_S: f64 = 86_400.0;

/// Days from 1970-01-01 to a date of the Gregorian calendar; none of a date that there is not (Hinnant,
/// *chrono-compatible low-level date algorithms*, `days_from_civil`).
pub fn days(year: i64, month: i64, day: i64) -> Option<i64> {
    let leap = year % 4 == 0 && (year % 100 != 0 || year % 400 == 0);
    let length = match month {
        2 => 28 + i64::from(leap),
        4 | 6 | 9 | 11 => 30,
        1..=12 => 31,
        _ => return None,
    };
    if !(1..=length).contains(&day) || !(1900..=9999).contains(&year) {
        return None;
    }
    let (y, m) = if month <= 2 {
        (year - 1, month + 9)
    } else {
        (year, month - 3)
    };
    let (era, of_era) = (y.div_euclid(400), y.rem_euclid(400));
    let of_year = (153 * m + 2) / 5 + day - 1;
    Some(era * 146_097 + of_era * 365 + of_era / 4 - of_era / 100 + of_year - 719_468)
}

/// Year, month and day of a day counted from 1970-01-01 (Hinnant, `civil_from_days`).
pub fn date(days_since_1970: i64) -> (i64, i64, i64) {
    let z = days_since_1970 + 719_468;
    let (era, of_era) = (z.div_euclid(146_097), z.rem_euclid(146_097));
    let year = (of_era - of_era / 1460 + of_era / 36_524 - of_era / 146_096) / 365;
    let of_year = of_era - (365 * year + year / 4 - year / 100);
    let m = (5 * of_year + 2) / 153;
    let day = of_year - (153 * m + 2) / 5 + 1;
    let month = if m < 10 { m + 3 } else { m - 9 };
    (year + era * 400 + i64::from(month <= 2), month, day)
}

/// `2026-11-27T12:30`, with seconds and `Z` or without, as seconds since 1970.
pub fn iso_8601(text: &str) -> Option<f64> {
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

/// A time in ns since 1970 as RFC 3339 has it, to the millisecond: `2026-11-27T12:30:00.000Z`.
pub fn rfc_3339(unix_ns: i64) -> String {
    let ms = unix_ns.div_euclid(1_000_000);
    let (year, month, day) = date(ms.div_euclid(86_400_000));
    let of_day = ms.rem_euclid(86_400_000);
    let (hour, minute) = (of_day / 3_600_000, of_day / 60_000 % 60);
    let (second, ms) = (of_day / 1000 % 60, of_day % 1000);
    format!("{year:04}-{month:02}-{day:02}T{hour:02}:{minute:02}:{second:02}.{ms:03}Z")
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
            let said = rfc_3339(unix_s as i64 * 1_000_000_000 + 1_500_000);
            assert!(
                said.starts_with(&text[..10]) && said.ends_with(".001Z"),
                "{said}"
            );
            assert_eq!(iso_8601(&said.replace(".001", "")), Some(unix_s));
        }
        for wrong in ["2026-02-29T00:00", "2026-11-27", "2026-11-27T25:00", "now"] {
            assert_eq!(iso_8601(wrong), None, "{wrong}");
        }
        for day in [-1, 0, 59, 60, 11_016, 20_000, 20_784] {
            let (year, month, of_month) = date(day);
            assert_eq!(days(year, month, of_month), Some(day));
        }
    }
}
