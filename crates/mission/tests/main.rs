//! Every test of `mission` outside its source, in one executable.

#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    reason = "a test may fail by a panic"
)]

mod airborne;
mod guardian;
mod outer_loop;
mod plan;
mod preflight;
mod stack;
mod team;
mod terrain;
