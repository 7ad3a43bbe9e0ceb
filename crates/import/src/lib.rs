//! Converts logs of instruments, spreadsheets and autopilots to Plumage's observations and flights.
//!
//! Input is bytes; output is rows, notices of every assumption, and a mapping file that repeats the conversion. This
//! crate opens no files.

pub mod decode;
pub mod delimited;
pub mod height;
pub mod in_order;
pub mod join;
pub mod logs;
pub mod map;
pub mod number;
pub mod preset;
pub mod quantity;
pub mod recognise;
pub mod run;
pub mod series;
pub mod series_log;
pub mod sink;
pub mod time;
pub mod unit;

mod error;

pub use error::ImportError;
