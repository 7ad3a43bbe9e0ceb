//! File formats of third-party tools and of numbers, each described once for its readers and writers.
//!
//! Input and output are bytes; this crate opens no files and knows nothing of missions.
//!
//! - [`binary`]: numbers in bytes;
//! - [`calendar`]: days of the Gregorian calendar and times of day, in UTC;
//! - [`cdr`]: messages of ROS 2 in bytes;
//! - [`delimited`]: CSV and its relatives, read row by row;
//! - [`list`]: lists of names in a sentence;
//! - [`mcap_records`]: the records of an MCAP file, also of one that is damaged or cut short;
//! - [`netcdf`]: NetCDF in its classic form;
//! - [`number`]: numbers as text, to the digit that their uncertainty allows;
//! - [`table`]: columns as CSV and as Parquet.

pub mod binary;
pub mod calendar;
pub mod cdr;
pub mod delimited;
pub mod list;
pub mod mcap_records;
pub mod netcdf;
pub mod number;
pub mod table;
