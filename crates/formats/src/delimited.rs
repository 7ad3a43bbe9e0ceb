//! Delimited text (CSV and its relatives), read row by row with the line and the column in every error.
//!
//! A file of known columns is a [`Table`]: its reader describes each column once ([`Column`]) and then asks a [`Row`] for
//! cells by their place in that description. A log of unknown layout is read as [`Records`] of bytes.
//!
//! A byte order mark before the header, line ends of Windows, blank lines, quoted cells and blanks around cells are
//! accepted everywhere. A number has a decimal point ([`number`] also reads decimal commas) and is finite; an empty
//! cell, or one that says `nan`, is missing.

use csv::ByteRecord;
use std::io::{self, BufRead as _, BufReader, Read};

/// Bytes that are read at a time.
const BUFFER: usize = 256 * 1024;
/// A line that begins with it is a comment.
const COMMENT: u8 = b'#';

/// What separates cells.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Delimiter {
    /// One byte.
    Byte(u8),
    /// Any number of blanks and tabs.
    Space,
}

impl Delimiter {
    /// Its name: `tab`, `space`, or the byte itself.
    pub fn name(self) -> String {
        match self {
            Self::Byte(b'\t') => "tab".to_owned(),
            Self::Byte(byte) => char::from(byte).to_string(),
            Self::Space => "space".to_owned(),
        }
    }

    /// The delimiter of this name; none where there is no such.
    pub fn named(name: &str) -> Option<Self> {
        match name {
            "tab" | "\t" => Some(Self::Byte(b'\t')),
            "space" | " " => Some(Self::Space),
            _ => match name.as_bytes() {
                [byte] if byte.is_ascii_punctuation() => Some(Self::Byte(*byte)),
                _ => None,
            },
        }
    }
}

/// The cells of one line.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Cells(ByteRecord);

impl Cells {
    /// The cells of `line`.
    pub fn of(line: &[u8], delimiter: Delimiter) -> Self {
        let mut cells = Self::default();
        match delimiter {
            Delimiter::Space => cells.split(line),
            Delimiter::Byte(byte) => {
                // Reading from memory cannot fail.
                let _ = csv_reader(line, byte, None, line.len()).read_byte_record(&mut cells.0);
            }
        }
        cells
    }

    fn split(&mut self, line: &[u8]) {
        self.0.clear();
        let cells = line.split(u8::is_ascii_whitespace);
        cells
            .filter(|c| !c.is_empty())
            .for_each(|c| self.0.push_field(c));
    }

    /// A cell without blanks around it; empty where the line has none.
    pub fn get(&self, at: usize) -> &[u8] {
        self.0.get(at).map_or(&[][..], <[u8]>::trim_ascii)
    }

    /// All cells, without blanks around them.
    pub fn iter(&self) -> impl Iterator<Item = &[u8]> {
        self.0.iter().map(<[u8]>::trim_ascii)
    }

    /// Number of cells.
    pub fn len(&self) -> usize {
        self.0.len()
    }

    /// Whether all cells are empty.
    pub fn is_empty(&self) -> bool {
        self.iter().all(<[u8]>::is_empty)
    }
}

impl<T: AsRef<[u8]>> FromIterator<T> for Cells {
    fn from_iter<I: IntoIterator<Item = T>>(cells: I) -> Self {
        Self(cells.into_iter().collect())
    }
}

fn csv_reader<R: Read>(
    bytes: R,
    delimiter: u8,
    comment: Option<u8>,
    buffer: usize,
) -> csv::Reader<R> {
    csv::ReaderBuilder::new()
        .delimiter(delimiter)
        .has_headers(false)
        .flexible(true)
        .comment(comment)
        .buffer_capacity(buffer.max(1))
        .from_reader(bytes)
}

enum Source<R> {
    Csv(Box<csv::Reader<R>>),
    Space(BufReader<R>, Vec<u8>),
}

