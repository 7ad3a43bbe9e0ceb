//! Every test of `record` outside its source, in one executable.

#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    reason = "a test may fail by a panic"
)]

mod export;
mod outputs;
mod recording;
mod synthetic;
