//! File formats of other people's tools, described once for those who read and those who write them.
//!
//! Bytes come in and go out; this crate knows no files and nothing of missions.
//!
//! - [`cdr`]: messages of ROS 2 in bytes;
//! - [`mcap_records`]: the records of an MCAP file, also of one that is damaged or cut short;
//! - [`netcdf`]: NetCDF in its classic form;
//! - [`table`]: columns as CSV and as Parquet.

pub mod cdr;
pub mod mcap_records;
pub mod netcdf;
pub mod table;