/// Reads lines of cells from bytes. Lines may differ in their number of cells.
pub struct Records<R> {
    source: Source<R>,
    comment: Option<u8>,
    first_line: u64,
    line: u64,
    /// The cells of the line that was read last.
    pub cells: Cells,
}

impl<R: Read> Records<R> {
    /// Lines of `bytes`, the first of which is `first_line` of its file. With `comments` lines that begin with `#` are
    /// ignored.
    pub fn new(bytes: R, delimiter: Delimiter, first_line: u64, comments: bool) -> Self {
        let comment = comments.then_some(COMMENT);
        let source = match delimiter {
            Delimiter::Byte(byte) => {
                Source::Csv(Box::new(csv_reader(bytes, byte, comment, BUFFER)))
            }
            Delimiter::Space => Source::Space(BufReader::with_capacity(BUFFER, bytes), Vec::new()),
        };
        Self {
            source,
            comment,
            first_line,
            line: 0,
            cells: Cells::default(),
        }
    }

    /// Reads the next line into [`Records::cells`]. Returns its number, or none at the end.
    ///
    /// # Errors
    /// Bytes that cannot be read.
    pub fn next_line(&mut self) -> io::Result<Option<u64>> {
        match &mut self.source {
            Source::Csv(reader) => {
                if !reader.read_byte_record(&mut self.cells.0)? {
                    return Ok(None);
                }
                self.line = self.cells.0.position().map_or(0, csv::Position::line);
            }
            Source::Space(reader, line) => loop {
                line.clear();
                if reader.read_until(b'\n', line)? == 0 {
                    return Ok(None);
                }
                self.line += 1;
                if self.comment.is_none() || line.first().copied() != self.comment {
                    self.cells.split(line);
                    break;
                }
            },
        }
        Ok(Some(self.first_line + self.line - 1))
    }
}

/// The number in a cell; none where it is no finite one. A leading plus sign is accepted.
pub fn number(cell: &[u8], decimal_comma: bool) -> Option<f64> {
    if decimal_comma && cell.contains(&b',') {
        let point = |b: &u8| if *b == b',' { b'.' } else { *b };
        return number(&cell.iter().map(point).collect::<Vec<u8>>(), false);
    }
    // "inf" and "infinity" parse as numbers but were never measured.
    let text = std::str::from_utf8(cell).ok()?;
    text.parse().ok().filter(|v: &f64| v.is_finite())
}

/// Whether a cell is a number with a decimal comma, such as `43,441`.
pub fn has_decimal_comma(cell: &[u8]) -> bool {
    let commas = cell.iter().filter(|b| **b == b',').count();
    commas == 1 && !cell.contains(&b'.') && number(cell, true).is_some()
}

/// Why a text is not the table that its reader expects.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct TableError {
    /// Name of the file; empty where the reader does not know it.
    pub file: String,
    /// Line, from 1.
    pub line: u64,
    /// Name of the column; empty for the whole line.
    pub column: String,
    /// What is wrong.
    pub problem: String,
    /// What would be right.
    pub expected: String,
}

impl TableError {
    /// File, line and column as far as they are known.
    pub fn place(&self) -> String {
        let file = match self.file.as_str() {
            "" => String::new(),
            file => format!("{file}: "),
        };
        let column = match self.column.as_str() {
            "" => String::new(),
            column => format!(", column {column}"),
        };
        format!("{file}line {}{column}", self.line)
    }
}

impl std::fmt::Display for TableError {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let (place, problem, expected) = (self.place(), &self.problem, &self.expected);
        write!(f, "{place}: {problem}; expected {expected}")
    }
}

impl std::error::Error for TableError {}

/// Description of a column.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Column {
    /// Its name in the header, with the unit.
    pub name: &'static str,
    /// Another name that a header may have instead, such as that in another unit.
    pub or: Option<&'static str>,
    /// Whether the header has to name it.
    pub required: bool,
    /// Least and greatest number in it.
    pub range: (f64, f64),
    /// What it holds, for messages; empty to name the range.
    pub holds: &'static str,
}

