//! Where rows go: into CSV text, or into a table.

use crate::ImportError;
use crate::in_order::{Done, InOrder, Stamps};
use crate::map::Output;
use crate::quantity::Quantity;
use std::io::Write;

/// Takes rows.
pub trait Sink {
    /// Takes a row: its time, its platform by name, and one value a column, NaN where there is none.
    ///
    /// # Errors
    /// The row cannot be written.
    fn row(&mut self, time_s: f64, platform: &str, values: &[f64]) -> Result<(), ImportError>;
}

/// Decimals of times: microseconds, which a double of today's date still holds.
const TIME_DECIMALS: u8 = 6;

/// Writes rows as CSV text: observations, or a flight, which has no platform.
pub struct CsvSink<W> {
    out: W,
    line: Vec<u8>,
    output: Output,
    number: zmij::Buffer,
}

impl<W: Write> CsvSink<W> {
    /// Begins with the header of `columns`.
    ///
    /// # Errors
    /// The header cannot be written.
    pub fn new(mut out: W, output: Output, columns: &[&Quantity]) -> Result<Self, ImportError> {
        let mut header = match output {
            Output::Observations => "time_s,platform".to_owned(),
            Output::Flight => "time_s".to_owned(),
        };
        for column in columns {
            header.push(',');
            header.push_str(column.name);
        }
        header.push('\n');
        out.write_all(header.as_bytes())
            .map_err(ImportError::bytes("output"))?;
        Ok(Self {
            out,
            line: Vec::new(),
            output,
            number: zmij::Buffer::new(),
        })
    }

    /// Ends the text.
    ///
    /// # Errors
    /// What waits cannot be written.
    pub fn finish(mut self) -> Result<W, ImportError> {
        self.out.flush().map_err(ImportError::bytes("output"))?;
        Ok(self.out)
    }

    fn push(&mut self, value: f64) {
        if value.is_finite() {
            let text = self.number.format_finite(value);
            let text = text.strip_suffix(".0").unwrap_or(text);
            self.line.extend_from_slice(text.as_bytes());
        }
    }
}

impl<W: Write> Sink for CsvSink<W> {
    fn row(&mut self, time_s: f64, platform: &str, values: &[f64]) -> Result<(), ImportError> {
        self.line.clear();
        self.push(crate::number::rounded(time_s, TIME_DECIMALS));
        if self.output == Output::Observations {
            self.line.push(b',');
            push_text(&mut self.line, platform);
        }
        for value in values {
            self.line.push(b',');
            self.push(*value);
        }
        self.line.push(b'\n');
        self.out
            .write_all(&self.line)
            .map_err(ImportError::bytes("output"))
    }
}

/// A text as a cell of CSV.
pub(crate) fn push_text(line: &mut Vec<u8>, text: &str) {
    if text.contains([',', '"', '\n', '\r']) {
        line.push(b'"');
        line.extend_from_slice(text.replace('"', "\"\"").as_bytes());
        line.push(b'"');
    } else {
        line.extend_from_slice(text.as_bytes());
    }
}

/// Rows held in memory.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Table {
    /// The columns.
    pub columns: Vec<&'static Quantity>,
    /// Time of each row, s.
    pub time_s: Vec<f64>,
    /// Platform of each row, by [`Table::platforms`].
    pub platform: Vec<usize>,
    /// Names of the platforms.
    pub platforms: Vec<String>,
    /// Values row by row, as many a row as there are columns; NaN where there is none.
    pub values: Vec<f64>,
}

impl Table {
    /// An empty table of these columns.
    pub fn new(columns: Vec<&'static Quantity>) -> Self {
        Self {
            columns,
            ..Self::default()
        }
    }

    /// Number of rows.
    pub fn len(&self) -> usize {
        self.time_s.len()
    }

    /// Whether there are no rows.
    pub fn is_empty(&self) -> bool {
        self.time_s.is_empty()
    }

    /// The values of a row.
    pub fn row(&self, row: usize) -> &[f64] {
        let width = self.columns.len();
        &self.values[row * width..(row + 1) * width]
    }

    /// All values of the column `name`, in order of rows.
    pub fn column(&self, name: &str) -> Option<Vec<f64>> {
        let at = self.columns.iter().position(|c| c.name == name)?;
        Some((0..self.len()).map(|r| self.row(r)[at]).collect())
    }

    /// Hands all rows to `sink` in order of time, those of one time in their order and spread by `stamps`.
    ///
    /// # Errors
    /// The sink's.
    pub fn write(&self, stamps: Stamps, sink: &mut dyn Sink) -> Result<Done, ImportError> {
        let mut rows: Vec<usize> = (0..self.len()).collect();
        rows.sort_by(|a, b| self.time_s[*a].total_cmp(&self.time_s[*b]));
        let mut order = InOrder::new(sink, "", stamps, self.columns.len(), false);
        for row in rows {
            let platform = order.platform(&self.platforms[self.platform[row]]);
            order.row(self.time_s[row], platform, self.row(row), 0)?;
        }
        order.finish().map(|(done, _)| done)
    }
}

impl Table {
    /// Adds a row.
    pub fn push(&mut self, time_s: f64, platform: &str, values: &[f64]) {
        let known = self.platforms.iter().rposition(|p| p == platform);
        let index = known.unwrap_or_else(|| {
            self.platforms.push(platform.to_owned());
            self.platforms.len() - 1
        });
        self.time_s.push(time_s);
        self.platform.push(index);
        self.values.extend_from_slice(values);
    }
}

impl Sink for Table {
    fn row(&mut self, time_s: f64, platform: &str, values: &[f64]) -> Result<(), ImportError> {
        self.push(time_s, platform, values);
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_are_written_with_as_many_digits_as_they_have() {
        let columns = ["lat_deg", "co2_ppm"].map(|n| Quantity::named(n).unwrap());
        let mut sink = CsvSink::new(Vec::new(), Output::Observations, &columns).unwrap();
        sink.row(1_714_557_600.25, "a,b", &[43.4417, f64::NAN])
            .unwrap();
        sink.row(0.1 + 0.2, "drone", &[-7.0, 421.0]).unwrap();
        let text = String::from_utf8(sink.finish().unwrap()).unwrap();
        assert_eq!(
            text,
            "time_s,platform,lat_deg,co2_ppm\n1714557600.25,\"a,b\",43.4417,\n0.3,drone,-7,421\n"
        );
    }
}
