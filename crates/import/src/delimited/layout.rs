//! How the text of a log is laid out: what parts cells, where the header is, what stands around it.

use crate::decode::letters;
use crate::map::LogMap;
use crate::recognise::Header;
use crate::{ImportError, unit};
use formats::delimited::{Cells, Delimiter, has_decimal_comma, number};

/// A header is looked for in so many lines: preambles of instruments are shorter.
const HEADER_WITHIN: usize = 200;
/// Lines between a header and its first row of numbers: units, kinds of mean, a repetition, a rule.
const BELOW_HEADER: usize = 6;

/// A line of the head of a log.
#[derive(Debug, Clone, Copy)]
pub struct Line<'a> {
    /// Number of the line, from 1.
    pub number: u64,
    /// Where it begins.
    pub at: usize,
    /// Its bytes, without its end.
    pub bytes: &'a [u8],
}

/// How a log is laid out.
#[derive(Debug, Clone, PartialEq)]
pub struct Layout {
    /// What parts cells.
    pub delimiter: Delimiter,
    /// The columns.
    pub headers: Vec<Header>,
    /// Cells of the header as bytes, to know it where it is repeated.
    pub header_cells: Cells,
    /// Line of the header, from 1; 0 where it is stated.
    pub header_line: u64,
    /// Units of the columns as a row below the header has them; empty without one.
    pub units: Vec<String>,
    /// Byte at which the first row below header and units begins.
    pub rows_at: usize,
    /// Line of that row, from 1.
    pub rows_line: u64,
    /// Whether numbers have a decimal comma.
    pub decimal_comma: bool,
    /// What was passed over.
    pub notices: Vec<String>,
}

impl Layout {
    /// Whether `cells` are the header again.
    pub fn repeats_header(&self, cells: &Cells) -> bool {
        let mut header = self.header_cells.iter().enumerate();
        header.all(|(at, name)| cells.get(at) == name)
    }

    /// The cell of the column that is called `wanted`, if there is one.
    pub fn find_column(&self, wanted: &str) -> Option<usize> {
        let exact = self.headers.iter().position(|h| h.is(wanted));
        exact.or_else(|| self.headers.iter().position(|h| h.is_nearly(wanted)))
    }

    /// The cell of the column that is called `wanted`.
    ///
    /// # Errors
    /// The log `name` has no such column.
    pub fn column(&self, name: &str, wanted: &str) -> Result<usize, ImportError> {
        self.find_column(wanted).ok_or_else(|| {
            let there: Vec<&str> = self.headers.iter().map(|h| h.text.as_str()).collect();
            ImportError::log(
                format!("{name}: line {}", self.header_line),
                format!("no column is called \"{wanted}\""),
                format!("state one of {}", there.join(", ")),
            )
        })
    }
}

/// Lines of `head`, without one that is cut off at its end unless the log `ended` there.
pub fn lines(head: &[u8], ended: bool) -> Vec<Line<'_>> {
    let mut lines = Vec::new();
    let (mut at, mut number) = (0, 1);
    while at < head.len() {
        let end = head[at..].iter().position(|b| *b == b'\n').map(|n| at + n);
        let Some(stop) = end.or(ended.then_some(head.len())) else {
            break;
        };
        let bytes = head[at..stop]
            .strip_suffix(b"\r")
            .unwrap_or(&head[at..stop]);
        lines.push(Line { number, at, bytes });
        at = stop + 1;
        number += 1;
    }
    lines
}

/// Whether a cell could stand in a row of measurements: a number.
fn is_number(cell: &[u8]) -> bool {
    number(cell, false).is_some() || has_decimal_comma(cell)
}

/// A candidate for the header.
struct Candidate {
    delimiter: Delimiter,
    line: usize,
    cells: Cells,
    known: usize,
}

