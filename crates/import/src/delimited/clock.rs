//! Which columns of a log are its time, and how they are read.

use super::layout::Layout;
use crate::ImportError;
use crate::map::LogMap;
use crate::number;
use crate::quantity::Dimension;
use crate::recognise::Clock;
use crate::time::{self, DateOrder};
use crate::unit::{Conversion, Unit};
use formats::calendar::{DAY_S, days};
use formats::delimited::{Cells, number as parse_number};

/// Rows by which a column of times is judged.
const JUDGED: usize = 200;

/// Numbers of the days in which spreadsheets count (since 1900), of 1954 to 2119.
const SPREADSHEET_DAYS: std::ops::Range<f64> = 20_000.0..80_000.0;
/// Rows are closer than this in days (3 min), and nobody logs 500 in a second.
const SPREADSHEET_STEP: f64 = 0.002;

/// How the time of a row is read. Cells are counted from 0.
#[derive(Debug, Clone, PartialEq)]
pub enum TimeCells {
    /// Date and time of day in one cell.
    Stamp(usize),
    /// Date in one cell, time of day in another.
    DateAndTime(usize, usize),
    /// A time of day without a date: seconds of the first row's day.
    OfDay(usize),
    /// A number, of which so many make a second, and perhaps nanoseconds more in another cell.
    Count(usize, f64, Option<usize>),
    /// Year, month, day, hour, minute and perhaps second.
    Parts(Vec<usize>),
}

impl TimeCells {
    /// The indices of all cells of a time.
    fn all(&self) -> Vec<usize> {
        match self {
            Self::Stamp(c) | Self::OfDay(c) | Self::Count(c, _, None) => vec![*c],
            Self::DateAndTime(a, b) | Self::Count(a, _, Some(b)) => vec![*a, *b],
            Self::Parts(all) => all.clone(),
        }
    }
}

/// The clock of a log.
#[derive(Debug, Clone, PartialEq)]
pub struct LogClock {
    /// Where its times stand.
    pub cells: TimeCells,
    order: Option<DateOrder>,
    /// What it is ahead of UTC where its times do not say it, s.
    ahead_s: f64,
    /// What is added, s.
    shift_s: f64,
    decimal_comma: bool,
    /// Days that a time of day has gone on, s, and the last one.
    midnight: (f64, f64),
    /// Whether its times are those of the calendar.
    pub is_absolute: bool,
}

/// What a column of times holds.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Kind {
    Stamp {
        fine: bool,
    },
    Date,
    OfDay {
        fine: bool,
    },
    Epoch {
        per_second: f64,
        name: &'static str,
        fine: bool,
    },
    Count,
}

/// What is known of how a clock was found.
#[derive(Debug, Default)]
pub struct ClockNotes {
    /// Assumptions and notices, in words.
    pub notices: Vec<String>,
    /// What of a mapping file says the same.
    pub map: LogMap,
}

type Rows = [Cells];

/// The clock of a log by its headers and first rows, `zero_s` being the time from which is counted.
///
/// # Errors
/// No time, one that cannot be told, or one that was stated and is not there.
pub fn find(
    name: &str,
    layout: &Layout,
    rows: &Rows,
    map: &LogMap,
    zero_s: f64,
) -> Result<(LogClock, ClockNotes), ImportError> {
    let finder = Finder {
        name,
        layout,
        rows: &rows[..rows.len().min(JUDGED)],
        map,
    };
    let (cells, kind) = match &map.time {
        Some(names) => finder.stated(names.all())?,
        None => finder.recognised()?,
    };
    finder.clock(cells, kind, zero_s)
}

struct Finder<'a> {
    name: &'a str,
    layout: &'a Layout,
    rows: &'a Rows,
    map: &'a LogMap,
}

