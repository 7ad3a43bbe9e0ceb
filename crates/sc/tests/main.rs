//! Every test of `sc` outside its source, in one executable.

#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    reason = "a test may fail by a panic"
)]

mod common;
mod information;
mod mission;
mod passes;
mod safety;
mod take_off;
