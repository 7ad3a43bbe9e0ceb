//! Every test of `sc` outside its source, in one executable.

#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    reason = "a test may fail by a panic"
)]

mod common;
mod mission;
mod safety;
mod take_off;
