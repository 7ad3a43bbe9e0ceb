//! The rows of a log, one by one.

use super::layout::Delimiter;
use crate::ImportError;
use csv::ByteRecord;
use std::io::{BufRead as _, BufReader, Read};

/// Bytes that are read at a time.
const BUFFER: usize = 256 * 1024;

/// The cells of one row.
#[derive(Debug, Default)]
pub struct Cells(ByteRecord);

impl Cells {
    /// A cell without blanks around it; empty where the row has none.
    pub fn get(&self, at: usize) -> &[u8] {
        self.0.get(at).map_or(&[][..], <[u8]>::trim_ascii)
    }

    /// Whether the row holds nothing.
    pub fn is_blank(&self) -> bool {
        self.0.iter().all(|cell| cell.trim_ascii().is_empty())
    }
}

enum Source<'a> {
    Csv(Box<csv::Reader<Box<dyn Read + 'a>>>),
    Space(BufReader<Box<dyn Read + 'a>>, Vec<u8>),
}

/// Reads rows.
pub struct Records<'a> {
    source: Source<'a>,
    first_line: u64,
    line: u64,
    /// The row that was read last.
    pub cells: Cells,
}

impl<'a> Records<'a> {
    /// Rows of `bytes`, the first of which is `first_line` of the log. Lines that begin with `#` are comments.
    pub fn new(bytes: Box<dyn Read + 'a>, delimiter: Delimiter, first_line: u64) -> Self {
        let source = match delimiter {
            Delimiter::Byte(byte) => Source::Csv(Box::new(
                csv::ReaderBuilder::new()
                    .delimiter(byte)
                    .has_headers(false)
                    .flexible(true)
                    .comment(Some(b'#'))
                    .buffer_capacity(BUFFER)
                    .from_reader(bytes),
            )),
            Delimiter::Space => Source::Space(BufReader::with_capacity(BUFFER, bytes), Vec::new()),
        };
        Self {
            source,
            first_line,
            line: 0,
            cells: Cells::default(),
        }
    }

    /// Reads the next row of the log `name`; its line, or none at the end.
    ///
    /// # Errors
    /// Bytes that cannot be read.
    pub fn next(&mut self, name: &str) -> Result<Option<u64>, ImportError> {
        match &mut self.source {
            Source::Csv(reader) => {
                let more = reader.read_byte_record(&mut self.cells.0);
                let more = more.map_err(std::io::Error::other);
                if !more.map_err(ImportError::bytes(name))? {
                    return Ok(None);
                }
                self.line = self.cells.0.position().map_or(0, csv::Position::line);
            }
            Source::Space(reader, line) => loop {
                line.clear();
                let count = reader.read_until(b'\n', line);
                if count.map_err(ImportError::bytes(name))? == 0 {
                    return Ok(None);
                }
                self.line += 1;
                if line.first() == Some(&b'#') {
                    continue;
                }
                self.cells.0.clear();
                for cell in line
                    .split(u8::is_ascii_whitespace)
                    .filter(|c| !c.is_empty())
                {
                    self.cells.0.push_field(cell);
                }
                break;
            },
        }
        Ok(Some(self.first_line + self.line - 1))
    }
}
