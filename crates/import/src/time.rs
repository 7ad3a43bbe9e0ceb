//! Dates and times of day in the notations of logs.

use formats::calendar::{DAY_S, days};

/// Order of day and month in a date of three numbers that does not begin with the year.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum DateOrder {
    /// Day, month, year.
    DayFirst,
    /// Month, day, year.
    MonthFirst,
}

/// A date and time of day as written.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Stamp {
    /// Seconds since 1970 that the clock showed.
    pub clock_s: f64,
    /// Offset of that clock from UTC, s; none if it is not written.
    pub ahead_s: Option<f64>,
}

/// Letters that begin the names of months.
const MONTHS: [&[u8; 3]; 12] = [
    b"jan", b"feb", b"mar", b"apr", b"may", b"jun", b"jul", b"aug", b"sep", b"oct", b"nov", b"dec",
];

/// Reads bytes from the left.
struct Bytes<'a>(&'a [u8]);

impl Bytes<'_> {
    fn peek(&self) -> Option<u8> {
        self.0.first().copied()
    }

    fn skip(&mut self, which: impl Fn(u8) -> bool) {
        while self.peek().is_some_and(&which) {
            self.0 = &self.0[1..];
        }
    }

    fn eat(&mut self, byte: u8) -> bool {
        let is = self.peek() == Some(byte);
        if is {
            self.0 = &self.0[1..];
        }
        is
    }

    /// At most `most` digits as a number, and how many there were.
    fn digits(&mut self, most: usize) -> Option<(i64, usize)> {
        let count = self
            .0
            .iter()
            .take(most)
            .take_while(|b| b.is_ascii_digit())
            .count();
        let value = self.0[..count]
            .iter()
            .fold(0, |n, d| n * 10 + i64::from(d - b'0'));
        self.0 = &self.0[count..];
        (count > 0).then_some((value, count))
    }

    /// A month's name of three letters or more.
    fn month(&mut self) -> Option<i64> {
        let word = self
            .0
            .iter()
            .take_while(|b| b.is_ascii_alphabetic())
            .count();
        let name = self.0.get(..3).filter(|_| word >= 3)?;
        let at = MONTHS
            .iter()
            .position(|m| name.eq_ignore_ascii_case(&m[..]))?;
        self.0 = &self.0[word..];
        Some(at as i64 + 1)
    }

    /// Digits after a point as a part of one.
    fn fraction(&mut self) -> f64 {
        let count = self.0.iter().take_while(|b| b.is_ascii_digit()).count();
        // Beyond nanoseconds nothing is measured.
        let value = self.0[..count.min(9)]
            .iter()
            .fold(0.0, |n, d| n * 10.0 + f64::from(d - b'0'));
        self.0 = &self.0[count..];
        value / 10_f64.powi(count.min(9) as i32)
    }
}

/// A date and a time of day in one text: ISO 8601 and its relatives (`2024-05-01T10:00:00.5+02:00`,
/// `01/05/2024 10:00`, `1.5.2024 10:00:00`, `20240501T100000Z`, `01-May-2024 10:00:00`, `05/01/2024 10:00 PM`).
/// None where it is none, or where the order of day and month is needed and not given.
pub fn stamp(text: &[u8], order: Option<DateOrder>) -> Option<Stamp> {
    let mut bytes = Bytes(text);
    bytes.skip(|b| b == b' ' || b == b'"');
    let day = date(&mut bytes, order)?;
    bytes.skip(|b| b == b' ' || b == b'T' || b == b't' || b == b'_' || b == b',');
    let (of_day_s, ahead_s) = if bytes.0.is_empty() {
        return None;
    } else {
        time_of_day(&mut bytes)?
    };
    Some(Stamp {
        clock_s: day as f64 * DAY_S + of_day_s,
        ahead_s,
    })
}

/// A date alone, as days since 1970.
pub fn date_alone(text: &[u8], order: Option<DateOrder>) -> Option<i64> {
    let mut bytes = Bytes(text);
    bytes.skip(|b| b == b' ' || b == b'"');
    let day = date(&mut bytes, order)?;
    bytes.skip(|b| b == b' ' || b == b'"');
    bytes.0.is_empty().then_some(day)
}