impl Column {
    /// A column that the header has to name, of any text or number.
    pub const fn required(name: &'static str) -> Self {
        Self {
            name,
            or: None,
            required: true,
            range: (f64::MIN, f64::MAX),
            holds: "a finite number with a decimal point",
        }
    }

    /// A column that the header may lack.
    pub const fn optional(name: &'static str) -> Self {
        Self {
            required: false,
            ..Self::required(name)
        }
    }

    /// The same column with numbers from `low` to `high`; `holds` describes them in messages.
    #[must_use]
    pub const fn of(self, (low, high, holds): (f64, f64, &'static str)) -> Self {
        Self {
            range: (low, high),
            holds,
            ..self
        }
    }

    /// The same column, which a header may also call `name`.
    #[must_use]
    pub const fn or(self, name: &'static str) -> Self {
        Self {
            or: Some(name),
            ..self
        }
    }

    fn is(&self, name: &str) -> bool {
        self.name == name || self.or == Some(name)
    }

    fn expected(&self) -> String {
        if self.holds.is_empty() {
            let (low, high) = self.range;
            return format!("a number from {low} to {high} (units?)");
        }
        self.holds.to_owned()
    }
}

/// The header of a table: where the described columns stand.
#[derive(Debug, Clone)]
pub struct Header {
    file: String,
    line: u64,
    columns: Vec<Column>,
    names: Vec<String>,
    at: Vec<Option<usize>>,
}

impl Header {
    /// Looks for `columns` in the header `cells`, which are `line` of `file`. Nothing is checked yet.
    pub fn find(file: &str, line: u64, cells: &Cells, columns: &[Column]) -> Self {
        let name = |cell| text(cell).trim_start_matches('\u{feff}').to_owned();
        let names: Vec<String> = cells.iter().map(name).collect();
        let place = |name: &str| names.iter().position(|n| n == name);
        let mut columns = columns.to_vec();
        let find = |column: &mut Column| {
            let by_name = place(column.name);
            let other = column.or.filter(|_| by_name.is_none());
            let by_other = other.and_then(|or| Some((place(or)?, or)));
            if let Some((_, or)) = by_other {
                column.or = Some(std::mem::replace(&mut column.name, or));
            }
            by_name.or(by_other.map(|(at, _)| at))
        };
        Self {
            at: columns.iter_mut().map(find).collect(),
            file: file.to_owned(),
            line,
            columns,
            names,
        }
    }

    /// Rejects a header that lacks a required column, or names a described one twice or by both of its names.
    ///
    /// # Errors
    /// The first such column.
    pub fn check(&self) -> Result<(), TableError> {
        for (k, column) in self.columns.iter().enumerate() {
            if column.required && !self.has(k) {
                return Err(self.missing(k));
            }
            if let Some(or) = column.or.filter(|or| self.names.iter().any(|n| n == or)) {
                let problem = format!("beside {}", column.name);
                return Err(self.error(or, problem, "one of the two"));
            }
        }
        self.distinct(|name| self.columns.iter().any(|c| c.is(name)))
    }

    /// Rejects a header in which a name that `is_meant` stands twice.
    ///
    /// # Errors
    /// The first such name.
    pub fn distinct(&self, is_meant: impl Fn(&str) -> bool) -> Result<(), TableError> {
        let mut names = self.names.iter().enumerate();
        match names.find(|(k, name)| is_meant(name) && self.names[..*k].contains(name)) {
            Some((_, name)) => {
                Err(self.error(name, "named twice in the header", "every column once"))
            }
            None => Ok(()),
        }
    }

    /// The error of a header that lacks the described column `k`.
    pub fn missing(&self, k: usize) -> TableError {
        let own = self.columns[k].name;
        let required = self
            .columns
            .iter()
            .filter(|c| c.required || c.name == own)
            .map(|c| match c.or {
                Some(or) => format!("{} (or {or})", c.name),
                None => c.name.to_owned(),
            });
        let required: Vec<String> = required.collect();
        let mut expected = format!("a header with {}", required.join(", "));
        if self.names.iter().any(|n| n.contains([';', '\t'])) {
            expected.push_str(", separated by commas");
        }
        if self.names.is_empty() {
            return self.error("", "the file is empty", expected);
        }
        let problem = format!("missing; the header has {}", self.names.join(", "));
        self.error(own, problem, expected)
    }

