//! Every test of `import` outside its source, in one executable.

#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    reason = "a test may fail by a panic"
)]

mod common;
mod delimited;
mod field_logs;
mod instruments;
mod logs;
mod ros;