impl Finder<'_> {
    fn error(&self, what: impl Into<String>, todo: impl Into<String>) -> ImportError {
        ImportError::log(self.name, what, todo)
    }

    fn header(&self, cell: usize) -> &str {
        self.layout
            .headers
            .get(cell)
            .map_or("", |h| h.text.as_str())
    }

    /// The cells of a column that hold something.
    fn cells(&self, column: usize) -> Vec<&[u8]> {
        let cells = self.rows.iter().map(|r| r.get(column));
        cells.filter(|c| !number::is_none(c)).collect()
    }

    fn number(&self, cell: &[u8]) -> Option<f64> {
        parse_number(cell, self.layout.decimal_comma)
    }

    /// What a column of times holds; none where most of its cells are no times.
    fn kind(&self, column: usize) -> Option<Kind> {
        let cells = self.cells(column);
        let most = |n: usize| n * 10 >= cells.len() * 8 && n > 0;
        let count = |f: &dyn Fn(&&&[u8]) -> bool| cells.iter().filter(f).count();
        let orders = [None, Some(DateOrder::DayFirst), Some(DateOrder::MonthFirst)];
        let fine = cells.iter().any(|c| has_fraction(c));
        let mut numbers: Vec<f64> = cells.iter().filter_map(|c| self.number(c)).collect();
        if orders
            .iter()
            .any(|o| most(count(&|c| time::stamp(c, *o).is_some())))
        {
            return Some(Kind::Stamp { fine });
        }
        if orders
            .iter()
            .any(|o| most(count(&|c| time::date_alone(c, *o).is_some())))
        {
            return Some(Kind::Date);
        }
        if most(count(&|c| {
            c.contains(&b':') && time::time_alone(c).is_some()
        })) {
            return Some(Kind::OfDay { fine });
        }
        if !most(numbers.len()) {
            return None;
        }
        numbers.sort_by(f64::total_cmp);
        let Some((second, name)) = time::epoch_unit(numbers[numbers.len() / 2]) else {
            return Some(Kind::Count);
        };
        let fine = second < 1.0 || numbers.iter().any(|v| v.fract() != 0.0);
        Some(Kind::Epoch {
            per_second: (1.0 / second).round(),
            name,
            fine,
        })
    }

    /// The order of day and month in which the dates of these columns are.
    fn order(&self, column: usize) -> Result<Option<DateOrder>, ImportError> {
        if let Some(order) = self.map.date_order().unwrap_or(None) {
            return Ok(Some(order));
        }
        let cells = self.cells(column);
        let fits = |order: Option<DateOrder>| {
            let reads = |c: &&&[u8]| {
                time::stamp(c, order).is_some() || time::date_alone(c, order).is_some()
            };
            cells.iter().filter(reads).count() * 10 >= cells.len() * 8
        };
        if fits(None) {
            return Ok(None);
        }
        let dotted = cells
            .first()
            .is_some_and(|c| c.iter().filter(|b| **b == b'.').count() >= 2);
        match (
            fits(Some(DateOrder::DayFirst)),
            fits(Some(DateOrder::MonthFirst)),
        ) {
            (true, false) => Ok(Some(DateOrder::DayFirst)),
            (false, true) => Ok(Some(DateOrder::MonthFirst)),
            // Dates with points are day first wherever they are written.
            _ if dotted => Ok(Some(DateOrder::DayFirst)),
            _ => Err(self.error(
                format!(
                    "column \"{}\": \"{}\" may begin with the day or the month",
                    self.header(column),
                    cells
                        .first()
                        .map_or(String::new(), |c| crate::decode::letters(c))
                ),
                "state --date-order dmy or mdy",
            )),
        }
    }

    fn stated(&self, names: &[String]) -> Result<(TimeCells, Kind), ImportError> {
        let cells = names
            .iter()
            .map(|n| self.layout.column(self.name, n))
            .collect::<Result<Vec<usize>, _>>()?;
        let nothing = |cell: usize| {
            self.error(
                format!("column \"{}\" contains no times", self.header(cell)),
                "state another column as time",
            )
        };
        // A clock may not be set yet in the first rows, such as that of a GPS without a fix.
        let unset = |cell: usize, kind| self.cells(cell).is_empty().then_some(kind);
        match cells[..] {
            [one] => {
                let kind = self.kind(one).or(unset(one, Kind::Stamp { fine: false }));
                let kind = kind.ok_or_else(|| nothing(one))?;
                Ok((self.single(one, kind), kind))
            }
            [date, of_day] => {
                let kinds = (
                    self.kind(date).or(unset(date, Kind::Date)),
                    self.kind(of_day).or(unset(of_day, Kind::OfDay { fine: false })),
                );
                match kinds {
                    (Some(Kind::Date), Some(kind @ Kind::OfDay { .. })) => {
                        Ok((TimeCells::DateAndTime(date, of_day), kind))
                    }
                    // Times of day without colons, as 100000.
                    (Some(Kind::Date), Some(_)) => {
                        Ok((TimeCells::DateAndTime(date, of_day), Kind::OfDay { fine: false }))
                    }
                    (Some(Kind::Epoch { per_second, name, .. }), Some(_)) => {
                        let kind = Kind::Epoch { per_second, name, fine: true };
                        Ok((TimeCells::Count(date, per_second, Some(of_day)), kind))
                    }
                    _ => Err(nothing(date)),
                }
            }
            [_, _, _, _, _] | [_, _, _, _, _, _] => Ok((TimeCells::Parts(cells), Kind::Stamp { fine: false })),
            _ => Err(self.error(
                format!("time names {} columns", names.len()),
                "state 1 column, 2 (date and time, or seconds and nanoseconds), or 5 or 6 (year to second)",
            )),
        }
    }

    fn single(&self, cell: usize, kind: Kind) -> TimeCells {
        match kind {
            Kind::Stamp { .. } | Kind::Date => TimeCells::Stamp(cell),
            Kind::OfDay { .. } => TimeCells::OfDay(cell),
            Kind::Epoch { per_second, .. } => TimeCells::Count(cell, per_second, None),
            Kind::Count => TimeCells::Count(cell, self.per_second(cell).0, None),
        }
    }

    /// How many of a column's numbers make a second, and whether that is stated anywhere.
    fn per_second(&self, cell: usize) -> (f64, bool) {
        let parse = |text: &str| Unit::parse(Dimension::Duration, text);
        let header = self.layout.headers.get(cell);
        let unit = self.map.time_unit.as_deref().and_then(parse);
        let unit = unit.or_else(|| header.and_then(|h| h.time()).and_then(|(_, unit, _)| unit));
        let unit = unit.or_else(|| self.layout.units.get(cell).and_then(|u| parse(u)));
        match unit.map(|u| u.conversion) {
            Some(Conversion::Linear { factor, .. }) => (1.0 / factor, true),
            _ => (1.0, false),
        }
    }

    /// The best of the columns that may be times: of the calendar before others, fine before whole seconds, UTC
    /// before local.
    fn recognised(&self) -> Result<(TimeCells, Kind), ImportError> {
        let mut candidates = Vec::new();
        let (mut date, mut of_day) = (None, None);
        for (cell, header) in self.layout.headers.iter().enumerate() {
            let Some((rank, _, clock)) = header.time() else {
                continue;
            };
            let Some(kind) = self.kind(cell) else {
                continue;
            };
            let local = usize::from(clock == Some(Clock::Local));
            let worth = match kind {
                Kind::Stamp { fine: true } | Kind::Epoch { fine: true, .. } => 0,
                Kind::Stamp { .. } | Kind::Epoch { .. } => 2,
                Kind::Count => 4,
                Kind::Date => {
                    date = date.or(Some(cell));
                    continue;
                }
                Kind::OfDay { .. } => {
                    of_day = of_day.or(Some((cell, kind, rank, local)));
                    5
                }
            };
            if kind == Kind::Count && header.is_in_days() {
                continue;
            }
            candidates.push(((worth, local, rank), self.single(cell, kind), kind));
        }
        if let (Some(date), Some((cell, kind, rank, local))) = (date, of_day) {
            let fine = kind == Kind::OfDay { fine: true };
            let worth = if fine { 1 } else { 3 };
            candidates.push((
                (worth, local, rank),
                TimeCells::DateAndTime(date, cell),
                kind,
            ));
        }
        let best = candidates.into_iter().min_by_key(|(worth, ..)| *worth);
        best.map(|(_, cells, kind)| (cells, kind)).ok_or_else(|| {
            let headers: Vec<&str> = self
                .layout
                .headers
                .iter()
                .map(|h| h.text.as_str())
                .collect();
            self.error(
                format!(
                    "no column was recognised as the time; the columns are {}",
                    headers.join(", ")
                ),
                "state time = \"COLUMN\" in a mapping file (--map); fractions of days are not supported",
            )
        })
    }

    fn clock(
        &self,
        cells: TimeCells,
        kind: Kind,
        zero_s: f64,
    ) -> Result<(LogClock, ClockNotes), ImportError> {
        let mut found = ClockNotes::default();
        let columns = cells.all();
        let names: Vec<String> = columns.iter().map(|c| self.header(*c).to_owned()).collect();
        let is_count = matches!(cells, TimeCells::Count(..));
        if kind == Kind::Count && self.is_in_spreadsheet_days(columns[0]) {
            return Err(self.error(
                format!("column \"{}\" looks like day numbers of a spreadsheet", names[0]),
                "format it as date and time in the spreadsheet and save it again (or state time_unit)",
            ));
        }
        let order = match cells {
            TimeCells::Stamp(c) | TimeCells::DateAndTime(c, _) => self.order(c)?,
            _ => None,
        };
        let is_absolute = !matches!(kind, Kind::Count) && !matches!(cells, TimeCells::OfDay(_));
        let stated = self.map.ahead_s().unwrap_or(None);
        let (ahead_s, zone) = match (is_count || !is_absolute, stated) {
            (true, _) => (0.0, None),
            (false, Some(ahead_s)) => (ahead_s, self.map.zone.clone()),
            (false, None) => self.assumed_zone(&columns, &mut found.notices),
        };
        self.describe(&cells, kind, order, &names, &mut found.notices);
        found.map = LogMap {
            time: Some(match &names[..] {
                [one] => crate::map::Names::One(one.clone()),
                _ => crate::map::Names::Many(names),
            }),
            date_order: order.map(|o| {
                (if o == DateOrder::DayFirst {
                    "dmy"
                } else {
                    "mdy"
                })
                .to_owned()
            }),
            time_unit: match (kind, &cells) {
                (Kind::Count, TimeCells::Count(cell, ..)) => {
                    Some(unit_name(self.per_second(*cell).0).to_owned())
                }
                _ => None,
            },
            zone,
            offset_s: self.map.offset_s,
            ..LogMap::default()
        };
        let offset_s = self.map.offset_s.unwrap_or(0.0);
        let clock = LogClock {
            cells,
            order,
            ahead_s,
            shift_s: offset_s - if is_absolute { zero_s } else { 0.0 },
            decimal_comma: self.layout.decimal_comma,
            midnight: (0.0, 0.0),
            is_absolute,
        };
        Ok((clock, found))
    }

    /// Whether a column's numbers, whose unit is stated nowhere, are a spreadsheet's days.
    fn is_in_spreadsheet_days(&self, cell: usize) -> bool {
        let numbers: Vec<f64> = self
            .cells(cell)
            .into_iter()
            .filter_map(|c| self.number(c))
            .collect();
        let mut steps: Vec<f64> = numbers
            .windows(2)
            .map(|w| w[1] - w[0])
            .filter(|s| *s > 0.0)
            .collect();
        steps.sort_by(f64::total_cmp);
        let usual = steps.get(steps.len() / 2);
        numbers.iter().all(|n| SPREADSHEET_DAYS.contains(n))
            && usual.is_some_and(|s| *s < SPREADSHEET_STEP)
            && !self.per_second(cell).1
    }

    /// The zone of times that are stated nowhere, and its name unless the times say theirs.
    fn assumed_zone(&self, columns: &[usize], notices: &mut Vec<String>) -> (f64, Option<String>) {
        let last = columns.last().copied().unwrap_or(0);
        let written = self.cells(last).into_iter().any(|c| {
            let alone = time::time_alone(c).and_then(|(_, ahead)| ahead);
            alone.is_some()
                || time::stamp(c, self.order(last).ok().flatten())
                    .is_some_and(|s| s.ahead_s.is_some())
        });
        let clocks = columns
            .iter()
            .filter_map(|c| self.layout.headers[*c].time());
        let clocks: Vec<Clock> = clocks.filter_map(|(_, _, clock)| clock).collect();
        if written {
            return (0.0, None);
        }
        let ahead = clocks.iter().find_map(|c| match c {
            Clock::Ahead(ahead_s) => Some(*ahead_s),
            _ => None,
        });
        if let Some(ahead_s) = ahead {
            let minutes = (ahead_s.abs() / 60.0).round();
            let sign = if ahead_s < 0.0 { '-' } else { '+' };
            let zone = format!(
                "{sign}{:02}:{:02}",
                (minutes / 60.0).floor(),
                minutes % 60.0
            );
            notices.push(format!(
                "\"{}\" is in the time zone {zone}",
                self.header(last)
            ));
            return (ahead_s, Some(zone));
        }
        if clocks.contains(&Clock::Local) {
            notices.push(format!(
                "assumed: \"{}\" is local time without a time zone and is read as UTC (otherwise state --zone \
                 +HH:MM)",
                self.header(last)
            ));
        } else if !clocks.contains(&Clock::Utc) {
            notices.push(format!(
                "assumed: \"{}\" states no time zone and is read as UTC (otherwise state --zone +HH:MM)",
                self.header(last)
            ));
        }
        (0.0, Some("UTC".to_owned()))
    }

    fn describe(
        &self,
        cells: &TimeCells,
        kind: Kind,
        order: Option<DateOrder>,
        names: &[String],
        notices: &mut Vec<String>,
    ) {
        let mut from = format!("time_s from \"{}\"", names.join("\", \""));
        match order {
            Some(DateOrder::DayFirst) => from += ", day first",
            Some(DateOrder::MonthFirst) => from += ", month first",
            None => {}
        }
        match (kind, cells) {
            (Kind::Epoch { name, .. }, _) => from += &format!(", {name} since 1970"),
            (Kind::Count, TimeCells::Count(cell, ..)) => {
                let (per_second, is_stated) = self.per_second(*cell);
                from += &format!(", in {} of no stated zero", unit_name(per_second));
                if !is_stated {
                    notices.push(format!(
                        "assumed: \"{}\" is in seconds",
                        names.join("\", \"")
                    ));
                }
            }
            (Kind::OfDay { .. }, TimeCells::OfDay(_)) => {
                from += ", in seconds of the first row's day, since the log has no date"
            }
            _ => {}
        }
        notices.push(from);
        let offset_s = self.map.offset_s.unwrap_or(0.0);
        if offset_s != 0.0 {
            notices.push(format!("{offset_s} s are added to all times, as stated"));
        }
    }
}

