//! Delimited text, as spreadsheets, loggers and instruments write it.
//!
//! The first megabyte tells how a log is laid out and what its columns are; then its rows are read one by one and
//! held nowhere.

pub mod clock;
pub mod grid;
pub mod layout;
pub mod plan;
pub mod vector;

use crate::ImportError;
use crate::decode;
use crate::in_order::{InOrder, Stamps};
use crate::map::LogMap;
use crate::preset::Preset;
use crate::quantity::Quantity;
use crate::sink::Sink;
use formats::delimited::{Cells, Records};
use layout::Layout;
use plan::{Column, Member, Plan, Source};
use std::collections::BTreeMap;
use std::io::{Cursor, Read};

/// Bytes by which a log is judged.
const HEAD_BYTES: u64 = 1 << 20;
/// Rows by which its columns are judged.
const HEAD_ROWS: usize = 2000;
/// The share of rows, or of a column's cells, that may be unreadable: beyond it something else is wrong.
const UNREADABLE_SHARE: f64 = 0.1;

/// A log that is open: its head is read and planned.
pub struct Delimited<'a> {
    name: String,
    rest: Box<dyn Read + 'a>,
    layout: Layout,
    /// What becomes of its columns.
    pub plan: Plan,
    stamps: Stamps,
    missing: Vec<Vec<u8>>,
    platform: String,
}

/// What came of a log's rows.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Outcome {
    /// Rows that were handed on.
    pub rows: usize,
    /// Names of the platforms.
    pub platforms: Vec<String>,
    /// What happened on the way, in words.
    pub notices: Vec<String>,
}

impl<'a> Delimited<'a> {
    /// Opens the log `name` with what is stated of it in `map`; rows are of `platform` where the log names none, and
    /// times count from `zero_s` after 1970.
    ///
    /// # Errors
    /// What cannot be read or told, with what to state.
    pub fn open(
        name: &str,
        bytes: Box<dyn Read + 'a>,
        map: &LogMap,
        platform: &str,
        zero_s: f64,
    ) -> Result<Self, ImportError> {
        let failed = || ImportError::bytes(name);
        let (mut text, encoding) = decode::text(bytes).map_err(failed())?;
        let mut head = Vec::new();
        let got = text.by_ref().take(HEAD_BYTES).read_to_end(&mut head);
        let ended = (got.map_err(failed())? as u64) < HEAD_BYTES;
        let lines = layout::lines(&head, ended);
        let forced = map.preset.as_deref().and_then(|p| Preset::named(p).ok());
        let forced_map = forced.map(Preset::states).transpose()?;
        let with_forced =
            forced_map.map_or_else(|| map.clone(), |states| map.clone().over(&states));
        let mut layout = layout::find(name, &lines, &with_forced)?;
        let preset = forced.or_else(|| Preset::of(&layout.headers, &head));
        let map = &by_preset(map, preset, &layout)?;
        if let Some(decimal) = &map.decimal {
            layout.decimal_comma = decimal == ",";
        }
        let rows = lines
            .iter()
            .filter(|l| l.number >= layout.rows_line && l.bytes.first() != Some(&b'#'));
        let first: Vec<Cells> = rows
            .take(HEAD_ROWS)
            .map(|l| Cells::of(l.bytes, layout.delimiter))
            .filter(|row| !layout.repeats_header(row))
            .collect();
        let mut plan = plan::plan(name, &layout, &first, map, zero_s)?;
        if let Some(preset) = preset {
            plan.notices.insert(
                0,
                format!("read as {} (preset {})", preset.what, preset.name),
            );
        }
        if let Some(encoding) = encoding {
            plan.notices.insert(0, format!("text in {encoding}"));
        } else if std::str::from_utf8(&head[..head.len().saturating_sub(4)])
            .is_err_and(|e| e.error_len().is_some())
        {
            plan.notices.insert(
                0,
                "assumed: the text, which is not UTF-8, is Latin-1".to_owned(),
            );
        }
        if layout.decimal_comma {
            plan.notices.push("numbers have decimal commas".to_owned());
        }
        plan.notices.append(&mut layout.notices);
        let stamps = stamps(&plan, &first);
        let rows_at = layout.rows_at;
        Ok(Self {
            name: name.to_owned(),
            rest: Box::new(Cursor::new(head.split_off(rows_at.min(head.len()))).chain(text)),
            layout,
            plan,
            stamps,
            missing: map.missing.iter().map(|m| m.clone().into_bytes()).collect(),
            platform: platform.to_owned(),
        })
    }

