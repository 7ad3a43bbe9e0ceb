//! Field data as people have it, read into Plumage's observations and flights.
//!
//! Bytes come in; rows, what was assumed on the way, and a mapping file that does the same again come out. This
//! crate knows no files.

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