/// Whether a time of day has parts of a second.
fn has_fraction(cell: &[u8]) -> bool {
    let colon = cell.iter().rposition(|b| *b == b':').unwrap_or(cell.len());
    let tail = &cell[colon..];
    let point = tail.iter().position(|b| *b == b'.' || *b == b',');
    point.is_some_and(|p| tail[p..].iter().any(|b| (b'1'..=b'9').contains(b)))
}

fn unit_name(per_second: f64) -> &'static str {
    match per_second {
        p if p > 5e8 => "ns",
        p if p > 5e5 => "us",
        p if p > 500.0 => "ms",
        p if p < 1e-3 => "h",
        p if p < 0.1 => "min",
        _ => "s",
    }
}

impl LogClock {
    /// The same clock as the log has it, with nothing added.
    pub fn unshifted(&self) -> Self {
        Self {
            shift_s: 0.0,
            ..self.clone()
        }
    }

    /// Whether the cells of a row's time are empty.
    pub fn is_unset<'c>(&self, cell: impl Fn(usize) -> &'c [u8]) -> bool {
        let mut cells = self.cells.all().into_iter();
        cells.all(|at| number::is_none(cell(at)))
    }

    /// The time of a row, s; none where its cells hold none.
    pub fn read<'c>(&mut self, cell: impl Fn(usize) -> &'c [u8]) -> Option<f64> {
        let utc_s = match &self.cells {
            TimeCells::Stamp(at) => {
                let stamp = time::stamp(cell(*at), self.order)?;
                stamp.clock_s - stamp.ahead_s.unwrap_or(self.ahead_s)
            }
            TimeCells::DateAndTime(date, of_day) => {
                let day = time::date_alone(cell(*date), self.order)?;
                let (of_day_s, ahead_s) = time::time_alone(cell(*of_day))?;
                day as f64 * DAY_S + of_day_s - ahead_s.unwrap_or(self.ahead_s)
            }
            TimeCells::OfDay(at) => {
                let (of_day_s, _) = time::time_alone(cell(*at))?;
                // Back by more than half a day: midnight lies between.
                if of_day_s < self.midnight.1 - DAY_S / 2.0 {
                    self.midnight.0 += DAY_S;
                }
                self.midnight.1 = of_day_s;
                self.midnight.0 + of_day_s
            }
            TimeCells::Count(at, per_second, nanos) => {
                let count = parse_number(cell(*at), self.decimal_comma)? / per_second;
                match nanos {
                    Some(nanos) => count + parse_number(cell(*nanos), self.decimal_comma)? * 1e-9,
                    None => count,
                }
            }
            TimeCells::Parts(cells) => {
                let part = |k: usize| match cells.get(k) {
                    Some(at) => parse_number(cell(*at), self.decimal_comma),
                    None => Some(0.0),
                };
                let year = part(0)?;
                let year = if year < 100.0 { 2000.0 + year } else { year };
                let day = days(year as i64, part(1)? as i64, part(2)? as i64)?;
                let of_day_s = part(3)? * 3600.0 + part(4)? * 60.0 + part(5)?;
                day as f64 * DAY_S + of_day_s - self.ahead_s
            }
        };
        Some(utc_s + self.shift_s)
    }
}