    /// How its times are stamped.
    pub fn stamps(&self) -> Stamps {
        self.stamps
    }

    /// Its name.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// The columns that come out, by their places in the plan: those of `wanted` that the log has.
    pub fn columns(&self) -> Vec<&'static Quantity> {
        self.plan.quantities()
    }

    /// Hands all rows to `sink`, which takes the columns at the places `taken` of [`Self::columns`].
    ///
    /// # Errors
    /// Rows that cannot be read, that run back in time unless they `may_run_back`, or the sink's.
    pub fn rows(
        self,
        taken: &[usize],
        may_run_back: bool,
        sink: &mut dyn Sink,
    ) -> Result<Outcome, ImportError> {
        let (delimiter, first_line) = (self.layout.delimiter, self.layout.rows_line);
        let mut records = Records::new(self.rest, delimiter, first_line, true);
        let mut clock = self.plan.clock.clone();
        let quantities = self.plan.quantities();
        let wanted: Vec<&str> = taken.iter().map(|t| quantities[*t].name).collect();
        let members: Vec<(&Member, Vec<Option<&Column>>)> = self
            .plan
            .members
            .iter()
            .map(|member| {
                let of = |name: &&str| member.columns.iter().find(|c| c.quantity.name == *name);
                (member, wanted.iter().map(of).collect())
            })
            .collect();
        // Who sorts spreads afterwards.
        let stamps = if may_run_back {
            Stamps::AS_THEY_ARE
        } else {
            self.stamps
        };
        let mut order = InOrder::new(sink, &self.name, stamps, wanted.len(), may_run_back);
        let fixed: Vec<usize> = members
            .iter()
            .map(|(m, _)| order.platform(m.platform.as_ref().unwrap_or(&self.platform)))
            .collect();
        let mut tally = Tally::new(wanted.len());
        let mut values = vec![f64::NAN; wanted.len()];
        while let Some(line) = records
            .next_line()
            .map_err(ImportError::bytes(&self.name))?
        {
            let cells = &records.cells;
            if cells.is_empty() {
                continue;
            }
            let Some(time_s) = clock.read(|at| cells.get(at)) else {
                if tally.rows == 0 && clock.is_unset(|at| cells.get(at)) {
                    tally.before_clock += 1;
                    continue;
                }
                tally.no_time(line, cells, &self.layout);
                continue;
            };
            let named = self.plan.platform.map(|at| cells.get(at));
            let named = named.filter(|cell| !cell.is_empty());
            tally.rows += 1;
            for ((member, columns), fixed) in members.iter().zip(&fixed) {
                let vectors = member.vectors.of_row(cells);
                for (k, (column, value)) in columns.iter().zip(&mut values).enumerate() {
                    let Some(column) = column else {
                        *value = f64::NAN;
                        continue;
                    };
                    *value = match column.source {
                        Source::Value(value) => value,
                        Source::Derived(part) => column.of_derived(vectors[part as usize]),
                        Source::Cell(at) => {
                            let cell = cells.get(at);
                            match column.value(cell, self.layout.decimal_comma) {
                                _ if self.missing.iter().any(|m| m == cell)
                                    || column.is_missing(cell) =>
                                {
                                    f64::NAN
                                }
                                Some(value) => {
                                    column.side.map_or(value, |s| sided(value, cells.get(s)))
                                }
                                None => tally.no_number(k, cell, line),
                            }
                        }
                    };
                }
                let platform = match named {
                    Some(cell) => order.platform(&decode::letters(cell)),
                    None => *fixed,
                };
                order.row(time_s, platform, &values, line)?;
            }
        }
        let (done, platforms) = order.finish()?;
        let mut outcome = tally.outcome(&self.name, &wanted)?;
        outcome.notices.extend(done.notice(stamps));
        outcome.platforms = platforms;
        Ok(outcome)
    }
}

/// What is stated of a log, and below it what its preset states.
fn by_preset(
    map: &LogMap,
    preset: Option<&Preset>,
    layout: &Layout,
) -> Result<LogMap, ImportError> {
    let Some(preset) = preset else {
        return Ok(map.clone());
    };
    let mut states = preset.states()?;
    // None for a version of an instrument with other time columns: then the time is recognised as in any log.
    states.time = preset.time(&layout.headers);
    Ok(map.clone().over(&states))
}