/// A time of day alone, s, with its offset from UTC where that is written.
pub fn time_alone(text: &[u8]) -> Option<(f64, Option<f64>)> {
    let mut bytes = Bytes(text);
    bytes.skip(|b| b == b' ' || b == b'"');
    time_of_day(&mut bytes)
}

fn date(bytes: &mut Bytes<'_>, order: Option<DateOrder>) -> Option<i64> {
    let apart = |b: u8| matches!(b, b'-' | b'/' | b'.' | b' ');
    let (first, count) = bytes.digits(8)?;
    if count == 8 {
        return days(first / 10_000, first / 100 % 100, first % 100);
    }
    if !bytes.peek().is_some_and(apart) {
        return None;
    }
    bytes.0 = &bytes.0[1..];
    let (second, named) = match bytes.month() {
        Some(month) => (month, true),
        None => (bytes.digits(2)?.0, false),
    };
    if !bytes.peek().is_some_and(apart) {
        return None;
    }
    bytes.0 = &bytes.0[1..];
    let (third, digits) = bytes.digits(4)?;
    if count == 4 {
        return days(first, second, third);
    }
    // Years of two digits are of this century: no logger of the last one is still read.
    let year = if digits == 2 { 2000 + third } else { third };
    match (named, order) {
        (true, _) | (false, Some(DateOrder::DayFirst)) => days(year, second, first),
        (false, Some(DateOrder::MonthFirst)) => days(year, first, second),
        (false, None) => None,
    }
}

fn time_of_day(bytes: &mut Bytes<'_>) -> Option<(f64, Option<f64>)> {
    let (first, count) = bytes.digits(6)?;
    let (mut hour, minute, second) = match count {
        // hhmmss as a number has five digits before ten o'clock.
        5 | 6 => (first / 10_000, first / 100 % 100, first % 100),
        4 => (first / 100, first % 100, 0),
        1 | 2 if bytes.eat(b':') => {
            let minute = bytes.digits(2)?.0;
            let second = if bytes.eat(b':') {
                bytes.digits(2)?.0
            } else {
                0
            };
            (first, minute, second)
        }
        _ => return None,
    };
    let mut part = 0.0;
    if bytes.eat(b'.') || bytes.eat(b',') || (count <= 2 && bytes.eat(b':')) {
        part = bytes.fraction();
    }
    bytes.skip(|b| b == b' ');
    if let [letter, b'M' | b'm', ..] = bytes.0
        && letter.eq_ignore_ascii_case(&b'P') | letter.eq_ignore_ascii_case(&b'A')
    {
        hour = hour % 12
            + if letter.eq_ignore_ascii_case(&b'P') {
                12
            } else {
                0
            };
        bytes.0 = &bytes.0[2..];
        bytes.skip(|b| b == b' ');
    }
    let ahead_s = ahead(bytes)?;
    bytes.skip(|b| b == b' ' || b == b'"');
    let in_day = (0..24).contains(&hour) && (0..60).contains(&minute) && (0..61).contains(&second);
    let whole = (hour * 3600 + minute * 60 + second) as f64;
    (in_day && bytes.0.is_empty()).then_some((whole + part, ahead_s))
}

/// The offset behind a time: nothing, `Z` or an offset. The outer none is text that is no zone.
fn ahead(bytes: &mut Bytes<'_>) -> Option<Option<f64>> {
    for name in [&b"UTC"[..], b"GMT", b"Z", b"z"] {
        if bytes.0.starts_with(name) {
            bytes.0 = &bytes.0[name.len()..];
            if bytes.0.is_empty() || name.len() == 1 {
                return Some(Some(0.0));
            }
            break;
        }
    }
    let sign = match bytes.peek() {
        Some(b'+') => 1.0,
        Some(b'-') => -1.0,
        _ => return Some(None),
    };
    bytes.0 = &bytes.0[1..];
    let (hours, count) = bytes.digits(4)?;
    let (hours, minutes) = if count > 2 {
        (hours / 100, hours % 100)
    } else if bytes.eat(b':') {
        (hours, bytes.digits(2)?.0)
    } else {
        (hours, 0)
    };
    (hours <= 14 && minutes < 60).then_some(Some(sign * (hours * 3600 + minutes * 60) as f64))
}

