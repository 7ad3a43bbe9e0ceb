//! Every test of `gap-bench` outside its source, in one executable.

#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    reason = "a test may fail by a panic"
)]

#[path = "../../../tests/bar/mod.rs"]
mod bar;
mod families;
mod flight_estimate;
mod flight_onset;
mod flight_share;
mod options;
mod share;
