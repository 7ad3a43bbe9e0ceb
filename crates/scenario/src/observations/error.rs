//! What makes a text no observations.

/// What makes a text no observations: where, what, and what would be right.
#[derive(Debug, Clone, thiserror::Error, PartialEq, Eq)]
pub enum ObservationError {
    /// No file was given.
    #[error("no observations: expected at least one CSV file")]
    NoFile,
    /// A file is not a table of observations: where, why, and what was expected.
    #[error(transparent)]
    Table(#[from] formats::delimited::TableError),
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