/// Finds the layout of a log from its head's `lines`. Names in `map` count as known.
///
/// # Errors
/// A log in which no header is found, or a stated one that cannot be.
pub fn find(name: &str, lines: &[Line<'_>], map: &LogMap) -> Result<Layout, ImportError> {
    let delimiters = stated_delimiters(name, map)?;
    if !map.header.is_empty() {
        return without_header(name, lines, map, &delimiters);
    }
    let best = match map.header_line {
        Some(line) => header_at(name, lines, line, &delimiters, map)?,
        None => delimiters
            .iter()
            .flat_map(|d| candidates(lines, *d, map))
            // The first of those that know most; one that parts more cells is no better.
            .reduce(|best, next| if next.known > best.known { next } else { best })
            .filter(|c| c.known >= 2 || c.cells.len() <= 3 || names_a_time(&c.cells))
            .ok_or_else(|| no_header(name, lines))?,
    };
    Ok(below(lines, best))
}

fn stated_delimiters(name: &str, map: &LogMap) -> Result<Vec<Delimiter>, ImportError> {
    let Some(stated) = &map.delimiter else {
        // Blanks last: they are inside of cells too.
        let bytes = [b',', b';', b'\t', b'|'].map(Delimiter::Byte);
        return Ok(bytes.into_iter().chain([Delimiter::Space]).collect());
    };
    let todo = "state delimiter as one of , ; | tab space";
    let named = Delimiter::named(stated);
    named
        .map(|d| vec![d])
        .ok_or_else(|| ImportError::log(name, format!("delimiter \"{stated}\""), todo))
}

fn no_header(name: &str, lines: &[Line<'_>]) -> ImportError {
    let first = lines.iter().find(|l| !l.bytes.is_empty());
    let seen = first.map_or_else(
        || "the file is empty".to_owned(),
        |l| {
            let text: String = letters(l.bytes).chars().take(80).collect();
            format!("line {} has \"{text}\"", l.number)
        },
    );
    ImportError::log(
        name,
        format!("no header found that names a time, a place or a gas; {seen}"),
        "state header_line, or the columns' names as header = [...], in a mapping file (--map)",
    )
}

/// How many cells of a possible header are known.
fn known(cells: &Cells, map: &LogMap) -> usize {
    let stated: Vec<&String> = map
        .column
        .values()
        .filter_map(|c| c.from.as_ref())
        .chain(map.time.as_ref())
        .flat_map(|n| n.all())
        .collect();
    let is_known = |cell: &&[u8]| {
        let header = Header::new(&letters(cell));
        !is_number(cell) && (stated.iter().any(|s| header.is_nearly(s)) || header.is_known())
    };
    cells.iter().filter(is_known).count()
}

/// Whether a cell names a time: a log without place and gas has one.
fn names_a_time(cells: &Cells) -> bool {
    cells
        .iter()
        .any(|cell| Header::new(&letters(cell)).time().is_some())
}

fn candidates(lines: &[Line<'_>], delimiter: Delimiter, map: &LogMap) -> Vec<Candidate> {
    let mut found = Vec::new();
    for (line, text) in lines.iter().take(HEADER_WITHIN).enumerate() {
        let bytes = text.bytes.strip_prefix(b"#").unwrap_or(text.bytes);
        let cells = Cells::of(bytes, delimiter);
        if cells.len() < 2 || cells.iter().filter(|c| is_number(c)).count() * 2 > cells.len() {
            continue;
        }
        let known = known(&cells, map);
        if known == 0 || !has_row(&lines[line + 1..], delimiter, cells.len()) {
            continue;
        }
        found.push(Candidate {
            delimiter,
            line,
            cells,
            known,
        });
    }
    found
}

/// Whether one of the next lines is a row of about so many cells, with numbers.
fn has_row(below: &[Line<'_>], delimiter: Delimiter, cells: usize) -> bool {
    below.iter().take(BELOW_HEADER).any(|line| {
        let row = Cells::of(line.bytes, delimiter);
        // Lines of numbers often end in a delimiter, and times may hold a blank.
        row.len() + 1 >= cells && row.len() <= cells + 2 && row.iter().any(is_number)
    })
}

fn header_at(
    name: &str,
    lines: &[Line<'_>],
    line: u64,
    delimiters: &[Delimiter],
    map: &LogMap,
) -> Result<Candidate, ImportError> {
    let at = lines.iter().position(|l| l.number == line);
    let place = || format!("{name}: line {line}");
    let at = at.ok_or_else(|| {
        ImportError::log(
            place(),
            "there is no such line near the beginning",
            "state another header_line",
        )
    })?;
    let of = |delimiter: &Delimiter| {
        let bytes = lines[at].bytes;
        let cells = Cells::of(bytes.strip_prefix(b"#").unwrap_or(bytes), *delimiter);
        let known = known(&cells, map);
        Candidate {
            delimiter: *delimiter,
            line: at,
            cells,
            known,
        }
    };
    let best = delimiters.iter().map(of).reduce(|a, b| {
        let more =
            (b.known, b.cells.len()) > (a.known, a.cells.len()) && b.delimiter != Delimiter::Space;
        if more || b.known > a.known { b } else { a }
    });
    best.filter(|c| c.cells.len() >= 2).ok_or_else(|| {
        ImportError::log(
            place(),
            "the line has a single cell",
            "state header_line and delimiter",
        )
    })
}

fn without_header(
    name: &str,
    lines: &[Line<'_>],
    map: &LogMap,
    delimiters: &[Delimiter],
) -> Result<Layout, ImportError> {
    let count = map.header.len();
    let row = delimiters.iter().find_map(|d| {
        let fits = |line: &&Line<'_>| {
            let cells = Cells::of(line.bytes, *d);
            cells.len() == count && cells.iter().any(is_number)
        };
        lines.iter().find(fits).map(|line| (*d, *line))
    });
    let (delimiter, row) = row.ok_or_else(|| {
        ImportError::log(
            name,
            format!("no line has the {count} cells that header names"),
            "state as many names in header as there are columns",
        )
    })?;
    let headers: Vec<Header> = map.header.iter().map(|h| Header::new(h)).collect();
    let mut layout = Layout {
        delimiter,
        header_cells: map.header.iter().collect(),
        headers,
        header_line: 0,
        units: Vec::new(),
        rows_at: row.at,
        rows_line: row.number,
        decimal_comma: false,
        notices: Vec::new(),
    };
    layout.decimal_comma = has_commas(lines, &layout);
    Ok(layout)
}

/// What stands below the header: units and other rows that are no measurements.
fn below(lines: &[Line<'_>], header: Candidate) -> Layout {
    let number = lines[header.line].number;
    let headers: Vec<Header> = header
        .cells
        .iter()
        .map(|c| Header::new(&letters(c)))
        .collect();
    let mut layout = Layout {
        delimiter: header.delimiter,
        headers,
        header_cells: header.cells,
        header_line: number,
        units: Vec::new(),
        rows_at: lines[header.line].at + lines[header.line].bytes.len(),
        rows_line: number,
        decimal_comma: false,
        notices: Vec::new(),
    };
    if number > 1 {
        layout.notices.push(format!(
            "lines 1 to {} before the header are skipped",
            number - 1
        ));
    }
    for line in lines[header.line + 1..].iter().take(BELOW_HEADER) {
        (layout.rows_at, layout.rows_line) = (line.at, line.number);
        let bytes = line.bytes.strip_prefix(b"#").unwrap_or(line.bytes);
        let cells = Cells::of(bytes, layout.delimiter);
        if line.bytes.first() != Some(&b'#') && cells.iter().any(is_number) {
            break;
        }
        let texts: Vec<String> = cells.iter().map(letters).collect();
        let units = texts
            .iter()
            .filter(|t| !t.is_empty() && unit::Unit::is_any(t))
            .count();
        if layout.units.is_empty() && units > 0 && texts.len() <= layout.headers.len() + 1 {
            layout.units = texts;
        } else if cells.iter().any(|c| !c.is_empty()) {
            layout
                .notices
                .push(format!("line {} below the header is skipped", line.number));
        }
    }
    if rows_are_numbered(lines, &layout) {
        layout.headers.insert(0, Header::default());
        if !layout.units.is_empty() {
            layout.units.insert(0, String::new());
        }
        layout.notices.push(
            "rows have one cell more than the header; their first cell is taken as the row number"
                .to_owned(),
        );
    }
    layout.decimal_comma = has_commas(lines, &layout);
    layout
}

/// Rows by which it is told whether they are numbered, and the fewest.
const NUMBERED_ROWS: (usize, usize) = (20, 2);

/// Whether all first rows have one cell more than the header, as where row names were written and their column has no
/// name: read without it every column would be its neighbour.
fn rows_are_numbered(lines: &[Line<'_>], layout: &Layout) -> bool {
    if layout.delimiter == Delimiter::Space {
        return false;
    }
    let rows = lines.iter().filter(|l| l.number >= layout.rows_line);
    let rows: Vec<Cells> = rows
        .take(NUMBERED_ROWS.0)
        .map(|l| Cells::of(l.bytes, layout.delimiter))
        .collect();
    // A row that merely ends in a delimiter has an empty last cell.
    let count = layout.headers.len();
    let is_numbered = |row: &Cells| row.len() == count + 1 && !row.get(count).is_empty();
    rows.len() >= NUMBERED_ROWS.1 && rows.iter().all(is_numbered)
}

/// Whether numbers have decimal commas: more cells of the first rows that only so are numbers than are with a point.
fn has_commas(lines: &[Line<'_>], layout: &Layout) -> bool {
    let (mut commas, mut points) = (0, 0);
    for line in lines
        .iter()
        .filter(|l| l.number >= layout.rows_line)
        .take(HEADER_WITHIN)
    {
        for cell in Cells::of(line.bytes, layout.delimiter).iter() {
            commas += usize::from(has_decimal_comma(cell));
            points += usize::from(cell.contains(&b'.') && number(cell, false).is_some());
        }
    }
    commas > points
}

#[cfg(test)]
mod tests {
    use super::*;

    fn layout(text: &str) -> Layout {
        let lines = lines(text.as_bytes(), true);
        find("a.csv", &lines, &LogMap::default()).unwrap()
    }

    #[test]
    fn a_header_is_found_below_a_preamble_with_units_under_it() {
        let text = "Instrument: X, serial 12\n\nTimestamp;Latitude;Longitude;CH4\n;deg;deg;ppb\n\
            2024-05-01 10:00:00;43,1;-7,8;1901,5\n";
        let found = layout(text);
        assert_eq!(found.delimiter, Delimiter::Byte(b';'));
        assert_eq!((found.header_line, found.rows_line), (3, 5));
        assert_eq!(found.units[3], "ppb");
        assert!(found.decimal_comma);
        assert_eq!(found.notices.len(), 1);
    }

    #[test]
    fn numbered_rows_below_a_header_without_their_name_are_not_shifted() {
        let numbered =
            layout("time,lat,lon,CO2 / ppm\n0,10.0,38.4,14.9,420\n1,11.0,38.4,14.9,421\n");
        assert_eq!(numbered.headers.len(), 5);
        assert!(numbered.headers[2].is("lat"));
        // A delimiter at the end of rows is no cell more.
        let ended = layout("time,lat,lon,CO2 / ppm\n10.0,38.4,14.9,420,\n11.0,38.4,14.9,421,\n");
        assert_eq!(ended.headers.len(), 4);
    }

    #[test]
    fn blanks_part_cells_only_where_nothing_else_does() {
        let spaced =
            "DATE       TIME      EPOCH_TIME    CH4_dry\n2024-05-01 10:00:00  1714557600.1  1.95\n";
        assert_eq!(layout(spaced).delimiter, Delimiter::Space);
        let tabbed = "Date Time\tWind Speed (m/s)\tCO2 (ppm)\n2024-05-01 10:00:00\t3.1\t421\n";
        let found = layout(tabbed);
        assert_eq!(found.delimiter, Delimiter::Byte(b'\t'));
        assert_eq!(found.headers.len(), 3);
    }

    #[test]
    fn a_log_without_names_is_refused_in_words() {
        let lines = lines(b"1,2,3\n4,5,6\n", true);
        let error = find("a.csv", &lines, &LogMap::default())
            .unwrap_err()
            .to_string();
        assert!(
            error.contains("a.csv: no header found") && error.contains("header = [...]"),
            "{error}"
        );
    }
}