    /// An error in this header.
    pub fn error(
        &self,
        column: &str,
        problem: impl Into<String>,
        expected: impl Into<String>,
    ) -> TableError {
        TableError {
            file: self.file.clone(),
            line: self.line,
            column: column.to_owned(),
            problem: problem.into(),
            expected: expected.into(),
        }
    }

    /// Name of the file.
    pub fn file(&self) -> &str {
        &self.file
    }

    /// All names, in the order of the file.
    pub fn names(&self) -> &[String] {
        &self.names
    }

    /// By which of its names the header has the described column `k`.
    pub fn called(&self, k: usize) -> &'static str {
        self.columns[k].name
    }

    /// Whether it names the described column `k`.
    pub fn has(&self, k: usize) -> bool {
        self.at[k].is_some()
    }

    /// Places and names of the columns that are not described.
    pub fn others(&self) -> impl Iterator<Item = (usize, &str)> {
        let named = self.names.iter().map(String::as_str).enumerate();
        named.filter(|(_, name)| !self.columns.iter().any(|c| c.is(name)))
    }

    /// The row of `cells`, which are `line` of the file.
    ///
    /// # Errors
    /// Another number of cells than the header has.
    pub fn row<'r>(&'r self, line: u64, cells: &'r Cells) -> Result<Row<'r>, TableError> {
        let row = Row {
            header: self,
            line,
            cells,
        };
        if cells.len() == self.names.len() {
            return Ok(row);
        }
        let expected = format!("{} cells, as in the header", self.names.len());
        Err(row.error("", format!("{} cells", cells.len()), expected))
    }
}

/// A text with a header and rows of as many cells.
pub struct Table<'t> {
    /// Its header.
    pub header: Header,
    records: Records<&'t [u8]>,
    text: &'t [u8],
    comments: bool,
    /// Bytes of the text whose lines are counted, and their number.
    counted: (usize, u64),
}

impl<'t> Table<'t> {
    /// Opens the comma-separated `text` of `file`; with `comments` lines that begin with `#` are ignored.
    ///
    /// # Errors
    /// As [`Header::check`].
    pub fn open(
        file: &str,
        text: &'t str,
        columns: &[Column],
        comments: bool,
    ) -> Result<Self, TableError> {
        let table = Self::unchecked(file, text, columns, comments);
        table.header.check()?;
        Ok(table)
    }

    /// The same for a reader that has more to say of its header and checks it itself.
    pub fn unchecked(file: &str, text: &'t str, columns: &[Column], comments: bool) -> Self {
        let text = text.strip_prefix('\u{feff}').unwrap_or(text);
        let text = if text.trim().is_empty() { "" } else { text };
        let mut records = Records::new(text.as_bytes(), Delimiter::Byte(b','), 1, comments);
        // Reading from memory cannot fail.
        let _ = records.next_line();
        let header = Header::find(file, 1, &records.cells, columns);
        let mut table = Self {
            header,
            records,
            text: text.as_bytes(),
            comments,
            counted: (0, 1),
        };
        table.header.line = table.line();
        table
    }