/// Offset from UTC, s, of a zone: `UTC`, `Z`, `+02:00`, `-0330`.
pub fn zone(text: &str) -> Option<f64> {
    let mut bytes = Bytes(text.trim().as_bytes());
    let ahead_s = ahead(&mut bytes)?;
    ahead_s.filter(|_| bytes.0.is_empty())
}

/// Unit of a count since 1970, told by its size: seconds in one, and its name. The counts of 1973 to 2286 in s, ms, µs and
/// ns do not overlap. None of a value outside of these.
pub fn epoch_unit(value: f64) -> Option<(f64, &'static str)> {
    match value {
        v if !(1e8..1e20).contains(&v) => None,
        v if v < 1e10 => Some((1.0, "s")),
        v if v < 1e11 => None,
        v if v < 1e13 => Some((1e-3, "ms")),
        v if v < 1e14 => None,
        v if v < 1e16 => Some((1e-6, "us")),
        v if v < 1e17 => None,
        v if v < 1e19 => Some((1e-9, "ns")),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    // date -u -d 2024-05-01T10:00:00Z +%s
    const MAY: f64 = 1_714_557_600.0;

    fn utc(text: &str, order: Option<DateOrder>) -> Option<f64> {
        stamp(text.as_bytes(), order).map(|s| s.clock_s - s.ahead_s.unwrap_or(0.0))
    }

    #[test]
    fn stamps_are_read_as_people_write_them() {
        for text in [
            "2024-05-01T10:00:00Z",
            "2024-05-01 10:00:00",
            "2024/05/01 10:00",
            "2024-05-01T12:00:00+02:00",
            "2024-05-01T06:30:00-0330",
            "20240501T100000Z",
            "2024-05-01 10:00:00 UTC",
            "2024-05-01 10:00:00.000",
            "01-May-2024 10:00:00",
            "2024 05 01 10:00",
            "\"2024-05-01 10:00:00\"",
        ] {
            assert_eq!(utc(text, None), Some(MAY), "{text}");
        }
        let day = Some(DateOrder::DayFirst);
        let month = Some(DateOrder::MonthFirst);
        assert_eq!(utc("01/05/2024 10:00:00", day), Some(MAY));
        assert_eq!(utc("1.5.2024 10:00", day), Some(MAY));
        assert_eq!(utc("05/01/2024 10:00:00", month), Some(MAY));
        assert_eq!(utc("5/1/24 10:00 AM", month), Some(MAY));
        assert_eq!(utc("5/1/2024 10:00:00 PM", month), Some(MAY + 43_200.0));
        assert_eq!(utc("05/01/2024 10:00:00", None), None);
        assert_eq!(utc("2024-05-01T10:00:00.25Z", None), Some(MAY + 0.25));
        assert_eq!(utc("2024-05-01 10:00:00:250", None), Some(MAY + 0.25));
    }

    #[test]
    fn what_is_no_time_is_none() {
        for text in [
            "2024-02-30 10:00:00",
            "2024-05-01",
            "2024-05-01 25:00:00",
            "now",
            "",
            "2024-05-01 10:00:00 CEST",
            "1714557600",
        ] {
            assert_eq!(utc(text, Some(DateOrder::DayFirst)), None, "{text}");
        }
        assert_eq!(time_alone(b"10:00:60.5"), Some((36_060.5, None)));
        assert_eq!(date_alone(b"2024-05-01", None), Some(19_844));
        assert_eq!(zone("+05:30"), Some(19_800.0));
        assert_eq!(zone("UTC"), Some(0.0));
        assert_eq!(zone("CET"), None);
    }

    #[test]
    fn counts_since_1970_are_told_by_their_size() {
        for (value, factor) in [
            (MAY, 1.0),
            (MAY * 1e3, 1e-3),
            (MAY * 1e6, 1e-6),
            (MAY * 1e9, 1e-9),
        ] {
            assert_eq!(epoch_unit(value).unwrap().0, factor);
        }
        assert_eq!(epoch_unit(3600.0), None);
    }
}
