//! Every test of `scenario` outside its source, in one executable.

#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    reason = "a test may fail by a panic"
)]

mod contradiction;
mod observations;
mod peak;
mod scenario;
mod terrain;