    /// The next row, or none at the end.
    ///
    /// # Errors
    /// As [`Header::row`].
    pub fn next_row(&mut self) -> Result<Option<Row<'_>>, TableError> {
        // Reading from memory cannot fail.
        match self.records.next_line().ok().flatten() {
            Some(_) => {
                let line = self.line();
                self.header.row(line, &self.records.cells).map(Some)
            }
            None => Ok(None),
        }
    }

    /// Line of the row that was read last. The position that `csv` gives is that before comments and empty lines.
    fn line(&mut self) -> u64 {
        let position = self.records.cells.0.position();
        let begun = position.map_or(0, |p| p.byte() as usize);
        let ends = |bytes: &[u8]| bytes.iter().filter(|b| **b == b'\n').count() as u64;
        let (counted, mut line) = self.counted;
        line += ends(self.text.get(counted..begun).unwrap_or_default());
        self.counted = (begun, line);
        let mut rest = self.text.get(begun..).unwrap_or_default();
        while let [first, after @ ..] = rest {
            rest = match first {
                b'\r' | b'\n' => after,
                &COMMENT if self.comments => {
                    let end = after.iter().position(|b| *b == b'\n');
                    end.map_or(&[][..], |end| &after[end + 1..])
                }
                _ => break,
            };
            line += u64::from(*first != b'\r');
        }
        line
    }

    /// The error of a table without rows.
    pub fn no_rows(&self) -> TableError {
        TableError {
            line: self.header.line + 1,
            ..self
                .header
                .error("", "no rows below the header", "at least one row")
        }
    }
}

/// A row of a table. Columns are given by their places in the description.
#[derive(Clone, Copy)]
pub struct Row<'r> {
    header: &'r Header,
    /// Its line, from 1.
    pub line: u64,
    cells: &'r Cells,
}

impl<'r> Row<'r> {
    /// The cell at a place of the file.
    pub fn cell(&self, at: usize) -> &'r str {
        text(self.cells.get(at))
    }

    /// The text of a column; empty where the header lacks it.
    pub fn text(&self, k: usize) -> &'r str {
        self.header.at[k].map_or("", |at| self.cell(at))
    }

    /// The text of a column of names.
    ///
    /// # Errors
    /// An empty cell.
    pub fn name(&self, k: usize) -> Result<&'r str, TableError> {
        let name = self.text(k);
        match name {
            "" => Err(self.wrong(k, "a name")),
            name => Ok(name),
        }
    }

    /// The number of a column; none where it is missing.
    ///
    /// # Errors
    /// A cell that is no number, or one outside of the column's range.
    pub fn number(&self, k: usize) -> Result<Option<f64>, TableError> {
        self.parsed(k, ", or an empty cell")
    }

    /// The number of a column in which none may be missing.
    ///
    /// # Errors
    /// As [`Row::number`], and a missing one.
    pub fn needed(&self, k: usize) -> Result<f64, TableError> {
        let missing = || self.wrong(k, self.header.columns[k].expected());
        self.parsed(k, "")?.ok_or_else(missing)
    }

    fn parsed(&self, k: usize, or_missing: &str) -> Result<Option<f64>, TableError> {
        let cell = self.text(k);
        if cell.is_empty() || cell.eq_ignore_ascii_case("nan") {
            return Ok(None);
        }
        let column = &self.header.columns[k];
        let (low, high) = column.range;
        match cell.parse::<f64>() {
            Ok(value) if value >= low && value <= high => Ok(Some(value)),
            _ => Err(self.wrong(k, column.expected() + or_missing)),
        }
    }

    /// The error of a column's cell.
    pub fn wrong(&self, k: usize, expected: impl Into<String>) -> TableError {
        let problem = format!("found \"{}\"", self.text(k));
        self.error(self.header.columns[k].name, problem, expected)
    }

    /// An error in this row.
    pub fn error(
        &self,
        column: &str,
        problem: impl Into<String>,
        expected: impl Into<String>,
    ) -> TableError {
        TableError {
            line: self.line,
            ..self.header.error(column, problem, expected)
        }
    }
}

/// A cell of a text in UTF-8.
fn text(cell: &[u8]) -> &str {
    std::str::from_utf8(cell).map_or("", str::trim)
}

#[cfg(test)]
mod tests {
    use super::*;

    const COLUMNS: [Column; 3] = [
        Column::required("time_s"),
        Column::required("name"),
        Column::optional("speed_m_s").of((0.0, 80.0, "")),
    ];

