//! File formats of other people's tools, described once for those who read and those who write them.
//!
//! Bytes come in and go out; this crate knows no files and nothing of missions.
//!
//! - [`binary`]: numbers in bytes;
//! - [`calendar`]: days of the Gregorian calendar and times of day, in UTC;
//! - [`cdr`]: messages of ROS 2 in bytes;
//! - [`delimited`]: CSV and its relatives, read row by row;
//! - [`mcap_records`]: the records of an MCAP file, also of one that is damaged or cut short;
//! - [`netcdf`]: NetCDF in its classic form;
//! - [`table`]: columns as CSV and as Parquet.

pub mod binary;
pub mod calendar;
pub mod cdr;
pub mod delimited;
pub mod mcap_records;
pub mod netcdf;
pub mod table;
