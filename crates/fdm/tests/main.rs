//! Every test of `fdm` outside its source, in one executable.

#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    reason = "a test may fail by a panic"
)]

mod bad_aircraft;
mod flying;
mod jsbsim;
mod laws;
mod multirotor;
mod published;
mod tuning;
