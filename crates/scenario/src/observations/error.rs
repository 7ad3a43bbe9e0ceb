//! What makes a text no observations.

/// What makes a text no observations: where, what, and what would be right.
#[derive(Debug, Clone, thiserror::Error, PartialEq, Eq)]
pub enum ObservationError {
    /// No file was given.
    #[error("no observations: expected at least one CSV file")]
    NoFile,
    /// A file has no header.
    #[error(
        "{file}: line 1: the file is empty; expected a header with the columns time_s, platform, \
         lat_deg, lon_deg, alt_amsl_m and the readings, such as co2_ppm or ch4_ppb"
    )]
    Empty {
        /// Name of the file.
        file: String,
    },
    /// A file has a header and nothing below.
    #[error("{file}: line 2: no rows below the header; expected at least one reading")]
    NoRows {
        /// Name of the file.
        file: String,
    },
    /// The header lacks a column or names one twice.
    #[error("{file}: line {line}, column {column}: {what}; {expected}")]
    Header {
        /// Name of the file.
        file: String,
        /// Line of the header, from 1.
        line: u64,
        /// The column's name.
        column: String,
        /// What is wrong.
        what: String,
        /// What would be right.
        expected: String,
    },
    /// A line cannot be split into cells.
    #[error("{file}: line {line}: {what}; expected {expected}")]
    Line {
        /// Name of the file.
        file: String,
        /// Line, from 1.
        line: u64,
        /// What is wrong.
        what: String,
        /// What would be right.
        expected: String,
    },
    /// A cell does not hold what its column must.
    #[error("{file}: line {line}, column {column}: found \"{found}\"; expected {expected}")]
    Cell {
        /// Name of the file.
        file: String,
        /// Line, from 1.
        line: u64,
        /// The column's name.
        column: &'static str,
        /// The cell.
        found: String,
        /// What would be right.
        expected: &'static str,
    },
    /// The rows of one platform are not in order of time.
    #[error(
        "{file}: line {line}, column time_s: platform {platform} is at {time_s} s after it was at \
         {before_s} s; expected times that increase within a platform"
    )]
    TimeOrder {
        /// Name of the file.
        file: String,
        /// Line, from 1.
        line: u64,
        /// Name of the platform.
        platform: String,
        /// Time of this row, s, as printed.
        time_s: String,
        /// Time of the platform's row before, s, as printed.
        before_s: String,
    },
    /// A platform has two different rows of the same time.
    #[error(
        "{file}: line {line}, column time_s: platform {platform} has a second, different row at \
         {time_s} s (first in {first}); expected one row a platform and time"
    )]
    TimeRepeated {
        /// Name of the file.
        file: String,
        /// Line, from 1.
        line: u64,
        /// Name of the platform.
        platform: String,
        /// The time, s, as printed.
        time_s: String,
        /// File and line of the first row of this time.
        first: String,
    },
    /// No row has a reading.
    #[error("{files}: column {column}: missing in all {rows} rows; expected at least one reading")]
    NoReading {
        /// Names of the files.
        files: String,
        /// Name of the column.
        column: &'static str,
        /// Number of rows.
        rows: usize,
    },
    /// Times too far apart to be those of one record.
    #[error(
        "observations, column time_s: times from {from_s} to {to_s} s; expected one record, in seconds \
         of one clock, shorter than 400 days"
    )]
    TimeSpan {
        /// First time, s, as printed.
        from_s: String,
        /// Last time, s, as printed.
        to_s: String,
    },
}