/// How the first rows are stamped.
fn stamps(plan: &Plan, first: &[Cells]) -> Stamps {
    let mut clock = plan.clock.unshifted();
    let mut names: BTreeMap<&[u8], usize> = BTreeMap::new();
    let mut times = Vec::new();
    for row in first {
        let Some(time_s) = clock.read(|at| row.get(at)) else {
            continue;
        };
        let name = plan.platform.map_or(&[][..], |at| row.get(at));
        let next = names.len();
        times.push((time_s, *names.entry(name).or_insert(next)));
    }
    if times.is_empty() {
        return Stamps::WHOLE_SECONDS;
    }
    Stamps::of(&times)
}

fn sided(value: f64, side: &[u8]) -> f64 {
    match side {
        b"S" | b"W" => -value.abs(),
        _ => value,
    }
}

/// What was odd in the rows of a log.
struct Tally {
    rows: usize,
    repeated_headers: usize,
    /// Rows at the beginning whose time is empty.
    before_clock: usize,
    without_time: usize,
    first_without_time: Option<(u64, String)>,
    /// Of each column: cells that are no numbers, and the first of them.
    unreadable: Vec<(usize, Option<(u64, String)>)>,
}

impl Tally {
    fn new(columns: usize) -> Self {
        Self {
            rows: 0,
            repeated_headers: 0,
            before_clock: 0,
            without_time: 0,
            first_without_time: None,
            unreadable: vec![(0, None); columns],
        }
    }

    #[cold]
    fn no_time(&mut self, line: u64, cells: &Cells, layout: &Layout) {
        if layout.repeats_header(cells) {
            self.repeated_headers += 1;
            return;
        }
        self.without_time += 1;
        if self.first_without_time.is_none() {
            self.first_without_time = Some((line, plan::shown(cells.get(0))));
        }
    }

    /// NaN, and counts the cell if it says anything.
    fn no_number(&mut self, column: usize, cell: &[u8], line: u64) -> f64 {
        if !crate::number::is_none(cell) {
            let (count, first) = &mut self.unreadable[column];
            *count += 1;
            if first.is_none() {
                *first = Some((line, plan::shown(cell)));
            }
        }
        f64::NAN
    }

    fn outcome(&self, name: &str, columns: &[&str]) -> Result<Outcome, ImportError> {
        let mut notices = Vec::new();
        let share = |count: usize, of: usize| count as f64 / of.max(1) as f64;
        if let Some((line, cell)) = &self.first_without_time {
            let what = format!(
                "{} of {} rows have no readable time; the first begins with \"{cell}\"",
                self.without_time,
                self.rows + self.without_time
            );
            if self.rows == 0 || share(self.without_time, self.rows) > UNREADABLE_SHARE {
                return Err(ImportError::log(
                    format!("{name}: line {line}"),
                    what,
                    "state time, header_line or delimiter in a mapping file (--map)",
                ));
            }
            notices.push(format!("line {line}: {what}; they are skipped"));
        }
        if self.rows == 0 && self.before_clock > 0 {
            return Err(ImportError::log(
                name,
                format!("the time is empty in all {} rows", self.before_clock),
                "state another column as time in a mapping file (--map), or give a log whose clock was set (a GPS sets \
                 it at its first fix)",
            ));
        }
        if self.before_clock > 0 {
            notices.push(format!(
                "{} rows before the clock was set have no time and are skipped",
                self.before_clock
            ));
        }
        if self.rows == 0 {
            return Err(ImportError::log(
                name,
                "no rows below the header",
                "give a log with rows",
            ));
        }
        if self.repeated_headers > 0 {
            notices.push(format!(
                "{} repetitions of the header are skipped",
                self.repeated_headers
            ));
        }
        for ((count, first), column) in self.unreadable.iter().zip(columns) {
            let Some((line, cell)) = first else { continue };
            let what = format!("{count} cells for {column} are not numbers, such as \"{cell}\"");
            if share(*count, self.rows) > UNREADABLE_SHARE {
                return Err(ImportError::log(
                    format!("{name}: line {line}"),
                    what,
                    "state their meaning as missing = [...], or decimal, or another column, in a mapping file \
                     (--map)",
                ));
            }
            notices.push(format!("line {line}: {what}; they are taken as missing"));
        }
        Ok(Outcome {
            rows: self.rows,
            platforms: Vec::new(),
            notices,
        })
    }
}