    fn error(text: &str) -> String {
        let read = || -> Result<(), TableError> {
            let mut table = Table::open("a.csv", text, &COLUMNS, true)?;
            while let Some(row) = table.next_row()? {
                row.needed(0)?;
                row.name(1)?;
                row.number(2)?;
            }
            Err(table.no_rows())
        };
        read().unwrap_err().to_string()
    }

    #[test]
    fn a_table_is_read_by_its_names_whatever_wrote_it() {
        let text = "\u{feff}name, speed_m_s ,time_s,more\r\n# a comment\r\n\"a, b\",NaN,+1,x\r\n\r\nc,5e1,2,y";
        let mut table = Table::open("a.csv", text, &COLUMNS, true).unwrap();
        assert_eq!(table.header.others().collect::<Vec<_>>(), [(3, "more")]);
        let row = table.next_row().unwrap().unwrap();
        assert_eq!(
            (row.needed(0), row.name(1), row.line),
            (Ok(1.0), Ok("a, b"), 3)
        );
        assert_eq!((row.number(2), row.cell(3)), (Ok(None), "x"));
        let row = table.next_row().unwrap().unwrap();
        assert_eq!(
            (row.needed(0), row.number(2), row.line),
            (Ok(2.0), Ok(Some(50.0)), 5)
        );
        assert!(table.next_row().unwrap().is_none());
    }

    #[test]
    fn errors_name_file_line_column_and_what_was_expected() {
        for (text, expected) in [
            (
                " \n",
                "a.csv: line 1: the file is empty; expected a header with time_s, name",
            ),
            (
                "time_s;name\n",
                "column time_s: missing; the header has time_s;name; expected a header with time_s, name, separated by commas",
            ),
            (
                "time_s,name,name\n",
                "line 1, column name: named twice in the header; expected every column once",
            ),
            (
                "time_s,name\n",
                "line 2: no rows below the header; expected at least one row",
            ),
            (
                "time_s,name\n1\n",
                "line 2: 1 cells; expected 2 cells, as in the header",
            ),
            (
                "time_s,name\n1,a\n,a\n",
                "line 3, column time_s: found \"\"; expected a finite number",
            ),
            ("time_s,name\ninf,a\n", "column time_s: found \"inf\""),
            (
                "time_s,name\n1,\n",
                "column name: found \"\"; expected a name",
            ),
            (
                "time_s,name,speed_m_s\n1,a,81\n",
                "found \"81\"; expected a number from 0 to 80",
            ),
        ] {
            let error = error(text);
            assert!(error.contains(expected), "{error}");
        }
    }

    #[test]
    fn records_are_lines_of_cells_with_their_numbers() {
        let read = |text: &str, delimiter| {
            let mut records = Records::new(text.as_bytes(), delimiter, 7, true);
            let mut all = Vec::new();
            while let Some(line) = records.next_line().unwrap() {
                let cells = records.cells.iter().map(text_of);
                all.push((line, cells.collect::<Vec<_>>()));
            }
            all
        };
        fn text_of(cell: &[u8]) -> String {
            text(cell).to_owned()
        }
        let two = |a: &str, b: &str| vec![a.to_owned(), b.to_owned()];
        let expected = |second| [(7, two("1", "a")), (second, two("2", "b"))];
        let semicolons = Delimiter::Byte(b';');
        assert_eq!(read("1; a \n2;\"b\"\n", semicolons), expected(8));
        assert_eq!(read("  1 \t a\n# x\n2 b", Delimiter::Space), expected(9));
        assert_eq!(Cells::of(b"1,\" x\"", Delimiter::Byte(b',')).get(1), b"x");
    }

    #[test]
    fn numbers_are_finite_with_a_point_or_a_comma() {
        assert_eq!(
            (number(b"43,5", true), number(b"43,5", false)),
            (Some(43.5), None)
        );
        assert_eq!(
            (number(b"inf", false), number(b"+2", false)),
            (None, Some(2.0))
        );
        assert!(has_decimal_comma(b"-7,86") && !has_decimal_comma(b"7.86"));
        assert!(!has_decimal_comma(b"1,2,3"));
    }
}
